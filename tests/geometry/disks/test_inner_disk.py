"""The disk inside the satellites: its clearance is that of free configurations, and it is sharp."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asperity import geometry as geo


@pytest.mark.parametrize("count", [12, 40, 400])
def test_the_disk_inside_never_touches_the_wall_in_a_free_configuration(count):
    rho = 2 * math.pi / count
    teeth = geo.rectangular_teeth(0.9)
    scale = 0.4 * rho**2
    space = geo.ConfigurationSpace(teeth, geo.Disk(), scale, rho)
    inner = space.inner_disk
    assert inner.is_clear and inner.radius == 1 - 2 * rho**2
    rng = np.random.default_rng(count)
    low = -inner.depth - 2 * math.sin(rho / 4) ** 2
    n = 20_000
    states = np.stack([rng.random(n) * scale, rng.uniform(low, 0, n), rng.uniform(-0.5, 0.5, n) * rho], axis=1)
    states[::2, 2] = 0.5 * rho * (1 - 1e-9)
    free = states[space.contains(states)]
    assert len(free) > 500
    bottom = 1 + free[:, 1] - inner.radius
    assert bottom.min() >= inner.clearance - 1e-15
    at_bottom = np.stack([free[:, 0], bottom], axis=-1)
    assert inner.contains(free, at_bottom + np.array([0.0, 1e-9])).all()
    assert not inner.contains(free, at_bottom - np.array([0.0, 1e-9])).any()


def test_the_clearance_is_attained_where_two_satellites_are_level_at_the_bottom():
    rho, depth = 0.2, 0.01
    inner = geo.InnerDisk(rho, depth)
    # the satellites at the angles -rho/2 and rho/2 are at the depth of the wall
    centre = -depth + math.cos(rho / 2)
    assert inner.clearance == pytest.approx(centre - (1 - 2 * rho**2), abs=1e-15)
    # 15/8 rho^2 is enough, and not much more is
    assert geo.InnerDisk(rho, 15 / 8 * rho**2).is_clear
    assert not geo.InnerDisk(rho, 1.877 * rho**2).is_clear
