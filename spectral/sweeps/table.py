"""The long table of a sweep: a row for each point and quantity, its forms in other libraries and files, its curves.

The largest or smallest value along a sweep is refined between its points.
"""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import whole_number
from ...core.errors import FileExistsRefusal, InputError
from ...core.estimates import Estimate, Summary
from ...core.files import write_whole
from ...core.long_runs import reported
from ...core.rounding import EPS
from ...core.tables import axes_or_new, data_frame, needed, verbatim
from ...geometry import WALLS
from .points import COLUMNS, UNITS, Point, SweepRow, key_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame
    from xarray import Dataset


FORMAT = 1
FILES = ("table.csv", "table.json")


@dataclass(frozen=True, repr=False)
class SweepTable(Summary):
    """What a sweep found.

    Attributes
    ----------
    parameters : tuple of str
    rows : tuple of SweepRow
        By points in the order of the grid, then by quantities.
    zipped : bool
        Whether the points are no product of values.
    solve : callable or None
        Computes the rows of further points; None for a table that was read.
    family : str
        The name of the walls or laws, for the axis of pictures; empty of a function without name.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> table = spec.sweep(ker.maxwell, {"diffuse_fraction": [0.25, 0.5]}, ["gap", "eta"])
    >>> [(row.point["diffuse_fraction"], row.quantity, round(row.value, 12)) for row in table.rows]
    [(0.25, 'gap', 0.25), (0.25, 'eta', 7.0), (0.5, 'gap', 0.5), (0.5, 'eta', 3.0)]
    """

    parameters: tuple[str, ...]
    rows: tuple[SweepRow, ...]
    zipped: bool = False
    solve: Callable[[Point], Sequence[SweepRow]] | None = field(default=None, repr=False, compare=False)
    family: str = field(default="", repr=False)
    _more = ".rows, .of(quantity), .to_frame(), .plot(), .extremum()"

    def _headline(self) -> str:
        return f"over {', '.join(self.parameters)}"

    def _facts(self) -> dict[str, object]:
        """The points, least and greatest value of each quantity, and why rows were refused."""
        facts: dict[str, object] = {"points": len(self.of(self.quantities[0])) if self.rows else 0}
        for name in self.quantities:
            known = sorted((row for row in self.of(name) if row.value is not None), key=lambda row: row.value or 0.0)
            facts[name] = " to ".join(dict.fromkeys(row.in_words() for row in (known[:1] + known[-1:])))
        return {**facts, "refused": self.refusals()}

    def refusals(self) -> str | None:
        """How many rows have no value, and why the first of them, or None."""
        refused = [row.message for row in self.rows if row.value is None]
        return f"{len(refused)} of {len(self.rows)}: {refused[0]}" if refused else None

    @property
    def quantities(self) -> tuple[str, ...]:
        """The names of the quantities."""
        return tuple(dict.fromkeys(row.quantity for row in self.rows))

    def of(self, quantity: str) -> tuple[SweepRow, ...]:
        """The rows of one quantity.

        Raises
        ------
        InputError
            If the table has no such quantity.
        """
        found = tuple(row for row in self.rows if row.quantity == quantity)
        if not found:
            raise InputError(f"quantity: expected one of {', '.join(self.quantities)}, got {quantity!r}")
        return found

    def to_frame(self) -> DataFrame:
        """A pandas frame with a column for each parameter and the columns of the rows; refused values are NaN.

        Raises
        ------
        InputError
            If pandas is not installed.
        """
        rows = [[*row.point.values(), *row.cells()] for row in self.rows]
        names = [*self.parameters, *COLUMNS]
        frame: DataFrame = data_frame({name: [row[k] for row in rows] for k, name in enumerate(names)})
        return frame.astype({"value": "float64", "error": "float64", "seconds": "float64"})

    def to_xarray(self) -> Dataset:
        """An xarray data set with the variables ``Q``, ``Q_error`` and ``Q_verdict`` of each quantity Q.

        Its dimensions are the parameters, or ``point`` where the points are no product. Every variable has its unit
        and its method in its attributes.

        Raises
        ------
        InputError
            If xarray is not installed.
        """
        xarray = needed("xarray", "to_xarray")
        frame = self.to_frame()
        if self.zipped:
            numbers = {key_of(dict(row.point)): number for number, row in enumerate(self.of(self.quantities[0]))}
            frame["point"] = [numbers[key_of(dict(row.point))] for row in self.rows]
        dimensions = ["point"] if self.zipped else list(self.parameters)
        found: Dataset = xarray.Dataset()
        for quantity in self.quantities:
            own = frame[frame["quantity"] == quantity].set_index(dimensions)
            for suffix, column in (("", "value"), ("_error", "error"), ("_verdict", "verdict")):
                variable = own[column].to_xarray()
                variable.attrs = {"long_name": f"{quantity.replace('_', ' ')}{suffix.replace('_', ', ')}"}
                if column != "verdict":
                    variable.attrs["units"] = UNITS.get(quantity, "1")
                found[f"{quantity}{suffix}"] = variable
            if self.zipped:
                found = found.assign_coords({name: ("point", own[name].to_numpy()) for name in self.parameters})
        return found

    def to_csv(self) -> str:
        """The table as CSV: numbers with all their digits, refused values empty."""
        rows = [(*row.point.values(), *row.cells()) for row in self.rows]
        return csv_text([*self.parameters, *COLUMNS], rows)

    def to_json(self) -> str:
        """The table as JSON, which `of_json` reads."""
        data = {
            "format": FORMAT, "family": self.family, "parameters": self.parameters, "zipped": self.zipped,
            "columns": ["point", *COLUMNS], "rows": [row.as_list() for row in self.rows],
        }  # fmt: skip
        return json.dumps(data, indent=1, allow_nan=False)

    @staticmethod
    def of_json(text: str) -> SweepTable:
        """The table that `to_json` gave.

        Raises
        ------
        InputError
            If the text is something else.
        """
        try:
            data = json.loads(text)
            if data["format"] != FORMAT or data["columns"] != ["point", *COLUMNS]:
                raise InputError(f"JSON: expected a table of format {FORMAT}, got {data['format']}")
            rows = tuple(SweepRow.of_list(data["parameters"], cells) for cells in data["rows"])
            family = str(data.get("family", ""))
            return SweepTable(tuple(data["parameters"]), rows, bool(data["zipped"]), family=family)
        except (ValueError, KeyError, TypeError, RecursionError) as reason:
            raise InputError(f"JSON: expected what SweepTable.to_json() gives: {reason}") from reason

    def to_parquet(self, path: str | Path) -> None:
        """Write the frame into a Parquet file, in place of an earlier one.

        Raises
        ------
        InputError
            If pandas or pyarrow is not installed, or the file cannot be written.
        """
        frame = self.to_frame()
        # pandas loads it by its name
        needed("pyarrow", "to_parquet")
        write_whole(Path(path), lambda stream: frame.to_parquet(stream, engine="pyarrow", index=False), overwrite=True)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> list[Path]:
        """Write ``table.csv`` and ``table.json``; returns their paths.

        Raises
        ------
        FileExistsRefusal
            If one of them exists and ``overwrite`` is False; nothing is written then.
        InputError
            If they cannot be written.
        """
        target = Path(folder)
        existing = [name for name in FILES if os.path.exists(target / name)]
        if existing and not overwrite:
            raise FileExistsRefusal(f"{target}: {', '.join(existing)} exist; pass overwrite=True to replace them")
        try:
            target.mkdir(parents=True, exist_ok=True)
        except OSError as reason:
            raise InputError(f"{target}: cannot write there ({reason}); choose another folder") from reason
        texts = dict(zip(FILES, (self.to_csv(), self.to_json() + "\n"), strict=True))
        for name, text in texts.items():
            write_whole(target / name, text, overwrite=overwrite)
        return [target / name for name in FILES]

    def plot(self, quantity: str | None = None, ax: Axes | None = None) -> Axes:
        """Draw a quantity, by default the first, against the first parameter that is a number.

        The error is a band, the verdict a marker, and where there is no gap the ground is shaded. Each combination of
        the other parameters is a curve.
        """
        name = self.quantities[0] if quantity is None else quantity
        return draw_curves(self.of(name), self.parameters, name, self.family, ax)

    def extremum(self, quantity: str | None = None, *, largest: bool = True, evaluations: int = 40) -> Extremum:
        """The largest or smallest value, by default of the first quantity, refined between the points of the sweep.

        See `Extremum` for what it says and what it presumes.

        Raises
        ------
        InputError
            If the table has several parameters, or one that is no number; if it was read from a file, so that nothing
            more can be computed; if no point has a value.
        """
        name = self.quantities[0] if quantity is None else quantity
        return refined_extremum(self.of(name), self.parameters, self.solve, largest, evaluations)


def csv_text(names: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table as CSV: numbers with all their digits, None as nothing."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    for row in rows:
        writer.writerow([repr(float(cell)) if isinstance(cell, float) else cell for cell in row])
    return text.getvalue()


# The best point is sought to this fraction of the interval between its neighbours, with half of the evaluations.
CLOSE, SEARCH_SHARE = 1e-4, 0.5
# An end of the interval of the parameter is known well enough when it is known to this fraction of its distance.
SHARP = 0.1
# What a parabola rises above the best point is doubled: the quantity is none.
SAFETY = 2.0


@dataclass(frozen=True, repr=False)
class Extremum(Summary):
    """The largest or smallest value of a quantity in the interval that a sweep covers.

    Attributes
    ----------
    parameter : Estimate
        Where it is: the middle of the interval in which it can lie, with its half width.
    value : Estimate
        The value at the best point that was computed. Its error is that of this point and of the ends of the interval,
        plus twice what the parabola through the three rises above it.
    largest : bool
    at_end : bool
        Whether it lies at an end of the sweep, beyond which it may go on.
    evaluations : int
        Points that were computed besides those of the sweep.
    names : tuple of two str
        Of the quantity and of the parameter.

    Notes
    -----
    The points of the sweep must be so dense that the extremum is beside the best of them, and that the quantity has
    no other extremum there. Then a point whose value is worse than the best one by more than both errors lies on one
    side of the extremum, and the two nearest such points are the ends of the interval. It cannot become arbitrarily
    short: near an extremum values are equal within their errors. The best point is sought by Brent's method.
    """

    parameter: Estimate
    value: Estimate
    largest: bool
    at_end: bool
    evaluations: int
    names: tuple[str, str] = ("", "")
    _show = "at_end evaluations"
    _more = ".value, .parameter"

    def _headline(self) -> str:
        quantity, parameter = self.names
        return f"{'largest' if self.largest else 'smallest'} {quantity} {self.value} at {parameter} = {self.parameter}"


@dataclass(frozen=True)
class _Value:
    """A value with the sign that makes the extremum a maximum, its error, and where it is."""

    x: float
    value: float
    error: float
    method: str

    def is_below(self, other: _Value) -> bool:
        """Whether it is surely less."""
        return self.value + self.error < other.value - other.error


def refined_extremum(
    rows: Sequence[SweepRow],
    parameters: Sequence[str],
    solve: Callable[[Point], Sequence[SweepRow]] | None,
    largest: bool,
    evaluations: int,
) -> Extremum:
    """See `SweepTable.extremum`."""
    whole_number("evaluations", evaluations, 0)
    if solve is None:
        raise InputError("extremum: this table was read, so that no point can be computed; call sweep again")
    if len(parameters) != 1 or any(isinstance(row.point[parameters[0]], str) for row in rows):
        raise InputError(f"extremum: expected one parameter that is a number, got {', '.join(parameters)}")
    (name,), quantity, sign = parameters, rows[0].quantity, 1.0 if largest else -1.0

    def signed(row: SweepRow) -> _Value | None:
        if row.value is None or row.error is None:
            return None
        return _Value(float(row.point[name]), sign * row.value, row.error, row.method)

    def computed(x: float) -> _Value:
        row = next(row for row in solve({name: x}) if row.quantity == quantity)
        found = signed(row)
        if found is None:
            raise InputError(f"extremum: {quantity} was refused at {name} = {x!r}: {row.message}")
        return found

    swept = sorted(filter(None, map(signed, rows)), key=lambda one: one.x)
    if not swept:
        raise InputError(f"extremum: no point of the sweep has a value of {quantity}")
    with reported(f"extremum of {quantity}"):
        return replace(_Search(swept, computed).extremum(evaluations, sign), names=(quantity, name))


class _Search:
    """The points beside the best one of a sweep, to which others are added."""

    def __init__(self, swept: Sequence[_Value], computed: Callable[[float], _Value]) -> None:
        top = max(range(len(swept)), key=lambda k: swept[k].value)
        self.low, self.high = swept[0].x, swept[-1].x
        self.points = list(swept[max(top - 1, 0) : top + 2])
        self.computed, self.made = computed, 0

    @property
    def best(self) -> _Value:
        """The greatest value."""
        return max(self.points, key=lambda one: one.value)

    def value_at(self, x: float) -> float:
        """Minus the value at a further point, which is stored."""
        self.points.append(self.computed(float(x)))
        self.made += 1
        return -self.points[-1].value

    def side(self, direction: int) -> tuple[_Value, _Value]:
        """On one side of the best point the nearest value that is surely less, and its neighbour on the way there.

        Where there is none, the outermost point twice.
        """
        best, nearer = self.best, self.best
        for one in sorted(self.points, key=lambda one: direction * one.x):
            if direction * (one.x - best.x) > 0.0:
                if one.is_below(best):
                    return one, nearer
                nearer = one
        return nearer, nearer

    def sharpen(self, direction: int, evaluations: int) -> None:
        """Halve the distance in which values become surely less than the best one."""
        for _ in range(evaluations):
            end, nearer = self.side(direction)
            if abs(end.x - nearer.x) <= SHARP * abs(end.x - self.best.x):
                return
            self.value_at(0.5 * (end.x + nearer.x))

    def extremum(self, evaluations: int, sign: float) -> Extremum:
        """Search, and say what was found."""
        from scipy.optimize import minimize_scalar

        ends = min(one.x for one in self.points), max(one.x for one in self.points)
        search = int(SEARCH_SHARE * evaluations)
        if search and ends[0] < ends[1]:
            close = CLOSE * (ends[1] - ends[0])
            minimize_scalar(self.value_at, bounds=ends, method="bounded", options={"maxiter": search, "xatol": close})
            for direction in (-1, 1):
                self.sharpen(direction, (evaluations - self.made) // 2 if direction < 0 else evaluations - self.made)
        (left, _), best, (right, _) = self.side(-1), self.best, self.side(1)
        rise = _rise(left, best, right)
        error = best.error + max(left.error, right.error) + SAFETY * rise
        value = Estimate(sign * best.value, error, "estimate", f"best of {self.made} points beside it; {best.method}")
        middle = 0.5 * (left.x + right.x)
        half = 0.5 * (right.x - left.x) + EPS * abs(middle)
        parameter = Estimate(middle, half, "estimate", "between values that are surely less extreme")
        return Extremum(parameter, value, sign > 0.0, best.x in (self.low, self.high), self.made)


def _rise(left: _Value, best: _Value, right: _Value) -> float:
    """How far the parabola through three points rises above the middle one."""
    if not left.x < best.x < right.x:
        return 0.0
    first = (best.value - left.value) / (best.x - left.x)
    second = (right.value - best.value) / (right.x - best.x)
    curvature = (second - first) / (right.x - left.x)
    slope = first + curvature * (best.x - left.x)
    return 0.25 * slope * slope / -curvature if curvature < 0.0 else 0.0


MARKERS = {"isolated": "o", "essential edge": "s", "no gap": "x", "undecided": "^", "": "."}
NO_GAP = "0.9"
# Units of the parameters of named walls; the others are pure numbers.
UNITS_OF_PARAMETERS = {"angle": "rad", "half_angle": "rad", "curvature": "1 / period"}


def draw_curves(
    rows: Sequence[SweepRow], parameters: Sequence[str], quantity: str, family: str, ax: Axes | None = None
) -> Axes:
    """Draw the rows of one quantity against the first parameter that is a number, which is named with its family.

    Raises
    ------
    InputError
        If no parameter is a number.
    """
    numeric = [name for name in parameters if all(isinstance(row.point[name], (int, float)) for row in rows)]
    if not numeric:
        raise InputError(f"plot: expected a parameter that is a number, got {', '.join(parameters)}")
    ax = axes_or_new(ax)
    name = numeric[0]
    curves: dict[str, list[SweepRow]] = {}
    for row in sorted(rows, key=lambda row: float(row.point[name])):
        label = verbatim(", ".join(f"{key} = {value}" for key, value in row.point.items() if key != name))
        curves.setdefault(label, []).append(row)
    for number, (label, curve) in enumerate(curves.items()):
        _draw_curve(ax, curve, name, f"C{number}", label)
    verdicts = dict.fromkeys(row.verdict for row in rows if row.verdict and row.value is not None)
    for verdict in verdicts:
        ax.plot([], [], MARKERS[verdict], color="0.3", linestyle="none", label=verdict)
    for low, high in gapless(next(iter(curves.values())), name) if len(curves) == 1 else []:
        ax.axvspan(low, high, color=NO_GAP, zorder=0)
    is_named = family.partition(":")[0].replace("_", "-") in WALLS
    ax.set_xlabel(_label(name, UNITS_OF_PARAMETERS.get(name) if is_named else None, f" of {family}" if family else ""))
    ax.set_ylabel(_label(quantity, UNITS.get(quantity)))
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False)
    return ax


def _label(name: str, unit: str | None, owner: str = "") -> str:
    return verbatim(name.replace("_", " ") + owner + (f" ({unit})" if unit else ""))


def _draw_curve(ax: Axes, curve: Sequence[SweepRow], name: str, colour: str, label: str) -> None:
    """One line with its band, broken where points were refused, and a marker by verdict at each point."""
    x = np.array([float(row.point[name]) for row in curve])
    value = np.array([np.nan if row.value is None else row.value for row in curve])
    error = np.array([np.nan if row.error is None else row.error for row in curve])
    ax.plot(x, value, color=colour, linewidth=1.0, label=label or None)
    known = np.where(np.isfinite(error), error, np.nan)
    ax.fill_between(x, value - known, value + known, color=colour, alpha=0.3, linewidth=0.0)
    for verdict, marker in MARKERS.items():
        own = np.array([row.verdict == verdict for row in curve])
        if own.any():
            ax.plot(x[own], value[own], marker, color=colour, markersize=4.5, linestyle="none")


def gapless(curve: Sequence[SweepRow], name: str) -> list[tuple[float, float]]:
    """The intervals between neighbouring points of a sorted curve that both have no gap."""
    found: list[tuple[float, float]] = []
    for first, second in pairwise(curve):
        if first.verdict == second.verdict == "no gap":
            low, high = float(first.point[name]), float(second.point[name])
            if found and found[-1][1] == low:
                found[-1] = (found[-1][0], high)
            else:
                found.append((low, high))
    return found
