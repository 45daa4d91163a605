"""Gaps of shallow walls, their verdicts and their essential edges, against independent references.

``python -m campaigns.small_gaps`` prints a row for each wall and convention. Two judges are used, neither of which
knows the distribution of slopes, divided differences or the form's bounds:

- *50 digits*, for walls that all but grazing rays meet once. Rays are followed in 50 digits, from the entry point to
  the curve and off it by reflecting a vector. E (f(theta') - f(theta))^2 / (2 E f^2) of cos(theta) or cos(theta)^2 -
  1/3 is at least the gap. For slopes up to s, its excess over the gap and the omitted grazing rays are of relative
  order s^4 ln s, and 200 s^4 ln s is allowed.
- *rays*, for steeper walls: the tests' textbook tracer follows a quarter of a million rays. The least value of the same
  form on polynomials is an upper bound of the gap up to its sampling error, and close to it.

``--random FIRST LAST`` tests random walls: polynomial curves of random heights between random positions, depths from
1e-7 to 1e-2, with and without mirror axis and flat tops. Every third case is a mixture of the laws of two such walls.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mpmath as mp
import numpy as np
from scipy.stats.qmc import Sobol

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from asperity.spectral.essential.edge import essential_edge
from campaigns.judges.textbook_tracer import compiled, follow, table_of

from .pages import print_table

DIGITS = 50
# Factor of slope^4 in the allowed excess of the precise judge, and the largest slope for which this judge is used.
ALLOWED, PRECISE = 200.0, 1.1e-2
# Nodes in the angle and on each curve.
ANGLES, ENTRIES = 16, 12
# For the rays: number of Sobol sequences, which gives the spread, points of each, and polynomials.
NETS, POINTS, DEGREES = 8, 2**15, 24
# Relative excess of the polynomials' value where eigenfunctions are not smooth, at grazing and near the half angle of
# arcs: for walls of slopes below 1/2, and for others.
MISSED, MISSED_STEEP = 5e-3, 0.1
SIGMAS = 4.0

CURVATURES = (1e-7, 1e-6, 3e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)
HALF_ANGLES = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 5e-3, 0.02, 0.05, 0.1, 0.3, 0.8, 1.2, 1.5)
DEPTHS = (1e-7, 1e-5, 1e-3, 1e-2, 0.1)

# A curve below y = 0 from x = a to x = b, with its height and slope at x; x is a float or a multiprecision number.
Curve = tuple[float, float, Callable[..., object], Callable[..., object]]


@dataclass(frozen=True)
class Case:
    """A wall, its curves as functions of x, its steepest slope, and the theoretical edge of its essential spectrum."""

    name: str
    wall: geo.Wall
    curves: tuple[Curve, ...]
    steepest: float
    edge: float = 0.0


@dataclass(frozen=True)
class Held:
    """A reported gap and edge, and the judge's interval for the gap."""

    name: str
    frame: str
    found: spec.SpectralGap
    edge: tuple[float, float]
    true_edge: float
    low: float
    high: float
    judge: str

    @property
    def is_confirmed(self) -> bool:
        """Whether the intervals intersect, the gap is positive and isolated, and the edge is right."""
        low, high = self.found.value - self.found.error, self.found.value + self.found.error
        meets = low <= self.high and high >= self.low
        right = all(abs(end - self.true_edge) <= 1e-15 for end in self.edge)
        return meets and low > 0.0 and self.found.verdict == "isolated" and right


def _bumps(curvature: float) -> Case:
    def height(x: object, top: float) -> object:
        return -curvature * (x - top) ** 2 / (1 + _root(1 - (curvature * (x - top)) ** 2))

    def slope(x: object, top: float) -> object:
        return -curvature * (x - top) / _root(1 - (curvature * (x - top)) ** 2)

    curves = tuple(
        (a, b, lambda x, top=top: height(x, top), lambda x, top=top: slope(x, top))
        for a, b, top in ((0.0, 0.5, 0), (0.5, 1.0, 1))
    )
    steepest = math.asin(0.5 * curvature)
    return Case(f"bumps, curvature {curvature:g}", geo.dispersing_arcs(curvature), curves, steepest)


def _arcs(half_angle: float) -> Case:
    def height(x: object) -> object:
        with mp.workdps(DIGITS):
            sine = mp.sin(mp.mpf(half_angle))
        sine = sine if isinstance(x, mp.mpf) else float(sine)
        # the circle of radius 1/(2 sin) through (0, 0) and (1, 0), written without cancellation
        root = _root(1 - sine**2)
        return -2 * sine * x * (1 - x) / (root + _root(1 - (sine * (2 * x - 1)) ** 2))

    def slope(x: object) -> object:
        with mp.workdps(DIGITS):
            sine = mp.sin(mp.mpf(half_angle))
        sine = sine if isinstance(x, mp.mpf) else float(sine)
        across = sine * (2 * x - 1)
        return across / _root(1 - across**2)

    wall = geo.focusing_arcs(half_angle)
    return Case(f"arcs, half angle {half_angle:g}", wall, ((0.0, 1.0, height, slope),), half_angle)


def _parabolas(depth: float) -> Case:
    """Bezier bumps of this depth: y = -4 depth x^2 up to x = 1/2, with tops at the integers as well."""
    wall = geo.Wall(
        [geo.Bezier([(0, 0), (0.25, 0), (0.5, -depth)]), geo.Bezier([(0.5, -depth), (0.75, 0), (1, 0)])], period=1.0
    )
    curves = tuple(
        (a, b, lambda x, top=top: -4 * depth * (x - top) ** 2, lambda x, top=top: -8 * depth * (x - top))
        for a, b, top in ((0.0, 0.5, 0), (0.5, 1.0, 1))
    )
    return Case(f"Bezier bumps, depth {depth:g}", wall, curves, math.atan(4.0 * depth))


def _ellipses(depth: float) -> Case:
    """Arcs of ellipses with half axes 1 and 10 times the depth, which leave y = 0 at a nonzero slope."""
    # (x - 1/2)^2 + ((y + c)/b)^2 = 1 below, with y = 0 at x = 0 and 1
    b = 10.0 * depth
    wall = geo.Wall(
        [geo.Arc((0.5, b * math.sqrt(0.75)), (1.0, b), -2 * math.pi / 3, -math.pi / 3).pinned((0, 0), (1, 0))]
    )

    def height(x: object) -> object:
        across = (x - _half(x)) ** 2
        return -b * (_half(x) ** 2 - across) / (_root(1 - across) + _root(1 - _half(x) ** 2))

    def slope(x: object) -> object:
        return b * (x - _half(x)) / _root(1 - (x - _half(x)) ** 2)

    return Case(f"ellipses, depth {depth:g}", wall, ((0.0, 1.0, height, slope),), math.atan(b / math.sqrt(3.0)))


def _skew(depth: float) -> Case:
    """Two parabolas that meet at x = 0.3: no mirror symmetry."""
    lowest = (0.3, -depth)
    wall = geo.Wall([geo.Bezier([(0, 0), (0.15, 0), lowest]), geo.Bezier([lowest, (0.65, 0), (1, 0)])], period=1.0)
    curves = tuple(
        (a, b, lambda x, top=top, c=c: -c * (x - top) ** 2, lambda x, top=top, c=c: -2 * c * (x - top))
        for a, b, top, c in ((0.0, 0.3, 0, depth / 0.3**2), (0.3, 1.0, 1, depth / 0.7**2))
    )
    return Case(f"skew Bezier bumps, depth {depth:g}", wall, curves, math.atan(2.0 * depth / 0.3))


def _tops(depth: float) -> Case:
    """Parabolas below one half of the period, and a flat top on the other half."""
    wall = geo.Wall([geo.Segment((0, 0), (0.5, 0)), geo.Bezier([(0.5, 0), (0.75, -depth), (1, 0)])], period=1.0)
    below = (0.5, 1.0, lambda x: 8 * depth * (x - 1) * (x - _half(x)), lambda x: 8 * depth * (2 * x - 3 * _half(x)))
    flat = (0.0, 0.5, lambda x: 0 * x, lambda x: 0 * x)
    return Case(f"half flat, depth {depth:g}", wall, (flat, below), math.atan(4.0 * depth), edge=0.5)


def _half(x: object) -> object:
    return mp.mpf(1) / 2 if isinstance(x, mp.mpf) else 0.5


def _root(x: object) -> object:
    return mp.sqrt(x) if isinstance(x, mp.mpf) else np.sqrt(x)


def cases(small: bool = False) -> Iterator[Case]:
    """All walls, or a few of them for the tests."""
    for curvature in CURVATURES[1:6:4] if small else CURVATURES:
        yield _bumps(curvature)
    for half_angle in HALF_ANGLES[1:6:4] if small else HALF_ANGLES:
        yield _arcs(half_angle)
    for depth in DEPTHS[1:2] if small else DEPTHS:
        yield _parabolas(depth)
        yield _ellipses(0.1 * depth)
        yield _skew(depth)
        yield _tops(depth)


def random_case(rng: np.random.Generator, name: str, deepest: float) -> Case:
    """A wall of one to three polynomial curves, mirrored in half of the cases, with a flat top in a third of them."""
    depth = 10.0 ** rng.uniform(-7.0, math.log10(deepest))
    mirrored = bool(rng.random() < 0.5)
    end, count = (0.5 if mirrored else 1.0), int(rng.integers(1, 4))
    flat = float(rng.uniform(0.1, 0.4)) * end if rng.random() < 1.0 / 3.0 else 0.0
    places = flat + (end - flat) * np.append(0.0, np.cumsum(rng.dirichlet(np.full(count, 6.0))))
    places[-1] = end
    levels = -depth * rng.uniform(0.2, 1.0, count + 1)
    levels[0] = 0.0
    if not mirrored:
        levels[-1] = 0.0
    half: list[tuple[float, float, tuple[float, ...]]] = []
    for k in range(count):
        inner = (-depth * rng.uniform(0.0, 1.2, 2)).tolist()
        half.append((float(places[k]), float(places[k + 1]), (float(levels[k]), *inner, float(levels[k + 1]))))
    graphs = half + ([(1.0 - b, 1.0 - a, c[::-1]) for a, b, c in half[::-1]] if mirrored else [])
    pieces: list[geo.Segment | geo.Bezier] = [
        geo.Bezier([(a + k / 3.0 * (b - a) if k < 3 else b, y) for k, y in enumerate(c)]) for a, b, c in graphs
    ]
    curves = [_graph(*graph) for graph in graphs]
    steepest = max(3.0 * float(np.abs(np.diff(c)).max()) / (b - a) for a, b, c in half)
    tops = ([(0.0, flat)] + ([(1.0 - flat, 1.0)] if mirrored else [])) if flat else []
    for a, b in tops:
        pieces.insert(0 if a == 0.0 else len(pieces), geo.Segment((a, 0.0), (b, 0.0)))
        curves.append((a, b, lambda x: 0 * x, lambda x: 0 * x))
    kind = f"{'mirrored' if mirrored else 'skew'}, {count} curves" + (", flat top" if flat else "")
    return Case(
        f"{name}, {kind}, depth {depth:.1e}", geo.Wall(pieces, period=1.0), tuple(curves), math.atan(steepest),
        edge=math.fsum(b - a for a, b in tops),
    )  # fmt: skip


def _graph(a: float, b: float, levels: tuple[float, ...]) -> Curve:
    """The height and slope of the cubic with these Bernstein ordinates."""
    p, q, r, s = levels

    def height(x: object) -> object:
        t = (x - a) / (b - a)
        return p * (1 - t) ** 3 + 3 * q * t * (1 - t) ** 2 + 3 * r * t**2 * (1 - t) + s * t**3

    def slope(x: object) -> object:
        t = (x - a) / (b - a)
        return 3 * ((q - p) * (1 - t) ** 2 + 2 * (r - q) * t * (1 - t) + (s - r) * t**2) / (b - a)

    return a, b, height, slope


def random_rows(number: int) -> Iterator[Held]:
    """Results for a random wall, or for a mixture of two walls with slopes small enough for the precise judge."""
    rng = np.random.default_rng([20261128, number])
    if number % 3:
        yield from held(random_case(rng, f"random {number}", 1e-2))
        return
    cases = [random_case(rng, f"random {number}", 3e-4) for _ in range(2)]
    weight = float(rng.uniform(0.2, 0.8))
    weights = (weight, 1.0 - weight)
    law = weight * ker.WallLaw(cases[0].wall) + (1.0 - weight) * ker.WallLaw(cases[1].wall)
    name = f"{cases[0].name}, and {weight:.2f} to {1.0 - weight:.2f} {cases[1].name.split(', ', 1)[1]}"
    for frame, form in (("specular", law.in_specular_frame()), ("paper", law)):
        if not form.reversible:
            continue
        # the form is linear in the law, and its minimiser is the same to leading order
        value = sum(
            w * _precise_quotient(case, 1 if frame == "specular" else 2) for w, case in zip(weights, cases, strict=True)
        )
        slack = max(_slack(case) for case in cases)
        edge = essential_edge(form)
        yield Held(
            name, frame, spec.spectral_gap(form), (edge.low, edge.high),
            sum(w * case.edge for w, case in zip(weights, cases, strict=True)),
            value * (1.0 - slack), value * (1.0 + slack), "50 digits",
        )  # fmt: skip


def held(case: Case) -> Iterator[Held]:
    """The gaps in both conventions with the judge's intervals."""
    law = ker.WallLaw(case.wall)
    for frame, form in (("specular", law.in_specular_frame()), ("paper", law)):
        if not form.reversible:
            continue
        found, edge = spec.spectral_gap(form), essential_edge(form)
        low, high, judge = judged(case, frame)
        yield Held(case.name, frame, found, (edge.low, edge.high), case.edge, low, high, judge)


def judged(case: Case, frame: str) -> tuple[float, float, str]:
    """The judge's interval for the gap, and the name of the judge."""
    if case.steepest <= PRECISE:
        value = _precise_quotient(case, 1 if frame == "specular" else 2)
        slack = _slack(case)
        return value * (1.0 - slack), value * (1.0 + slack), "50 digits"
    value, spread = _sampled_gap(case, frame)
    missed = MISSED if case.steepest < 0.5 else MISSED_STEEP
    return value * (1.0 - missed) - SIGMAS * spread, value + SIGMAS * spread, "rays"


def _slack(case: Case) -> float:
    return ALLOWED * case.steepest**4 * abs(math.log(case.steepest)) + 1e-15


def _precise_quotient(case: Case, degree: int) -> float:
    """E (f(theta'_F) - f(theta))^2/(2 Var f) without grazing rays, for f = P_degree(cos)."""
    with mp.workdps(DIGITS):
        low = 4 * mp.mpf(case.steepest)
        nodes = [(mp.mpf(x), mp.mpf(w)) for x, w in _gauss(ANGLES)]
        places = [(mp.mpf(x), mp.mpf(w)) for x, w in _gauss(ENTRIES)]
        total = mp.mpf(0)
        for x, w in nodes:
            theta = mp.pi / 2 + (mp.pi / 2 - low) * x
            cos, sin = mp.cos(theta), mp.sin(theta)
            row = mp.mpf(0)
            for a, b, height, slope in case.curves:
                # entry points of rays that meet the ends of the curve
                first, last = (mp.mpf(end) - height(mp.mpf(end)) * cos / sin for end in (a, b))
                for y, v in places:
                    entry = (first + last) / 2 + (last - first) / 2 * y
                    hit = _hit(entry, cos / sin, height)
                    rise = slope(hit)
                    size = 1 + rise**2
                    # the velocity -(cos, sin), reflected by (1, rise)
                    along = -(cos + sin * rise)
                    vx = 2 * along / size + cos
                    # specular reflection keeps the first component: theta'_F has the cosine -vx
                    row += (last - first) / 2 * v * (_shape(degree, -vx) - _shape(degree, cos)) ** 2
            total += (mp.pi / 2 - low) * w * sin / 2 * row
        return float(total / 2 * (2 * degree + 1))


def _hit(entry: mp.mpf, run: mp.mpf, height: Callable[..., object]) -> mp.mpf:
    """The x at which the ray x = entry + run y meets the curve y = height(x): by contraction, then by secants."""
    x = entry
    for _ in range(4):
        x = entry + run * height(x)
    return mp.findroot(
        lambda x: x - entry - run * height(x), (x, x + mp.mpf(10) ** -20), tol=mp.mpf(10) ** -60, verify=False
    )


def _shape(degree: int, z: mp.mpf) -> mp.mpf:
    return z if degree == 1 else (3 * z**2 - 1) / 2


def _gauss(order: int) -> list[tuple[mp.mpf, mp.mpf]]:
    """Gauss nodes and weights on (-1, 1) in many digits, by Newton's method from the doubles."""
    found = []
    for start in np.polynomial.legendre.leggauss(order)[0].tolist():
        x = mp.findroot(lambda x: mp.legendre(order, x), mp.mpf(start))
        slope = order * (x * mp.legendre(order, x) - mp.legendre(order - 1, x)) / (x**2 - 1)
        found.append((x, 2 / ((1 - x**2) * slope**2)))
    return found


def _sampled_gap(case: Case, frame: str) -> tuple[float, float]:
    """The least value of the form on polynomials, from rays, and its standard error."""
    values = []
    for net in range(NETS):
        u, x = Sobol(2, rng=np.random.default_rng(net)).random(POINTS).T
        theta = np.arccos(1.0 - 2.0 * u)
        out = _followed(table_of(case.wall), x, theta)
        # on flat tops reflection is specular
        for a, b, height, _ in case.curves:
            if height(0.5 * (a + b)) == 0.0:
                top = (x > a) & (x < b)
                out[top] = np.pi - theta[top]
        # unresolved rays in corners, some in a million, are omitted
        x, theta, out = x[np.isfinite(out)], theta[np.isfinite(out)], out[np.isfinite(out)]
        change = _legendre(np.pi - out if frame == "specular" else out) - _legendre(theta)
        form = 0.5 * change.T @ change / len(theta)
        # separate even and odd functions of mirror-symmetric laws
        parts = (slice(0, None, 2), slice(1, None, 2)) if case.wall.is_mirror_symmetric else (slice(None),)
        values.append(min(np.linalg.eigvalsh(form[part, part])[0] for part in parts))
    return float(np.mean(values)), float(np.std(values, ddof=1) / math.sqrt(NETS))


def _legendre(theta: Floats) -> Floats:
    degrees = np.arange(1, DEGREES + 1)
    return np.asarray(np.polynomial.legendre.legvander(np.cos(theta), DEGREES)[:, 1:] * np.sqrt(2.0 * degrees + 1.0))


@compiled
def _followed(table, x, theta):  # type: ignore[no-untyped-def]
    out = np.empty_like(x)
    for k in range(x.size):
        angle, label = follow(table, x[k], theta[k])
        out[k] = angle if label > 0 else np.nan
    return out


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.small_gaps", description=__doc__)
    parser.add_argument("--random", type=int, nargs=2, metavar=("FIRST", "LAST"), help="random walls of these numbers")
    options = parser.parse_args()
    rows = (row for case in cases() for row in held(case))
    if options.random:
        rows = (row for number in range(*options.random) for row in random_rows(number))
    confirmed: list[bool] = []

    def cells(row: Held) -> str:
        confirmed.append(row.is_confirmed)
        return (
            f"{row.name} | {row.frame} | {row.found.value:.10g} +- {row.found.error:.1e} | {row.found.verdict} "
            f"| {0.5 * sum(row.edge):g} | {row.judge} | {row.low:.10g} to {row.high:.10g} "
            f"| {'yes' if row.is_confirmed else '**no**'}"
        )

    print_table("wall | convention | gap | verdict | edge | judge | by the judge | holds", map(cells, rows))
    print(f"\n{sum(confirmed)} of {len(confirmed)} hold.")


if __name__ == "__main__":
    main()
