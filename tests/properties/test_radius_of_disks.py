"""The radius of a disk: no law depends on it, and lengths scale with it where they have the unit of positions."""

import math
from dataclasses import replace

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import InputError
from asperity.geometry.collisions.transversality import CollisionConstants
from disk_shapes import TOOTHED, UNEQUAL, bodies, starts

UNIT, WALL = geo.Disk(1.3, 0.4), geo.triangular_teeth(1.2)
# powers of 2 scale without rounding
RADIUS = 0.5
SMALL = geo.Disk(1.3, 0.4, RADIUS)
INCOMING = np.array([[0.3, -1.0, 0.7], [-0.8, -0.4, 0.2]])
TURNED = np.array([[-0.3, 1.0, 0.4], [0.8, 0.4, 0.1]])

LAWS = {
    "frame": lambda disk: disk.frame,
    "angles": lambda disk: disk.to_angles(-INCOMING),
    "velocities": lambda disk: disk.from_angles([0.4, 2.0], [1.0, 2.0], 3.0),
    "energy": lambda disk: disk.inner(INCOMING, INCOMING),
    "rolling momentum": lambda disk: disk.rolling_momentum(INCOMING),
    "constants": lambda disk: (CollisionConstants.of(disk).velocity, CollisionConstants.of(disk).state),
    "foreshortened": lambda disk: WALL.foreshorten(disk).vertices,
    "elliptical": lambda disk: geo.elliptical_arcs(0.9, disk).pieces[0].semi_axes,
    "smooth": ker.smooth_matrix,
    "no-slip": ker.no_slip_matrix,
    "law": lambda disk: ker.CollisionLaw.from_wall(WALL, disk).sample(INCOMING, rng=1),
    "branches": lambda disk: ker.no_slip(disk).branches(0.7)[0][1],
    "along a wall": lambda disk: ker.CollisionAlongWall(
        ker.PositionLaw([0.0, 1.0], [ker.lambertian()]), disk
    ).sample_at(np.array([0.1, 0.2]), INCOMING, rng=1),
    "pair": lambda disk: ker.PairLaw.from_wall(WALL, disk).sample([0.0, 1.0], INCOMING, TURNED, rng=1),
    "unequal pair": lambda disk: ker.PairLaw(ker.retroreflection(), disk, geo.Disk(2.0, 0.7)).sample(
        [0.0, 1.0], INCOMING, TURNED
    ),
    "true disk": lambda disk: ker.SatelliteLaw(WALL, disk, 1e-3).sample(INCOMING, rng=1),
    "small scales": lambda disk: (
        ker.limit_study(
            disk, WALL, [1e-2, 1e-3, 1e-4], np.random.default_rng(0), samples=(4, 4, 4), repetitions=2
        ).distance
    ),
    "weak limit": lambda disk: ker.weak_limit(disk, WALL, [1e-2], rng=0, samples=64, repetitions=2).cylinder,
    "exponents": lambda disk: (
        ker.lyapunov_exponent(geo.Container.circle(2.0), ker.no_slip(disk), collisions=64, trajectories=8, rng=0).value
    ),
}


@pytest.mark.parametrize("name", LAWS)
def test_no_law_of_a_disk_depends_on_its_radius(name):
    np.testing.assert_array_equal(LAWS[name](UNIT), LAWS[name](SMALL))


def test_laws_depend_on_the_mass_by_the_ratio_alone():
    for heavy in (geo.Disk(4.0 * 1.3, 0.4), geo.Disk.from_inertia(4.0 * 1.3, SMALL.inertia * 16.0, 2.0 * RADIUS)):
        assert heavy.foreshortening == UNIT.foreshortening
        for name in ("law", "pair", "no-slip", "true disk"):
            np.testing.assert_allclose(LAWS[name](heavy), LAWS[name](UNIT), rtol=0, atol=1e-12)


REFUSED = {
    "collide": lambda disk: geo.collide(disk, WALL, 1e-3, [[0.0, 0.0]], INCOMING[:1]),
    "cylinder": lambda disk: geo.collide_cylinder(disk, WALL, 1e-3, [[0.0, 0.0]], INCOMING[:1]),
    "modified": lambda disk: geo.collide_modified(disk, WALL, 1e-3, [[0.0, 0.0]], INCOMING[:1]),
    "path": lambda disk: geo.collision_path(disk, WALL, 1e-3, [2e-4, 0.0], INCOMING[0]),
    "space": lambda disk: geo.ConfigurationSpace(WALL, disk, 1e-3),
    "rim": lambda disk: geo.collide_rim(geo.SatelliteDisk(disk, 40, 0.0), WALL, 1e-3, [[0.0, 0.0]], INCOMING[:1]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_positions_in_units_of_the_radius_need_the_radius_one(name):
    REFUSED[name](UNIT)
    with pytest.raises(InputError, match=r"radius 1.*got radius 0\.5; pass Disk\(mass=1\.3, .*divide x1 by the radius"):
        REFUSED[name](SMALL)


def scaled(body: geo.SatelliteDisk, factor: float) -> geo.SatelliteDisk:
    disk = replace(body.disk, radius=factor * body.disk.radius)
    return replace(body, disk=disk, size=factor * body.sizes, radius=factor * body.radii)


@pytest.mark.parametrize("pair", [bodies(12), (UNEQUAL, TOOTHED)], ids=["satellites", "teeth"])
def test_two_true_disks_scale_with_their_radii(pair):
    position, velocity = starts(*pair, 6)
    lengths = np.array([RADIUS, RADIUS, 1.0])
    big = geo.collide_pair(*pair, position, velocity)
    small = geo.collide_pair(*(scaled(body, RADIUS) for body in pair), lengths * position, velocity)
    np.testing.assert_array_equal(small.velocity, big.velocity)
    np.testing.assert_array_equal(small.position, lengths * big.position)
    np.testing.assert_array_equal(small.time, RADIUS * big.time)
    np.testing.assert_array_equal(small.status, big.status)
    assert big.contacts.max() > 0


def test_satellites_are_on_the_rim_by_default():
    assert geo.SatelliteDisk(SMALL, 9, 0.1).radius == RADIUS
    assert geo.SatelliteDisk(UNIT, 9, 0.1).radius == 1.0


def room(size: float) -> geo.Container:
    return geo.Container.polygon(size * np.array([(0, 0), (9, 0), (9, 6), (0, 6)]))


SEATS = np.array([(2.0, 2.0), (5.0, 2.5), (7.0, 4.0)])
MOVING = np.array([[0.3, -1.0, 0.7], [-0.2, 0.6, 0.1], [1.0, 0.2, -0.5]])


def gas(disk: geo.Disk, events: int):
    pair = ker.PairLaw.from_wall(WALL, disk)
    walls = ker.CollisionLaw.from_wall(WALL, disk)
    return ker.play_gas(room(disk.radius), pair, disk.radius * SEATS, MOVING, events, walls, rng=1)


def billiard(disk: geo.Disk, events: int):
    return ker.play(
        room(disk.radius), ker.CollisionLaw.from_wall(WALL, disk), disk.radius * SEATS, MOVING, events, rng=1
    )


@pytest.mark.parametrize("played", [gas, billiard])
def test_billiards_and_gases_scale_with_the_radius(played):
    big, small = played(UNIT, 60), played(SMALL, 60)
    np.testing.assert_array_equal(small.velocity, big.velocity)
    np.testing.assert_array_equal(small.position, RADIUS * big.position)
    np.testing.assert_array_equal(small.time, RADIUS * big.time)
    np.testing.assert_array_equal(small.angle, big.angle)
    np.testing.assert_array_equal(small.energy, big.energy)
    np.testing.assert_array_equal(*(record.phase_portrait("velocity") for record in (small, big)))
    # the angle is that of omega
    turned = np.diff(small.time, axis=0) * small.velocity[:-1, :, 2] / RADIUS
    np.testing.assert_allclose(np.diff(small.angle, axis=0), turned, atol=1e-12)
    assert small.radius == (RADIUS if played is gas else None)


def test_a_no_slip_floor_reverses_the_slip_of_a_small_disk_and_keeps_the_angular_momentum_about_the_contact():
    disk = geo.Disk.from_inertia(1.0, 0.125, 0.5)
    omega = 0.7
    record = ker.play_gas(
        room(1.0), ker.PairLaw(ker.retroreflection(), disk), [[4.0, 1.0]], [[0.3, -1.0, disk.radius * omega]], 1,
        ker.no_slip(disk),
    )  # fmt: skip
    before, after = record.velocity[:, 0]
    spins = record.velocity[:, 0, 2] / disk.radius
    assert record.wall[1, 0] == 0
    # of the point of contact, v1 + r omega
    assert math.isclose(after[0] + disk.radius * spins[1], -0.65, rel_tol=1e-14)
    momenta = [
        -disk.mass * disk.radius * w[0] + disk.inertia * spin for w, spin in zip((before, after), spins, strict=True)
    ]
    assert math.isclose(momenta[0], -0.0625, rel_tol=1e-14) and math.isclose(momenta[1], momenta[0], rel_tol=1e-13)
    np.testing.assert_allclose([*after[:2], spins[1]], [-2 / 15, 1.0, -31 / 30], rtol=1e-14)
