"""Blocks of rays: reflected by flat tops and hollows, or moved on from facet to facet. Loads numba.

Rays are computed in blocks that fit into the first-level cache. `cross_arc`, `cross_wedge` and `cross_simple` are
called by their address, once for many rays, and compiled for walls that have such a hollow. The closed forms of the
first two have loops without branches that work in place, so the compiler vectorises them. They use sums, products,
quotients, roots and selections only, so a ray's result does not depend on its block; ``form`` are the numbers of
`scene/closed_forms`. `next_facets` finds position, piece and hit as `rays` does; runs of hits and closed forms hold for
mirrors only, and are not used.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from ....core.checks import Floats
from ...curves import columns as c
from ...scene.compiled.compiling import ROW, Late, call_late, compiled, inlined, inner, kind_of, reader_of
from .pieces.formulas import TOP_CORNER, exit_time, last_hollow, opening_at, with_length_one
from .pieces.kinds import reflect
from .pieces.records import BEZIER, FLYING, NO_PIECE, NO_STATES, OPENING, SIDE, Hit, Own
from .rays import (
    BOUNCE_LIMIT,
    CORNER,
    ESCAPED,
    GRAZING,
    MOST_STEPS,
    TABLES,
    UNCERTAIN,
    meets_corner,
    nearest_piece,
    scope_of,
    slots_at,
    tables_at,
)
from .trigonometry import LAST_ANGLE, PI, PI_REST, arcsine, direction_angle, mirrored, sine_cosine
from .waves import cross_simple
from .work import NATURAL, ROOM, WORK

# Adding and then subtracting this number rounds a number below 2^51 to an integer.
ROUNDER = 1.5 * 2.0**52


@inner
def cross_arc(form, entry, angle, hits, moment, incidence):
    """Reflect rays by a circular hollow: entry and angle become those of the exit, hits their number (0 if uncertain).

    With d the angle of incidence from the arc, X the fraction of the opening to the left of the ray,

        sin^2(d/2) = (1 - X) sin^2((theta + xi)/2) + X sin^2((theta - xi)/2),

    all terms positive, and the same with cosines. A chord advances by 2 d to the left if d is acute, else by
    2 (pi - d) to the right, which gives the number of hits. The angular momentum about the centre gives the exit.
    """
    left, right, uncertainty = form[c.FORM_LEFT], form[c.FORM_RIGHT], form[c.UNCERTAINTY]
    middle, height, radius, half = form[c.CIRCLE_X], form[c.CIRCLE_Y], form[c.RADIUS], form[c.HALF_ANGLE]
    width = right - left
    for i in range(entry.shape[0]):
        theta = angle[i]
        east, west = (entry[i] - left) / width, (right - entry[i]) / width
        s0, c0 = sine_cosine(0.5 * (theta + half))
        inner = 0.5 * (theta - half)
        s1, c1 = sine_cosine(-inner if inner < 0.0 else inner)
        sine2, cosine2 = west * (s0 * s0) + east * (s1 * s1), west * (c0 * c0) + east * (c1 * c1)
        moment[i] = sine2 - cosine2
        incidence[i] = sine2 if sine2 < cosine2 else cosine2
    for i in range(entry.shape[0]):
        incidence[i] = 2.0 * arcsine(math.sqrt(incidence[i]))
    for i in range(entry.shape[0]):
        acute = moment[i] < 0.0
        # for obtuse d the mirror image, pi - theta
        seen = angle[i] if acute else (PI - angle[i]) + PI_REST
        step = 2.0 * incidence[i]
        ratio = ((half + seen) - incidence[i]) / step
        count = (ratio + ROUNDER) - ROUNDER
        # angle from the last hit to the end of the arc, or from the end to the first point beyond it
        off = (ratio - count) * step
        count = count + 1.0 if off > 0.0 else count
        off = -off if off < 0.0 else off
        start = (half - seen) + incidence[i]
        gone = ((seen - count * step) + PI) + PI_REST
        angle[i] = gone if acute else (PI - gone) + PI_REST
        # the first and last segments pass the joints at 2 r sin(a/2) sin((step - a)/2) with a = start and a = off
        passing = start * (step - start)
        passing = passing if passing < off * (step - off) else off * (step - off)
        hits[i] = count if passing > uncertainty else 0.0
    for i in range(entry.shape[0]):
        sine, cosine = sine_cosine(angle[i])
        entry[i] = middle + (radius * moment[i] - height * cosine) / sine


@inner
def cross_wedge(form, entry, angle, hits, vx, vy, turn):
    """Reflect rays by a wedge, with results as in `cross_arc`; the last three arrays are work space.

    The sign of ``turn``, the moment of the apex about the ray, selects the line that is met first. The number of hits
    is the number of consecutive unfolded ends of the opening on the side of the ray opposite to the apex.
    """
    left, right, uncertainty = form[c.FORM_LEFT], form[c.FORM_RIGHT], form[c.UNCERTAINTY]
    apex_x, apex_y, copies = form[c.WEDGE_X], form[c.WEDGE_Y], int(form[c.COPIES])
    mirrored = c.LINK_COLUMNS * (copies + 2)
    for i in range(entry.shape[0]):
        sine, cosine = sine_cosine(angle[i])
        vx[i], vy[i] = -cosine, -sine
    for i in range(entry.shape[0]):
        turn[i] = (apex_x - entry[i]) * vy[i] - apex_y * vx[i]
    for i in range(entry.shape[0]):
        hits[i] = 1.0
    for k in range(2, copies + 1):
        first = c.CHAIN + c.LINK_COLUMNS * k
        x0, y0 = form[first + c.LINK_X], form[first + c.LINK_Y]
        x1, y1 = form[first + mirrored + c.LINK_X], form[first + mirrored + c.LINK_Y]
        before, now = k - 1.0, float(k)
        for i in range(entry.shape[0]):
            x, y = (x0, y0) if turn[i] > 0.0 else (x1, y1)
            beyond = ((x - entry[i]) * vy[i] - y * vx[i]) * turn[i] < 0.0
            hits[i] = now if beyond and hits[i] == before else hits[i]
    for i in range(entry.shape[0]):
        count = int(hits[i])
        last = c.CHAIN + c.LINK_COLUMNS * count + (0 if turn[i] > 0.0 else mirrored)
        following = last + c.LINK_COLUMNS
        inside = (form[last + c.LINK_X] - entry[i]) * vy[i] - form[last + c.LINK_Y] * vx[i]
        outside = (form[following + c.LINK_X] - entry[i]) * vy[i] - form[following + c.LINK_Y] * vx[i]
        odd = count % 2 == 1
        goes_right = odd == (turn[i] > 0.0)
        fraction = inside / (inside - outside)
        near, far = (right, left) if goes_right else (left, right)
        exit = near + fraction * (far - near)
        incoming = angle[i]
        angle[i] = form[last + c.LINK_CONSTANT] + (-incoming if odd else incoming)
        # distances of the ray's line from the apex, from the ends of the opening, and from its ends at the exit
        west, east = (left - entry[i]) * vy[i], (entry[i] - right) * vy[i]
        closest = min(min(abs(turn[i]), min(west, east)), min(abs(inside), abs(outside)))
        hits[i] = hits[i] if closest > uncertainty and fraction > 0.0 else 0.0
        entry[i] = exit


# Status of a ray to be traced hit by hit.
UNDECIDED = 255
RAYS = 512
# Row of `Room.numbers`: the left ends of the cells of rays.
BASES = 6
# Numbers in a line of the cache.
LINE = 8
# Of this type, because numba compiles a function again for a literal argument.
FIRST_HOLLOW = np.int64(0)


class Room(NamedTuple):
    """Work space: seven arrays, as long as a block has rays.

    Then the numbers of the rays of one hollow; linked lists of the rays of each hollow in a block, and of those that
    meet none, of which ``heads`` is the first ray (-1 for none), ``others`` the next; the hollows that rays meet; and
    the work space of waves.
    """

    numbers: Floats
    rays: NDArray[np.int64]
    others: NDArray[np.int64]
    met: NDArray[np.int64]
    heads: NDArray[np.int64]
    waves: Floats
    places: NDArray[np.int64]


def _aligned(count: int) -> Floats:
    """Return an array that begins at a line of the cache, as do its columns of whole lines."""
    numbers = np.empty(count + LINE)
    start = -(numbers.ctypes.data // numbers.itemsize) % LINE
    return numbers[start : start + count]


def room_for(hollows: Floats, block: int) -> Room:
    """Return the work space of `trace_closed`, for one thread and blocks of rays."""
    rays, others, met = np.empty((3, block), np.int64)
    # rays that are gathered have a second part
    heads = np.full(len(hollows) + 1, -1)
    return Room(np.empty((7, block)), rays, others, met, heads, _aligned(2 * WORK), np.empty(ROOM, np.int64))


NUMBERS, INTEGER = types.float64[::1], types.int64
WEDGES, ARCS = Late(cross_wedge, ROW, *[NUMBERS] * 6), Late(cross_arc, ROW, *[NUMBERS] * 5)
SIMPLE = Late(cross_simple, TABLES, INTEGER, INTEGER, *[NUMBERS] * 4, INTEGER[::1])
# The slots of `cross_wedge`, `cross_arc` and `cross_simple`; 0 in place of the last one leaves its hollows undecided.
CROSSINGS = WEDGES.slot, ARCS.slot, SIMPLE.slot


@inlined
def cross_hollow(tables, h, limit, entry, angle, hits, room, crossings):
    """Reflect rays by hollow number h: by its closed form if it has one, else in waves if these are wanted."""
    count = entry.shape[0]
    first, second, third = room.numbers[0, :count], room.numbers[1, :count], room.numbers[2, :count]
    wedge, arc, simple = crossings
    kind, form = tables.hollows[h, c.FORM], tables.closed[int(tables.hollows[h, c.FORM_START])]
    if kind == c.WEDGE:
        call_late(wedge, None, (form, entry, angle, hits, first, second, third))
    elif kind == c.CIRCULAR:
        call_late(arc, None, (form, entry, angle, hits, first, second))
    elif simple != 0:
        call_late(simple, None, (tables, h, limit, entry, angle, hits, room.waves, room.places))
    else:
        for j in range(count):
            hits[j] = 0.0


@inlined
def cell_of(x, cell):
    """Return the left end of the cell that contains x."""
    return np.floor(x / cell) * cell


@inlined
def put_into_hollows(starts, theta, tables, results, room):
    """-> int: the number of hollows that the rays of a block meet; list the rays of each, after those of flat tops.

    The last list, of number ``tables.hollow_count``, has the rays that meet a flat top or a corner. Their results are
    stored, and overwritten where a ray meets a hollow. Rays are spread, so the processor could not predict branches.
    """
    ends, gone, bounces, status = results
    hollows, cell = tables.hollows, tables.cell
    bases, others, met, heads = room.numbers[BASES], room.others, room.met, room.heads
    count, flat, kinds = starts.shape[0], tables.hollow_count, 0
    for j in range(count):
        bases[j] = cell_of(starts[j], cell)
    for j in range(count):
        ends[j] = starts[j]
    for j in range(count):
        gone[j] = mirrored(theta[j])
    for j in range(count):
        bounces[j] = 1
    for j in range(count):
        status[j] = ESCAPED
    for j in range(count if flat > 0 else 0):
        entry = starts[j] - bases[j]
        h = max(last_hollow(entry, hollows, flat), 0) if flat > 1 else FIRST_HOLLOW
        left, right = hollows[h, c.LEFT], hollows[h, c.RIGHT]
        place = h if (left < entry) & (entry < right) else flat
        if (entry == left) | (entry == right):
            h = opening_at(entry, hollows, flat)
            place = h if h >= 0 else flat
            if h == TOP_CORNER:
                status[j] = UNDECIDED
        met[kinds] = place
        kinds += np.int64(heads[place] < 0)
        others[j] = heads[place]
        heads[place] = j
    return kinds


@compiled
def trace_hollows(x, theta, tables, limit, results, room, crossings):
    """Trace a block of rays by flat tops, closed forms and waves; all other rays get the status `UNDECIDED`.

    Of the tables the address is given. ``results`` are four arrays to fill: x, theta, collisions, status. ``room`` is
    `room_for`, ``crossings`` is `CROSSINGS`.
    """
    tables = tables_at(tables)
    hollows, cell = tables.hollows, tables.cell
    out_x, out_theta, bounces, status = results
    numbers, rays, others, met, heads, _, _ = room
    whole = tables.hollow_count == 1 and hollows[0, c.LEFT] == 0.0 and hollows[0, c.RIGHT] == cell
    block, flat = numbers.shape[1], tables.hollow_count
    for first in range(0, x.shape[0], block):
        end = min(first + block, x.shape[0])
        starts, incoming, count = x[first:end], theta[first:end], end - first
        ends, gone, collisions, states = out_x[first:end], out_theta[first:end], bounces[first:end], status[first:end]
        if whole:
            # a single hollow without flat tops: compute in the arrays of the results, without gathering
            hits = numbers[3, :count]
            for j in range(count):
                ends[j] = starts[j] - cell_of(starts[j], cell)
            for j in range(count):
                gone[j] = incoming[j]
            cross_hollow(tables, FIRST_HOLLOW, limit, ends, gone, hits, room, crossings)
            for j in range(count):
                ends[j] += cell_of(starts[j], cell)
            for j in range(count):
                collisions[j] = int(hits[j])
                states[j] = ESCAPED if 0.0 < hits[j] <= limit else UNDECIDED
            continue
        kinds = put_into_hollows(starts, incoming, tables, (ends, gone, collisions, states), room)
        bases = numbers[BASES]
        for k in range(kinds):
            h = met[k]
            j, count = heads[h], 0
            heads[h] = -1
            if h == flat:
                continue
            while j >= 0:
                rays[count] = j
                count += 1
                j = others[j]
            entry, angle, hits = numbers[4, :count], numbers[5, :count], numbers[3, :count]
            for j in range(count):
                i = rays[j] & NATURAL
                entry[j], angle[j] = starts[i] - bases[i], incoming[i]
            cross_hollow(tables, h, limit, entry, angle, hits, room, crossings)
            for j in range(count):
                i = rays[j] & NATURAL
                ends[i], gone[i], collisions[i] = entry[j] + bases[i], angle[j], int(hits[j])
                states[i] = ESCAPED if 0.0 < hits[j] <= limit else UNDECIDED


# The least arriving angle, which a law takes: a positive normal number.
FIRST_ANGLE = 2.2250738585072014e-308
states_at = reader_of(kind_of(NO_STATES))


@inlined
def fly(scope, own, px, py, vx, vy):
    """-> (status, own, px, py, wx, wy): the next piece, with the mirrored velocity there, or the way out."""
    for _ in range(MOST_STEPS):
        hit, corner = nearest_piece(scope, own, px, py, vx, vy)
        if hit.uncertainty == UNCERTAIN:
            return CORNER, own, px, py, vx, vy
        time, kind = exit_time(scope, own, px, py, vx, vy, hit.time)
        if kind != NO_PIECE:
            hit = Hit(time, kind, hit.number, hit.s, hit.uncertainty)
        if hit.kind == NO_PIECE or meets_corner(scope, hit, corner, px, py, vx, vy):
            return CORNER, own, px, py, vx, vy
        if hit.kind == OPENING:
            return ESCAPED, own, px, py, vx, vy
        if hit.uncertainty != 0:
            return GRAZING, own, px, py, vx, vy
        if hit.kind != SIDE:
            px, py, wx, wy, at_corner = reflect(scope, hit, own, px, py, vx, vy)
            # without the length of the segment: a drawn direction does not tell from where the ray came
            own = Own(hit.kind, hit.number, hit.s if hit.kind == BEZIER else -1.0, 0.0, -1, 1)
            return CORNER if at_corner else FLYING, own, px, py, wx, wy
        py = max(py + hit.time * vy, scope.tables.joints[scope.joints[0], c.JOINT_Y])
        px = scope.left if vx > 0.0 else scope.right
        own = Own(SIDE, -1, -1.0, 0.0, -1, own.bounces)
    return BOUNCE_LIMIT, own, px, py, vx, vy


@inlined
def tangent_of(vx, vy, wx, wy):
    """-> (tx, ty): the unit tangent of a mirror, with the free side on its left, from velocities before and after."""
    # 2 (v t) t and -2 (v n) n; the longer one has no cancellation
    sx, sy, dx, dy = vx + wx, vy + wy, wx - vx, wy - vy
    if dx * dx + dy * dy > 2.0:
        scale = 1.0 / np.sqrt(dx * dx + dy * dy)
        return dy * scale, -dx * scale
    scale = 1.0 / np.sqrt(sx * sx + sy * sy)
    tx, ty = sx * scale, sy * scale
    return (-tx, -ty) if tx * wy < ty * wx else (tx, ty)


@compiled
def next_facets(first, end, states, tables, slots):
    """Let rays ``who[first:end]`` leave at their angles, and fly to the next facet, or out.

    The angle becomes the reversed arriving angle in the frame of the facet, or the outgoing angle of the wall.
    """
    who, hollow, kind, number, s, point, tangent, angle, status = states_at(states)
    tables, slots = tables_at(tables), slots_at(slots)
    for k in range(first, end):
        i = who[k]
        scope = scope_of(tables, hollow[i], slots)
        bounces = 0 if kind[i] == OPENING else 1
        own = Own(kind[i], number[i], s[i], 0.0, -1, bounces)
        tx, ty = tangent[i, c.POINT_X], tangent[i, c.POINT_Y]
        sine, cosine = sine_cosine(angle[i])
        vx, vy = with_length_one(cosine * tx - sine * ty, cosine * ty + sine * tx)
        status[i], own, px, py, wx, wy = fly(scope, own, point[i, c.POINT_X], point[i, c.POINT_Y], vx, vy)
        if status[i] == ESCAPED:
            angle[i] = min(direction_angle(vx, vy), LAST_ANGLE)
        if status[i] == FLYING:
            kind[i], number[i], s[i] = own.kind, own.number, own.s
            point[i, c.POINT_X], point[i, c.POINT_Y] = px, py
            tx, ty = tangent_of(vx, vy, wx, wy)
            tangent[i, c.POINT_X], tangent[i, c.POINT_Y] = tx, ty
            back = direction_angle(-vx * tx - vy * ty, abs(vx * ty - vy * tx))
            angle[i] = min(max(back, FIRST_ANGLE), LAST_ANGLE)
