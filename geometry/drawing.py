"""Pictures of walls and of rays in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..checks import angles, finite_array
from .tracing import trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .wall import Wall

# Okabe and Ito's colours, which stay apart for colour-blind readers.
RAY_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
SOLID = "0.82"
OUTLINE_TOLERANCE = 1e-3
FREE_SHARE = 0.35


def draw_wall(wall: Wall, x: ArrayLike = (), theta: ArrayLike = (), ax: Axes | None = None) -> Axes:
    """Draw one period of a wall, with the trajectories of the rays that enter at ``x`` with the angles ``theta``.

    Parameters
    ----------
    wall : Wall
    x, theta : array_like
        Entry points and incoming angles in (0, pi); they broadcast, and may be empty.
    ax : matplotlib Axes, optional
        A new figure is made if there is none.

    Returns
    -------
    matplotlib Axes
        Lengths are in the units of the wall; both axes have the same scale unless the wall is very flat.
    """
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").subplots()
    outline = wall.outline(OUTLINE_TOLERANCE * wall.period)
    height = FREE_SHARE * max(wall.depth, 0.3 * wall.period)
    floor = -wall.depth - 0.25 * height
    solid = np.vstack([outline, [wall.period, floor], [0.0, floor]])
    ax.fill(solid[:, 0], solid[:, 1], color=SOLID, linewidth=0)
    ax.plot(outline[:, 0], outline[:, 1], color="black", linewidth=1.2)
    for island in wall.islands:
        points = np.vstack([piece.flattened(OUTLINE_TOLERANCE * wall.period) for piece in island])
        ax.fill(points[:, 0], points[:, 1], facecolor=SOLID, edgecolor="black", linewidth=1.2)
    ax.axhline(0.0, color="0.5", linewidth=0.8, linestyle=":")
    places, incoming = np.broadcast_arrays(finite_array("x", x), angles("theta", theta))
    for i, (place, angle) in enumerate(zip(np.ravel(places), np.ravel(incoming), strict=True)):
        _draw_ray(ax, wall, float(place), float(angle), height, RAY_COLOURS[i % len(RAY_COLOURS)])
    ax.set_xlim(-0.02 * wall.period, 1.02 * wall.period)
    ax.set_ylim(floor, height)
    if wall.depth > 0.02 * wall.period:
        ax.set_aspect("equal")
    ax.set_xlabel("x (length units of the wall)")
    ax.set_ylabel("y")
    return ax


def _draw_ray(ax: Axes, wall: Wall, x: float, theta: float, height: float, colour: str) -> None:
    """One trajectory with its arrows: from above, through the wall, and out again."""
    points = trajectory(wall, x, theta)
    arrival = points[0] + height * np.array([np.cos(theta), np.sin(theta)]) / max(np.sin(theta), 0.2)
    parts = [arrival, *points]
    from .tracing import trace

    ray = trace(wall, x, theta)
    if bool(ray.escaped):
        outgoing = float(ray.theta)
        direction = np.array([np.cos(outgoing), np.sin(outgoing)])
        parts.append(points[-1] + height * direction / max(direction[1], 0.2))
    path = np.array(parts)
    ax.plot(path[:, 0], path[:, 1], color=colour, linewidth=1.1)
    for start, end in ((path[0], path[1]), (path[-2], path[-1])):
        ax.annotate(
            "", xy=0.45 * start + 0.55 * end, xytext=0.55 * start + 0.45 * end,
            arrowprops={"arrowstyle": "-|>", "color": colour},
        )  # fmt: skip
