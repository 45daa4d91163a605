"""Whether the reported errors of the transmission of channels hold, against flights with formulas of their own.

The judge starts particles in the opening and reflects them in circles, crevices or by the cosine law.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from campaigns.engine import Campaign, Judged

PARTICLES, TOGETHER, TOLERANCE = 2**23, 2**18, 5e-3
# Standard deviations of the judge: with two, it alone would refute one in twenty exact numbers.
SIGMAS = 3.5
# From the components along and across the channel of arriving particles to those of the reflected ones.
Reflect: TypeAlias = Callable[[Floats, Floats, np.random.Generator], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Case:
    """A law with its reflections, and a length."""

    number: int
    kind: str
    law: ker.Law
    reflect: Reflect
    length: float


def in_arcs(half_angle: float) -> Reflect:
    """Reflections in circular arcs of this half angle on chords of length 1."""
    radius, height = 0.5 / np.sin(half_angle), 0.5 / np.tan(half_angle)

    def reflect(along: Floats, across: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        x, y, u, v = rng.random(along.size) - 0.5, np.full(along.size, -height), along.copy(), -across
        inside = np.arange(along.size)
        while inside.size:
            a, b, c, d = x[inside], y[inside], u[inside], v[inside]
            slope = a * c + b * d
            time = -slope + np.sqrt(np.maximum(slope**2 - a * a - b * b + radius**2, 0.0))
            a, b = a + time * c, b + time * d
            stays = b < -height
            inside, a, b, c, d = (some[stays] for some in (inside, a, b, c, d))
            # back to the circle, and speed 1: else rounding grows along short chords
            size = radius / np.hypot(a, b)
            a, b = size * a, size * b
            normal = 2.0 * (a * c + b * d) / radius**2
            c, d = c - normal * a, d - normal * b
            speed = np.hypot(c, d)
            x[inside], y[inside], u[inside], v[inside] = a, b, c / speed, d / speed
        return u, v

    return reflect


def in_crevices(ratio: float) -> Reflect:
    """Reflections of flat tops and, on the other half, in crevices of this depth over width."""

    def reflect(along: Floats, across: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        odd = np.floor(rng.random(along.size) + 2.0 * ratio * np.abs(along) / across) % 2.0 == 1.0
        return np.where(odd & (rng.random(along.size) < 0.5), -along, along), across

    return reflect


def partly(diffuse: float, other: Reflect) -> Reflect:
    """Diffuse reflection of this fraction, else the other one."""

    def reflect(along: Floats, across: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        cosine, scattered = 2.0 * rng.random(along.size) - 1.0, rng.random(along.size) < diffuse
        along, across = other(along, across, rng)
        return np.where(scattered, cosine, along), np.where(scattered, np.sqrt(1.0 - cosine**2), across)

    return reflect


def draw(number: int) -> Case:
    """Arcs, crevices, or mixtures of one of them or of smooth walls with diffuse reflection."""
    rng = np.random.default_rng([41, number])
    length, diffuse = float(np.exp(rng.uniform(np.log(0.3), np.log(12.0)))), float(rng.uniform(0.1, 1.0))
    half_angle, ratio = float(rng.uniform(0.2, 1.5)), float(rng.uniform(0.2, 2.0))
    kind = ("arcs", "crevices", "diffuse and smooth", "arcs and diffuse")[number % 4]
    law, reflect = {
        "arcs": (ker.CircularArcLaw(half_angle), in_arcs(half_angle)),
        "crevices": (ker.RectangularTeethLaw(ratio), in_crevices(ratio)),
        "diffuse and smooth": (ker.maxwell(diffuse), partly(diffuse, lambda along, across, rng: (along, across))),
        "arcs and diffuse": (
            diffuse * ker.lambertian() + (1.0 - diffuse) * ker.CircularArcLaw(half_angle),
            partly(diffuse, in_arcs(half_angle)),
        ),
    }[kind]
    return Case(number, kind, law, reflect, length)


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
