"""Beams that pass the same triangles again and again, between parallel sides: all periods at once. Loads numba.

If a beam returns to an edge with an unfolding that differs by a translation T, its next period passes the same edges as
the last as long as no vertex V + m T, m = 1, 2, ..., enters the beam. The functional of V + m T is linear in m, so the
number of periods without a split follows from one period. Sides that are parallel within rounding turn the unfolding
by a tiny angle d in each period. Then the image of V in period m differs from V + m T by at most m d |V| + m^2 d |T|/2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ....core.rounding import EPS
from ...tracing.compiled.options import inlined
from .columns import EDGE, LINE_C, LINE_S, TURN
from .unfolding import STEP_ULPS, Course, unfolded

# Angle up to which a period counts as a translation, and limit on the angle of all skipped periods together.
NEARLY_PARALLEL, MOST_TURN = 1e-11, 1e-9
# Number of the last reflections among which the beginning of a period is searched, even.
MEMORY = 16
# A hollow has coordinates between -1 and 1, so no vertex is further from the origin.
FARTHEST = math.sqrt(2.0)


class Period(NamedTuple):
    """The translation of one period, its angle and bounds: of the error of both, of the drift, and of periods."""

    x: float
    y: float
    turn: float
    doubt: float
    error: float
    most: float


@inlined
def change_between(first, last):
    """Return the difference of two nearby double-doubles as a double."""
    return (last.high - first.high) + (last.low - first.low)


@inlined
def period_between(mark, course):
    """-> Period: the change of the unfolding between two places of a beam at the same edge."""
    first, last = mark.unfolding, course.unfolding
    x, y = change_between(first.x, last.x), change_between(first.y, last.y)
    turn = change_between(first.turn, last.turn)
    angle, size = abs(turn) + EPS, abs(x) + abs(y)
    doubt = 2.0 * (last.error_x - first.error_x + last.error_y - first.error_y) + (angle + STEP_ULPS * EPS) * size
    most = np.floor(MOST_TURN / angle)
    return Period(x, y, turn, doubt, doubt + angle * FARTHEST + 0.5 * MOST_TURN * size, most)


@inlined
def lag_of(course, history, reflections):
    """Return how many reflections ago a beam was at the same edge with a translated unfolding, 0 if never."""
    for lag in range(2, min(reflections, MEMORY) + 1, 2):
        slot = (reflections - lag) % MEMORY
        if (
            history.whole[slot, EDGE] == course.edge
            and abs(history.real[slot, TURN] - course.unfolding.turn.high) <= NEARLY_PARALLEL
        ):
            return lag
    return 0


@inlined
def set_drift(frame, polygon, count, period):
    """Compute the change of each line's functional from one period to the next."""
    for i in range(count):
        frame.drift[i] = period.x * polygon[i, LINE_S] - period.y * polygon[i, LINE_C]


@inlined
def periods_without_split(frame, count, side, doubt, period):
    """Return for how many further periods a vertex stays on its side of a beam for certain, from `side_of`."""
    most = period.most
    for i in range(count):
        value = side * frame.values[i] - 2.0 * doubt
        drift = side * frame.drift[i] - period.error
        if value + drift <= 0.0:
            return 0.0
        if drift < 0.0:
            most = min(most, np.floor(value / -drift))
    return most


@inlined
def repeated(mark, course, expected, periods):
    """-> (course, done): the course after further periods like that from ``mark`` to ``course``.

    Unchanged and False if this period is not ``expected``.
    """
    period, last = period_between(mark, course), course.unfolding
    doubt = expected.doubt
    if abs(period.x - expected.x) + abs(period.y - expected.y) > doubt or abs(period.turn) > abs(expected.turn) + EPS:
        return course, False
    # the translation turns by period.turn in each period, on average by half the angle between the first and the last
    half = 0.5 * (periods + 1.0) * period.turn
    dx, dy = periods * (period.x - half * period.y), periods * (period.y + half * period.x)
    error_x = last.error_x + periods * (last.error_x - mark.unfolding.error_x) + STEP_ULPS * EPS * abs(dx)
    error_y = last.error_y + periods * (last.error_y - mark.unfolding.error_y) + STEP_ULPS * EPS * abs(dy)
    bounces = course.bounces + int(periods) * (course.bounces - mark.bounces)
    turn = last.turn + periods * period.turn
    unfolding = unfolded(last.sign, turn, last.x + dx, last.y + dy, error_x, error_y)
    return Course(course.edge, bounces, unfolding), True
