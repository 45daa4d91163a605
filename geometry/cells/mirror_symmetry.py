"""Whether a periodic wall equals its mirror image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ..curves.arc import Arc
from ..curves.curve import Curve
from ..curves.segment import Segment
from .cell import Cell
from .hollow import flat_tops

# Distance up to which points of mirror images agree, relative to the wall's size. A mirrored point rounds once, but
# the two halves of a wall may have been computed by formulas of about fifty operations.
MIRROR_TOLERANCE = 256.0 * EPS
# Parameters at which pieces are compared, besides 0; the set is symmetric under t -> 1 - t.
PARAMETERS = np.array([0.25, 0.5, 0.75, 1.0])
# Starts from which on a correlation excludes most of them at once: a comparison takes a time of order n for each start,
# and the heights of a measured profile repeat. Its error is below some ten roundings for each of the log2(n) stages of
# the transforms, in units of the sum of the squares.
MANY_STARTS, CORRELATION_ULPS = 16, 1024.0


def has_mirror_axis(wall: Cell) -> bool:
    """Whether the periodic wall has a mirror axis x = const; for a wall with islands only x = period/2 is tested.

    A wall without islands is compared with its mirror image as a cycle of pieces, starting from every piece at which
    the two may agree. So the result does not depend on the start of the cell.
    """
    tolerance = MIRROR_TOLERANCE * max(wall.period, float(np.abs(wall.vertices).max()), wall.depth)
    if wall.islands:
        image = wall.mirrored()
        islands, images = map(_with_bottom_starts, (wall.islands, image.islands))
        return _agree(wall.pieces, image.pieces, tolerance) and all(
            any(_agree(loop[k:] + loop[:k], other, tolerance) for other in images for k in range(len(loop)))
            for loop in islands
        )
    own = _steps(_closed_up(wall))
    other = _mirrored(own)
    starts = np.flatnonzero(np.abs(own - other[0]).max(axis=(1, 2)) <= tolerance)
    if len(starts) > MANY_STARTS:
        starts = starts[_may_agree(own[:, -1], other[:, -1], tolerance)[starts]]
    return any(np.abs(np.roll(own, -k, axis=0) - other).max() <= tolerance for k in starts.tolist())


def _may_agree(own: Floats, other: Floats, tolerance: float) -> NDArray[np.bool_]:
    """Return for each k whether the cycle of vectors ``own``, started at k, may agree with the cycle ``other``.

    The sum over j of |own[k + j] - other[j]|^2 follows for all k from one circular correlation. It is at most
    2 n tolerance^2 where the cycles agree.
    """
    own, other = own - own.mean(axis=0), other - other.mean(axis=0)
    product = np.fft.rfft(own, axis=0) * np.fft.rfft(other, axis=0).conj()
    correlation = np.fft.irfft(product.sum(axis=1), len(own))
    squares = float((own * own).sum() + (other * other).sum())
    return np.asarray(squares - 2.0 * correlation <= 2.0 * len(own) * tolerance**2 + CORRELATION_ULPS * EPS * squares)


def _closed_up(wall: Cell) -> Sequence[Curve]:
    """Return the pieces of a wall as a cycle; a flat top that the ends of the period cut is joined."""
    pieces, last = wall.pieces, len(wall.pieces) - 1
    if last < 1 or not {0, last} <= set(flat_tops(pieces, wall.vertices)):
        return pieces
    return (Segment(pieces[-1].start, (wall.period + pieces[0].end[0], 0.0)), *pieces[1:-1])


def _with_bottom_starts(islands: Sequence[Sequence[Curve]]) -> list[tuple[Curve, ...]]:
    """Return the islands with each whole ellipse starting at its lowest point, since its given start is arbitrary."""
    bottom = -0.5 * np.pi
    return [
        (Arc(loop[0].center, loop[0].semi_axes, bottom, bottom + 2.0 * np.pi * loop[0].direction),)
        if len(loop) == 1 and isinstance(loop[0], Arc)
        else tuple(loop)
        for loop in islands
    ]


def _steps(path: Sequence[Curve]) -> Floats:
    """Return the points of every piece at PARAMETERS relative to its start, shape (n, 4, 2)."""
    start, end = (np.array([getattr(piece, name) for piece in path]) for name in ("start", "end"))
    # the points of a segment follow from its ends
    steps = PARAMETERS[:, None] * (end - start)[:, None, :]
    for i, piece in enumerate(path):
        if not piece.is_straight:
            steps[i, :-1] = piece.point(PARAMETERS[:-1]) - start[i]
    return np.asarray(steps)


def _mirrored(steps: Floats) -> Floats:
    """Return the steps of the mirror image; its parameter at a point is 1 - t."""
    end = steps[:, -1:]
    points = np.concatenate([steps[:, -2::-1] - end, -end], axis=1)
    return np.asarray(points[::-1] * [-1.0, 1.0])


def _agree(path: Sequence[Curve], other: Sequence[Curve], tolerance: float) -> bool:
    """Whether two paths agree piece by piece within ``tolerance``."""
    if len(path) != len(other) or [type(p) for p in path] != [type(p) for p in other]:
        return False
    starts = np.array([p.start for p in path]) - np.array([p.start for p in other])
    return bool(np.abs(starts).max() <= tolerance and np.abs(_steps(path) - _steps(other)).max() <= tolerance)
