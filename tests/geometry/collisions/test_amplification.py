"""Disks whose outgoing states rounding decides: the status says so, and the disks are not lost."""

import numpy as np
import pytest
from campaigns.rays.amplified_collisions import WALLS

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.collisions.rigid import fewest_contacts

AMPLIFIED = geo.DiskStatus.AMPLIFIED


def states(wall, disk, scale, n, seed=0):
    """Positions over one cell, alpha near 0, and velocities with independent uniform cosines."""
    rng = np.random.default_rng(seed)
    position = np.column_stack([rng.random(n) * scale * wall.period, 0.02 * (rng.random(n) - 0.5)])
    return position, -disk.from_angles(*np.arccos(1.0 - 2.0 * rng.random((2, n))))


@pytest.mark.parametrize("name", WALLS)
def test_few_ordinary_disks_are_amplified_or_even_repeated(name):
    wall, disk = WALLS[name], geo.Disk()
    hit = geo.collide(disk, wall, 1e-2, *states(wall, disk, 1e-2, 4000))
    counts = hit.counts()
    assert counts["escaped"] + counts["amplified"] == np.count_nonzero(hit.escaped) == 4000
    # islands of a tenth of the period are a chaotic billiard
    assert counts["amplified"] <= (80 if name == "islands" else 0)


def test_amplified_disks_keep_their_states_and_count_as_escaped():
    wall, disk, scale = WALLS["islands"], geo.Disk(1.0, 1e-4), 1e-2
    position, velocity = states(wall, disk, scale, 60)
    hit = geo.collide(disk, wall, scale, position, velocity)
    amplified = hit.status == AMPLIFIED
    assert amplified.any() and hit.escaped[amplified].all() and np.isfinite(hit.position).all()
    energy = disk.inner(hit.velocity, hit.velocity) / disk.inner(velocity, velocity)
    np.testing.assert_allclose(energy[amplified], 1.0, rtol=1e-12)
    assert np.all(hit.velocity[amplified, 1] > 0.0)
    alone = geo.collide(disk, wall, scale, position[amplified], velocity[amplified])
    np.testing.assert_array_equal(alone.velocity, hit.velocity[amplified])
    assert (alone.status == AMPLIFIED).all()


def test_laws_of_the_true_disk_sample_amplified_disks():
    law = ker.SatelliteLaw(WALLS["islands"], geo.Disk(1.0, 1e-4), scale=1e-2)
    out = law.sample(np.tile([[0.2, -1.0, 30.0]], (40, 1)), rng=0)
    assert np.isfinite(out).all() and np.all(out[:, 1] > 0.0)


def test_the_cylinder_and_the_modified_collision_have_the_status():
    disk = geo.Disk(1.0, 1e-4)
    wall = WALLS["islands"]
    cylinder = geo.collide_cylinder(disk, wall, 1e-2, *states(wall, disk, 1e-2, 100))
    assert cylinder.counts()["amplified"] > 0 and cylinder.escaped.all()
    modified = geo.collide_modified(disk, wall, 1e-2, *states(wall, disk, 1e-2, 60))
    assert modified.counts()["amplified"] > 0


def test_pairs_with_many_contacts_of_round_satellites_have_the_status():
    rng, n = np.random.default_rng(0), 12
    body = geo.SatelliteDisk(geo.Disk(), 24, 0.02)
    position, velocity = np.zeros((2, n, 2, 3))
    position[:, 1, 0], position[:, :, 2] = 2.3, rng.random((n, 2))
    velocity[:, 0, 0], velocity[:, 0, 1] = 1.0, rng.uniform(-0.3, 0.3, n)
    velocity[:, :, 2] = rng.standard_normal((n, 2))
    hit = geo.collide_pair(body, body, position, velocity)
    amplified = hit.status == AMPLIFIED
    assert hit.escaped.all() and amplified.any() and not amplified[hit.contacts <= 3].any()
    assert hit.contacts[amplified].min() > 3 and np.isfinite(hit.position).all()


def test_repeats_begin_with_fewer_contacts_where_walls_bend_and_inertias_are_small():
    numbers = [fewest_contacts(bend, ratio) for bend, ratio in ((0.0, 1.0), (0.01, 1.0), (2.0, 1.0), (2.0, 1e5))]
    assert numbers == sorted(numbers, reverse=True) and numbers[0] < 1000 and numbers[-1] == 1
    assert fewest_contacts(np.inf, 1.0) == 1
