"""Convex polygons of lines, which are the beams: their flux, cuts, functionals and pieces. Compiled; loads numba.

A line of direction theta is the vector (p, s, c) with s = sin theta, c = cos theta, p = x s at height 0. An unfolded
vertex (X, Y) is the functional f = X s - Y c - p, positive if the vertex lies right of the line. A beam is a convex
polygon of such vectors. The generators have p, s and abs(c) of one sign, and cutting combines them with positive
weights only, so every component has full relative accuracy down to grazing angles. `columns` describes the tables.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ....core.compilation import jit
from ....core.rounding import EPS
from ...scene.compiled.compiling import inlined
from ...tracing.compiled.trigonometry import PI, PI_REST
from ...tracing.double_double.numbers import double_double, scaled
from . import columns as c
from .columns import CUT_X, CUT_Y, LINE_C, LINE_P, LINE_S, VERTEX_COLUMNS
from .unfolding import FUNCTIONAL_ULPS


@inlined
def signs_of(polygon, apex, values):
    """-> (positive, negative, rounding): set ``values`` to an apex's functional at the vertices, 0 within rounding.

    The first two tell whether each sign occurs. If the apex divides the beam only within rounding, ``rounding`` bounds
    the flux on the other side.
    """
    uncertain, uncertainty = False, 0.0
    positive, negative = False, False
    low, high = 0, 0
    for i in range(len(polygon)):
        p, s, c = polygon[i, LINE_P], polygon[i, LINE_S], polygon[i, LINE_C]
        value = apex.x * s - apex.y * c - p
        slack = apex.error_x * s + apex.error_y * abs(c) + FUNCTIONAL_ULPS * EPS * p
        if abs(value) <= slack:
            if value != 0.0:
                uncertain = True
            value = 0.0
        uncertainty = max(uncertainty, slack)
        values[i] = value
        positive = positive or value > 0.0
        negative = negative or value < 0.0
        if c * polygon[low, LINE_S] > s * polygon[low, LINE_C]:
            low = i
        if c * polygon[high, LINE_S] < s * polygon[high, LINE_C]:
            high = i
    rounding = 0.0
    if uncertain and not (positive and negative):
        # the part on the other side: at most `uncertainty` in p, over at most the beam's range of angles
        spread = polygon[high, LINE_S] * polygon[low, LINE_C] - polygon[high, LINE_C] * polygon[low, LINE_S]
        rounding = 0.5 * math.pi * uncertainty * abs(spread)
    return positive, negative, rounding


@inlined
def polygon_flux(polygon):
    """Return the integral of dp dtheta over a polygon of lines, positive if counterclockwise.

    The polygon is cut into triangles. The integral over a triangle is -det(a, b, c) sqrt(2 / product of 1 + cos over
    the three differences of angles).
    """
    total = 0.0
    p, s, c = polygon[0, LINE_P], polygon[0, LINE_S], polygon[0, LINE_C]
    for i in range(1, len(polygon) - 1):
        here_s, here_c = polygon[i, LINE_S], polygon[i, LINE_C]
        next_s, next_c = polygon[i + 1, LINE_S], polygon[i + 1, LINE_C]
        bp, bs, bc = polygon[i, LINE_P] - p, here_s - s, here_c - c
        cp, cs, cc = polygon[i + 1, LINE_P] - p, next_s - s, next_c - c
        det = p * (bs * cc - bc * cs) - s * (bp * cc - bc * cp) + c * (bp * cs - bs * cp)
        product = (1.0 + s * here_s + c * here_c) * (1.0 + here_s * next_s + here_c * next_c)
        total -= det * math.sqrt(2.0 / (product * (1.0 + s * next_s + c * next_c)))
    return total


@inlined
def clip(polygon, values, wanted, apex, out):
    """Write the part of a polygon with functional of the sign ``wanted`` to ``out``; return its number of vertices."""
    size = 0
    for i in range(len(polygon)):
        j = i + 1 if i + 1 < len(polygon) else 0
        here, there = wanted * values[i], wanted * values[j]
        if here >= 0.0:
            for k in range(VERTEX_COLUMNS):
                out[size, k] = polygon[i, k]
            if here == 0.0 and there < 0.0:
                out[size, CUT_X], out[size, CUT_Y] = apex.x, apex.y
            size += 1
        if (here > 0.0 and there < 0.0) or (here < 0.0 and there > 0.0):
            near, far = abs(there), abs(here)
            p = near * polygon[i, LINE_P] + far * polygon[j, LINE_P]
            s = near * polygon[i, LINE_S] + far * polygon[j, LINE_S]
            c = near * polygon[i, LINE_C] + far * polygon[j, LINE_C]
            scale = 1.0 / math.sqrt(s * s + c * c)
            out[size, LINE_P], out[size, LINE_S], out[size, LINE_C] = p * scale, s * scale, c * scale
            if here > 0.0:
                out[size, CUT_X], out[size, CUT_Y] = apex.x, apex.y
            else:
                out[size, CUT_X], out[size, CUT_Y] = polygon[i, CUT_X], polygon[i, CUT_Y]
            size += 1
    return size


@inlined
def cut_rounding(polygon, apex):
    """Return a bound on the flux on the wrong side of the line through an apex.

    The error of the line is at most ``uncertainty`` in p over the cut's range of angles.
    """
    rounding = 0.0
    for i in range(len(polygon)):
        if polygon[i, CUT_X] == apex.x and polygon[i, CUT_Y] == apex.y:
            j = i + 1 if i + 1 < len(polygon) else 0
            here_s, here_c = polygon[i, LINE_S], polygon[i, LINE_C]
            there_s, there_c = polygon[j, LINE_S], polygon[j, LINE_C]
            p, s, c = max(polygon[i, LINE_P], polygon[j, LINE_P]), max(here_s, there_s), max(abs(here_c), abs(there_c))
            uncertainty = apex.error_x * s + apex.error_y * c + FUNCTIONAL_ULPS * EPS * p
            rounding += 0.5 * math.pi * uncertainty * abs(here_s * there_c - here_c * there_s)
    return rounding


class Frame(NamedTuple):
    """Lines as functionals f = along x + up y + rest of a vertex (x, y), their values at an apex, and their drifts.

    A drift is the change of f from one period to the next, see `unfolding`.
    """

    along: Floats
    up: Floats
    rest: Floats
    values: Floats
    drift: Floats


@inlined
def set_frame(frame, polygon, unfolding):
    """Compute the functionals of a beam's lines; return a bound on their error at any vertex.

    Coordinates of vertices, sines and cosines, and p are at most 1, so the terms besides T have a sum of at most 5.
    """
    sign, sine, cosine = unfolding.sign, unfolding.sine, unfolding.cosine
    for i in range(len(polygon)):
        p, s, c = polygon[i, LINE_P], polygon[i, LINE_S], polygon[i, LINE_C]
        frame.along[i] = cosine * s - sine * c
        frame.up[i] = -sign * (sine * s + cosine * c)
        frame.rest[i] = unfolding.x.high * s - unfolding.y.high * c - p
    size = abs(unfolding.x.high) + abs(unfolding.y.high) + 5.0
    return unfolding.error_x + unfolding.error_y + FUNCTIONAL_ULPS * EPS * size


@inlined
def side_of(frame, count, x, y, uncertainty):
    """Return 1 if a vertex of the hollow lies right of all lines of a beam for certain, -1 if left, and 0 otherwise."""
    right, left = 0, 0
    for i in range(count):
        value = frame.along[i] * x + frame.up[i] * y + frame.rest[i]
        frame.values[i] = value
        right += value > uncertainty
        left += value < -uncertainty
    return 1 if right == count else (-1 if left == count else 0)


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
def set_angles(polygon, angles, cuts):
    """Compute the angles of the vertices of a polygon, also in ascending order, in ``cuts``."""
    for i in range(len(polygon)):
        angle = math.atan2(polygon[i, c.LINE_S], polygon[i, c.LINE_C])
        angles[i] = angle
        k = i
        while k > 0 and cuts[k - 1] > angle:
            cuts[k] = cuts[k - 1]
            k -= 1
        cuts[k] = angle


@inlined
def put_pieces(pieces, used, polygon, angles, cuts, offset, tag, width):
    """Write the pieces of a beam between its ``cuts``; return the new number of pieces.

    ``tag`` is the number of the beam, its sign and its number of bounces.
    """
    for k in range(len(polygon) - 1):
        if cuts[k + 1] <= cuts[k]:
            continue
        middle = 0.5 * (cuts[k] + cuts[k + 1])
        lower, upper = -1, -1
        for i in range(len(polygon)):
            j = i + 1 if i + 1 < len(polygon) else 0
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


@_compile
def pieces_of(store, width):
    """-> (rows, tags): the pieces of all beams in a store."""
    vertices, beams = store.vertices.shape[0], store.whole.shape[0]
    pieces, used = Pieces(np.empty((vertices, c.PIECE_COLUMNS)), np.empty((vertices, c.TAG_COLUMNS), np.int64)), 0
    angles, cuts = np.empty(vertices), np.empty(vertices)
    for beam in range(beams):
        first = store.whole[beam, c.FIRST]
        polygon = store.vertices[first : first + store.whole[beam, c.COUNT]]
        set_angles(polygon, angles, cuts)
        tag = beam, store.whole[beam, c.SIGN], store.whole[beam, c.BOUNCES]
        used = put_pieces(pieces, used, polygon, angles, cuts, 0.0, tag, width)
    return pieces.rows[:used], pieces.tags[:used]
