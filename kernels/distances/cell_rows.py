"""Kernel matrices as kernels between points: the middle angles of their cells."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...checks import Floats
from ...errors import InputError
from ..matrices.matrix import KernelMatrix
from ..matrices.matrix_pair import check_same_basis
from .transport import grid_wasserstein, power_mean

# From two arrays of probabilities, shape (..., n, n), to their distances, shape (...).
RowsDistance = Callable[[Floats, Floats], Floats]


def stochastic_rows(matrix: KernelMatrix) -> Floats:
    """The rows of a matrix on cells, divided by their sums."""
    if not matrix.basis.is_partition:
        raise InputError(
            f"matrix: expected one on Bins, got one in {matrix.basis!r}; discretise on Bins, or use kind='pseudometric'"
        )
    array = matrix.array
    return np.asarray(array / array.sum(axis=1, keepdims=True))


def cell_middles(edges: Floats) -> Floats:
    """The middle angles of the cells between edges."""
    return np.asarray(0.5 * (edges[1:] + edges[:-1]))


def distance_of_rows(matrix: KernelMatrix, order: float, sup: bool) -> RowsDistance:
    """The row-wise W_p, averaged or at most, of kernels on the cells of a matrix."""
    points, weights = cell_middles(matrix.basis.edges), matrix.weights

    def between(one: Floats, other: Floats) -> Floats:
        one, other = np.broadcast_arrays(one, other)
        rows = grid_wasserstein(one, other, points, order)
        return np.asarray(rows.max(axis=-1)) if sup else power_mean(rows, weights, order)

    return between


def check_comparable(first: KernelMatrix, second: KernelMatrix) -> None:
    """Raise an InputError unless both are on the same cells and in the same convention."""
    for matrix in (first, second):
        stochastic_rows(matrix)
    check_same_basis(first, second)
