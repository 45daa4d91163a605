"""Whether the reported errors of the transmission of channels hold, against flights with formulas of their own.

The judge starts particles in the opening and reflects them by the textbook tracer, or by the cosine law. Of nearly
specular walls it solves Clausing's equation by another rule, or counts the mirrors that a path meets.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from campaigns.engine import Campaign, Judged
from campaigns.judges.clausing_equation import by_trapezoids
from campaigns.judges.textbook_tracer import outgoing_angles

PARTICLES, TOGETHER, TOLERANCE = 2**23, 2**18, 5e-3
# Standard deviations of the judge: with two, it alone would refute one in twenty exact numbers.
SIGMAS = 3.5
# Directions of the midpoint rule for mirrors in a row.
MIDPOINTS = 10**6


@dataclass(frozen=True)
class Case:
    """A law, its wall or None if it is smooth, the fraction of diffuse reflections, and a length."""

    number: int
    kind: str
    law: ker.Law
    wall: geo.Wall | None
    diffuse: float
    length: float

    def reflect(self, along: Floats, across: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """The components along and across the channel of reflected particles, from those of the arriving ones."""
        if self.wall is not None:
            theta = np.arctan2(across, -along)
            out = outgoing_angles(self.wall, rng.random(along.size), theta)
            # rays that are lost in corners or in thousands of hits near grazing are retroreflected
            out = np.where(np.isnan(out), theta, out)
            along, across = np.cos(out), np.sin(out)
        cosine, scattered = 2.0 * rng.random(along.size) - 1.0, rng.random(along.size) < self.diffuse
        return np.where(scattered, cosine, along), np.where(scattered, np.sqrt(1.0 - cosine**2), across)


def draw(number: int) -> Case:
    """Arcs, crevices, or mixtures of one of them or of smooth walls with diffuse reflection."""
    rng = np.random.default_rng([41, number])
    length, diffuse = float(np.exp(rng.uniform(np.log(0.3), np.log(12.0)))), float(rng.uniform(0.1, 1.0))
    half_angle, ratio = float(rng.uniform(0.2, 1.5)), float(rng.uniform(0.2, 2.0))
    arcs, crevices = geo.focusing_arcs(half_angle), geo.rectangular_teeth(ratio)
    law = ker.CircularArcLaw(half_angle)
    mixed = diffuse * ker.lambertian() + (1.0 - diffuse) * law
    return (
        Case(number, "arcs", law, arcs, 0.0, length),
        Case(number, "crevices", ker.RectangularTeethLaw(ratio), crevices, 0.0, length),
        Case(number, "diffuse and smooth", ker.maxwell(diffuse), None, diffuse, length),
        Case(number, "arcs and diffuse", mixed, arcs, diffuse, length),
    )[number % 4]


def passed(case: Case, rng: np.random.Generator, fraction: float = 1.0) -> int:
    """How many of the particles that enter leave at the far end, if this fraction of the collisions is rough."""
    sine = 2.0 * rng.random(TOGETHER) - 1.0
    along, across = np.sqrt(1.0 - sine**2), np.abs(sine)
    x, through = along / across * rng.random(TOGETHER), 0
    while x.size:
        through += int(np.count_nonzero(x >= case.length))
        inside = (x > 0.0) & (x < case.length)
        along, across = along[inside], across[inside]
        rough = rng.random(along.size) < fraction
        along[rough], across[rough] = case.reflect(along[rough], across[rough], rng)
        x = x[inside] + along / across
    return through


def judge(case: Case) -> Iterator[Judged]:
    """The transmission at a rough tolerance."""
    rng = np.random.default_rng([14, case.number])
    found = spec.transmission(case.law, case.length, tolerance=TOLERANCE, rng=rng)
    fraction = sum(passed(case, rng) for _ in range(PARTICLES // TOGETHER)) / PARTICLES
    error = SIGMAS * (fraction * (1.0 - fraction) / PARTICLES) ** 0.5
    yield Judged(f"{case.kind}, {found.method.split()[0]}", found.error, abs(float(found) - fraction), error)


# ---- nearly specular walls -----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class NearlySpecular:
    """Walls that reflect specularly but for a fraction of the collisions."""

    number: int
    kind: str
    fraction: float
    length: float
    wall: geo.Wall | None = None


def draw_nearly_specular(number: int) -> NearlySpecular:
    """Diffuse, retroreflecting or rough parts of a smooth wall, with up to some hundred such reflections."""
    rng = np.random.default_rng([43, number])
    kind = ("channel", "tube", "retroreflecting", "arcs", "crevices")[number % 5]
    fraction = float(10.0 ** rng.uniform(-7.0 if kind == "retroreflecting" else -2.7, -0.5))
    length = float(10.0 ** rng.uniform(-0.5, 3.0 if kind == "retroreflecting" else 1.5))
    if kind not in ("arcs", "crevices"):
        return NearlySpecular(number, kind, fraction, length)
    size = float(rng.uniform(0.2, 1.5))
    wall = geo.focusing_arcs(size) if kind == "arcs" else geo.rectangular_teeth(size)
    return NearlySpecular(number, kind, fraction, length, wall)


def mirrors(fraction: float, length: float) -> tuple[float, float]:
    """The transmission where a path that meets the walls n times finds n mirrors of this reflectivity in a row.

    Intensities of mirrors in a row have (1 - T)/T = n fraction/(1 - fraction). The error is from half the directions.
    """
    odds, values = fraction / (1.0 - fraction), []
    for number in (MIDPOINTS // 2, MIDPOINTS):
        angle = (np.arange(number) + 0.5) * (0.5 * np.pi / number)
        hits, more = np.divmod(length * np.tan(angle), 1.0)
        passing = (1.0 - more) / (1.0 + hits * odds) + more / (1.0 + (hits + 1.0) * odds)
        values.append(0.5 * np.pi * float(np.mean(np.cos(angle) * passing)))
    return values[1], abs(values[1] - values[0]) + 1e-12


def judge_nearly_specular(case: NearlySpecular) -> Iterator[Judged]:
    """The transmission, whose interval is in [0, 1], and whose error is no larger than what the rough part changes."""
    rng = np.random.default_rng([44, case.number])
    rough = ker.retroreflection() if case.kind == "retroreflecting" else ker.lambertian()
    if case.wall is not None:
        rough = ker.WallLaw(case.wall)
    law = (1.0 - case.fraction) * ker.specular() + case.fraction * rough
    section, closed = ("tube" if case.kind == "tube" else "channel"), case.kind in ("channel", "tube")
    found = spec.transmission(law, case.length, section, tolerance=1e-8 if closed else TOLERANCE / 10.0, rng=rng)
    if closed:
        known, error = by_trapezoids(section, case.length, case.fraction)
    elif case.wall is None:
        known, error = mirrors(case.fraction, case.length)
    else:
        plain = Case(case.number, case.kind, law, case.wall, 0.0, case.length)
        whole = PARTICLES // 8
        known = sum(passed(plain, rng, case.fraction) for _ in range(whole // TOGETHER)) / whole
        error = SIGMAS * (known * (1.0 - known) / whole) ** 0.5
    outside = found.value + found.error > 1.0 + 1e-15 or found.value - found.error < 0.0
    useless = found.error > max(0.5 * case.fraction * case.length, 1e-12)
    fault = "beyond [0, 1]" if outside else "an error as large as the change" if useless else ""
    yield Judged(f"nearly specular, {case.kind}", found.error, abs(float(found) - known), error, fault)


CAMPAIGNS = (
    Campaign("transmission", "Do errors of transmissions hold?", draw, judge, 32, [25], level=0.95),
    Campaign(
        "nearly-specular", "Do errors of transmissions of nearly specular walls hold?", draw_nearly_specular,
        judge_nearly_specular, 200, [0, 1, 4, 7], level=0.95,
    ),
)  # fmt: skip
