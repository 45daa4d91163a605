"""Gaps of densities with kinks, jumps, peaks and oscillations, as users write them, against known eigenvalues.

The kernel 1 + c (h(theta) - m)(h(theta') - m) with respect to sin(theta)/2 has the eigenvalue c Var h beside 1; of its
sums and products with isometries two more numbers are known, from the mean product of h and its mirror image. The judge
takes the moments from Gauss rules that are graded towards the breakpoints of h, which the library is told or not.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from asperity.errors import AccuracyError, InputError
from campaigns.engine import Campaign, Judged

COUNT, ROUNDING = 240, 1e-12
TOLERANCES = 1e-2, 1e-4, 1e-6, 1e-8
# Real seconds of a gap, whose nominal limit is ten, on a machine with other work.
MOST_SECONDS = 60.0
# Levels of the judge's rule at a breakpoint, and its nodes; angles at which the least value of a kernel is sought.
LEVELS, NODES, GRID = 48, 24, 100_000
Function = Callable[[Floats], Floats]


def shapes(x: float, w: float, n: int) -> list[tuple[str, Function, list[float]]]:
    """Functions with a feature at x of the width w, or of the frequency n, and their breakpoints."""
    marks = np.linspace(0.1, 3.0, n).tolist()
    return [
        ("root", lambda a: np.sqrt(np.abs(a - x)), [x]),
        ("kink", lambda a: np.abs(a - x), [x]),
        ("cube root", lambda a: np.cbrt(np.abs(a - x)), [x]),
        ("jump", lambda a: 1.0 * (a < x), [x]),
        ("two jumps", lambda a: 1.0 * (np.abs(a - x) < w), [x - w, x + w]),
        ("peak", lambda a: np.exp(-0.5 * ((a - x) / w) ** 2), [x]),
        ("oscillation", lambda a: np.cos(n * a), []),
        ("chirp", lambda a: np.sin(n * a * a), []),
        ("kinks", lambda a: sum(np.abs(a - y) * (-1.0) ** k for k, y in enumerate(marks)) + 0.1 * (a > x), [*marks, x]),
        ("root at an end", np.sqrt, [0.0]),
        ("tent", lambda a: np.maximum(1.0 - np.abs(a - x) / w, 0.0), [x - w, x, x + w]),
        ("Weierstrass", lambda a: sum(0.5**k * np.cos(3.0**k * a) for k in range(5)), []),
    ]


@dataclass(frozen=True)
class Case:
    """A law, or what makes one, and its gap."""

    kind: str
    law: Callable[[], ker.Law]
    gap: float
    tolerances: tuple[float, ...] = TOLERANCES


class Recipe(ker.Law):
    """A density as a user may write a law of it, without its breakpoints."""

    reversible = True

    def __init__(self, ratio: Callable[[Floats, Floats], Floats], most: float) -> None:
        self.ratio, self.most = ratio, most

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        found, left = np.empty(theta.size), np.arange(theta.size)
        while left.size:
            out = ker.SINE.sample(left.shape, rng)
            done = rng.random(left.size) * self.most < self.ratio(theta.ravel()[left], out)
            found[left[done]], left = out[done], left[~done]
        return found.reshape(theta.shape)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> ker.Conditionals:
        def density(given: Floats, out: Floats) -> Floats:
            return self.ratio(given, out) * ker.SINE.density(out)

        return ker.Conditionals.of_density(density, theta, degree, edges)


def mean(function: Function, points: list[float]) -> float:
    """The mean for sin(theta)/2, by Gauss rules graded towards the points."""
    graded = [point + sign * 2.0 ** -np.arange(LEVELS) for point in points for sign in (1.0, -1.0)]
    edges = np.unique(np.clip(np.concatenate([*graded, points, np.linspace(0.0, np.pi, 257)]), 0.0, np.pi))
    node, weight = np.polynomial.legendre.leggauss(NODES)
    half = 0.5 * np.diff(edges)[:, None]
    angle = 0.5 * (edges[1:] + edges[:-1])[:, None] + half * node
    return float(np.sum(half * weight * 0.5 * np.sin(angle) * function(angle)))


def draw(number: int) -> Case:
    """A density with or without its breakpoints, a compound of it with isometries, or a law by the recipe."""
    rng = np.random.default_rng([20261128, number])
    x, w = float(rng.uniform(0.2, 2.9)), float(10.0 ** rng.uniform(-2.5, -1.0))
    _, h, points = shapes(x, w, int(rng.integers(3, 60)))[number % 12]
    mirrored = [np.pi - point for point in points]
    m = mean(h, points)
    variance, product = mean(lambda a: (h(a) - m) ** 2, points), mean(
        lambda a: (h(a) - m) * (h(np.pi - a) - m), points + mirrored
    )  # fmt: skip
    ends = np.add.outer(points, [-1e-9, 0.0, 1e-9]).ravel()
    angle = np.clip(np.append(np.linspace(0.0, np.pi, GRID), ends), 1e-9, np.pi - 1e-9)
    low, high = float((h(angle) - m).min()), float((h(angle) - m).max())
    c = float(rng.uniform(0.2, 0.95)) * (1.0 / abs(low * high) if rng.random() < 0.5 else -1.0 / max(low**2, high**2))
    top, told, kind = c * variance, bool(rng.random() < 0.6), (number // 12) % 3

    def ratio(a: Floats, b: Floats) -> Floats:
        return 1.0 + c * (h(a) - m) * (h(b) - m)

    def density() -> ker.DensityLaw:
        return ker.DensityLaw(lambda a, b: ratio(a, b) * ker.SINE.density(b), points if told else ())

    if kind == 2:
        most = 1.0 + abs(c) * max(low**2, high**2)
        return Case("recipe", lambda: Recipe(ratio, most), 1.0 - max(top, 0.0), TOLERANCES[:2])
    where = "told" if told else "not told"
    if kind == 0:
        return Case(f"density, breakpoints {where}", density, 1.0 - max(top, 0.0))
    a, b, r = rng.dirichlet(np.ones(3)).tolist()
    r = 1.0 - a - b
    if rng.random() < 0.5:
        # on the even and odd parts of h, and on all other even functions
        even, odd = (np.sqrt(max(0.5 * (1.0 + sign * product / variance), 0.0)) for sign in (1.0, -1.0))
        block = [[a * top * even**2 + b + r, a * top * even * odd], [a * top * even * odd, a * top * odd**2 - b + r]]
        gap = 1.0 - max(float(np.linalg.eigvalsh(block)[-1]), b + r)
        return Case("sum", lambda: a * density() + b * ker.specular() + r * ker.retroreflection(), gap)
    value = a * top**3 + (1.0 - a) * top * c * product

    def chain() -> ker.Law:
        one = density()
        return one @ (a * one + (1.0 - a) * ker.specular()) @ one

    return Case("product", chain, 1.0 - max(value, 0.0))


def judge(case: Case) -> Iterator[Judged]:
    """The gap to several tolerances."""
    try:
        law = case.law()
    except (InputError, AccuracyError):
        yield Judged(case.kind, outcome="refused")
        return
    for tolerance in case.tolerances:
        start = time.process_time()
        gap = spec.spectral_gap(law, tolerance)
        late = time.process_time() - start > MOST_SECONDS
        outcome = "useless" if gap.error > 0.5 * gap.value else gap.verdict
        miss = abs(gap.value - case.gap)
        yield Judged(case.kind, gap.error, miss, ROUNDING, "late" if late else "", outcome)


CAMPAIGNS = (
    Campaign("density-gaps", "Do the errors of gaps of users' densities hold?", draw, judge, COUNT, [15, 17, 18, 40]),
)
