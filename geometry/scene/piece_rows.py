"""Pieces of a wall as rows of the tables of a scene, whose columns stand at the head of `scene`."""

from __future__ import annotations

from math import asin, cos, hypot, pi, sin
from typing import TYPE_CHECKING

import numpy as np

from ..curves.arc import Arc
from ..curves.bezier import Bezier
from ..curves.segment import Segment

if TYPE_CHECKING:
    from ..curves.curve import Curve, Point

# Tangents that agree to this angle make a smooth joint: a ray at the joint is then reflected alike by both pieces, up
# to this angle. Joints of arcs and splines that are meant to be smooth agree to a few rounding errors.
SMOOTH_JOINT = 1e-9
# Below this half angle the chord and the radius give it more exactly than the difference of two parameters does.
SHALLOW_ARC = 0.5


def hull_of(piece: Curve, start: Point, end: Point) -> list[Point]:
    """Four points whose convex hull contains the piece."""
    if isinstance(piece, Segment):
        return [start, end, start, end]
    if isinstance(piece, Bezier):
        return [start, *list(piece.control_points[1:-1])[:2], *[end] * (5 - len(piece.control_points))]
    x0, y0, x1, y1 = piece.box
    return [(x0, y0), (x0, y1), (x1, y0), (x1, y1)]


def corners_of(pieces: list[Curve]) -> list[bool]:
    """For every joint of the cycle of pieces (the first one again at the end): is it a corner?"""
    heads = np.array([_tangent(piece, 0.0) for piece in pieces])
    tails = np.roll(np.array([_tangent(piece, 1.0) for piece in pieces]), 1, axis=0)
    turn = np.abs(tails[:, 0] * heads[:, 1] - tails[:, 1] * heads[:, 0])
    corner = (turn > SMOOTH_JOINT) | (np.sum(tails * heads, axis=1) < 0.0)
    return [*map(bool, corner), bool(corner[0])]


def _tangent(piece: Curve, s: float) -> Point:
    if isinstance(piece, Segment):
        dx, dy = piece.end[0] - piece.start[0], piece.end[1] - piece.start[1]
        length = hypot(dx, dy)
        return dx / length, dy / length
    x, y = piece.tangent(s)
    return float(x), float(y)


def arc_row(arc: Arc, start: Point, end: Point) -> list[float]:
    """One row of ``circles`` or ``ellipses`` but for its flags."""
    a, b = arc.semi_axes
    stretch = a / b
    turn = arc.end_angle - arc.start_angle
    # anticlockwise arcs have their centre on the left, the free side: they focus
    sign = 1.0 if turn > 0.0 else -1.0
    chord = (end[0] - start[0], stretch * (end[1] - start[1]))
    length = hypot(*chord)
    direction = (chord[0] / length, chord[1] / length)
    half = 0.5 * abs(turn)
    # both joints lie on the circle exactly if sin(half) = kappa length / 2; the better known side gives the other
    if half < SHALLOW_ARC:
        half = asin(min(1.0, 0.5 * length / a))
        curvature = sign / a
    else:
        curvature = sign * 2.0 * sin(half) / length
    normal = (
        sign * sin(half) * direction[0] - cos(half) * direction[1],
        sign * sin(half) * direction[1] + cos(half) * direction[0],
    )
    short = length if half <= 0.25 * pi else 0.0
    row = [start[0], start[1], *normal, curvature, *direction, short, 0.0, 0.0, 0.0, 2.0 * half, stretch]
    return [*row, *start, *end]


def bezier_row(curve: Bezier, start: Point, end: Point) -> list[float]:
    """One row of ``beziers`` but for its flags."""
    inner = list(curve.control_points[1:-1])
    points = np.array([start, *inner, end], dtype=np.float64)
    if len(points) == 3:
        a0, a1, a2 = points[0], 2.0 * (points[1] - points[0]), points[0] - 2.0 * points[1] + points[2]
        a3 = np.zeros(2)
    else:
        a0, a1 = points[0], 3.0 * (points[1] - points[0])
        a2 = 3.0 * (points[0] - 2.0 * points[1] + points[2])
        a3 = points[3] - points[0] + 3.0 * (points[1] - points[2])
    return [*a0, *a1, *a2, *a3, *start, *end]
