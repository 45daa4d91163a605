"""A wall on a spring at a temperature: detailed balance with Maxwell's distribution, and plain mechanics."""

import numpy as np
import pytest
from scipy.optimize import brentq

from asperity import kernels as ker

RNG = 20_260_330
WALLS = [
    ker.SpringWall(1.0, 1.0), ker.SpringWall(0.1, 0.5, frequency=3.0), ker.SpringWall(8.0, 2.0, depth=0.3),
    ker.SpringWall(0.5, 2.0, depth=0.0),
]  # fmt: skip


@pytest.mark.parametrize("wall", WALLS, ids=repr)
def test_the_law_is_in_detailed_balance_with_maxwell(wall):
    defect = wall.symmetry_defect(60_000, rng=RNG)
    assert defect.z_score < 4.0
    # the flux of Maxwell's distribution is invariant: moments of v2^2, which is exponential with mean 2 T
    rng = np.random.default_rng(RNG)
    energy = 0.5 * wall.sample(wall.equilibrium(60_000, rng), rng)[:, 1] ** 2 / wall.temperature
    for power, mean, variance in ((1, 1.0, 1.0), (2, 2.0, 20.0), (3, 6.0, 684.0)):
        assert abs(np.mean(energy**power) - mean) < 4.0 * np.sqrt(variance / energy.size)


def test_a_wrong_temperature_is_not_in_balance():
    """The test has power: particles at the temperature of another gas leave with other moments and an asymmetry."""
    wall = WALLS[0]
    hot = ker.SpringWall(1.0, 1.3)
    rng = np.random.default_rng(RNG)
    before = wall.equilibrium(60_000, rng)
    after = hot.sample(before, rng)
    assert np.mean(after[:, 1] ** 2) > 1.05 * np.mean(before[:, 1] ** 2)
    # cells of equal measure under the flux of Maxwell's distribution at the wall's temperature
    levels = [np.exp(-0.5 * velocity[:, 1] ** 2 / wall.temperature) for velocity in (before, after)]
    counts = np.histogram2d(*levels, bins=12, range=[[0.0, 1.0], [0.0, 1.0]])[0]
    upper = np.triu_indices(12, 1)
    forth, back = counts[upper], counts.T[upper]
    assert np.sum((forth - back) ** 2 / (forth + back)) > 66.0 + 8.0 * np.sqrt(132.0)


def plain_return(wall, v, z, w):
    """One particle by a march in time with brackets, without any bound on the acceleration."""
    omega, ratio, y, step = wall.frequency, wall.mass_ratio, wall.depth, 1e-3 / wall.frequency

    def plate(t, z, w):
        return z * np.cos(omega * t) + w / omega * np.sin(omega * t)

    for _ in range(10_000_000):

        def gap(t, y=y, v=v, z=z, w=w):
            return y + v * t - plate(t, z, w)

        t = step
        while gap(t) > 0.0 and y + v * t < wall.depth + 1e-15:
            t += step
        if gap(t) > 0.0:
            return v
        low = t - step if gap(t - step) > 0.0 else 0.2 * (t - step) + 0.8e-9
        hit = brentq(gap, low, t, xtol=1e-15) if gap(low) > 0.0 else low
        y = plate(hit, z, w)
        z, w = y, w * np.cos(omega * hit) - omega * z * np.sin(omega * hit)
        v, w = ((ratio - 1.0) * v + 2.0 * w) / (1.0 + ratio), ((1.0 - ratio) * w + 2.0 * ratio * v) / (1.0 + ratio)
        # a contact is followed by motion apart
        y += 1e-13
    raise AssertionError


def test_outgoing_velocities_agree_with_a_plain_march_in_time():
    rng = np.random.default_rng(RNG)
    for wall in (ker.SpringWall(0.3, 1.0), ker.SpringWall(1.0, 1.0, frequency=2.0)):
        position, pace = wall._plate(40, rng)
        v = -rng.rayleigh(1.0, 40)
        expected = [plain_return(wall, *state) for state in zip(v, position, pace, strict=True)]
        found = wall._return(v.copy(), position, pace)
        # contacts that nearly graze are sensitive
        assert np.sum(np.abs(found - expected) < 1e-6) >= 39


def test_a_plate_at_rest_conserves_energy_and_a_heavy_one_is_a_mirror():
    mirror = ker.SpringWall(1e-12, 1e-12, frequency=1e-3)
    v = np.array([[0.3, -1.0], [-2.0, -0.1]])
    assert np.allclose(mirror.sample(v, rng=RNG), v * [1.0, -1.0], atol=1e-5)
    exchange = ker.SpringWall(1.0, 0.0, frequency=2.0, depth=0.5)
    assert np.allclose(exchange.sample(v, rng=RNG), v * [1.0, -1.0], atol=1e-12)
    # after one contact with a heavier plate at rest the particle leaves with (1 - m/M)/(1 + m/M) of its pace
    heavy = ker.SpringWall(0.25, 0.0, frequency=0.01)
    assert np.allclose(heavy.sample([[0.0, -1.0]], rng=RNG)[:, 1], 0.6, atol=1e-12)


def test_the_component_along_the_wall_is_unchanged():
    incoming = np.array([[-0.9, -0.4], [0.8, -1.8]])
    outgoing = WALLS[0].sample(incoming, rng=RNG)
    assert np.array_equal(outgoing[:, 0], incoming[:, 0]) and np.all(outgoing[:, 1] > 0.0)


def test_energy_flows_from_hot_to_cold():
    for wall in WALLS:
        hot, cold = (wall.energy_accommodation(f * wall.temperature, 40_000, rng=RNG) for f in (3.0, 0.3))
        for found in (hot, cold):
            assert found.error < float(found) < 1.0 + found.error
    # a lighter particle exchanges less
    light = ker.SpringWall(0.01, 1.0).energy_accommodation(3.0, 40_000, rng=RNG)
    assert float(light) + light.error < 0.3
