"""Lines: the hits of a ray, the point of the hit, and the distance of a position, with an exact sign. Loads numba.

The sign of c = (V - p) x v is the side of the ray on which a joint V lies. A line is hit from its free side exactly if
c goes from >= 0 at its start to <= 0 at its end. Neighbouring lines share the number c, so no ray passes between them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .....core.compilation import jit
from .....core.rounding import EPS, UNIT_ROUNDOFF
from ....curves import columns as c
from ....curves.columns import NEARBY_SLACKS
from ....scene.compiled.compiling import inlined, linked, linked_allocating
from ...double_double.numbers import dot, root, two_product, two_sum, where
from .formulas import side
from .records import LINE

# Least absolute value of a fraction from a line's end, so that it is negative even if the ray meets that end.
LEAST_FRACTION = 5e-324
# Rounding error of (b - a) x (c - a), relative to the sum of its two products: Shewchuk 1997, ccwerrboundA.
CROSS_ROUNDING = (3.0 + 16.0 * EPS) * UNIT_ROUNDOFF


class Line(NamedTuple):
    """A line: its ends, the vector between them, the unit normal towards the free side, and the length."""

    x0: float
    y0: float
    x1: float
    y1: float
    edge_x: float
    edge_y: float
    normal_x: float
    normal_y: float
    length: float


@inlined
def line_at(tables, j):
    """-> Line: the line that starts at joint j."""
    joints, lines = tables.joints, tables.lines
    return Line(
        joints[j, c.JOINT_X], joints[j, c.JOINT_Y], joints[j + 1, c.JOINT_X], joints[j + 1, c.JOINT_Y],
        lines[j, c.EDGE_X], lines[j, c.EDGE_Y], lines[j, c.LINE_NORMAL_X], lines[j, c.LINE_NORMAL_Y],
        lines[j, c.LENGTH],
    )  # fmt: skip


@inlined
def line_sides(line, px, py, vx, vy):
    """-> (before, after): the numbers c of the ends of a line."""
    return side(line.x0, line.y0, px, py, vx, vy), side(line.x1, line.y1, px, py, vx, vy)


@inlined
def line_point(line, fraction):
    """-> (x, y): the point of a line at a fraction, which is relative to the line's end if it is negative."""
    late = fraction < 0.0
    x, y = where(late, line.x1, line.x0), where(late, line.y1, line.y0)
    return x + fraction * line.edge_x, y + fraction * line.edge_y


@inlined
def line_hit(line, before, after, px, py, vx, vy):
    """-> (t, fraction, x, y): time to a line, and the hit there, as a fraction for `line_point` and as a point.

    The fraction is relative to the nearer joint, for accuracy at both ends. ``before`` and ``after`` are the numbers c
    of the joints.
    """
    across = before - after
    late = before > 0.5 * across
    fraction = where(late, after, before) / across
    fraction = where(late & (fraction == 0.0), -LEAST_FRACTION, fraction)
    x, y = line_point(line, fraction)
    return (x - px) * vx + (y - py) * vy, fraction, x, y


@inlined
def is_ahead(t, across, length, close, slack):
    """-> bool: whether a line lies ahead of the start for any rounding: at a time above ``close``, or a slack away.

    ``across`` is the difference of the numbers c of its joints.
    """
    return t > close or t * across > slack * length


@inlined
def is_faced(dx, dy, at_entry, vx, vy, slack):
    """-> bool: whether a corner at (dx, dy) from a ray lies ahead of it.

    At entry the corners of the opening are always behind the ray, at any angle.
    """
    return (dx * vx + dy * vy > slack) & ((not at_entry) | (dy != 0.0))


@inlined
def joint_side(joints, j, at_entry, px, py, vx, vy, slack):
    """-> (c, t): the number c of joint j, and the time to the joint if it is a corner that the ray meets, else inf."""
    dx, dy = joints[j, c.JOINT_X] - px, joints[j, c.JOINT_Y] - py
    c_there = dx * vy - dy * vx
    if abs(c_there) <= slack and joints[j, c.IS_CORNER] > 0.0 and is_faced(dx, dy, at_entry, vx, vy, slack):
        return c_there, dx * vx + dy * vy
    return c_there, np.inf


@linked
def line_ends(joints, index):
    """-> (x0, y0, x1, y1): the joints of the line that starts at joint ``index``."""
    start, end = joints[index], joints[index + 1]
    return start[c.JOINT_X], start[c.JOINT_Y], end[c.JOINT_X], end[c.JOINT_Y]


@linked
def line_frame(joints, index):
    """-> (x0, y0, ex, ey, nx, ny): start of a line, the vector to its end, and the unit normal on the free side."""
    x0, y0, x1, y1 = line_ends(joints, index)
    ex, ey = two_sum(x1, -x0), two_sum(y1, -y0)
    size = root(dot(ex, ey, ex, ey))
    return x0, y0, ex, ey, -(ey / size), ex / size


@linked
def line_height(joints, index, px, py):
    """-> (height, nx, ny): distance of a position from a line, positive on the free side (left), and unit normal."""
    x0, y0, _, _, nx, ny = line_frame(joints, index)
    return dot(px - x0, py - y0, nx, ny), nx, ny


@linked
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


# ---- the names that every kind of piece has, see `kinds` --------------------------------------------------------
KIND = LINE


@inlined
def nearby(scope, number, own, is_own, px, py, vx, vy):
    """-> (t, s, tangent, is_clear): time to a hit close by, or inf; see `kinds.piece_nearby`."""
    if is_own:
        return np.inf, 0.0, 0, False
    tables, slack = scope.tables, scope.slack
    line = line_at(tables, number)
    before, after = line_sides(line, px, py, vx, vy)
    if tables.joints[number, c.STARTS_LINE] > 0.0 and before >= 0.0 >= after and before > after:
        t, fraction, _, _ = line_hit(line, before, after, px, py, vx, vy)
        height, reach = t * (before - after), slack * line.length
        if abs(t) <= NEARBY_SLACKS * slack and height >= -reach:
            return t, fraction, 0, height > reach
    return np.inf, 0.0, 0, False


@inlined
def incidence(tables, hit, px, py, vx, vy):
    """-> float: sine of the angle between the velocity and the line."""
    table = tables.lines
    return abs(vx * table[hit.number, c.LINE_NORMAL_X] + vy * table[hit.number, c.LINE_NORMAL_Y])


@inlined
def surface(scope, hit, own, px, py, vx, vy):
    """-> (px, py, nx, ny, at_corner): the end of a ray segment, the unit normal, and whether it is at a corner."""
    tables = scope.tables
    line = line_at(tables, hit.number)
    px, py = line_point(line, hit.s)
    # a first hit near an end of the opening is as accurate as the ray, at any distance from that corner
    at_opening = own.bounces == 0 and (line.y0 if hit.s >= 0.0 else line.y1) == 0.0
    room = LEAST_FRACTION * line.length if at_opening else scope.slack
    near = hit.number if hit.s >= 0.0 else hit.number + 1
    at_corner = abs(hit.s) * line.length <= room and tables.joints[near, c.IS_CORNER] > 0.0
    return px, py, line.normal_x, line.normal_y, at_corner


@linked
def refined_surface(tables, hit, px, py, vx, vy):
    """-> (qx, qy, nx, ny, bent): see `kinds.refined_surface`."""
    x0, y0, ex, ey, nx, ny = line_frame(tables.joints, hit.number)
    return x0 + hit.s * ex, y0 + hit.s * ey, nx, ny, 0.0


@linked_allocating
def refined_row(tables, number):
    """-> array: empty, for the joints define a line."""
    return np.empty(0)


@linked
def height(joints, face, px, py):
    """-> (height, nx, ny): see `kinds.height_over`."""
    return line_height(joints, face.number, px, py)


@linked
def ends(joints, face):
    """-> (x0, y0, x1, y1): the ends of a piece."""
    return line_ends(joints, face.number)
