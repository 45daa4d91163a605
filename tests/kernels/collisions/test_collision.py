"""The collision law K: conservation, symmetry, its two deterministic cases, branches and spectrum."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

RNG = 20_260_301
positive = st.floats(1e-6, 1e6)


def velocities(n, rng):
    velocity = rng.normal(size=(n, 3))
    velocity[:, 1] = -np.abs(velocity[:, 1])
    return velocity


@given(mass=positive, inertia=positive)
def test_k_of_specular_is_the_smooth_matrix_and_of_retroreflection_the_no_slip_matrix(mass, inertia):
    disk = geo.Disk(mass, inertia)
    rng = np.random.default_rng(RNG)
    velocity = velocities(8, rng)
    for law, matrix in ((ker.specular(), ker.smooth_matrix(disk)), (ker.retroreflection(), ker.no_slip_matrix(disk))):
        K = ker.CollisionLaw(law, disk)
        expected = velocity @ matrix.T
        # spin is measured in units of the kinetic energy
        scale = np.sqrt(disk.inner(velocity, velocity))[:, None] / np.sqrt([mass, mass, inertia])
        assert np.all(np.abs(K.sample(velocity, rng) - expected) <= 64 * np.finfo(float).eps * scale)
        (probability, branch), *others = K.branches(0.7)
        assert not others and probability == 1.0
        assert np.all(np.abs((velocity @ branch.T) - expected) <= 64 * np.finfo(float).eps * scale)


@given(mass=positive, inertia=positive)
def test_no_slip_is_twice_the_projection_on_chi_minus_one(mass, inertia):
    disk = geo.Disk(mass, inertia)
    chi = np.array([-1.0, 0.0, 1.0]) / np.sqrt(mass + inertia)
    expected = 2.0 * np.outer(chi, chi * [mass, mass, inertia]) - np.eye(3)
    assert np.allclose(ker.no_slip_matrix(disk), expected, rtol=1e-9, atol=1e-12 * np.max(np.abs(expected)))
    assert np.allclose(ker.smooth_matrix(disk), np.diag([1.0, -1.0, 1.0]), atol=1e-9)


@pytest.mark.parametrize("wall", [geo.triangular_teeth(0.7), geo.focusing_arcs(1.2), geo.koch(2)], ids=repr)
def test_energy_and_rolling_momentum_are_conserved(wall):
    disk = geo.Disk(2.0, 0.3)
    K = ker.CollisionLaw.from_wall(wall, disk)
    rng = np.random.default_rng(RNG)
    before = velocities(2_000, rng)
    after = K.sample(before, rng)
    assert np.all(after[:, 1] > 0.0)
    energy = disk.inner(before, before)
    assert np.allclose(disk.inner(after, after), energy, rtol=1e-13)
    scale = np.sqrt((disk.mass + disk.inertia) * energy)
    assert np.all(np.abs(disk.rolling_momentum(after) - disk.rolling_momentum(before)) <= 1e-14 * scale)


def test_branches_of_triangular_teeth_are_isometries_that_conserve():
    """S2.28 in the original coordinates: every matrix keeps the metric and the covector -m v1 + J omega."""
    disk = geo.Disk(1.0, 0.5)
    K = ker.CollisionLaw.from_wall(geo.triangular_teeth(0.9), disk)
    metric = np.diag([disk.mass, disk.mass, disk.inertia])
    rolling = np.array([-disk.mass, 0.0, disk.inertia])
    for theta in (0.2, 0.9, 1.5, 2.6):
        branches = K.branches(theta)
        assert sum(p for p, _ in branches) == pytest.approx(1.0, abs=1e-14)
        for _, matrix in branches:
            assert np.allclose(matrix.T @ metric @ matrix, metric, atol=1e-13)
            assert np.allclose(rolling @ matrix, rolling, atol=1e-13)


def test_branches_give_the_sampled_velocities():
    disk = geo.Disk(1.3, 0.4)
    K = ker.CollisionLaw.from_wall(geo.triangular_teeth(0.9), disk)
    theta, psi = 1.1, 0.8
    before = -disk.from_angles(theta, psi, speed=1.7)
    expected = np.array([matrix @ before for _, matrix in K.branches(theta)])
    n = 20_000
    after = K.sample(np.tile(before, (n, 1)), np.random.default_rng(RNG))
    which = np.argmin(np.linalg.norm(after[:, None] - expected, axis=2), axis=1)
    assert np.max(np.linalg.norm(after - expected[which], axis=1)) < 1e-13
    fraction = np.bincount(which, minlength=len(expected)) / n
    probability = np.array([p for p, _ in K.branches(theta)])
    assert np.all(np.abs(fraction - probability) <= 4.5 * np.sqrt(probability * (1 - probability) / n) + 1e-12)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 10.0])
def test_the_law_of_the_foreshortened_wall_is_the_closed_form_with_corrected_parameters(ratio):
    """r~ = (1 + m/J)^(1/2) r (S2.18, corrected) and psi~ = 2 arctan((1 + m/J)^(-1/2) tan(psi/2)) (S2.21), traced."""
    disk = geo.Disk(ratio, 1.0)
    kappa = (1.0 + ratio) ** -0.5
    rng = np.random.default_rng(RNG)
    x, theta = rng.random(50_000), np.arccos(1 - 2 * rng.random(50_000))
    r, psi = 0.8, 1.1
    teeth = geo.trace(geo.rectangular_teeth(r).foreshorten(disk), x, theta)
    specular_fraction = ker.RectangularTeethLaw(r / kappa).branches(theta)
    exact = np.sum(specular_fraction[0] * (np.abs(specular_fraction[1] - (np.pi - theta)[:, None]) < 1e-9), axis=1)
    hit = np.abs(teeth.theta - (np.pi - theta)) < 1e-9
    assert teeth.escaped.all()
    assert abs(np.sum(hit - exact)) < 4.5 * np.sqrt(np.sum(exact * (1 - exact)))
    teeth = geo.trace(geo.triangular_teeth(psi).foreshorten(disk), x, theta)
    law = ker.TriangularTeethLaw(2 * np.arctan(kappa * np.tan(psi / 2)))
    hits = law.hits(x, theta)
    same = teeth.collisions == hits
    assert same.mean() > 0.99999
    assert np.max(np.abs(teeth.theta - law.reflect(x, theta))[same]) < 1e-12


def test_spectrum_of_k_is_that_of_the_reflection_law_with_both_signs():
    law = ker.henyey_greenstein(0.6)
    K = ker.CollisionLaw(law, geo.Disk())
    dense = K.operator(ker.Legendre(12), ker.Legendre(2, weight="sin2")).dense()
    found = spec.spectrum(K, k=8)
    assert np.allclose(found.values, [1, 0.6, 0.36, 0.216, -0.216, -0.36, -0.6, -1], atol=1e-12)
    eigenvalues = np.linalg.eigvalsh(dense)
    assert np.allclose(np.sort(np.abs(eigenvalues))[::-1][:8], np.repeat(0.6 ** np.arange(4), 2), atol=1e-12)
    assert found.gap == pytest.approx(0.4, abs=1e-12)
