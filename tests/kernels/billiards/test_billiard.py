"""Disks between rough walls: the no-slip strip and wedge, conservation, and random laws."""

import math
from fractions import Fraction

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import InputError

IRRATIONAL = (0.1, 2.0)
# arctan(sqrt(m/J)) = pi p/q
RATIONAL = ((1, 6), (1, 4), (1, 3), (1, 5), (2, 5))


def no_slip(disk):
    return ker.CollisionLaw(ker.retroreflection(), disk)


def smooth(disk):
    return ker.CollisionLaw(ker.specular(), disk)


def in_a_strip(ratio, steps, n=20):
    """A no-slip strip: record, and widths as fractions of l sqrt(1 + m/J) where l = sqrt(1/v2^2 - 1)."""
    disk, rng = geo.Disk(ratio, 1.0 / ratio), np.random.default_rng(0)
    velocity = disk.from_angles(rng.uniform(0.3, 2.8, n), rng.uniform(0.3, 2.8, n))
    record = ker.play(geo.Container.strip(), no_slip(disk), np.zeros((n, 2)), velocity, steps, rng)
    normal = math.sqrt(disk.mass) * velocity[:, 1]
    return record, record.extent() / (np.sqrt(1 / normal**2 - 1) * math.sqrt(1 + ratio))


@pytest.mark.slow
@pytest.mark.parametrize("ratio", IRRATIONAL)
def test_the_strip_is_filled_up_to_its_bound_where_the_angle_is_irrational(ratio):
    record, widths = in_a_strip(ratio, 1500)
    assert np.all(widths <= 1 + 1e-12)
    assert widths.min() > 1 - 2e-5
    np.testing.assert_allclose(record.energy, 0.5, rtol=1e-11)


@pytest.mark.parametrize(("p", "q"), RATIONAL)
def test_the_strip_has_finite_orbits_where_the_angle_is_rational(p, q):
    record, widths = in_a_strip(math.tan(math.pi * p / q) ** 2, 240)
    # seen from the strip's other side every time, each collision turns the tangential velocity by pi - 2 pi p/q: the
    # positions are the corners of a regular polygon, seen from the side
    corners = Fraction(q - 2 * p, 2 * q).denominator
    places = {round(float(x), 8) for x in record.position[1:, 0, 0]}
    assert len(places) <= corners
    low, high = math.cos(math.pi / corners), 1.0
    if corners % 2:
        low, high = (1 + low) / 2, math.cos(math.pi / (2 * corners))
    assert np.all((low - 1e-9 <= widths) & (widths <= high + 1e-9))


@pytest.mark.parametrize(("ratio", "q"), [(1.0, 5), (1.0, 7), (0.5, 7), (3.0, 5)])
def test_bounded_orbits_of_the_no_slip_wedge_are_periodic_at_rational_angles(ratio, q):
    # two reflections turn velocities by twice the angle between both walls' chi, whose cosine is
    # (J - m cos(opening))/(m + J); where that angle is 2 pi/q, velocities return after 2 q collisions, and positions
    # too
    opening = math.acos((1 - (1 + ratio) * math.cos(2 * math.pi / q)) / ratio)
    disk, rng, n = geo.Disk(ratio, 1.0 / ratio), np.random.default_rng(1), 150
    start = np.tile([math.cos(opening / 2), math.sin(opening / 2)], (n, 1))
    velocity = disk.from_angles(rng.uniform(0.1, 3, n), rng.uniform(0.1, 3, n))
    record = ker.play(geo.Container.wedge(opening), no_slip(disk), start, velocity, 200, rng)
    bounded = record.collisions == 200
    assert 5 < bounded.sum() < n
    # those that leave do so within the first period
    assert record.collisions[~bounded].max() <= 2 * q
    size = np.abs(record.position[:, bounded]).max(axis=(0, 2))
    shift = np.abs(record.position[1 + 2 * q :] - record.position[1 : -2 * q])[:, bounded].max(axis=(0, 2))
    assert np.all(shift < 1e-10 * (1 + size**2))
    shorter = np.abs(record.position[1 + 2 * (q // 2) :] - record.position[1 : -2 * (q // 2)])[:, bounded]
    assert shorter.max() > 0.1


def test_a_smooth_disk_in_a_polygon_is_a_billiard_that_keeps_its_spin():
    disk, rng = geo.Disk(), np.random.default_rng(2)
    room = geo.Container.polygon([(0, 0), (1, 0), (1, 2), (0, 2)])
    record = ker.play(room, smooth(disk), [[0.3, 0.4]], [[1.0, math.sqrt(2.0), 0.7]], 50, rng)
    np.testing.assert_allclose(record.velocity[..., 2], 0.7)
    np.testing.assert_allclose(np.abs(record.velocity[..., 0]), 1.0)
    # unfolded, the way is straight
    fold = np.abs((0.3 + record.time + 1.0) % 2.0 - 1.0)
    np.testing.assert_allclose(record.position[..., 0], fold, atol=1e-12)
    np.testing.assert_allclose(record.angle, 0.7 * record.time, atol=1e-12)


def test_every_law_keeps_the_energy_and_the_momentum_along_its_wall():
    disk, rng = geo.Disk(1.0, 0.7), np.random.default_rng(3)
    room = geo.Container.polygon([(0, 0), (3, 0), (3.5, 1.5), (1, 2)])
    laws = [
        no_slip(disk), smooth(disk), ker.CollisionLaw(ker.lambertian(), disk),
        ker.CollisionLaw.from_wall(geo.focusing_arcs(1.2), disk),
    ]  # fmt: skip
    velocity = disk.from_angles(rng.uniform(0.2, 2.9, 50), rng.uniform(0.2, 2.9, 50))
    record = ker.play(room, laws, np.tile([1.5, 0.8], (50, 1)), velocity, 100, rng)
    assert np.all(record.collisions == 100) and set(np.unique(record.wall[1:])) == {0, 1, 2, 3}
    np.testing.assert_allclose(record.energy, 0.5, rtol=1e-11)
    assert np.all(room.distances(record.position.reshape(-1, 2)) > -1e-12)
    tangent = room.tangents[record.wall[1:]]
    first = -np.sum(record.velocity[:-1, :, :2] * tangent, axis=-1) + 0.7 * record.velocity[:-1, :, 2]
    after = -np.sum(record.velocity[1:, :, :2] * tangent, axis=-1) + 0.7 * record.velocity[1:, :, 2]
    np.testing.assert_allclose(after, first, atol=1e-12)


def test_the_true_disk_in_a_strip_does_what_its_limit_law_does():
    disk, n = geo.Disk(1.0, 0.5), 200
    wall = geo.triangular_teeth(1.2)
    velocity = np.tile(disk.from_angles(1.1, 1.0), (n, 1))
    widths = []
    for law in (ker.SatelliteLaw(wall, disk, 1e-6), ker.CollisionLaw.from_wall(wall, disk)):
        record = ker.play(geo.Container.strip(), law, np.zeros((n, 2)), velocity, 20, np.random.default_rng(5))
        widths.append(np.log(record.extent()))
    difference = widths[0].mean() - widths[1].mean()
    assert abs(difference) < 4.5 * math.sqrt((widths[0].var() + widths[1].var()) / n)


class Own:
    """A law of a wall as a user writes it, by a function of the incoming velocities."""

    disk = geo.Disk()

    def __init__(self, function):
        self.function = function

    def sample(self, velocity, rng=None):
        return self.function(velocity)


MIRROR = np.array([1.0, -1.0, 1.0])


def turned_in_place(velocity):
    velocity *= MIRROR
    return velocity


def test_a_reflector_of_a_users_own_moves_disks_as_smooth_walls_do():
    room, start = geo.Container.stadium(), ([0.1, 0.2], [0.6, 0.8, 0.1])
    smooth = ker.play(room, ker.smooth(geo.Disk()), *start, 8)
    for function in (lambda v: v * MIRROR, lambda v: (v * MIRROR).tolist(), turned_in_place):
        assert np.allclose(ker.play(room, Own(function), *start, 8).position, smooth.position, atol=1e-9)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda v: v, r"with v2 > 0 and the energy 0\.5025.* at \[[-\d.]+, [-\d.]+\]"),
        (lambda v: 1.1 * v * MIRROR, r"of energy 0\.608"),
        (lambda v: v * MIRROR * [0.0, 1.0, 1.0], "and the energy"),
        (lambda v: np.where(v < 0.0, np.nan, v), "finite numbers"),
        (lambda v: (v * MIRROR)[:, :2], r"expected shape \(1, 3\), got \(1, 2\)"),
        (lambda v: (v * MIRROR)[0], r"expected shape \(1, 3\), got \(3,\)"),
        (lambda v: None, "returns: expected"),
        (lambda v: "up", "returns: expected"),
        (lambda v: v * MIRROR * (1 + 0j), "returns: expected"),
    ],
)
def test_a_reflector_that_does_not_reflect_is_refused(function, message):
    law, room = Own(function), geo.Container.polygon([(0, 0), (8, 0), (8, 8), (0, 8)])
    with pytest.raises(InputError, match=message):
        ker.play(room, law, [2.0, 3.0], [0.6, 0.8, 0.1], 3)
    with pytest.raises(InputError, match=message):
        pair = ker.PairLaw(ker.retroreflection(), geo.Disk())
        ker.play_gas(room, pair, [[2, 3], [6, 3]], [[0.6, 0.8, 0.1], [0, 0, 0]], 3, law)
