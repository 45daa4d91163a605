"""Integrals by proved antiderivatives, evaluation of derivatives, and sines for imaginary exponents."""

from __future__ import annotations

from typing import Any

import sympy as sp

from ..core.errors import InputError
from .balls import Unclear, Undefined, evaluate, interval
from .constants import spelled, visible
from .derivation import derive_equality
from .domain import Domain
from .polyhedron import Inequality, is_below
from .resolution import Nowhere, Resolution, is_infinite
from .signs import Part

# What is to be evaluated or cannot be transformed.
UNFINISHED = (sp.Integral, sp.Derivative, sp.Sum, sp.Product, sp.Limit, sp.Subs)
# For expressions of these functions, sympy's derivative is undefined wherever the true derivative is.
_SMOOTH = {sp.sin, sp.cos, sp.tan, sp.cot, sp.exp, sp.sinh, sp.cosh, sp.tanh, sp.atan}
_ENTIRE = {sp.exp, sp.sin, sp.cos, sp.sinh, sp.cosh}
BITS = 128


def prepared(e: Any) -> Any:
    """The expression with constants as symbols, without derivatives, integrals and the imaginary unit.

    Raises
    ------
    Unclear
        If a derivative or an integral remains.
    InputError
        If the imaginary unit stands anywhere but in polynomials and exponential, trigonometric or hyperbolic functions.
    """
    e = visible(e).replace(sp.Mod, lambda x, y: x - y * sp.floor(x / y))
    e = e.replace(lambda part: isinstance(part, sp.Derivative), _derivative)
    e = e.replace(lambda part: isinstance(part, sp.Integral), _integral)
    if e.has(*UNFINISHED):
        raise Unclear
    if e.has(sp.I):
        functions = {f.func for f in e.atoms(sp.Function) if f.has(sp.I)}
        real = sp.expand(e, complex=True) if functions <= _ENTIRE else e
        if real.has(sp.I, sp.re, sp.im):
            raise InputError(f"{spelled(e)}: expected a real expression, got one with the imaginary unit")
        e = real
    return e


def _derivative(e: Any) -> Any:
    functions = {f.func for f in e.expr.atoms(sp.Function)}
    rational = all(power.exp.is_Integer for power in e.expr.atoms(sp.Pow))
    return e.doit() if functions <= _SMOOTH and rational else e


def _integral(e: Any) -> Any:
    if e.function.has(*UNFINISHED) or any(len(limits) != 3 for limits in e.limits):
        return e
    variable, low, high = e.limits[0]
    found = _definite(e.function, variable, low, high)
    if found is None:
        return e
    return found if len(e.limits) == 1 else _integral(sp.Integral(found, *e.limits[1:]))


def _definite(integrand: Any, variable: Any, low: Any, high: Any) -> Any:
    """The difference of an antiderivative that is proved between the ends and continuous up to them, else None."""
    t = sp.Dummy(str(variable), real=True)
    f = integrand.xreplace({variable: t})
    ends = [low, high]
    bounds: list[Inequality] = []
    if not low.free_symbols and not high.free_symbols:
        if low == high:
            return sp.S.Zero
        ends = ends if is_below(low, high) else ends[::-1]
        bounds = [Inequality({t: sp.Integer(sign)}, -sign * end, True) for sign, end in zip((1, -1), ends, strict=True)
                  if end not in (sp.oo, -sp.oo)]  # fmt: skip
    antiderivative = f * t if not f.has(t) else visible(sp.integrate(f, t))
    if antiderivative.has(*UNFINISHED, sp.I) or is_infinite(antiderivative):
        return None
    others = sorted((f.free_symbols | antiderivative.free_symbols) - {t}, key=str)
    part = Part(Domain((t, *others), tuple(bounds)))
    try:
        first, second = (Resolution(part).resolved(side) for side in (f, visible(sp.diff(antiderivative, t))))
    except Nowhere:
        return None
    if not _is_continuous(antiderivative, part, bounds) or derive_equality(first, second, part) is None:
        return None
    at_ends = [
        sp.limit(antiderivative, t, end) if end in (sp.oo, -sp.oo) else visible(antiderivative, {t: end})
        for end in (low, high)
    ]
    value = at_ends[1] - at_ends[0]
    return None if value.has(sp.Limit) or is_infinite(value) else value


def _is_continuous(e: Any, part: Part, bounds: list[Inequality]) -> bool:
    """Whether e is continuous on the interval and up to its ends: everywhere, or because balls of it are finite."""
    functions = {f.func for f in e.atoms(sp.Function)}
    powers = e.atoms(sp.Pow)
    bases = [power.base for power in powers if not power.exp.is_Integer]
    bases += [1 - f.args[0] ** 2 for f in e.atoms(sp.asin, sp.acos)]
    if functions <= _ENTIRE | {sp.atan, sp.asin, sp.acos} and all(p.exp.is_Rational and p.exp > 0 for p in powers):
        return all(part.is_nonnegative(base) for base in bases)
    if len(bounds) < 2 or e.has(sp.Piecewise) or not functions <= _SMOOTH | {sp.log, sp.asinh}:
        return False
    t = part.domain.symbols[0]
    try:
        return bool(evaluate(e, {t: interval(*part.domain.interval(t)[:2], BITS)}, BITS).ball.is_finite())
    except (Undefined, Unclear):
        return False
