"""Statements as they are written, and with constants as symbols whose signs are known from balls.

Sympy decides signs of constants wherever it evaluates, and some of its answers are wrong (its issue 29850). So a
statement is rebuilt without evaluation where it is searched for counterexamples. Where it is transformed, every
irrational constant is a symbol, about which sympy knows what balls show and nothing more.
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import sympy as sp

from .balls import Constant, Unclear, Undefined, evaluate

# Bits at which the sign of a constant is sought; beyond the last it stays unknown.
BITS = (64, 2000)
# Larger numbers are not factored.
LARGEST = 10**15
# The number 1 where a function of a rational number is meant: exp(3) is written exp(3 ONE).
ONE = Constant.of(sp.S.One, positive=True)


def unevaluated(function: Any, args: Any) -> Any:
    """The expression of these arguments, which sympy does not evaluate."""
    kinds = (sp.Add, sp.Mul, sp.Pow, sp.Function, sp.Max, sp.Min, sp.core.relational.Relational)
    return function(*args, evaluate=False) if issubclass(function, kinds) else function(*args)


class Pickler(pickle.Pickler):
    """Stores expressions as they are written: sympy's own pickles are evaluated when they are read."""

    def reducer_override(self, e: Any) -> Any:
        """An expression by its arguments, another object as usual."""
        return (unevaluated, (e.func, e.args)) if isinstance(e, sp.Basic) and e.args else NotImplemented


def written(e: Any, names: Mapping[Any, Any]) -> Any:
    """The expression with other symbols, exact numbers and functions by their definitions, else as it is written."""
    if e in names:
        return names[e]
    if e.is_Float:
        return sp.Rational(e)
    if not e.args:
        return e
    args = tuple(written(argument, names) for argument in e.args)
    if e.is_Pow and args[0] in (sp.S.Zero, sp.zoo):
        # sympy writes 0**(-x) as a power of infinity, whatever the sign of x
        return _power_of_zero(args[1] if args[0] == 0 else -args[1])
    if e.func in _DEFINITIONS:
        with sp.evaluate(False):
            return _DEFINITIONS[e.func](*args)
    return e if args == e.args else unevaluated(e.func, args)


def visible(e: Any, values: Mapping[Any, Any] | None = None) -> Any:
    """The expression, evaluated, with a symbol for each irrational constant; ``values`` replace symbols."""
    if values and e in values:
        return visible(values[e])
    if isinstance(e, Constant) or not e.args:
        if e.is_NumberSymbol and e is not sp.pi:
            return sp.exp(ONE) if e is sp.E else constant(e)
        return e
    return built(e.func, [visible(argument, values) for argument in e.args])


def spelled(e: Any) -> Any:
    """The expression with its constants in place of their symbols."""
    while found := e.atoms(Constant):
        e = e.xreplace({one: one.number for one in found})
    return e


def built(function: Any, args: Any) -> Any:
    """The expression of these arguments, in which constants are symbols."""
    if function is sp.Pow and args[0] in (sp.S.Zero, sp.zoo) and not args[1].is_Rational:
        return _power_of_zero(args[1] if args[0] == 0 else -args[1])
    if any(one.free_symbols or one.has(sp.I, sp.oo, sp.zoo, sp.nan) for one in args):
        return function(*args)
    if issubclass(function, sp.core.relational.Relational):
        return sp.sympify(_decided(unevaluated(function, args)), strict=True)
    if function is sp.Add:
        found = sp.Add(*args)
        if found.is_Add and found.is_number:
            # not a number for sympy, which would look for its sign
            return sp.Add(*(t if t.as_coeff_Mul(rational=True)[1] is sp.pi else t * ONE for t in found.args))
        return found
    if function is sp.Pow:
        return _power(*args)
    if function is sp.log and args[0].is_Rational and args[0] > 0 and max(args[0].p, args[0].q) < LARGEST:
        return sp.Add(*(k * constant(sp.log(p, evaluate=False)) for p, k in sp.factorrat(args[0]).items() if p > 1))
    if not issubclass(function, sp.Function | sp.Max | sp.Min) or function is sp.Piecewise:
        return function(*args)
    known = constant(unevaluated(function, args))
    if all(one.is_Rational or one.as_coeff_Mul(rational=True)[1] is sp.pi for one in args):
        exact = function(*args)
        if not exact.has(sp.Function) and not exact.has(sp.I, sp.zoo, sp.E):
            return visible(exact)
    found = function(*(one * ONE if one.is_Rational else one for one in args))
    return found if isinstance(known, Constant) and not found.is_number else known


def _power(base: Any, exponent: Any) -> Any:
    """The power of constants; of a rational number as the roots of primes."""
    if exponent.is_Integer or base == 1:
        return base**exponent
    if not exponent.is_Rational:
        found = base**exponent
        return constant(unevaluated(sp.Pow, (base, exponent))) if found.is_number else found
    if base.is_Rational and base > 0 and max(base.p, base.q) < LARGEST:
        roots = {p: _root(sp.Integer(p), int(exponent.q)) for p in sp.factorrat(base) if p > 1}
        return sp.Mul(*(roots[p] ** (k * exponent.p) for p, k in sp.factorrat(base).items() if p > 1))
    root = _root(base, int(exponent.q))
    return root if root is sp.nan else root**exponent.p


def _root(radicand: Any, index: int) -> Any:
    return constant(sp.Pow(radicand, sp.Rational(1, index), evaluate=False))


def _power_of_zero(exponent: Any) -> Any:
    positive, zero = (relation(exponent, 0, evaluate=False) for relation in (sp.Gt, sp.Eq))
    return sp.Piecewise((sp.Integer(0), positive), (sp.Integer(1), zero), evaluate=False)


@lru_cache(maxsize=1 << 14)
def constant(number: Any) -> Any:
    """The symbol for a constant, equal for equal constants; a rational multiple of a power of pi stays a number."""
    for bits in BITS:
        try:
            value = evaluate(number, {}, bits)
        except Undefined:
            return sp.nan
        except Unclear:
            continue
        if value.exact is not None:
            return value.exact
        if value.ball > 0:
            return Constant.of(number, positive=True)
        if value.ball < 0:
            return Constant.of(number, negative=True)
    return Constant.of(number)


def _decided(relation: Any) -> Any:
    """Whether a relation of constants is true, as a bool; the relation itself where it is not known."""
    try:
        return bool(relation.func(sp.Integer(evaluate(relation.lhs - relation.rhs, {}, BITS[-1]).sign), 0))
    except (Undefined, Unclear):
        return relation


def _direction(y: Any, x: Any) -> Any:
    quarter, ratio = sp.pi / 2, sp.atan(x / y)
    return sp.Piecewise((sp.atan(y / x), x > 0), (quarter - ratio, y > 0), (-quarter - ratio, y < 0), (sp.pi, x < 0))


# Functions that are replaced wherever they are written; what is on the right is defined at the same points.
_DEFINITIONS: dict[Any, Any] = {
    sp.frac: lambda x: x - sp.floor(x),
    sp.Mod: lambda x, y: x - y * sp.floor(x / y),
    sp.Heaviside: lambda x, at_zero: sp.Piecewise((0, x < 0), (at_zero, sp.Eq(x, 0)), (1, True)),
    sp.atan2: _direction,
    # sympy's arc cotangent jumps at 0, where its value is pi/2
    sp.acot: lambda x: sp.Piecewise((sp.pi / 2, sp.Eq(x, 0)), (sp.atan(1 / x), True)),
    sp.asec: lambda x: sp.acos(1 / x),
    sp.acsc: lambda x: sp.asin(1 / x),
    sp.asinh: lambda x: sp.log(x + sp.sqrt(x**2 + 1)),
    sp.acosh: lambda x: sp.log(x + sp.sqrt(x**2 - 1)),
    sp.atanh: lambda x: sp.log((1 + x) / (1 - x)) / 2,
}
