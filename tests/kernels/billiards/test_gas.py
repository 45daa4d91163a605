"""Two rough disks and gases of them: conservation, limits, reversal, equipartition, and errors that cover."""

import math
import re

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker

DISK = geo.Disk(1.0, 0.4)
UNEQUAL = geo.Disk.from_inertia(1.0, 0.3, 0.7), geo.Disk.from_inertia(2.5, 4.0, 1.9)
ROOM = geo.Container.polygon([(0, 0), (9, 0), (9, 6), (0, 6)])
SEATS = np.array([(1.5 + 3.0 * i, 1.5 + 3.0 * j) for i in range(3) for j in range(2)])
LAWS = {
    "no-slip": ker.retroreflection(), "smooth": ker.specular(), "diffuse": ker.lambertian(),
    "teeth": ker.TriangularTeethLaw(1.0), "arcs": ker.WallLaw(geo.focusing_arcs(1.2)),
}  # fmt: skip


def unequal(law) -> ker.PairLaw:
    return ker.PairLaw(law, *UNEQUAL)


def meetings(pair: ker.PairLaw, n: int, seed: int = 0):
    """Contact points, normals and approaching velocities."""
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0, 2 * np.pi, n)
    normal = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    one, two = rng.standard_normal((2, n, 3))
    closing = np.sum((one - two)[:, :2] * normal, axis=1)
    one[:, :2] -= (2.0 * (closing > 0) * closing)[:, None] * normal
    return rng.standard_normal((n, 2)), normal, one, two


def totals(pair: ker.PairLaw, contact, normal, one, two):
    """Momentum (n, 2), angular momentum about the origin and energy."""
    disk1, disk2 = pair.disks
    x1, x2 = contact + disk1.radius * normal, contact - disk2.radius * normal
    momentum = disk1.mass * one[:, :2] + disk2.mass * two[:, :2]
    turning = disk1.inertia * one[:, 2] / disk1.radius + disk2.inertia * two[:, 2] / disk2.radius
    for disk, x, v in ((disk1, x1, one), (disk2, x2, two)):
        turning = turning + disk.mass * (x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])
    return momentum, turning, 0.5 * disk1.inner(one, one) + 0.5 * disk2.inner(two, two)


@pytest.mark.parametrize("name", LAWS)
def test_momentum_angular_momentum_and_energy_are_kept_to_rounding(name):
    pair = unequal(LAWS[name])
    contact, normal, one, two = meetings(pair, 2000)
    after = pair.sample(normal, one, two, np.random.default_rng(1))
    for kept, first in zip(totals(pair, contact, normal, *after), totals(pair, contact, normal, one, two), strict=True):
        np.testing.assert_allclose(kept, first, atol=2e-13)
    assert np.all(np.sum((after[0] - after[1])[:, :2] * normal, axis=1) > 0.0)


def slip(normal, one, two):
    """The velocities of both points of contact, subtracted."""
    spun = np.stack([normal[:, 1], -normal[:, 0]], axis=1)
    return one[:, :2] + one[:, 2:] * spun - two[:, :2] + two[:, 2:] * spun


def test_no_slip_reverses_the_relative_velocity_at_the_contact_and_smooth_its_normal_part():
    for law, tangential in ((ker.retroreflection(), -1.0), (ker.specular(), 1.0)):
        pair = unequal(law)
        _, normal, one, two = meetings(pair, 500)
        before, after = slip(normal, one, two), slip(normal, *pair.sample(normal, one, two))
        along = np.stack([normal[:, 1], -normal[:, 0]], axis=1)
        for direction, factor in ((normal, -1.0), (along, tangential)):
            parts = [np.sum(v * direction, axis=1) for v in (before, after)]
            np.testing.assert_allclose(parts[1], factor * parts[0], atol=1e-12)


@pytest.mark.parametrize("name", ["no-slip", "teeth"])
def test_a_heavy_second_disk_is_a_wall(name):
    # the error is proportional to m1/m2
    errors = []
    for weight in (1e3, 1e6):
        pair = ker.PairLaw(LAWS[name], DISK, geo.Disk(weight, 1.0))
        velocity = np.random.default_rng(2).standard_normal((200, 3))
        velocity[:, 1] = -np.abs(velocity[:, 1]) - 0.1
        one, _ = pair.sample([0.0, 1.0], velocity, [0.0, 0.0, 0.0], np.random.default_rng(3))
        wall = ker.CollisionLaw(LAWS[name], DISK).sample(velocity, np.random.default_rng(3))
        errors.append(np.median(np.abs(one - wall)))
    assert 0.9 < math.log10(errors[0] / errors[1]) / 3.0 < 1.1


def test_the_names_of_first_and_second_do_not_matter():
    pair = unequal(ker.retroreflection())
    swapped = ker.PairLaw(pair.law, pair.second, pair.first)
    _, normal, one, two = meetings(pair, 200)
    np.testing.assert_allclose(pair.sample(normal, one, two), swapped.sample(-normal, two, one)[::-1], atol=1e-12)


def test_the_roughness_is_foreshortened_for_the_reduced_disk():
    wall = geo.triangular_teeth(1.0)
    pair = ker.PairLaw.from_wall(wall, *UNEQUAL)
    ratio = (0.49 / 0.3 + 3.61 / 4.0) / (1.0 / 1.0 + 1.0 / 2.5)
    assert math.isclose(pair.reduced_disk.foreshortening, (1.0 + ratio) ** -0.5)
    equal = ker.PairLaw.from_wall(wall, DISK)
    assert math.isclose(equal.reduced_disk.foreshortening, DISK.foreshortening)


def gas(law, events, seed, seats=SEATS, **options):
    rng = np.random.default_rng(seed)
    velocity = np.concatenate([rng.standard_normal((len(seats), 2)), np.zeros((len(seats), 1))], axis=1)
    return ker.play_gas(ROOM, ker.PairLaw(law, DISK), seats, velocity, events, rng=rng, **options)


@pytest.mark.parametrize("name", ["no-slip", "diffuse"])
def test_disks_keep_their_energy_and_their_distance(name):
    record = gas(LAWS[name], 1000, 0)
    np.testing.assert_allclose(record.energy.sum(axis=1), record.energy[0].sum(), rtol=1e-12)
    for position in (record.position, 0.5 * (record.position[1:] + record.position[:-1])):
        apart = np.hypot(*np.moveaxis(position[:, :, None] - position[:, None], -1, 0)) + 9.0 * np.eye(len(SEATS))
        assert apart.min() > 2.0 - 1e-12
        assert position.min() > -1e-12 and np.all(position.max(axis=(0, 1)) < np.array([9.0, 6.0]) + 1e-12)
    touching = np.argwhere(record.partner >= 0)
    other = record.partner[tuple(touching.T)]
    gaps = record.position[tuple(touching.T)] - record.position[touching[:, 0], other]
    np.testing.assert_allclose(np.hypot(*gaps.T), 2.0, rtol=1e-12)
    moved = np.any(record.velocity[1:] != record.velocity[:-1], axis=2)
    assert np.all(moved.sum(axis=1) <= 2) and record.collisions.sum() == np.sum(moved)


def test_the_same_seed_gives_the_same_bits():
    first, second = (gas(LAWS["arcs"], 60, 5) for _ in range(2))
    assert np.array_equal(first.velocity, second.velocity) and np.array_equal(first.time, second.time)


def test_a_no_slip_gas_goes_back_when_it_is_reversed():
    record = gas(LAWS["no-slip"], 25, 1)
    middle = 0.5 * (record.position[-1] + record.position[-2])
    back = ker.play_gas(ROOM, ker.PairLaw(LAWS["no-slip"], DISK), middle, -record.velocity[-2], 24)
    # a chaotic motion, of 24 events
    np.testing.assert_allclose(back.position[-1], record.position[1], atol=1e-5)


RUNS = 16


@pytest.fixture(scope="module")
def runs():
    """Independent gases of no-slip disks that begin without spin."""
    return [gas(LAWS["no-slip"], 8000, seed, interval=2.0) for seed in range(RUNS)]


@pytest.mark.slow
def test_translation_and_spin_come_to_equipartition(runs):
    fractions = [record.rotational_fraction() for record in runs]
    values = np.array([fraction.value for fraction in fractions])
    spread = values.std(ddof=1) / math.sqrt(RUNS)
    assert abs(values.mean() - 1.0 / 3.0) < 4.0 * spread and spread < 0.02
    # the batch means cover 1/3 in 95 of 100; 4 or more misses of 16 have probability 0.007
    assert sum(abs(fraction.value - 1.0 / 3.0) > fraction.error for fraction in fractions) <= 3


def test_the_disks_share_the_energy_equally_and_their_velocities_are_those_of_the_sphere(runs):
    # on the energy sphere of 3 n dimensions, E[e^2]/E[e]^2 of one term is 3 n 3/(3 n + 2)
    terms = []
    for record in runs:
        energy = 0.5 * np.array([1.0, 1.0, 0.4]) * record.velocity[100:-1] ** 2 / record.energy[0].sum()
        terms.append([np.mean(energy**p, axis=(0, 1)) for p in (1, 2)])
    mean, spread = np.mean(terms, axis=0), np.std(terms, axis=0, ddof=1) / math.sqrt(RUNS)
    dimension = 3 * len(SEATS)
    expected = np.array([1.0 / dimension, 3.0 / (dimension * (dimension + 2.0))])[:, None]
    assert np.all(np.abs(mean - expected) < 4.5 * spread)


def test_the_rotational_fraction_is_a_mean_over_time():
    record = gas(LAWS["no-slip"], 100, 3)
    rotation = np.sum(0.5 * DISK.rim_mass * record.velocity[:-1, :, 2] ** 2, axis=1)
    mean = np.average(rotation, weights=np.diff(record.time[:, 0])) / record.energy[0].sum()
    assert record.rotational_fraction(0.0).value == pytest.approx(mean, rel=1e-12)


def test_smooth_disks_exchange_nothing_with_their_spins():
    record = gas(LAWS["smooth"], 600, 2)
    fraction = record.rotational_fraction()
    assert abs(fraction.value) < 1e-25 and fraction.error < 1e-25
    short = record.rotational_fraction(0.9)
    assert math.isinf(short.error)
    assert re.search(r"method *mean over \d+ events after the burn-in; an error needs \d+, 64 per disk", repr(short))
