"""The collision law of the true disk with random position and angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, finite_array, generator
from ...core.errors import AccuracyError
from ..bases.given import seed_by_name

if TYPE_CHECKING:
    from ...geometry import Disk, Wall

# Draws of a position at most. Contacts that double precision cannot resolve are drawn again.
MOST_DRAWS = 20


@dataclass(frozen=True)
class SatelliteLaw:
    """The collision law K^{Sigma, eps} of the true disk, with x1 uniform in a cell and alpha in one spacing.

    Disks of status ``DiskStatus.AMPLIFIED`` count as all others that escape.

    Parameters
    ----------
    wall : Wall
        Not foreshortened.
    disk : Disk
    scale : float
        eps.
    spacing : float, optional
        rho; by default as in `geometry.collide`.

    Raises
    ------
    InputError
        As in `geometry.collide`.

    Examples
    --------
    >>> import numpy as np
    >>> from asperity import geometry as geo, kernels as ker
    >>> law = ker.SatelliteLaw(geo.flat(), geo.Disk(), scale=1e-12)
    >>> law.sample([[0.25, -1.0, 0.5]], np.random.default_rng(0)).round(3).tolist()
    [[0.25, 1.0, 0.5]]
    """

    wall: Wall
    disk: Disk
    scale: float
    spacing: float | None = None

    def __post_init__(self) -> None:
        from ...geometry.collisions.configuration_space import ConfigurationSpace

        object.__setattr__(self, "spacing", ConfigurationSpace(self.wall, self.disk, self.scale, self.spacing).spacing)

    @seed_by_name
    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing velocity (n, 3) for every incoming one with v2 < 0.

        Raises
        ------
        AccuracyError
            If a disk does not come back from the wall in 20 draws of its position.
        """
        moving = finite_array("velocity", velocity)
        out = self.attempt(moving, generator(rng))
        lost = np.flatnonzero(np.isnan(out[:, 0]))
        if lost.size:
            raise AccuracyError(
                f"{lost.size} disks did not come back from the wall in {MOST_DRAWS} draws of their position; row "
                f"{int(lost[0])} has the velocity {moving[lost[0]].tolist()}",
                lost.size / len(moving),
            )
        return out

    def attempt(self, moving: Floats, rng: np.random.Generator) -> Floats:
        """Draw outgoing velocities as `sample`, nan for disks that do not come back."""
        from ...geometry import collide

        assert self.spacing is not None
        out, rest = np.full(moving.shape, np.nan), np.arange(len(moving))
        for _ in range(MOST_DRAWS):
            if not len(rest):
                break
            position = rng.random((len(rest), 2)) * [self.scale * self.wall.period, self.spacing]
            hit = collide(self.disk, self.wall, self.scale, position, moving[rest], self.spacing)
            out[rest[hit.escaped]] = hit.velocity[hit.escaped]
            rest = rest[~hit.escaped]
        return out
