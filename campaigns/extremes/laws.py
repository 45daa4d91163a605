"""Extreme masses, spectra and matrices against exact values."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from asperity import geometry as geo
from asperity.core.rounding import EPS
from asperity.kernels import Bins, CollisionLaw, KernelMatrix, Legendre, TriangularTeethLaw, discretise, maxwell
from asperity.kernels.matrices.matrix import frobenius_error
from asperity.spectral import spectrum
from campaigns.engine import Campaign, Judged

# Rounding errors of tens of operations on quantities of size 1.
ROUNDED = 256.0 * EPS
RATIOS, GAPS, BINS = (1e-12, 1e-6, 1.0, 1e6, 1e12), (1e-3, 1e-6, 1e-9, 1e-12), (1_000, 10_000)
RAYS, GAP_SIZE, SPECTRUM_SIZE = 1000, 16, 64
SPECTRA = {
    "eigenvalue of multiplicity 8": np.repeat([0.5, 0.1], [8, SPECTRUM_SIZE - 9]),
    "eigenvalues 1e-13 apart": np.concatenate([0.5 + 1e-13 * np.arange(4), np.full(SPECTRUM_SIZE - 5, 0.1)]),
    "eigenvalues of both signs, equal moduli": np.repeat([0.9, -0.9], [31, 32]),
}


def judge_masses(ratio: float) -> Iterator[Judged]:
    """Conservation of energy and rolling momentum, both in the kinetic metric, in sampled collisions."""
    disk = geo.Disk(ratio, 1.0 / ratio)
    rng = np.random.default_rng(4)
    psi, theta = np.arccos(rng.uniform(-1.0, 1.0, (2, RAYS)))
    incoming = -np.asarray(disk.from_angles(theta, psi))
    outgoing = CollisionLaw(TriangularTeethLaw(0.7), disk).sample(incoming, rng)
    energy = np.abs(disk.inner(outgoing, outgoing) / disk.inner(incoming, incoming) - 1.0)
    # the speed along chi is the rolling momentum over sqrt(m + J), to be compared with the speed
    rolling = np.abs(disk.rolling_momentum(outgoing) - disk.rolling_momentum(incoming)) / np.sqrt(1.0 + ratio)
    yield Judged(f"collision with m/J = {ratio:g}", ROUNDED, float(max(energy.max(), rolling.max())), number=RAYS)


def _judged(kind: str, allowed: float, reported: float, error: float) -> Judged:
    """An error that may exceed what is allowed if it is reported."""
    outcome = "degraded as reported" if error > allowed else ""
    return Judged(kind, max(allowed, reported), error, outcome=outcome)


def judge_gap(gap: float) -> Iterator[Judged]:
    """Maxwell's law with diffuse fraction ``gap``: eigenvalue 1 - gap on even functions, -(1 - gap) on odd ones."""
    found = spectrum(discretise(maxwell(gap), Legendre(GAP_SIZE)), k=GAP_SIZE)
    kind = f"gap of {gap:g}, multiplicity {GAP_SIZE // 2 - 1}"
    yield _judged(kind, 64.0 * EPS, found.gap_error, abs(found.gap - gap))


def judge_spectrum(name: str) -> Iterator[Judged]:
    """A matrix with given eigenvalues off the constants, in a random orthonormal basis."""
    values, rng = SPECTRA[name], np.random.default_rng(5)
    turn, _ = np.linalg.qr(rng.standard_normal((len(values), len(values))))
    symmetric = np.zeros((len(values) + 1,) * 2)
    symmetric[0, 0] = 1.0
    inner = (turn * values) @ turn.T
    symmetric[1:, 1:] = 0.5 * (inner + inner.T)
    exact = frobenius_error(0.0, "bound", "by construction")
    found = spectrum(KernelMatrix(symmetric, Legendre(len(symmetric)), exact, method="exact"), k=len(symmetric))
    error = float(np.max(np.abs(found.values - np.sort([1.0, *values])[::-1])))
    yield _judged(name, ROUNDED, float(found.errors.algebraic.max()), error)


def judge_bins(bins: int) -> Iterator[Judged]:
    """Maxwell's law in bins: eigenvalue 1/2 on even functions and -1/2 on odd ones, as for the law itself."""
    found = spectrum(discretise(maxwell(0.5), Bins(bins)), k=3)
    yield _judged(f"matrix of {bins} bins", bins * EPS, found.gap_error, abs(found.gap - 0.5))


CAMPAIGNS = (
    Campaign("extreme-masses", "Is energy kept whatever the masses?", RATIOS.__getitem__, judge_masses, 5, range(5)),
    Campaign("extreme-gaps", "Are small gaps right?", GAPS.__getitem__, judge_gap, 4, range(4)),
    Campaign("extreme-spectra", "Are close eigenvalues right?", list(SPECTRA).__getitem__, judge_spectrum, 3, range(3)),
    Campaign("extreme-matrices", "Are large matrices right?", BINS.__getitem__, judge_bins, 2, [0]),
)
