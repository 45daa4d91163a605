"""The way of a beam through the triangles up to the vertex that splits it: compiled. Loads numba."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ...tracing.compiled.options import inlined, linked_allocating
from .columns import VERTEX_COLUMNS
from .frames import Frame, set_frame, side_of
from .lines import signs_of
from .periods import MEMORY, lag_of, period_between, periods_without_split, repeated, set_drift
from .store import Store, course_of, new_store, put_course
from .unfolding import Course, apex_of, crossed

# What becomes of a beam: it is split, has left the hollow, is left for later, or is divided next.
SPLIT, LEFT, STOPPED, GOES_ON = range(4)


class Desk(NamedTuple):
    """Work space for one beam: its polygon, functionals, their frame, and its last places.

    ``parts``, ``sizes`` and ``fluxes`` are those of its two parts, ``angles`` and ``cuts`` those of its vertices, see
    `pieces`.
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

    Then ``desk.values`` are the apex's functionals. ``rounding`` bounds the flux that is doubtful by rounding. The fate
    is SPLIT, LEFT, or STOPPED at the limit of steps.
    A beam that comes to an edge for the second time, with a translated unfolding, measures the next period, and skips
    as many as it can.
    """
    polygon, frame, history = desk.polygon, desk.frame, desk.history
    mark, period, most, due, reflections = course, period_between(course, course), 0.0, 0, 0
    put_course(history, 0, course)
    rounding, doubt = 0.0, set_frame(frame, polygon, count, course.unfolding)
    for step in range(most_steps):
        edge = course.edge
        side = side_of(frame, count, hollow.apex_x[edge], hollow.apex_y[edge], doubt)
        if side == 0:
            signs = signs_of(polygon, count, apex_of(course, hollow), desk.values)
            if signs.positive and signs.negative:
                return course, SPLIT, step + 1, rounding
            rounding += signs.rounding
            if not signs.positive and not signs.negative:
                rounding += abs(flux)
            side = -1 if signs.negative else 1
        if most >= 1.0:
            most = min(most, periods_without_split(frame, count, side, doubt, period))
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
        doubt = set_frame(frame, polygon, count, course.unfolding)
    return course, STOPPED, most_steps, rounding
