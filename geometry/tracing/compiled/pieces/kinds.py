"""All kinds of pieces: the nearest hit on a curve, the angle of incidence, the reflection, distances. Loads numba.

A new kind of piece has its formulas in a module beside `lines`, `arcs` and `beziers`, and a branch in each function
here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from .....core.checks import Floats
from ....scene import columns as c
from ....scene.tolerances import NEARBY_SLACKS
from ...double_double.numbers import DoubleDouble, extended
from . import arcs, beziers, lines
from .formulas import mirror, near_end
from .options import inlined, inner, linked, linked_allocating
from .pointers import call_late
from .records import ARC, BEZIER, LINE, NO_PIECE, OPENING, Hit

# Of this type, because numba compiles a function again for a literal argument.
NOT_OWN = np.bool_(False)


@inlined
def nearest_curve(scope, own, px, py, vx, vy):
    """-> (Hit, contact, nearby): the first hit on a curve that is not tangent, and the time to the first tangent one.

    Both times are inf if there is none. For ``nearby`` see `rays.nearest_line`.
    """
    tables, slack = scope.tables, scope.slack
    close = NEARBY_SLACKS * slack
    time, kind, number, hit_s, contact, nearby = np.inf, NO_PIECE, -1, 0.0, np.inf, False
    for k in range(scope.arcs[0], scope.arcs[1]):
        arc = tables.arcs[k]
        is_own = own.kind == ARC and own.number == k
        t, tangent, _ = arcs.arc_time(arc, is_own, px, py, vx, vy)
        if abs(t) <= close and not is_own:
            nearby = True
        elif tangent != 0:
            if arcs.may_touch_arc(arc, t, px, py, vx, vy, slack):
                contact = min(contact, t)
        elif 0.0 <= t < time:
            excess, room = arcs.excess_after(arc, t, px, py, vx, vy), slack * max(1.0, arc[c.STRETCH])
            is_met = excess <= room
            if room < excess <= NEARBY_SLACKS * room:
                is_met = call_late(scope.slots.smooth_end, is_met, (arc, t, px, py, vx, vy, slack))
            if is_met:
                time, kind, number = t, ARC, k
    first, end = scope.beziers
    if first < end:
        own_number = own.number if own.kind == BEZIER else -1
        arguments = tables.beziers, first, end, own_number, own.s, px, py, vx, vy, slack, time
        t, k, s, touch, near_s = call_late(scope.slots.bezier, beziers.NO_BEZIER_HIT, arguments)
        contact = min(contact, touch)
        if k >= 0:
            time, kind, number, hit_s = t, BEZIER, k, s
        nearby = nearby or near_s >= 0.0
    return Hit(time, kind, number, hit_s, 0), contact, nearby


@linked
def line_nearby(tables, j, px, py, vx, vy, slack):
    """-> (t, fraction, is_clear): time to a line close by, or inf; whether the line is certainly ahead."""
    line = lines.line_at(tables, j)
    before, after = lines.line_sides(line, px, py, vx, vy)
    if tables.joints[j, c.STARTS_LINE] > 0.0 and before >= 0.0 >= after and before > after:
        t, fraction, _, _ = lines.line_hit(line, before, after, px, py, vx, vy)
        height, reach = t * (before - after), slack * line.length
        if abs(t) <= NEARBY_SLACKS * slack and height >= -reach:
            return t, fraction, height > reach
    return np.inf, 0.0, False


@linked
def arc_nearby(arc, px, py, vx, vy, slack):
    """-> (t, tangent, is_clear): time to a hit on an arc close by, or inf; see `line_nearby`."""
    stretch = arc[c.STRETCH]
    wide = slack * max(1.0, stretch)
    t, tangent, height = arcs.arc_time(arc, NOT_OWN, px, py, vx, vy)
    if abs(t) > NEARBY_SLACKS * slack or height < -wide:
        return np.inf, 0, False
    t = max(t, 0.0)
    if arcs.end_excess(arc, px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])) > wide:
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
        _, _, _, _, near_s = call_late(scope.slots.bezier, beziers.NO_BEZIER_HIT, arguments)
        if near_s >= 0.0:
            t, s = 0.0, near_s
    elif not is_own and kind == LINE:
        t, s, is_clear = line_nearby(tables, number, px, py, vx, vy, slack)
    elif not is_own:
        t, tangent, is_clear = arc_nearby(tables.arcs[number], px, py, vx, vy, slack)
    return t, s, tangent, is_clear


@inner
def incidence(tables, hit, px, py, vx, vy):
    """-> float: sine of the angle between the velocity and the piece that is hit; of the opening and the sides |vy|."""
    if hit.kind == LINE:
        table = tables.lines
        return abs(vx * table[hit.number, c.LINE_NORMAL_X] + vy * table[hit.number, c.LINE_NORMAL_Y])
    if hit.kind == ARC:
        return arcs.arc_incidence(tables.arcs[hit.number], hit.time, px, py, vx, vy)
    if hit.kind == BEZIER:
        tx, ty = beziers.bezier_tangent(beziers.bezier_coefficients(tables.beziers[hit.number]), hit.s)
        return abs(tx * vy - ty * vx) / math.sqrt(tx * tx + ty * ty)
    return abs(vy)


@inlined
def reflect(scope, hit, own, px, py, vx, vy):
    """-> (px, py, vx, vy, at_corner): the ray after its reflection on a piece, and whether it is at a corner.

    At a corner the velocity is not reflected.
    """
    tables = scope.tables
    if hit.kind == LINE:
        line = lines.line_at(tables, hit.number)
        px, py = lines.line_point(line, hit.s)
        # a first hit near an end of the opening is as accurate as the ray, at any distance from that corner
        at_opening = own.bounces == 0 and (line.y0 if hit.s >= 0.0 else line.y1) == 0.0
        room = lines.LEAST_FRACTION * line.length if at_opening else scope.slack
        near = hit.number if hit.s >= 0.0 else hit.number + 1
        at_corner = abs(hit.s) * line.length <= room and tables.joints[near, c.IS_CORNER] > 0.0
        nx, ny = line.normal_x, line.normal_y
    else:
        if hit.kind == BEZIER:
            curve = tables.beziers[hit.number]
            coefficients = beziers.bezier_coefficients(curve)
            (px, py), (nx, ny) = beziers.bezier_point(coefficients, hit.s), beziers.bezier_normal(coefficients, hit.s)
        else:
            curve = tables.arcs[hit.number]
            px, py, nx, ny = arcs.arc_point(arcs.arc_form(curve), curve, curve[c.STRETCH], hit.time, px, py, vx, vy)
        at_corner = near_end(curve, px, py, scope.slack)
    if at_corner:
        return px, py, vx, vy, True
    vx, vy = mirror(vx, vy, nx, ny)
    return px, py, vx, vy, False


@linked
def refined_surface(tables, hit, px, py, vx, vy):
    """-> (qx, qy, nx, ny, bent): the end of a ray segment, the unit normal there, and the curvature (a double).

    In double-doubles.
    """
    if hit.kind == LINE:
        x0, y0, ex, ey, nx, ny = lines.line_frame(tables.joints, hit.number)
        return x0 + hit.s * ex, y0 + hit.s * ey, nx, ny, 0.0
    if hit.kind == ARC:
        arc = tables.arcs[hit.number]
        qx, qy, nx, ny = arcs.arc_point(arcs.refined_form(arc), arc, arc[c.STRETCH], hit.time, px, py, vx, vy)
        return qx, qy, nx, ny, arcs.arc_bend(arc, nx.high, ny.high)
    if hit.kind == BEZIER:
        curve = tables.beziers[hit.number]
        coefficients = beziers.refined_coefficients(curve)
        (qx, qy), (nx, ny) = beziers.bezier_point(coefficients, hit.s), beziers.bezier_normal(coefficients, hit.s)
        return qx, qy, nx, ny, beziers.bezier_bend(curve, hit.s.high)
    nx, ny = (0.0, 1.0) if hit.kind == OPENING else (1.0, 0.0)
    return px + hit.time * vx, py + hit.time * vy, extended(nx), extended(ny), 0.0


class Face(NamedTuple):
    """A piece: kind, row of a line, arc as a row of `refined_arcs`, row of a Bezier piece and parameter on it.

    Fields of other kinds are not used.
    """

    kind: int
    number: int
    arc: Floats
    curve: Floats
    s: DoubleDouble


@linked_allocating
def face_of(tables, kind, number, s):
    """-> Face: a piece, given by kind, row and parameter in the tables of doubles."""
    arc, curve = np.empty(0), np.empty(0)
    if kind == ARC:
        arc = arcs.refined_arcs(carray(tables.arcs[number], (1, c.ARC_COLUMNS)))[0]
    if kind == BEZIER:
        curve = carray(tables.beziers[number], c.BEZIER_COLUMNS)
    return Face(kind, number, arc, curve, extended(s))


@linked
def refined_face(tables, hit):
    """-> Face: the piece of a hit in the tables of double-doubles."""
    arc, curve = (
        tables.arcs[hit.number if hit.kind == ARC else 0],
        tables.beziers[hit.number if hit.kind == BEZIER else 0],
    )
    return Face(hit.kind, hit.number, arc, curve, hit.s)


@linked
def height_over(joints, face, px, py):
    """-> (height, nx, ny): distance of a position from a piece, positive on the free side, and the unit normal."""
    if face.kind == LINE:
        return lines.line_height(joints, face.number, px, py)
    if face.kind == ARC:
        return arcs.arc_height(face.arc, px, py)
    return beziers.bezier_height(face.curve, face.s, px, py)


@linked
def ends_of(joints, face):
    """-> (x0, y0, x1, y1): the ends of a piece."""
    if face.kind == LINE:
        return lines.line_ends(joints, face.number)
    curve = face.arc if face.kind == ARC else face.curve
    return curve[c.START_X], curve[c.START_Y], curve[c.END_X], curve[c.END_Y]
