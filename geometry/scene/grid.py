"""A uniform grid over the straight pieces of a hollow with many pieces; loads numba, so it is imported late."""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.compilation import jit
from .columns import POINT_X, POINT_Y

# Cells per piece; a cell is then about as large as a piece (not tuned).
CELLS_PER_PIECE = 2.0
# Largest average number of cells per piece; the grid is coarsened to meet it, because long pieces lie in many cells.
MOST_ENTRIES = 16
# Margin, in cells: a piece is listed in every cell within this distance. The grid traversal of a ray has an error of
# some rounding errors of the hollow's size, a millionth of the margin if cells are 1e-3 of the size.
MARGIN = 1e-6


def grid_of(starts: Floats, ends: Floats, first: int, base: int) -> tuple[list[float], NDArray[np.int64]]:
    """Lay a grid over lines.

    Parameters
    ----------
    starts, ends : array, shape (m, 2)
    first : int
        Number of the first line; the numbers are consecutive. A row with equal ends is a joint where a curve starts.
    base : int
        Start of the returned array in the table ``grid``.

    Returns
    -------
    list of 7 floats
        Lower left corner, width and height of a cell, numbers of columns and rows, position of the first cell.
    array of int
        For every cell the start of its entries, then the end of the last cell's entries, then all entries: numbers of
        lines and of joints where no line starts.
    """
    low = np.minimum(starts.min(axis=0), ends.min(axis=0))
    high = np.maximum(starts.max(axis=0), ends.max(axis=0))
    spread = np.maximum(high - low, 1e-3 * np.max(high - low))
    low, spread = low - 1e-3 * spread, 1.002 * spread
    cells = CELLS_PER_PIECE * len(starts)
    while True:
        side = sqrt(spread[0] * spread[1] / cells)
        columns, rows = max(1, ceil(spread[0] / side)), max(1, ceil(spread[1] / side))
        size = spread / np.array([columns, rows])
        counts, nothing = np.zeros(columns * rows + 1, dtype=np.int64), np.empty(0, dtype=np.int64)
        list_entries(starts, ends, (low, size, columns, rows), first, counts, nothing)
        if counts.sum() <= MOST_ENTRIES * len(starts) or cells <= 16.0:
            break
        cells *= 0.25
    offsets = np.cumsum(np.concatenate([[0], counts[:-1]]))
    entries = np.zeros(int(offsets[-1]), dtype=np.int64)
    list_entries(starts, ends, (low, size, columns, rows), first, offsets[:-1].copy(), entries)
    frame = [float(low[0]), float(low[1]), float(size[0]), float(size[1]), float(columns), float(rows), float(base)]
    return frame, np.concatenate([offsets + (base + len(offsets)), entries])


@jit(error_model="python")
def touches(ax, ay, bx, by, column, row):
    """Whether the segment from a to b, in units of cells, meets a cell enlarged by the margin."""
    x, y = column + 0.5, row + 0.5
    reach = 0.5 + MARGIN
    if max(ax, bx) < x - reach or min(ax, bx) > x + reach or max(ay, by) < y - reach or min(ay, by) > y + reach:
        return False
    ex, ey = bx - ax, by - ay
    return abs(ex * (y - ay) - ey * (x - ax)) <= reach * (abs(ex) + abs(ey))


@jit(error_model="python")
def cells_about(low, high, count):
    """Return the first and last cell that an interval, in units of cells, may touch."""
    return max(0, int(np.floor(low - MARGIN))), min(count - 1, int(np.floor(high + MARGIN)))


@jit(error_model="python")
def list_entries(starts, ends, frame, first, next_entry, entries):
    """Write the lines of every cell into ``entries`` from ``next_entry`` of the cell on, and advance ``next_entry``.

    ``frame`` is the lower left corner, the size of a cell, columns and rows. If ``entries`` is empty, the lines are
    only counted in ``next_entry``.
    """
    low, size, columns, rows = frame
    for k in range(starts.shape[0]):
        ax, ay = (
            (starts[k, POINT_X] - low[POINT_X]) / size[POINT_X],
            (starts[k, POINT_Y] - low[POINT_Y]) / size[POINT_Y],
        )
        bx, by = (ends[k, POINT_X] - low[POINT_X]) / size[POINT_X], (ends[k, POINT_Y] - low[POINT_Y]) / size[POINT_Y]
        left, right = cells_about(min(ax, bx), max(ax, bx), columns)
        bottom, top = cells_about(min(ay, by), max(ay, by), rows)
        for row in range(bottom, top + 1):
            for column in range(left, right + 1):
                if touches(ax, ay, bx, by, column, row):
                    cell = row * columns + column
                    if entries.size:
                        entries[next_entry[cell]] = first + k
                    next_entry[cell] += 1
