"""Beams as pieces, intervals of theta with one formula for the probability: compiled. Loads numba."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.compilation import jit
from ...tracing.compiled.options import inlined, linked_allocating
from ...tracing.compiled.trigonometry import PI, PI_REST
from ...tracing.double_double.numbers import double_double, scaled
from . import columns as c

_compile = jit()


class Pieces(NamedTuple):
    """Tables of pieces; see `columns`."""

    rows: Floats
    tags: NDArray[np.int64]


@_compile
def offset_of(sign, turn, middle):
    """Return the offset of theta' = sign (theta + pi - turn), modulo 2 pi such that ``middle`` leaves upwards."""
    half_turn = double_double(PI, PI_REST)
    offset = scaled(sign, half_turn) - scaled(sign, turn)
    turns = np.rint((sign * middle + offset.high - 0.5 * PI) / (2.0 * PI))
    return (offset - scaled(2.0 * turns, half_turn)).high


@inlined
def leaving_offset(low, high, unfolding):
    """-> (offset, upwards): of theta' for lines between two angles, and whether their middle leaves upwards."""
    middle = 0.5 * (low + high)
    offset = offset_of(unfolding.sign, unfolding.turn, middle)
    return offset, 0.0 <= unfolding.sign * middle + offset <= PI


@inlined
def set_angles(polygon, count, angles, cuts):
    """Compute the angles of the vertices of a polygon, also in ascending order, in ``cuts``."""
    for i in range(count):
        angle = math.atan2(polygon[i, c.LINE_S], polygon[i, c.LINE_C])
        angles[i] = angle
        k = i
        while k > 0 and cuts[k - 1] > angle:
            cuts[k] = cuts[k - 1]
            k -= 1
        cuts[k] = angle


@inlined
def put_pieces(pieces, used, polygon, count, angles, cuts, offset, tag, width):
    """Write the pieces of a beam between its ``cuts``; return the new number of pieces.

    ``tag`` is the number of the beam, its sign and its number of bounces.
    """
    for k in range(count - 1):
        if cuts[k + 1] <= cuts[k]:
            continue
        middle = 0.5 * (cuts[k] + cuts[k + 1])
        lower, upper = -1, -1
        for i in range(count):
            j = i + 1 if i + 1 < count else 0
            if angles[i] <= middle < angles[j]:
                lower = i
            elif angles[j] <= middle < angles[i]:
                upper = i
        if lower < 0 or upper < 0:
            continue
        row, tags = pieces.rows[used], pieces.tags[used]
        row[c.PIECE_LOW], row[c.PIECE_HIGH], row[c.PIECE_OFFSET] = cuts[k], cuts[k + 1], offset
        row[c.PIECE_SINE] = (polygon[upper, c.CUT_X] - polygon[lower, c.CUT_X]) / width
        row[c.PIECE_COSINE] = (polygon[lower, c.CUT_Y] - polygon[upper, c.CUT_Y]) / width
        tags[c.TAG_LEAF], tags[c.TAG_SIGN], tags[c.TAG_BOUNCES] = tag
        used += 1
    return used


@linked_allocating
def new_pieces(size):
    """-> Pieces: tables with room for so many pieces."""
    return Pieces(np.empty((size, c.PIECE_COLUMNS)), np.empty((size, c.TAG_COLUMNS), np.int64))


@_compile
def pieces_of(store, width):
    """-> (rows, tags): the pieces of all beams in a store."""
    vertices, beams = store.vertices.shape[0], store.whole.shape[0]
    pieces, used = new_pieces(vertices), 0
    angles, cuts = np.empty(vertices), np.empty(vertices)
    for beam in range(beams):
        first, count = store.whole[beam, c.FIRST], store.whole[beam, c.COUNT]
        polygon = store.vertices[first : first + count]
        set_angles(polygon, count, angles, cuts)
        tag = beam, store.whole[beam, c.SIGN], store.whole[beam, c.BOUNCES]
        used = put_pieces(pieces, used, polygon, count, angles, cuts, 0.0, tag, width)
    return pieces.rows[:used], pieces.tags[:used]
