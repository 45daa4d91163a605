"""One rectangular crevice: the number d of widths that a ray crosses, and the probability of retroreflection."""

from __future__ import annotations

import math

import numpy as np

from ...core.checks import Floats, whole_number
from ..bases.measure import SINE

# d = 2 r |cot theta|, with r depth over width, has a relative error of about 2 eps in float64. Above the first limit
# d mod 2 needs double-double arithmetic, above the second multiple precision. Theta and r count as exact numbers.
LARGEST_PLAIN, LARGEST_DOUBLE_DOUBLE = 2.0**6, 2.0**48
# Guard bits beyond the bits of d itself.
MORE_BITS = 80
SPACING = float(np.spacing(np.pi))


def crossings_modulo_two(height_to_width: float, theta: Floats) -> Floats:
    """d mod 2 for d = 2 ``height_to_width`` |cot theta|, in [0, 2], with an error below 1e-13 for every float64 theta.

    Examples
    --------
    >>> rest = crossings_modulo_two(1.5, np.array([2.0**-30]))[0]    # d = 3 2^30 - 2^-30 + ...
    >>> float(2.0 - rest) == 2.0**-30
    True
    """
    theta = np.asarray(theta, dtype=np.float64)
    with np.errstate(over="ignore"):
        crossings = np.asarray(2.0 * height_to_width / np.abs(np.tan(theta)))
    # tan is finite at the float64 nearest to pi/2.
    rest = np.asarray(np.mod(np.where(crossings <= LARGEST_PLAIN, crossings, 0.0), 2.0))
    many = crossings > LARGEST_PLAIN
    if np.any(many):
        from ...geometry.tracing.double_double.crevice import crossings_modulo_two as in_double_double

        exceeding = many & (crossings > LARGEST_DOUBLE_DOUBLE)
        rest[many] = in_double_double(2.0 * height_to_width, theta[many])
        rest[exceeding] = [_in_many_digits(height_to_width, float(angle)) for angle in theta[exceeding]]
    return rest


def _in_many_digits(height_to_width: float, theta: float) -> float:
    import mpmath

    # d is below 2^(exponent of r - exponent of the sine + 2); the sine is at least the spacing near pi.
    bits = math.frexp(height_to_width)[1] - math.frexp(min(theta, SPACING))[1] + MORE_BITS
    with mpmath.workprec(max(bits, 0) + MORE_BITS):
        return float(mpmath.fmod(2 * mpmath.mpf(height_to_width) * abs(mpmath.cot(mpmath.mpf(theta))), 2))


def crevice_retro(height_to_width: float, theta: Floats) -> Floats:
    """The probability of retroreflection in a crevice: the distance from d to the nearest even number."""
    rest = crossings_modulo_two(height_to_width, theta)
    return np.asarray(np.minimum(rest, 2.0 - rest))


def crevice_breakpoints(height_to_width: float, limit: int) -> tuple[Floats, float]:
    """The angles where d is a whole number, about ``limit`` at most, and the measure of the angles beyond them."""
    last = max((whole_number("limit", limit, 0) - 1) // 2, 0)
    if last == 0:
        return np.empty(0), 1.0
    steep = np.arctan(2.0 * height_to_width / np.arange(last, 0, -1))
    breakpoints = np.concatenate([steep, [0.5 * np.pi], np.pi - steep[::-1]])
    return breakpoints, float(2.0 * SINE.cdf(steep[0]))
