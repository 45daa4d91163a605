"""Triangles of a polygonal hollow, with exact predicates and without new vertices."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import frexp, ldexp

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import Floats, finite_array, frozen
from ..errors import InputError, WallError
from ..rounding import UNIT_ROUNDOFF

Integers = NDArray[np.int64]

# Codes in `Triangulation.beyond`: at least 0 another triangle's edge; else the opening, or `FIRST_WALL - edge`.
OPENING = -1
FIRST_WALL = -2
# Rounding of (b - a) x (c - a), as a share of the sum of its two products: Shewchuk 1997, ccwerrboundA.
CROSS_ULPS = 3.0 + 16.0 * 2.0**-52
# Directions in (0, pi] of parallel edges differ by no more than a few rounding errors: an ulp of pi is 2^-51.
PARALLEL = 32.0 * UNIT_ROUNDOFF


@dataclass(frozen=True, eq=False)
class Triangulation:
    """A hollow cut into triangles along diagonals, in its own units: (left, 0) is the origin, the size is about 1.

    The lengths are divided by ``unit``, a power of two, hence without rounding. Ears are clipped by index, so chains
    that touch themselves (plates of zero thickness) keep their two sides apart. Triangles of no area occur where
    vertices are in line; they connect edges like any other.

    Parameters
    ----------
    vertices : array of shape (n, 2)
        The chain from the left to the right end of the opening, translated and scaled.
    unit : float
        The length that has become 1.
    corners : array of shape (n - 2, 3)
        Vertex indices of each triangle, counterclockwise.
    beyond : array of shape (3 (n - 2),)
        What lies beyond edge k (from corner k to corner k + 1) of triangle t, at 3 t + k: the edge of another
        triangle, or OPENING, or FIRST_WALL - e for the wall edge from vertex e to vertex e + 1.
    turn_high, turn_low : arrays of shape (n - 1,)
        The direction of each wall edge in radians, as an unevaluated sum. Parallel edges have equal directions.
    entrance : int
        The edge, in the numbering of ``beyond``, that is the opening.
    """

    vertices: Floats
    unit: float
    corners: Integers
    beyond: Integers
    turn_high: Floats
    turn_low: Floats
    entrance: int

    @property
    def width(self) -> float:
        """Width of the opening in units of ``unit``."""
        return float(self.vertices[-1, 0])

    @property
    def tables(self) -> tuple[Floats, Floats, Integers, Integers, Floats, Floats, int]:
        """What the compiled loops take: x, y, corners, beyond, turn_high, turn_low, entrance."""
        x, y = np.ascontiguousarray(self.vertices.T)
        return x, y, self.corners, self.beyond, self.turn_high, self.turn_low, self.entrance


def triangulated(hollow_vertices: ArrayLike) -> Triangulation:
    """Cut a polygonal hollow into triangles.

    Parameters
    ----------
    hollow_vertices : array_like of shape (n, 2)
        The chain from (left, 0) to (right, 0) with the hollow above it; it may touch but not cross itself.

    Returns
    -------
    Triangulation

    Raises
    ------
    InputError
        If the chain does not run from left to right between two points at height 0, or rises above it.
    WallError
        If no triangulation exists, because the chain crosses itself.

    Notes
    -----
    Ear clipping; cost n^2 for common walls, n^3 at worst. Signs are decided by exact rational arithmetic wherever
    double precision does not settle them.

    Examples
    --------
    >>> square = triangulated([(0, 0), (0, -1), (1, -1), (1, 0)])
    >>> square.corners.tolist()
    [[2, 3, 0], [0, 1, 2]]
    """
    points = _checked(hollow_vertices)
    relative = points - points[0]
    unit = ldexp(1.0, frexp(float(np.abs(relative).max()))[1])
    corners, beyond = _clipped(points / unit)
    entrance = int(np.flatnonzero(beyond == OPENING)[0])
    high, low = _directions(points)
    for array in (corners, beyond):
        array.setflags(write=False)
    return Triangulation(frozen(relative / unit), unit, corners, beyond, frozen(high), frozen(low), entrance)


def _checked(hollow_vertices: ArrayLike) -> Floats:
    points = finite_array("hollow_vertices", hollow_vertices)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
        raise InputError(f"hollow_vertices: expected an array of shape (n, 2), n at least 3, got {points.shape}")
    if points[0, 1] != 0.0 or points[-1, 1] != 0.0 or not points[0, 0] < points[-1, 0]:
        raise InputError(
            "hollow_vertices: expected a chain from (left, 0) to (right, 0) with left < right, "
            f"got {points[0].tolist()} to {points[-1].tolist()}"
        )
    worst = int(points[:, 1].argmax())
    if points[worst, 1] > 0.0:
        raise InputError(f"hollow_vertices: expected y <= 0, got {points[worst].tolist()} at vertex {worst}")
    keep = np.ones(len(points), bool)
    keep[1:] = (np.diff(points, axis=0) != 0.0).any(axis=1)
    if keep.sum() < 3:
        raise InputError("hollow_vertices: expected at least 3 different points in the chain")
    return np.asarray(points[keep])


def _exact_sign(a: Floats, b: Floats, c: Floats) -> int:
    ax, ay, bx, by, cx, cy = (Fraction(float(value)) for point in (a, b, c) for value in point)
    cross = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (cross > 0) - (cross < 0)


def _signs(a: Floats, b: Floats, points: Floats) -> NDArray[np.int8]:
    """On which side of the line from a to b each point lies: 1 left, -1 right, 0 on it. Exact."""
    first = (b[0] - a[0]) * (points[:, 1] - a[1])
    second = (b[1] - a[1]) * (points[:, 0] - a[0])
    cross = first - second
    signs: NDArray[np.int8] = np.sign(cross).astype(np.int8)
    doubtful = np.abs(cross) <= CROSS_ULPS * UNIT_ROUNDOFF * (np.abs(first) + np.abs(second))
    # products of exact zeros are zero, for all others the sign is not certain
    doubtful &= (first != 0.0) | (second != 0.0)
    for i in doubtful.nonzero()[0]:
        signs[i] = _exact_sign(a, b, points[i])
    return signs


def _enters(corners: list[Floats], start: Floats, end: Floats) -> bool:
    """Whether a segment meets the open triangle, exactly."""
    low, high = Fraction(0), Fraction(1)
    for k in range(3):
        a, b = corners[k], corners[(k + 1) % 3]
        ax, ay, bx, by = (Fraction(float(value)) for value in (*a, *b))
        at = [(bx - ax) * (Fraction(float(q[1])) - ay) - (by - ay) * (Fraction(float(q[0])) - ax) for q in (start, end)]
        if at[0] <= 0 and at[1] <= 0:
            return False
        if at[0] < 0 or at[1] < 0:
            root = at[0] / (at[0] - at[1])
            low, high = (max(low, root), high) if at[0] < 0 else (low, min(high, root))
    return low < high


def _clipped(points: Floats, slits_first: bool = False) -> tuple[Integers, Integers]:
    """Clip ears until nothing is left; the edges remember what lies beyond them.

    Parts of the hollow that hang together by a point or by a slit of no width need ``slits_first``, which is slower.
    """
    count = len(points)
    ring = list(range(count))
    link = [FIRST_WALL - e for e in range(count - 1)] + [OPENING]
    corners = np.empty((count - 2, 3), np.int64)
    beyond = np.full(3 * (count - 2), OPENING, np.int64)
    place = count - 1
    for triangle in range(count - 2):
        k = _next_ear(points, ring, place, slits_first)
        if k < 0 and not slits_first:
            return _clipped(points, slits_first=True)
        if k < 0:
            raise WallError(
                f"hollow_vertices: no triangulation beyond vertex {ring[place % len(ring)]}; expected a chain that "
                "does not cross itself, with the hollow on its left"
            )
        a, b, c = ring[k - 1], ring[k], ring[(k + 1) % len(ring)]
        corners[triangle] = a, b, c
        for side, owner in ((0, a), (1, b)):
            beyond[3 * triangle + side] = link[owner]
            if link[owner] >= 0:
                beyond[link[owner]] = 3 * triangle + side
        link[a] = 3 * triangle + 2
        if len(ring) == 3:
            # the last triangle's third side is an edge of the ring as well
            beyond[3 * triangle + 2] = link[c]
            if link[c] >= 0:
                beyond[link[c]] = 3 * triangle + 2
        del ring[k]
        place = k + 1
    return corners, beyond


def _next_ear(points: Floats, ring: list[int], place: int, slits_first: bool) -> int:
    """Position in the ring of a vertex that can be cut off, or -1.

    A true ear, or else a vertex in line with its neighbours, or else the end of a slit of no width; or that first.
    """
    size = len(ring)
    loop = points[ring]
    straight, slit = -1, -1
    for step in range(size):
        k = (place + step) % size
        a, b, c = loop[k - 1], loop[k], loop[(k + 1) % size]
        turn = int(_signs(a, b, c[None])[0])
        if turn > 0 and not slits_first and (size == 3 or _is_ear(loop, k)):
            return k
        if turn == 0:
            from_a = [Fraction(float(a[i])) - Fraction(float(b[i])) for i in (0, 1)]
            from_c = [Fraction(float(c[i])) - Fraction(float(b[i])) for i in (0, 1)]
            if from_a[0] * from_c[0] + from_a[1] * from_c[1] < 0:
                straight = k if straight < 0 else straight
            elif slit < 0 and not _surrounds(np.delete(loop, k, axis=0), b):
                slit = k
                if slits_first:
                    return k
    if slits_first:
        return _next_ear(points, ring, place, False)
    return straight if straight >= 0 else slit


def _surrounds(loop: Floats, point: Floats) -> bool:
    """Whether a loop winds around a point: then a fold that ends there is a plate in the hollow, not a slit of it."""
    winding = 0
    for start, end in zip(loop, np.roll(loop, -1, axis=0), strict=True):
        if start[1] <= point[1] < end[1]:
            winding += int(_signs(start, end, point[None])[0]) > 0
        elif end[1] <= point[1] < start[1]:
            winding -= int(_signs(start, end, point[None])[0]) < 0
    return winding != 0


def _is_ear(loop: Floats, k: int) -> bool:
    """Whether no edge of the ring meets the open triangle at its convex vertex k."""
    size = len(loop)
    corners = [loop[k - 1], loop[k], loop[(k + 1) % size]]
    outside = np.zeros(size, bool)
    for side in range(3):
        signs = _signs(corners[side], corners[(side + 1) % 3], loop)
        outside |= (signs <= 0) & (np.roll(signs, -1) <= 0)
    # the two sides themselves
    outside[k - 1] = outside[k] = True
    return not any(_enters(corners, loop[e], loop[(e + 1) % size]) for e in (~outside).nonzero()[0])


def _directions(points: Floats) -> tuple[Floats, Floats]:
    """Directions of the edges modulo pi, in two doubles, the same for edges that are exactly parallel.

    In extended precision where the machine has it: then 10^4 reflections turn by a sum that is good to an ulp.
    """
    wide = np.diff(points.astype(np.longdouble), axis=0)
    flip = (wide[:, 1] < 0) | ((wide[:, 1] == 0) & (wide[:, 0] < 0))
    wide[flip] *= -1
    direction = np.arctan2(wide[:, 1], wide[:, 0])
    order = np.argsort(direction, kind="stable")
    for before, after in pairwise(order):
        if direction[after] - direction[before] <= PARALLEL and _parallel(points, before, after):
            direction[after] = direction[before]
    high = direction.astype(np.float64)
    return high, (direction - high).astype(np.float64)


def _parallel(points: Floats, first: int, second: int) -> bool:
    edges = []
    for e in (first, second):
        (ax, ay), (bx, by) = points[e], points[e + 1]
        edges.append((Fraction(float(bx)) - Fraction(float(ax)), Fraction(float(by)) - Fraction(float(ay))))
    return edges[0][0] * edges[1][1] == edges[0][1] * edges[1][0]
