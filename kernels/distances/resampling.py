"""Resampled counts of empirical kernels: the distances that chance alone makes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ..matrices.matrix import KernelMatrix, check_same_basis
from ..sampling.counts import Counts
from .transport import grid_wasserstein, power_mean

# From two arrays of probabilities, shape (..., n, n), to their distances, shape (...).
RowsDistance = Callable[[Floats, Floats], Floats]
# Resamples whose mean is the noise floor, good to a tenth or so, and whose spread is in the error.
RESAMPLES = 32
# How many of their standard deviations above the mean the upper limit of 95 % is: more than the 1.65 of normal ones,
# as the spread is that of 32; the largest of many rows has a longer tail.
DEVIATIONS, DEVIATIONS_OF_SUPREMUM = 1.96, 2.5
SEED = 0
# Counts held at a time.
CHUNK = 2**22


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


def rows_of_counts(counts: Counts, pooled: Floats) -> Floats:
    """Counts of pairs, shape (..., n, n), as probabilities; rows without a pair are those of the pooled kernel."""
    total = counts.sum(axis=-1, keepdims=True)
    return np.asarray(np.where(total > 0, counts / np.maximum(total, 1), pooled))


def pooled_rows(first: KernelMatrix, second: KernelMatrix) -> Floats:
    """The kernel that both have if they are equal: that of an exact one, else of all counts together."""
    for matrix in (first, second):
        if matrix.counts is None:
            return stochastic_rows(matrix)
    assert first.counts is not None and second.counts is not None  # the loop returned otherwise
    return rows_of_counts(first.counts + second.counts, stochastic_rows(first))


def resampled(counts: Counts, rows: Floats, number: int, rng: np.random.Generator) -> Iterator[Counts]:
    """As many pairs from each cell as were counted, sent on by ``rows``, again and again; chunks of (., n, n)."""
    total = counts.sum(axis=1)
    size = len(total)
    chunk = max(1, CHUNK // size**2)
    probability = np.maximum(rows, 0.0)
    probability = probability / probability.sum(axis=1, keepdims=True)
    for start in range(0, number, chunk):
        yield rng.multinomial(total, probability, size=(min(chunk, number - start), size))


def noise_floor(first: KernelMatrix, second: KernelMatrix, order: float, sup: bool) -> float | None:
    """The mean distance of samples of these sizes from one and the same law; None where nothing was counted."""
    if first.counts is None and second.counts is None:
        return None
    common, rng = pooled_rows(first, second), np.random.default_rng(SEED)
    return float(np.mean(null_distances(first, second, common, (order, sup), RESAMPLES, rng)))


def null_distances(
    first: KernelMatrix,
    second: KernelMatrix,
    common: Floats,
    measured: tuple[float, bool],
    number: int,
    rng: np.random.Generator,
) -> Floats:
    """Distances of resamples of both from a common kernel; a matrix without counts is that kernel itself."""
    between = distance_of_rows(first, *measured)
    found = []
    draws = [_draws(matrix, common, number, rng) for matrix in (first, second)]
    for one, other in zip(*draws, strict=True):
        found.append(np.atleast_1d(between(one, other)))
    return np.concatenate(found)


def _draws(matrix: KernelMatrix, common: Floats, number: int, rng: np.random.Generator) -> Iterator[Floats]:
    if matrix.counts is not None:
        for counts in resampled(matrix.counts, common, number, rng):
            yield rows_of_counts(counts, common)
        return
    chunk = max(1, CHUNK // common.size)
    for start in range(0, number, chunk):
        yield np.broadcast_to(common, (min(chunk, number - start), *common.shape))


def matrices_error(first: KernelMatrix, second: KernelMatrix, order: float, sup: bool) -> float:
    """How far the distance of two matrices may be from that of their laws: as far as both matrices are from theirs.

    Where pairs were counted, the distance of resamples from the sample tells how far: its mean, and its deviation by a
    quantile, the deviations of two samples being independent. Else it is what the Frobenius error E of ``symmetric``
    allows: W_1 <= pi/2 sum_j |dP_ij|, whose mean over i is at most pi/2 E by Cauchy and Schwarz, and whose largest
    value is at most pi/2 E / sqrt(w_i); and W_p^p <= pi^(p - 1) W_1.
    """
    known, mean, variance = 0.0, 0.0, 0.0
    for matrix in (first, second):
        if matrix.counts is None:
            error = float(matrix.error) / (float(np.sqrt(matrix.weights.min())) if sup else 1.0)
            known += float(np.pi * min(0.5 * error, 1.0) ** (1.0 / order))
            continue
        own = stochastic_rows(matrix)
        between = distance_of_rows(matrix, order, sup)
        draws = resampled(matrix.counts, own, RESAMPLES, np.random.default_rng(SEED))
        found = np.concatenate([between(rows_of_counts(counts, own), own) for counts in draws])
        mean += float(np.mean(found))
        variance += float(np.var(found, ddof=1))
    return known + mean + (DEVIATIONS_OF_SUPREMUM if sup else DEVIATIONS) * float(np.sqrt(variance))
