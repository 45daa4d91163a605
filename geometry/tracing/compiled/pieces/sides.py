"""Test whether a ray that leaves one piece within rounding of another piece starts in front of the other piece.

The position of a ray has an error of some rounding errors of the hollow's size. So a distance of this size from a piece
is not significant: beside the tip of a sharp peak, in the apex of a narrow wedge, and on a plate of no thickness or
thinner than rounding. But the joints of the wall are exact, and the ray starts on the piece that it has left (its own
piece). So the distance is computed from the joints of both pieces.

* Two segments: the distance is linear along the own segment, and its signs at the two joints are exact (expansions of
  Shewchuk 1997). Coincident faces have distance 0: the ray is not in front of the other face.
* Curves: the position is projected onto its own piece, and the distance computed, in double-double arithmetic.
  Distances below the rounding error of this computation are 0.

Two faces of a plate cross within rounding if vertices that should lie on one line do not in doubles. Then the ray has
passed through the back of one face to the front of the other. A face that the ray passed from behind does not stop the
ray after its reflection.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .beziers import STEPS
from .kinds import ends_of, height_over
from .lines import height_over_line, line_ends
from .options import linked

# Error of a double-double position projected onto a curve, as a fraction of the slack (64 roundings to 16 EPS).
CURVE_NOISE = 2.0**-48
# Distance behind a face, in slacks, beyond which the last segment did not start between the face and the own piece.
BEHIND_SLACKS = 4.0


class Arrival(NamedTuple):
    """The arrival of a ray at its start: the length of the last segment and the accuracy of the position.

    ``slack`` is the distance within which pieces are nearby; ``blur`` is the error of the position along the own piece.
    If this error decides, for example if one piece stands on the other, the ray counts as in front.
    """

    flown: float
    slack: float
    blur: float


@linked
def came_through(ends, mx, my, px, py, vx, vy, arrival):
    """-> bool: whether a ray's last segment, which ended at p with the velocity v, crossed a piece from behind.

    ``ends`` are the ends of the piece, (mx, my) is its normal next to p.
    """
    x0, y0, x1, y1 = ends
    if arrival.flown * (vx * mx + vy * my) <= BEHIND_SLACKS * arrival.slack:
        return False
    return (x0 - px) * vy - (y0 - py) * vx <= 0.0 <= (x1 - px) * vy - (y1 - py) * vx


@linked
def line_in_front_of_line(joints, line, own, px, py, vx, vy, arrival):
    """-> bool: `in_front_at` for two lines, by their rows."""
    if height_over_line(joints, own, line, px, py, arrival.blur) <= 0.0:
        return False
    x0, y0, x1, y1 = line_ends(joints, own)
    ex, ey = x1 - x0, y1 - y0
    w = 2.0 * (vy * ex - vx * ey) / (ex * ex + ey * ey)
    ends = line_ends(joints, line)
    x0, y0, x1, y1 = ends
    length = math.hypot(x1 - x0, y1 - y0)
    mx, my = (y0 - y1) / length, (x1 - x0) / length
    return not came_through(ends, mx, my, px.high, py.high, vx + w * ey, vy - w * ex, arrival)


@linked
def in_front_at(joints, piece, own, px, py, vx, vy, arrival):
    """-> bool: whether a ray that has just left the piece ``own`` starts in front of ``piece``, within the slack of it.

    (``px``, ``py``), double-doubles, is the position, within rounding of ``own``. At least one piece is a curve.
    """
    nx, ny = px, py
    for _ in range(STEPS):
        height, nx, ny = height_over(own.kind, (joints, own, px, py))
        px, py = px - height * nx, py - height * ny
    height, mx, my = height_over(piece.kind, (joints, piece, px, py))
    if height.high + arrival.blur * abs(mx.high * ny.high - my.high * nx.high) <= CURVE_NOISE * arrival.slack:
        return False
    w = 2.0 * (vx * nx.high + vy * ny.high)
    vx, vy = vx - w * nx.high, vy - w * ny.high
    ends = ends_of(piece.kind, (joints, piece))
    return not came_through(ends, mx.high, my.high, px.high, py.high, vx, vy, arrival)
