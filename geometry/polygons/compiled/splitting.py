"""The compiled loop that splits beams at the vertices of a triangulated hollow.

A line of direction theta is the vector (p, s, c) with s = sin theta, c = cos theta, p = x s at height 0, and an
unfolded vertex (X, Y) is the functional f = X s - Y c - p, positive where it lies right of the line. A beam is a convex
polygon of such vectors. The generators have p, s and abs(c) of one sign, and cutting only mixes them with positive
weights: every component keeps its relative accuracy down to grazing. `columns` says where a beam's numbers stand.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ....core.rounding import EPS
from ...tracing.compiled.growing import larger, longer, taller
from ...tracing.compiled.trigonometry import PI, PI_REST
from ...tracing.double_double.arithmetic import add
from .codes import FIRST_WALL, OPENING
from .columns import (
    BOUNCES,
    COUNT,
    CUT_X,
    CUT_Y,
    EDGE,
    ERROR_X,
    ERROR_Y,
    FLUX,
    LEAF,
    LINE_C,
    LINE_P,
    LINE_S,
    PIECE_COLUMNS,
    PIECE_COSINE,
    PIECE_HIGH,
    PIECE_LOW,
    PIECE_OFFSET,
    PIECE_SINE,
    REAL_COLUMNS,
    SIGN,
    T_X,
    T_X_LOW,
    T_Y,
    T_Y_LOW,
    TAG_BOUNCES,
    TAG_COLUMNS,
    TAG_LEAF,
    TAG_LEFT,
    TAG_SIGN,
    TURN,
    TURN_LOW,
    VERTEX_COLUMNS,
    WALL_COLUMNS,
    WALL_DISTANCE,
    WALL_NORMAL_X,
    WALL_NORMAL_Y,
    WHOLE_COLUMNS,
)
from .heap import copied, pop, push, put

_compile = njit(cache=True, nogil=True, error_model="numpy")
# f is a sum of five products of numbers with one to three rounding errors each; every term is counted in `f`'s size.
FUNCTIONAL_ULPS = 8.0
# T gains 2 d R n at a reflection: d, n, R and the two products have one rounding error each.
STEP_ULPS = 4.0
DONE, BUDGET = 0, 1
# The open flux is a running sum; it is added up anew this often.
RECOUNT = 4096
# A beam may pass this many triangles for every beam that the budget allows.
STEPS_A_BEAM = 64


@_compile
def reduced(high, low):
    """An angle in two doubles, modulo 2 pi, in [-pi, pi] within rounding."""
    turns = np.rint(high / (2.0 * PI))
    if turns != 0.0:
        # turns is 1 or 2 at most, so its products are exact
        high, low = add((high, low), (-2.0 * turns * PI, -2.0 * turns * PI_REST))
    return high, low


@_compile
def offset_of(sign, turn, turn_low, middle):
    """The offset of theta' = sign (theta + pi - turn), modulo 2 pi, for which the angle ``middle`` leaves upwards."""
    offset = add((sign * PI, sign * PI_REST), (-sign * turn, -sign * turn_low))
    turns = np.rint((sign * middle + offset[0] - 0.5 * PI) / (2.0 * PI))
    return add(offset, (-2.0 * turns * PI, -2.0 * turns * PI_REST))[0]


@_compile
def wall_lines(x, y, turn_high):
    """The lines of a hollow's walls, one a row: unit normal and distance from the origin, from the nearer end."""
    lines = np.empty((turn_high.shape[0], WALL_COLUMNS))
    for e in range(turn_high.shape[0]):
        lines[e, WALL_NORMAL_X], lines[e, WALL_NORMAL_Y] = -math.sin(turn_high[e]), math.cos(turn_high[e])
        k = e if abs(x[e]) + abs(y[e]) <= abs(x[e + 1]) + abs(y[e + 1]) else e + 1
        lines[e, WALL_DISTANCE] = lines[e, WALL_NORMAL_X] * x[k] + lines[e, WALL_NORMAL_Y] * y[k]
    return lines


@_compile
def polygon_flux(polygon, count):
    """The integral of dp dtheta over a polygon of lines, positive if counterclockwise, as a fan of triangles.

    That of a triangle is -det(a, b, c) sqrt(2 / product of 1 + cos over the three differences of angle).
    """
    total = 0.0
    p, s, c = polygon[0, LINE_P], polygon[0, LINE_S], polygon[0, LINE_C]
    for i in range(1, count - 1):
        here_s, here_c = polygon[i, LINE_S], polygon[i, LINE_C]
        next_s, next_c = polygon[i + 1, LINE_S], polygon[i + 1, LINE_C]
        bp, bs, bc = polygon[i, LINE_P] - p, here_s - s, here_c - c
        cp, cs, cc = polygon[i + 1, LINE_P] - p, next_s - s, next_c - c
        det = p * (bs * cc - bc * cs) - s * (bp * cc - bc * cp) + c * (bp * cs - bs * cp)
        product = (1.0 + s * here_s + c * here_c) * (1.0 + here_s * next_s + here_c * next_c)
        total -= det * math.sqrt(2.0 / (product * (1.0 + s * next_s + c * next_c)))
    return total


@_compile
def clip(polygon, count, values, wanted, edge_x, edge_y, out):
    """The part of a polygon where the functional has the wanted sign; returns its number of vertices."""
    size = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        here, there = wanted * values[i], wanted * values[j]
        if here >= 0.0:
            for k in range(VERTEX_COLUMNS):
                out[size, k] = polygon[i, k]
            if here == 0.0 and there < 0.0:
                out[size, CUT_X], out[size, CUT_Y] = edge_x, edge_y
            size += 1
        if (here > 0.0 and there < 0.0) or (here < 0.0 and there > 0.0):
            near, far = abs(there), abs(here)
            p = near * polygon[i, LINE_P] + far * polygon[j, LINE_P]
            s = near * polygon[i, LINE_S] + far * polygon[j, LINE_S]
            c = near * polygon[i, LINE_C] + far * polygon[j, LINE_C]
            scale = 1.0 / math.sqrt(s * s + c * c)
            out[size, LINE_P], out[size, LINE_S], out[size, LINE_C] = p * scale, s * scale, c * scale
            if here > 0.0:
                out[size, CUT_X], out[size, CUT_Y] = edge_x, edge_y
            else:
                out[size, CUT_X], out[size, CUT_Y] = polygon[i, CUT_X], polygon[i, CUT_Y]
            size += 1
    return size


@_compile
def enter(edge, slot, real, whole, beyond, turn_high, turn_low, distance):
    """Take a beam through an edge of its triangle: on to the next one, back from a wall, or out (then True)."""
    code = beyond[edge]
    if code >= 0:
        whole[slot, EDGE] = code
        return False
    if code == OPENING:
        whole[slot, EDGE] = edge
        whole[slot, LEAF] = 1
        return True
    wall = FIRST_WALL - code
    sign = float(whole[slot, SIGN])
    # the image of the wall's unit normal, whose angle is turn + sign (direction + pi / 2)
    turn = sign * turn_high[wall], sign * turn_low[wall]
    high, low = add((real[slot, TURN], real[slot, TURN_LOW]), turn)
    sine, cosine = math.sin(high), math.cos(high)
    sine, cosine = sine + low * cosine, cosine - low * sine
    dx, dy = -2.0 * distance[wall] * sign * sine, 2.0 * distance[wall] * sign * cosine
    real[slot, T_X], real[slot, T_X_LOW] = add((real[slot, T_X], real[slot, T_X_LOW]), (dx, 0.0))
    real[slot, T_Y], real[slot, T_Y_LOW] = add((real[slot, T_Y], real[slot, T_Y_LOW]), (dy, 0.0))
    real[slot, ERROR_X] += STEP_ULPS * EPS * abs(dx)
    real[slot, ERROR_Y] += STEP_ULPS * EPS * abs(dy)
    high, low = add((high, low), turn)
    real[slot, TURN], real[slot, TURN_LOW] = reduced(high, low)
    whole[slot, SIGN] = -whole[slot, SIGN]
    whole[slot, EDGE] = edge
    whole[slot, BOUNCES] += 1
    return False


@_compile
def split_beams(x, y, triangles, beyond, turn_high, turn_low, entrance, tolerance, max_beams, halves):
    """Carry the beams of all rays through the hollow, the largest first; of the rays with theta < pi/2 if halves is 1.

    Returns the tables, the number of slots, the rounding bound (flux) and the number of splits.
    """
    width = x[x.shape[0] - 1]
    distance = wall_lines(x, y, turn_high)[:, WALL_DISTANCE]
    room, wide = 1024, 12
    corners = np.empty((room, wide, VERTEX_COLUMNS))
    real = np.zeros((room, REAL_COLUMNS))
    whole = np.zeros((room, WHOLE_COLUMNS), np.int64)
    heap = np.empty(room, np.int64)
    used, queue = 0, 0
    for half in range(halves):
        polygon = corners[half]
        for i in range(3):
            for k in range(VERTEX_COLUMNS):
                polygon[i, k] = 0.0
        if half == 0:
            polygon[0, LINE_C], polygon[1, LINE_S], polygon[2, LINE_S] = 1.0, 1.0, 1.0
            polygon[2, LINE_P], polygon[2, CUT_X] = width, width
        else:
            polygon[0, LINE_S], polygon[1, LINE_C], polygon[2, LINE_S] = 1.0, -1.0, 1.0
            polygon[2, LINE_P], polygon[1, CUT_X] = width, width
        whole[half, COUNT], whole[half, EDGE], whole[half, SIGN] = 3, entrance, 1
        real[half, FLUX] = polygon_flux(polygon, 3)
        queue = push(heap, queue, real, half)
        used += 1
    total = real[:halves, FLUX].sum()
    open_flux = total
    rounding = 0.0
    values = np.empty(wide)
    first, second = np.empty((wide, VERTEX_COLUMNS)), np.empty((wide, VERTEX_COLUMNS))
    splits, steps = 0, 0
    status = DONE
    slot = -1
    while True:
        if slot < 0:
            if queue == 0:
                break
            if splits % RECOUNT == 0 or open_flux <= tolerance * total:
                open_flux = 0.0
                for i in range(queue):
                    open_flux += real[heap[i], FLUX]
                if open_flux <= tolerance * total:
                    break
            if used >= max_beams or steps >= STEPS_A_BEAM * max_beams:
                status = BUDGET
                break
            slot, queue = pop(heap, queue, real)
        steps += 1
        if steps >= STEPS_A_BEAM * max_beams:
            queue = push(heap, queue, real, slot)
            status = BUDGET
            break
        edge, count = whole[slot, EDGE], whole[slot, COUNT]
        sign = float(whole[slot, SIGN])
        triangle, side = edge // 3, edge % 3
        apex = triangles[triangle, (side + 2) % 3]
        sine, cosine = math.sin(real[slot, TURN]), math.cos(real[slot, TURN])
        sine, cosine = sine + real[slot, TURN_LOW] * cosine, cosine - real[slot, TURN_LOW] * sine
        xx, xy, yx, yy = cosine * x[apex], -sign * sine * y[apex], sine * x[apex], sign * cosine * y[apex]
        vx, vy = xx + xy + real[slot, T_X], yx + yy + real[slot, T_Y]
        size_x = FUNCTIONAL_ULPS * EPS * (abs(xx) + abs(xy) + abs(real[slot, T_X])) + real[slot, ERROR_X]
        size_y = FUNCTIONAL_ULPS * EPS * (abs(yx) + abs(yy) + abs(real[slot, T_Y])) + real[slot, ERROR_Y]
        polygon = corners[slot]
        doubtful, doubt = False, 0.0
        positive, negative = False, False
        low_i, high_i = 0, 0
        for i in range(count):
            p, s, c = polygon[i, LINE_P], polygon[i, LINE_S], polygon[i, LINE_C]
            value = vx * s - vy * c - p
            slack = size_x * s + size_y * abs(c) + FUNCTIONAL_ULPS * EPS * p
            if abs(value) <= slack:
                if value != 0.0:
                    doubtful = True
                value = 0.0
            doubt = max(doubt, slack)
            values[i] = value
            positive = positive or value > 0.0
            negative = negative or value < 0.0
            if c * polygon[low_i, LINE_S] > s * polygon[low_i, LINE_C]:
                low_i = i
            if c * polygon[high_i, LINE_S] < s * polygon[high_i, LINE_C]:
                high_i = i
        if doubtful and not (positive and negative):
            # what lies beyond the line, by at most `doubt` in p, over at most the beam's range of angles
            spread = polygon[high_i, LINE_S] * polygon[low_i, LINE_C] - polygon[high_i, LINE_C] * polygon[low_i, LINE_S]
            rounding += 0.5 * math.pi * doubt * abs(spread)
        # the side of the triangle between its apex and the vertex of the edge that lies left of the beam, or right
        left_side, right_side = (side + 1) % 3, (side + 2) % 3
        if sign < 0.0:
            left_side, right_side = right_side, left_side
        if not (positive and negative):
            if not positive and not negative:
                rounding += abs(real[slot, FLUX])
            out = 3 * triangle + (right_side if negative else left_side)
            if enter(out, slot, real, whole, beyond, turn_high, turn_low, distance):
                open_flux -= real[slot, FLUX]
                slot = -1
            continue
        if used >= max_beams:
            queue = push(heap, queue, real, slot)
            status = BUDGET
            break
        splits += 1
        if used == room:
            room *= 2
            corners = larger(corners, room, wide)
            real, whole, heap = taller(real, room), taller(whole, room), longer(heap, room)
            polygon = corners[slot]
        if count + 1 >= wide:
            wide *= 2
            corners = larger(corners, room, wide)
            polygon = corners[slot]
            values = longer(values, wide)
            first, second = np.empty((wide, VERTEX_COLUMNS)), np.empty((wide, VERTEX_COLUMNS))
        count_first = clip(polygon, count, values, 1.0, vx, vy, first)
        count_second = clip(polygon, count, values, -1.0, vx, vy, second)
        for i in range(count_first):
            if first[i, CUT_X] == vx and first[i, CUT_Y] == vy:
                # the line that divides is misplaced by at most `doubt` in p over the cut's range of angles
                j = i + 1 if i + 1 < count_first else 0
                s, c = max(first[i, LINE_S], first[j, LINE_S]), max(abs(first[i, LINE_C]), abs(first[j, LINE_C]))
                doubt = size_x * s + size_y * c + FUNCTIONAL_ULPS * EPS * max(first[i, LINE_P], first[j, LINE_P])
                rounding += (
                    0.5
                    * math.pi
                    * doubt
                    * abs(first[i, LINE_S] * first[j, LINE_C] - first[i, LINE_C] * first[j, LINE_S])
                )
        new = used
        used += 1
        copied(slot, real, whole, new)
        put(first, count_first, corners, slot)
        put(second, count_second, corners, new)
        whole[slot, COUNT], whole[new, COUNT] = count_first, count_second
        open_flux -= real[slot, FLUX]
        real[slot, FLUX] = polygon_flux(corners[slot], count_first)
        real[new, FLUX] = polygon_flux(corners[new], count_second)
        open_flux += real[slot, FLUX] + real[new, FLUX]
        if enter(3 * triangle + left_side, slot, real, whole, beyond, turn_high, turn_low, distance):
            open_flux -= real[slot, FLUX]
        else:
            queue = push(heap, queue, real, slot)
        if enter(3 * triangle + right_side, new, real, whole, beyond, turn_high, turn_low, distance):
            open_flux -= real[new, FLUX]
        else:
            queue = push(heap, queue, real, new)
        slot = -1
    return corners, real, whole, used, rounding, splits, status


@_compile
def pieces_of(corners, real, whole, used, width):
    """Cut every polygon at the angles of its vertices; rows: low, high, sine, cosine, offset, and slot, sign, ..."""
    most = 0
    for slot in range(used):
        most += whole[slot, COUNT]
    rows = np.empty((most, PIECE_COLUMNS))
    tags = np.empty((most, TAG_COLUMNS), np.int64)
    size, leaf = 0, 0
    angle = np.empty(corners.shape[1])
    for slot in range(used):
        count = whole[slot, COUNT]
        polygon = corners[slot]
        for i in range(count):
            angle[i] = math.atan2(polygon[i, LINE_S], polygon[i, LINE_C])
        cuts = np.sort(angle[:count])
        sign = float(whole[slot, SIGN])
        middle = 0.5 * (cuts[0] + cuts[count - 1])
        offset = offset_of(sign, real[slot, TURN], real[slot, TURN_LOW], middle)
        if whole[slot, LEAF] == 1 and not 0.0 <= sign * middle + offset <= PI:
            # no ray can leave downwards: a sliver within rounding of a corner
            whole[slot, LEAF] = 0
        for k in range(count - 1):
            if cuts[k + 1] <= cuts[k]:
                continue
            middle = 0.5 * (cuts[k] + cuts[k + 1])
            lower, upper = -1, -1
            for i in range(count):
                j = i + 1 if i + 1 < count else 0
                if angle[i] <= middle < angle[j]:
                    lower = i
                elif angle[j] <= middle < angle[i]:
                    upper = i
            if lower < 0 or upper < 0:
                continue
            rows[size, PIECE_LOW], rows[size, PIECE_HIGH] = cuts[k], cuts[k + 1]
            rows[size, PIECE_SINE] = (polygon[upper, CUT_X] - polygon[lower, CUT_X]) / width
            rows[size, PIECE_COSINE] = (polygon[lower, CUT_Y] - polygon[upper, CUT_Y]) / width
            rows[size, PIECE_OFFSET] = offset
            tags[size, TAG_LEAF] = leaf
            tags[size, TAG_SIGN], tags[size, TAG_BOUNCES], tags[size, TAG_LEFT] = (
                whole[slot, SIGN],
                whole[slot, BOUNCES],
                whole[slot, LEAF],
            )
            size += 1
        if whole[slot, LEAF] == 1:
            leaf += 1
    return rows[:size], tags[:size]
