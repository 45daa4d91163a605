"""The invariant measures of reflection: sin(theta) d theta for angles, sin(psi)^2 d psi for the roll angle.

No other file of the package multiplies by these weights.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, angles, check_memory, choice, finite_array, generator, shaped, whole_number
from ...core.errors import InputError

WeightName = Literal["sin", "sin2"]

# Below this width the closed form x - sin(x) loses more than one digit, and eight terms of its series lose none.
SERIES_WIDTH = 0.5
NEWTON_STEPS = 60
# Angles that rounding puts on an end of (0, pi) are moved to these values. With 1e-300, sin and cot stay finite.
SMALLEST_ANGLE = 1e-300
LARGEST_ANGLE = float(np.nextafter(np.pi, 0.0))


@dataclass(frozen=True)
class AngularMeasure:
    r"""A probability measure on (0, pi): ``"sin"`` is sin(theta)/2 d theta, ``"sin2"`` is (2/pi) sin(psi)^2 d psi.

    Source: Rudzis 2022, section 1.2.2 (sin theta dx d theta) and section 1.3.6 (Lambda^2).

    Examples
    --------
    >>> round(float(SINE.mass(0.0, np.pi / 2)), 15)
    0.5
    """

    name: WeightName

    # numpy would take a measure for an entry of an array
    __array_ufunc__ = None

    def density(self, angle: ArrayLike) -> Floats:
        """Density with respect to d angle, at angles in [0, pi]."""
        at = finite_array("angle", angle)
        if at.size and not 0.0 <= at.min() <= at.max() <= np.pi:
            angles("angle", at)
        sine = np.sin(at)
        return np.asarray(0.5 * sine if self.name == "sin" else (2.0 / np.pi) * sine * sine)

    def mass(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """Measure of the interval (low, high), without cancellation for short intervals and near 0."""
        low, high = finite_array("low", low), finite_array("high", high)
        if self.name == "sin":
            return np.asarray(np.sin(0.5 * (low + high)) * np.sin(0.5 * (high - low)))
        width = high - low
        # (width - cos(low + high) sin(width)) / pi, written as a sum of two terms that do not cancel
        return np.asarray((_minus_sine(width) + 2.0 * np.sin(0.5 * (low + high)) ** 2 * np.sin(width)) / np.pi)

    def cdf(self, angle: ArrayLike) -> Floats:
        """Measure of (0, angle)."""
        return self.mass(0.0, angle)

    def quantile(self, probability: ArrayLike) -> Floats:
        """The angle below which a fraction ``probability`` in [0, 1] of the measure lies."""
        fraction = finite_array("probability", probability)
        if np.any((fraction < 0.0) | (fraction > 1.0)):
            worst = fraction.flat[np.argmax(np.abs(fraction - 0.5))]
            raise InputError(f"probability: expected numbers in [0, 1], got {float(worst)!r}")
        if self.name == "sin":
            # arcsin of the smaller of p and 1 - p gives full relative accuracy at both ends of (0, pi)
            lower = 2.0 * np.arcsin(np.sqrt(np.minimum(fraction, 0.5)))
            upper = np.pi - 2.0 * np.arcsin(np.sqrt(np.minimum(1.0 - fraction, 0.5)))
            return np.where(fraction <= 0.5, lower, upper)
        half = np.minimum(fraction, 1.0 - fraction)
        angle = np.minimum(np.cbrt(1.5 * np.pi * half), 0.5 * np.pi)
        for _ in range(NEWTON_STEPS):
            slope = self.density(angle)
            step = np.divide(self.cdf(angle) - half, slope, out=np.zeros_like(angle), where=slope > 0)
            angle = np.clip(angle - step, 0.0, 0.5 * np.pi)
            if np.all(np.abs(step) <= 4e-16 * np.maximum(angle, 1e-300)):
                break
        return np.where(fraction <= 0.5, angle, np.pi - angle)

    def sample(self, size: int | tuple[int, ...], rng: Rng = None) -> Floats:
        """Draw angles from the measure."""
        shape = size if isinstance(size, tuple) else (size,)
        checked = tuple(whole_number("size", length, 0) for length in shape)
        check_memory("size", "the sample", math.prod(checked))
        # 1 - U lies in (0, 1], so the angle 0 does not occur; pi is clipped to the open interval.
        return np.asarray(np.clip(self.quantile(1.0 - generator(rng).random(checked)), SMALLEST_ANGLE, LARGEST_ANGLE))

    def quadrature(self, edges: ArrayLike, order: int) -> tuple[Floats, Floats]:
        """Gauss-Legendre nodes (angles) and weights, ``order`` of them between each two neighbouring edges.

        Returns flat arrays. The weights contain the density and sum to the measure of the whole interval.
        """
        angle, weight = gauss_rule(shaped("edges", edges, "n"), whole_number("order", order, 1))
        return angle, weight * self.density(angle)


@lru_cache(maxsize=64)
def _gauss_on_unit_interval(order: int) -> tuple[Floats, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(order)
    nodes.setflags(write=False)
    weights.setflags(write=False)
    return nodes, weights


def gauss_rule(edges: Floats, order: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre rule for d angle, ``order`` nodes between each two neighbouring edges; flat arrays.

    The nodes are clipped to the open interval (0, pi).

    Examples
    --------
    >>> angle, weight = gauss_rule(np.array([0.0, 1.0, 3.0]), 2)
    >>> angle.shape, round(float(weight @ angle), 12)
    ((4,), 4.5)
    """
    return gauss_on_intervals(edges[:-1], edges[1:], order)


def gauss_on_intervals(low: Floats, high: Floats, order: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre rule for d angle, ``order`` nodes on each interval (low[i], high[i]); flat arrays."""
    nodes, weights = _gauss_on_unit_interval(order)
    centre, half = 0.5 * (high + low), 0.5 * (high - low)
    angle = np.clip(centre[:, None] + half[:, None] * nodes, SMALLEST_ANGLE, LARGEST_ANGLE)
    return angle.ravel(), (half[:, None] * weights).ravel()


def measure_by_name(name: str) -> AngularMeasure:
    """Return the measure called ``"sin"`` or ``"sin2"``; raises InputError for any other name."""
    choice("weight", name, ("sin", "sin2"))
    return SINE if name == "sin" else SINE_SQUARED


def _minus_sine(width: Floats) -> Floats:
    square = width * width
    series = np.ones_like(square)
    for power in range(17, 3, -2):
        series = 1.0 - square / (power * (power - 1)) * series
    series *= width * square / 6.0
    return np.where(np.abs(width) < SERIES_WIDTH, series, width - np.sin(width))


SINE = AngularMeasure("sin")
SINE_SQUARED = AngularMeasure("sin2")
