"""Collision laws of walls of a container whose roughness changes along them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, finite_array, generator, instance
from ...core.errors import InputError
from ...core.estimates import Summary
from ...geometry import Disk
from ..bases.given import seed_by_name
from ..collisions.collision_law import CollisionLaw
from ..positions.position_law import PositionLaw

if TYPE_CHECKING:
    from ...geometry import Container

# Arc lengths have rounding errors of this size, relative to that of the wall.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class CollisionAlongWall(Summary):
    r"""The collision law delta_x (x) P~(x, .) (x) delta_{pi - psi} of a disk and a wall whose cell changes along it.

    Parameters
    ----------
    law : PositionLaw
        P~(x, .), already that of the foreshortened walls. On a curve of a container x is the arc length from the start
        of the curve, and the edges run from 0 to its length. On a straight wall without ends x is the coordinate along
        the tangent from the point of the wall, and the law is repeated periodically.
    disk : Disk

    Raises
    ------
    InputError
        If an argument is not as described.

    Source: Rudzis 2022, sections 1.2.5 and 1.3.7.

    Examples
    --------
    A floor that is smooth for x < 1 and no-slip beyond:

    >>> from asperity import geometry as geo, kernels as ker
    >>> floor = ker.PositionLaw([0.0, 1.0, 2.0], [ker.specular(), ker.retroreflection()])
    >>> K = ker.CollisionAlongWall(floor, geo.Disk(1.0, 1.0))
    >>> (K.sample_at([0.5, 1.5], [[1.0, -1.0, 0.0], [1.0, -1.0, 0.0]], rng=0).round(12) + 0.0).tolist()
    [[1.0, 1.0, 0.0], [0.0, 1.0, -1.0]]
    """

    law: PositionLaw
    disk: Disk
    parts: tuple[CollisionLaw, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        instance("law", self.law, PositionLaw, "ker.PositionLaw([0, 1], [ker.specular()])")
        instance("disk", self.disk, Disk, "geo.Disk()")
        object.__setattr__(self, "parts", tuple(CollisionLaw(law, self.disk) for law in self.law.laws))

    @seed_by_name
    def sample_at(self, x: ArrayLike, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing velocity (n, 3) for every incoming one with v2 < 0 at the positions x (n,)."""
        at, incoming = finite_array("x", x), finite_array("velocity", velocity)
        if at.ndim != 1 or incoming.shape != (len(at), 3):
            raise InputError(f"velocity: expected shape (n, 3) for n positions, got {incoming.shape} for {at.shape}")
        source, where = generator(rng), self.law.interval(at)
        outgoing = np.empty(incoming.shape)
        for k, part in enumerate(self.parts):
            here = where == k
            if here.any():
                outgoing[here] = part.sample(incoming[here], source)
        return outgoing

    def check_wall(self, container: Container, wall: int) -> None:
        """Raise an InputError if the wall is a curve and the edges do not run from 0 to its length."""
        curve = wall - len(container.points)
        if curve < 0:
            return
        length = container.curves[curve].length
        first, last = float(self.law.edges[0]), float(self.law.edges[-1])
        if max(abs(first), abs(last - length)) > ROUNDING * length:
            raise InputError(
                f"law: expected edges from 0 to {length!r}, the length of wall {wall}, got from {first!r} to {last!r}"
            )

    def coordinate(self, container: Container, wall: int, position: Floats) -> Floats:
        """The coordinates x (n,) of points (n, 2) on a wall, within the edges of the law."""
        (first, last), position = self.law.edges[[0, -1]], finite_array("position", position)
        if wall < len(container.points):
            along = (position - container.points[wall]) @ container.tangents[wall]
            return np.asarray(first + np.mod(along - first, last - first))
        return np.clip(container.length_on(wall, position), first, last)
