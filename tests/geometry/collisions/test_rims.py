"""Disks with unequal satellites, teeth, and pairs: the compiled collision, dense searches, the limit."""

import math
from functools import partial

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import ks_2samp
from shapely import Polygon

from asperity import geometry as geo
from asperity import kernels as ker
from disk_shapes import PAIR, TOOTHED, UNEQUAL, VELOCITY, bodies, gear, starts

DISK = geo.Disk(1.0, 0.5)
EQUAL = geo.SatelliteDisk(PAIR[0], 5, 0.15), geo.SatelliteDisk(PAIR[1], 7, 0.1)
WALLS = {"triangular": geo.triangular_teeth(1.2), "rectangular": geo.rectangular_teeth(0.8), "flat": geo.flat()}


def states(period: float, spacing: float, n: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    position = rng.uniform([0.0, -0.5], [1.0, 0.5], (n, 2)) * [period, spacing]
    up, turn = np.sqrt(rng.uniform(0.05, 1.0, n)), rng.uniform(0.0, 2.0 * np.pi, n)
    side = np.sqrt(1.0 - up**2)
    return position, np.stack([side * np.cos(turn), -up, side * np.sin(turn)], axis=1) @ DISK.frame


@pytest.mark.parametrize("name", WALLS)
def test_equally_spaced_points_collide_as_in_the_compiled_loop(name):
    for scale in (1e-2, 1e-4):
        space = geo.ConfigurationSpace(WALLS[name], DISK, scale)
        position, velocity = states(scale * space.wall.period, space.spacing, 30)
        known = geo.collide(DISK, WALLS[name], scale, position, velocity, space.spacing)
        body = geo.SatelliteDisk(DISK, space.charts.satellites, 0.0)
        found = geo.collide_rim(body, WALLS[name], scale, position, velocity)
        np.testing.assert_array_equal(found.contacts, known.contacts)
        np.testing.assert_array_equal(found.two_satellites, known.two_satellites)
        for ours, theirs in ((found.velocity, known.velocity), (found.position, known.position)):
            np.testing.assert_allclose(ours, theirs, atol=1e-10)
        np.testing.assert_allclose(found.time, known.time, atol=1e-10)


def test_a_round_satellite_meets_the_wall_of_its_centre():
    # a satellite of radius s on a flat wall touches s above the tops: the disk of radius 1 + s with a point there
    size, position, velocity = 0.05, *states(1.0, 0.3, 20, 1)
    bumps = geo.SatelliteDisk(DISK, 21, size, 1.0 - size)
    found = geo.collide_rim(bumps, geo.flat(), 0.1, position, velocity)
    points = geo.collide_rim(geo.SatelliteDisk(DISK, 21, 0.0, 1.0 - size), geo.flat(), 0.1, position, velocity)
    np.testing.assert_allclose(found.velocity, points.velocity, atol=1e-12)
    np.testing.assert_allclose(found.time, points.time, atol=1e-12)


@pytest.mark.parametrize("name", ["triangular", "rectangular"])
def test_teeth_and_wall_first_touch_where_their_outlines_do(name):
    body, wall, scale = gear(24, 0.12), WALLS[name], 0.1
    top = np.concatenate([np.add(wall.vertices[:-1], (k, 0)) for k in range(-15, 15)]) * scale - [0.0, 1.0]
    ground = Polygon([*top, (top[-1, 0], -3.0), (top[0, 0], -3.0)])
    tested = 0
    for position, velocity in zip(*states(scale, 0.2, 12, 3), strict=True):
        first = geo.collide_rim(body, wall, scale, [position], [velocity], max_contacts=1)
        if first.status[0] != geo.Status.BOUNCE_LIMIT:
            continue  # the time is that of the whole collision
        tested += 1

        def gap(time, start=position, velocity=velocity):
            x1, x2, alpha = np.insert(start, 1, 0.0) + time * velocity
            return Polygon(np.add(body.arms(alpha - 0.5 * math.pi), (x1, x2))).distance(ground)

        assert gap(float(first.time[0])) < 1e-9
        assert min(map(gap, np.linspace(0.0, float(first.time[0]) - 1e-4, 60))) > 0.0
    assert tested > 3


def dense_gap(first, second, position, velocity, time):
    """The least distance of two toothed disks or rims of round satellites, over all points and edges."""
    outlines = []
    for k, body in enumerate((first, second)):
        x, y, turn = position[k] + velocity[k] * time / [1.0, 1.0, body.disk.radius]
        outlines.append((body.arms(turn) + np.array([x, y]), body.sizes, body.joined))
    found = []
    for (points, sizes, _), (others, widths, joined) in (outlines, outlines[::-1]):
        apart = np.hypot(*np.moveaxis(points[:, None] - others[None], -1, 0)) - sizes[:, None] - widths[None]
        found.append(apart.min())
        if joined:
            ends = np.roll(others, -1, axis=0)
            along = ends - others
            part = np.sum((points[:, None] - others[None]) * along, axis=2) / np.sum(along**2, axis=1)
            foot = others[None] + np.clip(part, 0.0, 1.0)[..., None] * along
            found.append((np.hypot(*np.moveaxis(points[:, None] - foot, -1, 0)) - sizes[:, None] - widths[0]).min())
    return min(found)


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), [(UNEQUAL, UNEQUAL), (UNEQUAL, TOOTHED), (TOOTHED, UNEQUAL), EQUAL],
                         ids=["satellites", "on teeth", "teeth on", "equal"])  # fmt: skip
def test_the_first_contact_is_that_of_a_dense_search_over_satellites_and_teeth(first, second):
    rng, met = np.random.default_rng(1), 0
    apart = first.largest + second.largest + 0.05
    for _ in range(6):
        position = np.array([[0.0, apart, rng.uniform(0, 7)], [0.0, 0.0, rng.uniform(0, 7)]])
        velocity = np.array([[rng.uniform(-1, 1), -1.0, rng.uniform(-3, 3)], [0.0, 0.0, rng.uniform(-3, 3)]])
        times = np.linspace(0.0, 1.5, 401)
        gaps = np.array([dense_gap(first, second, position, velocity, t) for t in times])
        touched = np.flatnonzero(gaps < 3e-3)
        hit = geo.collide_pair(first, second, [position], [velocity], max_contacts=1)
        assert (len(touched) > 0) or hit.contacts[0] == 0
        if hit.contacts[0]:
            at = float(hit.time[0])
            assert abs(dense_gap(first, second, position, velocity, at)) < 1e-9
            # no contact before: the gap is positive, and it falls through 0 there
            assert np.all(gaps[times < at - 1e-3] > 0.0)
            if first.joined or second.joined:
                assert dense_gap(first, second, position, velocity, at - 1e-4) > 0.0
            else:
                root = brentq(partial(dense_gap, first, second, position, velocity), at - 2e-4, at + 2e-4)
                assert math.isclose(root, at, abs_tol=1e-9)
            met += 1
    assert met >= 3


def test_the_limit_of_contacts_of_teeth_is_reported():
    limited = geo.collide_rim(gear(), WALLS["triangular"], 0.1, *states(0.1, 0.1, 10, 7), max_contacts=1)
    assert limited.counts()["bounce_limit"] > 0


@pytest.mark.slow
def test_close_satellites_collide_like_the_law_of_the_pair_and_distant_ones_do_not():
    # seen from one disk, the other's satellites are arcs of radius s1 + s2 = 3/4 of the spacing
    n, wall = 800, geo.dispersing_arcs(4.0 / 3.0)
    distant, close = (
        geo.collide_pair(*bodies(count), *starts(*bodies(count), n, 3)).velocity[:, 0] for count in (12, 600)
    )
    limit = ker.PairLaw.from_wall(wall, *PAIR)
    other = ker.PairLaw(ker.WallLaw(wall), *PAIR)
    rng = np.random.default_rng(4)
    one, two = (np.tile(v, (20_000, 1)) for v in VELOCITY)
    wanted = limit.sample([0.0, 1.0], one, two, rng)[0]
    for k in range(3):
        assert ks_2samp(close[:, k], wanted[:, k]).pvalue > 1e-3
    # without foreshortening the distribution is another one
    assert ks_2samp(close[:, 0], other.sample([0.0, 1.0], one, two, rng)[0][:, 0]).pvalue < 1e-12
    far, near = (
        abs(found[:, 0].mean() - wanted[:, 0].mean()) * math.sqrt(n) / found[:, 0].std() for found in (distant, close)
    )
    assert far > 5.0 and near < 4.0


def test_disks_that_miss_or_are_not_settled_have_names():
    first, second = bodies(12)
    far = geo.collide_pair(first, second, [[[9, 9, 0], [0, 0, 0]]], [[[1, 0, 0], [0, 0, 0]]])
    assert far.counts()["escaped"] == 1 and far.contacts[0] == 0
    still = geo.collide_pair(first, second, [[[9, 9, 0], [0, 0, 0]]], [[[0, 0, 0], [0, 0, 0]]])
    assert still.counts()["escaped"] == 1
    limited = geo.collide_pair(*bodies(60), *starts(*bodies(60), 50), max_contacts=1)
    assert 0 < limited.counts()["bounce_limit"] < 50
    # the second disk hits two satellites of the first at once
    two = geo.SatelliteDisk(PAIR[0], 4, 0.1), geo.SatelliteDisk(PAIR[0], 4, 0.1)
    both = geo.collide_pair(*two, [[[0, 4, math.pi / 4], [0, 0, math.pi / 4]]], [[[0, -1, 0], [0, 0, 0]]])
    assert both.counts()["corner"] == 1


def test_unequal_spacing_has_the_same_limit_law():
    # the angles of the limit do not depend on which satellite touches
    scale, n = 1e-5, 300
    rng = np.random.default_rng(5)
    gaps = rng.uniform(0.5, 1.5, 500)
    turns = 2.0 * np.pi * np.concatenate([[0.0], np.cumsum(gaps)[:-1]]) / gaps.sum()
    body = geo.SatelliteDisk(DISK, 500, 0.0, 1.0, turns)
    velocity = -DISK.from_angles(1.1, 1.2)
    position = np.stack([rng.uniform(0.0, scale, n), rng.uniform(0.0, 2.0 * np.pi, n)], axis=1)
    found = geo.collide_rim(body, WALLS["triangular"], scale, position, np.tile(velocity, (n, 1)))
    good = found.status == geo.Status.ESCAPED
    assert good.mean() > 0.99
    limit = ker.CollisionLaw.from_wall(WALLS["triangular"], DISK).sample(np.tile(velocity, (20_000, 1)), rng)
    angles = [DISK.to_angles(w) for w in (found.velocity[good], limit)]
    # the atoms of the limit are spread by rho; bins wider than that
    counts = [np.histogram(theta, np.linspace(0, np.pi, 13))[0] / len(theta) for theta, _ in angles]
    assert np.abs(counts[0] - counts[1]).sum() < 0.2
    assert abs(np.median(angles[0][1]) - (math.pi - 1.2)) < 0.01
    assert ks_2samp(angles[0][0], math.pi - angles[0][0]).pvalue < 1e-6
