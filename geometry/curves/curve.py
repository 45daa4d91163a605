"""The base class of Segment, Arc and Bezier: points, tangents, lengths, boxes and images."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from itertools import chain
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, finite_number, numbers, shortened
from ...core.errors import InputError, WallError

# Of a coordinate; products of three lengths stay far below the largest double.
LARGEST_COORDINATE = 1e100
# Steps of a flattened curve.
MOST_STEPS = 1e7
# Rounding takes parameters at most this far beyond the ends.
BEYOND_ENDS = 1e-9

Point = tuple[float, float]
Box = tuple[float, float, float, float]


class Curve(ABC):
    """A smooth directed curve in the plane, parametrised over [0, 1]; immutable.

    The free side of a wall is on the left of the direction of travel.

    Attributes
    ----------
    start, end : (float, float)
        The end points, exactly equal to ``point(0.0)`` and ``point(1.0)``.
    rounding : float
        Bound on the rounding error of ``start`` and ``end`` if they were computed; 0.0 if they were given.
    """

    start: Point
    end: Point
    rounding: float

    @abstractmethod
    def point(self, s: ArrayLike) -> Floats:
        """Return the points at the parameters ``s`` in [0, 1], shape ``s.shape + (2,)``."""

    @abstractmethod
    def tangent(self, s: ArrayLike) -> Floats:
        """Return the unit tangents at the parameters ``s`` in [0, 1], shape ``s.shape + (2,)``."""

    @property
    @abstractmethod
    def length(self) -> float:
        """The arc length."""

    @abstractmethod
    def turning_points(self, axis: int) -> list[float]:
        """Return the parameters in (0, 1) where coordinate ``axis`` has zero derivative, ascending."""

    def turning_values(self, axis: int) -> list[float]:
        """Return coordinate ``axis`` at its turning points."""
        turns = self.turning_points(axis)
        return [float(v) for v in self.point(turns)[:, axis]] if turns else []

    @abstractmethod
    def reversed(self) -> Self:
        """Return the same curve in the opposite direction."""

    @abstractmethod
    def stretched(self, x_factor: float, y_factor: float) -> Self:
        """Return the image under (x, y) -> (x_factor x, y_factor y); negative factors reflect, 0 raises WallError."""

    @abstractmethod
    def moved(self, dx: float, dy: float) -> Self:
        """Return the curve shifted by (dx, dy)."""

    @abstractmethod
    def pinned(self, start: Point, end: Point) -> Self:
        """Return the curve with its end points set to nearby points that are known exactly."""

    @abstractmethod
    def split(self, s: float) -> tuple[Self, Self]:
        """Return the parts before and after the parameter ``s`` in (0, 1)."""

    @abstractmethod
    def flattened(self, tolerance: float) -> Floats:
        """Return points on the curve, shape (n, 2), both ends included, whose polyline is within ``tolerance``."""

    @property
    def box(self) -> Box:
        """The bounding box (xmin, ymin, xmax, ymax) of the curve."""
        bounds = []
        for axis in (0, 1):
            values = [self.start[axis], self.end[axis], *self.turning_values(axis)]
            bounds.append((min(values), max(values)))
        (xmin, xmax), (ymin, ymax) = bounds
        return xmin, ymin, xmax, ymax


def point_array(points: Iterable[Point]) -> Floats:
    """Return points as an array of shape (n, 2), twice as fast as numpy does."""
    return np.fromiter(chain.from_iterable(points), np.float64).reshape(-1, 2)


def as_point(name: str, value: Any) -> Point:
    """Return ``value`` as a pair of floats of at most 1e100, or raise a WallError that begins with ``name``."""
    try:
        x, y = value if isinstance(value, tuple) else numbers(name, value)
        point = as_float(name, x), as_float(name, y)
    except (TypeError, ValueError, OverflowError) as reason:
        raise WallError(f"{name}: expected a point (x, y), got {shortened(value)}") from reason
    if not (abs(point[0]) <= LARGEST_COORDINATE and abs(point[1]) <= LARGEST_COORDINATE):
        raise WallError(f"{name}: expected finite coordinates of at most {LARGEST_COORDINATE:g}, got {point}")
    return point


def as_float(name: str, value: Any) -> float:
    """Return a coordinate as a float."""
    return float(value) if isinstance(value, (float, int)) else finite_number(name, value)


def stretch_factors(x_factor: float, y_factor: float) -> tuple[float, float]:
    """Return both factors as floats; raise WallError unless both are finite and other than 0."""
    factors = as_point("stretched", (x_factor, y_factor))
    if 0.0 in factors:
        raise WallError(f"stretched: expected two finite factors other than 0, got {factors}")
    return factors


def parameters(s: ArrayLike) -> Floats:
    """Return parameters of a curve as an array; raise InputError unless they are in [0, 1], up to rounding."""
    array = finite_array("s", s)
    if array.size and not -BEYOND_ENDS <= array.min() <= array.max() <= 1.0 + BEYOND_ENDS:
        raise InputError(f"s: expected numbers in [0, 1], got {shortened(s)}")
    return array


def uniform_parameters(steps: float) -> Floats:
    """Return parameters from 0 to 1 in at least ``steps`` equal steps."""
    if not steps <= MOST_STEPS:
        raise WallError(f"flattened: expected a tolerance for at most {MOST_STEPS:g} points, got {steps:.3g}")
    return np.linspace(0.0, 1.0, max(1, math.ceil(steps)) + 1)
