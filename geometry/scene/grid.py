"""A uniform grid over the straight pieces of a hollow that has many. Loads numba: imported where it is used."""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...core.checks import Floats
from .columns import POINT_X, POINT_Y

# Cells a piece: a choice that keeps a cell about as large as a piece; it has not been tuned.
CELLS_PER_PIECE = 2.0
# Long pieces lie in many cells each; the grid is coarsened until a piece lies in no more than this many on average.
MOST_ENTRIES = 16
# A piece is listed in every cell that it comes this close to, in cells. A ray's walk through the cells and its position
# there are wrong by some rounding errors of the hollow's size, a millionth of this where cells are 1e-3 of the size.
MARGIN = 1e-6


def grid_of(starts: Floats, ends: Floats, first: int, base: int) -> tuple[list[float], NDArray[np.int64]]:
    """Lay a grid over lines.

    Parameters
    ----------
    starts, ends : array, shape (m, 2)
    first : int
        Number of the first line; the others follow. A row whose start equals its end is a joint where a curve starts.
    base : int
        Where the list will begin in the table ``grid``.

    Returns
    -------
    list of 7 floats, array of int
        Lower left corner, width and height of a cell, columns, rows, position of the first cell; then for every cell
        where its entries begin, the end of the last one, and the entries: numbers of lines
        and of joints where no line starts.
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


@njit(cache=True, nogil=True)
def touches(ax, ay, bx, by, column, row):
    """Whether the segment from a to b, in units of cells, comes within the margin of a cell."""
    x, y = column + 0.5, row + 0.5
    reach = 0.5 + MARGIN
    if max(ax, bx) < x - reach or min(ax, bx) > x + reach or max(ay, by) < y - reach or min(ay, by) > y + reach:
        return False
    ex, ey = bx - ax, by - ay
    return abs(ex * (y - ay) - ey * (x - ax)) <= reach * (abs(ex) + abs(ey))


@njit(cache=True, nogil=True)
def cells_about(low, high, count):
    """First and last cell that an interval may touch, in units of cells."""
    return max(0, int(np.floor(low - MARGIN))), min(count - 1, int(np.floor(high + MARGIN)))


@njit(cache=True, nogil=True)
def list_entries(starts, ends, frame, first, next_entry, entries):
    """List the lines of every cell in ``entries``, from the cell's position on; move the position behind them.

    ``frame`` is the lower left corner, the size of a cell, columns and rows. With no entries the lines are only
    counted: positions that begin at 0 become their numbers.
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
