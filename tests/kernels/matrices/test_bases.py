"""The bases of L^2(sin theta d theta): orthonormality, exact weights, grids within grids, the flip."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import legendre

from asperity.kernels import SINE, Basis, Bins, Legendre, Panels, TensorBasis
from asperity.kernels.bases.mirror import is_mirror_symmetric, mirror_refinement, reflection_matrix

BASES = [
    Bins(1),
    Bins(7),
    Bins(8),
    Bins([0.0, 0.3, 2.0, np.pi]),
    Bins(9, weight="sin2"),
    Legendre(1),
    Legendre(40),
    Legendre(30, weight="sin2"),
    Panels([0.0, 0.01, 1.0, 2.0, np.pi], 5),
    Panels([0.0, 1.0, 2.0, np.pi], 0),
    Panels([0.0, 1.0, np.pi], 3, weight="sin2"),
]
# e_i e_j reaches the size of the basis and is integrated by as many rounded terms.
ROUNDING = 1e-13


def uniform_rule(basis: Basis) -> tuple[np.ndarray, np.ndarray]:
    """Gauss nodes that share nothing with the basis but its edges."""
    edges = np.unique(np.concatenate((basis.edges, np.linspace(0.0, np.pi, 12))))
    nodes, weights = legendre.leggauss(30)
    centre, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    angle = (centre[:, None] + half[:, None] * nodes).ravel()
    density = 0.5 * np.sin(angle) if basis.measure.name == "sin" else 2.0 / np.pi * np.sin(angle) ** 2
    return angle, (half[:, None] * weights).ravel() * density


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_every_basis_is_orthonormal_for_its_measure(basis: Basis) -> None:
    angle, weight = uniform_rule(basis)
    values = basis.evaluate(angle)
    assert np.abs(values.T @ (weight[:, None] * values) - np.eye(basis.size)).max() < ROUNDING


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_the_constant_has_the_declared_coefficients_and_weights_sum_to_one(basis: Basis) -> None:
    assert np.abs(basis.evaluate([0.2, 1.5, 3.0]) @ basis.constant - 1.0).max() < ROUNDING
    assert abs(basis.weights.sum() - 1.0) < ROUNDING
    assert np.abs(basis.project(np.ones_like) - basis.constant).max() < ROUNDING


@pytest.mark.parametrize("basis", [b for b in BASES if b.size > 1], ids=repr)
def test_coarsened_bases_are_subspaces(basis: Basis) -> None:
    coarse = basis.coarsened()
    assert coarse is not None
    angle = np.linspace(0.05, 3.1, 40)
    small, table = coarse
    assert 0.4 * basis.size <= small.size <= 0.67 * basis.size
    assert np.abs(table @ table.T - np.eye(small.size)).max() < ROUNDING
    scale = np.abs(small.evaluate(angle)).max()
    assert np.abs(small.evaluate(angle) - basis.evaluate(angle) @ table.T).max() < ROUNDING * scale


def test_equal_bins_are_equal_in_the_cosine() -> None:
    assert np.allclose(np.cos(Bins(10).edges), np.linspace(1.0, -1.0, 11), rtol=0.0, atol=4e-16)
    assert np.allclose(Bins(10).weights, 0.1, rtol=4e-15, atol=0.0)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 300), st.floats(1e-12, np.pi - 1e-12))
def test_the_quick_search_finds_the_bin_whose_edges_hold_the_angle(n: int, angle: float) -> None:
    bins = Bins(n)
    index = int(bins.index(angle))
    assert bins.edges[index] <= angle < bins.edges[index + 1]


@pytest.mark.parametrize("n", [1, 2, 3, 64, 511, 512])
def test_edges_themselves_belong_to_the_bin_on_their_right(n: int) -> None:
    bins = Bins(n)
    assert bins.index(bins.edges[:-1]).tolist() == list(range(n))
    assert int(bins.index(np.pi)) == n - 1
    lower = bins.edges[: (n + 1) // 2]
    assert np.array_equal(bins.edges[::-1][: (n + 1) // 2], np.pi - lower)


def test_high_degrees_stay_accurate_next_to_grazing() -> None:
    # P_l(cos t) = 1 - l (l + 1) t^2 / 4 + O((l t)^4): the recurrence in cos t would lose it below t = 1e-8
    angle, degree = 1e-7, 400
    value = Legendre(degree + 1).evaluate(angle)[degree] / np.sqrt(2 * degree + 1.0)
    assert value == pytest.approx(1.0 - degree * (degree + 1) * angle**2 / 4.0, abs=1e-15)


@pytest.mark.parametrize("basis", [b for b in BASES if b.measure == SINE], ids=repr)
def test_the_flip_matrix_is_that_of_the_flip(basis: Basis) -> None:
    angle, weight = uniform_rule(basis)
    angle = np.sort(np.concatenate((angle, np.pi - angle)))
    edges = np.unique(np.concatenate((basis.edges, np.pi - basis.edges)))
    fine, weight = SINE.quadrature(edges, 40)
    expected = basis.evaluate(fine).T @ (weight[:, None] * basis.evaluate(np.pi - fine))
    assert np.abs(reflection_matrix(basis) - expected).max() < 1e-12
    finer, restriction = mirror_refinement(basis)
    assert is_mirror_symmetric(finer)
    # the flip of the finer basis, restricted, is the flip's Galerkin matrix
    assert np.abs(restriction @ reflection_matrix(finer) @ restriction.T - expected).max() < 1e-12


def test_tensor_bases_are_products_with_the_last_angle_fastest() -> None:
    theta, psi = Bins(3), Legendre(4, weight="sin2")
    basis = TensorBasis((theta, psi))
    value = basis.evaluate([[1.0, 0.5]])[0]
    assert np.array_equal(value, np.outer(theta.evaluate(1.0), psi.evaluate(0.5)).ravel())
    coefficients = basis.project(lambda point: np.cos(point[..., 0]) * np.cos(point[..., 1]))
    assert np.allclose(coefficients, np.kron(theta.project(np.cos), psi.project(np.cos)), atol=1e-14)
    assert TensorBasis((basis, theta)).factors == (theta, psi, theta)
    assert not basis.is_partition
    assert TensorBasis((Bins(2), Bins(2))).is_partition
    coarse = basis.coarsened()
    assert coarse is not None and coarse[1].shape == (2 * 2, 12)


def test_equality_is_that_of_the_functions() -> None:
    assert Bins(4) == Bins(Bins(4).edges)
    assert Bins(4) != Bins(4, weight="sin2")
    assert Legendre(3) != Legendre(4)
    assert Legendre(3) != Legendre(3, weight="sin2") and hash(Legendre(3)) != hash(Legendre(3, weight="sin2"))
    assert Panels([0, 1, np.pi], 2) != Panels([0, 1, np.pi], 3)
    assert Panels([0, 1, np.pi], 2) != Panels([0, 1, np.pi], 2, weight="sin2")
    assert Panels([0, 1, np.pi], 2) == Panels([0, 1, np.pi], 2)
    assert len({Bins(4), Bins(Bins(4).edges), Legendre(4)}) == 2


def test_bases_are_immutable() -> None:
    with pytest.raises(ValueError, match="read-only"):
        Bins(4).edges[0] = 1.0
    with pytest.raises(AttributeError):
        Legendre(4).n = 5  # type: ignore[misc]
