"""Momentum accommodation: closed forms, weighted means, and the nearest Maxwell law."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity import InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

AVERAGES = ("tangential", "normal", "maxwell_fraction", "misfit")


@settings(max_examples=15, deadline=None)
@given(st.floats(0.01, 0.99))
def test_the_coefficients_of_maxwells_law_are_its_fraction_at_every_angle(fraction):
    found = spec.accommodation(ker.maxwell(fraction))
    for name, value in zip(AVERAGES, (fraction, fraction, fraction, 0.0), strict=True):
        estimate = getattr(found, name)
        assert abs(estimate.value - value) <= estimate.error, name
    assert np.all(np.abs(found.tangential_at - fraction) <= found.tangential_errors)
    assert np.all(np.abs(found.normal_at - fraction) <= found.normal_errors)


def test_retroreflection_is_fitted_by_diffuse_walls_with_the_misfit_of_its_own_velocity():
    found = spec.accommodation(ker.retroreflection())
    assert (found.tangential.value, found.maxwell_fraction.value) == (pytest.approx(2.0, abs=1e-13), 1.0)
    assert abs(found.normal.value) <= found.normal.error
    # E cos^2 + E (sin - pi/4)^2 = 1 - pi^2/16
    assert abs(found.misfit.value - np.sqrt(1.0 - np.pi**2 / 16.0)) <= found.misfit.error < 1e-9


def test_an_arc_has_its_known_moment_in_both_conventions():
    law = ker.CircularArcLaw(1.2)
    paper, specular = (spec.accommodation(one) for one in (law, law.in_specular_frame()))
    # <u, P u>/<u, u> of this arc, from an independent tracer
    assert abs(paper.tangential.value - 1.327558333378) < 1e-11
    assert specular.tangential == paper.tangential and specular.misfit == paper.misfit


@pytest.mark.parametrize(
    "law",
    [ker.TriangularTeethLaw(0.7), ker.CircularArcLaw(0.8), ker.WallLaw(geo.dispersing_arcs(0.8)),
     0.3 * ker.lambertian() + 0.7 * ker.CircularArcLaw(1.0)],
    ids=repr,
)  # fmt: skip
def test_rays_agree_with_averages_and_with_the_misfit(law):
    found = spec.accommodation(law, 1e-6)
    rng = np.random.default_rng(3)
    number = 200_000
    theta = ker.SINE.sample(number, rng)
    first, second = law.sample(theta, rng), law.sample(theta, rng)
    tangential = 1.0 + 3.0 * np.cos(theta) * np.cos(first)
    raised = np.sin(theta) - np.pi / 4.0
    normal = 1.0 - raised * (np.sin(first) - np.pi / 4.0) / (2.0 / 3.0 - np.pi**2 / 16.0)
    keeps = 1.0 - found.maxwell_fraction.value
    # two draws at one angle are independent: the mean of the product is the square of the conditional mean
    square = sum(
        (function(first) - maxwell) * (function(second) - maxwell)
        for function, maxwell in (
            (np.cos, -keeps * np.cos(theta)), (lambda x: np.sin(x) - np.pi / 4.0, keeps * raised)
        )
    )  # fmt: skip
    for drawn, value in (
        (tangential, found.tangential.value), (normal, found.normal.value), (square, found.misfit.value**2)
    ):  # fmt: skip
        assert abs(drawn.mean() - value) < 4.5 * drawn.std() / np.sqrt(number) + 1e-6


def test_the_fraction_is_where_the_misfit_is_least():
    law = ker.CircularArcLaw(0.3)
    found = spec.accommodation(law)
    angle, weight = ker.SINE.quadrature(np.linspace(0.0, np.pi, 65), 8)
    along, across = law.apply(np.cos, angle), law.apply(np.sin, angle) - np.pi / 4.0

    def misfit(fraction):
        rest = along + (1.0 - fraction) * np.cos(angle), across - (1.0 - fraction) * (np.sin(angle) - np.pi / 4.0)
        return np.sqrt(weight @ (rest[0] ** 2 + rest[1] ** 2))

    best = found.maxwell_fraction.value
    assert 0.0 < best < 1.0
    assert misfit(best) == pytest.approx(found.misfit.value, abs=2.0 * found.misfit.error + 1e-6)
    assert misfit(best) < min(misfit(best - 1e-3), misfit(best + 1e-3))


@pytest.mark.parametrize("law", [ker.TriangularTeethLaw(0.7), ker.CircularArcLaw(1.2), ker.LeastResistanceLaw()])
def test_the_error_of_the_misfit_holds_against_a_fine_rule(law):
    found = spec.accommodation(law)
    angle, weight = ker.SINE.quadrature(np.linspace(0.0, np.pi, 4097), 4)
    keeps = 1.0 - found.maxwell_fraction.value
    rest = (
        law.apply(np.cos, angle) + keeps * np.cos(angle),
        law.apply(np.sin, angle) - np.pi / 4.0 - keeps * (np.sin(angle) - np.pi / 4.0),
    )
    fine = np.sqrt(weight @ (rest[0] ** 2 + rest[1] ** 2))
    assert abs(fine - found.misfit.value) <= found.misfit.error + 1e-6


def test_laws_without_known_means_are_sampled_with_honest_errors():
    # a product of two driven laws: its conditional means have no error of their own
    law = ker.WallLaw(geo.dispersing_arcs(0.5)) @ ker.WallLaw(geo.dispersing_arcs(0.5))
    found = spec.accommodation(law, 1e-3, theta=[0.4, 1.2])
    known = ker.WallLaw(geo.dispersing_arcs(0.5))
    exact = 1.0 + known.apply(lambda t: known.apply(np.cos, t), [0.4, 1.2]) / np.cos([0.4, 1.2])
    assert np.all(found.tangential_errors > 0.0)
    assert np.all(np.abs(found.tangential_at - exact) < 2.3 * found.tangential_errors)


@pytest.mark.parametrize("angle", [np.pi / 2, np.arcsin(np.pi / 4), np.pi - np.arcsin(np.pi / 4)])
def test_angles_at_which_a_coefficient_is_no_number_are_refused(angle):
    with pytest.raises(InputError, match="take one beside it"):
        spec.accommodation(ker.lambertian(), theta=[1.0, angle])


def test_the_default_angles_are_far_from_the_poles():
    found = spec.accommodation(ker.lambertian())
    assert np.abs(np.cos(found.theta)).min() > 0.03
    assert np.abs(np.sin(found.theta) - np.pi / 4).min() > 0.005


def test_what_is_no_law_is_refused():
    with pytest.raises(InputError, match="expected a law"):
        spec.accommodation(geo.flat())


def test_shallow_walls_have_the_coefficients_of_the_billiard_laplacian():
    flatness = spec.mean_squared_slope(geo.focusing_arcs(0.05))
    found = spec.accommodation(ker.CircularArcLaw(0.05))
    assert found.tangential.value / flatness == pytest.approx(4.0, rel=2e-3)
    # the Dirichlet form of sin(theta) over its variance
    assert found.normal.value / flatness == pytest.approx(1.0 / (1.0 - 3.0 * np.pi**2 / 32.0), rel=1e-2)
