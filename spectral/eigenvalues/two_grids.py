"""How much eigenvalues change from a coarser basis to a finer one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...checks import Floats
from .deflation import compressed
from .dense import Extremes, end_values

if TYPE_CHECKING:
    from ...kernels import KernelMatrix

# With order 2, the lowest of the bases, the change by the last doubling is this share of the one before.
EARLIER_SHARE = 0.25


def two_grid_changes(matrix: KernelMatrix, found: Extremes) -> Floats:
    """Change of every eigenvalue off the constants from the coarser basis, by its rank from its end of the spectrum.

    A step of parity can leave an eigenvalue unchanged by accident; so a share of the change before counts too. ``inf``
    where the coarser basis has no such eigenvalue.
    """
    grids = _coarser_grids(matrix, found.top, len(found.values) - found.top, levels=2)
    changes = np.abs(np.diff([found.values, *grids], axis=0))
    if not len(changes):
        return np.full(len(found.values), np.inf)
    last = np.where(np.isnan(changes[0]), np.inf, changes[0])
    return np.asarray(np.fmax(last, EARLIER_SHARE * changes[1]) if len(changes) > 1 else last)


def _coarser_grids(matrix: KernelMatrix, top: int, bottom: int, levels: int) -> list[Floats]:
    """The eigenvalues of these ranks on successively coarser bases; NaN where there is none."""
    from scipy.sparse import csr_array

    found: list[Floats] = []
    basis, array = matrix.basis, matrix.symmetric
    for _ in range(levels):
        coarser = basis.coarsened()
        if coarser is None:
            break
        basis, embedding = coarser[0], csr_array(coarser[1])
        array = compressed(array, embedding)
        upper, lower = end_values(array, np.asarray(basis.constant), top, bottom)
        found.append(np.concatenate([_padded(upper, top), _padded(lower, bottom)[::-1]]))
    return found


def _padded(values: Floats, length: int) -> Floats:
    return np.concatenate([values, np.full(length - len(values), np.nan)])
