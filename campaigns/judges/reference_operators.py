"""Matrices of composed laws by operators on functions, which share no formula with the library.

A law is a sum of words. The laws of a word act, from the last one back, on the functions of the basis as functions of
any angle. Teeth and arcs use formulas of single rays, scatterings their eigenvalues, and consecutive rectangular teeth
their action on even and odd functions. Integrals are composite Gauss rules between all angles at which the integrand
may not be smooth. The arithmetic is extended precision, except for the conditionals of arcs. The error is twice the
difference of a coarse and a fine rule, plus rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc

from asperity import kernels as ker

# Extended precision if the processor has it, so that errors near rounding are resolved; conditionals of arcs are
# float64.
Floats = NDArray[Any]
Extended = np.longdouble
PI = 4.0 * np.arctan(Extended(1.0))
# Rounding error of the reference for each basis function, in ulps: sums of about ten thousand terms.
ROUNDING = 25.0
# Function values held in memory at a time.
CHUNK = 2**20


# ---- functions of the angle, with the angles at which they are not smooth ------------------------------------------
@dataclass(frozen=True)
class Function:
    """n functions of the angle: values of shape (angles, n), and the angles at which they are not smooth."""

    evaluate: Callable[[Floats], Floats]
    breaks: Floats


# Breakpoints towards grazing, and towards pi/2, where the involution below maps them.
NEAR = PI * Extended(0.4) ** np.arange(2, 26)
GRADED = NEAR, PI - NEAR, PI / 2 - NEAR, PI / 2 + NEAR


@dataclass(frozen=True)
class Rule:
    """The resolution of the reference's integrals and the type of its numbers.

    The resolution consists of panels of (0, pi), Gauss nodes on each panel, crossings of a crevice and hits of an arc.
    """

    panels: int
    nodes: int
    crossings: int
    hits: int
    kind: type = Extended

    def grid(self, breaks: Floats) -> tuple[Floats, Floats]:
        """Nodes and weights of sin(theta)/2 d theta on (0, pi)."""
        regular = PI * np.arange(self.panels + 1, dtype=Extended) / self.panels
        edges = np.unique(np.clip(np.concatenate((regular, breaks, *GRADED)), 0, PI))
        angle, weight = (part.ravel() for part in nodes_between(edges[:-1], edges[1:], self.nodes))
        return angle.astype(self.kind), (weight * np.sin(angle) / 2).astype(self.kind)

    def moments(self, functions: Callable[[Floats], Floats], function: Function, breaks: Floats) -> Floats:
        """Means of products of functions, shape (functions, functions)."""
        angle, weight = self.grid(np.concatenate((function.breaks, breaks)))
        size = function.evaluate(angle[:1]).shape[1] + functions(angle[:1]).shape[1]
        step = max(CHUNK // size, 1)
        parts = (slice(start, start + step) for start in range(0, angle.size, step))
        return np.asarray(
            sum(functions(angle[part]).T @ (weight[part, None] * function.evaluate(angle[part])) for part in parts)
        )


def nodes_between(low: Floats, high: Floats, number: int) -> tuple[Floats, Floats]:
    """Gauss nodes in s with angle = low + (high - low) s^2 (3 - 2 s), which makes square roots at the ends smooth."""
    node, weight = gauss(number)
    s = (1 + node) / 2
    width = (high - low)[:, None]
    return low[:, None] + width * (s * s * (3 - 2 * s)), width * (3 * s * (1 - s) * weight)


@cache
def gauss(number: int) -> tuple[Floats, Floats]:
    """Gauss nodes and weights on (-1, 1) in extended precision, by Newton steps from the float64 values."""
    x = np.polynomial.legendre.leggauss(number)[0].astype(Extended)
    for _ in range(3):
        table = _legendre(number, x)
        slope = number * (table[:, -2] - x * table[:, -1]) / (1 - x * x)
        x = x - table[:, -1] / slope
    return x, 2 / ((1 - x * x) * slope**2)


def _legendre(degree: int, x: Floats) -> Floats:
    return np.polynomial.legendre.legvander(x, degree)


Operator = Callable[[Function, Rule], Function]


def polynomials(number: int, angle: Floats) -> Floats:
    """Orthonormal Legendre polynomials in the cosine."""
    norms = np.sqrt(2 * np.arange(number).astype(angle.dtype) + 1)
    return np.asarray(_legendre(number - 1, np.cos(angle)) * norms)


@dataclass(frozen=True)
class Diagonal:
    """The operator with given eigenvalues on the first Legendre polynomials and 0 on the others."""

    eigenvalues: Floats

    def __call__(self, function: Function, rule: Rule) -> Function:
        size = self.eigenvalues.size
        moments = rule.moments(lambda angle: polynomials(size, angle), function, np.empty(0))
        image = self.eigenvalues[:, None] * moments

        def evaluate(theta: Floats) -> Floats:
            step, moments = max(CHUNK // (4 * size), 1), image.astype(theta.dtype)
            parts = (theta[start : start + step] for start in range(0, max(theta.size, 1), step))
            return np.concatenate([polynomials(size, part) @ moments for part in parts])

        return Function(evaluate, np.empty(0))


def scattering(g: float) -> Operator:
    """Henyey-Greenstein: g^l on the polynomial of degree l."""
    last = 1 if g == 0.0 else int(np.ceil(np.log(1e-19) / np.log(abs(g)))) + 1
    return Diagonal(Extended(g) ** np.arange(last))


@dataclass(frozen=True, eq=False)
class Piecewise:
    """Transitions between bins of equal measure, uniform within the bin."""

    array: Floats

    def __call__(self, function: Function, rule: Rule) -> Function:
        bins = piecewise_polynomials(equal_bins(len(self.array)), 0)
        image = self.array @ rule.moments(bins.evaluate, function, bins.breaks)
        return Function(lambda theta: bins.evaluate(theta) @ image.astype(theta.dtype), bins.breaks)


def equal_bins(size: int) -> Floats:
    """Edges of bins of equal measure."""
    return np.arccos(1 - 2 * np.arange(size + 1, dtype=Extended) / size)


def piecewise_polynomials(edges: Floats, degree: int) -> Function:
    """Orthonormal polynomials in the angle on each cell, the normalised indicators of the cells if ``degree`` is 0."""
    width, changes = degree + 1, [_orthonormal(*ends, degree) for ends in pairwise(edges)]

    def values(angle: Floats) -> Floats:
        ends = edges.astype(angle.dtype)
        cell = np.clip(np.searchsorted(ends, angle, side="right") - 1, 0, len(changes) - 1)
        found = np.zeros((angle.size, len(changes) * width), dtype=angle.dtype)
        for k, change in enumerate(changes):
            row = np.flatnonzero(cell == k)
            local = (2 * angle[row] - ends[k] - ends[k + 1]) / (ends[k + 1] - ends[k])
            found[row, k * width : (k + 1) * width] = _legendre(degree, local) @ change.astype(angle.dtype)
        return found

    return Function(values, edges[1:-1])


def _orthonormal(low: Any, high: Any, degree: int) -> Floats:
    """Combinations of Legendre polynomials that are orthonormal on (low, high), by Gram-Schmidt."""
    node, weight = gauss(degree + 16)
    mass = (high - low) * weight * np.sin(low + (high - low) * (1 + node) / 2) / 4
    table, found = _legendre(degree, node), np.eye(degree + 1, dtype=Extended)
    for column in range(degree + 1):
        for before in [*range(column), *range(column)]:
            overlap = np.sum(mass * (table @ found[:, before]) * (table @ found[:, column]))
            found[:, column] -= overlap * found[:, before]
        found[:, column] /= np.sqrt(np.sum(mass * (table @ found[:, column]) ** 2))
    return found


def flip(function: Function, rule: Rule) -> Function:
    """Specular reflection."""
    return Function(lambda theta: function.evaluate(theta.dtype.type(PI) - theta), PI - function.breaks)


def identity(function: Function, rule: Rule) -> Function:
    """Retroreflection."""
    return function


def exchange(function: Function, rule: Rule) -> Function:
    """The involution u -> 1/2 - u for 0 < u < 1/2, u = (1 - cos theta)/2."""
    fixed = np.append(function.breaks, PI / 2)
    return Function(lambda theta: function.evaluate(exchanged(theta)), np.append(exchanged(fixed), PI / 2))


def exchanged(theta: Floats) -> Floats:
    """The involution: reversed below pi/2, the identity above."""
    theta = np.asarray(theta)
    return np.where(theta < PI / 2, 2 * np.arcsin(np.sqrt(np.abs(np.cos(theta)) / 2)), theta)


# Number of crossings of a crevice followed towards grazing for functions that are not smooth there.
MOST_TIMES = 30


# ---- laws of isometries: probabilities of the branches s theta + c ------------------------------------------------
@dataclass(frozen=True)
class Isometries:
    """Branches s theta + c with probabilities p(theta), shape (angles, branches), smooth between breakpoints."""

    sign: Floats
    offset: Floats
    probabilities: Callable[[Floats], Floats]
    breakpoints: Floats

    def __call__(self, function: Function, rule: Rule) -> Function:
        targets = function.breaks
        sources = (self.sign[:, None] * (targets - self.offset[:, None])).ravel() if targets.size else np.empty(0)
        breaks = np.concatenate((self.breakpoints, sources[(sources > 0.0) & (sources < PI)]))
        return Function(lambda theta: self._means(function, theta), np.unique(breaks))

    def _means(self, function: Function, theta: Floats) -> Floats:
        fraction = self.probabilities(theta)
        total = 0.0 * function.evaluate(theta)
        sign, offset = self.sign.astype(theta.dtype), self.offset.astype(theta.dtype)
        for branch in range(sign.size):
            row = np.flatnonzero(fraction[:, branch] > 0.0)
            outgoing = np.clip(sign[branch] * theta[row] + offset[branch], 0, theta.dtype.type(PI))
            total[row] += fraction[row, branch][:, None] * function.evaluate(outgoing)
        return total


@dataclass(frozen=True)
class Triangular:
    """Triangular teeth, from the formula of a single ray with bounds of the number n of hits."""

    apex: float

    def __call__(self, function: Function, rule: Rule) -> Function:
        psi = Extended(self.apex)
        n = np.arange(np.ceil(PI / psi) + 3, dtype=Extended)
        even = n % 2 == 0
        sign = np.where(even, 1, -1)
        left, right = np.where(even, PI - n * psi, n * psi), np.where(even, n * psi - PI, 2 * PI - n * psi)

        def half(theta: Floats) -> Floats:
            angle, hits = theta.dtype.type(psi), n.astype(theta.dtype)
            lowest = np.abs(theta - angle / 2)
            highest = np.maximum(np.minimum(theta.dtype.type(PI / 2), theta + angle / 2), lowest)
            first, last = (
                np.clip((hits + side) * angle - theta[:, None], lowest[:, None], highest[:, None])
                for side in (-0.5, 0.5)
            )
            width = np.sin(theta) * np.sin(angle / 2)
            return np.asarray(np.sin((first + last) / 2) * np.sin((last - first) / 2) / width[:, None])

        k = np.arange(-2, 2 * np.ceil(PI / psi) + 6, dtype=Extended)
        one = np.concatenate((k * psi / 2, (k * psi - PI) / 2, (PI - k * psi) / 2))
        both = np.concatenate((one, PI - one))
        return Isometries(
            np.concatenate((sign, sign)),
            np.concatenate((left, right)),
            lambda theta: np.concatenate((half(theta), half(theta.dtype.type(PI) - theta)), axis=1),
            both[(both > 0) & (both < PI)],
        )(function, rule)


@dataclass(frozen=True)
class Rectangular:
    r"""Consecutive rectangular teeth: a function with f(pi - theta) = -f(theta) is multiplied by -c, c = |1 - d mod 2|.

    Reflection is specular with probability 1 - {d}/2 or 1/2 + {d}/2, d = 2 r |cot theta|; even functions are invariant.
    Far towards grazing the power c^n is replaced by its mean over a period. The transition is smooth over a range of
    many periods, so that the error against a smooth function is smaller than any power of that range.

    Parameters
    ----------
    powers : dict
        r and its number of occurrences.
    """

    powers: dict[float, int]

    def __call__(self, function: Function, rule: Rule) -> Function:
        # points where the function is not smooth near grazing must lie where the power is not replaced yet
        near = np.minimum(function.breaks, PI - function.breaks)
        nearest = float(np.min(near[near > 1e-12], initial=np.pi))
        last = int(np.clip(2.0 * 2.2 * max(self.powers) / nearest, rule.crossings, MOST_TIMES * rule.crossings))

        def odd_factor(theta: Floats) -> Floats:
            product = np.ones(theta.shape, dtype=theta.dtype)
            for r, n in self.powers.items():
                d = 2 * theta.dtype.type(r) / np.abs(np.tan(theta))
                rest = d - 2 * np.floor(d / 2)
                # w is 1 for even d and 1/2 for odd d; the factor is 1 - 2 (1 - w) up to its sign
                w = 1 - np.minimum(rest, 2 - rest) / 2
                kept = (erfc(6.0 * (4.0 * np.minimum(d, 1e9).astype(float) / last - 3.0)) / 2).astype(d.dtype)
                product *= (-1) ** n * (kept * (2 * w - 1) ** n + (1 - kept) / (n + 1))
            return product

        def probabilities(theta: Floats) -> Floats:
            odd = odd_factor(theta)
            return np.stack(((1 - odd) / 2, (1 + odd) / 2), axis=-1)

        many = np.arange(last + 1, dtype=Extended)
        steep = np.concatenate([np.arctan2(2 * Extended(r), many) for r in self.powers])
        return Isometries(np.array([-1, 1]), np.array([PI, 0]), probabilities, np.concatenate((steep, PI - steep)))(
            function, rule
        )


def joined(word: tuple[Operator, ...]) -> tuple[Operator, ...]:
    """The word with consecutive rectangular teeth joined into one operator; mirrors between them commute with it."""
    found: list[Operator] = []
    for operator in word:
        place = len(found)
        while place and found[place - 1] in (flip, identity):
            place -= 1
        before = found[place - 1] if place else None
        if isinstance(operator, Rectangular) and isinstance(before, Rectangular):
            powers = dict(before.powers)
            for r, n in operator.powers.items():
                powers[r] = powers.get(r, 0) + n
            found[place - 1] = Rectangular(powers)
        else:
            found.append(operator)
    return tuple(found)


# Multiple of the hits with theta breakpoints up to which conditionals of arcs are followed, and their number of nodes.
MORE_HITS, FEW_NODES = 16, 6


# ---- circular arcs ------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Arcs:
    """Focusing arcs: Gauss rules in delta between the changes of the number of hits N and the target breakpoints.

    For delta < pi/2 the outgoing angle is theta + pi - 2 N delta, with (xi + theta)/(2 N + 1) < delta < (xi + theta)/(2
    N - 1) and |theta - xi| < delta < min(theta + xi, 2 pi - theta - xi). For delta > pi/2 it is the mirror image.
    """

    half_angle: float

    def __call__(self, function: Function, rule: Rule) -> Function:
        targets = np.sort(function.breaks.astype(float))
        # also where the function is smooth but varies strongly
        regular = np.linspace(0.0, np.pi, 8 + rule.panels // 3)[1:-1]
        cuts = np.unique(np.concatenate((targets, regular)))

        def evaluate(theta: Floats) -> Floats:
            theta = theta.astype(float)
            step = max(1, CHUNK // (MORE_HITS * rule.hits))
            return np.concatenate([some(theta[start : start + step]) for start in range(0, theta.size, step)])

        def some(theta: Floats) -> Floats:
            total = np.zeros((theta.size, function.evaluate(theta[:1]).shape[1]))
            for mirrored in (False, True):
                turned, aims = (np.pi - theta, np.pi - cuts[::-1]) if mirrored else (theta, cuts)
                for row, outgoing, weight in self._row(turned, aims, rule):
                    angle = np.clip(np.pi - outgoing if mirrored else outgoing, 0.0, np.pi)
                    step = max(1, CHUNK // (weight.shape[1] * total.shape[1]))
                    for start in range(0, row.size, step):
                        part = slice(start, start + step)
                        value = function.evaluate(angle[part].ravel()).reshape(*angle[part].shape, -1)
                        np.add.at(total, row[part], np.einsum("ij,ijk->ik", weight[part], value))
            return total / (2.0 * np.sin(theta) * np.sin(self.half_angle))[:, None]

        forward, back = self._breaks(targets, rule.hits), np.pi - self._breaks(np.pi - targets, rule.hits)
        return Function(evaluate, np.concatenate((forward, back)))

    def _row(self, theta: Floats, targets: Floats, rule: Rule) -> Iterator[tuple[Floats, Floats, Floats]]:
        """Indices of ``theta``, shape (pieces,), with outgoing angles and weights of chords below pi/2 (pieces,
        nodes)."""
        number = np.arange(1.0, MORE_HITS * rule.hits + 1.0)
        begin, end = self._ends(theta)
        reach = (self.half_angle + theta)[:, None]
        low = np.clip(reach / (2.0 * number + 1.0), begin[:, None], end[:, None])
        high = np.clip(reach / (2.0 * number - 1.0), begin[:, None], end[:, None])
        row, column = np.nonzero(low < high)
        low, high, hits = low[row, column], high[row, column], number[column]
        first = np.searchsorted(targets, theta[row] + np.pi - 2.0 * hits * high, side="right")
        last = np.searchsorted(targets, theta[row] + np.pi - 2.0 * hits * low, side="left")
        crossed = np.maximum(last - first, 0)
        owner = np.repeat(np.arange(row.size), crossed)
        which = np.arange(owner.size) - np.repeat(np.cumsum(crossed) - crossed, crossed) + first[owner]
        cut = (theta[row][owner] + np.pi - targets[which]) / (2.0 * hits[owner])
        cut = np.clip(cut, low[owner], high[owner])
        owner = np.concatenate((np.arange(row.size), owner))
        start = np.concatenate((low, cut))
        order = np.lexsort((start, owner))
        owner, start = owner[order], start[order]
        closes = np.append(owner[1:] != owner[:-1], True)
        stop = np.where(closes, high[owner], np.append(start[1:], 0.0))
        few = hits[owner] <= rule.hits
        for chosen, nodes in ((few, rule.nodes), (~few, FEW_NODES)):
            piece = owner[chosen]
            chord, weight = (part.astype(float) for part in nodes_between(start[chosen], stop[chosen], nodes))
            yield row[piece], theta[row[piece], None] + np.pi - 2.0 * hits[piece, None] * chord, weight * np.sin(chord)
        # the chords with more hits
        rest = np.minimum(reach[:, 0] / (2.0 * number[-1] + 1.0), end)
        more = np.flatnonzero(begin < rest)
        chord, weight = (part.astype(float) for part in nodes_between(begin[more], rest[more], FEW_NODES))
        every = np.ceil((reach[more] - chord) / (2.0 * chord))
        yield more, theta[more, None] + np.pi - 2.0 * every * chord, weight * np.sin(chord)

    def _ends(self, theta: Floats) -> tuple[Floats, Floats]:
        xi = self.half_angle
        begin = np.abs(theta - xi)
        return begin, np.maximum(np.minimum(np.minimum(theta + xi, 2.0 * np.pi - theta - xi), 0.5 * np.pi), begin)

    def _breaks(self, targets: Floats, most: int) -> Floats:
        """Angles at which a change of N meets an end, or a target meets a change of N or an end."""
        xi, n = self.half_angle, np.arange(1.0, most + 1.0)[:, None]
        zero, one = np.zeros_like(n), np.ones_like(n)
        sides = [
            (1.0 / (2.0 * n + 1.0), xi / (2.0 * n + 1.0)),
            (1.0 / (2.0 * n - 1.0), xi / (2.0 * n - 1.0)),
            *((a * one, b * one) for a, b in ((1.0, -xi), (-1.0, xi), (1.0, xi), (-1.0, 2.0 * np.pi - xi))),
            (zero, 0.5 * np.pi * one),
        ]
        found = [xi * (1.0 + 1.0 / n).ravel(), xi * (n / (n + 1.0)).ravel()]
        found.append(np.array([xi, 0.5 * np.pi - xi]))
        # a sequence of changes accumulates at xi
        found += [xi * (1.0 + sign / most * 0.4 ** np.arange(1.0, 12.0)) for sign in (-1.0, 1.0)]
        for slope, offset in sides:
            theta = (targets - np.pi + 2.0 * n * offset) / (1.0 - 2.0 * n * slope)
            chord = slope * theta + offset
            begin, end = self._ends(theta)
            slack = 1e-9
            met = (chord > begin - slack) & (chord < end + slack) & (theta > 0.0) & (theta < np.pi)
            met &= (chord > (xi + theta) / (2.0 * n + 1.0) - slack) & (chord < (xi + theta) / (2.0 * n - 1.0) + slack)
            found.append(theta[met])
        every = np.concatenate(found)
        return every[(every > 0.0) & (every < np.pi)]


# ---- sums of words ------------------------------------------------------------------------------------------------
Words = tuple[tuple[float, tuple[Operator, ...]], ...]


@dataclass(frozen=True)
class Expression:
    """A law and the words whose sum it is; the operators of a word are listed from the first to the last."""

    law: ker.Law
    words: Words

    def __matmul__(self, other: Expression) -> Expression:
        pairs = tuple((a * b, first + second) for a, first in self.words for b, second in other.words)
        return Expression(self.law @ other.law, pairs)

    def power(self, exponent: int) -> Expression:
        """The law applied several times."""
        found = self
        for _ in range(exponent - 1):
            found = found @ self
        return Expression(self.law**exponent, found.words)

    def mixed(self, other: Expression, fraction: float) -> Expression:
        """A mixture."""
        weighted = (fraction, self.words), (1.0 - fraction, other.words)
        words = tuple((weight * a, word) for weight, words in weighted for a, word in words)
        return Expression(fraction * self.law + (1.0 - fraction) * other.law, words)

    def turned(self) -> Expression:
        """The law in the other frame."""
        return Expression(self.law.in_specular_frame(), tuple((a, (*word, flip)) for a, word in self.words))

    def adjoint(self) -> Expression:
        """The adjoint; all operators but transitions between bins are symmetric."""
        words = (
            (a, tuple(Piecewise(one.array.T) if isinstance(one, Piecewise) else one for one in reversed(word)))
            for a, word in self.words
        )
        return Expression(self.law.adjoint(), tuple(words))


def leaf(law: ker.Law, operator: Operator) -> Expression:
    """A single law."""
    return Expression(law, ((1.0, (operator,)),))


COARSE, FINE = Rule(40, 16, 400, 40), Rule(56, 20, 600, 64)
# Divisor of the number of crossings if other teeth multiply the breakpoints.
FEWER_CROSSINGS = 3


def reference(expression: Expression, basis: ker.Basis) -> tuple[Floats, float]:
    """<e_i, P e_j>, and its error: twice the difference from a coarser rule, plus rounding."""
    (coarse, _), (fine, rounding) = (_by_rule(expression, basis, rule) for rule in (COARSE, FINE))
    return fine, 2.0 * float(np.linalg.norm(fine - coarse)) + rounding


def _by_rule(expression: Expression, basis: ker.Basis, rule: Rule) -> tuple[Floats, float]:
    last = _functions(basis)
    total, rounding = np.zeros((basis.size, basis.size), dtype=Extended), 0.0
    for weight, word in expression.words:
        operators = joined(word)
        degrees = [operator.eigenvalues.size for operator in operators if isinstance(operator, Diagonal)]
        degrees.append(basis.size if isinstance(basis, ker.Legendre) else 0)
        teeth = sum(isinstance(operator, (Triangular, Rectangular, Arcs)) for operator in operators)
        arcs = any(isinstance(operator, Arcs) for operator in operators)
        own = replace(
            rule,
            # conditionals of arcs are expensive, and their nodes resolve several oscillations
            panels=rule.panels + max(degrees) // (4 if arcs else 1),
            crossings=rule.crossings if teeth < 2 else rule.crossings // FEWER_CROSSINGS,
            kind=float if arcs else Extended,
        )
        function = last
        for operator in reversed(operators):
            function = operator(function, own)
        total += weight * own.moments(last.evaluate, function, last.breaks)
        rounding += weight * ROUNDING * float(np.finfo(own.kind).eps) * basis.size
    return total, rounding


def _functions(basis: ker.Basis) -> Function:
    if isinstance(basis, ker.Legendre):
        return Function(lambda angle: polynomials(basis.size, angle), np.empty(0))
    edges = basis.edges.astype(Extended)
    edges[-1] = PI
    if isinstance(basis, ker.Bins) and np.abs(edges - equal_bins(basis.size)).max() < 1e-14:
        edges = equal_bins(basis.size)
    return piecewise_polynomials(edges, basis.degree if isinstance(basis, ker.Panels) else 0)
