"""Verdicts on equalities and inequalities: a counterexample, or a proof on every part of the domain.

The domain is divided into its interior and its faces, and further where a linear expression is 0 at which a function
jumps, bends or ends. On each part both sides are resolved into smooth functions. An equality is proved by a normal
form, an inequality by the sign of the difference. A part on which one side is defined nowhere needs no proof.
"""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import sympy as sp
from flint import ctx

from ..core.errors import InputError
from .balls import Unclear, Undefined, Value, evaluate, is_below
from .constants import spelled, visible, written
from .domain import SPECIAL, Domain, as_float, has_properties, linear
from .normal_form import NOT_NEGATIVE, POSITIVE, vanishes
from .resolution import Part, is_infinite
from .verdict import Verdict, every

# Points at which both sides are compared before a proof is sought: for an equality, and for an inequality.
POINTS = 24
MORE_POINTS = 60
# Points at which both sides are sought to be defined before they are refused.
MOST_POINTS = 600
# Parts that are tried, and points of every part at which a counterexample is sought.
PARTS = 60
FEW_POINTS = 3
# Not transformed, so that nothing about them is proved.
UNFINISHED = (sp.Integral, sp.Derivative, sp.Sum, sp.Product, sp.Limit, sp.Subs)
EXPANSION = "expansion"
NORMAL_FORM = "polynomial normal form"
SQUARES = "neither side is negative, and the polynomial normal forms of the squares agree"
SIGN = "the sign of the difference"
NOWHERE = "defined nowhere on the domain"
ANGLES = "the cosine of the difference is 1, and it is less than a turn"
FAILED = "sympy does not serve"


def decide(claims: list[Claim], relations: list[Any]) -> Verdict:
    """The verdict on claims under the same assumptions."""
    verdicts = []
    for claim in claims:
        try:
            verdicts.append(_decided(*claim, relations))
        except Unclear:
            verdicts.append(Verdict("undecided", "two numbers could not be told apart"))
        except InputError:
            raise
        except Exception as error:  # of sympy's algorithms, which know many more kinds of objects
            verdicts.append(Verdict("undecided", f"{FAILED} ({type(error).__name__}: {error})"))
        if verdicts[-1].answer == "refuted":
            break
    return every(*verdicts)


def _decided(left: Any, right: Any, relation: str, assumptions: list[Any]) -> Verdict:
    symbols = set().union(*(part.free_symbols for part in (left, right, *assumptions)))
    real = {symbol: _as_real(symbol) for symbol in symbols}
    if len({symbol.name for symbol in symbols}) < len(symbols):
        raise InputError(f"{', '.join(sorted(map(str, symbols)))}: expected different names of different symbols")
    domain = Domain.of(real.values(), [written(given, real) for given in assumptions])
    claim = written(left, real), written(right, real), relation
    for side in claim[:2]:
        if side.has(sp.I):
            raise InputError(f"{side}: expected a real expression, got one with the imaginary unit")
    search = Search(*claim, domain)
    found = _found(search, domain)
    if search.undefined == search.tried and found.evidence != NOWHERE:
        found = search.refutation(domain, MOST_POINTS, until_defined=True) or found
    if search.undefined == search.tried or found.evidence == NOWHERE:
        raise InputError(
            f"lhs, rhs: expected both to be defined and real somewhere on the domain; got {claim[0]} and {claim[1]}, "
            f"and at each of {search.tried} points one of them is not"
        )
    names = {str(stand_in): str(symbol) for symbol, stand_in in real.items()}
    point = {names.get(name, name): value for name, value in found.counterexample.items()}
    return Verdict(found.answer, found.evidence, point, found.values)


def _as_real(symbol: Any) -> Any:
    if symbol.is_real is False or not symbol.is_Symbol:
        raise InputError(f"{symbol}: expected a real symbol, because identities are verified over the real numbers")
    return symbol if symbol.is_real else sp.Dummy(symbol.name, **{**symbol._assumptions_orig, "real": True})


def _found(search: Search, domain: Domain) -> Verdict:
    """A counterexample, a proof on every part of the domain, or *undecided* with a reason."""
    unfinished = search.left.has(*UNFINISHED) or search.right.has(*UNFINISHED)
    sides = (sp.nan, sp.nan) if unfinished else (visible(search.left), visible(search.right))
    expands = search.relation == "==" and expands_to_zero(sides[0] - sides[1])
    points = POINTS if search.relation == "==" else MORE_POINTS
    found = search.refutation(domain, points, until_defined=expands)
    if not search.tried:
        raise InputError(f"assumptions: no point was found that meets {', '.join(map(str, domain.conditions))}")
    if found is not None:
        return found
    if expands and search.defined:
        return Verdict("proved", EXPANSION)
    reason = f"no counterexample among {search.defined} points where both are defined, and "
    if unfinished:
        return Verdict("undecided", reason + "no integral, derivative, sum or limit is evaluated; try .doit() first")
    waiting = domain.faces()
    if waiting is None:
        return Verdict("undecided", reason + "the domain has too many faces")
    methods: dict[str, None] = {}
    tried = 0
    while waiting:
        part, tried = waiting.pop(0), tried + 1
        found = search.refutation(part, FEW_POINTS) if tried > 1 or waiting else None
        if found is not None:
            return found
        method = _method(*sides, search.relation, part)
        if method is not None:
            methods[method] = None
            continue
        pieces = next((pieces for g in search.deciding if (pieces := part.divided(g))), [])
        if not pieces or tried + len(waiting) > PARTS:
            return Verdict("undecided", reason + "no known method proves it")
        waiting = pieces + waiting
    return Verdict("proved", "; ".join(method for method in methods if method != NOWHERE) or NOWHERE)


def _method(left: Any, right: Any, relation: str, domain: Domain) -> str | None:
    """The method that proves a relation on an open part, or None."""
    left, right = (visible(side, domain.values) for side in (left, right))
    part = Part(domain)
    method = _equal(left, right, part) if relation == "==" and not is_infinite(left - right) else None
    if method is not None:
        return method
    left, right = part.resolved(left), part.resolved(right)
    if is_infinite(left) or is_infinite(right):
        return NOWHERE
    if relation != "==" and part.signs(right - left) <= (POSITIVE if relation == "<" else NOT_NEGATIVE):
        return SIGN
    if relation == "<":
        return None
    method = _equal(left, right, part)
    if method is None and part.is_within_a_turn(left - right) and vanishes(1 - sp.cos(left - right), part.parameters):
        return ANGLES
    if method is None and all(part.signs(side) <= NOT_NEGATIVE for side in (left, right)):
        return SQUARES if vanishes(left**2 - right**2, part.parameters) else None
    return method


def expands_to_zero(difference: Any) -> bool:
    """Whether expansion shows that the difference is 0 wherever it is defined."""
    return bool(sp.expand(difference, power_exp=False, log=False) == 0)


def _equal(left: Any, right: Any, part: Part) -> str | None:
    """The method that shows two sides equal, or None."""
    difference = left - right
    if expands_to_zero(difference):
        return EXPANSION
    return NORMAL_FORM if vanishes(difference, part.parameters) else None


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


Claim = tuple[Any, Any, str]
_RELATIONS = {sp.Eq: "==", sp.Le: "<=", sp.Ge: "<=", sp.Lt: "<", sp.Gt: "<"}


def claims_of(lhs: Any, rhs: Any, assumptions: Any) -> tuple[list[Claim], list[Any]]:
    """The claims and the relations of the arguments of `verify`."""
    if rhs is not None and not _are_relations(lhs):
        return _equations(lhs, rhs), _assumed(assumptions)
    if rhs is not None and assumptions != ():
        raise InputError("rhs: expected none beside a relation; assumptions are the second argument then")
    return _related(lhs), _assumed(assumptions if rhs is None else rhs)


def _are_relations(side: Any) -> bool:
    if isinstance(side, list | tuple):
        return bool(side) and all(_are_relations(part) for part in side)
    return isinstance(side, sp.logic.boolalg.Boolean | bool) and not isinstance(side, sp.Symbol)


def _related(given: Any) -> list[Claim]:
    if isinstance(given, list | tuple):
        return [claim for part in given for claim in _related(part)]
    if isinstance(given, sp.And):
        return [claim for part in given.args for claim in _related(part)]
    if isinstance(given, bool):
        # of expressions that are written differently == is False, whatever they are
        raise InputError(f"lhs: Python has made {given} of this formula; pass both sides, or sympy.Eq(lhs, rhs)")
    if given is sp.true or given is sp.false:
        # sympy has already decided it
        return [(sp.Integer(0), sp.Integer(0 if given else 1), "==")]
    if type(given) not in _RELATIONS:
        raise InputError(f"lhs: expected two sides, or a relation such as a <= b, got {given!r} alone")
    if isinstance(given, sp.Eq):
        return _equations(*given.args)
    left, right = (_exact("lhs", side) for side in given.args)
    sides = (right, left) if isinstance(given, sp.Ge | sp.Gt) else (left, right)
    return [(*sides, _RELATIONS[type(given)])]


def _equations(lhs: Any, rhs: Any) -> list[Claim]:
    left, right = _entries(lhs), _entries(rhs)
    if len(left) != len(right) or not left:
        raise InputError(f"lhs, rhs: expected one shape, not empty, got {len(left)} and {len(right)} entries")
    if isinstance(lhs, sp.MatrixBase) and isinstance(rhs, sp.MatrixBase) and lhs.shape != rhs.shape:
        raise InputError(f"lhs, rhs: expected matrices of one shape, got {lhs.shape} and {rhs.shape}")
    return [(a, b, "==") for a, b in zip(left, right, strict=True)]


def _entries(side: Any) -> list[Any]:
    # of arrays and matrices, of numpy or of sympy
    side = side.tolist() if hasattr(side, "tolist") else side
    if isinstance(side, sp.Tuple | list | tuple):
        return [entry for part in side for entry in _entries(part)]
    return [_exact("lhs, rhs", side)]


def _exact(name: str, given: Any, kind: type = sp.Expr) -> Any:
    """The sympy object; text is refused, because sympy would execute it."""
    try:
        found = sp.sympify(given, strict=True)
    except sp.SympifyError:
        found = None
    if isinstance(found, kind) and not getattr(found, "is_Matrix", False):
        return found
    raise InputError(
        f"{name}: expected expressions, equations or inequalities of sympy, or numbers, got {reprlib.repr(given)}; "
        "build expressions from sympy.Symbol"
    )


def _assumed(assumptions: Any) -> list[Any]:
    if isinstance(assumptions, Mapping):
        try:
            bounds = [(symbol, low, high) for symbol, (low, high) in assumptions.items()]
        except (TypeError, ValueError) as reason:
            raise InputError(
                f"assumptions: expected an interval (low, high) for each symbol, got {reprlib.repr(assumptions)}"
            ) from reason
        exact = [[_exact("assumptions", part) for part in bound] for bound in bounds]
        return [sp.Lt(*side, evaluate=False) for symbol, low, high in exact for side in ((low, symbol), (symbol, high))]
    given = [assumptions] if isinstance(assumptions, sp.Basic | bool | str) else assumptions
    try:
        found = [_exact("assumptions", one, sp.Basic) for one in given]
    except TypeError as reason:
        raise InputError(f"assumptions: expected relations, got {reprlib.repr(assumptions)}") from reason
    if any(isinstance(one, bool) for one in given):
        raise InputError("assumptions: Python has made True or False of one; write sympy.Ne(x, 1) for x != 1")
    return found
