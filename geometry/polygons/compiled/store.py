"""Tables of beams that grow: compiled. Loads numba."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ...tracing.compiled.growing import taller
from ...tracing.compiled.options import inlined, linked_allocating
from ...tracing.double_double.numbers import double_double
from . import columns as c
from .unfolding import Course, unfolded


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
    isometry = unfolded(
        float(whole[beam, c.SIGN]),
        double_double(real[beam, c.TURN], real[beam, c.TURN_LOW]),
        double_double(real[beam, c.T_X], real[beam, c.T_X_LOW]),
        double_double(real[beam, c.T_Y], real[beam, c.T_Y_LOW]),
        real[beam, c.ERROR_X],
        real[beam, c.ERROR_Y],
    )
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


@linked_allocating
def new_store(vertices, beams):
    """-> Store: tables with room for so many vertices and beams."""
    return Store(
        np.empty((vertices, c.VERTEX_COLUMNS)),
        np.empty((beams, c.REAL_COLUMNS)),
        np.empty((beams, c.WHOLE_COLUMNS), np.int64),
    )


@inlined
def has_room(store, used, vertices):
    """Whether two more beams of at most ``vertices`` vertices each fit into the tables."""
    return used + 2 <= store.real.shape[0] and end_of(store, used) + 2 * vertices <= store.vertices.shape[0]


@linked_allocating
def with_room(store, used, vertices):
    """-> Store: with room for two more beams of at most ``vertices`` vertices each."""
    if has_room(store, used, vertices):
        return store
    rows, beams = 2 * (end_of(store, used) + 2 * vertices), 2 * (used + 2)
    return Store(taller(store.vertices, rows), taller(store.real, beams), taller(store.whole, beams))


@linked_allocating
def trimmed(store, used):
    """-> Store: the first ``used`` beams."""
    return Store(store.vertices[: end_of(store, used)], store.real[:used], store.whole[:used])
