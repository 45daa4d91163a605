"""The domain of an identity: an interval for each symbol, and conditions that its points meet.

Bounds of single symbols are intervals. An inequality between symbols, such as x > y, makes one of them an expression in
the others and in their distance: x = y + t with t > 0. All other relations are conditions, which only select points.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import sympy as sp

from ..core.errors import InputError
from .balls import MANY_BITS, Unclear, Undefined, evaluate, is_below, is_true

# Simple numbers are tried first, because a counterexample with small numbers is easier to read.
SIMPLE = tuple(sp.Rational(p, q) for q in (1, 2, 3, 5) for p in range(1, 16))
# Points at which an inverse function or a step has a known value, or a pole or a jump occurs.
SPECIAL = (sp.S.Zero, sp.S.One, sp.S.NegativeOne, sp.pi / 2, sp.pi, -sp.pi / 2, 2 * sp.pi, -sp.pi, sp.pi / 4, sp.pi / 3)
# Range of the logarithmic scale on which some random points are close to an end or far out.
CLOSEST = 1e-6
FARTHEST = 1e4
# Digits of random numbers; shorter intervals need more.
DIGITS = (9, 17, 40)
# Attempts per point, after which the conditions are considered unsatisfiable.
ATTEMPTS = 40
# Probability that a symbol gets the value of another symbol or its negative.
TOGETHER = 0.15
# Probability of a special value, once simple values have been tried.
OFTEN = 0.2
# Domains with more faces are not divided; integers with more values are not enumerated.
FACES = 200
VALUES = 24


@dataclass(frozen=True)
class Interval:
    """An interval of real numbers between two exact numbers or infinities."""

    low: Any = -sp.oo
    high: Any = sp.oo
    low_closed: bool = False
    high_closed: bool = False

    @classmethod
    def of(cls, number: Any) -> Interval:
        return cls(number, number, True, True)

    @property
    def is_empty(self) -> bool:
        return not is_below(self.low, self.high, self.low_closed and self.high_closed)

    @property
    def closed_ends(self) -> list[Any]:
        return list(dict.fromkeys([self.low] * self.low_closed + [self.high] * self.high_closed))

    @property
    def signs(self) -> frozenset[int]:
        """The signs of its numbers."""
        zero = sp.Integer(0)
        present = {1: is_below(zero, self.high), 0: self.contains(zero), -1: is_below(self.low, zero)}
        return frozenset(sign for sign in present if present[sign])

    @property
    def inner_point(self) -> Any:
        """A number that is not an end, near neither end if both are finite."""
        third = sp.Rational(1, 3)
        if self.low == -sp.oo:
            return third if self.high == sp.oo else self.high - third
        return self.low + third if self.high == sp.oo else self.low + third * (self.high - self.low)

    @property
    def opened(self) -> Interval:
        """The interval without its ends."""
        return Interval(self.low, self.high)

    def contains(self, value: Any) -> bool:
        return is_below(self.low, value, self.low_closed) and is_below(value, self.high, self.high_closed)

    def __and__(self, other: Interval) -> Interval:
        lows = (self.low, self.low_closed), (other.low, other.low_closed)
        highs = (self.high, self.high_closed), (other.high, other.high_closed)
        low, low_closed = lows[is_below(self.low, other.low, not other.low_closed)]
        high, high_closed = highs[is_below(other.high, self.high, not other.high_closed)]
        return Interval(low, high, low_closed, high_closed)

    def __add__(self, other: Interval) -> Interval:
        return Interval(
            self.low + other.low,
            self.high + other.high,
            self.low_closed and other.low_closed,
            self.high_closed and other.high_closed,
        )

    def __mul__(self, factor: Any) -> Interval:
        """The multiple by a rational number other than 0."""
        if factor > 0:
            return Interval(factor * self.low, factor * self.high, self.low_closed, self.high_closed)
        return Interval(factor * self.high, factor * self.low, self.high_closed, self.low_closed)

    def between_integers(self) -> Interval:
        """The interval with rational ends moved inwards to integers."""
        low, high = self.low, self.high
        if low.is_Rational:
            low = sp.ceiling(low) if self.low_closed else sp.floor(low) + 1
        if high.is_Rational:
            high = sp.floor(high) if self.high_closed else sp.ceiling(high) - 1
        return Interval(low, high, self.low_closed or bool(low.is_Rational), self.high_closed or bool(high.is_Rational))


def linear(expression: Any) -> tuple[dict[Any, Any], Any] | None:
    """The rational coefficients of symbols and the constant of a linear expression; None for another expression."""
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
    return {s: c for s, c in coefficients.items() if c != 0}, constant


@dataclass(frozen=True)
class Domain:
    """The domain of an identity, or a part of that domain.

    Parameters
    ----------
    original : mapping
        The symbols of the identity with their intervals.
    conditions : tuple of relations
        All other relations between these symbols.
    intervals : mapping
        The symbols that vary independently on this part, with their intervals. Some are distances between symbols.
    values : mapping
        The other symbols, as expressions in those that vary.
    """

    original: Mapping[Any, Interval]
    conditions: tuple[Any, ...]
    intervals: Mapping[Any, Interval]
    values: Mapping[Any, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, symbols: Iterable[Any], relations: Iterable[Any]) -> Domain:
        """The domain given by relations and by the properties of symbols.

        Raises
        ------
        InputError
            If a relation is not an inequality, a symbol may only be 0, or no point meets the relations.
        """
        relations = [part for given in relations for part in _parts(given)]
        every = sorted(set(symbols).union(*(relation.free_symbols for relation in relations)), key=str)
        box = {s: _own_interval(s) for s in every}
        conditions = [sp.Ne(s, 0, evaluate=False) for s in every if s.is_zero is False]
        for relation in relations:
            form = _form(relation)
            if form is None or len(form[0]) != 1:
                conditions.append(relation)
                continue
            ((symbol, coefficient),) = form[0].items()
            bound = _positive(relation) + Interval.of(-form[1])
            box[symbol] &= bound * (1 / coefficient)
        box = {s: interval.between_integers() if s.is_integer else interval for s, interval in box.items()}
        domain = cls(box, tuple(conditions), box)
        if any(one.is_empty or _values(s, one) == [] for s, one in box.items()) or domain._by_distances is None:
            integers = ", ".join(str(s) for s in every if s.is_integer)
            raise InputError(
                f"assumptions: no point meets {', '.join(map(str, relations)) or 'them'}"
                + (f" ({integers} integer)" if integers else "")
            )
        return domain

    def enclosure(self, expression: Any) -> Interval | None:
        """All values of a linear expression in the symbols that vary; None for another expression."""
        form = linear(expression)
        if form is None:
            return None
        found = Interval.of(form[1])
        for symbol, coefficient in form[0].items():
            found += self.intervals.get(symbol, Interval()) * coefficient
        return found

    # ---- parts

    def fixed(self, symbol: Any, value: Any) -> Domain:
        """The part in which a symbol that varies has a value, a number or an expression in the others."""
        values = {s: v.xreplace({symbol: value}) for s, v in self.values.items()} | {symbol: value}
        return replace(self, intervals={s: i for s, i in self.intervals.items() if s != symbol}, values=values)

    def where(self, difference: Any, positive: Interval) -> Domain | None:
        """The part on which a linear expression is positive, or not negative; None if it is known to be empty.

        One of several symbols is written by the value of the expression. Its own bounds should follow from the bounds
        of the others; else the part that is described is larger.
        """
        form = linear(difference)
        if form is None or not form[0]:
            return self
        box, choices = dict(self.intervals), []
        for symbol, coefficient in form[0].items():
            rest = replace(self, intervals=box).enclosure(sp.expand(symbol - difference / coefficient))
            assert rest is not None
            bound = rest + positive * (1 / coefficient)
            box[symbol], own = box[symbol] & bound, box[symbol]
            choices.append(((bound & own) != bound, symbol.is_integer is True, symbol))
        part = replace(self, intervals=box)
        if any(one.is_empty for one in box.values()):
            return None
        _, is_integer, symbol = min(choices, key=lambda choice: choice[:2])
        if len(choices) == 1 or is_integer:
            return part
        distance = sp.Dummy("d", real=True)
        found = part.enclosure(difference)
        assert found is not None
        box[distance] = found & positive
        return part.fixed(symbol, sp.expand(symbol + (distance - difference) / form[0][symbol]))

    @cached_property
    def _by_distances(self) -> Domain | None:
        """The domain with symbols written by their distances from others; None if it is known to be empty."""
        whole: Domain | None = self
        for relation in self.conditions:
            if whole is not None and _form(relation) is not None:
                difference = (relation.gts - relation.lts).xreplace(dict(whole.values))
                whole = whole.where(sp.expand(difference), _positive(relation))
        return whole

    def faces(self) -> list[Domain] | None:
        """Open parts whose union contains the domain: the interior first, then the faces; None if there are too many.

        An integer with few values gives one part for each value.
        """
        whole = self._by_distances
        if whole is None:
            return []
        choices: list[list[tuple[Any, Any]]] = []
        for symbol, interval in whole.intervals.items():
            values = _values(symbol, interval)
            ends = interval.closed_ends if values is None else values
            inside = [(symbol, None)] if values is None and not interval.opened.is_empty else []
            choices.append(inside + [(symbol, end) for end in ends if has_properties(symbol, end)])
        if np.prod([float(len(choice)) for choice in choices]) > FACES:
            return None
        found = []
        for choice in product(*choices):
            part = replace(whole, intervals={s: interval.opened for s, interval in whole.intervals.items()})
            for symbol, value in choice:
                part = part if value is None else part.fixed(symbol, value)
            if not part._is_excluded:
                found.append(part)
        return sorted(found, key=lambda part: -len(part.intervals))

    def divided(self, difference: Any) -> list[Domain]:
        """Open parts where a linear expression is positive, negative and 0; none if only one of them has points."""
        difference = sp.expand(difference.xreplace(dict(self.values)))
        found = self.enclosure(difference)
        form = linear(difference)
        if found is None or form is None or not found.signs >= {-1, 1}:
            return []
        symbol, coefficient = next(iter(form[0].items()))
        at = self.fixed(symbol, sp.expand(symbol - difference / coefficient))
        positive = Interval(low=sp.Integer(0))
        parts = [self.where(difference, positive), self.where(-difference, positive), at]
        return [part for part in parts if part is not None and not part._is_excluded]

    @property
    def _is_excluded(self) -> bool:
        """Whether the fixed symbols have values that certainly violate a condition."""
        known = {s: v for s, v in self.values.items() if not v.free_symbols}
        for condition in self.conditions:
            try:
                if condition.free_symbols <= set(known) and not is_true(condition, known, MANY_BITS):
                    return True
            except (Undefined, Unclear):
                continue
        return False

    # ---- points

    def points(self, rng: np.random.Generator, count: int, most: int = 0) -> Iterator[dict[Any, Any]]:
        """Yield exact points as values of the original symbols; each point meets every condition.

        Half of the first ``count`` points are simple.
        """
        found = 0
        count, most = (count, most) if self.intervals else (1, 1)
        for attempt in range(ATTEMPTS * count):
            simple = attempt < 4 * count and found < count // 2
            point = self._point(rng, simple)
            if point is not None:
                found += 1
                yield point
            if found >= max(count, most):
                return

    def _point(self, rng: np.random.Generator, simple: bool) -> dict[Any, Any] | None:
        point: dict[Any, Any] = {}
        for symbol, interval in self.intervals.items():
            value = None
            if point and rng.random() < TOGETHER:
                # the value of another symbol, up to the sign
                value = list(point.values())[rng.integers(len(point))] * int(rng.choice([-1, 1]))
                value = value if interval.contains(value) and has_properties(symbol, value) else None
            if value is None:
                value = _number(symbol, interval, simple, rng)
            if value is None:
                return None
            point[symbol] = value
        point |= {s: sp.expand(value.xreplace(point)) for s, value in self.values.items()}
        whole = {s: point[s] for s in self.original}
        return whole if self._allows(whole) else None

    def _allows(self, point: Mapping[Any, Any]) -> bool:
        """Whether a point certainly lies in the intervals, meets the conditions and has the symbols' properties."""
        try:
            return all(
                interval.contains(point[s]) and has_properties(s, point[s]) for s, interval in self.original.items()
            ) and all(is_true(condition, point, MANY_BITS) for condition in self.conditions)
        except (Undefined, Unclear):
            return False


# Properties that are known of rational numbers only; signs are bounds of the domain.
_ARITHMETIC = {
    "integer", "noninteger", "even", "odd", "rational", "irrational", "prime", "composite", "algebraic",
    "transcendental",
}  # fmt: skip


def has_properties(symbol: Any, value: Any) -> bool:
    """Whether a number is known to have all properties of a symbol, such as even."""
    given = symbol.assumptions0
    if not value.is_Rational:
        return not _ARITHMETIC & set(given)
    return all(getattr(value, f"is_{name}") in (known, None) for name, known in given.items())


def _values(symbol: Any, interval: Interval) -> list[Any] | None:
    """The values of an integer symbol that has few; None if there are many or the symbol is not an integer."""
    low, high = interval.low, interval.high
    if not (symbol.is_integer and low.is_Integer and high.is_Integer and high - low < VALUES):
        return None
    return [n for n in map(sp.Integer, range(int(low), int(high) + 1)) if has_properties(symbol, n)]


def _number(symbol: Any, interval: Interval, simple: bool, rng: np.random.Generator) -> Any:
    """A random number of the interval; None if none was found."""
    inside, ends = interval.opened, interval.closed_ends
    if ends and (interval.low == interval.high or rng.random() < 0.2):
        return ends[rng.integers(len(ends))]
    if simple:
        for _ in range(20):
            value = int(rng.choice([-1, 1])) * SIMPLE[rng.integers(len(SIMPLE))]
            if inside.contains(value) and has_properties(symbol, value):
                return value
    special = SPECIAL[rng.integers(len(SPECIAL))]
    if rng.random() < OFTEN and interval.contains(special) and has_properties(symbol, special):
        return special
    value = _between(as_float(interval.low), as_float(interval.high), rng)
    if symbol.is_integer:
        # small, or in the range of other numbers
        number = sp.Integer(round(value) if rng.random() < 0.5 else int(rng.integers(-3, 4)))
        number += 0 if has_properties(symbol, number) else 1
        return number if interval.contains(number) else None
    for digits in DIGITS:
        exact = sp.Rational(np.format_float_positional(value, digits, unique=False, fractional=False))
        if inside.contains(exact):
            return exact
    # the interval is shorter than floats resolve
    point = interval.inner_point
    exact = point if point.is_Rational else sp.Rational(str(sp.N(point, DIGITS[-1])))
    return exact if inside.contains(exact) else None


def as_float(end: Any) -> float:
    """The float next to an exact number or infinity."""
    return float(end) if end in (sp.oo, -sp.oo) else float(evaluate(end, {}, MANY_BITS).ball.mid())


def _between(low: float, high: float, rng: np.random.Generator) -> float:
    """A random number in an interval: uniform, or on a logarithmic scale near an end or far out."""
    if np.isinf(low) and np.isinf(high):
        return float(rng.choice([-1.0, 1.0])) * _logarithmic(rng, FARTHEST)
    if np.isinf(high):
        return low + _logarithmic(rng, FARTHEST)
    if np.isinf(low):
        return high - _logarithmic(rng, FARTHEST)
    fraction = rng.random() if rng.random() < 0.5 else _logarithmic(rng, 0.5)
    return low + (high - low) * (fraction if rng.random() < 0.5 else 1.0 - fraction)


def _logarithmic(rng: np.random.Generator, top: float) -> float:
    return float(np.exp(rng.uniform(np.log(CLOSEST), np.log(top))))


_ORDER = (sp.Lt, sp.Le, sp.Gt, sp.Ge)


def _parts(given: Any) -> list[Any]:
    if given is sp.true:
        return []
    if given is sp.false:
        raise InputError("assumptions: no point meets them, because one is false")
    if isinstance(given, sp.And):
        return [part for argument in given.args for part in _parts(argument)]
    if isinstance(given, _ORDER) and (given.gts is sp.oo or given.lts is -sp.oo):
        # of all real numbers
        return []
    if isinstance(given, (*_ORDER, sp.Ne, sp.Or, sp.Not)):
        return [given]
    raise InputError(
        f"assumptions: expected inequalities such as 0 < theta, got {given!r}; substitute equations in both sides first"
    )


def _own_interval(symbol: Any) -> Interval:
    """The interval by the properties of a symbol."""
    if symbol.is_zero:
        raise InputError(f"{symbol}: expected a symbol that may differ from 0; substitute 0 for it in both sides")
    if symbol.is_nonnegative:
        return Interval(low=sp.Integer(0), low_closed=not symbol.is_positive)
    if symbol.is_nonpositive:
        return Interval(high=sp.Integer(0), high_closed=not symbol.is_negative)
    return Interval()


def _form(relation: Any) -> tuple[dict[Any, Any], Any] | None:
    """The linear form that a relation makes positive, or not negative; None if there is none."""
    return linear(relation.gts - relation.lts) if isinstance(relation, _ORDER) else None


def _positive(relation: Any) -> Interval:
    """The values that a relation allows for the difference of its sides."""
    return Interval(low=sp.Integer(0), low_closed=not isinstance(relation, sp.Gt | sp.Lt))
