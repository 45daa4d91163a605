"""Enclosures of eigenvalues of laws and of compositions with scatterings: they hold and are narrow."""

import numpy as np
import pytest
from scipy.special import eval_legendre

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.bounds.operator_residuals import image_rule
from asperity.spectral.bounds.separation import rest_of_spectrum


def test_maxwell_has_one_indexed_eigenvalue_and_the_rest_is_refused_with_the_reason():
    found = spec.enclosures(ker.maxwell(0.3), 3)
    assert [item.label for item in found] == ["indexed", "contains-spectrum", "contains-spectrum"]
    # .7 and -.7 are eigenvalues of infinite multiplicity: which of them come first is a matter of rounding
    assert 1.0 in found[0] and all(0.7 in item or -0.7 in item for item in found[1:])
    assert "its number is not known" in found[1].reason and "Lambertian fraction" in found[1].reason


@pytest.mark.parametrize(
    "wall", [geo.dispersing_arcs(0.5), geo.Wall([geo.Bezier([(0, 0), (0.3, -0.12), (1, 0)])])], ids=["bumps", "skew"]
)
def test_enclosures_of_curved_walls_hold_against_a_finer_run(wall):
    law = ker.WallLaw(wall)
    coarse = spec.enclosures(law, 2, basis=ker.Legendre(8), tolerance=1e-5)
    fine = spec.spectrum(ker.discretise(law, ker.Legendre(14), tolerance=1e-5), 2)
    assert coarse[1].label == "indexed" and coarse[1].index == 1
    slack = 2.0 * fine.errors.algebraic[1] + fine.matrix_error
    assert coarse[1].low - slack <= fine.values[1] <= coarse[1].high + slack


@pytest.mark.parametrize("tolerance", [1e-10, 1e-12])
def test_jumps_of_trial_functions_that_a_shallow_wall_smooths_between_nodes_are_seen(tolerance):
    law = ker.WallLaw(geo.dispersing_arcs(1e-3)).in_specular_frame()
    _, found = spec.enclosures(law, 2, tolerance=tolerance)
    # 1 - K^2/3 + O(K^4), four times the mean square of the slope
    assert found.label == "indexed" and found.low - 1e-12 <= 1.0 - 1e-6 / 3.0 <= found.high + 1e-12


def test_nothing_is_indexed_below_the_essential_spectrum():
    found = spec.enclosures(ker.CircularArcLaw(np.pi / 2), 2, basis=ker.Legendre(12))
    assert found[1].label == "contains-spectrum" and found[1].index is None


def test_the_order_of_values_of_the_same_modulus_and_other_sign_is_not_certain():
    """(.2 - .6)/2 = -.2 and (.04 + .36)/2 = .2: which is the larger is rounding."""
    found = spec.enclosures(0.5 * ker.henyey_greenstein(0.2) + 0.5 * ker.henyey_greenstein(-0.6), 3)
    assert ["the order with" in item.reason for item in found] == [False, True, True]


@pytest.mark.parametrize("degree", [24, 39, 80])
def test_images_of_fast_functions_are_accurate(degree):
    angle = np.array([0.02, 0.7, 1.5, 2.9])
    image = ker.henyey_greenstein(0.3).apply(lambda theta: eval_legendre(degree, np.cos(theta)), angle)
    assert np.abs(image - 0.3**degree * eval_legendre(degree, np.cos(angle))).max() < 1e-13


def test_errors_of_images_of_arcs_and_of_unresolved_polygons_are_counted():
    basis, angle = ker.Legendre(60), np.array([0.3, 1.1, 1.2002, 2.5])
    vectors, arc = np.eye(60), ker.CircularArcLaw(1.2)
    # midpoint sums over entry points, by parts where the fastest functions turn once
    x = (np.arange(200_000) + 0.5) / 200_000
    midpoint = np.array([basis.evaluate(arc.reflect(x, np.full(x.size, one))).mean(axis=0) for one in angle])
    found, error = image_rule(arc, basis, vectors)(angle, 1e-8)
    assert np.all(np.abs(found - midpoint).max(axis=1) <= error + 1e-3) and error.max() < 1e-2
    wall = geo.Wall.from_vertices([(0, 0), (0.2, -0.9), (0.45, -0.2), (0.8, -1.1), (1, 0)])
    few = ker.PolygonLaw(wall, max_beams=40)
    _, error = image_rule(few, ker.Bins(4), np.eye(4))(angle, 1e-8)
    assert float(few.unresolved) > 0.0 and np.all(error >= 2.0 * np.sqrt(float(few.unresolved)))


def test_errors_of_means_of_a_density_with_a_kink_that_moves_are_counted():
    """1 + (|u - v| - (1 + u^2)/2 - (1 + v^2)/2 + 2/3)/2 has rows of mean 1, and a kink at u = v."""

    def kernel(u, v):
        return 1.0 + 0.5 * (np.abs(u - v) - 0.5 * (1.0 + u**2) - 0.5 * (1.0 + v**2) + 2.0 / 3.0)

    law = ker.DensityLaw(lambda theta, out: 0.5 * np.sin(out) * kernel(np.cos(theta), np.cos(out)))
    basis, angle = ker.Legendre(12), np.array([0.31, 0.9, 1.7, 2.6])
    found, error = image_rule(law, basis, np.eye(12))(angle, 1e-8)
    node, weight = np.polynomial.legendre.leggauss(20)
    for u, image, uncertainty in zip(np.cos(angle), found, error, strict=True):
        # polynomials on either side of the kink
        halves = [(0.5 * (a + b) + 0.5 * (b - a) * node, 0.5 * (b - a) * weight) for a, b in ((-1.0, u), (u, 1.0))]
        exact = sum((0.5 * w * kernel(u, v)) @ basis.evaluate(np.arccos(v)) for v, w in halves)
        assert 1e-12 < np.abs(image - exact).max() <= uncertainty < 1e-3


def test_the_next_value_of_slow_functions_is_held_against_fast_oscillations():
    """Sides that bend by 1e-4 nearly keep cos(44 theta); an arc keeps no oscillation."""
    left, right = [(0, 0), (0.25, -0.5001), (0.5, -1)], [(0.5, -1), (0.75, -0.5001), (1, 0)]
    bent = ker.WallLaw(geo.Wall([geo.Bezier(left), geo.Bezier(right)]))
    apart = rest_of_spectrum(bent, np.array([1.0, -0.88]), 1e-3, 0.7)
    assert apart.radius == 1.0 and "fast oscillations" in apart.reason
    assert rest_of_spectrum(ker.CircularArcLaw(1.2), np.array([1.0, 0.367]), 1e-3, 0.2).radius == 0.2
