"""All zeros and poles of a function of one symbol in an interval, exactly, if its form is simple enough."""

from __future__ import annotations

from typing import Any

import sympy as sp
from flint import ctx

from .balls import Unclear, Undefined, evaluate, interval
from .polyhedron import sign_of

# Domains are not divided at more zeros than MOST.
MOST = 60
LARGEST = 300


def zeros_in(e: Any, symbol: Any, low: Any, high: Any) -> list[Any] | None:
    """The points of the open interval at which e is 0 or infinite, ascending; None if they are not known.

    They are not known for an expression that is 0 everywhere.
    """
    if not e.has(symbol):
        return [] if e.is_zero is False or (e.is_number and _differs_from_zero(e)) else None
    try:
        points = _points(e, symbol, low, high)
        if points is None or len(points) > MOST:
            return None
        inside = [point for point in points if sign_of(point - low) > 0 and sign_of(high - point) > 0]
    except (Undefined, Unclear):
        return None
    return sorted(inside, key=lambda point: sp.N(point, 50))


def _points(e: Any, symbol: Any, low: Any, high: Any) -> set[Any] | None:
    """A set that contains all zeros and poles, and possibly other points, some outside the interval."""
    if sp.count_ops(e) > LARGEST:
        return None
    points: set[Any] = set()
    numerator, denominator = sp.together(e).as_numer_denom()
    for factor in (*sp.Mul.make_args(sp.factor(numerator)), *sp.Mul.make_args(sp.factor(denominator))):
        base, exponent = factor.as_base_exp()
        if exponent.has(symbol) and not base.is_positive:
            # not continuous
            return None
        found = _of_factor(base, symbol, low, high)
        if found is None:
            return None
        points.update(found)
    return points


def _differs_from_zero(number: Any) -> bool:
    try:
        return sign_of(number) != 0
    except (Undefined, Unclear):
        return False


def _of_factor(e: Any, symbol: Any, low: Any, high: Any) -> list[Any] | None:
    if not e.has(symbol):
        return [] if _differs_from_zero(e) else None
    if e.is_polynomial(symbol):
        return _of_polynomial(e, symbol)
    atoms = [f for f in e.atoms(sp.Function) | {p for p in e.atoms(sp.Pow) if not p.exp.is_Integer} if f.has(symbol)]
    outer = [f for f in atoms if not any(f != g and g.has(f) for g in atoms)]
    if len(outer) == 2:
        return _of_sine_and_cosine(e, outer, symbol, low, high)
    if len(outer) != 1:
        return None
    function = outer[0]
    stand_in = sp.Dummy()
    polynomial = e.xreplace({function: stand_in})
    if polynomial.has(symbol) or not polynomial.is_polynomial(stand_in):
        return None
    levels = _of_polynomial(polynomial, stand_in)
    if levels is None:
        return None
    found: list[Any] = []
    for level in levels:
        points = _where(function, level, symbol, low, high)
        if points is None:
            return None
        found += points
    return found


def _of_polynomial(e: Any, symbol: Any) -> list[Any] | None:
    polynomial = sp.Poly(e, symbol)
    if polynomial.degree() < 1 or not _differs_from_zero(polynomial.LC()):
        return None
    if polynomial.degree() == 1:
        a, b = polynomial.all_coeffs()
        return [sp.together(-b / a)]
    if polynomial.domain.is_ZZ or polynomial.domain.is_QQ:
        roots = sp.real_roots(polynomial, multiple=True)
        return None if any(root.has(sp.CRootOf) for root in roots) else list(dict.fromkeys(roots))
    if polynomial.degree() != 2:
        return None
    a, b, c = polynomial.all_coeffs()
    discriminant = sp.expand(b**2 - 4 * a * c)
    try:
        sign = sign_of(discriminant)
    except (Undefined, Unclear):
        return None
    return [] if sign < 0 else [(-b + s * sp.sqrt(discriminant)) / (2 * a) for s in (1, -1)]


def _where(function: Any, level: Any, symbol: Any, low: Any, high: Any) -> list[Any] | None:
    """The points at which a function of an inner expression takes a value."""
    inner = function.args[0]
    solutions: list[Any] | None
    try:
        if function.func in (sp.sin, sp.cos):
            if sign_of(1 - level**2) < 0:
                return []
            if function.func is sp.sin:
                solutions = _periodic([sp.asin(level), sp.pi - sp.asin(level)], 2 * sp.pi, inner, symbol, low, high)
            else:
                solutions = _periodic([sp.acos(level), -sp.acos(level)], 2 * sp.pi, inner, symbol, low, high)
        elif function.func in (sp.tan, sp.cot):
            # includes the poles
            base = sp.atan(level) if function.func is sp.tan else sp.pi / 2 - sp.atan(level)
            pole = sp.pi / 2 if function.func is sp.tan else 0
            solutions = _periodic([base, pole], sp.pi, inner, symbol, low, high)
        elif function.func is sp.exp:
            solutions = [sp.log(level)] if sign_of(level) > 0 else []
        elif function.func is sp.log:
            # includes the end of its domain
            solutions = [sp.exp(level), sp.S.Zero]
        elif function.func is sp.Abs:
            solutions = [level, -level] if sign_of(level) >= 0 else []
        elif function.is_Pow and function.exp.is_Rational:
            inner = function.base
            solutions = [sp.S.Zero] + ([level ** (1 / function.exp)] if sign_of(level) > 0 else [])
        else:
            return None
    except (Undefined, Unclear):
        return None
    if solutions is None:
        return None
    found: list[Any] = []
    for solution in solutions:
        points = _points(inner - solution, symbol, low, high)
        if points is None:
            return None
        found += points
    return found


def _periodic(bases: list[Any], period: Any, inner: Any, symbol: Any, low: Any, high: Any) -> list[Any] | None:
    if low.is_infinite or high.is_infinite:
        return None
    try:
        reach = evaluate(inner, {symbol: interval(low, high)}, 64).ball
    except (Undefined, Unclear):
        return None
    with ctx.workprec(64):
        first, last = float(reach.lower()), float(reach.upper())
    step = float(period)
    if not (last - first) / step < MOST:
        return None
    return [
        base + k * period
        for base in dict.fromkeys(bases)
        for k in range(int((first - float(base)) // step) - 1, int((last - float(base)) // step) + 2)
    ]


def _of_sine_and_cosine(e: Any, pair: list[Any], symbol: Any, low: Any, high: Any) -> list[Any] | None:
    """Zeros of a sin v + b cos v, from tan v = -b/a."""
    by_function = {f.func: f for f in pair}
    if set(by_function) != {sp.sin, sp.cos}:
        return None
    sine, cosine = by_function[sp.sin], by_function[sp.cos]
    if sine.args != cosine.args:
        return None
    s, c = sp.Dummy(), sp.Dummy()
    flat = sp.expand(e.xreplace({sine: s, cosine: c}))
    a, b = flat.coeff(s), flat.coeff(c)
    if sp.expand(flat - a * s - b * c) != 0 or not (a.is_number and b.is_number and _differs_from_zero(a)):
        return None
    angles = _periodic([sp.atan(-b / a)], sp.pi, sine.args[0], symbol, low, high)
    if angles is None:
        return None
    found: list[Any] = []
    for angle in angles:
        points = _points(sine.args[0] - angle, symbol, low, high)
        if points is None:
            return None
        found += points
    return found
