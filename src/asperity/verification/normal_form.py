"""A normal form in which an expression that vanishes becomes the polynomial 0.

Every symbol is replaced by parameters that run exactly over its interval, so that signs are known. An angle in (0, pi)
becomes 2 arctan t with t > 0, which makes its sines rational. An unbounded angle, or one whose signs do not matter,
becomes a pair (c, s) with c^2 + s^2 = 1. A number in (a, b) becomes (a + b t)/(1 + t). Roots become symbols with a
relation, after factors of known sign have been extracted. The result is a polynomial in quantities that are treated as
independent. If it is 0, the expression is 0 at every point of the domain. The converse fails where the quantities are
dependent.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
from math import comb, lcm
from typing import Any

import sympy as sp
from flint import Ordering, ctx, fmpz_mpoly_ctx

from .balls import MANY_BITS, Constant, Unclear, evaluate, is_below, sign_of
from .constants import ONE, built, visible
from .domain import Domain, Interval

Signs = frozenset[int]
POSITIVE, NOT_NEGATIVE, ZERO = frozenset({1}), frozenset({0, 1}), frozenset({0})
NEGATIVE, NOT_POSITIVE, ANY = frozenset({-1}), frozenset({-1, 0}), frozenset({-1, 0, 1})
# Multiples of an angle beyond this are angles of their own, because they are polynomials of this degree.
MOST = 24

_BY_SINES = {
    sp.tan: lambda x: sp.sin(x) / sp.cos(x),
    sp.cot: lambda x: sp.cos(x) / sp.sin(x),
    sp.sec: lambda x: 1 / sp.cos(x),
    sp.csc: lambda x: 1 / sp.sin(x),
    sp.sinh: lambda x: (sp.exp(x) - sp.exp(-x)) / 2,
    sp.cosh: lambda x: (sp.exp(x) + sp.exp(-x)) / 2,
    sp.tanh: lambda x: (sp.exp(2 * x) - 1) / (sp.exp(2 * x) + 1),
}


# Sine and cosine of inverse functions, wherever the inverse functions are defined.
_OF_INVERSE = {
    sp.asin: lambda x: (x, sp.sqrt(1 - x**2)),
    sp.acos: lambda x: (sp.sqrt(1 - x**2), x),
    sp.atan: lambda x: (x / sp.sqrt(1 + x**2), 1 / sp.sqrt(1 + x**2)),
}


def vanishes(expression: Any, parameters: Parameters) -> bool:
    """Whether the normal form is 0.

    Then the expression is 0 on open intervals, and at those of their ends where it is continuous.
    """
    e = parameters.normal(_unfolded(expression))
    # a function without a normal form becomes a symbol; equal functions are already equal expressions
    e = e.xreplace({f: sp.Dummy("f") for f in e.atoms(sp.Function, sp.Max, sp.Min) if f.func is not sp.Abs})
    roots: dict[Any, tuple[Any, int]] = {}
    e = _with_root_symbols(e, roots)
    e = sp.together(e).as_numer_denom()[0]
    # from the outermost root to the innermost, because a radicand may contain other roots
    for root, (radicand, index) in reversed(roots.items()):
        e = _reduced(e, root, index, radicand)
    for cosine, sine in parameters.circles.values():
        e = _reduced(e, sine, 2, 1 - cosine**2)
    for root in _roots(e):
        e = _reduced(e, root, int(root.number.exp.q), root.number.base)
    return bool(sp.expand(e.xreplace({ONE: sp.S.One})) == 0)


def _roots(e: Any) -> list[Any]:
    return [one for one in e.atoms(Constant) if one.number.is_Pow and one.number.exp.is_Rational]


def _unfolded(e: Any) -> Any:
    """The expression with the roots of constants, except those of primes, as roots."""
    while folded := {root: root.number for root in _roots(e) if not root.number.base.is_Rational}:
        e = e.xreplace(folded)
    return e


def signs_of(e: Any, signs: Callable[[Any], Signs]) -> Signs:
    """The signs that an expression may have where it is defined, from the signs of its parts."""
    if not e.free_symbols:
        try:
            return frozenset({sign_of(e)})
        except Unclear:
            return ANY
    if e.is_Mul:
        found = POSITIVE
        for factor in map(signs, e.args):
            found = frozenset(a * b for a in found for b in factor)
        return found
    if e.is_Pow and e.exp.is_Integer:
        base = signs(e.base) - (ZERO if e.exp < 0 else frozenset())
        return base if e.exp % 2 else frozenset(sign * sign for sign in base)
    if e.is_Pow and e.exp.is_Rational:
        return POSITIVE if e.exp < 0 else signs(e.base) & NOT_NEGATIVE
    if e.func in (sp.exp, sp.Abs, sp.acos):
        return POSITIVE if e.func is sp.exp else NOT_NEGATIVE
    if e.func in (sp.atan, sp.asin, sp.sinh, sp.tanh):
        return signs(e.args[0])
    return ANY


def sign_in(e: Any) -> Signs:
    """The signs of an expression in parameters; of a sum, if its terms have one sign."""
    if e.is_Symbol and e.free_symbols:
        known = [sign for sign, excluded in ((1, e.is_nonpositive), (0, e.is_nonzero), (-1, e.is_nonnegative))
                 if not excluded]  # fmt: skip
        return frozenset(known)
    if e.is_Add and e.free_symbols:
        signs = [sign_in(term) for term in e.args]
        for strict, loose in ((POSITIVE, NOT_NEGATIVE), (NEGATIVE, NOT_POSITIVE)):
            if all(one <= loose for one in signs):
                return strict if strict in signs else loose
        return ANY
    return signs_of(e, sign_in)


class Parameters:
    """The parameters that replace the symbols of a domain; all expressions of a part share them."""

    def __init__(self, domain: Domain) -> None:
        self._domain = domain
        self._numbers: dict[Any, Any] = {}
        self._opaque: dict[Any, Any] = {}
        self._angles: dict[Any, tuple[Any, Any]] = {}
        self._exponentials: dict[Any, Any] = {}
        self._divisors: dict[Any, int] = {}
        self.circles: dict[Any, tuple[Any, Any]] = {}

    def _interval(self, symbol: Any) -> tuple[Any, Any]:
        interval = self._domain.intervals.get(symbol, Interval())
        return visible(interval.low), visible(interval.high)

    def normal(self, e: Any) -> Any:
        """The expression in the parameters, with roots and absolute values split into factors of known sign."""
        for function, by_sines in _BY_SINES.items():
            e = e.replace(function, by_sines)
        arguments = {f.args[0] for f in e.atoms(sp.sin, sp.cos)}
        arguments |= {argument for f in e.atoms(sp.exp, sp.Pow) if (argument := self._exponent(f)) is not None}
        changed = False
        for argument in arguments:
            for fraction, unit in _terms(argument):
                divisor = lcm(self._divisors.get(unit, 1), int(fraction.q))
                changed |= divisor != self._divisors.get(unit, 1)
                self._divisors[unit] = divisor
        if changed:
            # the unit angle is smaller now, so the old substitutions are obsolete
            self._angles.clear()
            self._exponentials.clear()
            self.circles.clear()
        return self._rebuilt(e)

    def factored(self, e: Any) -> Any:
        """The normal form as a product, for `sign_in`."""
        return product(self._on_circles(self.normal(e)))

    def _rebuilt(self, e: Any) -> Any:
        if isinstance(e, Constant):
            return e
        if e.is_Symbol:
            if e not in self._numbers:
                self._numbers[e] = _running(self._interval(e), e)
            return self._numbers[e]
        if e.func in (sp.sin, sp.cos):
            sine, cosine = self._sine_and_cosine(e.args[0])
            return sine if e.func is sp.sin else cosine
        exponent = self._exponent(e)
        if exponent is not None:
            return sp.Mul(*(self._exponential(fraction, unit) for fraction, unit in _terms(exponent)))
        if not e.args:
            return e
        if not _is_arithmetic(e):
            # one symbol for equal expressions
            return self._opaque.setdefault(e, sp.Dummy("o"))
        parts = [self._rebuilt(part) for part in e.args]
        if e.is_Pow and parts[1].is_Rational and not parts[1].is_Integer:
            return _power(self._on_circles(parts[0]), parts[1])
        if e.is_Pow and not parts[1].is_Rational:
            # one symbol for equal powers; the power jumps where its base is 0
            return self._opaque.setdefault((parts[0], parts[1]), sp.Dummy("p"))
        if e.func is sp.Abs:
            return sp.Mul(*(_absolute(factor) ** times for factor, times in _factors(parts[0])))
        if e.func is sp.log:
            return _logarithm(parts[0])
        return built(e.func, [product(part) for part in parts] if e.is_Function else parts)

    def _on_circles(self, e: Any) -> Any:
        """Reduce every sine to at most its first power; the value does not change."""
        if not self.circles or not e.is_polynomial(*(sine for _, sine in self.circles.values())):
            return e
        for cosine, sine in self.circles.values():
            if e.has(sine):
                terms = sp.Poly(e, sine).terms()
                e = sp.Add(*(c * sine ** (k % 2) * (1 - cosine**2) ** (k // 2) for (k,), c in terms))
        return sp.expand(e)

    def _sine_and_cosine(self, argument: Any) -> tuple[Any, Any]:
        terms = _terms(argument)
        turn = sum(fraction for fraction, unit in terms if unit is sp.pi)
        sine, cosine = (self._rebuilt(_unfolded(visible(f(sp.pi * turn)))) for f in (sp.sin, sp.cos))
        for fraction, unit in terms:
            if unit is sp.pi:
                continue
            times = int(fraction * self._divisors[unit])
            one = self._circle((times, unit)) if abs(times) > MOST else self._multiple(times, *self._unit_circle(unit))
            sine, cosine = sine * one[1] + cosine * one[0], cosine * one[1] - sine * one[0]
        return sine, cosine

    @staticmethod
    def _multiple(times: int, sine: Any, cosine: Any) -> tuple[Any, Any]:
        """Sine and cosine of a multiple, by the binomial formula."""
        n = abs(times)
        if n == 1:
            return times * sine, cosine
        terms = [comb(n, k) * (-1) ** (k // 2) * cosine ** (n - k) * sine**k for k in range(n + 1)]
        return (1 if times > 0 else -1) * sp.Add(*terms[1::2]), sp.Add(*terms[::2])

    def _unit_circle(self, unit: Any) -> tuple[Any, Any]:
        """Sine and cosine of ``unit`` divided by its divisor."""
        if unit not in self._angles and unit.func in _OF_INVERSE and self._divisors[unit] == 1:
            self._angles[unit] = tuple(self._rebuilt(part) for part in _OF_INVERSE[unit.func](unit.args[0]))
        if unit not in self._angles:
            low, high = (end / self._divisors[unit] for end in self._interval(unit))
            low, high = _plain_end(low, sp.floor), _plain_end(high, sp.ceiling)
            # half turns that move the interval between -pi and pi
            turns = sp.floor(low / sp.pi) + (1 if high - low > sp.pi else 0) if -sp.oo not in (low, -high) else 0
            low, high = low - turns * sp.pi, high - turns * sp.pi
            if is_below(-sp.pi, low, True) and is_below(high, sp.pi, True):
                ends = (sp.tan(low / 2) if low != -sp.pi else -sp.oo, sp.tan(high / 2) if high != sp.pi else sp.oo)
                t = _running(ends, unit)
                sign = -1 if turns % 2 else 1
                self._angles[unit] = sign * 2 * t / (1 + t**2), sign * (1 - t**2) / (1 + t**2)
            else:
                self._angles[unit] = self._circle(unit)
        return self._angles[unit]

    def _circle(self, angle: Any) -> tuple[Any, Any]:
        """Sine and cosine of an angle of which nothing is known."""
        cosine, sine = self.circles.setdefault(angle, (sp.Dummy("c", real=True), sp.Dummy("s", real=True)))
        return sine, cosine

    def _exponent(self, e: Any) -> Any:
        """u if e is exp(u), or a power with a positive base and a non-rational exponent; else None."""
        if e.func is sp.exp:
            return e.args[0]
        if not e.is_Pow or e.exp.is_Rational:
            return None
        is_positive = sign_in(e.base) == POSITIVE or (
            e.base.is_Symbol and is_below(sp.S.Zero, self._interval(e.base)[0], True)
        )
        return e.exp * built(sp.log, [e.base]) if is_positive else None

    def _exponential(self, fraction: Any, unit: Any) -> Any:
        inner = unit.number if isinstance(unit, Constant) else unit
        if inner.func is sp.log:
            base = self._rebuilt(inner.args[0])
            return base**fraction if fraction.is_Integer else _power(base, fraction)
        times = fraction * self._divisors[unit]
        if abs(times) > MOST:
            return self._exponentials.setdefault((times, unit), sp.Dummy("E", positive=True))
        return self._exponentials.setdefault(unit, sp.Dummy("E", positive=True)) ** times


def _is_arithmetic(e: Any) -> bool:
    """Whether it is an operation or a function of numbers, unlike cases, integrals or sums."""
    return bool(e.is_Add or e.is_Mul or e.is_Pow or e.is_Function) and all(isinstance(part, sp.Expr) for part in e.args)


def _terms(argument: Any) -> list[tuple[Any, Any]]:
    """The argument as a sum of rational multiples of units."""
    terms = [term.as_coeff_Mul(rational=True) for term in sp.Add.make_args(sp.expand(argument))]
    return [(fraction, ONE if unit == 1 else unit) for fraction, unit in terms]


def _plain_end(end: Any, outward: Any) -> Any:
    """The end of an angle's interval, moved outward to a multiple of pi/2 if the tangent of its half is not elementary.

    A statement on the wider interval also holds on the given one.
    """
    if end in (sp.oo, -sp.oo):
        return end
    quarters = evaluate(2 * end / sp.pi, {}, MANY_BITS)
    if quarters.exact is not None and quarters.exact.is_Integer:
        return quarters.exact * sp.pi / 2
    with ctx.workprec(MANY_BITS):
        whole = (quarters.ball.floor() if outward is sp.floor else quarters.ball.ceil()).unique_fmpz()
    if whole is None:
        return -sp.oo if outward is sp.floor else sp.oo
    return sp.Integer(int(whole)) * sp.pi / 2


def _running(interval: tuple[Any, Any], symbol: Any) -> Any:
    """An expression in one new symbol whose values are exactly an open interval."""
    low, high = interval
    name = str(symbol)
    if low == -sp.oo and high == sp.oo:
        return sp.Dummy(name, real=True, integer=symbol.is_integer, zero=symbol.is_zero)
    if low == 0 and high == sp.oo:
        return sp.Dummy(name, positive=True, integer=symbol.is_integer)
    t = sp.Dummy(name, positive=True)
    if high == sp.oo:
        return low + t
    if low == -sp.oo:
        return high - t
    return (low + high * t) / (1 + t)


def product(e: Any) -> Any:
    """An expression as the product of its factors."""
    return sp.Mul(*(base**times for base, times in _irreducible(e)))


def _irreducible(e: Any) -> Iterable[tuple[Any, Any]]:
    """Irreducible polynomials, what is no polynomial, and numbers, with their exponents.

    By flint, because ``sympy.factor`` draws points at random and can take minutes where it is unlucky.
    """
    found: dict[Any, Any] = defaultdict(lambda: sp.Integer(0))
    for factor in sp.Mul.make_args(sp.together(e)):
        base, times = factor.as_base_exp()
        # a sum may be a number
        base = sp.expand(base) if base.is_Add and sp.expand(base).is_Rational else base
        polynomial = sp.Poly(base) if base.is_Add and times.is_Integer else None
        if polynomial is None or not (polynomial.domain.is_ZZ or polynomial.domain.is_QQ):
            found[base] += times
            continue
        shared, polynomial = polynomial.clear_denoms(convert=True)
        ring = fmpz_mpoly_ctx.get(("x", len(polynomial.gens)), Ordering.lex)
        content, parts = ring.from_dict({powers: int(c) for powers, c in polynomial.terms()}).factor()
        found[sp.Integer(int(content)) / shared] += times
        for part, often in parts:
            terms = {powers: int(c) for powers, c in part.terms()}
            found[sp.Poly(terms, *polynomial.gens).as_expr()] += often * times
    return found.items()


def _factors(e: Any) -> list[tuple[Any, Any]]:
    """Factors and their exponents: factors of known sign separately, numbers as powers of primes."""
    found: list[tuple[Any, Any]] = []
    for base, times in _irreducible(e):
        if base.is_Rational and base != 0 and times.is_Integer:
            found += [(sp.Integer(p), k * times) for p, k in sp.factorint(abs(base.p)).items() if p != 1]
            found += [(sp.Integer(p), -k * times) for p, k in sp.factorint(base.q).items() if p != 1]
            if base < 0:
                found.append((sp.Integer(-1), times))
        else:
            found.append((base, times))
    return found


def _absolute(factor: Any) -> Any:
    signs = sign_in(factor)
    if signs <= NOT_NEGATIVE:
        return factor
    return -factor if signs <= NOT_POSITIVE else sp.Abs(sp.expand(factor))


def _power(base: Any, exponent: Any) -> Any:
    """base ** exponent for a base that is not negative, with known roots extracted."""
    outside, inside = sp.Integer(1), sp.Integer(1)
    for factor, times in _factors(base):
        signs = sign_in(factor)
        if not factor.free_symbols and not factor.is_Rational:
            inside *= factor**times
        elif signs <= NOT_NEGATIVE:
            outside *= visible(factor ** (times * exponent))
        elif times.is_Integer and times % 2 == 0 and exponent.q == 2:
            outside *= _absolute(factor) ** (times * exponent)
        elif signs <= NOT_POSITIVE:
            outside *= visible((-factor) ** (times * exponent))
            inside *= (-1) ** times
        else:
            inside *= factor**times
    root = (sp.expand(inside) if inside.is_polynomial() else inside) ** exponent
    return outside * (visible(root) if inside.is_Rational else root)


def _logarithm(e: Any) -> Any:
    factors = _factors(e)
    if all(sign_in(factor) == POSITIVE for factor, _ in factors):
        return sp.Add(*(times * built(sp.log, [sp.expand(factor)]) for factor, times in factors))
    return built(sp.log, [product(e)])


def _with_root_symbols(e: Any, roots: dict[Any, tuple[Any, int]]) -> Any:
    """Replace every root by a symbol; ``roots`` receives the radicands, inner roots first."""
    if not e.args:
        return e
    if e.func is sp.Abs:
        return _root(_with_root_symbols(e.args[0], roots) ** 2, 2, roots)
    if e.is_Pow and e.exp.is_Rational and not e.exp.is_Integer:
        return _root(_with_root_symbols(e.base, roots), int(e.exp.q), roots) ** e.exp.p
    return e.func(*(_with_root_symbols(part, roots) for part in e.args))


def _root(radicand: Any, index: int, roots: dict[Any, tuple[Any, int]]) -> Any:
    for symbol, known in roots.items():
        if known == (radicand, index):
            return symbol
    symbol = sp.Dummy("r")
    roots[symbol] = radicand, index
    return symbol


def _reduced(e: Any, symbol: Any, index: int, power: Any) -> Any:
    """The numerator of e after the substitution symbol^index = power."""
    if not e.has(symbol):
        return e
    total = sp.Integer(0)
    for (times,), coefficient in sp.Poly(e, symbol).terms():
        total += coefficient * symbol ** (times % index) * power ** (times // index)
    return sp.together(total).as_numer_denom()[0]
