"""The convex region between straight walls in which the centre of a disk moves."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, frozen, number_between, positive_number
from ...core.errors import InputError

# Tolerance for the length 1 of the normals, which have a few rounding errors.
UNIT_TOLERANCE = 1e-12


@dataclass(frozen=True)
class Container:
    """The convex region {x : (x - p_i).n_i >= 0 for all i} in which the centre of the disk moves.

    The walls bound the centre, not the rim. For example, the centre of a disk of radius 1 between two plates at
    distance 3 moves in ``Container.strip(1.0)``.

    Parameters
    ----------
    points : array_like, shape (k, 2)
        A point p_i on every wall.
    normals : array_like, shape (k, 2)
        The unit normal n_i of every wall, into the region.

    Raises
    ------
    InputError
        If a shape is wrong or a normal does not have length 1.

    Examples
    --------
    >>> room = Container.polygon([(0, 0), (4, 0), (4, 3)])
    >>> room.normals.round(2).tolist()
    [[0.0, 1.0], [-1.0, 0.0], [0.6, -0.8]]
    >>> room.contains([[3.0, 1.0], [1.0, 1.0]]).tolist()
    [True, False]
    """

    points: Floats
    normals: Floats

    def __post_init__(self) -> None:
        points, normals = finite_array("points", self.points), finite_array("normals", self.normals)
        if points.ndim != 2 or points.shape[1] != 2 or points.shape != normals.shape or not len(points):
            raise InputError(
                f"points, normals: expected two arrays of shape (k, 2), got {points.shape}, {normals.shape}"
            )
        lengths = np.hypot(normals[:, 0], normals[:, 1])
        if np.any(np.abs(lengths - 1.0) > UNIT_TOLERANCE):
            raise InputError(f"normals: expected unit vectors, got lengths {lengths.tolist()}")
        object.__setattr__(self, "points", frozen(points))
        object.__setattr__(self, "normals", frozen(normals))

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

    @property
    def tangents(self) -> Floats:
        """The unit tangents (k, 2), to the right if the wall is seen below the disk."""
        return frozen(np.stack([self.normals[:, 1], -self.normals[:, 0]], axis=1))

    def distances(self, position: ArrayLike) -> Floats:
        """Return the signed distances (n, k) of points (n, 2) from the walls, negative outside."""
        positions = finite_array("position", position)
        if positions.ndim != 2 or positions.shape[1] != 2:
            raise InputError(f"position: expected shape (n, 2), got {positions.shape}")
        return np.asarray(np.einsum("nki,ki->nk", positions[:, None, :] - self.points, self.normals))

    def contains(self, position: ArrayLike) -> NDArray[np.bool_]:
        """Return whether each of the points (n, 2) is inside or on the boundary."""
        return np.asarray(np.all(self.distances(position) >= 0.0, axis=1))
