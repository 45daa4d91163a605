"""The sign of an expression on an open part of a domain."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import sympy as sp
from flint import arb, ctx

from .balls import Unclear, Undefined, evaluate, interval
from .domain import Domain
from .normal_form import Parameters
from .polyhedron import Inequality, sign_of
from .zeros import zeros_in

Signs = frozenset[int]
POSITIVE, NOT_NEGATIVE, ZERO = frozenset({1}), frozenset({0, 1}), frozenset({0})
NEGATIVE, NOT_POSITIVE, NONZERO, ANY = frozenset({-1}), frozenset({-1, 0}), frozenset({-1, 1}), frozenset({-1, 0, 1})

_CONTAINERS = (sp.Piecewise, sp.Integral, sp.Sum, sp.Product, sp.Limit, sp.Derivative, sp.Subs)
BITS = 128
# Boxes tried before the sign stays unknown, and operations beyond which expressions are not factored.
BOXES = 400
LARGEST = 150
# Nested derivatives used to find a sign.
DEPTH = 5
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
        self._thorough: dict[Any, Signs] = {}
        self._given: dict[Any, Signs] | None = None

    def signs(self, e: Any) -> Signs:
        """A superset of the signs of e where it is defined."""
        if e not in self._known:
            self._known[e] = self._signs(e) & self._assumed().get(e, ANY)
        return self._known[e]

    def is_nonnegative(self, e: Any) -> bool:
        """Whether e is nowhere negative on the part."""
        return self.signs(e) <= NOT_NEGATIVE

    def _signs(self, e: Any) -> Signs:
        if not e.free_symbols:
            try:
                return frozenset({sign_of(e)})
            except (Undefined, Unclear):
                return ANY
        if e.is_Mul:
            return _product([self.signs(factor) for factor in e.args])
        if e.is_Pow and e.exp.is_Integer:
            return _powered(self.signs(e.base), int(e.exp))
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
            found = ANY & self._on_box(e, self.box())
        if found == ANY and e.is_Add:
            found = self._of_sum(e)
        if found in (ANY, NOT_NEGATIVE, NOT_POSITIVE):
            found &= self._between_zeros(e)
        if found == ANY and sp.count_ops(e) < LARGEST:
            found = _of_product(_without_roots(self.parameters.factored(e)))
        return found

    def _assumed(self) -> dict[Any, Signs]:
        """The signs that the conditions give directly."""
        if self._given is None:
            self._given = {}
            for condition in self.domain.conditions:
                difference = (condition.lhs - condition.rhs).xreplace(dict(self.domain.values))
                signs = frozenset(sign for sign in ANY if condition.func(sp.Integer(sign), 0) is sp.true)
                for e in (difference, sp.expand(difference), sp.factor(difference)):
                    self._given[e], self._given[-e] = signs, frozenset(-sign for sign in signs)
        return self._given

    def _linear(self, e: Any) -> Signs | None:
        above = Inequality.of(e, strict=True)
        if above is None:
            return None
        below = Inequality.of(-e, strict=True)
        assert below is not None
        for one, strict, loose in ((above, POSITIVE, NOT_NEGATIVE), (below, NEGATIVE, NOT_POSITIVE)):
            if self.domain.polyhedron.implies(one):
                return strict
            if self.domain.polyhedron.implies(Inequality(one.coefficients, one.constant, strict=False)):
                return loose
        return ANY

    def _of_sum(self, e: Any) -> Signs:
        """The sign of a sum from bounds of its terms: products of sines lie in [-1, 1], other terms have a sign."""
        found = self._of_root_and_rest(e)
        if found is not None:
            return found
        lows, highs, strict_ones = zip(*(self._bounds(term) for term in e.args), strict=True)
        try:
            for sign, ends in ((1, lows), (-1, highs)):
                if all(one.is_finite for one in ends):
                    total = sign_of(sign * sp.Add(*ends))
                    strict = total > 0 or any(strict_ones)
                    if total >= 0:
                        return frozenset({sign}) if strict else frozenset({0, sign})
        except (Undefined, Unclear):
            pass
        return ANY

    def _of_root_and_rest(self, e: Any) -> Signs | None:
        """The sign of a square root whose absolute value exceeds the other terms."""
        for term in e.args:
            fraction, root = term.as_coeff_Mul(rational=True)
            if root.is_Pow and root.exp == sp.S.Half:
                rest = e - term
                if self.signs(sp.expand(fraction**2 * root.base - rest**2)) == POSITIVE:
                    return POSITIVE if fraction > 0 else NEGATIVE
        return None

    def _bounds(self, term: Any) -> tuple[Any, Any, bool]:
        """Bounds of a term, and whether its finite bound is not attained."""
        if term.is_number:
            return term, term, False
        fraction, rest = term.as_coeff_Mul(rational=True)
        factors = [factor.as_base_exp() for factor in sp.Mul.make_args(rest)]
        if all(base.func in (sp.sin, sp.cos) and times.is_Integer and times > 0 for base, times in factors):
            low = 0 if all(times % 2 == 0 for _, times in factors) else -1
            return *sorted([fraction * low, fraction]), False
        if rest.func in _RANGES:
            low, high = _RANGES[rest.func]
            return *sorted([fraction * low, fraction * high], key=float), rest.func is not sp.acos
        signs = self.signs(term)
        return (
            sp.Integer(0) if signs <= NOT_NEGATIVE else -sp.oo,
            sp.Integer(0) if signs <= NOT_POSITIVE else sp.oo,
            0 not in signs,
        )

    def box(self) -> dict[Any, Any]:
        return {s: _ball(*self.domain.interval(s)[:2]) for s in self.domain.symbols}

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

    def _between_zeros(self, e: Any) -> Signs:
        symbols = e.free_symbols
        if len(symbols) != 1:
            return ANY
        (symbol,) = symbols
        if symbol not in self.domain.symbols:
            return ANY
        low, high = self.domain.interval(symbol)[:2]
        if zeros_in(e, symbol, low, high) != []:
            return ANY
        for point in self.domain_points():
            try:
                return frozenset({evaluate(e, point, 4 * BITS).sign})
            except (Undefined, Unclear):
                continue
        return ANY

    def domain_points(self) -> list[dict[Any, Any]]:
        """Some interior points, as values of the symbols that vary."""
        free = replace(self.domain, values={}, conditions=(), original=self.domain.symbols)
        return list(free.points(np.random.default_rng(0), FIRST_POINTS))

    def thorough_signs(self, e: Any, depth: int = DEPTH) -> Signs:
        """As `signs`, but also by bisection and by derivatives."""
        key = (e, depth)
        if key not in self._thorough:
            found = self.signs(e)
            if not found <= NOT_NEGATIVE and not found <= NOT_POSITIVE:
                found = self._by_bisection(e)
            if not found <= NOT_NEGATIVE and not found <= NOT_POSITIVE and depth:
                found = self._by_derivative(e, depth)
            self._thorough[key] = found
        return self._thorough[key]

    def _by_bisection(self, e: Any) -> Signs:
        symbols = [s for s in self.domain.symbols if e.has(s)]
        box = {s: self.domain.interval(s)[:2] for s in symbols}
        if not symbols or any(end.is_infinite for ends in box.values() for end in ends):
            return ANY
        waiting, found, tried = [{s: (float(a), float(b)) for s, (a, b) in box.items()}], frozenset[int](), 0
        # rounded outward
        waiting = [{s: (np.nextafter(a, -np.inf), np.nextafter(b, np.inf)) for s, (a, b) in waiting[0].items()}]
        while waiting:
            tried += 1
            one = waiting.pop()
            signs = self._on_box(e, {s: _float_ball(a, b) for s, (a, b) in one.items()})
            if signs == ANY:
                if tried + len(waiting) > BOXES:
                    return ANY
                half_ranges = [[(a, (a + b) / 2), ((a + b) / 2, b)] for a, b in one.values()]
                waiting += [dict(zip(one, half, strict=True)) for half in product(*half_ranges)]
            else:
                found |= signs
            if {-1, 1} <= found:
                return ANY
        return found

    def _is_nowhere_constant(self, e: Any, slope: Any) -> bool:
        """Whether an analytic function of one symbol has a nonzero slope somewhere, so that no interval is constant."""
        roots = any(not power.exp.is_Integer for power in e.atoms(sp.Pow))
        if len(e.free_symbols) != 1 or roots or e.has(*_NOT_ANALYTIC):
            return False
        for point in self.domain_points():
            try:
                if evaluate(slope, point, BITS).sign != 0:
                    return True
            except (Undefined, Unclear):
                continue
        return False

    def along(self, symbol: Any) -> Part:
        """The part without conditions that may cut the line of one symbol into pieces."""
        values = dict(self.domain.values)
        remaining = tuple(
            condition
            for condition in self.domain.conditions
            if isinstance(condition, sp.Gt | sp.Ge | sp.Lt | sp.Le)
            and (difference := (condition.lhs - condition.rhs).xreplace(values)).is_polynomial(symbol)
            and sp.degree(difference, symbol) <= 1
        )
        return self if remaining == self.domain.conditions else Part(replace(self.domain, conditions=remaining))

    def _by_derivative(self, e: Any, depth: int) -> Signs:
        """The sign at an end of a symbol's interval, if the derivative has the matching sign."""
        if self.domain.conditions:
            # a line from the end may leave the region of the conditions
            return Part(replace(self.domain, conditions=()))._by_derivative(e, depth)
        if not e.free_symbols or sp.count_ops(e) > LARGEST:
            return ANY
        for symbol in sorted(e.free_symbols, key=str):
            if any(symbol in one.coefficients and len(one.coefficients) > 1 for one in self.domain.inequalities):
                continue
            slope = None
            for end, outward in zip(self.domain.interval(symbol)[:2], (1, -1), strict=True):
                if end.is_infinite:
                    continue
                face = self.domain.face(symbol, end)
                at_end = e.xreplace({symbol: end})
                if face is None or is_infinite(at_end) or not is_continuous(e, self, (symbol, end)):
                    continue
                here = Part(face).thorough_signs(at_end, depth - 1)
                if here not in (ZERO, POSITIVE, NEGATIVE, NOT_NEGATIVE, NOT_POSITIVE):
                    continue
                if slope is None:
                    slope = self.thorough_signs(sp.diff(e, symbol), depth - 1)
                rising = _product([slope, frozenset({outward})])
                moves = self._is_nowhere_constant(e, sp.diff(e, symbol))
                if here <= NOT_NEGATIVE and rising <= NOT_NEGATIVE:
                    return POSITIVE if POSITIVE in (here, rising) or moves else NOT_NEGATIVE
                if here <= NOT_POSITIVE and rising <= NOT_POSITIVE:
                    return NEGATIVE if NEGATIVE in (here, rising) or moves else NOT_POSITIVE
        return ANY


# All but the arc cosine do not attain their bounds.
_RANGES = {sp.acos: (sp.S.Zero, sp.pi), sp.atan: (-sp.pi / 2, sp.pi / 2), sp.tanh: (-sp.S.One, sp.S.One)}


_NOT_ANALYTIC = (sp.asin, sp.acos, sp.acosh)


def is_muddled(e: Any) -> bool:
    """Whether e contains sympy's form of 0**(-x): infinity to the power of x, whose value is 0 for negative x."""
    return any(power.base is sp.zoo and power.free_symbols for power in e.atoms(sp.Pow))


def is_infinite(e: Any) -> bool:
    """Whether a part that every value requires is undefined, infinite or imaginary."""
    if isinstance(e, _CONTAINERS) or is_muddled(e):
        return False
    return e in (sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I) or isinstance(e, sp.AccumBounds) or any(map(is_infinite, e.args))


# Functions that are continuous wherever they are defined, and analytic in the interior.
_SMOOTH = (
    sp.sin, sp.cos, sp.tan, sp.cot, sp.sec, sp.csc, sp.asin, sp.acos, sp.atan, sp.exp, sp.log, sp.sinh, sp.cosh,
    sp.tanh, sp.asinh, sp.acosh, sp.atanh, sp.erf, sp.erfc,
)  # fmt: skip


def is_continuous(e: Any, part: Part, end: tuple[Any, ...] | None = None) -> bool:
    """Whether e is proved continuous on the whole part, and analytic there up to a thin set.

    With ``end`` = (symbol, value) or (symbol, value, face), e is also continuous on the face at this value of the
    symbol. ``face`` is needed if it differs from the part's face.
    """
    if not all(is_continuous(argument, part, end) for argument in e.args):
        return False
    if e.is_Add or e.is_Mul or e.is_Symbol or e.is_number:
        return True

    def everywhere(g: Any, wanted: frozenset[int], wanted_at_end: frozenset[int]) -> bool:
        if not part.signs(g) <= wanted:
            return False
        if not end:
            return True
        face, there = end[2] if len(end) > 2 else part.domain.face(*end), g.xreplace({end[0]: end[1]})
        return face is not None and not is_infinite(there) and Part(face).signs(there) <= wanted_at_end

    argument = e.args[0]
    if e.is_Pow:
        if e.exp.is_Integer:
            return bool(e.exp > 0) or everywhere(e.base, NONZERO, NONZERO)
        if e.exp.is_Rational and e.exp > 0:
            return everywhere(e.base, NOT_NEGATIVE, NOT_NEGATIVE) and part.signs(e.base) != ZERO
        return everywhere(e.base, POSITIVE, POSITIVE)
    if not e.is_Function or e.func not in _SMOOTH:
        return False
    if e.func in (sp.asin, sp.acos):
        return everywhere(1 - argument**2, NOT_NEGATIVE, NOT_NEGATIVE) and part.signs(1 - argument**2) != ZERO
    if e.func is sp.log:
        return everywhere(argument, POSITIVE, POSITIVE)
    if e.func is sp.acosh:
        return everywhere(argument - 1, NOT_NEGATIVE, NOT_NEGATIVE) and part.signs(argument - 1) != ZERO
    if e.func is sp.atanh:
        return everywhere(1 - argument**2, POSITIVE, POSITIVE)
    if e.func in (sp.tan, sp.sec):
        return everywhere(sp.cos(argument), NONZERO, NONZERO)
    if e.func in (sp.cot, sp.csc):
        return everywhere(sp.sin(argument), NONZERO, NONZERO)
    return True


def _ball(low: Any, high: Any) -> Any:
    if low.is_infinite or high.is_infinite:
        return arb(0, float("inf"))
    return interval(low, high, BITS)


def _float_ball(low: float, high: float) -> Any:
    with ctx.workprec(BITS):
        return arb(low).union(arb(high))


def _product(factors: list[Signs]) -> Signs:
    found = frozenset({1})
    for signs in factors:
        found = frozenset(a * b for a in found for b in signs)
    return found


def _powered(signs: Signs, exponent: int) -> Signs:
    if exponent < 0:
        signs -= {0}
    return signs if exponent % 2 else frozenset(sign * sign for sign in signs)


def _without_roots(e: Any) -> Any:
    """Replace a positive parameter under a square root by a square, and factor."""
    rooted = {p.base for p in e.atoms(sp.Pow) if p.exp.is_Rational and p.exp.q == 2 and p.base.is_Symbol}
    squares = {t: sp.Dummy(positive=True) ** 2 for t in rooted if t.is_positive}
    return sp.factor(e.xreplace(squares)) if squares else e


def _of_product(e: Any) -> Signs:
    """The sign of a product from its factors in positive parameters."""
    return _product([_of_factor(factor) for factor in sp.Mul.make_args(e)])


def _of_factor(factor: Any) -> Signs:
    if factor.is_positive:
        return POSITIVE
    if factor.is_negative:
        return NEGATIVE
    if factor.is_nonnegative:
        return NOT_NEGATIVE
    if factor.is_nonpositive:
        return NOT_POSITIVE
    base, exponent = factor.as_base_exp()
    if base.is_polynomial() and len(base.free_symbols) == 1 and exponent.is_Integer:
        (t,) = base.free_symbols
        polynomial = sp.Poly(base, t)
        if t.is_positive and (polynomial.domain.is_ZZ or polynomial.domain.is_QQ):
            # no root beyond 0 (Sturm): the leading coefficient gives the sign
            if polynomial.count_roots(0, None) == (1 if polynomial.eval(0) == 0 else 0):
                return _powered(frozenset({int(sp.sign(polynomial.LC()))}), int(exponent))
            return _powered(ANY, int(exponent))
    if exponent.is_Integer and base.is_real:
        return _powered(NONZERO if base.is_nonzero else ANY, int(exponent))
    return NONZERO if factor.is_nonzero else ANY
