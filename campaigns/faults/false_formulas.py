"""Random true and false identities and inequalities, and the answers of `verify`.

In each claim the second expression is the first one rewritten by a rule that holds on some domains, possibly with a
perturbation, down to 1e-25 or at one point only. The domain is drawn independently of the rule. The judge evaluates
both sides in 50 digits by mpmath, with its own evaluator. Its points are random points, ends and special points of the
domain, and neighbours of these. A proof is false if the values differ at a point. A refutation is false if its
counterexample is not in the domain, or if there the values agree or one is not real. Later numbers draw claims in the
forms in which users write them (cases with Boolean conditions, relations, matrices, symbols of any kind), a third of
them no claims at all, which must be refused by InputErrors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np
import sympy as sp

from asperity import InputError, verify
from asperity.verification.derivation import FAILED
from campaigns.engine import Campaign, Judged

DIGITS = 50
# Values that differ only in the last quarter of the digits count as equal.
SAME = 0.75
# An argument that differs from a jump only in the last fifth of the digits counts as on the jump.
ON_A_JUMP = 0.8
POINTS = 80
# From this number on claims are written as users write them.
FIRST_WRITTEN = 5000
SECONDS = 10.0

X, Y = sp.symbols("x y", real=True)
N, K = sp.Symbol("n", integer=True), sp.Symbol("k", integer=True, even=True)
PI = sp.pi


# ---- the judge


class NotReal(Exception):
    """The expression is not a real number at the point."""


class Unsure(Exception):
    """The judge cannot decide."""


def value(e: Any, point: dict[Any, Any]) -> Any:
    """The value in real arithmetic, part by part, by mpmath."""
    if e.is_Symbol:
        return point[e]
    if e.is_Rational:
        return mpmath.mpf(int(e.p)) / int(e.q)
    if e is sp.pi:
        return +mpmath.pi
    if e is sp.E:
        return +mpmath.e
    if isinstance(e, sp.Piecewise):
        for branch, condition in e.args:
            if condition == True or (condition != False and truth(condition, point)):  # noqa: E712
                return value(branch, point)
        raise NotReal
    if isinstance(e, sp.Integral):
        variable, low, high = e.limits[0]
        ends = [
            mpmath.inf if end is sp.oo else -mpmath.inf if end is -sp.oo else value(end, point) for end in (low, high)
        ]
        return mpmath.quad(lambda t: value(e.function, {**point, variable: t}), ends)
    if e.is_Pow and e.base is sp.zoo:
        # sympy writes 0**(-x) so
        return power(mpmath.mpf(0), -value(e.exp, point))
    args = [value(argument, point) for argument in e.args]
    if e.is_Add:
        return mpmath.fsum(args)
    if e.is_Mul:
        return mpmath.fprod(args)
    if e.is_Pow:
        return power(args[0], args[1])
    if e.func not in FUNCTIONS:
        raise Unsure
    return FUNCTIONS[e.func](*args)


def is_zero(x: Any) -> bool:
    return bool(abs(x) < mpmath.mpf(10) ** (-ON_A_JUMP * mpmath.mp.dps))


def sign_of(x: Any) -> int:
    return 0 if is_zero(x) else 1 if x > 0 else -1


def truth(condition: Any, point: dict[Any, Any]) -> bool:
    if isinstance(condition, sp.And):
        return all(truth(part, point) for part in condition.args)
    if isinstance(condition, sp.Or):
        return any(truth(part, point) for part in condition.args)
    if isinstance(condition, sp.Not):
        return not truth(condition.args[0], point)
    if condition in (sp.true, sp.false):
        return bool(condition)
    sign = sign_of(value(condition.lhs, point) - value(condition.rhs, point))
    return {sp.Gt: sign > 0, sp.Ge: sign >= 0, sp.Lt: sign < 0, sp.Le: sign <= 0, sp.Eq: sign == 0, sp.Ne: sign != 0}[
        condition.func
    ]


def power(base: Any, exponent: Any) -> Any:
    if is_zero(exponent - mpmath.nint(exponent)):
        whole = int(mpmath.nint(exponent))
        if sign_of(base) == 0:
            if whole < 0:
                raise NotReal
            return mpmath.mpf(0 if whole else 1)
        return base**whole
    if sign_of(base) == 0:
        if exponent < 0:
            raise NotReal
        return mpmath.mpf(0)
    if base < 0:
        raise NotReal
    return mpmath.exp(exponent * mpmath.log(base))


def floor(x: Any) -> Any:
    near = mpmath.nint(x)
    return near if is_zero(x - near) else mpmath.floor(x)


def inside(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def image(x: Any) -> Any:
        if abs(x) > 1 and not is_zero(abs(x) - 1):
            raise NotReal
        return function(min(max(x, mpmath.mpf(-1)), mpmath.mpf(1)))

    return image


def quotient(a: Any, b: Any) -> Any:
    if sign_of(b) == 0:
        raise NotReal
    return a / b


def logarithm(x: Any) -> Any:
    if sign_of(x) <= 0:
        raise NotReal
    return mpmath.log(x)


def direction(y: Any, x: Any) -> Any:
    if sign_of(y) == 0:
        if sign_of(x) == 0:
            raise NotReal
        return mpmath.mpf(0) if x > 0 else +mpmath.pi
    return mpmath.atan2(y, x)


FUNCTIONS: dict[Any, Any] = {
    sp.sin: mpmath.sin, sp.cos: mpmath.cos, sp.exp: mpmath.exp, sp.atan: mpmath.atan,
    sp.sinh: mpmath.sinh, sp.cosh: mpmath.cosh, sp.tanh: mpmath.tanh, sp.asinh: mpmath.asinh,
    sp.tan: lambda x: quotient(mpmath.sin(x), mpmath.cos(x)), sp.cot: lambda x: quotient(mpmath.cos(x), mpmath.sin(x)),
    sp.sec: lambda x: quotient(1, mpmath.cos(x)), sp.csc: lambda x: quotient(1, mpmath.sin(x)),
    sp.asin: inside(mpmath.asin), sp.acos: inside(mpmath.acos), sp.log: logarithm, sp.Abs: abs,
    sp.sign: lambda x: mpmath.mpf(sign_of(x)), sp.floor: floor, sp.ceiling: lambda x: -floor(-x),
    sp.Max: max, sp.Min: min, sp.atan2: direction, sp.Mod: lambda x, y: x - y * floor(quotient(x, y)),
    sp.Heaviside: lambda x, at_zero=0.5: at_zero if sign_of(x) == 0 else mpmath.mpf(1 if x > 0 else 0),
}  # fmt: skip


def compared(claim: Claim, point: dict[Any, Any]) -> bool | None:
    """Whether the relation holds at a point, None if a side is not real or the judge is unsure.

    A difference is checked with more digits, because terms may cancel and a sine may have a large argument.
    """
    sides = _sides(claim, point, DIGITS)
    if sides is None:
        return None
    return _agree(claim, sides, DIGITS) or compared_in_more_digits(claim, point)


def compared_in_more_digits(claim: Claim, point: dict[Any, Any]) -> bool | None:
    """As `compared` in 200 digits; None unless 1000 digits give the same values. Integrals get 50 and 75 digits."""
    digits = (DIGITS, DIGITS + 25) if _has_integral(claim) else (4 * DIGITS, 20 * DIGITS)
    few, many = (_sides(claim, point, number) for number in digits)
    if few is None or many is None:
        return None
    if any(_far(a, b, digits[0]) for a, b in zip(few, many, strict=True)):
        return None
    return _agree(claim, few, digits[0])


def _has_integral(claim: Claim) -> bool:
    return bool(claim.left.has(sp.Integral) or claim.right.has(sp.Integral))


def _sides(claim: Claim, point: dict[Any, Any], digits: int) -> tuple[Any, Any] | None:
    """Both values; None if a relation of the domain fails or a side is not real."""
    with mpmath.workdps(digits):
        try:
            numbers = {s: value(v, {}) for s, v in point.items()}
            if not all(truth(relation, numbers) for relation in claim.domain):
                return None
            return value(claim.left, numbers), value(claim.right, numbers)
        except (NotReal, Unsure, OverflowError, ZeroDivisionError, ValueError):
            return None


def _far(a: Any, b: Any, digits: int) -> bool:
    with mpmath.workdps(digits):
        return bool(abs(a - b) > mpmath.mpf(10) ** (-SAME * digits) * max(1, abs(a), abs(b)))


def _agree(claim: Claim, sides: tuple[Any, Any], digits: int) -> bool:
    a, b = sides
    return not _far(a, b, digits) or (claim.relation == "<=" and bool(a < b))


# ---- claims


@dataclass(frozen=True)
class Claim:
    """left relation right wherever both sides are real, for symbols that satisfy the relations of the domain."""

    kind: str
    left: Any
    right: Any
    relation: str
    domain: tuple[Any, ...]
    # the arguments of `verify`, if they are not the two sides, or their relation, and the domain
    asked: tuple[Any, ...] = ()

    @property
    def symbols(self) -> list[Any]:
        every = set().union(*(part.free_symbols for part in (self.left, self.right, *self.domain)))
        return sorted(every, key=str)


NICE = [sp.Rational(p, q) for p in range(-3, 4) for q in (1, 2)] + [k * PI / 2 for k in range(-4, 7)]


class Maker:
    """Draws claims."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def pick(self, values: Any) -> Any:
        return values[int(self.rng.integers(len(values)))]

    def linear(self) -> Any:
        a = self.pick([1, 1, 1, 2, -1, sp.Rational(1, 2), 3, -2])
        b = self.pick([0, 0, 0, 1, -1, sp.Rational(1, 3), PI / 2, -PI, PI / 4])
        return a * self.pick([X, X, X, Y]) + b

    def inner(self) -> Any:
        return self.pick([
            lambda: self.linear(), lambda: self.linear(), lambda: self.linear(), lambda: X - Y, lambda: X * Y,
            lambda: X**2, lambda: sp.sin(X), lambda: 1 - X**2, lambda: N, lambda: X + N, lambda: X**2 - Y**2,
            lambda: sp.cos(X) + 1, lambda: K / 2, lambda: sp.exp(X), lambda: N * X, lambda: sp.Abs(X) - 1,
        ])()  # fmt: skip

    def constant(self) -> Any:
        """A number of which sympy may believe the wrong sign: of a large argument, near 0, or a tower of powers."""
        whole = sp.Integer(int(self.rng.integers(2, 14)))
        angle = self.pick(
            [sp.exp(whole), whole**11, sp.sqrt(whole), sp.exp(sp.exp(sp.Integer(4))), 3 ** sp.sqrt(whole)]
        )
        angle += PI * sp.Rational(int(self.rng.integers(-125, 126)), 125)
        return self.pick([
            lambda: self.pick([sp.csc, sp.sec, sp.tan, sp.cot, sp.sin, sp.cos])(angle),
            lambda: self.pick([sp.csc, sp.sec, sp.tan])(angle) - self.pick([0, 1, whole]),
            lambda: sp.exp(-5 * whole) - self.pick([0, sp.Rational(1, 10**whole)]),
            lambda: whole ** sp.sqrt(2) - sp.Rational(str(round(float(whole) ** 2**0.5, 12))),
            lambda: sp.exp(sp.exp(sp.cos(whole))) - sp.exp(whole) / whole,
            lambda: sp.sqrt(whole) - sp.Rational(*(float(whole) ** 0.5).as_integer_ratio()),
            lambda: sp.log(whole) - sp.log(whole + sp.Rational(1, 10**15)), lambda: sp.sqrt(2 + sp.sqrt(whole)),
            lambda: sp.atan(whole) - PI / 2 + 1 / whole, lambda: sp.exp(whole), lambda: sp.sqrt(whole) - 2,
        ])()  # fmt: skip

    def of_constants(self) -> tuple[str, Any, Any]:
        """Written without evaluation, because sympy decides signs where it evaluates."""
        c, w, u = self.constant(), self.pick([X, X, self.linear()]), self.inner()
        product_, square = sp.Mul(c, w, evaluate=False), sp.Mul(sp.Pow(c, 2), w**2, evaluate=False)
        bare = sp.Abs(product_, evaluate=False)
        large = self.pick([sp.Integer(10**4), sp.Integer(10**22), 7 * sp.sqrt(3) * 10**3, c])
        pairs: list[Callable[[], tuple[Any, Any]]] = [
            lambda: (bare, self.pick([product_, -product_, sp.Abs(w) * sp.Abs(c, evaluate=False)])),
            lambda: (sp.Pow(square, sp.S.Half, evaluate=False), self.pick([product_, -product_, bare])),
            lambda: (sp.Max(product_, 0, evaluate=False), self.pick([product_, sp.Integer(0), (bare + product_) / 2])),
            lambda: (sp.sign(product_, evaluate=False), self.pick([sp.sign(w), -sp.sign(w)])),
            lambda: (sp.Piecewise((u, sp.Gt(product_, 0, evaluate=False)), (-u, True), evaluate=False),
                     self.pick([u, -u])),
            lambda: (sp.log(product_, evaluate=False), self.pick([sp.log(w) + sp.log(c, evaluate=False), sp.log(w)])),
            lambda: (sp.sin(w + large), sp.sin(w) * sp.cos(large) + sp.cos(w) * sp.sin(large)),
            lambda: (sp.exp(sp.Add(w, c, evaluate=False), evaluate=False), sp.exp(w) * sp.exp(c)),
            lambda: (sp.Pow(product_, sp.S.Half, evaluate=False), sp.sqrt(w) * sp.Pow(c, sp.S.Half, evaluate=False)),
            lambda: (sp.Heaviside(product_, evaluate=False), self.pick([sp.Heaviside(w), 1 - sp.Heaviside(w)])),
            lambda: (sp.atan2(product_, c, evaluate=False), self.pick([sp.atan(w), sp.atan(w) + PI, -sp.atan(w)])),
        ]  # fmt: skip
        left, right = self.pick(pairs)()
        return "constants", left, right

    def rule(self) -> tuple[str, Any, Any]:
        if self.rng.random() < 0.15:
            return self.of_constants()
        u, v = self.inner(), self.inner()
        w = self.linear()
        t = sp.Symbol("t", real=True)
        end = self.pick([X, Y, sp.Integer(1), PI, sp.Rational(1, 2)])
        rules: list[tuple[str, Callable[[], tuple[Any, Any]]]] = [
            ("roots", lambda: (sp.sqrt(sp.expand(u**2)), self.pick([u, -u, sp.Abs(u)]))),
            ("roots", lambda: (sp.sqrt(u) * sp.sqrt(v), sp.sqrt(u * v))),
            ("roots", lambda: (sp.sqrt(u / v), sp.sqrt(u) / sp.sqrt(v))),
            ("roots", lambda: ((u**3) ** sp.Rational(1, 3), self.pick([u, sp.Abs(u)]))),
            ("roots", lambda: (sp.sqrt(1 - sp.cos(w) ** 2), self.pick([sp.sin(w), -sp.sin(w), sp.Abs(sp.sin(w))]))),
            ("roots", lambda: (sp.sqrt((1 + sp.cos(w)) / 2), self.pick([sp.cos(w / 2), sp.Abs(sp.cos(w / 2))]))),
            ("absolute values", lambda: (sp.Abs(u * v), self.pick([u * v, -u * v, sp.Abs(u) * sp.Abs(v)]))),
            ("absolute values", lambda: (sp.Abs(u) / u, self.pick([sp.Integer(1), sp.Integer(-1), sp.sign(u)]))),
            ("absolute values", lambda: (sp.sign(u) ** 2, sp.Integer(1))),
            ("absolute values", lambda: (sp.Max(u, v), self.pick([u, v, (u + v + sp.Abs(u - v)) / 2]))),
            ("absolute values", lambda: (sp.Min(u, v), self.pick([u, u + v - sp.Max(u, v)]))),
            ("acos(cos)", lambda: (sp.acos(sp.cos(w)), self.pick([w, -w, 2 * PI - w, w - 2 * PI, sp.Abs(w)]))),
            ("acos(cos)", lambda: (sp.asin(sp.sin(w)), self.pick([w, PI - w, -PI - w, w - 2 * PI]))),
            ("acos(cos)", lambda: (sp.atan(sp.tan(w)), self.pick([w, w - PI, w + PI]))),
            ("acos(cos)", lambda: (sp.acos(sp.sin(w)), self.pick([PI / 2 - w, w - PI / 2, sp.Abs(w - PI / 2)]))),
            ("acos(cos)", lambda: (sp.asin(sp.cos(w)), self.pick([PI / 2 - w, PI / 2 - sp.acos(sp.cos(w))]))),
            ("atan2", lambda: (sp.atan2(sp.sin(w), sp.cos(w)), self.pick([w, w - 2 * PI, w + 2 * PI]))),
            ("atan2", lambda: (sp.atan2(u, v), self.pick([sp.atan(u / v), sp.atan(u / v) + PI]))),
            ("inverse functions", lambda: (2 * sp.acos(u), self.pick(
                [sp.acos(2 * u**2 - 1), 2 * PI - sp.acos(2 * u**2 - 1)]))),
            ("inverse functions", lambda: (sp.sin(sp.acos(u)), sp.sqrt(1 - u**2))),
            ("inverse functions", lambda: (sp.asin(u) + sp.acos(u), PI / 2)),
            ("inverse functions", lambda: (sp.atan(u) + sp.atan(1 / u), self.pick([PI / 2, sp.sign(u) * PI / 2]))),
            ("inverse functions", lambda: (sp.atan(u) + sp.atan(v), sp.atan((u + v) / (1 - u * v)))),
            ("inverse functions", lambda: (sp.tan(sp.asin(u)), u / sp.sqrt(1 - u**2))),
            ("logarithms", lambda: (sp.log(sp.expand(u * v)), sp.log(u) + sp.log(v))),
            ("logarithms", lambda: (sp.log(sp.expand(u**2)), self.pick([2 * sp.log(u), 2 * sp.log(sp.Abs(u))]))),
            ("logarithms", lambda: (sp.asinh(u), sp.log(u + sp.sqrt(u**2 + 1)))),
            ("steps", lambda: (sp.floor(u) + sp.floor(-u), self.pick([sp.Integer(-1), sp.Integer(0)]))),
            ("steps", lambda: (sp.ceiling(u), self.pick([sp.floor(u) + 1, sp.floor(u)]))),
            ("steps", lambda: (sp.Mod(u, 1), self.pick([u - sp.floor(u), u]))),
            ("steps", lambda: (sp.floor(w), self.pick([sp.Integer(0), sp.Integer(1), sp.Integer(-1)]))),
            ("steps", lambda: (sp.Heaviside(u), self.pick([(1 + sp.sign(u)) / 2, sp.Integer(1)]))),
            ("cases", lambda: (sp.Piecewise((u, u > v), (v, True)), self.pick([sp.Max(u, v), u, v]))),
            ("cases", lambda: (sp.Piecewise((u, self.pick(NICE) > X), (v, True)), self.pick([u, v]))),
            ("cases", lambda: (sp.Piecewise((u, X > Y), (-u, X < Y)), self.pick([u, -u]))),
            ("powers", lambda: (sp.Pow(0, u), sp.Integer(0))),
            ("powers", lambda: (sp.Pow(0, sp.Abs(u)), self.pick([sp.Integer(0), 1 - sp.sign(u) ** 2]))),
            ("powers", lambda: (u**v * u, u ** (v + 1))),
            ("powers", lambda: ((u**2) ** sp.Rational(1, 4), self.pick([sp.sqrt(u), sp.sqrt(sp.Abs(u))]))),
            ("powers", lambda: (sp.exp(v * sp.log(u)), u**v)),
            ("integers", lambda: (sp.cos(PI * (N + X)), self.pick([(-1) ** N * sp.cos(PI * X), sp.cos(PI * X)]))),
            ("integers", lambda: (sp.Abs(sp.sin(PI * N / 2)), self.pick([1 - (-1) ** N, (1 - (-1) ** N) / 2]))),
            ("integers", lambda: (sp.floor(K / 2 + sp.Rational(1, 3)), K / 2)),
            ("integers", lambda: (N * (N - 1) * (N - 2), self.pick([sp.Integer(0), N**3 - 3 * N**2 + 2 * N]))),
            ("integers", lambda: (sp.floor(N / 2) + sp.ceiling(N / 2), N)),
            ("angles", lambda: (sp.sin(u + v), sp.sin(u) * sp.cos(v) + sp.cos(u) * sp.sin(v))),
            ("angles", lambda: (sp.tan(w / 2), (1 - sp.cos(w)) / sp.sin(w))),
            ("angles", lambda: (sp.sin(w) / sp.tan(w), sp.cos(w))),
            ("angles", lambda: (sp.tanh(2 * w), 2 * sp.tanh(w) / (1 + sp.tanh(w) ** 2))),
            ("integrals", lambda: (sp.Integral(self.pick([t**2, sp.sin(t), sp.exp(-t), 1 / (1 + t**2), t * sp.cos(t)]),
                                               (t, 0, end)), self.pick([end**3 / 3, 1 - sp.cos(end), 1 - sp.exp(-end),
                                                                       sp.atan(end)]))),
            ("integrals", lambda: (sp.Integral(1 / t, (t, 1, end)), sp.log(end))),
            ("integrals", lambda: (sp.Integral(t * sp.cos(t), (t, 0, end)), end * sp.sin(end) + sp.cos(end) - 1)),
        ]  # fmt: skip
        name, make = self.pick(rules)
        left, right = make()
        return name, left, right

    def inequality(self) -> tuple[str, Any, Any]:
        u, v, w = self.inner(), self.inner(), self.linear()
        tiny = sp.Rational(1, 10**25)
        pairs: list[tuple[Any, Any]] = [
            (sp.sin(w), w), (w - w**3 / 6, sp.sin(w)), (1 - w**2 / 2, sp.cos(w)), (1 + w, sp.exp(w)),
            (sp.log(u), u - 1), (2 * u * v, u**2 + v**2), (sp.Abs(u + v), sp.Abs(u) + sp.Abs(v)), (w, sp.tan(w)),
            (sp.atan(w), w), (sp.sqrt(u * v), (u + v) / 2), (sp.sin(w) ** 2, sp.Integer(1)), (u, sp.Max(u, v)),
            (sp.floor(u), u), (u - 1, sp.floor(u)), (2 * w / PI, sp.sin(w)), (tiny, w**2), (w**2, w**4 + 1),
            (sp.cos(w), 1 - w**2 / 4), (u, u + tiny), (u, u - tiny), (sp.acos(w), PI), (X**2, X), (X * Y, X),
        ]  # fmt: skip
        return "inequalities", *self.pick(pairs)

    def domain(self) -> tuple[Any, ...]:
        relations: list[Any] = []
        for symbol in (X, Y):
            shape = self.rng.integers(6)
            low, high = sorted((self.pick(NICE), self.pick(NICE)), key=float)
            if low == high:
                high = low + 1
            above = symbol > low if self.rng.random() < 0.5 else symbol >= low
            below = symbol < high if self.rng.random() < 0.5 else symbol <= high
            relations += [[above, below], [above, below], [above, below], [above], [below], []][shape]
        if self.rng.random() < 0.35:
            relations.append(self.pick([X < Y, X >= Y, X + Y > 0, X * Y < 1, sp.Ne(X, self.pick(NICE)), X > 2 * Y,
                                        X**2 + Y**2 < 9, X > Y**2]))  # fmt: skip
        if self.rng.random() < 0.5:
            first = int(self.rng.integers(-3, 4))
            relations += self.pick([[first <= N], [first < N, first + int(self.rng.integers(1, 5)) >= N], [first > N]])
        return tuple(relations)

    def claim(self) -> Claim:
        relation = "<=" if self.rng.random() < 0.15 else "=="
        kind, left, right = self.inequality() if relation == "<=" else self.rule()
        change = self.rng.random()
        tiny = sp.Rational(1, 10**25)
        if relation == "==" and change < 0.35:
            right = self.pick([
                lambda: right + tiny, lambda: right - tiny, lambda: right * (1 + tiny), lambda: right + X * tiny,
                lambda: -right, lambda: right + sp.Rational(1, 7),
                lambda: sp.Piecewise((right + 1, sp.Eq(X, self.pick(NICE))), (right, True)),
                lambda: right + sp.Pow(0, sp.Abs(X - self.pick(NICE))),
                lambda: right + tiny * sp.Heaviside(X - self.pick(NICE)),
            ])()  # fmt: skip
        elif relation == "==" and change < 0.5:
            outer = self.pick([sp.exp, sp.cos, lambda z: z**2, lambda z: z + self.linear(), lambda z: z * self.linear(),
                               sp.atan, lambda z: 1 / z, sp.sqrt])  # fmt: skip
            left, right = outer(left), outer(right)
        symbols = set(left.free_symbols | right.free_symbols)
        domain = tuple(r for r in self.domain() if r not in (True, False) and r.free_symbols <= symbols)
        return Claim(kind, sp.sympify(left, strict=True), sp.sympify(right, strict=True), relation, domain)


# Symbols as users make them, with what the judge has to know of them.
SYMBOLS = [
    (sp.Symbol("x"), ()), (sp.Symbol("x", positive=True), (sp.Gt, 0)), (sp.Symbol("x", negative=True), (sp.Lt, 0)),
    (sp.Symbol("x", nonnegative=True), (sp.Ge, 0)), (sp.Symbol("x", nonzero=True), (sp.Ne, 0)),
    (sp.Symbol("x", finite=True), ()), (sp.Symbol("x", extended_real=True), ()), (sp.Symbol("x", integer=True), ()),
]  # fmt: skip


class Writer(Maker):
    """Draws claims in the forms in which users write them, a third of them broken on purpose."""

    def relation(self) -> Any:
        return self.pick([sp.Gt, sp.Ge, sp.Lt, sp.Le])(self.pick([X, X, Y, X - Y, X**2]), self.pick([*NICE, Y, sp.oo]))

    def condition(self) -> Any:
        one, other, third = self.relation(), self.relation(), self.relation()
        return self.pick([
            lambda: one, lambda: one & other, lambda: one | other, lambda: ~one, lambda: ~(one & other),
            lambda: ~(one | other), lambda: (one & other) | third, lambda: (one | other) & third,
            lambda: sp.And(one, other, evaluate=False), lambda: sp.Not(one, evaluate=False),
        ])()  # fmt: skip

    def cases(self) -> tuple[Any, Any]:
        u, v, w, where, there = self.inner(), self.inner(), self.linear(), self.condition(), self.condition()
        return self.pick([
            lambda: (sp.Piecewise((u, where), (v, True)), sp.Piecewise((v, ~where), (u, True))),
            lambda: (sp.Piecewise((u, where), (v, True)), self.pick([u, v])),
            lambda: (sp.Piecewise((1, where), (7, True)), self.pick([1, 7])),
            lambda: (sp.Piecewise((u, where), (v, there), (w, True)), self.pick([u, v, w])),
            lambda: (sp.Piecewise((u, where & there), (v, True)),
                     sp.Piecewise((sp.Piecewise((u, there), (v, True)), where), (v, True))),
            lambda: (sp.Piecewise((u, where)) + w, u + w),
            lambda: (sp.sin(sp.Piecewise((X, X > Y), (Y, True))), sp.sin(sp.Max(X, Y))),
        ])()  # fmt: skip

    def inverse(self) -> tuple[Any, Any]:
        u, w = self.inner(), self.pick([X, X, Y, 2 * X, X - Y])
        sine = w / sp.sqrt(1 + w**2)
        return self.pick([
            lambda: (sp.atan(u) + sp.atan(1 / u), self.pick([PI / 2, -PI / 2, sp.sign(u) * PI / 2])),
            lambda: (sp.atan(w), self.pick([sp.asin(sine), sp.acos(1 / sp.sqrt(1 + w**2)), PI / 2 - sp.atan(1 / w)])),
            lambda: (2 * sp.atan(w), self.pick([sp.atan(2 * w / (1 - w**2)), sp.asin(2 * w / (1 + w**2)),
                                                sp.acos((1 - w**2) / (1 + w**2))])),
            lambda: (sp.acos(w), self.pick([sp.atan(sp.sqrt(1 - w**2) / w), 2 * sp.atan(sp.sqrt((1 - w) / (1 + w))),
                                            sp.asin(sp.sqrt(1 - w**2)), PI / 2 - sp.asin(w)])),
            lambda: (2 * sp.acos(w), self.pick([sp.acos(2 * w**2 - 1), 2 * PI - sp.acos(2 * w**2 - 1)])),
            lambda: (2 * sp.asin(w), self.pick([sp.asin(2 * w * sp.sqrt(1 - w**2)), sp.acos(1 - 2 * w**2)])),
            lambda: (3 * sp.atan(w), sp.atan((3 * w - w**3) / (1 - 3 * w**2)) + self.pick([0, PI, -PI])),
            lambda: (sp.atan(X) + sp.atan(Y), sp.atan((X + Y) / (1 - X * Y)) + self.pick([0, PI, -PI])),
            lambda: (sp.atan2(X, Y), self.pick([sp.atan(X / Y), PI / 2 - sp.atan(Y / X),
                                                2 * sp.atan(X / (sp.sqrt(X**2 + Y**2) + Y))])),
        ])()  # fmt: skip

    def limits(self) -> list[Any]:
        """Assumptions on x and y, among them infinite bounds and Boolean combinations."""
        plain = list(self.domain())
        more = [sp.Lt(X, sp.oo), sp.Gt(Y, -sp.oo), self.condition(), self.condition()]
        return [r for r in (*plain, self.pick(more)) if r not in (sp.true, sp.false)] if self.pick([0, 1]) else plain

    def written(self) -> Claim:
        kind = self.pick(["cases", "inverse", "rule", "inequality"])
        _, left, right = (kind, *getattr(self, kind)())[-3:]
        relation = "<=" if kind == "inequality" else "=="
        symbol, sign = self.pick(SYMBOLS)
        domain = [] if self.pick([0, 0, 1]) else self.limits()
        left, right, *domain = (sp.sympify(one).xreplace({X: symbol}) for one in (left, right, *domain))
        symbols = left.free_symbols | right.free_symbols
        domain = [r for r in domain if r.free_symbols and r.free_symbols <= symbols and r.func is not sp.Eq]
        known = [sign[0](symbol, sign[1], evaluate=False)] if sign and symbol in symbols else []
        return Claim(f"written, {kind}", left, right, relation, (*domain, *known),
                     self.asked(left, right, relation, domain))  # fmt: skip

    def asked(self, left: Any, right: Any, relation: str, domain: list[Any]) -> tuple[Any, ...]:
        assumed = self.pick([domain, tuple(domain), iter(domain), sp.And(*domain) if domain else ()])
        if relation == "<=":
            return *self.pick([
                (sp.Le(left, right, evaluate=False),), (sp.Ge(right, left, evaluate=False),),
                ([sp.Le(left, right, evaluate=False), sp.Lt(left, right + 1, evaluate=False)],),
                (sp.And(sp.Le(left, right, evaluate=False), sp.Le(left, right + 1, evaluate=False), evaluate=False),),
            ]), assumed  # fmt: skip
        return *self.pick([
            (left, right), (left, right), ([left, 1], [right, 1.0]), (sp.Matrix([[left, 0]]), sp.Matrix([[right, 0]])),
            (sp.ImmutableMatrix([left]), [[right]]), (sp.Array([left, 2]), (right, 2)),
            (sp.Tuple(left), sp.Tuple(right)),
            (np.array([left], dtype=object), [right]), (sp.Eq(left, right, evaluate=False),),
        ]), assumed  # fmt: skip

    def broken(self) -> Claim:
        """A claim that is none: every part of `verify` should say so."""
        u, x = self.inner(), sp.Symbol("x")
        asked = self.pick([
            (u, sp.Poly(X**2 + 1, X)), ({u}, {u}), ({"a": u}, {"a": u}), ("x", u), (u, None), (None, u), (u, b"1"),
            (u, sp.Interval(0, 1)), (sp.FiniteSet(u), sp.FiniteSet(u)), (u, u, [True]), (u, u, [u == 3]), (u, u, None),
            (u, u, sp.Eq(X, 1)), (u, u, [X > 1, X < 1]), (u, u, "x > 0"), (u, u, 7), (u, u, {X: 1}),
            (u, u, {"x": (0, 1)}),
            (u, u, {X: (1, 0)}), (u, u, X), (u, u, sp.Contains(X, sp.Interval(0, 1))), (u, sp.I * u), (u, sp.nan),
            (u, sp.oo), (u, float("nan")), (u, 1j), (sp.Symbol("z", imaginary=True), 1),
            (x, sp.Symbol("x", positive=True)),
            ([], []), ([u], []), ([u, u], [u]), (sp.eye(2), sp.eye(3)), (sp.MatrixSymbol("A", 2, 2), sp.eye(2)),
            (sp.IndexedBase("A")[0], 1), (u,), (X > 0, 1, 2), (sp.Ne(X, 0),), (sp.Or(X > 0, Y > 0),), (u == u,),
            (sp.sin, u),
            (u, lambda t: t), (u, object()), (u, u, [sp.Gt(X, sp.nan, evaluate=False)]),
            (np.array([[1.0, 2.0]]), [1.0]), (sp.Symbol("a", commutative=False), 1), (u, u, [X**2 < -1]), (u, range),
        ])  # fmt: skip
        return Claim("broken", sp.Integer(0), sp.Integer(0), "==", (), asked)

    def claim(self) -> Claim:
        return self.broken() if self.rng.random() < 1 / 3 else self.written()


def places(claim: Claim, rng: np.random.Generator) -> Iterator[dict[Any, Any]]:
    """Random and simple points and neighbours of simple points, inside and outside the domain."""
    named = {atom for part in (claim.left, claim.right, *claim.domain) for atom in part.atoms(sp.Rational)}
    nice = list(dict.fromkeys([*NICE, *named]))
    ends = {s: (max([-12.0, *_bounds(claim, s, sp.Gt, sp.Ge)]), min([12.0, *_bounds(claim, s, sp.Lt, sp.Le)]))
            for s in claim.symbols}  # fmt: skip
    # the judge's integrals take seconds
    for _ in range(1 if not claim.symbols else POINTS // 4 if _has_integral(claim) else POINTS):
        point = {}
        for symbol in claim.symbols:
            choice = rng.random()
            if symbol.is_integer:
                number = sp.Integer(int(rng.integers(-8, 9)))
                point[symbol] = 2 * number if symbol.is_even else number
            elif choice < 0.4:
                point[symbol] = nice[int(rng.integers(len(nice)))]
            elif choice < 0.6:
                step = sp.Rational(int(rng.choice([-1, 1])), 10 ** int(rng.integers(1, 9)))
                point[symbol] = nice[int(rng.integers(len(nice)))] + step
            else:
                low, high = ends[symbol]
                point[symbol] = sp.Rational(round(10**6 * (low + (high - low) * rng.random())), 10**6)
        yield point


def _bounds(claim: Claim, symbol: Any, *kinds: Any) -> list[float]:
    return [float(r.rhs) for r in claim.domain if r.func in kinds and r.lhs == symbol and r.rhs.is_number]


def draw(number: int) -> tuple[int, Claim]:
    """The seed of the points, and a claim."""
    return number, (Maker if number < FIRST_WRITTEN else Writer)(number).claim()


def judge(case: tuple[int, Claim]) -> Iterator[Judged]:
    """The answer of `verify` beside the verdict from values."""
    number, claim = case
    is_broken = claim.kind == "broken"
    outcomes = [] if is_broken else [compared(claim, at) for at in places(claim, np.random.default_rng(number))]
    broken, seen = outcomes.count(False), outcomes.count(True)
    sides = (claim.left, claim.right) if claim.relation == "==" else (sp.Le(claim.left, claim.right),)
    fault = ""
    try:
        verdict = verify(*(claim.asked or (*sides, claim.domain)), time_limit=SECONDS)
    except InputError:
        answer, fault = "error", "FALSE error" if broken + seen > 0 else ""
    except Exception as reason:  # what users must never see
        answer, fault = "raw", f"RAW {type(reason).__name__}"
    else:
        answer = "out of time" if "time limit" in verdict.evidence else verdict.answer
        # sympy rewrites some cases for ever
        if is_broken or (FAILED in verdict.evidence and "RecursionError" not in verdict.evidence):
            fault = "TAKEN" if is_broken else "FAILED"
        if answer == "proved" and broken:
            fault = "FALSE proof"
        if answer == "refuted" and verdict.counterexample:
            point = {s: sp.sympify(verdict.counterexample.get(str(s), 0)) for s in claim.symbols}
            is_allowed = all(has_its_properties(s, v) for s, v in point.items())
            fault = fault if is_allowed and compared_in_more_digits(claim, point) is False else "FALSE refutation"
    label = "false" if broken else "true" if seen else "nowhere"
    label = "broken" if is_broken else f"{label} by values"
    yield Judged(claim.kind, fault=f"{fault}: {claim}" if fault else "", outcome=f"{answer}, {label}")


def has_its_properties(symbol: Any, number: Any) -> bool:
    return (not symbol.is_integer or number.is_integer is True) and (not symbol.is_even or number.is_even is True)


# Those before FIRST_WRITTEN without the first twelve are about constants.
SMALL = (*range(16, 28), 43, 56, 67, 72, 79, *range(FIRST_WRITTEN, FIRST_WRITTEN + 30))
CAMPAIGNS = (Campaign("false-formulas", "Is any verdict of verify false?", draw, judge, 8000, SMALL),)
