"""The wall for a wanted collision law, on which the true disk with its satellites collides."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker

DISK, MOMENTS = geo.Disk(1.0, 0.4), 4
REPLICATES, SAMPLES = 8, 2**14


@pytest.fixture(scope="module")
def wanted():
    return ker.CollisionLaw(ker.maxwell(0.5), DISK)


@pytest.fixture(scope="module")
def found(wanted):
    return ker.collision_for(wanted, moments=MOMENTS)


def moments_of_collisions(wall, scale):
    """Moments <e_l, P e_m> of true collisions, their standard errors, and the mean of |psi + psi' - pi|."""
    basis, space = ker.Legendre(MOMENTS), geo.ConfigurationSpace(wall, DISK, scale)
    tables, rolls = [], []
    for replicate in range(REPLICATES):
        rng = np.random.default_rng([7, replicate])
        theta, psi = ker.SINE.sample(SAMPLES, rng), np.pi * (0.1 + 0.8 * rng.random(SAMPLES))
        alpha, x1 = space.spacing * (rng.random(SAMPLES) - 0.5), scale * wall.period * rng.random(SAMPLES)
        position = np.stack([x1, alpha], axis=-1)
        collided = geo.collide(DISK, wall, scale, position, -DISK.from_angles(theta, psi), space.spacing)
        assert collided.escaped.all()
        outgoing, rolled = DISK.to_angles(collided.velocity)
        table = basis.evaluate(theta).T @ basis.evaluate(outgoing) / SAMPLES
        tables.append(0.5 * (table + table.T))
        rolls.append(float(np.mean(np.abs(rolled + psi - np.pi))))
    error = np.std(tables, axis=0, ddof=1) / np.sqrt(REPLICATES)
    return np.mean(tables, axis=0), error, np.mean(rolls)


def test_the_true_disk_approaches_the_wanted_collision_law(wanted, found):
    matrix = ker.discretise(wanted.law, ker.Legendre(MOMENTS)).symmetric
    defects, rolls = [], []
    for scale in (1e-2, 1e-3, 1e-5):
        mean, error, rolled = moments_of_collisions(found.wall, scale)
        defects.append(np.linalg.norm(mean - matrix))
        rolls.append(rolled)
    # at 1e-5 the limit law of order eps^(2/5) in psi, and sampling in theta
    assert np.linalg.norm(error) < 0.02 and defects[2] < 3.0 * np.linalg.norm(error)
    assert defects[0] > 0.05 > 3.0 * defects[2]
    assert np.log(rolls[0] / rolls[2]) / np.log(1e3) == pytest.approx(0.4, abs=0.05)


def test_the_wall_without_the_disks_factor_has_another_law(wanted, found):
    matrix = ker.discretise(wanted.law, ker.Legendre(MOMENTS)).symmetric
    mean, error, _ = moments_of_collisions(found.wall.foreshorten(DISK), 1e-5)
    assert np.linalg.norm(mean - matrix) > 10.0 * np.linalg.norm(error)
