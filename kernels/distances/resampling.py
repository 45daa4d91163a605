"""Distances between resampled counts of empirical kernels, for noise floors and errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ...core.long_runs import NUMBERS_AT_ONCE, progress_bar
from ..matrices.matrix import KernelMatrix, check_same_basis
from ..sampling.counts import Counts, missed_fraction
from .transport import grid_wasserstein, power_mean

# From two arrays of probabilities, shape (..., n, n), to their distances, shape (...).
RowsDistance = Callable[[Floats, Floats], Floats]
# Resamples for the noise floor, to about 10 %, and for the errors.
RESAMPLES = 32
# Upper limit of 95 % in standard deviations above the mean. It is larger than the normal 1.65 because the deviation is
# estimated from 32 resamples. The maximum over many incoming angles has a longer tail.
DEVIATIONS, DEVIATIONS_OF_SUPREMUM = 1.96, 2.5
SEED = 0


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
    """A function for the mean or the maximum over rows of W_p, for kernels on the cells of a matrix."""
    points, weights = cell_middles(matrix.basis.edges), matrix.weights

    def between(one: Floats, other: Floats) -> Floats:
        one, other = np.broadcast_arrays(one, other)
        rows = grid_wasserstein(one, other, points, order)
        return np.asarray(rows.max(axis=-1)) if sup else power_mean(rows, weights, order)

    return between


def check_comparable(first: KernelMatrix, second: KernelMatrix) -> None:
    """Raise an InputError unless both matrices are on the same cells and in the same convention."""
    for matrix in (first, second):
        stochastic_rows(matrix)
    check_same_basis(first, second)


def rows_of_counts(counts: Counts, pooled: Floats) -> Floats:
    """Counts of pairs, shape (..., n, n), as probabilities; rows without pairs are taken from the pooled kernel."""
    total = counts.sum(axis=-1, keepdims=True)
    return np.asarray(np.where(total > 0, counts / np.maximum(total, 1), pooled))


def pooled_rows(first: KernelMatrix, second: KernelMatrix) -> Floats:
    """The common kernel if both laws are equal: the kernel of an exact matrix, else of the pooled counts."""
    for matrix in (first, second):
        if matrix.counts is None:
            return stochastic_rows(matrix)
    assert first.counts is not None and second.counts is not None  # the loop returned otherwise
    return rows_of_counts(first.counts + second.counts, stochastic_rows(first))


def noise_floor(first: KernelMatrix, second: KernelMatrix, order: float, sup: bool) -> float | None:
    """The mean distance of samples of these sizes from one law; None if neither matrix has counts."""
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
    """Distances between resamples of both matrices from a common kernel, which replaces a matrix without counts."""
    draws = [_draws(matrix, common, number, rng) for matrix in (first, second)]
    return all_distances(distance_of_rows(first, *measured), zip(*draws, strict=True), number, "sample", "distance")


def all_distances(
    between: RowsDistance, pairs: Iterable[tuple[Floats, Floats]], number: int, unit: str, title: str
) -> Floats:
    """The distances of all pairs of tables, shape (number,), with a progress bar."""
    found = []
    with progress_bar(number, unit, title) as bar:
        for one, other in pairs:
            found.append(between(one, other))
            bar.update(found[-1].size)
    return np.concatenate(found)


def _draws(matrix: KernelMatrix, common: Floats, number: int, rng: np.random.Generator) -> Iterator[Floats]:
    """Kernels of ``number`` resamples of a matrix's counts by a common kernel, with the same row sums, in chunks."""
    for size in chunks(number, common.size):
        if matrix.counts is None:
            yield np.broadcast_to(common, (size, *common.shape))
        else:
            probability = np.maximum(common, 0.0)
            probability = probability / probability.sum(axis=1, keepdims=True)
            drawn = rng.multinomial(matrix.counts.sum(axis=1), probability, size=(size, len(common)))
            yield rows_of_counts(drawn, common)


def chunks(number: int, size: int) -> list[int]:
    """How many tables of a size are computed at a time, of ``number`` in total."""
    most = max(1, NUMBERS_AT_ONCE // size)
    return [min(most, number - start) for start in range(0, number, most)]


def matrices_error(first: KernelMatrix, second: KernelMatrix, order: float, sup: bool) -> float:
    """Error of the distance of two matrices: the sum of the distances of both matrices from their laws.

    For a matrix with counts it is the mean distance of resamples from the sample, plus a multiple of the standard
    deviation, and at least pi p^(1/order) with the probability p of an event that no ray met, see `missed_fraction`: of
    all rays, or of those of the row with the fewest. Otherwise the Frobenius error E of ``symmetric`` gives a bound:
    W_1 <= pi/2 sum_j |dP_ij|, with a mean over i of at most pi/2 E by Cauchy and Schwarz and a maximum of pi/2 E /
    sqrt(w_i); W_p^p <= pi^(p - 1) W_1.
    """
    known, mean, variance, missed = 0.0, 0.0, 0.0, 0.0
    for matrix in (first, second):
        if matrix.counts is None:
            error = float(matrix.error) / (float(np.sqrt(matrix.weights.min())) if sup else 1.0)
            known += float(np.pi * min(0.5 * error, 1.0) ** (1.0 / order))
            continue
        own, rays = stochastic_rows(matrix), matrix.counts.sum(axis=1)
        missed += float(np.pi * missed_fraction(max(int(rays.min() if sup else rays.sum()), 1)) ** (1.0 / order))
        between = distance_of_rows(matrix, order, sup)
        draws = ((rows, own) for rows in _draws(matrix, own, RESAMPLES, np.random.default_rng(SEED)))
        found = all_distances(between, draws, RESAMPLES, "sample", "distance: error")
        mean += float(np.mean(found))
        variance += float(np.var(found, ddof=1))
    spread = mean + (DEVIATIONS_OF_SUPREMUM if sup else DEVIATIONS) * float(np.sqrt(variance))
    return known + max(spread, missed)
