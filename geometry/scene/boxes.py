"""A tree of boxes about the straight pieces of a hollow: a ray is tested against sixteen boxes at once.

Pieces that follow each other along the wall are close to each other, so sixteen consecutive lines make a leaf, sixteen
consecutive leaves a node, and so on up to the root. A row of the tree has up to sixteen lines with their ends, or
boxes with their middles and half their widths and heights; the rest of it is NaN.
"""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats
from ..curves.tolerances import BOX_MARGIN

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
