"""Gaps of shallow walls, their verdicts and their essential edges, held against references of other makings.

``python -m benchmarks.small_gaps`` prints a row a wall and convention. Two judges, neither of which knows of the
distribution of slopes, of divided differences or of the form's bounds:

- *50 digits*: rays are followed in 50 digits, from the entry point to the curve and off it by reflecting a vector, for
  walls whose rays, but for the grazing ones, meet them once. E (f(theta') - f(theta))^2 / (2 E f^2) of cos(theta) or
  cos(theta)^2 - 1/3 is at least the gap; its excess over the gap, and the grazing rays left out, are of order s^4 ln s
  of it for slopes up to s, and 200 s^4 is allowed.
- *rays*: for steeper walls a quarter of a million rays are followed by the tests' textbook tracer; the least value of
  the same form on polynomials is an upper bound of the gap but for its sampling error, and close to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import mpmath as mp
import numpy as np
from scipy.stats.qmc import Sobol
from tests.textbook_tracer import compiled, follow, table_of

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.checks import Floats
from asperity.spectral.essential import essential_edge

DIGITS = 50
# Of the slope to the fourth: what the precise judge allows, and up to which slope it is asked.
ALLOWED, PRECISE = 200.0, 1.1e-2
# Nodes in the angle and on each curve.
ANGLES, ENTRIES = 16, 12
# Of the plain judge: nets of points, for their spread, and polynomials.
NETS, POINTS, DEGREES = 8, 2**15, 24
# The share of the gap that so many polynomials miss where eigenfunctions are not smooth, at grazing and near the half
# angle of arcs: walls of slopes below 1/2, and others.
MISSED, MISSED_STEEP = 5e-3, 0.1
SIGMAS = 4.0

CURVATURES = (1e-7, 1e-6, 3e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0)
HALF_ANGLES = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 5e-3, 0.02, 0.05, 0.1, 0.3, 0.8, 1.2, 1.5)
DEPTHS = (1e-7, 1e-5, 1e-3, 1e-2, 0.1)

# A curve below y = 0 from x = a to x = b: its height and slope at x, in whatever numbers x is.
Curve = tuple[float, float, Callable[..., object], Callable[..., object]]


@dataclass(frozen=True)
class Case:
    """A wall, its curves as functions of x, its steepest slope, and the edge of its essential spectrum by theorem."""

    name: str
    wall: geo.Wall
    curves: tuple[Curve, ...]
    steepest: float
    edge: float = 0.0


@dataclass(frozen=True)
class Held:
    """A reported gap and edge, and the interval in which the gap lies by the judge."""

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
        """Whether the intervals meet, the gap is positive and isolated, and the edge right."""
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
        # the circle of radius 1/(2 sin) through (0, 0) and (1, 0), as minus a product over a sum
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
    """Parts of ellipses, 2 wide and a half of that times the depth high, that leave y = 0 at a slope."""
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
    """Parabolas below one half of the period, a flat top on the other."""
    wall = geo.Wall([geo.Segment((0, 0), (0.5, 0)), geo.Bezier([(0.5, 0), (0.75, -depth), (1, 0)])], period=1.0)
    below = (0.5, 1.0, lambda x: 8 * depth * (x - 1) * (x - _half(x)), lambda x: 8 * depth * (2 * x - 3 * _half(x)))
    flat = (0.0, 0.5, lambda x: 0 * x, lambda x: 0 * x)
    return Case(f"half flat, depth {depth:g}", wall, (flat, below), math.atan(4.0 * depth), edge=0.5)


def _half(x: object) -> object:
    return mp.mpf(1) / 2 if isinstance(x, mp.mpf) else 0.5


def _root(x: object) -> object:
    return mp.sqrt(x) if isinstance(x, mp.mpf) else np.sqrt(x)


def cases(small: bool = False) -> Iterator[Case]:
    """All walls, or a few for the tests."""
    for curvature in CURVATURES[1:6:4] if small else CURVATURES:
        yield _bumps(curvature)
    for half_angle in HALF_ANGLES[1:6:4] if small else HALF_ANGLES:
        yield _arcs(half_angle)
    for depth in DEPTHS[1:2] if small else DEPTHS:
        yield _parabolas(depth)
        yield _ellipses(0.1 * depth)
        yield _skew(depth)
        yield _tops(depth)


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
    """Where the gap lies by a judge, and which."""
    if case.steepest <= PRECISE:
        value = _precise_quotient(case, 1 if frame == "specular" else 2)
        slack = ALLOWED * case.steepest**4 * abs(math.log(case.steepest)) + 1e-15
        return value * (1.0 - slack), value * (1.0 + slack), "50 digits"
    value, spread = _sampled_gap(case, frame)
    missed = MISSED if case.steepest < 0.5 else MISSED_STEEP
    return value * (1.0 - missed) - SIGMAS * spread, value + SIGMAS * spread, "rays"


def _precise_quotient(case: Case, degree: int) -> float:
    """E (f(theta'_F) - f(theta))^2/(2 Var f) over all but grazing rays, of f = P_degree(cos)."""
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
    """The x where a ray that falls by 1 on the way back by ``run`` meets the curve: a contraction, then secants."""
    x = entry
    for _ in range(4):
        x = entry + run * height(x)
    return mp.findroot(
        lambda x: x - entry - run * height(x), (x, x + mp.mpf(10) ** -20), tol=mp.mpf(10) ** -60, verify=False
    )


def _shape(degree: int, z: mp.mpf) -> mp.mpf:
    return z if degree == 1 else (3 * z**2 - 1) / 2


def _gauss(order: int) -> list[tuple[mp.mpf, mp.mpf]]:
    """Gauss's nodes and weights on (-1, 1) in many digits: Newton's method from the doubles."""
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
        # rays that the judge loses in corners, some in a million, are left out
        x, theta, out = x[np.isfinite(out)], theta[np.isfinite(out)], out[np.isfinite(out)]
        change = _legendre(np.pi - out if frame == "specular" else out) - _legendre(theta)
        form = 0.5 * change.T @ change / len(theta)
        # of mirror-symmetric laws even and odd functions apart
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
    print("| wall | convention | gap | verdict | edge | judge | by the judge | holds |")
    print("|---|---|---|---|---|---|---|---|")
    count = confirmed = 0
    for case in cases():
        for row in held(case):
            count, confirmed = count + 1, confirmed + row.is_confirmed
            print(
                f"| {row.name} | {row.frame} | {row.found.value:.10g} +- {row.found.error:.1e} | {row.found.verdict} "
                f"| {0.5 * sum(row.edge):g} | {row.judge} | {row.low:.10g} to {row.high:.10g} "
                f"| {'yes' if row.is_confirmed else '**no**'} |",
                flush=True,
            )
    print(f"\n{confirmed} of {count} hold.")


if __name__ == "__main__":
    main()
