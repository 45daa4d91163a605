"""One run of the benchmark: its reports, summary, files and figures."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import FileExistsRefusal, InputError
from ..core.files import moved_when_complete
from ..core.tables import table
from ..spectral import WorkReport, WorkRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMAT = 1
SUMMARY, TABLES, DATA = "summary.md", "tables.md", "bench.json"
# The library's choice is good if its time is within this factor of the best method's at equal error.
GOOD_CHOICE = 2.0
COLUMNS, WIDTH, HEIGHT = 3, 4.6, 3.8


@dataclass(frozen=True)
class BenchRun:
    """Reports on problems, in the order in which they were run.

    Attributes
    ----------
    reports : tuple of WorkReport
    """

    reports: tuple[WorkReport, ...]

    def summary(self) -> str:
        """A table with the library's choice, its error and its time relative to the best method, for each problem."""
        heads = "problem | chosen | error | reported | seconds"
        heads += " | times the best at equal error | at equal known error | front"
        lines = [table(heads, map(_cells, self.reports)), "", *self._choices(), ""]
        agree, differ, unsure = self.orders()
        lines.append(
            f"Declared orders: {len(agree)} agree within 0.15, {len(differ)} differ, {len(unsure)} are not resolved "
            "(their 95 % interval holds the declared one, but is wide)."
        )
        lines += ["", *(f"- differs: {line}" for line in differ), ""] if differ else [""]
        if self.reports:
            lines.append(f"Machine: {self.reports[0].machine}.")
        return "\n".join(lines)

    def _choices(self) -> list[str]:
        """The number of good choices in words, and a list of the others."""
        choosing = [report for report in self.reports if report.auto in report.methods]
        done = [report for report in choosing if any(row.is_done for row in _chosen(report))]
        choices = [(report.problem, choice) for report in done if (choice := report.choice()) is not None]
        good = sum(choice <= GOOD_CHOICE for _, choice in choices)
        known = [choice for report in done if (choice := report.choice(known=True)) is not None]
        lines = [
            f"The library chooses in {len(choosing)} problems. It is within a factor {GOOD_CHOICE:g} of the best on "
            f"{good} of the {len(choices)} where another method gets as far; on {len(done) - len(choices)} none does; "
            f"on {len(choosing) - len(done)} it was not done in time. Where errors count as far as they are known, it "
            f"is within that factor on {sum(choice <= GOOD_CHOICE for choice in known)} of {len(known)}."
        ]
        slow = [f"- {problem}: {choice:.2g} times the best" for problem, choice in choices if choice > GOOD_CHOICE]
        return [*lines, "", *slow] if slow else lines

    def references(self) -> str:
        """A table of each problem's reference and the accuracy of the reference."""
        rows = (
            f"{report.problem} | {source} | {floor:.1e}"
            for report in self.reports
            for source, floor in dict.fromkeys((record.reference, record.floor) for record in report.methods.values())
        )
        return table("problem | reference | known to", rows)

    def orders(self) -> tuple[list[str], list[str], list[str]]:
        """Declared orders in three lists: confirmed, contradicted or not resolved by the fits."""
        groups: tuple[list[str], list[str], list[str]] = ([], [], [])
        for report in self.reports:
            for name, record in report.methods.items():
                fitted = report.order(name)
                if record.declared_order is None or fitted is None:
                    continue
                verdict = fitted.verdict(record.declared_order)
                line = f"{report.problem}, {name}: {fitted}, declared {record.declared_order:g}"
                groups[("agrees", "differs", "not resolved").index(verdict)].append(line)
        return groups

    def tables(self) -> str:
        """Tables of all rows, one for each problem."""
        return "\n\n".join(f"## {report.problem}\n\n{report.table()}" for report in self.reports)

    def save(self, folder: Path) -> list[Path]:
        """Write summary, tables, data and a figure for each scene; return the written paths."""
        written = [folder / SUMMARY, folder / TABLES, folder / DATA]
        with moved_when_complete(folder) as beside:
            for path, text in zip(written, (self.summary(), self.tables(), self.to_json()), strict=True):
                (beside / path.name).write_text(text + "\n", encoding="utf-8")
            for scene, reports in self.by_scene().items():
                drawn = [report for report in reports if any(row.is_done for row in report.rows)]
                if drawn:
                    written.append(folder / f"{scene}.png")
                    draw_scene(drawn).savefig(beside / written[-1].name, dpi=100)
        return written

    def by_scene(self) -> dict[str, list[WorkReport]]:
        """The reports of each scene."""
        found: dict[str, list[WorkReport]] = {}
        for report in self.reports:
            found.setdefault(report.problem.split("/")[0], []).append(report)
        return found

    def to_json(self) -> str:
        """All reports as JSON."""
        data = {"format": FORMAT, "reports": [json.loads(report.to_json()) for report in self.reports]}
        return json.dumps(data, indent=1, allow_nan=False)

    @classmethod
    def of_json(cls, text: str) -> BenchRun:
        """The run saved by `to_json`; an InputError for any other text."""
        try:
            data = json.loads(text)
            return cls(tuple(WorkReport.of_json(json.dumps(report)) for report in data["reports"]))
        except (ValueError, KeyError, TypeError, RecursionError) as reason:
            raise InputError(f"JSON: expected what BenchRun.to_json() gives: {reason!r}") from reason


def prepare_folder(folder: Path, names: Sequence[str], *, force: bool) -> None:
    """Make the folder for a run of these problems; only ``force`` may cost files that are there.

    A run goes on from the rows in the folder, and then its summary replaces that of the same problems or fewer. With
    ``force`` the rows of these problems are removed, so that they are measured again, and no other file is.

    Raises
    ------
    FileExistsRefusal
        If a file would be replaced that is not of an earlier run of these problems, and ``force`` is False.
    """
    if os.path.exists(folder) and not folder.is_dir():
        raise FileExistsRefusal(f"--out: {folder} is a file; name a folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise InputError(f"--out: cannot make {folder} ({reason.strerror}); choose another folder") from reason
    if force:
        for name in names:
            (folder / f"{file_stem(name)}.json").unlink(missing_ok=True)
        return
    pictures = {f"{name.split('/')[0]}.png" for name in names}
    found = sorted(name for name in (SUMMARY, TABLES, DATA, *pictures) if os.path.exists(folder / name))
    if found and not _is_earlier(folder / DATA, names):
        raise FileExistsRefusal(
            f"--out: {', '.join(found)} in {folder} are not of an earlier run of these problems; "
            "use another folder or --force to replace them"
        )


def file_stem(name: str) -> str:
    """What the files of a problem are called."""
    return name.replace("/", "-")


def _is_earlier(data: Path, names: Sequence[str]) -> bool:
    """Whether this is the file of a run of some of these problems and no others."""
    try:
        run = BenchRun.of_json(data.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return {report.problem for report in run.reports} <= set(names)


def _chosen(report: WorkReport) -> list[WorkRow]:
    """The rows of the method in which the library chooses."""
    return [row for row in report.rows if row.method == report.auto]


def _cells(report: WorkReport) -> tuple[str, ...]:
    """One row of the summary."""
    rows = [row for row in _chosen(report) if row.is_done]
    front = ", ".join(dict.fromkeys(row.method for row in report.front()))
    if not rows:
        states = ", ".join(dict.fromkeys(row.status for row in _chosen(report)))
        words = states or ("not run" if report.auto in report.methods else "nothing to choose")
        return report.problem, words, *"-----", front
    best = min(rows, key=report.error)
    reported = "-" if best.reported is None else f"{best.reported:.1e}"
    ratios = [report.choice(), report.choice(known=True)]
    true, known = ("-" if ratio is None else f"{ratio:.2g}" for ratio in ratios)
    error, seconds = f"{report.error(best):.1e}", f"{best.least:.2g}"
    return report.problem, best.note, error, reported, seconds, true, known, front


def draw_scene(reports: Sequence[WorkReport]) -> Figure:
    """Draw one panel for each report, three panels in a row."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(reports))
    rows = -(-len(reports) // columns)
    figure = Figure(figsize=(WIDTH * columns, HEIGHT * rows), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, report in zip(panels, reports, strict=False):
        report.plot(panel)
    for panel in panels[len(reports) :]:
        panel.remove()
    return figure
