"""The table of the hollows that are reflected in closed form: of two lines, or of one circular arc.

`tracing/compiled/closed_forms` reads its rows. A *fan* is a hollow of two lines: unfolded about its apex, the copies
of its triangle are a fan, a ray is straight, and it leaves through the copy of the opening that it meets first. A
*bowl* is a hollow of one circular arc of at most a half circle: all hops of a ray are equal.

Columns: kind (`NONE`, `FAN`, `BOWL`), left, right, doubt; then for a bowl the centre (2), radius, half angle; for a
fan the apex (2), number of copies K, then for a ray that first meets the right line, and for one that first meets the
left, K + 2 rows each of the unfolded ends of the opening (2) and of the constant c in theta' = +-theta + c after so
many hits. Row 0 is the end of the opening on the other side.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, ceil, cos, fsum, hypot, pi, sin
from typing import TYPE_CHECKING

import numpy as np

from ...core.checks import Floats
from ..curves.arc import Arc
from ..curves.segment import Segment
from .facing import WIDEST_WEDGE

if TYPE_CHECKING:
    from ..curves.curve import Curve, Point

NONE, FAN, BOWL = 0.0, 1.0, 2.0
FAN_COLUMN, CHAIN_COLUMNS = 7, 3
# A ray whose line passes a joint within this share of the hollow's size, or an arc's hit within this angle of an end,
# is left to the loop. This is far beyond what the loop calls a corner and beyond all rounding, so that the two never
# disagree about a ray's number of hits or its status; and it is one ray in 10^8.
DOUBT = 2.0**-30
# Shallower arcs are left to the loop, which keeps the digits of positions along them.
FLATTEST_BOWL = 0.05
# In a narrower fan the loop takes runs of hits in one step.
NARROWEST_FAN = WIDEST_WEDGE


def closed_row(pieces: Sequence[Curve], places: Sequence[Point], size: float) -> list[float]:
    """The row of one hollow; ``places`` are its joints from left to right."""
    (left, top), (right, other) = places[0], places[-1]
    if top == other == 0.0 and left < right:
        if len(pieces) == 2 and all(isinstance(piece, Segment) for piece in pieces):
            return _fan_row(left, right, places[1], size)
        if len(pieces) == 1 and isinstance(pieces[0], Arc) and pieces[0].is_circular:
            return _bowl_row(left, right, pieces[0])
    return [NONE]


def closed_table(rows: Sequence[Sequence[float]]) -> Floats | None:
    """All rows as one table, or None where no hollow has a closed form."""
    if all(row[0] == NONE for row in rows):
        return None
    table = np.zeros((len(rows), max(map(len, rows))))
    for k, row in enumerate(rows):
        table[k, : len(row)] = row
    return table


def _fan_row(left: float, right: float, apex: Point, size: float) -> list[float]:
    x, y = apex
    # inclinations of the two lines, each measured from its own side of the horizontal
    west, east = atan2(-y, x - left), atan2(-y, right - x)
    angle = fsum([pi, -west, -east])
    # the chain of the openings' ends is convex if the apex lies below the opening
    if not left <= x <= right or angle <= NARROWEST_FAN:
        return [NONE]
    # a straight ray turns by less than pi about the apex
    copies = ceil(pi / angle)
    row = [FAN, left, right, DOUBT * size, x, y, float(copies)]
    lengths = hypot(x - left, y), hypot(right - x, y)
    for side, first, (far, near) in ((1.0, east, lengths), (-1.0, west, lengths[::-1])):
        for k in range(copies + 2):
            polar, length = fsum([first, -(k - 1) * angle]), near if k % 2 else far
            row += [x + side * length * cos(polar), y + length * sin(polar), _constant(k, side, first, angle)]
    return row


def _constant(hits: int, side: float, first: float, angle: float) -> float:
    """c of theta' = +-theta + c after so many hits, of which the first is on the right for side 1, on the left for -1.

    A reflection takes the direction a to 2 b - a. On the right the lines have the directions b = first, first + angle,
    first, ..., and the ray's direction is theta + pi; the left is its mirror image, all angles taken from pi.
    """
    if hits % 2 == 0:
        return side * fsum([hits * angle, -pi])
    constant = fsum([2.0 * first, -(hits - 1) * angle, pi])
    return constant if side > 0.0 else 2.0 * pi - constant


def _bowl_row(left: float, right: float, arc: Arc) -> list[float]:
    half = 0.5 * (arc.end_angle - arc.start_angle)
    if not FLATTEST_BOWL <= half <= 0.5 * pi:
        return [NONE]
    radius = 0.5 * (right - left) / sin(half)
    # at pi/2 the centre lies on the opening
    height = radius * cos(half) if half < 0.5 * pi else 0.0
    return [BOWL, left, right, DOUBT, 0.5 * (left + right), height, radius, half]
