"""Standard errors of eigenvalues of sampled matrices, by the delta method."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from ..kernels import KernelMatrix


def sampling_errors(matrix: KernelMatrix, vectors: Floats, values: Floats) -> Floats:
    """One standard error of each eigenvalue, shape (k,); zeros for matrices that were not sampled.

    To first order an eigenvalue moves by v^T (S_hat - S) v. Where the matrix keeps its independent randomisations,
    the spread of v^T S_r v over them is used; otherwise the multinomial variance of the counts in each row.
    """
    if len(matrix.replicates) > 1:
        each = np.array([_quadratic_forms(replicate, vectors) for replicate in matrix.replicates])
        return np.asarray(each.std(axis=0, ddof=1) / np.sqrt(len(each)))
    if matrix.counts is not None:
        return np.sqrt(_count_variances(matrix, vectors))
    return np.zeros(len(values))


def _quadratic_forms(symmetric: Floats | csr_array[Any], vectors: Floats) -> Floats:
    return np.asarray(np.sum(vectors * (symmetric @ vectors), axis=0))


def _count_variances(matrix: KernelMatrix, vectors: Floats) -> Floats:
    """Variance of the mean of phi(i) phi(j) over the counted pairs, phi = v / sqrt(w).

    Where rows were normalised, i is fixed and each row an independent multinomial; else all pairs are one.
    """
    counts = np.asarray(matrix.counts, dtype=np.float64)
    weights = np.asarray(matrix.weights)
    phi = vectors / np.sqrt(weights)[:, None]
    if matrix.symmetrised:
        shares = counts / counts.sum()
        mean = np.sum(phi * (shares @ phi), axis=0)
        spread = np.sum(phi**2 * (shares @ phi**2), axis=0) - mean**2
        return np.asarray(np.maximum(spread, 0.0) / counts.sum())
    totals = np.maximum(counts.sum(axis=1), 1.0)
    shares = counts / totals[:, None]
    spread = np.maximum(shares @ phi**2 - (shares @ phi) ** 2, 0.0)
    return np.asarray(((weights[:, None] * phi) ** 2 * spread / totals[:, None]).sum(axis=0))
