"""The reflection of a block of rays by flat tops and by hollows, hollow by hollow: compiled.

Rays are computed in blocks that fit into the first-level cache. `cross_arc`, `cross_wedge` and `cross_simple` are
called by their address, once for many rays, and compiled for walls that have such a hollow.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from ....core.checks import Floats
from ...curves import columns as c
from ...scene.compiled.tables import ROW
from .closed_forms import cross_arc, cross_wedge
from .pieces.formulas import TOP_CORNER, last_hollow, opening_at
from .pieces.options import compiled, inlined
from .pieces.pointers import Late, call_late
from .rays import ESCAPED, TABLES, tables_at
from .trigonometry import mirrored
from .waves import cross_simple
from .work import NATURAL, ROOM, WORK

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
