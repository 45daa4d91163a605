"""The compiled loop of interval marching. Only `marching` imports this file, because it loads numba.

The line is folded, not the hollow unfolded: with m = (m_x, m_y) the line's normal, at first (sin theta, -cos theta),
a vertex (X, Y) is passed on its left exactly by the lines p < X m_x + Y m_y + shift, with p = x sin theta. A wall with
unit normal n at distance d from the origin changes m by -2 (m.n) n and the shift by 2 (m.n) d. The changes of m are
added up as angles.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .polygons.compiled.codes import FIRST_WALL, OPENING
from .polygons.compiled.splitting import offset_of, reduced, wall_lines
from .tracing.compiled.growing import longer, taller
from .tracing.double_double.arithmetic import add

# Triangles that a ray may pass for every bounce that it is allowed.
STEPS_A_BOUNCE = 64

_compile = njit(cache=True, nogil=True, error_model="numpy")


@_compile
def march(x, y, triangles, beyond, turn_high, turn_low, entrance, theta, max_intervals, max_bounces):
    """Exact rows at many angles; returns first row of each angle, then per interval: end, offset, and sign, bounces."""
    width = x[x.shape[0] - 1]
    walls = wall_lines(x, y, turn_high)
    first = np.zeros(theta.shape[0] + 1, np.int64)
    room = 64 + 8 * theta.shape[0]
    ends, offsets = np.empty(room), np.empty(room)
    tags = np.empty((room, 2), np.int64)
    used = 0
    for row in range(theta.shape[0]):
        sine, cosine = math.sin(theta[row]), math.cos(theta[row])
        stop = width * sine
        low = 0.0
        count = 0
        while low < stop:
            high = stop
            edge, sign, bounces, steps = entrance, 1, 0, 0
            m_x, m_y, shift, shift_low = sine, -cosine, 0.0, 0.0
            turn, rest = 0.0, 0.0
            out = count + 1 < max_intervals
            while out:
                triangle, side = edge // 3, edge % 3
                apex = triangles[triangle, (side + 2) % 3]
                value = x[apex] * m_x + y[apex] * m_y + shift_low + shift
                if value > low:
                    high = min(high, value)
                    edge = 3 * triangle + ((side + 1) % 3 if sign > 0 else (side + 2) % 3)
                else:
                    edge = 3 * triangle + ((side + 2) % 3 if sign > 0 else (side + 1) % 3)
                code = beyond[edge]
                steps += 1
                if code >= 0:
                    edge = code
                elif code == OPENING:
                    break
                else:
                    wall = FIRST_WALL - code
                    across = 2.0 * (m_x * walls[wall, 0] + m_y * walls[wall, 1])
                    shift, shift_low = add((shift, shift_low), (across * walls[wall, 2], 0.0))
                    turn, rest = add((turn, rest), (2.0 * sign * turn_high[wall], 2.0 * sign * turn_low[wall]))
                    turn, rest = reduced(turn, rest)
                    sign = -sign
                    bounces += 1
                    # m from the sum of all turns, so that its error does not grow
                    turned, along = math.sin(turn), math.cos(turn)
                    turned, along = turned + rest * along, along - rest * turned
                    m_x = sine * along - cosine * turned
                    m_y = -sign * (cosine * along + sine * turned)
                if bounces > max_bounces or steps > STEPS_A_BOUNCE * max_bounces:
                    out = False
            if count + 1 >= max_intervals:
                high = stop
            if used == room:
                room *= 2
                ends, offsets, tags = longer(ends, room), longer(offsets, room), taller(tags, room)
            offset = offset_of(float(sign), turn, rest, theta[row]) if out else 0.0
            ends[used] = high / stop
            offsets[used] = offset
            tags[used, 0], tags[used, 1] = sign if out else 0, bounces
            used += 1
            count += 1
            low = high
        first[row + 1] = used
    return first, ends[:used], offsets[:used], tags[:used]
