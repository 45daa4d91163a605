"""Disks in waves over convex hollows: the same collisions as one by one, whatever the other disks are."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity.geometry.collisions import rigid
from asperity.geometry.collisions.compiled.waves import UNDECIDED, WORK, collide_in_waves
from asperity.geometry.collisions.records import ground_of, is_convex, mass_fractions, results_for, ring_of
from asperity.geometry.disk.satellites import Satellites
from asperity.geometry.tracing.tracing import MAX_COLLISIONS
from disk_shapes import DISK, states

CONVEX = {
    "shallow teeth": geo.triangular_teeth(0.2),
    "teeth": geo.triangular_teeth(0.7),
    "steep teeth": geo.triangular_teeth(1.2),
    "trough": geo.Wall.from_vertices([(0, 0), (0.15, -0.5), (0.5, -0.62), (0.9, -0.4), (1, 0)]),
    "circles": geo.focusing_arcs(1.5),
    "flat ellipses": geo.elliptical_arcs(1.0, geo.Disk(1.0, 3.0)),
    "steep ellipses": geo.elliptical_arcs(1.0, geo.Disk(1.0, 0.1)),
}
OTHERS = {
    "flat tops": geo.rectangular_teeth(0.5),
    "a bend outwards": geo.Wall.from_vertices([(0, 0), (0.3, -0.4), (0.5, -0.3), (0.7, -0.4), (1, 0)]),
    "three joints in line": geo.Wall.from_vertices([(0, 0), (0.25, -0.25), (0.5, -0.5), (1, 0)]),
    "two hollows": geo.Wall.from_vertices([(0, 0), (0.25, -0.3), (0.5, 0), (0.75, -0.3), (1, 0)]),
    "an island": geo.Wall([geo.Segment((0, -0.5), (1, -0.5))], islands=[[geo.Arc((0.4, -0.2), 0.1, 0.0, -2 * np.pi)]]),
    "dispersing arcs": geo.dispersing_arcs(1.0),
    "mushrooms": geo.mushrooms(0.3),
}
EPS = np.finfo(float).eps


def constants_for(wall, scale, limit=MAX_COLLISIONS):
    ring = ring_of(Satellites.around(scale, scale * wall.depth), scale, wall.scene)
    return mass_fractions(DISK), ring, limit, ground_of(wall.scene)


def in_waves_alone(wall, scale, position, velocity, limit=MAX_COLLISIONS):
    results = results_for(len(position))
    collide_in_waves(position, velocity, *constants_for(wall, scale, limit), results, *np.zeros((2, WORK)))
    return results


@pytest.mark.parametrize("scale", [1e-1, 1e-2, 1e-3, 1e-6])
@pytest.mark.parametrize("name", CONVEX)
def test_disks_in_waves_collide_as_one_by_one(name, scale):
    wall = CONVEX[name]
    position, velocity = states(wall, scale, 2000, seed=8)
    found, expected = in_waves_alone(wall, scale, position, velocity), results_for(2000)
    rigid._one_by_one(position, velocity, constants_for(wall, scale), expected)
    done = found.status != UNDECIDED
    # few disks are left, except where one turns far while it is near the wall
    assert done.mean() > (0.97 if scale < 0.1 else 0.75)
    assert np.array_equal(found.status[done], expected.status[done])
    assert np.array_equal(found.contacts[done], expected.contacts[done])
    assert np.array_equal(found.two_satellites[done], expected.two_satellites[done])
    error = np.abs(found.velocity - expected.velocity).max(axis=1)
    # arcs magnify the rounding of a satellite's position, as they magnify that of the start
    rng, shaken = np.random.default_rng(1), np.zeros(2000)
    for _ in range(6):
        nudged = position * (1.0 + 4.0 * EPS * rng.choice([-1, 1], (2000, 2)))
        turned = velocity * (1.0 + 4.0 * EPS * rng.choice([-1, 1], (2000, 3)))
        other = results_for(2000)
        rigid._one_by_one(nudged, turned, constants_for(wall, scale), other)
        shaken = np.maximum(shaken, np.abs(other.velocity - expected.velocity).max(axis=1))
    assert np.all(error[done] <= 1e-13 + 8.0 * shaken[done])
    assert np.median(error[done]) < 1e-12
    np.testing.assert_allclose(found.position[done], expected.position[done], rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.time[done], expected.time[done], rtol=1e-12, atol=1e-13)


def test_walls_of_one_convex_hollow_are_told_from_others():
    for name, wall in (CONVEX | OTHERS).items():
        assert is_convex(ground_of(wall.scene)) == (name in CONVEX), name


def test_what_rounding_or_the_limit_of_contacts_decides_is_left_undecided():
    wall, scale = CONVEX["steep teeth"], 0.01
    # into the corner of a tooth; between two satellites at one height; sinking without end
    half = 0.5 * Satellites.around(scale, scale * wall.depth).spacing
    position = np.array([[0.005, 0.0], [0.0, half], [0.003, 0.1 * half]])
    velocity = np.array([[0.0, -1.0, 0.0], [0.0, -1.0, 0.0], [0.1, -1e-9, 1.0]])
    assert np.all(in_waves_alone(wall, scale, position, velocity).status == UNDECIDED)
    position, velocity = states(wall, scale, 300)
    free, limited = (in_waves_alone(wall, scale, position, velocity, limit) for limit in (MAX_COLLISIONS, 2))
    done = free.status != UNDECIDED
    assert np.array_equal(limited.status[done] == UNDECIDED, free.contacts[done] > 2)


def test_satellites_that_come_round_while_a_disk_sinks_are_not_forgotten():
    wall, scale, n = CONVEX["teeth"], 1e-3, 1000
    rng = np.random.default_rng(4)
    position, _ = states(wall, scale, n, seed=4)
    sinking = 10.0 ** -rng.uniform(1.5, 3.5, n)
    velocity = np.stack([-1.0 + rng.normal(0.0, 0.02, n), -sinking, np.ones(n)], axis=1)
    found, expected = in_waves_alone(wall, scale, position, velocity), results_for(n)
    rigid._one_by_one(position, velocity, constants_for(wall, scale), expected)
    done = found.status != UNDECIDED
    assert 0.2 < done.mean() < 0.9
    assert np.array_equal(found.contacts[done], expected.contacts[done])
    np.testing.assert_allclose(found.velocity[done], expected.velocity[done], rtol=0, atol=1e-9)
