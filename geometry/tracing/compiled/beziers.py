"""The first hit of a ray on a Bezier piece, and the reflection there: compiled.

A piece b(s), 0 <= s <= 1, is hit where g(s) = (b(s) - p) x v falls through zero; the root at the ray's own start is
divided out. The columns of the table are explained in `scene/scene`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ....core.rounding import EPS
from ...scene.columns import END_X, END_Y, START_X, START_Y, X1, X2, X3, Y1, Y2, Y3
from ...scene.tolerances import JOINT_ULPS, NEARBY, TANGENT_ULPS
from ..double_double.beziers import curve_size

ROOT_STEPS = 80

_compile = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)


@_compile
def bezier_value(a0, a1, a2, a3, s):
    return ((a3 * s + a2) * s + a1) * s + a0


@_compile
def falling_root(a0, a1, a2, a3, low, high):
    """The root of the cubic in [low, high], where it falls monotonically from >= 0 to <= 0; safeguarded Newton."""
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
        if abs(step - s) <= EPS * abs(step) or step == low or step == high:
            return step
        s = step
    return s


@_compile
def contact_time(curve, bend, s, px, py, vx, vy):
    """Time to the point s, where the ray's line touches the curve from its free side; inf where from the other.

    ``bend`` is the second derivative of g there. Of the two hits that merge at s the front one came first exactly if
    the curve runs along the ray where g has a minimum, or against it where g has a maximum.
    """
    tx = (3.0 * curve[X3] * s + 2.0 * curve[X2]) * s + curve[X1]
    ty = (3.0 * curve[Y3] * s + 2.0 * curve[Y2]) * s + curve[Y1]
    if not 0.0 < s < 1.0 or bend * (tx * vx + ty * vy) <= 0.0:
        return np.inf
    dx = bezier_value(curve[START_X], curve[X1], curve[X2], curve[X3], s) - px
    dy = bezier_value(curve[START_Y], curve[Y1], curve[Y2], curve[Y3], s) - py
    return dx * vx + dy * vy


@_compile
def bezier_hit(curve, own_s, px, py, vx, vy, slack):
    """First front hit of one Bezier piece: flight time (inf if none), parameter, 1 if it is tangent within rounding.

    ``own_s`` < 0: the ray does not start on this piece. A hit that lies within the slack of the start, before or behind
    it, is not among them: the fourth value is its parameter, -1 if there is none.
    """
    share_slack = JOINT_ULPS * EPS
    # b(s) - p in the power basis; columns 0-7 hold x and y coefficients of 1, s, s^2, s^3
    a0 = (curve[START_X] - px) * vy - (curve[START_Y] - py) * vx
    a1 = curve[X1] * vy - curve[Y1] * vx
    a2 = curve[X2] * vy - curve[Y2] * vx
    a3 = curve[X3] * vy - curve[Y3] * vx
    if own_s >= 0.0:
        # divide out the ray's own start: g(s) = (s - own) (b2 sigma^2 + b1 sigma + b0), sigma = s - own
        b0 = (3.0 * a3 * own_s + 2.0 * a2) * own_s + a1
        b1 = 3.0 * a3 * own_s + a2
        b2 = a3
        best_t, best_s = np.inf, 0.0
        disc = b1 * b1 - 4.0 * b2 * b0
        if abs(disc) <= TANGENT_ULPS * EPS * (b1 * b1 + 4.0 * abs(b2 * b0)) and b2 != 0.0:
            s = own_s - 0.5 * b1 / b2
            t = contact_time(curve, 6.0 * a3 * s + 2.0 * a2, s, px, py, vx, vy)
            if t > slack:
                return t, s, 1, -1.0
        if disc < 0.0:
            return best_t, best_s, 0, -1.0
        q = -0.5 * (b1 + math.copysign(math.sqrt(disc), b1))
        for root in range(2):
            bottom, top = (b2, q) if root == 0 else (q, b0)
            if bottom == 0.0:
                continue
            s = own_s + top / bottom
            if -share_slack <= s <= 1.0 + share_slack:
                s = min(max(s, 0.0), 1.0)
                slope = (3.0 * a3 * s + 2.0 * a2) * s + a1
                dx = bezier_value(curve[START_X], curve[X1], curve[X2], curve[X3], s) - px
                dy = bezier_value(curve[START_Y], curve[Y1], curve[Y2], curve[Y3], s) - py
                t = dx * vx + dy * vy
                if slope <= 0.0 and 0.0 < t < best_t:
                    best_t, best_s = t, s
        return best_t, best_s, 0, -1.0
    # g is a sum of products of numbers of this size
    spread = max(abs(vx), abs(vy)) * (abs(curve[START_X] - px) + abs(curve[START_Y] - py) + curve_size(curve))
    # split [0, 1] at the critical points of g; it can fall through zero once on each part
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
            # the joint itself, so that the next piece sees the same number
            value_high = (curve[END_X] - px) * vy - (curve[END_Y] - py) * vx
        else:
            value_high = bezier_value(a0, a1, a2, a3, high)
            if abs(value_high) <= TANGENT_ULPS * EPS * spread:
                t = contact_time(curve, 6.0 * a3 * high + 2.0 * a2, high, px, py, vx, vy)
                touches = t > slack and t < np.inf
                if touches and t < best_t:
                    best_t, best_s, tangent = t, high, 1
        # the root beside a contact is the contact itself, within rounding
        if value_low >= 0.0 >= value_high and value_low > value_high and not touched and not touches:
            s = falling_root(a0, a1, a2, a3, low, high)
            dx = bezier_value(curve[START_X], curve[X1], curve[X2], curve[X3], s) - px
            dy = bezier_value(curve[START_Y], curve[Y1], curve[Y2], curve[Y3], s) - py
            t = dx * vx + dy * vy
            if t < best_t:
                # the height in front of the curve is t times the sine of incidence, g' / |b'|
                fall = -((3.0 * a3 * s + 2.0 * a2) * s + a1)
                tx = (3.0 * curve[X3] * s + 2.0 * curve[X2]) * s + curve[X1]
                ty = (3.0 * curve[Y3] * s + 2.0 * curve[Y2]) * s + curve[Y1]
                reach = slack * math.sqrt(tx * tx + ty * ty)
                if abs(t) <= NEARBY * spread and abs(t) * fall <= reach:
                    near_s = s
                elif t > 0.0:
                    best_t, best_s, tangent = t, s, 0
        low, value_low = high, value_high
    return best_t, best_s, tangent, near_s


@_compile
def bend_number(curve, s):
    """Which part between its inflections the point s of a Bezier piece belongs to: 0, 1 or 2.

    A ray that just misses a bump may hit the same piece behind it, and leaves elsewhere; only a part that bends to one
    side has one front hit that moves continuously with the ray.
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
