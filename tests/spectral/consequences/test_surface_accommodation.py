"""Accommodation of surfaces: closed forms, grooves, mixtures, the tensor, sideways momentum, and errors that hold."""

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError

HEIGHTS = np.array([0.0, 0.5, 0.2, 0.9, 0.1, 0.35, 0.6, 0.15])
PROFILE = ker.WallLaw(geo.Wall.from_profile(np.arange(9) / 4.0, np.append(HEIGHTS, HEIGHTS[0]), seam="step"))
GROOVES = geo.Surface(HEIGHTS[:, None], 0.25)
NOISE = geo.Surface(np.random.default_rng(4).integers(0, 4, (6, 5)) * 0.25)
CHIRAL = geo.Surface(np.array([[3, 2, 1], [2, 1, 2], [3, 0, 1]]) * 0.5)


def test_a_smooth_surface_accommodates_nothing_and_normal_incidence_on_gentle_facets_four_ninths():
    flat = spec.accommodation(ker.SurfaceLaw(geo.Surface([[0.0]])), incidence_deg=[0, 30, 80])
    assert abs(flat.tangential.value) < flat.tangential.error and abs(flat.normal.value) < flat.normal.error < 1e-3
    assert np.isnan(flat.tangential_at[0]) and flat.tangential_errors[0] == np.inf
    assert (np.abs(flat.tangential_at) <= flat.tangential_errors)[1:].all() and flat.tangential_errors[1:].max() < 1e-11
    assert (np.abs(flat.normal_at) <= flat.normal_errors).all() and flat.normal_errors.max() < 1e-11
    carton = ker.SurfaceLaw(geo.Surface([[0.0, 0.2], [0.2, 0.4]]))
    assert spec.accommodation(carton, 0.01, incidence_deg=0.0).normal_at[0] == pytest.approx(4.0 / 9.0, abs=1e-13)


@pytest.mark.parametrize("orientation", ["random", 0.0, 0.6])
def test_grooves_have_the_coefficients_of_their_planar_law(orientation):
    planar = spec.accommodation(ker.HemisphereLaw(PROFILE), tolerance=1e-7)
    found = spec.accommodation(ker.SurfaceLaw(GROOVES, orientation), tolerance=1e-3)
    for name in ("tangential", "normal", "maxwell_fraction"):
        one, other = getattr(found, name), getattr(planar, name)
        # half widths of 95 %, of which nine are looked at
        assert abs(one.value - other.value) <= 1.5 * (one.error + other.error) <= 8e-3
    whole = 2.0 * planar.tangential.value
    along = 0.0 if orientation == "random" else orientation
    turn = np.array([[np.cos(along), -np.sin(along)], [np.sin(along), np.cos(along)]])
    wanted = np.diag([whole, whole]) / 2.0 if orientation == "random" else turn @ np.diag([whole, 0.0]) @ turn.T
    assert (
        np.abs(found.tensor - wanted) <= 1.5 * found.tensor_errors + 1e-6
    ).all() and found.tensor_errors.max() < 8e-3


def test_coefficients_at_a_direction_are_those_of_independent_rays():
    for orientation in ("random", 0.4):
        law = ker.SurfaceLaw(CHIRAL, orientation)
        found = spec.accommodation(law, tolerance=2e-3, incidence_deg=[20.0, 60.0], azimuth_deg=[110.0, 110.0])
        for k, zenith in enumerate(np.radians([20.0, 60.0])):
            turn = math.radians(110.0)
            t, left = np.array([np.cos(turn), np.sin(turn), 0.0]), np.array([-np.sin(turn), np.cos(turn), 0.0])
            v = np.sin(zenith) * t - [0.0, 0.0, np.cos(zenith)]
            out = law.sample(np.tile(v, (200_000, 1)), rng=k)
            for values, one, wrong in (
                (1.0 - out @ t / np.sin(zenith), found.tangential_at[k], found.tangential_errors[k]),
                ((np.cos(zenith) - out[:, 2]) / (np.cos(zenith) - 2 / 3), found.normal_at[k], found.normal_errors[k]),
                (out @ left, found.sideways_at[k], found.sideways_errors[k]),
            ):
                assert abs(values.mean() - one) < 4.0 * values.std() / math.sqrt(200_000) + 1.5 * wrong


def test_a_mirror_image_has_the_opposite_sideways_momentum():
    left, right = (ker.SurfaceLaw(geo.Surface(z)) for z in (CHIRAL.heights, CHIRAL.heights.T))
    one, other = (spec.accommodation(law, 1e-3, incidence_deg=[60.0, 80.0]) for law in (left, right))
    assert (np.abs(one.sideways_at + other.sideways_at) < one.sideways_errors + other.sideways_errors).all()
    assert (np.abs(one.sideways_at) > 3 * one.sideways_errors).any()


def test_mixtures_mix_and_products_are_refused():
    S, H = ker.SurfaceLaw(NOISE), ker.HemisphereLaw(ker.lambertian())
    alone, mixed = (spec.accommodation(law, 1e-3, rng=1) for law in (S, 0.25 * S + 0.75 * H))
    assert mixed.tangential.value == pytest.approx(0.25 * alone.tangential.value + 0.75 * 0.5, abs=1e-7)
    assert mixed.tangential.error == pytest.approx(0.25 * alone.tangential.error, abs=1e-6)
    with pytest.raises(InputError, match="expected a law of one collision"):
        spec.accommodation(S @ H)


def test_the_averages_are_entries_of_the_matrix():
    law = ker.SurfaceLaw(NOISE, 0.3)
    matrix = ker.discretise(law, ker.Zernike(1), samples=2**18)
    found = spec.accommodation(law, tolerance=1e-3)
    # the functions are 1, 2 y, 2 x
    assert np.abs(np.eye(2) - matrix.symmetric[1:, 1:][::-1, ::-1] - found.tensor).max() < 2e-3 + matrix.error.value
    assert found.tangential.value == pytest.approx(0.5 * np.trace(found.tensor), abs=1e-12)


def test_surfaces_pass_as_many_particles_through_a_tube_as_the_grooves_that_they_are():
    surface, grooves = ker.SurfaceLaw(GROOVES), ker.HemisphereLaw(PROFILE)
    for first, second in ((surface, grooves), (0.5 * surface + 0.5 * grooves, grooves)):
        one, other = (spec.transmission(law, 2.0, "tube", tolerance=1e-2, rng=4) for law in (first, second))
        assert abs(one.value - other.value) < one.error + other.error < 0.03


def test_errors_of_95_percent_hold():
    law = ker.SurfaceLaw(NOISE)
    truth = spec.accommodation(law, tolerance=1e-9, rng=77)
    held = 0
    for seed in range(30):
        found = spec.accommodation(law, tolerance=0.1, rng=seed)
        held += abs(found.tangential.value - truth.tangential.value) <= found.tangential.error
        held += abs(found.normal.value - truth.normal.value) <= found.normal.error
    assert held >= 52


@pytest.mark.parametrize(
    ("law", "asked", "message"),
    [
        (ker.SurfaceLaw(NOISE), {"incidence_deg": 95.0}, r"expected degrees from the normal, in \[0, 90\)"),
        (ker.SurfaceLaw(NOISE), {"incidence_deg": math.degrees(math.acos(2 / 3))}, "48.19 degrees"),
        (ker.SurfaceLaw(NOISE), {"azimuth_deg": 3.0}, "azimuth_deg: expected incidence_deg beside it"),
        (ker.SurfaceLaw(NOISE), {"theta": 1.0}, "theta: expected none"),
        (ker.SurfaceLaw(NOISE), {"incidence_deg": [1.0, 2.0], "azimuth_deg": np.ones(3)}, "expected a shape that"),
        (ker.HemisphereLaw(ker.lambertian()), {"azimuth_deg": 3.0}, "azimuth_deg: expected none"),
        (ker.lambertian(), {"azimuth_deg": 3.0}, "azimuth_deg: expected none for .*, a law in the plane"),
    ],
)  # fmt: skip
def test_bad_input_ends_in_one_clear_error(law, asked, message):
    with pytest.raises(InputError, match=message):
        spec.accommodation(law, **asked)
