"""The lines of a beam in the frame of the hollow, where no vertex needs unfolding: compiled. Loads numba."""

from __future__ import annotations

from typing import NamedTuple

from ....core.checks import Floats
from ....core.rounding import EPS
from ...tracing.compiled.options import inlined
from .columns import LINE_C, LINE_P, LINE_S
from .unfolding import FUNCTIONAL_ULPS

# Lines are computed in groups, as a register has them.
LANES = 4


class Frame(NamedTuple):
    """Lines as functionals f = along x + up y + rest of a vertex (x, y), their values at an apex, and their drifts.

    A drift is the change of f from one period to the next, see `periods`. The first line fills up the last group.
    """

    along: Floats
    up: Floats
    rest: Floats
    values: Floats
    drift: Floats


@inlined
def lanes_of(count):
    """Return the number of lines with those that fill up the last group."""
    return LANES * ((count + LANES - 1) // LANES)


@inlined
def set_frame(frame, polygon, count, unfolding):
    """Compute the functionals of a beam's lines; return a bound on their error at any vertex.

    Coordinates of vertices, sines and cosines, and p are at most 1, so the terms besides T have a sum of at most 5.
    """
    sign, sine, cosine = unfolding.sign, unfolding.sine, unfolding.cosine
    for i in range(lanes_of(count)):
        j = i if i < count else 0
        p, s, c = polygon[j, LINE_P], polygon[j, LINE_S], polygon[j, LINE_C]
        frame.along[i] = cosine * s - sine * c
        frame.up[i] = -sign * (sine * s + cosine * c)
        frame.rest[i] = unfolding.x.high * s - unfolding.y.high * c - p
    size = abs(unfolding.x.high) + abs(unfolding.y.high) + 5.0
    return unfolding.error_x + unfolding.error_y + FUNCTIONAL_ULPS * EPS * size


@inlined
def side_of(frame, count, x, y, doubt):
    """Return 1 if a vertex of the hollow lies right of all lines of a beam for certain, -1 if left, and 0 otherwise."""
    right, left, lanes = 0, 0, lanes_of(count)
    for group in range(0, lanes, LANES):
        for k in range(LANES):
            value = frame.along[group + k] * x + frame.up[group + k] * y + frame.rest[group + k]
            frame.values[group + k] = value
            right += value > doubt
            left += value < -doubt
    return 1 if right == lanes else (-1 if left == lanes else 0)
