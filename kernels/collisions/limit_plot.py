"""A plot of the outgoing angles of the true disk and of its limit law."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Rng, finite_array, generator, whole_number
from ...core.errors import InputError
from .satellite_law import SatelliteLaw

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ...geometry import Disk, Wall

COLOURS = ("#E69F00", "#0072B2", "#D55E00", "#009E73")
# Points drawn per sample.
DRAWN = 1500


def draw_limit(
    disk: Disk,
    wall: Wall,
    scales: ArrayLike,
    angles: tuple[float, float],
    rng: Rng = None,
    samples: int = 20_000,
    ax: Axes | None = None,
) -> Axes:
    """Draw outgoing (theta', psi') of the true disk at several scales, and the support of the limit law.

    Parameters
    ----------
    disk : Disk
    wall : Wall
    scales : array_like
        Values of eps, at most four.
    angles : (float, float)
        Incoming (theta, psi), radians.
    rng : None, int or numpy.random.Generator
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
    >>> rng = np.random.default_rng(1)
    >>> draw_limit(geo.Disk(), geo.focusing_arcs(1.2), 1e-3, (1.0, 1.2), rng, samples=50).get_xlabel()
    "theta' (radians)"
    """
    from ...geometry import trace

    rng = generator(rng)
    whole_number("samples", samples, 1)
    eps = np.atleast_1d(finite_array("scales", scales))
    if eps.ndim > 1 or eps.size > len(COLOURS):
        raise InputError(f"scales: expected at most {len(COLOURS)} numbers, got shape {eps.shape}")
    theta, psi = angles
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").subplots()
    right = ax.twinx()
    velocity = np.tile(-disk.from_angles(theta, psi), (samples, 1))
    fractions = (np.arange(samples) + 0.5) / samples
    for colour, scale in zip(COLOURS, eps, strict=False):
        out, rolled = disk.to_angles(SatelliteLaw(wall, disk, float(scale)).sample(velocity, rng))
        ax.plot(out[:DRAWN], rolled[:DRAWN], ".", color=colour, markersize=2.0, alpha=0.6, zorder=2)
        right.plot(np.sort(out), fractions, color=colour, linewidth=1.4, label=f"true disk, eps = {scale:g}", zorder=3)
    target = wall.foreshorten(disk)
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
