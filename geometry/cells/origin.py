"""The origin of a wall's cell: one of the wall's highest points (condition B5'; Rudzis 2022, section 1.3.1).

A wall without islands closes if its period begins at any of its highest points. So the law of the wall is that of
the cell that begins there, for any given start of the period and any height of the wall below y = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...core.checks import Floats
from ...core.rounding import EPS
from ..curves.arc import Arc
from ..curves.bezier import Bezier
from ..curves.crossings import directions_of
from ..curves.curve import Curve, Point
from ..curves.segment import Segment

# Two pieces are parts of one curve if it passes within this distance, relative to the wall's size, of their joint and
# of points of both. The joint is computed by a few dozen operations, and shifting the cell rounds once more.
SAME_PIECE = 64.0 * EPS
# Parameters at which the parts are compared with the whole curve.
INNER = np.array([0.25, 0.5, 0.75])


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
        For every piece its index in the wall, of a joined piece that of its first part.
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
    pieces = [
        Segment(start, end) if isinstance(path[k], Segment) else path[k].moved(float(shift), -y).pinned(start, end)
        for k, shift, (start, end) in zip(order, shifts, pairwise(points), strict=True)
    ]
    seam = count - first
    if 0 < seam < count:
        whole = joined(pieces[seam - 1], pieces[seam], SAME_PIECE * _size(vertices))
        if whole is not None:
            pieces[seam - 1 : seam + 1] = [whole]
            del order[seam]
    return HighestPoint(tuple(pieces), (x, y), tuple(order))


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


def joined(before: Curve, after: Curve, tolerance: float) -> Curve | None:
    """Return the curve whose two consecutive parts are the given pieces within ``tolerance``; None if none exists.

    Examples
    --------
    >>> joined(Segment((0, 0), (1, -1)), Segment((1, -1), (3, -3)), 1e-15)
    Segment(start=(0.0, 0.0), end=(3.0, -3.0))
    """
    if isinstance(before, Segment) and isinstance(after, Segment):
        return _joined_segments(before, after, tolerance)
    if isinstance(before, Arc) and isinstance(after, Arc):
        return _joined_arcs(before, after, tolerance)
    if isinstance(before, Bezier) and isinstance(after, Bezier):
        return _joined_beziers(before, after, tolerance)
    return None


def _joined_segments(before: Segment, after: Segment, tolerance: float) -> Segment | None:
    (ax, ay), (bx, by), (cx, cy) = before.start, before.end, after.end
    dx, dy = cx - ax, cy - ay
    length = math.hypot(dx, dy)
    along, across = (bx - ax) * dx + (by - ay) * dy, (bx - ax) * dy - (by - ay) * dx
    if not 0.0 < along < length * length or abs(across) > tolerance * length:
        return None
    return Segment(before.start, after.end)


def _joined_arcs(before: Arc, after: Arc, tolerance: float) -> Arc | None:
    span = 2.0 * (before.half_span + after.half_span)
    if before.direction != after.direction or span > 2.0 * math.pi:
        return None
    end = before.start_angle + before.direction * span
    whole = Arc(before.center, before.semi_axes, before.start_angle, end).pinned(before.start, after.end)
    return whole if _are_parts(whole, before, after, before.half_span / (0.5 * span), tolerance) else None


def _joined_beziers(before: Bezier, after: Bezier, tolerance: float) -> Bezier | None:
    if before.degree != after.degree:
        return None
    first, second = (np.array(part.control_points) for part in (before, after))
    # each distance is proportional to the derivative at the joint times the part's fraction of the parameter
    left, right = math.dist(first[-1], first[-2]), math.dist(second[1], second[0])
    if left == 0.0 or right == 0.0:
        return None
    fraction = left / (left + right)
    inner = [first[0] + (first[1] - first[0]) / fraction]
    if before.degree == 3:
        inner.append(second[-1] + (second[-2] - second[-1]) / (1.0 - fraction))
    whole = Bezier([before.start, *(tuple(p) for p in inner), after.end])
    return whole if _are_parts(whole, before, after, fraction, tolerance) else None


def _are_parts(whole: Curve, before: Curve, after: Curve, fraction: float, tolerance: float) -> bool:
    """Whether the joint and points of both parts lie on the whole curve at the corresponding parameters."""
    given = np.concatenate([before.point(INNER), [before.end], after.point(INNER)])
    found = whole.point(np.concatenate([fraction * INNER, [fraction], fraction + (1.0 - fraction) * INNER]))
    return bool(np.abs(given - found).max() <= tolerance)


def _size(vertices: Floats) -> float:
    return float(np.ptp(vertices, axis=0).max())
