"""Beams on their way through the triangles of a hollow, and their division at vertices: compiled. Loads numba."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ...scene.compiled.compiling import compiled, inlined
from ...tracing.compiled.trigonometry import PI
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
def put_beam(store, beam, polygon, flux, divisor, course):
    """Write a beam behind those before it."""
    first, count = end_of(store, beam), len(polygon)
    for i in range(count):
        for k in range(c.VERTEX_COLUMNS):
            store.vertices[first + i, k] = polygon[i, k]
    store.whole[beam, c.FIRST], store.whole[beam, c.COUNT] = first, count
    store.real[beam, c.FLUX], store.real[beam, c.DIVISOR] = flux, divisor
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


class Desk(NamedTuple):
    """Work space for one beam: its functionals, their frame, and its last places.

    ``parts``, ``sizes`` and ``fluxes`` are those of its two parts, ``angles`` and ``cuts`` those of its vertices, see
    `polygon`.
    """

    parts: Floats
    sizes: NDArray[np.int64]
    fluxes: Floats
    values: Floats
    angles: Floats
    cuts: Floats
    frame: Frame
    history: Store


@inlined
def passed(course, desk, polygon, flux, hollow, most_steps):
    """-> (Course, fate, steps, rounding): move a beam to the triangle whose apex splits it.

    Then ``desk.values`` are the apex's functionals. ``rounding`` bounds the flux that rounding may misplace. The fate
    is SPLIT, LEFT, or STOPPED at the limit of steps.
    A beam that comes to an edge for the second time, with a translated unfolding, measures the next period, and skips
    as many as it can.
    """
    frame, history = desk.frame, desk.history
    mark, period, most, due, reflections = course, unfolding.period_between(course, course), 0.0, 0, 0
    put_course(history, 0, course)
    rounding, uncertainty = 0.0, polygons.set_frame(frame, polygon, course.unfolding)
    for step in range(most_steps):
        edge = course.edge
        side = polygons.side_of(frame, len(polygon), hollow.apex_x[edge], hollow.apex_y[edge], uncertainty)
        if side == 0:
            positive, negative, misplaced = polygons.signs_of(polygon, apex_of(course, hollow), desk.values)
            if positive and negative:
                return course, SPLIT, step + 1, rounding
            rounding += misplaced
            if not positive and not negative:
                rounding += abs(flux)
            side = -1 if negative else 1
        if most >= 1.0:
            most = min(most, unfolding.periods_without_split(frame, len(polygon), side, uncertainty, period))
        exit_edge = hollow.exits[2 * edge + ((side < 0) != (course.unfolding.sign < 0.0))]
        course, beyond = unfolding.crossed(exit_edge, course, hollow)
        if beyond == c.OPENING:
            return course, LEFT, step + 1, rounding
        if beyond >= 0:
            continue
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
                unfolding.set_drift(frame, polygon, period)
        put_course(history, reflections % MEMORY, course)
        uncertainty = polygons.set_frame(frame, polygon, course.unfolding)
    return course, STOPPED, most_steps, rounding


# The numbers that a division counts: beams and pieces in the tables, leaves, splits, steps, and all vertices of beams
# and of leaves.
RESTING, WAITING, PIECES, LEAVES, SPLITS, STEPS, VERTICES = range(7)
COUNTS = 7
# Least room in a table; not a power of two, for which the addresses of a frame's columns would collide in the cache.
ROOM = 4000


class Tables(NamedTuple):
    """The beams that are left for later, those that wait for their division, pieces, work space, and numbers."""

    rest: Store
    stack: Store
    pieces: Pieces
    desk: Desk
    counts: NDArray[np.int64]
    rounding: Floats


@inlined
def put(tables, polygon, flux, divisor, course, fate, width):
    """Put a beam among the pieces, if it has left the hollow, or among the beams that wait or are left for later."""
    counts, angles, cuts, isometry = tables.counts, tables.desk.angles, tables.desk.cuts, course.unfolding
    if fate == LEFT:
        polygons.set_angles(polygon, angles, cuts)
        middle = 0.5 * (cuts[0] + cuts[len(polygon) - 1])
        offset = polygons.offset_of(isometry.sign, isometry.turn, middle)
        if 0.0 <= isometry.sign * middle + offset <= PI:
            tag = counts[LEAVES], int(isometry.sign), course.bounces
            own = polygon, angles, cuts, offset, tag, width
            counts[PIECES] = polygons.put_pieces(tables.pieces, counts[PIECES], *own)
            counts[LEAVES] += 1
            return
        # no ray leaves downwards: this is a sliver within rounding of a corner, which is never divided
        divisor = np.inf
    store, number = (tables.stack, WAITING) if fate == GOES_ON else (tables.rest, RESTING)
    put_beam(store, counts[number], polygon, flux, divisor, course)
    counts[number] += 1


@inlined
def cut(tables, polygon, apex):
    """Cut a beam at an apex."""
    desk, counts = tables.desk, tables.counts
    counts[SPLITS] += 1
    counts[VERTICES] -= len(polygon)
    for k in range(2):
        desk.sizes[k] = polygons.clip(polygon, desk.values, 1.0 - 2.0 * k, apex, desk.parts[k])
        desk.fluxes[k] = polygons.polygon_flux(desk.parts[k, : desk.sizes[k]])
        counts[VERTICES] += desk.sizes[k]
    tables.rounding[0] += polygons.cut_rounding(desk.parts[0, : desk.sizes[0]], apex)


@compiled
def work(tables, hollow, threshold, limits):
    """Divide beams until none waits, or until there may be no room for the next.

    Between parallel sides a beam loses one sliver in each passage. After k passages its flux is of the order k^-2, and
    each sliver has k^-3. By flux, the large beam would always come before its slivers, and the flux of those left
    would fall as n^(-4/3) in the number n of beams. Divided by the number of slivers it has lost, its flux has the
    order of the next sliver, and the flux that is left falls as n^-2.
    """
    counts, desk, stack = tables.counts, tables.desk, tables.stack
    while counts[WAITING] > 0:
        beam = counts[WAITING] - 1
        polygon, course = stack.vertices[stack.whole[beam, c.FIRST] : end_of(stack, beam + 1)], course_of(stack, beam)
        flux, divisor = stack.real[beam, c.FLUX], stack.real[beam, c.DIVISOR]
        # each part has at most one vertex more than the beam
        if counts[VERTICES] + 2 * (len(polygon) + 1) > desk.values.shape[0]:
            return
        counts[WAITING] = beam
        fate = STOPPED
        if flux / divisor > threshold and counts[SPLITS] < limits[0] and counts[STEPS] < limits[1]:
            course, fate, steps, rounding = passed(course, desk, polygon, flux, hollow, limits[1] - counts[STEPS])
            counts[STEPS] += steps
            tables.rounding[0] += rounding
        if fate != SPLIT:
            put(tables, polygon, flux, divisor, course, fate, hollow.width)
            continue
        apex = apex_of(course, hollow)
        cut(tables, polygon, apex)
        for k in range(2):
            flux = desk.fluxes[k]
            part_divisor = divisor + 1.0 if flux >= desk.fluxes[1 - k] else 1.0
            after, beyond = unfolding.crossed(apex.left if k == 0 else apex.right, course, hollow)
            fate = LEFT if beyond == c.OPENING else (GOES_ON if flux / part_divisor > threshold else STOPPED)
            put(tables, desk.parts[k, : desk.sizes[k]], flux, part_divisor, after, fate, hollow.width)


def new_store(rows: int) -> Store:
    """Return tables with room for so many vertices and beams."""
    vertices, real = np.empty((rows, c.VERTEX_COLUMNS)), np.empty((rows, c.REAL_COLUMNS))
    return Store(vertices, real, np.empty((rows, c.WHOLE_COLUMNS), np.int64))


def first_beams(store: Store, number: int) -> Store:
    """Return the first beams of a store."""
    whole = store.whole[:number]
    return Store(store.vertices[: whole[:, c.COUNT].sum()], store.real[:number], whole)


def new_tables(waiting: Store, rounding: Floats) -> Tables:
    """Return tables with the beams that wait, and with room for at least twice as many vertices more."""
    counts, rows = np.zeros(COUNTS, np.int64), 3 * len(waiting.vertices) + ROOM
    counts[[WAITING, VERTICES]] = len(waiting.whole), len(waiting.vertices)
    rest, stack = new_store(rows), new_store(rows)
    for table, given in zip(stack, waiting, strict=True):
        table[: len(given)] = given
    pieces = Pieces(np.empty((rows, c.PIECE_COLUMNS)), np.empty((rows, c.TAG_COLUMNS), np.int64))
    values, angles, cuts = np.empty((3, rows))
    parts, history = np.empty((2, rows, c.VERTEX_COLUMNS)), new_store(MEMORY)
    frame = Frame(*np.empty((5, rows)))
    desk = Desk(parts, np.empty(2, np.int64), np.empty(2), values, angles, cuts, frame, history)
    return Tables(rest, stack, pieces, desk, counts, rounding)


def divide(
    hollow: Hollow, waiting: Store, threshold: float, most_splits: int, most_steps: int, rounding: Floats
) -> Iterator[tuple[Store, Floats, NDArray[np.int64], NDArray[np.int64]]]:
    """-> (Store, rows, tags, counts), several times: divide beams, the last one first, as many as find room at a time.

    Beams above the ``threshold`` of priority are divided, and their parts, until the limit of splits or steps is
    reached. The store contains beams that are left; rows and tags are the pieces of those that have left the hollow.
    Adds a bound on the flux in wrong leaves to ``rounding``.
    """
    while len(waiting.whole):
        tables = new_tables(waiting, rounding)
        work(tables, hollow, threshold, (most_splits, most_steps))
        counts, (rows, tags) = tables.counts, tables.pieces
        most_splits, most_steps = most_splits - counts[SPLITS], most_steps - counts[STEPS]
        waiting, used = first_beams(tables.stack, counts[WAITING]), counts[PIECES]
        yield first_beams(tables.rest, counts[RESTING]), rows[:used].copy(), tags[:used].copy(), counts
