"""Exact derivations of equalities and inequalities on a domain, part by part.

The domain is divided into its interior and its faces, and further where a linear expression changes its sign that
decides a branch. On each part both sides are resolved into smooth functions and
compared by a normal form or by squares. A part on which one side is defined nowhere needs no proof.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import sympy as sp

from .balls import Unclear
from .constants import visible
from .domain import Domain
from .normal_form import NOT_NEGATIVE, POSITIVE, vanishes
from .polyhedron import Inequality
from .resolution import Nowhere, Resolution, is_infinite
from .signs import Part
from .verdict import Verdict

# Parts that are tried, and points of every part at which a counterexample is sought.
PARTS = 60
POINTS = 3

EXPANSION = "expansion"
NORMAL_FORM = "polynomial normal form"
SQUARES = "neither side is negative, and the polynomial normal forms of the squares agree"
INSIDE = "one function of equal things"
SIGN = "the sign of the difference"

Refute = Callable[[Domain, int], Verdict | None]


@dataclass
class Derivation:
    """The search for a proof of one relation between two sides.

    Parameters
    ----------
    left, right : sympy expressions
    relation : {"==", "<=", "<"}
    refute : callable
        Searches a part for a counterexample, with a given number of points.
    deciding : sequence of expressions
        A part on which no proof is found is divided where one of these that is linear is 0.

    Attributes
    ----------
    methods : list of str
        The methods that proved the parts on which both sides are defined.
    reason : str
        Why no proof was found.
    """

    left: Any
    right: Any
    relation: str
    refute: Refute
    deciding: Sequence[Any] = ()
    methods: list[str] = field(default_factory=list, init=False)
    reason: str = field(default="no known method proves it", init=False)

    def verdict(self, domain: Domain) -> Verdict | None:
        """Return *proved* or *refuted*, or None with a `reason`."""
        cells = domain.cells()
        if cells is None:
            self.reason = "the domain has too many faces"
            return None
        waiting, tried = cells[::-1], 0
        while waiting:
            cell, tried = waiting.pop(), tried + 1
            try:
                found = self.refute(cell, POINTS) if tried > 1 or waiting else None
                if found is not None:
                    return found
                if not self._is_proved(cell):
                    pieces = self._pieces(cell)
                    if not pieces or tried + len(waiting) > PARTS:
                        return None
                    waiting += pieces
            except sp.polys.polyerrors.BasePolynomialError as error:
                self.reason = f"sympy's polynomials do not serve: {error}"
                return None
            except Unclear:
                self.reason = "two numbers could not be told apart"
                return None
        return Verdict("proved", "; ".join(dict.fromkeys(self.methods)) or "defined nowhere on the domain")

    def _pieces(self, cell: Domain) -> list[Domain]:
        """The part divided where the first suitable deciding expression is 0."""
        for g in self.deciding:
            one = Inequality.of(g.xreplace(dict(cell.values)), True)
            if one is None or not one.coefficients:
                continue
            sides = [cell.where(one), cell.where(replace(one.negated(), strict=True))]
            middle = cell.on(one)
            if middle is not None and not any(side.is_empty for side in sides):
                return [*sides, *([] if middle.is_empty or not middle.has_allowed_values else [middle])]
        return []

    def _is_proved(self, cell: Domain) -> bool:
        box = boxed(cell)
        if box.polyhedron.is_empty:
            return True
        left, right = (visible(side, box.values) for side in (self.left, self.right))
        if is_infinite(left) or is_infinite(right):
            return True
        part = Part(box)
        method = equal_as_written(left, right, part) if self.relation == "==" else None
        if method is None:
            resolution = Resolution(part)
            try:
                left, right = resolution.resolved(left), resolution.resolved(right)
            except Nowhere:
                return True
            method = self._method(left, right, part)
        if method is not None:
            self.methods.append(method)
        return method is not None

    def _method(self, left: Any, right: Any, part: Part) -> str | None:
        if self.relation == "==":
            return derive_equality(left, right, part)
        allowed = POSITIVE if self.relation == "<" else NOT_NEGATIVE
        if part.thorough_signs(right - left) <= allowed or _signs_of_steps(right - left, part) <= allowed:
            return SIGN
        return NORMAL_FORM if self.relation == "<=" and derive_equality(left, right, part) is not None else None


def _signs_of_steps(difference: Any, part: Part) -> frozenset[int]:
    """The signs of an expression after floor(x) is replaced by x - f with a new symbol 0 <= f < 1."""
    steps = sorted(difference.atoms(sp.floor), key=str)
    if len(steps) != 1 or steps[0].args[0].has(sp.floor):
        return frozenset({-1, 0, 1})
    (step,) = steps
    fraction = sp.Dummy("f", real=True)
    bounds = (
        Inequality({fraction: sp.Integer(1)}, sp.Integer(0), strict=True),
        Inequality({fraction: sp.Integer(-1)}, sp.Integer(1), strict=True),
    )
    domain = part.domain
    wider = replace(domain, symbols=(*domain.symbols, fraction), inequalities=(*domain.inequalities, *bounds))
    inside = Part(wider).thorough_signs(difference.xreplace({step: step.args[0] - fraction}))
    return inside | part.thorough_signs(difference.xreplace({step: step.args[0]}))


def boxed(domain: Domain) -> Domain:
    """Introduce a new symbol for the slack of each inequality between symbols, while symbols suffice."""
    slacks: set[Any] = set()
    while True:
        ties = [one for one in domain.inequalities if len(one.coefficients) > 1 and not slacks & set(one.coefficients)]
        choice = next(
            ((one, s) for one in ties for s in sorted(one.coefficients, key=str) if abs(one.coefficients[s]) == 1), None
        )
        if choice is None:
            return domain
        one, symbol = choice
        slack = sp.Dummy(f"d_{symbol}", real=True)
        slacks.add(slack)
        value = sp.expand(symbol + (slack - one.expression) / one.coefficients[symbol])
        domain = domain.replaced(symbol, value, slack)


def expands_to_zero(difference: Any) -> bool:
    """Whether expansion shows that the difference is 0 wherever it is defined."""
    return bool(sp.expand(difference, power_exp=False, log=False) == 0)


def equal_as_written(left: Any, right: Any, part: Part) -> str | None:
    """The method that shows two sides equal without resolving branches, or None."""
    if expands_to_zero(left - right):
        return EXPANSION
    if vanishes(left - right, part.plain) or vanishes(left - right, part.parameters):
        return NORMAL_FORM
    return None


def derive_equality(left: Any, right: Any, part: Part) -> str | None:
    """The method that shows two resolved sides equal on an open part, or None."""
    method = equal_as_written(left, right, part)
    if method is not None:
        return method
    if all(part.is_nonnegative(side) for side in (left, right)) and vanishes(left**2 - right**2, part.parameters):
        return SQUARES
    return INSIDE if _equal_inside(left, right, part) else None


def _equal_inside(left: Any, right: Any, part: Part) -> bool:
    """Whether both sides are the same function of arguments that are found equal."""
    if left.func != right.func or len(left.args) != len(right.args) or not (left.is_Function or left.is_Pow):
        return False
    pairs = [(a, b) for a, b in zip(left.args, right.args, strict=True) if a != b]
    return len(pairs) == 1 and derive_equality(*pairs[0], part) is not None
