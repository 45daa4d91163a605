"""The true collision of two disks with satellites: conservation, an independent search, reversal, and its limit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import ks_2samp

from asperity import geometry as geo
from asperity import kernels as ker
from disk_shapes import PAIR, RADII, VELOCITY, bodies, starts


def plain_first_contact(first, second, position, velocity):
    """The first time at which two satellites touch, from values on a dense grid; for few satellites."""
    turns = [2.0 * np.pi * np.arange(body.count) / body.count for body in (first, second)]

    def gap(time):
        points = []
        for k, body in enumerate((first, second)):
            x, y, turn = position[k] + velocity[k] * time
            points.append((x + 1j * y) + body.radius * np.exp(1j * (turn + turns[k])))
        return float(np.min(np.abs(points[0][:, None] - points[1][None, :]))) - first.size - second.size

    times = np.linspace(0.0, 3.0, 6001)
    values = np.array([gap(time) for time in times])
    crossing = np.flatnonzero((values[:-1] > 0.0) & (values[1:] <= 0.0))
    return brentq(gap, times[crossing[0]], times[crossing[0] + 1], xtol=1e-14) if len(crossing) else None


@pytest.mark.slow
def test_the_first_contact_is_that_of_a_dense_search():
    first, second = geo.SatelliteDisk(PAIR[0], 5, 0.15), geo.SatelliteDisk(PAIR[1], 7, 0.1, 1.5)
    rng = np.random.default_rng(1)
    for _ in range(15):
        position = np.array([[0.0, 3.0, rng.uniform(0, 7)], [0.0, 0.0, rng.uniform(0, 7)]])
        velocity = np.array([[rng.uniform(-1, 1), -1.0, rng.uniform(-3, 3)], [0.0, 0.0, rng.uniform(-3, 3)]])
        expected = plain_first_contact(first, second, position, velocity)
        hit = geo.collide_pair(first, second, [position], [velocity], max_contacts=1)
        if expected is None:
            assert hit.contacts[0] == 0 and hit.status[0] == geo.Status.ESCAPED
        else:
            assert hit.contacts[0] == 1
            assert math.isclose(hit.time[0], expected, abs_tol=1e-11)


@pytest.mark.slow
def test_close_satellites_collide_like_the_law_of_the_pair():
    # seen from one disk, the other's satellites are arcs of radius s1 + s2 = 3/4 of the spacing
    n = 1500
    found = geo.collide_pair(*bodies(600), *starts(*bodies(600), n, 3)).velocity[:, 0]
    wall = geo.dispersing_arcs(4.0 / 3.0)
    limit = ker.PairLaw.from_wall(wall, *PAIR, RADII)
    other = ker.PairLaw(ker.WallLaw(wall), *PAIR, RADII)
    rng = np.random.default_rng(4)
    one, two = (np.tile(v, (20_000, 1)) for v in VELOCITY)
    for k in range(3):
        assert ks_2samp(found[:, k], limit.sample([0.0, 1.0], one, two, rng)[0][:, k]).pvalue > 1e-3
    # without foreshortening the distribution is another one
    assert ks_2samp(found[:, 0], other.sample([0.0, 1.0], one, two, rng)[0][:, 0]).pvalue < 1e-12


@pytest.mark.slow
def test_the_distance_to_the_law_of_the_pair_tends_to_zero():
    limit = ker.PairLaw.from_wall(geo.dispersing_arcs(4.0 / 3.0), *PAIR, RADII)
    rng, n = np.random.default_rng(5), 1500
    one, two = (np.tile(v, (40_000, 1)) for v in VELOCITY)
    wanted = limit.sample([0.0, 1.0], one, two, rng)[0][:, 0].mean()
    defects = []
    for count in (12, 600):
        found = geo.collide_pair(*bodies(count), *starts(*bodies(count), n, 6)).velocity[:, 0, 0]
        defects.append(abs(found.mean() - wanted) * math.sqrt(n) / found.std())
    assert defects[0] > 6.0 and defects[1] < 4.0


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
