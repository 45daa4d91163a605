"""What a run of the benchmark writes: summary, tables, data and figures of its reports."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.errors import FileExistsRefusal, InputError
from ..core.files import moved_when_complete
from ..core.tables import table
from ..spectral import WorkReport
from ..spectral.work_diagrams.problem import OrderVerdict
from ..spectral.work_diagrams.report import WorkRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMAT = 2
SUMMARY, TABLES, DATA = "summary.md", "tables.md", "bench.json"
# The library's choice is good if its time is within this factor of the best method's at equal error.
GOOD_CHOICE = 2.0
COLUMNS, WIDTH, HEIGHT = 3, 4.6, 3.8


def summary(reports: Sequence[WorkReport]) -> str:
    """The library's choice beside the best method for each problem; declared orders, references, the machine."""
    heads = "problem | chosen | error | reported | seconds | times the best at equal error | front"
    references = (
        (report.problem, source, f"{floor:.1e}")
        for report in reports
        for source, floor in dict.fromkeys((record.reference, record.floor) for record in report.methods.values())
    )
    choices = [choice for report in reports if (choice := report.choice()) is not None]
    good, orders = sum(choice <= GOOD_CHOICE for choice in choices), Counter(_order_verdicts(reports))
    words = (
        f"The library chooses within a factor {GOOD_CHOICE:g} of the best in {good} of the {len(choices)} problems "
        f"where another method gets as far. Declared orders: {orders['agrees']} agree within 0.15, "
        f"{orders['differs']} differ, {orders['not resolved']} are not resolved (their 95 % interval holds the "
        "declared one, but is wide)."
    )
    parts = [table(heads, map(_cells, reports)), words, table("problem | reference | known to", references)]
    parts += [f"Machine: {report.machine}." for report in reports[:1]]
    return "\n\n".join(parts)


def _order_verdicts(reports: Sequence[WorkReport]) -> Iterator[OrderVerdict]:
    """Whether each declared order that can be fitted agrees with the fit."""
    for report in reports:
        for name, record in report.methods.items():
            fitted = report.order(name)
            if record.declared_order is not None and fitted is not None:
                yield fitted.verdict(record.declared_order)


def save(reports: Sequence[WorkReport], folder: Path) -> list[Path]:
    """Write summary, tables, data and a figure for each scene; return the written paths."""
    tables = "\n\n".join(f"## {report.problem}\n\n{report.table()}" for report in reports)
    data = {"format": FORMAT, "reports": [json.loads(report.to_json()) for report in reports]}
    texts = {SUMMARY: summary(reports), TABLES: tables, DATA: json.dumps(data, indent=1, allow_nan=False)}
    drawn = [report for report in reports if any(row.is_done for row in report.rows)]
    drawn.sort(key=lambda report: scene_of(report.problem))
    with moved_when_complete(folder) as beside:
        for name, text in texts.items():
            (beside / name).write_text(text + "\n", encoding="utf-8")
        for scene, some in groupby(drawn, key=lambda report: scene_of(report.problem)):
            _draw(list(some)).savefig(beside / f"{label(scene)}.png", dpi=100)
        names = sorted(path.name for path in beside.iterdir() if path.name not in texts)
    return [folder / name for name in (*texts, *names)]


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
    pictures = {f"{label(scene_of(name))}.png" for name in names}
    found = sorted(name for name in (SUMMARY, TABLES, DATA, *pictures) if os.path.exists(folder / name))
    if found and not _is_earlier(folder / DATA, names):
        raise FileExistsRefusal(
            f"--out: {', '.join(found)} in {folder} are not of an earlier run of these problems; "
            "use another folder or --force to replace them"
        )


def scene_of(name: str) -> str:
    """The scene of a problem SCENE/QUANTITY; the text of a wall may have slashes of its own."""
    return name.rpartition("/")[0]


def label(scene: str) -> str:
    """What the picture of a scene is called: a wall's file by its last name.

    >>> label("koch"), label("walls/mine.txt:units=um/nm")
    ('koch', 'mine.txt-units=um-nm')
    """
    path, colon, parameters = scene.partition(":")
    return (Path(path).name + colon + parameters).replace("/", "-").replace(":", "-")


def file_stem(name: str) -> str:
    """What the files of a problem are called."""
    return f"{label(scene_of(name))}-{name.rpartition('/')[2]}"


def _is_earlier(data: Path, names: Sequence[str]) -> bool:
    """Whether this is the file of a run of some of these problems and no others."""
    try:
        reports = json.loads(data.read_text(encoding="utf-8"))["reports"]
        return {report["problem"] for report in reports} <= set(names)
    except (OSError, ValueError, LookupError, TypeError):
        return False


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
        return report.problem, words, *"----", front
    best = min(rows, key=lambda row: row.error or 0.0)
    numbers = ((best.reported, ".1e"), (best.least, ".2g"), (report.choice(), ".2g"))
    cells = ("-" if number is None else format(number, digits) for number, digits in numbers)
    return report.problem, best.note, report.methods[best.method].in_words(best.error or 0.0), *cells, front


def _draw(reports: Sequence[WorkReport]) -> Figure:
    """Draw one panel for each report, three panels in a row."""
    from matplotlib.figure import Figure

    columns = min(COLUMNS, len(reports))
    rows = -(-len(reports) // columns)
    figure = Figure(figsize=(WIDTH * columns, HEIGHT * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for panel, report in zip(panels, reports, strict=False):
        report.plot(panel)
    for panel in panels[len(reports) :]:
        panel.remove()
    return figure
