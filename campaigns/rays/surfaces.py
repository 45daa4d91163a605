"""Rays on height maps: aimed where rounding decides, beside a tracer in 50 digits, and what all rays together keep."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy import stats

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.surfaces.surface import Surface
from campaigns.engine import Campaign, Judged
from campaigns.judges.precise_surface import follow

KINDS = ("vertices", "edges", "diagonals", "seams", "quarters", "random")
WAYS = ("vertical", "dyadic", "grazing", "cosine", "along x")
AIMED, JUDGED, CHECKED, SEEDS = 25_000, 100, 200_000, 60
# Cells of the squared tangential speed and of the azimuth for tests of reciprocity and of the cosine law, and the
# probability below which such a test fails: of 100 maps and three tests none by chance.
CELLS, TURNS, LEAST = 4, 4, 1e-6


def random_map(number: int) -> Surface:
    """Maps in turn: noise, steep noise, integers, plateaus, cliffs, fields, grooves, pyramids of 45 degrees."""
    rng = np.random.default_rng([7, number])
    n, m = (int(one) for one in rng.integers(1, 17, 2))
    spacing = tuple(rng.uniform(0.5, 2.0, 2)) if number % 3 == 0 else (1.0, 1.0)
    kind = number % 8
    if kind == 4:
        return Surface(np.where(rng.random((n, m)) < 0.3, 10.0 ** rng.uniform(0.5, 2.0), 0.0), spacing)
    if kind == 5:
        return Surface.random(geo.HeightCorrelation(0.2), (16, 16), rms_slope=rng.uniform(0.1, 2.0), rng=rng)
    if kind == 7:
        return Surface(np.add.outer(np.arange(8) % 2, np.arange(8) % 2) / math.sqrt(2.0))
    heights = {
        0: rng.standard_normal((n, m)), 1: 6.0 * rng.standard_normal((n, m)),
        2: rng.integers(0, 3, (n, m)).astype(float), 3: np.kron(rng.integers(0, 2, (4, 4)), np.ones((3, 3))),
        6: rng.standard_normal((n, 1)),
    }[kind]  # fmt: skip
    return Surface(heights, spacing)


def cosine(n: int, rng: np.random.Generator) -> np.ndarray:
    """Incoming velocities of the cosine law."""
    radius, angle = np.sqrt(rng.random(n)), 2.0 * math.pi * rng.random(n)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), -np.sqrt(1.0 - radius**2)])


def aimed(surface: Surface, kind: str, way: str, n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Entry points at these places of the map, and velocities of this kind."""
    at = rng.integers(0, 64, (n, 2)).astype(float)
    free = rng.random(n)
    if kind == "seams":
        at *= surface.heights.shape
    if kind in ("edges", "diagonals"):
        at[:, 0] += free
    if kind == "diagonals":
        at[:, 1] += free
    if kind == "quarters":
        at += rng.integers(0, 4, (n, 2)) / 4.0
    if kind == "random":
        at += rng.random((n, 2))
    v = {
        "vertical": np.tile([0.0, 0.0, -1.0], (n, 1)),
        "dyadic": np.column_stack([rng.integers(-4, 5, (n, 2)) / 4.0, -rng.integers(1, 5, n) / 4.0]),
        "grazing": np.column_stack([rng.standard_normal((n, 2)), -(10.0 ** -rng.uniform(1.0, 2.5, n))]),
        "cosine": cosine(n, rng),
        "along x": np.column_stack([rng.choice([-1.0, 1.0], n), np.zeros(n), -rng.random(n) - 0.01]),
    }[way]
    # grazing rays on cliffs meet thousands of facets
    if way == "grazing" and surface.rms_slope > 5.0:
        at, v = at[: n // 50], v[: n // 50]
    return at * surface.spacing, v


def judge_aimed(case: tuple[Surface, str, str, int]) -> Iterator[Judged]:
    """No ray is lost but exactly level ones, none passes the surface, and speeds are kept."""
    surface, kind, way, number = case
    x, v = aimed(surface, kind, way, AIMED, np.random.default_rng([8, number]))
    found = surface.trace(x, v)
    size = np.linalg.norm(found.velocities, axis=1) / np.linalg.norm(v, axis=1)
    level = ~found.escaped & (found.velocities[:, 2] == 0.0)
    faults = {
        "not a number": ~(np.isfinite(found.points).all(axis=1) & np.isfinite(found.velocities).all(axis=1)),
        "lost": ~found.escaped & ~level,
        "passed without a bounce": found.collisions == 0,
        "does not rise": found.escaped & ~(found.velocities[:, 2] > 0.0),
        "another speed": ~(np.abs(size - 1.0) < 1e-11),
    }
    for words, wrong in faults.items():
        for k in np.flatnonzero(wrong)[:3]:
            yield Judged(f"{kind}, {way}", fault=f"{words}: from {x[k].tolist()}, {v[k].tolist()}")
    yield Judged(f"{kind}, {way}", number=len(x) - int(level.sum()))
    if level.any():
        yield Judged(f"{kind}, {way}", number=int(level.sum()), outcome="level")


def draw_aimed(number: int) -> tuple[Surface, str, str, int]:
    """Maps, places and ways in turn."""
    return random_map(number), KINDS[number % 6], WAYS[number // 6 % 5], number


def judge_precisely(case: tuple[Surface, int]) -> Iterator[Judged]:
    """Bounce counts are those of 50 digits, and velocities agree within the rounding that bounces amplify."""
    surface, number = case
    rng = np.random.default_rng([9, number])
    x, v = rng.random((JUDGED, 2)) * surface.periods, cosine(JUDGED, rng)
    found = surface.trace(x, v)
    # the points of the library's and the judge's ray may be on both sides of an edge, within rounding of it
    for k in range(JUDGED):
        _, _, along, hits = follow(surface.heights.tolist(), surface.spacing, x[k], v[k])
        true = max(abs(float(along[c]) - found.velocities[k, c]) for c in range(3))
        room = 1e-14 * (1.0 + surface.rms_slope) * 4.0 ** min(hits, 20)
        where = f"{hits} hits in 50 digits, {found.collisions[k]} found: from {x[k].tolist()}, {v[k].tolist()}"
        yield Judged("velocities", room, true, fault="" if hits == found.collisions[k] else where)


def judge_laws(case: tuple[Surface, int]) -> Iterator[Judged]:
    """Counts of pairs of cells are those of reversed pairs, and outgoing cells are even; a wrong reversal fails."""
    surface, number = case
    rng = np.random.default_rng([10, number])
    incoming = cosine(CHECKED, rng)
    out = ker.SurfaceLaw(surface, 0.3).sample(incoming, rng=rng)

    def cell(z: np.ndarray) -> np.ndarray:
        turn = np.floor((np.arctan2(z[:, 1], z[:, 0]) / (2.0 * math.pi) % 1.0) * TURNS).astype(int) % TURNS
        return np.minimum((CELLS * np.sum(z[:, :2] ** 2, axis=1)).astype(int), CELLS - 1) * TURNS + turn

    size = CELLS * TURNS
    pairs = np.bincount(cell(incoming) * size + cell(out), minlength=size * size).reshape(size, size)
    back = np.arange(size) // TURNS * TURNS + (np.arange(size) + TURNS // 2) % TURNS
    number_of = np.arange(size * size).reshape(size, size)
    even = np.bincount(cell(out), minlength=size)
    yield Judged("cosine law", fault=_unlikely("outgoing cells", float(stats.chisquare(even).pvalue)))
    # reversed: -v' to -v, where the sign is half a turn
    reversal = number_of.T[np.ix_(back, back)]
    yield Judged("reciprocity", fault=_unlikely("reciprocity", _symmetric(pairs, reversal)))
    # without the sign the pairs differ, if the map has no symmetry
    if _symmetric(pairs, number_of.T) < LEAST:
        yield Judged("transposed pairs", outcome="refuted")
    else:
        yield Judged("transposed pairs", outcome="not refuted")


def _symmetric(pairs: np.ndarray, image: np.ndarray) -> float:
    """The probability of differences as large as those of counts and of their images, if both are equally likely."""
    counts, numbers = pairs.ravel(), np.arange(pairs.size)
    once = (numbers < image.ravel()) & (counts + counts[image.ravel()] >= 10)
    first, second = counts[once], counts[image.ravel()[once]]
    return float(stats.chi2.sf(np.sum((first - second) ** 2 / (first + second)), max(first.size, 1)))


def _unlikely(what: str, probability: float) -> str:
    return f"{what}: probability {probability:.2g}" if probability < LEAST else ""


def judge_errors(case: tuple[Surface, int]) -> Iterator[Judged]:
    """Half widths of 95 % of matrices and of the tangential coefficient, for many seeds against many rays."""
    surface, number = case
    law, basis = ker.SurfaceLaw(surface), ker.Zernike(4)
    truth = ker.discretise(law, basis, samples=2**20, tolerance=0.0, rng=10_000 + number)
    for seed in range(SEEDS):
        found = ker.discretise(law, basis, samples=2**13, tolerance=0.0, rng=seed)
        true = float(np.linalg.norm(found.symmetric - truth.symmetric))
        yield Judged("matrix", found.error.value, true)
        entries = [one[1, 1] for one in found.replicates]
        wide = 2.365 * float(np.std(entries, ddof=1)) / math.sqrt(8.0)
        yield Judged("tangential entry", wide, abs(float(found.symmetric[1, 1] - truth.symmetric[1, 1])))


def judge_tables(case: tuple[Surface, int]) -> Iterator[Judged]:
    """Means of functions with slopes of 1 at most over draws of a table and of its law, and distribution functions."""
    surface, number = case
    law, rng = ker.SurfaceLaw(surface, 0.3 if number % 4 == 3 else "random"), np.random.default_rng([11, number])
    table, v = law.table(6, 7, 7, n_turn=6, tolerance=0.03, rng=number), cosine(CHECKED // 2, rng)
    ahead = v[:, :2] / np.linalg.norm(v[:, :2], axis=1)[:, None]
    draws = []
    for out in (table.sample(v, rng), law.sample(v, rng)):
        across = [np.sum(out[:, :2] * one, axis=1) for one in (ahead, ahead[:, ::-1] * [-1.0, 1.0])]
        distances = [np.linalg.norm(out - v * sign, axis=1) for sign in ([1.0, 1.0, -1.0], [-1.0, -1.0, -1.0])]
        draws.append(np.column_stack([out, *across, *distances]))
    means, noise = (draws[0] - draws[1]).mean(axis=0), 4.0 * (draws[0] - draws[1]).std(axis=0) / math.sqrt(len(v))
    worst = int(np.argmax(np.abs(means) - noise))
    yield Judged("mean values", table.error, abs(float(means[worst])), float(noise[worst]))
    far = 0.0
    for i, square in enumerate(table.square):
        down = np.array([math.sqrt(1.0 - square), 0.0, -math.sqrt(square)])
        own = np.sort(law.sample(np.tile(down, (CHECKED // 2, 1)), rng)[:, 2] ** 2)
        p, q = table.probability[1:-1], table.quantile[i, 0, 1:-1]
        low, high = (np.searchsorted(own, q + side * 1e-9) / own.size for side in (-1.0, 1.0))
        far = max(far, float((low - p).max()), float((p - high).max()))
    yield Judged("distribution functions", table.distribution_error, far, math.sqrt(math.log(240.0) / CHECKED))


def draw(number: int) -> tuple[Surface, int]:
    """A map and its number."""
    return random_map(number), number


CAMPAIGNS = (
    Campaign("surface-aimed", "Are rays lost at vertices, edges, seams and cliffs of height maps?",
             draw_aimed, judge_aimed, 400, (0, 7, 14)),
    Campaign("surface-precise", "Are rays on height maps those of 50 digits?", draw, judge_precisely, 100, (2,)),
    Campaign("surface-laws", "Do laws of surfaces keep the cosine law and reciprocity?", draw, judge_laws, 100, (0, 5)),
    Campaign("surface-errors", "Do errors of matrices of surfaces hold in 95 of 100 cases?",
             draw, judge_errors, 20, (0,), level=0.95),
    Campaign("surface-tables", "Do the errors of tables of surfaces hold?", draw, judge_tables, 80, (5,), level=0.95),
)  # fmt: skip
