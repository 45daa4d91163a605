"""Runs of problems: each in a process that can be killed, within its part of the time, and from its file on."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path

from ..core.child import ChildCrashed, ChildProcess, OutOfTime
from ..spectral import WorkMethod, WorkProblem, WorkReport, work_precision
from ..spectral.work_diagrams.report import WorkRow
from .problems import measured, methods_of, prepare
from .quantities.walls import scenes
from .references import FINEST, known_reference, made_references
from .run import file_stem, scene_of

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
                    say(f"{name}: {len(report.rows)} rows")
                    yield report


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

    def runner(problem: WorkProblem, method: WorkMethod, budget: float, repeats: int, seconds: float) -> WorkRow:
        if method.name not in ends:
            if plan.remaining >= LEAST_SECONDS:
                # the start counts for the problem, not for the method
                child.start()
            weight = AUTO_WEIGHT if method.name == problem.auto else 1.0
            ends[method.name] = time.monotonic() + plan.next_fraction(weight)
        limit = min(effort.row_seconds, ends[method.name] - time.monotonic())
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
