"""The compiled function that splits beams at the vertices of a triangulated hollow.

A line of direction theta is the vector (p, s, c) with s = sin theta, c = cos theta, p = x s at height 0. An unfolded
vertex (X, Y) is the functional f = X s - Y c - p, positive if the vertex lies right of the line. A beam is a convex
polygon of such vectors. The generators have p, s and abs(c) of one sign, and cutting combines them with positive
weights only, so every component has full relative accuracy down to grazing angles. `columns` describes the tables.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....core.compilation import jit
from ....core.rounding import EPS
from ...tracing.compiled.growing import larger, longer, taller
from ...tracing.compiled.options import inlined
from ...tracing.compiled.trigonometry import PI, PI_REST
from ...tracing.double_double.arithmetic import add
from .codes import FIRST_WALL, OPENING
from .columns import (
    BOUNCES,
    COUNT,
    CUT_X,
    CUT_Y,
    CUTS,
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
    PRIORITY,
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
from .heap import BeamTables, copied, pop, push, put

_compile = jit()
# Rounding error of f, in eps times the sum of the absolute terms: five products of numbers with one to three errors.
FUNCTIONAL_ULPS = 8.0
# Rounding error of 2 d R n, by which a reflection changes T: d, n, R and the two products have one error each.
STEP_ULPS = 4.0
DONE, BUDGET = 0, 1
# Number of splits after which the running sum of the open flux is computed anew.
RECOUNT = 4096
# Limit on the triangles passed by all beams, per beam allowed.
STEPS_A_BEAM = 64
# Initial number of slots in the tables, and of vertices per beam.
ROOM, WIDE = 1024, 12


@_compile
def reduced(high, low):
    """Return an angle, given as two doubles, modulo 2 pi in [-pi, pi] within rounding."""
    turns = np.rint(high / (2.0 * PI))
    if turns != 0.0:
        # turns is at most 2, so its products are exact
        high, low = add((high, low), (-2.0 * turns * PI, -2.0 * turns * PI_REST))
    return high, low


@_compile
def offset_of(sign, turn, turn_low, middle):
    """Return the offset of theta' = sign (theta + pi - turn), modulo 2 pi such that ``middle`` leaves upwards."""
    offset = add((sign * PI, sign * PI_REST), (-sign * turn, -sign * turn_low))
    turns = np.rint((sign * middle + offset[0] - 0.5 * PI) / (2.0 * PI))
    return add(offset, (-2.0 * turns * PI, -2.0 * turns * PI_REST))[0]


@_compile
def wall_lines(x, y, turn_high):
    """Return the lines of a hollow's edges: unit normal and distance from the origin, computed at the nearer end."""
    lines = np.empty((turn_high.shape[0], WALL_COLUMNS))
    for e in range(turn_high.shape[0]):
        lines[e, WALL_NORMAL_X], lines[e, WALL_NORMAL_Y] = -math.sin(turn_high[e]), math.cos(turn_high[e])
        k = e if abs(x[e]) + abs(y[e]) <= abs(x[e + 1]) + abs(y[e + 1]) else e + 1
        lines[e, WALL_DISTANCE] = lines[e, WALL_NORMAL_X] * x[k] + lines[e, WALL_NORMAL_Y] * y[k]
    return lines


@inlined
def polygon_flux(polygon, count):
    """Return the integral of dp dtheta over a polygon of lines, positive if counterclockwise.

    The polygon is cut into triangles. The integral over a triangle is -det(a, b, c) sqrt(2 / product of 1 + cos over
    the three differences of angles).
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


@inlined
def clip(polygon, count, values, wanted, edge_x, edge_y, out):
    """Write the part of a polygon with functional of the sign ``wanted`` to ``out``; return its number of vertices."""
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


class Apex(NamedTuple):
    """The third vertex of a beam's triangle, unfolded, bounds on its rounding errors, and the two edges at the vertex.

    ``left`` is the edge on the left of the vertex as seen by the beam, ``right`` the edge on its right.
    """

    x: float
    y: float
    error_x: float
    error_y: float
    left: int
    right: int


class Signs(NamedTuple):
    """The signs of an apex's functional on a beam.

    ``positive`` and ``negative`` tell whether each sign occurs. If the apex divides the beam only within rounding,
    ``rounding`` bounds the flux on the other side.
    """

    positive: bool
    negative: bool
    rounding: float


@inlined
def enter(edge, slot, beams, mesh, distance):
    """-> bool: move a beam through an edge into the next triangle, reflect it at a wall, or let it leave (True)."""
    real, whole = beams.real, beams.whole
    code = mesh.beyond[edge]
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
    turn = sign * mesh.turn_high[wall], sign * mesh.turn_low[wall]
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


@inlined
def entrance_beams(beams, mesh, entrances):
    """-> int: set the beams of rays with theta < pi/2, or of all rays if ``entrances`` is 2; return the heap's size."""
    width, queue = mesh.x[mesh.x.shape[0] - 1], 0
    for half in range(entrances):
        polygon = beams.corners[half]
        for i in range(3):
            for k in range(VERTEX_COLUMNS):
                polygon[i, k] = 0.0
        if half == 0:
            polygon[0, LINE_C], polygon[1, LINE_S], polygon[2, LINE_S] = 1.0, 1.0, 1.0
            polygon[2, LINE_P], polygon[2, CUT_X] = width, width
        else:
            polygon[0, LINE_S], polygon[1, LINE_C], polygon[2, LINE_S] = 1.0, -1.0, 1.0
            polygon[2, LINE_P], polygon[1, CUT_X] = width, width
        beams.whole[half, COUNT], beams.whole[half, EDGE], beams.whole[half, SIGN] = 3, mesh.entrance, 1
        beams.real[half, FLUX] = polygon_flux(polygon, 3)
        beams.real[half, PRIORITY] = beams.real[half, FLUX]
        queue = push(beams.heap, queue, beams.real, half)
    return queue


@inlined
def apex_of(slot, beams, mesh):
    """-> Apex: the apex of the triangle that a beam enters."""
    real, edge = beams.real, beams.whole[slot, EDGE]
    sign = float(beams.whole[slot, SIGN])
    triangle, side = edge // 3, edge % 3
    apex = mesh.triangles[triangle, (side + 2) % 3]
    x, y = mesh.x[apex], mesh.y[apex]
    sine, cosine = math.sin(real[slot, TURN]), math.cos(real[slot, TURN])
    sine, cosine = sine + real[slot, TURN_LOW] * cosine, cosine - real[slot, TURN_LOW] * sine
    xx, xy, yx, yy = cosine * x, -sign * sine * y, sine * x, sign * cosine * y
    # the sides of the triangle from the apex to the left and the right end of the edge that the beam crosses
    left, right = (side + 1) % 3, (side + 2) % 3
    if sign < 0.0:
        left, right = right, left
    return Apex(
        xx + xy + real[slot, T_X],
        yx + yy + real[slot, T_Y],
        FUNCTIONAL_ULPS * EPS * (abs(xx) + abs(xy) + abs(real[slot, T_X])) + real[slot, ERROR_X],
        FUNCTIONAL_ULPS * EPS * (abs(yx) + abs(yy) + abs(real[slot, T_Y])) + real[slot, ERROR_Y],
        3 * triangle + left,
        3 * triangle + right,
    )


@inlined
def signs_of(polygon, count, apex, values):
    """-> Signs: set ``values`` to an apex's functional at the vertices of a beam, 0 within rounding."""
    doubtful, doubt = False, 0.0
    positive, negative = False, False
    low, high = 0, 0
    for i in range(count):
        p, s, c = polygon[i, LINE_P], polygon[i, LINE_S], polygon[i, LINE_C]
        value = apex.x * s - apex.y * c - p
        slack = apex.error_x * s + apex.error_y * abs(c) + FUNCTIONAL_ULPS * EPS * p
        if abs(value) <= slack:
            if value != 0.0:
                doubtful = True
            value = 0.0
        doubt = max(doubt, slack)
        values[i] = value
        positive = positive or value > 0.0
        negative = negative or value < 0.0
        if c * polygon[low, LINE_S] > s * polygon[low, LINE_C]:
            low = i
        if c * polygon[high, LINE_S] < s * polygon[high, LINE_C]:
            high = i
    rounding = 0.0
    if doubtful and not (positive and negative):
        # the part on the other side: at most `doubt` in p, over at most the beam's range of angles
        spread = polygon[high, LINE_S] * polygon[low, LINE_C] - polygon[high, LINE_C] * polygon[low, LINE_S]
        rounding = 0.5 * math.pi * doubt * abs(spread)
    return Signs(positive, negative, rounding)


@inlined
def cut_rounding(polygon, count, apex, rounding):
    """-> float: ``rounding`` plus a bound on the flux on the wrong side of the line through an apex.

    The error of the line is at most ``doubt`` in p over the cut's range of angles.
    """
    for i in range(count):
        if polygon[i, CUT_X] == apex.x and polygon[i, CUT_Y] == apex.y:
            j = i + 1 if i + 1 < count else 0
            here_s, here_c, there_s, there_c = (
                polygon[i, LINE_S],
                polygon[i, LINE_C],
                polygon[j, LINE_S],
                polygon[j, LINE_C],
            )
            p, s, c = max(polygon[i, LINE_P], polygon[j, LINE_P]), max(here_s, there_s), max(abs(here_c), abs(there_c))
            doubt = apex.error_x * s + apex.error_y * c + FUNCTIONAL_ULPS * EPS * p
            rounding += 0.5 * math.pi * doubt * abs(here_s * there_c - here_c * there_s)
    return rounding


@_compile
def with_room(beams, used, count):
    """-> Beams: tables with a slot beyond ``used`` and with room for polygons of one vertex more than ``count``."""
    corners, real, whole, heap = beams
    room, wide = corners.shape[0], corners.shape[1]
    if used == room:
        room *= 2
        corners = larger(corners, room, wide)
        real, whole, heap = taller(real, room), taller(whole, room), longer(heap, room)
    if count + 1 >= wide:
        corners = larger(corners, room, 2 * wide)
    return BeamTables(corners, real, whole, heap)


@inlined
def queue_flux(beams, queue):
    """-> float: total flux of the beams on the heap."""
    total = 0.0
    for i in range(queue):
        total += beams.real[beams.heap[i], FLUX]
    return total


@inlined
def rank_parts(slot, new, beams):
    """Set the priorities of the two parts of a beam.

    Between parallel sides a beam loses one sliver in each passage. After k passages its flux is of the order k^-2, and
    each sliver has k^-3. By flux, the large beam would always come before its slivers, and the flux of those left
    would fall as n^(-4/3) in the number n of beams. Divided by the number of slivers it has lost, its flux has the
    order of the next sliver, and the flux that is left falls as n^-2.
    """
    real, whole = beams.real, beams.whole
    small, large = (slot, new) if real[slot, FLUX] < real[new, FLUX] else (new, slot)
    whole[small, CUTS] = 0
    whole[large, CUTS] += 1
    real[small, PRIORITY] = real[small, FLUX]
    real[large, PRIORITY] = real[large, FLUX] / (1.0 + whole[large, CUTS])


@inlined
def cut_beam(slot, new, apex, values, room, beams, rounding):
    """-> float: divide a beam at an apex, and return the new ``rounding``.

    The part right of the apex goes to slot ``new``. ``room`` is work space, two polygons.
    """
    polygon, count = beams.corners[slot], beams.whole[slot, COUNT]
    first, second = room
    count_first = clip(polygon, count, values, 1.0, apex.x, apex.y, first)
    count_second = clip(polygon, count, values, -1.0, apex.x, apex.y, second)
    copied(slot, beams.real, beams.whole, new)
    put(first, count_first, beams.corners, slot)
    put(second, count_second, beams.corners, new)
    beams.whole[slot, COUNT], beams.whole[new, COUNT] = count_first, count_second
    beams.real[slot, FLUX] = polygon_flux(beams.corners[slot], count_first)
    beams.real[new, FLUX] = polygon_flux(beams.corners[new], count_second)
    rank_parts(slot, new, beams)
    return cut_rounding(first, count_first, apex, rounding)


@_compile
def split_beams(mesh, tolerance, max_beams, entrances):
    """-> (corners, real, whole, used, rounding, splits, status): the beams of all rays, by priority.

    If ``entrances`` is 1, only rays with theta < pi/2. ``used`` slots of the tables are used; ``rounding`` bounds the
    flux in wrong leaves.
    """
    distance = wall_lines(mesh.x, mesh.y, mesh.turn_high)[:, WALL_DISTANCE]
    beams = BeamTables(
        np.empty((ROOM, WIDE, VERTEX_COLUMNS)),
        np.zeros((ROOM, REAL_COLUMNS)),
        np.zeros((ROOM, WHOLE_COLUMNS), np.int64),
        np.empty(ROOM, np.int64),
    )
    used, queue = entrances, entrance_beams(beams, mesh, entrances)
    total = beams.real[:entrances, FLUX].sum()
    open_flux = total
    rounding, splits, steps, status, slot = 0.0, 0, 0, DONE, -1
    values, polygons = np.empty(WIDE), (np.empty((WIDE, VERTEX_COLUMNS)), np.empty((WIDE, VERTEX_COLUMNS)))
    while True:
        if slot < 0:
            if queue == 0:
                break
            if splits % RECOUNT == 0 or open_flux <= tolerance * total:
                open_flux = queue_flux(beams, queue)
                if open_flux <= tolerance * total:
                    break
            if used >= max_beams or steps >= STEPS_A_BEAM * max_beams:
                status = BUDGET
                break
            slot, queue = pop(beams.heap, queue, beams.real)
        steps += 1
        if steps >= STEPS_A_BEAM * max_beams:
            queue, status = push(beams.heap, queue, beams.real, slot), BUDGET
            break
        apex, count = apex_of(slot, beams, mesh), beams.whole[slot, COUNT]
        signs = signs_of(beams.corners[slot], count, apex, values)
        rounding += signs.rounding
        if not (signs.positive and signs.negative):
            if not signs.positive and not signs.negative:
                rounding += abs(beams.real[slot, FLUX])
            if enter(apex.right if signs.negative else apex.left, slot, beams, mesh, distance):
                open_flux -= beams.real[slot, FLUX]
                slot = -1
            continue
        if used >= max_beams:
            queue, status = push(beams.heap, queue, beams.real, slot), BUDGET
            break
        splits += 1
        beams = with_room(beams, used, count)
        if values.shape[0] < beams.corners.shape[1]:
            wide = beams.corners.shape[1]
            values, polygons = np.empty(wide), (np.empty((wide, VERTEX_COLUMNS)), np.empty((wide, VERTEX_COLUMNS)))
            signs_of(beams.corners[slot], count, apex, values)
        open_flux -= beams.real[slot, FLUX]
        rounding = cut_beam(slot, used, apex, values, polygons, beams, rounding)
        open_flux += beams.real[slot, FLUX] + beams.real[used, FLUX]
        for part, edge in ((slot, apex.left), (used, apex.right)):
            if enter(edge, part, beams, mesh, distance):
                open_flux -= beams.real[part, FLUX]
            else:
                queue = push(beams.heap, queue, beams.real, part)
        used += 1
        slot = -1
    return beams.corners, beams.real, beams.whole, used, rounding, splits, status


@_compile
def pieces_of(corners, real, whole, used, width):
    """-> (rows, tags): the pieces of all beams, cut at the angles of the vertices; for their columns see `columns`."""
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
            # no ray leaves downwards: this is a sliver within rounding of a corner
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
