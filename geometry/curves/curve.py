"""The base class of Segment, Arc and Bezier: points, tangents, lengths, boxes, images, and tables of wall files."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import chain
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, finite_number, numbers, shortened
from ...core.errors import InputError, WallError
from ...core.rounding import EPS

# Of a coordinate; products of three lengths stay far below the largest double.
LARGEST_COORDINATE = 1e100
# Steps of a flattened curve.
MOST_STEPS = 1e7
# Rounding takes parameters at most this far beyond the ends.
BEYOND_ENDS = 1e-9
# Limit on steps for a root; every fourth is a bisection, of which 53 suffice.
ROOT_STEPS = 220
# Halvings after which an interval of parameters has the width of rounding.
HALVINGS = 56
# Parameters at which two curves are compared, and rounding of a closed formula.
INNER, ROUNDED = np.array([0.25, 0.5, 0.75]), 64.0 * EPS

Bools = NDArray[np.bool_]
Point = tuple[float, float]
Table = dict[str, Any]
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
    # the name in wall files, and the classes by their names
    kind: ClassVar[str] = ""
    kinds: ClassVar[dict[str, type[Curve]]] = {}
    is_straight: ClassVar[bool] = False
    # place of the compiled table among those of all curves that rays meet, and its columns; whether disks meet it
    table: ClassVar[int] = -1
    columns: ClassVar[int] = 0
    meets_disks: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        if "kind" in vars(cls):
            Curve.kinds[cls.kind] = cls

    @staticmethod
    @cache
    def traced() -> tuple[type[Curve], ...]:
        """Return the classes of the curves that rays meet, in the order of their tables; classes made later are not."""
        found = sorted((cls for cls in Curve.kinds.values() if cls.columns), key=lambda cls: cls.table)
        if [cls.table for cls in found] != list(range(len(found))):
            raise TypeError(f"expected tables 0, 1, ... of curves, got {[(cls.kind, cls.table) for cls in found]}")
        return tuple(found)

    @property
    def is_whole(self) -> bool:
        """Whether it is a closed curve without ends."""
        return False

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

    @staticmethod
    def steps(count: float) -> Floats:
        """Return parameters from 0 to 1 in at least ``count`` equal steps."""
        if not count <= MOST_STEPS:
            raise WallError(f"flattened: expected a tolerance for at most {MOST_STEPS:g} points, got {count:.3g}")
        return np.linspace(0.0, 1.0, max(1, math.ceil(count)) + 1)

    @abstractmethod
    def curvature(self, s: float) -> float:
        """Return the signed curvature at the parameter s, positive if the piece is focusing; inf where b' = 0."""

    @abstractmethod
    def largest_curvature(self) -> tuple[float, float]:
        """Return the largest absolute curvature and a bound on its error; (inf, 0) if b' vanishes somewhere."""

    def joined(self, after: Curve, tolerance: float) -> Curve | None:
        """Return the curve whose parts are this one and the next within ``tolerance``; None if none exists."""
        return None

    def cusp(self) -> float | None:
        """Return a parameter between the ends at which b' = 0; None if there is none."""
        return None

    def has_parts(self, before: Curve, after: Curve, fraction: float, tolerance: float) -> bool:
        """Whether two parts and their joint lie on the curve; the first one has this ``fraction`` of the parameters."""
        given = np.concatenate([before.point(INNER), [before.end], after.point(INNER)])
        found = self.point(np.concatenate([fraction * INNER, [fraction], fraction + (1.0 - fraction) * INNER]))
        return bool(np.abs(given - found).max() <= tolerance)

    @abstractmethod
    def to_table(self) -> Table:
        """Return the table of a wall file."""

    @classmethod
    @abstractmethod
    def from_table(cls, table: Table) -> Curve:
        """Return the piece of a table of a wall file."""

    @staticmethod
    def of_table(table: Table) -> Curve:
        """Return the piece of a table of any kind."""
        kind = table.get("kind")
        if isinstance(kind, str) and kind in Curve.kinds:
            return Curve.kinds[kind].from_table(table)
        check_keys(table, {"kind"}, set(table))
        *first, last = map(repr, sorted(Curve.kinds))
        raise InputError(f"key 'kind': expected {', '.join(first)} or {last}, got {kind!r}")

    # ---- for the tracer -----------------------------------------------------------------------------------------
    def row(self, ends: Mapping[int, float]) -> Floats:
        """Return the row of the compiled table of this kind from its first columns ``ends``; see `columns`."""
        raise NotImplementedError

    @staticmethod
    def heights(rows: Floats) -> Floats:
        """Return heights (n, k) of which the least and the largest bound each piece of these rows."""
        raise NotImplementedError

    @staticmethod
    def goes_in_waves(rows: Floats) -> bool:
        """Return whether `waves` has a loop for these rows."""
        return False

    def hull(self, start: Point, end: Point) -> list[Point]:
        """Return four points whose convex hull contains the piece between the joints ``start`` and ``end``."""
        x0, y0, x1, y1 = self.box
        return [(x0, y0), (x0, y1), (x1, y0), (x1, y1)]

    def cut(self) -> tuple[Curve, ...]:
        """Return the parts of which each has a row of its own."""
        return (self,)

    # ---- for containers: a disk whose centre moves freely -------------------------------------------------------
    @property
    @abstractmethod
    def signed_area(self) -> float:
        """Half of the integral of x dy - y dx along the curve."""

    @property
    def wall_row(self) -> Floats | None:
        """The row of the walls of a table, with the columns from `columns.WALL_KIND` on; None: `arrival` is asked."""
        return None

    def arrival(self, position: Floats, velocity: Floats, own: Bools, slack: float, front: bool = True) -> Floats:
        """Return the times (n,) at which moving points reach the curve from its left, inf where they do not.

        A point that is tangent to a curve flies on, except where the curve bends towards it: there it is reached.

        Parameters
        ----------
        own : array of bool, shape (n,)
            Whether the point begins on this curve.
        slack : float
            The length by which the curve is longer at both ends, and the depth up to which a point may be behind it.
        front : bool
            If False, arrivals from the right.
        """
        raise NotImplementedError

    @abstractmethod
    def touch(self, position: Floats) -> tuple[Floats, Floats, Floats]:
        """Return points (n, 2) that are on the curve up to rounding, moved onto it, with tangents and curvatures."""

    @abstractmethod
    def length_to(self, position: Floats) -> Floats:
        """Return the arc lengths (n,) from the start to points (n, 2) on the curve."""

    def point_at_length(self, length: Floats) -> Floats:
        """Return the points (n, 2) at these arc lengths (n,) from the start."""
        return self.point(length / self.length)

    def is_on(self, position: Floats, slack: float) -> Bools:
        """Return whether points (n, 2) are on the curve, up to ``slack``."""
        return np.asarray(np.hypot(*(self.touch(position)[0] - position).T) <= slack)

    @property
    def box(self) -> Box:
        """The bounding box (xmin, ymin, xmax, ymax) of the curve."""
        bounds = []
        for axis in (0, 1):
            values = [self.start[axis], self.end[axis], *self.turning_values(axis)]
            bounds.append((min(values), max(values)))
        (xmin, xmax), (ymin, ymax) = bounds
        return xmin, ymin, xmax, ymax


def point_array(points: Sequence[Point]) -> Floats:
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


def inverted(length_to: Callable[[Floats], Floats], length: Floats, most: float) -> Floats:
    """Return where in [0, ``most``] an increasing function takes these values (n,), to rounding."""
    low, high = np.zeros_like(length), np.full_like(length, most)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        short = length_to(middle) < length
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.asarray(0.5 * (low + high))


def cubic_roots(c: Floats, low: float, high: float) -> Floats:
    """Return the roots (n, 3) in [low, high] of cubics with the coefficients (4, n), nan where there are fewer."""
    # critical points, by the formula without cancellation
    half, ends = -c[2], np.array([low, high])
    with np.errstate(divide="ignore", invalid="ignore"):
        q = half + np.where(half >= 0.0, 1.0, -1.0) * np.sqrt(half * half - 3.0 * c[3] * c[1])
        critical = np.array([q / (3.0 * c[3]), c[1] / q])
    critical = np.where(np.isfinite(critical), np.clip(critical, low, high), high)
    knots = np.concatenate([np.full((1, c.shape[1]), ends[0]), np.sort(critical, axis=0),
                            np.full((1, c.shape[1]), ends[1])])  # fmt: skip

    def value(s: Floats) -> Floats:
        return np.asarray(c[0] + s * (c[1] + s * (c[2] + s * c[3])))

    left, right = knots[:-1], knots[1:]
    at_left, at_right = value(left), value(right)
    crossed = (at_left <= 0.0) != (at_right <= 0.0)
    s = 0.5 * (left + right)
    settled = ~crossed
    for step in range(ROOT_STEPS):
        at = value(s)
        same = (at <= 0.0) == (at_left <= 0.0)
        left, right = np.where(same, s, left), np.where(same, right, s)
        with np.errstate(divide="ignore", invalid="ignore"):
            change = at / (c[1] + s * (2.0 * c[2] + 3.0 * s * c[3]))
        settled |= (np.abs(change) <= EPS) | (right - left <= EPS)
        if np.all(settled):
            break
        newton, middle = s - change, 0.5 * (left + right)
        following = np.where((newton > left) & (newton < right), newton, middle) if step % 4 else middle
        s = np.where(settled, s, following)
    return np.asarray(np.where(crossed, s, np.nan).T)


def check_keys(table: Table, required: set[str], optional: set[str]) -> None:
    missing, unknown = sorted(required - set(table)), sorted(set(table) - required - optional)
    if missing:
        raise InputError(f"missing key {missing[0]!r}")
    if unknown:
        raise InputError(f"unknown key {unknown[0]!r}; expected {', '.join(sorted(required | optional))}")


def tables_of(name: str, value: Any) -> list[Table]:
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        raise InputError(f"key {name!r}: expected an array of tables ([[{name}]]), got {value!r}")
    return value


def points_of(name: str, value: Any) -> list[Point]:
    if not isinstance(value, list) or not value:
        raise InputError(f"key {name!r}: expected a list of points, got {value!r}")
    return [pair_of(f"{name}[{i}]", point) for i, point in enumerate(value)]


def pair_of(name: str, value: Any) -> Point:
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"key {name!r}: expected two numbers [a, b], got {value!r}")
    return number_of(name, value[0]), number_of(name, value[1])


def number_of(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"key {name!r}: expected a number, got {value!r}")
    try:
        return float(value)
    except OverflowError as reason:
        raise InputError(
            f"key {name!r}: expected a number below 1e308, got one of {len(str(value))} digits"
        ) from reason
