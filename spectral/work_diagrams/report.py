"""A report on error against run time: its rows, its Markdown table and its plot."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import sqrt
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from ...core.checks import choice
from ...core.errors import InputError
from ...core.estimates import Summary
from ...core.tables import axes_or_new, data_frame, table, verbatim
from .problem import ROUNDED, FittedOrder, Machine, WorkMethod, WorkProblem, fit_order

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RowStatus = Literal["done", "failed", "timed out", "left out"]
FORMAT = 2
# Errors below this multiple of the error of the reference are not significant.
ABOVE_REFERENCE = 3.0
MARKERS = "osv^D<>Ph*X"
# Least ratio of the ends of an axis, so that at least one power of ten is labelled.
DECADE = 10.0


@dataclass(frozen=True, repr=False)
class WorkRow(Summary):
    """One row of a report on error against run time.

    Attributes
    ----------
    method : str
    budget : float
    status : {"done", "failed", "timed out", "left out"}
        ``"left out"`` if a smaller budget reached the time limit.
    error : float or None
        Norm of the error; for a random method the root mean square over the repeats.
    seconds : tuple of float
        Wall time of every repeat.
    reported : float or None
        The error reported by the method, if any; for a random method the root mean square over the repeats.
    note : str
        The method's description of the computation, or the reason for a missing value.

    Examples
    --------
    >>> row = WorkRow("midpoint", 8, "done", 1e-3, (0.2, 0.1, 0.4))
    >>> row.least, round(row.spread, 12)
    (0.1, 3.0)
    """

    method: str
    budget: float
    status: RowStatus
    error: float | None = None
    seconds: tuple[float, ...] = ()
    reported: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        choice("status", self.status, get_args(RowStatus))
        self._set(budget=float(self.budget), seconds=tuple(map(float, self.seconds)))

    @property
    def is_done(self) -> bool:
        """Whether the row has a value."""
        return self.status == "done"

    @property
    def least(self) -> float:
        """Least time of the repeats in seconds; infinite without repeats."""
        return min(self.seconds, default=float("inf"))

    @property
    def spread(self) -> float:
        """Range of the times of the repeats as a fraction of the least time."""
        return (max(self.seconds) - self.least) / self.least if self.seconds else 0.0


def table_of(report: WorkReport) -> str:
    """The Markdown table of a report, see `WorkReport.table`."""
    front = set(map(id, report.front()))
    heads = "method | budget | error | reported | seconds | spread | "
    lines = [table(heads, (_cells(report, row, id(row) in front) for row in report.rows)), ""]
    for name, record in report.methods.items():
        words = f"- {name}: against {record.reference} (known to {record.floor:.1e})"
        fitted = report.order(name)
        if fitted is not None:
            words += f"; fitted order {fitted}"
        if record.declared_order is not None:
            words += f", declared {record.declared_order:g}"
            if fitted is not None:
                words += f": {fitted.verdict(record.declared_order)}"
        lines.append(words)
    choice = report.choice()
    if choice is not None:
        lines.append(f"- {report.auto} takes {choice:.2g} times as long as the best other method at equal error")
    lines.append(f"- {report.machine}")
    return "\n".join(lines)


def _cells(report: WorkReport, row: WorkRow, in_front: bool) -> list[str]:
    name = f"**{row.method}**" if row.method == report.auto else row.method
    if not row.is_done:
        return [name, f"{row.budget:g}", *["-"] * 4, f"{row.status}: {row.note}"]
    error = report.methods[row.method].in_words(row.error or 0.0)
    reported = "-" if row.reported is None else f"{row.reported:.1e}"
    marks = [mark for mark, holds in (("front", in_front), (row.note, bool(row.note))) if holds]
    return [name, f"{row.budget:g}", error, reported, f"{row.least:.2g}", f"{row.spread:.0%}", ", ".join(marks)]


@dataclass(frozen=True)
class MethodFacts:
    """Properties of a method in a report.

    Attributes
    ----------
    declared_order : float or None
    is_random : bool
    reference : str
        Source of the reference of the method.
    floor : float
        Error of this reference, or rounding; smaller errors are not significant.
    """

    declared_order: float | None
    is_random: bool
    reference: str
    floor: float

    def in_words(self, error: float) -> str:
        """An error, or a bound of it where the reference is not known so well."""
        return f"{error:.1e}" if error > self.floor else f"< {self.floor:.1e}"


@dataclass(frozen=True, repr=False)
class WorkReport(Summary):
    """Errors and run times measured by `work_precision`.

    Attributes
    ----------
    problem : str
    auto : str
        Name of the method by which the library chooses a method itself.
    methods : mapping of str to MethodFacts
    machine : Machine
    rows : tuple of WorkRow

    Examples
    --------
    >>> from asperity import spectral as spec
    >>> problem = spec.WorkProblem("one third", spec.ReferenceValue(1 / 3, 0.0, "by hand"))
    >>> decimals = spec.WorkMethod("decimals", lambda n: round(1 / 3, n))
    >>> report = spec.work_precision(problem, [decimals], [1, 2, 3], repeats=1)
    >>> [f"{row.error:.1e}" for row in report.rows]
    ['3.3e-02', '3.3e-03', '3.3e-04']
    """

    problem: str
    auto: str
    methods: Mapping[str, MethodFacts]
    machine: Machine
    rows: tuple[WorkRow, ...] = ()
    _more = ".table(), .rows, .front(), .choice(), .order(method), .plot(), .machine"

    def _headline(self) -> str:
        return self.problem

    def _facts(self) -> dict[str, str]:
        """Of each method on the front the least error there, with the time that it took."""
        return {row.method: f"error {row.error:.1e} in {row.least:.2g} s" for row in self.front()}

    @classmethod
    def of(cls, problem: WorkProblem, methods: Sequence[WorkMethod], machine: Machine) -> WorkReport:
        """A report without rows."""
        records = {}
        for method in methods:
            reference = problem.reference_for(method.name)
            size = float(np.max(np.abs(reference.value), initial=0.0))
            floor = max(reference.error, ROUNDED * size, ROUNDED * np.finfo(np.float64).tiny)
            records[method.name] = MethodFacts(method.order, method.is_random, reference.source, floor)
        return cls(problem.name, problem.auto, MappingProxyType(records), machine)

    def with_row(self, row: WorkRow) -> WorkReport:
        """The report with an additional row."""
        return replace(self, rows=(*self.rows, row))

    def continued(self, earlier: WorkReport) -> WorkReport:
        """This report with the rows of an earlier one; an InputError if its problem or machine differs.

        Rows of a method that was compared with another reference are left out, so that they are measured again.
        """
        if earlier.problem != self.problem:
            raise InputError(f"path: expected rows of {self.problem!r}, got {earlier.problem!r}; name another file")
        if earlier.machine.hardware != self.machine.hardware:
            raise InputError(f"path: its times are of {earlier.machine}, not of {self.machine}; name another file")
        methods = {**earlier.methods, **self.methods}
        rows = tuple(row for row in earlier.rows if earlier.methods.get(row.method) == methods.get(row.method))
        return replace(self, methods=MappingProxyType(methods), rows=rows)

    def level(self, row: WorkRow) -> float:
        """The error of a row, or the reported error if less and the former is not significant; at least rounding."""
        floor = self.methods[row.method].floor
        error = max(row.error or 0.0, floor)
        if error > ABOVE_REFERENCE * floor or row.reported is None:
            return error
        return max(min(row.reported, error), min(floor, ROUNDED))

    def lasting_level(self, row: WorkRow) -> float:
        """The largest `level` at this and all larger budgets: a small error by chance at one budget does not count."""
        return max(self.level(other) for other in self._done(row.method) if other.budget >= row.budget)

    def order(self, method: str) -> FittedOrder | None:
        """The order in the budget, fitted to the significant errors; None for fewer than three of them."""
        least = ABOVE_REFERENCE * self.methods[method].floor
        rows = [(row.budget, row.error, len(row.seconds)) for row in self._done(method) if (row.error or 0.0) > least]
        if not rows:
            return None
        budgets, errors, repeats = zip(*rows, strict=True)
        return fit_order(budgets, errors, repeats if self.methods[method].is_random else None)

    def front(self) -> tuple[WorkRow, ...]:
        """The Pareto front: rows not surpassed by another in both error (see `level`) and least time, fastest first."""
        found: list[WorkRow] = []
        for row in sorted(self._done(), key=lambda row: (row.least, row.error)):
            if not found or self.level(row) < self.level(found[-1]):
                found.append(row)
        return tuple(found)

    def choice(self) -> float | None:
        """Largest ratio, over the rows of ``auto``, of its time to the best time of the other methods at equal error.

        Times between the rows of a method are interpolated logarithmically. Errors are taken from `lasting_level`. None
        without rows of both kinds.
        """
        ratios = []
        for row in self._done(self.auto):
            error = self.lasting_level(row)
            others = (name for name in self.methods if name != self.auto)
            times = [time for name in others if (time := self._time_to(name, error)) is not None]
            if times:
                ratios.append(row.least / min(times))
        return max(ratios, default=None)

    def to_frame(self) -> Any:
        """One row a measurement, as a pandas.DataFrame (extra ``studies``)."""
        names = ("method", "budget", "status", "error", "reported", "note", "least", "spread")
        return data_frame({name: [getattr(row, name) for row in self.rows] for name in names})

    def table(self) -> str:
        """A Markdown table, followed by references, orders, choice and machine."""
        return table_of(self)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw errors against least times on logarithmic axes."""
        return draw_work(self, ax)

    def to_json(self) -> str:
        """The report as JSON, without NaN or infinity."""
        data = {
            "format": FORMAT,
            "problem": self.problem,
            "auto": self.auto,
            "methods": {name: asdict(method) for name, method in self.methods.items()},
            "machine": asdict(self.machine),
            "rows": [asdict(row) for row in self.rows],
        }
        return json.dumps(data, indent=1, allow_nan=False)

    @classmethod
    def of_json(cls, text: str) -> WorkReport:
        """The report from the result of `to_json`; an InputError for other text."""
        try:
            data: dict[str, Any] = json.loads(text)
            if data["format"] != FORMAT:
                raise InputError(f"JSON: expected format {FORMAT} of a report, got {data['format']!r}")
            methods = {name: MethodFacts(**record) for name, record in data["methods"].items()}
            rows = tuple(WorkRow(**row) for row in data["rows"])
            return cls(data["problem"], data["auto"], MappingProxyType(methods), Machine(**data["machine"]), rows)
        except (ValueError, KeyError, TypeError, RecursionError) as reason:
            raise InputError(f"JSON: expected what WorkReport.to_json() gives: {reason!r}") from reason

    def _done(self, method: str | None = None) -> list[WorkRow]:
        return [row for row in self.rows if row.is_done and method in (None, row.method)]

    def _time_to(self, method: str, error: float) -> float | None:
        """The time after which a method has at most this error, now and at larger budgets; None if it never does."""
        best: list[tuple[float, float]] = []
        for row in sorted(self._done(method), key=lambda row: row.least):
            level = self.lasting_level(row)
            if level < (best[-1][1] if best else float("inf")):
                best.append((row.least, level))
        if not best or best[-1][1] > error:
            return None
        if best[0][1] <= error:
            return best[0][0]
        times, errors = np.log(np.array(best)).T
        return float(np.exp(np.interp(-np.log(error), -errors, times)))


def draw_work(report: WorkReport, ax: Axes | None = None) -> Axes:
    """Draw the errors (see `WorkReport.level`) over the least times, the front in grey and ``auto`` in black."""
    ax = axes_or_new(ax, figsize=(6.0, 4.5))
    front = [(row.least, report.level(row)) for row in report.front()]
    if len(front) > 1:
        ax.plot(*zip(*front, strict=True), color="0.8", linewidth=6.0, solid_capstyle="round", zorder=0)
    floors = {record.floor for record in report.methods.values()}
    for number, name in enumerate(report.methods):
        rows = sorted((row for row in report.rows if row.is_done and row.method == name), key=lambda row: row.least)
        if not rows:
            continue
        chosen = name == report.auto
        ax.plot(
            [row.least for row in rows], [report.level(row) for row in rows],
            marker=MARKERS[number % len(MARKERS)], markersize=8.0 if chosen else 5.0, linewidth=1.2,
            color="black" if chosen else f"C{number}", fillstyle="none" if chosen else "full", label=verbatim(name),
        )  # fmt: skip
    ax.axhline(max(floors), color="0.5", linestyle=":", linewidth=1.0, label="reference known to")
    ax.set(xscale="log", yscale="log", xlabel="seconds", ylabel="error")
    ax.set_title(verbatim(report.problem))
    from matplotlib.ticker import NullFormatter

    for axis, (low, high), limit in ((ax.xaxis, ax.get_xlim(), ax.set_xlim), (ax.yaxis, ax.get_ylim(), ax.set_ylim)):
        middle, reach = sqrt(low * high), sqrt(max(high / low, DECADE))
        limit(middle / reach, middle * reach)
        # matplotlib also labels minor ticks of a few decades, which overlap
        axis.set_minor_formatter(NullFormatter())
    ax.legend(fontsize="x-small", framealpha=0.6)
    return ax
