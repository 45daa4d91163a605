"""Values and ranges of real expressions in ball arithmetic, with rigorous bounds on rounding errors.

An expression is defined at a point if it and all its parts are real there. As in sympy, 0**0 and x**0 are 1, and a root
of a negative number is not real. A power of a negative number is real only if its exponent is an integer.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import prod
from typing import Any

import sympy as sp
from flint import acb, arb, ctx, fmpq

# Bits that suffice for most constants, and bits at which a sign stays unknown.
FEW_BITS, MANY_BITS = 100, 2000
# Of an integral: cells on which its integrand is examined, evaluations, and the largest number of bits of its value.
CELLS, EVALUATIONS, INTEGRAL_BITS = 64, 2000, 256


class Undefined(Exception):
    """The expression is certainly not real: at the point, or anywhere in the box."""


class Unclear(Exception):
    """The value cannot be determined at this precision, or no rule for a function is known."""


class Constant(sp.Dummy):  # type: ignore[misc]
    """A symbol for one real number, which sympy treats as any symbol."""

    number: Any

    @classmethod
    def of(cls, number: Any, **sign: bool) -> Constant:
        """The symbol for a number of which no more than the sign, if given, is known."""
        found = cls("c", real=True, **sign)
        found.number = number
        return found

    @property
    def free_symbols(self) -> set[Any]:
        return set()


@dataclass(frozen=True)
class Value:
    """A ball that contains the value, and the exact value if it is a rational number times a power of pi."""

    ball: Any
    exact: Any = None

    @property
    def sign(self) -> int:
        """-1, 0 or 1; raises `Unclear` if the ball does not determine the sign."""
        if self.exact is not None:
            return int(sp.sign(self.exact))
        if self.ball > 0:
            return 1
        if self.ball < 0:
            return -1
        raise Unclear


def evaluate(expression: Any, point: Mapping[Any, Any], bits: int) -> Value:
    """Return the value of an expression in which every symbol is an exact number or a ball.

    Raises
    ------
    Undefined
        If the expression is certainly undefined at the point, or everywhere in the ball.
    Unclear
        If this cannot be determined, or a function is not known.
    """
    with ctx.workprec(bits):
        return _value(expression, {symbol: _given(number) for symbol, number in point.items()})


def interval(low: Any, high: Any, bits: int = 64) -> Any:
    """A ball that contains all numbers between two exact numbers, or all numbers if one is infinite."""
    if sp.oo in (low, -low, high, -high):
        return arb(0, float("inf"))
    with ctx.workprec(bits):
        ends = [_value(end, {}).ball for end in (low, high)]
        return ends[0].union(ends[1])


def sign_of(number: Any) -> int:
    """The sign of an exact number; raises `Unclear` if the number is not real or cannot be distinguished from 0."""
    if number.is_Rational or number in (sp.oo, -sp.oo):
        return int(sp.sign(number))
    try:
        with suppress(Unclear):
            return evaluate(number, {}, FEW_BITS).sign
        return evaluate(sp.expand(number, power_exp=False, power_base=False, log=False), {}, MANY_BITS).sign
    except Undefined as error:
        raise Unclear from error


def is_below(low: Any, high: Any, also_equal: bool = False) -> bool:
    """Whether one exact number, or infinity, is below another, or also if both are equal."""
    if -sp.oo in (low, -high):
        return True
    sign = sign_of(high - low)
    return sign > 0 or (also_equal and sign == 0)


def is_true(relation: Any, point: Mapping[Any, Any], bits: int) -> bool:
    """Whether a relation or a Boolean combination of relations holds; raises as `evaluate` does."""
    with ctx.workprec(bits):
        return _truth(relation, {symbol: _given(number) for symbol, number in point.items()})


def _given(number: Any) -> Value:
    return Value(number) if isinstance(number, arb) else _value(number, {})


def _exactly(number: Any) -> Value | None:
    """The exact value of a rational multiple of an integer power of pi, None for other sympy numbers."""
    if number.is_Rational:
        return Value(arb(fmpq(int(number.p), int(number.q))), number)
    fraction, rest = number.as_coeff_Mul(rational=True)
    base, power = rest.as_base_exp()
    if base is sp.pi and power.is_Integer:
        return Value(arb.pi() ** int(power) * fmpq(int(fraction.p), int(fraction.q)), number)
    return None


def _value(e: Any, point: Mapping[Any, Value]) -> Value:
    if e in point:
        return point[e]
    if isinstance(e, Constant):
        return _value(e.number, {})
    if e in _CONSTANTS:
        return Value(_CONSTANTS[e](), sp.pi if e is sp.pi else None)
    if e.is_Rational:
        found = _exactly(e)
        assert found is not None
        return found
    if e in (sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I):
        raise Undefined
    if isinstance(e, sp.Piecewise):
        for branch, condition in e.args:
            if _truth(condition, point):
                return _value(branch, point)
        raise Undefined
    if isinstance(e, sp.Integral):
        with ctx.workprec(min(ctx.prec, INTEGRAL_BITS)):
            return Value(_integral(e, point))
    if not (e.is_Add or e.is_Mul or e.is_Pow or e.func in _FUNCTIONS):
        raise Unclear
    parts = [_value(argument, point) for argument in e.args]
    exact = _exact_result(e.func, parts)
    if exact is not None:
        return exact
    balls = [part.ball for part in parts]
    if e.is_Add:
        result = sum(balls[1:], balls[0])
    elif e.is_Mul:
        result = balls[0]
        for ball in balls[1:]:
            result = result * ball
    elif e.is_Pow:
        result = _power(*parts)
    else:
        result = _FUNCTIONS[e.func](*parts)
    if isinstance(result, Value):
        return result
    if result.is_nan():
        raise Unclear
    return Value(result)


def _integral(e: Any, point: Mapping[Any, Value]) -> Any:
    """A ball that contains an integral over one symbol, if the integrand is certainly finite on the whole interval."""
    if len(e.limits) != 1 or len(e.limits[0]) != 3 or e.limits[0].has(sp.oo, -sp.oo):
        raise Unclear
    t, *ends = e.limits[0]
    low, high = (_value(end, point).ball for end in ends)
    for k in range(CELLS):
        cell = low + (high - low) * arb(k).union(k + 1) / CELLS
        if not _value(e.function, {**point, t: Value(cell)}).ball.is_finite():
            raise Unclear
    _around(e.function, t, acb(low), False, point)

    def values(z: Any, analytic: bool) -> Any:
        try:
            return _around(e.function, t, z, analytic, point)
        except (Undefined, Unclear):
            return acb("nan")

    found = acb.integral(values, low, high, eval_limit=EVALUATIONS).real
    return found if found.is_finite() else _unclear()


def _around(e: Any, t: Any, z: Any, analytic: bool, point: Mapping[Any, Value]) -> Any:
    """The values for t in a complex ball: not finite if ``analytic`` is asked for and a branch cut is near."""
    if e == t:
        return z
    if t not in e.free_symbols:
        return acb(_value(e, point).ball)
    parts = [_around(argument, t, z, analytic, point) for argument in e.args]
    if e.is_Add or e.is_Mul:
        return sum(parts, acb(0)) if e.is_Add else prod(parts, start=acb(1))
    if e.is_Pow:
        return parts[0] ** int(e.exp) if e.exp.is_Integer else parts[0].pow(parts[1], analytic=analytic)
    if e.func is sp.log:
        return parts[0].log(analytic=analytic)
    return getattr(parts[0], e.func.__name__)() if e.func.__name__ in _MEROMORPHIC else _unclear()


def _exact_result(function: Any, parts: list[Value]) -> Value | None:
    if any(part.exact is None for part in parts):
        if function is sp.Mul and any(part.exact == 0 for part in parts):
            return _exactly(sp.S.Zero)
        return None
    if function not in _EXACT and not all(part.exact.is_Rational and abs(part.exact) < LARGEST for part in parts):
        # sympy compares other numbers in floating point, and writes large factorials out
        return None
    if function is sp.Pow and not (parts[1].exact.is_Integer and abs(parts[1].exact) < 1000):
        # a power such as (1/3)**(10**9) is not written out
        if parts[0].exact not in (0, 1) and not (parts[1].exact.is_Rational and parts[1].exact.q < 7):
            return None
        if abs(parts[1].exact) > 1000:
            return None
    result = function(*(part.exact for part in parts))
    if result in (sp.zoo, sp.nan, sp.oo, -sp.oo) or result.is_real is False:
        raise Undefined
    return _exactly(result)


def _truth(relation: Any, point: Mapping[Any, Value]) -> bool:
    if relation in (sp.true, sp.false):
        return bool(relation)
    if isinstance(relation, sp.And):
        return all([_truth(part, point) for part in relation.args])
    if isinstance(relation, sp.Or):
        return any([_truth(part, point) for part in relation.args])
    if isinstance(relation, sp.Not):
        return not _truth(relation.args[0], point)
    if not isinstance(relation, sp.core.relational.Relational):
        raise Unclear
    left, right = (_value(side, point) for side in relation.args)
    exact = None if left.exact is None or right.exact is None else left.exact - right.exact
    sign = Value(left.ball - right.ball, exact).sign
    return bool(relation.func(sp.Integer(sign), 0))


def _power(base: Value, exponent: Value) -> Any:
    power = exponent.exact
    if power is not None and power.is_Integer:
        if power < 0 and base.ball.contains(0):
            raise Unclear
        return base.ball ** int(power)
    if base.exact == 0:
        if exponent.sign > 0:
            return _exactly(sp.S.Zero)
        raise Undefined
    if base.ball > 0:
        return (exponent.ball * base.ball.log()).exp() if power != sp.S.Half else base.ball.sqrt()
    if base.ball < 0:
        if (power is not None and power.is_Rational) or not exponent.ball.contains_integer():
            raise Undefined
        raise Unclear
    if base.ball >= 0 and exponent.ball > 0:
        # the range over [0, upper end]
        top = base.ball.upper()
        return arb(0).union((exponent.ball * top.log()).exp()) if power is not None else _unclear()
    return _unclear()


def _unclear(*_: Value) -> Any:
    raise Unclear


def _of_sine(name: str) -> Any:
    """The arcsine or the arccosine, real on [-1, 1]."""

    def image(x: Value) -> Any:
        if x.ball < -1 or x.ball > 1:
            raise Undefined
        return getattr(x.ball, name)() if -1 <= x.ball <= 1 else _unclear()

    return image


def _logarithm(x: Value) -> Any:
    if x.ball < 0:
        raise Undefined
    return x.ball.log() if x.ball > 0 else _unclear()


def _sign(x: Value) -> Any:
    return _exactly(sp.Integer(x.sign))


def _whole(name: str) -> Any:
    def image(x: Value) -> Any:
        number = getattr(x.ball, name)().unique_fmpz()
        return _unclear() if number is None else _exactly(sp.Integer(int(number)))

    return image


def _extreme(name: str) -> Any:
    def image(*values: Value) -> Any:
        result = values[0].ball
        for value in values[1:]:
            result = getattr(result, name)(value.ball)
        return result

    return image


def _by(name: str) -> Any:
    return lambda x: getattr(x.ball, name)()


# Functions of rational multiples of powers of pi whose exact values are taken from sympy.
_EXACT = (sp.Add, sp.Mul, sp.Pow, sp.sin, sp.cos, sp.tan, sp.cot, sp.sec, sp.csc, sp.Abs, sp.sign)
LARGEST = 10**4
_CONSTANTS: dict[Any, Any] = {
    sp.pi: arb.pi, sp.E: arb.const_e, sp.EulerGamma: arb.const_euler, sp.Catalan: arb.const_catalan,
    sp.GoldenRatio: lambda: (1 + arb(5).sqrt()) / 2,
}  # fmt: skip
_MEROMORPHIC = (
    "sin", "cos", "tan", "cot", "sec", "csc", "exp", "sinh", "cosh", "tanh", "coth", "sech", "csch", "erf", "erfc",
    "erfi", "gamma",
)  # fmt: skip
_FUNCTIONS: dict[Any, Any] = {
    **{getattr(sp, name): _by(name) for name in (*_MEROMORPHIC, "atan")},
    sp.log: _logarithm,
    sp.asin: _of_sine("asin"),
    sp.acos: _of_sine("acos"),
    sp.Abs: lambda x: abs(x.ball),
    sp.Max: _extreme("max"),
    sp.Min: _extreme("min"),
    sp.sign: _sign,
    sp.floor: _whole("floor"),
    sp.ceiling: _whole("ceil"),
}  # fmt: skip
