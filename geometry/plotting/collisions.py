"""Plots of the disk with satellites: the path of a collision, and a section of the configuration space."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, number_between, positive_number
from ...core.errors import InputError
from ..collisions.configuration_space import ConfigurationSpace
from ..collisions.rigid import collide
from ..collisions.transversality import shadow
from ..disk.disk import Disk
from ..walls.wall import Wall
from .walls import LEVEL, OUTLINE_TOLERANCE, RAY_COLOURS, SOLID

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Number of points on a satellite's nearly straight path between two contacts.
FLIGHT_POINTS = 40
# Free space shown above the tops, in depths of the wall, and cells shown beside the contacts.
FREE, MARGIN = 1.0, 1.0
# Pixels per side of a section of the configuration space.
SECTION = 500
MOST_CONTACTS = 200


def collision_path(
    disk: Disk, wall: Wall, scale: float, position: ArrayLike, velocity: ArrayLike, spacing: float | None = None
) -> Floats:
    """Return the configurations (x1, x2, alpha) of one disk at height 0, at k contacts, and at height 0 again.

    Parameters
    ----------
    disk, wall, scale, spacing
        As in `collide`.
    position : array_like, shape (2,)
    velocity : array_like, shape (3,)

    Returns
    -------
    ndarray, shape (k + 2, 3)

    Raises
    ------
    InputError
        As in `collide`, and if the disk does not come back or has more than 200 contacts.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> path = collision_path(geo.Disk(), geo.triangular_teeth(2.0), 0.01, [0.0025, 0.0], [0.0, -1.0, 0.0])
    >>> path.shape, bool(path[0, 1] == 0.0), bool(path[1, 1] < 0.0), abs(float(path[-1, 1])) < 1e-15
    ((4, 3), True, True, True)
    """
    start, moving = finite_array("position", position)[None], finite_array("velocity", velocity)[None]
    whole = collide(disk, wall, scale, start, moving, spacing)
    contacts = int(whole.contacts[0])
    if not whole.escaped[0] or contacts > MOST_CONTACTS:
        state = next(name for name, count in whole.counts().items() if count)
        raise InputError(
            f"position, velocity: expected a disk that comes back after at most {MOST_CONTACTS} contacts, got {state} "
            f"after {contacts}"
        )
    # a run limited to k contacts ends at contact k + 1; the heights follow from the times
    states = [(start[0], moving[0], 0.0)]
    legs = [collide(disk, wall, scale, start, moving, spacing, max_contacts=k) for k in range(1, contacts)]
    states += [(leg.position[0], leg.velocity[0], float(leg.time[0])) for leg in [*legs, whole]]
    height, path = 0.0, [(*start[0], 0.0)]
    if contacts:
        first = _first_time(disk, wall, scale, start, moving, spacing, states[-1] if contacts == 1 else states[1])
        path.append((*(start[0] + moving[0, [0, 2]] * first), moving[0, 1] * first))
        height, before = moving[0, 1] * first, first
        for configuration, w, at in states[1:]:
            height += w[1] * (at - before)
            before = at
            path.append((*configuration, height))
    else:
        path.append((*whole.position[0], 0.0))
    return np.array([(x1, x2, alpha) for x1, alpha, x2 in path])


def _first_time(
    disk: Disk, wall: Wall, scale: float, start: Floats, moving: Floats, spacing: float | None,
    after: tuple[Floats, Floats, float],
) -> float:  # fmt: skip
    """Return the time of the first contact from the velocities before and after it and the state ``after``."""
    configuration, w, end = after
    change = w[[0, 2]] - moving[0, [0, 2]]
    reached = configuration - start[0] - end * w[[0, 2]]
    # start + v first + w (end - first) = position
    if not np.any(change):
        # only v2 changed: the time follows from the return to height 0
        return float(end * w[1] / (w[1] - moving[0, 1]))
    return float(-(change @ reached) / (change @ change))


def draw_collision(
    disk: Disk,
    wall: Wall,
    scale: float,
    position: ArrayLike,
    velocity: ArrayLike,
    spacing: float | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw one collision near the wall: the rim at every contact, and the paths of the satellites near the wall.

    Parameters
    ----------
    disk, wall, scale, position, velocity, spacing
        As in `collision_path`.
    ax : matplotlib Axes, optional
        By default the axes of a new figure.

    Returns
    -------
    matplotlib Axes
        Lengths are in units of the wall. Dots are the satellites at height 0 and at every contact, lines are their
        paths. The rim between satellites, dashed, does not touch the wall.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> axes = draw_collision(geo.Disk(), geo.triangular_teeth(2.0), 0.01, [0.0025, 0.0], [0.0, -1.0, 0.0])
    >>> axes.get_ylabel()
    'height above the tops'
    """
    eps = positive_number("scale", scale)
    space = ConfigurationSpace(wall, disk, eps, spacing)
    path = collision_path(disk, wall, eps, position, velocity, spacing)
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").subplots()
    lowest = -space.charts.nearest(path[:, 2])
    numbers = np.arange(lowest.min() - 1, lowest.max() + 2)
    low = space.zoomed.satellite(path / eps, lowest)
    cells = np.array([low[:, 0].min(), low[:, 0].max()]) / wall.period
    left, right = np.floor(cells[0] - MARGIN), np.ceil(cells[1] + MARGIN)
    top = FREE * max(wall.depth, 0.3 * wall.period)
    outline = wall.outline(1e-3 * wall.period)
    for k in range(int(left) - 1, int(right) + 1):
        ax.fill_between(outline[:, 0] + k * wall.period, outline[:, 1], -2.0 * top, color=SOLID, linewidth=0)
        ax.plot(outline[:, 0] + k * wall.period, outline[:, 1], color="black", linewidth=1.2)
    for j, number in enumerate(numbers):
        colour = RAY_COLOURS[j % len(RAY_COLOURS)]
        for before, after in pairwise(path):
            fraction = np.linspace(0.0, 1.0, FLIGHT_POINTS)[:, None]
            track = space.zoomed.satellite((before + fraction * (after - before)) / eps, number)
            ax.plot(track[:, 0], track[:, 1], color=colour, linewidth=1.1)
    _draw_rims(ax, space, path, numbers)
    ax.axhline(0.0, color=LEVEL, linewidth=0.8, linestyle=":")
    ax.set_xlim(left * wall.period, right * wall.period)
    ax.set_ylim(-1.15 * max(wall.depth, 0.1 * wall.period), top)
    ax.set_aspect("equal")
    ax.set_xlabel("x (length units of the wall)")
    ax.set_ylabel("height above the tops")
    return ax


def _draw_rims(ax: Axes, space: ConfigurationSpace, path: Floats, numbers: Floats) -> None:
    """Draw the rim of the disk with its satellites at start, contacts and end."""
    angles = np.linspace(-1.5 * space.spacing, 1.5 * space.spacing, 4 * FLIGHT_POINTS)
    for configuration in path:
        x1, x2, alpha = configuration / space.scale
        x = x1 + np.sin(angles) / space.scale
        y = x2 + 2.0 * np.sin(0.5 * angles) ** 2 / space.scale
        ax.plot(x, y, color=LEVEL, linewidth=0.7, linestyle=(0, (4, 3)), zorder=1.5)
        for j, number in enumerate(numbers):
            dot = space.zoomed.satellite(np.array([x1, x2, alpha]), number)
            ax.plot(*dot, "o", color=RAY_COLOURS[j % len(RAY_COLOURS)], markersize=4.5, zorder=4)


def draw_shadow(space: ConfigurationSpace, position: ArrayLike, velocity: ArrayLike, ax: Axes | None = None) -> Axes:
    """Draw the contact's path on the cylinder with the radius of transversality, and the path of the true contact.

    Parameters
    ----------
    space : ConfigurationSpace
    position, velocity : array_like, shapes (2,) and (3,)
        As in `shadow`.
    ax : matplotlib Axes, optional
        By default the axes of a new figure.

    Returns
    -------
    matplotlib Axes
        Lengths are in units of the wall. Each flight on the cylinder has a band as wide as its radius on both sides.
        Rings have the bounds of the distances of the contacts as radii. The true path is that of the satellite that
        begins lowest.

    Raises
    ------
    InputError
        As in `shadow` and `collision_path`.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> space = geo.ConfigurationSpace(geo.triangular_teeth(1.2), geo.Disk(), scale=1e-9)
    >>> draw_shadow(space, [0.2e-9, 0.0], [0.0, -1.0, 0.0]).get_legend().get_texts()[0].get_text()
    'on the cylinder'
    """
    pair = shadow(space, position, velocity)
    path = collision_path(space.disk, space.wall, space.scale, position, velocity, space.spacing) / space.scale
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").subplots()
    wall = space.wall
    # the hollow is drawn in the cell that begins at 0
    shift = np.array([np.floor(pair.points[-2, 0] / wall.period) * wall.period, 0.0])
    points = pair.points - shift + np.array(wall.origin)
    left, right = np.floor(points[1:, 0].min() / wall.period), np.ceil(points[1:, 0].max() / wall.period)
    cells = np.arange(left - 1, right + 1) * wall.period
    line = wall.outline(OUTLINE_TOLERANCE * wall.period)[:-1]
    outline = np.concatenate([line + np.array([cell, 0.0]) for cell in cells])
    floor = wall.origin[1] - 1.4 * wall.depth - 0.05 * wall.period
    ax.fill_between(outline[:, 0], outline[:, 1], floor, color=SOLID, linewidth=0, zorder=1.2)
    ax.plot(outline[:, 0], outline[:, 1], color="black", linewidth=1.2, zorder=2)
    for (first, last), radius in zip(pairwise(points), pair.radii, strict=True):
        along = (last - first) / max(float(np.hypot(*(last - first))), np.finfo(float).tiny)
        side = radius * np.array([-along[1], along[0]])
        corners = np.array([first + side, last + side, last - side, first - side])
        ax.fill(*corners.T, color=RAY_COLOURS[0], alpha=0.15, linewidth=0, zorder=1.0)
    ax.plot(*points.T, color=RAY_COLOURS[0], linewidth=1.2, zorder=3, label="on the cylinder")
    number = -space.charts.nearest(path[0, 2] * space.scale)
    fraction = np.linspace(0.0, 1.0, FLIGHT_POINTS)[:, np.newaxis]
    legs = [space.zoomed.satellite(a + fraction * (b - a), number) for a, b in pairwise(path)]
    ax.plot(*(np.concatenate(legs) - shift).T, color=RAY_COLOURS[2], linestyle="--", linewidth=1.4, zorder=3,
            label="of the true disk")  # fmt: skip
    turn = np.linspace(0.0, 2.0 * np.pi, 2 * FLIGHT_POINTS)
    for point, reach in zip(points[1:-1], pair.reaches, strict=True):
        if np.isfinite(reach):
            ring = point + reach * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            ax.plot(*ring.T, color="black", linewidth=0.8, zorder=3)
    ax.axhline(0.0, color=LEVEL, linewidth=0.8, linestyle=":")
    ax.set_xlim(points[1:, 0].min() - 0.5 * wall.period, points[1:, 0].max() + 0.5 * wall.period)
    ax.set_ylim(floor, wall.origin[1] + 0.6 * max(wall.depth, 0.5 * wall.period))
    ax.set_aspect("equal")
    ax.legend(loc="upper left", frameon=False)
    ax.set_xlabel("x (length units of the wall)")
    ax.set_ylabel("height above the tops")
    return ax


def draw_configurations(space: ConfigurationSpace, height: float, ax: Axes | None = None) -> Axes:
    """Draw the section of the configuration space at one ``height`` of the lowest satellite.

    The section covers two cells and two spacings. Free configurations are white. For alpha in Z the solid is a bent
    cylinder over the wall, x1 + sin(alpha) constant. In the coloured bands two satellites may be below the tops, and
    two cylinders cross.

    Parameters
    ----------
    space : ConfigurationSpace
    height : float
        Height of the lowest satellite relative to the tops, in units of the depth of the scaled wall, in (-1, 0).
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> space = ConfigurationSpace(geo.triangular_teeth(2.0), geo.Disk(), 0.01)
    >>> draw_configurations(space, -0.5).get_images()[0].get_extent()
    [0.0, 2.0, -1.0, 1.0]
    """
    height = number_between("height", height, -1.0, 0.0)
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.figure(layout="constrained").subplots()
    width, rho = space.scale * space.wall.period, space.spacing
    x1 = width * (np.arange(SECTION) + 0.5) / SECTION * 2.0
    alpha = rho * (2.0 * (np.arange(SECTION) + 0.5) / SECTION - 1.0)
    grid = np.stack(np.meshgrid(x1, alpha, indexing="xy"), axis=-1)
    x2 = height * space.depth - 2.0 * np.sin(0.5 * space.charts.residual(grid[..., 1])) ** 2
    free = space.contains(np.stack([grid[..., 0], x2, grid[..., 1]], axis=-1))
    extent = (0.0, 2.0 * space.wall.period, -1.0, 1.0)
    ax.imshow(np.where(free, 1.0, float(SOLID)), cmap="gray", vmin=0.0, vmax=1.0, origin="lower", extent=extent,
              aspect="auto", interpolation="nearest")  # fmt: skip
    gap = space.gap_radius / rho
    for middle in (-0.5, 0.5):
        label = "two satellites can be low" if middle < 0.0 else None
        ax.axhspan(middle - gap, middle + gap, color=RAY_COLOURS[4], alpha=0.25, linewidth=0, label=label)
    ax.set_xlabel("x1 / eps")
    ax.set_ylabel("alpha / rho")
    return ax
