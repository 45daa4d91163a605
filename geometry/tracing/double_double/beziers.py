"""The hits of a ray on Bezier pieces in double-double arithmetic."""

from __future__ import annotations

import numpy as np

from ....core.compilation import jit
from ...scene import columns as c
from .formulas import bezier_sides, bezier_time, cubic, cubic_slope, extrema, is_close_by, quadratic_roots
from .numbers import LOCAL_ERROR, cross, dot, extended, root, scaled

# Limit on bisections, more than the search for neighbouring doubles needs.
ROOT_STEPS = 200

_compile = jit(linked=True, _nrt=False)


@_compile
def falling_root(a, low, high):
    """Return the root of a cubic that falls from >= 0 at low to <= 0 at high, by bisection and Newton steps."""
    for _ in range(ROOT_STEPS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        if cubic(a, extended(middle)) >= 0.0:
            low = middle
        else:
            high = middle
    s = extended(low)
    for _ in range(4):
        slope = cubic_slope(a, s)
        if slope.high == 0.0:
            break
        step = cubic(a, s) / slope
        if abs(step.high) > 4.0 * (high - low):
            break
        s = s - step
    return s


@_compile
def exact_coefficients(a0, a1, a2, a3, end, is_quadratic):
    """-> (a0, a1, a2, a3): of one coordinate of a curve; the highest one makes the curve end exactly at its joint."""
    rest = extended(end) - a0 - a1
    if is_quadratic:
        return extended(a0), extended(a1), rest, extended(a3)
    return extended(a0), extended(a1), extended(a2), rest - a2


@_compile
def bezier_coefficients(curve):
    """-> (ax, ay): the coefficients of both coordinates."""
    is_quadratic = curve[c.X3] == 0.0 and curve[c.Y3] == 0.0
    return (
        exact_coefficients(curve[c.START_X], curve[c.X1], curve[c.X2], curve[c.X3], curve[c.END_X], is_quadratic),
        exact_coefficients(curve[c.START_Y], curve[c.Y1], curve[c.Y2], curve[c.Y3], curve[c.END_Y], is_quadratic),
    )


@_compile
def hit_from_own(coefficients, g, own_s, px, py, vx, vy):
    """-> (t, s): first front hit on the Bezier piece that the ray has just left at ``own_s``; inf if none.

    ``g`` are the coefficients of g; the root at the start is divided out.
    """
    _, _, a2, a3 = g
    best_t, best_s = extended(np.inf), extended(0.0)
    b0, b1 = cubic_slope(g, own_s), 3.0 * a3 * own_s + a2
    disc = b1 * b1 - scaled(4.0, a3 * b0)
    if disc < 0.0:
        return best_t, best_s
    for sigma in quadratic_roots(b0, b1, a3, disc):
        s = own_s + sigma
        if s.high >= -LOCAL_ERROR and (s - 1.0).high <= LOCAL_ERROR:
            t = bezier_time(coefficients, s, px, py, vx, vy)
            if cubic_slope(g, s) <= 0.0 and 0.0 < t < best_t:
                best_t, best_s = t, s
    return best_t, best_s


@_compile
def bezier_hit(curve, own_s, px, py, vx, vy, slack, error):
    """-> (t, s, undecided, near_s): time to the first front hit on a Bezier piece, inf if none, and its parameter.

    ``undecided`` is the time of an undecided contact, or inf. ``near_s`` is the parameter of a hit within the slack of
    the start, which is not counted, or -1. ``error`` bounds the transversal error of the ray.
    """
    coefficients = ax, ay = bezier_coefficients(curve)
    g = bezier_sides(coefficients, px, py, vx, vy)
    best_t, best_s, undecided, near_s = extended(np.inf), extended(0.0), np.inf, extended(-1.0)
    if own_s >= 0.0:
        best_t, best_s = hit_from_own(coefficients, g, own_s, px, py, vx, vy)
        return best_t, best_s, undecided, near_s
    size = abs(curve[c.START_X] - px.high) + abs(curve[c.START_Y] - py.high) + curve_size(curve)
    # double precision suffices, because g changes in second order at an extremum
    c1, c2 = extrema(g)
    low, value_low = 0.0, g[0]
    for part in range(3):
        high = 1.0 if part == 2 else (c1.high if part == 0 else c2.high)
        if not low < high <= 1.0:
            if part < 2:
                continue
            high = 1.0
        if high == 1.0:
            value_high = cross(curve[c.END_X] - px, curve[c.END_Y] - py, vx, vy)
        else:
            value_high = cubic(g, extended(high))
            if abs(value_high.high) <= error:
                contact = bezier_time(coefficients, extended(high), px, py, vx, vy).high
                if 0.0 < contact < undecided:
                    undecided = contact
        if value_low >= 0.0 and value_high <= 0.0 and value_low > value_high:
            s = falling_root(g, low, high)
            t = bezier_time(coefficients, s, px, py, vx, vy)
            if t < best_t:
                tangent = cubic_slope(ax, s).high, cubic_slope(ay, s).high
                if is_close_by(tangent, s.high, t.high, vx.high, vy.high, size, slack):
                    near_s = s
                elif t > 0.0:
                    best_t, best_s = t, s
        low, value_low = high, value_high
    return best_t, best_s, undecided, near_s


@_compile
def bezier_point(curve, s):
    """-> (x, y, nx, ny, bent): position and unit normal at s, and curvature (a double, positive if focusing)."""
    ax, ay = bezier_coefficients(curve)
    tx, ty = cubic_slope(ax, s), cubic_slope(ay, s)
    size = root(dot(tx, ty, tx, ty))
    (_, _, ax2, ax3), (_, _, ay2, ay3) = ax, ay
    bx, by = 2.0 * ax2.high + 6.0 * ax3.high * s.high, 2.0 * ay2.high + 6.0 * ay3.high * s.high
    bent = (tx.high * by - ty.high * bx) / size.high**3
    return cubic(ax, s), cubic(ay, s), -(ty / size), tx / size, bent


@_compile
def curve_size(curve):
    """Return a bound on the extent of a Bezier piece: the sum of the absolute non-constant coefficients."""
    return (
        abs(curve[c.X1]) + abs(curve[c.Y1]) + abs(curve[c.X2]) + abs(curve[c.Y2]) + abs(curve[c.X3]) + abs(curve[c.Y3])
    )
