"""Enclosures of compositions with scatterings, images of fast functions, and walls of nearly straight sides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import eval_legendre

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from asperity.spectral.bounds.enclosure import Enclosure, _with_ties
from asperity.spectral.bounds.operator_residuals import image_rule
from asperity.spectral.bounds.separation import rest_of_spectrum


def test_products_of_scatterings_are_narrow_and_indexed():
    scattering, flip = ker.henyey_greenstein(0.5), ker.specular()
    for law, exact in ((scattering @ scattering, 0.25), (flip @ scattering, -0.5)):
        found = {item.index: item for item in spec.enclosures(law, 3)}
        assert exact in found[1] and found[1].width < 1e-13


def test_values_of_the_same_modulus_and_other_sign_are_not_indexed():
    """(.2 - .6)/2 = -.2 and (.04 + .36)/2 = .2: which is the larger is rounding."""
    found = spec.enclosures(0.5 * ker.henyey_greenstein(0.2) + 0.5 * ker.henyey_greenstein(-0.6), 3)
    assert [item.label for item in found] == ["indexed", "contains-spectrum", "contains-spectrum"]


@pytest.mark.parametrize("degree", [24, 39, 80])
def test_images_of_fast_functions_are_accurate(degree):
    angle = np.array([0.02, 0.7, 1.5, 2.9])
    image = ker.henyey_greenstein(0.3).apply(lambda theta: eval_legendre(degree, np.cos(theta)), angle)
    assert np.abs(image - 0.3**degree * eval_legendre(degree, np.cos(angle))).max() < 1e-13


def test_a_composition_whose_images_have_no_known_error_is_refused():
    arc, scattering = ker.CircularArcLaw(1.0), ker.henyey_greenstein(0.5)
    with pytest.raises(InputError, match="no known error"):
        spec.enclosures(arc @ scattering @ arc, 2)
    with pytest.raises(InputError, match="has a scattering that leaves"):
        near = ker.henyey_greenstein(0.96)
        spec.enclosures(near @ ker.TriangularTeethLaw(0.7) @ near, 2, tolerance=1e-12)


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


def test_a_first_power_is_the_law():
    law = ker.henyey_greenstein(0.5)
    assert [item.low for item in spec.enclosures(law**1, 3)] == [item.low for item in spec.enclosures(law, 3)]


def test_indices_that_may_change_places_say_so():
    def item(low, high, index):
        return Enclosure(0.5 * (low + high), low, high, "indexed", index, 0.0, "estimate", "reason")

    first, second, third = _with_ties([item(0.3, 0.4, 1), item(-0.35, -0.2, 2), item(-0.1, 0.15, 3)])
    assert first.reason == "reason; the order with 2 is not certain"
    assert second.reason == "reason; the order with 1 is not certain"
    assert third.reason == "reason"


def test_errors_of_means_of_a_density_with_a_kink_that_moves_are_counted():
    """1 + (|u - v| - (1 + u^2)/2 - (1 + v^2)/2 + 2/3)/2 has rows of mean 1, and a kink at u = v."""

    def kernel(u, v):
        return 1.0 + 0.5 * (np.abs(u - v) - 0.5 * (1.0 + u**2) - 0.5 * (1.0 + v**2) + 2.0 / 3.0)

    law = ker.DensityLaw(lambda theta, out: 0.5 * np.sin(out) * kernel(np.cos(theta), np.cos(out)))
    basis, angle = ker.Legendre(12), np.array([0.31, 0.9, 1.7, 2.6])
    found, error = image_rule(law, basis, np.eye(12))(angle, 1e-8)
    node, weight = np.polynomial.legendre.leggauss(20)
    for u, image, doubt in zip(np.cos(angle), found, error, strict=True):
        # polynomials on either side of the kink
        halves = [(0.5 * (a + b) + 0.5 * (b - a) * node, 0.5 * (b - a) * weight) for a, b in ((-1.0, u), (u, 1.0))]
        exact = sum((0.5 * w * kernel(u, v)) @ basis.evaluate(np.arccos(v)) for v, w in halves)
        assert 1e-12 < np.abs(image - exact).max() <= doubt < 1e-3


def test_the_next_value_of_slow_functions_is_held_against_fast_oscillations():
    """Sides that bend by 1e-4 nearly keep cos(44 theta); an arc keeps no oscillation."""
    left, right = [(0, 0), (0.25, -0.5001), (0.5, -1)], [(0.5, -1), (0.75, -0.5001), (1, 0)]
    bent = ker.WallLaw(geo.Wall([geo.Bezier(left), geo.Bezier(right)]))
    apart = rest_of_spectrum(bent, np.array([1.0, -0.88]), 1e-3, 0.7)
    assert apart.radius == 1.0 and "fast oscillations" in apart.reason
    assert rest_of_spectrum(ker.CircularArcLaw(1.2), np.array([1.0, 0.367]), 1e-3, 0.2).radius == 0.2


def test_the_matrix_of_a_scattering_in_polynomials_is_exact_and_agrees_with_quadrature():
    law, basis = ker.henyey_greenstein(0.6), ker.Legendre(8)
    exact, quadrature = (ker.discretise(law, basis, method=method) for method in ("auto", "quadrature"))
    assert exact.method == "exact" and quadrature.method == "quadrature"
    assert np.abs(exact.symmetric - np.diag(0.6 ** np.arange(8.0))).max() <= float(exact.error)
    assert np.abs(exact.symmetric - quadrature.symmetric).max() < 1e-12
