"""Hits of a ray on pieces within rounding of its start: compiled.

The loop of `rays` only detects such pieces. The separate function `hit_nearby` tests them again, so that the loop
itself contains no call.
"""

from __future__ import annotations

import numpy as np

from ...curves.tolerances import NEARBY_SLACKS
from ...scene.boxes import BOXES, CONTENT
from ..double_double.numbers import extended
from .pieces.kinds import face_of, piece_nearby
from .pieces.options import allocating, inner, linked
from .pieces.pointers import call_late
from .pieces.records import FIRST_CURVE, LINE, NO_PIECE, OPENING, SIDE, Hit
from .pieces.sides import Arrival, in_front_at, line_in_front_of_line
from .tree import first_boxes, next_leaf, tree_of

# A value of `Hit.uncertainty`: the side of the piece on which the ray starts is not resolved.
UNCERTAIN = 2
# Constants of these types, because numba compiles a function again for every literal argument.
FORWARD, A_LINE = np.bool_(True), np.int64(LINE)


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
def nearer(scope, found, piece, own, px, py, vx, vy):
    """-> Hit: the earlier of a hit and of that on a nearby piece, given by kind and row, if the ray starts in front."""
    tables, slack = scope.tables, scope.slack
    kind, number = piece
    is_own = own.kind == kind and own.number == number
    t, s, tangent, is_clear = piece_nearby(kind, (scope, number, own, is_own, px, py, vx, vy))
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
        tree = tree_of(scope)
        walk = first_boxes(tree, px, py, vx, vy, -close, close)
        while True:
            leaf, walk = next_leaf(tree, walk, FORWARD, px, py, vx, vy, -close, close)
            if leaf < 0:
                break
            start = int(scope.tables.boxes[leaf, CONTENT])
            for number in range(start, min(start + BOXES, end - 1)):
                found = nearer(scope, found, (A_LINE, number), own, px, py, vx, vy)
    else:
        for number in range(first, end - 1):
            found = nearer(scope, found, (A_LINE, number), own, px, py, vx, vy)
    for index, (first, end) in enumerate(scope.curves):
        for number in range(first, end):
            found = nearer(scope, found, (FIRST_CURVE + index, number), own, px, py, vx, vy)
    return found
