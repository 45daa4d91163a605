"""Walls whose period begins anywhere and below y = 0, against the same walls begun at a highest point.

Every wall is made twice by the same numbers: as it is, and cut elsewhere and lowered. What depends on the law alone
must be the same. The plain tracer follows some rays in the coordinates of the rolled wall.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.checks import Floats
from asperity.errors import AccuracyError, WallError
from campaigns.cases.random_curved_walls import COUNT as CURVED
from campaigns.cases.random_curved_walls import random_curved_wall
from campaigns.cases.random_hollows import random_hollow, wall_with
from campaigns.engine import Campaign, Judged
from campaigns.judges.plain_tracer import PlainTracer

from .aimed_rays import WALLS

CASES, RAYS, JUDGED, DISKS, SPIKES = 200, 5_000, 20, 500, 2_000
# After more hits, rounding changes positions and angles too much for a comparison.
MOST_HITS = 200
# Allowed difference of angles; rounding grows along a ray, on bumps by up to a factor of ten at each hit.
SAME_ANGLE = 1e-6
# Allowed relative change of the energy of a disk: each contact ends with a Newton step to the norm of the velocity.
SAME_ENERGY = 1e-14
SCALE, SPACING = 1e-3, 2.0 * np.pi / 80
# Flatter rays pass too many cells for the plain tracer.
STEEP = 0.3
# The plain tracer is trusted if no hit is as near to an end of its piece, as a fraction of it, or as flat.
JOINT, FLAT = 1e-6, 1e-4


NAMED = (
    *WALLS.values(),
    geo.mushrooms(0.3, 0.4, 2),
    # a plate of no thickness over a cavity, one that stands in it, a cavity whose side touches the flat top
    geo.Wall.from_vertices([(0, 0), (0.7, 0), (0.2, 0), (0.2, -1), (1, -1), (1, 0)]),
    geo.Wall.from_vertices([(0, 0), (0, -1), (0.5, -1), (0.5, -0.2), (0.5, -1), (1, -1), (1, 0)]),
    geo.Wall.from_vertices([(0, 0), (0.3, 0), (0.5, -0.8), (0.4, -0.1), (0.3, 0), (0.9, 0), (1, -0.1), (1, 0)]),
    # a bump that touches the level with its top, between two sides, and a bowl
    geo.Wall([
        geo.Segment((0, 0), (0, -0.2)), geo.Arc((0.2, -0.2), 0.2, np.pi, 0.0), geo.Segment((0.4, -0.2), (0.4, 0)),
        geo.Arc((0.7, 0.0), 0.3, np.pi, 2.0 * np.pi),
    ]),
    geo.flat(),
)  # fmt: skip


def base_wall(number: int) -> geo.Wall:
    """Wall ``number``: the named ones, then curved and polygonal ones in turn."""
    if number < len(NAMED):
        return NAMED[number]
    number -= len(NAMED)
    if number % 2:
        return random_curved_wall(number // 2 % CURVED)
    return geo.Wall.from_vertices(wall_with(random_hollow(number // 2)))


@dataclass(frozen=True)
class Rolled:
    """A wall, and the same wall with the period begun at ``place`` = (x, y) of it and lowered by ``drop``."""

    wall: geo.Wall
    rolled: geo.Wall
    place: tuple[float, float]
    drop: float

    @property
    def shape(self) -> str:
        """The row of the table."""
        return f"{'polygon' if self.wall.is_polygonal else 'curved'}, {'lowered' if self.drop else 'rolled'}"

    @property
    def shift(self) -> tuple[float, float]:
        """What takes a point of the wall to that of the rolled one, up to periods."""
        return -self.place[0], -self.drop


def rolled_wall(number: int) -> Rolled:
    """Number ``number``, always the same: cut at a joint or inside a piece, lowered or not."""
    rng = np.random.default_rng([number, 16])
    wall = base_wall(number)
    pieces = list(wall.pieces)
    k = int(rng.integers(len(pieces)))
    after = [pieces[k]]
    before = []
    if rng.random() < 0.6:
        first, last = pieces[k].split(float(rng.uniform(0.05, 0.95)))
        before, after = [first], [last]
    x = after[0].start[0]
    drop = float(rng.choice([0.0, rng.uniform(0.01, 0.6) * wall.period]))
    moved = [piece.moved(-x, -drop) for piece in (*after, *pieces[k + 1 :])]
    moved += [piece.moved(wall.period - x, -drop) for piece in (*pieces[:k], *before)]
    return Rolled(wall, geo.Wall(moved, wall.period), (x, after[0].start[1]), drop)


def rays(one: Rolled, count: int, rng: np.random.Generator, least: float = 1e-3):
    """Entry points of rays and their angles, in the coordinates of the rolled wall, and where they enter the wall."""
    theta = np.arccos(1.0 - 2.0 * rng.random(count)).clip(least, np.pi - least)
    x = rng.uniform(-1.0, 2.0, count) * one.wall.period
    return x, theta, x - one.drop / np.tan(theta) - one.shift[0]


def draw(number: int) -> tuple[int, Rolled]:
    """A number for further draws, and a wall."""
    return number, rolled_wall(number)


def judge(case: tuple[int, Rolled]) -> Iterator[Judged]:
    """Rays, disks and properties of a rolled wall and its original."""
    number, one = case
    rng = np.random.default_rng([number, 17])
    for kind, others in (("rays", _other_rays(one, rng)), ("judged rays", _misjudged(one, rng)),
                         ("disks", _other_disks(one, rng))):  # fmt: skip
        for fault, count in ((f"{others.sum()} differ", others.sum()), ("", (~others).sum())):
            if count:
                yield Judged(f"{kind}, {one.shape}", fault=fault, number=int(count))
    yield Judged(f"properties, {one.shape}", fault="" if _same_properties(one) else "unlike")


def judge_matrices(case: tuple[int, Rolled]) -> Iterator[Judged]:
    """The distance of the matrices of both laws, to rounding and their errors."""
    one, basis, rng = case[1], ker.Legendre(8), np.random.default_rng(18)
    try:
        here, there = (
            ker.discretise(ker.WallLaw(wall), basis, tolerance=1e-3, samples=2**16, rng=rng)
            for wall in (one.wall, one.rolled)
        )
    except AccuracyError:
        return
    distance = float(np.linalg.norm(here.symmetric - there.symmetric))
    yield Judged(f"matrices, {one.shape}", float(here.error) + float(there.error) + 1e-12, distance)


def _other_rays(one: Rolled, rng: np.random.Generator) -> Floats:
    """Which rays end otherwise."""
    x, theta, entry = rays(one, RAYS, rng)
    here = geo.trace(one.wall, entry, theta, max_collisions=MOST_HITS)
    there = geo.trace(one.rolled, x, theta, max_collisions=MOST_HITS)
    out = here.escaped & there.escaped
    place = here.x + one.shift[0] + one.drop / np.tan(here.theta)
    size = 1.0 + np.abs(place) + one.drop / np.sin(np.where(out, here.theta, 1.0)) ** 2
    apart = np.abs(here.theta - there.theta) + np.abs(place - there.x) / size > SAME_ANGLE
    return np.where(out, apart | (here.collisions != there.collisions), here.escaped != there.escaped)


def _misjudged(one: Rolled, rng: np.random.Generator) -> Floats:
    """Which rays the plain tracer contradicts, of those that it can judge."""
    x, theta, _ = rays(one, JUDGED, rng, STEEP)
    traced, wrong = geo.trace(one.rolled, x, theta, max_collisions=MOST_HITS), []
    tracer = PlainTracer(one.rolled)
    for i in np.flatnonzero(traced.escaped):
        ray = tracer.trace(float(x[i]), float(theta[i]))
        if ray.from_joint >= JOINT and ray.incidence >= FLAT:
            allowed = SAME_ANGLE * (1.0 + one.drop / np.sin(ray.theta) ** 2)
            same = abs(ray.x - traced.x[i]) <= allowed and abs(ray.theta - traced.theta[i]) <= SAME_ANGLE
            wrong.append(not (same and ray.hits == traced.collisions[i]))
    return np.array(wrong, dtype=bool)


def _other_disks(one: Rolled, rng: np.random.Generator) -> Floats:
    """Which disks end otherwise and do not say that they may, or with another energy; none over Bezier pieces."""
    if any(isinstance(piece, geo.Bezier) for piece in one.wall.pieces):
        return np.zeros(0, dtype=bool)
    scale = SCALE / max(one.rolled.depth, one.rolled.period)
    velocity = rng.normal(size=(DISKS, 3))
    velocity[:, 1] = -np.abs(velocity[:, 1]) - 0.1
    position = rng.random((DISKS, 2)) * [scale * one.wall.period, SPACING]
    flight = scale * one.drop / -velocity[:, 1]
    start = position + flight[:, None] * velocity[:, [0, 2]] - [scale * one.shift[0], 0.0]
    limit = {"spacing": SPACING, "max_contacts": MOST_HITS}
    disk = geo.Disk()
    here = geo.collide(disk, one.wall, scale, start, velocity, **limit)
    there = geo.collide(disk, one.rolled, scale, position, velocity, **limit)
    out = here.escaped & there.escaped
    climb = scale * one.drop / np.where(out, here.velocity[:, 1], 1.0)
    place = here.position + [scale * one.shift[0], 0.0] + climb[:, None] * here.velocity[:, [0, 2]]
    apart = np.abs(here.velocity - there.velocity).max(axis=1) > SAME_ANGLE
    apart |= np.abs(place - there.position).max(axis=1) > SAME_ANGLE * (1.0 + climb / here.velocity[:, 1])
    # the status says on both walls that rounding decides the path, never the energy
    amplified = (here.status == geo.DiskStatus.AMPLIFIED) & (there.status == geo.DiskStatus.AMPLIFIED)
    energies = [disk.inner(end, end) / disk.inner(velocity, velocity) for end in (here.velocity, there.velocity)]
    lost = np.abs(np.array(energies) - 1.0).max(axis=0) > SAME_ENERGY
    return lost | ~amplified & np.where(out, apart | (here.contacts != there.contacts), here.escaped != there.escaped)


def _same_properties(one: Rolled) -> bool:
    """Whether both walls have the same closing, symmetry, length, openings and flat tops."""
    wall, rolled = one.wall, one.rolled
    widths = [sorted(hollow.width for hollow in each.hollows) for each in (wall, rolled)]
    return (
        wall.closes == rolled.closes
        and wall.is_mirror_symmetric == rolled.is_mirror_symmetric
        and len(widths[0]) == len(widths[1])
        and bool(np.allclose(*widths, rtol=0.0, atol=1e-13 * wall.period))
        and abs(wall.flat_top - rolled.flat_top) <= 1e-13 * wall.period
        and abs(wall.arc_length - rolled.arc_length) <= 1e-12 * wall.arc_length
        and abs(wall.cell.depth - rolled.cell.depth) <= 1e-13 * max(wall.period, wall.depth)
    )


def spiked_path(number: int) -> tuple[np.ndarray, bool]:
    """Vertices of a graph below y = 0 with a spike of no width on one of its edges, and whether it goes up.

    A spike that goes up from a graph stands in free space, a plate; one that goes down is a slit in the solid. Half of
    them come back by a point between that is off the line by rounding.
    """
    rng = np.random.default_rng([number, 19])
    count = int(rng.integers(2, 8))
    x = np.concatenate([[0.0], np.sort(rng.uniform(0.05, 0.95, count)), [1.0]])
    y = -rng.uniform(0.3, 1.0, count + 2)
    y[0] = y[-1] = -rng.uniform(0.3, 1.0)
    edge = int(rng.integers(count + 1))
    fraction = float(rng.uniform(0.1, 0.9)) if rng.random() < 0.7 else 0.0
    start = np.array([x[edge], y[edge]])
    foot = start + fraction * (np.array([x[edge + 1], y[edge + 1]]) - start)
    upward = bool(rng.random() < 0.5)
    height = float(rng.uniform(0.01, 0.25)) * (1.0 if upward else -1.0)
    # steeper than every edge: it leaves the graph on one side
    steepest = np.abs(np.diff(y) / np.diff(x)).max()
    aside = height * float(rng.uniform(-0.5, 0.5)) / steepest if 0 < edge < count else 0.0
    tip = foot + np.array([aside, height])
    middle = foot + float(rng.uniform(0.2, 0.8)) * (tip - foot)
    spike = [tip, middle, foot] if rng.random() < 0.5 else [tip, foot]
    before = [foot] if fraction > 0.0 else []
    left, right = np.column_stack([x, y])[: edge + 1], np.column_stack([x, y])[edge + 1 :]
    return np.vstack([left, *([p] for p in (*before, *spike)), right]), upward


def is_taken_rightly(number: int) -> bool:
    """Whether a path whose spike is a plate is accepted with its depth and length, and any other spike is refused."""
    vertices, is_plate = spiked_path(number)
    try:
        wall = geo.Wall.from_vertices(vertices)
    except WallError as reason:
        return not is_plate and "zero width" in str(reason)
    length = float(np.hypot(*np.diff(vertices, axis=0).T).sum())
    return is_plate and abs(wall.arc_length - length) < 1e-13 and wall.depth == -vertices[:, 1].min()


def judge_spike(number: int) -> Iterator[Judged]:
    """Whether a path is taken rightly."""
    yield Judged("paths with a spike", fault="" if is_taken_rightly(number) else "taken wrongly")


CAMPAIGNS = (
    Campaign("rolled-walls", "Does the start of the period matter?", draw, judge, CASES, range(28)),
    Campaign(
        "rolled-matrices", "Are matrices of rolled walls those of the wall?", draw, judge_matrices, CASES,
        [0, 3, 6, 15, 16],
    ),
    Campaign("spikes", "Are plates accepted and slits refused?", int, judge_spike, SPIKES, range(120)),
)  # fmt: skip
