"""The origin of a wall's cell: one of the wall's highest points (condition B5'; Rudzis 2022, section 1.3.1).

A wall without islands closes if its period begins at any of its highest points. So the law of the wall is that of
the cell that begins there, for any given start of the period and any height of the wall below y = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...core.checks import Floats
from ..curves.crossings import directions_of
from ..curves.curve import Curve, Point
from ..curves.segment import Segment


@dataclass(frozen=True)
class HighestPoint:
    """The pieces of a wall over one period, starting from one of its highest points as the origin.

    Parameters
    ----------
    pieces : tuple of Curve
        From (0, 0) to (period, 0).
    origin : (float, float)
        The position of (0, 0) in the coordinates of the wall.
    numbers : tuple of int
        For every piece its index in the wall.
    """

    pieces: tuple[Curve, ...]
    origin: Point
    numbers: tuple[int, ...]


def highest_point_of(path: tuple[Curve, ...], joints: Floats, period: float) -> HighestPoint | None:
    """Return the cell of a wall without islands; None without a first top or if rounding would remove a piece."""
    first = first_top(joints, period)
    if first is None:
        return None
    first = _above_a_plate(path, joints, first)
    x, y = (float(c) for c in joints[first])
    count = len(path)
    if first == 0 and y == 0.0:
        return HighestPoint(path, (0.0, 0.0), tuple(range(count)))
    order = [*range(first, count), *range(first)]
    shifts = np.where(np.array(order) >= first, -x, period - x)
    starts = joints[order] + np.column_stack([shifts, np.full(count, -y)])
    vertices = np.concatenate([starts, [(period, 0.0)]])
    given = joints[1:][order] - joints[:-1][order]
    if np.any(np.all(vertices[1:] == vertices[:-1], axis=1) & np.any(given != 0.0, axis=1)):
        return None
    points = [(px, py) for px, py in vertices.tolist()]
    pieces = tuple(
        Segment(start, end) if path[k].is_straight else path[k].moved(float(shift), -y).pinned(start, end)
        for k, shift, (start, end) in zip(order, shifts, pairwise(points), strict=True)
    )
    return HighestPoint(pieces, (x, y), tuple(order))


def _above_a_plate(path: tuple[Curve, ...], joints: Floats, top: int) -> int:
    """Return the first joint at the point of a top with the sky on its left: on a plate there is one below it, too."""
    same = np.flatnonzero(np.all(joints[:-1] == joints[top], axis=1))
    if len(same) > 1:
        into, out = directions_of(path)
        # angles from straight down, from -pi/2 on the left to pi/2 on the right
        back, on = (np.arctan2(x, -y) for x, y in (-into[same - 1].T, out[same].T))
        above = same[on >= back]
        top = int(above[0]) if len(above) else top
    return top


def first_top(vertices: Floats, period: float) -> int | None:
    """Return the first joint of greatest height with all others of that height at most one period to its right.

    Only joints on plates of zero thickness, which run back below a flat top, lack this property.

    Examples
    --------
    >>> first_top(np.array([(0, -1), (0.2, 0), (0.5, 0), (0.3, 0), (1, -1)]), 1.0)
    1
    """
    height = vertices[:-1, 1]
    tops = np.flatnonzero(height == height.max())
    x = vertices[tops, 0]
    # extremal x of this joint and the later ones, and of the earlier ones shifted by one period
    least = np.minimum.accumulate(x[::-1])[::-1]
    most = np.maximum.accumulate(x[::-1])[::-1]
    least[1:] = np.minimum(least[1:], np.minimum.accumulate(x)[:-1] + period)
    most[1:] = np.maximum(most[1:], np.maximum.accumulate(x)[:-1] + period)
    found = tops[(least >= x) & (most <= x + period)]
    return int(found[0]) if len(found) else None
