"""Gaps of shallow walls, their verdicts and their essential edges, against independent references.

Two judges are used, neither of which knows the distribution of slopes, divided differences or the form's bounds:

- *50 digits*, for walls that all but grazing rays meet once. Rays are followed in 50 digits, from the entry point to
  the curve and off it by reflecting a vector. E (f(theta') - f(theta))^2 / (2 E f^2) of cos(theta) or cos(theta)^2 -
  1/3 is at least the gap. For slopes up to s, its excess over the gap and the omitted grazing rays are of relative
  order s^4 ln s, and 200 s^4 ln s is allowed.
- *rays*, for steeper walls: the textbook tracer follows a quarter of a million rays. The least value of the same form
  on polynomials is an upper bound of the gap up to its sampling error, and close to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import mpmath as mp
import numpy as np
from scipy.stats.qmc import Sobol

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.essential.edge import essential_edge
from campaigns.engine import Campaign, Judged
from campaigns.judges.reference_operators import gauss
from campaigns.judges.textbook_tracer import legendre_functions, outgoing_angles

DIGITS = 50
# Factor of slope^4 in the allowed excess of the precise judge, and the largest slope for which this judge is used.
ALLOWED, PRECISE = 200.0, 1.1e-2
# Nodes in the angle and on each curve.
ANGLES, ENTRIES = 16, 12
# For the rays: number of Sobol sequences, which gives the spread, points of each, and polynomials.
SEQUENCES, POINTS, DEGREES = 8, 2**15, 24
# Relative excess of the polynomials' value where eigenfunctions are not smooth, at grazing and near the half angle of
# arcs: for walls of slopes below 1/2, and for others.
MISSED, MISSED_STEEP = 5e-3, 0.1
SIGMAS = 4.0

CURVATURES = (1e-7, 1e-6, 3e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)
HALF_ANGLES = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 5e-3, 0.02, 0.05, 0.1, 0.3, 0.8, 1.2, 1.5)
DEPTHS = (1e-7, 1e-5, 1e-3, 1e-2, 0.1)


@dataclass(frozen=True)
class Curve:
    """A curve below y = 0 from x = low to x = high, with its height and slope at a multiprecision x."""

    low: float
    high: float
    height: Callable[[mp.mpf], mp.mpf]
    slope: Callable[[mp.mpf], mp.mpf]


@dataclass(frozen=True)
class Case:
    """A wall, its curves, its steepest slope, and the theoretical edge of its essential spectrum."""

    wall: geo.Wall
    curves: tuple[Curve, ...]
    steepest: float
    edge: float = 0.0


Mixture = Sequence[tuple[float, Case]]


def _ellipse(low: float, high: float, curvature: mp.mpf, middle: float, zero: float, stretch: float = 1.0) -> Curve:
    """Part of a circle around x = ``middle``, stretched in y, with the height 0 at x = ``zero``."""

    def below_top(x: mp.mpf) -> mp.mpf:
        across = curvature * (x - middle)
        return across * (x - middle) / (1 + mp.sqrt(1 - across**2))

    def slope(x: mp.mpf) -> mp.mpf:
        across = curvature * (x - middle)
        return -stretch * across / mp.sqrt(1 - across**2)

    return Curve(low, high, lambda x: stretch * (below_top(mp.mpf(zero)) - below_top(x)), slope)


def _bumps(curvature: float) -> Case:
    curves = tuple(_ellipse(a, b, curvature, top, top) for a, b, top in ((0.0, 0.5, 0.0), (0.5, 1.0, 1.0)))
    return Case(geo.dispersing_arcs(curvature), curves, math.asin(0.5 * curvature))


def _arcs(half_angle: float) -> Case:
    with mp.workdps(DIGITS):
        curve = _ellipse(0.0, 1.0, -2 * mp.sin(mp.mpf(half_angle)), 0.5, 0.0)
    return Case(geo.focusing_arcs(half_angle), (curve,), half_angle)


def _ellipses(depth: float) -> Case:
    """Arcs of ellipses with half axes 1 and 10 times the depth, which leave y = 0 at a nonzero slope."""
    b = 10.0 * depth
    arc = geo.Arc((0.5, b * math.sqrt(0.75)), (1.0, b), -2 * math.pi / 3, -math.pi / 3).pinned((0, 0), (1, 0))
    return Case(geo.Wall([arc]), (_ellipse(0.0, 1.0, -1, 0.5, 0.0, b),), math.atan(b / math.sqrt(3.0)))


def _polynomials(*graphs: tuple[float, float, tuple[float, ...]]) -> Case:
    """Graphs of polynomials by their ends and Bernstein ordinates; the edge is the fraction of flat tops."""
    pieces: list[geo.Segment | geo.Bezier] = []
    for a, b, levels in graphs:
        n = len(levels) - 1
        points = [(a + k / n * (b - a) if k < n else b, y) for k, y in enumerate(levels)]
        pieces.append(geo.Bezier(points) if any(levels) else geo.Segment(points[0], points[-1]))
    steepest = max((len(c) - 1) * float(np.abs(np.diff(c)).max()) / (b - a) for a, b, c in graphs)
    edge = math.fsum(b - a for a, b, levels in graphs if not any(levels))
    return Case(geo.Wall(pieces, period=1.0), tuple(_graph(*graph) for graph in graphs), math.atan(steepest), edge)


def _graph(a: float, b: float, levels: Sequence[float]) -> Curve:
    def value(levels: Sequence[mp.mpf], x: mp.mpf) -> mp.mpf:
        t = (x - a) / (mp.mpf(b) - a)
        while len(levels) > 1:
            levels = [(1 - t) * p + t * q for p, q in pairwise(levels)]
        return levels[0]

    def slope(x: mp.mpf) -> mp.mpf:
        return (len(levels) - 1) / (mp.mpf(b) - a) * value([mp.mpf(q) - p for p, q in pairwise(levels)], x)

    return Curve(a, b, lambda x: value(levels, x), slope)


def draw(number: int) -> Mixture:
    """Bumps, arcs, parabolas, ellipses, two parabolas without mirror symmetry, and a parabola beside a flat top."""
    cases = [*map(_bumps, CURVATURES), *map(_arcs, HALF_ANGLES)]
    for depth in DEPTHS:
        cases.append(_polynomials((0.0, 0.5, (0.0, 0.0, -depth)), (0.5, 1.0, (-depth, 0.0, 0.0))))
        cases.append(_ellipses(0.1 * depth))
        cases.append(_polynomials((0.0, 0.3, (0.0, 0.0, -depth)), (0.3, 1.0, (-depth, 0.0, 0.0))))
        cases.append(_polynomials((0.0, 0.5, (0.0, 0.0)), (0.5, 1.0, (0.0, -depth, 0.0))))
    return [(1.0, cases[number])]


def random_wall(rng: np.random.Generator, deepest: float) -> Case:
    """A wall of one to three polynomial curves, mirrored in half of the cases, with a flat top in a third of them."""
    depth = 10.0 ** rng.uniform(-7.0, math.log10(deepest))
    mirrored = bool(rng.random() < 0.5)
    end, count = (0.5 if mirrored else 1.0), int(rng.integers(1, 4))
    flat = float(rng.uniform(0.1, 0.4)) * end if rng.random() < 1.0 / 3.0 else 0.0
    ends = flat + (end - flat) * np.append(0.0, np.cumsum(rng.dirichlet(np.full(count, 6.0))))
    ends[-1] = end
    levels = -depth * rng.uniform(0.2, 1.0, count + 1)
    levels[0] = 0.0
    if not mirrored:
        levels[-1] = 0.0
    half: list[tuple[float, float, tuple[float, ...]]] = [(0.0, flat, (0.0, 0.0))] if flat else []
    for (a, b), (first, last) in zip(pairwise(ends.tolist()), pairwise(levels.tolist()), strict=True):
        half.append((a, b, (first, *(-depth * rng.uniform(0.0, 1.2, 2)).tolist(), last)))
    return _polynomials(*half, *((1.0 - b, 1.0 - a, c[::-1]) for a, b, c in half[::-1] if mirrored))


def random_mixture(number: int) -> Mixture:
    """A random wall, or a mixture of two walls with slopes small enough for the precise judge."""
    rng = np.random.default_rng([20261128, number])
    if number % 3:
        return [(1.0, random_wall(rng, 1e-2))]
    cases = [random_wall(rng, 3e-4) for _ in range(2)]
    weight = float(rng.uniform(0.2, 0.8))
    return [(weight, cases[0]), (1.0 - weight, cases[1])]


def judge(mixture: Mixture) -> Iterator[Judged]:
    """The gaps in both conventions: near the judge's interval, positive and isolated, with the right edge."""
    laws = [(weight, ker.WallLaw(case.wall)) for weight, case in mixture]
    law = laws[0][1] if len(laws) == 1 else laws[0][0] * laws[0][1] + laws[1][0] * laws[1][1]
    edge = sum(weight * case.edge for weight, case in mixture)
    for convention, form in (("specular", law.in_specular_frame()), ("paper", law)):
        if not form.reversible:
            continue
        found, bounds = spec.spectral_gap(form), essential_edge(form)
        low, high, way = interval(mixture, convention)
        faults = []
        if found.verdict != "isolated" or found.value <= found.error:
            faults.append(f"{found.value:.10g} +- {found.error:.1e} is {found.verdict}")
        if not edge - 1e-15 <= bounds.low <= bounds.high <= edge + 1e-15:
            faults.append(f"the edge is {edge:g}, not {bounds.low:g} to {bounds.high:g}")
        away = max(low - found.value, found.value - high, 0.0)
        yield Judged(f"{convention}, {way}", found.error, away, fault=", ".join(faults), outcome=found.verdict)


def interval(mixture: Mixture, convention: str) -> tuple[float, float, str]:
    """The judge's interval for the gap, and the name of the judge."""
    steepest = max(case.steepest for _, case in mixture)
    if steepest <= PRECISE:
        # the form is linear in the law, and its minimiser is the same to leading order
        value = sum(weight * _precise_quotient(case, 1 if convention == "specular" else 2) for weight, case in mixture)
        slack = max(_slack(case) for _, case in mixture)
        return value * (1.0 - slack), value * (1.0 + slack), "50 digits"
    ((_, case),) = mixture
    value, spread = sampled_gap(case.wall, convention)
    missed = MISSED if steepest < 0.5 else MISSED_STEEP
    return value * (1.0 - missed) - SIGMAS * spread, value + SIGMAS * spread, "rays"


def _slack(case: Case) -> float:
    return ALLOWED * case.steepest**4 * abs(math.log(case.steepest)) + 1e-15


def _precise_quotient(case: Case, degree: int) -> float:
    """E (f(theta'_F) - f(theta))^2/(2 Var f) without grazing rays, for f = P_degree(cos)."""
    with mp.workdps(DIGITS):
        low = 4 * mp.mpf(case.steepest)
        nodes, entries = (list(zip(*map(mp.matrix, gauss(n)), strict=True)) for n in (ANGLES, ENTRIES))
        total = mp.mpf(0)
        for x, w in nodes:
            theta = mp.pi / 2 + (mp.pi / 2 - low) * x
            cos, sin = mp.cos(theta), mp.sin(theta)
            for curve in case.curves:
                # entry points of rays that meet the ends of the curve
                first, last = (mp.mpf(end) - curve.height(mp.mpf(end)) * cos / sin for end in (curve.low, curve.high))
                for y, v in entries:
                    rise = curve.slope(_hit((first + last) / 2 + (last - first) / 2 * y, cos / sin, curve.height))
                    # the velocity -(cos, sin), reflected by (1, rise); specular reflection keeps the first component
                    out = 2 * (cos + sin * rise) / (1 + rise**2) - cos
                    change = mp.legendre(degree, out) - mp.legendre(degree, cos)
                    total += (mp.pi / 2 - low) * w * sin / 2 * (last - first) / 2 * v * change**2
        return float(total / 2 * (2 * degree + 1))


def _hit(entry: mp.mpf, run: mp.mpf, height: Callable[[mp.mpf], mp.mpf]) -> mp.mpf:
    """The x at which the ray x = entry + run y meets the curve y = height(x): by contraction, then by secants."""
    x = entry
    for _ in range(4):
        x = entry + run * height(x)
    return mp.findroot(
        lambda x: x - entry - run * height(x), (x, x + mp.mpf(10) ** -20), tol=mp.mpf(10) ** -60, verify=False
    )


def sampled_gap(
    wall: geo.Wall, convention: str, *, blocks: int = 1, degrees: int = DEGREES, seed: int = 0
) -> tuple[float, float]:
    """The least value of the form on polynomials, from rays, and its standard error; the gap is at most this value."""
    # separate even and odd functions of mirror-symmetric laws
    parts = (slice(0, None, 2), slice(1, None, 2)) if wall.is_mirror_symmetric else (slice(None),)
    values = []
    for sequence in range(SEQUENCES):
        sampler, form, number = Sobol(2, rng=np.random.default_rng([seed, sequence])), 0.0, 0
        for _ in range(blocks):
            u, x = sampler.random(POINTS).T
            theta = np.arccos(1.0 - 2.0 * u)
            out = outgoing_angles(wall, x, theta)
            # rays lost in corners, some in a million, are omitted
            theta, out = theta[np.isfinite(out)], out[np.isfinite(out)]
            change = legendre_functions(np.pi - out if convention == "specular" else out, degrees)
            change -= legendre_functions(theta, degrees)
            form, number = form + change.T @ change, number + theta.size
        values.append(min(np.linalg.eigvalsh(0.5 / number * form[part, part])[0] for part in parts))
    return float(np.mean(values)), float(np.std(values, ddof=1) / math.sqrt(SEQUENCES))


NUMBER = len(CURVATURES) + len(HALF_ANGLES) + 4 * len(DEPTHS)
CAMPAIGNS = (
    Campaign("small-gaps", "Are gaps down to 1e-16 right?", draw, judge, NUMBER, [1, 12, 30, 32]),
    Campaign("random-small-gaps", "Are small gaps of random walls right?", random_mixture, judge, 40, [1, 6, 10]),
)
