"""Compiled comparison of the pieces of neighbouring rows. Imported inside functions only."""

from __future__ import annotations

import numpy as np
from numba import njit

from .changes import probe

_compile = njit(cache=True, nogil=True, error_model="numpy")


@_compile
def find_overlooked(thetas, least_widths, pieces, starts, linked, scene, degree):
    """Places in rows where a ray has another label than the piece that it belongs to: pieces of a neighbour say where.

    Rows ``k`` and ``k + 1`` are compared where ``linked[k]``. Pieces of the one no wider than the other's
    ``least_widths`` do not count. Returns the numbers of the rows, the places, and the numbers of rays and flights.
    """
    hollow, tables, period, limits, edges = scene
    lows, highs, labels = pieces
    code = np.zeros(2, np.uint64)
    rows, places = [0 for _ in range(0)], [0.0 for _ in range(0)]
    rays = 0
    for k in range(thetas.shape[0] - 1):
        if not linked[k]:
            continue
        for here, there in ((k, k + 1), (k + 1, k)):
            task = (thetas[there], hollow, tables, period, limits, edges, degree, code)
            m, end = starts[there], starts[there + 1]
            for p in range(starts[here], starts[here + 1]):
                if highs[p] - lows[p] <= least_widths[there]:
                    continue
                x = 0.5 * (lows[p] + highs[p])
                while m < end - 1 and highs[m] <= x:
                    m += 1
                # what lies in the gaps is in the row's error
                if labels[m] != labels[p] and lows[m] < x < highs[m]:
                    rays += 1
                    if probe(x, task)[1] != labels[m]:
                        rows.append(there)
                        places.append(x)
    return np.array(rows, dtype=np.int64), np.array(places), rays, np.int64(code[1])
