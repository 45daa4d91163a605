"""Spectra and gaps: exact kernels, published values, errors that hold."""

import numpy as np
import pytest
from scipy.stats.qmc import Sobol

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec


def test_published_gap_of_dispersing_bumps():
    """.0373 (Feres and Zhang 2010) at K = 1/3 in Feres' convention; quasi-Monte Carlo below gives one digit more."""
    law = ker.WallLaw(geo.dispersing_arcs(1 / 3)).in_specular_frame()
    gap = spec.spectral_gap(law, tolerance=1e-5)
    assert gap.convention == "specular"
    assert abs(float(gap) - 0.0373) < 5e-5
    assert gap.error < 1e-4
    # a matrix of polynomials has no smaller one
    assert spec.spectrum(ker.discretise(law, ker.Legendre(12)), k=2).gap >= float(gap) - gap.error


@pytest.mark.parametrize(
    ("law", "wall", "degree"),
    [
        (ker.WallLaw(geo.dispersing_arcs(1 / 3)), geo.dispersing_arcs(1 / 3), 12),
        (ker.CircularArcLaw(0.1), geo.focusing_arcs(0.1), 24),
    ],
    ids=["bumps", "arcs by their closed form"],
)
def test_an_eigenvalue_is_the_rayleigh_quotient_of_traced_rays(law, wall, degree):
    """1 - lambda = E (phi(theta) - phi(pi - theta'))^2 / 2 over the flux, by z-score over 8 nets of 2^15 rays."""
    found = spec.spectrum(ker.discretise(law.in_specular_frame(), ker.Legendre(degree)), k=2)
    means = []
    for seed in range(8):
        x, u = np.clip(Sobol(2, rng=np.random.default_rng(seed)).random(2**15).T, 1e-15, 1 - 1e-15)
        theta = np.arccos(1 - 2 * u)
        traced = geo.trace(wall, x, theta)
        change = found.eigenfunction(1, theta) - found.eigenfunction(1, np.pi - traced.theta)
        means.append(np.mean(0.5 * change**2))
    error = np.std(means, ddof=1) / np.sqrt(8)
    assert abs(np.mean(means) - found.gap) < 5.0 * error < 1e-4


@pytest.mark.parametrize("method", ["monte-carlo", "qmc"])
@pytest.mark.parametrize("symmetrise", [False, True])
def test_sampling_error_of_an_eigenvalue_is_calibrated(method, symmetrise):
    """z-scores of 60 seeds for lambda_2 of a bins matrix against the exact matrix: standard normal by size."""
    law, basis = ker.CircularArcLaw(1.0), ker.Bins(8)
    exact = spec.spectrum(ker.discretise(law, basis), k=2).values[1]
    scores = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        matrix = ker.discretise(law, basis, method=method, samples=2**14, rng=rng, symmetrise=symmetrise)
        found = spec.spectrum(matrix, k=2)
        assert found.errors.sampling[1] > 0
        scores.append((found.values[1] - exact) / found.errors.sampling[1])
    mean_square = np.mean(np.square(scores))
    # squares of normal scores have mean 1 and variance 2; over the spread of eight replicates they are Student
    # t(7), whose square is F(1, 7) with mean 7/5 and variance 7.84
    expected, variance = (1.0, 2.0) if method == "monte-carlo" else (1.4, 7.84)
    assert abs(mean_square - expected) < 4.5 * np.sqrt(variance / 60)


def test_a_multiple_eigenvalue_one_is_not_mixed_up_with_constants():
    found = spec.spectrum(ker.discretise(ker.retroreflection(), ker.Legendre(12)), k=6)
    assert np.allclose(found.values, 1.0, atol=1e-13)
    assert found.gap == pytest.approx(0.0, abs=1e-13)


def test_a_small_matrix_has_fewer_eigenvalues_than_asked_for():
    assert len(spec.spectrum(ker.discretise(ker.specular(), ker.Legendre(8)), k=10).values) == 8


@pytest.mark.parametrize("degree", [6, 8, 12, 16, 24, 32])
def test_the_error_of_an_eigenvalue_holds_in_small_bases(degree):
    """Facts 10: the second eigenvalue of focusing arcs, xi = 1.2, is 0.3670253152(3)."""
    found = spec.spectrum(ker.discretise(ker.CircularArcLaw(1.2), ker.Legendre(degree)), k=2)
    low, high = found.intervals[1]
    assert low <= 0.3670253152 <= high


@pytest.mark.parametrize(("half_angle", "ratio"), [(0.1, 0.996971), (0.2, 0.987607)])
def test_gap_of_shallow_arcs_is_four_times_the_mean_squared_slope(half_angle, ratio):
    """h = [ln(sec xi + tan xi) - sin xi]/sin xi is the mean squared slope; gap/(4h) tends to 1 like 1 - 0.3 xi^2.

    The ratios are Rayleigh quotients of 2^21 traced rays (test_an_eigenvalue_is_the_rayleigh_quotient_of_traced_rays).
    """
    h = (np.log(1 / np.cos(half_angle) + np.tan(half_angle)) - np.sin(half_angle)) / np.sin(half_angle)
    law = ker.WallLaw(geo.focusing_arcs(half_angle)).in_specular_frame()
    gap = spec.spectral_gap(law, tolerance=1e-6)
    assert abs(float(gap) / (4 * h) - ratio) < 1e-6 + gap.error / (4 * h)
    assert gap.error / (4 * h) < 2e-3
