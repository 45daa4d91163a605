"""Straight pieces of walls."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, shaped
from ...core.errors import WallError
from . import columns as c
from .curve import Bools, Box, Curve, Point, Table, as_point, check_keys, pair_of, parameters, stretch_factors


@dataclass(frozen=True)
class Segment(Curve):
    """A straight piece from ``start`` to ``end``.

    Parameters
    ----------
    start, end : (float, float)
        Two different points.

    Raises
    ------
    WallError
        If a coordinate is not finite or the two points coincide.

    Examples
    --------
    >>> side = Segment((0, 0), (3, -4))
    >>> side.length
    5.0
    >>> side.point([0.0, 0.5]).tolist()
    [[0.0, 0.0], [1.5, -2.0]]
    """

    kind = "segment"
    is_straight = True

    start: Point
    end: Point
    rounding: float = field(default=0.0, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", as_point("Segment start", self.start))
        object.__setattr__(self, "end", as_point("Segment end", self.end))
        if self.start == self.end:
            raise WallError(f"Segment: expected two different points, got {self.start} twice; leave this piece out")

    @classmethod
    def path(cls, vertices: Floats) -> list[Self]:
        """Return the segments between consecutive points, which are finite and different.

        Examples
        --------
        >>> [piece.length for piece in Segment.path(np.array([[0.0, 0.0], [3.0, -4.0], [3.0, 0.0]]))]
        [5.0, 4.0]
        """
        corners = shaped("vertices", vertices, "n", 2)
        pieces, assign = [], object.__setattr__
        for start, end in pairwise(zip(*corners.T.tolist(), strict=True)):
            # without the checks of the constructor, which take longer than all else in a wall of many pieces
            piece = object.__new__(cls)
            assign(piece, "start", start)
            assign(piece, "end", end)
            pieces.append(piece)
        return pieces

    def point(self, s: ArrayLike) -> Floats:
        along = parameters(s)[..., np.newaxis]
        points: Floats = (1.0 - along) * np.array(self.start) + along * np.array(self.end)
        return points

    def tangent(self, s: ArrayLike) -> Floats:
        """Return the unit tangent, repeated for every parameter in ``s``, shape ``s.shape + (2,)``."""
        dx, dy = self.end[0] - self.start[0], self.end[1] - self.start[1]
        speed = math.hypot(dx, dy)
        direction = np.array([dx / speed, dy / speed])
        return np.array(np.broadcast_to(direction, (*parameters(s).shape, 2)), dtype=np.float64)

    @property
    def length(self) -> float:
        """The distance between the end points."""
        return math.dist(self.start, self.end)

    @property
    def box(self) -> Box:
        (x0, y0), (x1, y1) = self.start, self.end
        return min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)

    def turning_points(self, axis: int) -> list[float]:
        return []

    def reversed(self) -> Segment:
        """Return the segment in the opposite direction."""
        return Segment(self.end, self.start)

    def stretched(self, x_factor: float, y_factor: float) -> Segment:
        fx, fy = stretch_factors(x_factor, y_factor)
        return Segment((fx * self.start[0], fy * self.start[1]), (fx * self.end[0], fy * self.end[1]))

    def moved(self, dx: float, dy: float) -> Segment:
        dx, dy = as_point("moved", (dx, dy))
        return Segment((self.start[0] + dx, self.start[1] + dy), (self.end[0] + dx, self.end[1] + dy))

    def pinned(self, start: Point, end: Point) -> Segment:
        return Segment(start, end)

    def split(self, s: float) -> tuple[Segment, Segment]:
        x, y = self.point(s)
        middle = (float(x), float(y))
        return Segment(self.start, middle), Segment(middle, self.end)

    def flattened(self, tolerance: float) -> Floats:
        """Return the two end points, for any tolerance."""
        return np.array([self.start, self.end])

    def curvature(self, s: float) -> float:
        return 0.0

    def largest_curvature(self) -> tuple[float, float]:
        return 0.0, 0.0

    def to_table(self) -> Table:
        return {"kind": self.kind, "start": list(self.start), "end": list(self.end)}

    @classmethod
    def from_table(cls, table: Table) -> Segment:
        check_keys(table, {"kind", "start", "end"}, set())
        return cls(pair_of("start", table["start"]), pair_of("end", table["end"]))

    @property
    def signed_area(self) -> float:
        (x0, y0), (x1, y1) = self.start, self.end
        return 0.5 * (x0 * y1 - x1 * y0)

    @property
    def wall_row(self) -> Floats:
        (x, y), (dx, dy) = self.start, self.tangent(0.0).tolist()
        columns = {c.WALL_KIND: c.SEGMENT_WALL, c.WALL_X: x, c.WALL_Y: y}
        return c.row_of(c.WALL_COLUMNS, {**columns, c.INNER_X: -dy, c.INNER_Y: dx, c.WALL_LENGTH: self.length})

    def touch(self, position: Floats) -> tuple[Floats, Floats, Floats]:
        tangent = np.broadcast_to(self.tangent(0.0), position.shape)
        return position, tangent, np.zeros(len(position))

    def length_to(self, position: Floats) -> Floats:
        along = (position - np.array(self.start)) @ self.tangent(0.0)
        return np.asarray(np.clip(along, 0.0, self.length))

    def is_on(self, position: Floats, slack: float) -> Bools:
        along = self.tangent(0.0)
        relative = position - np.array(self.start)
        at = relative @ along
        near = np.abs(relative @ np.array([-along[1], along[0]])) <= slack
        return np.asarray(near & (at >= -slack) & (at <= self.length + slack))
