"""Beams on their way through the triangles of a hollow, and their division at vertices: compiled. Loads numba."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.compilation import jit
from ...tracing.compiled.growing import taller
from ...tracing.compiled.options import inlined, inner, linked_allocating
from .columns import COUNT, VERTEX_COLUMNS
from .polygon import (
    GROUP,
    Frame,
    Pieces,
    clip,
    cut_rounding,
    leaving_offset,
    new_pieces,
    polygon_flux,
    put_pieces,
    set_angles,
    set_frame,
    side_of,
    signs_of,
)
from .store import (
    Rank,
    Store,
    course_of,
    has_room,
    new_store,
    put_beam,
    put_course,
    rank_of,
    take_polygon,
    trimmed,
    with_room,
)
from .unfolding import (
    MEMORY,
    Course,
    apex_of,
    crossed,
    lag_of,
    period_between,
    periods_without_split,
    repeated,
    set_drift,
)

# What becomes of a beam: it is split, has left the hollow, is left for later, or is divided next.
SPLIT, LEFT, STOPPED, GOES_ON = range(4)


class Desk(NamedTuple):
    """Work space for one beam: its polygon, functionals, their frame, and its last places.

    ``parts``, ``sizes`` and ``fluxes`` are those of its two parts, ``angles`` and ``cuts`` those of its vertices, see
    `polygon`.
    """

    polygon: Floats
    parts: Floats
    sizes: NDArray[np.int64]
    fluxes: Floats
    values: Floats
    angles: Floats
    cuts: Floats
    frame: Frame
    history: Store


@linked_allocating
def new_desk(wide):
    """-> Desk: for polygons of up to ``wide`` vertices."""
    frame = Frame(np.empty(wide), np.empty(wide), np.empty(wide), np.empty(wide), np.empty(wide))
    return Desk(
        np.empty((wide, VERTEX_COLUMNS)),
        np.empty((2, wide, VERTEX_COLUMNS)),
        np.empty(2, np.int64),
        np.empty(2),
        np.empty(wide),
        np.empty(wide),
        np.empty(wide),
        frame,
        new_store(1, MEMORY),
    )


@inlined
def passed(course, desk, count, flux, hollow, most_steps):
    """-> (Course, fate, steps, rounding): move a beam to the triangle whose apex splits it.

    Then ``desk.values`` are the apex's functionals. ``rounding`` bounds the flux that rounding may misplace. The fate
    is SPLIT, LEFT, or STOPPED at the limit of steps.
    A beam that comes to an edge for the second time, with a translated unfolding, measures the next period, and skips
    as many as it can.
    """
    polygon, frame, history = desk.polygon, desk.frame, desk.history
    mark, period, most, due, reflections = course, period_between(course, course), 0.0, 0, 0
    put_course(history, 0, course)
    rounding, uncertainty = 0.0, set_frame(frame, polygon, count, course.unfolding)
    for step in range(most_steps):
        edge = course.edge
        side = side_of(frame, count, hollow.apex_x[edge], hollow.apex_y[edge], uncertainty)
        if side == 0:
            signs = signs_of(polygon, count, apex_of(course, hollow), desk.values)
            if signs.positive and signs.negative:
                return course, SPLIT, step + 1, rounding
            rounding += signs.rounding
            if not signs.positive and not signs.negative:
                rounding += abs(flux)
            side = -1 if signs.negative else 1
        if most >= 1.0:
            most = min(most, periods_without_split(frame, count, side, uncertainty, period))
        way = 2 * edge + ((side < 0) != (course.unfolding.sign < 0.0))
        code = hollow.behind[way]
        if code >= 0:
            course = Course(code, course.bounces, course.unfolding)
            continue
        course, left = crossed(hollow.exits[way], course, hollow)
        if left:
            return course, LEFT, step + 1, rounding
        reflections += 1
        if reflections == due:
            if most >= 1.0 and course.edge == mark.edge:
                course, repeats = repeated(mark, course, period, most)
                reflections = 0 if repeats else reflections
            most, due = 0.0, 0
        if due == 0:
            lag = lag_of(course, history, reflections)
            if lag > 0:
                period = period_between(course_of(history, (reflections - lag) % MEMORY), course)
                mark, due, most = course, reflections + lag, period.most
                set_drift(frame, polygon, count, period)
        put_course(history, reflections % MEMORY, course)
        uncertainty = set_frame(frame, polygon, count, course.unfolding)
    return course, STOPPED, most_steps, rounding


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
        and most + GROUP <= tables.desk.values.shape[0]
    )


@_linked
def roomier(tables):
    """-> Tables: with room for what becomes of the next beam."""
    counts, most = tables.counts, tables.counts[WIDEST] + 1
    pieces, desk = tables.pieces, tables.desk
    size = counts[PIECES] + 2 * most
    if size > pieces.rows.shape[0]:
        pieces = Pieces(taller(pieces.rows, 2 * size), taller(pieces.tags, 2 * size))
    if most + GROUP > desk.values.shape[0]:
        desk = new_desk(2 * (most + GROUP))
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
    tables = Tables(rest, stack, new_pieces(2 * size), new_desk(4 * GROUP), counts, np.zeros(1))
    while not work(tables, hollow, store, stride, threshold, (most_splits, most_steps)):
        tables = roomier(tables)
    used, pieces = counts[PIECES], tables.pieces
    rest = trimmed(tables.rest, counts[RESTING])
    return rest, pieces.rows[:used], pieces.tags[:used], counts, tables.rounding[0]
