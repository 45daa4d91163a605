"""Functions that jump, bend or have branches, resolved into smooth functions on an open part of a domain.

Every rule holds wherever the expression is defined. A function stays as it is where a sign is unknown, and an
expression that is defined nowhere on the part becomes nan.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import sympy as sp

from .balls import FEW_BITS, Unclear, Undefined, evaluate, interval
from .constants import built
from .domain import Domain
from .normal_form import (
    ANY,
    NEGATIVE,
    NOT_NEGATIVE,
    NOT_POSITIVE,
    POSITIVE,
    ZERO,
    Parameters,
    Signs,
    product,
    sign_in,
    signs_of,
)

# Operations beyond which expressions are not factored.
LARGEST = 150


class Part:
    """An open part of a domain: signs, resolved expressions, and the parameters of normal forms."""

    def __init__(self, domain: Domain) -> None:
        if any(one.is_empty or one.closed_ends for one in domain.intervals.values()):
            # every statement would hold on an empty part, and a proof says nothing of a closed end
            raise ValueError("expected an open part with points in it")
        self.domain = domain
        self.parameters = Parameters(domain)
        self._box = {s: interval(one.low, one.high, FEW_BITS) for s, one in domain.intervals.items()}
        self._known: dict[Any, Signs] = {}
        self._resolved: dict[Any, Any] = {}

    # ---- signs

    def signs(self, e: Any) -> Signs:
        """A superset of the signs of e where it is defined."""
        if e not in self._known:
            found = signs_of(e, self.signs)
            if found == ANY:
                found = self._enclosed(e)
            if found == ANY and sp.count_ops(e) < LARGEST:
                found = sign_in(_with_squares(self.parameters.factored(e)))
            self._known[e] = found
        return self._known[e]

    def _enclosed(self, e: Any) -> Signs:
        """The signs of an enclosure: exact for a linear expression, else a ball."""
        found = self.domain.enclosure(e)
        if found is not None:
            return found.signs
        try:
            ball = evaluate(e, self._box, FEW_BITS).ball
        except Undefined:
            return frozenset()
        except Unclear:
            return ANY
        excluded = {1: ball <= 0, 0: ball > 0 or ball < 0, -1: ball >= 0}
        return frozenset(sign for sign in ANY if not excluded[sign])

    def is_within_a_turn(self, e: Any) -> bool:
        """Whether an expression with arctangents or arccosines is surely between -2 pi and 2 pi."""
        box, names = dict(self._box), {f: sp.Dummy("a") for f in e.atoms(sp.atan, sp.acos)}
        for f, name in names.items():
            low, high = (sign * sp.pi / 2 * int(sign in self.signs(f.args[0])) for sign in (-1, 1))
            box[name] = interval(low, high) if f.func is sp.atan else interval(sp.pi / 2 - high, sp.pi / 2 - low)
        try:
            return bool(names) and bool(abs(evaluate(e.xreplace(names), box, FEW_BITS).ball) < 6)
        except (Undefined, Unclear):
            return False

    # ---- rules

    def resolved(self, e: Any) -> Any:
        """Return the resolved expression."""
        if not e.args:
            return e
        if e not in self._resolved:
            if isinstance(e, sp.Piecewise):
                found = self._cases(e)
            else:
                args = [self.resolved(argument) for argument in e.args]
                found = e if tuple(args) == e.args else built(e.func, args)
                rule = _RULES.get(found.func)
                found = rule(self, found) if rule is not None and not is_infinite(found) else found
            self._resolved[e] = found
        return self._resolved[e]

    def _absolute(self, e: Any) -> Any:
        signs = self.signs(e.args[0])
        if signs <= NOT_NEGATIVE:
            return e.args[0]
        return -e.args[0] if signs <= NOT_POSITIVE else e

    def _sign(self, e: Any) -> Any:
        signs = self.signs(e.args[0])
        return sp.Integer(next(iter(signs))) if len(signs) == 1 else e

    def _extreme(self, e: Any) -> Any:
        """The maximum or minimum by absolute values, if it is not known which argument it is."""
        factor = 1 if e.func is sp.Max else -1
        return reduce(lambda a, b: (a + b + factor * self.resolved(built(sp.Abs, [a - b]))) / 2, e.args)

    def _floor(self, e: Any) -> Any:
        k = self._piece(e.args[0], sp.Integer(0), sp.Integer(1))
        return e if k is None else k

    def _ceiling(self, e: Any) -> Any:
        k = self._piece(-e.args[0], sp.Integer(0), sp.Integer(1))
        return e if k is None else -k

    def _piece(self, e: Any, start: Any, length: Any) -> Any:
        """k with start + k length <= e < start + (k + 1) length on the whole part; None if it is unknown."""
        inside = {s: one.inner_point for s, one in self.domain.intervals.items()}
        try:
            k = evaluate((e - start) / length, inside, FEW_BITS).ball.floor().unique_fmpz()
        except (Undefined, Unclear):
            return None
        if k is None:
            return None
        k = sp.Integer(int(k))
        low, high = start + k * length, start + (k + 1) * length
        return k if self.signs(e - low) <= NOT_NEGATIVE and self.signs(high - e) == POSITIVE else None

    def _cases(self, e: Any) -> Any:
        """The branch that applies; e itself if the branch is unknown."""
        for branch, condition in e.args:
            truth = self._truth(condition)
            if truth is None:
                return e
            if truth:
                return self.resolved(branch)
        return sp.nan

    def _truth(self, condition: Any) -> bool | None:
        if condition in (sp.true, sp.false):
            return bool(condition)
        if isinstance(condition, sp.And | sp.Or | sp.Not):
            parts = [self._truth(part) for part in condition.args]
            # a condition of unknown truth may also be undefined
            return None if None in parts else bool(condition.func(*parts))
        if not isinstance(condition, sp.core.relational.Relational):
            return None
        difference = self.resolved(condition.lhs) - self.resolved(condition.rhs)
        truths = {bool(condition.func(sp.Integer(sign), 0)) for sign in self.signs(difference)}
        return truths.pop() if len(truths) == 1 else None

    def _arcsine(self, e: Any) -> Any:
        # arcsine and arccosine share one function
        return sp.pi / 2 - self.resolved(built(sp.acos, e.args))

    def _arccosine(self, e: Any) -> Any:
        (w,) = e.args
        if w.could_extract_minus_sign():
            return sp.pi - self.resolved(built(sp.acos, [-w]))
        shift = sp.pi / 2 if w.func is sp.sin else sp.Integer(0)
        if w.func in (sp.sin, sp.cos):
            angle = w.args[0] - shift
            k = self._piece(angle, sp.Integer(0), sp.pi)
            if k is not None:
                return (k + 1) * sp.pi - angle if k % 2 else angle - k * sp.pi
        return e

    def _arctangent(self, e: Any) -> Any:
        (w,) = e.args
        if w.could_extract_minus_sign():
            return -self.resolved(built(sp.atan, [-w]))
        angle = w.args[0] if w.func is sp.tan else None
        if w.is_Pow and w.exp == -1 and w.base.func is sp.cot:
            angle = w.base.args[0]
        k = None if angle is None else self._piece(angle, -sp.pi / 2, sp.pi)
        return e if k is None else angle - k * sp.pi

    def _power(self, e: Any) -> Any:
        base, exponent = e.base, e.exp
        if exponent.is_Integer and exponent > 0:
            return e
        signs = self.signs(base)
        if signs <= (ZERO if exponent.is_Integer else NEGATIVE if exponent.is_Rational else frozenset()):
            return sp.nan
        if signs == ZERO:
            return {POSITIVE: sp.Integer(0), ZERO: sp.Integer(1), NEGATIVE: sp.nan}.get(self.signs(exponent), e)
        if signs == POSITIVE and not exponent.is_Rational:
            return built(sp.exp, [exponent * built(sp.log, [base])])
        return e

    def _logarithm(self, e: Any) -> Any:
        return sp.nan if self.signs(e.args[0]) <= NOT_POSITIVE else e


def _with_squares(e: Any) -> Any:
    """Replace a positive parameter under a square root by a square, and factor."""
    squares = {p.base: sp.Dummy(positive=True) ** 2 for p in e.atoms(sp.Pow) if p.exp == sp.S.Half and p.base.is_Dummy}
    return product(e.xreplace({t: square for t, square in squares.items() if t.is_positive}))


def is_infinite(e: Any) -> bool:
    """Whether a part that every value requires is undefined, infinite or imaginary."""
    if isinstance(e, sp.Piecewise):
        return False
    return e in (sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I) or isinstance(e, sp.AccumBounds) or any(map(is_infinite, e.args))


_RULES: dict[Any, Any] = {
    sp.Abs: Part._absolute,
    sp.sign: Part._sign,
    sp.Max: Part._extreme,
    sp.Min: Part._extreme,
    sp.floor: Part._floor,
    sp.ceiling: Part._ceiling,
    sp.asin: Part._arcsine,
    sp.acos: Part._arccosine,
    sp.atan: Part._arctangent,
    sp.Pow: Part._power,
    sp.log: Part._logarithm,
}
