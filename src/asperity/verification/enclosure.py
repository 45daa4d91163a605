"""Intervals that contain the value of an expression at a rational point.

Imported only by functions, because it imports sympy and mpmath.
"""

from __future__ import annotations

from typing import Any

import mpmath
import sympy as sp
from mpmath import iv

PRECISION = 200
# mpmath's inverse functions are accurate to an ulp or so; the ends are moved by many of them.
SLACK = 2.0 ** (16 - PRECISION)


def enclose(expression: Any, point: dict[Any, Any]) -> Any:
    """An interval around the value, or None where it is not real or a function is not known."""
    before, iv.prec = iv.prec, PRECISION
    try:
        with mpmath.workprec(PRECISION):
            return _interval(expression, point)
    except (_Unknown, ZeroDivisionError, ValueError):
        return None
    finally:
        iv.prec = before


class _Unknown(Exception):
    """The value is not known to be a finite real number."""


def _interval(e: Any, point: dict[Any, Any]) -> Any:
    if e.is_Symbol:
        return _interval(point[e], {})
    if e.is_Rational:
        return iv.mpf(int(e.p)) / iv.mpf(int(e.q))
    if e is sp.pi:
        return iv.pi
    if e is sp.E:
        return iv.e
    if not (e.is_Add or e.is_Mul or e.is_Pow or e.func in _FUNCTIONS):
        raise _Unknown
    parts = [_interval(argument, point) for argument in e.args]
    if e.is_Add:
        return sum(parts[1:], parts[0])
    if e.is_Mul:
        product = parts[0]
        for part in parts[1:]:
            product = product * part
        return product
    if e.is_Pow:
        return _power(parts[0], parts[1], e.exp)
    return _FUNCTIONS[e.func](*parts)


def _power(base: Any, exponent: Any, exact: Any) -> Any:
    if exact.is_Integer:
        if exact < 0 and base.a <= 0 <= base.b:
            raise _Unknown
        return base ** int(exact)
    if base.a < 0:
        raise _Unknown
    if exact == sp.Rational(1, 2):
        return iv.sqrt(base)
    if base.a <= 0:
        raise _Unknown
    return iv.exp(exponent * iv.log(base))


def _increasing(function: Any, low: float = -mpmath.inf, high: float = mpmath.inf) -> Any:
    def image(x: Any) -> Any:
        if x.a < low or x.b > high:
            raise _Unknown
        return iv.mpf([function(mpmath.mpf(x.a)) - SLACK, function(mpmath.mpf(x.b)) + SLACK])

    return image


def _arccos(x: Any) -> Any:
    return iv.pi / 2 - _increasing(mpmath.asin, -1, 1)(x)


def _whole(function: Any) -> Any:
    def image(x: Any) -> Any:
        low, high = function(mpmath.mpf(x.a)), function(mpmath.mpf(x.b))
        if low != high:
            raise _Unknown
        return iv.mpf(low)

    return image


def _sign(x: Any) -> Any:
    if x.a > 0:
        return iv.mpf(1)
    if x.b < 0:
        return iv.mpf(-1)
    raise _Unknown


def _logarithm(x: Any) -> Any:
    if x.a <= 0:
        raise _Unknown
    return iv.log(x)


_FUNCTIONS: dict[Any, Any] = {
    sp.sin: iv.sin,
    sp.cos: iv.cos,
    sp.tan: lambda x: iv.sin(x) / iv.cos(x),
    sp.cot: lambda x: iv.cos(x) / iv.sin(x),
    sp.sec: lambda x: 1 / iv.cos(x),
    sp.csc: lambda x: 1 / iv.sin(x),
    sp.exp: iv.exp,
    sp.log: _logarithm,
    sp.sinh: lambda x: (iv.exp(x) - iv.exp(-x)) / 2,
    sp.cosh: lambda x: (iv.exp(x) + iv.exp(-x)) / 2,
    sp.tanh: lambda x: (iv.exp(2 * x) - 1) / (iv.exp(2 * x) + 1),
    sp.asin: _increasing(mpmath.asin, -1, 1),
    sp.acos: _arccos,
    sp.atan: _increasing(mpmath.atan),
    sp.Abs: abs,
    sp.sign: _sign,
    sp.floor: _whole(mpmath.floor),
    sp.ceiling: _whole(mpmath.ceil),
}
