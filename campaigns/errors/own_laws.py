"""Laws as users write them, by the recipe of CONTRIBUTING, and functions that they average: right and broken ones.

The judge integrates between the singular points that it knows, on intervals graded towards them. Every third case is
broken on purpose and has to be refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError
from campaigns.engine import Campaign, Judged
from campaigns.judges.reference_operators import Floats

KINDS = (
    "density",
    "function",
    "broken density",
    "gap",
    "function",
    "broken atoms",
    "density",
    "function",
    "broken draws",
)
# One gap among this number of its cases; it takes some seconds.
GAPS = 10
# Intervals of the judge are no wider than this, and graded by halving towards singular points; nodes on each.
WIDEST, HALVINGS, NODES = 0.05, 50, 24
JUDGE_ERROR = 2e-14
# What `apply` claims, as a fraction of the mean size of a function: of laws, of compositions.
CLAIMED, CLAIMED_OF_MEANS = 1e-8, 1e-4
# Angles at which means are judged; an error beyond this is useless.
ANGLES, USELESS = np.array([0.05, 0.9, 1.7, 3.0]), 1e-3


@dataclass(frozen=True)
class Shape:
    """A bounded function of the angle, and the points where it is not smooth."""

    name: str
    value: Callable[[Floats], Floats]
    points: tuple[float, ...] = ()


@dataclass(frozen=True)
class Case:
    """A kind of case with its random numbers; broken ones have to be refused."""

    number: int
    kind: str
    rng: np.random.Generator

    @property
    def broken(self) -> bool:
        return self.kind.startswith("broken")


def draw(number: int) -> Case:
    """Kinds take turns; of the gaps most are functions instead."""
    kind = KINDS[number % len(KINDS)]
    few = kind == "gap" and number // len(KINDS) % GAPS
    return Case(number, "function" if few else kind, np.random.default_rng([55, number]))


def random_shape(rng: np.random.Generator) -> Shape:
    """A function with values in about [-1, 1]."""
    a, width = float(rng.uniform(0.2, 2.9)), float(10.0 ** rng.uniform(-2.5, -0.5))
    power, often = float(rng.uniform(0.2, 0.9)), float(rng.integers(2, 300))
    many = tuple(np.sort(rng.uniform(0.1, 3.0, 12)).tolist())
    shapes = (
        Shape("smooth", lambda x: np.cos(x + a)),
        Shape("power", lambda x: np.abs(x - a) ** power - 0.5, (a,)),
        Shape("kink", lambda x: np.abs(x - a) - 0.5, (a,)),
        Shape("jump", lambda x: np.where(x < a, 1.0, -0.5), (a,)),
        Shape("plateau", lambda x: (np.abs(x - a) < width).astype(float), (a - width, a + width)),
        Shape("tent", lambda x: np.maximum(0.0, 1.0 - np.abs(x - a) / width), (a - width, a, a + width)),
        Shape("peak", lambda x: np.exp(-0.5 * ((x - a) / width) ** 2), tuple(a + width * np.arange(-8.0, 8.5))),
        Shape("waves", lambda x: np.cos(often * x + a)),
        Shape("jumps", lambda x: np.searchsorted(many, x, side="right") / 12.0 - 0.5, many),
        Shape("end", lambda x: (0.5 * x / np.pi) ** power - 0.3),
    )
    return shapes[rng.integers(len(shapes))]


def integral(function: Callable[[Floats], Floats], points: tuple[float, ...]) -> float:
    """The integral over (0, pi) of a function that is smooth but at these points and at the ends."""
    ends = np.unique([0.0, np.pi, *(p for p in points if 0.0 < p < np.pi)])
    graded = 0.5 ** np.arange(1.0, HALVINGS)
    cuts = [ends, np.linspace(0.0, np.pi, int(np.pi / WIDEST) + 1)]
    for low, high in pairwise(ends):
        cuts += [low + (high - low) * graded, high - (high - low) * graded]
    edges = np.unique(np.concatenate(cuts))
    node, weight = np.polynomial.legendre.leggauss(NODES)
    half, middle = 0.5 * np.diff(edges)[:, None], 0.5 * (edges[1:] + edges[:-1])[:, None]
    return float(np.sum(half * weight * function(middle + half * node)))


class RecipeLaw(ker.Law):
    """(1 + c (h(a) - m)(h(b) - m)) sin(b)/2 by the recipe, with its means and its second eigenvalue by the judge."""

    reversible = True

    def __init__(self, shape: Shape, factor: float) -> None:
        self.shape, self.mean = shape, integral(lambda x: 0.5 * np.sin(x) * shape.value(x), shape.points)
        self.factor = factor

    def _height(self, angle: Floats) -> Floats:
        return np.asarray(self.shape.value(angle) - self.mean)

    def density(self, theta: Floats, out: Floats) -> Floats:
        """p(theta, theta')."""
        return np.asarray(0.5 * np.sin(out) * (1.0 + self.factor * self._height(theta) * self._height(out)))

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        """By rejection: the density is at most twice that of sin(theta)/2."""
        out, left = np.empty(theta.size), np.arange(theta.size)
        while left.size:
            out[left] = ker.SINE.sample(left.size, rng)
            ratio = self.density(theta.ravel()[left], out[left]) / ker.SINE.density(out[left])
            left = left[2.0 * rng.random(left.size) > ratio]
        return out.reshape(theta.shape)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> ker.Conditionals:
        return ker.Conditionals.of_density(self.density, theta, degree, edges, tolerance=tolerance)

    def true_gap(self) -> float:
        """1 less the variance of h times the factor, or 1 if that is negative."""
        variance = integral(lambda x: 0.5 * np.sin(x) * self._height(x) ** 2, self.shape.points)
        return 1.0 - max(self.factor * variance, 0.0)


def judge(case: Case) -> Iterator[Judged]:
    """What the library says of the case, beside the judge."""
    rng = case.rng
    if case.broken:
        yield _refusal(
            case.kind, {"broken density": _density, "broken atoms": _atoms, "broken draws": _draws}[case.kind], rng
        )
    elif case.kind == "function":
        yield _function(rng)
    else:
        law = RecipeLaw(random_shape(rng), float(rng.uniform(-0.4, 0.4)))
        yield from _gap(law) if case.kind == "gap" else _means(law, rng)


def _means(law: RecipeLaw, rng: np.random.Generator) -> Iterator[Judged]:
    often, shift = float(rng.integers(1, 9)), float(rng.uniform(0.0, 6.0))
    tolerance = float(10.0 ** rng.uniform(-13.0, -3.0))

    def function(x: Floats) -> Floats:
        return np.asarray(np.cos(often * x + shift))

    found = law.conditionals(ANGLES, tolerance, int(often))
    for theta, mean, error in zip(ANGLES, found.mean(function), found.error, strict=True):
        wanted = integral(lambda x, t=theta: law.density(t, x) * function(x), law.shape.points)  # type: ignore[misc]
        word = "useless" if error > USELESS else ""
        yield Judged(f"means, {law.shape.name}", float(error), abs(float(mean) - wanted), JUDGE_ERROR, outcome=word)


def _gap(law: RecipeLaw) -> Iterator[Judged]:
    gap = spec.spectral_gap(law, tolerance=1e-6)
    word = "useless" if gap.error > USELESS else ""
    yield Judged("gap", gap.error, abs(float(gap) - law.true_gap()), JUDGE_ERROR, outcome=word)


def _function(rng: np.random.Generator) -> Judged:
    shape, theta = random_shape(rng), float(rng.choice(ANGLES))
    scale, weight = float(10.0 ** rng.uniform(-6.0, 6.0)), float(rng.uniform(0.1, 0.9))
    mean = integral(lambda x: 0.5 * np.sin(x) * shape.value(x), shape.points)
    flat, back = (float(shape.value(np.array(x))) for x in (np.pi - theta, theta))
    g, lambertian, specular = float(rng.uniform(-0.6, 0.6)), ker.lambertian(), ker.specular()
    linear = ker.DensityLaw(lambda a, b: 0.5 * np.sin(b) * (1.0 + g * np.cos(a) * np.cos(b)))
    slope = integral(lambda x: 0.5 * np.sin(x) * np.cos(x) * shape.value(x), shape.points)
    cases: tuple[tuple[str, ker.Law, float], ...] = (
        ("law", lambertian, mean),
        ("law", weight * lambertian + (1.0 - weight) * specular, weight * mean + (1.0 - weight) * flat),
        ("law", ker.MatrixLaw(np.full((5, 5), 0.2)), mean),
        ("law", linear, mean + g * np.cos(theta) * slope),
        ("law", linear.in_specular_frame(), mean - g * np.cos(theta) * slope),
        ("atoms", specular, flat),
        ("composition", specular @ linear, mean - g * np.cos(theta) * slope),
        ("composition", linear @ linear, mean + g * g / 3.0 * np.cos(theta) * slope),
        ("composition", ker.maxwell(weight) @ specular, weight * mean + (1.0 - weight) * back),
        ("composition", linear @ specular, mean - g * np.cos(theta) * slope),
    )
    kind, law, wanted = cases[rng.integers(len(cases))]
    size = abs(scale) * (1.0 + abs(wanted))
    claimed = size * {"law": CLAIMED, "atoms": 1e-15, "composition": CLAIMED_OF_MEANS}[kind]
    try:
        found = float(law.apply(lambda x: scale * shape.value(x), theta))
    except AccuracyError as reason:
        return Judged(f"function, {kind}", fault=str(reason), outcome="not resolved")
    return Judged(f"function, {kind}", claimed, abs(found - scale * wanted), JUDGE_ERROR * size)


def _refusal(kind: str, broken: Callable[[np.random.Generator], Any], rng: np.random.Generator) -> Judged:
    try:
        found = broken(rng)
    except (InputError, AccuracyError):
        return Judged(kind, outcome="refused")
    return Judged(kind, fault=f"taken: {found}")


def _density(rng: np.random.Generator) -> Any:
    """A density that is signed, not normalised or not finite, in the mean of a function."""
    law, a = RecipeLaw(random_shape(rng), 0.3), float(rng.uniform(0.3, 2.8))
    factor = float(rng.choice([0.5, 0.999, 1.00001, 2.0]))
    which = rng.integers(3)

    def density(theta: Floats, out: Floats) -> Floats:
        right = law.density(theta, out)
        if which == 0:
            return factor * right
        return np.where(np.abs(out - a) < 0.3, np.nan if which == 1 else -right, right)

    return ker.Conditionals.of_density(density, ANGLES, 4, ()).error


class _Own(ker.Law):
    """A law of two functions."""

    def __init__(self, drawn: Callable[[Floats], Any], found: Callable[[Floats], Any]) -> None:
        self.drawn, self.found = drawn, found

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self.drawn(theta)  # type: ignore[no-any-return]

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> ker.Conditionals:
        return self.found(theta)  # type: ignore[no-any-return]


def _atoms(rng: np.random.Generator) -> Any:
    """Atoms that are no distribution, in some question to their law."""
    number = int(rng.integers(1, 6))
    weights, nodes = rng.dirichlet(np.ones(number)), rng.uniform(0.1, 3.0, number)
    which, at = rng.integers(5), int(rng.integers(number))
    if which == 0:
        weights[at] = -0.01 - weights[at]
    elif which == 1:
        weights[at] = np.nan
    elif which == 2:
        weights *= float(rng.choice([0.5, 0.999, 1.000001]))
    elif which == 3:
        nodes[at] = float(rng.choice([-0.1, 0.0 - 1e-9, np.pi + 1e-9, 7.0, np.nan]))
    else:
        weights[at] += np.inf
    own = _Own(
        lambda theta: theta,
        lambda theta: ker.Conditionals.of_atoms(
            np.tile(nodes, (theta.size, 1)), np.tile(weights, (theta.size, 1)), 0.0
        ),
    )
    questions: tuple[Callable[[], Any], ...] = (
        lambda: own.apply(np.cos, ANGLES), lambda: own.conditionals(ANGLES), lambda: ker.resistance(own),
        lambda: (own @ ker.henyey_greenstein(0.3)).apply(np.cos, 1.0), lambda: ker.discretise(own, ker.Legendre(3)),
        lambda: (0.5 * own + 0.5 * ker.specular()).apply(np.sin, 1.0), lambda: own.table(3, 5),
    )  # fmt: skip
    return questions[rng.integers(len(questions))]()


def _draws(rng: np.random.Generator) -> Any:
    """Draws that are no angles, or not one for each, in some question to their law."""
    wrong: tuple[Callable[[Floats], Any], ...] = (
        lambda theta: theta + np.pi, lambda theta: -theta, lambda theta: np.where(theta > 0.0, np.nan, 1.0),
        lambda theta: theta[..., None], lambda theta: theta + 0j, lambda theta: "angles", lambda theta: None,
        lambda theta: np.append(theta, 1.0), lambda theta: 1 // 0, lambda theta: {}[0],
    )  # fmt: skip
    own = _Own(wrong[rng.integers(len(wrong))], lambda theta: None)
    questions: tuple[Callable[[], Any], ...] = (
        lambda: own.sample(ANGLES, rng=0), lambda: (own @ ker.specular()).sample(ANGLES, rng=0),
        lambda: own.in_specular_frame().sample(ANGLES, rng=0), lambda: (own**2).sample(ANGLES, rng=0),
        lambda: ker.discretise(own, ker.Bins(3), "monte-carlo", samples=64, rng=0),
        lambda: ker.PositionLaw([0.0, 1.0], [own]).sample(0.5, ANGLES, rng=0),
    )  # fmt: skip
    return questions[rng.integers(len(questions))]()


CAMPAIGNS = (
    Campaign(
        "own-laws", "Do errors of laws and functions of users hold, and are broken ones refused?", draw, judge,
        cases=2000, small=range(36), seconds=300.0,
    ),
)  # fmt: skip
