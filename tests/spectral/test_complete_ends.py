"""The outermost eigenvalues of large dense matrices: complete, within their errors, whatever their multiplicities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import qr
from scipy.sparse import csr_array

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.eigenvalues.completeness import Deflated, margin_below
from asperity.spectral.eigenvalues.dense import TILE, compressed, end_values, extremal, symmetric_half
from asperity.spectral.eigenvalues.parity import parity_basis

SIZE = 600
RNG = np.random.default_rng(7)
BASIS = qr(RNG.normal(size=(SIZE, SIZE)))[0]
BULK = RNG.uniform(-0.3, 0.3, SIZE)


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
def test_matrices_are_compressed_by_pairs_as_by_the_products(size):
    """Joined bins and functions of a parity: E A E^T, and its symmetric part, of dense arrays."""
    array = np.random.default_rng(size).normal(size=(size, size))
    basis = ker.Bins(size)
    halves = parity_basis(basis, ker.maxwell(0.5))
    for embedding in (csr_array(basis.coarsened()[1]), *(half.T.tocsr() for half in halves)):
        form = embedding.toarray() @ array @ embedding.toarray().T
        np.testing.assert_allclose(compressed(array, embedding), 0.5 * (form + form.T), rtol=0, atol=1e-14)


@pytest.mark.parametrize("place", [(1, 0), (0, TILE + 1), (TILE + 3, TILE + 2)])
def test_the_symmetric_part_is_the_mean_with_the_transpose_and_a_symmetric_matrix_itself(place):
    array = np.random.default_rng(3).normal(size=(TILE + 7, TILE + 7))
    array += array.T
    assert symmetric_half(array) is array
    array[place] = np.nextafter(array[place], np.inf) + 1.0
    np.testing.assert_array_equal(symmetric_half(array), 0.5 * (array + array.T))
