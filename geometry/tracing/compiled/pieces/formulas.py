"""Formulas of a ray that serve doubles and double-doubles: openings and the reflection. Loads numba."""

from __future__ import annotations

import numpy as np

from .....core.rounding import EPS
from ....curves import columns as c
from ....curves.columns import JOINT_ULPS
from ....curves.curve import Curve
from ....scene.compiled.compiling import inlined, linked
from ...double_double.numbers import dot, rounded, scaled, where
from .records import NO_PIECE, OPENING, SIDE

# In place of a hollow's number: a flat top, and a corner at an end of an opening.
FLAT_TOP, TOP_CORNER = -1, -2


@inlined
def side(x, y, px, py, vx, vy):
    """-> float: the number c of a point."""
    return (x - px) * vy - (y - py) * vx


def _ranges_up_to(table):
    """Return a function of a hollow: the ranges of its curves in the tables up to this one."""
    first, end = c.range_of(table)
    if table == 0:
        return inlined(lambda hollow: ((np.int64(hollow[first]), np.int64(hollow[end])),))
    earlier = _ranges_up_to(table - 1)
    return inlined(lambda hollow: earlier(hollow) + ((np.int64(hollow[first]), np.int64(hollow[end])),))  # noqa: RUF005


_ranges = _ranges_up_to(len(Curve.traced()) - 1)


@inlined
def bounds_of(hollow):
    """-> (left, right, slack, joints, curves): the ends of the opening, the slack, and ranges in the tables."""
    joints = np.int64(hollow[c.FIRST_JOINT]), np.int64(hollow[c.JOINTS_END])
    return hollow[c.LEFT], hollow[c.RIGHT], JOINT_ULPS * EPS * hollow[c.SIZE], joints, _ranges(hollow)


@inlined
def exit_time(scope, own, px, py, vx, vy, time):
    """-> (t, kind): time to the opening (OPENING) or to a side of an open wall (SIDE) before ``time``, else NO_PIECE.

    The opening is an edge from right to left. A piece within rounding of the opening or of a side is hit first.
    """
    left, right, slack, is_open = scope.left, scope.right, scope.slack, scope.tables.is_open
    kind = NO_PIECE
    if vy > 0.0:
        t, is_met = opening_met(left, right, px, py, vx, vy)
        if (is_met or is_open) and own.kind != OPENING and (rounded(time) - rounded(t)) * rounded(vy) > slack:
            time, kind = t, OPENING
    if is_open and rounded(vx) != 0.0:
        t = ((right if vx > 0.0 else left) - px) / vx
        if t < time and (kind == OPENING or (rounded(time) - rounded(t)) * abs(rounded(vx)) > slack):
            time, kind = where(t > 0.0, t, 0.0), SIDE
    return time, kind


@inlined
def opening_met(left, right, px, py, vx, vy):
    """-> (t, is_met): time to the level of the opening, and whether the ray passes between its ends upwards."""
    c_right, c_left = (right - px) * vy + py * vx, (left - px) * vy + py * vx
    t = -py / vy
    return where(t > 0.0, t, 0.0), (vy > 0.0) & (c_right >= 0.0) & (c_left <= 0.0)


@inlined
def mirror(vx, vy, nx, ny):
    """-> (vx, vy): the velocity after the reflection on a piece with a unit normal."""
    w = scaled(2.0, dot(vx, vy, nx, ny))
    return vx - w * nx, vy - w * ny


@inlined
def with_length_one(vx, vy):
    """-> (vx, vy): one Newton step on |v| = 1, so that errors of speed and position do not amplify each other."""
    scale = 1.5 - scaled(0.5, dot(vx, vy, vx, vy))
    return scale * vx, scale * vy


@inlined
def last_hollow(entry, hollows, count):
    """-> int: number of the last hollow with left end <= entry, -1 if there is none."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if hollows[middle, c.LEFT] <= entry:
            low = middle + 1
        else:
            high = middle
    return low - 1


@inlined
def opening_at(entry, hollows, count):
    """-> int: number of the hollow whose opening contains a position of the cell, or `FLAT_TOP`, or `TOP_CORNER`."""
    h = last_hollow(entry, hollows, count)
    if h < 0 or entry >= hollows[h, c.RIGHT] or (entry == hollows[h, c.LEFT] and hollows[h, c.LEFT_EDGE] != c.NO_EDGE):
        # a flat top or its edge; an edge between two hollows is a corner
        at_left = h >= 0 and entry == hollows[h, c.LEFT] and hollows[h, c.LEFT_EDGE] == c.CORNER_EDGE
        at_right = h >= 0 and entry == hollows[h, c.RIGHT] and hollows[h, c.RIGHT_EDGE] == c.CORNER_EDGE
        return TOP_CORNER if at_left or at_right else FLAT_TOP
    return h


@linked
def curve_ends(joints, face):
    """-> (x0, y0, x1, y1): the ends of a curve."""
    return face.row[c.START_X], face.row[c.START_Y], face.row[c.END_X], face.row[c.END_Y]


@inlined
def near_end(curve, px, py, slack):
    """-> bool: whether a hit of a curve is within rounding of an end that is a corner."""
    x, y, u, v = px - curve[c.START_X], py - curve[c.START_Y], px - curve[c.END_X], py - curve[c.END_Y]
    at_start = (curve[c.START_CORNER] > 0.0) & (x * x + y * y <= slack * slack)
    return at_start | ((curve[c.END_CORNER] > 0.0) & (u * u + v * v <= slack * slack))
