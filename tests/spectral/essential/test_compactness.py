"""Hilbert-Schmidt norms against closed forms, and reasons where there is none."""

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec


@pytest.mark.parametrize("g", [-0.5, 0.0, 0.3, 0.8, 0.95, 0.99])
def test_the_norm_of_henyey_greenstein_scattering_is_the_sum_of_its_eigenvalues(g):
    norm = spec.hilbert_schmidt_norm(ker.henyey_greenstein(g))
    assert norm.compact
    assert abs(float(norm) - (1.0 - g * g) ** -0.5) <= norm.error + 1e-14
    if abs(g) < 0.97:
        assert norm.error < 1e-6


def test_norms_of_densities_agree_with_an_integral():
    """Squares of k = p/(sin theta'/2), integrated by another rule."""
    weight = 0.5

    def density(theta, outgoing):
        return 0.5 * np.sin(outgoing) * (1.0 + weight * np.cos(theta) * np.cos(outgoing))

    norm = spec.hilbert_schmidt_norm(ker.DensityLaw(density))
    # int int (1 + w x y)^2 dx dy/4 = 1 + w^2/9
    assert abs(float(norm) - math.sqrt(1.0 + weight**2 / 9.0)) <= norm.error < 1e-6


def test_norms_of_powers_and_products():
    powers = spec.hilbert_schmidt_norm(ker.henyey_greenstein(0.7) ** 2)
    assert float(powers) == pytest.approx((1.0 - 0.7**4) ** -0.5, abs=2 * powers.error + 1e-12)
    turned = spec.hilbert_schmidt_norm(ker.henyey_greenstein(0.7) @ ker.specular())
    assert float(turned) == pytest.approx((1.0 - 0.49) ** -0.5, abs=2 * turned.error + 1e-12)


@pytest.mark.parametrize(
    "law",
    [
        ker.specular(), ker.maxwell(0.9), ker.TriangularTeethLaw(0.7), ker.WallLaw(geo.koch(1)),
        ker.WallLaw(geo.mushrooms(0.4)), ker.CircularArcLaw(0.5 * np.pi), ker.InvolutionLaw(lambda t: np.pi - t),
        0.5 * ker.lambertian() + 0.5 * ker.InvolutionLaw(lambda t: np.pi - t),
    ],
    ids=repr,
)  # fmt: skip
def test_laws_that_are_not_compact_have_no_norm_and_a_reason(law):
    norm = spec.hilbert_schmidt_norm(law)
    assert norm.value == math.inf and norm.error == 0.0 and norm.compact is False
    assert norm.reasons


def test_the_norms_of_matrices_of_a_law_without_norm_grow():
    """The independent view: squared norms of Galerkin matrices of an isometric law grow like their size."""
    sizes = [16, 32, 64]
    squares = [np.sum(ker.discretise(ker.TriangularTeethLaw(0.7), ker.Legendre(n)).symmetric ** 2) for n in sizes]
    assert np.all(np.diff(squares) / np.diff(sizes) > 0.2)


def test_where_no_theorem_decides_the_value_is_a_lower_bound():
    norm = spec.hilbert_schmidt_norm(ker.CircularArcLaw(1.2))
    assert norm.error == math.inf and norm.compact is None
    larger = np.linalg.norm(ker.discretise(ker.CircularArcLaw(1.2), ker.Legendre(64)).symmetric)
    assert float(norm) <= larger
