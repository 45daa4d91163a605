"""Walls whose sides and curves are cut at points where nothing changes, against the walls as they were.

A wall depends on where it runs, not on the joints along it: pieces, rays, matrices and their errors are compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.checks import Floats
from asperity.errors import AccuracyError
from asperity.geometry.curves.curve import Curve
from campaigns.engine import Campaign, Judged

from .rolled_walls import MOST_HITS, base_wall

CASES, RAYS, MOST_PARTS = 200, 5_000, 7
# Allowed difference of angles and positions, and its growth: at a bump by up to a factor of ten at each hit.
SAME_ANGLE, GROWTH, ROUNDING = 1e-8, 10.0, 1e-15
# Errors of matrices that are equal up to rounding, which rounding alone decides.
ROUNDED = 1e-11


@dataclass(frozen=True)
class Cut:
    """A wall, and the same wall with its pieces cut."""

    number: int
    wall: geo.Wall
    cut: geo.Wall

    @property
    def shape(self) -> str:
        """The row of the table."""
        if self.wall.islands:
            return "islands"
        return "polygon" if self.wall.is_polygonal else "curved"


def with_island(number: int) -> geo.Wall:
    """A box with an island: a polygon, a circle or an ellipse."""
    rng = np.random.default_rng([number, 21])
    floor = [(0, 0), (0, -1), (1, -1), (1, 0)]
    turns = np.sort(rng.random(3 + number % 4))[::-1] * 2.0 * np.pi
    points = [(0.5 + 0.3 * np.cos(t), -0.5 + 0.3 * np.sin(t)) for t in turns.tolist()]
    loop: list[Curve] = [geo.Segment(p, q) for p, q in pairwise([*points, points[0]])]
    if number % 2:
        loop = [geo.Arc((0.5, -0.5), (0.3, float(rng.uniform(0.1, 0.4))), turns[0], turns[0] - 2.0 * np.pi)]
    return geo.Wall([geo.Segment(p, q) for p, q in pairwise(floor)], islands=[loop])


def parts_of(piece: Curve, rng: np.random.Generator) -> list[Curve]:
    """A piece cut at random points, an arc also into arcs of its ellipse as a user writes them."""
    at = np.concatenate([[0.0], np.sort(rng.uniform(0.02, 0.98, rng.integers(MOST_PARTS))), [1.0]])
    if isinstance(piece, geo.Arc) and rng.random() < 0.5:
        angles = piece.start_angle + at * (piece.end_angle - piece.start_angle)
        return [geo.Arc(piece.center, piece.semi_axes, *pair) for pair in pairwise(angles.tolist())]
    parts, rest = [], piece
    for before, here in pairwise(at[:-1].tolist()):
        first, rest = rest.split((here - before) / (1.0 - before))
        parts.append(first)
    return [*parts, rest]


def draw(number: int) -> Cut:
    """Number ``number``, always the same."""
    rng = np.random.default_rng([number, 20])
    wall = with_island(number) if number % 5 == 4 else base_wall(number)
    path, *islands = (
        [part for piece in loop for part in parts_of(piece, rng)] for loop in (wall.pieces, *wall.islands)
    )
    return Cut(number, wall, geo.Wall(path, wall.period, islands))


def judge(one: Cut) -> Iterator[Judged]:
    """Pieces and rays of a cut wall and its original."""
    paths = [
        (*wall.cell.pieces, *(piece for loop in wall.cell.islands for piece in loop)) for wall in (one.wall, one.cut)
    ]
    # the control points of the whole curve follow from those of a short part with large rounding errors
    kinds = [[type(piece) for piece in path if not isinstance(piece, geo.Bezier)] for path in paths]
    fault = "" if kinds[0] == kinds[1] else f"{len(paths[1])} for {len(paths[0])}"
    yield Judged(f"pieces, {one.shape}", fault=fault, outcome="joined" if len(paths[0]) == len(paths[1]) else "in part")
    others = _other_rays(one)
    for fault, count in ((f"{others.sum()} differ", others.sum()), ("", (~others).sum())):
        if count:
            yield Judged(f"rays, {one.shape}", fault=fault, number=int(count))


def _other_rays(one: Cut) -> Floats:
    """Which rays end otherwise."""
    rng = np.random.default_rng([one.number, 22])
    theta, x = np.arccos(1.0 - 2.0 * rng.random(RAYS)), rng.random(RAYS) * one.wall.period
    here, there = (geo.trace(wall, x, theta, max_collisions=MOST_HITS) for wall in (one.wall, one.cut))
    apart = np.maximum(np.abs(here.theta - there.theta), np.abs(here.x - there.x))
    hits = np.maximum(here.collisions, there.collisions)
    other = np.where(here.escaped & there.escaped, here.collisions != there.collisions, here.escaped != there.escaped)
    grown = ROUNDING * GROWTH ** np.minimum(hits, 300)
    return (other | (apart > SAME_ANGLE + grown)) & ~(grown >= 1.0)


def judge_matrices(one: Cut) -> Iterator[Judged]:
    """The distance of the matrices of both laws, and their errors."""
    basis = (ker.Bins(16), ker.Legendre(8))[one.number % 2]
    try:
        here, there = (
            ker.discretise(ker.WallLaw(wall), basis, tolerance=1e-4, samples=2**16, rng=23)
            for wall in (one.wall, one.cut)
        )
    except AccuracyError:
        return
    distance, errors = float(np.linalg.norm(here.symmetric - there.symmetric)), (float(here.error), float(there.error))
    yield Judged(f"matrices, {one.shape}", sum(errors) + 1e-12, distance)
    yield Judged(f"errors, {one.shape}", 2.0 * errors[0] + ROUNDED, errors[1])


CAMPAIGNS = (
    Campaign("cut-walls", "Do joints along a side matter?", draw, judge, CASES, range(20)),
    Campaign(
        "cut-matrices", "Are matrices of cut walls those of the wall?", draw, judge_matrices, CASES,
        [0, 2, 4, 6, 15],
    ),
)  # fmt: skip
