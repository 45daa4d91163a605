"""Walls with facets of their own: matrices, samples, hits and gaps against rays and equations of the judge alone.

The judge draws its own rays in random polygons, solves the integral equations of diffuse grooves and arcs, and for
roughness of two scales rays meet all the fine teeth.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from asperity.kernels.walls.faceted_law import follow_facets
from campaigns.engine import Campaign, Judged
from campaigns.judges.plain_facets import diffuse_arc, diffuse_groove, reflected

CASES, RAYS, BATCHES, SIGMAS = 200, 2**17, 8, 4.0
KINDS = ("matrix", "samples", "equations", "quotients", "two scales")
# Teeth on each facet, and the largest distance from facets with the law of the teeth times their number; .34 was seen.
TEETH, TWO_SCALES = (2, 8, 32, 128), 0.7


def draw(number: int) -> tuple[int, str, Floats, float, float]:
    """A number for further draws, a kind, the vertices of a wall, and diffuse and retroreflected fractions."""
    rng = np.random.default_rng([number, 60])
    x = np.sort(rng.uniform(0.05, 0.95, int(rng.integers(1, 5))))
    y = -rng.uniform(0.05, 1.5) * rng.uniform(0.1, 1.0, len(x))
    vertices = np.array([(0.0, 0.0), *zip(x, y, strict=True), (1.0, 0.0)])
    diffuse = float(rng.uniform(0.05, 1.0))
    return number, KINDS[number % len(KINDS)], vertices, diffuse, float(rng.uniform(0.0, 1.0 - diffuse))


def values_of(rng: np.random.Generator, basis: ker.Legendre) -> Floats:
    """Random coefficients of products e_i(theta) e_j(theta') of Frobenius norm 1, without constants."""
    matrix = rng.normal(size=(basis.size, basis.size))
    matrix[0] = matrix[:, 0] = 0.0
    return np.asarray(matrix / np.linalg.norm(matrix))


def mean_of(matrix: Floats, basis: ker.Legendre, theta: Floats, outgoing: Floats) -> tuple[float, float]:
    """The mean of the products with these coefficients, and its standard deviation."""
    values = np.sum(basis.evaluate(theta) @ matrix * basis.evaluate(outgoing), axis=1)
    return float(values.mean()), float(values.std() / np.sqrt(values.size))


def judge(case: tuple[int, str, Floats, float, float]) -> Iterator[Judged]:
    number, kind, vertices, diffuse, back = case
    rng, wall = np.random.default_rng([number, 61]), geo.Wall.from_vertices(vertices)
    theta = np.arccos(1.0 - 2.0 * rng.random(RAYS))
    if kind == "equations":
        yield from judged_by_equations(number, rng)
    elif kind == "two scales":
        yield from judged_by_fine_teeth(vertices, theta, rng)
    elif kind == "samples":
        facets = diffuse * ker.lambertian() + back * ker.retroreflection() + (1.0 - diffuse - back) * ker.specular()
        drawn, hits, status = follow_facets(wall, rng.random(RAYS), theta, lambda angle, _: facets.sample(angle, rng))
        expected, own_hits = reflected(vertices, theta, diffuse, back, rng)
        basis = ker.Legendre(4)
        matrix = values_of(rng, basis)
        (found, one), (true, other) = (mean_of(matrix, basis, theta, out) for out in (drawn, expected))
        yield Judged("samples", SIGMAS * float(np.hypot(one, other)), abs(found - true))
        length = float(np.hypot(*np.diff(vertices, axis=0).T).sum())
        for name, count in (("hits", hits), ("hits of the judge", own_hits)):
            yield Judged(name, SIGMAS * float(count.std()) / np.sqrt(RAYS), abs(float(count.mean()) - length))
        yield Judged("status", fault="rays did not escape" if status.any() else "")
    else:
        law, basis = ker.FacetedLaw(wall, ker.maxwell(diffuse)), ker.Legendre(4)
        if kind == "matrix":
            found, matrix = ker.discretise(law, basis, samples=2**16, rng=number), values_of(rng, basis)
            parts = [
                mean_of(matrix, basis, theta, reflected(vertices, theta, diffuse, 0.0, rng)[0])
                for theta in np.arccos(1.0 - 2.0 * rng.random((BATCHES, RAYS)))
            ]
            mean, spread = np.mean(parts, axis=0)
            true = abs(float(np.sum(matrix * found.symmetric)) - float(mean))
            yield Judged("matrix", float(found.error), true, 2.0 * float(spread) / np.sqrt(BATCHES))
            return
        outgoing, _ = reflected(vertices, theta, diffuse, 0.0, rng)
        gap = spec.spectral_gap(law, tolerance=1e-2, rng=number, time_limit=4.0)
        vector = rng.normal(size=basis.size)
        vector[0] = 0.0
        vector /= np.linalg.norm(vector)
        mean, spread = mean_of(np.outer(vector, vector), basis, theta, outgoing)
        beyond = max(gap.value - gap.error - (1.0 - mean), 0.0)
        yield Judged("gap below quotients", SIGMAS * spread, beyond, outcome=gap.verdict)
        least = [float(line.split("a gamma = ")[1].split(",")[0]) for line in gap.evidence if "a gamma = " in line]
        fault = (
            "" if least and 0.0 < least[0] <= gap.value + gap.error else "the lower bound is missing or exceeds the gap"
        )
        yield Judged("lower bound", fault=fault)


def judged_by_equations(number: int, rng: np.random.Generator) -> Iterator[Judged]:
    """The momentum that diffuse grooves and arcs return."""
    angle, basis = float(rng.uniform(0.4, 2.6)), ker.Legendre(2)
    walls = ((geo.triangular_teeth(angle), diffuse_groove(angle, 160)), (geo.focusing_arcs(0.55 * angle), 0.0))
    for name, (wall, value) in zip(("diffuse groove", "diffuse arc"), walls, strict=True):
        found = ker.discretise(ker.FacetedLaw(wall, ker.lambertian()), basis, samples=2**17, rng=number)
        expected = value or diffuse_arc(0.55 * angle)
        yield Judged(name, float(found.error), abs(float(found.symmetric[1, 1]) - expected))


def judged_by_fine_teeth(vertices: Floats, theta: Floats, rng: np.random.Generator) -> Iterator[Judged]:
    """A wall whose facets have many asymmetric teeth, against facets with the law of the teeth."""
    depth = -float(rng.uniform(0.2, 0.5))
    outer = np.array([(0.0, 0.0), (0.2, 0.0), (0.5, depth), (0.8, 0.0), (1.0, 0.0)])
    tooth = np.array([(0.0, 0.0), (0.3, -0.25)])
    fine = geo.Wall.from_vertices([*tooth, (1.0, 0.0)])
    law = ker.FacetedLaw(geo.Wall.from_vertices(outer), ker.WallLaw(fine))
    basis = ker.Legendre(4)
    matrix = values_of(rng, basis)
    expected, one = mean_of(matrix, basis, theta, law.sample(theta, rng))
    for number in TEETH:
        points = [outer[:1]]
        for start, end in pairwise(outer):
            t = (end - start) / number
            n = np.array([-t[1], t[0]])
            places = start + np.arange(number)[:, None, None] * t + tooth[:, :1] * t + tooth[:, 1:] * n
            points += [places.reshape(-1, 2)[1:], end[None]]
        rough = geo.Wall.from_vertices(np.concatenate(points))
        rays = geo.trace(rough, rng.random(len(theta)), theta)
        found, other = mean_of(matrix, basis, theta, rays.theta)
        yield Judged(
            f"{number} teeth", TWO_SCALES / number + SIGMAS * float(np.hypot(one, other)), abs(found - expected)
        )


CAMPAIGNS = (
    Campaign(
        "faceted-laws", "Do walls with facets of their own reflect as rays and equations say?", draw, judge, CASES,
        (0, 1, 2, 4), level=0.95,
    ),
)  # fmt: skip
