"""The collision law of the true disk with random position and angle, and its plot beside the limit law."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, finite_array, generator, shaped, whole_number
from ...core.errors import AccuracyError, InputError
from ...core.given import seed_by_name
from ...core.tables import axes_or_new
from ...geometry import Disk, Wall, collide, trace
from ...geometry.collisions.configuration_space import ConfigurationSpace
from ...geometry.collisions.rigid import in_radii

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# Draws of a position at most. Contacts that double precision cannot resolve are drawn again.
MOST_DRAWS = 20
# Colours of the scales, and points drawn for each of them.
COLOURS, DRAWN = ("#E69F00", "#0072B2", "#D55E00", "#009E73"), 1500


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
        space = ConfigurationSpace(self.wall, in_radii(self.disk), self.scale, self.spacing)
        object.__setattr__(self, "spacing", space.spacing)

    @seed_by_name
    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing velocity (n, 3) for every incoming one with v2 < 0.

        Raises
        ------
        AccuracyError
            If a disk does not come back from the wall in 20 draws of its position.
        """
        moving = shaped("velocity", velocity, "n", 3)
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

        assert self.spacing is not None
        out, rest = np.full(moving.shape, np.nan), np.arange(len(moving))
        disk = in_radii(self.disk)
        for _ in range(MOST_DRAWS):
            if not len(rest):
                break
            position = rng.random((len(rest), 2)) * [self.scale * self.wall.period, self.spacing]
            hit = collide(disk, self.wall, self.scale, position, moving[rest], self.spacing)
            out[rest[hit.escaped]] = hit.velocity[hit.escaped]
            rest = rest[~hit.escaped]
        return out

    def draw_limit(
        self,
        angles: tuple[float, float],
        rng: Rng = None,
        *,
        scales: ArrayLike | None = None,
        samples: int = 20_000,
        ax: Axes | None = None,
    ) -> Axes:
        """Draw outgoing (theta', psi') at one or several scales, and the support of the limit law.

        Parameters
        ----------
        angles : (float, float)
            Incoming (theta, psi), radians.
        rng : None, int or numpy.random.Generator
        scales : array_like, optional
            At most four values of eps, each with its default spacing; by default the scale of this law alone.
        samples : int
            Collisions at each scale.
        ax : matplotlib Axes, optional

        Returns
        -------
        matplotlib Axes
            Dots show the two angles; the dotted line is psi' = pi - psi. Lines, on the right axis, are the distribution
            functions of theta'.

        Raises
        ------
        InputError
            If there are more than four scales, or a number is out of range.

        Examples
        --------
        >>> from asperity import geometry as geo
        >>> law = SatelliteLaw(geo.focusing_arcs(1.2), geo.Disk(), 1e-3)
        >>> law.draw_limit((1.0, 1.2), np.random.default_rng(1), samples=50).get_xlabel()
        "theta' (radians)"
        """

        rng = generator(rng)
        whole_number("samples", samples, 1)
        eps = np.atleast_1d(finite_array("scales", self.scale if scales is None else scales))
        if eps.ndim > 1 or eps.size > len(COLOURS):
            raise InputError(f"scales: expected at most {len(COLOURS)} numbers, got shape {eps.shape}")
        laws = [self] if scales is None else [SatelliteLaw(self.wall, self.disk, float(scale)) for scale in eps]
        theta, psi = angles
        ax = axes_or_new(ax)
        right = ax.twinx()
        velocity = np.tile(-self.disk.from_angles(theta, psi), (samples, 1))
        fractions = (np.arange(samples) + 0.5) / samples
        for colour, law in zip(COLOURS, laws, strict=False):
            out, rolled = self.disk.to_angles(law.sample(velocity, rng))
            ax.plot(out[:DRAWN], rolled[:DRAWN], ".", color=colour, markersize=2.0, alpha=0.6, zorder=2)
            label = f"true disk, eps = {law.scale:g}"
            right.plot(np.sort(out), fractions, color=colour, linewidth=1.4, label=label, zorder=3)
        target = self.wall.foreshorten(self.disk)
        limit = np.sort(trace(target, target.period * fractions, theta).theta)
        right.plot(limit, fractions, color="black", linewidth=1.0, linestyle="--", label="limit law", zorder=4)
        ax.axhline(math.pi - psi, color="black", linewidth=0.8, linestyle=":")
        ax.set_xlim(0.0, math.pi)
        ax.set_xlabel("theta' (radians)")
        ax.set_ylabel("psi' (radians; dots)")
        right.set_ylabel("distribution function of theta' (lines)")
        # distribution functions do not reach this corner; the frame separates the text from the dots
        right.legend(loc="lower right", fontsize="small", framealpha=0.9)
        return ax
