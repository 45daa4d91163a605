"""The sign of an expression on an open part of a domain."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import sympy as sp
from flint import ctx

from .balls import Unclear, Undefined, evaluate, interval
from .constants import visible
from .domain import Domain
from .normal_form import (
    ANY,
    NEGATIVE,
    NOT_NEGATIVE,
    NOT_POSITIVE,
    POSITIVE,
    Parameters,
    Signs,
    powered,
    product_of,
    sign_in,
)
from .polyhedron import Inequality, sign_of

BITS = 128
# Boxes tried before the sign stays unknown, and operations beyond which expressions are not factored.
BOXES = 400
LARGEST = 150
FIRST_POINTS = 6


class Part:
    """An open part of a domain, with known signs and the parameters of its normal form."""

    def __init__(self, domain: Domain) -> None:
        if domain.polyhedron.is_empty:
            # every statement would hold on an empty part
            raise ValueError("expected a part with points in it")
        if any(one.coefficients and not one.strict for one in domain.inequalities):
            raise ValueError("expected an open part")
        self.domain = domain
        self.positive_bases: set[Any] = set()
        self.plain = Parameters(domain, half_angles=False, positive=self.positive_bases)
        self.parameters = Parameters(domain, half_angles=True, positive=self.positive_bases)
        self._known: dict[Any, Signs] = {}
        self._assumed: dict[Any, Signs] = {}
        for condition in domain.conditions:
            difference = visible(condition.lhs - condition.rhs, domain.values)
            signs = frozenset(sign for sign in ANY if condition.func(sp.Integer(sign), 0) is sp.true)
            for e in (difference, sp.expand(difference), sp.factor(difference)):
                self._assumed[e], self._assumed[-e] = signs, frozenset(-sign for sign in signs)

    def signs(self, e: Any) -> Signs:
        """A superset of the signs of e where it is defined."""
        if e not in self._known:
            self._known[e] = self._signs(e) & self._assumed.get(e, ANY)
        return self._known[e]

    def is_nonnegative(self, e: Any) -> bool:
        """Whether e is nowhere negative on the part."""
        return self.signs(e) <= NOT_NEGATIVE

    def _signs(self, e: Any) -> Signs:
        if not e.free_symbols:
            try:
                return frozenset({sign_of(e)})
            except Unclear:
                return ANY
        if e.is_Mul:
            return product_of([self.signs(factor) for factor in e.args])
        if e.is_Pow and e.exp.is_Integer:
            return powered(self.signs(e.base), int(e.exp))
        if e.is_Pow and e.exp.is_Rational:
            return POSITIVE if e.exp < 0 else self.signs(e.base) & NOT_NEGATIVE
        if e.func in (sp.Abs, sp.acos):
            return NOT_NEGATIVE
        if e.func is sp.exp:
            return POSITIVE
        if e.func in (sp.atan, sp.asin, sp.asinh, sp.sinh, sp.tanh):
            return self.signs(e.args[0])
        found = self._linear(e)
        if found is None:
            found = self._on_box(e, self.box())
        if found == ANY and e.is_Add:
            found = self._of_sum(e)
        if found == ANY and sp.count_ops(e) < LARGEST:
            found = sign_in(_without_roots(self.parameters.factored(e)))
        return found

    def _linear(self, e: Any) -> Signs | None:
        above, below = Inequality.of(e, strict=True), Inequality.of(-e, strict=True)
        if above is None or below is None:
            return None
        for one, strict, loose in ((above, POSITIVE, NOT_NEGATIVE), (below, NEGATIVE, NOT_POSITIVE)):
            if self.domain.polyhedron.implies(one):
                return strict
            if self.domain.polyhedron.implies(replace(one, strict=False)):
                return loose
        return ANY

    def _of_sum(self, e: Any) -> Signs:
        """The sign of a sum from bounds of its terms: products of sines lie in [-1, 1], other terms have a sign."""
        for sign, strict, loose in ((1, POSITIVE, NOT_NEGATIVE), (-1, NEGATIVE, NOT_POSITIVE)):
            lows = [low for term in e.args if (low := self._low(sign * term)) is not None]
            if len(lows) == len(e.args) and (total := sign_of(sp.Add(*(low for low, _ in lows)))) >= 0:
                return strict if total > 0 or any(open_ for _, open_ in lows) else loose
        return ANY

    def _low(self, term: Any) -> tuple[Any, bool] | None:
        """A lower bound of a term, and whether it is not attained."""
        if not term.free_symbols:
            return term, False
        fraction, rest = term.as_coeff_Mul(rational=True)
        factors = [factor.as_base_exp() for factor in sp.Mul.make_args(rest)]
        if all(base.func in (sp.sin, sp.cos) and times.is_Integer and times > 0 for base, times in factors):
            even = all(times % 2 == 0 for _, times in factors)
            return (sp.S.Zero if even and fraction > 0 else -abs(fraction)), False
        if rest in self.domain.symbols:
            end = self.domain.interval(rest)[0 if fraction > 0 else 1]
            return None if end in (sp.oo, -sp.oo) else (fraction * visible(end), True)
        signs = self.signs(term)
        return (sp.S.Zero, 0 not in signs) if signs <= NOT_NEGATIVE else None

    def box(self) -> dict[Any, Any]:
        return {s: interval(*self.domain.interval(s)[:2], BITS) for s in self.domain.symbols}

    def _on_box(self, e: Any, box: dict[Any, Any]) -> Signs:
        try:
            ball = evaluate(e, box, BITS).ball
        except Undefined:
            return frozenset()
        except Unclear:
            return ANY
        if ball > 0:
            return POSITIVE
        if ball < 0:
            return NEGATIVE
        if ball >= 0:
            return NOT_NEGATIVE
        return NOT_POSITIVE if ball <= 0 else ANY

    def domain_points(self) -> list[dict[Any, Any]]:
        """Some interior points, as values of the symbols that vary."""
        free = replace(self.domain, values={}, conditions=(), original=self.domain.symbols)
        return list(free.points(np.random.default_rng(0), FIRST_POINTS))

    def thorough_signs(self, e: Any) -> Signs:
        """As `signs`, but also by bisection of the box."""
        found = self.signs(e)
        box = {s: interval(*self.domain.interval(s)[:2], BITS) for s in self.domain.symbols if e.has(s)}
        if found <= NOT_NEGATIVE or found <= NOT_POSITIVE or not box or not all(b.is_finite() for b in box.values()):
            return found
        waiting, found, tried = [box], frozenset[int](), 0
        while waiting and not {-1, 1} <= found:
            tried += 1
            one = waiting.pop()
            signs = self._on_box(e, one)
            if signs != ANY:
                found |= signs
            elif tried + len(waiting) > BOXES:
                return ANY
            else:
                waiting += [dict(zip(one, half, strict=True)) for half in product(*map(_halves, one.values()))]
        return ANY if {-1, 1} <= found else found


def _halves(ball: Any) -> list[Any]:
    with ctx.workprec(BITS):
        return [ball.lower().union(ball.mid()), ball.mid().union(ball.upper())]


def _without_roots(e: Any) -> Any:
    """Replace a positive parameter under a square root by a square, and factor."""
    rooted = {p.base for p in e.atoms(sp.Pow) if p.exp.is_Rational and p.exp.q == 2 and p.base.is_Symbol}
    squares = {t: sp.Dummy(positive=True) ** 2 for t in rooted if t.is_positive and t.free_symbols}
    return sp.factor(e.xreplace(squares)) if squares else e
