"""Random curved and mixed walls, the same for ever: segments, circular and elliptic arcs, Bezier pieces, cusps."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from asperity import geometry as geo
from asperity.errors import InputError
from asperity.geometry import Arc, Bezier, Segment

COUNT = 24


def arc_over(start, end, sagitta, stretch=1.0):
    """The arc from start to end whose height over the chord is ``sagitta`` chords, to the right of the way (wall
    side) if positive, as seen after y was divided by ``stretch``."""
    (x0, y0), (x1, y1) = start, end
    y0, y1 = y0 / stretch, y1 / stretch
    chord = math.hypot(x1 - x0, y1 - y0)
    h = sagitta * chord
    radius = (0.25 * chord**2 + h**2) / (2.0 * abs(h))
    # the centre lies beyond the chord from the bulge
    tx, ty = (x1 - x0) / chord, (y1 - y0) / chord
    nx, ny = ty, -tx
    side = math.copysign(1.0, h)
    cx = 0.5 * (x0 + x1) + nx * side * (abs(h) - radius)
    cy = 0.5 * (y0 + y1) + ny * side * (abs(h) - radius)
    first, last = math.atan2(y0 - cy, x0 - cx), math.atan2(y1 - cy, x1 - cx)
    while side > 0 and last < first:
        last += 2.0 * math.pi
    while side < 0 and last > first:
        last -= 2.0 * math.pi
    arc = Arc((cx, cy * stretch), radius if stretch == 1.0 else (radius, radius * stretch), first, last)
    return arc.pinned(start, end)


def _bezier(start, end, rng):
    (x0, y0), (x1, y1) = start, end
    nx, ny = y1 - y0, x0 - x1
    points = [start]
    for fraction in (1 / 3, 2 / 3):
        off = rng.uniform(-0.35, 0.35)
        points.append((x0 + fraction * (x1 - x0) + off * nx, y0 + fraction * (y1 - y0) + off * ny))
    return Bezier([*points, end])


def _cusp(rng):
    """Two arcs that bulge into the hollow and touch tangentially, or nearly, at its bottom."""
    radius = float(rng.uniform(0.5, 1.2))
    x = 0.5
    y = -math.sqrt(radius**2 - (radius - x) ** 2)
    left = Arc((0.5 - radius, y), radius, math.acos(min(1.0, (radius - 0.5) / radius)), 0.0)
    left = left.pinned((0.0, 0.0), (x, y))
    right = Arc((0.5 + radius, y), radius, math.pi, math.pi - math.acos(min(1.0, (radius - 0.5) / radius)))
    return [left, right.pinned((x, y), (1.0, 0.0))]


def _attempt(kind, rng):
    if kind % 8 == 7:
        return geo.Wall(_cusp(rng))
    number = int(rng.integers(1, 4))
    inner = np.sort(rng.uniform(0.1, 0.9, number))
    joints = [(0.0, 0.0), *((float(x), -float(rng.uniform(0.1, 0.9))) for x in inner), (1.0, 0.0)]
    pieces = []
    for place, (start, end) in enumerate(pairwise(joints)):
        what = (kind + place) % 4 if place == 0 else int(rng.integers(0, 4))
        if what == 0:
            pieces.append(arc_over(start, end, float(rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.35))))
        elif what == 1:
            stretch = float(rng.uniform(0.6, 1.7))
            pieces.append(arc_over(start, end, float(rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 0.3)), stretch))
        elif what == 2:
            pieces.append(_bezier(start, end, rng))
        else:
            pieces.append(Segment(start, end))
    if all(isinstance(piece, Segment) for piece in pieces):
        raise InputError("not curved")
    if kind % 3 == 0:
        pieces.append(Segment((1.0, 0.0), (1.25, 0.0)))
    return geo.Wall(pieces, period=1.25 if kind % 3 == 0 else 1.0)


def random_curved_wall(kind: int, seed: int = 20261121) -> geo.Wall:
    """Wall number ``kind`` of COUNT, or of another seed: the first valid attempt of its own fixed generator."""
    rng = np.random.default_rng([seed, kind])
    while True:
        try:
            return _attempt(kind, rng)
        except InputError:
            continue
