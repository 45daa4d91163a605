"""The exact law of a polygonal hollow at single angles, by marching from one itinerary to the next."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from asperity.core.checks import Floats
from asperity.geometry.polygons.compiled.columns import FIRST_WALL, OPENING
from asperity.geometry.polygons.compiled.polygon import offset_of
from asperity.geometry.polygons.compiled.unfolding import reduced, sine_and_cosine
from asperity.geometry.polygons.triangulation import triangulated
from asperity.geometry.tracing.compiled.growing import longer, taller
from asperity.geometry.tracing.double_double.numbers import double_double, extended, scaled

# Triangles that a ray may pass for every bounce that it is allowed.
STEPS_A_BOUNCE = 64

_compile = njit(cache=True, nogil=True, error_model="numpy")


@_compile
def wall_lines(x, y, turn_high):
    """Lines of a hollow's edges: unit normal and distance from the origin, computed at the nearer end."""
    lines = np.empty((turn_high.shape[0], 3))
    for e in range(turn_high.shape[0]):
        lines[e, 0], lines[e, 1] = -math.sin(turn_high[e]), math.cos(turn_high[e])
        k = e if abs(x[e]) + abs(y[e]) <= abs(x[e + 1]) + abs(y[e + 1]) else e + 1
        lines[e, 2] = lines[e, 0] * x[k] + lines[e, 1] * y[k]
    return lines


@_compile
def march(x, y, triangles, beyond, turn_high, turn_low, entrance, theta, max_intervals, max_bounces):
    """The exact row at an angle; of each interval the end, the offset, and sign and bounces."""
    walls = wall_lines(x, y, turn_high)
    ends, offsets, tags, used = np.empty(64), np.empty(64), np.empty((64, 2), np.int64), 0
    sine, cosine = math.sin(theta), math.cos(theta)
    low, stop = 0.0, x[x.shape[0] - 1] * sine
    while low < stop:
        high = stop
        edge, sign, bounces, steps = entrance, 1, 0, 0
        m_x, m_y, shift, turn = sine, -cosine, extended(0.0), extended(0.0)
        out = used + 1 < max_intervals
        while out:
            triangle, side = edge // 3, edge % 3
            apex = triangles[triangle, (side + 2) % 3]
            value = x[apex] * m_x + y[apex] * m_y + shift.low + shift.high
            if value > low:
                high = min(high, value)
                edge = 3 * triangle + ((side + 1) % 3 if sign > 0 else (side + 2) % 3)
            else:
                edge = 3 * triangle + ((side + 2) % 3 if sign > 0 else (side + 1) % 3)
            code = beyond[edge]
            steps += 1
            if code >= 0:
                edge = code
            elif code == OPENING:
                break
            else:
                wall = FIRST_WALL - code
                across = 2.0 * (m_x * walls[wall, 0] + m_y * walls[wall, 1])
                shift = shift + across * walls[wall, 2]
                turn = reduced(turn + scaled(2.0 * sign, double_double(turn_high[wall], turn_low[wall])))
                sign = -sign
                bounces += 1
                # m from the sum of all turns, so that its error does not grow
                turned, along = sine_and_cosine(turn)
                m_x = sine * along - cosine * turned
                m_y = -sign * (cosine * along + sine * turned)
            if bounces > max_bounces or steps > STEPS_A_BOUNCE * max_bounces:
                out = False
        if used + 1 >= max_intervals:
            high = stop
        if used == ends.shape[0]:
            ends, offsets, tags = longer(ends, 2 * used), longer(offsets, 2 * used), taller(tags, 2 * used)
        ends[used] = high / stop
        offsets[used] = offset_of(float(sign), turn, theta) if out else 0.0
        tags[used, 0], tags[used, 1] = sign if out else 0, bounces
        used += 1
        low = high
    return ends[:used], offsets[:used], tags[:used]


class Row(NamedTuple):
    """Where a polygonal hollow sends the rays of one angle, by intervals of the opening.

    Attributes
    ----------
    edges : array of shape (n + 1,)
        Ends of the intervals as fractions of the opening, from 0 to 1, ascending.
    sign : array of shape (n,)
        +1 or -1; 0 where the bounce limit was met, or the limit of intervals.
    offset, outgoing : arrays of shape (n,)
        theta' = sign theta + offset is the outgoing angle, radians. Where the sign is 0 both are 0 and mean nothing.
    bounces : array of int, shape (n,)
        Number of reflections.
    unresolved : float
        Share of the opening where the sign is 0.
    """

    edges: Floats
    sign: NDArray[np.int64]
    offset: Floats
    outgoing: Floats
    bounces: NDArray[np.int64]
    unresolved: float


def exact_rows(
    hollow_vertices: ArrayLike, theta: ArrayLike, max_intervals: int = 1_000_000, max_bounces: int = 1_000_000
) -> list[Row]:
    """Where a polygonal hollow sends the rays of some angles.

    The ray just right of a position is followed through a triangulation of the hollow. It keeps the nearest vertex that
    it passes on the left; there its itinerary changes, and the next ray begins. The rest of the opening is unresolved
    after so many intervals, and an interval with more bounces.
    """
    cut = triangulated(hollow_vertices)
    x, y = np.ascontiguousarray(cut.vertices.T)
    rows = []
    for angle in np.ravel(theta).tolist():
        tables = x, y, cut.corners, cut.beyond, cut.turn_high, cut.turn_low, cut.entrance
        ends, offset, tags = march(*tables, angle, max_intervals, max_bounces)
        edges, sign = np.append(0.0, ends), tags[:, 0]
        outgoing = np.where(sign == 0, 0.0, sign * angle + offset)
        rows.append(Row(edges, sign, offset, outgoing, tags[:, 1], float(np.diff(edges)[sign == 0].sum())))
    return rows


def exact_row(hollow_vertices: ArrayLike, theta: float, **limits: int) -> Row:
    """The row of one angle.

    Examples
    --------
    A square notch at half a right angle: the floor and both sides in one order or another, or a side twice.

    >>> row = exact_row([(0, 0), (0, -1.25), (1, -1.25), (1, 0)], np.pi / 4)
    >>> row.edges.round(12).tolist(), row.sign.tolist(), row.bounces.tolist()
    ([0.0, 0.25, 0.5, 1.0], [1, 1, -1], [4, 4, 3])
    """
    return exact_rows(hollow_vertices, theta, **limits)[0]
