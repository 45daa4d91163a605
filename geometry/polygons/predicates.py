"""Exact predicates for points of the plane in double precision."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS, UNIT_ROUNDOFF

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
        unit = max(denominator for _, denominator in ratios)
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
        (along, up), (right, above) = self._step(a, b), self._step(a, c)
        return along * above - up * right
