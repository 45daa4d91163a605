"""Test for points inside the solid of a wall, by the parity of the boundary's crossings above the point."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..curves.curve import Curve
from .wall import Wall

# Number of bisections of the parameter interval [0, 1] that leave two neighbouring floats near 1.
HALVINGS = 53


def in_solid(wall: Wall, points: Floats) -> NDArray[np.bool_]:
    """Return whether points of shape (..., 2) are in the interior of the solid; boundary points are not.

    A point is interior if it is on the solid side in all four limits (x +- 0, y +- 0). For points within a few units
    in the last place of a curved boundary the result depends on rounding.
    """
    flat = points.reshape(-1, 2)
    x, y = np.mod(flat[:, 0], wall.period), flat[:, 1]
    # parity of the crossings above each point, for y +- 0 (first axis) and x +- 0 (second axis)
    odd = np.zeros((2, 2, len(flat)), dtype=bool)
    for path in (wall.pieces, *wall.islands):
        for piece in path:
            low, high = piece.box[0], piece.box[2]
            for copy in range(int(np.floor(-high / wall.period)), int(np.ceil((wall.period - low) / wall.period)) + 1):
                _cross(piece, x - copy * wall.period, y, odd)
    below = y < -wall.depth
    return np.asarray((odd.all(axis=(0, 1)) | below).reshape(points.shape[:-1]))


def _cross(piece: Curve, x: Floats, y: Floats, odd: NDArray[np.bool_]) -> None:
    """Flip the parities of the points below the piece."""
    for start, end in pairwise([0.0, *piece.turning_points(0), 1.0]):
        left, right = (float(piece.point(s)[0]) for s in (start, end))
        if left == right:
            continue
        low, high = min(left, right), max(left, right)
        near = ((low <= x) & (x <= high)).nonzero()[0]
        if not len(near):
            continue
        height = _height(piece, start, end, x[near])
        for side, between in enumerate(((low <= x[near]) & (x[near] < high), (low < x[near]) & (x[near] <= high))):
            odd[0, side, near] ^= between & (height > y[near])
            odd[1, side, near] ^= between & (height >= y[near])


def _height(piece: Curve, start: float, end: float, x: Floats) -> Floats:
    """Return the heights at ``x`` of the part from ``start`` to ``end``, which is monotone in x."""
    if piece.is_straight:
        (x0, y0), (x1, y1) = piece.start, piece.end
        return np.asarray(y0 + (x - x0) * ((y1 - y0) / (x1 - x0)))
    first, last = np.full_like(x, start), np.full_like(x, end)
    rises = piece.point(end)[0] > piece.point(start)[0]
    for _ in range(HALVINGS):
        middle = 0.5 * (first + last)
        before = (piece.point(middle)[:, 0] < x) == rises
        first, last = np.where(before, middle, first), np.where(before, last, middle)
    return np.asarray(piece.point(0.5 * (first + last))[:, 1])
