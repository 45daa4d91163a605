"""The domain of an identity: real or integer symbols, inequalities between them, and further conditions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import sympy as sp
from flint import ctx

from ..core.errors import InputError
from .balls import Unclear, Undefined, evaluate, is_true
from .polyhedron import BITS, Inequality, Polyhedron, is_below, sign_of

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
class Domain:
    """The domain of an identity, or a part of that domain.

    Parameters
    ----------
    symbols : tuple of symbols
        The real symbols that vary.
    inequalities : tuple of Inequality
        The linear inequalities in these symbols.
    conditions : tuple of relations
        All other conditions, in the original symbols.
    values : mapping
        The symbols that do not vary on this part, as expressions in those that do.
    original : tuple of symbols
        The symbols of the whole domain, whose values `points` returns.
    """

    symbols: tuple[Any, ...]
    inequalities: tuple[Inequality, ...] = ()
    conditions: tuple[Any, ...] = ()
    values: Mapping[Any, Any] = field(default_factory=dict)
    original: tuple[Any, ...] = ()

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
        inequalities = [bound for symbol in every for bound in _own_bounds(symbol)]
        conditions = [
            sp.Ne(symbol, 0, evaluate=False)
            for symbol in every
            if symbol.is_zero is False and not (symbol.is_extended_positive or symbol.is_extended_negative)
        ]
        for relation in relations:
            linear = None
            if not isinstance(relation, sp.Ne):
                linear = Inequality.of(relation.gts - relation.lts, isinstance(relation, sp.Gt | sp.Lt))
            if linear is None:
                conditions.append(relation)
            else:
                inequalities.append(tightened(linear))
        domain = cls(tuple(every), tuple(inequalities), tuple(conditions), {}, tuple(every))
        if domain.is_empty:
            raise InputError(f"assumptions: no point meets {', '.join(map(str, relations)) or 'them'}{_ranges(domain)}")
        return domain

    @cached_property
    def polyhedron(self) -> Polyhedron:
        return Polyhedron(self.symbols, self.inequalities)

    @cached_property
    def is_empty(self) -> bool:
        """Whether the domain is known to contain no point."""
        if self.polyhedron.is_empty:
            return True
        for symbol in self.symbols:
            low, high, low_closed, high_closed = self.interval(symbol)
            numbers = _few_integers(low, high) if symbol.is_integer else None
            bounds = low, high, low_closed, high_closed
            if numbers is not None and not any(_is_inside(n, bounds) and has_properties(symbol, n) for n in numbers):
                return True
        return False

    def interval(self, symbol: Any) -> tuple[Any, Any, bool, bool]:
        """The ends of a symbol's interval, and whether each end belongs to the interval."""
        if symbol not in self._intervals:
            others = [s for s in self.symbols if s != symbol]
            self._intervals[symbol] = Polyhedron([symbol, *others], self.inequalities).bounds(0, {})
        return self._intervals[symbol]

    @cached_property
    def _intervals(self) -> dict[Any, tuple[Any, Any, bool, bool]]:
        return {}

    # ---- parts

    def fixed(self, symbol: Any, value: Any) -> Domain | None:
        """The part in which a symbol has a value, an expression in the others; None if this is not linear."""
        inequalities = [one.substituted(symbol, value) for one in self.inequalities]
        if None in inequalities:
            return None
        values = {s: v.xreplace({symbol: value}) for s, v in self.values.items()} | {symbol: value}
        symbols = tuple(s for s in self.symbols if s != symbol)
        return replace(self, symbols=symbols, inequalities=tuple(filter(None, inequalities)), values=values)

    def where(self, one: Inequality) -> Domain:
        """The part in which one more inequality holds."""
        return replace(self, inequalities=(*self.inequalities, one))

    def replaced(self, symbol: Any, value: Any, new: Any, inequalities: Iterable[Inequality] = ()) -> Domain:
        """The domain with ``symbol`` written as an expression in a new symbol."""
        part = self.fixed(symbol, value)
        assert part is not None
        return replace(part, symbols=(*part.symbols, new), inequalities=(*part.inequalities, *inequalities))

    def cells(self) -> list[Domain] | None:
        """Open parts whose union is the domain: the interior and the faces; None if there are too many.

        An integer with few values gives one part for each value.
        """
        parts = [self]
        for symbol in self.symbols:
            parts = [piece for part in parts for piece in part._by_integers(symbol)]
        found: list[Domain] = []
        for part in parts:
            closed = [one for one in part.inequalities if not one.strict and one.coefficients]
            if len(parts) * 2 ** len(closed) > FACES:
                return None
            for on_face in product((False, True), repeat=len(closed)):
                cell: Domain | None = replace(
                    part,
                    inequalities=(
                        *(one for one in part.inequalities if one.strict),
                        *(replace(one, strict=True) for one, face in zip(closed, on_face, strict=True) if not face),
                    ),
                )
                for one in (one for one, face in zip(closed, on_face, strict=True) if face):
                    cell = cell.on(one) if cell is not None else None
                if cell is not None and not cell.is_empty and cell.has_allowed_values:
                    found.append(cell)
        # the interior comes first
        return sorted(found, key=lambda cell: -len(cell.symbols))

    def _by_integers(self, symbol: Any) -> list[Domain]:
        if not symbol.is_integer:
            return [self]
        bounds = self.interval(symbol)
        numbers = _few_integers(*bounds[:2])
        if numbers is None:
            return [self]
        allowed = [n for n in numbers if _is_inside(n, bounds) and has_properties(symbol, n)]
        return [part for n in allowed if (part := self.fixed(symbol, n)) is not None]

    def on(self, one: Inequality) -> Domain | None:
        """The part where the left side of an inequality is 0, None if there is none."""
        here = Inequality.of(one.expression.xreplace(dict(self.values)), False)
        assert here is not None
        for symbol, coefficient in here.coefficients.items():
            return self.fixed(symbol, sp.expand(symbol - here.expression / coefficient))
        return self if sign_of(here.constant) == 0 else None

    @property
    def has_allowed_values(self) -> bool:
        """Whether the fixed symbols have values that agree with their properties and with the conditions."""
        fixed = {s: v for s, v in self.values.items() if not v.free_symbols}
        if any(lacks_properties(symbol, value) for symbol, value in fixed.items()):
            return False
        decided = [c for c in self.conditions if c.free_symbols and c.free_symbols <= set(fixed)]
        return not any(_is_false(condition, fixed) for condition in decided)

    # ---- points

    def points(self, rng: np.random.Generator, count: int, most: int = 0) -> Iterator[dict[Any, Any]]:
        """Yield exact points as values of the original symbols; each point meets every condition.

        Half of the first ``count`` points are simple.
        """
        found = 0
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
        for position, symbol in enumerate(self.symbols):
            bounds = self.polyhedron.bounds(position, point)
            value = None
            if point and rng.random() < TOGETHER:
                # the value of another symbol, up to the sign
                value = list(point.values())[rng.integers(len(point))] * int(rng.choice([-1, 1]))
                value = value if _is_inside(value, bounds) and has_properties(symbol, value) else None
            if value is None:
                value = _number(symbol, bounds, simple, rng)
            if value is None:
                return None
            point[symbol] = value
        return self._whole(point)

    def _whole(self, point: Mapping[Any, Any]) -> dict[Any, Any] | None:
        """The values of the original symbols, None if they violate a condition."""
        point = {**point, **{s: value.xreplace(dict(point)) for s, value in self.values.items()}}
        whole = {s: point[s] for s in self.original}
        return whole if self.allows(whole) else None

    def allows(self, point: Mapping[Any, Any]) -> bool:
        """Whether a point of the original symbols has their properties and certainly meets the conditions."""
        try:
            return all(has_properties(s, value) for s, value in point.items()) and all(
                is_true(condition, point, BITS) for condition in self.conditions
            )
        except (Undefined, Unclear):
            return False


# Properties that are known of rational numbers only; signs are inequalities of the domain.
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


def lacks_properties(symbol: Any, value: Any) -> bool:
    """Whether a number is known to lack a property of a symbol."""
    return bool(value.is_Rational and not has_properties(symbol, value))


def _few_integers(low: Any, high: Any) -> list[Any] | None:
    """All integers from one number to another, with one more at each end; None if they are many."""
    if low == -sp.oo or high == sp.oo or not is_below(high - low, sp.Integer(VALUES)):
        return None
    with ctx.workprec(BITS):
        first, last = (evaluate(end, {}, BITS).ball.floor().unique_fmpz() for end in (low, high))
    return None if None in (first, last) else [sp.Integer(n) for n in range(int(first), int(last) + 2)]


def _is_false(condition: Any, point: Mapping[Any, Any]) -> bool:
    try:
        return not is_true(condition, point, BITS)
    except Undefined:
        return True
    except Unclear:
        return False


def _is_inside(value: Any, bounds: tuple[Any, Any, bool, bool]) -> bool:
    low, high, low_closed, high_closed = bounds
    return is_below(low, value, low_closed) and is_below(value, high, high_closed)


def _number(symbol: Any, bounds: tuple[Any, Any, bool, bool], simple: bool, rng: np.random.Generator) -> Any:
    low, high, low_closed, high_closed = bounds
    ends = [end for end, closed in ((low, low_closed), (high, high_closed)) if closed]
    if low == high:
        return low if ends else None
    if ends and rng.random() < 0.2:
        return ends[rng.integers(len(ends))]
    if simple:
        for _ in range(20):
            value = int(rng.choice([-1, 1])) * SIMPLE[rng.integers(len(SIMPLE))]
            if _is_inside(value, (low, high, False, False)) and has_properties(symbol, value):
                return value
    special = SPECIAL[rng.integers(len(SPECIAL))]
    if rng.random() < OFTEN and _is_inside(special, bounds) and has_properties(symbol, special):
        return special
    value = _between(as_float(low), as_float(high), rng)
    if symbol.is_integer:
        # small, or in the range of other numbers
        number = sp.Integer(round(value) if rng.random() < 0.5 else int(rng.integers(-3, 4)))
        if symbol.is_even is not None and symbol.is_even != number.is_even:
            number += 1
        return number if _is_inside(number, bounds) else None
    for digits in DIGITS:
        exact = sp.Rational(np.format_float_positional(value, digits, unique=False, fractional=False))
        if _is_inside(exact, (low, high, False, False)):
            return exact
    # the interval is shorter than floats resolve
    middle = (low + high) / 2
    exact = middle if middle.is_Rational else sp.Rational(str(sp.N(middle, DIGITS[-1])))
    return exact if _is_inside(exact, (low, high, False, False)) else None


def as_float(end: Any) -> float:
    """The float next to an exact number or infinity."""
    return float(end) if end in (sp.oo, -sp.oo) else float(evaluate(end, {}, BITS).ball.mid())


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


def _parts(given: Any) -> list[Any]:
    if given is sp.true:
        return []
    if given is sp.false:
        raise InputError("assumptions: no point meets them, because one is false")
    if isinstance(given, sp.And):
        return [part for argument in given.args for part in _parts(argument)]
    if isinstance(given, sp.Ne | sp.Lt | sp.Le | sp.Gt | sp.Ge):
        return [given]
    raise InputError(
        f"assumptions: expected inequalities such as 0 < theta, got {given!r}; substitute equations in both sides first"
    )


def _own_bounds(symbol: Any) -> list[Inequality]:
    if symbol.is_zero:
        raise InputError(f"{symbol}: expected a symbol that may differ from 0; substitute 0 for it in both sides")
    if symbol.is_nonnegative:
        return [tightened(Inequality({symbol: sp.Integer(1)}, sp.Integer(0), bool(symbol.is_positive)))]
    if symbol.is_nonpositive:
        return [tightened(Inequality({symbol: sp.Integer(-1)}, sp.Integer(0), bool(symbol.is_negative)))]
    return []


def tightened(one: Inequality) -> Inequality:
    """Move the bound of a single integer symbol to the next integer and make it non-strict."""
    if len(one.coefficients) != 1:
        return one
    ((symbol, coefficient),) = one.coefficients.items()
    end = one.end(symbol, {})
    if not symbol.is_integer or not end.is_Rational:
        return one
    if coefficient > 0:
        end = sp.floor(end) + 1 if one.strict else sp.ceiling(end)
        return Inequality({symbol: sp.Integer(1)}, -end, False)
    end = sp.ceiling(end) - 1 if one.strict else sp.floor(end)
    return Inequality({symbol: sp.Integer(-1)}, end, False)


def _ranges(domain: Domain) -> str:
    empty = [s for s in domain.symbols if s.is_integer]
    return f" ({', '.join(map(str, empty))} integer)" if empty else ""
