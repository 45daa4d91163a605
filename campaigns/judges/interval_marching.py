"""The exact law of a polygonal hollow at single angles, by marching from one itinerary to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from asperity.core.checks import Floats, angles, frozen, number_between, whole_number
from asperity.geometry.polygons.compiled.columns import FIRST_WALL, OPENING
from asperity.geometry.polygons.compiled.polygon import offset_of
from asperity.geometry.polygons.compiled.unfolding import reduced, sine_and_cosine
from asperity.geometry.polygons.triangulation import triangulated
from asperity.geometry.tracing.double_double.numbers import double_double, extended, scaled
from asperity.geometry.tracing.threads import interruptibly

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
def longer(array):
    """A copy with twice as many rows."""
    return np.concatenate((array, np.empty_like(array)))


@_compile
def march(x, y, triangles, beyond, turn_high, turn_low, entrance, theta, max_intervals, max_bounces):
    """Exact rows at many angles; returns first row of each angle, then per interval: end, offset, and sign, bounces."""
    width = x[x.shape[0] - 1]
    walls = wall_lines(x, y, turn_high)
    first = np.zeros(theta.shape[0] + 1, np.int64)
    room = 64 + 8 * theta.shape[0]
    ends, offsets = np.empty(room), np.empty(room)
    tags = np.empty((room, 2), np.int64)
    used = 0
    for row in range(theta.shape[0]):
        sine, cosine = math.sin(theta[row]), math.cos(theta[row])
        stop = width * sine
        low = 0.0
        count = 0
        while low < stop:
            high = stop
            edge, sign, bounces, steps = entrance, 1, 0, 0
            m_x, m_y, shift, turn = sine, -cosine, extended(0.0), extended(0.0)
            out = count + 1 < max_intervals
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
            if count + 1 >= max_intervals:
                high = stop
            if used == room:
                room *= 2
                ends, offsets, tags = longer(ends), longer(offsets), longer(tags)
            offset = offset_of(float(sign), turn, theta[row]) if out else 0.0
            ends[used] = high / stop
            offsets[used] = offset
            tags[used, 0], tags[used, 1] = sign if out else 0, bounces
            used += 1
            count += 1
            low = high
        first[row + 1] = used
    return first, ends[:used], offsets[:used], tags[:used]


MAX_INTERVALS = 1_000_000
MAX_BOUNCES = 1_000_000


@dataclass(frozen=True, eq=False)
class Row:
    """Where a polygonal hollow sends the rays of one angle, by intervals of the opening.

    Parameters
    ----------
    theta : float
        The incoming angle, radians.
    edges : array of shape (n + 1,)
        Ends of the intervals as fractions of the opening, from 0 to 1, ascending.
    sign : array of int8, shape (n,)
        +1 or -1; 0 where the bounce limit was met, or the limit of intervals.
    offset, outgoing : arrays of shape (n,)
        theta' = sign theta + offset is the outgoing angle, radians. Where the sign is 0 both are 0 and mean nothing.
    bounces : array of int, shape (n,)
        Number of reflections.
    unresolved : float
        Share of the opening where the sign is 0.
    """

    theta: float
    edges: Floats
    sign: NDArray[np.int8]
    offset: Floats
    outgoing: Floats
    bounces: NDArray[np.int64]
    unresolved: float


@dataclass(frozen=True, eq=False)
class Rows:
    """The rows of many angles, one after the other: those of angle k are ``first[k]`` to ``first[k + 1]``.

    Parameters
    ----------
    theta : array of shape (m,)
        Incoming angles, radians.
    first : array of int, shape (m + 1,)
        Where the intervals of each angle begin in the other arrays.
    low, high : arrays
        Ends of the intervals as fractions of the opening.
    sign, offset, bounces : arrays
        As in `Row`.
    """

    theta: Floats
    first: NDArray[np.int64]
    low: Floats
    high: Floats
    sign: NDArray[np.int8]
    offset: Floats
    bounces: NDArray[np.int64]

    def row(self, k: int) -> Row:
        """The row of angle number k."""
        part = slice(int(self.first[k]), int(self.first[k + 1]))
        sign, offset, theta = self.sign[part], self.offset[part], float(self.theta[k])
        low, high = self.low[part], self.high[part]
        lost = sign == 0
        return Row(
            theta=theta,
            edges=frozen(np.append(low, high[-1])),
            sign=sign,
            offset=offset,
            outgoing=frozen(np.where(lost, 0.0, sign * theta + offset)),
            bounces=self.bounces[part],
            unresolved=float((high - low)[lost].sum()),
        )


def exact_row(
    hollow_vertices: ArrayLike, theta: float, *, max_intervals: int = MAX_INTERVALS, max_bounces: int = MAX_BOUNCES
) -> Row:
    """Where a polygonal hollow sends the rays of one angle.

    The ray just right of a position is followed through a triangulation of the hollow. It keeps the nearest vertex that
    it passes on the left; there its itinerary changes, and the next ray begins.

    Parameters
    ----------
    hollow_vertices : array_like of shape (n, 2)
        The chain from (left, 0) to (right, 0), with the hollow above it.
    theta : float
        Incoming angle in (0, pi), radians.
    max_intervals : int
        The rest of the opening is unresolved when there are so many.
    max_bounces : int
        An interval with more reflections is unresolved.

    Returns
    -------
    Row

    Raises
    ------
    InputError, WallError
        If the chain is no hollow, or the angle not in (0, pi); see `triangulated`.

    Examples
    --------
    A square notch at half a right angle: the floor and both sides in one order or another, or a side twice.

    >>> row = exact_row([(0, 0), (0, -1.25), (1, -1.25), (1, 0)], np.pi / 4)
    >>> row.edges.round(12).tolist(), row.sign.tolist(), row.bounces.tolist()
    ([0.0, 0.25, 0.5, 1.0], [1, 1, -1], [4, 4, 3])
    """
    number_between("theta", theta, 0.0, np.pi)
    return exact_rows(hollow_vertices, [theta], max_intervals=max_intervals, max_bounces=max_bounces).row(0)


def exact_rows(
    hollow_vertices: ArrayLike,
    theta: ArrayLike,
    *,
    max_intervals: int = MAX_INTERVALS,
    max_bounces: int = MAX_BOUNCES,
) -> Rows:
    """The rows of many angles at once; see `exact_row`.

    Examples
    --------
    >>> rows = exact_rows([(0, 0), (0, -1.25), (1, -1.25), (1, 0)], [np.pi / 4, 3 * np.pi / 4])
    >>> [rows.row(k).bounces.tolist() for k in range(2)]
    [[4, 4, 3], [3, 4, 4]]
    """
    incoming = np.ascontiguousarray(np.ravel(angles("theta", theta)))
    limit = whole_number("max_intervals", max_intervals, 1)
    bounce_limit = whole_number("max_bounces", max_bounces, 1)
    cut = triangulated(hollow_vertices)
    x, y = np.ascontiguousarray(cut.vertices.T)
    tables = x, y, cut.corners, cut.beyond, cut.turn_high, cut.turn_low, cut.entrance
    first, high, offset, tags = interruptibly(lambda: march(*tables, incoming, limit, bounce_limit))
    low = np.concatenate([[0.0], high[:-1]])
    low[first[:-1]] = 0.0
    sign = tags[:, 0].astype(np.int8)
    bounces = np.ascontiguousarray(tags[:, 1])
    for array in (first, sign, bounces):
        array.setflags(write=False)
    return Rows(frozen(incoming), first, frozen(low), frozen(high), sign, frozen(offset), bounces)
