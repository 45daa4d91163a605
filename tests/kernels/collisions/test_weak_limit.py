"""Lemma 5.1 as measured numbers: symmetry of the true law, decay with the scale, honest errors."""

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

DISK = geo.Disk(1.0, 1.0)
TEETH = geo.triangular_teeth(1.2)


def bump(y):
    return np.prod(np.cos(0.5 * np.pi * np.clip(y, -1.0, 1.0)) ** 2, axis=-1)


def leaning(y, theta, psi):
    return bump(y) * np.cos(theta) * (2.0 + np.cos(psi))


def squared(y, theta, psi):
    return bump(y) * (1.0 + y[..., 0]) * np.cos(2.0 * theta) ** 2


def test_the_laws_are_symmetric_so_that_the_functions_of_a_pair_may_be_exchanged():
    found = ker.weak_limit(
        DISK, TEETH, [1e-2, 1e-4], {"fg": (leaning, squared), "gf": (squared, leaning)}, rng=1, samples=2**13
    )
    for table, error in ((found.cylinder, found.cylinder_error), (found.limit, found.limit_error)):
        assert np.all(np.abs(table[:, 0] - table[:, 1]) <= 1.5 * (error[:, 0] + error[:, 1]))
    assert found.names == ("fg", "gf") and found.collisions == 2**16


def test_the_differences_decay_with_the_scale():
    found = ker.weak_limit(DISK, geo.flat(), [1e-2, 1e-3, 1e-4, 1e-5], rng=2, samples=2**12)
    # a flat wall at these scales: of the order of rho^2 in cos psi
    j = found.names.index("cos psi")
    slope = np.polyfit(np.log(found.spacings), np.log(np.abs(found.cylinder[:, j])), 1)[0]
    assert 1.5 < slope < 2.5
    assert np.all(np.abs(found.cylinder[-1]) <= 1e-4)
    # on a flat wall the cylinder's law is the limit law
    assert np.all(np.abs(found.cylinder - found.limit) <= found.cylinder_error + found.limit_error)


def test_another_wall_is_not_the_limit():
    """The difference of two walls is far beyond the errors, so the test has power."""
    teeth = ker.weak_limit(DISK, TEETH, [1e-4], rng=3)
    j = teeth.names.index("cos theta")
    means = []
    for wall in (TEETH, geo.flat()):
        law = ker.WallLaw(wall.foreshorten(DISK))
        P = ker.discretise(law, ker.Legendre(2))
        # 4 (3/8)^2 is the integral of the squared bump, P[1, 1]/3 the mean of cos theta cos theta'
        means.append(4.0 * (3.0 / 8.0) ** 2 * P.symmetric[1, 1] / 3.0)
    assert abs(means[0] - means[1]) > 30.0 * teeth.limit_error[0, j]
    assert abs(teeth.limit[0, j]) < 0.1 * abs(means[0] - means[1])


def test_reported_errors_hold_in_repeated_runs():
    wall = geo.focusing_arcs(1.2)
    exact = ker.weak_limit(DISK, wall, [1e-3], rng=11, samples=2**13, repetitions=16)
    misses = 0
    for seed in range(20):
        run = ker.weak_limit(DISK, wall, [1e-3], rng=seed, samples=2**8)
        misses += np.sum(np.abs(run.limit - exact.limit) > run.limit_error + exact.limit_error)
    # 80 intervals of 95 %; those of one run are correlated
    assert misses <= 10


def test_a_limit_study_over_several_psi_is_the_mean_of_its_parts():
    psi = [0.4, 1.2, 2.4]
    study = ker.limit_study(DISK, TEETH, [1e-3, 1e-5], rng=4, psi=psi, samples=(8, 12, 12))
    assert study.psi.tolist() == psi and study.collisions == 4 * 3 * 8 * 12 * 12
    for name in ("distance", "state_distance", "psi_defect"):
        assert study.by_psi[name].shape == (2, 3)
        assert np.allclose(study.by_psi[name].mean(axis=1), getattr(study, name), rtol=1e-12)
    # y' is tested as well: the displacement is of the order of a cell, of x1 and of alpha, here up to a few
    moved = study.state_distance - study.distance
    assert np.all(moved >= study.drift) and np.all(moved <= 2.0 * study.drift * (1.0 + 1e-12))
    assert moved[1] < 0.03 * moved[0]
