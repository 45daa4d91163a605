"""The points of a sweep: products and rows of parameter values, points that are put where a curve bends, and rows."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, product
from typing import Any, TypeAlias

import numpy as np

from ...core.checks import finite_number, number_between, positive_number, whole_number
from ...core.contents import content
from ...core.errors import InputError
from ...core.estimates import Estimate, Summary, finite, shown

Value: TypeAlias = float | int | str
Point: TypeAlias = dict[str, Value]
# Points that are asked for at a time by the adaptive sweep, whatever the number of workers: so the points are the same.
TOGETHER = 4
# Loss of `adaptive` below which no point is added.
RESOLUTION = 0.01
# The first quantity at a point that was computed.
Leading: TypeAlias = Callable[[Point], float]


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
        """Points as they stand in the grid, those of each curve ascending."""
        name = self.choosing
        if name is None:
            return list(points)
        curves = groupby(points, lambda point: key_of({**point, name: 0}))
        return [point for _, curve in curves for point in sorted(curve, key=lambda point: point[name])]

    @property
    def is_product(self) -> bool:
        """Whether every value of a parameter goes with all values of the others."""
        return not self.zipped and self.choosing is None

    @property
    def size(self) -> int:
        """The number of points, at most."""
        sizes = [values.points if isinstance(values, Between) else len(values) for values in self.axes.values()]
        return sizes[0] if self.zipped else math.prod(sizes)

    def some(self, number: int) -> list[Point]:
        """At most so many points, evenly spread, the first and the last among them; of a `Between` its ends."""
        known = {name: (one.low, one.high) if isinstance(one, Between) else one for name, one in self.axes.items()}
        points = list(self._points(known))
        return [points[k] for k in np.unique(np.linspace(0, len(points) - 1, number).astype(int))]

    def as_dict(self) -> dict[str, str]:
        """A line for each parameter that tells its values from others."""
        return {
            name: repr(one) if isinstance(one, Between) else f"{len(one)} from {one[0]} to {one[-1]} ({content(one)})"
            for name, one in self.axes.items()
        }

    def portions(self, leading: Leading) -> Iterator[list[Point]]:
        """The points, in portions that can be computed side by side.

        Chosen ones depend on the first quantity at all points before them.
        """
        choosing = self.choosing
        if choosing is None:
            yield list(self._points(self.axes))
            return
        axis = self.axes[choosing]
        assert isinstance(axis, Between)
        for fixed in self._points({**self.axes, choosing: (axis.low,)}):
            yield from _chosen(choosing, axis, fixed, leading)

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


def _chosen(name: str, axis: Between, fixed: Point, leading: Leading) -> Iterator[list[Point]]:
    """The points of one curve, a few at a time."""
    try:
        from adaptive import Learner1D
        from adaptive.learner.learner1D import curvature_loss_function
    except ImportError as reason:
        raise InputError("grid: Between needs adaptive; pip install 'asperity[studies]'") from reason
    learner = Learner1D(lambda _: 0.0, (axis.low, axis.high), loss_per_interval=curvature_loss_function())
    while learner.npoints < axis.points and learner.loss() > axis.resolution:
        asked, _ = learner.ask(TOGETHER if learner.npoints else 2)
        points: list[Point] = [{**fixed, name: float(x)} for x in asked]
        yield points
        learner.tell_many(asked, list(map(leading, points)))


COLUMNS = ("quantity", "value", "error", "kind", "verdict", "method", "seconds", "version", "message")
# What the quantities are measured in; all others are pure numbers.
UNITS = {"relaxation_time": "collisions"}


@dataclass(frozen=True, repr=False)
class SweepRow(Summary):
    """One quantity at one point.

    Attributes
    ----------
    point : mapping of str to number or text
        The parameters.
    quantity : str
    value, error : float or None
        None where the quantity was refused; an error that is not known is ``inf``.
    kind : {"bound", "estimate", ""}
    verdict : str
        On the gap behind the quantity; empty where there is none.
    method : str
    seconds : float
        Of the computation; for several numbers of one computation, of all.
    version : str
        Of asperity.
    message : str
        Why there is no value, or empty.
    """

    point: Mapping[str, Value]
    quantity: str
    value: float | None
    error: float | None
    kind: str
    verdict: str
    method: str
    seconds: float
    version: str
    message: str
    _show = "kind verdict message"

    def _headline(self) -> str:
        return f"{self.quantity} {self.in_words()}"

    def in_words(self) -> str:
        """The value with its error, and the point."""
        number = "refused" if self.value is None else self._fact("value")
        return f"{number} at {', '.join(map(shown, self.point.values()))}"

    def cells(self) -> list[Any]:
        """What is in the columns ``quantity`` to ``message``."""
        return [getattr(self, name) for name in COLUMNS]

    def as_list(self) -> list[Any]:
        """The point and the columns as plain JSON values; an infinite error is None beside a value."""
        return [
            list(self.point.values()),
            *(finite(cell) if isinstance(cell, float) else cell for cell in self.cells()),
        ]

    @staticmethod
    def of_list(names: Sequence[str], cells: Sequence[Any]) -> SweepRow:
        """The row that `as_list` gave."""
        values, quantity, value, error, *rest = cells
        known = math.inf if value is not None and error is None else error
        return SweepRow(dict(zip(names, values, strict=True)), quantity, value, known, *rest)

    def check(self, quantity: str) -> None:
        """Refuse what is not a row of this quantity.

        Raises
        ------
        ValueError
            InputErrors among them.
        """
        number_between("seconds", self.seconds, 0.0, math.inf, closed="low")
        texts = self.kind, self.verdict, self.method, self.version, self.message
        if self.quantity != quantity or not all(isinstance(text, str) for text in texts):
            raise ValueError(f"expected a row of {quantity!r}, got {self!r}")
        if self.value is not None:
            finite_number("value", self.value)
            if not isinstance(self.error, float):
                raise ValueError(f"error: expected a number, got {self.error!r}")
            Estimate(self.value, self.error, self.kind, self.method)  # type: ignore[arg-type]
        elif self.error is not None or not self.message:
            raise ValueError(f"expected a reason why {quantity!r} has no value")
