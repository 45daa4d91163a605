"""Walls whose period begins anywhere, and below y = 0: walls that begin at a highest point, cut elsewhere and lowered.

Every wall is made twice by the same numbers: as it is, and rolled. What depends on the law alone must be the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from campaigns.judges.random_curved_walls import COUNT as CURVED
from campaigns.judges.random_curved_walls import random_curved_wall
from campaigns.judges.random_hollows import random_hollow, wall_with

from asperity import geometry as geo
from asperity.geometry import Arc, Bezier, Segment


def _polygon(*corners):
    return geo.Wall.from_vertices(np.array(corners, dtype=float))


def _lens():
    """A bump that touches the level with its top, between two sides, and a bowl."""
    bump, bowl = Arc((0.2, -0.2), 0.2, np.pi, 0.0), Arc((0.7, 0.0), 0.3, np.pi, 2.0 * np.pi)
    return geo.Wall([Segment((0, 0), (0, -0.2)), bump, Segment((0.4, -0.2), (0.4, 0)), bowl])


NAMED = (
    lambda: geo.triangular_teeth(0.7),
    lambda: geo.focusing_arcs(1.2),
    lambda: geo.mushrooms(0.3, 0.4),
    lambda: geo.rectangular_teeth(1.5),
    lambda: geo.dispersing_arcs(1.3),
    lambda: geo.double_parabola(),
    lambda: geo.koch(2),
    lambda: geo.mushrooms(0.3, 0.4, 2),
    # a plate of no thickness over a cavity, one that stands in it, a cavity whose side touches the flat top
    lambda: _polygon((0, 0), (0.7, 0), (0.2, 0), (0.2, -1), (1, -1), (1, 0)),
    lambda: _polygon((0, 0), (0, -1), (0.5, -1), (0.5, -0.2), (0.5, -1), (1, -1), (1, 0)),
    lambda: _polygon((0, 0), (0.3, 0), (0.5, -0.8), (0.4, -0.1), (0.3, 0), (0.9, 0), (1, -0.1), (1, 0)),
    _lens,
    lambda: geo.elliptical_arcs(0.9, geo.Disk(1.0, 0.5)),
    lambda: geo.flat(),
)


def base_wall(number: int) -> geo.Wall:
    """Wall ``number``: the named ones, then curved and polygonal ones in turn."""
    if number < len(NAMED):
        return NAMED[number]()
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


def textbook_exit(wall: geo.Wall, x: float, theta: float, cells: int = 6, most_hits: int = 400):
    """A ray through the pieces of a wall as they were given, cell by cell, in 2x2 systems and polynomial roots.

    Nothing is known here of highest points, shifts or hollows: the ray flies until it is above all pieces. Returns x'
    at y = 0, theta' and the number of hits, or None where it comes too near to a joint or a tangency to be sure.
    """
    copies = [(piece, k * wall.period) for piece in wall.pieces for k in range(-cells, cells + 1)]
    top = max(piece.box[3] for piece in wall.pieces)
    p, v = np.array([x, 0.0]), np.array([-np.cos(theta), -np.sin(theta)])
    own = None
    for hits in range(most_hits):
        found = []
        for number, (piece, shift) in enumerate(copies):
            for t, s, normal in _meetings(piece, p - (shift, 0.0), v):
                # at once it meets the piece that it has left, or the back of a plate of no thickness
                if t > (1e-9 if hits else -1e-12) and float(normal @ v) < 0.0 and not (number == own and t < 1e-7):
                    found.append((t, s, number, normal))
        found.sort(key=lambda hit: hit[0])
        if not found:
            if v[1] <= 0.0:
                return None
            return p[0] - p[1] / v[1] * v[0], float(np.arctan2(v[1], v[0])), hits
        t, s, own, normal = found[0]
        if v[1] > 0.0 and p[1] + t * v[1] > top + 1e-9:
            return None
        if min(s, 1.0 - s) < 1e-6 or abs(float(normal @ v)) < 1e-4:
            return None
        p = p + t * v
        v = v - 2.0 * float(normal @ v) * normal
        v /= np.hypot(*v)
    return None


def _meetings(piece, p, v):
    """(t, fraction, unit normal to the free side) of every meeting of a line with a piece."""
    if isinstance(piece, Segment):
        a, e = np.array(piece.start), np.array(piece.end) - piece.start
        det = e[0] * v[1] - e[1] * v[0]
        if det == 0.0:
            return []
        r = p - a
        s, t = (r[0] * v[1] - r[1] * v[0]) / det, (r[0] * e[1] - r[1] * e[0]) / det
        return [(t, s, np.array([-e[1], e[0]]) / np.hypot(*e))] if -1e-9 <= s <= 1.0 + 1e-9 else []
    if isinstance(piece, Arc):
        c, axes = np.array(piece.center), np.array(piece.semi_axes)
        q, w = (p - c) / axes, v / axes
        roots = np.roots([w @ w, 2.0 * q @ w, q @ q - 1.0])
        low, high = sorted((piece.start_angle, piece.end_angle))
        out = []
        for t in roots[np.isreal(roots)].real:
            u = q + t * w
            turn = np.arctan2(u[1], u[0])
            turn += 2.0 * np.pi * np.ceil((low - turn - 1e-9) / (2.0 * np.pi))
            if turn <= high + 1e-9:
                normal = -piece.direction * u / axes
                out.append((float(t), float((turn - low) / (high - low)), normal / np.hypot(*normal)))
        return out
    assert isinstance(piece, Bezier)
    control = np.array(piece.control_points) - p
    cross = control[:, 0] * v[1] - control[:, 1] * v[0]
    if len(cross) == 3:
        polynomial = [cross[0] - 2 * cross[1] + cross[2], 2 * (cross[1] - cross[0]), cross[0]]
    else:
        polynomial = [
            cross[3] - 3 * cross[2] + 3 * cross[1] - cross[0],
            3 * (cross[2] - 2 * cross[1] + cross[0]),
            3 * (cross[1] - cross[0]),
            cross[0],
        ]
    out = []
    roots = np.roots(polynomial)
    for s in roots[np.abs(roots.imag) < 1e-9].real:
        if -1e-9 <= s <= 1.0 + 1e-9:
            s = min(max(float(s), 0.0), 1.0)
            tangent = piece.tangent(s)
            out.append((float((piece.point(s) - p) @ v), s, np.array([-tangent[1], tangent[0]])))
    return out


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
