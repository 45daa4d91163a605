"""Samples for the numeric checks of the ledger: random disks and velocities, and kinetic norms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core.checks import Floats

SAMPLES = 4000


def generator() -> np.random.Generator:
    """The random generator of every check, with a fixed seed."""
    return np.random.default_rng(2022)


def random_disks(count: int = SAMPLES) -> tuple[np.random.Generator, Floats, Floats]:
    """The generator, and random m and J between 1/10 and 10."""
    rng = generator()
    return rng, *np.exp(rng.uniform(-np.log(10), np.log(10), (2, count)))


def kinetic_norm(w: Floats, m: Floats | float, J: Floats | float) -> Floats:
    """The kinetic-energy norm of velocities (3, n)."""
    return np.asarray(np.sqrt(m * (w[0] ** 2 + w[1] ** 2) + J * w[2] ** 2))


def unit_velocities(rng: np.random.Generator, m: Floats | float, J: Floats | float) -> Floats:
    """Random velocities (3, n) of kinetic norm 1 with v2 > 0; some are grazing, some nearly rolling."""
    w = rng.normal(size=(3, SAMPLES)) * np.exp(rng.uniform(-4, 0, (3, SAMPLES)))
    w[1] = np.abs(w[1])
    return w / kinetic_norm(w, m, J)


def residual(alpha: Floats, spacing: float) -> tuple[NDArray[np.int64], Floats]:
    """The nearest multiple of the spacing and the remainder."""
    k = np.rint(alpha / spacing).astype(np.int64)
    return k, alpha - k * spacing
