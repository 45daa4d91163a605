"""Pieces that are parts of one segment, arc or Bezier curve, joined to one: rays do not depend on where it was cut."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ..curves.crossings import straight_in
from ..curves.curve import Curve, point_array
from ..curves.segment import Segment

# Two pieces are parts of one curve if it passes within this distance, relative to the wall's size, of their joint and
# of points of both. The joint is computed by a few dozen operations, and shifting the cell rounds once more.
SAME_PIECE = 64.0 * EPS
# Joints lie on one side within this distance, relative to the largest x and the largest y: a point of a side is
# computed by three operations, and a wall is moved and stretched after that.
ON_SIDE = 8.0 * EPS
# No part is shorter than this, relative to the wall's size: the end of a plate that is thinner has no direction.
SHORTEST = 1e-12


def merged(path: tuple[Curve, ...], is_loop: bool = False) -> tuple[Curve, ...]:
    """Return the path without the joints at which nothing changes; the path itself if there are none.

    Joints at height 0 stay, because hollows end there, except between level segments.

    Examples
    --------
    >>> merged((Segment((0, 0), (1, -1)), Segment((1, -1), (3, -3)), Segment((3, -3), (4, 0))))
    (Segment(start=(0.0, 0.0), end=(3.0, -3.0)), Segment(start=(3.0, -3.0), end=(4.0, 0.0)))
    """
    straight, before = straight_in(path), np.arange(-1, len(path) - 1)
    starts, ends = (point_array(getattr(piece, name) for piece in path) for name in ("start", "end"))
    size = np.maximum(np.abs(starts).max(axis=0), np.abs(ends[-1]))
    level = straight & (starts[before, 1] == 0.0) & (ends[:, 1] == 0.0)
    able = (straight == straight[before]) & (level | (starts[:, 1] != 0.0))
    able[0] &= is_loop
    able &= ~straight | _between(starts[before], starts, ends, size)
    for k in np.flatnonzero(able & ~straight).tolist():
        able[k] = bool(_whole((path[k - 1], path[k]), size))
    if not able.any():
        return path
    first = int(np.argmin(able))
    path, firsts = path[first:] + path[:first], np.flatnonzero(~np.roll(able, -first)).tolist() or [0]
    groups = [path[low:high] for low, high in pairwise([*firsts, len(path)])]
    return tuple(piece for group in groups for piece in _whole(group, size) or group)


def _between(start: Floats, points: Floats, end: Floats, size: Floats) -> NDArray[np.bool_]:
    """Return whether points lie between two others on the straight line, to rounding; all of shape (n, 2)."""
    step, whole = points - start, end - start
    along, across = np.sum(step * whole, axis=1), step[:, 0] * whole[:, 1] - step[:, 1] * whole[:, 0]
    near = np.abs(across) <= ON_SIDE * (np.abs(whole) @ size[::-1])
    length = np.hypot(*whole.T)
    least = SHORTEST * size.max() * length
    return np.asarray(near & (along > least) & (along < length**2 - least))


def _whole(parts: tuple[Curve, ...], size: Floats) -> list[Curve]:
    """Return the curve whose consecutive parts are the given pieces of one kind; an empty list if there is none."""
    start, end = parts[0].start, parts[-1].end
    if parts[0].is_straight:
        joints = point_array(piece.start for piece in parts[1:])
        return [Segment(start, end)] if _between(np.array([start]), joints, np.array([end]), size).all() else []
    if end < start:
        # in one direction of the two, so that coincident faces stay coincident
        return [p.reversed() for p in _whole(tuple(part.reversed() for part in reversed(parts)), size)]
    whole: Curve | None = parts[0]
    for part in parts[1:]:
        whole = whole and whole.joined(part, SAME_PIECE * float(size.max()))
    return [whole] if whole else []
