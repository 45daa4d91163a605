"""The collision law of two rough disks, in the limit of small roughness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, common_shape, instance, shaped
from ...core.errors import InputError
from ...core.given import seed_by_name
from ...geometry import Disk, Wall
from ..collisions.collision_law import CollisionLaw
from ..laws.law import Law, specular

# Tolerance for the length 1 of normals.
UNIT_TOLERANCE = 1e-9


@dataclass(frozen=True)
class PairLaw:
    r"""The law of the collision of two rough disks with each other.

    The pair behaves like one disk at a fixed wall. The *reduced disk* has mass (1/m1 + 1/m2)^(-1) and, with
    M = J/r^2 = ``rim_mass``, the mass (1/M1 + 1/M2)^(-1) at its rim. Its velocity is the relative velocity of the
    centres and the sum r1 omega1 + r2 omega2; the tangent is seen with the second disk below. The roughness sees the
    reduced disk's foreshortening. The collision conserves the momentum, the angular momentum about any point, and the
    energy.

    Parameters
    ----------
    law : Law
        P~, the law of the *foreshortened* roughness of both rims; `from_wall` foreshortens.
    first, second : Disk
        The disks; ``second`` is by default equal to ``first``. The law does not depend on their radii.

    Raises
    ------
    InputError
        If an argument is of another kind.

    Notes
    -----
    Source: Rudzis 2022, sections 1.1.2 and 3: Proposition 3.2 for the impulse, with the conservation law of Proposition
    3.3 corrected to the *total* angular momentum. For m2, J2 -> infinity it is `CollisionLaw` of the first disk.

    Examples
    --------
    A no-slip disk without spin hits an equal one at rest, with normal and tangential velocity 1:

    >>> from asperity import geometry as geo, kernels as ker
    >>> pair = ker.PairLaw(ker.retroreflection(), geo.Disk(1.0, 0.5))
    >>> first, second = pair.sample([0.0, 1.0], [1.0, -1.0, 0.0], [0.0, 0.0, 0.0])
    >>> ((3 * first).round(12) + 0.0).tolist(), ((3 * second).round(12) + 0.0).tolist()
    ([2.0, 0.0, -2.0], [1.0, -3.0, -2.0])
    """

    law: Law
    first: Disk
    second: Disk | None = None

    def __post_init__(self) -> None:
        instance("first", self.first, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
        if self.second is None:
            object.__setattr__(self, "second", self.first)
        instance("second", self.second, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
        # refuses what is no law of angles, and other frames
        _ = self.reduced_law

    @classmethod
    def from_wall(cls, wall: Wall, first: Disk, second: Disk | None = None) -> PairLaw:
        """Return the law of a pair whose relative roughness is a wall: the law of the foreshortened wall.

        Source: Rudzis 2022, section 1.3.7, for the reduced disk.
        """
        instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
        reduced = cls(specular(), first, second).reduced_disk
        return cls(CollisionLaw.from_wall(wall, reduced).law, first, second)

    @property
    def disks(self) -> tuple[Disk, Disk]:
        """Both disks."""
        return self.first, self.second or self.first

    @property
    def reduced_disk(self) -> Disk:
        """The disk of radius 1 at a fixed wall that behaves like the pair."""
        one, two = self.disks
        mass = 1.0 / (1.0 / one.mass + 1.0 / two.mass)
        return Disk(mass, 1.0 / (mass / one.rim_mass + mass / two.rim_mass))

    @property
    def reduced_law(self) -> CollisionLaw:
        """The collision law of the reduced disk."""
        return CollisionLaw(self.law, self.reduced_disk)

    @seed_by_name
    def sample(
        self, normal: ArrayLike, first_velocity: ArrayLike, second_velocity: ArrayLike, rng: Rng = None
    ) -> tuple[Floats, Floats]:
        """Draw the velocities after collisions.

        Parameters
        ----------
        normal : array_like, shape (..., 2)
            Unit vectors from the second to the first centre.
        first_velocity, second_velocity : array_like, shape (..., 3)
            (v1, v2, r omega) of both disks in fixed axes, approaching each other.
        rng : None, int or numpy.random.Generator

        Returns
        -------
        (array, array), each of shape (..., 3)

        Raises
        ------
        InputError
            If a shape is wrong, a normal does not have length 1, or disks do not approach each other.
        """
        up, one, two = self._checked(normal, first_velocity, second_velocity)
        along = np.stack([up[..., 1], -up[..., 0]], axis=-1)
        relative = one[..., :2] - two[..., :2]
        disk1, disk2 = self.disks
        before = np.stack([np.sum(relative * along, -1), np.sum(relative * up, -1), one[..., 2] + two[..., 2]], axis=-1)
        if not np.all(before[..., 1] < 0.0):
            raise InputError("velocities: expected disks that approach each other along the normal; check its sign")
        mass = self.reduced_disk.mass
        change = mass * (self.reduced_law.sample(before, rng=rng)[..., :2] - before[..., :2])
        impulse = change[..., :1] * along + change[..., 1:] * up
        spun = change[..., :1]
        return (
            one + np.concatenate([impulse / disk1.mass, spun / disk1.rim_mass], axis=-1),
            two + np.concatenate([-impulse / disk2.mass, spun / disk2.rim_mass], axis=-1),
        )

    @staticmethod
    def _checked(normal: ArrayLike, first: ArrayLike, second: ArrayLike) -> tuple[Floats, Floats, Floats]:
        up = shaped("normal", normal, "...", 2)
        one, two = shaped("first_velocity", first, "...", 3), shaped("second_velocity", second, "...", 3)
        if np.any(np.abs(np.hypot(up[..., 0], up[..., 1]) - 1.0) > UNIT_TOLERANCE):
            raise InputError("normal: expected unit vectors from the second to the first centre")
        shape = common_shape(normal=up[..., 0], first_velocity=one[..., 0], second_velocity=two[..., 0])
        return tuple(np.broadcast_to(a, (*shape, a.shape[-1])) for a in (up, one, two))  # type: ignore[return-value]
