"""Fractions by number of bounces, and the specular fraction: unfolded grooves, traced rays, and what is refused."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

DEGREES = [0.0, 17.0, 30.0, -45.0, 62.5, -80.0, 89.0]


def on_the_right(half, incidence, most):
    """Of the rays into a groove with sides of length 1, those of the right side with 1, 2, ..., and more bounces.

    Unfolded about the bottom, the images of the right tip lie at the angles 3 half, 5 half, ... from the vertical. A
    straight ray leaves by the j-th image of the opening if it passes outside all images of the tip up to the j-th.
    p is the distance from the bottom, at which a ray passes.
    """
    low, high = max(0.0, np.sin(incidence - half)), np.sin(incidence + half)
    further = [high]
    for j in range(1, most + 1):
        further.append(min(further[-1], np.sin((2 * j + 1) * half + incidence)))
    at_least = np.maximum(np.array(further) - low, 0.0) / (2.0 * np.sin(half) * np.cos(incidence))
    return np.append(-np.diff(at_least), at_least[-1])


def unfolded(angle, degrees, most):
    half, incidence = 0.5 * angle, np.radians(degrees)
    return on_the_right(half, incidence, most) + on_the_right(half, -incidence, most)


@pytest.mark.parametrize("angle", [0.3, 1.0, np.pi / 2, 2.0, 2.9])
def test_fractions_of_grooves_are_those_of_the_unfolded_groove(angle):
    for degrees, row in zip(DEGREES, spec.bounce_shares(geo.triangular_teeth(angle), DEGREES), strict=True):
        exact = unfolded(angle, degrees, 4)
        assert [one.kind for one in row] == ["bound"] * 5
        for one, value in zip(row, exact, strict=True):
            assert abs(one.value - value) <= one.error < 1e-10, degrees


def counted(wall, degrees, most, rays, seed):
    x = np.random.default_rng(seed).random(rays) * wall.period
    bounces = geo.trace(wall, x, np.radians(90.0 - degrees)).collisions
    return np.bincount(np.minimum(bounces - 1, most), minlength=most + 1) / rays


WALLS = {
    "koch": geo.koch(),
    "rectangles": geo.rectangular_teeth(2.3),
    "two hollows": geo.Wall.from_vertices(
        [(0, 0), (0.3, -0.8), (0.5, 0), (0.7, 0), (0.75, -0.4), (1.0, -0.3), (1.2, 0)]
    ),
    "arcs": geo.focusing_arcs(1.2),
    "mushrooms": geo.mushrooms(),
}


@pytest.mark.parametrize("name", WALLS)
def test_fractions_are_those_of_independent_rays(name):
    wall, degrees, rays = WALLS[name], [0.0, 35.0, -70.0], 200_000
    for angle, row in zip(degrees, spec.bounce_shares(wall, degrees, most=3), strict=True):
        found = counted(wall, angle, 3, rays, 7)
        for one, fraction in zip(row, found, strict=True):
            assert abs(one.value - fraction) <= one.error + 5.0 * np.sqrt(fraction * (1 - fraction) / rays) + 5.0 / rays
        assert sum(one.value for one in row) == pytest.approx(1.0, abs=1e-12)
        assert {one.kind for one in row} == {"bound" if wall.is_polygonal else "estimate"}


def test_a_number_of_bounces_that_no_ray_has_is_not_excluded():
    (row,) = spec.bounce_shares(geo.focusing_arcs(0.5), 20.0, most=5)
    assert row[-1].value == 0.0 and row[-1].error == pytest.approx(3.0 / 2**16)
    assert sum(one.value > 0.0 for one in row) >= 1


def test_errors_of_rays_hold_against_many_rays():
    wall = geo.dispersing_arcs(1.5)
    misses = 0
    bounces = geo.trace(wall, (np.arange(2**22) + 0.5) / 2**22 * wall.period, np.radians(50.0)).collisions
    exact = np.bincount(np.minimum(bounces - 1, 2), minlength=3) / 2**22
    for seed in range(10):
        (row,) = spec.bounce_shares(wall, 40.0, most=2, rng=seed)
        misses += sum(abs(one.value - value) > one.error for one, value in zip(row, exact, strict=True))
        assert max(one.error for one in row) < 5e-4
    assert misses <= 3


def test_a_flat_wall_bounces_once():
    assert [float(one) for one in spec.bounce_shares(geo.flat(), 20.0, most=2)[0]] == [1.0, 0.0, 0.0]


ARCS = ker.WallLaw(geo.focusing_arcs(1.0))
WITH_TOPS = ker.WallLaw(geo.Wall([*geo.focusing_arcs(1.0).pieces, geo.Segment((1.0, 0.0), (1.5, 0.0))], period=1.5))
TRACED_WITH_TOPS = ker.WallLaw(
    geo.Wall([*geo.dispersing_arcs(0.8).pieces, geo.Segment((1.0, 0.0), (1.5, 0.0))], period=1.5)
)


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (ker.specular(), 1.0),
        (ker.retroreflection(), 0.0),
        (ker.maxwell(0.3), 0.7),
        (ker.maxwell(0.3).in_specular_frame(), 0.7),
        (ker.henyey_greenstein(0.4), 0.0),
        (ker.specular() @ ker.specular(), 0.0),
        (ker.specular() ** 3, 1.0),
        (ker.specular() ** 4, 0.0),
        (ker.maxwell(0.3) ** 3, 0.7**3),
        (ker.TriangularTeethLaw(1.0) @ ker.lambertian(), 0.0),
        (ARCS, 0.0),
        (WITH_TOPS, 1.0 / 3.0),
        (WITH_TOPS.in_specular_frame(), 1.0 / 3.0),
        (TRACED_WITH_TOPS, 1.0 / 3.0),
        (TRACED_WITH_TOPS @ ker.specular(), 0.0),
        (0.5 * WITH_TOPS + 0.5 * ker.specular(), 2.0 / 3.0),
        (ker.WallLaw(geo.dispersing_arcs(0.8)), 0.0),
    ],
    ids=repr,
)
def test_the_specular_fraction_is_exact_where_it_is_known(law, expected):
    for one in (spec.specular_share(law), *spec.specular_share(law, [0.0, 40.0, -75.0])):
        assert one.kind == "bound" and abs(one.value - expected) <= one.error < 1e-12


@pytest.mark.parametrize("ratio", [0.2, 1.0, 30.0])
def test_the_average_of_rectangular_teeth_is_that_of_its_fraction_by_angle(ratio):
    law = ker.RectangularTeethLaw(ratio)
    found = spec.specular_share(law)
    # pieces between the angles where it is linear in the cotangent; beyond the last one it is between 1/2 and 1
    edges, omitted = law.breakpoints(2**12)
    angle, weight = ker.SINE.quadrature(edges, 6)
    exact = weight @ law.branches(angle)[0][:, 0] + 0.75 * omitted
    assert abs(found.value - exact) < 0.25 * omitted + 1e-12 and found.kind == "bound"
    assert found.error < 1e-10
    turned = spec.specular_share(law @ ker.specular())
    assert turned.value == pytest.approx(1.0 - found.value, abs=1e-9)


POLYGONS = [
    ker.WallLaw(geo.triangular_teeth(1.0)),
    ker.WallLaw(geo.rectangular_teeth(0.7)),
    ker.PolygonLaw(WALLS["two hollows"]),
    ker.WallLaw(geo.Wall.from_vertices([(0, 0), (0.3, -0.2), (0.8, -0.2), (1, 0)])),
    0.25 * ker.retroreflection() + 0.75 * ker.WallLaw(geo.koch()),
    ker.WallLaw(geo.mushrooms()),
]


@pytest.mark.parametrize("law", POLYGONS, ids=repr)
def test_the_specular_fraction_is_that_of_drawn_angles(law):
    rng, number = np.random.default_rng(11), 100_000
    theta = ker.SINE.sample(number, rng)
    found = spec.specular_share(law)
    near = np.abs(law.sample(theta, rng) - (np.pi - theta)) < 1e-9
    assert abs(near.mean() - found.value) < 4.5 * np.sqrt(0.25 / number) + found.error
    for degrees, one in zip([10.0, 50.0, -50.0], spec.specular_share(law, [10.0, 50.0, -50.0]), strict=True):
        angle = np.radians(90.0 - degrees)
        near = np.abs(law.sample(np.full(number, angle), rng) - (np.pi - angle)) < 1e-9
        assert abs(near.mean() - one.value) < 4.5 * np.sqrt(0.25 / number) + one.error
        assert one.error < 1e-3


def test_retroreflection_at_normal_incidence_is_not_counted():
    corner = ker.WallLaw(geo.triangular_teeth(np.pi / 2))
    assert spec.specular_share(corner, 0.0)[0].value == 0.0
    assert spec.specular_share(ker.retroreflection(), 0.0)[0].value == 0.0
    # a right-angled notch, and in the same hollow a curved side, so that rays are drawn
    sides = [geo.Segment((0.0, 0.0), (0.5, -0.5)), geo.Segment((0.5, -0.5), (0.9, -0.1))]
    curve = geo.Bezier([(0.9, -0.1), (0.95, -0.15), (1.05, -0.1), (1.1, 0.0)])
    (found,) = spec.specular_share(ker.WallLaw(geo.Wall([*sides, curve], period=1.1)), 0.0)
    assert found.kind == "estimate" and found.value < 0.01


@pytest.mark.parametrize("angle", [1.2, 2.0, 2.6])
@pytest.mark.parametrize("degrees", [0.0, 10.0, 25.0])
def test_single_bounces_of_grooves_are_torrance_and_sparrows_attenuation(angle, degrees):
    """Of a lit side the fraction min(1, 2 (n h)(n v)/(v h)) reflects once: h its normal, v outgoing, n the border's."""
    incidence, seen = np.radians(degrees), 0.0
    opening = 2.0 * np.sin(0.5 * angle) * np.cos(incidence)
    toward = np.array([np.sin(incidence), -np.cos(incidence)])
    for side in (-1.0, 1.0):
        normal = np.array([-side * np.cos(0.5 * angle), np.sin(0.5 * angle)])
        facing = -float(toward @ normal)
        leaving = toward + 2.0 * facing * normal
        assert facing > 0.0
        masked = 1.0 if leaving[1] <= 0.0 else 2.0 * normal[1] * leaving[1] / facing
        # a ray that moves on downwards, or outwards over the same side, meets no other
        outward = leaving[1] > 0.0 and side * leaving[0] > 0.0
        seen += facing / opening * (0.0 if leaving[1] <= 0.0 else 1.0 if outward else min(1.0, masked))
    (row,) = spec.bounce_shares(geo.triangular_teeth(angle), degrees)
    assert row[0].value == pytest.approx(seen, abs=1e-13)
