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

import numpy as np

from ....core.checks import Floats
from ....core.compilation import jit
from ....core.rounding import EPS, UNIT_ROUNDOFF
from ...scene import columns as c
from .arcs import arc_height
from .beziers import bezier_coefficients, bezier_point
from .formulas import cubic, cubic_slope
from .numbers import DoubleDouble, dot, root, two_product, two_sum
from .records import ARC, LINE

# Error of a double-double position projected onto a curve, as a fraction of the slack (64 roundings to 16 EPS).
CURVE_NOISE = 2.0**-48
# Rounding error of (b - a) x (c - a), relative to the sum of its two products: Shewchuk 1997, ccwerrboundA.
CROSS_ROUNDING = (3.0 + 16.0 * EPS) * UNIT_ROUNDOFF
# Distance behind a face, in slacks, beyond which the last segment did not start between the face and the own piece.
BEHIND_SLACKS = 4.0
# Newton steps that project a position onto a curve within rounding of it; each step squares the error.
STEPS = 2

_compile = jit(linked=True, _nrt=False)


class Face(NamedTuple):
    """A piece: kind, row of a line, arc as a row of `refined_arcs`, row of a Bezier piece and parameter on it.

    Fields of other kinds are not used.
    """

    kind: int
    number: int
    arc: Floats
    curve: Floats
    s: DoubleDouble


class Arrival(NamedTuple):
    """The arrival of a ray at its start: the length of the last segment and the accuracy of the position.

    ``slack`` is the distance within which pieces are nearby; ``blur`` is the error of the position along the own piece.
    If this error decides, for example if one piece stands on the other, the ray counts as in front.
    """

    flown: float
    slack: float
    blur: float


@jit(_nrt=True)
def orientation(ax, ay, bx, by, cx, cy):
    """Return (b - a) x (c - a) with the exact sign: positive if c lies on the left of the line from a to b."""
    first, second = (bx - ax) * (cy - ay), (by - ay) * (cx - ax)
    value = first - second
    size = abs(first) + abs(second)
    if size == 0.0 or abs(value) > CROSS_ROUNDING * size:
        return value
    along, up = two_sum(bx, -ax), two_sum(by, -ay)
    right, above = two_sum(cx, -ax), two_sum(cy, -ay)
    # the exact sum of 16 terms as an expansion of non-overlapping numbers, the largest last
    total, count = np.zeros(16), 0
    for along_part, up_part in ((along.high, up.high), (along.low, up.low)):
        for right_part, above_part in ((right.high, above.high), (right.low, above.low)):
            for product in (two_product(along_part, above_part), two_product(-up_part, right_part)):
                for term in (product.high, product.low):
                    rest = term
                    for k in range(count):
                        exact = two_sum(rest, total[k])
                        rest, total[k] = exact.high, exact.low
                    total[count] = rest
                    count += 1
    value = 0.0
    for k in range(count):
        value += total[k]
    return value


@_compile
def line_ends(joints, index):
    """-> (x0, y0, x1, y1): the joints of the line that starts at joint ``index``."""
    start, end = joints[index], joints[index + 1]
    return start[c.JOINT_X], start[c.JOINT_Y], end[c.JOINT_X], end[c.JOINT_Y]


@_compile
def line_frame(joints, index):
    """-> (x0, y0, ex, ey, nx, ny): start of a line, the vector to its end, and the unit normal on the free side."""
    x0, y0, x1, y1 = line_ends(joints, index)
    ex, ey = two_sum(x1, -x0), two_sum(y1, -y0)
    size = root(dot(ex, ey, ex, ey))
    return x0, y0, ex, ey, -(ey / size), ex / size


@_compile
def line_height(joints, index, px, py):
    """-> (height, nx, ny): distance of a position from a line, positive on the free side (left), and unit normal."""
    x0, y0, _, _, nx, ny = line_frame(joints, index)
    return dot(px - x0, py - y0, nx, ny), nx, ny


@_compile
def height_over_line(joints, own, other, px, py, blur):
    """Return the distance of a position on line ``own`` from line ``other``, times a length, with the exact sign.

    If the lines meet between the ends of ``own``, the double-double position decides. Its error along ``own`` is
    ``blur``, and the result is the largest possible distance.
    """
    ax, ay, bx, by = line_ends(joints, other)
    x0, y0, x1, y1 = line_ends(joints, own)
    first, last = orientation(ax, ay, bx, by, x0, y0), orientation(ax, ay, bx, by, x1, y1)
    if first * last >= 0.0:
        return first + last
    height, nx, ny = line_height(joints, own, px, py)
    px, py = px - height * nx, py - height * ny
    height, _, _ = line_height(joints, other, px, py)
    length = math.hypot(x1 - x0, y1 - y0)
    return math.hypot(bx - ax, by - ay) * height.high + blur * abs(last - first) / length


@_compile
def bezier_height(curve, s, px, py):
    """-> (height, nx, ny): distance of a position from a Bezier piece near its parameter s, and the unit normal."""
    ax, ay = bezier_coefficients(curve)
    for _ in range(STEPS):
        tx, ty = cubic_slope(ax, s), cubic_slope(ay, s)
        s = s + dot(px - cubic(ax, s), py - cubic(ay, s), tx, ty) / dot(tx, ty, tx, ty)
    x, y, nx, ny, _ = bezier_point(curve, s)
    return dot(px - x, py - y, nx, ny), nx, ny


@_compile
def height_over(joints, face, px, py):
    """-> (height, nx, ny): distance of a position from a piece, positive on the free side, and the unit normal."""
    if face.kind == LINE:
        return line_height(joints, face.number, px, py)
    if face.kind == ARC:
        return arc_height(face.arc, px, py)
    return bezier_height(face.curve, face.s, px, py)


@_compile
def ends_of(joints, face):
    """-> (x0, y0, x1, y1): the ends of a piece."""
    if face.kind == LINE:
        return line_ends(joints, face.number)
    curve = face.arc if face.kind == ARC else face.curve
    return curve[c.START_X], curve[c.START_Y], curve[c.END_X], curve[c.END_Y]


@_compile
def came_through(ends, mx, my, px, py, vx, vy, arrival):
    """-> bool: whether a ray's last segment, which ended at p with the velocity v, crossed a piece from behind.

    ``ends`` are the ends of the piece, (mx, my) is its normal next to p.
    """
    x0, y0, x1, y1 = ends
    if arrival.flown * (vx * mx + vy * my) <= BEHIND_SLACKS * arrival.slack:
        return False
    return (x0 - px) * vy - (y0 - py) * vx <= 0.0 <= (x1 - px) * vy - (y1 - py) * vx


@_compile
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


@_compile
def in_front_at(joints, piece, own, px, py, vx, vy, arrival):
    """-> bool: whether a ray that has just left the piece ``own`` starts in front of ``piece``, within the slack of it.

    (``px``, ``py``), double-doubles, is the position, within rounding of ``own``. At least one piece is a curve.
    """
    nx, ny = px, py
    for _ in range(STEPS):
        height, nx, ny = height_over(joints, own, px, py)
        px, py = px - height * nx, py - height * ny
    height, mx, my = height_over(joints, piece, px, py)
    if height.high + arrival.blur * abs(mx.high * ny.high - my.high * nx.high) <= CURVE_NOISE * arrival.slack:
        return False
    w = 2.0 * (vx * nx.high + vy * ny.high)
    vx, vy = vx - w * nx.high, vy - w * ny.high
    return not came_through(ends_of(joints, piece), mx.high, my.high, px.high, py.high, vx, vy, arrival)
