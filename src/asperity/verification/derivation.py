"""Verdicts on equalities and inequalities: a counterexample, or a proof on every part of the domain.

The domain is divided into its interior and its faces, and further where a linear expression is 0 at which a function
jumps, bends or ends. On each part both sides are resolved into smooth functions. An equality is proved by a normal
form, an inequality by the sign of the difference. A part on which one side is defined nowhere needs no proof.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from ..core.errors import InputError
from .balls import Unclear
from .claims import Claim
from .constants import visible, written
from .domain import Domain
from .normal_form import NOT_NEGATIVE, POSITIVE, vanishes
from .refutation import Search
from .resolution import Part, is_infinite
from .verdict import Verdict, every

# Points at which both sides are compared before a proof is sought: for an equality, and for an inequality.
POINTS = 24
MORE_POINTS = 60
# Points at which both sides are sought to be defined before they are refused.
MOST_POINTS = 600
# Parts that are tried, and points of every part at which a counterexample is sought.
PARTS = 60
FEW_POINTS = 3
# Not transformed, so that nothing about them is proved.
UNFINISHED = (sp.Integral, sp.Derivative, sp.Sum, sp.Product, sp.Limit, sp.Subs)

EXPANSION = "expansion"
NORMAL_FORM = "polynomial normal form"
SQUARES = "neither side is negative, and the polynomial normal forms of the squares agree"
SIGN = "the sign of the difference"
NOWHERE = "defined nowhere on the domain"
ANGLES = "the cosine of the difference is 1, and it is less than a turn"
FAILED = "sympy does not serve"


def decide(claims: list[Claim], relations: list[Any]) -> Verdict:
    """The verdict on claims under the same assumptions."""
    verdicts = []
    for claim in claims:
        try:
            verdicts.append(_decided(*claim, relations))
        except Unclear:
            verdicts.append(Verdict("undecided", "two numbers could not be told apart"))
        except InputError:
            raise
        except Exception as error:  # of sympy's algorithms, which know many more kinds of objects
            verdicts.append(Verdict("undecided", f"{FAILED} ({type(error).__name__}: {error})"))
        if verdicts[-1].answer == "refuted":
            break
    return every(*verdicts)


def _decided(left: Any, right: Any, relation: str, assumptions: list[Any]) -> Verdict:
    symbols = set().union(*(part.free_symbols for part in (left, right, *assumptions)))
    real = {symbol: _as_real(symbol) for symbol in symbols}
    if len({symbol.name for symbol in symbols}) < len(symbols):
        raise InputError(f"{', '.join(sorted(map(str, symbols)))}: expected different names of different symbols")
    domain = Domain.of(real.values(), [written(given, real) for given in assumptions])
    claim = written(left, real), written(right, real), relation
    for side in claim[:2]:
        if side.has(sp.I):
            raise InputError(f"{side}: expected a real expression, got one with the imaginary unit")
    search = Search(*claim, domain)
    found = _found(search, domain)
    if search.undefined == search.tried and found.evidence != NOWHERE:
        found = search.refutation(domain, MOST_POINTS, until_defined=True) or found
    if search.undefined == search.tried or found.evidence == NOWHERE:
        raise InputError(
            f"lhs, rhs: expected both to be defined and real somewhere on the domain; got {claim[0]} and {claim[1]}, "
            f"and at each of {search.tried} points one of them is not"
        )
    names = {str(stand_in): str(symbol) for symbol, stand_in in real.items()}
    point = {names.get(name, name): value for name, value in found.counterexample.items()}
    return Verdict(found.answer, found.evidence, point, found.values)


def _as_real(symbol: Any) -> Any:
    if symbol.is_real is False or not symbol.is_Symbol:
        raise InputError(f"{symbol}: expected a real symbol, because identities are verified over the real numbers")
    return symbol if symbol.is_real else sp.Dummy(symbol.name, **{**symbol._assumptions_orig, "real": True})


def _found(search: Search, domain: Domain) -> Verdict:
    """A counterexample, a proof on every part of the domain, or *undecided* with a reason."""
    unfinished = search.left.has(*UNFINISHED) or search.right.has(*UNFINISHED)
    sides = (sp.nan, sp.nan) if unfinished else (visible(search.left), visible(search.right))
    expands = search.relation == "==" and expands_to_zero(sides[0] - sides[1])
    points = POINTS if search.relation == "==" else MORE_POINTS
    found = search.refutation(domain, points, until_defined=expands)
    if not search.tried:
        raise InputError(f"assumptions: no point was found that meets {', '.join(map(str, domain.conditions))}")
    if found is not None:
        return found
    if expands and search.defined:
        return Verdict("proved", EXPANSION)
    reason = f"no counterexample among {search.defined} points where both are defined, and "
    if unfinished:
        return Verdict("undecided", reason + "no integral, derivative, sum or limit is evaluated; try .doit() first")
    waiting = domain.faces()
    if waiting is None:
        return Verdict("undecided", reason + "the domain has too many faces")
    methods: dict[str, None] = {}
    tried = 0
    while waiting:
        part, tried = waiting.pop(0), tried + 1
        found = search.refutation(part, FEW_POINTS) if tried > 1 or waiting else None
        if found is not None:
            return found
        method = _method(*sides, search.relation, part)
        if method is not None:
            methods[method] = None
            continue
        pieces = next((pieces for g in search.deciding if (pieces := part.divided(g))), [])
        if not pieces or tried + len(waiting) > PARTS:
            return Verdict("undecided", reason + "no known method proves it")
        waiting = pieces + waiting
    return Verdict("proved", "; ".join(method for method in methods if method != NOWHERE) or NOWHERE)


def _method(left: Any, right: Any, relation: str, domain: Domain) -> str | None:
    """The method that proves a relation on an open part, or None."""
    left, right = (visible(side, domain.values) for side in (left, right))
    part = Part(domain)
    method = _equal(left, right, part) if relation == "==" and not is_infinite(left - right) else None
    if method is not None:
        return method
    left, right = part.resolved(left), part.resolved(right)
    if is_infinite(left) or is_infinite(right):
        return NOWHERE
    if relation != "==" and part.signs(right - left) <= (POSITIVE if relation == "<" else NOT_NEGATIVE):
        return SIGN
    if relation == "<":
        return None
    method = _equal(left, right, part)
    if method is None and part.is_within_a_turn(left - right) and vanishes(1 - sp.cos(left - right), part.parameters):
        return ANGLES
    if method is None and all(part.signs(side) <= NOT_NEGATIVE for side in (left, right)):
        return SQUARES if vanishes(left**2 - right**2, part.parameters) else None
    return method


def expands_to_zero(difference: Any) -> bool:
    """Whether expansion shows that the difference is 0 wherever it is defined."""
    return bool(sp.expand(difference, power_exp=False, log=False) == 0)


def _equal(left: Any, right: Any, part: Part) -> str | None:
    """The method that shows two sides equal, or None."""
    difference = left - right
    if expands_to_zero(difference):
        return EXPANSION
    return NORMAL_FORM if vanishes(difference, part.parameters) else None
