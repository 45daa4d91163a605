"""Flights that graze walls, or run into corners: one of them costs no other its results."""

import math

import numpy as np
from campaigns.rays.grazing_flights import room_with_pillar

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.tables.boundary import FlightStatus
from asperity.geometry.tables.compiled import flights

DISK = geo.Disk(1.0, 1.0)


def test_every_v2_below_zero_is_a_velocity_of_the_collision_law():
    small = -np.array([1e-18, 1e-300, 5e-324])
    for along in (1.0, -1.0):
        velocity = np.column_stack([np.full(3, along), small, np.zeros(3)])
        out = ker.smooth(DISK).sample(velocity)
        np.testing.assert_allclose(out, velocity * [1.0, 0.0, 1.0], atol=1e-15)
        assert np.all(out[:, 1] > 0.0)


def test_a_disk_at_a_corner_stops_alone_and_the_others_keep_their_bits():
    rng = np.random.default_rng(5)
    square = geo.Container.polygon([(0, 0), (2, 0), (2, 2), (0, 2)])
    position, velocity = rng.uniform(0.2, 1.8, (999, 2)), rng.standard_normal((999, 3))
    alone = ker.play(square, ker.smooth(DISK), position, velocity, 40)
    odd = [np.insert(array, 500, row, axis=0) for array, row in ((position, [1, 1]), (velocity, [1, 1, 0]))]
    record = ker.play(square, ker.smooth(DISK), *odd, 40)
    assert record.counts() == {"flying": 999, "corner": 1, "grazing": 0, "free": 0, "unreflected": 0}
    assert record.collisions[500] == 0 and record.position[-1, 500].tolist() == [1.0, 1.0]
    for name in ("time", "position", "angle", "velocity", "wall"):
        np.testing.assert_array_equal(np.delete(getattr(record, name), 500, axis=1), getattr(alone, name))


def test_pictures_portraits_and_extents_are_finite_beside_a_disk_that_stopped():
    square = geo.Container.polygon([(0, 0), (2, 0), (2, 2), (0, 2)]).closed()
    record = ker.play(square, ker.smooth(DISK), [1.0, 1.0], [[1.0, 1.0, 0.0], [1.0, 0.3, 0.0]], 5)
    s, along = record.phase_portrait()
    assert np.isnan(s[:, 0]).all() and np.isfinite(s[:, 1]).all() and np.isfinite(along[:, 1]).all()
    assert np.isfinite(record.extent()).all()


def test_a_gas_ends_with_the_status_of_the_disk_at_the_corner():
    square = geo.Container.polygon([(0, 0), (8, 0), (8, 8), (0, 8)])
    pair = ker.PairLaw(ker.retroreflection(), geo.Disk())
    record = ker.play_gas(square, pair, [[4, 4], [2, 6]], [[1, 1, 0], [0, 3, 0]], 50, rng=0)
    assert record.counts()["corner"] == 1 and record.status.tolist() == [1, 0]
    assert 1 <= len(record.time) - 1 < 50 and np.isfinite(record.position).all()


def test_a_law_that_finds_no_velocity_stops_its_disk_alone(monkeypatch):
    law = ker.SatelliteLaw(geo.flat(), geo.Disk(), scale=1e-9)
    found = type(law).attempt

    def without_the_first(self, moving, rng):
        out = found(self, moving, rng)
        out[0] = np.nan
        return out

    monkeypatch.setattr(type(law), "attempt", without_the_first)
    record = ker.play(geo.Container.strip(), law, [[0, 0.5], [0, 0.5]], [[0, 1, 0], [0, -1, 0]], 1, 0)
    assert record.counts()["unreflected"] == 2 and np.isfinite(record.velocity).all()


def test_the_billiard_map_stops_particles_at_corners_and_keeps_the_others():
    hexagon = geo.Container.polygon([(math.cos(k * math.pi / 3), math.sin(k * math.pi / 3)) for k in range(6)])
    after = geo.billiard_map(hexagon, [0.5, 0.5], [math.pi / 2, math.atan2(math.sqrt(3.0), -0.5)], 3)
    assert after.counts()["corner"] == 1 and after.counts()["escaped"] == 1 and np.isfinite(after.theta).all()


def test_lyapunov_exponents_need_no_trajectory_that_runs_into_a_corner():
    table = room_with_pillar(0.625)
    estimate = ker.lyapunov_exponent(table, ker.smooth(DISK), 64, 16, rng=0)
    assert estimate.value > 0.0 and "0 not resolved" in estimate.method


def test_compiled_flights_have_the_statuses_of_containers():
    for name in ("FLYING", "CORNER", "GRAZING", "FREE"):
        assert getattr(flights, name) == FlightStatus[name]
