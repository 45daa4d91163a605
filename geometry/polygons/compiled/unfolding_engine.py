"""What the compiled loops over a triangulated hollow share: lines of walls, and angles in two doubles. Loads numba."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ...tracing.compiled.trigonometry import PI, PI_REST
from ...tracing.double_double.arithmetic import add

_compile = njit(cache=True, nogil=True, error_model="numpy")


@_compile
def reduced(high, low):
    """An angle in two doubles, modulo 2 pi, in [-pi, pi] within rounding."""
    turns = np.rint(high / (2.0 * PI))
    if turns != 0.0:
        # turns is 1 or 2 at most, so its products are exact
        high, low = add((high, low), (-2.0 * turns * PI, -2.0 * turns * PI_REST))
    return high, low


@_compile
def offset_of(sign, turn, turn_low, middle):
    """The offset of theta' = sign (theta + pi - turn), modulo 2 pi, for which the angle ``middle`` leaves upwards."""
    offset = add((sign * PI, sign * PI_REST), (-sign * turn, -sign * turn_low))
    turns = np.rint((sign * middle + offset[0] - 0.5 * PI) / (2.0 * PI))
    return add(offset, (-2.0 * turns * PI, -2.0 * turns * PI_REST))[0]


@_compile
def wall_lines(x, y, turn_high):
    """The lines of a hollow's walls, one a row: unit normal and distance from the origin, from the nearer end."""
    lines = np.empty((turn_high.shape[0], 3))
    for e in range(turn_high.shape[0]):
        lines[e, 0], lines[e, 1] = -math.sin(turn_high[e]), math.cos(turn_high[e])
        k = e if abs(x[e]) + abs(y[e]) <= abs(x[e + 1]) + abs(y[e + 1]) else e + 1
        lines[e, 2] = lines[e, 0] * x[k] + lines[e, 1] * y[k]
    return lines
