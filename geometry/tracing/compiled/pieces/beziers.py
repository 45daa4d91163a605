"""Bezier pieces, in both number types: the hits of a ray, the point of the hit, distances. Loads numba.

A Bezier piece b(s), 0 <= s <= 1, is hit where g(s) = (b(s) - p) x v falls through zero. The root at the ray's start on
the piece itself is divided out.

In doubles a piece is a row of the table ``beziers`` or, for many rays, the tuple of the row's numbers. Its
*coefficients* are those of both coordinates; in double-doubles the highest one makes the piece end exactly at its
joint. A quadratic piece has a3 = 0 in both.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray  # type: ignore[attr-defined]
from numba.extending import overload

from .....core.rounding import EPS
from ....curves import columns as c
from ....curves.bezier import Bezier
from ....curves.columns import JOINT_ULPS, NEARBY, NEARBY_MARGIN, SMOOTH_JOINT, TANGENT_ULPS
from ....scene.compiled.compiling import call_late, inlined, inner, linked, linked_allocating
from ...double_double.numbers import (
    DOUBLE_DOUBLE,
    LOCAL_ERROR,
    OPTIONS,
    cross,
    dot,
    extended,
    like,
    root,
    rounded,
    scaled,
    where,
)
from .formulas import curve_ends, near_end, side
from .records import BEZIER

ROOT_STEPS = 80
# Limit on bisections in double-doubles, more than the search for neighbouring doubles needs.
BISECTIONS = 200
# What `nearest_bezier` returns for a ray that meets no piece.
NO_BEZIER_HIT = np.inf, -1, 0.0, np.inf, -1.0
# Size, in eps times that of its products, from which on g is not 0: twice that of a contact. Each value of g has about
# eight rounding errors.
NO_ZERO_ULPS = 2.0 * TANGENT_ULPS
# Distance in the parameter beyond an end within which a hit from the piece itself is on the piece.
OWN_SLACK = JOINT_ULPS * EPS
# Newton steps that project a position onto a piece within rounding of it; each step squares the error.
STEPS = 2


@inlined
def bezier_coefficients(curve):
    """-> (ax, ay): the coefficients of both coordinates."""
    ax = curve[c.START_X], curve[c.X1], curve[c.X2], curve[c.X3]
    return ax, (curve[c.START_Y], curve[c.Y1], curve[c.Y2], curve[c.Y3])


@linked
def refined_coefficients(curve):
    """-> (ax, ay): the coefficients in double-doubles."""
    is_quadratic = curve[c.X3] == 0.0 and curve[c.Y3] == 0.0
    ax, ay = bezier_coefficients(curve)
    return exact_coefficients(ax, curve[c.END_X], is_quadratic), exact_coefficients(ay, curve[c.END_Y], is_quadratic)


@linked
def exact_coefficients(a, end, is_quadratic):
    """-> (a0, a1, a2, a3): of one coordinate of a piece that ends exactly at its joint."""
    a0, a1, a2, a3 = a
    rest = extended(end) - a0 - a1
    if is_quadratic:
        return extended(a0), extended(a1), rest, extended(a3)
    return extended(a0), extended(a1), extended(a2), rest - a2


@inlined
def cubic(a, s):
    """-> number: the cubic with the coefficients a at s."""
    a0, a1, a2, a3 = a
    return ((a3 * s + a2) * s + a1) * s + a0


@inlined
def cubic_slope(a, s):
    """-> number: the derivative of the cubic with the coefficients a at s."""
    _, a1, a2, a3 = a
    return (3.0 * a3 * s + scaled(2.0, a2)) * s + a1


@inlined
def extrema(a):
    """-> (first, second): the extrema of a cubic in increasing order; those outside (0, 1) may be any numbers."""
    _, a1, a2, a3 = a
    disc = a2 * a2 - 3.0 * a3 * a1
    half = root(disc)
    q = -(a2 + where(a2 >= 0.0, half, -half))
    one, other = q / (3.0 * a3), a1 / q
    first, second = where(one < other, one, other), where(one < other, other, one)
    return where(disc > 0.0, first, 2.0), where(disc > 0.0, second, 2.0)


@inlined
def quadratic_roots(b0, b1, b2, disc):
    """-> (first, second): the roots of b2 sigma^2 + b1 sigma + b0; inf or NaN where there is none."""
    half = root(disc)
    q = scaled(-0.5, b1 + where(b1 >= 0.0, half, -half))
    return q / b2, b0 / q


@inlined
def bezier_point(coefficients, s):
    """-> (x, y): b(s)."""
    ax, ay = coefficients
    return cubic(ax, s), cubic(ay, s)


@inlined
def bezier_tangent(coefficients, s):
    """-> (tx, ty): b'(s)."""
    ax, ay = coefficients
    return cubic_slope(ax, s), cubic_slope(ay, s)


@inlined
def bezier_normal(coefficients, s):
    """-> (nx, ny): the unit normal at b(s)."""
    tx, ty = bezier_tangent(coefficients, s)
    scale = 1.0 / root(dot(tx, ty, tx, ty))
    return -ty * scale, tx * scale


@linked
def bezier_bend(curve, s):
    """-> float: the curvature at b(s), positive if it is focusing; s is a double."""
    coefficients = (_, _, ax2, ax3), (_, _, ay2, ay3) = bezier_coefficients(curve)
    tx, ty = bezier_tangent(coefficients, s)
    bx, by = 2.0 * ax2 + 6.0 * ax3 * s, 2.0 * ay2 + 6.0 * ay3 * s
    return (tx * by - ty * bx) / math.hypot(tx, ty) ** 3


@inlined
def bezier_time(coefficients, s, px, py, vx, vy):
    """-> number: the distance along the ray to the point s of a piece."""
    x, y = bezier_point(coefficients, s)
    return dot(x - px, y - py, vx, vy)


@inlined
def bezier_sides(coefficients, px, py, vx, vy):
    """-> (a0, a1, a2, a3): the coefficients of g."""
    (x0, x1, x2, x3), (y0, y1, y2, y3) = coefficients
    return cross(x0 - px, y0 - py, vx, vy), cross(x1, y1, vx, vy), cross(x2, y2, vx, vy), cross(x3, y3, vx, vy)


@inlined
def end_side(curve, px, py, vx, vy):
    """-> number: g at the end, computed from the joint, so that the next piece has the same number."""
    return side(curve[c.END_X], curve[c.END_Y], px, py, vx, vy)


@inlined
def is_falling(before, after):
    """-> bool: whether a function with these two values, monotonic in between, falls through zero."""
    return (before >= 0.0) & (after <= 0.0) & (before > after)


@inlined
def curve_size(curve):
    """-> float: a bound on the extent of a piece: the sum of the absolute non-constant coefficients."""
    return (
        abs(curve[c.X1]) + abs(curve[c.Y1]) + abs(curve[c.X2]) + abs(curve[c.Y2]) + abs(curve[c.X3]) + abs(curve[c.Y3])
    )


@inlined
def side_spread(curve, px, py, vx, vy):
    """-> float: the size of the products in the sum g, of a ray in doubles."""
    ux, uy = abs(vx), abs(vy)
    return (where(ux > uy, ux, uy)) * (abs(curve[c.START_X] - px) + abs(curve[c.START_Y] - py) + curve_size(curve))


@inlined
def meets_circle(curve, px, py, vx, vy, time):
    """-> bool: whether a ray meets the circle about a Bezier piece before ``time``; else it meets no other piece."""
    dx, dy = curve[c.MIDDLE_X] - px, curve[c.MIDDLE_Y] - py
    along, room = dx * vx + dy * vy, curve[c.REACH] + NEARBY_MARGIN * (abs(dx) + abs(dy))
    return (abs(dx * vy - dy * vx) <= room) & (along >= -room) & (along - room <= time)


@inlined
def squeezed(s):
    """-> number: the nearest number in [0, 1]; 0 for NaN."""
    s = where(s > 0.0, s, 0.0)
    return where(s < 1.0, s, 1.0)


@inlined
def quadratic_root(a0, a1, a2):
    """-> float: the root in [0, 1] at which the quadratic with these coefficients falls, if it has one."""
    disc, rises = a1 * a1 - 4.0 * a2 * a0, a1 > 0.0
    root_of_disc = math.sqrt(where(disc > 0.0, disc, 0.0))
    # the sum of two numbers of the same sign
    top = where(rises, -(a1 + root_of_disc), 2.0 * a0)
    return squeezed(top / (where(rises, 2.0 * a2, root_of_disc - a1)))


@inlined
def root_step(g, s, low, high):
    """-> (s, low, high, is_last): a safeguarded Halley step to the root between low and high at which a cubic falls.

    It is the last one if the next step would be below one rounding error.
    """
    _, _, a2, a3 = g
    value, slope = cubic(g, s), cubic_slope(g, s)
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
    middle = cubic(g, low + 0.5 * span)
    rise, bend = 4.0 * middle - 3.0 * value_low - value_high, 2.0 * (value_low + value_high) - 4.0 * middle
    return low + span * quadratic_root(value_low, rise, bend)


@inlined
def root_in_doubles(g, low, high, value_low, value_high):
    """-> float: `falling_root` in doubles."""
    a0, a1, a2, a3 = g
    if a3 == 0.0:
        return quadratic_root(a0, a1, a2)
    s = root_start(g, low, high, value_low, value_high)
    for _ in range(ROOT_STEPS):
        s, low, high, is_last = root_step(g, s, low, high)
        if is_last:
            break
    return s


@linked
def refined_root(g, low, high):
    """-> number: `falling_root` in double-doubles, by bisection and Newton steps."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        if cubic(g, middle) >= 0.0:
            low = middle
        else:
            high = middle
    s = extended(low)
    for _ in range(4):
        slope = cubic_slope(g, s)
        if slope.high == 0.0:
            break
        step = cubic(g, s) / slope
        if abs(step.high) > 4.0 * (high - low):
            break
        s = s - step
    return s


def falling_root(g, low, high, value_low, value_high):
    """Return the root of a cubic that falls from >= 0 at low to <= 0 at high, two doubles."""


@overload(falling_root, jit_options=OPTIONS)
def _falling_root(g, low, high, value_low, value_high):
    if value_low == DOUBLE_DOUBLE:
        return lambda g, low, high, value_low, value_high: refined_root(g, low, high)
    return lambda g, low, high, value_low, value_high: root_in_doubles(g, low, high, value_low, value_high)


@inlined
def contact_time(coefficients, bend, s, px, py, vx, vy):
    """-> number: time to the point s, where the ray's line touches the curve from its free side, else inf.

    ``bend`` is the second derivative of g at s. Of the two hits that merge at s, the front hit is first exactly if the
    curve runs along the ray at a minimum of g or against the ray at a maximum.
    """
    tx, ty = bezier_tangent(coefficients, s)
    if bend * dot(tx, ty, vx, vy) <= 0.0:
        return like(vx, np.inf)
    return bezier_time(coefficients, s, px, py, vx, vy)


@inlined
def joint_contact_time(curve, coefficients, g, s, px, py, vx, vy, room):
    """-> number: time to the end s, 0 or 1, of a piece, if it is no corner and the ray runs along it there, else inf.

    The ray's line passes the end within rounding, and ``room`` bounds the rounding errors of g. If the slope of g there
    were certain, hit and miss would be, because the next piece has the same number g and nearly the same slope. Else an
    extremum of g lies at the joint within rounding, on either piece or, where their tangents differ, on none.
    """
    tx, ty = bezier_tangent(coefficients, s)
    is_steep = abs(rounded(cubic_slope(g, s))) > SMOOTH_JOINT * (abs(rounded(tx)) + abs(rounded(ty))) + room
    if is_steep or curve[c.START_CORNER if s == 0.0 else c.END_CORNER] > 0.0:
        return like(vx, np.inf)
    return bezier_time(coefficients, s, px, py, vx, vy)


@inlined
def own_terms(g, own_s):
    """-> (b0, b1, b2, disc): of a ray that starts at ``own_s``: g(s) = sigma (b2 sigma^2 + b1 sigma + b0).

    Here sigma = s - own_s, ``g`` are the coefficients of g, and ``disc`` is b1^2 - 4 b2 b0.
    """
    _, _, a2, a3 = g
    b0, b1, b2 = cubic_slope(g, own_s), 3.0 * a3 * own_s + a2, a3
    return b0, b1, b2, b1 * b1 - 4.0 * b2 * b0


@inlined
def own_error(curve, b0, b1, b2):
    """-> float: the rounding error of ``disc`` in doubles: each b has up to ten roundings of the size of the piece."""
    size = curve_size(curve) * (abs(b0) + abs(b1) + abs(2.0 * b2))
    return TANGENT_ULPS * EPS * (b1 * b1 + abs(4.0 * b2 * b0) + size)


@inlined
def own_point(g, own_s, sigma, slack):
    """-> (s, is_front): the point own_s + sigma, and whether it is on the piece and a ray may hit it from its front."""
    s = own_s + sigma
    on_piece = (s >= -slack) & (s <= 1.0 + slack)
    s = squeezed(s)
    return s, on_piece & (cubic_slope(g, s) <= 0.0)


@inlined
def own_hit(coefficients, g, own_s, sigma, px, py, vx, vy, slack):
    """-> (t, s): time to the point own_s + sigma of the piece on which a ray started, inf if it is no front hit."""
    s, is_front = own_point(g, own_s, sigma, slack)
    t = bezier_time(coefficients, s, px, py, vx, vy)
    return where(is_front & (t > 0.0), t, np.inf), s


@inlined
def nearest_own_hit(coefficients, g, own_s, px, py, vx, vy, slack):
    """-> (t, s): first front hit on the piece that the ray has just left at ``own_s``, inf if none."""
    b0, b1, b2, disc = own_terms(g, own_s)
    first, second = quadratic_roots(b0, b1, b2, disc)
    t, s = own_hit(coefficients, g, own_s, second, px, py, vx, vy, slack)
    other_t, other_s = own_hit(coefficients, g, own_s, first, px, py, vx, vy, slack)
    other_is_first = other_t <= t
    return where(disc >= 0.0, where(other_is_first, other_t, t), np.inf), where(other_is_first, other_s, s)


@inlined
def hit_from_afar(curve, coefficients, g, px, py, vx, vy, room, least, slack):
    """-> (t, s, tangent, near_s): first front hit on a piece that the ray did not start on; see `bezier_hit`.

    ``room`` bounds the error of g. A contact before the time ``least`` is not counted.
    """
    a0, _, a2, a3 = g
    spread = side_spread(curve, rounded(px), rounded(py), rounded(vx), rounded(vy))
    # g can fall through zero once on each part of [0, 1] between its extrema
    c1, c2 = extrema(g)
    best_t, best_s, tangent, near_s = like(a0, np.inf), like(a0, 0.0), 0, like(a0, -1.0)
    low, value_low, touches = 0.0, a0, False
    if abs(rounded(a0)) <= room:
        t = joint_contact_time(curve, coefficients, g, 0.0, px, py, vx, vy, room)
        touches = least < t < np.inf
        if touches:
            best_t, tangent = t, 1
    for part in range(3):
        high = 1.0 if part == 2 else (rounded(c1) if part == 0 else rounded(c2))
        if not low < high <= 1.0:
            if part < 2:
                continue
            high = 1.0
        touched, touches = touches, False
        value_high = end_side(curve, px, py, vx, vy) if high == 1.0 else cubic(g, high)
        if abs(rounded(value_high)) <= room:
            if high == 1.0:
                t = joint_contact_time(curve, coefficients, g, 1.0, px, py, vx, vy, room)
            else:
                t = contact_time(coefficients, 6.0 * a3 * high + 2.0 * a2, high, px, py, vx, vy)
            touches = least < t < np.inf
            if touches and t < best_t:
                best_t, best_s, tangent = t, like(a0, high), 1
        # a root beside a contact equals the contact within rounding
        if is_falling(value_low, value_high) and not touched and not touches:
            s = falling_root(g, low, high, value_low, value_high)
            t = bezier_time(coefficients, s, px, py, vx, vy)
            if t < best_t:
                tx, ty = bezier_tangent(coefficients, s)
                direction = rounded(tx), rounded(ty), rounded(vx), rounded(vy)
                if is_close_by(direction, rounded(s), rounded(t), spread, slack):
                    near_s = s
                elif t > 0.0:
                    best_t, best_s, tangent = t, s, 0
        low, value_low = high, value_high
    return best_t, best_s, tangent, near_s


@inlined
def is_close_by(direction, s, t, spread, slack):
    """-> bool: whether a hit at s on a piece after the time t (of either sign) is within the slack of the start.

    All numbers are doubles; the direction is that of the piece and that of the ray. A hit behind the start is not if
    the start lies beyond an end of the piece: the ray has left the next piece, and rounding across the two pieces does
    not change the end that it has passed.
    """
    tx, ty, vx, vy = direction
    size = math.sqrt(tx * tx + ty * ty)
    # the height in front of the curve is t times the sine of incidence
    close = abs(t) <= NEARBY * spread and abs(t * (ty * vx - tx * vy)) <= slack * size
    behind = t * (tx * vx + ty * vy)
    return close and (t >= 0.0 or -slack * size <= s * size * size - behind <= size * size + slack * size)


@inlined
def bezier_hit(curve, own_s, px, py, vx, vy, slack):
    """-> (t, s, tangent, near_s): time to the first front hit on a piece in doubles, inf if none, and its parameter.

    ``tangent`` is 1 if hit and miss are not distinguished. ``own_s`` is below 0 if the ray does not start on the piece.
    A hit within the slack of the start is not counted: ``near_s`` is its parameter, -1 if there is none.
    """
    coefficients = bezier_coefficients(curve)
    g = a0, a1, a2, a3 = bezier_sides(coefficients, px, py, vx, vy)
    if own_s >= 0.0:
        b0, b1, b2, disc = own_terms(g, own_s)
        error = own_error(curve, b0, b1, b2)
        if abs(disc) <= error and b2 != 0.0:
            # the roots that rounding does not distinguish from a double one lie up to ``reach`` beside it
            s, reach = own_s - 0.5 * b1 / b2, 0.5 * math.sqrt(error) / abs(b2)
            if -reach <= s <= 1.0 + reach:
                s = min(max(s, 0.0), 1.0)
                t = contact_time(coefficients, 6.0 * a3 * s + 2.0 * a2, s, px, py, vx, vy)
                if t > slack:
                    return t, s, 1, -1.0
        t, s = nearest_own_hit(coefficients, g, own_s, px, py, vx, vy, OWN_SLACK)
        return t, s, 0, -1.0
    spread = side_spread(curve, px, py, vx, vy)
    # g lies between its four Bernstein coefficients, so it has no zero if they have one sign
    b1, b2, b3 = a0 + a1 / 3.0, a0 + (2.0 * a1 + a2) / 3.0, a0 + a1 + a2 + a3
    if max(min(a0, b1, b2, b3), -max(a0, b1, b2, b3)) > NO_ZERO_ULPS * EPS * spread:
        return np.inf, 0.0, 0, -1.0
    return hit_from_afar(curve, coefficients, g, px, py, vx, vy, TANGENT_ULPS * EPS * spread, slack, slack)


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


# ---- the names that every kind of piece has, see `kinds` --------------------------------------------------------
KIND, TABLE = BEZIER, Bezier.table


@inlined
def nearest(state, scope, own, px, py, vx, vy):
    """-> (time, kind, number, s, contact, nearby): the nearest of these hits and of those on Bezier pieces."""
    time, kind, number, hit_s, contact, nearby = state
    first, end = scope.curves[TABLE]
    if first < end:
        own_number = own.number if own.kind == BEZIER else -1
        arguments = scope.tables.curves[TABLE], first, end, own_number, own.s, px, py, vx, vy, scope.slack, time
        t, k, s, touch, near_s = call_late(scope.slots.bezier, NO_BEZIER_HIT, arguments)
        contact = min(contact, touch)
        if k >= 0:
            time, kind, number, hit_s = t, BEZIER, k, s
        nearby = nearby or near_s >= 0.0
    return time, kind, number, hit_s, contact, nearby


@inlined
def nearby(scope, number, own, is_own, px, py, vx, vy):
    """-> (t, s, tangent, is_clear): time to a hit close by, or inf; see `kinds.piece_nearby`."""
    own_number = number if is_own else -1
    arguments = scope.tables.curves[TABLE], number, number + 1, own_number, own.s, px, py, vx, vy, scope.slack, np.inf
    _, _, _, _, near_s = call_late(scope.slots.bezier, NO_BEZIER_HIT, arguments)
    if near_s >= 0.0:
        return 0.0, near_s, 0, False
    return np.inf, 0.0, 0, False


@inlined
def incidence(tables, hit, px, py, vx, vy):
    """-> float: sine of the angle between the velocity and the curve."""
    tx, ty = bezier_tangent(bezier_coefficients(tables.curves[TABLE][hit.number]), hit.s)
    return abs(tx * vy - ty * vx) / math.sqrt(tx * tx + ty * ty)


@inlined
def surface(scope, hit, own, px, py, vx, vy):
    """-> (px, py, nx, ny, at_corner): the end of a ray segment, the unit normal, and whether it is at a corner."""
    curve = scope.tables.curves[TABLE][hit.number]
    coefficients = bezier_coefficients(curve)
    (px, py), (nx, ny) = bezier_point(coefficients, hit.s), bezier_normal(coefficients, hit.s)
    return px, py, nx, ny, near_end(curve, px, py, scope.slack)


@linked
def refined_surface(tables, hit, px, py, vx, vy):
    """-> (qx, qy, nx, ny, bent): see `kinds.refined_surface`."""
    curve = tables.curves[TABLE][hit.number]
    coefficients = refined_coefficients(curve)
    (qx, qy), (nx, ny) = bezier_point(coefficients, hit.s), bezier_normal(coefficients, hit.s)
    return qx, qy, nx, ny, bezier_bend(curve, hit.s.high)


@linked
def refined_hit(scope, number, own, is_own, px, py, vx, vy, error):
    """-> (t, s, undecided, clearance, near_s): see `kinds.refined_hit`."""
    curve, slack = scope.tables.curves[TABLE][number], scope.slack
    coefficients, undecided, near_s = refined_coefficients(curve), np.inf, extended(-1.0)
    g = bezier_sides(coefficients, px, py, vx, vy)
    if is_own:
        t, s = nearest_own_hit(coefficients, g, own.s, px, py, vx, vy, LOCAL_ERROR)
    else:
        t, s, tangent, near_s = hit_from_afar(curve, coefficients, g, px, py, vx, vy, error, 0.0, slack)
        if tangent != 0:
            t, undecided = extended(np.inf), t.high
    return t, s, undecided, (np.inf, slack, error), near_s


# a row with its ends defines the piece, see `refined_coefficients`
refined_table = np.asarray


@linked_allocating
def refined_row(tables, number):
    """-> array: the row of `refined_table` of a row of the table of doubles."""
    return carray(tables.curves[TABLE][number], c.BEZIER_COLUMNS)


@linked
def height(joints, face, px, py):
    """-> (height, nx, ny): see `kinds.height_over`."""
    coefficients, s = refined_coefficients(face.row), face.s
    for _ in range(STEPS):
        (x, y), (tx, ty) = bezier_point(coefficients, s), bezier_tangent(coefficients, s)
        s = s + dot(px - x, py - y, tx, ty) / dot(tx, ty, tx, ty)
    (x, y), (nx, ny) = bezier_point(coefficients, s), bezier_normal(coefficients, s)
    return dot(px - x, py - y, nx, ny), nx, ny


ends = curve_ends
