"""The formulas of the pieces of a wall: the first hit of a ray on a line, an arc or a Bezier piece, and the reflection.

Loads numba. The loops over one ray, in `rays`, and those over many rays, in `waves`, call the same functions, so a ray
has the same numbers by both. A function that many rays call has choices by `where` in place of branches. A curve is a
row of its table or, for many rays, the tuple of the row's numbers.

* The sign of c = (V - p) x v is the side of the ray on which a joint V lies. A line is hit from its free side exactly
  if c goes from >= 0 at its start to <= 0 at its end. Neighbouring lines share the number c, so no ray passes between
  them.
* A circular arc is F(r) = n0.r - kappa |r|^2 / 2 = 0, with r relative to its first joint and n0 the unit normal there,
  towards the free side; kappa > 0 is focusing. The front root is (B + sqrt(D)) / (kappa |v|^2), and
  2 B / (kappa |v|^2) if the ray starts on the arc. An elliptic arc is circular in stretched coordinates.
* A Bezier piece b(s), 0 <= s <= 1, is hit where g(s) = (b(s) - p) x v falls through zero. The root at the ray's start
  on the piece itself is divided out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....core.rounding import EPS
from ...scene import columns as c
from ...scene.tolerances import JOINT_ULPS, NEARBY_MARGIN, NEARBY_SLACKS, SMOOTH_JOINT, TANGENT_ULPS
from ..double_double import formulas
from ..double_double.beziers import curve_size
from ..double_double.formulas import where
from .options import inlined, inner
from .records import LINE

# Least absolute value of a fraction from a line's end, so that it is negative even if the ray meets that end.
LEAST_FRACTION = 5e-324
# Bound, times B^2 + |v|^2, on the error of D that `tangent_error` gives for a ray near a tangency: there kappa |r| is
# at most |B| and the chord over the radius.
NEARLY_TANGENT = 4.0 * TANGENT_ULPS * EPS
ROOT_STEPS = 80
# What `nearest_bezier` returns for a ray that meets no piece.
NO_BEZIER_HIT = np.inf, -1, 0.0, np.inf, -1.0
# Size, in eps times that of its products, from which on g is not 0: twice that of a contact. Each value of g has about
# eight rounding errors.
NO_ZERO_ULPS = 2.0 * TANGENT_ULPS


@inlined
def side(x, y, px, py, vx, vy):
    """-> float: the number c of a point."""
    return (x - px) * vy - (y - py) * vx


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


@inlined
def nearest_line(scope, own, px, py, vx, vy, time):
    """-> (t, line, fraction, corner, nearby): the first line before ``time``, and the time to the first corner; or inf.

    ``nearby`` is true if a line is so close that rounding of the start may decide the hit; see `nearby`.
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
def arc_form(arc):
    """-> (n0x, n0y, curvature): the numbers of F."""
    return arc[c.NORMAL_X], arc[c.NORMAL_Y], arc[c.CURVATURE]


@inlined
def arc_time(arc, own, px, py, vx, vy, stretch):
    """-> (t, tangent, height): time to the front of the arc, inf if there is no hit.

    ``tangent`` is 1 if hit and miss are not distinguished. For a hit close by, ``height`` is about the distance of the
    start in front of the arc, in coordinates with a circular arc; inf for a hit on the far side of a focusing arc.
    """
    form, curvature = arc_form(arc), arc[c.CURVATURE]
    rx, ry = px - arc[c.START_X], stretch * (py - arc[c.START_Y])
    b, f, d, speed2 = formulas.arc_terms(form, rx, ry, vx, stretch * vy)
    if own:
        if curvature <= 0.0 or b <= 0.0:
            return np.inf, 0, np.inf
        return formulas.arc_root(form, own, b, f, 0.0, speed2), 0, np.inf
    tangent = 0
    if is_nearly_tangent(arc, b, d, speed2) and abs(d) <= tangent_error(arc, b, rx, ry, speed2):
        tangent = 1
        d = 0.0
    if d < 0.0 or (b >= 0.0 and curvature <= 0.0):
        return np.inf, 0, np.inf
    return formulas.arc_root(form, own, b, f, math.sqrt(d), speed2), tangent, np.inf if b >= 0.0 else f


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
def on_arc(arc, qx, qy, slack):
    """-> bool: whether the point q of the full circle, relative to the first joint, is on the arc."""
    return beyond_end(arc, qx, qy) <= slack


@inlined
def beyond_end(arc, qx, qy):
    """-> float: how far the point q of the full circle, relative to the first joint, is beyond an end of the arc."""
    return formulas.beyond_end(arc_form(arc), (arc[c.CHORD_X], arc[c.CHORD_Y], arc[c.SHORT_CHORD]), qx, qy)


@inlined
def on_arc_after(arc, t, px, py, vx, vy, stretch, slack):
    """-> bool: whether the point of the full circle after the time t is on the arc.

    At grazing incidence rounding moves the point along the arc by more than the slack; at a smooth joint of two arcs it
    would be on neither.
    """
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    beyond, room = beyond_end(arc, qx, qy), slack * max(1.0, stretch)
    if room < beyond <= NEARBY_SLACKS * room:
        ex, ey = arc[c.END_X] - arc[c.START_X], stretch * (arc[c.END_Y] - arc[c.START_Y])
        is_late = 2.0 * (qx * ex + qy * ey) > ex * ex + ey * ey
        is_corner = arc[c.END_CORNER if is_late else c.START_CORNER] > 0.0
        return not is_corner and beyond * arc_incidence(arc, t, px, py, vx, vy, stretch) <= room
    return beyond <= room


@inlined
def may_touch_arc(arc, t, px, py, vx, vy, stretch, slack):
    """-> bool: whether a ray whose line touches the full circle after the time t may touch the arc.

    The hits that rounding does not distinguish from a tangent one lie up to sqrt(D) / (kappa |v|) beside it.
    """
    rx, ry, wy = px - arc[c.START_X], stretch * (py - arc[c.START_Y]), stretch * vy
    b, _, _, speed2 = formulas.arc_terms(arc_form(arc), rx, ry, vx, wy)
    reach = math.sqrt(tangent_error(arc, b, rx, ry, speed2) / speed2) / abs(arc[c.CURVATURE])
    return on_arc(arc, rx + t * vx, ry + t * wy, slack * max(1.0, stretch) + reach)


@inlined
def near_end(curve, px, py, slack):
    """-> bool: whether a hit of a curve is within rounding of an end that is a corner."""
    x, y, u, v = px - curve[c.START_X], py - curve[c.START_Y], px - curve[c.END_X], py - curve[c.END_Y]
    at_start = (curve[c.START_CORNER] > 0.0) & (x * x + y * y <= slack * slack)
    return at_start | ((curve[c.END_CORNER] > 0.0) & (u * u + v * v <= slack * slack))


@inlined
def arc_point(arc, t, px, py, vx, vy, stretch):
    """-> (x, y, nx, ny): the position on the arc after the time t, and the unit normal there."""
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    qx, qy = formulas.back_on_arc(arc_form(arc), qx, qy)
    nx, ny = formulas.arc_normal(arc_form(arc), stretch, qx, qy)
    scale = 1.0 / math.sqrt(nx * nx + ny * ny)
    return arc[c.START_X] + qx, arc[c.START_Y] + qy / stretch, nx * scale, ny * scale


@inlined
def arc_incidence(arc, t, px, py, vx, vy, stretch):
    """-> float: sine of the angle between the velocity and the arc after the time t."""
    qx, qy = px + t * vx - arc[c.START_X], stretch * (py + t * vy - arc[c.START_Y])
    nx, ny = formulas.arc_normal(arc_form(arc), stretch, qx, qy)
    return abs(vx * nx + vy * ny) / math.sqrt(nx * nx + ny * ny)


@inlined
def quadratic_root(a0, a1, a2):
    """-> float: the root in [0, 1] at which the quadratic with these coefficients falls, if it has one."""
    disc, rises = a1 * a1 - 4.0 * a2 * a0, a1 > 0.0
    root = math.sqrt(where(disc > 0.0, disc, 0.0))
    # the sum of two numbers of the same sign
    return squeezed((where(rises, -(a1 + root), 2.0 * a0)) / (where(rises, 2.0 * a2, root - a1)))


@inlined
def squeezed(s):
    """-> float: the nearest number in [0, 1]; 0 for NaN."""
    s = where(s > 0.0, s, 0.0)
    return where(s < 1.0, s, 1.0)


@inlined
def end_side(curve, px, py, vx, vy):
    """-> float: g at the end, computed from the joint, so that the next piece has the same number."""
    return side(curve[c.END_X], curve[c.END_Y], px, py, vx, vy)


@inlined
def is_falling(before, after):
    """-> bool: whether a function with these two values, monotonic in between, falls through zero."""
    return (before >= 0.0) & (after <= 0.0) & (before > after)


@inlined
def side_spread(curve, px, py, vx, vy):
    """-> float: the size of the products in the sum g."""
    ux, uy = abs(vx), abs(vy)
    return (where(ux > uy, ux, uy)) * (abs(curve[c.START_X] - px) + abs(curve[c.START_Y] - py) + curve_size(curve))


@inlined
def meets_circle(curve, px, py, vx, vy, time):
    """-> bool: whether a ray meets the circle about a Bezier piece before ``time``; else it meets no other piece."""
    dx, dy = curve[c.MIDDLE_X] - px, curve[c.MIDDLE_Y] - py
    along, room = dx * vx + dy * vy, curve[c.REACH] + NEARBY_MARGIN * (abs(dx) + abs(dy))
    return (abs(dx * vy - dy * vx) <= room) & (along >= -room) & (along - room <= time)


@inlined
def bezier_coefficients(curve):
    """-> (ax, ay): the coefficients of both coordinates."""
    ax = curve[c.START_X], curve[c.X1], curve[c.X2], curve[c.X3]
    return ax, (curve[c.START_Y], curve[c.Y1], curve[c.Y2], curve[c.Y3])


@inlined
def bezier_point(curve, s):
    """-> (x, y): b(s)."""
    ax, ay = bezier_coefficients(curve)
    return formulas.cubic(ax, s), formulas.cubic(ay, s)


@inlined
def bezier_normal(curve, s):
    """-> (nx, ny): the unit normal at b(s)."""
    tx, ty = bezier_tangent(curve, s)
    scale = 1.0 / math.sqrt(tx * tx + ty * ty)
    return -ty * scale, tx * scale


@inlined
def root_step(g, s, low, high):
    """-> (s, low, high, is_last): a safeguarded Halley step to the root between low and high at which a cubic falls.

    It is the last one if the next step would be below one rounding error.
    """
    _, _, a2, a3 = g
    value, slope = formulas.cubic(g, s), formulas.cubic_slope(g, s)
    bend = 3.0 * a3 * s + a2
    low, high = where(value > 0.0, s, low), where(value < 0.0, s, high)
    step = s - value * slope / (slope * slope - value * bend)
    inside = (low <= step) & (step <= high)
    step = where(inside, step, where(value == 0.0, s, 0.5 * (low + high)))
    # the error of the root is, to first order, (bend^2 / slope^2 - a3 / slope) times the third power of the step
    move = step - s
    is_small = abs(move * move * move) * (bend * bend + abs(a3 * slope)) <= EPS * abs(step) * (slope * slope)
    return step, low, high, (inside & is_small) | ((not inside) & ((value == 0.0) | (step == low) | (step == high)))


@inlined
def root_start(g, low, high, value_low, value_high):
    """-> float: the root of the quadratic with the same values as a cubic at low, at high and in the middle."""
    span = high - low
    middle = formulas.cubic(g, low + 0.5 * span)
    rise, bend = 4.0 * middle - 3.0 * value_low - value_high, 2.0 * (value_low + value_high) - 4.0 * middle
    return low + span * quadratic_root(value_low, rise, bend)


@inlined
def falling_root(g, low, high, value_low, value_high):
    """-> float: the root of a cubic that falls from >= 0 at low to <= 0 at high."""
    s = root_start(g, low, high, value_low, value_high)
    for _ in range(ROOT_STEPS):
        s, low, high, is_last = root_step(g, s, low, high)
        if is_last:
            break
    return s


@inlined
def bezier_tangent(curve, s):
    """-> (tx, ty): b'(s)."""
    ax, ay = bezier_coefficients(curve)
    return formulas.cubic_slope(ax, s), formulas.cubic_slope(ay, s)


@inlined
def contact_time(curve, bend, s, px, py, vx, vy):
    """-> float: time to the point s, where the ray's line touches the curve from its free side, else inf.

    ``bend`` is the second derivative of g at s. Of the two hits that merge at s, the front hit is first exactly if the
    curve runs along the ray at a minimum of g or against the ray at a maximum.
    """
    tx, ty = bezier_tangent(curve, s)
    if bend * (tx * vx + ty * vy) <= 0.0:
        return np.inf
    return formulas.bezier_time(bezier_coefficients(curve), s, px, py, vx, vy)


@inlined
def joint_contact_time(curve, g, s, px, py, vx, vy, room):
    """-> float: time to the end s, 0 or 1, of a piece, if it is no corner and the ray runs along it there, else inf.

    The ray's line passes the end within rounding, and ``room`` bounds the rounding errors of g. If the slope of g there
    were certain, hit and miss would be, because the next piece has the same number g and nearly the same slope. Else an
    extremum of g lies at the joint within rounding, on either piece or, where their tangents differ, on none.
    """
    tx, ty = bezier_tangent(curve, s)
    is_steep = abs(formulas.cubic_slope(g, s)) > SMOOTH_JOINT * (abs(tx) + abs(ty)) + room
    if is_steep or curve[c.START_CORNER if s == 0.0 else c.END_CORNER] > 0.0:
        return np.inf
    return formulas.bezier_time(bezier_coefficients(curve), s, px, py, vx, vy)


@inlined
def own_terms(curve, g, own_s):
    """-> (b0, b1, b2, disc, error): of a ray that starts at ``own_s``: g(s) = sigma (b2 sigma^2 + b1 sigma + b0).

    Here sigma = s - own_s, and ``g`` are the coefficients of g. ``error`` bounds the rounding error of b1^2 - 4 b2 b0:
    each b has up to ten rounding errors of the size of the piece.
    """
    _, _, a2, a3 = g
    b0, b1, b2 = formulas.cubic_slope(g, own_s), 3.0 * a3 * own_s + a2, a3
    size = curve_size(curve) * (abs(b0) + abs(b1) + abs(2.0 * b2))
    error = TANGENT_ULPS * EPS * (b1 * b1 + abs(4.0 * b2 * b0) + size)
    return b0, b1, b2, b1 * b1 - 4.0 * b2 * b0, error


@inlined
def own_point(g, own_s, sigma):
    """-> (s, is_front): the point own_s + sigma, and whether it is on the piece and a ray may hit it from its front."""
    s, slack = own_s + sigma, JOINT_ULPS * EPS
    on_piece = (s >= -slack) & (s <= 1.0 + slack)
    s = squeezed(s)
    return s, on_piece & (formulas.cubic_slope(g, s) <= 0.0)


@inlined
def own_hit(curve, g, own_s, sigma, px, py, vx, vy):
    """-> (t, s): time to the point own_s + sigma of the piece on which a ray started, inf if it is no front hit."""
    s, is_front = own_point(g, own_s, sigma)
    t = formulas.bezier_time(bezier_coefficients(curve), s, px, py, vx, vy)
    return where(is_front & (t > 0.0), t, np.inf), s


@inlined
def hit_from_own(curve, g, own_s, px, py, vx, vy, slack):
    """-> (t, s, tangent): first front hit on the Bezier piece that the ray has just left at ``own_s``; inf if none."""
    _, _, a2, a3 = g
    b0, b1, b2, disc, error = own_terms(curve, g, own_s)
    if abs(disc) <= error and b2 != 0.0:
        # the roots that rounding does not distinguish from a double one lie up to ``reach`` beside it
        s, reach = own_s - 0.5 * b1 / b2, 0.5 * math.sqrt(error) / abs(b2)
        if -reach <= s <= 1.0 + reach:
            s = min(max(s, 0.0), 1.0)
            t = contact_time(curve, 6.0 * a3 * s + 2.0 * a2, s, px, py, vx, vy)
            if t > slack:
                return t, s, 1
    if disc < 0.0:
        return np.inf, 0.0, 0
    first, second = formulas.quadratic_roots(b0, b1, b2, disc)
    t, s = own_hit(curve, g, own_s, second, px, py, vx, vy)
    if b2 != 0.0:
        other_t, other_s = own_hit(curve, g, own_s, first, px, py, vx, vy)
        if other_t <= t:
            t, s = other_t, other_s
    return t, s, 0


@inlined
def hit_from_afar(curve, g, px, py, vx, vy, slack):
    """-> (t, s, tangent, near_s): first front hit on a Bezier piece that the ray did not start on; see `bezier_hit`."""
    a0, a1, a2, a3 = g
    spread = side_spread(curve, px, py, vx, vy)
    # g lies between its four Bernstein coefficients, so it has no zero if they have one sign
    b1, b2, b3 = a0 + a1 / 3.0, a0 + (2.0 * a1 + a2) / 3.0, a0 + a1 + a2 + a3
    if max(min(a0, b1, b2, b3), -max(a0, b1, b2, b3)) > NO_ZERO_ULPS * EPS * spread:
        return np.inf, 0.0, 0, -1.0
    # g can fall through zero once on each part of [0, 1] between its extrema
    c1, c2 = formulas.extrema(g)
    best_t, best_s, tangent, near_s = np.inf, 0.0, 0, -1.0
    room = TANGENT_ULPS * EPS * spread
    low, touches = 0.0, False
    value_low = a0
    if abs(a0) <= room:
        t = joint_contact_time(curve, g, 0.0, px, py, vx, vy, room)
        touches = t > slack and t < np.inf
        if touches:
            best_t, best_s, tangent = t, 0.0, 1
    for part in range(3):
        high = 1.0 if part == 2 else (c1 if part == 0 else c2)
        if not low < high <= 1.0:
            if part < 2:
                continue
            high = 1.0
        touched, touches = touches, False
        if high == 1.0:
            value_high = end_side(curve, px, py, vx, vy)
            if abs(value_high) <= room:
                t = joint_contact_time(curve, g, 1.0, px, py, vx, vy, room)
                touches = t > slack and t < np.inf
                if touches and t < best_t:
                    best_t, best_s, tangent = t, 1.0, 1
        else:
            value_high = formulas.cubic(g, high)
            if abs(value_high) <= room:
                t = contact_time(curve, 6.0 * a3 * high + 2.0 * a2, high, px, py, vx, vy)
                touches = t > slack and t < np.inf
                if touches and t < best_t:
                    best_t, best_s, tangent = t, high, 1
        # a root beside a contact equals the contact within rounding
        if is_falling(value_low, value_high) and not touched and not touches:
            if curve[c.X3] == 0.0 and curve[c.Y3] == 0.0:
                s = quadratic_root(a0, a1, a2)
            else:
                s = falling_root(g, low, high, value_low, value_high)
            t = formulas.bezier_time(bezier_coefficients(curve), s, px, py, vx, vy)
            if t < best_t:
                if formulas.is_close_by(bezier_tangent(curve, s), s, t, vx, vy, spread, slack):
                    near_s = s
                elif t > 0.0:
                    best_t, best_s, tangent = t, s, 0
        low, value_low = high, value_high
    return best_t, best_s, tangent, near_s


@inlined
def bezier_hit(curve, own_s, px, py, vx, vy, slack):
    """-> (t, s, tangent, near_s): time to the first front hit on a Bezier piece, inf if none, and its parameter.

    ``tangent`` is 1 if hit and miss are not distinguished. ``own_s`` is below 0 if the ray does not start on the piece.
    A hit within the slack of the start is not counted: ``near_s`` is its parameter, -1 if there is none.
    """
    g = formulas.bezier_sides(bezier_coefficients(curve), px, py, vx, vy)
    if own_s >= 0.0:
        t, s, tangent = hit_from_own(curve, g, own_s, px, py, vx, vy, slack)
        return t, s, tangent, -1.0
    return hit_from_afar(curve, g, px, py, vx, vy, slack)


@inner
def nearest_bezier(beziers, first, end, own_number, own_s, px, py, vx, vy, slack, time):
    """-> (t, number, s, contact, near_s): the first hit before ``time`` on the pieces from ``first`` to ``end``.

    ``contact`` is the time to the first tangent hit, which is not counted, or inf. ``near_s`` is that of the last piece
    that has one, else -1; for all else see `bezier_hit`. The ray starts on the piece ``own_number`` at ``own_s``; the
    number is -1 if it starts elsewhere.
    """
    number, hit_s, contact, near = -1, 0.0, np.inf, -1.0
    for k in range(first, end):
        curve = beziers[k]
        # no short circuit, because the processor guesses its branches wrong
        if (k != own_number) & (not meets_circle(curve, px, py, vx, vy, time)):
            continue
        t, s, tangent, near_s = bezier_hit(curve, own_s if k == own_number else -1.0, px, py, vx, vy, slack)
        if tangent != 0:
            contact = min(contact, t)
        elif t < time:
            time, number, hit_s = t, k, s
        if near_s >= 0.0:
            near = near_s
    return time, number, hit_s, contact, near


@inlined
def bend_number(curve, s):
    """-> int: the number, 0, 1 or 2, of the part between inflections that contains the point s of a Bezier piece.

    Only on a part without inflection the front hit is unique and moves continuously with the ray. A ray that just
    misses a bump may hit the same piece behind the bump.
    """
    # the curvature has the sign of b' x b'', which is a quadratic in s for a cubic b
    c0 = 2.0 * (curve[c.X1] * curve[c.Y2] - curve[c.Y1] * curve[c.X2])
    c1 = 6.0 * (curve[c.X1] * curve[c.Y3] - curve[c.Y1] * curve[c.X3])
    c2 = 6.0 * (curve[c.X2] * curve[c.Y3] - curve[c.Y2] * curve[c.X3])
    disc = c1 * c1 - 4.0 * c2 * c0
    if disc <= 0.0:
        return 0
    q = -0.5 * (c1 + math.copysign(math.sqrt(disc), c1))
    number = 0
    if q != 0.0 and 0.0 < c0 / q < s:
        number += 1
    if c2 != 0.0 and 0.0 < q / c2 < s:
        number += 1
    return number
