"""Exact derivations of equalities and inequalities on a domain, part by part.

The domain is divided into its interior and its faces, and further at the points where a function jumps or bends. On
each part both sides are resolved into smooth functions. They are compared by a normal form, by squares, or by a
vanishing derivative of their difference. A part on which one side is defined nowhere needs no proof.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from typing import Any

import sympy as sp

from .balls import Unclear, Undefined, evaluate
from .domain import Domain, tightened
from .normal_form import vanishes
from .polyhedron import Inequality
from .resolution import Nowhere, Resolution
from .signs import NOT_NEGATIVE, POSITIVE, Part, is_continuous, is_infinite, is_muddled
from .verdict import Verdict
from .zeros import zeros_in

# Limits on the number of parts and on the depth of their subdivision.
PARTS = 400
DEPTH = 8
# Algebraic numbers with more operations are not examined.
LARGEST_NUMBER = 60
NUMBER_BITS = 256

# Half-widths of the intervals around a fixed value on which a proof is also tried.
NEAR = (sp.Rational(1, 64), sp.Integer(4))
# A symbol with this prefix is half of an integer and is not halved again.
HALF = "half of "

EXPANSION = "expansion"
NORMAL_FORM = "polynomial normal form"
SQUARES = "neither side is negative, and the polynomial normal forms of the squares agree"
DERIVATIVE = "the derivative of the difference vanishes on a connected domain, and so does the difference at one point"
CONDITION = "a condition, an equation"
INSIDE = "one function of equal things"
ALGEBRAIC = "algebraic numbers"
ANGLES = "the sine of the difference is 0, and the difference is small"
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
    spreads : bool
        Whether a claim that is not proved at one value of a symbol is tried on an interval around this value.

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
    spreads: bool = True
    methods: list[str] = field(default_factory=list, init=False)
    reason: str = field(default="no known method proves it", init=False)
    _parts: int = field(default=0, init=False)
    _failed: bool = field(default=False, init=False)

    def verdict(self, domain: Domain) -> Verdict | None:
        """Return *proved* or *refuted*, or None with a `reason`."""
        cells = domain.cells()
        if cells is None:
            self.reason = "the domain has too many faces"
            return None
        for cell in cells:
            found = self._tried(cell, 0)
            if found is not None or self._failed:
                return found
        return Verdict("proved", "; ".join(dict.fromkeys(self.methods)) or "defined nowhere on the domain")

    def _give_up(self, reason: str | None = None) -> None:
        self._failed = True
        self.reason = reason or self.reason

    def _tried(self, domain: Domain, depth: int) -> Verdict | None:
        try:
            return self._on(domain, depth)
        except sp.polys.polyerrors.BasePolynomialError as error:
            self._give_up(f"sympy's polynomials do not serve: {error}")
            return None
        except Unclear:
            self._give_up("two numbers could not be told apart")
            return None

    def _on(self, domain: Domain, depth: int) -> Verdict | None:
        """Return a refutation on an open part, or None; then the part is proved unless `_failed` is set."""
        if domain.is_empty or not domain.has_allowed_values:
            return None
        self._parts += 1
        if self._parts > PARTS:
            self._give_up("too many parts")
            return None
        if depth:
            refuted = self.refute(domain, 3)
            if refuted is not None:
                return refuted
        box = boxed(domain)
        if box.polyhedron.is_empty:
            return None
        values = dict(box.values)
        left, right = (side.xreplace(values) for side in (self.left, self.right))
        if is_muddled(left) or is_muddled(right):
            self._give_up("sympy does not know a power of 0")
            return None
        if is_infinite(left) or is_infinite(right):
            return None
        part = Part(box)
        if self.relation == "==":
            method = equal_as_written(left, right, part)
            if method is not None:
                self.methods.append(method)
                return None
        resolution = Resolution(part)
        try:
            left, right = resolution.resolved(left), resolution.resolved(right)
        except Nowhere:
            return None
        method = self._method(left, right, part)
        if method is not None:
            self.methods.append(method)
            return None
        expressions = [*resolution.undetermined, *resolution.limits]
        if self.relation != "==":
            # the part is also cut where the difference or its slope changes sign
            difference = right - left
            slopes = [sp.diff(difference, symbol) for symbol in box.symbols]
            arguments = [f.args[0] for f in sorted(difference.atoms(sp.Function), key=str)]
            expressions += [difference, *slopes, *arguments, *box.symbols]
        pieces = self._pieces(box, expressions, resolution.undetermined) if depth < DEPTH else None
        if pieces is None:
            if not self._is_proved_around(domain):
                self._give_up()
            return None
        for piece in pieces:
            found = self._tried(piece, depth + 1)
            if found is not None or self._failed:
                return found
        return None

    def _is_proved_around(self, domain: Domain) -> bool:
        """Whether the claim is proved on an open interval around the value of one fixed symbol."""
        fixed = [s for s, v in domain.values.items() if s in domain.original and not s.is_integer and v.is_number]
        for symbol, reach in product(fixed if self.spreads else [], NEAR):
            value = domain.values[symbol]
            near = replace(
                domain,
                symbols=(*domain.symbols, symbol),
                inequalities=(
                    *domain.inequalities,
                    Inequality({symbol: sp.Integer(1)}, reach - value, strict=True),
                    Inequality({symbol: sp.Integer(-1)}, reach + value, strict=True),
                ),
                values={s: v for s, v in domain.values.items() if s != symbol},
            )
            there = Derivation(self.left, self.right, self.relation, lambda *_: None, spreads=False)
            there._tried(near, DEPTH - 1)
            if not there._failed:
                self.methods += there.methods
                return True
        return False

    def _method(self, left: Any, right: Any, part: Part) -> str | None:
        if self.relation == "==":
            return derive_equality(left, right, part)
        difference = right - left
        allowed = POSITIVE if self.relation == "<" else NOT_NEGATIVE
        if part.thorough_signs(difference) <= allowed or _signs_of_steps(difference, part) <= allowed:
            return SIGN
        if self.relation == "<=" and derive_equality(left, right, part) is not None:
            return NORMAL_FORM
        return None

    @staticmethod
    def _pieces(domain: Domain, expressions: list[Any], undetermined: list[Any]) -> list[Domain] | None:
        """The part cut at the zeros of the first suitable expression, else by the sign of an undetermined one."""
        for e in dict.fromkeys(factor for point in expressions for factor in sp.Mul.make_args(point)):
            symbols = [s for s in domain.symbols if e.has(s)]
            if len(symbols) == 1 and e.free_symbols <= set(symbols):
                (symbol,) = symbols
                low, high, *_ = domain.interval(symbol)
                try:
                    cuts = zeros_in(e, symbol, low, high)
                except (Undefined, Unclear):
                    continue
                if cuts:
                    return _cut(domain, symbol, cuts)
            elif len(symbols) > 1:
                linear = Inequality.of(e, strict=True) or _linear_factor(e)
                if linear is None:
                    continue
                opposite = Inequality.of(-linear.expression, strict=True)
                assert opposite is not None
                pieces = [domain.where(linear), domain.where(opposite), domain.on(linear)]
                return [piece for piece in pieces if piece is not None]
        for e in dict.fromkeys(undetermined):
            if len(e.free_symbols & set(domain.symbols)) > 1:
                # the sign of e becomes a condition of each piece
                return [
                    replace(domain, conditions=(*domain.conditions, relation(e, 0, evaluate=False)))
                    for relation in (sp.Gt, sp.Lt, sp.Eq)
                ]
        for symbol in domain.symbols:
            if symbol.is_integer and symbol.is_even is None and not symbol.name.startswith(HALF):
                even_and_odd = [(sp.Dummy(f"{HALF}{symbol}", integer=True), rest) for rest in (0, 1)]
                return [domain.replaced(symbol, 2 * half + rest, half) for half, rest in even_and_odd]
        return None


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


def _linear_factor(e: Any) -> Inequality | None:
    if not e.is_polynomial():
        return None
    for factor in sp.Mul.make_args(sp.factor(e)):
        linear = Inequality.of(factor.as_base_exp()[0], strict=True)
        if linear is not None and linear.coefficients:
            return linear
    return None


def _cut(domain: Domain, symbol: Any, cuts: list[Any]) -> list[Domain] | None:
    pieces = []
    for low, high in pairwise([None, *cuts, None]):
        piece = domain
        if low is not None:
            piece = piece.where(tightened(Inequality({symbol: sp.Integer(1)}, -low, strict=True)))
        if high is not None:
            piece = piece.where(tightened(Inequality({symbol: sp.Integer(-1)}, high, strict=True)))
        # few values of an integer may remain
        cells = piece.cells() if symbol.is_integer else [piece]
        if cells is None:
            return None
        pieces += cells
    points = [domain.fixed(symbol, cut) for cut in cuts]
    return pieces + [point for point in points if point is not None]


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


def derive_equality(left: Any, right: Any, part: Part, differentiate: int = 2) -> str | None:
    """The method that shows two resolved sides equal on an open part, or None."""
    method = equal_as_written(left, right, part)
    if method is not None:
        return method
    difference = left - right
    if not difference.free_symbols:
        return _equal_numbers(difference)
    if all(part.is_nonnegative(side) for side in (left, right)) and vanishes(left**2 - right**2, part.parameters):
        return SQUARES
    if any(vanishes(difference - fraction * g, part.plain) for g in _zero(part) for fraction in _FRACTIONS):
        return CONDITION
    if _equal_inside(left, right, part, differentiate):
        return INSIDE
    if differentiate:
        for symbol in sorted(difference.free_symbols, key=str):
            along = part.along(symbol)
            if _is_constant_along(difference, symbol, along) and _vanishes_somewhere(
                difference, symbol, along, differentiate - 1
            ):
                return DERIVATIVE
    return None


_FRACTIONS = (1, -1, sp.S.Half, -sp.S.Half, 2, -2)


def _zero(part: Part) -> list[Any]:
    """The expressions that a condition sets to 0 on the part."""
    values = dict(part.domain.values)
    return [(c.lhs - c.rhs).xreplace(values) for c in part.domain.conditions if isinstance(c, sp.Eq)]


def _equal_inside(left: Any, right: Any, part: Part, differentiate: int) -> bool:
    """Whether both sides are the same function of arguments that are found equal."""
    if left.func != right.func or len(left.args) != len(right.args) or not (left.is_Function or left.is_Pow):
        return False
    pairs = [(a, b) for a, b in zip(left.args, right.args, strict=True) if a != b]
    return len(pairs) == 1 and derive_equality(*pairs[0], part, differentiate) is not None


def _is_constant_along(difference: Any, symbol: Any, part: Part) -> bool:
    slope = sp.diff(difference, symbol)
    if is_muddled(slope) or is_infinite(slope) or slope.has(sp.Derivative, sp.Subs, sp.DiracDelta):
        return False
    return is_continuous(difference, part) and (
        vanishes(slope, part.parameters) or vanishes(slope, part.plain) or _resolves_to_zero(slope, part)
    )


def _resolves_to_zero(slope: Any, part: Part) -> bool:
    try:
        return vanishes(Resolution(part).resolved(slope), part.parameters)
    except Nowhere:
        return False


def _vanishes_somewhere(difference: Any, symbol: Any, part: Part, differentiate: int) -> bool:
    """Whether the difference is 0 at one value of a symbol: inside, or at an end where it is continuous."""
    low, high, *_ = part.domain.interval(symbol)
    inside = [point for point in _POINTS if bool(low < point) and bool(point < high)][:4]
    if low.is_finite and high.is_finite:
        inside.append((low + high) / 2)
    for point, is_end in [(end, True) for end in (low, high) if end.is_finite] + [(p, False) for p in inside]:
        face = part.domain.face(symbol, point)
        there = difference.xreplace({symbol: point})
        if face is None or face.polyhedron.is_empty or is_muddled(there) or is_infinite(there):
            continue
        on_face = Part(face)
        if not all(_is_met(condition, symbol, point, on_face) for condition in part.domain.conditions):
            continue
        if is_end and not is_continuous(difference, part, (symbol, point)):
            continue
        try:
            resolved = Resolution(on_face).resolved(there)
        except Nowhere:
            continue
        if derive_equality(resolved, sp.Integer(0), on_face, differentiate) is not None:
            return True
    return False


def _is_met(condition: Any, symbol: Any, point: Any, on_face: Part) -> bool:
    """Whether a condition holds at every point of a face."""
    values = dict(on_face.domain.values)
    difference = (condition.lhs - condition.rhs).xreplace(values).xreplace({symbol: point})
    bare = Part(replace(on_face.domain, conditions=()))
    return all(condition.func(sp.Integer(sign), 0) is sp.true for sign in bare.signs(difference))


_POINTS = (
    sp.Integer(0), sp.Integer(1), sp.Rational(1, 2), sp.Integer(-1), sp.Rational(-1, 2), sp.Integer(2), sp.pi / 4,
    sp.pi / 3, sp.pi / 6, sp.pi / 2, -sp.pi / 4,
)  # fmt: skip


def _equal_numbers(difference: Any) -> str | None:
    """The method that shows a number to be 0, or None."""
    try:
        ball = evaluate(difference, {}, NUMBER_BITS).ball
    except (Undefined, Unclear):
        return None
    if not ball.contains(0) or not abs(ball) < 1 or sp.count_ops(difference) > LARGEST_NUMBER:
        return None
    if difference.has(sp.asin, sp.acos, sp.atan):
        sine = sp.expand_trig(sp.sin(sp.expand(difference)))
        if not sine.has(sp.sin, sp.cos, sp.asin, sp.acos, sp.atan) and _is_algebraic_zero(sine):
            return ANGLES
        return None
    return ALGEBRAIC if _is_algebraic_zero(difference) else None


def _is_algebraic_zero(number: Any) -> bool:
    number = sp.expand(number)
    if number == 0:
        return True
    if not number.is_algebraic:
        return False
    unknown = sp.Dummy()
    try:
        return bool(sp.minimal_polynomial(number, unknown) == unknown)
    except (NotImplementedError, sp.polys.polyerrors.BasePolynomialError):
        return False
