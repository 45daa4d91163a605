"""Defects and their z-scores, against enumerated moments and the distributions of scipy."""

import itertools
import pickle

import numpy as np
import pytest
from scipy.stats import chi2, gamma, norm, t

from asperity.kernels.matrices import defects
from asperity.kernels.matrices.defects import (
    SYMMETRY_NORM,
    Defect,
    SymmetryDefect,
    defect_of_pairs,
    invariance_z_score,
    occupied_pairs,
    relative_asymmetry,
    replicate_z_score,
    reversibility_z_score,
    row_blocks,
)


def score_of(statistic: float, mean: float, variance: float) -> float:
    """The normal score of a scaled chi-square of this mean and variance, by its distribution."""
    shape = mean**2 / variance
    return float(norm.isf(gamma.sf(statistic, shape, scale=mean / shape)))


def paired_counts(forth: list[int], back: list[int], size: int) -> np.ndarray:
    counts = np.diag(np.full(size, 7))
    places = list(itertools.combinations(range(size), 2))
    for (i, j), one, other in zip(places, forth, back, strict=False):
        counts[i, j], counts[j, i] = one, other
    return counts


@pytest.mark.parametrize("excess", [0, 5, 20, 40])
def test_scores_of_many_counts_are_those_of_a_chi_square(excess: int) -> None:
    rng = np.random.default_rng(0)
    forth = 10_000 + rng.integers(-100, 100, size=45) + excess
    back = 20_000 - forth + 2 * rng.integers(-30, 30, size=45)
    pairs = forth + back
    statistic = float(np.sum((forth - back) ** 2 / pairs))
    score = reversibility_z_score(paired_counts(list(forth), list(back), 10))
    assert score == pytest.approx(norm.isf(chi2.sf(statistic, 45)), abs=0.015)


@pytest.mark.parametrize("total", [2, 3, 5])
def test_scores_of_few_counts_have_their_enumerated_moments(total: int) -> None:
    # one way of each number, likely as its binomial, ten pairs of cells in all
    first = np.arange(total + 1)
    likely = np.array([float(np.prod([(total - k) / (k + 1) for k in range(j)])) for j in first]) / 2.0**total
    square = (2.0 * first - total) ** 2 / total
    mean, variance = likely @ square, likely @ square**2 - (likely @ square) ** 2
    assert mean == pytest.approx(1.0)
    for several in ([total] * 10, [0] * 5 + [total - 1] * 5, [1] * 10, [total, total - 1] * 5):
        statistic = sum(square[k] for k in several)
        found = reversibility_z_score(paired_counts(several, [total - k for k in several], 5))
        # farther out the cube root of a chi-square is no longer normal
        if 5.0 < statistic < 40.0:
            assert found == pytest.approx(score_of(statistic, 10.0 * mean, 10.0 * variance), abs=0.06)
    single = paired_counts([total] * 10, [0] * 10, 5)
    assert reversibility_z_score(single.T) == reversibility_z_score(single) > 2.0


def test_single_transitions_and_no_transitions_say_nothing() -> None:
    assert reversibility_z_score(np.diag([3, 4])) == 0.0
    assert reversibility_z_score(np.array([[3, 1], [0, 4]])) == 0.0
    told = paired_counts([9, 12, 30], [4, 13, 11], 4)
    more = paired_counts([9, 12, 30, 1, 0, 1], [4, 13, 11, 0, 1, 0], 4)
    assert reversibility_z_score(told) == reversibility_z_score(more)
    # two of two the same way, of variance 1: they count
    assert reversibility_z_score(np.array([[3, 2], [0, 4]])) == pytest.approx(score_of(2.0, 1.0, 1.0), abs=0.06)
    assert reversibility_z_score(paired_counts([5], [5], 2)) < -1.5


@pytest.mark.parametrize("weights", [[0.2] * 5, [0.1, 0.15, 0.2, 0.25, 0.3]])
@pytest.mark.parametrize("number", [1, 2, 5])
def test_the_score_of_incoming_angles_has_enumerated_moments(weights: list[float], number: int) -> None:
    fraction = np.array(weights)
    statistics, likely = [], []
    for draws in itertools.product(range(5), repeat=number):
        totals = np.bincount(draws, minlength=5)
        statistics.append(float(np.sum((totals - number * fraction) ** 2 / (number * fraction))))
        likely.append(float(np.prod(fraction[list(draws)])))
    statistics, likely = np.array(statistics), np.array(likely)
    mean = likely @ statistics
    variance = likely @ statistics**2 - mean**2
    if variance < 1e-6:
        # one draw of equal cells is no statistic
        assert invariance_z_score(np.array([1, 0, 0, 0, 0]), fraction) == 0.0
        return
    assert mean == pytest.approx(4.0)
    for totals in ([number, 0, 0, 0, 0], [number - 1, 0, 0, 1, 0], [0, 0, 0, 0, number]):
        totals = np.array(totals)
        statistic = float(np.sum((totals - number * fraction) ** 2 / (number * fraction)))
        expected = score_of(statistic, 4.0, variance)
        if 0.5 < statistic < 12.0:
            assert invariance_z_score(totals, fraction) == pytest.approx(expected, abs=0.06)


def test_the_score_of_many_incoming_angles_is_that_of_pearson() -> None:
    fraction = np.array([0.1, 0.2, 0.3, 0.4])
    for shift in (0, 100, 200):
        totals = np.array([10_000, 20_000, 30_000, 40_000]) + shift * np.array([1, -1, 1, -1])
        expected = 1e5 * fraction
        statistic = float(np.sum((totals - expected) ** 2 / expected))
        if shift:
            score = norm.isf(chi2.sf(statistic, 3))
            assert invariance_z_score(totals, fraction) == pytest.approx(score, abs=0.05)
        else:
            assert invariance_z_score(totals, fraction) < -3.0
    assert invariance_z_score(np.array([7]), np.array([1.0])) == 0.0


def test_one_number_a_part_has_a_student_score_with_the_fitted_freedom() -> None:
    """Numbers that are 2 or 0 seem to vary in less than one dimension; the freedom of one is 3.4."""
    numbers = np.array([2.0, 0.0, 2.0, 2.0, 0.0, 0.0, 0.0, 2.0])
    products = np.array([4.0] * 6 + [0.0] * 22)
    ratio = products.mean() / (products.std(ddof=1) / np.sqrt(28.0))
    score = norm.isf(t.sf(ratio, 3.4))
    assert replicate_z_score([numbers[:, None]]) == pytest.approx(score, rel=1e-9)
    line = np.array([[0.0, 2.0], [-2.0, 0.0]])
    lines = [number * line for number in numbers]
    for blocks in ([lines], [[part[:1] for part in lines], [part[1:] for part in lines]]):
        assert replicate_z_score(blocks) == pytest.approx(replicate_z_score([numbers[:, None]]), rel=1e-9)


def test_the_freedom_grows_with_the_dimensions_up_to_that_of_the_products() -> None:
    # the dimensions are known where all parts are a mean and noise of equal size in directions of their own
    rng = np.random.default_rng(1)
    for dimensions in (3000, 40):
        parts = [0.3 / np.sqrt(dimensions) ** 0.5 + rng.normal(size=dimensions) for _ in range(8)]
        flat = np.array(parts)
        products = np.array([a @ b for a, b in itertools.combinations(flat, 2)])
        ratio = products.mean() / (products.std(ddof=1) / np.sqrt(28.0))
        centred = flat - flat.mean(axis=0)
        inner = np.array([a @ b for a, b in itertools.combinations(centred, 2)])
        known = np.mean([a @ a for a in centred]) ** 2 / np.var(inner, ddof=1)
        freedom = min(3.4 * known**0.27, 27.0)
        assert replicate_z_score([parts]) == pytest.approx(norm.isf(t.sf(ratio, freedom)), rel=1e-9)
        assert known == pytest.approx(dimensions, rel=0.8)
    # noise of equal products leaves no spread of the centred ones: the freedom is that of 28 products
    corners = list(np.eye(8))
    assert replicate_z_score([corners]) == 0.0
    moved = [np.append(corner, [1.0 + 1e-3 * k]) for k, corner in enumerate(corners)]
    products = np.array([a @ b for a, b in itertools.combinations(np.array(moved), 2)])
    ratio = products.mean() / (products.std(ddof=1) / np.sqrt(28.0))
    assert replicate_z_score([moved]) == pytest.approx(norm.isf(t.sf(ratio, 27.0)), rel=1e-6)


def test_the_asymmetry_is_relative_to_the_whole() -> None:
    # the antisymmetric part is [[0, 1], [-1, 0]] of norm sqrt 2; the whole has norm sqrt(9 + 16 + 36 + 0)
    assert relative_asymmetry(np.array([[3.0, 6.0], [4.0, 0.0]])) == pytest.approx(np.sqrt(2.0 / 61.0), rel=1e-15)
    assert relative_asymmetry(np.zeros((2, 2))) == 0.0
    assert relative_asymmetry(np.array([[0.0, 0.5], [-0.5, 0.0]])) == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize(("large", "sizes"), [(1, [1] * 5), (10, [2, 2, 1]), (25, [5])])
def test_blocks_of_rows_find_what_the_whole_array_holds(large: int, sizes: list[int], monkeypatch) -> None:
    monkeypatch.setattr(defects, "BLOCK", large)
    assert [len(range(5)[rows]) for rows in row_blocks(5)] == sizes
    counts, scale = np.random.default_rng(3).poisson(0.5, (5, 5)), np.arange(1.0, 6.0)
    assert np.array_equal(np.hstack(list(occupied_pairs(counts))), np.nonzero(np.triu(counts + counts.T, 1)))
    scaled = counts * np.outer(scale, scale)
    assert relative_asymmetry(counts, scale) == pytest.approx(relative_asymmetry(scaled), rel=1e-14)


def test_pairs_of_numbers_are_counted_in_cells_with_the_end_in_the_last() -> None:
    counts = np.array([[2, 0, 9], [1, 0, 1], [4, 1, 0]])
    first, second = np.repeat([[0, 0, 1, 1, 2, 2], [0, 2, 0, 2, 0, 1]], [2, 9, 1, 1, 4, 1], axis=1) * 1.5
    found = defect_of_pairs(first, second, 3)
    assert (found, found.z_score) == (relative_asymmetry(counts), reversibility_z_score(counts))


def test_defects_are_immutable_numbers_with_a_norm() -> None:
    defect = Defect(0.25, "a norm", 1.234567)
    assert defect == 0.25 and defect.value == 0.25 and type(defect.value) is float
    assert repr(defect) == "Defect(0.25, 'a norm', z_score=1.23)" and repr(Defect(0.5, "n")) == "Defect(0.5, 'n')"
    for copy in (pickle.loads(pickle.dumps(defect)), SymmetryDefect(0.1, z_score=2.0)):
        assert copy.z_score in (1.234567, 2.0) and isinstance(copy, Defect)
    assert SymmetryDefect(0.1).norm == SYMMETRY_NORM and SymmetryDefect(0.1).z_score is None
    kept = pickle.loads(pickle.dumps(SymmetryDefect(0.1, "other", 3.0)))
    assert type(kept) is SymmetryDefect and (kept, kept.norm, kept.z_score) == (0.1, "other", 3.0)
    for name in ("norm", "z_score", "new"):
        with pytest.raises(AttributeError, match="immutable"):
            setattr(defect, name, "x")
