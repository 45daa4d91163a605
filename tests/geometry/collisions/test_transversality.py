"""Bounds on the distance of a collision from the cylinder: they hold, are sharp, and cover nearly all states."""

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity.geometry.collisions.transversality import CollisionConstants
from disk_shapes import states

DISKS = geo.Disk(1.0, 0.5), geo.Disk(2.0, 0.15)
WALLS = {
    "flat": geo.flat(), "triangular": geo.triangular_teeth(1.2), "rectangular": geo.rectangular_teeth(0.8),
    "focusing": geo.focusing_arcs(1.2), "dispersing": geo.dispersing_arcs(1.0), "elliptical":
    geo.elliptical_arcs(0.9, DISKS[0]), "parabola": geo.double_parabola(),
    "lowered": geo.Wall.from_vertices([(0, -0.9), (0.4, -0.5), (1, -0.9)]),
}  # fmt: skip
# Scale, and the least fraction of licit pairs.
LICIT = {
    "flat": (1e-4, 0.8), "triangular": (1e-6, 0.4), "rectangular": (1e-6, 0.5), "focusing": (1e-9, 0.6),
    "dispersing": (1e-6, 0.6), "elliptical": (1e-9, 0.6), "parabola": (1e-14, 0.1), "lowered": (1e-6, 0.4),
}  # fmt: skip


def states_over(space: geo.ConfigurationSpace, n: int, seed: int = 0):
    return states(space.wall, space.scale, n, seed, space.disk, space.spacing)


@pytest.mark.parametrize("disk", DISKS, ids=str)
@pytest.mark.parametrize("name", WALLS)
def test_licit_pairs_have_the_same_contacts_and_velocities_within_the_bound(name, disk):
    scale, least = LICIT[name]
    space = geo.ConfigurationSpace(WALLS[name], disk, scale)
    position, velocity = states_over(space, 25)
    pairs = [geo.shadow(space, x, w) for x, w in zip(position, velocity, strict=True)]
    licit = np.array([pair.is_licit for pair in pairs])
    hit = geo.collide(disk, WALLS[name], scale, position, velocity, space.spacing)
    assert licit.mean() > least or disk is not DISKS[0]
    assert np.all(hit.escaped[licit]) and not np.any(hit.two_satellites[licit])
    assert np.array_equal(hit.contacts[licit], [len(pair.sines) for pair in pairs if pair.is_licit])
    apart = hit.velocity - [pair.velocity for pair in pairs]
    distance = np.sqrt(disk.inner(apart, apart))
    assert np.all(distance[licit] < np.array([pair.error for pair in pairs])[licit])
    assert all(math.isinf(pair.error) and pair.reason for pair in pairs if not pair.is_licit)


@pytest.mark.parametrize("name", ["triangular", "focusing"])
def test_contacts_of_the_true_disk_are_within_their_reaches(name):
    space = geo.ConfigurationSpace(WALLS[name], DISKS[0], 1e-6)
    found = 0
    for x, w in zip(*states_over(space, 40, 2), strict=True):
        pair = geo.shadow(space, x, w)
        if pair.is_licit:
            path = geo.collision_path(space.disk, space.wall, space.scale, x, w, space.spacing)
            contacts = space.zoomed.contact(path[1:-1] / space.scale)
            assert np.all(np.hypot(*(contacts - pair.points[1:-1]).T) <= pair.reaches)
            found += 1
    assert found > 10


def test_the_bound_is_attained_on_a_flat_wall_without_spin():
    # the normal turns by the satellite's angle, in the kinetic metric by (m/J)^(1/2) x
    disk = geo.Disk(1.0, 0.5)
    space = geo.ConfigurationSpace(geo.flat(), disk, 1e-8)
    for part in (0.1, 0.3):
        start = [0.0, part * space.spacing]
        pair = geo.shadow(space, start, [0.0, -1.0, 0.0])
        apart = geo.collide(disk, geo.flat(), 1e-8, [start], [[0.0, -1.0, 0.0]], space.spacing).velocity[0]
        apart = apart - pair.velocity
        # the angle and the time of flight make the difference
        assert 0.99 < math.sqrt(float(disk.inner(apart, apart))) / pair.error < 1.0
        assert math.isclose(pair.error, 2.0 * math.sqrt(2.0) * start[1], rel_tol=1e-2)


def test_the_radius_of_a_vertical_flight_into_teeth_is_known():
    # apex angle pi/2: sides y = -x and y = x - 1; a flight at x = 1/5 ends at (1/5, -1/5)
    space = geo.ConfigurationSpace(geo.triangular_teeth(0.5 * math.pi), geo.Disk(), 1e-9)
    for x in (0.2, 0.35, 0.45):
        pair = geo.shadow(space, [x * 1e-9, 0.0], [0.0, -1.0, 0.0])
        corner = math.sqrt(2.0) * (0.5 - x)
        facing = (1.0 - 2.0 * x) / math.sqrt(2.0)
        expected = min(x, corner, facing)
        assert math.isclose(pair.radii[0], expected, rel_tol=1e-9)
        np.testing.assert_allclose(pair.points[1], [x, -x], atol=1e-12)
        assert math.isclose(pair.sines[0], math.sqrt(0.5), rel_tol=1e-12)


def test_parallel_flights_within_the_radius_and_the_reach_meet_the_same_pieces():
    space = geo.ConfigurationSpace(WALLS["triangular"], DISKS[0], 1e-9)
    for x, w in zip(*states_over(space, 30, 3), strict=True):
        pair = geo.shadow(space, [x[0], 0.0], w)
        steps = np.diff(pair.points, axis=0)
        widest = 0.99 * pair.radii[0] * pair.sines[0] / (1.0 + pair.sines[0]) if len(pair.sines) else 0.0
        along = steps[0] / np.hypot(*steps[0])
        across = widest / max(abs(along[1]), 1e-9)
        for sign in (-1, 1):
            other = geo.shadow(space, [x[0] + sign * across * 1e-9, 0.0], w)
            sides = [(p.points[1, 0] - math.floor(p.points[1, 0])) < 0.5 for p in (pair, other)]
            assert sides[0] == sides[1]


def test_the_good_set_becomes_everything():
    rates = []
    for scale in (1e-5, 1e-8, 1e-11):
        space = geo.ConfigurationSpace(WALLS["triangular"], DISKS[0], scale)
        found = geo.good_fraction(space, 80, rng=4)
        # two satellites are excluded
        assert found.value - found.error < 1.0 - 2.0 * space.gap_radius / space.spacing
        rates.append(1.0 - found.value)
    assert rates[0] > rates[1] > rates[2] and rates[2] < 0.12


def test_the_error_of_the_good_fraction_covers():
    space = geo.ConfigurationSpace(geo.flat(), DISKS[0], 1e-3)
    reference = geo.good_fraction(space, 400, rng=0)
    runs = [geo.good_fraction(space, 25, rng=seed) for seed in range(1, 17)]
    missed = sum(abs(run.value - reference.value) > run.error for run in runs)
    # 4 or more of 16 at probability 0.05 have probability 0.007
    assert 0.3 < reference.value < 0.99 and missed <= 3


def test_the_constants_of_the_paper_are_larger_than_the_bounds():
    disk = geo.Disk(1.0, 1.0)
    constants = CollisionConstants.of(disk)
    space = geo.ConfigurationSpace(WALLS["focusing"], disk, 1e-9)
    tested = 0
    for x, w in zip(*states_over(space, 60, 5), strict=True):
        pair = geo.shadow(space, x, w)
        kappa = max(1.0, WALLS["focusing"].largest_curvature.value)
        if pair.is_licit and len(pair.sines) == 1 and space.spacing <= kappa * pair.reaches[0]:
            assert pair.error < constants.velocity * kappa * pair.reaches[0]
            tested += 1
    assert tested > 5
    assert constants.state - constants.velocity == pytest.approx(3.4) and constants.state < 80.0
    light = CollisionConstants.of(geo.Disk(2.0, 0.25))
    assert light.velocity / constants.velocity == pytest.approx(math.sqrt(2.5))


def test_the_angles_of_the_set_xi_become_nearly_all():
    parts = []
    for scale in (1e-5, 1e-9, 1e-13, 1e-17):
        space = geo.ConfigurationSpace(WALLS["triangular"], DISKS[0], scale)
        parts.append(space.good_half_width() * space.scale / (0.5 * space.spacing))
        assert parts[-1] < 1.0 - 2.0 * space.gap_radius / space.spacing
    assert np.all(np.diff(parts) > 0.0) and parts[-1] > 0.999


def test_a_flight_into_a_corner_has_no_shadow_and_a_reason():
    space = geo.ConfigurationSpace(WALLS["triangular"], DISKS[0], 1e-6)
    corner = geo.shadow(space, [0.0, 0.0], [0.0, -1.0, 0.0])
    assert not corner.is_licit and "corner" in corner.reason
