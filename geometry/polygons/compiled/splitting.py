"""The compiled functions that split beams at the vertices of a triangulated hollow. Loads numba."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.compilation import jit
from ...tracing.compiled.growing import taller
from ...tracing.compiled.options import inlined, inner
from .columns import COUNT
from .frames import LANES
from .lines import clip, cut_rounding, polygon_flux
from .passing import GOES_ON, LEFT, SPLIT, STOPPED, Desk, new_desk, passed
from .pieces import Pieces, leaving_offset, new_pieces, put_pieces, set_angles
from .store import (
    Rank,
    Store,
    course_of,
    has_room,
    new_store,
    put_beam,
    rank_of,
    take_polygon,
    trimmed,
    with_room,
)
from .unfolding import apex_of, crossed

_compile = jit()
_linked = jit(linked=True)
# Initial number of beams in a table.
ROOM = 256
# The numbers that a division counts: beams and pieces in the tables, leaves, splits, steps, the next beam of the store,
# and the largest number of vertices so far.
RESTING, WAITING, PIECES, LEAVES, SPLITS, STEPS, NEXT, WIDEST = range(8)
COUNTS = 8
# Priority of a beam that leaves only within rounding, which is never divided.
NEVER = -1.0


@inlined
def part_ranked(rank, flux, other):
    """-> Rank: of a part of a beam, from its flux and that of the other part.

    Between parallel sides a beam loses one sliver in each passage. After k passages its flux is of the order k^-2, and
    each sliver has k^-3. By flux, the large beam would always come before its slivers, and the flux of those left
    would fall as n^(-4/3) in the number n of beams. Divided by the number of slivers it has lost, its flux has the
    order of the next sliver, and the flux that is left falls as n^-2.
    """
    cuts = rank.cuts + 1 if flux >= other else 0
    return Rank(flux, flux / (1.0 + cuts), cuts)


class Tables(NamedTuple):
    """The beams that are left for later, those that wait for their division, pieces, work space, and numbers."""

    rest: Store
    stack: Store
    pieces: Pieces
    desk: Desk
    counts: NDArray[np.int64]
    rounding: Floats


@inlined
def put(tables, polygon, count, rank, course, fate, width):
    """Put a beam among the pieces, if it has left the hollow, or among the beams that wait or are left for later."""
    counts, angles, cuts = tables.counts, tables.desk.angles, tables.desk.cuts
    priority = rank.priority
    if fate == LEFT:
        set_angles(polygon, count, angles, cuts)
        offset, upwards = leaving_offset(cuts[0], cuts[count - 1], course.unfolding)
        if upwards:
            tag = counts[LEAVES], int(course.unfolding.sign), course.bounces
            counts[PIECES] = put_pieces(tables.pieces, counts[PIECES], polygon, count, angles, cuts, offset, tag, width)
            counts[LEAVES] += 1
            return
        # no ray leaves downwards: this is a sliver within rounding of a corner
        priority = NEVER
    store, number = (tables.stack, WAITING) if fate == GOES_ON else (tables.rest, RESTING)
    put_beam(store, counts[number], polygon, count, Rank(rank.flux, priority, rank.cuts), course)
    counts[number] += 1


@inlined
def cut(tables, count, apex):
    """Cut the beam on the desk at an apex."""
    desk = tables.desk
    for k in range(2):
        desk.sizes[k] = clip(desk.polygon, count, desk.values, 1.0 - 2.0 * k, apex, desk.parts[k])
        desk.fluxes[k] = polygon_flux(desk.parts[k], desk.sizes[k])
    tables.counts[SPLITS] += 1
    tables.rounding[0] += cut_rounding(desk.parts[0], desk.sizes[0], apex)


@inlined
def next_beam(tables, store, stride):
    """-> (count, Rank, Course): take the next beam to the desk; the count is 0 if there is none."""
    counts = tables.counts
    if counts[WAITING] > 0:
        counts[WAITING] -= 1
        beam = counts[WAITING]
        count = take_polygon(tables.stack, beam, tables.desk.polygon)
        return count, rank_of(tables.stack, beam), course_of(tables.stack, beam)
    beam = min(counts[NEXT], store.whole.shape[0] - 1)
    count = 0
    if counts[NEXT] <= beam:
        counts[NEXT] += stride
        count = take_polygon(store, beam, tables.desk.polygon)
    return count, rank_of(store, beam), course_of(store, beam)


@inner
def work(tables, hollow, store, stride, threshold, limits):
    """Divide beams until none is left, or until there may be no room for the next; return whether none is left."""
    counts, desk = tables.counts, tables.desk
    while is_roomy(tables):
        count, rank, course = next_beam(tables, store, stride)
        if count == 0:
            return True
        fate = STOPPED
        if rank.priority > threshold and counts[SPLITS] < limits[0] and counts[STEPS] < limits[1]:
            course, fate, steps, rounding = passed(course, desk, count, rank.flux, hollow, limits[1] - counts[STEPS])
            counts[STEPS] += steps
            tables.rounding[0] += rounding
        counts[WIDEST] = max(counts[WIDEST], count + 1)
        if fate != SPLIT:
            put(tables, desk.polygon, count, rank, course, fate, hollow.width)
            continue
        apex = apex_of(course, hollow)
        cut(tables, count, apex)
        for k in range(2):
            part = part_ranked(rank, desk.fluxes[k], desk.fluxes[1 - k])
            beyond, left = crossed(apex.left if k == 0 else apex.right, course, hollow)
            fate = LEFT if left else (GOES_ON if part.priority > threshold else STOPPED)
            put(tables, desk.parts[k], desk.sizes[k], part, beyond, fate, hollow.width)
    return False


@inlined
def is_roomy(tables):
    """Whether every table has room for what becomes of the next beam."""
    counts, most = tables.counts, tables.counts[WIDEST] + 1
    return (
        has_room(tables.rest, counts[RESTING], most)
        and has_room(tables.stack, counts[WAITING], most)
        and counts[PIECES] + 2 * most <= tables.pieces.rows.shape[0]
        and most + LANES <= tables.desk.values.shape[0]
    )


@_linked
def roomier(tables):
    """-> Tables: with room for what becomes of the next beam."""
    counts, most = tables.counts, tables.counts[WIDEST] + 1
    pieces, desk = tables.pieces, tables.desk
    size = counts[PIECES] + 2 * most
    if size > pieces.rows.shape[0]:
        pieces = Pieces(taller(pieces.rows, 2 * size), taller(pieces.tags, 2 * size))
    if most + LANES > desk.values.shape[0]:
        desk = new_desk(2 * (most + LANES))
    rest, stack = with_room(tables.rest, counts[RESTING], most), with_room(tables.stack, counts[WAITING], most)
    return Tables(rest, stack, pieces, desk, counts, tables.rounding)


@_compile
def divide(hollow, store, begin, stride, threshold, most_splits, most_steps):
    """-> (Store, rows, tags, counts, rounding): divide every ``stride``-th beam of a store from ``begin`` on.

    Beams above the ``threshold`` of priority are divided, and their parts, until the limit of splits or steps is
    reached. The store returned contains the beams that are left; rows and tags are the pieces of those that have left
    the hollow. ``rounding`` bounds the flux in wrong leaves.
    """
    counts = np.zeros(COUNTS, np.int64)
    counts[NEXT] = begin
    for beam in range(store.whole.shape[0]):
        counts[WIDEST] = max(counts[WIDEST], store.whole[beam, COUNT])
    size = ROOM + 2 * (store.whole.shape[0] // stride)
    rest, stack = new_store(4 * size, size), new_store(4 * ROOM, ROOM)
    tables = Tables(rest, stack, new_pieces(2 * size), new_desk(4 * LANES), counts, np.zeros(1))
    while not work(tables, hollow, store, stride, threshold, (most_splits, most_steps)):
        tables = roomier(tables)
    used, pieces = counts[PIECES], tables.pieces
    rest = trimmed(tables.rest, counts[RESTING])
    return rest, pieces.rows[:used], pieces.tags[:used], counts, tables.rounding[0]
