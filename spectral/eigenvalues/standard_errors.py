"""Sampling errors of eigenvalues, by the delta method and by the bootstrap."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import Floats, Rng, check_memory, generator, number_between, whole_number
from ...core.errors import InputError
from ...core.estimates import NORMAL_95, student_95
from ...kernels.sampling.counts import missed_fraction

if TYPE_CHECKING:
    from scipy.sparse import csr_array

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
        each = np.array([_quadratic_forms(replicate, vectors) for replicate in matrix.replicates])
        errors = np.asarray(each.std(axis=0, ddof=1) / np.sqrt(len(each)))
    elif matrix.counts is not None:
        errors = np.sqrt(_count_variances(matrix, vectors))
    if matrix.samples == 0:
        return errors
    beside = np.maximum(1.0 - (matrix.basis.constant @ vectors) ** 2, 0.0)
    return np.maximum(errors, 2.0 * missed_fraction(matrix.samples) * beside / sampling_quantile(matrix))


def _quadratic_forms(symmetric: Floats | csr_array[Any], vectors: Floats) -> Floats:
    return np.asarray(np.sum(vectors * (symmetric @ vectors), axis=0))


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


def bootstrap_intervals(
    matrix: KernelMatrix, k: int, rng: Rng = None, resamples: int = 200, level: float = 0.95
) -> Floats:
    """Basic bootstrap intervals of the k largest eigenvalues off the constants, shape (k, 2), largest first.

    Parameters
    ----------
    matrix : KernelMatrix
        A sampled matrix on bins with counts, which are resampled pair by pair.
    k : int
        Number of eigenvalues.
    rng : None, int or numpy.random.Generator
    resamples : int
    level : float
        Nominal coverage.

    Raises
    ------
    InputError
        If the matrix has no counts.

    Notes
    -----
    The interval is [2 x - q_high, 2 x - q_low] with the quantiles q of the resampled values. It does not assume
    normality, so it checks the delta method. Both are unreliable if a bin has few pairs.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> rng = np.random.default_rng(0)
    >>> P = ker.discretise(ker.maxwell(0.5), ker.Bins(4), method="monte-carlo", samples=4000, rng=rng)
    >>> low, high = bootstrap_intervals(P, 1, rng)[0]
    >>> bool(low < high)
    True
    """
    if matrix.counts is None or not matrix.basis.is_partition:
        raise InputError("matrix: expected a matrix sampled in bins, with counts; use sampling_errors for others")
    whole_number("k", k, 1)
    whole_number("resamples", resamples, 2)
    check_memory("resamples", "the table of draws", resamples * matrix.size**2)
    level = number_between("level", level, 0.0, 1.0)
    counts = np.asarray(matrix.counts)
    number = int(counts.sum())
    drawn = generator(rng).multinomial(number, (counts / number).ravel(), size=resamples).reshape(-1, *counts.shape)
    everything = np.concatenate([counts[None], drawn])
    values = _leading_values(everything, np.asarray(matrix.weights), k, symmetrised=matrix.symmetrised)
    tail = 0.5 * (1.0 - level)
    low, high = np.quantile(values[1:], [tail, 1.0 - tail], axis=0)
    return np.stack([2.0 * values[0] - high, 2.0 * values[0] - low], axis=1)


def _leading_values(counts: Floats, weights: Floats, k: int, *, symmetrised: bool) -> Floats:
    """The largest eigenvalues off the constants of many matrices of counts at once, shape (matrices, k)."""
    counts = counts.astype(np.float64)
    if symmetrised:
        flux = counts / counts.sum(axis=(1, 2), keepdims=True)
    else:
        flux = weights[:, None] * counts / np.maximum(counts.sum(axis=2, keepdims=True), 1.0)
    root = np.sqrt(weights)
    flux = 0.5 * (flux + np.swapaxes(flux, 1, 2)) / (root[:, None] * root)
    # the constants are moved below all other eigenvalues
    shifted = flux - 3.0 * np.outer(root, root)
    return np.asarray(np.linalg.eigvalsh(shifted)[:, ::-1][:, :k])
