"""Convex polygons of lines, which are the beams, and the line that cuts them: compiled. Loads numba.

A line of direction theta is the vector (p, s, c) with s = sin theta, c = cos theta, p = x s at height 0. An unfolded
vertex (X, Y) is the functional f = X s - Y c - p, positive if the vertex lies right of the line. A beam is a convex
polygon of such vectors. The generators have p, s and abs(c) of one sign, and cutting combines them with positive
weights only, so every component has full relative accuracy down to grazing angles. `columns` describes the tables.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ....core.rounding import EPS
from ...tracing.compiled.options import inlined
from .columns import CUT_X, CUT_Y, LINE_C, LINE_P, LINE_S, VERTEX_COLUMNS
from .unfolding import FUNCTIONAL_ULPS


class Signs(NamedTuple):
    """The signs of an apex's functional on a beam.

    ``positive`` and ``negative`` tell whether each sign occurs. If the apex divides the beam only within rounding,
    ``rounding`` bounds the flux on the other side.
    """

    positive: bool
    negative: bool
    rounding: float


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
def clip(polygon, count, values, wanted, apex, out):
    """Write the part of a polygon with functional of the sign ``wanted`` to ``out``; return its number of vertices."""
    size = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
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
def cut_rounding(polygon, count, apex):
    """Return a bound on the flux on the wrong side of the line through an apex.

    The error of the line is at most ``doubt`` in p over the cut's range of angles.
    """
    rounding = 0.0
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
