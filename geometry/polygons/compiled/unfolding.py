"""The isometry that unfolds a hollow along a beam, its vertices, and periods of beams: compiled. Loads numba.

If a beam returns to an edge with an unfolding that differs by a translation T, its next period passes the same edges as
the last as long as no vertex V + m T, m = 1, 2, ..., enters the beam. The functional of V + m T is linear in m, so the
number of periods without a split follows from one period. Sides that are parallel within rounding turn the unfolding
by a tiny angle d in each period. Then the image of V in period m differs from V + m T by at most m d |V| + m^2 d |T|/2.
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
from ...tracing.double_double.numbers import DoubleDouble, double_double, scaled
from .columns import EDGE, FIRST_WALL, LINE_C, LINE_S, OPENING, TURN

_compile = jit()
# Rounding error of f, in eps times the sum of the absolute terms: five products of numbers with one to three errors.
FUNCTIONAL_ULPS = 8.0
# Rounding error of R n, by which a reflection changes T: n has two errors, R, the product and the sum one each. The
# length of n, twice the distance of a wall, has eight units of roundoff of the coordinates of its end.
STEP_ULPS = 4.0


class Hollow(NamedTuple):
    """A triangulated hollow, as beams see it.

    ``apex_x``, ``apex_y`` are the third vertex of the triangle of each edge. A beam that enters through ``edge`` leaves
    the triangle through ``exits[2 edge]`` if the apex lies on its right, seen in the hollow, else through
    ``exits[2 edge + 1]``; ``beyond`` is what lies behind each edge, see `Triangulation`. The normal of each wall has
    twice the length of the distance of its line from the origin, with an error of ``slack``.
    """

    apex_x: Floats
    apex_y: Floats
    exits: NDArray[np.int64]
    beyond: NDArray[np.int64]
    turn_high: Floats
    turn_low: Floats
    normal_x: Floats
    normal_y: Floats
    slack: Floats
    width: float


class Unfolding(NamedTuple):
    """The isometry V -> R V + T that unfolds the hollow, where R reflects first if ``sign`` is -1.

    ``turn`` is the angle of R, with ``sine`` and ``cosine``; T is (x, y). The errors bound the rounding of T.
    """

    sign: float
    turn: DoubleDouble
    sine: float
    cosine: float
    x: DoubleDouble
    y: DoubleDouble
    error_x: float
    error_y: float


class Course(NamedTuple):
    """Where a beam is: the edge through which it enters a triangle, the unfolding there, and its reflections so far."""

    edge: int
    bounces: int
    unfolding: Unfolding


class Apex(NamedTuple):
    """The third vertex of a beam's triangle, unfolded, bounds on its rounding errors, and the two edges at the vertex.

    ``left`` is the edge on the left of the vertex as seen by the beam, ``right`` the edge on its right.
    """

    x: float
    y: float
    error_x: float
    error_y: float
    left: int
    right: int


@_compile
def reduced(angle):
    """Return an angle, a double-double, modulo 2 pi in [-pi, pi] within rounding."""
    turns = np.rint(angle.high / (2.0 * PI))
    # turns is at most 2, so its products are exact
    return angle - scaled(2.0 * turns, double_double(PI, PI_REST)) if turns != 0.0 else angle


@inlined
def sine_and_cosine(angle):
    """Return the sine and the cosine, doubles, of an angle, a double-double."""
    sine, cosine = math.sin(angle.high), math.cos(angle.high)
    return sine + angle.low * cosine, cosine - angle.low * sine


@inlined
def unfolded(sign, turn, x, y, error_x, error_y):
    """-> Unfolding: with the sine and the cosine of its angle."""
    sine, cosine = sine_and_cosine(turn)
    return Unfolding(sign, turn, sine, cosine, x, y, error_x, error_y)


@inlined
def reflected(unfolding, wall, hollow):
    """-> Unfolding: the isometry beyond a wall that the beam hits."""
    sign = unfolding.sign
    # twice the distance of the wall along the image of its unit normal, whose angle is turn + sign (direction + pi / 2)
    nx, ny = hollow.normal_x[wall], hollow.normal_y[wall]
    xx, xy = unfolding.cosine * nx, -sign * unfolding.sine * ny
    yx, yy = unfolding.sine * nx, sign * unfolding.cosine * ny
    direction = double_double(hollow.turn_high[wall], hollow.turn_low[wall])
    turn = reduced(unfolding.turn + scaled(2.0 * sign, direction))
    error_x = unfolding.error_x + hollow.slack[wall] + STEP_ULPS * EPS * (abs(xx) + abs(xy))
    error_y = unfolding.error_y + hollow.slack[wall] + STEP_ULPS * EPS * (abs(yx) + abs(yy))
    return unfolded(-sign, turn, unfolding.x + (xx + xy), unfolding.y + (yx + yy), error_x, error_y)


@inlined
def crossed(edge, course, hollow):
    """-> (course, code): the course beyond an edge of the triangle, and what lies there, as in `Hollow.beyond`."""
    code = hollow.beyond[edge]
    if code >= 0:
        return Course(code, course.bounces, course.unfolding), code
    if code == OPENING:
        return Course(edge, course.bounces, course.unfolding), code
    return Course(edge, course.bounces + 1, reflected(course.unfolding, FIRST_WALL - code, hollow)), code


@inlined
def apex_of(course, hollow):
    """-> Apex: the apex of the triangle that a beam enters."""
    edge, isometry = course.edge, course.unfolding
    x, y = hollow.apex_x[edge], hollow.apex_y[edge]
    xx, xy = isometry.cosine * x, -isometry.sign * isometry.sine * y
    yx, yy = isometry.sine * x, isometry.sign * isometry.cosine * y
    left, right = hollow.exits[2 * edge], hollow.exits[2 * edge + 1]
    if isometry.sign < 0.0:
        left, right = right, left
    error_x = FUNCTIONAL_ULPS * EPS * (abs(xx) + abs(xy) + abs(isometry.x.high)) + isometry.error_x
    error_y = FUNCTIONAL_ULPS * EPS * (abs(yx) + abs(yy) + abs(isometry.y.high)) + isometry.error_y
    return Apex(xx + xy + isometry.x.high, yx + yy + isometry.y.high, error_x, error_y, left, right)


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
    uncertainty: float
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
    uncertainty = 2.0 * (last.error_x - first.error_x + last.error_y - first.error_y) + (angle + STEP_ULPS * EPS) * size
    most = np.floor(MOST_TURN / angle)
    return Period(x, y, turn, uncertainty, uncertainty + angle * FARTHEST + 0.5 * MOST_TURN * size, most)


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
def set_drift(frame, polygon, period):
    """Compute the change of each line's functional from one period to the next."""
    for i in range(len(polygon)):
        frame.drift[i] = period.x * polygon[i, LINE_S] - period.y * polygon[i, LINE_C]


@inlined
def periods_without_split(frame, count, side, uncertainty, period):
    """Return for how many further periods a vertex stays on its side of a beam for certain, from `side_of`."""
    most = period.most
    for i in range(count):
        value = side * frame.values[i] - 2.0 * uncertainty
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
    uncertainty = expected.uncertainty
    if (
        abs(period.x - expected.x) + abs(period.y - expected.y) > uncertainty
        or abs(period.turn) > abs(expected.turn) + EPS
    ):
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
