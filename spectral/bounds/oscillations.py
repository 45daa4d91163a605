"""Rayleigh quotients of fast oscillations, which detect spectrum near 1 missed by slow trial functions."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ...kernels import Law
from ...kernels.bases.measure import SINE

# Rays, and batches of them for the standard error.
RAYS, PARTS = 2**12, 8
# Frequencies per block.
AT_ONCE = 32
# Frequencies times the root mean square of theta' - theta (or of its mirror image).
FREQUENCIES = np.arange(0.5, 64.0, 0.1)
# Margin in standard errors; by chance alone the least of the quotients is 3 standard errors below its mean.
SIGMAS = 6.0
# Trial functions of enclosures are slower than the frequency FASTEST_SLOW. The fraction of a faster oscillation in
# their span, which decreases like t^-4, is below SLOW_FRACTION.
FASTEST_SLOW, SLOW_FRACTION = 40.0, 0.01
# Lower limit of the root mean square of theta' - theta.
LEAST_MOVE = 1e-6


@lru_cache(maxsize=8)
def fast_top(law: Law) -> tuple[float, str] | None:
    """A value reached by the spectrum beyond slow functions, with its evidence in words; None if rays do not escape.

    It is the largest sampled Rayleigh quotient of f = cos(t theta + phase), minus margins for the sampling error and
    for the part of f in the span of slow functions.
    """
    try:
        frequency, quotient, spread = least_quotient(law, FASTEST_SLOW)
    except AccuracyError:
        return None
    top = 1.0 - quotient - SIGMAS * spread - SLOW_FRACTION
    return top, f"by {RAYS} rays cos(t theta + phase), t = {frequency:.6g}, has a mean of {top:.6g} at least"


def least_quotient(law: Law, least: float = 0.0) -> tuple[float, float, float]:
    """Frequency, value and standard error of the least quotient of 1 - P, for frequencies of at least ``least``."""
    rng = np.random.default_rng(0)
    theta = SINE.quantile((np.arange(RAYS) + rng.random(RAYS)) / RAYS)
    out = law.sample(theta, rng)
    move = min(float(np.sqrt(np.mean((angle - theta) ** 2))) for angle in (out, np.pi - out))
    best = (0.0, np.inf, np.inf)
    frequencies = FREQUENCIES / max(move, LEAST_MOVE)
    frequencies += max(least - frequencies[0], 0.0)
    # exp(i t_k theta) = exp(i t_first theta) exp(i (t_k - t_first) theta), and frequencies are equally spaced
    offsets = frequencies[:AT_ONCE] - frequencies[0]
    steps = [np.exp(1j * offsets[:, None] * angle) for angle in (theta, out)]
    for start in range(0, frequencies.size, AT_ONCE):
        # cosines and sines as real and imaginary parts, shape (frequencies, rays)
        t = frequencies[start : start + AT_ONCE]
        here, there = (
            np.exp(1j * t[0] * angle) * step[: t.size] for angle, step in zip((theta, out), steps, strict=True)
        )
        variance, form = _squares(here - here.mean(axis=1)[:, None]), 0.5 * _squares(there - here)
        lower = np.linalg.cholesky(variance)
        scaled = np.linalg.solve(lower, np.swapaxes(np.linalg.solve(lower, form), 1, 2))
        values, vectors = np.linalg.eigh(scaled)
        worst = int(np.argmin(values[:, 0]))
        if values[worst, 0] < best[1]:
            real, imaginary = np.linalg.solve(lower[worst].T, vectors[worst, :, 0])
            change = (there - here)[worst]
            # batches of interleaved angles
            parts = (0.5 * (real * change.real + imaginary * change.imag) ** 2).reshape(-1, PARTS).mean(axis=0)
            best = (float(t[worst]), float(values[worst, 0]), float(parts.std(ddof=1) / np.sqrt(PARTS)))
    return best


def _squares(values: NDArray[np.complex128]) -> Floats:
    """Mean products of real and imaginary parts, shape (frequencies, 2, 2)."""
    parts = np.stack((values.real, values.imag), axis=1)
    return np.asarray(parts @ np.swapaxes(parts, 1, 2) / values.shape[1])
