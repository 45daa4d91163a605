"""Linear inequalities between symbols: whether they are consistent, and the bounds of each symbol."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy as sp

from .balls import Unclear, Undefined, evaluate

# Bits that suffice to compare any two different numbers that a user writes as ends of intervals.
BITS = 2000


@dataclass(frozen=True)
class Inequality:
    """sum of coefficient * symbol + constant is positive (``strict``) or not negative."""

    coefficients: Mapping[Any, Any]
    constant: Any
    strict: bool

    @classmethod
    def of(cls, expression: Any, strict: bool) -> Inequality | None:
        """expression > 0 or >= 0 if it is linear with rational coefficients, else None."""
        constant = sp.Integer(0)
        coefficients: dict[Any, Any] = {}
        for term in sp.Add.make_args(sp.expand(expression)):
            fraction, unit = term.as_coeff_Mul(rational=True)
            if not term.free_symbols:
                constant += term
            elif unit.is_Symbol:
                coefficients[unit] = coefficients.get(unit, 0) + fraction
            else:
                return None
        if constant.has(sp.oo, sp.zoo, sp.nan, sp.I):
            return None
        return cls({s: c for s, c in coefficients.items() if c != 0}, constant, strict)

    @property
    def expression(self) -> Any:
        """The left side as a sympy expression."""
        return sp.Add(*(c * s for s, c in self.coefficients.items()), self.constant)

    def negated(self) -> Inequality:
        """The opposite inequality."""
        return Inequality({s: -c for s, c in self.coefficients.items()}, -self.constant, not self.strict)

    def substituted(self, symbol: Any, value: Any) -> Inequality | None:
        """The inequality for a value of one symbol, None if it is then not linear."""
        return Inequality.of(self.expression.xreplace({symbol: value}), self.strict)

    def end(self, symbol: Any, point: Mapping[Any, Any]) -> Any:
        """The bound that the inequality sets to one symbol if the others are given."""
        rest = sp.Add(*(c * point[s] for s, c in self.coefficients.items() if s != symbol), self.constant)
        return -rest / self.coefficients[symbol]


def sign_of(number: Any) -> int:
    """The sign of an exact number; raises `Unclear` if the number is not real or cannot be distinguished from 0."""
    if number.is_Rational or number in (sp.oo, -sp.oo):
        return int(sp.sign(number))
    try:
        with suppress(Unclear):
            return evaluate(number, {}, 100).sign
        return evaluate(sp.expand(number, power_exp=False, power_base=False, log=False), {}, BITS).sign
    except Undefined as error:
        raise Unclear from error


def is_below(low: Any, high: Any, also_equal: bool = False) -> bool:
    """Whether one exact number, or infinity, is below another, or also if both are equal."""
    if -sp.oo in (low, -high):
        return True
    sign = sign_of(high - low)
    return sign > 0 or (also_equal and sign == 0)


class Polyhedron:
    """The solutions of linear inequalities; symbols are eliminated one by one (Fourier and Motzkin)."""

    def __init__(self, symbols: Sequence[Any], inequalities: Iterable[Inequality]) -> None:
        self.symbols, self.inequalities = tuple(symbols), tuple(inequalities)

    @cached_property
    def _tower(self) -> tuple[list[tuple[Any, list[Inequality]]], bool]:
        """The bounds of every symbol in terms of earlier symbols, and whether all inequalities are consistent."""
        remaining, tower = list(self.inequalities), []
        for symbol in reversed(self.symbols):
            here = [one for one in remaining if symbol in one.coefficients]
            remaining = [one for one in remaining if symbol not in one.coefficients]
            below = [one for one in here if one.coefficients[symbol] > 0]
            above = [one for one in here if one.coefficients[symbol] < 0]
            remaining += [_sum(a, -b.coefficients[symbol], b, a.coefficients[symbol]) for a in below for b in above]
            tower.append((symbol, here))
        signs = [(sign_of(one.constant), one.strict) for one in remaining]
        return tower[::-1], all(sign > 0 or (sign == 0 and not strict) for sign, strict in signs)

    @property
    def is_empty(self) -> bool:
        return not self._tower[1]

    def bounds(self, position: int, point: Mapping[Any, Any]) -> tuple[Any, Any, bool, bool]:
        """Ends of a symbol's interval for given values of earlier symbols, and whether each end belongs to it."""
        symbol, here = self._tower[0][position]
        low, high, low_closed, high_closed = -sp.oo, sp.oo, False, False
        for one in here:
            end = one.end(symbol, point)
            if one.coefficients[symbol] > 0:
                closer = sign_of(end - low) if low != -sp.oo else 1
                if closer > 0 or (closer == 0 and one.strict):
                    low, low_closed = end, not one.strict
            else:
                closer = sign_of(high - end) if high != sp.oo else 1
                if closer > 0 or (closer == 0 and one.strict):
                    high, high_closed = end, not one.strict
        return low, high, low_closed, high_closed

    def implies(self, one: Inequality) -> bool:
        """Whether an inequality holds at every point."""
        opposite = one.negated()
        return Polyhedron(self.symbols, (*self.inequalities, opposite)).is_empty


def _sum(a: Inequality, times: Any, b: Inequality, other_times: Any) -> Inequality:
    coefficients = {
        s: times * a.coefficients.get(s, 0) + other_times * b.coefficients.get(s, 0)
        for s in {*a.coefficients, *b.coefficients}
    }
    return Inequality(
        {s: c for s, c in coefficients.items() if c != 0},
        times * a.constant + other_times * b.constant,
        a.strict or b.strict,
    )
