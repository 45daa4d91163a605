"""Exact derivations of equalities: by a normal form, by squares, or because a difference is constant.

Imported only by functions, because it imports sympy.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from .domain import SIMPLE, Domain
from .normal_form import Parameters, vanishes

# Functions that are continuous wherever they are defined, and analytic inside.
_TRIGONOMETRIC = (sp.sin, sp.cos, sp.tan, sp.cot, sp.sec, sp.csc, sp.asin, sp.acos, sp.atan)
_SMOOTH = (*_TRIGONOMETRIC, sp.exp, sp.log, sp.sinh, sp.cosh, sp.tanh)
_CONTINUOUS = {*_SMOOTH, sp.Abs, sp.Max, sp.Min}
PLACES = (*(sp.pi * sp.Rational(p, q) for p, q in ((1, 2), (1, 3), (1, 4), (1, 6), (2, 3))), 0, *SIMPLE[:3], -sp.pi / 4)


def derive_equality(left: Any, right: Any, domain: Domain) -> str | None:
    """Name the route by which left = right was derived on the whole of the domain's intervals, or return None.

    The conditions that tie symbols together are not used: what is derived without them holds with them.
    """
    if sp.expand(left - right) == 0:
        return "expansion"
    if domain.closed and not _is_made_of_continuous_functions(left - right):
        # the parameters leave out the ends, and at a jump nothing follows for them
        return None
    parameters = Parameters(domain, half_angles=True)
    if vanishes(left - right, Parameters(domain, half_angles=False)) or vanishes(left - right, parameters):
        return "polynomial normal form"
    if all(parameters.factored(side).is_nonnegative for side in (left, right)) and vanishes(
        left**2 - right**2, parameters
    ):
        return "neither side is negative, and the polynomial normal forms of the squares agree"
    if _is_constant(left - right, parameters) and any(
        vanishes((left - right).subs(place), parameters) for place in _places(domain)
    ):
        return "the derivatives of the difference vanish on a connected domain, and so does it at one point"
    return None


def _is_made_of_continuous_functions(e: Any) -> bool:
    # roots and logarithms jump only in the complex plane
    return _CONTINUOUS.issuperset(f.func for f in e.atoms(sp.Function)) and not e.has(sp.I)


def _is_constant(difference: Any, parameters: Parameters) -> bool:
    if not _is_continuous(difference, parameters):
        return False
    return all(vanishes(sp.diff(difference, symbol), parameters) for symbol in difference.free_symbols)


def _is_continuous(e: Any, parameters: Parameters) -> bool:
    """Whether an expression is shown to be defined and continuous on the whole domain, and analytic inside."""
    if not all(_is_continuous(part, parameters) for part in e.args):
        return False
    if e.is_Function and e.func not in _SMOOTH:
        return False
    if e.func in (sp.asin, sp.acos):
        return bool(parameters.factored(1 - e.args[0] ** 2).is_nonnegative)
    if e.func is sp.log:
        return bool(parameters.factored(e.args[0]).is_positive)
    if e.func in (sp.tan, sp.sec):
        return bool(parameters.factored(sp.cos(e.args[0])).is_nonzero)
    if e.func in (sp.cot, sp.csc):
        return bool(parameters.factored(sp.sin(e.args[0])).is_nonzero)
    if e.is_Pow:
        base = parameters.factored(e.base)
        if e.exp.is_Integer:
            return bool(e.exp > 0 or base.is_nonzero)
        return bool(e.exp.is_Rational and (base.is_positive or (e.exp > 0 and base.is_nonnegative)))
    return bool(e.is_Add or e.is_Mul or e.is_Function or e.is_Symbol or e.is_number)


def _places(domain: Domain) -> list[dict[Any, Any]]:
    """Points inside, at which inverse functions have known values."""
    inside = {s: [p for p in PLACES if bool(low < p) and bool(p < high)] for s, (low, high) in domain.intervals.items()}
    depth = min((len(values) for values in inside.values()), default=0)
    return [{symbol: values[index] for symbol, values in inside.items()} for index in range(depth)]
