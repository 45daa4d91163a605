"""Plots of walls and of rays in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, angles, broadcast, finite_array, instance
from ...core.tables import axes_or_new, verbatim
from ..walls.wall import Wall

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from ..curves.curve import Curve

# Okabe and Ito's colours, which colour-blind readers can distinguish.
RAY_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
SOLID, LEVEL = "0.82", "0.5"
# Tolerance of curves, and distance below which points are merged, relative to the size of the plot: a tenth of a pixel
# at 1000 pixels.
OUTLINE_TOLERANCE = 1e-4
# Parts of the neighbouring cells beside the cell, and free space above it, in periods.
MARGIN, FREE = 0.12, 0.3
# Depths, in periods, between which both axes have the same scale. The plot of a shallower or deeper wall is stretched,
# and the label of the vertical axis gives the factor.
SHALLOWEST, DEEPEST = 0.04, 3.0
# Height over width of the plot of one cell of a stretched wall.
SHALLOW_SHAPE, DEEP_SHAPE = 0.55, 1.6
# Number of points above which an outline is drawn with a thin line.
FINE_POINTS = 2000
# Slope in the plot below which a ray leaves it sideways.
FLATTEST = 0.2
# Number of neighbouring cells, on either side, in which rays in an open wall are drawn.
MOST_CELLS = 2


def draw_wall(wall: Wall, x: ArrayLike = (), theta: ArrayLike = (), ax: Axes | None = None) -> Axes:
    """Draw one period of a wall, with the trajectories of the rays that enter at ``x`` with the angles ``theta``.

    Parameters
    ----------
    wall : Wall
    x, theta : array_like
        Entry points and incoming angles in (0, pi), radians; they broadcast, and may be empty.
    ax : matplotlib Axes, optional
        By default the axes of a new figure.

    Returns
    -------
    matplotlib Axes
        Lengths are in the units of the wall. A dot marks the entry of a ray, a ring its exit; a ray that does not
        escape ends in a cross. Both axes have the same scale if the depth is 0 or from 0.04 to 3 periods; otherwise
        the label of the vertical axis gives the factor by which y is stretched.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> draw_wall(geo.triangular_teeth(1.5), 0.25, np.pi / 2).get_ylabel()
    'y'
    >>> draw_wall(geo.triangular_teeth(3.1)).get_ylabel()
    'y, stretched 29.1 times'
    """
    instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
    entries, incoming = broadcast(x=finite_array("x", x), theta=angles("theta", theta))
    ax = axes_or_new(ax)
    free, floor = heights(wall)
    rays = [
        RayPath(wall, float(place), float(angle), free)
        for place, angle in zip(np.ravel(entries), np.ravel(incoming), strict=True)
    ]
    inside = np.concatenate([[0.0, 1.0], *(ray.points[:, 0] / wall.period for ray in rays)])
    first = max(int(np.floor(inside.min())), -MOST_CELLS)
    last = min(int(np.ceil(inside.max())), 1 + MOST_CELLS)
    draw_solid(ax, wall, range(first - 1, last + 1), floor)
    ax.axhline(0.0, color=LEVEL, linewidth=0.8, linestyle=":", zorder=1)
    for i, ray in enumerate(rays):
        _draw_ray(ax, ray, RAY_COLOURS[i % len(RAY_COLOURS)])
    left, right = (first - MARGIN) * wall.period, (last + MARGIN) * wall.period
    ax.set_xlim(left, right)
    ax.set_ylim(floor, free)
    across, upwards = axis_labels(wall)
    ax.set_xlabel(verbatim(across))
    ax.set_ylabel(verbatim(upwards))
    ax.set_aspect(vertical_stretch(wall))
    ax.locator_params(axis="both", nbins=6)
    return ax


def vertical_stretch(wall: Wall) -> float:
    """Return the scale of y over the scale of x: 1 unless the wall is very shallow or very deep.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> vertical_stretch(geo.flat()), vertical_stretch(geo.rectangular_teeth(1e4)) < 1
    (1.0, True)
    """
    if wall.depth == 0.0 or SHALLOWEST * wall.period <= wall.depth <= DEEPEST * wall.period:
        return 1.0
    free, floor = heights(wall)
    shape = SHALLOW_SHAPE if wall.depth < wall.period else DEEP_SHAPE
    return shape * (1.0 + 2.0 * MARGIN) * wall.period / (free - floor)


def axis_labels(wall: Wall) -> tuple[str, str]:
    """Return the labels of x and y: the unit of the wall, and the factor by which y is stretched."""
    factor = vertical_stretch(wall)
    words = f"stretched {factor:.3g} times" if factor >= 1.0 else f"compressed {1.0 / factor:.3g} times"
    upwards = f"y ({wall.unit})" if wall.unit else "y"
    upwards += "" if factor == 1.0 else f", {words}"
    return f"x ({wall.unit or 'length units of the wall'})", upwards


def heights(wall: Wall) -> tuple[float, float]:
    """Return y at the top and at the bottom of the plot."""
    shallow = 0.0 < wall.depth < SHALLOWEST * wall.period
    free = wall.depth if shallow else FREE * max(wall.period, wall.depth)
    return free, -wall.depth - 0.25 * free


class RayPath:
    """The path of one ray: the start of its arrival, its points in the wall, and the end of its departure."""

    def __init__(self, wall: Wall, x: float, theta: float, free: float) -> None:
        from ..tracing.tracing import trace, trajectory

        stretch = vertical_stretch(wall)
        result = trace(wall, x, theta)
        self.points = trajectory(wall, x, theta)
        self.arrival = self.points[0] + _up_to(free, theta, stretch)
        self.departure: Floats | None = None
        if bool(result.escaped):
            self.points[-1] = (float(result.x), 0.0)
            self.departure = self.points[-1] + _up_to(free, float(result.theta), stretch)
        ends = [] if self.departure is None else [self.departure]
        self.path = np.vstack([self.arrival, self.points, *ends])


def _up_to(height: float, theta: float, stretch: float) -> Floats:
    """Return the vector along theta that rises by ``height``, or by less if it is flat in the plot."""
    direction = np.array([np.cos(theta), np.sin(theta)])
    return np.asarray(height * direction / max(direction[1], FLATTEST * abs(direction[0]) / stretch))


def draw_solid(ax: Axes, wall: Wall, cells: Sequence[int], floor: float) -> None:
    """Draw the solid of some cells of a wall down to the height ``floor``."""
    # a tenth of a pixel in each direction
    step = OUTLINE_TOLERANCE * np.array([wall.period, -floor])
    outline = _thinned(wall.outline(float(step.min())), step)
    pen = 1.2 if len(outline) <= FINE_POINTS else 0.6
    # the last point of a cell is the first point of the next cell
    path = np.concatenate([*(outline[:-1] + np.array([k * wall.period, 0.0]) for k in cells), outline[-1:]])
    path[-1, 0] = (cells[-1] + 1) * wall.period
    below = np.array([[path[-1, 0], floor], [path[0, 0], floor]])
    solid = np.vstack([path, below])
    ax.fill(solid[:, 0], solid[:, 1], color=SOLID, linewidth=0, zorder=1)
    ax.plot(path[:, 0], path[:, 1], color="black", linewidth=pen, zorder=2, solid_joinstyle="round")
    for island in wall.islands:
        loop = _loop(island, float(step.min()))
        for k in cells:
            ax.fill(
                loop[:, 0] + k * wall.period, loop[:, 1], facecolor=SOLID, edgecolor="black", linewidth=1.2, zorder=2
            )


def _loop(island: Sequence[Curve], tolerance: float) -> Floats:
    return np.vstack([piece.flattened(tolerance) for piece in island])


def _thinned(points: Floats, step: Floats) -> Floats:
    """Remove points in the same rectangle of sides ``step`` as their predecessor; a wall may have 10^5 pieces."""
    cells_of = np.floor(points / step)
    keep = np.any(cells_of[1:] != cells_of[:-1], axis=1)
    keep[-1] = True
    return np.asarray(points[np.concatenate([[True], keep])])


def _draw_ray(ax: Axes, ray: RayPath, colour: str) -> None:
    """Draw one trajectory: the path with arrows in and out, a dot at the entry, and a ring at the exit."""
    ax.plot(ray.path[:, 0], ray.path[:, 1], color=colour, linewidth=1.1, zorder=3)
    style = {"arrowstyle": "-|>", "color": colour, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 13.0}
    arrows = [(ray.arrival, ray.points[0], 0.55)]
    ax.plot(*ray.points[0], "o", color=colour, markersize=4.5, zorder=4)
    if ray.departure is None:
        ax.plot(*ray.points[-1], "x", color=colour, markersize=7, zorder=4)
    else:
        ax.plot(*ray.points[-1], "o", markersize=5.5, mfc="white", mec=colour, mew=1.3, zorder=4)
        arrows.append((ray.points[-1], ray.departure, 0.8))
    for start, end, fraction in arrows:
        tail, tip = start + (fraction - 0.05) * (end - start), start + fraction * (end - start)
        ax.annotate("", xy=tuple(tip), xytext=tuple(tail), arrowprops=style, zorder=4, annotation_clip=True)
