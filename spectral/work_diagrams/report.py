"""Error against run time of several methods: rows, orders, the front, and how well the library chose."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from .machine import Machine
from .order import FittedOrder, fit_order
from .problem import WorkMethod, WorkProblem
from .reference_value import ROUNDED
from .work_row import WorkRow
from .work_table import table_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORMAT = 1
# An error within so many errors of its reference measures the reference.
ABOVE_REFERENCE = 3.0


@dataclass(frozen=True)
class MethodFacts:
    """What a report says of a method besides its rows.

    Attributes
    ----------
    declared_order : float or None
    is_random : bool
    reference : str
        Where the reference that it is measured against comes from.
    floor : float
        Error of that reference, or rounding; errors below it are not told apart.
    """

    declared_order: float | None
    is_random: bool
    reference: str
    floor: float


@dataclass(frozen=True)
class WorkReport:
    """What `work_precision` measured.

    Attributes
    ----------
    problem : str
    norms : tuple of str
        The first one decides on orders, the front and the choice.
    auto : str
        Name of the method in which the library chooses.
    methods : mapping of str to MethodFacts
    machine : Machine
    rows : tuple of WorkRow

    Examples
    --------
    >>> from asperity import spectral as spec
    >>> problem = spec.WorkProblem("one third", spec.ReferenceValue(1 / 3, 0.0, "by hand"))
    >>> decimals = spec.WorkMethod("decimals", lambda n: round(1 / 3, n))
    >>> report = spec.work_precision(problem, [decimals], [1, 2, 3], repeats=1)
    >>> [f"{row.errors['absolute']:.1e}" for row in report.rows]
    ['3.3e-02', '3.3e-03', '3.3e-04']
    """

    problem: str
    norms: tuple[str, ...]
    auto: str
    methods: Mapping[str, MethodFacts]
    machine: Machine
    rows: tuple[WorkRow, ...] = ()

    @classmethod
    def of(cls, problem: WorkProblem, methods: Sequence[WorkMethod], machine: Machine) -> WorkReport:
        """A report without rows."""
        facts = {}
        for method in methods:
            reference = problem.reference_for(method.name)
            size = float(np.max(np.abs(reference.value), initial=0.0))
            floor = max(reference.error, ROUNDED * size, ROUNDED * np.finfo(np.float64).tiny)
            facts[method.name] = MethodFacts(method.order, method.is_random, reference.source, floor)
        return cls(problem.name, tuple(problem.norms), problem.auto, MappingProxyType(facts), machine)

    def with_row(self, row: WorkRow) -> WorkReport:
        """The report with one row more."""
        return replace(self, rows=(*self.rows, row))

    def continued(self, earlier: WorkReport) -> WorkReport:
        """This report with the rows of an earlier one; an InputError if these are not of the same problem."""
        if (earlier.problem, earlier.norms) != (self.problem, self.norms):
            raise InputError(f"path: expected rows of {self.problem!r}, got {earlier.problem!r}; name another file")
        if not earlier.machine.is_comparable_with(self.machine):
            raise InputError(f"path: its times are of {earlier.machine}, not of {self.machine}; name another file")
        return replace(self, methods=MappingProxyType({**earlier.methods, **self.methods}), rows=earlier.rows)

    def error(self, row: WorkRow) -> float:
        """Error of a row that is done, in the first norm."""
        return row.errors[self.norms[0]]

    def level(self, row: WorkRow) -> float:
        """The row's error; where its reference cannot tell it from zero, what the method reports if that is less.

        Never below rounding.
        """
        floor = self.methods[row.method].floor
        error = max(self.error(row), floor)
        if error > ABOVE_REFERENCE * floor or row.reported is None:
            return error
        return max(min(row.reported, error), min(floor, ROUNDED))

    def kept_level(self, row: WorkRow, *, known: bool = False) -> float:
        """The largest `level` at this and all larger budgets of the row's method.

        A rule that happens to hit, and misses again when it is refined, has not reached that error. With ``known``, of
        the level and what the method reports the larger counts, which is infinite where it reports nothing.
        """
        later = [other for other in self._done(row.method) if other.budget >= row.budget]
        levels = [self.level(other) for other in later]
        if known:
            levels += [float("inf") if other.reported is None else other.reported for other in later]
        return max(levels)

    def order(self, method: str) -> FittedOrder | None:
        """The order in the budget, fitted to errors well above the reference's; None for fewer than three of them."""
        least = ABOVE_REFERENCE * self.methods[method].floor
        rows = [row for row in self._done(method) if self.error(row) > least]
        if not rows:
            return None
        repeats = [len(row.seconds) for row in rows] if self.methods[method].is_random else None
        return fit_order([row.budget for row in rows], [self.error(row) for row in rows], repeats)

    def front(self) -> tuple[WorkRow, ...]:
        """The rows that no other one beats in both error (see `level`) and least time, fastest first."""
        found: list[WorkRow] = []
        for row in sorted(self._done(), key=lambda row: (row.least, self.error(row))):
            if not found or self.level(row) < self.level(found[-1]):
                found.append(row)
        return tuple(found)

    def choice(self, *, known: bool = False) -> float | None:
        """Time of the method that chooses over that of the best other one at equal error, the worst of its rows.

        Between the rows of a method its time is interpolated in the logarithms. Errors are those of `kept_level`: true
        ones or, with ``known``, those that who uses a method may count on. None without rows of both kinds.
        """
        ratios = []
        for row in self._done(self.auto):
            error = self.kept_level(row, known=known)
            others = (name for name in self.methods if name != self.auto)
            times = [time for name in others if (time := self._time_to(name, error, known)) is not None]
            if times:
                ratios.append(row.least / min(times))
        return max(ratios, default=None)

    def table(self) -> str:
        """A Markdown table, with the reference, the orders, the choice and the machine below it."""
        return table_of(self)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw errors against least times, both logarithmic."""
        from .work_picture import draw_work

        return draw_work(self, ax)

    def to_json(self) -> str:
        """Everything, as JSON without NaN or infinity."""
        data = {
            "format": FORMAT,
            "problem": self.problem,
            "norms": list(self.norms),
            "auto": self.auto,
            "methods": {name: dict(facts.__dict__) for name, facts in self.methods.items()},
            "machine": self.machine.as_dict(),
            "rows": [row.as_dict() for row in self.rows],
        }
        return json.dumps(data, indent=1, allow_nan=False)

    @classmethod
    def of_json(cls, text: str) -> WorkReport:
        """The report that `to_json` gave; an InputError for any other text."""
        try:
            data: dict[str, Any] = json.loads(text)
            if data["format"] != FORMAT:
                raise InputError(f"JSON: expected format {FORMAT} of a report, got {data['format']!r}")
            methods = {name: MethodFacts(**facts) for name, facts in data["methods"].items()}
            rows = tuple(WorkRow.of_dict(row) for row in data["rows"])
            machine = Machine.of_dict(data["machine"])
            return cls(data["problem"], tuple(data["norms"]), data["auto"], MappingProxyType(methods), machine, rows)
        except (ValueError, KeyError, TypeError) as reason:
            raise InputError(f"JSON: expected what WorkReport.to_json() gives: {reason!r}") from reason

    def _done(self, method: str | None = None) -> list[WorkRow]:
        return [row for row in self.rows if row.is_done and method in (None, row.method)]

    def _time_to(self, method: str, error: float, known: bool) -> float | None:
        """The time after which a method has a finite error and keeps it, or None if it has not."""
        best: list[tuple[float, float]] = []
        for row in sorted(self._done(method), key=lambda row: row.least):
            level = self.kept_level(row, known=known)
            if level < (best[-1][1] if best else float("inf")):
                best.append((row.least, level))
        if not best or best[-1][1] > error:
            return None
        if best[0][1] <= error:
            return best[0][0]
        times, errors = np.log(np.array(best)).T
        return float(np.exp(np.interp(-np.log(error), -errors, times)))
