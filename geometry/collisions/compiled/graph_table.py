"""Bezier pieces as graphs over chords, for the contacts of satellites.

A piece is cut into parts. In the frame of its chord, with the abscissa xi along the chord and the ordinate eta to the
left, a part is a graph eta = h(xi) of small slope, on which h'' and h''' are bounded. Its formula holds a little beyond
its ends, on the neighbouring parts; further away the graph is continued by straight lines.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from ....core.checks import Floats
from ....core.rounding import EPS
from ...curves import columns as c
from ...curves.bezier import Bezier
from ...curves.columns import range_of, row_of, table_of

# graphs: the first columns are those of every curve; sigma = s - FIRST_S is the parameter of the part.
ALONG_X = c.END_CORNER + 1  # unit vector along the chord
ALONG_Y = c.END_CORNER + 2
WIDTH = c.END_CORNER + 3  # abscissa of the end
XI1 = c.END_CORNER + 4  # xi = XI1 sigma + XI2 sigma^2 + XI3 sigma^3
XI2 = c.END_CORNER + 5
XI3 = c.END_CORNER + 6
ETA1 = c.END_CORNER + 7
ETA2 = c.END_CORNER + 8
ETA3 = c.END_CORNER + 9
FIRST_S = c.END_CORNER + 10  # parameter of the piece at the start of the part
LEAST_SIGMA = c.END_CORNER + 11  # the formula holds from here
MOST_SIGMA = c.END_CORNER + 12  # to here
PIECE = c.END_CORNER + 13  # row of the piece in `beziers`
STEEPNESS = c.END_CORNER + 14  # sqrt(1 + h'^2) at most
LEAST_BEND = c.END_CORNER + 15  # h'' at least, at most 0
MOST_BEND = c.END_CORNER + 16  # h'' at most, at least 0
THIRD = c.END_CORNER + 17  # |h'''| at most
GRAPH_COLUMNS = c.END_CORNER + 18

# Largest slope of a part against its chord, and largest ratio of the speeds d xi/ds on it. Smaller limits make more
# parts, and the bounds on h'' sharper.
STEEPEST = 0.7
SPEED_RATIO = 5.0
# Fraction of a part's length in s by which its formula holds beyond its ends.
OVERLAP = 0.25
# A part below this fraction of the piece's size, next to a point where b' = 0, is straight within rounding.
STRAIGHT = 2.0**-50


def graphs_of(beziers: Floats, hollows: Floats) -> Floats:
    """Return the table of the graphs of all Bezier pieces, and set the ranges of the hollows, in place, to its rows."""
    rows: list[Floats] = []
    first = [0]
    for number, curve in enumerate(beziers):
        rows += _graphs_of_piece(curve, number)
        first.append(len(rows))
    for hollow in hollows:
        columns = list(range_of(Bezier.table))
        hollow[columns] = [first[int(k)] for k in hollow[columns]]
    return table_of(rows, GRAPH_COLUMNS)


def _graphs_of_piece(curve: Floats, number: int) -> list[Floats]:
    """Return the rows of one piece, from halving until every part is a graph."""
    size = float(np.abs(curve[[c.X1, c.Y1, c.X2, c.Y2, c.X3, c.Y3]]).sum())
    todo, rows = [(0.0, 1.0)], []
    while todo:
        low, high = todo.pop()
        row = _graph(curve, low, high, size)
        middle = 0.5 * (low + high)
        if row is None:
            todo += [(middle, high), (low, middle)]
            continue
        row[PIECE] = number
        row[c.START_CORNER] = curve[c.START_CORNER] if low == 0.0 else 0.0
        row[c.END_CORNER] = curve[c.END_CORNER] if high == 1.0 else 0.0
        rows.append(row)
    for before, after in pairwise(rows):
        before[[c.END_X, c.END_Y]] = after[[c.START_X, c.START_Y]]
    rows[-1][[c.END_X, c.END_Y]] = curve[[c.END_X, c.END_Y]]
    return rows


def _graph(curve: Floats, low: float, high: float, size: float) -> Floats | None:
    """Return the row of the part on [low, high], or None if the part must be halved."""
    a1, a2, a3 = curve[[c.X1, c.Y1]], curve[[c.X2, c.Y2]], curve[[c.X3, c.Y3]]
    start = curve[[c.START_X, c.START_Y]] + low * (a1 + low * (a2 + low * a3))
    # the coefficients of b(low + sigma) - b(low)
    c1, c2, c3 = a1 + low * (2.0 * a2 + 3.0 * low * a3), a2 + 3.0 * low * a3, a3
    span = high - low
    chord = span * (c1 + span * (c2 + span * c3))
    width = float(np.hypot(*chord))
    along = chord / width if width > 0.0 else np.array([1.0, 0.0])
    values = {c.START_X: start[0], c.START_Y: start[1], FIRST_S: low}
    values |= {ALONG_X: along[0], ALONG_Y: along[1], WIDTH: width}
    if width <= STRAIGHT * size or span <= EPS:
        return row_of(GRAPH_COLUMNS, values | {XI1: width / span or EPS * size, MOST_SIGMA: span, STEEPNESS: 1.0})
    frame = np.array([along, [-along[1], along[0]]])
    c1, c2, c3 = frame @ c1, frame @ c2, frame @ c3
    least, most = max(-OVERLAP * span, -low), min(span + OVERLAP * span, 1.0 - low)
    bounds = _bounds(c1, c2, c3, least, most)
    if bounds is None:
        return None
    values |= {XI1: c1[0], XI2: c2[0], XI3: c3[0], ETA1: c1[1], ETA2: c2[1], ETA3: c3[1]}
    return row_of(GRAPH_COLUMNS, values | {LEAST_SIGMA: least, MOST_SIGMA: most} | bounds)


def _bounds(c1: Floats, c2: Floats, c3: Floats, low: float, high: float) -> dict[int, float] | None:
    """Return the bounds on h', h'' and h''' over [low, high], or None if the part is no graph of small slope.

    Bounds are the extreme coefficients of the Bernstein form, within which a polynomial stays.
    """
    span = high - low
    v0, bend0, bend1 = c1 + low * (2.0 * c2 + 3.0 * low * c3), 2.0 * c2 + 6.0 * low * c3, 2.0 * c2 + 6.0 * high * c3
    v1 = c1 + high * (2.0 * c2 + 3.0 * high * c3)
    velocities = np.array([v0, v0 + 0.5 * span * bend0, v1])
    slowest, fastest = float(velocities[:, 0].min()), float(velocities[:, 0].max())
    if slowest <= 0.0 or fastest > SPEED_RATIO * slowest:
        return None
    slope = float(np.abs(velocities[:, 1] / velocities[:, 0]).max())
    if slope > STEEPEST:
        return None
    # xi' eta'' - eta' xi'', a quadratic: its slope is xi' eta''' - eta' xi'''
    cross = [_cross(v0, bend0), _cross(v0, bend0) + 0.5 * span * _cross(v0, 6.0 * c3), _cross(v1, bend1)]
    turning = max(map(abs, cross))
    change = max(abs(cross[1] - cross[0]), abs(cross[2] - cross[1])) * 2.0 / span
    bent = max(abs(bend0[0]), abs(bend1[0]))
    return {
        STEEPNESS: math.hypot(1.0, slope),
        LEAST_BEND: min(0.0, *cross) / slowest**3,
        MOST_BEND: max(0.0, *cross) / slowest**3,
        THIRD: (change * fastest + 3.0 * turning * bent) / slowest**5,
    }


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])
