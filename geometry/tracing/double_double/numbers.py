"""Double-double numbers as a number type of compiled code: an unevaluated sum of two doubles, about 31 digits.

Loads numba. The operators take double-doubles and doubles mixed. A formula that uses only operators, `root`, `scaled`,
`cross`, `dot`, `where`, `like` and `rounded` serves both number types. The error-free transforms are those of Dekker
(1971) and Knuth. Sums and products follow Joldes, Muller & Popescu (2017), with relative errors of at most 3 u^2 for
the sum, 7 u^2 for the product and 15 u^2 for the quotient, u = 2^-53. No operation may be reassociated: never compile
this module with ``fastmath``.
"""

from __future__ import annotations

import math
import operator
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, make_attribute_wrapper, models, overload, register_model

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
# 1/n! for n = 0 .. _TERMS as double-doubles, correctly rounded.
_FACTORIALS = [Fraction(1, math.factorial(n)) for n in range(_TERMS + 1)]
_INVERSE_FACTORIALS = tuple((float(exact), float(exact - Fraction(float(exact)))) for exact in _FACTORIALS)
# Without wrappers and counts of references, which no operator needs, numba compiles an operator in half the time.
OPTIONS: Any = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
_compile = jit(linked=True, _nrt=False)


class DoubleDouble(types.Type):
    """numba's type of double-double numbers, with the attributes ``high`` and ``low``."""

    def __init__(self) -> None:
        super().__init__(name="DoubleDouble")


DOUBLE_DOUBLE = DoubleDouble()
make_attribute_wrapper(DoubleDouble, "high", "high")
make_attribute_wrapper(DoubleDouble, "low", "low")


@register_model(DoubleDouble)
class _Model(models.StructModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, [("high", types.float64), ("low", types.float64)])


@intrinsic
def double_double(typing, high, low):
    """Return the double-double high + low; the low part is at most half an ulp of the high part."""

    def make(context, builder, signature, parts):
        made = cgutils.create_struct_proxy(DOUBLE_DOUBLE)(context, builder)
        made.high, made.low = parts
        return made._getvalue()

    return DOUBLE_DOUBLE(types.float64, types.float64), make


@intrinsic
def extended(typing, x):
    """Return a number of either type as a double-double."""

    def make(context, builder, signature, parts):
        return extend(context, builder, x, parts[0])

    return DOUBLE_DOUBLE(x if x == DOUBLE_DOUBLE else types.float64), make


def extend(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Return a value of either type in compiled code as a double-double."""
    if kind == DOUBLE_DOUBLE:
        return value
    made = cgutils.create_struct_proxy(DOUBLE_DOUBLE)(context, builder)
    made.high, made.low = value, context.get_constant(types.float64, 0.0)
    return made._getvalue()


@_compile
def two_sum(a, b):
    """Return the exact sum of two doubles."""
    s = a + b
    t = s - a
    return double_double(s, (a - (s - t)) + (b - t))


@_compile
def quick_two_sum(a, b):
    """Return the exact sum of two doubles, if the exponent of a is at least that of b."""
    s = a + b
    return double_double(s, b - (s - a))


@_compile
def two_product(a, b):
    """Return the exact product of two doubles (Dekker; no overflow below 1e300)."""
    p = a * b
    t = _SPLITTER * a
    a_high = t - (t - a)
    a_low = a - a_high
    t = _SPLITTER * b
    b_high = t - (t - b)
    b_low = b - b_high
    return double_double(p, ((a_high * b_high - p) + a_high * b_low + a_low * b_high) + a_low * b_low)


@_compile
def add(a, b):
    s, t = two_sum(a.high, b.high), two_sum(a.low, b.low)
    s = quick_two_sum(s.high, s.low + t.high)
    return quick_two_sum(s.high, s.low + t.low)


@_compile
def subtract(a, b):
    return add(a, -b)


@_compile
def multiply(a, b):
    p = two_product(a.high, b.high)
    return quick_two_sum(p.high, p.low + (a.high * b.low + a.low * b.high))


@_compile
def divide(a, b):
    """Return a / b by long division with three partial quotients."""
    q1 = a.high / b.high
    rest = a - b * q1
    q2 = rest.high / b.high
    rest = rest - b * q2
    return quick_two_sum(q1, q2) + rest.high / b.high


@_compile
def square_root(a):
    """Return the square root of a by two Newton steps from the root in double precision; 0 if a <= 0."""
    if a.high <= 0.0:
        return extended(0.0)
    x = math.sqrt(a.high)
    first = quick_two_sum(x, (a - two_product(x, x)).high / (2.0 * x))
    # the second step corrects the first one, whose division is in double precision
    return first + (a - first * first).high / (2.0 * x)


def are_mixed(a: Any, b: Any) -> bool:
    """Return whether two types are that of double-doubles, or one of them and the other that of doubles."""
    return DOUBLE_DOUBLE in (a, b) and {a, b} <= {DOUBLE_DOUBLE, types.float64}


def _set_operator(symbol: Any, rule: Any) -> None:
    @overload(symbol, jit_options=OPTIONS)
    def typed(a, b):
        return (lambda a, b: rule(extended(a), extended(b))) if are_mixed(a, b) else None


def _set_comparison(symbol: Any) -> None:
    @_compile
    def compared(a, b):
        return symbol(a.low, b.low) if a.high == b.high else symbol(a.high, b.high)

    _set_operator(symbol, compared)


for _symbol, _rule in (
    (operator.add, add),
    (operator.sub, subtract),
    (operator.mul, multiply),
    (operator.truediv, divide),
):
    _set_operator(_symbol, _rule)
for _symbol in (operator.lt, operator.le, operator.gt, operator.ge, operator.eq):
    _set_comparison(_symbol)


@overload(operator.neg, jit_options=OPTIONS)
def _negative(a):
    return (lambda a: double_double(-a.high, -a.low)) if a == DOUBLE_DOUBLE else None


def root(x):
    """Return the square root of a number of either type."""


@overload(root, jit_options=OPTIONS)
def _root(x):
    return (lambda x: square_root(x)) if x == DOUBLE_DOUBLE else lambda x: math.sqrt(x)


def number_kind(x: Any) -> Any:
    """Return the type of a number in compiled code: that of double-doubles, or of doubles."""
    return x if x == DOUBLE_DOUBLE else types.float64


@intrinsic
def scaled(typing, factor, x):
    """-> number: a number of either type times a power of 2, exactly."""

    def make(context, builder, signature, values):
        power, number = values
        if x != DOUBLE_DOUBLE:
            return builder.fmul(power, number)
        for k in range(2):
            number = builder.insert_value(number, builder.fmul(power, builder.extract_value(number, k)), k)
        return number

    return number_kind(x)(types.float64, number_kind(x)), make


@intrinsic
def like(typing, x, value):
    """-> number: a double as a number of the type of x."""

    def make(context, builder, signature, values):
        return extend(context, builder, types.float64, values[1]) if x == DOUBLE_DOUBLE else values[1]

    return number_kind(x)(number_kind(x), types.float64), make


@intrinsic
def rounded(typing, x):
    """-> float: a number of either type as a double."""

    def make(context, builder, signature, values):
        return builder.extract_value(values[0], 0) if x == DOUBLE_DOUBLE else values[0]

    return types.float64(number_kind(x)), make


@intrinsic
def where(typing, condition, yes, no):
    """-> number: one of two numbers, a double-double if one of them is; both are computed, and there is no branch.

    A conditional expression is a branch at first. The compiler would join those of one condition, and then write to the
    columns of a wave with a mask, which is slow on many processors, or not vectorise at all.
    """
    if DOUBLE_DOUBLE not in (yes, no):
        return types.float64(types.boolean, types.float64, types.float64), lambda *given: given[1].select(*given[3])

    def select(context, builder, signature, values):
        return builder.select(values[0], *map(partial(extend, context, builder), (yes, no), values[1:]))

    return DOUBLE_DOUBLE(types.boolean, yes, no), select


@_compile
def cross(ax, ay, bx, by):
    return ax * by - ay * bx


@_compile
def dot(ax, ay, bx, by):
    return ax * bx + ay * by


@_compile
def sine_cosine(angle):
    """Return sine and cosine of a double 0 <= angle <= 4, with relative errors of a few EPS_DOUBLE_DOUBLE."""
    turns = math.floor(angle / _HALF_PI[0] + 0.5)
    # turns is at most 3; the products by the middle and last parts are exact or have errors below 2^-160
    whole = two_product(turns, _HALF_PI[0])
    x = extended(angle - whole.high) + -whole.low - two_product(turns, _HALF_PI[1]) - turns * _HALF_PI[2]
    square = x * x
    sine = double_double(_INVERSE_FACTORIALS[_TERMS - 1][0], _INVERSE_FACTORIALS[_TERMS - 1][1])
    cosine = double_double(_INVERSE_FACTORIALS[_TERMS][0], _INVERSE_FACTORIALS[_TERMS][1])
    n = _TERMS - 3
    while n > 0:
        sine = double_double(_INVERSE_FACTORIALS[n][0], _INVERSE_FACTORIALS[n][1]) - sine * square
        cosine = double_double(_INVERSE_FACTORIALS[n + 1][0], _INVERSE_FACTORIALS[n + 1][1]) - cosine * square
        n -= 2
    sine, cosine = sine * x, 1.0 - cosine * square
    if turns == 0.0:
        return sine, cosine
    if turns == 1.0:
        return cosine, -sine
    if turns == 2.0:
        return -sine, -cosine
    return -cosine, sine


@_compile
def direction_angle(x, y):
    """Return the angle in [-pi, pi] of the unit vector (x, y): the double-precision angle plus a correction."""
    angle = math.atan2(y.high, x.high)
    sine, cosine = sine_cosine(abs(angle))
    rest = cross(cosine, -sine if angle < 0.0 else sine, x, y)
    return two_sum(angle, rest.high)


@jit()
def crossings_modulo_two(double_height, theta):
    """Return d mod 2 for d = double_height |cot theta| < 2^53, with an error of at most about d 2^-100."""
    found = np.empty(theta.size)
    for k in range(theta.size):
        sine, cosine = sine_cosine(theta[k])
        pairs = 0.5 * double_height * (-cosine if cosine < 0.0 else cosine) / sine
        # the high part may be an integer with a negative low part
        whole = math.floor(pairs.high)
        if whole == pairs.high and pairs.low < 0.0:
            whole -= 1.0
        found[k] = min(max(2.0 * (pairs - whole).high, 0.0), 2.0)
    return found
