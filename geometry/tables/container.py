"""The region in which the centre of a disk moves: between straight walls, or inside curves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import (
    Floats,
    Value,
    finite_array,
    frozen,
    indices,
    number_between,
    positive_number,
    sequence,
    shaped,
)
from ...core.errors import InputError
from ...core.estimates import Summary
from ...core.tables import axes_or_new
from ..curves import columns as c
from ..curves.arc import Arc
from ..curves.bezier import GRAZE
from ..curves.curve import Curve
from ..curves.segment import Segment
from . import boundary
from .boundary import FlightStatus

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Tolerance for the length 1 of the normals, which have a few rounding errors.
UNIT_TOLERANCE = 1e-12


@dataclass(frozen=True)
class Torus(Value):
    """The rectangle [0, width) x [0, height) with opposite sides identified: a gas without walls, for `play_gas`.

    Parameters
    ----------
    width, height : float
        The periods, greater than 0.

    Raises
    ------
    InputError
        If a period is not positive.

    Examples
    --------
    >>> Torus(12.0, 9.0).area
    108.0
    """

    width: float
    height: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "width", positive_number("width", self.width))
        object.__setattr__(self, "height", positive_number("height", self.height))

    @property
    def periods(self) -> tuple[float, float]:
        """Width and height."""
        return self.width, self.height

    @property
    def area(self) -> float:
        """The area, width times height."""
        return self.width * self.height

    def draw(self, ax: Axes | None = None) -> Axes:
        """Draw one period into matplotlib Axes, new ones by default, and return them."""
        axes, (x, y) = axes_or_new(ax), (self.width, self.height)
        axes.plot([0.0, x, x, 0.0, 0.0], [0.0, 0.0, y, y, 0.0], color="black", linestyle=":", linewidth=1.2)
        axes.set_aspect("equal")
        return axes


@dataclass(frozen=True, repr=False)
class Container(Summary):
    """The region in which the centre of the disk moves: {x : (x - p_i).n_i >= 0 for all i}, and inside of curves.

    The walls bound the centre, not the rim. For example, the centre of a disk of radius 1 between two plates at
    distance 3 moves in ``Container.strip(1.0)``, and the centre of a disk of radius 1 in a round room of radius 4 moves
    in ``Container.circle(3.0)``. Walls are numbered: first the straight walls without ends, then the curves.

    Parameters
    ----------
    points : array_like, shape (k, 2)
        A point p_i on every straight wall without ends.
    normals : array_like, shape (k, 2)
        The unit normal n_i of every such wall, into the region.
    curves : sequence of Curve, optional
        Closed loops with the region on their left: at most one outer loop, counterclockwise, and obstacles, clockwise.

    Raises
    ------
    InputError
        If a shape is wrong, a normal does not have length 1, there is no wall, or the curves are no closed loops, cross
        themselves or each other, or run with the region on their right.

    Examples
    --------
    >>> room = Container.polygon([(0, 0), (4, 0), (4, 3)])
    >>> room.normals.round(2).tolist()
    [[0.0, 1.0], [-1.0, 0.0], [0.6, -0.8]]
    >>> room.contains([[3.0, 1.0], [1.0, 1.0]]).tolist()
    [True, False]

    A channel with a round pillar:

    >>> from math import pi
    >>> pillar = Arc((0.0, 0.5), 0.25, 2 * pi, 0.0)
    >>> channel = Container([[0, 0], [0, 1]], [[0, 1], [0, -1]], [pillar])
    >>> channel.contains([[0.0, 0.5], [5.0, 0.5], [0.0, 2.0]]).tolist()
    [False, True, False]
    """

    points: Floats
    normals: Floats
    curves: tuple[Curve, ...] = ()

    def __post_init__(self) -> None:
        points, normals = finite_array("points", self.points), finite_array("normals", self.normals)
        curves = boundary.checked_curves(self.curves)
        if points.ndim != 2 or points.shape[1] != 2 or points.shape != normals.shape or not len(points) + len(curves):
            raise InputError(
                f"points, normals: expected two arrays of shape (k, 2), got {points.shape}, {normals.shape}"
            )
        lengths = np.hypot(normals[:, 0], normals[:, 1])
        if np.any(np.abs(lengths - 1.0) > UNIT_TOLERANCE):
            raise InputError(f"normals: expected unit vectors, got lengths {lengths.tolist()}")
        if curves:
            boundary.check_nesting(curves, boundary.loops_of(curves))
        object.__setattr__(self, "points", frozen(points))
        object.__setattr__(self, "normals", frozen(normals))
        object.__setattr__(self, "curves", curves)

    @classmethod
    def from_curves(cls, curves: Sequence[Curve]) -> Container:
        """Return the inside of closed loops of curves, which run with the inside on their left.

        The outer loop is counterclockwise, and each loop around an obstacle clockwise. Every curve is a wall of its
        own, which can have its own law. The order of the loops is free.

        Parameters
        ----------
        curves : sequence of Curve, such as Segment, Arc and Bezier
            The curves, on which the centre of the disk is reflected.

        Raises
        ------
        InputError
            If there is no curve, a Bezier curve has a cusp between its ends, or the curves form no loops as described.

        Examples
        --------
        Half a disk:

        >>> from math import pi
        >>> half = Container.from_curves([Segment((-1, 0), (1, 0)), Arc((0, 0), 1.0, 0.0, pi)])
        >>> half.area == pi / 2, half.perimeter == 2 + pi
        (True, True)

        The region between a parabola and its chord, two thirds of the rectangle around it:

        >>> from asperity import geometry as geo
        >>> bowl = Container.from_curves([geo.Bezier([(-1, 1), (0, -1), (1, 1)]), Segment((1, 1), (-1, 1))])
        >>> round(bowl.area, 12)
        1.333333333333
        """
        curves = sequence("curves", curves)
        if not curves:
            raise InputError("curves: expected at least one curve, got none")
        return cls(np.empty((0, 2)), np.empty((0, 2)), boundary.checked_curves(curves))

    @classmethod
    def circle(cls, radius: float = 1.0) -> Container:
        """Return the disk of this radius around the origin; its one wall is wall 0."""
        return cls.ellipse(radius, radius)

    @classmethod
    def ellipse(cls, a: float, b: float) -> Container:
        """Return the ellipse with semi-axes ``a`` along x1 and ``b`` along x2 around the origin; one wall."""
        axes = positive_number("a", a), positive_number("b", b)
        return cls.from_curves([Arc((0.0, 0.0), axes, 0.0, 2.0 * math.pi)])

    @classmethod
    def stadium(cls, length: float = 2.0, radius: float = 1.0) -> Container:
        """Return the stadium: a rectangle of this length and height 2 radius between two half disks.

        Walls 0 to 3 are the lower side, the right half circle, the upper side and the left half circle. The origin is
        the centre. Source: L. A. Bunimovich (1979).
        """
        half, r = 0.5 * positive_number("length", length), positive_number("radius", radius)
        corners = [(-half, -r), (half, -r), (half, r), (-half, r)]
        right = Arc((half, 0.0), r, -0.5 * math.pi, 0.5 * math.pi).pinned(corners[1], corners[2])
        left = Arc((-half, 0.0), r, 0.5 * math.pi, 1.5 * math.pi).pinned(corners[3], corners[0])
        return cls.from_curves([Segment(*corners[:2]), right, Segment(*corners[2:]), left])

    @classmethod
    def sinai(cls, side: float = 1.0, radius: float = 0.25) -> Container:
        """Return the Sinai table: a square around the origin without the disk of this radius in its middle.

        Walls 0 to 3 are the lower, right, upper and left side, wall 4 is the circle. Unfolded by reflections, it is the
        periodic Lorentz gas on the square lattice. Source: Ya. G. Sinai (1970).

        Raises
        ------
        InputError
            If ``radius`` is not in (0, side/2).
        """
        half = 0.5 * positive_number("side", side)
        r = number_between("radius", radius, 0.0, half)
        corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
        sides = [Segment(corners[k], corners[(k + 1) % 4]) for k in range(4)]
        return cls.from_curves([*sides, Arc((0.0, 0.0), r, 2.0 * math.pi, 0.0)])

    @classmethod
    def strip(cls, gap: float = 1.0) -> Container:
        """Return the strip 0 <= x2 <= gap, unbounded along x1."""
        height = positive_number("gap", gap)
        return cls(np.array([[0.0, 0.0], [0.0, height]]), np.array([[0.0, 1.0], [0.0, -1.0]]))

    @classmethod
    def wedge(cls, angle: float) -> Container:
        """Return the wedge of polar angles from 0 to ``angle``, apex at the origin; ``angle`` in (0, pi), radians."""
        opening = number_between("angle", angle, 0.0, math.pi)
        normals = [[0.0, 1.0], [math.sin(opening), -math.cos(opening)]]
        return cls(np.zeros((2, 2)), np.array(normals))

    @classmethod
    def polygon(cls, vertices: ArrayLike) -> Container:
        """Return the inside of a convex polygon from its vertices in counterclockwise order.

        Raises
        ------
        InputError
            If there are fewer than three vertices, or the polygon is not convex and counterclockwise.
        """
        corners = finite_array("vertices", vertices)
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
            raise InputError(f"vertices: expected shape (k, 2) with k >= 3, got {corners.shape}")
        edges = np.roll(corners, -1, axis=0) - corners
        following = np.roll(edges, -1, axis=0)
        turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
        total_turn = np.arctan2(turns, np.sum(edges * following, axis=1)).sum()
        if not np.all(turns > 0.0) or total_turn > 3.0 * math.pi:
            raise InputError("vertices: expected a convex polygon with its vertices counterclockwise")
        lengths = np.hypot(edges[:, 0], edges[:, 1])[:, None]
        # adding 0 turns -0 into 0
        return cls(corners, np.stack([-edges[:, 1], edges[:, 0]], axis=1) / lengths + 0.0)

    def closed(self) -> Container:
        """Return the same region with segments for straight walls that are the sides of a convex polygon.

        Walls keep their numbers. Other containers are returned as they are.

        Examples
        --------
        >>> room = Container.polygon([(0, 0), (4, 0), (4, 3)])
        >>> len(room.closed().curves), room.area, room.perimeter
        (3, 6.0, 12.0)
        """
        following = np.roll(self.points, -1, axis=0)
        if self.curves or len(self.points) < 3:
            return self
        size = float(np.abs(self.points - self.points[0]).max())
        off = np.abs(np.sum((following - self.points) * self.normals, axis=1))
        if np.any(off > boundary.JOIN_TOLERANCE * size):
            return self
        corners = [(x, y) for x, y in self.points.tolist()]
        return Container.from_curves([Segment(p, q) for p, q in zip(corners, corners[1:] + corners[:1], strict=True)])

    def _facts(self) -> dict[str, object]:
        return {"walls without ends": len(self.points) or None, "curves": len(self.curves) or None}

    @property
    def tangents(self) -> Floats:
        """The unit tangents (k, 2), to the right if the wall is seen below the disk."""
        return frozen(np.stack([self.normals[:, 1], -self.normals[:, 0]], axis=1))

    def distances(self, position: ArrayLike) -> Floats:
        """Return the signed distances (n, k) of points (n, 2) from the endless straight walls, negative outside."""
        points = shaped("position", position, "n", 2)
        return np.asarray(np.einsum("nki,ki->nk", points[:, None, :] - self.points, self.normals))

    @property
    def wall_count(self) -> int:
        """The number of walls: straight walls without ends, and curves."""
        return len(self.points) + len(self.curves)

    @property
    def area(self) -> float:
        """The area, of a polygon or a container of curves with an outer loop.

        Raises
        ------
        InputError
            If the container is not bounded by curves or the sides of a polygon.
        """
        return math.fsum(curve.signed_area for curve in self._closed_curves())

    @property
    def perimeter(self) -> float:
        """The length of the boundary; a disk with specular reflection flies pi area/perimeter on average (Santalo)."""
        return math.fsum(curve.length for curve in self._closed_curves())

    def _closed_curves(self) -> tuple[Curve, ...]:
        table = self.closed()
        if len(table.points) or not table.has_outer_loop:
            raise InputError("container: expected a polygon, or curves with an outer loop, such as Container.circle()")
        return table.curves

    @property
    def has_outer_loop(self) -> bool:
        """Whether the curves have an outer loop."""
        loops = boundary.loops_of(self.curves) if self.curves else []
        return any(sum(self.curves[k].signed_area for k in loop) > 0.0 for loop in loops)

    def contains(self, position: ArrayLike) -> NDArray[np.bool_]:
        """Return whether each of the points (n, 2) is inside or on the boundary."""
        inside = np.all(self.distances(position) >= 0.0, axis=1)
        if self.curves:
            points = finite_array("position", position)
            inside = inside & boundary.on_the_left(self.curves, points, self.has_outer_loop)
        return np.asarray(inside)

    def next_wall(
        self, position: Floats, velocity: Floats, last: NDArray[np.int64]
    ) -> tuple[Floats, NDArray[np.int64], NDArray[np.uint8]]:
        """Return the time to the next wall, its index and the ``FlightStatus``, ``FLYING`` for a hit.

        This decides whether a disk hits a wall or grazes it. One that grazes an obstacle or a side flies on.

        Parameters
        ----------
        position : array, shape (n, 2)
            Points inside or on the boundary.
        velocity : array, shape (n, 2) or (n, 3)
            The first two columns count.
        last : array of int, shape (n,)
            The wall on which a point is, -1 if on none. A straight wall and an obstacle cannot be the next one too.

        Returns
        -------
        (time, wall, status)
            The time is inf and the wall -1 where no wall is ahead, with the status ``FREE``.
        """
        last = indices("last", shaped("last", last, "n"), self.wall_count, -1)
        position, velocity = shaped("position", position, last.size, 2), shaped("velocity", velocity, last.size, "k")
        if velocity.shape[1] not in (2, 3):
            raise InputError(f"velocity: expected shape (n, 2) or (n, 3), got {velocity.shape}")
        time, wall = np.full(len(position), np.inf), np.full(len(position), -1)
        (walls, corners, slack), new = self.wall_table, np.flatnonzero(last < 0)
        for k, curve in enumerate(self.curves, len(self.points)):
            if curve.wall_row is None:
                begins = last == k
                begins[new] = boundary.begins_along(curve, position[new])
                arrival = curve.arrival(position, velocity, begins, slack)
                wall, time = np.where(arrival < time, k, wall), np.minimum(time, arrival)
        status, plane = np.empty(len(position), dtype=np.uint8), np.ascontiguousarray(velocity[:, :2])
        from .compiled.flights import next_walls

        next_walls(walls, corners, slack, np.ascontiguousarray(position), plane, last, time, wall, status)
        for k in np.unique(wall[(wall >= len(self.points)) & (status == FlightStatus.FLYING)]):
            if self.curves[k - len(self.points)].wall_row is None:
                here = np.flatnonzero((wall == k) & (status == FlightStatus.FLYING))
                point = self.touch(int(k), position[here] + plane[here] * time[here, None])
                level = np.sum(plane[here] * point.normal, axis=1) >= -GRAZE * np.hypot(*plane[here].T)
                status[here[level & (point.curvature > 0.0)]] = FlightStatus.GRAZING
        return time, wall, status

    @cached_property
    def wall_table(self) -> tuple[Floats, Floats, float]:
        """The rows of all walls for compiled functions, the corners (c, 2), and by how much curves are longer."""
        lines = [
            c.row_of(c.WALL_COLUMNS, {c.WALL_KIND: c.LINE_WALL, c.WALL_X: x, c.WALL_Y: y, c.INNER_X: nx, c.INNER_Y: ny})
            for (x, y), (nx, ny) in zip(self.points.tolist(), self.normals.tolist(), strict=True)
        ]
        rows = [curve.wall_row for curve in self.curves]
        given = c.row_of(c.WALL_COLUMNS, {c.WALL_KIND: c.GIVEN_WALL})
        slack = boundary.SLACK * boundary.size_of(self.curves) if self.curves else 0.0
        return np.array([*lines, *(given if row is None else row for row in rows)]), self._corners, slack

    @cached_property
    def _corners(self) -> Floats:
        """The points (c, 2) where walls meet at an angle: joints of curves, and crossings of straight walls."""
        crossings = [
            np.linalg.solve(self.normals[[i, j]], np.sum(self.normals[[i, j]] * self.points[[i, j]], axis=1))
            for i, j in combinations(range(len(self.points)), 2)
            if abs(self.normals[i] @ self.tangents[j]) > boundary.KINK
        ]
        return np.concatenate([boundary.corners_of(self.curves), np.array(crossings).reshape(-1, 2)])

    def touch(self, wall: int, position: Floats) -> boundary.Touch:
        """Return points (n, 2) of a wall without their rounding error, with unit tangents and curvatures there.

        The inside is on the left of the tangent; seen with the wall below, the tangent points to the right.
        """
        position, (wall,) = shaped("position", position, "n", 2), indices("wall", [wall], self.wall_count).tolist()
        if wall >= len(self.points):
            return boundary.Touch(*self.curves[wall - len(self.points)].touch(position))
        return boundary.Touch(position, np.broadcast_to(self.tangents[wall], position.shape), np.zeros(len(position)))

    def frames(self, position: Floats, wall: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Return the unit tangents (n, 2) and inner unit normals (n, 2) at points (n, 2) of these walls (n,)."""
        position = shaped("position", position, "n", 2)
        wall = indices("wall", shaped("wall", wall, len(position)), self.wall_count)
        tangent = np.empty((len(position), 2))
        for k in np.unique(wall):
            here = wall == k
            tangent[here] = self.touch(int(k), position[here]).tangent
        return tangent, np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)

    def point_at(self, length: ArrayLike) -> tuple[Floats, NDArray[np.int64]]:
        """Return the points (n, 2) of the boundary at these arc lengths (n,), and their walls (n,).

        The arc length runs along the curves in their order, from 0 to `perimeter`, modulo which it counts.

        Examples
        --------
        >>> points, wall = Container.stadium(2.0, 1.0).point_at([0.5, 3.0 + np.pi])
        >>> points.round(12).tolist(), wall.tolist()
        ([[-0.5, -1.0], [0.0, 1.0]], [0, 2])
        """
        ends = self._ends()
        along = shaped("length", length, "n") % ends[-1]
        wall = np.minimum(np.searchsorted(ends, along, side="right") - 1, len(self.curves) - 1)
        points = np.empty((len(along), 2))
        for k, curve in enumerate(self.curves):
            here = wall == k
            points[here] = curve.point_at_length(along[here] - ends[k])
        return points, wall.astype(np.int64)

    def length_at(self, position: ArrayLike, wall: NDArray[np.int64]) -> Floats:
        """Return the arc lengths (n,), from 0 to `perimeter`, of points (n, 2) on these walls (n,)."""
        points, ends = shaped("position", position, "n", 2), self._ends()
        wall = indices("wall", shaped("wall", wall, len(points)), self.wall_count)
        length = np.empty(len(points))
        for k, curve in enumerate(self.curves):
            here = wall == k
            length[here] = ends[k] + curve.length_to(points[here])
        return length

    def length_on(self, wall: int, position: Floats) -> Floats:
        """Return the arc lengths (n,) of points (n, 2) from the start of a curve, whose number is ``wall``."""
        (curve,) = indices("wall", [wall - len(self.points)], len(self.curves)).tolist()
        return self.curves[int(curve)].length_to(shaped("position", position, "n", 2))

    def _ends(self) -> Floats:
        """The arc lengths at the ends of the curves, 0 before the first."""
        if len(self.points):
            raise InputError("container: expected one from curves, such as Container.circle()")
        return np.cumsum([0.0, *(curve.length for curve in self.curves)])

    def draw(self, ax: Axes | None = None) -> Axes:
        """Draw the boundary into matplotlib Axes, new ones by default, and return them."""
        axes = axes_or_new(ax)
        for curve in self.curves:
            axes.plot(*curve.flattened(1e-4 * boundary.size_of(self.curves)).T, color="black", linewidth=1.2)
        for point, tangent in zip(self.points, self.tangents, strict=True):
            axes.axline(tuple(point), tuple(point + tangent), color="black", linewidth=1.2)
        axes.set_aspect("equal")
        return axes
