"""A tree of boxes about the straight pieces of a hollow: a ray is tested against sixteen boxes at once.

Pieces that follow each other along the wall are close to each other, so sixteen consecutive lines make a leaf, sixteen
consecutive leaves a node, and so on up to the root. A row of the tree has up to sixteen lines with their ends, or
boxes with their middles and half their widths and heights; the rest of it is NaN. Of a ray that escapes, because it
leaves its line in the line's sector of escape, no box is tested.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ..curves.columns import BOX_MARGIN, JOINT_ULPS, NEARBY

# Most boxes, or lines, in a row; of four levels of nodes the masks are in one number, see `tracing/compiled/tree`.
BOXES = 16
# Columns of a row. Of a line the start and the end, of a box the middle and half of its width and height.
ANCHOR_X = 0
ANCHOR_Y = BOXES
OTHER_X = 2 * BOXES
OTHER_Y = 3 * BOXES
CONTENT = 4 * BOXES  # row of the first box's own row; of a leaf the joint at which the first line starts
PARENT = 4 * BOXES + 1  # row of the node that contains this one
TREE_COLUMNS = 4 * BOXES + 2


def tree_of(starts: Floats, ends: Floats, first: int, base: int, size: float) -> tuple[Floats, int]:
    """Put boxes about lines.

    Parameters
    ----------
    starts, ends : array, shape (m, 2)
        A row with equal ends is a joint where no line starts.
    first : int
        Number of the first line; the numbers are consecutive.
    base : int
        Row of the root in the table ``boxes``.
    size : float
        Size of the hollow.

    Returns
    -------
    array
        Rows of the tree, the root first and the leaves last.
    int
        Number of levels.

    Examples
    --------
    >>> tree, levels = tree_of(np.array([[0.0, -1.0], [1.0, -1.0]]), np.array([[1.0, -1.0], [3.0, -2.0]]), 0, 0, 3.0)
    >>> levels, tree[:, ANCHOR_X].tolist(), tree[:, CONTENT].tolist()
    (2, [1.5, 0.0], [1.0, 0.0])
    """
    leaf = np.concatenate([starts, ends], axis=1)
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    levels = [_rows(leaf)]
    while True:
        firsts = np.arange(0, len(low), BOXES)
        low, high = np.minimum.reduceat(low, firsts), np.maximum.reduceat(high, firsts)
        levels.append(_rows(np.concatenate([0.5 * (low + high), 0.5 * (high - low) + BOX_MARGIN * size], axis=1)))
        if len(levels[-1]) == 1:
            break
    row = base
    for upper, lower in zip(levels[:0:-1], levels[-2::-1], strict=True):
        upper[:, CONTENT] = row + len(upper) + BOXES * np.arange(len(upper))
        lower[:, PARENT] = row + np.arange(len(lower)) // BOXES
        row += len(upper)
    levels[0][:, CONTENT] = first + BOXES * np.arange(len(levels[0]))
    return np.concatenate(levels[::-1]), len(levels)


def _rows(entries: Floats) -> Floats:
    """Return rows of sixteen entries of four numbers each, the last row of those that are left."""
    count = -(-len(entries) // BOXES)
    padded = np.full((count * BOXES, 4), np.nan)
    padded[: len(entries)] = entries
    rows = np.zeros((count, TREE_COLUMNS))
    rows[:, : 4 * BOXES] = padded.reshape(count, BOXES, 4).transpose(0, 2, 1).reshape(count, 4 * BOXES)
    return rows


# Number of lines in a hollow up to which all pairs of them are compared, a few milliseconds.
MOST_LINES = 1024
# Joints compared at once, so that the arrays of pairs stay in the cache.
ROWS = 64
# Least angle, about, between a ray of the sector and a ray from its start to any joint above.
ESCAPE_MARGIN = 2.0**-10
# Distance from the ends of its line, in multiples of the slack at joints, from which on a ray may escape: the
# ends are then 16 slacks or more from the ray, and a neighbour that the ray's line crosses behind the start is 2 away.
ESCAPE_ROOM = 2.0**15


def escape_sectors(points: Floats, size: float) -> Floats:
    """Return the sectors of escape of the lines between consecutive points, which end at the two ends of an opening.

    Let a ray leave a line from A to B upwards. The pieces from B on end on its right, at an end of the opening, those
    up to A on its left; to be in its way they would cross the ray in its direction from A or that from B. Of a piece
    after B only the part above the start of such a ray matters. It is on the right if its ends are, and these are below
    a slope. The greatest of these slopes, and the same on the left, limit the sector of the line.

    Parameters
    ----------
    points : array, shape (n + 1, 2)
    size : float
        Size of the hollow.

    Returns
    -------
    array, shape (n, 2)
        A ray of velocity (vx, vy) that leaves the line at a distance from its ends escapes if vx < right * vy and
        -vx < left * vy, where right and left are the two numbers of a row; both are 0 for a line without one.

    Examples
    --------
    >>> escape_sectors(np.array([[0.0, 0.0], [0.5, -1.0], [1.0, 0.0]]), 1.0).round(2).tolist()
    [[0.5, 0.5], [0.5, 0.5]]
    """
    count = len(points) - 1
    sectors = np.zeros((count, 2))
    if count > MOST_LINES:
        return sectors
    slack = JOINT_ULPS * EPS * size
    right, left = _slopes(points, slack), _slopes(points[::-1] * (-1.0, 1.0), slack)[::-1]
    is_alone = _is_alone(points, NEARBY * size)
    for column, slopes in enumerate((right, left)):
        slope = np.maximum(slopes[:-1], slopes[1:])
        sectors[:, column] = is_alone / (slope + ESCAPE_MARGIN * (1.0 + slope * slope))
    return np.asarray(sectors * (sectors > 0.0).all(axis=1, keepdims=True))


def _slopes(points: Floats, slack: float) -> Floats:
    """Return the greatest slope from each point to the later pieces above it, at least 0; inf if one is on the left."""
    slopes = np.zeros(len(points))
    start, end = points[:-1], points[1:]
    for first in range(0, len(points), ROWS):
        numbers = np.arange(first, min(first + ROWS, len(points)))[:, np.newaxis]
        x, level = points[numbers, 0], points[numbers, 1] - 4.0 * slack
        later, is_next = np.arange(len(start)) >= numbers, np.arange(len(start)) == numbers
        worst = np.zeros(later.shape)
        for here, there in ((start, end), (end, start)):
            matters = later & (np.maximum(here[:, 1], there[:, 1]) >= level) & ~(is_next & (here is start))
            # the end of the part above the level
            below = here[:, 1] < level
            with np.errstate(divide="ignore", invalid="ignore"):
                part = np.where(below, (level - here[:, 1]) / (there[:, 1] - here[:, 1]), 0.0)
            dx = here[:, 0] + part * (there[:, 0] - here[:, 0]) - x
            dy = np.where(below, 0.0, here[:, 1] - level)
            # of the piece that starts here only the other end counts
            matters &= ~(is_next & below)
            slope = np.where(dx > slack, dy / np.where(dx > slack, dx, 1.0), np.inf)
            worst = np.maximum(worst, np.where(matters, slope, 0.0))
        slopes[first : first + len(numbers)] = worst.max(axis=1)
    return slopes


def _is_alone(points: Floats, close: float) -> NDArray[np.bool_]:
    """Return which lines are long, far from all others but their neighbours, and at no spike."""
    start, end = points[:-1], points[1:]
    edges = end - start
    count, lengths = len(edges), np.hypot(edges[:, 0], edges[:, 1])
    low, high = np.minimum(start, end), np.maximum(start, end)
    alone = lengths > 2.0 * close
    alone[1:] &= lengths[:-1] > 2.0 * close
    alone[:-1] &= lengths[1:] > 2.0 * close
    turn = edges[:-1, 0] * edges[1:, 1] - edges[:-1, 1] * edges[1:, 0]
    along = edges[:-1, 0] * edges[1:, 0] + edges[:-1, 1] * edges[1:, 1]
    is_spike = (along < 0.0) & (np.abs(turn) < ESCAPE_MARGIN * lengths[:-1] * lengths[1:])
    alone[1:] &= ~is_spike
    alone[:-1] &= ~is_spike
    for first in range(0, count, ROWS):
        rows = slice(first, min(first + ROWS, count))
        others = np.abs(np.arange(count) - np.arange(count)[rows, np.newaxis]) > 1
        gap = np.maximum(low - high[rows, np.newaxis], low[rows, np.newaxis] - high).max(axis=-1)
        alone[rows] &= ~(others & (gap <= 2.0 * close)).any(axis=1)
    return alone
