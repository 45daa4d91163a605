"""Hits of a ray on pieces within rounding of its start: compiled.

The loop of `rays` only detects such pieces. The separate function `hit_nearby` tests them again, so that the loop
itself contains no call.
"""

from __future__ import annotations

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from ...scene import columns as c
from ...scene.boxes import BOXES, CONTENT
from ...scene.tolerances import NEARBY_SLACKS
from ..double_double.arcs import refined_arcs
from ..double_double.numbers import extended
from ..double_double.records import ARC
from ..double_double.records import BEZIER as CURVE
from ..double_double.records import LINE as STRAIGHT
from ..double_double.sides import Arrival, Face, in_front_at, line_in_front_of_line
from .options import allocating, inner, linked, linked_allocating
from .pieces import NO_BEZIER_HIT, arc_time, line_at, line_hit, line_sides, on_arc
from .pointers import call_late
from .records import BEZIER, CIRCLE, ELLIPSE, LINE, NO_PIECE, OPENING, SIDE, Hit
from .tree import first_boxes, next_leaf

# A value of `Hit.uncertainty`: the side of the piece on which the ray starts is not resolved.
UNCERTAIN = 2
# Constants of these types, because numba compiles a function again for every literal argument.
NOT_OWN, FORWARD, A_LINE = np.bool_(False), np.bool_(True), np.int64(LINE)


@linked_allocating
def face_of(tables, kind, number, s):
    """-> Face: a piece, given by kind, row and parameter, for double-double arithmetic."""
    arc, curve = np.empty(0), np.empty(0)
    form = STRAIGHT
    # numba would compile a function for the operator `in`
    if kind == CIRCLE or kind == ELLIPSE:  # noqa: SIM109
        row = tables.circles[number] if kind == CIRCLE else tables.ellipses[number]
        form, arc = ARC, refined_arcs(carray(row, (1, c.ARC_COLUMNS)))[0]
    if kind == BEZIER:
        form, curve = CURVE, carray(tables.beziers[number], c.BEZIER_COLUMNS)
    return Face(form, number, arc, curve, extended(s))


@allocating
def starts_in_front(tables, hit, own, px, py, vx, vy, slack):
    """-> bool: whether a ray that left a piece starts, or may start, in front of a nearby piece; see `sides`.

    At least one of the pieces is a curve.
    """
    piece, start = face_of(tables, hit.kind, hit.number, hit.s), face_of(tables, own.kind, own.number, own.s)
    arrival = Arrival(own.flown, slack, slack)
    return in_front_at(tables.joints, piece, start, extended(px), extended(py), vx, vy, arrival)


@inner
def line_starts_in_front(joints, line, own, px, py, vx, vy, slack):
    """-> bool: `starts_in_front` for a ray that left a line, and another line."""
    arrival = Arrival(own.flown, slack, slack)
    return line_in_front_of_line(joints, line, own.number, extended(px), extended(py), vx, vy, arrival)


@linked
def line_nearby(tables, j, px, py, vx, vy, slack):
    """-> (t, fraction, is_clear): time to a line close by, or inf; whether the line is certainly ahead."""
    line = line_at(tables, j)
    before, after = line_sides(line, px, py, vx, vy)
    if tables.joints[j, c.STARTS_LINE] > 0.0 and before >= 0.0 >= after and before > after:
        t, fraction, _, _ = line_hit(line, before, after, px, py, vx, vy)
        height, reach = t * (before - after), slack * line.length
        if abs(t) <= NEARBY_SLACKS * slack and height >= -reach:
            return t, fraction, height > reach
    return np.inf, 0.0, False


@linked
def arc_nearby(arc, px, py, vx, vy, slack):
    """-> (t, tangent, is_clear): time to a hit on an arc close by, or inf; see `line_nearby`."""
    stretch = arc[c.STRETCH]
    wide = slack * max(1.0, stretch)
    t, tangent, height = arc_time(arc, NOT_OWN, px, py, vx, vy, stretch)
    if abs(t) > NEARBY_SLACKS * slack or height < -wide:
        return np.inf, 0, False
    t = max(t, 0.0)
    if not on_arc(arc, px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y]), wide):
        return np.inf, 0, False
    return t, tangent, height > wide


@linked
def piece_nearby(scope, piece, own, px, py, vx, vy):
    """-> (t, s, tangent, is_clear): time to a hit on a piece close by, or inf, and the position s on the piece.

    ``piece`` is the kind and row of the piece.
    """
    tables, slack = scope.tables, scope.slack
    kind, number = piece
    is_own = own.kind == kind and own.number == number
    t, s, tangent, is_clear = np.inf, 0.0, 0, False
    if kind == BEZIER:
        own_number = number if is_own else -1
        arguments = tables.beziers, number, number + 1, own_number, own.s, px, py, vx, vy, slack, np.inf
        _, _, _, _, near_s = call_late(scope.slots.bezier, NO_BEZIER_HIT, arguments)
        if near_s >= 0.0:
            t, s = 0.0, near_s
    elif not is_own and kind == LINE:
        t, s, is_clear = line_nearby(tables, number, px, py, vx, vy, slack)
    elif not is_own:
        arc = tables.circles[number] if kind == CIRCLE else tables.ellipses[number]
        t, tangent, is_clear = arc_nearby(arc, px, py, vx, vy, slack)
    return t, s, tangent, is_clear


@linked
def nearer(scope, found, piece, own, px, py, vx, vy):
    """-> Hit: the earlier of a hit and of that on a nearby piece, given by kind and row, if the ray starts in front."""
    tables, slack = scope.tables, scope.slack
    kind, number = piece
    t, s, tangent, is_clear = piece_nearby(scope, piece, own, px, py, vx, vy)
    if not t < found.time:
        return found
    from_piece = own.kind != OPENING and own.kind != SIDE
    hit = Hit(max(t, 0.0), kind, number, s, tangent if is_clear or not from_piece else UNCERTAIN)
    # no piece lies above the opening or beyond a side, so a piece within rounding of them is hit there
    if is_clear or not from_piece:
        return hit
    if kind == LINE and own.kind == LINE:
        arguments = tables.joints, number, own, px, py, vx, vy, slack
        is_front = call_late(scope.slots.line_in_front, is_clear, arguments)
    else:
        is_front = call_late(scope.slots.in_front, is_clear, (tables, hit, own, px, py, vx, vy, slack))
    return hit if is_front else found


@inner
def hit_nearby(scope, own, px, py, vx, vy):
    """-> Hit: the first hit on nearby pieces with the ray's start on their front side.

    The hit is UNCERTAIN if the gap between start and piece is within the slack, as in the apex of a wedge: double
    precision does not determine how the ray continues.
    """
    found = Hit(np.inf, NO_PIECE, -1, 0.0, 0)
    first, end = scope.joints
    if scope.has_tree:
        close = NEARBY_SLACKS * scope.slack
        walk = first_boxes(scope, px, py, vx, vy, -close, close)
        while True:
            leaf, walk = next_leaf(scope, walk, FORWARD, px, py, vx, vy, -close, close)
            if leaf < 0:
                break
            start = int(scope.tables.boxes[leaf, CONTENT])
            for number in range(start, min(start + BOXES, end - 1)):
                found = nearer(scope, found, (A_LINE, number), own, px, py, vx, vy)
    else:
        for number in range(first, end - 1):
            found = nearer(scope, found, (A_LINE, number), own, px, py, vx, vy)
    for kind, (first, end) in ((CIRCLE, scope.circles), (ELLIPSE, scope.ellipses), (BEZIER, scope.beziers)):
        for number in range(first, end):
            found = nearer(scope, found, (kind, number), own, px, py, vx, vy)
    return found
