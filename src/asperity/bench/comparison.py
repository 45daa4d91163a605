"""Two runs of the benchmark compared: rows that became slower or less exact, and whether that is chance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..core.errors import InputError
from ..core.tables import table
from ..spectral import WorkReport, WorkRow
from .run import BenchRun

# A row is slower only if chance would show it in less than this fraction of the rows, and by more than machines drift
# in a day. Four repeats that are all slower than four others, the fewest that are run, have the p-value 1/70.
SIGNIFICANT, DRIFT = 0.02, 1.25
# An error that grew by less than this is that of another rounding or another sample.
GREW = 2.0


@dataclass(frozen=True)
class RowChange:
    """One row in both runs.

    Attributes
    ----------
    problem, method : str
    budget : float
    time_ratio : float
        Least time now over least time before.
    p_value : float
        Of the times being alike, against their being longer (or shorter, as the ratio is), by the Mann-Whitney test.
    error_ratio : float
        Error now over error before, both at least what their reference can tell.
    status : str
        "" or what became of a row that was done.
    """

    problem: str
    method: str
    budget: float
    time_ratio: float
    p_value: float
    error_ratio: float
    status: str = ""

    @property
    def is_slower(self) -> bool:
        """Whether the row takes longer, beyond chance and drift."""
        return self.time_ratio > DRIFT and self.p_value < SIGNIFICANT

    @property
    def is_worse(self) -> bool:
        """Whether it is slower, less exact, or gone."""
        return self.is_slower or self.error_ratio > GREW or bool(self.status)


@dataclass(frozen=True)
class Comparison:
    """All rows that both runs have.

    Attributes
    ----------
    changes : tuple of RowChange
    """

    changes: tuple[RowChange, ...]

    @property
    def is_worse(self) -> bool:
        """Whether any row is."""
        return any(change.is_worse for change in self.changes)

    @property
    def drift(self) -> float:
        """Geometric mean of the ratios of the times: what the whole machine did."""
        ratios = [change.time_ratio for change in self.changes if not change.status]
        return float(np.exp(np.mean(np.log(ratios)))) if ratios else 1.0

    def table(self) -> str:
        """The rows that changed, and the drift of all."""
        rows = (
            f"{one.problem} | {one.method} | {one.budget:g} | {one.time_ratio:.2f} | {one.p_value:.3f} "
            f"| {one.error_ratio:.2g} | {one.status or ('worse' if one.is_worse else 'faster')}"
            for one in self.changes
            if one.is_worse or (one.time_ratio < 1.0 / DRIFT and one.p_value < SIGNIFICANT)
        )
        lines = table("problem | method | budget | time now/before | p | error now/before | ", rows)
        drift = f"their times are {self.drift:.2f} of before in the geometric mean."
        return f"{lines}\n\n{len(self.changes)} rows in both; {drift}"


def compare_runs(before: BenchRun, now: BenchRun) -> Comparison:
    """Compare the rows that both runs have; an InputError if they are of different machines or share nothing."""
    earlier = {report.problem: report for report in before.reports}
    changes: list[RowChange] = []
    for report in now.reports:
        if report.problem not in earlier:
            continue
        old = earlier[report.problem]
        if not old.machine.is_comparable_with(report.machine):
            raise InputError(f"--compare: its times are of {old.machine}, these of {report.machine}")
        rows = {(row.method, row.budget): row for row in old.rows if row.is_done}
        for row in report.rows:
            if (row.method, row.budget) in rows:
                changes.append(_change(report, row, old, rows[row.method, row.budget]))
    if not changes:
        raise InputError("--compare: expected an earlier run of the same problems, got none of them")
    return Comparison(tuple(changes))


def _change(report: WorkReport, row: WorkRow, old_report: WorkReport, old: WorkRow) -> RowChange:
    if not row.is_done:
        return RowChange(report.problem, row.method, row.budget, 1.0, 1.0, 1.0, f"{row.status}: {row.note}")
    from scipy.stats import mannwhitneyu

    side: Literal["greater", "less"] = "greater" if row.least > old.least else "less"
    p_value = float(mannwhitneyu(row.seconds, old.seconds, alternative=side, method="exact").pvalue)
    floor = max(record.floor for record in (report.methods[row.method], old_report.methods[row.method]))
    errors = [max(one.error(what), floor) for one, what in ((report, row), (old_report, old))]
    # a random error is known to its own spread only: a factor more for few repeats
    room = 1.0 + 2.0 / len(row.seconds) ** 0.5 if report.methods[row.method].is_random else 1.0
    return RowChange(
        report.problem, row.method, row.budget, row.least / old.least, p_value, errors[0] / errors[1] / room
    )
