"""A permutation test whether two empirical kernels come from one law."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats, Rng, check_memory, choice, generator, instance, number_between, whole_number
from ...core.errors import InputError
from ...core.estimates import Summary
from ..matrices.matrix import KernelMatrix
from ..sampling.counts import Counts
from .transport import (
    all_distances,
    check_comparable,
    chunks,
    distance_of_rows,
    null_distances,
    pooled_rows,
    rows_of_counts,
    stochastic_rows,
    wasserstein_order,
)


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
