"""Samples for the numeric checks of the ledger: random disks, velocities, and clearances over a wall."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core.checks import Floats

SAMPLES = 4000


def generator() -> np.random.Generator:
    """The random generator of every check, with a fixed seed."""
    return np.random.default_rng(2022)


def masses(rng: np.random.Generator, count: int = SAMPLES) -> tuple[Floats, Floats]:
    """Random m and J between 1/10 and 10."""
    return np.exp(rng.uniform(-np.log(10), np.log(10), count)), np.exp(rng.uniform(-np.log(10), np.log(10), count))


def kinetic_norm(w: Floats, m: Floats | float, J: Floats | float) -> Floats:
    """The kinetic-energy norm of velocities (3, n)."""
    return np.asarray(np.sqrt(m * (w[0] ** 2 + w[1] ** 2) + J * w[2] ** 2))


def unit_velocities(rng: np.random.Generator, m: Floats | float, J: Floats | float) -> Floats:
    """Random velocities (3, n) of kinetic norm 1 with v2 > 0; some are grazing, some nearly rolling."""
    w = rng.normal(size=(3, SAMPLES)) * np.exp(rng.uniform(-4, 0, (3, SAMPLES)))
    w[1] = np.abs(w[1])
    return w / kinetic_norm(w, m, J)


def tooth(x: Floats) -> Floats:
    """The height of the sampled wall: triangular teeth of period 1 and depth 1, with corners at the integers."""
    return np.abs(2.0 * (x - np.floor(x)) - 1.0) - 1.0


def satellites(configuration: Floats, count: int) -> Floats:
    """The positions (2, n, count) of all satellites of a rotated disk, with heights relative to the lowest contact."""
    x1, x2, alpha = configuration
    rotated = np.exp(1j * (alpha[:, np.newaxis] + 2 * np.pi * np.arange(count) / count)) * -1j
    return np.stack([x1[:, np.newaxis] + rotated.real, x2[:, np.newaxis] + 1.0 + rotated.imag])


def clearance(configuration: Floats, eps: float, count: int) -> Floats:
    """The least height (n,) of all satellites over the wall eps W; negative if a satellite is in the solid."""
    x, height = satellites(configuration, count)
    return np.asarray(np.min(height - eps * tooth(x / eps), axis=-1))


def is_free(configuration: Floats, eps: float, count: int) -> NDArray[np.bool_]:
    """Whether configurations (3, n) are in M, tested at every satellite."""
    return clearance(configuration, eps, count) >= 0.0


def residual(alpha: Floats, spacing: float) -> tuple[NDArray[np.int64], Floats]:
    """The nearest multiple of the spacing and the remainder."""
    k = np.rint(alpha / spacing).astype(np.int64)
    return k, alpha - k * spacing
