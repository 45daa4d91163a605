"""Runs in closed form: consecutive hits of a ray on one circular arc or between two facing lines. Loads numba.

All functions return the state after the run and its number of hits, 0 if a run does not pay. A run omits the last
hits, which are computed one by one. In double-doubles only long runs along an arc and between vertical sides are
computed in one step.
"""

from __future__ import annotations

import math

import numpy as np

from ...curves import columns as c
from ...scene.compiled.compiling import inlined, linked
from ..double_double.numbers import cross, direction_angle, dot, extended, rounded, scaled, sine_cosine, two_sum
from .pieces.arcs import arc_form, arc_normal, refined_form

# Least number of hits in a run, which costs about one arctangent and three sines; not tuned.
SHORTEST_RUN = 4.0
# The computed number of remaining hits has about eight relative rounding errors; a run omits the last two hits.
COUNT_ROUNDING = 1.0 - 16.0 * 2.0**-52
LAST_HITS = 2.0
# Runs up to this number of hits are traced hit by hit in double-doubles, as a check of those in doubles; so are the
# last hits of a run.
LONGEST_FOLLOWED, LAST_REFINED_HITS = 4096.0, 4.0
# Uncertainty of the ends of the facing parts and of the pieces beyond them, one slack (JOINT_ULPS) each.
END_SLACKS = 2.0


@inlined
def state_on_arc(form, arc, px, py, vx, vy):
    """-> ((sine, cosine), (nx, ny), phi, room): of a ray that leaves a circular arc.

    The angle of the velocity with the arc, the unit normal n, the angle from the start of the arc about its centre, and
    the angle that is left in the direction of travel; the last two are doubles.
    """
    n0x, n0y, _ = form
    qx, qy = px - arc[c.START_X], py - arc[c.START_Y]
    nx, ny = arc_normal(form, 1.0, qx, qy)
    # the free side, and so the normal, is on the left of the tangent in the direction of travel
    sine, cosine = dot(vx, vy, nx, ny), cross(vx, vy, nx, ny)
    # q = (sin(phi) t0 + (1 - cos(phi)) n0) / kappa with t0 = (n0y, -n0x)
    phi = 2.0 * math.atan2(rounded(dot(qx, qy, n0x, n0y)), rounded(cross(qx, qy, n0x, n0y)))
    if phi < 0.0:
        phi += 2.0 * math.pi
    return (sine, cosine), (nx, ny), phi, arc[c.SPAN] - phi if cosine > 0.0 else phi


@linked
def skip_chords(arc, px, py, vx, vy, most):
    """-> (px, py, vx, vy, chords): move a ray along a circular arc by all whole chords of its run, up to ``most``."""
    (sine, cosine), _, phi, room = state_on_arc(arc_form(arc), arc, px, py, vx, vy)
    if sine <= 0.0 or sine > arc[c.RUN_SINE]:
        return px, py, vx, vy, 0
    chord_angle = 2.0 * math.atan2(sine, abs(cosine))
    count = room / chord_angle
    if count < 1.0 or most < 1:
        return px, py, vx, vy, 0
    chords = most if count >= most else np.int64(count)
    turn = chords * chord_angle if cosine > 0.0 else -chords * chord_angle
    phi += turn
    half = 0.5 * phi
    chord = 2.0 * math.sin(half) / arc[c.CURVATURE]
    along, inward = chord * math.cos(half), chord * math.sin(half)
    qx, qy = along * arc[c.NORMAL_Y] + inward * arc[c.NORMAL_X], -along * arc[c.NORMAL_X] + inward * arc[c.NORMAL_Y]
    cosine, sine = math.cos(turn), math.sin(turn)
    return arc[c.START_X] + qx, arc[c.START_Y] + qy, cosine * vx - sine * vy, sine * vx + cosine * vy, chords


@linked
def skip_crossings(pair, normal, px, py, vx, vy, slack, most):
    """-> (px, py, vx, vy, hits): move a ray from a line by an even number of hits, at most ``most``, between two lines.

    ``pair`` is a row of the table ``pairs``, ``normal`` the unit normal of the line. Let beta be the angle between the
    lines, g the gap at the ray and alpha the angle of its velocity with the direction u of the apex. By unfolding the
    lines, hit k lies

        s_k = g (2 sin(k beta/2) / sin(beta)) cos(alpha + k beta/2) / sin(alpha + k beta)

    further towards the apex and its angle is alpha + k beta; for beta = 0, s_k = g k cot(alpha). All terms are
    accurate down to beta = 0, because the distance g / sin(beta) of the apex enters only by its inverse.
    """
    nx, ny = normal
    ux, uy, sine, beta = pair[c.APEX_X], pair[c.APEX_Y], pair[c.PAIR_SINE], pair[c.PAIR_ANGLE]
    along, away = vx * ux + vy * uy, vx * nx + vy * ny
    ahead = (pair[c.NEAR_X] - px) * ux + (pair[c.NEAR_Y] - py) * uy
    behind = (px - pair[c.FAR_X]) * ux + (py - pair[c.FAR_Y]) * uy
    gap = pair[c.GAP] + ahead * sine
    ahead -= END_SLACKS * slack
    behind -= END_SLACKS * slack
    if not (ahead > 0.0 and behind > 0.0 and away > 0.0 and gap > 0.0):
        return px, py, vx, vy, 0
    if beta == 0.0:
        room = ahead if along > 0.0 else behind
        step = gap * abs(along)
        if room * away < (SHORTEST_RUN + LAST_HITS) * step:
            return px, py, vx, vy, 0
        count = room * away / step
    else:
        if gap <= slack:
            # next to the apex, where the gap is within rounding, double precision does not resolve the position
            return px, py, vx, vy, 0
        # the facing part ends on circles about the apex; curvature is that of the circle through the ray's position
        curvature = sine / gap
        # radius of the nearer circle relative to the ray's; the line meets it if its distance from the apex is less
        narrow = (pair[c.GAP] + END_SLACKS * slack * sine) / gap
        if along > 0.0 and narrow >= away:
            root = math.sqrt((narrow - away) * (narrow + away))
            t = ahead * (2.0 - ahead * curvature) / (along + root)
        else:
            root = math.sqrt(along * along + behind * curvature * (2.0 + behind * curvature))
            reach = behind * (2.0 + behind * curvature)
            t = (along + root) / curvature if along >= 0.0 else reach / (root - along)
        count = math.atan2(curvature * t * away, 1.0 - curvature * t * along) / beta
    count = count * COUNT_ROUNDING - LAST_HITS
    if not count >= SHORTEST_RUN or most < SHORTEST_RUN:
        return px, py, vx, vy, 0
    hits = most if count >= most else np.int64(count)
    hits -= hits % 2
    if beta == 0.0:
        step = hits * (gap * along / away)
        return px + step * ux, py + step * uy, vx, vy, hits
    turn = hits * beta
    angle = math.atan2(away, along)
    last = angle + turn
    new_along, new_away = math.cos(last), math.sin(last)
    step = gap * (2.0 * math.sin(0.5 * turn) / sine) * math.cos(angle + 0.5 * turn) / new_away
    return px + step * ux, py + step * uy, new_along * ux + new_away * nx, new_along * uy + new_away * ny, hits


@linked
def refined_crossings(tables, index, other, py, vx, vy, most):
    """-> (hits, travel, flight): an even number of hits between two facing vertical sides, travel along y, and time."""
    joints, lines, pairs = tables.joints, tables.lines, tables.pairs
    travel, flight = extended(0.0), 0.0
    if (
        joints[index, c.JOINT_X] != joints[index + 1, c.JOINT_X]
        or joints[other, c.JOINT_X] != joints[other + 1, c.JOINT_X]
    ):
        return 0, travel, flight
    for row in range(int(lines[index, c.FIRST_PAIR]), int(lines[index, c.PAIRS_END])):
        if pairs[row, c.PARTNER] == other:
            gap = two_sum(joints[other, c.JOINT_X], -joints[index, c.JOINT_X])
            time = gap / vx
            step = time * vy
            low, high = min(pairs[row, c.NEAR_Y], pairs[row, c.FAR_Y]), max(pairs[row, c.NEAR_Y], pairs[row, c.FAR_Y])
            room = high - py.high if step.high > 0.0 else py.high - low
            count = room / abs(step.high) - LAST_REFINED_HITS if step.high != 0.0 else 0.0
            if count > LONGEST_FOLLOWED and count < most and time > 0.0:
                hits = 2 * np.int64(0.5 * count)
                # beyond 2^53 hits is no double, and a double-double does not resolve the ray's position
                return hits, float(hits) * step, float(hits) * time.high
    return 0, travel, flight


@linked
def turned(x, y, sine, cosine):
    """-> (x, y): a vector turned by an angle."""
    return cosine * x - sine * y, sine * x + cosine * y


@linked
def skip_refined_chords(arc, px, py, vx, vy, most):
    """-> (chords, px, py, vx, vy): move a ray along a circular arc by most chords of a long run.

    With n the normal at the ray, t the tangent and tau the angle of all chords about the centre,
    the ray moves by (2 sin(tau/2) / kappa) (cos(tau/2) t + sin(tau/2) n).
    """
    form = _, _, curvature = refined_form(arc)
    (sine, cosine), (nx, ny), _, room = state_on_arc(form, arc, px, py, vx, vy)
    if sine <= 0.0 or sine > arc[c.RUN_SINE]:
        return 0, px, py, vx, vy
    forward = cosine > 0.0
    half_chord = direction_angle(cosine if forward else -cosine, sine)
    count = 0.5 * room / half_chord.high - LAST_REFINED_HITS
    if not LONGEST_FOLLOWED < count < most:
        return 0, px, py, vx, vy
    chords = np.int64(count)
    half = float(chords) * half_chord
    first, second = sine_cosine(half.high)
    # the low part of the angle is below an ulp of it, and its square below all errors
    sine, cosine = first + half.low * second, second - half.low * first
    sine = sine if forward else -sine
    dx, dy = turned(ny, -nx, sine, cosine)
    shift = scaled(2.0, sine) / curvature
    vx, vy = turned(vx, vy, sine, cosine)
    vx, vy = turned(vx, vy, sine, cosine)
    return chords, px + shift * dx, py + shift * dy, vx, vy
