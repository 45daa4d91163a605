"""Matrices from counted pairs: small tables by hand, moments by enumeration, quantiles of known distributions."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from scipy.stats import binom, chi2, gamma, norm, t

from asperity import kernels as ker
from asperity.errors import AccuracyError
from asperity.kernels import Basis, Bins, Legendre, Panels
from asperity.kernels.bases.polynomials import Directions
from asperity.kernels.matrices.matrix import KernelMatrix, frobenius_error
from asperity.kernels.sampling import counts as counting
from asperity.kernels.sampling.counts import (
    count_pairs,
    half_width,
    matrix_from_counts,
    matrix_from_sums,
    missed_fraction,
    sum_products,
    sums_of_rows,
    with_missed_events,
)

UNEVEN = Bins([0.0, np.pi / 3, np.pi])  # of measures 1/4 and 3/4
COUNTS = np.array([[30, 10], [20, 100]])


def test_pairs_are_counted_in_their_cells() -> None:
    incoming, outgoing = np.array([[0.1, 0.2], [0.3, 2.0]]), np.array([[2.0, 3.0], [0.4, 2.5]])
    table = count_pairs(UNEVEN, incoming, outgoing)
    assert table.tolist() == [[1, 2], [0, 1]] and table.dtype == np.int64
    assert count_pairs(Bins(3), np.array([3.0]), np.array([0.1])).tolist() == [[0, 0, 0], [0, 0, 0], [1, 0, 0]]
    basis, theta, turned = Legendre(3), np.array([0.3, 1.0]), np.array([2.0, 2.9])
    products = [np.outer(basis.evaluate(a), basis.evaluate(b)) for a, b in zip(theta, turned, strict=True)]
    assert np.allclose(sum_products(basis, theta, turned), sum(products), rtol=1e-14, atol=1e-14)
    weighted = sum_products(basis, theta, turned, np.array([2.0, -0.5]))
    assert np.allclose(weighted, 2.0 * products[0] - 0.5 * products[1], rtol=1e-14, atol=1e-14)


def test_rows_are_fractions_and_fluxes_count_both_ways() -> None:
    rows = matrix_from_counts([COUNTS], UNEVEN, symmetrise=False, independent=True)
    # P = C_ij / N_i is heights S / heights, heights 2 and 2 / sqrt(3)
    scale = np.array([[1.0, math.sqrt(3.0)], [1.0 / math.sqrt(3.0), 1.0]])
    assert np.allclose(rows.symmetric * scale, [[0.75, 0.25], [1 / 6, 5 / 6]], rtol=1e-14)
    both = matrix_from_counts([COUNTS], UNEVEN, symmetrise=True, independent=True)
    # fluxes 30/160, 15/160 and 100/160, times heights on both sides
    side = 15 / 160 * 4 / math.sqrt(3.0)
    assert np.allclose(both.symmetric, [[30 / 160 * 4.0, side], [side, 100 / 160 * 4.0 / 3.0]], rtol=1e-14)
    # the raw array is h_i h_j C_ij / N: 120, 40/sqrt(3), 80/sqrt(3), 400/3
    defect = (40.0 / math.sqrt(3.0)) / math.sqrt(2) / math.sqrt(120**2 + (40**2 + 80**2) / 3 + (400 / 3) ** 2)
    for found in (rows, both):
        assert float(found.raw_defect) == pytest.approx(defect, rel=1e-14)
        assert found.counts is not None and np.array_equal(found.counts, COUNTS) and found.replicates == ()
        # 10 of 30 go one way: Z^2 = 10/3 with mean 1 and variance 2 - 2/30
        tail = gamma.sf(10 / 3, 1.0 / (2 - 2 / 30), scale=2 - 2 / 30)
        assert found.raw_defect.z_score == pytest.approx(norm.isf(tail), abs=0.05)


def test_parts_are_the_replicates_of_their_mean() -> None:
    parts = [np.array([[20, 20], [40, 80]]), np.array([[28, 12], [60, 60]]), np.array([[16, 24], [10, 110]])]
    for symmetrise in (True, False):
        found = matrix_from_counts(parts, UNEVEN, symmetrise=symmetrise, independent=False)
        alone = [matrix_from_counts([p], UNEVEN, symmetrise=symmetrise, independent=True).symmetric for p in parts]
        # all parts have the same sums of rows, so that the estimate is linear in them
        assert np.allclose(found.symmetric, np.mean(alone, axis=0), rtol=1e-13)
        for replicate, expected in zip(found.replicates, alone, strict=True):
            assert np.allclose(replicate, expected, rtol=1e-12, atol=1e-13)
            assert not replicate.flags.writeable
        assert float(found.error) == pytest.approx(half_width(found.symmetric, alone), rel=1e-12)
        assert found.counts is not None and np.array_equal(found.counts, sum(parts))
        # sums of weights, also those below 1, give the same
        weighted = matrix_from_counts([p / 7e3 for p in parts], UNEVEN, symmetrise=symmetrise, independent=False)
        assert weighted.counts is None and np.allclose(weighted.symmetric, found.symmetric, rtol=1e-13)
        assert float(weighted.error) == pytest.approx(float(found.error), rel=1e-12)
    assert np.array_equal(parts[0], [[20, 20], [40, 80]])


@pytest.mark.parametrize("symmetrise", [False, True])
def test_replicates_of_unequal_parts_are_influences(symmetrise: bool) -> None:
    """With weights 1 + s on a part the estimate moves by s / k (replicate - estimate) to first order."""
    rng = np.random.default_rng(3)
    parts = [rng.integers(20, 60, size=(2, 2)).astype(float) for _ in range(4)]
    found = matrix_from_counts(parts, UNEVEN, symmetrise=symmetrise, independent=False)
    step = 1e-6
    for k, replicate in enumerate(found.replicates):
        moved = [
            matrix_from_counts(
                [part * (1.0 + sign * step * (j == k)) for j, part in enumerate(parts)],
                UNEVEN,
                symmetrise=symmetrise,
                independent=False,
            ).symmetric
            for sign in (1.0, -1.0)
        ]
        influence = (moved[0] - moved[1]) / (2.0 * step)
        assert np.allclose(influence, (replicate - found.symmetric) / 4.0, atol=1e-8)


def test_the_z_score_of_parts_weighs_pairs_by_their_noise() -> None:
    rng = np.random.default_rng(0)
    drift = np.array([[50, 40, 10], [10, 50, 15], [10, 15, 50]])
    parts = [drift + rng.integers(0, 9, size=(3, 3)) for _ in range(8)]
    assert matrix_from_counts(parts, Bins(3), symmetrise=False, independent=False).raw_defect.z_score > 3.5
    same = [part + part.T + np.triu(step, 1) - np.triu(step, 1).T for part, step in zip(parts, noise(), strict=True)]
    assert abs(matrix_from_counts(same, Bins(3), symmetrise=False, independent=False).raw_defect.z_score) < 2.5
    # a pair of cells with few counts has its say: 4 of 4 one way in every part, beside a busy and noisy pair
    busy = [np.array([[9, 400 + s, 4], [400 - s, 9, 9], [0, 9, 9]]) for s in (11, -9, 14, -13, 8, -10, 12, -13)]
    assert matrix_from_counts(busy, Bins(3), symmetrise=True, independent=False).raw_defect.z_score > 2.0


def noise() -> list[np.ndarray]:
    return list(np.random.default_rng(5).integers(-5, 6, size=(8, 3, 3)))


def test_errors_of_rows_are_those_of_binomials() -> None:
    # each row has one free fraction with variance p (1 - p) / N; with equal bins ||error||^2 = 2 (e_1^2 + e_2^2)
    n = 10**7
    counts = np.array([[3 * n, 7 * n], [7 * n, 3 * n]])
    found = matrix_from_counts([counts], Bins(2), symmetrise=False, independent=True)
    assert float(found.error) == pytest.approx(math.sqrt(2 * 0.21 / (10 * n) * chi2.ppf(0.95, 2)), rel=1e-6)
    # of measures w: ||error||^2 = sum of w_i e_i^2 / (w_1 w_2), here by a table with equal terms
    counts = np.array([[3 * n, 7 * n], [21 * n, 9 * n]])
    found = matrix_from_counts([counts], UNEVEN, symmetrise=False, independent=True)
    variance = 0.25 * 0.21 / (10 * n) / (0.25 * 0.75)
    assert float(found.error) == pytest.approx(math.sqrt(variance * chi2.ppf(0.95, 2)), rel=1e-6)


def test_errors_of_symmetrised_counts_are_those_of_a_multinomial() -> None:
    n = 10**8
    counts = np.array([[3 * n, n], [2 * n, 4 * n]])
    found = matrix_from_counts([counts], UNEVEN, symmetrise=True, independent=True)
    fraction = np.array([0.3, 0.3, 0.4])  # first diagonal position, both others together, second diagonal position
    covariance = (np.diag(fraction) - np.outer(fraction, fraction)) / (10 * n)
    # entries 4 p_1, (4/sqrt 3) p_2 / 2 twice, (4/3) p_3
    form = np.diag([16.0, 16.0 / 3.0 / 4.0 * 2.0, 16.0 / 9.0])
    mean, variance = np.trace(form @ covariance), 2.0 * np.trace(form @ covariance @ form @ covariance)
    degrees = 2.0 * mean**2 / variance
    assert float(found.error) == pytest.approx(math.sqrt(mean / degrees * chi2.ppf(0.95, degrees)), rel=1e-6)


def test_quantiles_of_norms_are_those_of_chi_squares() -> None:
    for degrees in (1, 2, 5):
        for scale in (1.0, 3.0):
            found = counting._quantile(scale * degrees, 2.0 * scale**2 * degrees)
            assert found == pytest.approx(math.sqrt(scale * chi2.ppf(0.95, degrees)), rel=1e-12)
    assert counting._quantile(1.0, 2.0) == pytest.approx(1.959963984540054, rel=1e-12)
    assert counting._quantile(4.0, 0.0) == 2.0 and counting._quantile(0.0, 0.0) == 0.0


@pytest.mark.parametrize("counts", [[0, 1, 0], [3, 0, 2], [40, 7, 13]])
def test_the_squared_error_has_the_moments_of_a_dirichlet_distribution(counts: list[int]) -> None:
    expected, weight = np.array([0.5, 0.25, 0.25]), np.array([2.0, 4.0, 4.0])
    drawn, number = np.array(counts), sum(counts)
    prior = np.array([counting.PRIOR])
    mean, variance = counting._squared_norms([(drawn[None], weight, expected)], np.array([number]), prior)
    fractions = np.random.default_rng(3).dirichlet(drawn + counting.PRIOR * expected, 400_000)
    square = ((fractions - drawn / number) ** 2) @ weight
    # the covariance is that of so many draws from the mean
    most = 1.0 + (counting.PRIOR + 1.0) / number
    assert 0.99 <= mean[0] / np.mean(square) < 1.01 * most
    assert 0.95 <= np.sqrt(variance[0]) / np.std(square) < 1.05 * most**2


def test_cells_that_no_pair_met_have_an_error() -> None:
    # all pairs of a cell leave in one cell, five times: one in six may leave in the other
    found = ker.estimate([0.5] * 5 + [2.5] * 5, [0.5] * 5 + [2.5] * 5, ker.Bins(2), invariant=True)
    assert 0.3 < float(found.error) < 1.0


@pytest.mark.parametrize("symmetrise", [False, True])
@pytest.mark.parametrize(("pairs", "bins"), [(10, 2), (40, 4)])
def test_the_errors_of_few_pairs_hold_in_95_of_100_cases(pairs: int, bins: int, symmetrise: bool) -> None:
    basis, held, number, ratio = ker.Bins(bins), 0, 0, []
    exact = ker.discretise(ker.lambertian(), basis).symmetric
    for seed in range(400):
        rng = np.random.default_rng([seed, pairs])
        theta, out = ker.SINE.sample(pairs, rng), ker.SINE.sample(pairs, rng)
        try:
            found = ker.estimate(theta, out, basis, symmetrise, invariant=True)
        except AccuracyError:  # a cell without pairs
            continue
        true = np.linalg.norm(found.symmetric - exact)
        held, number = held + (true <= float(found.error)), number + 1
        ratio.append(float(found.error) / true)
    assert number > 300 and held >= 0.925 * number and np.median(ratio) < 2.7


@pytest.mark.parametrize(("number", "fraction"), [(2000, 0.003), (2000, 0.5), (3000, 0.2)])
def test_the_variance_of_the_squared_error_is_that_of_binomials(number: int, fraction: float) -> None:
    first = np.arange(number + 1)
    with np.errstate(all="raise", under="ignore"):
        counts = np.stack([first, number - first], axis=1)
        cells = counts, np.array([1.0, 2.0]), np.array([0.5, 0.5])
        _, found = counting._squared_norms([cells], np.full(number + 1, number), np.full(number + 1, 1.0))
    likely = binom.pmf(first, number, fraction)
    square = 3.0 * (first / number - fraction) ** 2
    exact = likely @ square**2 - (likely @ square) ** 2
    # cells of a few pairs have more, because their fractions are not known
    assert 0.995 < likely @ found / exact < 1.005 + 6.0 / (number * fraction)


def test_parts_along_one_line_have_students_error() -> None:
    rng = np.random.default_rng(1)
    line, fractions = rng.normal(size=(3, 3)), rng.normal(size=8)
    parts = [2.0 + fraction * line for fraction in fractions]
    middle = np.mean(parts, axis=0)
    exact = t.ppf(0.975, 7) * np.std(fractions, ddof=1) / math.sqrt(8.0) * np.linalg.norm(line)
    assert half_width(middle, parts) == pytest.approx(exact, rel=1e-10)
    assert half_width(middle, [middle] * 8) == 0.0


def test_parts_in_many_dimensions_have_the_root_mean_square() -> None:
    parts = list(np.random.default_rng(2).normal(size=(8, 200, 200)))
    middle = np.mean(parts, axis=0)
    rms = math.sqrt(sum(float(np.sum((part - middle) ** 2)) for part in parts) / 56.0)
    assert rms < half_width(middle, parts) < 1.02 * rms


@pytest.mark.parametrize("number", [3, 8])
def test_dimensions_are_the_ratio_of_traces_whose_means_wishart_gave(number: int) -> None:
    differences = np.random.default_rng(4).normal(size=(number, 5)) * [3.0, 1.0, 1.0, 0.5, 0.2]
    differences -= differences.mean(axis=0)
    freedom = number - 1
    covariance = differences.T @ differences / freedom
    # E tr W^2 = (1 + 1/f) tr C^2 + (tr C)^2 / f and E (tr W)^2 = (tr C)^2 + 2 tr C^2 / f, solved for the two
    table = [[1.0 + 1.0 / freedom, 1.0 / freedom], [2.0 / freedom, 1.0]]
    of_square, squared = np.linalg.solve(table, [np.trace(covariance @ covariance), np.trace(covariance) ** 2])
    assert counting._dimensions(differences @ differences.T)[0] == pytest.approx(squared / of_square, rel=1e-10)
    assert counting._dimensions(differences[:, :1] @ differences[:, :1].T) == pytest.approx((1.0, 1.0), rel=1e-10)
    # the same in all directions that the parts allow: nothing is left of the trace of the square
    for scale in (1.0, 1e-5, 1e5):
        assert counting._dimensions(scale**2 * (np.eye(number) - 1.0 / number))[0] > 1e12


@pytest.mark.parametrize("number", [8, 33])
def test_the_skewness_is_that_of_wisharts_third_moment(number: int) -> None:
    freedom, spectrum = number - 1, np.array([1.0] + [0.02] * 150)
    differences = np.random.default_rng(4).normal(size=(number, 151)) * np.sqrt(spectrum)
    differences -= differences.mean(axis=0)
    covariance = differences.T @ differences / freedom
    spread, skew = counting._dimensions(differences @ differences.T)
    # back from (tr C)^2 / tr C^2, (tr C^2)^3 / (tr C^3)^2 and E (tr W)^2 = (tr C)^2 + 2 tr C^2 / f to the traces
    second = np.trace(covariance) ** 2 / (spread + 2.0 / freedom)
    first, third = math.sqrt(spread * second), math.sqrt(second**3 / skew)

    def moment(first: float, second: float, third: float) -> float:
        f = freedom
        return ((f**3 + 3 * f**2 + 4 * f) * third + 3 * (f**2 + f) * first * second + f * first**3) / f**3

    # of identities of p dimensions E tr (f W)^3 = f p (f^2 + p^2 + 3 f p + 3 f + 3 p + 4)
    f, p = freedom, 5
    assert moment(p, p, p) * f**3 == pytest.approx(f * p * (f**2 + p**2 + 3 * f * p + 3 * f + 3 * p + 4))
    assert moment(first, second, third) == pytest.approx(np.trace(covariance @ covariance @ covariance), rel=1e-10)


@pytest.mark.parametrize("rest", [0, 20, 150])
def test_half_widths_of_many_parts_are_quantiles_also_where_one_dimension_rules(rest: int) -> None:
    spectrum = np.array([1.0] + [0.02] * rest)
    rng = np.random.default_rng(12)
    parts = rng.normal(size=(1500, len(spectrum))) * np.sqrt(spectrum)
    squares = rng.normal(size=(200_000, 1)) ** 2 + 0.02 * rng.chisquare(max(rest, 1), size=(200_000, 1)) * (rest > 0)
    exact = math.sqrt(np.quantile(squares, 0.95) / 1500)
    # the spread of 1500 parts is known within 2 %; a chi-square of the same variance is 2.3 % below for 150
    assert half_width(parts.mean(axis=0), list(parts)) == pytest.approx(exact, rel=0.015)


def test_half_widths_follow_student_and_fisher(monkeypatch) -> None:
    from scipy.stats import f

    parts = list(np.random.default_rng(6).normal(size=(8, 4, 4)))
    middle = np.mean(parts, axis=0)
    differences = np.array([(part - middle).ravel() for part in parts])
    square = float(np.sum(differences**2)) / 56.0

    def exact(compared: np.ndarray) -> float:
        spread, skew = (max((1.0 - 1.5 / 7.0) * number, 1.0) for number in counting._dimensions(compared @ compared.T))
        return math.sqrt((1.0 + (f.ppf(0.95, skew, 7 * skew) - 1.0) * math.sqrt(skew / spread)) * square)

    assert half_width(middle, parts) == pytest.approx(exact(differences), rel=1e-10)
    assert 2**18 <= counting.MOST_COMPARED <= 2**22
    # of large arrays some rows are compared: 16 entries of which 8 may be, so every second row
    monkeypatch.setattr(counting, "MOST_COMPARED", 8)
    some = np.array([(part - middle)[::2].ravel() for part in parts])
    assert half_width(middle, parts) == pytest.approx(exact(some), rel=1e-10)


def test_replicates_are_dropped_where_they_are_too_large(monkeypatch) -> None:
    def kept(diagonal: np.ndarray) -> Sequence:
        parts = [np.diag(diagonal + step) for step in (0, 1, 2)]
        return matrix_from_counts(parts, Bins(len(diagonal)), symmetrise=False, independent=False).replicates

    assert 2**26 <= counting.LARGEST_REPLICATES <= 2**30
    monkeypatch.setattr(counting, "LARGEST_REPLICATES", 3 * 16 * 8)
    assert len(kept(np.full(4, 5))) == 3
    monkeypatch.setattr(counting, "LARGEST_REPLICATES", 3 * 16 * 8 - 1)
    assert kept(np.full(4, 5)) == ()


@pytest.mark.parametrize(("symmetrise", "keeps"), [(True, True), (True, False), (False, True), (False, False)])
def test_what_is_known_of_sums_is_put_in(symmetrise: bool, keeps: bool) -> None:
    rng = np.random.default_rng(8)
    basis = Bins([0.0, 0.7, 1.5, np.pi])
    means = [np.eye(3) + 0.1 * rng.normal(size=(3, 3)) for _ in range(8)]
    found = matrix_from_sums(means, basis, symmetrise=symmetrise, keeps_measure=keeps)
    constant = basis.constant
    assert np.allclose(found.symmetric @ constant, constant, atol=1e-14)
    assert np.allclose(constant @ found.symmetric, constant, atol=1e-14) == (keeps or symmetrise)
    assert np.allclose(found.symmetric, found.symmetric.T, atol=1e-14) == symmetrise
    # functions of mean 0 are left as they are, up to a constant where the adjoint is mended too
    others = np.linalg.svd(constant[None])[2][1:]
    raw = np.mean(means, axis=0)
    wanted = 0.5 * (raw + raw.T) if symmetrise else raw
    assert np.allclose(others @ found.symmetric @ others.T, others @ wanted @ others.T, atol=1e-14)
    if not (keeps or symmetrise):
        assert np.allclose(found.symmetric @ others.T, raw @ others.T, atol=1e-14)
    assert len(found.replicates) == 8 and np.allclose(np.mean(found.replicates, axis=0), found.symmetric)
    assert all(np.allclose(replicate @ constant, constant) for replicate in found.replicates)
    inner = others @ (found.replicates[2] - found.symmetric) @ others.T
    part = 0.5 * (means[2] + means[2].T) if symmetrise else means[2]
    assert np.allclose(inner, others @ (part - wanted) @ others.T, atol=1e-14)
    assert float(found.error) == pytest.approx(half_width(found.symmetric, list(found.replicates)), rel=1e-12)
    asymmetry = np.linalg.norm(raw - raw.T) / np.linalg.norm(raw) / 2.0
    assert float(found.raw_defect) == pytest.approx(asymmetry, rel=1e-13) and found.counts is None
    assert abs(found.raw_defect.z_score) < 3.0
    drift = [mean + np.array([[0.0, 0.5, 0.0], [-0.5, 0.0, 0.0], [0.0, 0.0, 0.0]]) for mean in means]
    assert matrix_from_sums(drift, basis, symmetrise=symmetrise, keeps_measure=keeps).raw_defect.z_score > 3.0


def test_sums_that_vanish_are_no_error() -> None:
    found = matrix_from_sums([np.zeros((2, 2))] * 3, Bins(2), symmetrise=True, keeps_measure=True)
    assert np.allclose(found.symmetric @ Bins(2).constant, Bins(2).constant) and float(found.error) < 1e-15
    assert float(found.raw_defect) == 0.0 and found.raw_defect.z_score == 0.0


def test_empty_bins_are_named_and_weighed() -> None:
    with pytest.raises(AccuracyError, match=r"1 of 2 bins have no incoming pair \(bins 0\)") as caught:
        matrix_from_counts([np.array([[0, 0], [3, 4]])], UNEVEN, symmetrise=False, independent=True)
    assert caught.value.defect == pytest.approx(0.25)
    # a single pair will do; with pairs counted both ways an outgoing pair is enough
    matrix_from_counts([np.array([[0, 0], [3, 4]])], UNEVEN, symmetrise=True, independent=True)
    matrix_from_counts([np.array([[0, 1], [3, 4]])], UNEVEN, symmetrise=False, independent=True)
    for size, named in ((8, r"\(bins 0, 1, 2, 3, 4, 5, 6, 7\)"), (9, r"\(bins 0, 1, 2, 3, 4, 5, 6, 7, \.\.\.\)")):
        counts = np.zeros((size + 1, size + 1), dtype=np.int64)
        counts[-1, -1] = 5
        for symmetrise in (False, True):
            with pytest.raises(AccuracyError, match=named) as caught:
                matrix_from_counts([counts], Bins(size + 1), symmetrise=symmetrise, independent=True)
            assert caught.value.defect == pytest.approx(size / (size + 1.0))


@pytest.mark.parametrize("rays", [50, 40_000])
@pytest.mark.parametrize(
    "basis", [UNEVEN, Bins(64), Legendre(6), Panels(np.linspace(0.0, np.pi, 5), 2), Directions()], ids=repr
)
def test_rows_of_pairs_have_the_sums_of_each_row(basis: Basis, rays: int) -> None:
    incoming, outgoing = np.random.default_rng(1).uniform(0.0, np.pi, (2, 8, rays))
    each = count_pairs if basis.is_partition else sum_products
    expected = np.array([each(basis, *row) for row in zip(incoming, outgoing, strict=True)])
    found = sums_of_rows(basis, incoming, outgoing)
    assert found.dtype == expected.dtype and np.allclose(found, expected, rtol=1e-12, atol=1e-11 * rays**0.5)


@pytest.mark.parametrize("rays", [1, 40, 10**6])
def test_missed_events_have_a_twentieth_of_a_chance_and_change_a_matrix_by_at_most_the_error(rays: int) -> None:
    p = missed_fraction(rays)
    assert (1.0 - p) ** rays == pytest.approx(0.05, rel=1e-9)
    constant, identity = Bins(5).constant, np.eye(5)
    means = np.outer(constant, constant)
    # the most is reached: an event that sends all functions of mean 0 to their opposite, or keeps them
    for before, given in ((identity, 2.0 * means - identity), (means * (1.0 - 1e-15), identity)):
        matrices = [KernelMatrix(before, Bins(5), frobenius_error(error, "estimate", "given")) for error in (0.0, 9.0)]
        small, large = (float(with_missed_events(matrix, rays).error) for matrix in matrices)
        assert small == pytest.approx(p * np.linalg.norm(given - before), rel=1e-12) and large == 9.0
