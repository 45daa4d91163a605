"""The true collision of two disks with satellites: conservation, an independent search, reversal, and its limit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import ks_2samp

from asperity import geometry as geo
from asperity import kernels as ker
from disk_shapes import PAIR, RADII, VELOCITY, bodies, starts


@pytest.mark.slow
def test_close_satellites_collide_like_the_law_of_the_pair_and_distant_ones_do_not():
    # seen from one disk, the other's satellites are arcs of radius s1 + s2 = 3/4 of the spacing
    n, wall = 800, geo.dispersing_arcs(4.0 / 3.0)
    distant, close = (
        geo.collide_pair(*bodies(count), *starts(*bodies(count), n, 3)).velocity[:, 0] for count in (12, 600)
    )
    limit = ker.PairLaw.from_wall(wall, *PAIR, RADII)
    other = ker.PairLaw(ker.WallLaw(wall), *PAIR, RADII)
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
