"""The compiled loop of the planar tracer: the hollow that a ray enters, and its segments to the exit. Loads numba.

One compiled version serves all walls: a table is empty if the wall has no such piece. The formulas are numerically
stable, and no epsilon decides which piece is hit:

* For hits on lines, arcs and Bezier pieces see `pieces`.
* A piece within rounding of the ray's start is hit only if the start lies in front of it by the exact positions of the
  joints, see `in_front_at`. So the opposite face of a plate of zero thickness or of a sharp peak is not hit. The loop
  only detects such pieces, and `hit_nearby` tests them again, so that the loop itself contains no call.
* After each bounce the hit point is projected onto its piece, and the velocity is renormalised.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from ...curves import columns as c
from ...curves.columns import NEARBY_SLACKS, Struct
from ...scene.closed_forms import BOXES, CONTENT, TREE_COLUMNS
from ...scene.compiled.compiling import (
    ROW,
    Late,
    Table,
    allocating,
    call_late,
    checked,
    compiled,
    inlined,
    inner,
    is_raised,
    kind_of,
    linked,
    named,
    reader_of,
)
from ...scene.scene import no_tables
from ..double_double.numbers import extended
from .pieces import arcs, beziers, records
from .pieces.arcs import arc_form, arc_normal, on_smooth_end
from .pieces.beziers import bend_number, nearest_bezier
from .pieces.formulas import FLAT_TOP, TOP_CORNER, bounds_of, exit_time, opening_at, with_length_one
from .pieces.kinds import (
    CURVES,
    Arrival,
    face_of,
    in_front_at,
    incidence,
    line_in_front_of_line,
    nearest_curve,
    piece_nearby,
    reflect,
)
from .pieces.lines import is_ahead, joint_side, line_at, line_hit
from .pieces.records import ARC, BEZIER, FIRST_CURVE, LINE, NO_DETAILS, NO_PIECE, NO_RAYS, OPENING, SIDE, Hit, Own, Rays
from .runs import skip_chords, skip_crossings
from .tree import NO_LINE_HIT, first_boxes, nearest_line_in_boxes, next_leaf, tree_of
from .trigonometry import LAST_ANGLE, direction_angle, mirrored, sine_cosine

# A value of `Hit.uncertainty`: the side of the piece on which the ray starts is not resolved.
UNCERTAIN = 2
# Constants of these types, because numba compiles a function again for every literal argument.
FORWARD, A_LINE = np.bool_(True), np.int64(LINE)


@allocating
def starts_in_front(tables, hit, own, px, py, vx, vy, slack):
    """-> bool: whether a ray that left a piece starts, or may start, in front of a nearby piece; see `in_front_at`.

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


# The last one, of rays that end on curves, only where `Tables` say so.
ESCAPED, CORNER, GRAZING, BOUNCE_LIMIT, ABSORBED = 0, 1, 2, 3, 4
# Limit on the segments of a ray, 20 to 100 ms of work. A run of hits counts as one segment.
MOST_STEPS = 1_000_000
# An odd number without pattern, so that itineraries with the same pieces in another order differ.
HASH_FACTOR = np.uint64(0x9E3779B97F4A7C15)
# What `skip_run` returns without a run.
NO_RUN = 0.0, 0.0, 0.0, 0.0, 0
# Shift to bits that the numbers of the pieces do not reach.
BEND_SHIFT = 40


@inlined
def scope_of(tables, h, slots):
    """-> Scope: hollow number h."""
    hollow = tables.hollows[h]
    left, right, slack, joints, curves = bounds_of(hollow)
    has_tree = hollow[c.TREE_LEVELS] > 0.0
    return records.Scope(tables, hollow, left, right, slack, joints, curves, has_tree, slots)


@inlined
def nearest_line(scope, own, px, py, vx, vy, time):
    """-> (t, line, fraction, corner, nearby): the first line before ``time``, and the time to the first corner; or inf.

    ``nearby`` is true if a line is so close that rounding of the start may decide the hit; see `hit_nearby`.
    """
    tables, slack = scope.tables, scope.slack
    joints = tables.joints
    close = NEARBY_SLACKS * slack
    best, found, best_fraction, nearby = np.inf, -1, 0.0, False
    at_entry, (first, end) = own.bounces == 0, scope.joints
    c_before, corner_time = joint_side(joints, first, at_entry, px, py, vx, vy, slack)
    for j in range(first, end - 1):
        c_after, ahead = joint_side(joints, j + 1, at_entry, px, py, vx, vy, slack)
        corner_time = min(corner_time, ahead)
        if c_before >= 0.0 >= c_after and c_before > c_after and joints[j, c.STARTS_LINE] > 0.0:
            is_own = own.kind == LINE and own.number == j
            if not is_own:
                line = line_at(tables, j)
                t, fraction, _, _ = line_hit(line, c_before, c_after, px, py, vx, vy)
                if is_ahead(t, c_before - c_after, line.length, close, slack):
                    if t < min(best, time):
                        best, found, best_fraction = t, j, fraction
                elif t >= -close:
                    nearby = True
        c_before = c_after
    return best, found, best_fraction, corner_time, nearby


@inlined
def nearest_piece(scope, own, px, py, vx, vy):
    """-> (Hit, corner): the first hit on a piece, and the time to the first corner within the slack of the ray."""
    hit, contact, nearby = nearest_curve(scope, own, px, py, vx, vy)
    if scope.has_tree:
        own_line = own.number if own.kind == LINE else -1
        arguments = tree_of(scope), own_line, own.bounces == 0, px, py, vx, vy, hit.time
        t, line, fraction, corner, near = call_late(scope.slots.boxes, NO_LINE_HIT, arguments)
    else:
        t, line, fraction, corner, near = nearest_line(scope, own, px, py, vx, vy, hit.time)
    if t < hit.time:
        hit = Hit(t, LINE, line, fraction, 0)
    if contact < np.inf and is_beside(scope, hit, contact, px, py, vx, vy):
        # of no piece in particular
        hit = Hit(min(contact, hit.time), BEZIER, -1, 0.0, 1)
    if nearby or near:
        close_by = call_late(scope.slots.nearby, hit, (scope, own, px, py, vx, vy))
        if close_by.time < hit.time:
            hit = close_by
    return hit, corner


@inlined
def is_beside(scope, hit, contact, px, py, vx, vy):
    """-> bool: whether a tangent hit after the time ``contact`` comes before a hit, or may be the same for rounding.

    At a smooth joint the ray may touch one piece and seem to hit the other before. At the hit, the point of contact is
    then in front of the tangent by rounding, and by far less than the bound here.
    """
    sine = call_late(scope.slots.incidence, 0.0, (scope.tables, hit, px, py, vx, vy))
    return contact <= hit.time or (contact - hit.time) * sine <= NEARBY_SLACKS * scope.slack


@inlined
def meets_corner(scope, hit, corner, px, py, vx, vy):
    """-> bool: whether a ray meets the corner that it passes after the time ``corner``, besides or before its hit."""
    if corner == np.inf:
        return False
    time, slack = hit.time, scope.slack
    if corner <= time + slack:
        return True
    # at grazing incidence a corner within the slack of the ray may lie far beyond the hit
    if hit.kind == BEZIER or hit.kind == SIDE:
        return False
    sine = call_late(scope.slots.incidence, 0.0, (scope.tables, hit, px, py, vx, vy))
    return (corner - time) * sine <= 2.0 * slack


@inlined
def may_run(tables, hit, own, px, py, vx, vy):
    """-> bool: whether a run of hits may follow a hit, so that `skip_run` is worth a call."""
    if hit.kind == ARC:
        arc = tables.curves[arcs.TABLE][hit.number]
        qx, qy = px - arc[c.START_X], py - arc[c.START_Y]
        nx, ny = arc_normal(arc_form(arc), 1.0, qx, qy)
        return (arc[c.RUN_SINE] > 0.0) & (vx * nx + vy * ny <= arc[c.RUN_SINE])
    # the ray came from this line, hit the other one, and came back
    came_back = hit.kind == LINE and own.kind == LINE and own.before == hit.number
    return came_back and tables.lines[hit.number, c.PAIRS_END] > 0.0


@inner
def skip_run(scope, hit, own, px, py, vx, vy, most):
    """-> (px, py, vx, vy, hits): the ray after the run of hits that follows a hit; no hits if a run does not pay."""
    tables, number = scope.tables, hit.number
    if hit.kind == ARC and tables.curves[arcs.TABLE][number, c.RUN_SINE] > 0.0:
        return skip_chords(tables.curves[arcs.TABLE][number], px, py, vx, vy, most)
    if hit.kind == LINE:
        lines, pairs = tables.lines, tables.pairs
        normal = lines[number, c.LINE_NORMAL_X], lines[number, c.LINE_NORMAL_Y]
        for row in range(np.int64(lines[number, c.FIRST_PAIR]), np.int64(lines[number, c.PAIRS_END])):
            if pairs[row, c.PARTNER] == own.number:
                return skip_crossings(pairs[row], normal, px, py, vx, vy, scope.slack, most)
    return px, py, vx, vy, np.int64(0)


@inner
def piece_label(tables, hit, vx):
    """-> int: a number for the piece or side that is hit; for a Bezier piece, of its part between inflections."""
    side = 1 if hit.kind == SIDE and vx > 0.0 else 0
    number = 8 * (hit.number + 1 + side) + hit.kind
    if hit.kind == BEZIER:
        number += bend_number(tables.curves[beziers.TABLE][hit.number], hit.s) << BEND_SHIFT
    return np.uint64(number)


@inlined
def trace_ray(scope, entry, theta, limit, labelled, with_path, path):
    """-> (x, vx, vy, bounces, status, label, steps): trace one ray through one hollow.

    In an open wall x is unfolded. ``label`` is the hash of `Details.itinerary`, if ``labelled``; ``steps`` are
    `Details.segments`; ``path`` is `Details.path`.
    """
    sine, cosine = sine_cosine(theta)
    px, py, vx, vy, shift = entry, 0.0, -cosine, -sine, 0.0
    own = Own(OPENING, -1, -1.0, 0.0, -1, 0)
    steps, label = 0, np.uint64(0)
    if with_path:
        path[0, c.POINT_X], path[0, c.POINT_Y] = px, py
    while True:
        hit, corner = nearest_piece(scope, own, px, py, vx, vy)
        bounces = own.bounces
        if hit.uncertainty == UNCERTAIN:
            return shift + px, vx, vy, bounces, CORNER, label, steps
        time, kind = exit_time(scope, own, px, py, vx, vy, hit.time)
        if kind != NO_PIECE:
            hit = Hit(time, kind, hit.number, hit.s, hit.uncertainty)
        steps += 1
        if hit.kind == NO_PIECE or meets_corner(scope, hit, corner, px, py, vx, vy):
            return shift + px, vx, vy, bounces, CORNER, label, steps
        if hit.kind == OPENING:
            if with_path:
                path[bounces + 1, c.POINT_X], path[bounces + 1, c.POINT_Y] = shift + px + hit.time * vx, 0.0
            return shift + px + hit.time * vx, vx, vy, bounces, ESCAPED, label, steps
        if hit.uncertainty != 0:
            return shift + px, vx, vy, bounces, GRAZING, label, steps
        if (bounces >= limit and hit.kind != SIDE) or steps > MOST_STEPS:
            return shift + px, vx, vy, bounces, BOUNCE_LIMIT, label, steps
        if labelled:
            label = HASH_FACTOR * label + call_late(scope.slots.label, label, (scope.tables, hit, vx))
        if scope.tables.curves_absorb and hit.kind >= FIRST_CURVE:
            return shift + px, vx, vy, bounces, ABSORBED, label, steps
        if hit.kind == SIDE:
            # the two ends of the wall are the same point, and a ray passes a side above this point
            py = max(py + hit.time * vy, scope.tables.joints[scope.joints[0], c.JOINT_Y])
            px = scope.left if vx > 0.0 else scope.right
            shift += (scope.right - scope.left) if vx > 0.0 else (scope.left - scope.right)
            own = Own(SIDE, -1, -1.0, own.flown, -1, bounces)
            continue
        px, py, vx, vy, at_corner = reflect(scope, hit, own, px, py, vx, vy)
        if at_corner:
            return shift + px, vx, vy, bounces, CORNER, label, steps
        flown = hit.time
        if not with_path:
            hits = np.int64(0)
            if may_run(scope.tables, hit, own, px, py, vx, vy):
                arguments = scope, hit, own, px, py, vx, vy, limit - bounces - 1
                px, py, vx, vy, hits = call_late(scope.slots.run, NO_RUN, arguments)
                bounces += hits
                # no segment of a run passes a piece from behind
                flown = 0.0 if hits > 0 else flown
            if labelled:
                label = HASH_FACTOR * label + np.uint64(hits)
        vx, vy = with_length_one(vx, vy)
        bounces += 1
        before = own.number if own.kind == LINE else -1
        own = Own(hit.kind, hit.number, hit.s if hit.kind == BEZIER else -1.0, flown, before, bounces)
        if with_path:
            path[bounces, c.POINT_X], path[bounces, c.POINT_Y] = px + shift, py


@compiled
def trace_rays(count, rays, tables, limit, details, slots):
    """Trace a block of rays until its flag is raised.

    Of the `Rays`, of the tables, of the `Details` to fill and of `SLOTS` the addresses are given.
    """
    x, theta, out_x, out_theta, collisions, status, stop = rays_at(rays)
    tables, details, slots = tables_at(tables), details_at(details), slots_at(slots)
    cell, labelled = tables.cell, details.with_itinerary
    for i in range(count):
        if is_raised(stop):
            break
        base = math.floor(x[i] / cell) * cell
        h = opening_at(x[i] - base, tables.hollows, tables.hollow_count)
        if h == FLAT_TOP:
            out_x[i], out_theta[i], collisions[i], status[i] = x[i], mirrored(theta[i]), 1, ESCAPED
            continue
        if h == TOP_CORNER:
            out_x[i], out_theta[i], collisions[i], status[i] = x[i], theta[i] - math.pi, 0, CORNER
            continue
        scope = scope_of(tables, h, slots)
        end, vx, vy, collisions[i], status[i], label, steps = trace_ray(
            scope, x[i] - base, theta[i], limit, labelled, details.with_path, details.path
        )
        out_x[i] = base + end
        angle = direction_angle(vx, vy)
        out_theta[i] = min(angle, LAST_ANGLE) if status[i] == ESCAPED else angle
        if labelled:
            details.itinerary[i], details.segments[i] = label, steps
            details.velocity[i, c.POINT_X], details.velocity[i, c.POINT_Y] = vx, vy


def trace_into(rays: Rays, tables: Struct, limit: int, details: Struct = NO_DETAILS) -> None:
    """Trace rays: see `Rays` and `Details` for the arrays to fill."""
    block = Struct(rays)
    checked(lambda: trace_rays(len(rays.x), block.address, tables.address, limit, details.address, SLOTS.address))


def _late_functions() -> tuple[Late, ...]:
    """Return the functions of `Slots`, for all walls."""
    number, integer, truth = types.float64, types.int64, types.boolean
    own = named(Own, integer, integer, number, number, integer, integer)
    hit = named(Hit, number, integer, integer, number, integer)
    ranges = types.UniTuple(integer, 2), types.UniTuple(types.UniTuple(integer, 2), len(CURVES))
    scope = named(records.Scope, TABLES, ROW, *[number] * 3, *ranges, truth, kind_of(NO_SLOTS))
    table = Table(TREE_COLUMNS), Table(c.JOINT_COLUMNS), Table(c.LINE_COLUMNS)
    tree = named(records.Tree, *table, integer, integer, number)
    ray = number, number, number, number
    return (
        Late(hit_nearby, scope, own, *ray),
        Late(starts_in_front, TABLES, hit, own, *ray, number),
        Late(line_starts_in_front, Table(c.JOINT_COLUMNS), integer, own, *ray, number),
        Late(nearest_line_in_boxes, tree, integer, truth, *ray, number),
        Late(skip_run, scope, hit, own, *ray, integer),
        Late(nearest_bezier, Table(c.BEZIER_COLUMNS), integer, integer, integer, number, *ray, number, number),
        Late(on_smooth_end, ROW, *[number] * 6),
        Late(incidence, TABLES, hit, *ray),
        Late(piece_label, TABLES, hit, number),
    )


TABLES, NO_SLOTS = kind_of(no_tables().values), records.Slots(*[0] * len(records.Slots._fields))
LATE = _late_functions()
# For functions that are compiled apart from `trace_rays`.
TRACE = Late(trace_rays, *[types.int64] * 6)
SLOTS = Struct(records.Slots(*(function.slot for function in LATE)))
tables_at, slots_at = reader_of(TABLES), reader_of(kind_of(NO_SLOTS))
rays_at, details_at = reader_of(kind_of(NO_RAYS)), reader_of(kind_of(NO_DETAILS.values))
