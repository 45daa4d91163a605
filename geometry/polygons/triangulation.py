"""The triangulation of a polygonal hollow, with exact predicates and without new vertices."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from operator import itemgetter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, frozen
from ...core.errors import InputError, WallError
from ...core.rounding import EPS, UNIT_ROUNDOFF
from .compiled.columns import FIRST_WALL, OPENING

Integers = NDArray[np.int64]
# Difference up to which edges are tested for being parallel, a few rounding errors of directions in (0, pi].
PARALLEL = 32.0 * UNIT_ROUNDOFF
# A diagonal is exchanged for one that is shorter by more than rounding, so the exchanges come to an end.
SHORTER = 1.0 - 1e-9


@dataclass(frozen=True, eq=False)
class Triangulation:
    """A hollow cut into triangles along diagonals, with origin (left, 0) and a size of about 1.

    The lengths are divided by ``unit``, a power of two, hence without rounding. Ears are clipped by index, so the two
    sides of a chain that touches itself (a plate of zero thickness) remain distinct. Collinear vertices give triangles
    of no area, which connect edges like all others.

    Parameters
    ----------
    vertices : array of shape (n, 2)
        The chain from the left to the right end of the opening, translated and scaled.
    unit : float
        The length that is scaled to 1.
    corners : array of shape (n - 2, 3)
        Vertex indices of each triangle, counterclockwise.
    beyond : array of shape (3 (n - 2),)
        At 3 t + k the neighbour at edge k (from corner k to corner k + 1) of triangle t: the edge of another
        triangle, or OPENING, or FIRST_WALL - e for the wall edge from vertex e to vertex e + 1.
    turn_high, turn_low : arrays of shape (n - 1,)
        The direction of each wall edge in radians, as an unevaluated sum; equal for parallel edges.
    entrance : int
        The number of the opening, as an index of ``beyond``.
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


def triangulated(hollow_vertices: ArrayLike) -> Triangulation:
    """Cut a polygonal hollow into triangles.

    Parameters
    ----------
    hollow_vertices : array_like of shape (n, 2)
        The chain from (left, 0) to (right, 0) with the hollow above it; the chain may touch but not cross itself.

    Returns
    -------
    Triangulation

    Raises
    ------
    InputError
        If the chain does not run from left to right between two points at height 0, or rises above height 0.
    WallError
        If no triangulation exists, because the chain crosses itself.

    Notes
    -----
    By ear clipping; cost n^2 for common walls, n^3 at worst. Signs that double precision does not resolve are computed
    in exact rational arithmetic. Then the diagonals of convex quadrilaterals are exchanged as long as they become
    shorter, because a ray crosses diagonals in proportion to their length.

    Examples
    --------
    >>> square = triangulated([(0, 0), (0, -1), (1, -1), (1, 0)])
    >>> square.corners.tolist()
    [[2, 3, 0], [0, 1, 2]]
    """
    points = checked_chain(hollow_vertices)
    relative = points - points[0]
    unit = math.ldexp(1.0, math.frexp(float(np.abs(relative).max()))[1])
    chain = ExactPoints(points / unit)
    corners, beyond = _clipped(chain)
    _shorten(chain, corners, beyond)
    entrance = int(np.flatnonzero(beyond == OPENING)[0])
    high, low = _directions(ExactPoints(points))
    for array in (corners, beyond):
        array.setflags(write=False)
    return Triangulation(frozen(relative / unit), unit, corners, beyond, frozen(high), frozen(low), entrance)


def checked_chain(hollow_vertices: ArrayLike) -> Floats:
    """Return the different vertices of a chain from (left, 0) to (right, 0), none above height 0."""
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


def _clipped(chain: ExactPoints, slits_first: bool = False) -> tuple[Integers, Integers]:
    """Clip all ears; return the corners of the triangles and the neighbours of their edges.

    Hollows whose parts are connected by a point or by a slit of no width need ``slits_first``, which is slower.
    """
    count = len(chain.points)
    ring = list(range(count))
    link = [FIRST_WALL - e for e in range(count - 1)] + [OPENING]
    corners = np.empty((count - 2, 3), np.int64)
    beyond = np.full(3 * (count - 2), OPENING, np.int64)
    first = count - 1
    for triangle in range(count - 2):
        k = _next_ear(chain, ring, first, slits_first)
        if k < 0 and not slits_first:
            return _clipped(chain, slits_first=True)
        if k < 0:
            raise WallError(
                f"hollow_vertices: no triangulation beyond vertex {ring[first % len(ring)]}; expected a chain that "
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
            # the third side of the last triangle is an edge of the ring, too
            beyond[3 * triangle + 2] = link[c]
            if link[c] >= 0:
                beyond[link[c]] = 3 * triangle + 2
        del ring[k]
        first = k + 1
    return corners, beyond


def _shorten(chain: ExactPoints, corners: Integers, beyond: Integers) -> None:
    """Exchange diagonals of strictly convex quadrilaterals for the other ones, as long as these are shorter."""
    points = chain.points
    open_edges = [edge for edge in range(beyond.size) if beyond[edge] > edge]
    while open_edges:
        edge = open_edges.pop()
        if beyond[edge] < 0:
            continue
        (triangle, k), (other, j) = divmod(edge, 3), divmod(int(beyond[edge]), 3)
        a, b, c = corners[triangle, [k, (k + 1) % 3, (k + 2) % 3]].tolist()
        d = int(corners[other, (j + 2) % 3])
        if math.dist(points[c], points[d]) >= SHORTER * math.dist(points[a], points[b]):
            continue
        if chain.turn(d, b, c) <= 0 or chain.turn(c, a, d) <= 0:
            continue
        bc, ca = beyond[[3 * triangle + (k + 1) % 3, 3 * triangle + (k + 2) % 3]].tolist()
        ad, db = beyond[[3 * other + (j + 1) % 3, 3 * other + (j + 2) % 3]].tolist()
        corners[triangle], corners[other] = (c, d, b), (d, c, a)
        sides = (3 * other, db, bc, 3 * triangle, ca, ad)
        for place, neighbour in zip(
            [*range(3 * triangle, 3 * triangle + 3), *range(3 * other, 3 * other + 3)], sides, strict=True
        ):
            beyond[place] = neighbour
            if neighbour >= 0:
                beyond[neighbour] = place
        open_edges += [3 * triangle + 1, 3 * triangle + 2, 3 * other + 1, 3 * other + 2]


def _next_ear(chain: ExactPoints, ring: list[int], first: int, slits_first: bool) -> int:
    """Return the index in the ring of a vertex to cut off, or -1.

    The vertex is a true ear, else a vertex between collinear neighbours, else the end of a slit of no width. With
    ``slits_first`` the end of a slit has priority.
    """
    size = len(ring)
    straight, slit = -1, -1
    for step in range(size):
        k = (first + step) % size
        a, b, c = ring[k - 1], ring[k], ring[(k + 1) % size]
        turn = chain.turn(a, b, c)
        if turn > 0 and not slits_first and (size == 3 or _is_ear(chain, ring, k)):
            return k
        if turn == 0:
            if chain.is_between(a, b, c):
                straight = k if straight < 0 else straight
            elif slit < 0 and not _surrounds(chain, ring[:k] + ring[k + 1 :], b):
                slit = k
                if slits_first:
                    return k
    if slits_first:
        return _next_ear(chain, ring, first, False)
    return straight if straight >= 0 else slit


def _surrounds(chain: ExactPoints, loop: list[int], point: int) -> bool:
    """Whether a loop winds around a point; a fold that ends there is then a plate inside the hollow, not a slit."""
    winding, height = 0, chain.points[:, 1]
    for start, end in zip(loop, [*loop[1:], loop[0]], strict=True):
        if height[start] <= height[point] < height[end]:
            winding += chain.turn(start, end, point) > 0
        elif height[end] <= height[point] < height[start]:
            winding -= chain.turn(start, end, point) < 0
    return winding != 0


def _is_ear(chain: ExactPoints, ring: list[int], k: int) -> bool:
    """Whether no edge of the ring meets the open triangle at its convex vertex k."""
    size = len(ring)
    triangle = ring[k - 1], ring[k], ring[(k + 1) % size]
    outside, loop = np.zeros(size, bool), np.array([*ring, ring[0]])
    for side in range(3):
        behind = chain.sides(triangle[side], triangle[(side + 1) % 3], loop) <= 0
        outside |= behind[:-1] & behind[1:]
    # the two sides themselves
    outside[k - 1] = outside[k] = True
    return not any(chain.enters(triangle, ring[e], ring[(e + 1) % size]) for e in (~outside).nonzero()[0])


def _directions(chain: ExactPoints) -> tuple[Floats, Floats]:
    """Return the directions of the edges modulo pi, as two doubles, equal for exactly parallel edges.

    In extended precision if the machine has it: the rotation of 10^4 reflections then has an error of about one ulp.
    """
    wide = np.diff(chain.points.astype(np.longdouble), axis=0)
    flip = (wide[:, 1] < 0) | ((wide[:, 1] == 0) & (wide[:, 0] < 0))
    wide[flip] *= -1
    direction = np.arctan2(wide[:, 1], wide[:, 0])
    order = np.argsort(direction, kind="stable")
    for before, after in pairwise(order.tolist()):
        if direction[after] - direction[before] <= PARALLEL and chain.are_parallel(before, after):
            direction[after] = direction[before]
    high = direction.astype(np.float64)
    return high, (direction - high).astype(np.float64)


# Rounding error of (b - a) x (c - a), relative to the sum of its two products: Shewchuk 1997, ccwerrboundA.
CROSS_ULPS = 3.0 + 16.0 * EPS

Vector = tuple[int, int]


@dataclass(frozen=True, eq=False)
class ExactPoints:
    """Points, given by their index, with exact predicates.

    Doubles are integers times a power of two. If double precision does not resolve a sign, Python evaluates the
    expression exactly in these integers.

    Parameters
    ----------
    points : array of shape (n, 2)

    Examples
    --------
    >>> corner = ExactPoints(np.array([[0.0, 0.0], [3.0, 0.0], [1.0, 1e-300]]))
    >>> corner.turn(0, 1, 2), corner.turn(1, 0, 2), corner.turn(0, 1, 1)
    (1, -1, 0)
    """

    points: Floats

    @cached_property
    def _lattice(self) -> list[Vector]:
        """The coordinates as integer multiples of a common unit."""
        ratios = [value.as_integer_ratio() for value in self.points.ravel().tolist()]
        _, unit = max(ratios, key=itemgetter(1))
        whole = [numerator * (unit // denominator) for numerator, denominator in ratios]
        return list(zip(whole[::2], whole[1::2], strict=True))

    @cached_property
    def _plain(self) -> list[list[float]]:
        """The coordinates as Python's numbers."""
        found: list[list[float]] = self.points.tolist()
        return found

    def turn(self, a: int, b: int, c: int) -> int:
        """Return 1 if the path a, b, c turns left, -1 if it turns right, 0 if the points are collinear."""
        (ax, ay), (bx, by), (cx, cy) = self._plain[a], self._plain[b], self._plain[c]
        first, second = (bx - ax) * (cy - ay), (by - ay) * (cx - ax)
        cross: float = first - second
        if abs(cross) <= CROSS_ULPS * UNIT_ROUNDOFF * (abs(first) + abs(second)) and (first or second):
            cross = self._cross(a, b, c)
        return (cross > 0) - (cross < 0)

    def sides(self, a: int, b: int, others: Sequence[int] | NDArray[np.int64]) -> NDArray[np.int8]:
        """Return the side of the line from a to b on which each other point lies: 1 left, -1 right, 0 on the line."""
        start, (along, up) = self.points[a], self.points[b] - self.points[a]
        offset = self.points[others] - start
        first, second = along * offset[:, 1], up * offset[:, 0]
        cross = first - second
        signs: NDArray[np.int8] = np.sign(cross).astype(np.int8)
        uncertain = np.abs(cross) <= CROSS_ULPS * UNIT_ROUNDOFF * (np.abs(first) + np.abs(second))
        # if both products are exact zeros, the sign is certain
        uncertain &= (first != 0.0) | (second != 0.0)
        for i in uncertain.nonzero()[0].tolist():
            value = self._cross(a, b, int(others[i]))
            signs[i] = (value > 0) - (value < 0)
        return signs

    def is_between(self, a: int, b: int, c: int) -> bool:
        """Whether the angle at b between the directions to a and to c is more than a right angle."""
        (ax, ay), (cx, cy) = self._step(b, a), self._step(b, c)
        return ax * cx + ay * cy < 0

    def are_parallel(self, a: int, b: int) -> bool:
        """Whether the step from point a to point a + 1 is parallel to the step from point b to point b + 1."""
        (ax, ay), (bx, by) = self._step(a, a + 1), self._step(b, b + 1)
        return ax * by == ay * bx

    def enters(self, triangle: Sequence[int], start: int, end: int) -> bool:
        """Whether a segment meets the open triangle with counterclockwise corners."""
        # the part inside all sides so far, as integer fractions with positive denominators
        low, high = (0, 1), (1, 1)
        for k in range(3):
            a, b = triangle[k], triangle[(k + 1) % 3]
            first, last = self._cross(a, b, start), self._cross(a, b, end)
            if first <= 0 and last <= 0:
                return False
            if first < 0 and -first * low[1] > low[0] * (last - first):
                low = (-first, last - first)
            if last < 0 and first * high[1] < high[0] * (first - last):
                high = (first, first - last)
        return low[0] * high[1] < high[0] * low[1]

    def _step(self, a: int, b: int) -> Vector:
        (ax, ay), (bx, by) = self._lattice[a], self._lattice[b]
        return bx - ax, by - ay

    def _cross(self, a: int, b: int, c: int) -> int:
        (ax, ay), (bx, by), (cx, cy) = self._lattice[a], self._lattice[b], self._lattice[c]
        return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
