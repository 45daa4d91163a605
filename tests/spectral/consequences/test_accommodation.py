"""Momentum accommodation: closed forms, weighted means, and the nearest Maxwell law."""

from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

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


@pytest.mark.parametrize("law", [
    ker.TriangularTeethLaw(0.7), ker.CircularArcLaw(0.3), ker.LeastResistanceLaw(),
    0.3 * ker.lambertian() + 0.7 * ker.CircularArcLaw(1.0),
])  # fmt: skip
def test_averages_and_the_least_misfit_hold_against_a_fine_rule(law):
    found = spec.accommodation(law)
    angle, weight = ker.SINE.quadrature(np.linspace(0.0, np.pi, 4097), 4)
    raised = np.sin(angle) - np.pi / 4.0
    along, across = law.apply(np.cos, angle), law.apply(np.sin, angle) - np.pi / 4.0
    tangential = 1.0 + 3.0 * weight @ (np.cos(angle) * along)
    normal = 1.0 - weight @ (raised * across) / (2.0 / 3.0 - np.pi**2 / 16.0)
    for one, value in ((found.tangential, tangential), (found.normal, normal)):
        # the rule errs at kinks
        assert abs(one.value - value) <= one.error + 2e-5

    def misfit(fraction):
        rest = along + (1.0 - fraction) * np.cos(angle), across - (1.0 - fraction) * (np.sin(angle) - np.pi / 4.0)
        return np.sqrt(weight @ (rest[0] ** 2 + rest[1] ** 2))

    best = found.maxwell_fraction.value
    assert abs(misfit(best) - found.misfit.value) <= found.misfit.error + 1e-6
    assert misfit(best) < min(misfit(other) for other in (best - 1e-3, best + 1e-3) if other < 1.0)


@pytest.mark.parametrize("law", [ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0.3, -0.4), (1, 0)])),
                                 ker.WallLaw(geo.dispersing_arcs(0.01))], ids=["sawtooth", "shallow arcs"])  # fmt: skip
def test_degrees_from_the_normal_are_angles_that_begin_at_the_other_end(law):
    theta = np.array([np.pi / 3, 2 * np.pi / 3, np.pi / 12])
    by_degrees = spec.accommodation(law, 1e-4, incidence_deg=[30, -30, 75])
    by_angles = spec.accommodation(law, 1e-4, theta)
    assert np.allclose(by_degrees.theta, theta, rtol=1e-15)
    assert by_angles.incidence_deg == pytest.approx([30.0, -30.0, 75.0])
    for name in ("tangential_at", "normal_at"):
        assert np.allclose(getattr(by_degrees, name), getattr(by_angles, name), rtol=1e-6)
    if isinstance(law, ker.PolygonLaw):
        # a ray with theta < pi/2 moves to the left
        assert abs(by_degrees.tangential_at[0] - by_degrees.tangential_at[1]) > 0.1


@pytest.mark.parametrize("law", [ker.maxwell(0.25), ker.CircularArcLaw(1.2), ker.WallLaw(geo.dispersing_arcs(0.01)),
                                 ker.TriangularTeethLaw(0.7)], ids=repr)  # fmt: skip
def test_at_normal_incidence_only_the_normal_coefficient_is_defined(law):
    found = spec.accommodation(law, 1e-4, incidence_deg=[0.0, 45.0])
    assert np.isnan(found.tangential_at[0]) and np.isinf(found.tangential_errors[0]) and found.tangential_missed[0]
    expected = (1.0 - float(law.apply(np.sin, np.pi / 2))) / (1.0 - np.pi / 4)
    assert abs(found.normal_at[0] - expected) <= found.normal_errors[0] + 1e-7
    # the other angle does not suffer
    alone = spec.accommodation(law, 1e-4, incidence_deg=45.0)
    assert found.tangential_at[1] == pytest.approx(alone.tangential_at[0], rel=1e-4)
    assert found.tangential_missed[1] == alone.tangential_missed[0] and not found.normal_missed[0]


@pytest.mark.parametrize("law", [ker.maxwell(0.25), ker.CircularArcLaw(1.2), ker.retroreflection(),
                                 0.5 * ker.lambertian() + 0.5 * ker.TriangularTeethLaw(0.7)], ids=repr)  # fmt: skip
def test_the_fraction_at_an_angle_is_where_the_misfit_is_least(law):
    found = spec.accommodation(law, incidence_deg=[0.0, 20.0, -65.0])
    along, across = law.apply(np.cos, found.theta), law.apply(np.sin, found.theta)

    def misfits(fraction):
        keeps = 1.0 - fraction
        mean_sine = keeps * np.sin(found.theta) + fraction * np.pi / 4.0
        return np.hypot(along + keeps * np.cos(found.theta), across - mean_sine)

    every = np.array([misfits(fraction) for fraction in np.linspace(0.0, 1.0, 20_001)])
    assert np.all(np.abs(every.argmin(axis=0) / 20_000 - found.maxwell_fraction_at) < 1e-4)
    assert np.all(np.abs(misfits(found.maxwell_fraction_at) - found.misfit_at) <= found.misfit_errors + 1e-8)
    assert np.all(every.min(axis=0) >= found.misfit_at - found.misfit_errors - 1e-8)
    if law == ker.maxwell(0.25):
        assert np.all(np.abs(found.maxwell_fraction_at - 0.25) <= found.maxwell_fraction_errors)
        assert np.all(found.misfit_at <= found.misfit_errors) and found.misfit_errors.max() < 1e-14


def test_errors_at_an_angle_hold_for_laws_without_known_means():
    # a product of two driven laws: its conditional means have no error of their own
    one = ker.WallLaw(geo.dispersing_arcs(0.5))
    sampled = spec.accommodation(one @ one, 1e-4, incidence_deg=[10.0, 50.0])
    assert sampled.tangential_missed.all()
    theta, exact = sampled.theta, []
    angles, second = np.linspace(0.005, np.pi - 0.005, 400), one.conditionals(sampled.theta)
    for function in (np.cos, np.sin):
        # means of the first law at many angles, and between them a spline, to 1e-8
        means = CubicSpline(angles, one.apply(function, angles))(second.nodes)
        exact.append(np.add.reduceat(second.weights * means, second.starts[:-1]))
    changes = np.stack([np.cos(theta) + exact[0], np.sin(theta) - exact[1]], axis=1)
    complete = np.stack([np.cos(theta), np.sin(theta) - np.pi / 4.0], axis=1)
    fraction = np.clip(np.sum(changes * complete, axis=1) / np.sum(complete**2, axis=1), 0.0, 1.0)
    misfit = np.linalg.norm(changes - fraction[:, None] * complete, axis=1)
    assert np.all(np.abs(1.0 + exact[0] / np.cos(theta) - sampled.tangential_at) < 2.3 * sampled.tangential_errors)
    assert np.all(np.abs(fraction - sampled.maxwell_fraction_at) < 1.5 * sampled.maxwell_fraction_errors)
    assert np.all(np.abs(misfit - sampled.misfit_at) < 1.5 * sampled.misfit_errors)
    assert np.all(sampled.misfit_errors > 1e-4)


def test_incidence_from_thirty_degrees_on_keeps_relative_accuracy_for_shallow_walls():
    wall = geo.dispersing_arcs(1e-4)
    found = spec.accommodation(ker.WallLaw(wall), 1e-6, incidence_deg=[0, 30, 60])
    assert np.all(found.tangential_errors[1:] < 1e-6 * found.tangential_at[1:])
    assert np.all(found.normal_errors < 1e-6 * np.abs(found.normal_at))
    # sigma_t is 4 E sin(slope)^2 for the leading order
    assert found.tangential_at[1:] == pytest.approx(4 * float(spec.mean_squared_slope(wall)), rel=1e-3)


def test_the_default_angles_are_far_from_the_poles():
    found = spec.accommodation(ker.lambertian())
    assert np.abs(np.cos(found.theta)).min() > 0.03
    assert np.abs(np.sin(found.theta) - np.pi / 4).min() > 0.005


def random_polygon(steepest, rng):
    """The vertices of a closed path from (0, 0) to (1, 0) below y = 0, with slopes of about this size."""
    x = np.concatenate([[0.0], np.sort(rng.uniform(0.05, 0.95, 4)), [1.0]])
    y = np.concatenate([[0.0], -rng.uniform(0.2, 1.0, 4), [0.0]])
    slope = np.abs(np.diff(y) / np.diff(x)).max()
    return list(zip(x.tolist(), (y * 0.99 * steepest / slope).tolist(), strict=True))


def exact_coefficients(vertices, theta):
    """Both coefficients in 50 digits, each side weighted with the entry points of its rays, which meet no other."""
    with mp.workdps(50):
        angle, along, raised = mp.mpf(float(theta)), mp.mpf(0), mp.mpf(0)
        for (x, y), (x2, y2) in pairwise(vertices):
            width, rise = mp.mpf(x2) - mp.mpf(x), mp.mpf(y2) - mp.mpf(y)
            share = width - rise * mp.cot(angle)
            outgoing = mp.pi - angle + 2 * mp.atan2(rise, width)
            along += share * mp.cos(outgoing)
            raised += share * mp.sin(outgoing)
        complete = mp.sin(angle) - mp.pi / 4
        return float(1 + along / mp.cos(angle)), float((mp.sin(angle) - raised) / complete)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-6, 1e-3, 0.09])
@pytest.mark.parametrize("diffuse", [0.0, 1e-9])
def test_coefficients_of_random_shallow_walls_have_the_digits_of_sums_in_fifty_digits(size, diffuse):
    rng = np.random.default_rng(int(-np.log10(size)))
    for _ in range(2):
        vertices = random_polygon(size, rng)
        law = ker.WallLaw(geo.Wall([geo.Segment(*ends) for ends in pairwise(vertices)]))
        law = diffuse * ker.lambertian() + (1.0 - diffuse) * law if diffuse else law
        theta = np.concatenate([rng.uniform(3.1 * size, np.pi - 3.1 * size, 6), [3.1 * size, np.pi - 3.1 * size]])
        found = spec.accommodation(law, theta=theta)
        exact = np.array([exact_coefficients(vertices, angle) for angle in theta]) * (1.0 - diffuse) + diffuse
        assert np.all(np.abs(found.tangential_at - exact[:, 0]) <= found.tangential_errors + 1e-12 * exact[:, 0])
        assert np.all(np.abs(found.normal_at - exact[:, 1]) <= found.normal_errors + 1e-12 * np.abs(exact[:, 1]))
        assert np.all(found.tangential_errors <= 1e-8 * found.tangential_at) and not found.tangential_missed.any()


@pytest.mark.parametrize("size", [1e-6, 1e-4, 1e-2, 0.05, 0.3, 1.0])
def test_the_mean_accommodation_of_walls_is_four_times_their_mean_squared_slope(size):
    """With the mean of sin(slope)^2 in closed form; the next order is below 40 s^4 ln(1/s)."""
    walls = (
        (geo.dispersing_arcs(size), size**2 / 12.0, 0.5 * size),
        (geo.focusing_arcs(size), np.sin(size) ** 2 / 3.0, size),
        (geo.triangular_teeth(np.pi - 2.0 * size), np.sin(size) ** 2, size),
    )
    for wall, square, steepest in walls:
        found = spec.accommodation(ker.WallLaw(wall), theta=[0.6, 1.2])
        beyond = 40.0 * steepest**4 * (1.0 - np.log(min(steepest, 1.0)))
        # pi - 2 s has an error of half a unit in the last place of pi
        rounding = 2e-15 * steepest
        assert abs(found.tangential.value - 4.0 * square) <= found.tangential.error + beyond + rounding
        assert found.tangential.error <= 1e-5 * found.tangential.value
        if size < 0.1:
            assert np.all(np.abs(found.tangential_at / (4.0 * square) - 1.0) < 1e-9 + rounding / square)
            # the Dirichlet form of sin(theta) over its variance
            assert found.normal.value / square == pytest.approx(1.0 / (1.0 - 3.0 * np.pi**2 / 32.0), rel=1e-2)


def test_the_misfit_of_very_shallow_teeth_is_that_of_their_exact_changes():
    size = 1e-5
    vertices = [(0.0, 0.0), (0.5, -0.5 * size), (1.0, 0.0)]
    law = ker.WallLaw(geo.Wall([geo.Segment(*ends) for ends in pairwise(vertices)]))
    found = spec.accommodation(law)
    edges = np.concatenate([np.geomspace(3.0 * size, 0.3, 20), np.linspace(0.3, 0.5 * np.pi, 6)[1:]])
    angle, weight = ker.SINE.quadrature(edges, 6)
    complete = np.stack([np.cos(angle), np.sin(angle) - np.pi / 4.0], axis=1)
    rest = np.array([exact_coefficients(vertices, one) for one in angle]) - found.maxwell_fraction.value
    # less steep rays, 4.5 s^2 of all, change by 5 s at most
    steep, grazing = 2.0 * float(weight @ np.sum((rest * complete) ** 2, axis=1)), 4.5 * 25.0 * size**4
    low, high = np.sqrt(steep), np.sqrt(steep + grazing)
    assert low - found.misfit.error <= found.misfit.value <= high + found.misfit.error
    assert found.misfit.error < 0.05 * found.misfit.value


@pytest.mark.slow
def test_angles_at_which_the_tolerance_is_missed_are_named():
    law = ker.WallLaw(geo.dispersing_arcs(1e-4))
    found = spec.accommodation(law, theta=[1e-4, 1.0])
    assert found.tangential_missed.tolist() == found.normal_missed.tolist() == [True, False]
    # the mean over so few rays has an error all the same, and it holds
    assert 0.0 < found.tangential_errors[0] < 0.2 * found.tangential_at[0]
    assert not spec.accommodation(ker.specular(), theta=[0.5]).tangential_missed.any()


@pytest.mark.parametrize("kind", [ker.WallLaw, ker.PolygonLaw])
def test_measured_profiles_of_small_heights_have_errors_relative_to_the_coefficients(kind):
    """Of 4 heights or 200, of size 1e-6: as many pieces as they have."""
    rng = np.random.default_rng(0)
    for number in (5, 201):
        heights = 1e-6 * rng.uniform(-1.0, 0.0, number) / number
        heights[[0, -1]] = 0.0
        wall = geo.Wall.from_profile(np.linspace(0.0, 1.0, number), heights)
        found = spec.accommodation(kind(wall), theta=[0.6, 1.2, 2.0])
        vertices = np.array([*(piece.start for piece in wall.cell.pieces), wall.cell.pieces[-1].end]) / wall.period
        exact = np.array([exact_coefficients(vertices, angle) for angle in found.theta])
        assert np.all(np.abs(found.tangential_at - exact[:, 0]) <= found.tangential_errors + 1e-12 * exact[:, 0])
        assert np.all(np.abs(found.normal_at - exact[:, 1]) <= found.normal_errors + 1e-12 * np.abs(exact[:, 1]))
        for one in (found.tangential, found.normal, found.maxwell_fraction):
            assert 0.0 < one.error < 1e-6 * one.value
        assert not found.tangential_missed.any() and found.misfit.error < 0.2 * found.misfit.value


def test_a_coefficient_that_misses_its_tolerance_beside_a_pole_says_so():
    law = ker.WallLaw(geo.dispersing_arcs(1.0))
    words = spec.accommodation(law @ law, 1e-4, incidence_deg=[3.0, 20.0, 40.0]).by_angle()
    assert "tangential" in words["at 3 degrees"].split(" (its definition is singular at 0 degrees")[0]
    assert words["at 40 degrees"].endswith("(its definition is singular at 38.24 degrees; maxwell_fraction_at is not)")
    assert "singular" not in words["at 20 degrees"]
    assert "singular" not in str(spec.accommodation(ker.maxwell(0.25), incidence_deg=[0.0, 3.0, 40.0]).by_angle())
