"""Sampling errors of eigenvalues, by the delta method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...core.checks import Floats
from ...core.estimates import NORMAL_95, student_95
from ...kernels.sampling.counts import missed_fraction

if TYPE_CHECKING:
    from ...kernels import KernelMatrix


def sampling_quantile(matrix: KernelMatrix) -> float:
    """Half width of a 95 % interval in standard errors of `sampling_errors`."""
    return student_95(len(matrix.replicates)) if len(matrix.replicates) > 1 else NORMAL_95


def sampling_errors(matrix: KernelMatrix, vectors: Floats, values: Floats) -> Floats:
    """One standard error of each eigenvalue, shape (k,); zeros for unsampled matrices.

    To first order an eigenvalue changes by v^T (S_hat - S) v. If the matrix has replicates, the spread of v^T S_r v
    over them is used; otherwise the multinomial variance of the counts. An event that no ray met, of probability p at
    all angles, changes an eigenvalue by at most 2 p; see `missed_fraction`.
    """
    errors = np.zeros(len(values))
    if len(matrix.replicates) > 1:
        each = np.array([np.sum(vectors * (replicate @ vectors), axis=0) for replicate in matrix.replicates])
        errors = np.asarray(each.std(axis=0, ddof=1) / np.sqrt(len(each)))
    elif matrix.counts is not None:
        errors = np.sqrt(_count_variances(matrix, vectors))
    if matrix.samples == 0:
        return errors
    beside = np.maximum(1.0 - (matrix.basis.constant @ vectors) ** 2, 0.0)
    return np.maximum(errors, 2.0 * missed_fraction(matrix.samples) * beside / sampling_quantile(matrix))


def _count_variances(matrix: KernelMatrix, vectors: Floats) -> Floats:
    """Variance of the mean of phi(i) phi(j) over the counted pairs, phi = v / sqrt(w).

    If rows were normalised, each row i is an independent multinomial sample; otherwise all pairs are one sample.
    """
    counts = np.asarray(matrix.counts, dtype=np.float64)
    weights = np.asarray(matrix.weights)
    phi = vectors / np.sqrt(weights)[:, None]
    # one product for the means of phi and of its square, before any division of the counts
    means = counts @ np.column_stack([phi, phi**2, np.ones(len(phi))])
    first, square, totals = means[:, : phi.shape[1]], means[:, phi.shape[1] : -1], means[:, -1]
    if matrix.symmetrised:
        number = totals.sum()
        mean = np.sum(phi * first, axis=0) / number
        spread = np.sum(phi**2 * square, axis=0) / number - mean**2
        return np.asarray(np.maximum(spread, 0.0) / number)
    totals = np.maximum(totals, 1.0)[:, None]
    spread = np.maximum(square / totals - (first / totals) ** 2, 0.0)
    return np.asarray(((weights[:, None] * phi) ** 2 * spread / totals).sum(axis=0))
