"""Runs of problems: each in a process that can be killed, within its part of the time, from its file on, and with its
reference.
"""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from ..core.child import ChildCrashed, ChildProcess, OutOfTime
from ..core.errors import FileExistsRefusal, InputError
from ..core.files import moved_when_complete
from ..core.tables import table
from ..kernels import WallLaw
from ..kernels.walls.wall_law import FEW_PIECES
from ..spectral import ReferenceValue, WorkMethod, WorkProblem, WorkReport, work_precision
from ..spectral.bounds.images import is_traced
from ..spectral.work_diagrams.problem import OrderVerdict
from ..spectral.work_diagrams.report import WorkRow
from .problems import measured, methods_of, prepare, value_of
from .quantities import AUTO, BEAMS, CLOSED_FORM, FLIGHTS, QMC, ROWS, scenes, wall_of

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
        states = "; ".join(dict.fromkeys(f"{row.status}: {row.note}" for row in _chosen(report)))
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


Say = Callable[[str], None]


class TimePlan:
    """Divides ``seconds``, counted from construction, among ``parts``.

    If no part exceeds its fraction, the sum is at most ``seconds``. Later parts divide the time that earlier parts
    leave.

    Examples
    --------
    >>> plan = TimePlan(10.0, 2)
    >>> round(plan.next_fraction())
    5
    """

    def __init__(self, seconds: float, parts: int) -> None:
        self._end, self._left = time.monotonic() + seconds, parts

    @property
    def remaining(self) -> float:
        """Remaining seconds, at least 0."""
        return max(self._end - time.monotonic(), 0.0)

    def next_fraction(self, weight: float = 1.0) -> float:
        """Seconds for the next part, which counts as ``weight`` later parts."""
        fraction = weight / (weight + self._left - 1) * self.remaining
        self._left = max(self._left - 1, 1)
        return fraction


@dataclass(frozen=True)
class Effort:
    """The amount of work of a run.

    Attributes
    ----------
    quick : bool
        Whether the shorter ladders are used.
    repeats : int
        Repeats of every row; random methods, whose error is a mean over them, have ``RANDOM_FACTOR`` times as many.
    seconds : float
        Repeats and ladders end after this time; see `work_precision`.
    row_seconds : float
        A row that takes longer is killed.
    reference_seconds : float
        Limit of each method that makes a reference of a user's wall.
    total_seconds : float
        Limit for all problems together, including the start of processes; see `TimePlan`. Rows beyond the limit are
        omitted and marked.
    """

    quick: bool
    repeats: int
    seconds: float
    row_seconds: float
    reference_seconds: float
    total_seconds: float


RANDOM_FACTOR = 4
# The library's choice gets this multiple of another method's time, because it is the main result.
AUTO_WEIGHT = 4.0
QUICK = Effort(True, 4, 0.2, 1.5, 5.0, 155.0)
FULL = Effort(False, 4, 1.5, 12.0, 30.0, 1080.0)
# A row with less remaining time is not started.
LEAST_SECONDS = 0.05


def run_problems(
    names: Sequence[str], effort: Effort, folder: Path | None = None, say: Say = print
) -> Iterator[WorkReport]:
    """Yield the reports of problems; ``say`` names problems without a reference and finished reports."""
    plan = TimePlan(effort.total_seconds, len(names))
    for scene, group in groupby(names, key=scene_of):
        with ChildProcess(partial(prepare, scene)) as child:
            for name in group:
                report = _run(name, effort, folder, child, plan)
                if report is None:
                    say(f"{name}: left out, no independent reference is known")
                else:
                    say(f"{name}: {len(report.rows)} rows{_without_result(report)}")
                    yield report


def _without_result(report: WorkReport) -> str:
    """Which rows have no result, and why."""
    missing = (f"{row.method} at {row.budget:g} {row.status}, {row.note}" for row in report.rows if not row.is_done)
    words = "; ".join(missing)
    return words and f", without a result: {words}"


def _run(name: str, effort: Effort, folder: Path | None, child: ChildProcess, whole: TimePlan) -> WorkReport | None:
    """The report of one problem within its part of the time, or None without a reference."""
    stored = known_reference(name)
    if stored is None and scene_of(name) in scenes():
        return None
    if whole.remaining >= LEAST_SECONDS:
        # before the time is divided: the first process on a machine compiles for minutes
        child.start()
    entries = methods_of(name)
    plan = TimePlan(whole.next_fraction(), len(entries))
    # half of the time at most
    seconds = min(effort.reference_seconds, 0.5 * plan.remaining / len(FINEST))
    references = made_references(name, child, seconds) if stored is None else (stored,)
    methods = [method for method, _, _ in entries if any(method.name not in one.made_by for one in references)]
    if not methods:
        return None
    ends: dict[str, float] = {}
    weights = {method.name: AUTO_WEIGHT if method.name == AUTO else 1.0 for method in methods}

    def runner(problem: WorkProblem, method: WorkMethod, budget: float, repeats: int, seconds: float) -> WorkRow:
        if method.name not in ends:
            if plan.remaining >= LEAST_SECONDS:
                # the start counts for the problem, not for the method
                child.start()
            ends[method.name] = time.monotonic() + plan.next_fraction(weights[method.name])
        limit = min(effort.row_seconds * weights[method.name], ends[method.name] - time.monotonic())
        if limit < LEAST_SECONDS:
            return WorkRow(method.name, budget, "left out", note="the time planned for this method was spent")
        more = RANDOM_FACTOR * repeats if method.is_random else repeats
        task = (name, references, method.name, budget, more, min(seconds, 0.5 * limit))
        try:
            row: WorkRow = child.call(measured, *task, seconds=limit)
            return row
        except OutOfTime:
            return WorkRow(method.name, budget, "timed out", note=f"ended after {limit:.2g} s")
        except ChildCrashed as reason:
            return WorkRow(method.name, budget, "failed", note=str(reason))

    ladders = {method.name: (quick if effort.quick else full) for method, quick, full in entries}
    return work_precision(
        WorkProblem(name, references), methods, ladders, repeats=effort.repeats, seconds=effort.seconds, warm_up=False,
        path=None if folder is None else folder / f"{file_stem(name)}.json", runner=runner,
    )  # fmt: skip


FILE = Path(__file__).with_name("standard_references.json")
# Budgets of the reference of a user's wall: of each method the finest that is done in time. Rays are more than in rows.
FINEST = {
    CLOSED_FORM: (1.0,), BEAMS: (1e4, 1e5, 1e6), ROWS: (1e3, 1e4, 1e6, 1e8), QMC: (4.0**9, 4.0**12),
    FLIGHTS: (1e2, 1e3, 1e4),
}  # fmt: skip
RAYS = (QMC, FLIGHTS)
# A reference that is farther from that of rays, in half widths of 95 %, has this distance as its error.
DISAGREE = 3.0


@cache
def _stored() -> dict[str, Any]:
    table: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return table


def known_reference(problem: str) -> ReferenceValue | None:
    """The reference of a problem SCENE/QUANTITY, or None if no independent reference is known."""
    entry = _stored().get(problem)
    if entry is None:
        return None
    value = np.asarray(entry["value"], dtype=np.float64)
    return ReferenceValue(_whole(value) if value.ndim else value, entry["error"], entry["source"])


def _whole(upper: np.ndarray[Any, np.dtype[np.float64]]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The symmetric matrix with the given upper triangle, in row order."""
    size = round((np.sqrt(8.0 * upper.size + 1.0) - 1.0) / 2.0)
    matrix = np.zeros((size, size))
    matrix[np.triu_indices(size)] = upper
    return np.asarray(matrix + np.triu(matrix, 1).T)


def made_references(name: str, child: ChildProcess, seconds: float) -> tuple[ReferenceValue, ...]:
    """References of a problem on a user's wall, the most exact first: the finest run of each method within ``seconds``.

    None is for its own method, nor for the library's choice if this may use that method; rays are for all, because no
    row has the same. Every other reference is checked by that of rays.
    """
    applicable = {method.name for method, _, _ in methods_of(name)}
    found = {method: _finest(name, method, child, seconds) for method in FINEST if method in applicable}
    (rays,) = (found.pop(method) for method in RAYS if method in found)
    checked = [one if rays is None else _beside(one, rays) for one in found.values() if one is not None]
    return tuple(sorted([*checked, *([] if rays is None else [rays])], key=lambda one: one.error))


def _finest(name: str, method: str, child: ChildProcess, seconds: float) -> ReferenceValue | None:
    """The value at the largest budget that is done in time and reports an error."""
    found, made_by = None, () if method in RAYS else (method, *_chooses(scene_of(name), method))
    child.start()
    end = time.monotonic() + seconds
    for budget in FINEST[method]:
        try:
            value, error, _ = child.call(value_of, name, method, budget, seconds=max(end - time.monotonic(), 0.0))
        except Exception:  # of the method, or of its process
            break
        if error is not None:
            # the checksum tells walls apart whose errors agree
            source = f"{method} with budget {budget:g}, checksum {crc32(np.asarray(value).tobytes()):08x}"
            found = ReferenceValue(value, error, source, made_by)
    return found


def _chooses(scene: str, method: str) -> tuple[str, ...]:
    """The name of the library's choice, if this may use the method."""
    wall = wall_of(scene)
    law = WallLaw(wall)
    # of these walls it takes the closed form or beams, whatever the tolerance
    exact = not law.has_traced_parts or (len(wall.pieces) <= FEW_PIECES and not is_traced(law))
    return () if method == ROWS and exact else (AUTO,)


def _beside(found: ReferenceValue, rays: ReferenceValue) -> ReferenceValue:
    """A reference, with its distance from that of rays as its error if they disagree."""
    distance = float(np.linalg.norm(found.value - rays.value))
    if distance <= found.error + DISAGREE * rays.error:
        return found
    return ReferenceValue(found.value, distance, f"{found.source}, not confirmed by rays", found.made_by)
