"""Counterexamples: exact points at which disjoint balls contain the two sides."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import sympy as sp
from flint import ctx

from .balls import Unclear, Undefined, Value, evaluate, is_below
from .constants import spelled
from .domain import SPECIAL, Domain, as_float, has_properties, linear
from .verdict import Verdict

SEED = 0
# Increasing bits of evaluation: MOST_BITS at the first point only, the third of BITS at the first CLOSE_LOOKS points.
BITS = (64, 256, 2048)
CLOSE_LOOKS = 4
MOST_BITS = 1 << 15
SHOWN = 20
# Factor on the number of points if a side is often undefined.
MORE = 4
# Expressions whose zeros are tried, operations beyond which they are not sought, and the first steps of a function.
MOST_CRITICAL = 60
LARGEST = 40
_PERIODIC = (sp.cos, sp.sin, sp.tan, sp.cot)
_OUTWARD = (0, 1, -1, 2, -2, 3, -3, 4, -4)


def _deciding(e: Any) -> Iterator[Any]:
    """The expressions at whose zeros a function of e may jump, bend or end."""
    for part in sp.preorder_traversal(e):
        if isinstance(part, sp.core.relational.Relational):
            yield part.lhs - part.rhs
        elif part.func in (sp.Max, sp.Min):
            yield from (a - b for a, b in combinations(part.args, 2))
        elif part.func in (sp.floor, sp.ceiling):
            yield from (part.args[0] - k for k in _OUTWARD)
        elif part.func in (sp.acos, sp.asin, sp.atan) and part.args[0].func in _PERIODIC:
            yield from (part.args[0].args[0] - k * sp.pi / 2 for k in _OUTWARD)
        elif part.is_Pow:
            yield from () if part.exp.is_Integer and part.exp > 0 else part.args
        elif part.is_Function:
            # not of And, Or and cases, whose relations come by themselves
            yield from (one for one in part.args if isinstance(one, sp.Expr))


def _zeros(g: Any) -> list[tuple[Any, Any]]:
    """Symbols, and the values at which a linear expression or a quadratic polynomial of one symbol is 0."""
    form = linear(g)
    if form is not None:
        return [(symbol, sp.expand(symbol - g / coefficient)) for symbol, coefficient in [*form[0].items()][:1]]
    if len(g.free_symbols) != 1 or sp.count_ops(g) > LARGEST:
        return []
    (symbol,) = g.free_symbols
    try:
        polynomial = sp.Poly(g, symbol)
    except sp.PolynomialError:
        return []
    if polynomial.degree() != 2:
        return []
    c, b, a = (polynomial.nth(k) for k in range(3))
    root = sp.sqrt(sp.expand(b**2 - 4 * a * c))
    return [(symbol, (sign * root - b) / (2 * a)) for sign in (1, -1)] if root.is_real else []


@dataclass
class Search:
    """The search for a counterexample to a relation.

    Attributes
    ----------
    tried : int
        Number of points at which both sides were evaluated.
    defined : int
        Number of these points at which both sides are certainly defined.
    undefined : int
        Number of these points at which one side is certainly undefined.
    deciding : list of expressions
        Expressions at whose zeros a function of a side may jump, bend or end.
    """

    left: Any
    right: Any
    relation: str
    domain: Domain
    tried: int = 0
    defined: int = 0
    undefined: int = 0

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(SEED)
        parts = [part for side in (self.left, self.right) for part in _deciding(side)]
        # an inequality may fail between two zeros of the difference
        parts += [sp.expand(self.right - self.left)] if self.relation != "==" else []
        factors = (g for part in parts for g in sp.Mul.make_args(part) if g.free_symbols)
        # the symbol of an integral is none of the domain
        found = dict.fromkeys(g for g in factors if g.free_symbols <= set(self.domain.original))
        self.deciding = list(found)[:MOST_CRITICAL]
        self._critical = [place for g in self.deciding for place in _zeros(g)]

    def refutation(self, part: Domain, count: int, until_defined: bool = False) -> Verdict | None:
        """The first counterexample among ``count`` points of a part, or up to the first point where both are
        defined."""
        before = self.defined
        for point in part.points(self._rng, count, MORE * count):
            found = self._at(point)
            if found is not None or (until_defined and self.defined > before):
                return found
            if self.defined - before >= count:
                break
        special = self._special() if part is self.domain else ()
        return next((found for point in special if (found := self._at(point)) is not None), None)

    def _special(self) -> Iterator[dict[Any, Any]]:
        """Points at which a function may jump or bend, and points between these and the ends of the domain."""
        for symbol, place in self._critical:
            if place.free_symbols:
                yield from self.domain.fixed(symbol, place).points(self._rng, 1)
        for symbol, interval in self.domain.intervals.items():
            low, high = interval.low, interval.high
            places = {place for one, place in self._critical if one == symbol and not place.free_symbols}
            places |= set(SPECIAL) if len(self.domain.intervals) == 1 else set()
            try:
                inside = sorted((p for p in places if is_below(low, p) and is_below(p, high)), key=as_float)
            except Unclear:
                continue
            ends = [end for end in (low, *inside, high) if end not in (sp.oo, -sp.oo)]
            for value in (*inside, *((a + b) / 2 for a, b in pairwise(ends) if inside)):
                if has_properties(symbol, value):
                    yield from self.domain.fixed(symbol, value).points(self._rng, 1)

    def _at(self, point: dict[Any, Any]) -> Verdict | None:
        self.tried += 1
        bits_to_try = (*BITS, MOST_BITS) if self.defined == 0 else BITS if self.defined < CLOSE_LOOKS else BITS[:2]
        seen = False
        for bits in bits_to_try:
            try:
                left, right = evaluate(self.left, point, bits), evaluate(self.right, point, bits)
            except Undefined:
                self.undefined += 1
                return None
            except Unclear:
                continue
            if not seen:
                seen = True
                self.defined += 1
            if self._is_broken(left, right):
                return Verdict(
                    "refuted",
                    "counterexample, by ball arithmetic",
                    {str(symbol): str(spelled(value)) for symbol, value in point.items()},
                    self._shown(point, bits),
                )
            if left.exact is not None and left.exact == right.exact:
                break
        return None

    def _is_broken(self, left: Value, right: Value) -> bool:
        if left.exact is not None and right.exact is not None and (left.exact - right.exact).is_Rational:
            sign = int(sp.sign(left.exact - right.exact))
        elif left.ball > right.ball or left.ball < right.ball:
            sign = 1 if left.ball > right.ball else -1
        else:
            return False
        return sign != 0 if self.relation == "==" else sign > 0 if self.relation == "<=" else sign >= 0

    def _shown(self, point: dict[Any, Any], bits: int) -> tuple[str, str]:
        """Both values, with enough digits to distinguish them."""
        digits = SHOWN
        while True:
            with ctx.workprec(bits):
                sides = [evaluate(side, point, bits).ball.mid() for side in (self.left, self.right)]
                left, right = (side.str(digits, radius=False) for side in sides)
            # equal sides refute a strict inequality
            if left != right or self.relation == "<" or bits >= MOST_BITS:
                return left, right
            bits, digits = 2 * bits, 2 * digits
