"""Reported errors of matrices of random compositions, mixtures, powers, frames and adjoints, against references.

``python -m benchmarks.composed_laws --count 2000`` draws laws and bases from seeds 0, 1, ... and prints how many of the
reported errors hold, by method and by basis, and the cases where one does not hold or cannot be told.

The reference expands the expression into words without simplifying them and applies the laws of a word to the functions
of the basis, from the last one back, as functions of any angle: rays into teeth and arcs by the formulas of single
rays, scatterings by their eigenvalues. Every integral is a composite Gauss rule between all angles at which the
integrand may not be smooth, which are carried along. It is done twice, coarsely and finely; twice the difference and
rounding are its own error.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from asperity import kernels as ker
from asperity.errors import InputError

Floats = NDArray[np.float64]
# The reference's rounding for each function of the basis: sums of some ten thousand terms.
ROUNDING = 5e-16
# Of matrices by rays the error is a spread, not a bound: how far beyond a wrong one would be.
SAMPLES = 2**14


# ---- functions of the angle, and where they are not smooth ---------------------------------------------------------
@dataclass(frozen=True)
class Function:
    """n functions of the angle at once: values of shape (angles, n), and the angles where they are not smooth."""

    evaluate: Callable[[Floats], Floats]
    breaks: Floats


# Towards grazing, and towards pi/2 where the involution below comes from there.
NEAR = np.pi * 0.4 ** np.arange(2.0, 24.0)
GRADED = NEAR, np.pi - NEAR, 0.5 * np.pi - NEAR, 0.5 * np.pi + NEAR


@dataclass(frozen=True)
class Rule:
    """How fine the reference's integrals are."""

    panels: int
    nodes: int
    crossings: int

    def grid(self, breaks: Floats) -> tuple[Floats, Floats]:
        """Nodes and weights of sin(theta)/2 d theta on (0, pi)."""
        edges = np.concatenate((np.linspace(0.0, np.pi, self.panels + 1), breaks, *GRADED))
        edges = np.unique(np.clip(edges, 0.0, np.pi))
        edges = edges[np.append(True, np.diff(edges) > 1e-13)]
        x, w = np.polynomial.legendre.leggauss(self.nodes)
        half = 0.5 * np.diff(edges)[:, None]
        angle = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * x).ravel()
        return angle, (half * w).ravel() * 0.5 * np.sin(angle)


Operator = Callable[[Function, Rule], Function]


def polynomials(number: int, angle: Floats) -> Floats:
    """Orthonormal Legendre polynomials in the cosine."""
    return np.polynomial.legendre.legvander(np.cos(angle), number - 1) * np.sqrt(2.0 * np.arange(number) + 1.0)


def diagonal(eigenvalues: Floats) -> Operator:
    """The operator with these eigenvalues on the first Legendre polynomials, and 0 on the others."""

    def act(function: Function, rule: Rule) -> Function:
        angle, weight = rule.grid(function.breaks)
        moments = polynomials(eigenvalues.size, angle).T @ (weight[:, None] * function.evaluate(angle))
        image = eigenvalues[:, None] * moments
        return Function(lambda theta: polynomials(eigenvalues.size, theta) @ image, np.empty(0))

    return act


def scattering(g: float) -> Operator:
    """Henyey-Greenstein: g^l on the polynomial of degree l."""
    last = 1 if g == 0.0 else int(np.ceil(np.log(1e-18) / np.log(abs(g)))) + 1
    return diagonal(g ** np.arange(last))


def piecewise(array: Floats) -> Operator:
    """From bin to bin of equal measure, uniformly within the bin."""
    size = len(array)
    edges = np.arccos(1.0 - 2.0 * np.arange(size + 1) / size)

    def act(function: Function, rule: Rule) -> Function:
        angle, weight = rule.grid(np.concatenate((function.breaks, edges)))
        cell = np.clip(np.searchsorted(edges, angle) - 1, 0, size - 1)
        means = np.zeros((size, function.evaluate(angle[:1]).shape[1]))
        np.add.at(means, cell, size * weight[:, None] * function.evaluate(angle))
        image = array @ means
        return Function(lambda theta: image[np.clip(np.searchsorted(edges, theta) - 1, 0, size - 1)], edges[1:-1])

    return act


def flip(function: Function, rule: Rule) -> Function:
    """Specular reflection."""
    return Function(lambda theta: function.evaluate(np.pi - theta), np.pi - function.breaks)


def identity(function: Function, rule: Rule) -> Function:
    """Retroreflection."""
    return function


def exchange(function: Function, rule: Rule) -> Function:
    """The involution u -> 1/2 - u for 0 < u < 1/2, u = (1 - cos theta)/2."""
    fixed = np.append(function.breaks, 0.5 * np.pi)
    return Function(lambda theta: function.evaluate(exchanged(theta)), np.append(exchanged(fixed), 0.5 * np.pi))


def exchanged(theta: Floats) -> Floats:
    """The involution: the half below pi/2 turned round, the other half as it is."""
    return np.where(theta < 0.5 * np.pi, np.arccos(np.clip(1.0 - np.cos(theta), -1.0, 1.0)), theta)


# ---- laws of isometries: probabilities of the branches s theta + c ------------------------------------------------
@dataclass(frozen=True)
class Isometries:
    """Branches s theta + c with probabilities p(theta), shape (angles, branches), smooth between kinks."""

    sign: Floats
    offset: Floats
    probabilities: Callable[[Floats], Floats]
    kinks: Floats

    def __call__(self, function: Function, rule: Rule) -> Function:
        targets = function.breaks
        sources = (self.sign[:, None] * (targets - self.offset[:, None])).ravel() if targets.size else np.empty(0)
        breaks = np.concatenate((self.kinks, sources[(sources > 0.0) & (sources < np.pi)]))
        return Function(lambda theta: self._means(function, theta), np.unique(breaks))

    def _means(self, function: Function, theta: Floats) -> Floats:
        share = self.probabilities(theta)
        row, branch = np.nonzero(share > 0.0)
        outgoing = np.clip(self.sign[branch] * theta[row] + self.offset[branch], 0.0, np.pi)
        image = share[row, branch][:, None] * function.evaluate(outgoing)
        total = np.zeros((theta.size, image.shape[1]))
        np.add.at(total, row, image)
        return total


def triangular(psi: float) -> Isometries:
    """Triangular teeth, from the formula of a single ray by the bounds of the number n of hits."""
    n = np.arange(0.0, np.ceil(np.pi / psi) + 3.0)
    even = n % 2 == 0
    sign = np.where(even, 1.0, -1.0)
    left, right = np.where(even, np.pi - n * psi, n * psi), np.where(even, n * psi - np.pi, 2.0 * np.pi - n * psi)

    def half(theta: Floats) -> Floats:
        lowest, highest = np.abs(theta - 0.5 * psi), np.minimum(0.5 * np.pi, theta + 0.5 * psi)
        bounds = [
            np.clip((n + side) * psi - theta[:, None], lowest[:, None], np.maximum(highest, lowest)[:, None])
            for side in (-0.5, 0.5)
        ]
        width = np.cos(theta - 0.5 * psi) - np.cos(theta + 0.5 * psi)
        return (np.cos(bounds[0]) - np.cos(bounds[1])) / width[:, None]

    k = np.arange(-2.0, 2.0 * np.ceil(np.pi / psi) + 6.0)
    one = np.concatenate((k * 0.5 * psi, (0.5 * k) * psi - 0.5 * np.pi, 0.5 * np.pi - 0.5 * k * psi))
    both = np.concatenate((one, np.pi - one))
    return Isometries(
        np.concatenate((sign, sign)),
        np.concatenate((left, right)),
        lambda theta: np.concatenate((half(theta), half(np.pi - theta)), axis=1),
        both[(both > 0.0) & (both < np.pi)],
    )


def rectangular(r: float) -> Operator:
    """Rectangular teeth: specular with 1 - {d}/2 or 1/2 + {d}/2, d = 2 r |cot theta|.

    Beyond an even number K of crossings the probability is replaced by its mean, 3/4. The first two antiderivatives of
    the difference vanish in the mean over a period, so that this moves integrals by about r^2 / K^4.
    """

    def act(function: Function, rule: Rule) -> Function:
        def probabilities(theta: Floats) -> Floats:
            d = 2.0 * r / np.abs(np.tan(theta))
            part = d - np.floor(d)
            mirror = np.where(np.floor(d) % 2.0 == 0.0, 1.0 - 0.5 * part, 0.5 + 0.5 * part)
            mirror = np.where(d < rule.crossings, mirror, 0.75)
            return np.stack((mirror, 1.0 - mirror), axis=-1)

        steep = np.arctan2(2.0 * r, np.arange(0.0, rule.crossings + 1.0))
        kinks = np.concatenate((steep, np.pi - steep))
        return Isometries(np.array([-1.0, 1.0]), np.array([np.pi, 0.0]), probabilities, kinks)(function, rule)

    return act


# ---- circular arcs ------------------------------------------------------------------------------------------------
def arcs(xi: float) -> Operator:
    """Focusing arcs: a Gauss rule in delta between the changes of the number of hits and of what it hits."""

    def act(function: Function, rule: Rule) -> Function:
        most = 4 * rule.nodes
        hits = np.arange(1.0, most + 1.0)
        x, w = np.polynomial.legendre.leggauss(rule.nodes)

        def row(theta: float) -> tuple[Floats, Floats]:
            begin, end = abs(theta - xi), min(theta + xi, 2.0 * np.pi - theta - xi)
            cuts = [(xi + theta) / (2.0 * hits + 1.0), (2.0 * hits * np.pi - xi + theta) / (2.0 * hits + 1.0)]
            for target in function.breaks:
                cuts += [(theta + np.pi - target) / (2.0 * hits), np.pi - (target + np.pi - theta) / (2.0 * hits)]
            inside = np.concatenate(cuts)
            inside = inside[(inside > begin) & (inside < end)]
            edges = np.unique(np.concatenate((inside, [begin, end, np.clip(0.5 * np.pi, begin, end)])))
            half = 0.5 * np.diff(edges)[:, None]
            delta = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * x).ravel()
            weight = (half * w).ravel() * np.sin(delta)
            back = delta >= 0.5 * np.pi
            step = np.where(back, 2.0 * (np.pi - delta), -2.0 * delta)
            gamma = theta - delta
            number = np.ceil(np.where(back, xi - gamma, xi + gamma) / np.abs(step))
            outgoing = theta + number * step + np.where(back, -np.pi, np.pi)
            return np.clip(outgoing, 0.0, np.pi), weight / weight.sum()

        def evaluate(theta: Floats) -> Floats:
            rows = [row(float(angle)) for angle in theta]
            owner = np.repeat(np.arange(theta.size), [angle.size for angle, _ in rows])
            outgoing, weight = (np.concatenate(column) for column in zip(*rows, strict=True))
            image = weight[:, None] * function.evaluate(outgoing)
            total = np.zeros((theta.size, image.shape[1]))
            np.add.at(total, owner, image)
            return total

        k = np.arange(1.0, 2.0 * rule.nodes)
        one = np.concatenate((xi * (1.0 + 1.0 / k), xi * k / (k + 1.0), [xi, 0.5 * np.pi - xi]))
        both = np.concatenate((one, np.pi - one))
        return Function(evaluate, both[(both > 0.0) & (both < np.pi)])

    return act


# ---- random expressions -------------------------------------------------------------------------------------------
Word = tuple[Operator, ...]


@dataclass(frozen=True)
class Expression:
    """A law, and the words that it is the sum of, their operators from the first to the last."""

    law: ker.Law
    words: tuple[tuple[float, Word], ...]
    adjoint_words: tuple[tuple[float, Word], ...] = field(repr=False)
    cost: int

    def __matmul__(self, other: Expression) -> Expression:
        pairs = [(a * b, first + second) for a, first in self.words for b, second in other.words]
        back = [(a * b, second + first) for a, first in self.adjoint_words for b, second in other.adjoint_words]
        return Expression(self.law @ other.law, tuple(pairs), tuple(back), self.cost + other.cost)

    def power(self, exponent: int) -> Expression:
        """The law applied several times."""
        found = self
        for _ in range(exponent - 1):
            found = found @ self
        return Expression(self.law**exponent, found.words, found.adjoint_words, found.cost)

    def mixed(self, other: Expression, share: float) -> Expression:
        """A mixture."""
        words, back = (
            tuple((share * a, word) for a, word in mine) + tuple(((1.0 - share) * a, word) for a, word in yours)
            for mine, yours in ((self.words, other.words), (self.adjoint_words, other.adjoint_words))
        )
        law = share * self.law + (1.0 - share) * other.law
        return Expression(law, words, back, max(self.cost, other.cost))

    def turned(self) -> Expression:
        """In the other frame."""
        words = tuple((a, (*word, flip)) for a, word in self.words)
        back = tuple((a, (flip, *word)) for a, word in self.adjoint_words)
        return Expression(self.law.in_specular_frame(), words, back, self.cost)

    def adjoint(self) -> Expression:
        """The adjoint."""
        return Expression(self.law.adjoint(), self.adjoint_words, self.words, self.cost)


def leaf(law: ker.Law, operator: Operator, cost: int = 0, adjoint: Operator | None = None) -> Expression:
    """A single law."""
    return Expression(law, ((1.0, (operator,)),), ((1.0, (adjoint or operator,)),), cost)


LOPSIDED = np.array([[0.5, 0.5, 0.0], [0.5, 0.25, 0.25], [0.0, 0.25, 0.75]])
CYCLE = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
# What a law of isometries or of arcs costs in a word, and the most that one may have.
TEETH, ARCS, DEAREST, MOST_WORDS = 1, 4, 4, 12


def random_leaf(rng: np.random.Generator) -> Expression:
    """One law."""
    kind = rng.choice(
        ["retro", "specular", "lambert", "scattering", "triangular", "rectangular", "density", "matrix", "map", "arcs"],
        p=[0.08, 0.1, 0.06, 0.26, 0.2, 0.12, 0.07, 0.05, 0.04, 0.02],
    )
    if kind == "retro":
        return leaf(ker.retroreflection(), identity)
    if kind == "specular":
        return leaf(ker.specular(), flip)
    if kind == "lambert":
        return leaf(ker.lambertian(), diagonal(np.ones(1)))
    if kind == "scattering":
        g = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.9))
        return leaf(ker.henyey_greenstein(g), scattering(g))
    if kind == "triangular":
        psi = float(rng.uniform(0.4, 2.8))
        return leaf(ker.TriangularTeethLaw(psi), triangular(psi), TEETH)
    if kind == "rectangular":
        r = float(np.exp(rng.uniform(np.log(0.1), np.log(3.0))))
        return leaf(ker.RectangularTeethLaw(r), rectangular(r), TEETH)
    if kind == "density":
        a, b = rng.uniform(-0.5, 0.5, 2)
        values = np.array([1.0, a / 3.0, b / 5.0])
        return leaf(ker.DensityLaw(_two_moments(float(a), float(b))), diagonal(values))
    if kind == "matrix":
        if rng.random() < 0.5:
            return leaf(ker.MatrixLaw(LOPSIDED), piecewise(LOPSIDED))
        return leaf(ker.MatrixLaw(CYCLE), piecewise(CYCLE), adjoint=piecewise(CYCLE.T))
    if kind == "map":
        return leaf(ker.InvolutionLaw(exchanged), exchange)
    xi = float(rng.uniform(0.3, 1.5))
    return leaf(ker.CircularArcLaw(xi), arcs(xi), ARCS)


def _two_moments(a: float, b: float) -> Callable[[Floats, Floats], Floats]:
    def density(theta: Floats, out: Floats) -> Floats:
        u, v = np.cos(theta), np.cos(out)
        return 0.5 * np.sin(out) * (1.0 + a * u * v + b * (1.5 * u * u - 0.5) * (1.5 * v * v - 0.5))

    return density


def random_expression(rng: np.random.Generator, depth: int, turned: bool) -> Expression:
    """A random tree of at most that depth, all of whose laws are in one frame."""
    if depth == 0:
        one = random_leaf(rng)
        return one.turned() if turned else one
    kind = rng.choice(["compose", "mix", "power", "adjoint", "leaf"], p=[0.45, 0.25, 0.12, 0.08, 0.1])
    first = random_expression(rng, depth - 1, turned)
    if kind == "leaf":
        return first
    if kind == "power":
        return first.power(int(rng.integers(2, 4)))
    if kind == "adjoint":
        return first.adjoint()
    second = random_expression(rng, depth - 1, turned)
    return first @ second if kind == "compose" else first.mixed(second, float(rng.uniform(0.1, 0.9)))


def random_basis(rng: np.random.Generator) -> tuple[str, ker.Basis]:
    """Bins uniform in u or not, polynomials, panels; and what kind it is."""
    kind = rng.choice(["Bins(n)", "Bins(edges)", "Legendre", "Panels"], p=[0.25, 0.2, 0.35, 0.2])
    if kind == "Bins(n)":
        return kind, ker.Bins(int(rng.choice([2, 4, 8, 16])))
    if kind == "Legendre":
        return kind, ker.Legendre(int(rng.choice([4, 8, 16, 32, 64], p=[0.25, 0.3, 0.25, 0.1, 0.1])))
    edges = np.concatenate(([0.0], np.sort(rng.uniform(0.05, 3.09, int(rng.integers(1, 6)))), [np.pi]))
    return kind, ker.Bins(edges) if kind == "Bins(edges)" else ker.Panels(edges, int(rng.integers(0, 4)))


# ---- what came out ------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Outcome:
    """One matrix: its case, how it was made, what it reports, how far it is off, and the reference's own error."""

    seed: int
    law: str
    basis: str
    method: str
    reported: float
    distance: float
    reference: float

    @property
    def exceeds(self) -> bool:
        """Whether the true error is above the reported one, whatever the reference's error does."""
        return self.distance - self.reference > self.reported

    @property
    def is_open(self) -> bool:
        """Whether the reference is too coarse to tell."""
        return not self.exceeds and not self.holds

    @property
    def holds(self) -> bool:
        """Whether the true error is below the reported one, whatever the reference's error does."""
        return self.distance + self.reference <= self.reported

    @property
    def factor(self) -> float:
        """True over reported error."""
        return max(self.distance - self.reference, 0.0) / self.reported if self.reported else np.inf


COARSE, FINE = Rule(40, 9, 2000), Rule(56, 12, 6000)
# Crevices are followed less far where other teeth multiply the kinks.
FEWER_CROSSINGS = 24


def reference(expression: Expression, basis: ker.Basis) -> tuple[Floats, float]:
    """<e_i, P e_j>, and twice the difference from a coarser rule plus rounding."""
    coarse, fine = (_by_rule(expression, basis, rule) for rule in (COARSE, FINE))
    return fine, 2.0 * float(np.linalg.norm(fine - coarse)) + ROUNDING * basis.size


def _by_rule(expression: Expression, basis: ker.Basis, rule: Rule) -> Floats:
    oscillations = basis.size if isinstance(basis, ker.Legendre) else 0
    whole = Rule(max(rule.panels, oscillations), rule.nodes, rule.crossings)
    edges = np.empty(0) if oscillations else np.asarray(basis.edges[1:-1])
    last = Function(_functions(basis), edges)
    total = np.zeros((basis.size, basis.size))
    for weight, word in expression.words:
        multiplied = any(isinstance(operator, Isometries) for operator in word)
        rule = replace(whole, crossings=whole.crossings // FEWER_CROSSINGS * 2) if multiplied else whole
        function = last
        for operator in reversed(word):
            function = operator(function, rule)
        angle, mass = rule.grid(np.concatenate((function.breaks, edges)))
        total += weight * last.evaluate(angle).T @ (mass[:, None] * function.evaluate(angle))
    return total


def _functions(basis: ker.Basis) -> Callable[[Floats], Floats]:
    if isinstance(basis, ker.Legendre):
        return lambda angle: polynomials(basis.size, angle)
    if isinstance(basis, ker.Bins):
        mass = 0.5 * -np.diff(np.cos(basis.edges))

        def indicators(angle: Floats) -> Floats:
            cell = np.clip(np.searchsorted(basis.edges, angle, side="right") - 1, 0, mass.size - 1)
            return np.eye(mass.size)[cell] / np.sqrt(mass)

        return indicators
    return basis.evaluate


def drawn(seed: int) -> tuple[Expression, str, ker.Basis, str]:
    """The expression, the kind of its basis, the basis and the method of a seed."""
    rng = np.random.default_rng([seed, 16])
    while True:
        depth, turned = int(rng.integers(1, 4)), bool(rng.random() < 0.25)
        try:
            expression = random_expression(rng, depth, turned)
        except InputError:
            # an adjoint that is not known in closed form
            continue
        if rng.random() < 0.1:
            expression = expression.turned()
        if expression.cost <= DEAREST and len(expression.words) <= MOST_WORDS:
            break
    kind, basis = random_basis(rng)
    method = rng.choice(["auto", "quadrature", "exact", "qmc", "monte-carlo"], p=[0.6, 0.2, 0.08, 0.04, 0.08])
    return expression, kind, basis, str(method)


def outcome(seed: int) -> tuple[str, Outcome] | None:
    """The kind of basis and the outcome of a seed; None if its law does not have the method that was drawn."""
    expression, kind, basis, method = drawn(seed)
    try:
        matrix = ker.discretise(expression.law, basis, method=method, samples=SAMPLES, rng=np.random.default_rng(seed))
    except InputError:
        return None
    exact, error = reference(expression, basis)
    distance = float(np.linalg.norm(matrix.symmetric - exact))
    name = "rays" if matrix.samples else matrix.method if matrix.method in ("exact", "quadrature") else "sum of several"
    return kind, Outcome(seed, repr(expression.law), repr(basis), name, float(matrix.error), distance, error)


def outcomes(seeds: Sequence[int]) -> Iterator[tuple[str, Outcome]]:
    """All that have the method drawn."""
    for seed in seeds:
        found = outcome(seed)
        if found is not None:
            yield found


def summary(found: Sequence[Outcome]) -> str:
    """How many, how many hold, do not, cannot be told; the largest true over reported; the median of the inverse."""
    told = [one for one in found if not one.is_open]
    false = sum(one.exceeds for one in told)
    unknown = len(found) - len(told)
    worst = max((one.factor for one in told), default=0.0)
    sharp = [one.reported / one.distance for one in told if one.distance > one.reference]
    median = f"{np.median(sharp):.2g}" if sharp else "-"
    return f"{len(found)} | {len(told) - false} | {false} | {unknown} | {worst:.2g} | {median}"


def table(found: Sequence[tuple[str, Outcome]]) -> str:
    """A line for each method and kind of basis."""
    groups: dict[tuple[str, str], list[Outcome]] = defaultdict(list)
    for kind, one in found:
        groups[one.method, kind].append(one)
    lines = [
        "| method | basis | matrices | hold | do not | cannot be told | largest true/reported | median reported/true |",
        "|---|---|---|---|---|---|---|---|",
    ]
    lines += [f"| {method} | {kind} | {summary(some)} |" for (method, kind), some in sorted(groups.items())]
    computed = [one for _, one in found if one.method != "rays"]
    return "\n".join([*lines, f"| all but rays | | {summary(computed)} |"])


def main() -> None:
    """Print the table and the cases that speak against it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.composed_laws", description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    arguments = parser.parse_args()
    found = []
    for seed in range(arguments.first, arguments.first + arguments.count):
        begun = time.perf_counter()
        one = outcome(seed)
        if one is None:
            continue
        found.append(one)
        if one[1].exceeds or one[1].is_open or time.perf_counter() - begun > 60.0:
            print(one[1], f"{time.perf_counter() - begun:.0f} s", flush=True)
    print(f"\n{table(found)}")


if __name__ == "__main__":
    main()
