"""Extreme masses, spectra and matrices against exact values."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from asperity import geometry as geo
from asperity.core.checks import Floats
from asperity.core.rounding import EPS
from asperity.kernels import Bins, CollisionLaw, KernelMatrix, Legendre, TriangularTeethLaw, discretise, maxwell
from asperity.kernels.matrices.matrix import frobenius_error
from asperity.spectral import spectrum

from .row import ExtremeRow

# Rounding errors of tens of operations on quantities of size 1.
ROUNDED = 256.0 * EPS
SPECTRUM_SIZE = 64
GAP_SIZE = 16


def law_cases(rays: int, most_bins: int) -> dict[str, Callable[[], ExtremeRow]]:
    """The cases by name."""
    cases: dict[str, Callable[[], ExtremeRow]] = {}
    for ratio in (1e-12, 1e-6, 1.0, 1e6, 1e12):
        name = f"collision with m/J = {ratio:g}"
        cases[name] = partial(_collision, name, ratio, rays)
    for gap in (1e-3, 1e-6, 1e-9, 1e-12):
        name = f"gap of {gap:g}, multiplicity {GAP_SIZE // 2 - 1}"
        cases[name] = partial(_gap, name, gap)
    spectra = {
        "eigenvalue of multiplicity 8": np.repeat([0.5, 0.1], [8, SPECTRUM_SIZE - 9]),
        "eigenvalues 1e-13 apart": np.concatenate([0.5 + 1e-13 * np.arange(4), np.full(SPECTRUM_SIZE - 5, 0.1)]),
        "eigenvalues of both signs, equal moduli": np.repeat([0.9, -0.9], [31, 32]),
    }
    for name, values in spectra.items():
        cases[name] = partial(_known_spectrum, name, values)
    for bins in (1_000, most_bins):
        name = f"matrix of {bins} bins"
        cases[name] = partial(_many_bins, name, bins)
    return cases


def _collision(name: str, ratio: float, rays: int) -> ExtremeRow:
    """Conservation of energy and rolling momentum, both in the kinetic metric, in sampled collisions."""
    disk = geo.Disk(mass=ratio, inertia=1.0)
    rng = np.random.default_rng(4)
    psi, theta = np.arccos(rng.uniform(-1.0, 1.0, (2, rays)))
    incoming = -np.asarray(disk.from_angles(theta, psi))
    outgoing = CollisionLaw(TriangularTeethLaw(0.7), disk).sample(incoming, rng)
    energy = np.abs(disk.inner(outgoing, outgoing) / disk.inner(incoming, incoming) - 1.0)
    # the speed along chi is the rolling momentum over sqrt(m + J), to be compared with the speed
    rolling = np.abs(disk.rolling_momentum(outgoing) - disk.rolling_momentum(incoming)) / np.sqrt(1.0 + ratio)
    worst = float(max(energy.max(), rolling.max()))
    return ExtremeRow(name, "conservation of energy and rolling momentum", worst, ROUNDED, "relative")


def _gap(name: str, gap: float) -> ExtremeRow:
    """Maxwell's law with diffuse fraction ``gap``: eigenvalue 1 - gap on even functions, -(1 - gap) on odd ones."""
    found = spectrum(discretise(maxwell(gap), Legendre(GAP_SIZE)), k=GAP_SIZE)
    return ExtremeRow(name, "Maxwell's law, a", abs(found.gap - gap), 64.0 * EPS, "absolute", found.gap_error)


def _known_spectrum(name: str, values: Floats) -> ExtremeRow:
    """A matrix with given eigenvalues off the constants, in a random orthonormal basis."""
    rng = np.random.default_rng(5)
    turn, _ = np.linalg.qr(rng.standard_normal((len(values), len(values))))
    symmetric = np.zeros((len(values) + 1,) * 2)
    symmetric[0, 0] = 1.0
    inner = (turn * values) @ turn.T
    symmetric[1:, 1:] = 0.5 * (inner + inner.T)
    exact = frobenius_error(0.0, "bound", "by construction")
    found = spectrum(KernelMatrix(symmetric, Legendre(len(symmetric)), exact, method="exact"), k=len(symmetric))
    error = float(np.max(np.abs(found.values - np.sort([1.0, *values])[::-1])))
    return ExtremeRow(name, "by construction", error, ROUNDED, "absolute", float(found.errors.algebraic.max()))


def _many_bins(name: str, bins: int) -> ExtremeRow:
    """Maxwell's law in bins: eigenvalue 1/2 on even functions and -1/2 on odd ones, as for the law itself."""
    found = spectrum(discretise(maxwell(0.5), Bins(bins)), k=3)
    return ExtremeRow(name, "Maxwell's law, 1 - a", abs(found.gap - 0.5), bins * EPS, "absolute", found.gap_error)
