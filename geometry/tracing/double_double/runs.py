"""Long runs of hits in one step, in double-double arithmetic: between vertical sides, and along a circular arc.

Loads numba. The last hits of a run are left to be traced hit by hit.
"""

from __future__ import annotations

import math

import numpy as np

from ....core.compilation import jit
from ...scene import columns as c
from .arcs import arc_form
from .formulas import arc_normal
from .numbers import cross, direction_angle, dot, extended, scaled, sine_cosine, two_sum

# Runs up to this number of hits are traced hit by hit, as a check of `compiled/runs`; so are the last hits of a run.
LONGEST_FOLLOWED, LAST_HITS = 4096.0, 4.0

_compile = jit(linked=True, _nrt=False)


@_compile
def crossings(tables, index, other, py, vx, vy, most):
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
            count = room / abs(step.high) - LAST_HITS if step.high != 0.0 else 0.0
            if count > LONGEST_FOLLOWED and count < most and time > 0.0:
                hits = 2 * np.int64(0.5 * count)
                # beyond 2^53 hits is no double, and a double-double does not resolve the ray's position
                return hits, float(hits) * step, float(hits) * time.high
    return 0, travel, flight


@_compile
def turned(x, y, sine, cosine):
    """-> (x, y): a vector turned by an angle."""
    return cosine * x - sine * y, sine * x + cosine * y


@_compile
def skip_chords(arc, px, py, vx, vy, most):
    """-> (chords, px, py, vx, vy): move a ray along a circular arc by most chords of a long run.

    As in `compiled/runs`. With n the normal at the ray, t the tangent and tau the angle of all chords about the centre,
    the ray moves by (2 sin(tau/2) / kappa) (cos(tau/2) t + sin(tau/2) n).
    """
    form = arc_form(arc)
    n0x, n0y, curvature = form
    qx, qy = px - arc[c.START_X], py - arc[c.START_Y]
    nx, ny = arc_normal(form, 1.0, qx, qy)
    sine, cosine = dot(vx, vy, nx, ny), cross(vx, vy, nx, ny)
    if sine <= 0.0 or sine > arc[c.RUN_SINE]:
        return 0, px, py, vx, vy
    forward = cosine > 0.0
    half_chord = direction_angle(cosine if forward else -cosine, sine)
    phi = 2.0 * math.atan2(dot(qx, qy, n0x, n0y).high, cross(qx, qy, n0x, n0y).high)
    if phi < 0.0:
        phi += 2.0 * math.pi
    room = arc[c.SPAN] - phi if forward else phi
    count = 0.5 * room / half_chord.high - LAST_HITS
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
