"""Matrices of laws with a density: ranks, eigenvalues, masses between bins, orders, products."""

import numpy as np
import pytest

from asperity import kernels as ker


def eigenvalues(matrix: ker.KernelMatrix) -> np.ndarray:
    return np.linalg.eigvalsh(0.5 * (matrix.symmetric + matrix.symmetric.T))[::-1]


def test_lambertian_matrices_have_rank_one_to_rounding() -> None:
    for basis in (ker.Bins(60), ker.Legendre(12), ker.Panels([0.0, 0.5, np.pi], 3)):
        matrix = ker.discretise(ker.lambertian(), basis)
        assert np.abs(matrix.symmetric - np.outer(basis.constant, basis.constant)).max() < 1e-14


def henyey_greenstein_on(basis: ker.Bins, g: float) -> np.ndarray:
    """The Galerkin matrix from sum (2 l + 1)/2 g^l P_l P_l, with the integral of P_l (P_{l+1} - P_{l-1})/(2 l + 1)."""
    u = np.cos(basis.edges)
    before, legendre = np.ones_like(u), u.copy()
    mass = -np.diff(u)
    flux = 0.5 * np.outer(mass, mass)
    for degree in range(1, int(np.log(1e-17) / np.log(abs(g)))):
        after = ((2 * degree + 1) * u * legendre - degree * before) / (degree + 1)
        integral = -np.diff(after - before) / (2 * degree + 1)
        flux += 0.5 * (2 * degree + 1) * g**degree * np.outer(integral, integral)
        before, legendre = legendre, after
    return flux / np.sqrt(np.outer(mass, mass))


UNEVEN = ker.Bins([0.0, 0.01, 0.3, 0.32, 1.0, 1.7, 2.5, 3.0, np.pi])


@pytest.mark.parametrize(
    ("g", "basis"),
    [
        (0.5, ker.Bins(64)),
        (0.95, UNEVEN),
        (0.99, ker.Bins(256)),
        (0.99, ker.Bins(7)),
        (-0.9, ker.Bins(64)),
        (-0.9, UNEVEN),
    ],
)
def test_peaked_densities_have_their_exact_masses_between_bins(g: float, basis: ker.Bins) -> None:
    matrix = ker.discretise(ker.henyey_greenstein(g), basis)
    assert np.linalg.norm(matrix.symmetric - henyey_greenstein_on(basis, g)) <= float(matrix.error)
    assert float(matrix.error) < 1e-7
    assert matrix.stochastic_defect() < 1e-10
    assert matrix.symmetry_defect() < 1e-9


def test_a_peak_much_narrower_than_the_bins_is_seen() -> None:
    matrix = ker.discretise(ker.henyey_greenstein(1.0 - 1e-5), ker.Bins(16))
    assert matrix.stochastic_defect() < 1e-10 and eigenvalues(matrix)[0] == pytest.approx(1.0, abs=1e-10)
    # a Galerkin eigenvalue of a reversible law lies below its own, g
    assert 0.999 < eigenvalues(matrix)[1] < 1.0 - 1e-5


@pytest.mark.parametrize(
    ("make", "sizes", "order"),
    [
        (ker.Bins, (16, 32, 64), ker.Bins.order),
        (lambda n: ker.Panels(np.linspace(0, np.pi, n + 1), 1), (12, 16, 24), 4),
        (lambda n: ker.Panels(np.linspace(0, np.pi, n + 1), 2), (8, 12, 16), 6),
    ],
    ids=["bins", "linear panels", "quadratic panels"],
)
def test_eigenvalues_converge_with_the_declared_order(make: object, sizes: tuple[int, ...], order: int) -> None:
    law, g = ker.henyey_greenstein(0.5), 0.5
    bases = [make(n) for n in sizes]  # type: ignore[operator]
    assert all(basis.order == order for basis in bases)
    errors = [g - eigenvalues(ker.discretise(law, basis, tolerance=1e-13))[1] for basis in bases]
    # Galerkin eigenvalues of a compact law approach from below
    assert min(errors) > 0.0
    slope = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.15)


def test_products_of_densities_are_the_galerkin_matrices_of_the_product() -> None:
    product = ker.henyey_greenstein(0.5) @ ker.henyey_greenstein(0.8)
    smooth = ker.discretise(product, ker.Legendre(12))
    assert np.abs(smooth.symmetric - np.diag(0.4 ** np.arange(12.0))).max() < 1e-11
    bins = ker.discretise(product, ker.Bins(12))
    exact = ker.discretise(ker.henyey_greenstein(0.4), ker.Bins(12))
    assert np.linalg.norm(bins.symmetric - exact.symmetric) <= float(bins.error)
    # which the product of the two Galerkin matrices is not
    factors = [ker.discretise(ker.henyey_greenstein(g), ker.Bins(12)) for g in (0.5, 0.8)]
    assert np.linalg.norm((factors[0] @ factors[1]).symmetric - exact.symmetric) > float(bins.error)
