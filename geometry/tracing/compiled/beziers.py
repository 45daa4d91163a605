"""The first hit of a ray on a Bezier piece, and the reflection there: compiled. Loads numba.

A piece b(s), 0 <= s <= 1, is hit where g(s) = (b(s) - p) x v falls through zero. The root at the ray's start on the
piece itself is divided out.
"""

from __future__ import annotations

import math

import numpy as np

from ....core.rounding import EPS
from ...scene.columns import (
    END_X,
    END_Y,
    MIDDLE_X,
    MIDDLE_Y,
    REACH,
    START_X,
    START_Y,
    X1,
    X2,
    X3,
    Y1,
    Y2,
    Y3,
)
from ...scene.tolerances import JOINT_ULPS, NEARBY, NEARBY_MARGIN, TANGENT_ULPS
from ..double_double.beziers import curve_size
from .options import inlined, inner

ROOT_STEPS = 80
# What `nearest_bezier` returns for a ray that meets no piece.
NO_BEZIER_HIT = np.inf, -1, 0.0, 0, -1.0
# Size, in eps times that of its products, from which on g is not 0: twice that of a contact. Each value of g has about
# eight rounding errors.
NO_ZERO_ULPS = 2.0 * TANGENT_ULPS


@inlined
def bezier_value(a0, a1, a2, a3, s):
    """-> float: the cubic with these coefficients at s."""
    return ((a3 * s + a2) * s + a1) * s + a0


@inlined
def falling_root(a0, a1, a2, a3, low, high):
    """-> float: the root of a cubic that falls from >= 0 at low to <= 0 at high, by safeguarded Newton steps."""
    s = 0.5 * (low + high)
    for _ in range(ROOT_STEPS):
        value = bezier_value(a0, a1, a2, a3, s)
        if value > 0.0:
            low = s
        elif value < 0.0:
            high = s
        else:
            return s
        slope = (3.0 * a3 * s + 2.0 * a2) * s + a1
        step = s - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - s) <= EPS * abs(step) or step in (low, high):
            return step
        s = step
    return s


@inlined
def bezier_tangent(curve, s):
    """-> (tx, ty): b'(s)."""
    tx = (3.0 * curve[X3] * s + 2.0 * curve[X2]) * s + curve[X1]
    ty = (3.0 * curve[Y3] * s + 2.0 * curve[Y2]) * s + curve[Y1]
    return tx, ty


@inlined
def bezier_time(curve, s, px, py, vx, vy):
    """-> float: the distance along the ray to the point s of the curve."""
    dx = bezier_value(curve[START_X], curve[X1], curve[X2], curve[X3], s) - px
    dy = bezier_value(curve[START_Y], curve[Y1], curve[Y2], curve[Y3], s) - py
    return dx * vx + dy * vy


@inlined
def contact_time(curve, bend, s, px, py, vx, vy):
    """-> float: time to the point s, where the ray's line touches the curve from its free side, else inf.

    ``bend`` is the second derivative of g at s. Of the two hits that merge at s, the front hit is first exactly if the
    curve runs along the ray at a minimum of g or against the ray at a maximum.
    """
    tx, ty = bezier_tangent(curve, s)
    if not 0.0 < s < 1.0 or bend * (tx * vx + ty * vy) <= 0.0:
        return np.inf
    return bezier_time(curve, s, px, py, vx, vy)


@inlined
def hit_from_own(curve, g, own_s, px, py, vx, vy, slack):
    """-> (t, s, tangent): first front hit on the Bezier piece that the ray has just left at ``own_s``; inf if none.

    ``g`` are the coefficients of g. The root at the start is divided out: with sigma = s - own_s,
    g(s) = sigma (b2 sigma^2 + b1 sigma + b0).
    """
    _, a1, a2, a3 = g
    fraction_slack = JOINT_ULPS * EPS
    b0 = (3.0 * a3 * own_s + 2.0 * a2) * own_s + a1
    b1 = 3.0 * a3 * own_s + a2
    b2 = a3
    best_t, best_s = np.inf, 0.0
    disc = b1 * b1 - 4.0 * b2 * b0
    if abs(disc) <= TANGENT_ULPS * EPS * (b1 * b1 + 4.0 * abs(b2 * b0)) and b2 != 0.0:
        s = own_s - 0.5 * b1 / b2
        t = contact_time(curve, 6.0 * a3 * s + 2.0 * a2, s, px, py, vx, vy)
        if t > slack:
            return t, s, 1
    if disc < 0.0:
        return best_t, best_s, 0
    q = -0.5 * (b1 + math.copysign(math.sqrt(disc), b1))
    for root in range(2):
        bottom, top = (b2, q) if root == 0 else (q, b0)
        if bottom == 0.0:
            continue
        s = own_s + top / bottom
        if -fraction_slack <= s <= 1.0 + fraction_slack:
            s = min(max(s, 0.0), 1.0)
            slope = (3.0 * a3 * s + 2.0 * a2) * s + a1
            t = bezier_time(curve, s, px, py, vx, vy)
            if slope <= 0.0 and 0.0 < t < best_t:
                best_t, best_s = t, s
    return best_t, best_s, 0


@inlined
def extrema(a1, a2, a3):
    """-> (c1, c2): the extrema of the cubic g in increasing order; 2 in place of a missing one."""
    c1, c2 = 2.0, 2.0
    disc = a2 * a2 - 3.0 * a3 * a1
    if disc > 0.0:
        q = -(a2 + math.copysign(math.sqrt(disc), a2))
        if a3 != 0.0:
            c1 = q / (3.0 * a3)
        if q != 0.0:
            c2 = a1 / q
        if c1 > c2:
            c1, c2 = c2, c1
    return c1, c2


@inlined
def is_close_by(curve, g, s, t, spread, slack):
    """-> bool: whether a hit at s after the time t (of either sign) is within the slack of the ray's start."""
    _, a1, a2, a3 = g
    # the height in front of the curve is t times the sine of incidence, g' / |b'|
    fall = -((3.0 * a3 * s + 2.0 * a2) * s + a1)
    tx, ty = bezier_tangent(curve, s)
    reach = slack * math.sqrt(tx * tx + ty * ty)
    return abs(t) <= NEARBY * spread and abs(t) * fall <= reach


@inlined
def hit_from_afar(curve, g, px, py, vx, vy, slack):
    """-> (t, s, tangent, near_s): first front hit on a Bezier piece that the ray did not start on; see `bezier_hit`."""
    a0, a1, a2, a3 = g
    # size of the products in the sum g
    spread = max(abs(vx), abs(vy)) * (abs(curve[START_X] - px) + abs(curve[START_Y] - py) + curve_size(curve))
    # g lies between its four Bernstein coefficients, so it has no zero if they have one sign
    b1, b2, b3 = a0 + a1 / 3.0, a0 + (2.0 * a1 + a2) / 3.0, a0 + a1 + a2 + a3
    if max(min(a0, b1, b2, b3), -max(a0, b1, b2, b3)) > NO_ZERO_ULPS * EPS * spread:
        return np.inf, 0.0, 0, -1.0
    # g can fall through zero once on each part of [0, 1] between its extrema
    c1, c2 = extrema(a1, a2, a3)
    best_t, best_s, tangent, near_s = np.inf, 0.0, 0, -1.0
    low, touches = 0.0, False
    value_low = a0
    for part in range(3):
        high = 1.0 if part == 2 else (c1 if part == 0 else c2)
        if high <= low or high > 1.0:
            if part < 2:
                continue
            high = 1.0
        touched, touches = touches, False
        if high == 1.0:
            # computed from the joint, so that the next piece has the same number
            value_high = (curve[END_X] - px) * vy - (curve[END_Y] - py) * vx
        else:
            value_high = bezier_value(a0, a1, a2, a3, high)
            if abs(value_high) <= TANGENT_ULPS * EPS * spread:
                t = contact_time(curve, 6.0 * a3 * high + 2.0 * a2, high, px, py, vx, vy)
                touches = t > slack and t < np.inf
                if touches and t < best_t:
                    best_t, best_s, tangent = t, high, 1
        # a root beside a contact equals the contact within rounding
        if value_low >= 0.0 >= value_high and value_low > value_high and not touched and not touches:
            s = falling_root(a0, a1, a2, a3, low, high)
            t = bezier_time(curve, s, px, py, vx, vy)
            if t < best_t:
                if is_close_by(curve, g, s, t, spread, slack):
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
    g = (
        (curve[START_X] - px) * vy - (curve[START_Y] - py) * vx,
        curve[X1] * vy - curve[Y1] * vx,
        curve[X2] * vy - curve[Y2] * vx,
        curve[X3] * vy - curve[Y3] * vx,
    )
    if own_s >= 0.0:
        t, s, tangent = hit_from_own(curve, g, own_s, px, py, vx, vy, slack)
        return t, s, tangent, -1.0
    return hit_from_afar(curve, g, px, py, vx, vy, slack)


@inner
def nearest_bezier(beziers, first, end, own_number, own_s, px, py, vx, vy, slack, time):
    """-> (t, number, s, tangent, near_s): the first hit before ``time`` on the pieces from ``first`` to ``end``.

    ``near_s`` is that of the last piece that has one, else -1; for all else see `bezier_hit`. The ray starts on the
    piece ``own_number`` at ``own_s``; the number is -1 if it starts elsewhere.
    """
    number, hit_s, doubt, near = -1, 0.0, 0, -1.0
    for k in range(first, end):
        curve = beziers[k]
        # whether the ray meets the circle about the piece before ``time``; if not, `hit_from_afar` finds nothing
        dx, dy = curve[MIDDLE_X] - px, curve[MIDDLE_Y] - py
        along, room = dx * vx + dy * vy, curve[REACH] + NEARBY_MARGIN * (abs(dx) + abs(dy))
        # no short circuit, because the processor guesses its branches wrong
        if (k != own_number) & ((abs(dx * vy - dy * vx) > room) | (along < -room) | (along - room > time)):
            continue
        t, s, tangent, near_s = bezier_hit(curve, own_s if k == own_number else -1.0, px, py, vx, vy, slack)
        if t < time:
            time, number, hit_s, doubt = t, k, s, tangent
        if near_s >= 0.0:
            near = near_s
    return time, number, hit_s, doubt, near


@inlined
def bezier_reflect(curve, s, vx, vy):
    """-> (px, py, vx, vy): the point s of the curve and the reflected velocity."""
    px = bezier_value(curve[START_X], curve[X1], curve[X2], curve[X3], s)
    py = bezier_value(curve[START_Y], curve[Y1], curve[Y2], curve[Y3], s)
    tx, ty = bezier_tangent(curve, s)
    scale = 1.0 / math.sqrt(tx * tx + ty * ty)
    w = 2.0 * scale * scale * (vy * tx - vx * ty)
    return px, py, vx + w * ty, vy - w * tx


@inlined
def bend_number(curve, s):
    """-> int: the number, 0, 1 or 2, of the part between inflections that contains the point s of a Bezier piece.

    Only on a part without inflection the front hit is unique and moves continuously with the ray. A ray that just
    misses a bump may hit the same piece behind the bump.
    """
    # the curvature has the sign of b' x b'', which is a quadratic in s for a cubic b
    c0 = 2.0 * (curve[X1] * curve[Y2] - curve[Y1] * curve[X2])
    c1 = 6.0 * (curve[X1] * curve[Y3] - curve[Y1] * curve[X3])
    c2 = 6.0 * (curve[X2] * curve[Y3] - curve[Y2] * curve[X3])
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
