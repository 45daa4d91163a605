"""Wasserstein distances between many pairs of distributions on an interval, of resampled counts and by chance alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ...core.checks import (
    Floats,
    Rng,
    check_memory,
    choice,
    finite_number,
    generator,
    instance,
    number_between,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import Summary
from ...core.long_runs import NUMBERS_AT_ONCE, progress_bar
from ...core.rounding import EPS
from ..expectations.conditionals import SMALLEST_STEP, Distributions
from ..matrices.matrix import KernelMatrix, check_same_basis
from ..sampling.counts import Counts, missed_fraction

# If the ends of a piece agree to this fraction, divided by p^(4/5), two terms of the series about the middle are used.
# The divided difference would then lose more digits than the third term, 1/1920 of the fourth power, contributes.
EQUAL_ENDS = (1920.0 * EPS) ** 0.2


def wasserstein(first: Distributions, second: Distributions, order: float = 1.0) -> Floats:
    r"""The exact W_p between corresponding distributions, shape (rows,).

    W_p^p is the integral over t in (0, 1) of the p-th power of the absolute difference of the two quantile functions.
    Between neighbouring levels of the two functions this difference is linear in t, and its power is integrated in
    closed form.

    Examples
    --------
    >>> one = Distributions.of_atoms(np.array([[0.0, 1.0]]), np.array([[0.5, 0.5]]))
    >>> other = Distributions.of_atoms(np.array([[0.5]]), np.array([[1.0]]))
    >>> wasserstein(one, other, 2.0).tolist()
    [0.5]
    """
    levels = np.sort(np.concatenate((first.level, second.level), axis=1), axis=1)
    width = np.diff(levels, axis=1)
    quarter, three = levels[:, :-1] + 0.25 * width, levels[:, :-1] + 0.75 * width
    early = first.quantile(quarter) - second.quantile(quarter)
    late = first.quantile(three) - second.quantile(three)
    # steps of zero width have arbitrary quantiles
    start, end = (np.where(width > 0.0, side, 0.0) for side in (1.5 * early - 0.5 * late, 1.5 * late - 0.5 * early))
    # divided by the largest, because powers of angles underflow or overflow at high orders
    largest = np.maximum(np.abs(start), np.abs(end)).max(axis=1, initial=0.0)
    unit = np.where(largest > 0.0, largest, 1.0)[:, None]
    power = np.sum(width * _mean_power(start / unit, end / unit, order), axis=1)
    return np.asarray(largest * power ** (1.0 / order))


def absolute_area(width: Floats, start: Floats, middle: Floats, end: Floats) -> Floats:
    """The integrals of abs(f), shape (rows,), for piecewise quadratic f, from its values at ends and middles of pieces.

    All arrays have the shape (rows, pieces).

    Examples
    --------
    >>> values = (np.array([[x - 0.25]]) for x in (0.0, 0.5, 1.0))
    >>> absolute_area(np.ones((1, 1)), *values).tolist()
    [0.3125]
    """
    area = np.abs(start + 4.0 * middle + end) / 6.0
    signs = np.stack((start, middle, end))
    mixed = (signs.max(axis=0) > 0.0) & (signs.min(axis=0) < 0.0)
    if mixed.any():
        start, middle, end = signs[:, mixed]
        # f(t) = start + slope t + bend t^2 for t in (0, 1)
        slope, bend = 4.0 * middle - 3.0 * start - end, 2.0 * (start + end - 2.0 * middle)
        root = np.sqrt(np.maximum(slope * slope - 4.0 * bend * start, 0.0))
        sum_of_both = -0.5 * (slope + np.where(slope < 0.0, -root, root))
        zeros = [
            np.clip(np.divide(top, base, out=np.zeros_like(top), where=np.abs(base) > SMALLEST_STEP), 0.0, 1.0)
            for top, base in ((sum_of_both, bend), (start, sum_of_both))
        ]
        cut = np.stack((np.zeros_like(slope), np.minimum(*zeros), np.maximum(*zeros), np.ones_like(slope)))
        primitive = cut * (start + cut * (0.5 * slope + cut * bend / 3.0))
        area[mixed] = np.abs(np.diff(primitive, axis=0)).sum(axis=0)
    return np.asarray((width * area).sum(axis=1))


def _mean_power(start: Floats, end: Floats, order: float) -> Floats:
    """The mean of |f|^p for a linear function f between two values."""
    rise, middle = end - start, 0.5 * (start + end)
    flat = np.abs(rise) <= EQUAL_ENDS / order**0.8 * np.maximum(np.abs(start), np.abs(end))
    bend = order * rise / np.where(flat & (middle != 0.0), middle, np.inf)
    near = np.abs(middle) ** order * (1.0 + (1.0 - 1.0 / order) * bend**2 / 24.0)
    primitive = [np.sign(value) * np.abs(value) ** (order + 1.0) / (order + 1.0) for value in (start, end)]
    return np.where(flat, near, (primitive[1] - primitive[0]) / np.where(flat, 1.0, rise))


def power_mean(values: Floats, weights: Floats, order: float) -> Floats:
    """(sum_j w_j v_j^p)^(1/p) over the last axis, for nonnegative values and any order p.

    Examples
    --------
    >>> float(power_mean(np.array([3.0, 3.0]), np.array([0.5, 0.5]), 1e6))
    3.0
    """
    largest = np.asarray(values.max(axis=-1, initial=0.0))
    unit = np.where(largest > 0.0, largest, 1.0)
    return np.asarray(largest * ((values / unit[..., None]) ** order @ weights) ** (1.0 / order))


def wasserstein_order(order: float) -> float:
    """The checked order p of a Wasserstein distance, a finite number of at least 1."""
    power = finite_number("order", order)
    if power < 1.0:
        raise InputError(f"order: expected a number of at least 1, got {order!r}")
    return power


def grid_wasserstein(first: Floats, second: Floats, points: Floats, order: float = 1.0) -> Floats:
    """W_p between corresponding probability vectors on the same increasing points, shape ``first.shape[:-1]``.

    For p = 1 it is the integral of the absolute difference of the distribution functions, without sorting.
    """
    if order == 1.0:
        return np.asarray(np.abs(np.cumsum(first - second, axis=-1)[..., :-1]) @ np.diff(points))
    flat = [np.reshape(array, (-1, points.size)) for array in (first, second)]
    one, other = (Distributions.of_atoms(np.broadcast_to(points, array.shape), array) for array in flat)
    return wasserstein(one, other, order).reshape(first.shape[:-1])


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


@dataclass(frozen=True, repr=False)
class DifferenceTest(Summary):
    """The outcome of `difference_test`.

    Attributes
    ----------
    statistic : float
        The distance of the two empirical kernels.
    p_value : float
        The probability of a distance at least as large if both laws are the same; at least 1 / (1 + permutations).
    null : ndarray, shape (permutations,)
        The distances after the permutations; their mean is the noise floor.
    """

    statistic: float
    p_value: float
    null: Floats
    _show = "statistic noise_floor p_value"

    @property
    def noise_floor(self) -> float:
        """The mean distance if both laws are the same."""
        return float(np.mean(self.null))

    def differs(self, level: float = 0.05) -> bool:
        """Whether the laws differ at this level, the largest probability of a false alarm."""
        return self.p_value <= number_between("level", level, 0.0, 1.0)


def difference_test(
    first: KernelMatrix,
    second: KernelMatrix,
    order: float = 1,
    kind: str = "rows",
    permutations: int = 999,
    rng: Rng = None,
) -> DifferenceTest:
    r"""Test whether two laws are the same, from two empirical matrices or from an empirical and an exact matrix.

    Parameters
    ----------
    first, second : KernelMatrix
        Matrices on the same bins. At least one has counts of independent pairs, from `estimate` or from `discretise`
        by ``"monte-carlo"``. Counts by ``"qmc"`` are more even than independent pairs: the test is then conservative.
    order, kind
        As in `distance`; kind is ``"rows"`` or ``"sup"``.
    permutations : int
        Number of permutations, at least 19.
    rng : None, int or numpy.random.Generator
        Source of the permutations; by default a generator with a fixed seed.

    Returns
    -------
    DifferenceTest

    Raises
    ------
    InputError
        If the bins differ, the order is not a number of at least 1, or neither matrix has counts.

    Notes
    -----
    Two samples: if the laws are equal, pairs with incoming angles in the same cell are exchangeable. The pairs of each
    cell are redistributed between the samples (a multivariate hypergeometric draw). The p-value
    (1 + number of distances not smaller) / (1 + permutations) is valid for every number of pairs. One sample: its pairs
    are drawn anew from the exact matrix, cell by cell. The test is valid if the incoming angles follow the invariant
    measure within each cell, or if the law hardly varies within a cell.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> rng = np.random.default_rng(0)
    >>> theta = ker.SINE.sample(2000, rng)
    >>> rough, smooth = (ker.estimate(theta, ker.maxwell(a).sample(theta, rng), ker.Bins(8)) for a in (0.5, 0.3))
    >>> difference_test(rough, smooth).differs(), difference_test(rough, rough).p_value
    (True, 1.0)
    """
    instance("first", first, KernelMatrix, "ker.discretise(law, ker.Bins(64))")
    instance("second", second, KernelMatrix, "ker.discretise(law, ker.Bins(64))")
    check_comparable(first, second)
    choice("kind", kind, ("rows", "sup"))
    number = whole_number("permutations", permutations, 19)
    check_memory("permutations", "the distribution", number)
    source = generator(rng, 0)
    if first.counts is None and second.counts is None:
        raise InputError("difference_test: expected counts in one matrix at least; of exact laws take the distance")
    common, measured = pooled_rows(first, second), (wasserstein_order(order), kind == "sup")
    if first.counts is None or second.counts is None:
        null = null_distances(first, second, common, measured, number, source)
    else:
        pairs = _permuted(first.counts, second.counts, stochastic_rows(first), number, source)
        null = all_distances(distance_of_rows(first, *measured), pairs, number, "permutation", "test")
    pair = [
        stochastic_rows(matrix) if matrix.counts is None else rows_of_counts(matrix.counts, common)
        for matrix in (first, second)
    ]
    statistic = float(distance_of_rows(first, *measured)(*pair))
    # distances of equal tables may differ by rounding and count as equal
    not_smaller = int(np.count_nonzero(null >= statistic * (1.0 - 1e-12)))
    return DifferenceTest(statistic, (1 + not_smaller) / (1 + number), null)


def _permuted(
    counts: Counts, other: Counts, rows: Floats, number: int, rng: np.random.Generator
) -> Iterator[tuple[Floats, Floats]]:
    """Pairs of kernels after redistributing the pairs of each incoming cell between the two samples."""
    pooled, sizes = counts + other, counts.sum(axis=1)
    common = rows_of_counts(pooled, rows)
    for size in chunks(number, pooled.size):
        dealt = [
            rng.multivariate_hypergeometric(row, int(drawn), size=size, method="marginals")
            for row, drawn in zip(pooled, sizes, strict=True)
        ]
        first = np.stack(dealt, axis=1)
        yield rows_of_counts(first, common), rows_of_counts(pooled - first, common)
