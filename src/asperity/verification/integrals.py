"""Integrals by proved antiderivatives, evaluation of derivatives, and sines for imaginary exponents."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import sympy as sp

from ..core.errors import InputError
from .derivation import derive_equality
from .domain import Domain
from .polyhedron import Inequality
from .resolution import Nowhere, Resolution
from .signs import Part, is_continuous, is_infinite

# For expressions of these functions, sympy's derivative is undefined wherever the true derivative is.
_SMOOTH = {sp.sin, sp.cos, sp.tan, sp.cot, sp.exp, sp.sinh, sp.cosh, sp.tanh, sp.atan}
_ENTIRE = {sp.exp, sp.sin, sp.cos, sp.sinh, sp.cosh}


def prepared(e: Any, domain: Domain) -> Any:
    """Evaluate derivatives, integrals and fractional parts, as far as the result is proved.

    Raises
    ------
    InputError
        If the imaginary unit stands anywhere but in polynomials and exponential, trigonometric or hyperbolic functions.
    """
    e = e.replace(sp.frac, lambda x: x - sp.floor(x))
    # sympy would write 0**(-x) as a power of infinity, whatever the sign of x
    e = e.replace(lambda part: part.is_Pow and part.base == 0, lambda part: _power_of_zero(part.exp))
    e = e.replace(lambda part: part.is_Pow and part.base is sp.zoo, lambda part: _power_of_zero(-part.exp))
    e = e.replace(sp.Mod, lambda x, y: x - y * sp.floor(x / y))
    e = e.replace(lambda part: isinstance(part, sp.Derivative), _derivative)
    e = e.replace(lambda part: isinstance(part, sp.Integral), lambda part: _integral(part, domain))
    if e.has(sp.I):
        functions = {f.func for f in e.atoms(sp.Function) if f.has(sp.I)}
        real = sp.expand(e, complex=True) if functions <= _ENTIRE else e
        if real.has(sp.I, sp.re, sp.im):
            raise InputError(f"{e}: expected a real expression, got one with the imaginary unit")
        e = real
    return e


def _power_of_zero(exponent: Any) -> Any:
    return sp.Piecewise((sp.Integer(0), exponent > 0), (sp.Integer(1), sp.Eq(exponent, 0)), evaluate=False)


def _derivative(e: Any) -> Any:
    functions = {f.func for f in e.expr.atoms(sp.Function)}
    rational = all(power.exp.is_Integer for power in e.expr.atoms(sp.Pow))
    return e.doit() if functions <= _SMOOTH and rational else e


def _integral(e: Any, domain: Domain) -> Any:
    if e.function.has(sp.Integral) or any(len(limits) != 3 for limits in e.limits):
        return e
    integrand, (variable, low, high) = e.function, e.limits[0]
    found = _definite(integrand, variable, low, high, domain)
    if found is None:
        return e
    return found if len(e.limits) == 1 else prepared(sp.Integral(found, *e.limits[1:]), domain)


def _definite(integrand: Any, variable: Any, low: Any, high: Any, domain: Domain) -> Any:
    """The difference of an antiderivative that is proved between the ends and continuous up to them, else None."""
    t = sp.Dummy(str(variable), real=True)
    f = integrand.xreplace({variable: t})
    if f.is_number:
        return f * (high - low) if low.is_finite is not False and high.is_finite is not False else None
    ends = [low, high]
    bounds: list[Inequality] | None
    if all(not end.free_symbols for end in ends):
        reverse = bool(low > high)
        first, last = ends[::-1] if reverse else ends
        bounds = [Inequality({t: sp.Integer(sign)}, -sign * end, True) for sign, end in ((1, first), (-1, last))
                  if end.is_finite]  # fmt: skip
    else:
        bounds = _between(t, low, high, domain)
    cells = domain.cells()
    if bounds is None or cells is None:
        return None
    antiderivative = sp.integrate(f, t)
    if antiderivative.has(sp.Integral, sp.I) or is_infinite(antiderivative):
        return None
    for cell in cells:
        if not all(bound.expression.free_symbols <= {t, *cell.symbols} for bound in bounds):
            bounds_here = [Inequality.of(b.expression.xreplace(dict(cell.values)), True) for b in bounds]
        else:
            bounds_here = list(bounds)
        if None in bounds_here:
            return None
        inside = replace(
            cell, symbols=(*cell.symbols, t), inequalities=(*cell.inequalities, *filter(None, bounds_here))
        )
        values = dict(cell.values)
        if inside.polyhedron.is_empty:
            # an empty interval: the integral is 0, and the difference must be 0 too
            at_end = antiderivative.xreplace({t: low}).xreplace(values)
            if is_infinite(at_end) or not is_continuous(at_end, Part(cell)):
                return None
            continue
        part = Part(inside)
        here, derivative = antiderivative.xreplace(values), sp.diff(antiderivative, t).xreplace(values)
        try:
            resolution = Resolution(part)
            here = resolution.resolved(here)
            equal = derive_equality(resolution.resolved(f.xreplace(values)), resolution.resolved(derivative), part)
        except Nowhere:
            return None
        if equal is None or not is_continuous(here, part):
            return None
        for end in ends:
            if end.is_finite is not False and not is_continuous(here, part, (t, end.xreplace(values), cell)):
                return None
    at_ends = [
        antiderivative.xreplace({t: end}) if end.is_infinite is not True
        else sp.limit(antiderivative, t, end, "-" if end is sp.oo else "+")
        for end in ends
    ]  # fmt: skip
    value = at_ends[1] - at_ends[0]
    return None if value.has(sp.Limit) or is_infinite(value) else value


def _between(t: Any, low: Any, high: Any, domain: Domain) -> list[Inequality] | None:
    """Bounds of an interval that contains all numbers between two ends."""
    above, below = Inequality.of(t - low, True), Inequality.of(high - t, True)
    if above is None or (below is None and high is not sp.oo):
        return None
    if below is None:
        return [above]
    for first, last in ((low, high), (high, low)):
        order = Inequality.of(last - first, False)
        if order is not None and domain.polyhedron.implies(order):
            return [Inequality.of(t - first, True), Inequality.of(last - t, True)]  # type: ignore[list-item]
    # either end may come first, so only bounds common to both orders are used
    bounds = []
    for sign in (1, -1):
        for bound in {sp.S.Zero, *(end for s in domain.symbols for end in domain.interval(s)[:2] if end.is_finite)}:
            beyond = [Inequality.of(sign * (end - bound), True) for end in (low, high)]
            if all(one is not None and domain.polyhedron.implies(one) for one in beyond):
                bounds.append(Inequality({t: sp.Integer(sign)}, -sign * bound, True))
    return bounds
