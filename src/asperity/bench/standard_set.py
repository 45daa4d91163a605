"""The standard set: each problem runs in a process that can be killed, and each report file can be continued."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import cache, partial
from itertools import groupby
from pathlib import Path

import numpy as np

from ..core.child import ChildCrashed, ChildProcess, OutOfTime
from ..core.errors import InputError
from ..spectral import WorkMethod, WorkProblem, WorkReport, WorkRow, work_precision
from ..spectral.work_diagrams.machine import on_few_cores
from ..spectral.work_diagrams.runs import measure
from .quantities.collision import COLLISION, DISK, TRUE_DISK, by_true_disks
from .quantities.distance import DISTANCE
from .quantities.matrix import LAW, MOMENT, RESISTANCE
from .quantities.spectral import DIFFUSIVITY, EIGENVALUE
from .quantities.walls import scenes, standard_names, wall_of
from .references import known_reference
from .run import file_stem

Say = Callable[[str], None]
QUANTITIES = {
    one.name: one for one in (LAW, MOMENT, EIGENVALUE, COLLISION, TRUE_DISK, RESISTANCE, DISTANCE, DIFFUSIVITY)
}


@dataclass
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

    seconds: float
    parts: int
    _begun: float = field(default_factory=lambda: time.monotonic(), init=False)
    _left: int = field(init=False)

    def __post_init__(self) -> None:
        self._left = self.parts

    @property
    def remaining(self) -> float:
        """Remaining seconds, at least 0."""
        return max(self.seconds - (time.monotonic() - self._begun), 0.0)

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
    total_seconds : float
        Limit for all problems together, including the start of processes; see `TimePlan`. Rows beyond the limit are
        omitted and marked.
    """

    quick: bool
    repeats: int
    seconds: float
    row_seconds: float
    total_seconds: float


RANDOM_FACTOR = 4
# The library's choice gets this multiple of another method's time, because it is the main result.
AUTO_WEIGHT = 4.0
QUICK = Effort(True, 4, 0.2, 1.5, 155.0)
FULL = Effort(False, 4, 1.5, 12.0, 1080.0)
# A row with less remaining time is not started.
LEAST_SECONDS = 0.05
# The quantity measured on the random walls.
RANDOM_QUANTITY = "moment"


def problem_names(patterns: Sequence[str] = ()) -> list[str]:
    """Names SCENE/QUANTITY that match a pattern; without patterns, the names of the standard set.

    A pattern is a name with wildcards, a scene or a quantity.
    """
    standard = [
        f"{scene}/{one.name}" for scene in standard_names() for one in QUANTITIES.values() if scene in one.scenes
    ]
    random = [f"{scene}/{RANDOM_QUANTITY}" for scene in scenes() if scene not in standard_names()]
    if not patterns:
        return standard
    chosen = []
    for pattern in patterns:
        found = [
            name
            for name in standard + random
            if any(fnmatch(part, pattern) for part in (name, *name.split("/")))
            # a quantity alone means the scenes of the standard set
            and (name in standard or fnmatch(name, pattern) or fnmatch(name.split("/")[0], pattern))
        ]
        if not found:
            raise InputError(
                f"PROBLEM: expected SCENE, QUANTITY or SCENE/QUANTITY, scenes {', '.join(standard_names())}, random-N, "
                f"quantities {', '.join(QUANTITIES)}; got {pattern!r}"
            )
        chosen += [name for name in found if name not in chosen]
    return chosen


def run_problems(
    names: Sequence[str], effort: Effort, folder: Path | None = None, say: Say = print
) -> Iterator[WorkReport]:
    """Yield the reports of problems; ``say`` names problems without a reference and finished reports."""
    plan = TimePlan(effort.total_seconds, sum(known_reference(name) is not None for name in names))
    for scene, group in groupby(names, key=lambda name: name.split("/")[0]):
        with ChildProcess(partial(prepare, scene)) as child:
            for name in group:
                reference = known_reference(name)
                if reference is None:
                    say(f"{name}: left out, no independent reference is known")
                    continue
                if plan.remaining >= LEAST_SECONDS:
                    # before the time is divided: the first process on a machine compiles for minutes
                    child.start()
                report = _run(_problem(name), effort, folder, child, plan.next_fraction())
                say(f"{name}: {len(report.rows)} rows")
                yield report


def _run(problem: WorkProblem, effort: Effort, folder: Path | None, child: ChildProcess, fraction: float) -> WorkReport:
    """The report of one problem within ``fraction`` seconds."""
    scene, quantity = problem.name.split("/")
    entries = QUANTITIES[quantity].methods(wall_of(scene))
    methods = [method for method, _, _ in entries]
    ladders = {method.name: (quick if effort.quick else full) for method, quick, full in entries}
    plan = TimePlan(fraction, len(methods))
    ends: dict[str, TimePlan] = {}

    def runner(problem: WorkProblem, method: WorkMethod, budget: float, repeats: int, seconds: float) -> WorkRow:
        if method.name not in ends:
            if plan.remaining >= LEAST_SECONDS:
                # the start counts for the problem, not for the method
                child.start()
            ends[method.name] = TimePlan(plan.next_fraction(AUTO_WEIGHT if method.name == problem.auto else 1.0), 1)
        limit = min(effort.row_seconds, ends[method.name].remaining)
        if limit < LEAST_SECONDS:
            return WorkRow(method.name, budget, "left out", note="the time planned for this method was spent")
        more = RANDOM_FACTOR * repeats if method.is_random else repeats
        task = (problem.name, method.name, budget, more, min(seconds, 0.5 * limit))
        try:
            return WorkRow.of_dict(child.call(measured, *task, seconds=limit))
        except OutOfTime:
            return WorkRow(method.name, budget, "timed out", note=f"ended after {limit:.2g} s")
        except ChildCrashed as reason:
            return WorkRow(method.name, budget, "failed", note=str(reason))

    return work_precision(
        problem, methods, ladders, repeats=effort.repeats, seconds=effort.seconds, warm_up=False,
        path=None if folder is None else folder / f"{file_stem(problem.name)}.json", runner=runner,
    )  # fmt: skip


def prepare(scene: str) -> None:
    """Load and compile everything that a new process needs for a scene, before timing starts."""
    from ..geometry import trace
    from ..geometry.polygons.beams import beams_of
    from ..kernels import Legendre, WallLaw, discretise
    from ..kernels.walls.conditionals import adaptive_conditionals

    wall = wall_of(scene)
    for one in (wall, wall.foreshorten(DISK)):
        trace(one, [0.3, 0.6], [1.0, 2.0])
        # rays towards corners require more than double precision
        trace(one, np.clip(one.vertices[:, 0], 0.0, np.nextafter(one.period, 0.0)), 0.5 * np.pi)
        adaptive_conditionals(one, [1.0], 1e-2)
    if wall.is_polygonal:
        beams_of([(0.0, 0.0), (0.3, -0.5), (0.6, -0.4), (1.0, 0.0)])
    if scene in QUANTITIES["disk"].scenes:
        by_true_disks(wall, 1e-3, np.random.default_rng(0), 1)
    discretise(WallLaw(wall), Legendre(2), "monte-carlo", samples=16)


@cache
def _problem(name: str) -> WorkProblem:
    reference = known_reference(name)
    assert reference is not None  # `run_problems` skips problems without a reference
    return WorkProblem(name, (reference,))


@cache
def _methods(name: str) -> dict[str, WorkMethod]:
    scene, quantity = name.split("/")
    return {method.name: method for method, _, _ in QUANTITIES[quantity].methods(wall_of(scene))}


def measured(name: str, method: str, budget: float, repeats: int, seconds: float) -> dict[str, object]:
    """One row, measured in this process on one core, as a dictionary."""
    with on_few_cores(1), np.errstate(all="ignore"):
        return measure(_problem(name), _methods(name)[method], budget, repeats, seconds).as_dict()
