"""The domain of an identity: an interval for every symbol, and conditions that tie symbols together.

Imported only by functions, because it imports sympy.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from ..errors import InputError

# Simple numbers first, because a counterexample of small numbers is read more easily.
SIMPLE = tuple(sp.Rational(p, q) for q in (1, 2, 3, 5) for p in range(1, 16))
RANDOM_POINTS = 24
# Some random points lie this close to an end of the interval, or this far out, on a logarithmic scale.
CLOSEST = 1e-6
FARTHEST = 1e4
# So many simple numbers are tried for a symbol.
SIMPLE_TRIES = 40
# Random numbers are rounded to so many digits, or to more where the interval is shorter than that.
DIGITS = (9, 17, 40)
# A point of the domain is looked for so many times before the conditions are taken for empty.
ATTEMPTS = 1000


@dataclass(frozen=True)
class Domain:
    """Intervals, exact, one a symbol, taken without their ends; ``closed`` says that some end belongs to the domain.

    ``conditions`` are the relations that are not the bound of one symbol.
    """

    intervals: dict[Any, tuple[Any, Any]]
    conditions: tuple[Any, ...] = ()
    closed: bool = False

    @classmethod
    def of(cls, symbols: Iterable[Any], assumptions: Iterable[Any]) -> Domain:
        """Read the assumptions of the symbols themselves, and relations such as ``0 < theta``.

        Raises
        ------
        InputError
            If an assumption is no inequality, or a symbol is not real, or an interval is empty.
        """
        relations = [part for given in assumptions for part in _relations(given)]
        every = set(symbols).union(*(relation.free_symbols for relation in relations))
        intervals = {symbol: _own_interval(symbol) for symbol in sorted(every, key=str)}
        conditions = []
        closed = any(
            (s.is_nonnegative and not s.is_positive) or (s.is_nonpositive and not s.is_negative) for s in every
        )
        for relation in relations:
            bound = _bound(relation)
            if bound is None:
                conditions.append(relation)
                continue
            symbol, low, high = bound
            closed = closed or isinstance(relation, sp.Le | sp.Ge)
            old_low, old_high = intervals[symbol]
            intervals[symbol] = sp.Max(old_low, low), sp.Min(old_high, high)
        for symbol, (low, high) in intervals.items():
            if not bool(low < high):
                raise InputError(f"assumptions: no value of {symbol} lies between {low} and {high}")
        return cls(intervals, tuple(conditions), closed)

    def points(self, rng: np.random.Generator) -> Iterator[dict[Any, Any]]:
        """Rational points inside, simple ones first, that meet the conditions and what the symbols carry, exactly."""
        found = 0
        for attempt in range(ATTEMPTS):
            simple = attempt < ATTEMPTS // 4 and found < RANDOM_POINTS // 2
            point = {symbol: self._value(symbol, simple, rng) for symbol in self.intervals}
            conditions_met = all(condition.xreplace(point) is sp.true for condition in self.conditions)
            if conditions_met and all(_fits(symbol, value) for symbol, value in point.items()):
                found += 1
                yield point
            if found >= RANDOM_POINTS:
                return
        if not found and self.conditions:
            raise InputError(f"assumptions: no point was found that meets {', '.join(map(str, self.conditions))}")

    def _value(self, symbol: Any, simple: bool, rng: np.random.Generator) -> Any:
        low, high = self.intervals[symbol]
        if simple:
            for sign in rng.choice([-1, 1], SIMPLE_TRIES):
                value = int(sign) * SIMPLE[rng.integers(len(SIMPLE))]
                if bool(low < value) and bool(value < high) and _fits(symbol, value):
                    return value
        value = _between(float(low), float(high), rng)
        if symbol.is_integer:
            return sp.Integer(round(value))
        for digits in DIGITS:
            exact = sp.Rational(np.format_float_positional(value, digits, unique=False, fractional=False))
            if bool(low < exact) and bool(exact < high):
                return exact
        # shorter than floats can tell
        return sp.Rational(str(sp.N((low + high) / 2, DIGITS[-1])))


def _between(low: float, high: float, rng: np.random.Generator) -> float:
    """A number in an interval: anywhere, or near an end or far out on a logarithmic scale."""
    if np.isinf(low) and np.isinf(high):
        return float(rng.choice([-1.0, 1.0])) * _logarithmic(rng, FARTHEST)
    if np.isinf(high):
        return low + _logarithmic(rng, FARTHEST)
    if np.isinf(low):
        return high - _logarithmic(rng, FARTHEST)
    share = rng.random() if rng.random() < 0.5 else _logarithmic(rng, 0.5)
    return low + (high - low) * (share if rng.random() < 0.5 else 1.0 - share)


def _fits(symbol: Any, value: Any) -> bool:
    """Whether a number has the properties that a symbol carries: even, say, or not zero."""
    return all(getattr(value, f"is_{name}") in (given, None) for name, given in symbol.assumptions0.items())


def _logarithmic(rng: np.random.Generator, top: float) -> float:
    return float(np.exp(rng.uniform(np.log(CLOSEST), np.log(top))))


def _relations(given: Any) -> list[Any]:
    given = sp.sympify(given)
    if given is sp.true:
        return []
    if isinstance(given, sp.And):
        return [part for argument in given.args for part in _relations(argument)]
    if isinstance(given, sp.Ne) or (isinstance(given, sp.core.relational.Relational) and not isinstance(given, sp.Eq)):
        return [given]
    raise InputError(
        f"assumptions: expected inequalities such as 0 < theta, got {given!r}; substitute equations in both sides first"
    )


def _own_interval(symbol: Any) -> tuple[Any, Any]:
    if symbol.is_real is False:
        raise InputError(f"{symbol}: expected a real symbol, because identities are verified over the real numbers")
    if symbol.is_zero:
        raise InputError(f"{symbol}: expected a symbol that may differ from 0; substitute 0 for it in both sides")
    if symbol.is_nonnegative:
        return sp.Integer(0), sp.oo
    if symbol.is_nonpositive:
        return -sp.oo, sp.Integer(0)
    return -sp.oo, sp.oo


def _bound(relation: Any) -> tuple[Any, Any, Any] | None:
    if isinstance(relation, sp.Ne):
        return None
    small, large = relation.lts, relation.gts
    if large.is_Symbol and small.is_number:
        return large, small, sp.oo
    if small.is_Symbol and large.is_number:
        return small, -sp.oo, large
    return None
