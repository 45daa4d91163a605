"""Complete ends of spectra: the check by factorisation, its margin against Higham's theorem, and what rests on it."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import qr
from scipy.sparse import csr_array

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.eigenvalues.dense import (
    Deflated,
    compressed,
    end_values,
    extremal,
    margin_below,
    norm_beyond,
    parity_basis,
)

U = 2.0**-53
RNG = np.random.default_rng(11)


def orthogonal(size: int) -> np.ndarray:
    return np.linalg.qr(RNG.normal(size=(size, size)))[0]


def symmetric(values: list[float], basis: np.ndarray) -> np.ndarray:
    array = (basis * np.asarray(values)) @ basis.T
    return 0.5 * (array + array.T)


def nothing(size: int) -> tuple[np.ndarray, np.ndarray]:
    return np.empty((size, 0)), np.empty(0)


def higham(size: int) -> float:
    """gamma_{n + 3}: gamma_{n + 1} of theorem 10.3, with a rounding for reciprocals of pivots and one for the root."""
    terms = (size + 3) * U
    return terms / (1.0 - terms)


# ---- the margin, where the factor is known -----------------------------------------------------------------------
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_margin_of_a_diagonal_matrix_is_that_of_the_theorem(sign):
    """R is the root of the diagonal, so both norms of |R| are the root of its largest entry; six roundings an entry."""
    entries, threshold = np.array([0.5, -0.25, 0.125, 0.0]), 0.75
    margin = margin_below(Deflated.of(np.diag(entries), None), sign, *nothing(4), threshold)
    largest = float(np.max(threshold - sign * entries))
    parts = float(np.sqrt(0.5**2 + 0.25**2 + 0.125**2)) + 0.75
    assert margin == pytest.approx(higham(4) * largest + 6.0 * U * parts, rel=1e-12, abs=0.0)


def test_the_margin_counts_the_vectors_that_are_moved_and_the_squares_that_they_add():
    entries, threshold, value = np.array([0.5, -0.25, 0.125]), 0.75, 0.5
    margin = margin_below(Deflated.of(np.diag(entries), None), 1.0, np.eye(3)[:, :1], np.array([value]), threshold)
    # the vector goes up by value + 1 + |value| = 2, from .75 - .5 to 2.25
    parts = float(np.sqrt(0.25 + 0.0625 + 0.015625)) + 0.75 + 2.0
    assert margin == pytest.approx(higham(3) * 2.25 + 7.0 * U * parts, rel=1e-12, abs=0.0)


def test_the_margin_counts_the_deflation():
    """Off e_1 the matrix diag(.5, -.25, .125) is diag(0, -.25, .125); e_1 goes up by 1 + |threshold|; u = e_1/4."""
    matrix = Deflated.of(np.diag([0.5, -0.25, 0.125]), np.eye(3)[0])
    assert matrix.image is not None and matrix.image.tolist() == [0.25, 0.0, 0.0]
    margin = margin_below(matrix, 1.0, *nothing(3), 0.75)
    parts = float(np.sqrt(0.25 + 0.0625 + 0.015625)) + 0.75 + 1.75 + 0.5
    assert margin == pytest.approx(higham(3) * 2.5 + 7.0 * U * parts, rel=1e-12, abs=0.0)


def test_the_margin_takes_the_largest_row_and_the_largest_column():
    """B = R^T R with R = [[2, 1], [0, 2]]: its columns sum up to 3, and so does its first row."""
    array, threshold = np.array([[0.0, -2.0], [-2.0, -1.0]]), 4.0
    margin = margin_below(Deflated.of(array, None), 1.0, *nothing(2), threshold)
    assert margin == pytest.approx(higham(2) * 9.0 + 6.0 * U * (3.0 + 4.0), rel=1e-12, abs=0.0)


@pytest.mark.parametrize("size", [3, 10, 40])
def test_the_margin_is_above_the_backward_error_in_exact_arithmetic(size):
    """The factor of LAPACK, multiplied out in fractions, differs from B by less than the margin says."""
    from scipy.linalg.lapack import dpotrf

    in_fractions = np.vectorize(Fraction, otypes=[object])
    for _ in range(3):
        array = symmetric(RNG.uniform(-1.0, 1.0, size).tolist(), orthogonal(size))
        threshold = float(np.linalg.eigvalsh(array)[-1]) + 1e-3
        margin = margin_below(Deflated.of(array, None), 1.0, *nothing(size), threshold)
        factor = np.tril(dpotrf(threshold * np.eye(size) - array, lower=1)[0])
        root, target, given = (in_fractions(one) for one in (factor, threshold * np.eye(size), array))
        error = (root @ root.T - target + given).astype(float)
        assert margin is not None and 0.0 < np.linalg.norm(error, 2) <= margin


# ---- what is proved, on either side of an eigenvalue -------------------------------------------------------------
CASES = {"plain": False, "deflated": True}


@pytest.mark.parametrize("deflated", CASES.values(), ids=CASES)
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("size", [6, 30])
def test_a_threshold_is_proved_above_an_eigenvalue_and_not_below(deflated, sign, size):
    """Of a deflated matrix S is far from its compression: c is no eigenvector, and c^T S c lies beyond all."""
    basis = orthogonal(size)
    values = np.linspace(-0.6, 0.7, size)
    constant = None
    array = symmetric(values.tolist(), basis)
    if deflated:
        constant = basis[:, 0]
        turned = RNG.normal(size=size)
        # adding c u^T + u c^T changes nothing on the complement of c
        array += np.outer(constant, turned) + np.outer(turned, constant)
        array = 0.5 * (array + array.T)
        values = values[1:]
    matrix = Deflated.of(array, constant)
    extreme = float(np.max(sign * values))
    for distance in (1e-3, 1e-9):
        margin = margin_below(matrix, sign, *nothing(size), extreme + distance)
        assert margin is not None and margin < 1e-11
        margin = margin_below(matrix, sign, *nothing(size), extreme - distance)
        assert margin is None or margin >= distance
    # the eigenvector moved away, the next one is the largest: also where the threshold is negative
    order = np.argsort(sign * values)[::-1]
    vectors, next_value = basis[:, order[:1] + deflated], float(sign * values[order[1]])
    assert margin_below(matrix, sign, vectors, values[order[:1]], next_value + 1e-9) is not None
    refused = margin_below(matrix, sign, vectors, values[order[:1]], next_value - 1e-9)
    assert refused is None or refused >= 1e-9


@pytest.mark.parametrize("threshold", [-0.3, -2.0, -50.0])
def test_vectors_and_the_constant_are_moved_beyond_any_threshold_that_may_be_asked(threshold):
    """All other values lie below the threshold; the listed one and the deflated direction must not spoil the proof."""
    basis = orthogonal(8)
    values = np.array([0.0, 0.9, *np.linspace(threshold - 3.0, threshold - 0.1, 6)])
    array = symmetric(values.tolist(), basis)
    matrix = Deflated.of(array, basis[:, 0])
    margin = margin_below(matrix, 1.0, basis[:, 1:2], values[1:2], threshold)
    # the listed vector goes up by .9 + 1 + .9 only, which is less than the third threshold asks for: refused, not false
    proved = margin is not None
    assert proved == (threshold > -1.9)
    if proved:
        assert margin < 1e-11


def test_a_missing_copy_is_never_proved_away():
    basis = orthogonal(12)
    array = symmetric([0.9, 0.9, *np.linspace(-0.5, 0.5, 10)], basis)
    matrix = Deflated.of(array, None)
    assert margin_below(matrix, 1.0, basis[:, :1], np.array([0.9]), 0.6) is None
    assert margin_below(matrix, 1.0, basis[:, :2], np.array([0.9, 0.9]), 0.6) is not None


# ---- the deflated matrix and its norms ---------------------------------------------------------------------------
@pytest.mark.parametrize("deflated", CASES.values(), ids=CASES)
def test_a_deflated_matrix_multiplies_vectors_and_blocks_as_the_compression(deflated):
    size = 9
    array = symmetric(RNG.uniform(-1.0, 1.0, size).tolist(), orthogonal(size))
    constant = orthogonal(size)[:, 2] if deflated else None
    matrix = Deflated.of(array, constant)
    projector = np.eye(size) - (np.outer(constant, constant) if constant is not None else 0.0)
    exact = projector @ array @ projector
    block = RNG.normal(size=(size, 4))
    assert np.allclose(matrix @ block, exact @ block, rtol=0.0, atol=1e-14)
    assert np.allclose(matrix @ block[:, 1], exact @ block[:, 1], rtol=0.0, atol=1e-14)
    assert (matrix @ block[:, 1]).shape == (size,)
    assert matrix.frobenius == pytest.approx(np.linalg.norm(exact), rel=1e-13)


def test_the_norm_beyond_is_that_of_the_values_that_are_left():
    basis = orthogonal(7)
    values = np.array([0.9, -0.8, 0.5, 0.4, -0.3, 0.2, 0.1])
    matrix = Deflated.of(symmetric(values.tolist(), basis), None)
    rest = float(np.sqrt(np.sum(values[2:] ** 2)))
    assert rest <= norm_beyond(matrix, values[:2]) <= rest * (1.0 + 1e-13)
    # of nothing that is left the bound is that of rounding: 2 n^2 u |S|_F^2
    whole = float(np.sum(values**2))
    assert norm_beyond(matrix, values) == pytest.approx(np.sqrt(2.0 * 49.0 * U * whole), rel=0.2, abs=0.0)


def test_of_a_matrix_that_is_only_its_deflated_direction_nothing_is_left():
    """The squared norm is a difference that rounding may make negative."""
    assert Deflated.of(np.diag([1.0, 0.0]), np.array([1.0, 0.0])).frobenius == 0.0
    for _ in range(50):
        constant = orthogonal(5)[:, 0]
        assert 0.0 <= Deflated.of(np.outer(constant, constant), constant).frobenius < 1e-6


def test_values_that_rounding_makes_too_large_leave_the_bound_of_rounding():
    matrix = Deflated.of(np.diag([0.5, 0.25]), None)
    exact = np.sqrt(2.0 * 4.0 * U * 0.3125)
    assert norm_beyond(matrix, np.array([0.5, 0.25 * (1.0 + 1e-9)])) == pytest.approx(exact, rel=1e-12, abs=0.0)
    assert norm_beyond(matrix, np.array([1.0, 0.5])) == pytest.approx(exact, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("twin", [False, True], ids=["simple", "double"])
def test_sampled_matrices_are_proved_complete(twin):
    """Noise whose spectrum ends near 0.06, and eigenvalues beyond it."""
    rng, spikes = np.random.default_rng(1100), np.array([0.8, 0.8 if twin else -0.7, *0.5 * 0.7 ** np.arange(9.0)])
    vectors = np.linalg.qr(rng.normal(size=(1100, len(spikes))))[0]
    rough = rng.normal(size=(1100, 1100)) * 0.06 / np.sqrt(8.0 * 1100)
    array = (vectors * spikes) @ vectors.T + rough + rough.T
    array = 0.5 * (array + array.T)
    found = extremal(array, None, 2)
    exact = np.linalg.eigvalsh(array)
    expected = np.sort(exact[np.argsort(-np.abs(exact))[:2]])[::-1]
    assert "Cholesky" in found.method and found.errors.max() < 1e-11
    assert np.all(np.abs(found.values - expected) <= found.errors)


SIZE = 600
LARGE_RNG = np.random.default_rng(7)
BASIS = qr(LARGE_RNG.normal(size=(SIZE, SIZE)))[0]
BULK = LARGE_RNG.uniform(-0.3, 0.3, SIZE)


def with_spectrum(leading: list[float]) -> np.ndarray:
    """A full symmetric matrix with these eigenvalues and others of modulus below 0.3; and a cluster at 0.3."""
    values = BULK.copy()
    values[: len(leading)] = leading
    array = (BASIS * values) @ BASIS.T
    return 0.5 * (array + array.T)


SPECTRA = {
    "simple": [0.9, 0.8, -0.7, 0.6, -0.5],
    "double": [0.9, 0.9, 0.8, 0.8, -0.9, -0.9, -0.9],
    "nearly double": [0.9, 0.9 - 1e-11, 0.8, -0.85, -0.85 + 1e-12],
    "ten copies": [0.95] * 10 + [-0.95] * 3,
    "gap 1e-12": [1.0 - 1e-12, 1.0 - 3e-12, 0.5, -0.4],
    "half and half": [0.5] * 300 + [-0.5] * 300,
}


@pytest.mark.parametrize("leading", SPECTRA.values(), ids=SPECTRA)
@pytest.mark.parametrize("k", [1, 3, 5])
def test_the_values_of_largest_modulus_are_those_of_their_ranks_within_their_errors(leading, k):
    array = with_spectrum(leading)
    exact = np.sort(np.concatenate([leading, BULK[len(leading) :]]))[::-1]
    found = extremal(array, None, k)
    # LAPACK may stand in for Lanczos, but not for a proof that fails: these matrices have no other eigenvalues
    assert "Cholesky factorisations no other" in found.method or "since Lanczos" in found.method
    ranks = np.concatenate([np.arange(found.top), len(exact) + np.arange(found.top - len(found.values), 0)])
    assert np.all(np.abs(found.values - exact[ranks]) <= found.errors)
    assert np.all(found.errors < 1e-10)
    # nothing else is larger in modulus than the least of the k largest, but for its error
    left_out = np.delete(exact, ranks)
    assert np.abs(left_out).max() <= np.sort(np.abs(found.values))[::-1][k - 1] + found.errors.max()
    assert np.linalg.norm(found.vectors.T @ found.vectors - np.eye(len(found.values))) < 1e-10


def test_the_largest_value_is_found_where_all_moduli_are_at_the_lower_end():
    found = extremal(with_spectrum([-0.9, -0.8, -0.7]), None, 2)
    assert found.top == 1
    assert found.values[0] == pytest.approx(np.sort(BULK[3:])[-1], abs=1e-10)
    assert np.allclose(found.values[1:], [-0.8, -0.9], rtol=0.0, atol=1e-10)


def test_the_margin_of_rounding_is_below_a_hundred_times_the_dimension_in_roundings():
    margin = margin_below(Deflated.of(with_spectrum([0.9]), None), 1.0, np.empty((SIZE, 0)), np.empty(0), 0.95)
    assert margin is not None and margin < 100 * SIZE * np.finfo(float).eps


def test_the_factorisation_proves_what_is_off_the_constants_whatever_the_constants_do():
    """Adding c u^T + u c^T moves values to 5 and -5 and changes nothing on the complement of c."""
    constant, turned = BASIS[:, 10], 5.0 * BASIS[:, 20]
    array = with_spectrum([0.9, -0.8, 0.7, -0.6])
    array += np.outer(constant, turned) + np.outer(turned, constant)
    found = extremal(0.5 * (array + array.T), constant, 3)
    assert "Cholesky factorisations no other" in found.method
    assert np.allclose(found.values, [0.9, 0.7, -0.8], rtol=0.0, atol=found.errors.max())
    assert found.errors.max() < 1e-10


def test_end_values_are_the_ends_of_the_spectrum():
    upper, lower = end_values(with_spectrum([0.9, 0.8, -0.7]), None, 2, 1)
    assert np.allclose(upper, [0.9, 0.8], rtol=0.0, atol=1e-12)
    assert np.allclose(lower, [-0.7], rtol=0.0, atol=1e-12)


# ---- what is built upon them ------------------------------------------------------------------------------------
@pytest.mark.parametrize("known", [True, None], ids=["mirror-symmetric", "symmetry unknown"])
def test_large_and_small_matrices_have_the_same_kind_of_spectrum(known):
    """Maxwell's law in 1200 bins: two eigenvalues of multiplicity 600, off the constants; with g^l of another law."""
    law = ker.maxwell(0.5)
    matrix = ker.discretise(law, ker.Bins(1200))
    if known is None:
        matrix = ker.KernelMatrix(matrix.symmetric, matrix.basis, matrix.error, reversible=True)
    found = spec.spectrum(matrix, k=6)
    assert np.allclose(np.abs(found.values[1:]), 0.5, rtol=0.0, atol=1e-9) and found.values[0] == pytest.approx(1.0)
    assert "no other eigenvalue" in found.completeness
    assert found.gap == pytest.approx(0.5, abs=1e-9) and found.gap_errors.algebraic[0] < 1e-10
    assert set(found.parity) == ({"none"} if known is None else {"even", "odd"})


@pytest.mark.parametrize("size", [2, 3, 64, 65, 100])
def test_matrices_are_compressed_as_by_the_products(size):
    """Joined bins and functions of a parity: E A E^T, and its symmetric part, of dense arrays."""
    array = np.random.default_rng(size).normal(size=(size, size))
    basis = ker.Bins(size)
    halves = parity_basis(basis, ker.maxwell(0.5))
    for embedding in (csr_array(basis.coarsened()[1]), *(half.T.tocsr() for half in halves)):
        form = embedding.toarray() @ array @ embedding.toarray().T
        np.testing.assert_allclose(compressed(array, embedding), 0.5 * (form + form.T), rtol=0, atol=1e-14)
