"""The first hit of a ray on a Bezier piece, and the reflection there: compiled. Loads numba.

A piece b(s), 0 <= s <= 1, is hit where g(s) = (b(s) - p) x v falls through zero. The root at the ray's start on the
piece itself is divided out.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from ....core.rounding import EPS
from ...scene import columns as c
from ...scene.boxes import BOXES
from ...scene.tolerances import JOINT_ULPS, NEARBY, NEARBY_MARGIN, SMOOTH_JOINT, TANGENT_ULPS
from ..double_double.beziers import curve_size
from .lanes import BEFORE, HIT_S, LANES, NUMBER, RAY, TIME, WORD, Lanes, Ray, Table, constant, cross, dot, repeated
from .options import inlined, inner

ROOT_STEPS = 80
# What `nearest_bezier` returns for a ray that meets no piece.
NO_BEZIER_HIT = np.inf, -1, 0.0, np.inf, -1.0
# Size, in eps times that of its products, from which on g is not 0: twice that of a contact. Each value of g has about
# eight rounding errors.
NO_ZERO_ULPS = 2.0 * TANGENT_ULPS


@inlined
def bezier_value(a0, a1, a2, a3, s):
    """-> float: the cubic with these coefficients at s."""
    return ((a3 * s + a2) * s + a1) * s + a0


@inlined
def bezier_slope(a1, a2, a3, s):
    """-> float: the derivative of the cubic at s."""
    return (3.0 * a3 * s + 2.0 * a2) * s + a1


@inlined
def quadratic_root(a0, a1, a2):
    """-> float: the root in [0, 1] at which the quadratic with these coefficients falls, if it has one."""
    disc = a1 * a1 - 4.0 * a2 * a0
    root = math.sqrt(disc if disc > 0.0 else 0.0)
    # the sum of two numbers of the same sign
    s = -(a1 + root) / (2.0 * a2) if a1 > 0.0 else 2.0 * a0 / (root - a1)
    s = s if s > 0.0 else 0.0
    return s if s < 1.0 else 1.0


@inlined
def falling_root(a0, a1, a2, a3, low, high, value_low, value_high):
    """-> float: the root of a cubic that falls from >= 0 at low to <= 0 at high, by safeguarded Halley steps.

    They begin at the root of the quadratic with the same values at both ends and in the middle, and end when the next
    step would be below one rounding error.
    """
    span = high - low
    level, rise, bend = parabola_through(value_low, bezier_value(a0, a1, a2, a3, low + 0.5 * span), value_high)
    s = low + span * quadratic_root(level, rise, bend)
    for _ in range(ROOT_STEPS):
        value, slope = bezier_value(a0, a1, a2, a3, s), bezier_slope(a1, a2, a3, s)
        bend = 3.0 * a3 * s + a2
        low, high = s if value > 0.0 else low, s if value < 0.0 else high
        step = s - value * slope / (slope * slope - value * bend)
        if not low <= step <= high:
            step = 0.5 * (low + high)
            if value == 0.0:
                return s
            if step in (low, high):
                return step
        elif halley_error(step - s, slope, bend, a3) <= EPS * abs(step) * (slope * slope):
            return step
        s = step
    return s


@inlined
def parabola_through(before, middle, after):
    """-> (a0, a1, a2): coefficients of the quadratic with these values at 0, 1/2 and 1."""
    return before, 4.0 * middle - 3.0 * before - after, 2.0 * (before + after) - 4.0 * middle


@inlined
def halley_error(step, slope, bend, a3):
    """-> float: the error of a root after a step of Halley's method from s, times the square of the slope at s.

    It is (bend^2 / slope^2 - a3 / slope) step^3 to first order, where ``bend`` is half the second derivative.
    """
    return abs(step * step * step) * (bend * bend + abs(a3 * slope))


@inlined
def bezier_tangent(curve, s):
    """-> (tx, ty): b'(s)."""
    return bezier_slope(curve[c.X1], curve[c.X2], curve[c.X3], s), bezier_slope(
        curve[c.Y1], curve[c.Y2], curve[c.Y3], s
    )


@inlined
def bezier_time(curve, s, px, py, vx, vy):
    """-> float: the distance along the ray to the point s of the curve."""
    dx = bezier_value(curve[c.START_X], curve[c.X1], curve[c.X2], curve[c.X3], s) - px
    dy = bezier_value(curve[c.START_Y], curve[c.Y1], curve[c.Y2], curve[c.Y3], s) - py
    return dx * vx + dy * vy


@inlined
def contact_time(curve, bend, s, px, py, vx, vy):
    """-> float: time to the point s, where the ray's line touches the curve from its free side, else inf.

    ``bend`` is the second derivative of g at s. Of the two hits that merge at s, the front hit is first exactly if the
    curve runs along the ray at a minimum of g or against the ray at a maximum.
    """
    tx, ty = bezier_tangent(curve, s)
    if bend * (tx * vx + ty * vy) <= 0.0:
        return np.inf
    return bezier_time(curve, s, px, py, vx, vy)


@inlined
def joint_contact_time(curve, g, s, px, py, vx, vy, room):
    """-> float: time to the end s, 0 or 1, of a piece, if it is no corner and the ray runs along it there, else inf.

    The ray's line passes the end within rounding, and ``room`` bounds the rounding errors of g. If the slope of g there
    were certain, hit and miss would be, because the next piece has the same number g and nearly the same slope. Else an
    extremum of g lies at the joint within rounding, on either piece or, where their tangents differ, on none.
    """
    _, a1, a2, a3 = g
    tx, ty = bezier_tangent(curve, s)
    is_steep = abs(bezier_slope(a1, a2, a3, s)) > SMOOTH_JOINT * (abs(tx) + abs(ty)) + room
    if is_steep or curve[c.START_CORNER if s == 0.0 else c.END_CORNER] > 0.0:
        return np.inf
    return bezier_time(curve, s, px, py, vx, vy)


@inlined
def own_error(size, b0, b1, b2):
    """-> float: bound on the rounding error of b1^2 - 4 b2 b0 in `hit_from_own`.

    Each b has up to ten rounding errors of the size of the piece, `curve_size`.
    """
    return TANGENT_ULPS * EPS * (b1 * b1 + abs(4.0 * b2 * b0) + size * (abs(b0) + abs(b1) + abs(2.0 * b2)))


@inlined
def hit_from_own(curve, g, own_s, px, py, vx, vy, slack):
    """-> (t, s, tangent): first front hit on the Bezier piece that the ray has just left at ``own_s``; inf if none.

    ``g`` are the coefficients of g. The root at the start is divided out: with sigma = s - own_s,
    g(s) = sigma (b2 sigma^2 + b1 sigma + b0).
    """
    _, a1, a2, a3 = g
    fraction_slack = JOINT_ULPS * EPS
    b0 = bezier_slope(a1, a2, a3, own_s)
    b1 = 3.0 * a3 * own_s + a2
    b2 = a3
    best_t, best_s = np.inf, 0.0
    disc = b1 * b1 - 4.0 * b2 * b0
    error = own_error(curve_size(curve), b0, b1, b2)
    if abs(disc) <= error and b2 != 0.0:
        # the roots that rounding does not distinguish from a double one lie up to ``reach`` beside it
        s, reach = own_s - 0.5 * b1 / b2, 0.5 * math.sqrt(error) / abs(b2)
        if -reach <= s <= 1.0 + reach:
            s = min(max(s, 0.0), 1.0)
            t = contact_time(curve, 6.0 * a3 * s + 2.0 * a2, s, px, py, vx, vy)
            if t > slack:
                return t, s, 1
    if disc < 0.0:
        return best_t, best_s, 0
    root = math.sqrt(disc)
    q = -0.5 * (b1 + (root if b1 >= 0.0 else -root))
    for number in range(2):
        bottom, top = (b2, q) if number == 0 else (q, b0)
        if bottom == 0.0:
            continue
        s = own_s + top / bottom
        if -fraction_slack <= s <= 1.0 + fraction_slack:
            s = min(max(s, 0.0), 1.0)
            slope = bezier_slope(a1, a2, a3, s)
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
        root = math.sqrt(disc)
        q = -(a2 + (root if a2 >= 0.0 else -root))
        if a3 != 0.0:
            c1 = q / (3.0 * a3)
        if q != 0.0:
            c2 = a1 / q
        if c1 > c2:
            c1, c2 = c2, c1
    return c1, c2


@inlined
def is_close_by(curve, s, t, vx, vy, spread, slack):
    """-> bool: whether a hit at s after the time t (of either sign) is within the slack of the ray's start.

    A hit behind the start is not if the start lies beyond an end of the piece: the ray has left the next piece, and
    rounding across the two pieces does not change the end that it has passed.
    """
    tx, ty = bezier_tangent(curve, s)
    size = math.sqrt(tx * tx + ty * ty)
    # the height in front of the curve is t times the sine of incidence
    close = abs(t) <= NEARBY * spread and abs(t * (ty * vx - tx * vy)) <= slack * size
    behind = t * (tx * vx + ty * vy)
    return close and (t >= 0.0 or -slack * size <= s * size * size - behind <= size * size + slack * size)


@inlined
def hit_from_afar(curve, g, px, py, vx, vy, slack):
    """-> (t, s, tangent, near_s): first front hit on a Bezier piece that the ray did not start on; see `bezier_hit`."""
    a0, a1, a2, a3 = g
    # size of the products in the sum g
    spread = max(abs(vx), abs(vy)) * (abs(curve[c.START_X] - px) + abs(curve[c.START_Y] - py) + curve_size(curve))
    # g lies between its four Bernstein coefficients, so it has no zero if they have one sign
    b1, b2, b3 = a0 + a1 / 3.0, a0 + (2.0 * a1 + a2) / 3.0, a0 + a1 + a2 + a3
    if max(min(a0, b1, b2, b3), -max(a0, b1, b2, b3)) > NO_ZERO_ULPS * EPS * spread:
        return np.inf, 0.0, 0, -1.0
    # g can fall through zero once on each part of [0, 1] between its extrema
    c1, c2 = extrema(a1, a2, a3)
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
        if high <= low or high > 1.0:
            if part < 2:
                continue
            high = 1.0
        touched, touches = touches, False
        if high == 1.0:
            # computed from the joint, so that the next piece has the same number
            value_high = (curve[c.END_X] - px) * vy - (curve[c.END_Y] - py) * vx
            if abs(value_high) <= room:
                t = joint_contact_time(curve, g, 1.0, px, py, vx, vy, room)
                touches = t > slack and t < np.inf
                if touches and t < best_t:
                    best_t, best_s, tangent = t, 1.0, 1
        else:
            value_high = bezier_value(a0, a1, a2, a3, high)
            if abs(value_high) <= room:
                t = contact_time(curve, 6.0 * a3 * high + 2.0 * a2, high, px, py, vx, vy)
                touches = t > slack and t < np.inf
                if touches and t < best_t:
                    best_t, best_s, tangent = t, high, 1
        # a root beside a contact equals the contact within rounding
        if value_low >= 0.0 >= value_high and value_low > value_high and not touched and not touches:
            if curve[c.X3] == 0.0 and curve[c.Y3] == 0.0:
                s = quadratic_root(a0, a1, a2)
            else:
                s = falling_root(a0, a1, a2, a3, low, high, value_low, value_high)
            t = bezier_time(curve, s, px, py, vx, vy)
            if t < best_t:
                if is_close_by(curve, s, t, vx, vy, spread, slack):
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
        (curve[c.START_X] - px) * vy - (curve[c.START_Y] - py) * vx,
        curve[c.X1] * vy - curve[c.Y1] * vx,
        curve[c.X2] * vy - curve[c.Y2] * vx,
        curve[c.X3] * vy - curve[c.Y3] * vx,
    )
    if own_s >= 0.0:
        t, s, tangent = hit_from_own(curve, g, own_s, px, py, vx, vy, slack)
        return t, s, tangent, -1.0
    return hit_from_afar(curve, g, px, py, vx, vy, slack)


@inner
def nearest_bezier(tables, first, end, own_number, own_s, px, py, vx, vy, slack, time):
    """-> (t, number, s, contact, near_s): the first hit before ``time`` on the pieces from ``first`` to ``end``.

    ``contact`` is the time to the first tangent hit, which is not counted, or inf. ``near_s`` is that of the last piece
    that has one, else -1; for all else see `bezier_hit`. The ray starts on the piece ``own_number`` at ``own_s``; the
    number is -1 if it starts elsewhere.
    """
    number, hit_s, contact, near = -1, 0.0, np.inf, -1.0
    for k in range(first, end):
        curve = tables.beziers[k]
        # whether the ray meets the circle about the piece before ``time``; if not, `hit_from_afar` finds nothing
        dx, dy = curve[c.MIDDLE_X] - px, curve[c.MIDDLE_Y] - py
        along, room = dx * vx + dy * vy, curve[c.REACH] + NEARBY_MARGIN * (abs(dx) + abs(dy))
        # no short circuit, because the processor guesses its branches wrong
        if (k != own_number) & ((abs(dx * vy - dy * vx) > room) | (along < -room) | (along - room > time)):
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
def bezier_reflect(curve, s, vx, vy):
    """-> (px, py, vx, vy): the point s of the curve and the reflected velocity."""
    px = bezier_value(curve[c.START_X], curve[c.X1], curve[c.X2], curve[c.X3], s)
    py = bezier_value(curve[c.START_Y], curve[c.Y1], curve[c.Y2], curve[c.Y3], s)
    tx, ty = bezier_tangent(curve, s)
    scale = 1.0 / math.sqrt(tx * tx + ty * ty)
    nx, ny = -ty * scale, tx * scale
    w = 2.0 * (vx * nx + vy * ny)
    return px, py, vx - w * nx, vy - w * ny


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


class _Curve:
    """A row of ``beziers`` in compiled code, each number in all lanes."""

    def __init__(self, at: Table) -> None:
        self._at = at

    def __getitem__(self, column: int) -> Lanes:
        return self._at.number(column)


def _squeezed(s: Lanes) -> Lanes:
    """Return the nearest numbers in [0, 1]; 0 for NaN."""
    builder = s.builder
    s = (s > 0.0).where(s, constant(builder, 0.0))
    return (s < 1.0).where(s, constant(builder, 1.0))


def _quadratic_roots(a0: Lanes, a1: Lanes, a2: Lanes) -> Lanes:
    """Return `quadratic_root` of eight rays."""
    disc, zero = a1 * a1 - 4.0 * a2 * a0, constant(a0.builder, 0.0)
    root, rises = (disc > 0.0).where(disc, zero).root(), a1 > 0.0
    return _squeezed(rises.where(-(a1 + root), 2.0 * a0) / rises.where(2.0 * a2, root - a1))


def _falling_roots(g: Any, low: Lanes, high: Lanes, value_low: Lanes, value_high: Lanes, wanted: Lanes) -> Lanes:
    """Return `falling_root` of those of eight rays that are wanted."""
    builder, (_, a1, a2, a3) = low.builder, g
    value_of, slope_of = bezier_value.py_func, bezier_slope.py_func
    span = high - low
    start = parabola_through.py_func(value_low, value_of(*g, low + 0.5 * span), value_high)
    s = low + span * _quadratic_roots(*start)
    states = [cgutils.alloca_once_value(builder, part.value) for part in (s, low, high, wanted)]
    count = cgutils.alloca_once_value(builder, WORD(0))
    body, end = builder.append_basic_block("step"), builder.append_basic_block("found")
    builder.cbranch(wanted.any(), body, end)
    builder.position_at_end(body)
    s, low, high, active = (Lanes(builder, builder.load(state)) for state in states)
    value, slope, bend = value_of(*g, s), slope_of(a1, a2, a3, s), 3.0 * a3 * s + a2
    low, high = (value > 0.0).where(s, low), (value < 0.0).where(s, high)
    step = s - value * slope / (slope * slope - value * bend)
    inside = (low <= step) & (step <= high)
    middle = 0.5 * (low + high)
    step = inside.where(step, value.equals(0.0).where(s, middle))
    is_small = halley_error.py_func(step - s, slope, bend, a3) <= EPS * abs(step) * (slope * slope)
    ends = inside.where(is_small, value.equals(0.0) | step.equals(low) | step.equals(high))
    s = active.where(step, s)
    active = active & ~ends
    for state, part in zip(states, (s, low, high, active), strict=True):
        builder.store(part.value, state)
    steps = builder.add(builder.load(count), WORD(1))
    builder.store(steps, count)
    more = builder.and_(active.any(), builder.icmp_unsigned("<", steps, WORD(ROOT_STEPS)))
    builder.cbranch(more, body, end)
    builder.position_at_end(end)
    return Lanes(builder, builder.load(states[0]))


def _pick(*choices: Any) -> Any:
    """Return the value of the first choice (condition, value) that holds, else the last value."""
    *first, value = choices
    for condition, other in reversed(first):
        value = condition.where(other, value)
    return value


def _meets_circle(ray: Ray, curve: _Curve) -> Lanes:
    """Return which rays meet the circle about the piece before their hits, as in `nearest_bezier`."""
    dx, dy = curve[c.MIDDLE_X] - ray.px, curve[c.MIDDLE_Y] - ray.py
    along, room = dot(dx, dy, ray.vx, ray.vy), curve[c.REACH] + NEARBY_MARGIN * (abs(dx) + abs(dy))
    return (abs(cross(dx, dy, ray.vx, ray.vy)) <= room) & (along >= -room) & (along - room <= ray.at[TIME])


@intrinsic
def gather_near(typing, work, first, count, beziers, k, number, place):
    """-> int: how many of eight rays start on a Bezier piece or meet the circle about it; note them at ``place``.

    ``count`` is the number of rays of the wave, ``number`` that of the piece.
    """

    def gather(context, builder, signature, values):
        ray = Ray(context, builder, signature, values)
        curve = _Curve(Table(context, builder, signature.args[3], values[3]).row(values[4]))
        rest = repeated(builder, builder.sitofp(builder.sub(values[2], values[1]), NUMBER))
        begin = repeated(builder, builder.sitofp(values[1], NUMBER))
        lane = Lanes(builder, ir.Constant(LANES, [float(k) for k in range(BOXES)]))
        near = (lane < rest) & (ray.own.equals(repeated(builder, values[5])) | _meets_circle(ray, curve))
        Table(context, builder, signature.args[0], values[0]).column(values[6]).pack(RAY, lane + begin, near)
        return builder.ctpop(near.mask())

    integer = types.int64
    return types.int64(work, integer, integer, beziers, integer, types.float64, integer), gather


class _Meeting:
    """Eight rays and a Bezier piece: the hits that are nearer."""

    def __init__(self, context: Any, builder: Any, signature: Any, values: Any) -> None:
        self.builder = builder
        self.ray = Ray(context, builder, signature, values)
        self.curve = _Curve(Table(context, builder, signature.args[2], values[2]).row(values[3]))
        self.corners = [repeated(builder, v) for v in cgutils.unpack_tuple(builder, values[4])]
        self.number = repeated(builder, values[5])
        ray, curve = self.ray, self.curve
        self.own = ray.own.equals(self.number)
        self.zero, self.one = constant(builder, 0.0), constant(builder, 1.0)
        self.far = ~self.own & _meets_circle(ray, curve)

    def coefficients(self) -> tuple[Lanes, Lanes, Lanes, Lanes]:
        """Return those of g, as in `bezier_hit`."""
        ray, curve = self.ray, self.curve
        return (
            cross(curve[c.START_X] - ray.px, curve[c.START_Y] - ray.py, ray.vx, ray.vy),
            cross(curve[c.X1], curve[c.Y1], ray.vx, ray.vy),
            cross(curve[c.X2], curve[c.Y2], ray.vx, ray.vy),
            cross(curve[c.X3], curve[c.Y3], ray.vx, ray.vy),
        )

    def value_at_end(self) -> Lanes:
        ray, curve = self.ray, self.curve
        return cross(curve[c.END_X] - ray.px, curve[c.END_Y] - ray.py, ray.vx, ray.vy)

    def spread(self) -> Lanes:
        """Return the size of the products in the sum g."""
        ray, curve = self.ray, self.curve
        size: Lanes = curve_size.py_func(curve)
        fast = (abs(ray.vx) > abs(ray.vy)).where(abs(ray.vx), abs(ray.vy))
        return fast * (abs(curve[c.START_X] - ray.px) + abs(curve[c.START_Y] - ray.py) + size)

    def touch(self, ends: Any, extrema: Any) -> None:
        """Doubt rays whose line passes an end of the piece, or touches it at an extremum of g, within rounding.

        ``ends`` are the values of g there, and of each extremum whether it is on the piece and the value.
        """
        room = (TANGENT_ULPS * EPS) * self.spread()
        near = (abs(ends[0]) <= room) | (abs(ends[1]) <= room)
        for inside, value in extrema:
            near = near | (inside & (abs(value) <= room))
        self.ray.doubt(self.far & near)

    def hit(self, s: Lanes, chosen: Lanes) -> None:
        """Take the hits at s that are nearer."""
        ray, curve = self.ray, self.curve
        x = bezier_value.py_func(curve[c.START_X], curve[c.X1], curve[c.X2], curve[c.X3], s)
        y = bezier_value.py_func(curve[c.START_Y], curve[c.Y1], curve[c.Y2], curve[c.Y3], s)
        time = dot(x - ray.px, y - ray.py, ray.vx, ray.vy)
        ray.doubt(chosen & self.far & (abs(time) <= NEARBY * self.spread()))
        nearer = chosen & (time > 0.0) & (time < ray.at[TIME])
        with self.builder.if_then(nearer.any()):
            slope_of = bezier_slope.py_func
            tx, ty = (
                slope_of(curve[c.X1], curve[c.X2], curve[c.X3], s),
                slope_of(curve[c.Y1], curve[c.Y2], curve[c.Y3], s),
            )
            scale = self.one / (tx * tx + ty * ty).root()
            start, end = self.corners
            dx, dy = x - curve[c.START_X], y - curve[c.START_Y]
            at_corner = (start > 0.0) & (dot(dx, dy, dx, dy) <= start * start)
            dx, dy = x - curve[c.END_X], y - curve[c.END_Y]
            at_corner = at_corner | ((end > 0.0) & (dot(dx, dy, dx, dy) <= end * end))
            ray.hit(nearer, self.number, time, (x, y), (-ty * scale, tx * scale), at_corner)
            ray.at[HIT_S] = nearer.where(s, ray.at[HIT_S])

    def hit_from_own(self, g: Any, shift: Lanes, chosen: Lanes) -> None:
        """Take hits of rays that started on the piece."""
        _, a1, a2, a3 = g
        s = self.ray.at[BEFORE] + shift
        slack = JOINT_ULPS * EPS
        chosen = chosen & (s >= -slack) & (s <= 1.0 + slack)
        s = _squeezed(s)
        self.hit(s, chosen & (bezier_slope.py_func(a1, a2, a3, s) <= 0.0))


@intrinsic
def meet_parabola(typing, work, first, beziers, k, corners, number):
    """Find the hits of eight rays on a quadratic Bezier piece that are nearer, as `nearest_bezier` does for one ray.

    ``corners`` are the slacks of the two ends, negative where there is no corner; ``number`` is that of the piece.
    """

    def meet(context, builder, signature, values):
        all_ = _Meeting(context, builder, signature, values)
        ray = all_.ray
        with builder.if_then((all_.own | all_.far).any()):
            g = all_.coefficients()
            a0, a1, a2, a3 = g
            with builder.if_then(all_.own.any()):
                slope = bezier_slope.py_func(a1, a2, a3, ray.at[BEFORE])
                bend = 3.0 * a3 * ray.at[BEFORE] + a2
                all_.hit_from_own(g, slope / -bend, all_.own)
            with builder.if_then(all_.far.any()):
                last = all_.value_at_end()
                lowest_at = a1 / (-2.0 * a2)
                lowest = bezier_value.py_func(a0, a1, a2, a3, lowest_at)
                inside = (lowest_at > 0.0) & (lowest_at < 1.0)
                all_.touch((a0, last), [(inside, lowest)])
                early = (a0 >= 0.0) & (lowest <= 0.0) & (a0 > lowest)
                late = (lowest >= 0.0) & (last <= 0.0) & (lowest > last)
                whole = (a0 >= 0.0) & (last <= 0.0) & (a0 > last)
                falls = all_.far & ((inside & (early | late)) | (~inside & whole))
                with builder.if_then(falls.any()):
                    all_.hit(_quadratic_roots(a0, a1, a2), falls)
        return context.get_dummy_value()

    return _meeting_type(work, beziers), meet


@intrinsic
def meet_cubic(typing, work, first, beziers, k, corners, number):
    """Find the hits of eight rays on a cubic Bezier piece that are nearer; see `meet_parabola`."""

    def meet(context, builder, signature, values):
        all_ = _Meeting(context, builder, signature, values)
        with builder.if_then((all_.own | all_.far).any()):
            g = all_.coefficients()
            with builder.if_then(all_.own.any()):
                _meet_own_cubic(all_, g)
            a0, a1, a2, a3 = g
            b1, b2, b3 = a0 + a1 / 3.0, a0 + (2.0 * a1 + a2) / 3.0, a0 + a1 + a2 + a3
            room = (NO_ZERO_ULPS * EPS) * all_.spread()
            positive = (a0 > room) & (b1 > room) & (b2 > room) & (b3 > room)
            negative = (a0 < -room) & (b1 < -room) & (b2 < -room) & (b3 < -room)
            all_.far = all_.far & ~positive & ~negative
            with builder.if_then(all_.far.any()):
                _meet_far_cubic(all_, g)
        return context.get_dummy_value()

    return _meeting_type(work, beziers), meet


def _meeting_type(work: Any, beziers: Any) -> Any:
    number = types.float64
    return types.void(work, types.int64, beziers, types.int64, types.UniTuple(number, 2), number)


def _meet_own_cubic(all_: _Meeting, g: Any) -> None:
    """Find hits of the rays that started on the piece, as `hit_from_own` does for one ray."""
    _, a1, a2, a3 = g
    own_s = all_.ray.at[BEFORE]
    b0, b1 = bezier_slope.py_func(a1, a2, a3, own_s), 3.0 * a3 * own_s + a2
    disc = b1 * b1 - 4.0 * a3 * b0
    all_.ray.doubt(all_.own & (abs(disc) <= own_error.py_func(curve_size.py_func(all_.curve), b0, b1, a3)))
    root = disc.root()
    q = -0.5 * (b1 + (b1 >= 0.0).where(root, -root))
    for shift in (q / a3, b0 / q):
        all_.hit_from_own(g, shift, all_.own & (disc >= 0.0))


def _meet_far_cubic(all_: _Meeting, g: Any) -> None:
    """Find hits of the rays that started elsewhere, as `hit_from_afar` does for one ray."""
    a0, a1, a2, a3 = g
    zero, one, last = all_.zero, all_.one, all_.value_at_end()
    disc = a2 * a2 - 3.0 * a3 * a1
    root = disc.root()
    q = -(a2 + (a2 >= 0.0).where(root, -root))
    c1, c2 = q / (3.0 * a3), a1 / q
    # NaN, if there are no extrema, is not inside
    first_at, second_at = (c1 < c2).where(c1, c2), (c1 < c2).where(c2, c1)
    values = []
    insides = []
    for turn in (first_at, second_at):
        inside = (disc > 0.0) & (turn > 0.0) & (turn < 1.0)
        value = bezier_value.py_func(*g, turn)
        values.append(value)
        insides.append(inside)
    all_.touch((a0, last), zip(insides, values, strict=True))
    low, value_low = insides[0].where(first_at, zero), insides[0].where(values[0], a0)
    high, value_high = insides[1].where(second_at, one), insides[1].where(values[1], last)
    first = (a0 >= 0.0) & (value_low <= 0.0) & (a0 > value_low)
    second = (value_low >= 0.0) & (value_high <= 0.0) & (value_low > value_high)
    third = (value_high >= 0.0) & (last <= 0.0) & (value_high > last)
    falls = all_.far & (first | second | third)
    with all_.builder.if_then(falls.any()):
        start, end = _pick((first, zero), (second, low), high), _pick((first, low), (second, high), one)
        above = _pick((first, a0), (second, value_low), value_high)
        below = _pick((first, value_low), (second, value_high), last)
        all_.hit(_falling_roots(g, start, end, above, below, falls), falls)
    again = all_.far & first & third
    with all_.builder.if_then(again.any(), likely=False):
        all_.hit(_falling_roots(g, high, one, value_high, last, again), again)
