"""Verdicts and gaps of random walls, and eigenvalues to a tolerance, against independent references.

- *Random walls*: segments, arcs, ellipses and Bezier pieces, flat tops and islands, unchanged, mixed and squared, in
  both conventions. The judge follows rays with the textbook tracer, which shares no formula with the library's tracer.
  The largest eigenvalues of its Galerkin matrices in Legendre polynomials are lower bounds, so the reported gap must
  not exceed the gap of these matrices. For the verdict *isolated* the judge's values at three degrees must lead to the
  gap. For the verdict *essential edge* the edge must lie between two bounds from rays that meet straight pieces only.
- *Theorems*: polygons have no gap, in both conventions; with a Lambertian fraction a their gap is a.
- *Tolerances*: `spectrum(law, tolerance=t)` against known eigenvalues.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats.qmc import Sobol

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.checks import Floats
from asperity.errors import InputError
from campaigns.cases.random_curved_walls import COUNT, random_curved_wall
from campaigns.cases.random_hollows import random_hollow, wall_with
from campaigns.engine import Campaign, Judged
from campaigns.judges.textbook_tracer import legendre_functions, outgoing_angles

POLYGONS, WALLS, TOLERANCE, FRACTION = 20, 48, 1e-3, 0.3
# Logarithm of the judge's number of rays, number of blocks whose spread gives the error, and degrees of its matrices.
LOG_RAYS, BLOCKS, DEGREES = 18, 8, (16, 32, 64)
# Angles, refinement between angles, and entry points of the straight rays; a step, and the rotation that shows a curve.
ANGLES, BETWEEN, POINTS, STEP, TURN = 512, 3, 256, 1e-5, 1e-12
EXCESSES = (0.003, 0.006, 0.012, 0.02, 0.03, 0.05, 0.1)
SIGMAS = 4.0
# Increase of the largest eigenvalues of 64 x 64 matrices by sampling noise; error of the edge's grid and entry points.
NOISE_OF_SIZE, EDGE_NOISE = 3e-3, 6e-3
# Eigenvalues off the constants and their error: for the focusing arc by a second method, else by theorems.
ARC, ARC_VALUE, ARC_ERROR = ker.CircularArcLaw(1.2), 0.3670253152, 3e-10
KNOWN = {
    "focusing arc, 1.2": (ARC, (ARC_VALUE,), ARC_ERROR),
    "focusing arc, 1.2, squared": (ARC**2, (ARC_VALUE**2,), ARC_ERROR),
    "Henyey-Greenstein, .9": (ker.henyey_greenstein(0.9), (0.9, 0.81, 0.729), 0.0),
    "half Lambertian, half arc": (0.5 * ker.lambertian() + 0.5 * ARC, (0.5 * ARC_VALUE,), ARC_ERROR),
}
Case = tuple[int, geo.Wall]
# Largest values of the judge's matrices by degree, with the error of the last; bounds of the edge.
Reference, Edge = tuple[Floats, float], tuple[float, float]


def first_valid(seed: int, number: int, attempt: Callable[[np.random.Generator], geo.Wall]) -> geo.Wall:
    rng = np.random.default_rng([seed, number])
    while True:
        try:
            return attempt(rng)
        except InputError:
            continue


def island_wall(number: int) -> geo.Wall:
    """A random curved wall with an island in its hollow, alternately a polygon and an ellipse."""

    def attempt(rng: np.random.Generator) -> geo.Wall:
        wall = random_curved_wall(int(rng.integers(COUNT)))
        x, y, r = rng.uniform(0.25, 0.75), -rng.uniform(0.1, 0.6), rng.uniform(0.03, 0.12)
        if number % 2:
            island = [geo.Arc((x, y), (r, r * float(rng.uniform(0.6, 1.5))), 0.0, -2.0 * np.pi)]
        else:
            corners = 3 + number % 3
            turn = -(np.arange(corners) + rng.uniform(0.0, 0.9)) * 2.0 * np.pi / corners
            points = [(float(x + r * np.cos(t)), float(y + r * np.sin(t))) for t in turn]
            island = [geo.Segment(a, b) for a, b in zip(points, points[1:] + points[:1], strict=True)]
        return geo.Wall(wall.pieces, wall.period, islands=[island])

    return first_valid(20261122, number, attempt)


def mirrored_wall(number: int) -> geo.Wall:
    """A random wall of two curves that are mirror images of each other, with or without a segment between them."""

    def attempt(rng: np.random.Generator) -> geo.Wall:
        x, y = rng.uniform(0.2, 0.45), -rng.uniform(0.1, 0.7)
        bend = rng.uniform(-0.3, 0.3, 2)
        end = x if number % 2 else 0.5
        left = [(0.0, 0.0), (0.3 * end, y * (0.3 + bend[0])), (0.7 * end, y * (0.7 + bend[1])), (end, y)]
        between = [geo.Segment((end, y), (1.0 - end, y))] if number % 2 else []
        return geo.Wall([geo.Bezier(left), *between, geo.Bezier([(1.0 - px, py) for px, py in reversed(left)])])

    return first_valid(20261123, number, attempt)


def draw(number: int) -> Case:
    """Of six walls three are mixed, two have islands and one is mirror-symmetric."""
    group, k = divmod(number, 6)
    if k < 3:
        return number, random_curved_wall(3 * group + k)
    return number, island_wall(2 * group + k - 3) if k < 5 else mirrored_wall(group)


def rays_out(wall: geo.Wall, fraction: Floats, theta: Floats) -> Floats:
    """Outgoing angles for entry points in fractions of the period; lost rays are retroreflected by convention."""
    out = outgoing_angles(wall, fraction * wall.period, theta)
    return np.where(np.isnan(out), theta, out)


def matrices(wall: geo.Wall) -> Floats:
    """<e_i, P e_j> off the constants, from each block of rays, shape (blocks, degree, degree)."""
    found = []
    for block in range(BLOCKS):
        points = Sobol(2, rng=np.random.default_rng(block)).random(2**LOG_RAYS // BLOCKS)
        fraction, u = points.T.clip(1e-12, 1 - 1e-12)
        theta = np.arccos(1.0 - 2.0 * u)
        here, there = (legendre_functions(x, DEGREES[-1] - 1) for x in (theta, rays_out(wall, fraction, theta)))
        found.append(here.T @ there / fraction.size)
    return np.array(found)


def straight_edge(wall: geo.Wall) -> Edge:
    """Bounds of the largest spectral value of Q, the part of the law that straight pieces produce.

    The lower bound is from a matrix that interpolates between angles. The upper bound (Collatz and Wielandt) is the
    supremum of Q f / f, since Q is positive and f > 0; f is (1 - Q/s)^-1 1 by the matrix, for the best of several s.
    """
    theta = _angles(ANGLES)
    out, unrotated = _straight_rays(wall, theta)
    low, fraction = _interpolation(out)
    matrix = np.zeros((ANGLES, ANGLES))
    row = np.repeat(np.arange(ANGLES), POINTS).reshape(out.shape)
    np.add.at(matrix, (row[unrotated], low[unrotated]), (1.0 - fraction)[unrotated] / POINTS)
    np.add.at(matrix, (row[unrotated], low[unrotated] + 1), fraction[unrotated] / POINTS)
    root = np.sqrt(np.sin(theta))
    even = root[:, None] * matrix / root
    below = float(np.linalg.eigvalsh(0.5 * (even + even.T))[-1])
    between = _angles(BETWEEN * ANGLES)
    out, unrotated = _straight_rays(wall, between)
    above = float(unrotated.mean(axis=1).max())
    for excess in EXCESSES:
        function = np.linalg.solve(np.eye(ANGLES) - matrix / (below * (1.0 + excess) + 1e-9), np.ones(ANGLES))
        if function.min() >= 1.0:
            there, here = (
                (1 - weight) * function[low] + weight * function[low + 1]
                for low, weight in map(_interpolation, (out, between))
            )
            above = min(above, float((np.where(unrotated, there, 0.0).mean(axis=1) / here).max()))
    return below, above


def _angles(number: int) -> Floats:
    return np.pi * (np.arange(number) + 0.5) / number


def _straight_rays(wall: geo.Wall, theta: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Outgoing angles, shape (angles, entry points), and a mask of the rays that a step does not rotate."""
    shift = np.random.default_rng(1).random((theta.size, 1))
    fraction = np.clip((np.arange(POINTS) + shift) / POINTS, 1e-9, 1.0 - 2.0 * STEP)
    angle = np.repeat(theta, POINTS)
    out, beside = (rays_out(wall, fraction.ravel() + step, angle).reshape(fraction.shape) for step in (0.0, STEP))
    return out, np.abs(out - beside) <= TURN


def _interpolation(angle: Floats) -> tuple[NDArray[np.intp], Floats]:
    """The grid index below every angle, and the weight of the next index."""
    position = np.clip(angle * ANGLES / np.pi - 0.5, 0.0, ANGLES - 1.0)
    low = np.minimum(position.astype(np.intp), ANGLES - 2)
    return low, position - low


def reference(matrices: Floats, norm: bool = False) -> Reference:
    """From the symmetric parts, or from the largest singular values."""

    def top(matrix: Floats, degree: int) -> float:
        part = matrix[: degree - 1, : degree - 1]
        return float(np.linalg.svd(part)[1][0] if norm else np.linalg.eigvalsh(0.5 * (part + part.T))[-1])

    spread = np.std([top(matrix, DEGREES[0]) for matrix in matrices], ddof=1) / np.sqrt(BLOCKS)
    return np.array([top(matrices.mean(axis=0), degree) for degree in DEGREES]), SIGMAS * float(spread)


def refutation(gap: spec.SpectralGap, known: Reference, edge: Edge) -> str:
    """The error found by the judge, or an empty string."""
    top, (tops, noise) = 1.0 - gap.value, known
    change = abs(tops[-1] - tops[-2])
    if gap.verdict == "no gap":
        return "a curved wall has a gap"
    if tops[-1] - noise > top + gap.error + NOISE_OF_SIZE:
        return f"gap {gap.value:.5f}, the judge has 1 - {tops[-1]:.5f}"
    if gap.verdict == "isolated" and top - gap.error > tops[-1] + 2.0 * change + noise + NOISE_OF_SIZE:
        return f"gap {gap.value:.5f}, the judge leads to 1 - {tops[-1]:.5f} - {change:.5f}"
    if gap.verdict == "essential edge" and not edge[0] - EDGE_NOISE <= top <= edge[1] + EDGE_NOISE:
        return f"edge {top:.4f}, the judge's is in {edge[0]:.4f} to {edge[1]:.4f}"
    return ""


def judge(case: Case, tolerance: float = TOLERANCE) -> Iterator[Judged]:
    """The gap of the wall's law in both conventions; of every fourth law also of a mixture and of the square."""
    number, wall = case
    law, rest, rays, (low, high) = ker.WallLaw(wall), 1.0 - FRACTION, matrices(wall), straight_edge(wall)

    def judged(kind: str, law: ker.Law, known: Callable[[bool], Reference], edge: Edge) -> Judged:
        gap = spec.spectral_gap(law, tolerance)
        return Judged(kind, gap.error, fault=refutation(gap, known(not gap.self_adjoint), edge), outcome=gap.verdict)

    yield judged("wall", law, partial(reference, rays), (low, high))
    signs = (-1.0) ** np.arange(1, DEGREES[-1])
    yield judged("specular", law.in_specular_frame(), partial(reference, rays * signs), (low, high))
    if number % 4 == 0:
        mixed = FRACTION * ker.lambertian() + rest * law
        yield judged("Lambertian fraction", mixed, partial(reference, rest * rays), (rest * low, rest * high))
        tops, error = reference(rays, norm=True)
        yield judged("squared", law**2, lambda _: (tops**2, 2.0 * error), (low**2, high**2))


def judge_polygon(law: ker.Law) -> Iterator[Judged]:
    """Theorems on polygons and laws made from them."""
    mixed = FRACTION * ker.lambertian() + (1.0 - FRACTION) * law
    for kind, each, value in (
        ("paper", law, 0.0), ("specular", law.in_specular_frame(), 0.0), ("squared", law**2, 0.0),
        ("Lambertian fraction", mixed, FRACTION), ("Lambertian, specular", mixed.in_specular_frame(), FRACTION),
    ):  # fmt: skip
        gap, verdict = spec.spectral_gap(each), "no gap" if value == 0.0 else "essential edge"
        fault = "" if gap.verdict == verdict else f"{gap.verdict} instead of {verdict}"
        yield Judged(kind, gap.error + 1e-15, abs(gap.value - value), fault=fault, outcome=gap.verdict)


def judge_known(name: str) -> Iterator[Judged]:
    """Each known eigenvalue to several tolerances."""
    law, values, error = KNOWN[name]
    for tolerance in (1e-3, 1e-5, 1e-7, 1e-9):
        found = spec.spectrum(law, 4, tolerance=tolerance)
        for value in values:
            nearest = int(np.argmin(np.abs(found.values - value)))
            true = abs(float(found.values[nearest]) - value)
            yield Judged(name, float(found.errors.total()[nearest]), true, error)


CAMPAIGNS = (
    Campaign("verdicts", "Are gap and verdict of random walls right?", draw, judge, WALLS, [18]),
    Campaign(
        "polygon-gaps", "Do polygons have the gaps that theorems give them?",
        lambda number: ker.WallLaw(geo.Wall.from_vertices(wall_with(random_hollow(number)))), judge_polygon,
        POLYGONS, range(2),
    ),
    Campaign(
        "known-spectra", "Do errors of eigenvalues of known laws hold?", lambda number: list(KNOWN)[number],
        judge_known, len(KNOWN), [2],
    ),
)  # fmt: skip
