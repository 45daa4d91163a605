"""Rayleigh quotients of fast oscillations, which show spectrum near 1 that slow trial functions miss."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ...kernels import Law
from ...kernels.bases.measure import SINE

# Rays, and parts of them for the spread.
RAYS, PARTS = 2**12, 8
# Frequencies at a time.
AT_ONCE = 32
# Frequencies, in units of 1 over the root mean square by which the law moves angles.
FREQUENCIES = np.arange(0.5, 64.0, 0.1)
# The least of so many quotients is 3 standard errors below its mean by chance.
SIGMAS = 6.0
# Trial functions of enclosures are slower than this frequency t: of a faster oscillation less than this fraction, which
# falls off like t^-4, is in them.
FASTEST_SLOW, SLOW_FRACTION = 40.0, 0.01
# What the law moves angles by, at least.
LEAST_MOVE = 1e-6


@lru_cache(maxsize=8)
def fast_top(law: Law) -> tuple[float, str] | None:
    """A value that the spectrum beyond slow functions reaches, with what shows it; None where that cannot be told.

    It is the largest mean of f P f / f^2, f = cos(t theta + phase), that rays show, less what chance may do and what of
    f is in the slow functions.
    """
    try:
        frequency, quotient, spread = least_quotient(law, FASTEST_SLOW)
    except AccuracyError:
        return None
    top = 1.0 - quotient - SIGMAS * spread - SLOW_FRACTION
    return top, f"by {RAYS} rays cos(t theta + phase), t = {frequency:.6g}, has a mean of {top:.6g} at least"


def least_quotient(law: Law, least: float = 0.0) -> tuple[float, float, float]:
    """The frequency of the least quotient, this quotient, and its standard error; of frequencies beyond the least."""
    rng = np.random.default_rng(0)
    theta = SINE.quantile((np.arange(RAYS) + rng.random(RAYS)) / RAYS)
    out = law.sample(theta, rng)
    move = min(float(np.sqrt(np.mean((angle - theta) ** 2))) for angle in (out, np.pi - out))
    best = (0.0, np.inf, np.inf)
    for start in range(0, FREQUENCIES.size, AT_ONCE):
        # cosines and sines as real and imaginary parts, shape (frequencies, rays)
        t = FREQUENCIES[start : start + AT_ONCE] / max(move, LEAST_MOVE)
        t += max(least - FREQUENCIES[0] / max(move, LEAST_MOVE), 0.0)
        here, there = (np.exp(1j * t[:, None] * angle) for angle in (theta, out))
        variance, form = _squares(here - here.mean(axis=1)[:, None]), 0.5 * _squares(there - here)
        lower = np.linalg.cholesky(variance)
        scaled = np.linalg.solve(lower, np.swapaxes(np.linalg.solve(lower, form), 1, 2))
        values, vectors = np.linalg.eigh(scaled)
        worst = int(np.argmin(values[:, 0]))
        if values[worst, 0] < best[1]:
            real, imaginary = np.linalg.solve(lower[worst].T, vectors[worst, :, 0])
            change = (there - here)[worst]
            # neighbouring angles in every part
            parts = (0.5 * (real * change.real + imaginary * change.imag) ** 2).reshape(-1, PARTS).mean(axis=0)
            best = (float(t[worst]), float(values[worst, 0]), float(parts.std(ddof=1) / np.sqrt(PARTS)))
    return best


def _squares(values: NDArray[np.complex128]) -> Floats:
    """The mean products of real and imaginary parts, shape (frequencies, 2, 2)."""
    square, product = (np.abs(values) ** 2).mean(axis=1), (values**2).mean(axis=1)
    rows = [[square + product.real, product.imag], [product.imag, square - product.real]]
    return np.asarray(0.5 * np.moveaxis(np.array(rows), -1, 0))
