"""Resolution of functions that jump, bend or have branches, on an open part of a domain.

Every rule holds wherever the expression is defined. A function stays as it is where a sign is unknown.
"""

from __future__ import annotations

from typing import Any

import sympy as sp

from .balls import Unclear, Undefined, evaluate
from .constants import built
from .normal_form import NEGATIVE, NOT_NEGATIVE, NOT_POSITIVE, POSITIVE, ZERO
from .signs import Part

BITS = 128
LARGEST = 120


class Nowhere(Exception):
    """The expression is defined at no point of the part."""


class Resolution:
    """Resolves expressions on one part."""

    def __init__(self, part: Part) -> None:
        self._part = part
        self._done: dict[Any, Any] = {}

    def resolved(self, e: Any) -> Any:
        """Return the resolved expression; raise `Nowhere` if it is defined nowhere."""
        if is_infinite(e):
            raise Nowhere
        if not e.args:
            return e
        if e not in self._done:
            if isinstance(e, sp.Piecewise):
                self._done[e] = self._cases(e)
            else:
                args = [self.resolved(argument) for argument in e.args]
                again = e if tuple(args) == e.args else built(e.func, args)
                if is_infinite(again):
                    raise Nowhere
                rule = _RULES.get(again.func)
                self._done[e] = rule(self, again) if rule is not None else again
        return self._done[e]

    # ---- bends and jumps

    def _absolute(self, e: Any) -> Any:
        signs = self._part.signs(e.args[0])
        if signs <= NOT_NEGATIVE:
            return e.args[0]
        return -e.args[0] if signs <= NOT_POSITIVE else e

    def _sign(self, e: Any) -> Any:
        signs = self._part.signs(e.args[0])
        return sp.Integer(next(iter(signs))) if len(signs) == 1 else e

    def _step(self, e: Any) -> Any:
        signs = self._part.signs(e.args[0])
        return e.func(sp.Integer(next(iter(signs))), *e.args[1:]) if len(signs) == 1 else e

    def _extreme(self, e: Any) -> Any:
        factor = 1 if e.func is sp.Max else -1
        remaining: list[Any] = []
        for one in e.args:
            signs = {other: self._part.signs(factor * (other - one)) for other in remaining}
            if not any(found <= NOT_NEGATIVE for found in signs.values()):
                remaining = [other for other in remaining if not signs[other] <= NOT_POSITIVE] + [one]
        return remaining[0] if len(remaining) == 1 else e.func(*remaining)

    def _floor(self, e: Any) -> Any:
        found = self._piece(e.args[0], sp.Integer(0), sp.Integer(1))
        return e if found is None else sp.Integer(found)

    def _ceiling(self, e: Any) -> Any:
        found = self._piece(-e.args[0], sp.Integer(0), sp.Integer(1))
        return e if found is None else -sp.Integer(found)

    def _piece(self, e: Any, start: Any, length: Any) -> int | None:
        """k with start + k length <= e < start + (k + 1) length on the whole part; None if there is none or it is
        unknown."""
        for point in self._part.domain_points():
            try:
                value = evaluate((e - start) / length, point, BITS)
            except Undefined:
                continue
            except Unclear:
                return None
            k = value.ball.floor().unique_fmpz()
            if k is None:
                continue
            low, high = start + int(k) * length, start + (int(k) + 1) * length
            is_inside = self._part.signs(e - low) <= NOT_NEGATIVE and self._part.signs(high - e) == POSITIVE
            return int(k) if is_inside else None
        return None

    # ---- cases

    def _cases(self, e: Any) -> Any:
        """The branch that applies; e itself if the branch is unknown."""
        for branch, condition in e.args:
            truth = self._truth(condition)
            if truth is None:
                return e
            if truth:
                return self.resolved(branch)
        raise Nowhere

    def _truth(self, condition: Any) -> bool | None:
        if condition in (sp.true, sp.false):
            return bool(condition)
        if isinstance(condition, sp.And | sp.Or):
            parts = [self._truth(part) for part in condition.args]
            deciding = isinstance(condition, sp.Or)
            if None in parts:
                # a condition of unknown truth may also be undefined
                return None
            return deciding if deciding in parts else not deciding
        if isinstance(condition, sp.Not):
            truth = self._truth(condition.args[0])
            return None if truth is None else not truth
        if not isinstance(condition, sp.core.relational.Relational):
            return None
        difference = self.resolved(condition.lhs) - self.resolved(condition.rhs)
        truths = {bool(condition.func(sp.Integer(sign), 0)) for sign in self._part.signs(difference)}
        return truths.pop() if len(truths) == 1 else None

    # ---- inverse functions

    def _direction(self, e: Any) -> Any:
        y, x = e.args
        across, along = self._part.signs(y), self._part.signs(x)
        if along == POSITIVE:
            return self.resolved(sp.atan(y / x))
        if across == POSITIVE:
            return sp.pi / 2 - self.resolved(sp.atan(x / y))
        if across == NEGATIVE:
            return -sp.pi / 2 - self.resolved(sp.atan(x / y))
        if along == NEGATIVE and across <= NOT_NEGATIVE:
            return sp.pi + self.resolved(sp.atan(y / x))
        return e

    def _arcsine(self, e: Any) -> Any:
        (w,) = e.args
        self._limit(1 - w, 1 + w)
        sign, core = (-1, -w) if w.could_extract_minus_sign() else (1, w)
        if core.func is sp.cos:
            return sign * (sp.pi / 2 - self.resolved(sp.acos(core)))
        if core.func is sp.sin:
            k = self._piece_of_angle(core.args[0], -sp.pi / 2)
            if k is not None:
                return sign * (-1) ** k * (core.args[0] - k * sp.pi)
        # arcsine and arccosine share one function
        return sign * (sp.pi / 2 - sp.acos(core))

    def _arccosine(self, e: Any) -> Any:
        (w,) = e.args
        self._limit(1 - w, 1 + w)
        if w.could_extract_minus_sign():
            return sp.pi - self.resolved(sp.acos(-w))
        if w.func is sp.sin:
            k = self._piece_of_angle(w.args[0], -sp.pi / 2)
            return e if k is None else sp.pi / 2 - (-1) ** k * (w.args[0] - k * sp.pi)
        if w.func is sp.cos:
            k = self._piece_of_angle(w.args[0], sp.Integer(0))
            if k is not None:
                return (k + 1) * sp.pi - w.args[0] if k % 2 else w.args[0] - k * sp.pi
        return e

    def _arctangent(self, e: Any) -> Any:
        (w,) = e.args
        sign, core = (-1, -w) if w.could_extract_minus_sign() else (1, w)
        if core.func is sp.tan:
            k = self._piece_of_angle(core.args[0], -sp.pi / 2)
            if k is not None:
                return sign * (core.args[0] - k * sp.pi)
        if core.func is sp.cot:
            k = self._piece_of_angle(core.args[0], sp.Integer(0))
            if k is not None:
                return sign * (sp.pi / 2 + k * sp.pi - core.args[0])
        return e

    def _piece_of_angle(self, angle: Any, start: Any) -> int | None:
        return self._piece(angle, start, sp.pi)

    def _arccotangent(self, e: Any) -> Any:
        signs = self._part.signs(e.args[0])
        if signs == ZERO:
            return sp.pi / 2
        if 0 not in signs:
            (w,) = e.args
            return self.resolved(sp.atan(sp.tan(*w.args) if w.func is sp.cot else 1 / w))
        return e

    # ---- where an expression is defined, and products under roots and logarithms

    def _limit(self, *expressions: Any) -> None:
        """Raise `Nowhere` if an expression that must not be negative is negative."""
        for expression in expressions:
            if self._part.signs(expression) <= NEGATIVE:
                raise Nowhere

    def _power(self, e: Any) -> Any:
        base, exponent = e.base, e.exp
        if exponent.is_Integer and exponent > 0:
            return e
        signs = self._part.signs(base)
        if exponent.is_Integer:
            if signs <= ZERO:
                raise Nowhere
            return e
        if exponent.is_Rational and signs <= NEGATIVE:
            raise Nowhere
        if signs == ZERO:
            return self._power_of_zero(e)
        if signs == POSITIVE:
            self._part.positive_bases.add(base)
        if exponent.is_Rational and exponent.q == 2 and base.free_symbols and sp.count_ops(base) < LARGEST:
            return self._root_of_product(e)
        return e

    def _power_of_zero(self, e: Any) -> Any:
        signs = self._part.signs(e.exp)
        if signs <= NEGATIVE:
            raise Nowhere
        if len(signs) == 1:
            return sp.Integer(0 if signs == POSITIVE else 1)
        return e

    def _root_of_product(self, e: Any) -> Any:
        """Extract even powers from a square root."""
        outside, inside = sp.Integer(1), sp.Integer(1)
        for factor in sp.Mul.make_args(sp.factor(e.base)):
            base, times = factor.as_base_exp()
            if times.is_Integer and times % 2 == 0 and not base.is_number:
                outside *= self._absolute(sp.Abs(base, evaluate=False)) ** (times * e.exp)
            else:
                inside *= factor
        return e if outside == 1 else outside * built(sp.Pow, [inside, e.exp])

    def _logarithm(self, e: Any) -> Any:
        if self._part.signs(e.args[0]) <= NOT_POSITIVE:
            raise Nowhere
        if sp.count_ops(e.args[0]) > LARGEST:
            return e
        total, rest = sp.Integer(0), sp.Integer(1)
        for factor in sp.Mul.make_args(sp.factor(e.args[0])):
            base, times = factor.as_base_exp()
            # no factor is 0 where the logarithm is defined
            signs = self._part.signs(base) - {0}
            if times.is_Rational and signs == POSITIVE:
                total += times * built(sp.log, [base])
            elif times.is_Integer and signs == NEGATIVE:
                total += times * built(sp.log, [-base])
                rest *= (-1) ** times
            else:
                rest *= factor
        return total if rest == 1 else total + built(sp.log, [rest])

    def _reciprocal(self, e: Any) -> Any:
        return self.resolved((sp.acos if e.func is sp.asec else sp.asin)(1 / e.args[0]))

    def _hyperbolic(self, e: Any) -> Any:
        (x,) = e.args
        if e.func is sp.asinh:
            return self.resolved(sp.log(x + sp.sqrt(x**2 + 1)))
        if e.func is sp.acosh:
            self._limit(x - 1)
            return self.resolved(sp.log(x + sp.sqrt(x**2 - 1)))
        self._limit(1 - x, 1 + x)
        return self.resolved(sp.log((1 + x) / (1 - x))) / 2


def is_infinite(e: Any) -> bool:
    """Whether a part that every value requires is undefined, infinite or imaginary."""
    if isinstance(e, sp.Piecewise):
        return False
    return e in (sp.zoo, sp.nan, sp.oo, -sp.oo, sp.I) or isinstance(e, sp.AccumBounds) or any(map(is_infinite, e.args))


_RULES: dict[Any, Any] = {
    sp.Abs: Resolution._absolute,
    sp.sign: Resolution._sign,
    sp.Heaviside: Resolution._step,
    sp.Max: Resolution._extreme,
    sp.Min: Resolution._extreme,
    sp.floor: Resolution._floor,
    sp.ceiling: Resolution._ceiling,
    sp.atan2: Resolution._direction,
    sp.asin: Resolution._arcsine,
    sp.acos: Resolution._arccosine,
    sp.atan: Resolution._arctangent,
    sp.acot: Resolution._arccotangent,
    sp.asec: Resolution._reciprocal,
    sp.acsc: Resolution._reciprocal,
    sp.asinh: Resolution._hyperbolic,
    sp.acosh: Resolution._hyperbolic,
    sp.atanh: Resolution._hyperbolic,
    sp.Pow: Resolution._power,
    sp.log: Resolution._logarithm,
}
