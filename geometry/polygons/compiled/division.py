"""Beams on their way through the triangles of a hollow, and their division at vertices: compiled. Loads numba."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ...tracing.compiled.pieces.options import compiled, inlined
from ...tracing.double_double.numbers import double_double
from . import columns as c
from . import polygon as polygons
from . import unfolding
from .polygon import Frame, Pieces
from .unfolding import MEMORY, Course, Hollow, apex_of

# What becomes of a beam: it is split, has left the hollow, is left for later, or is divided next.
SPLIT, LEFT, STOPPED, GOES_ON = range(4)


class Store(NamedTuple):
    """Beams: their polygons, one after the other, and their numbers; see `columns`."""

    vertices: Floats
    real: Floats
    whole: NDArray[np.int64]


class Rank(NamedTuple):
    """The flux of a beam, its priority, and how often in a row it was the larger part of a split beam."""

    flux: float
    priority: float
    cuts: int


@inlined
def end_of(store, used):
    """Return the number of vertices of the first ``used`` beams."""
    return store.whole[used - 1, c.FIRST] + store.whole[used - 1, c.COUNT] if used > 0 else 0


@inlined
def put_course(store, beam, course):
    """Write where a beam is."""
    real, whole, isometry = store.real, store.whole, course.unfolding
    whole[beam, c.EDGE], whole[beam, c.SIGN], whole[beam, c.BOUNCES] = course.edge, int(isometry.sign), course.bounces
    real[beam, c.TURN], real[beam, c.TURN_LOW] = isometry.turn.high, isometry.turn.low
    real[beam, c.T_X], real[beam, c.T_X_LOW], real[beam, c.ERROR_X] = isometry.x.high, isometry.x.low, isometry.error_x
    real[beam, c.T_Y], real[beam, c.T_Y_LOW], real[beam, c.ERROR_Y] = isometry.y.high, isometry.y.low, isometry.error_y


@inlined
def put_beam(store, beam, polygon, count, rank, course):
    """Write a beam behind those before it."""
    first = end_of(store, beam)
    for i in range(count):
        for k in range(c.VERTEX_COLUMNS):
            store.vertices[first + i, k] = polygon[i, k]
    store.whole[beam, c.FIRST], store.whole[beam, c.COUNT], store.whole[beam, c.CUTS] = first, count, rank.cuts
    store.real[beam, c.FLUX], store.real[beam, c.PRIORITY] = rank.flux, rank.priority
    put_course(store, beam, course)


@inlined
def course_of(store, beam):
    """-> Course: where a beam is."""
    real, whole = store.real, store.whole
    turn = double_double(real[beam, c.TURN], real[beam, c.TURN_LOW])
    x = double_double(real[beam, c.T_X], real[beam, c.T_X_LOW])
    y = double_double(real[beam, c.T_Y], real[beam, c.T_Y_LOW])
    sign, errors = float(whole[beam, c.SIGN]), (real[beam, c.ERROR_X], real[beam, c.ERROR_Y])
    isometry = unfolding.unfolded(sign, turn, x, y, *errors)
    return Course(whole[beam, c.EDGE], whole[beam, c.BOUNCES], isometry)


@inlined
def rank_of(store, beam):
    """-> Rank: the flux and the priority of a beam."""
    return Rank(store.real[beam, c.FLUX], store.real[beam, c.PRIORITY], store.whole[beam, c.CUTS])


@inlined
def take_polygon(store, beam, polygon):
    """Write the polygon of a beam to ``polygon``, which has room for it; return its number of vertices."""
    first, count = store.whole[beam, c.FIRST], store.whole[beam, c.COUNT]
    for i in range(count):
        for k in range(c.VERTEX_COLUMNS):
            polygon[i, k] = store.vertices[first + i, k]
    return count


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


@inlined
def passed(course, desk, count, flux, hollow, most_steps):
    """-> (Course, fate, steps, rounding): move a beam to the triangle whose apex splits it.

    Then ``desk.values`` are the apex's functionals. ``rounding`` bounds the flux that rounding may misplace. The fate
    is SPLIT, LEFT, or STOPPED at the limit of steps.
    A beam that comes to an edge for the second time, with a translated unfolding, measures the next period, and skips
    as many as it can.
    """
    polygon, frame, history = desk.polygon, desk.frame, desk.history
    mark, period, most, due, reflections = course, unfolding.period_between(course, course), 0.0, 0, 0
    put_course(history, 0, course)
    rounding, uncertainty = 0.0, polygons.set_frame(frame, polygon, count, course.unfolding)
    for step in range(most_steps):
        edge = course.edge
        side = polygons.side_of(frame, count, hollow.apex_x[edge], hollow.apex_y[edge], uncertainty)
        if side == 0:
            positive, negative, misplaced = polygons.signs_of(polygon, count, apex_of(course, hollow), desk.values)
            if positive and negative:
                return course, SPLIT, step + 1, rounding
            rounding += misplaced
            if not positive and not negative:
                rounding += abs(flux)
            side = -1 if negative else 1
        if most >= 1.0:
            most = min(most, unfolding.periods_without_split(frame, count, side, uncertainty, period))
        way = 2 * edge + ((side < 0) != (course.unfolding.sign < 0.0))
        code = hollow.behind[way]
        if code >= 0:
            course = Course(code, course.bounces, course.unfolding)
            continue
        course, left = unfolding.crossed(hollow.exits[way], course, hollow)
        if left:
            return course, LEFT, step + 1, rounding
        reflections += 1
        if reflections == due:
            if most >= 1.0 and course.edge == mark.edge:
                course, repeats = unfolding.repeated(mark, course, period, most)
                reflections = 0 if repeats else reflections
            most, due = 0.0, 0
        if due == 0:
            lag = unfolding.lag_of(course, history, reflections)
            if lag > 0:
                period = unfolding.period_between(course_of(history, (reflections - lag) % MEMORY), course)
                mark, due, most = course, reflections + lag, period.most
                unfolding.set_drift(frame, polygon, count, period)
        put_course(history, reflections % MEMORY, course)
        uncertainty = polygons.set_frame(frame, polygon, count, course.unfolding)
    return course, STOPPED, most_steps, rounding


# Initial number of beams in a table, and of vertices on the desk.
ROOM, WIDE = 256, 16
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
        polygons.set_angles(polygon, count, angles, cuts)
        offset, upwards = polygons.leaving_offset(cuts[0], cuts[count - 1], course.unfolding)
        if upwards:
            tag = counts[LEAVES], int(course.unfolding.sign), course.bounces
            counts[PIECES] = polygons.put_pieces(
                tables.pieces, counts[PIECES], polygon, count, angles, cuts, offset, tag, width
            )
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
        desk.sizes[k] = polygons.clip(desk.polygon, count, desk.values, 1.0 - 2.0 * k, apex, desk.parts[k])
        desk.fluxes[k] = polygons.polygon_flux(desk.parts[k], desk.sizes[k])
    tables.counts[SPLITS] += 1
    tables.rounding[0] += polygons.cut_rounding(desk.parts[0], desk.sizes[0], apex)


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


@compiled
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
            beyond, left = unfolding.crossed(apex.left if k == 0 else apex.right, course, hollow)
            fate = LEFT if left else (GOES_ON if part.priority > threshold else STOPPED)
            put(tables, desk.parts[k], desk.sizes[k], part, beyond, fate, hollow.width)
    return False


@inlined
def has_room(store, used, vertices):
    """Whether two more beams of at most ``vertices`` vertices each fit into the tables."""
    return used + 2 <= store.real.shape[0] and end_of(store, used) + 2 * vertices <= store.vertices.shape[0]


@inlined
def is_roomy(tables):
    """Whether every table has room for what becomes of the next beam."""
    counts, most = tables.counts, tables.counts[WIDEST] + 1
    return (
        has_room(tables.rest, counts[RESTING], most)
        and has_room(tables.stack, counts[WAITING], most)
        and counts[PIECES] + 2 * most <= tables.pieces.rows.shape[0]
        and most <= tables.desk.values.shape[0]
    )


def new_store(vertices: int, beams: int) -> Store:
    """Return tables with room for so many vertices and beams."""
    real, whole = np.empty((beams, c.REAL_COLUMNS)), np.empty((beams, c.WHOLE_COLUMNS), np.int64)
    return Store(np.empty((vertices, c.VERTEX_COLUMNS)), real, whole)


def new_desk(wide: int) -> Desk:
    """Return the work space for polygons of up to ``wide`` vertices."""
    polygon, parts = np.empty((wide, c.VERTEX_COLUMNS)), np.empty((2, wide, c.VERTEX_COLUMNS))
    frame = Frame(*np.empty((5, wide)))
    values, angles, cuts = np.empty((3, wide))
    return Desk(polygon, parts, np.empty(2, np.int64), np.empty(2), values, angles, cuts, frame, new_store(1, MEMORY))


def longer(array: NDArray[Any], rows: int) -> NDArray[Any]:
    """Return a copy with so many further rows, which are not set."""
    return np.concatenate([array, np.empty((rows, array.shape[1]), array.dtype)])


def with_room(store: Store, used: int, vertices: int) -> Store:
    """Return a store with room for two more beams of at most ``vertices`` vertices each."""
    rows, beams = int(store.whole[:used, c.COUNT].sum()) + 2 * vertices, used + 2
    if rows <= len(store.vertices) and beams <= len(store.real):
        return store
    return Store(longer(store.vertices, rows), longer(store.real, beams), longer(store.whole, beams))


def roomier(tables: Tables) -> Tables:
    """Return tables with room for what becomes of the next beam."""
    rest, stack, pieces, desk, counts, rounding = tables
    most = int(counts[WIDEST]) + 1
    size = int(counts[PIECES]) + 2 * most
    if size > len(pieces.rows):
        pieces = Pieces(longer(pieces.rows, size), longer(pieces.tags, size))
    if most > len(desk.values):
        desk = new_desk(2 * most)
    rest, stack = with_room(rest, counts[RESTING], most), with_room(stack, counts[WAITING], most)
    return Tables(rest, stack, pieces, desk, counts, rounding)


def divide(
    hollow: Hollow, store: Store, begin: int, stride: int, threshold: float, most_splits: int, most_steps: int
) -> tuple[Store, Floats, NDArray[np.int64], NDArray[np.int64], float]:
    """-> (Store, rows, tags, counts, rounding): divide every ``stride``-th beam of a store from ``begin`` on.

    Beams above the ``threshold`` of priority are divided, and their parts, until the limit of splits or steps is
    reached. The store returned contains the beams that are left; rows and tags are the pieces of those that have left
    the hollow. ``rounding`` bounds the flux in wrong leaves.
    """
    counts = np.zeros(COUNTS, np.int64)
    counts[[NEXT, WIDEST]] = begin, store.whole[:, c.COUNT].max(initial=0)
    size = ROOM + 2 * (len(store.whole) // stride)
    pieces = Pieces(np.empty((2 * size, c.PIECE_COLUMNS)), np.empty((2 * size, c.TAG_COLUMNS), np.int64))
    stores = new_store(4 * size, size), new_store(4 * ROOM, ROOM)
    tables = Tables(*stores, pieces, new_desk(WIDE), counts, np.zeros(1))
    while not work(tables, hollow, store, stride, threshold, (most_splits, most_steps)):
        tables = roomier(tables)
    (vertices, real, whole), pieces, used = tables.rest, tables.pieces, counts[PIECES]
    real, whole = real[: counts[RESTING]], whole[: counts[RESTING]]
    rest = Store(vertices[: whole[:, c.COUNT].sum()], real, whole)
    return rest, pieces.rows[:used], pieces.tags[:used], counts, float(tables.rounding[0])
