"""The picture of a height map: shaded relief with contours, and the paths of rays seen from above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...core.checks import Floats
from ...core.tables import axes_or_new, verbatim

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

# As of walls: Okabe and Ito's, which colour-blind readers can distinguish.
RAY_COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
CONTOURS = 8
# Direction to the light, and slope of a facet after the relief is exaggerated or flattened, root mean squared.
LIGHT, RELIEF = np.array([-0.5, 0.5, np.sqrt(0.5)]), 0.7
# Rays that leave the map by more than this many periods are cut off.
MOST_PERIODS = 2
# Least points of the picture along the longer side: coarse maps show their facets.
LEAST_POINTS = 400


Spacing = tuple[float, float]


def draw_surface(
    heights: Floats, spacing: Spacing, unit: str, paths: Sequence[tuple[Floats, bool]], ax: Axes | None
) -> Axes:
    """Draw a map with the points of rays on it, each with whether the ray escaped; see ``Surface.plot``."""
    ax = axes_or_new(ax)
    periods = np.array(spacing) * heights.shape
    ends = np.concatenate([[[0.5, 0.5]], *(path[:, :2] / periods for path, _ in paths)])
    first, last = (
        np.clip(np.floor(one), -MOST_PERIODS, MOST_PERIODS).astype(int) for one in (ends.min(0), ends.max(0))
    )
    (left, low), (right, high) = first * periods, (last + 1) * periods
    z, shade = (np.tile(one, last - first + 1) for one in _relief(heights, spacing))
    box = (left, right, low, high)
    picture = ax.imshow(z.T, origin="lower", extent=box, cmap="cividis", aspect="equal")
    ax.imshow(shade.T, origin="lower", extent=box, cmap="gray", alpha=0.4, vmin=0.0, vmax=1.0, aspect="equal")
    if np.ptp(z) > 0.0:
        across, along = (np.linspace(a, b, k, endpoint=False) + 0.5 * (b - a) / k
                         for a, b, k in ((left, right, z.shape[0]), (low, high, z.shape[1])))  # fmt: skip
        ax.contour(across, along, z.T, CONTOURS, colors="black", linewidths=0.4, alpha=0.6)
    colours = ax.figure.colorbar(picture, ax=ax, shrink=0.8)
    unit = f" ({unit})" if unit else ""
    colours.set_label(verbatim(f"height{unit}"))
    for number, (path, escaped) in enumerate(paths):
        colour = RAY_COLOURS[number % len(RAY_COLOURS)]
        ax.plot(*path[:, :2].T, color="white", linewidth=2.6, zorder=3)
        ax.plot(*path[:, :2].T, color=colour, linewidth=1.3, zorder=4)
        hits = path[1:-1] if escaped else path[1:]
        ax.plot(*hits[:, :2].T, ".", color=colour, markersize=4, zorder=5)
        ax.plot(*path[0, :2], "o", color=colour, markersize=6, mec="white", zorder=5)
        ax.plot(*path[-1, :2], "o" if escaped else "x", markersize=6, mfc="white", mec=colour, mew=1.5, zorder=5)
    ax.set_xlim(left, right)
    ax.set_ylim(low, high)
    ax.set_xlabel(verbatim(f"x{unit}"))
    ax.set_ylabel(verbatim(f"y{unit}"))
    return ax


def _relief(z: Floats, spacing: Spacing) -> tuple[Floats, Floats]:
    """Heights and brightness of the facets at the points of a picture of one period."""
    finer = -(-LEAST_POINTS // max(z.shape))
    i, j = np.ix_(*(np.arange(count * finer) // finer for count in z.shape))
    p, q = np.ix_(*((np.arange(count * finer) % finer + 0.5) / finer for count in z.shape))
    upper, n, m = q > p, *z.shape
    here, far = z[i, j], z[(i + 1) % n, (j + 1) % m]
    corner = np.where(upper, z[i, (j + 1) % m], z[(i + 1) % n, j])
    along_x, along_y = np.where(upper, far - corner, corner - here), np.where(upper, corner - here, far - corner)
    slope_x, slope_y = along_x / spacing[0], along_y / spacing[1]
    factor = RELIEF / (np.sqrt(np.mean(slope_x**2 + slope_y**2)) or 1.0)
    slope_x, slope_y = factor * slope_x, factor * slope_y
    lit = (LIGHT[2] - LIGHT[0] * slope_x - LIGHT[1] * slope_y) / np.sqrt(1.0 + slope_x**2 + slope_y**2)
    return here + along_x * p + along_y * q, np.maximum(lit, 0.0)
