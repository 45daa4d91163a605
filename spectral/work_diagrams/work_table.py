"""A report on error against run time as a Markdown table."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .report import WorkReport
    from .work_row import WorkRow


def table_of(report: WorkReport) -> str:
    """The table of `WorkReport.table`."""
    front = set(map(id, report.front()))
    heads = ["method", "budget", *(f"{norm} error" for norm in report.norms), "reported", "seconds", "spread", ""]
    lines = [f"| {' | '.join(heads)} |", "|" + "---|" * len(heads)]
    lines += [f"| {' | '.join(_cells(report, row, id(row) in front))} |" for row in report.rows]
    lines.append("")
    for name, facts in report.methods.items():
        words = f"- {name}: against {facts.reference} (known to {facts.floor:.1e})"
        fitted = report.order(name)
        if fitted is not None:
            words += f"; fitted order {fitted}"
        if facts.declared_order is not None:
            words += f", declared {facts.declared_order:g}"
            if fitted is not None:
                words += f": {fitted.verdict(facts.declared_order)}"
        lines.append(words)
    choice = report.choice()
    if choice is not None:
        lines.append(f"- {report.auto} takes {choice:.2g} times as long as the best other method at equal error")
    lines.append(f"- {report.machine}")
    return "\n".join(lines)


def _cells(report: WorkReport, row: WorkRow, in_front: bool) -> list[str]:
    name = f"**{row.method}**" if row.method == report.auto else row.method
    if not row.is_done:
        return [name, f"{row.budget:g}", *["-"] * (len(report.norms) + 3), f"{row.status}: {row.note}"]
    errors = [f"{row.errors[norm]:.1e}" for norm in report.norms]
    reported = "-" if row.reported is None else f"{row.reported:.1e}"
    marks = [mark for mark, holds in (("front", in_front), (row.note, bool(row.note))) if holds]
    return [name, f"{row.budget:g}", *errors, reported, f"{row.least:.2g}", f"{row.spread:.0%}", ", ".join(marks)]
