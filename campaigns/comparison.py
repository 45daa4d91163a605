"""Comparison of two benchmark runs: rows that became slower or less accurate, with significance tests.

``python -m campaigns.comparison EARLIER/bench.json NOW/bench.json`` exits with 1 if a row became worse. Both are runs
of ``asperity bench`` on the same machine.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from asperity.bench.run import BenchRun
from asperity.core.errors import InputError
from asperity.core.tables import table
from asperity.spectral import WorkReport, WorkRow

# A row is slower if its p-value is below SIGNIFICANT and its time ratio exceeds DRIFT, the drift of machines in a day.
# If four repeats, the fewest of any run, are all slower than four others, the p-value is 1/70.
SIGNIFICANT, DRIFT = 0.02, 1.25
# A smaller growth of an error can come from rounding or from another sample.
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
        One-sided Mann-Whitney test of equal times, in the direction of ``time_ratio``.
    error_ratio : float
        Error now over error before, each at least the error of its reference.
    status : str
        "", or the reason why a row of the earlier run is missing now.
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
        """Whether the row is slower, less accurate, or missing."""
        return self.is_slower or self.error_ratio > GREW or bool(self.status)


@dataclass(frozen=True)
class Comparison:
    """Comparison of the rows that both runs contain.

    Attributes
    ----------
    changes : tuple of RowChange
    """

    changes: tuple[RowChange, ...]

    @property
    def is_worse(self) -> bool:
        """Whether any row is worse."""
        return any(change.is_worse for change in self.changes)

    @property
    def drift(self) -> float:
        """Geometric mean of the time ratios: the drift of the machine."""
        ratios = [change.time_ratio for change in self.changes if not change.status]
        return float(np.exp(np.mean(np.log(ratios)))) if ratios else 1.0

    def table(self) -> str:
        """A table of the rows that changed, and the overall drift."""
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
    """Compare the rows of both runs; InputError if the machines differ or no row is common."""
    earlier = {report.problem: report for report in before.reports}
    changes: list[RowChange] = []
    for report in now.reports:
        if report.problem not in earlier:
            continue
        old = earlier[report.problem]
        if not old.machine.is_comparable_with(report.machine):
            raise InputError(f"EARLIER: its times are of {old.machine}, these of {report.machine}")
        rows = {(row.method, row.budget): row for row in old.rows if row.is_done}
        for row in report.rows:
            if (row.method, row.budget) in rows:
                changes.append(_change(report, row, old, rows[row.method, row.budget]))
    if not changes:
        raise InputError("EARLIER: expected an earlier run of the same problems, got none of them")
    return Comparison(tuple(changes))


def _change(report: WorkReport, row: WorkRow, old_report: WorkReport, old: WorkRow) -> RowChange:
    if not row.is_done:
        return RowChange(report.problem, row.method, row.budget, 1.0, 1.0, 1.0, f"{row.status}: {row.note}")
    from scipy.stats import mannwhitneyu

    side: Literal["greater", "less"] = "greater" if row.least > old.least else "less"
    p_value = float(mannwhitneyu(row.seconds, old.seconds, alternative=side, method="exact").pvalue)
    floor = max(record.floor for record in (report.methods[row.method], old_report.methods[row.method]))
    errors = [max(one.error(what), floor) for one, what in ((report, row), (old_report, old))]
    # a random error has a spread, so a factor is allowed that decreases with the number of repeats
    room = 1.0 + 2.0 / len(row.seconds) ** 0.5 if report.methods[row.method].is_random else 1.0
    return RowChange(
        report.problem, row.method, row.budget, row.least / old.least, p_value, errors[0] / errors[1] / room
    )


if __name__ == "__main__":
    earlier, latest = (BenchRun.of_json(Path(name).read_text(encoding="utf-8")) for name in sys.argv[1:])
    found = compare_runs(earlier, latest)
    print(found.table())
    sys.exit(1 if found.is_worse else 0)
