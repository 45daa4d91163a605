"""Compiled: when a satellite of the flying disk first meets a piece of the wall. Only `rigid_engine` imports this file.

Lengths are in units of the wall, so the disk's radius is 1/scale and the wall's tops are at height 0. In the time t a
disk with velocities (v1, v2) and spin omega moves a satellite at the angle a from the lowest point by

    D(t) = (v1 t + (sin(a + d) - sin a)/scale, v2 t + (cos a - cos(a + d))/scale),   d = scale omega t,

which is evaluated by products, without cancellation. A line or an upright conic is F = 0 with

    F(D) = f + g.D - curvature |D|^2/2     (y multiplied by the arc's stretch; curvature 0 for lines),

where f and g belong to the start of the flight: the rows of the planar tracer's tables, see `scene`, with circles and
ellipses in one table ``arcs``.

**No root is passed.** On [t, t + ahead] the second derivative of F(D(t)) is at least c = F''(t) - L ahead, where L
bounds the third one. So F lies above the parabola with F(t), F'(t) and c, and the first root of the parabola is a
safe step; where the parabola has none, F has none. The steps converge quadratically because c tends to F''. All roots
of F are visited in their order, in both directions, until one lies on the piece.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .arc_engine import on_arc
from .engine import CORNER, ESCAPED, GRAZING, LINE, NO_PIECE, SIDE, near_end

# Arrays belong to the caller for the whole run. Counting the references to them, an atomic operation at each function
# that takes one, took a quarter of the time: these functions are compiled without numba's run time, and allocate nothing.
compiled = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
# an array that is passed costs ten arguments: small functions are inlined
inlined = njit(cache=True, nogil=True, error_model="numpy", _nrt=False, forceinline=True)

# A contact is clear, or double precision does not settle it; the codes are those of the statuses of rays.
CLEAR = ESCAPED
# numba compiles a function again for every literal that it is called with, but not for constants of these types
NOTHING, ZERO, NO = np.int64(-1), np.int64(0), np.bool_(False)
# The series of `half_turn` are cut after the tenth power: below this angle the rest is less than 2e-18.
SMALL_TURN = 0.1
S3, S5, S7, S9 = -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0, 1.0 / 362880.0
C2, C4, C6, C8, C10 = -1.0 / 2.0, 1.0 / 24.0, -1.0 / 720.0, 1.0 / 40320.0, -1.0 / 3628800.0
# Of the slack, 16 rounding errors, a root's own error may be this share.
ROOT_SHARE = 1.0 / 16.0
# Incidences below 1e-6 radians are treated as that one, so that the slack stays far below the pieces' lengths.
WIDEST_SLACK = 1e6
# A near tangency halves its distance at every step at worst, from the wall's size to its rounding in about 100 steps.
ROOT_STEPS = 400


ARC = 8


@inlined
def half_turn(h):
    """Sine and cosine of h, quickly where h is small."""
    if abs(h) < SMALL_TURN:
        z = h * h
        sine = h + h * z * (S3 + z * (S5 + z * (S7 + z * S9)))
        return sine, 1.0 + z * (C2 + z * (C4 + z * (C6 + z * (C8 + z * C10))))
    return math.sin(h), math.cos(h)


@inlined
def satellite_after(t, turn, motion):
    """Displacement (2) of a satellite after the time t, and the sine and cosine of its angle then.

    ``turn`` is (sin a, cos a) at the start, ``motion`` is (v1, v2, omega, scale).
    """
    sine, cosine = turn
    if t == 0.0:
        return 0.0, 0.0, sine, cosine
    v1, v2, omega, scale = motion
    half_sine, half_cosine = half_turn(0.5 * scale * omega * t)
    sin_d, versed_d = 2.0 * half_sine * half_cosine, 2.0 * half_sine * half_sine
    d_sine, fall = cosine * sin_d - sine * versed_d, sine * sin_d + cosine * versed_d
    radius = 1.0 / scale
    return v1 * t + d_sine * radius, v2 * t + fall * radius, sine + d_sine, cosine - fall


@inlined
def safe_step(f, f1, c):
    """First positive root of the parabola f + f1 t + c t^2/2 with f >= 0, or inf; 0 only where f = 0 > f1."""
    disc = f1 * f1 - 2.0 * c * f
    if f1 < 0.0:
        return 2.0 * f / (math.sqrt(disc) - f1) if disc >= 0.0 else np.inf
    return (f1 + math.sqrt(disc)) / -c if c < 0.0 else np.inf


@compiled
def next_root(sign, leaving, piece, t, end, state, turn, motion, fastest, patience, slack):
    """First time in [t, end) at which sign F falls through 0 (inf if none), the satellite's state there, and a code.

    ``piece`` is (f, g1, g2, curvature, stretch) and ``state`` what `satellite_after` gives at t. ``leaving`` says that
    F(t) = 0 to rounding, a root that is not to be found again. ``fastest`` bounds the satellite's speed and
    ``patience`` is the longest time for which the bounds are worth having.
    """
    f0, g1, g2, curvature, stretch = piece
    v1, v2, omega, scale = motion
    widest = max(1.0, stretch)
    bend = scale * omega * omega
    swing = bend * scale * abs(omega)
    for number in range(ROOT_STEPS):
        dx, dy = state[0], stretch * state[1]
        n1, n2 = g1 - curvature * dx, g2 - curvature * dy
        u1, u2 = v1 + omega * state[3], stretch * (v2 + omega * state[2])
        f = sign * (f0 + 0.5 * ((g1 + n1) * dx + (g2 + n2) * dy))
        f1 = sign * (n1 * u1 + n2 * u2)
        f2 = sign * (bend * (stretch * n2 * state[3] - n1 * state[2]) - curvature * (u1 * u1 + u2 * u2))
        if number == 0 and leaving:
            if f1 <= 0.0:
                return t, state, GRAZING
            f = 0.0
        elif f <= 0.0:
            # at the start: behind the piece by a rounding error
            return t, state, CLEAR if number > 0 else CORNER
        ahead = min(end - t, patience)
        third = widest * swing
        if curvature != 0.0:
            speed = widest * fastest
            third *= math.sqrt(n1 * n1 + n2 * n2) + abs(curvature) * speed * ahead
            third += 3.0 * abs(curvature) * speed * widest * bend
        c = f2 - third * ahead
        step = safe_step(f, f1, c)
        if step >= ahead:
            if c > 0.0 and -f2 * ahead <= f1 < 0.0 and f - 0.5 * f1 * f1 / f2 <= slack:
                # so near a tangency that rounding decides between two roots and none
                t -= f1 / f2
                return t, satellite_after(t, turn, motion), GRAZING
            if end - t <= patience:
                break
            step = ahead
        before = t
        t += step
        state = satellite_after(t, turn, motion)
        # what F may still be there is its gap to the parabola; far below the slack it counts as 0
        if step < ahead and (third * ahead * step * step <= ROOT_SHARE * slack or t == before):
            return t, state, CLEAR
    return np.inf, state, CLEAR


@inlined
def where_on_line(joints, lines, j, x, y, slack):
    """How a point of the line through segment j lies to the segment: inside, and within the slack of a corner."""
    along = (x - joints[j, 0]) * lines[j, 0] + (y - joints[j, 1]) * lines[j, 1]
    length = lines[j, 4]
    from_start, from_end = along / length, length - along / length
    corner = (from_start <= slack and joints[j, 2] > 0.0) or (from_end <= slack and joints[j + 1, 2] > 0.0)
    return from_start >= -slack and from_end >= -slack, corner


@inlined
def first_on_piece(kind, index, own, x, y, t, end, state, turn, motion, fastest, size, slack, joints, lines, arcs):
    """First contact in [t, end) of one satellite with the front of one piece, the state there, and a code.

    (x, y) is where the satellite was at the start of the flight, and ``own`` whether that is on this piece.
    """
    patience = np.inf
    if kind == LINE:
        g1, g2, curvature, stretch = lines[index, 2], lines[index, 3], 0.0, 1.0
        f0 = 0.0 if own else g1 * (x - joints[index, 0]) + g2 * (y - joints[index, 1])
    else:
        curvature, stretch = arcs[index, 4], arcs[index, 12]
        rx, ry = x - arcs[index, 0], stretch * (y - arcs[index, 1])
        g1, g2 = arcs[index, 2] - curvature * rx, arcs[index, 3] - curvature * ry
        f0 = 0.0 if own else 0.5 * ((arcs[index, 2] + g1) * rx + (arcs[index, 3] + g2) * ry)
        patience = 2.0 * size / fastest
    piece = (f0, g1, g2, curvature, stretch)
    dx, dy = state[0], stretch * state[1]
    n1, n2 = g1 - curvature * dx, g2 - curvature * dy
    here = f0 + 0.5 * ((g1 + n1) * dx + (g2 + n2) * dy)
    leaving = own and t == 0.0
    falling = n1 * (motion[0] + motion[2] * state[3]) + stretch * n2 * (motion[1] + motion[2] * state[2]) < 0.0
    sign = 1.0 if leaving or here >= 0.0 or (here >= -slack and falling) else -1.0
    while True:
        t, state, code = next_root(sign, leaving, piece, t, end, state, turn, motion, fastest, patience, slack)
        if t >= end:
            return np.inf, state, CLEAR
        if sign > 0.0:
            px, py = x + state[0], y + state[1]
            # at a shallow incidence a rounding error across the piece is a longer way along it
            dx, dy = state[0], stretch * state[1]
            n1, n2 = g1 - curvature * dx, g2 - curvature * dy
            inward = n1 * (motion[0] + motion[2] * state[3]) + stretch * n2 * (motion[1] + motion[2] * state[2])
            wide = slack * max(1.0, min(fastest / abs(inward), WIDEST_SLACK))
            if kind == LINE:
                inside, corner = where_on_line(joints, lines, index, px, py, wide)
            else:
                ax, ay = px - arcs[index, 0], stretch * (py - arcs[index, 1])
                inside = on_arc(arcs[index], ax, ay, wide * max(1.0, stretch))
                corner = near_end(arcs[index], px, py, wide)
            if inside:
                return t, state, CORNER if corner else code
        if code != CLEAR:
            # a tangency beside the piece: of a line it is the only one, and of a circle the way leads on outside
            return np.inf, state, CLEAR
        sign = -sign
        leaving = True


@inlined
def first_in_hollow(
    hollows, h, own_kind, own_index, came_from, x, y, t, end, state, turn, motion, fastest, slack, is_open, joints,
    lines, arcs,
):  # fmt: skip
    """First contact of one satellite with the pieces of the hollow h: time (inf), kind, index, state and code.

    For an open wall the sides of the cell count as pieces; ``came_from`` is -1 or 1 for a satellite that has just come
    in through the left or the right one.
    """
    kind, index, code, where, size = NO_PIECE, -1, CLEAR, state, hollows[h, 2]
    for part in (3, 5, 7):
        tried = LINE if part == 3 else ARC
        for k in range(int(hollows[h, part]), int(hollows[h, part + 1])):
            if tried == ARC or joints[k, 3] > 0.0:
                own = own_kind == tried and own_index == k
                hit, place, unclear = first_on_piece(
                    tried, k, own, x, y, t, end, state, turn, motion, fastest, size, slack, joints, lines, arcs
                )
                if hit < end:
                    end, kind, index, code, where = hit, tried, k, unclear, place
    if is_open:
        for side in (-1, 1):
            edge = hollows[h, 0] if side < 0 else hollows[h, 1]
            piece = (side * (edge - x), -float(side), 0.0, 0.0, 1.0)
            hit, place, unclear = next_root(
                1.0, came_from == side, piece, t, end, state, turn, motion, fastest, np.inf, slack
            )
            if hit < end:
                end, kind, index, code, where = hit, SIDE, side, unclear, place
    return end if kind != NO_PIECE else np.inf, kind, index, where, code
