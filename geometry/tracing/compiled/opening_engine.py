"""Which hollow of a cell a ray enters: compiled, taken in by the loops over rays. Loads numba."""

from __future__ import annotations

from numba import njit

# In place of a hollow's number: a flat top, and an end of one that is a corner.
FLAT_TOP, TOP_CORNER = -1, -2


_compile = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)


@_compile
def last_hollow(place, hollows):
    """Number of the last hollow whose left end is not beyond a place of the cell, -1 where there is none."""
    low, high = 0, hollows.shape[0]
    while low < high:
        middle = (low + high) // 2
        if hollows[middle, 0] <= place:
            low = middle + 1
        else:
            high = middle
    return low - 1


@_compile
def opening_at(place, hollows):
    """Number of the hollow that opens at a place of the cell, or `FLAT_TOP`, or `TOP_CORNER`."""
    h = last_hollow(place, hollows)
    if h < 0 or place >= hollows[h, 1] or (place == hollows[h, 0] and hollows[h, 11] > 0.0):
        # a flat top, or an edge of it; the edges between two hollows are corners
        edge = h >= 0 and (
            (place == hollows[h, 0] and hollows[h, 11] > 1.0) or (place == hollows[h, 1] and hollows[h, 12] > 1.0)
        )
        return TOP_CORNER if edge else FLAT_TOP
    return h
