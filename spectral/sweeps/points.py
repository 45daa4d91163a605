"""The points of a sweep: products and rows of parameter values, and points that `adaptive` puts where a curve bends."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias

import numpy as np

from ...core.checks import finite_number, positive_number, whole_number
from ...core.errors import InputError

Value: TypeAlias = float | int | str
Point: TypeAlias = dict[str, Value]
# Points that are asked for at a time by the adaptive sweep, whatever the number of workers: so the points are the same.
TOGETHER = 4
# Loss of `adaptive` below which no point is added.
RESOLUTION = 0.01

# Yields points that can be computed side by side, and is sent the first quantity at each of them.
Plan: TypeAlias = Generator[list[Point], Sequence[float], None]


@dataclass(frozen=True)
class Between:
    """An interval of a parameter in which a sweep chooses its points: more of them where the curve bends.

    The package ``adaptive`` chooses, by the curvature of the first quantity.

    Parameters
    ----------
    low, high : float
    points : int
        At most so many, 2 at least; rounded up to a multiple of 4 after the two ends.
    resolution : float
        Enough once the largest loss is below this: about the root of the area of the triangle of three neighbouring
        points, in a picture of unit width and height.

    Examples
    --------
    >>> Between(0.2, 1.5, points=50)
    Between(low=0.2, high=1.5, points=50, resolution=0.01)
    """

    low: float
    high: float
    points: int = 50
    resolution: float = RESOLUTION

    def __post_init__(self) -> None:
        if finite_number("low", self.low) >= finite_number("high", self.high):
            raise InputError(f"high: expected a number greater than low = {self.low!r}, got {self.high!r}")
        whole_number("points", self.points, 2)
        positive_number("resolution", self.resolution)


@dataclass(frozen=True)
class Grid:
    """The parameters of a sweep and their values.

    Attributes
    ----------
    axes : mapping of str to tuple or Between
    zipped : bool
        Whether the k-th values of all parameters belong together; by default every value goes with every other.
    """

    axes: Mapping[str, tuple[Value, ...] | Between]
    zipped: bool

    @staticmethod
    def of(grid: Mapping[str, Any], zipped: bool) -> Grid:
        """The checked grid.

        Raises
        ------
        InputError
            If there is no parameter, a parameter has no value or one that is neither a number nor text, or the
            lengths of zipped parameters differ.
        """
        if not isinstance(grid, Mapping) or not grid:
            raise InputError(f"grid: expected values by parameter, as {{'half_angle': [0.2, 0.9]}}, got {grid!r}")
        axes = {str(name): _axis(str(name), values) for name, values in grid.items()}
        choosing = [name for name, values in axes.items() if isinstance(values, Between)]
        lengths = {name: len(values) for name, values in axes.items() if not isinstance(values, Between)}
        if len(choosing) > 1 or (choosing and zipped):
            raise InputError(f"grid: expected Between for one parameter of a product, got it for {choosing}")
        if zipped and len(set(lengths.values())) > 1:
            raise InputError(f"grid: expected as many values for all zipped parameters, got {lengths}")
        found = Grid(axes, zipped)
        rows = [axes] if zipped else [{name: values} for name, values in axes.items() if name not in choosing]
        for each in rows:
            keys = [key_of(point) for point in found._points(each)]
            if len(set(keys)) < len(keys):
                raise InputError(f"grid: expected different values of {' and '.join(each)}, got {keys}")
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters."""
        return tuple(self.axes)

    @property
    def choosing(self) -> str | None:
        """The parameter in which points are chosen."""
        return next((name for name, values in self.axes.items() if isinstance(values, Between)), None)

    def in_order(self, points: Sequence[Point]) -> list[Point]:
        """Points as they stand in the grid, chosen ones ascending."""
        name = self.choosing
        if name is None:
            return list(points)
        order = {key: number for number, key in enumerate(dict.fromkeys(_others(point, name) for point in points))}
        return sorted(points, key=lambda point: (order[_others(point, name)], point[name]))

    @property
    def is_product(self) -> bool:
        """Whether every value of a parameter goes with all values of the others."""
        return not self.zipped and self.choosing is None

    @property
    def size(self) -> int:
        """The number of points, at most."""
        sizes = [values.points if isinstance(values, Between) else len(values) for values in self.axes.values()]
        return sizes[0] if self.zipped else int(np.prod(sizes, dtype=object))

    @property
    def ends(self) -> tuple[Point, Point]:
        """The first and the last point."""
        first, last = (
            {
                name: (values.low, values.high)[end] if isinstance(values, Between) else values[-end]
                for name, values in self.axes.items()
            }
            for end in (0, 1)
        )
        return first, last

    def some(self, number: int) -> list[Point]:
        """At most so many points, evenly spread, the first and the last among them; the ends of a `Between`."""
        if self.choosing is not None:
            return list(self.ends)
        points = list(self._points(self.axes))
        picked = np.unique(np.linspace(0, len(points) - 1, min(number, max(len(points), 2))).astype(int))
        chosen = [points[k] for k in picked]
        return chosen if len(chosen) > 1 else chosen * 2

    def as_dict(self) -> dict[str, str]:
        """A line for each parameter that tells its values from others."""
        return {name: _in_words(values) for name, values in self.axes.items()}

    def plan(self) -> Plan:
        """The points, in one portion or as they are chosen."""
        choosing = self.choosing
        if choosing is None:
            yield list(self._points(self.axes))
            return
        axis = self.axes[choosing]
        assert isinstance(axis, Between)
        others = {name: values for name, values in self.axes.items() if name != choosing}
        for fixed in self._points(others):
            yield from _chosen(choosing, axis, {name: fixed.get(name, 0.0) for name in self.axes})

    def _points(self, axes: Mapping[str, Any]) -> Iterable[Point]:
        together = zip(*axes.values(), strict=True) if self.zipped else product(*axes.values())
        return (dict(zip(axes, values, strict=True)) for values in together)


def key_of(point: Point) -> str:
    """A point as text, in which numbers have all their digits.

    Examples
    --------
    >>> key_of({"angle": 0.1, "wall": "koch"})
    '[0.1,"koch"]'
    """
    return json.dumps(list(point.values()), separators=(",", ":"))


def _others(point: Point, name: str) -> str:
    return key_of({key: value for key, value in point.items() if key != name})


def _axis(name: str, values: Any) -> tuple[Value, ...] | Between:
    if isinstance(values, Between):
        return values
    listed = [values] if isinstance(values, (str, int, float)) else list(values)
    # numpy's scalars as Python's
    plain = [value.item() if isinstance(value, np.generic) else value for value in listed]
    bad = [value for value in plain if not isinstance(value, (str, int, float)) or value != value]
    if bad or not plain:
        raise InputError(f"grid, {name}: expected numbers or texts, at least one, got {bad[0] if bad else plain!r}")
    return tuple(plain)


def _in_words(values: tuple[Value, ...] | Between) -> str:
    if isinstance(values, Between):
        return repr(values)
    digest = hashlib.sha256(json.dumps(values).encode()).hexdigest()[:12]
    return f"{len(values)} from {values[0]} to {values[-1]} ({digest})"


def _chosen(name: str, axis: Between, fixed: Point) -> Plan:
    """The points of one curve, a few at a time: each portion depends on the values at all points before it."""
    try:
        from adaptive import Learner1D
        from adaptive.learner.learner1D import curvature_loss_function
    except ImportError as reason:
        raise InputError("grid: Between needs adaptive; pip install 'asperity[studies]'") from reason
    learner = Learner1D(lambda _: 0.0, (axis.low, axis.high), loss_per_interval=curvature_loss_function())
    while learner.npoints < axis.points and learner.loss() > axis.resolution:
        asked, _ = learner.ask(TOGETHER if learner.npoints else 2)
        values = yield [{**fixed, name: float(x)} for x in asked]
        learner.tell_many(asked, list(values))
