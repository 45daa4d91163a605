"""Whether the reported errors of the transmission of channels hold, against flights with formulas of their own.

The judge starts particles in the opening and reflects them by the textbook tracer, or by the cosine law.
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
from campaigns.judges.textbook_tracer import outgoing_angles

PARTICLES, TOGETHER, TOLERANCE = 2**23, 2**18, 5e-3
# Standard deviations of the judge: with two, it alone would refute one in twenty exact numbers.
SIGMAS = 3.5


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


def passed(case: Case, rng: np.random.Generator) -> int:
    """How many of the particles that enter leave at the far end."""
    sine = 2.0 * rng.random(TOGETHER) - 1.0
    along, across = np.sqrt(1.0 - sine**2), np.abs(sine)
    x, through = along / across * rng.random(TOGETHER), 0
    while x.size:
        through += int(np.count_nonzero(x >= case.length))
        inside = (x > 0.0) & (x < case.length)
        along, across = case.reflect(along[inside], across[inside], rng)
        x = x[inside] + along / across
    return through


def judge(case: Case) -> Iterator[Judged]:
    """The transmission at a rough tolerance."""
    rng = np.random.default_rng([14, case.number])
    found = spec.transmission(case.law, case.length, tolerance=TOLERANCE, rng=rng)
    fraction = sum(passed(case, rng) for _ in range(PARTICLES // TOGETHER)) / PARTICLES
    error = SIGMAS * (fraction * (1.0 - fraction) / PARTICLES) ** 0.5
    yield Judged(f"{case.kind}, {found.method.split()[0]}", found.error, abs(float(found) - fraction), error)


CAMPAIGNS = (Campaign("transmission", "Do errors of transmissions hold?", draw, judge, 32, [25], level=0.95),)
