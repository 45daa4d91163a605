"""Circular and elliptic arcs, in both number types: the hits of a ray, the point of the hit, distances. Loads numba.

A circular arc is F(r) = n0.r - kappa |r|^2 / 2 = 0, with r relative to its first joint and n0 the unit normal there,
towards the free side; kappa > 0 is focusing. With B the rate of F along a ray of velocity v and
D = B^2 + 2 kappa |v|^2 F, the front root is (B + sqrt(D)) / (kappa |v|^2), and 2 B / (kappa |v|^2) if the ray starts on
the arc. An elliptic arc is circular in coordinates with y multiplied by its stretch.

In doubles an arc is a row of the table ``arcs`` or, for many rays, the tuple of the row's numbers; in double-doubles it
is a row of `refined_arcs`. Its *form* is the tuple of the numbers n0 and kappa.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray  # type: ignore[attr-defined]

from .....core.compilation import jit
from .....core.rounding import EPS
from ....curves import columns as c
from ....curves.arc import Arc
from ....curves.columns import NEARBY_SLACKS, SMOOTH_JOINT, TANGENT_ULPS
from ....scene.compiled.compiling import call_late, inlined, inner, linked, linked_allocating
from ...double_double.numbers import (
    LOCAL_ERROR,
    cross,
    dot,
    double_double,
    extended,
    like,
    root,
    scaled,
    sine_cosine,
    two_sum,
    where,
)
from .formulas import curve_ends, near_end
from .records import ARC

# Of this type, because numba compiles a function again for a literal argument.
NOT_OWN = np.bool_(False)

# Bound, times B^2 + |v|^2, on the error of D that `tangent_error` gives for a ray near a tangency: there kappa |r| is
# at most |B| and the chord over the radius.
NEARLY_TANGENT = 4.0 * TANGENT_ULPS * EPS


@inlined
def arc_form(arc):
    """-> (n0x, n0y, curvature): the form of an arc."""
    return arc[c.NORMAL_X], arc[c.NORMAL_Y], arc[c.CURVATURE]


@inlined
def arc_chord(arc):
    """-> (ex, ey, short): the unit vector along the chord, and its length, 0 for half angles beyond pi/4."""
    return arc[c.CHORD_X], arc[c.CHORD_Y], arc[c.SHORT_CHORD]


@jit()
def refined_arcs(arcs):
    """Return the table of arcs that go through both joints exactly and subtend their span exactly.

    It has the columns of arcs, then the low parts of the numbers from NORMAL_X to SHORT_CHORD.
    """
    # at least one row, because `refined_face` passes a row of the first table also for lines
    table = np.zeros((max(1, arcs.shape[0]), c.REFINED_ARC_COLUMNS))
    for k in range(arcs.shape[0]):
        arc, row = arcs[k], table[k]
        for column in range(c.ARC_COLUMNS):
            row[column] = arc[column]
        cx, cy = two_sum(arc[c.END_X], -arc[c.START_X]), arc[c.STRETCH] * two_sum(arc[c.END_Y], -arc[c.START_Y])
        length = root(dot(cx, cy, cx, cy))
        ex, ey = cx / length, cy / length
        sine, cosine = sine_cosine(0.5 * arc[c.SPAN])
        if arc[c.CURVATURE] < 0.0:
            sine = -sine
        # n0 = (s ex - c ey, s ey + c ex), kappa = 2 s / length
        nx, ny = sine * ex - cosine * ey, sine * ey + cosine * ex
        curvature = scaled(2.0, sine) / length
        numbers = nx, ny, curvature, ex, ey, length if arc[c.SHORT_CHORD] > 0.0 else extended(0.0)
        for j in range(len(numbers)):
            row[c.NORMAL_X + j], row[c.NORMAL_X + j + c.LOWS] = numbers[j].high, numbers[j].low
    return table


@linked
def number_at(arc, column):
    """-> number: the double-double in a column of a row of `refined_arcs`."""
    return double_double(arc[column], arc[column + c.LOWS])


@linked
def refined_form(arc):
    """-> (n0x, n0y, curvature): the form of an arc in double-doubles."""
    return number_at(arc, c.NORMAL_X), number_at(arc, c.NORMAL_Y), number_at(arc, c.CURVATURE)


@linked
def refined_chord(arc):
    """-> (ex, ey, short): `arc_chord` in double-doubles."""
    return number_at(arc, c.CHORD_X), number_at(arc, c.CHORD_Y), number_at(arc, c.SHORT_CHORD)


@inlined
def form_value(form, x, y):
    """-> number: F at a position relative to the first joint."""
    nx, ny, curvature = form
    return dot(nx, ny, x, y) - scaled(0.5, curvature * dot(x, y, x, y))


@inlined
def arc_normal(form, stretch, x, y):
    """-> (nx, ny): the gradient of F with its y stretched: a normal of the arc, without stretch the unit normal."""
    nx, ny, curvature = form
    return nx - curvature * x, stretch * (ny - curvature * y)


@inlined
def arc_terms(form, x, y, vx, vy):
    """-> (b, f, d, speed2): the numbers B, F, D and |v|^2 of a ray, in coordinates with a circular arc."""
    nx, ny, curvature = form
    b = dot(nx, ny, vx, vy) - curvature * dot(x, y, vx, vy)
    f, speed2 = form_value(form, x, y), dot(vx, vy, vx, vy)
    return b, f, b * b + scaled(2.0, curvature * speed2 * f), speed2


@inlined
def arc_root(form, is_own, b, f, root_of_d, speed2):
    """-> number: time to the front of an arc, of a ray that meets it."""
    _, _, curvature = form
    # only of a focusing arc
    far = b >= where(curvature > 0.0, 0.0, float("inf"))
    top = where(is_own, scaled(2.0, b), where(far, b + root_of_d, scaled(2.0, f)))
    return top / where(is_own | far, curvature * speed2, root_of_d - b)


@inlined
def front_hit(form, own, b, f, d, speed2):
    """-> (t, height): time to the front of the full circle or ellipse, inf if there is no hit.

    For a hit close by, ``height`` is about the distance of the start in front of the arc, in coordinates with a
    circular arc; inf for a hit on the far side of a focusing arc.
    """
    _, _, curvature = form
    far = own or b >= 0.0
    if (far and curvature <= 0.0) or (own and b <= 0.0) or (not own and d < 0.0):
        return like(b, np.inf), like(b, np.inf)
    return arc_root(form, own, b, f, root(where(own, 0.0, d)), speed2), where(far, np.inf, f)


@inlined
def beyond_end(form, chord, x, y):
    """-> number: how far a point of the full circle, relative to the first joint, is beyond an end of the arc.

    The distance is along or across the chord, inf on the far side of the circle, and at most 0 on the arc.
    """
    (_, _, curvature), (ex, ey, short) = form, chord
    # up to a half angle of pi/4: by the position along the chord, on the arc's side of the circle
    along, (nx, ny) = dot(x, y, ex, ey), arc_normal(form, 1.0, x, y)
    beyond = where(-along > along - short, -along, along - short)
    # larger half angles: by the side of the chord; the arc curves away from its free side exactly if it is focusing
    height = cross(ex, ey, x, y)
    height = where(curvature > 0.0, height, -height)
    return where(short > 0.0, where(cross(ex, ey, nx, ny) > 0.0, beyond, float("inf")), height)


@inlined
def arc_point(form, arc, stretch, t, px, py, vx, vy):
    """-> (x, y, nx, ny): the position on an arc after the time t, by a Newton step on F, and the unit normal there."""
    x, y = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    f, (nx, ny) = form_value(form, x, y), arc_normal(form, 1.0, x, y)
    x, y = x - f * nx, y - f * ny
    nx, ny = arc_normal(form, stretch, x, y)
    scale = 1.0 / root(dot(nx, ny, nx, ny))
    return arc[c.START_X] + x, arc[c.START_Y] + y / stretch, nx * scale, ny * scale


@inlined
def arc_time(arc, own, px, py, vx, vy):
    """-> (t, tangent, height): `front_hit` of a ray in doubles; ``tangent`` is 1 if rounding may make it a miss."""
    form, stretch = arc_form(arc), arc[c.STRETCH]
    rx, ry = px - arc[c.START_X], stretch * (py - arc[c.START_Y])
    b, f, d, speed2 = arc_terms(form, rx, ry, vx, stretch * vy)
    tangent = 0
    if not own and is_nearly_tangent(arc, b, d, speed2) and abs(d) <= tangent_error(arc, b, rx, ry, speed2):
        tangent = 1
        d = 0.0
    t, height = front_hit(form, own, b, f, d, speed2)
    return t, tangent, height


@inlined
def is_nearly_tangent(arc, b, d, speed2):
    """-> bool: whether hit and miss of a ray that started elsewhere may not be distinguished; see `tangent_error`."""
    dispersing = b < where(arc[c.CURVATURE] < 0.0, 0.0, -np.inf)
    return dispersing & (abs(d) <= NEARLY_TANGENT * (b * b + speed2))


@inlined
def tangent_error(arc, b, rx, ry, speed2):
    """-> float: the size of D up to which a tangent hit and a miss are not distinguished.

    B has rounding errors of 3 + 4 kappa |r| eps, and F of (3 + 2 kappa |r|) |r| eps; kappa |r| is about |B|. At a
    smooth joint of two arcs a ray between their tangents is tangent to neither, and D is at most the square of their
    angle.
    """
    size = abs(arc[c.CURVATURE]) * (abs(rx) + abs(ry))
    return TANGENT_ULPS * EPS * (b * b + (abs(b) + size) * math.sqrt(speed2)) + SMOOTH_JOINT * SMOOTH_JOINT * speed2


@inlined
def end_excess(arc, qx, qy):
    """-> float: `beyond_end` in doubles."""
    return beyond_end(arc_form(arc), arc_chord(arc), qx, qy)


@inlined
def excess_after(arc, t, px, py, vx, vy):
    """-> float: how far the point of the full circle after the time t is beyond an end of the arc."""
    return end_excess(arc, px + t * vx - arc[c.START_X], arc[c.STRETCH] * (py + t * vy - arc[c.START_Y]))


@inner
def on_smooth_end(arc, t, px, py, vx, vy, slack):
    """-> bool: whether a point of the full circle close beyond an end of the arc, after the time t, counts as on it.

    At grazing incidence rounding moves the point along the arc by more than the slack; at a smooth joint of two arcs it
    would be on neither.
    """
    stretch = arc[c.STRETCH]
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    ex, ey = arc[c.END_X] - arc[c.START_X], stretch * (arc[c.END_Y] - arc[c.START_Y])
    is_late = 2.0 * (qx * ex + qy * ey) > ex * ex + ey * ey
    is_corner = arc[c.END_CORNER if is_late else c.START_CORNER] > 0.0
    across = end_excess(arc, qx, qy) * arc_incidence(arc, t, px, py, vx, vy)
    return not is_corner and across <= slack * max(1.0, stretch)


@inlined
def may_touch_arc(arc, t, px, py, vx, vy, slack):
    """-> bool: whether a ray whose line touches the full circle after the time t may touch the arc.

    The hits that rounding does not distinguish from a tangent one lie up to sqrt(D) / (kappa |v|) beside it.
    """
    stretch = arc[c.STRETCH]
    rx, ry, wy = px - arc[c.START_X], stretch * (py - arc[c.START_Y]), stretch * vy
    b, _, _, speed2 = arc_terms(arc_form(arc), rx, ry, vx, wy)
    reach = math.sqrt(tangent_error(arc, b, rx, ry, speed2) / speed2) / abs(arc[c.CURVATURE])
    return end_excess(arc, rx + t * vx, ry + t * wy) <= slack * max(1.0, stretch) + reach


@inlined
def arc_incidence(arc, t, px, py, vx, vy):
    """-> float: sine of the angle between the velocity and the arc after the time t."""
    stretch = arc[c.STRETCH]
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    nx, ny = arc_normal(arc_form(arc), stretch, qx, qy)
    return abs(vx * nx + vy * ny) / math.sqrt(nx * nx + ny * ny)


# ---- the names that every kind of piece has, see `kinds` --------------------------------------------------------
KIND, TABLE = ARC, Arc.table


@inlined
def nearest(state, scope, own, px, py, vx, vy):
    """-> (time, kind, number, s, contact, nearby): the nearest of these hits and of those on arcs."""
    time, kind, number, hit_s, contact, nearby = state
    slack = scope.slack
    close = NEARBY_SLACKS * slack
    for k in range(scope.curves[TABLE][0], scope.curves[TABLE][1]):
        arc = scope.tables.curves[TABLE][k]
        is_own = own.kind == ARC and own.number == k
        t, tangent, _ = arc_time(arc, is_own, px, py, vx, vy)
        if abs(t) <= close and not is_own:
            nearby = True
        elif tangent != 0:
            if may_touch_arc(arc, t, px, py, vx, vy, slack):
                contact = min(contact, t)
        elif 0.0 <= t < time:
            excess, room = excess_after(arc, t, px, py, vx, vy), slack * max(1.0, arc[c.STRETCH])
            is_met = excess <= room
            if room < excess <= NEARBY_SLACKS * room:
                is_met = call_late(scope.slots.smooth_end, is_met, (arc, t, px, py, vx, vy, slack))
            if is_met:
                time, kind, number = t, ARC, k
    return time, kind, number, hit_s, contact, nearby


@inlined
def nearby(scope, number, own, is_own, px, py, vx, vy):
    """-> (t, s, tangent, is_clear): time to a hit close by, or inf; see `kinds.piece_nearby`."""
    if is_own:
        return np.inf, 0.0, 0, False
    arc, slack = scope.tables.curves[TABLE][number], scope.slack
    stretch = arc[c.STRETCH]
    wide = slack * max(1.0, stretch)
    t, tangent, height = arc_time(arc, NOT_OWN, px, py, vx, vy)
    if abs(t) > NEARBY_SLACKS * slack or height < -wide:
        return np.inf, 0.0, 0, False
    t = max(t, 0.0)
    if end_excess(arc, px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])) > wide:
        return np.inf, 0.0, 0, False
    return t, 0.0, tangent, height > wide


@inlined
def incidence(tables, hit, px, py, vx, vy):
    """-> float: sine of the angle between the velocity and the arc."""
    return arc_incidence(tables.curves[TABLE][hit.number], hit.time, px, py, vx, vy)


@inlined
def surface(scope, hit, own, px, py, vx, vy):
    """-> (px, py, nx, ny, at_corner): the end of a ray segment, the unit normal, and whether it is at a corner."""
    curve = scope.tables.curves[TABLE][hit.number]
    px, py, nx, ny = arc_point(arc_form(curve), curve, curve[c.STRETCH], hit.time, px, py, vx, vy)
    return px, py, nx, ny, near_end(curve, px, py, scope.slack)


@linked
def refined_surface(tables, hit, px, py, vx, vy):
    """-> (qx, qy, nx, ny, bent): see `kinds.refined_surface`."""
    arc = tables.curves[TABLE][hit.number]
    stretch = arc[c.STRETCH]
    qx, qy, nx, ny = arc_point(refined_form(arc), arc, stretch, hit.time, px, py, vx, vy)
    x, y = nx.high, ny.high
    return qx, qy, nx, ny, arc[c.CURVATURE] * (y * y + (stretch * x) ** 2) * math.sqrt(x * x + (y / stretch) ** 2)


@linked
def refined_hit(scope, number, own, is_own, px, py, vx, vy, error):
    """-> (t, s, undecided, clearance, near_s): see `kinds.refined_hit`."""
    arc = scope.tables.curves[TABLE][number]
    form, chord, stretch, undecided = refined_form(arc), refined_chord(arc), arc[c.STRETCH], np.inf
    widest = max(1.0, stretch)
    rx, ry, wy = px - arc[c.START_X], stretch * (py - arc[c.START_Y]), stretch * vy
    b, f, d, speed2 = arc_terms(form, rx, ry, vx, wy)
    _, _, curvature = form
    if not is_own and curvature < 0.0 and b < 0.0:
        # d = w^2 - kappa^2 (distance of the line from the centre)^2 w^2; kappa times distance is about 1 at d = 0
        noise = 8.0 * LOCAL_ERROR * (b.high * b.high + 2.0 * abs((curvature * speed2 * f).high))
        if abs(d.high) <= noise + 4.0 * abs(curvature.high) * widest**4 * error:
            t = arc_root(form, is_own, b, f, extended(0.0), speed2)
            if t > 0.0 and beyond_end(form, chord, rx + t * vx, ry + t * wy) <= error:
                undecided = t.high
    t, height = front_hit(form, is_own, b, f, d, speed2)
    if t < np.inf and beyond_end(form, chord, rx + t * vx, ry + t * wy) > error * widest:
        t, height = extended(np.inf), extended(np.inf)
    clearance = height.high, scope.slack * widest, error * widest
    return t, own.s, undecided, clearance, extended(-1.0)


refined_table = refined_arcs


@linked_allocating
def refined_row(tables, number):
    """-> array: the row of `refined_table` of a row of the table of doubles."""
    return refined_arcs(carray(tables.curves[TABLE][number], (1, c.ARC_COLUMNS)))[0]


@linked
def height(joints, face, px, py):
    """-> (height, nx, ny): see `kinds.height_over`."""
    arc = face.row
    form, stretch = refined_form(arc), arc[c.STRETCH]
    qx, qy = px - arc[c.START_X], stretch * (py - arc[c.START_Y])
    nx, ny = arc_normal(form, stretch, qx, qy)
    size = root(dot(nx, ny, nx, ny))
    return form_value(form, qx, qy) / size, nx / size, ny / size


ends = curve_ends
