"""The hits of a ray on Bezier pieces in double-double arithmetic."""

from __future__ import annotations

import math

import numpy as np

from ....core.compilation import jit
from ...scene import columns as c
from ...scene.tolerances import NEARBY
from .arithmetic import LOCAL_ERROR, add, cross, divide, dot, multiply, negate, square_root, subtract, wide

# Limit on bisections, more than the search for neighbouring doubles needs.
ROOT_STEPS = 200

_compile = jit(linked=True, _nrt=False)


@_compile
def cubic(a0, a1, a2, a3, s):
    return add(multiply(add(multiply(add(multiply(a3, s), a2), s), a1), s), a0)


@_compile
def cubic_slope(a1, a2, a3, s):
    three = multiply((3.0, 0.0), multiply(a3, s))
    return add(multiply(add(three, (2.0 * a2[0], 2.0 * a2[1])), s), a1)


@_compile
def falling_root(a0, a1, a2, a3, low, high):
    """Return the root of a cubic that falls from >= 0 at low to <= 0 at high, by bisection and Newton steps."""
    for _ in range(ROOT_STEPS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        if cubic(a0, a1, a2, a3, (middle, 0.0))[0] >= 0.0:
            low = middle
        else:
            high = middle
    s = (low, 0.0)
    for _ in range(4):
        slope = cubic_slope(a1, a2, a3, s)
        if slope[0] == 0.0:
            break
        step = divide(cubic(a0, a1, a2, a3, s), slope)
        if abs(step[0]) > 4.0 * (high - low):
            break
        s = subtract(s, step)
    return s


@_compile
def bezier_coefficients(curve):
    """-> (ax0, ay0, ..., ay3): the coefficients; the highest one makes the curve end exactly at its joint."""
    ax0, ax1, ax2, ax3 = wide(curve[c.START_X]), wide(curve[c.X1]), wide(curve[c.X2]), wide(curve[c.X3])
    ay0, ay1, ay2, ay3 = wide(curve[c.START_Y]), wide(curve[c.Y1]), wide(curve[c.Y2]), wide(curve[c.Y3])
    rest_x = subtract(subtract(wide(curve[c.END_X]), ax0), ax1)
    rest_y = subtract(subtract(wide(curve[c.END_Y]), ay0), ay1)
    if curve[c.X3] == 0.0 and curve[c.Y3] == 0.0:
        ax2, ay2 = rest_x, rest_y
    else:
        ax3, ay3 = subtract(rest_x, ax2), subtract(rest_y, ay2)
    return ax0, ay0, ax1, ay1, ax2, ay2, ax3, ay3


@_compile
def bezier_time(coefficients, s, px, py, vx, vy):
    """-> double-double: the distance along the ray to the point s of a curve."""
    ax0, ay0, ax1, ay1, ax2, ay2, ax3, ay3 = coefficients
    dx, dy = subtract(cubic(ax0, ax1, ax2, ax3, s), px), subtract(cubic(ay0, ay1, ay2, ay3, s), py)
    return dot(dx, dy, vx, vy)


@_compile
def hit_from_own(coefficients, g, own_s, px, py, vx, vy):
    """-> (t, s): first front hit on the Bezier piece that the ray has just left at ``own_s``; inf if none.

    ``g`` are the coefficients of g; the root at the start is divided out.
    """
    _, a1, a2, a3 = g
    best_t, best_s = (np.inf, 0.0), (0.0, 0.0)
    b0 = cubic_slope(a1, a2, a3, own_s)
    b1 = add(multiply(multiply((3.0, 0.0), a3), own_s), a2)
    product = multiply(a3, b0)
    disc = subtract(multiply(b1, b1), (4.0 * product[0], 4.0 * product[1]))
    if disc[0] < 0.0:
        return best_t, best_s
    root = square_root(disc)
    q = add(b1, root if b1[0] >= 0.0 else negate(root))
    q = (-0.5 * q[0], -0.5 * q[1])
    for which in range(2):
        bottom, top = (a3, q) if which == 0 else (q, b0)
        if bottom[0] == 0.0:
            continue
        s = add(own_s, divide(top, bottom))
        if s[0] >= -LOCAL_ERROR and subtract(s, (1.0, 0.0))[0] <= LOCAL_ERROR:
            t = bezier_time(coefficients, s, px, py, vx, vy)
            if cubic_slope(a1, a2, a3, s)[0] <= 0.0 and 0.0 < t[0] < best_t[0]:
                best_t, best_s = t, s
    return best_t, best_s


@_compile
def extrema(a1, a2, a3):
    """-> (c1, c2): the extrema of the cubic g in increasing order; 2 in place of a missing one.

    Double precision suffices, because g changes in second order at an extremum.
    """
    c1, c2 = 2.0, 2.0
    disc = subtract(multiply(a2, a2), multiply((3.0, 0.0), multiply(a3, a1)))
    if disc[0] > 0.0:
        root = square_root(disc)
        q = negate(add(a2, root if a2[0] >= 0.0 else negate(root)))
        if a3[0] != 0.0:
            c1 = divide(q, multiply((3.0, 0.0), a3))[0]
        if q[0] != 0.0:
            c2 = divide(a1, q)[0]
        if c1 > c2:
            c1, c2 = c2, c1
    return c1, c2


@_compile
def is_close_by(coefficients, s, t, vx, vy, size, slack):
    """-> bool: whether a hit at s after the time t (of either sign) is within the slack of the ray's start.

    A hit behind the start is not if the start lies beyond an end of the piece, see `compiled/pieces`.
    """
    _, _, ax1, ay1, ax2, ay2, ax3, ay3 = coefficients
    tx, ty = cubic_slope(ax1, ax2, ax3, s), cubic_slope(ay1, ay2, ay3, s)
    speed = math.hypot(tx[0], ty[0])
    close = abs(t[0]) <= NEARBY * size and abs(t[0] * cross(tx, ty, vx, vy)[0]) <= slack * speed
    behind = t[0] * dot(tx, ty, vx, vy)[0]
    return close and (t[0] >= 0.0 or -slack * speed <= s[0] * speed * speed - behind <= speed * (speed + slack))


@_compile
def bezier_hit(curve, own_s, px, py, vx, vy, slack, error):
    """-> (t, s, undecided, near_s): time to the first front hit on a Bezier piece, inf if none, and its parameter.

    ``undecided`` is the time of an undecided contact, or inf. ``near_s`` is the parameter of a hit within the slack of
    the start, which is not counted, or -1. ``error`` bounds the transversal error of the ray.
    """
    coefficients = bezier_coefficients(curve)
    ax0, ay0, ax1, ay1, ax2, ay2, ax3, ay3 = coefficients
    a0 = cross(subtract(ax0, px), subtract(ay0, py), vx, vy)
    a1, a2, a3 = cross(ax1, ay1, vx, vy), cross(ax2, ay2, vx, vy), cross(ax3, ay3, vx, vy)
    best_t, best_s, undecided = (np.inf, 0.0), (0.0, 0.0), np.inf
    near_s = (-1.0, 0.0)
    if own_s[0] >= 0.0:
        best_t, best_s = hit_from_own(coefficients, (a0, a1, a2, a3), own_s, px, py, vx, vy)
        return best_t, best_s, undecided, near_s
    size = abs(curve[c.START_X] - px[0]) + abs(curve[c.START_Y] - py[0]) + curve_size(curve)
    c1, c2 = extrema(a1, a2, a3)
    low, value_low = 0.0, a0
    for part in range(3):
        high = 1.0 if part == 2 else (c1 if part == 0 else c2)
        if high <= low or high > 1.0:
            if part < 2:
                continue
            high = 1.0
        if high == 1.0:
            value_high = cross(subtract(wide(curve[c.END_X]), px), subtract(wide(curve[c.END_Y]), py), vx, vy)
        else:
            value_high = cubic(a0, a1, a2, a3, (high, 0.0))
            if abs(value_high[0]) <= error:
                contact = bezier_time(coefficients, (high, 0.0), px, py, vx, vy)[0]
                if 0.0 < contact < undecided:
                    undecided = contact
        if value_low[0] >= 0.0 >= value_high[0] and value_low[0] > value_high[0]:
            s = falling_root(a0, a1, a2, a3, low, high)
            t = bezier_time(coefficients, s, px, py, vx, vy)
            if t[0] < best_t[0]:
                if is_close_by(coefficients, s, t, vx, vy, size, slack):
                    near_s = s
                elif t[0] > 0.0:
                    best_t, best_s = t, s
        low, value_low = high, value_high
    return best_t, best_s, undecided, near_s


@_compile
def bezier_point(curve, s):
    """-> (x, y, nx, ny, bent): position and unit normal at s, and curvature (a double, positive if focusing)."""
    ax0, ay0, ax1, ay1, ax2, ay2, ax3, ay3 = bezier_coefficients(curve)
    tx, ty = cubic_slope(ax1, ax2, ax3, s), cubic_slope(ay1, ay2, ay3, s)
    size = square_root(dot(tx, ty, tx, ty))
    bx, by = 2.0 * ax2[0] + 6.0 * ax3[0] * s[0], 2.0 * ay2[0] + 6.0 * ay3[0] * s[0]
    bent = (tx[0] * by - ty[0] * bx) / size[0] ** 3
    nx, ny = negate(divide(ty, size)), divide(tx, size)
    return cubic(ax0, ax1, ax2, ax3, s), cubic(ay0, ay1, ay2, ay3, s), nx, ny, bent


@_compile
def curve_size(curve):
    """Return a bound on the extent of a Bezier piece: the sum of the absolute non-constant coefficients."""
    return (
        abs(curve[c.X1]) + abs(curve[c.Y1]) + abs(curve[c.X2]) + abs(curve[c.Y2]) + abs(curve[c.X3]) + abs(curve[c.Y3])
    )
