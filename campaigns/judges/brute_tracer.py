"""A brute-force tracer of polygonal walls in 31 digits: a judge of both compiled tracers with formulas of its own.

It takes the vertices of the wall and of its islands, not the tables. Every flight is tested against every segment by
Cramer's rule; the cells that the ray passes are taken one after the other, without sides; nothing is skipped. A hit is
ahead if the segment's line lies more than ``NEAR`` in front of the position, far below any thickness that doubles can
express and far above the rounding of 31 digits. So a coincident face of a plate without thickness, and the other side
of a peak next to its tip, are behind the ray by what they are. Faces that cross by rounding are not for this judge.
"""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
from numba import njit

from asperity.geometry.tracing.double_double.arithmetic import (
    add,
    cross,
    direction_angle,
    divide,
    dot,
    multiply,
    negate,
    sine_cosine,
    subtract,
    two_product,
    two_sum,
    wide,
)
from asperity.geometry.tracing.refinement import RefinedTrace

ESCAPED, CORNER, BOUNCE_LIMIT = 0, 1, 3
# In front of a position, as a fraction of the cell and the depth: double-doubles carry some 1e-31, plates are 1e-17 at
# least.
NEAR = 1e-25
# What doubles may be off where they only sort out segments that the ray cannot meet.
ROOM = 1e-9
# The half ulp of an angle, with some room: a ray that another judge calls a corner hit is one here.
WIDER = 1.0 + 1e-4
# Cells without a hit after which a ray is given up.
MOST_CELLS = 1_000_000

_compile = njit(cache=True, nogil=True, error_model="numpy")


def brute_trace(wall, x, theta, limit):
    """Trace rays through a polygonal wall whose pieces stay in their cell."""
    segments = [
        (*a, *b)
        for chain in (wall.vertices, *wall.island_vertices)
        for a, b in pairwise([tuple(map(float, v)) for v in chain])
    ]
    table = np.array(segments)
    assert wall.is_polygonal and table[:, ::2].min() >= 0.0 and table[:, ::2].max() <= wall.period
    closed = [chain[:-1] for chain in wall.island_vertices]
    # the wall goes on in the next cell
    first, last = wall.vertices[1], wall.vertices[-2]
    path = [(last[0] - wall.period, last[1]), *wall.vertices, (first[0] + wall.period, first[1])]
    corners = [b for a, b, c in zip(path, path[1:], path[2:], strict=False) if _turns(a, b, c)]
    for loop in closed:
        corners += [loop[k] for k in range(len(loop)) if _turns(loop[k - 1], loop[k], loop[(k + 1) % len(loop)])]
    n = len(x)
    result = RefinedTrace(
        np.empty((n, 2)), np.empty((n, 2)), np.empty(n, np.int64), np.empty(n, np.uint8), np.empty(n), np.zeros(n)
    )
    size = wall.period + float(-table[:, 1::2].min())
    _follow_rays(
        np.asarray(x, float), np.asarray(theta, float), table, np.array(corners, dtype=float).reshape(-1, 2),
        wall.period, size, limit, result.x, result.theta, result.collisions, result.status, result.amplification,
    )  # fmt: skip
    return result


def _turns(a, b, c):
    """Whether the path a, b, c has a corner at b, exactly."""
    (ax, ay), (bx, by), (cx, cy) = (tuple(map(Fraction, map(float, p))) for p in (a, b, c))
    turn = (bx - ax) * (cy - by) - (by - ay) * (cx - bx)
    return turn != 0 or (bx - ax) * (cx - bx) + (by - ay) * (cy - by) < 0


@_compile
def _follow_rays(x, theta, table, corners, period, size, limit, out_x, out_theta, bounces, status, amplification):
    near = NEAR * size
    for i in range(x.shape[0]):
        px, py = wide(x[i]), (0.0, 0.0)
        sine, cosine = sine_cosine(theta[i])
        vx, vy = negate(cosine), negate(sine)
        width = WIDER * math.ldexp(1.0, math.frexp(theta[i])[1] - 54)
        gone, hits, outcome = 0.0, 0, BOUNCE_LIMIT
        for _ in range(limit + 1):
            best, found, shift = (np.inf, 0.0), -1, (0.0, 0.0)
            leave = divide(negate(py), vy) if vy[0] > 0.0 and hits > 0 else (np.inf, 0.0)
            step = 1.0 if vx[0] > 0.0 else -1.0
            cell = math.floor(px[0] / period) - step
            for _ in range(MOST_CELLS):
                offset = two_product(cell, period)
                best, found = _first_hit(table, offset, px, py, vx, vy, near, hits == 0)
                if found >= 0:
                    shift = offset
                    break
                # where this cell ends; the ray may have left through the opening before
                edge = cell + 1.0 if step > 0.0 else cell
                if leave[0] < np.inf and (edge * period - (px[0] + leave[0] * vx[0])) * step > ROOM * size:
                    break
                cell += step
            # a face in the opening is met from below, not passed
            if leave[0] < np.inf and (found < 0 or add(py, multiply(best, vy))[0] > near):
                found, best = -1, leave
            elif found < 0:
                outcome = BOUNCE_LIMIT
                break
            incidence = abs(vy[0])
            if found >= 0:
                ex = table[found, 2] - table[found, 0]
                ey = table[found, 3] - table[found, 1]
                incidence = abs(ex * vy[0] - ey * vx[0]) / math.hypot(ex, ey)
            hit = table[max(found, 0)]
            if _meets_corner(
                corners, period, px, py, vx, vy, best[0], incidence, gone, width, size, hit, shift, found >= 0
            ):  # fmt: skip
                outcome = CORNER
                break
            gone += best[0]
            px, py = add(px, multiply(best, vx)), add(py, multiply(best, vy))
            if found < 0:
                outcome = ESCAPED
                break
            if hits == limit:
                outcome = BOUNCE_LIMIT
                break
            hits += 1
            # the velocity along the segment stays, the one across turns round
            ex = two_sum(table[found, 2], -table[found, 0])
            ey = two_sum(table[found, 3], -table[found, 1])
            fraction = divide(dot(vx, vy, ex, ey), dot(ex, ey, ex, ey))
            fraction = (2.0 * fraction[0], 2.0 * fraction[1])
            vx, vy = subtract(multiply(fraction, ex), vx), subtract(multiply(fraction, ey), vy)
            # back onto the segment, across
            ax, ay = add(wide(table[found, 0]), shift), wide(table[found, 1])
            fraction = divide(dot(subtract(px, ax), subtract(py, ay), ex, ey), dot(ex, ey, ex, ey))
            px, py = add(ax, multiply(fraction, ex)), add(ay, multiply(fraction, ey))
        out_x[i, 0], out_x[i, 1] = px
        out_theta[i, 0], out_theta[i, 1] = direction_angle(vx, vy)
        bounces[i], status[i] = hits, outcome
        amplification[i] = math.sqrt(2.0 + (gone / size) ** 2)


@_compile
def _first_hit(table, offset, px, py, vx, vy, near, starts):
    """Time to the first segment of a cell that the ray meets from its left, and the segment, -1 if there is none."""
    best, found = (np.inf, 0.0), -1
    x, y, wx, wy = px[0] - offset[0], py[0], vx[0], vy[0]
    for k in range(table.shape[0]):
        dx, dy = table[k, 2] - table[k, 0], table[k, 3] - table[k, 1]
        det = dx * wy - dy * wx
        length = math.hypot(dx, dy)
        if det > ROOM * length:
            continue
        rx, ry = table[k, 0] - x, table[k, 1] - y
        if (rx * wy - ry * wx) < -ROOM or ((rx + dx) * wy - (ry + dy) * wx) > ROOM:
            continue
        ax, ay = subtract(add(wide(table[k, 0]), offset), px), subtract(wide(table[k, 1]), py)
        ex, ey = two_sum(table[k, 2], -table[k, 0]), two_sum(table[k, 3], -table[k, 1])
        det = cross(ex, ey, vx, vy)
        if det[0] >= 0.0:
            continue
        # p + t v = a + s e
        s = divide(cross(vx, vy, ax, ay), det)
        if s[0] < 0.0 or subtract(s, (1.0, 0.0))[0] > 0.0:
            continue
        height = cross(ex, ey, ax, ay)
        if height[0] > (near if starts else -near) * length:
            continue
        t = divide(height, det)
        if found < 0 or subtract(t, best)[0] < 0.0:
            best, found = t, k
    return best, found


@_compile
def _meets_corner(
    corners, period, px, py, vx, vy, time, incidence, gone, width, size, hit, shift, is_hit
):  # fmt: skip
    """Whether the flight, or one of an angle that rounds to the same double, meets a corner before its end.

    A corner behind the segment that ends the flight is not met.
    """
    low, high = px[0], px[0] + time * vx[0]
    low, high = min(low, high), max(low, high)
    for cell in range(math.floor(low / period) - 1, math.floor(high / period) + 2):
        for k in range(corners.shape[0]):
            room = width * (gone + time + size) + ROOM
            x, y = corners[k, 0] + cell * period - px[0], corners[k, 1] - py[0]
            if abs(x * vy[0] - y * vx[0]) > room:
                continue
            qx = subtract(add(wide(corners[k, 0]), two_product(float(cell), period)), px)
            qy = subtract(wide(corners[k, 1]), py)
            ahead = dot(qx, qy, vx, vy)[0]
            reach = width * (gone + ahead) + NEAR * size
            is_met = ahead > NEAR * size and (ahead - time) * incidence <= 2.0 * reach
            if is_met and abs(cross(qx, qy, vx, vy)[0]) <= reach:
                ax, ay = subtract(add(wide(hit[0]), shift), px), subtract(wide(hit[1]), py)
                ex, ey = two_sum(hit[2], -hit[0]), two_sum(hit[3], -hit[1])
                height = cross(ex, ey, subtract(qx, ax), subtract(qy, ay))[0]
                if not is_hit or height >= -NEAR * size * math.hypot(ex[0], ey[0]):
                    return True
    return False
