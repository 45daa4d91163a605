"""Rayleigh quotients of fast oscillations by rays, which detect spectrum missed by trial functions."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ...kernels import Law
from ...kernels.bases.assembly import one_blas_thread
from ...kernels.bases.measure import SINE

# Rays, and batches of them for the standard error.
RAYS, PARTS = 2**12, 8
# Frequencies of one factor.
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
    with one_blas_thread():
        return _least_quotient(law, least)


def _least_quotient(law: Law, least: float) -> tuple[float, float, float]:
    rng = np.random.default_rng(0)
    theta = SINE.quantile((np.arange(RAYS) + rng.random(RAYS)) / RAYS)
    out = law.sample(theta, rng)
    move = min(float(np.sqrt(np.mean((angle - theta) ** 2))) for angle in (out, np.pi - out))
    frequencies = FREQUENCIES / max(move, LEAST_MOVE)
    frequencies += max(least - frequencies[0], 0.0)
    # frequencies are equally spaced, and exp(i t_k theta) = exp(i t_first theta) exp(i (t_k - t_first) theta), so that
    # a matrix product has the means of all of them
    steps = frequencies[::AT_ONCE], frequencies[:AT_ONCE] - frequencies[0]
    here, there = ([np.exp(1j * t[:, None] * angle) for t in steps] for angle in (theta, out))

    def mean(values: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
        return np.asarray((values[0] @ values[1].T).ravel()[: frequencies.size] / RAYS)

    centre, square = mean(here), mean([z * z for z in here])
    # of the change w - z from z = exp(i t theta) to w = exp(i t theta')
    modulus = 2.0 - 2.0 * mean([w * z.conj() for z, w in zip(here, there, strict=True)]).real
    change = mean([w * w for w in there]) - 2.0 * mean([w * z for z, w in zip(here, there, strict=True)]) + square
    variance = _products(1.0, square) - _products(np.abs(centre) ** 2, centre**2)
    lower = np.linalg.cholesky(variance)
    scaled = np.linalg.solve(lower, np.swapaxes(np.linalg.solve(lower, 0.5 * _products(modulus, change)), 1, 2))
    values, vectors = np.linalg.eigh(scaled)
    worst = int(np.argmin(values[:, 0]))
    t = float(frequencies[worst])
    cosine, sine = np.linalg.solve(lower[worst].T, vectors[worst, :, 0])
    moved = cosine * (np.cos(t * out) - np.cos(t * theta)) + sine * (np.sin(t * out) - np.sin(t * theta))
    # batches of interleaved angles
    parts = (0.5 * moved**2).reshape(-1, PARTS).mean(axis=0)
    return t, float(parts.mean()), float(parts.std(ddof=1) / np.sqrt(PARTS))


def _products(modulus: float | Floats, square: NDArray[np.complex128]) -> Floats:
    """Mean products of real and imaginary parts of z, from the means of |z|^2 and z^2; shape (frequencies, 2, 2)."""
    rows = (modulus + square.real, square.imag), (square.imag, modulus - square.real)
    return np.asarray(0.5 * np.moveaxis(np.array(rows), 2, 0))
