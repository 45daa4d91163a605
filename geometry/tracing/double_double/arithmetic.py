"""Compiled double-double arithmetic: a number is an unevaluated sum (high, low) of two doubles, about 31 digits.

Loads numba. The error-free transforms are those of Dekker (1971) and Knuth. Sums and products follow Joldes, Muller &
Popescu (2017), with relative errors of at most 3 u^2 for the sum, 7 u^2 for the product and 15 u^2 for the quotient,
u = 2^-53. No operation may be reassociated: never compile this module with ``fastmath``.
"""

from __future__ import annotations

import math

from ....core.compilation import jit

# Bound on the relative error of one operation: 15 u^2 < 2^-102.
EPS_DOUBLE_DOUBLE = 2.0**-102
# Error of one bounce relative to the cell's size: fewer than 64 consecutive operations on each coordinate.
LOCAL_ERROR = 64.0 * EPS_DOUBLE_DOUBLE
# 2^27 + 1 splits a double into two halves of 26 bits (Dekker).
_SPLITTER = 134217729.0
# pi/2 as the sum of three doubles; angles up to 4 are reduced with an error below 2^-160.
_HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
# Order of the series; for |x| <= pi/4 the first omitted term of either series is below 1e-34.
_TERMS = 28


def _inverse_factorials() -> tuple[tuple[float, float], ...]:
    """Return 1/n! for n = 0 .. _TERMS as double-doubles, correctly rounded."""
    from fractions import Fraction

    rows = []
    for n in range(_TERMS + 1):
        exact = Fraction(1, math.factorial(n))
        high = float(exact)
        rows.append((high, float(exact - Fraction(high))))
    return tuple(rows)


_INVERSE_FACTORIALS = _inverse_factorials()

_compile = jit(linked=True, _nrt=False)


@_compile
def two_sum(a, b):
    """Return a + b exactly, as a double and its rounding error."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@_compile
def quick_two_sum(a, b):
    """Return a + b exactly, if the exponent of a is at least that of b."""
    s = a + b
    return s, b - (s - a)


@_compile
def two_product(a, b):
    """Return a b exactly, as a double and its rounding error (Dekker; no overflow below 1e300)."""
    p = a * b
    t = _SPLITTER * a
    a_high = t - (t - a)
    a_low = a - a_high
    t = _SPLITTER * b
    b_high = t - (t - b)
    b_low = b - b_high
    return p, ((a_high * b_high - p) + a_high * b_low + a_low * b_high) + a_low * b_low


@_compile
def wide(a):
    """Return a double as a double-double."""
    return a, 0.0


@_compile
def add(a, b):
    s, e = two_sum(a[0], b[0])
    t, f = two_sum(a[1], b[1])
    s, e = quick_two_sum(s, e + t)
    return quick_two_sum(s, e + f)


@_compile
def negate(a):
    return -a[0], -a[1]


@_compile
def subtract(a, b):
    return add(a, (-b[0], -b[1]))


@_compile
def multiply(a, b):
    p, e = two_product(a[0], b[0])
    return quick_two_sum(p, e + (a[0] * b[1] + a[1] * b[0]))


@_compile
def divide(a, b):
    """Return a / b by long division with three partial quotients."""
    q1 = a[0] / b[0]
    r = subtract(a, multiply(b, (q1, 0.0)))
    q2 = r[0] / b[0]
    r = subtract(r, multiply(b, (q2, 0.0)))
    q3 = r[0] / b[0]
    s, e = quick_two_sum(q1, q2)
    return add((s, e), (q3, 0.0))


@_compile
def square_root(a):
    """Return the square root of a by two Newton steps from the root in double precision; 0 if a <= 0."""
    if a[0] <= 0.0:
        return 0.0, 0.0
    x = math.sqrt(a[0])
    p, e = two_product(x, x)
    rest = subtract(a, (p, e))
    s, e = quick_two_sum(x, rest[0] / (2.0 * x))
    # the second step corrects the first one, whose division is in double precision
    rest = subtract(a, multiply((s, e), (s, e)))
    return add((s, e), (rest[0] / (2.0 * x), 0.0))


@_compile
def cross(ax, ay, bx, by):
    return subtract(multiply(ax, by), multiply(ay, bx))


@_compile
def dot(ax, ay, bx, by):
    return add(multiply(ax, bx), multiply(ay, by))


@_compile
def sine_cosine(angle):
    """Return sine and cosine of a double 0 <= angle <= 4, with relative errors of a few EPS_DOUBLE_DOUBLE."""
    turns = math.floor(angle / _HALF_PI[0] + 0.5)
    # turns is at most 3; the products by the middle and last parts are exact or have errors below 2^-160
    high, error = two_product(turns, _HALF_PI[0])
    x = add((angle - high, 0.0), (-error, 0.0))
    x = subtract(x, two_product(turns, _HALF_PI[1]))
    x = subtract(x, (turns * _HALF_PI[2], 0.0))
    square = multiply(x, x)
    sine = _INVERSE_FACTORIALS[_TERMS - 1]
    cosine = _INVERSE_FACTORIALS[_TERMS]
    n = _TERMS - 3
    while n > 0:
        sine = subtract(_INVERSE_FACTORIALS[n], multiply(sine, square))
        cosine = subtract(_INVERSE_FACTORIALS[n + 1], multiply(cosine, square))
        n -= 2
    sine = multiply(sine, x)
    cosine = subtract((1.0, 0.0), multiply(cosine, square))
    if turns == 0.0:
        return sine, cosine
    if turns == 1.0:
        return cosine, negate(sine)
    if turns == 2.0:
        return negate(sine), negate(cosine)
    return negate(cosine), sine


@_compile
def direction_angle(x, y):
    """Return the angle in [-pi, pi] of the unit vector (x, y): the double-precision angle plus a correction."""
    angle = math.atan2(y[0], x[0])
    sine, cosine = sine_cosine(abs(angle))
    if angle < 0.0:
        sine = negate(sine)
    rest = cross(cosine, sine, x, y)
    return two_sum(angle, rest[0])
