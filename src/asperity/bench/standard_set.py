"""Run the standard set: every problem in a process that can be ended, every report in a file that can be continued."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cache, partial
from itertools import groupby
from pathlib import Path

import numpy as np

from ..errors import AsperityError, InputError
from ..spectral import ReferenceValue, WorkMethod, WorkProblem, WorkReport, WorkRow, work_precision
from ..spectral.machine import on_few_cores
from ..spectral.stopwatch import measure
from .child_process import ChildCrashed, ChildProcess, OutOfTime
from .quantities import QUANTITIES
from .scenes import scenes, standard_names, wall_of

Say = Callable[[str], None]


@dataclass(frozen=True)
class Effort:
    """How much work a run takes.

    Attributes
    ----------
    quick : bool
        Whether the shorter ladders and the cheaper references are used.
    repeats : int
    seconds : float
        Repeats and ladders end when they have taken this long; see `work_precision`.
    row_seconds, reference_seconds : float
        A row, or the references of a problem, that take longer are ended.
    """

    quick: bool
    repeats: int
    seconds: float
    row_seconds: float
    reference_seconds: float


QUICK = Effort(True, 5, 0.2, 1.5, 10.0)
FULL = Effort(False, 5, 1.0, 10.0, 60.0)
# Of the random walls every quantity that has a reference by itself; the others are of the standard set alone.
RANDOM_QUANTITIES = ("law", "moment")


def problem_names(patterns: Sequence[str] = ()) -> list[str]:
    """Names SCENE/QUANTITY that match one of the patterns; without patterns those of the standard set.

    A pattern is a name with wildcards, or a scene or a quantity alone.
    """
    standard = [f"{scene}/{quantity}" for scene in standard_names() for quantity in QUANTITIES]
    random = [f"{scene}/{q}" for scene in scenes() if scene not in standard_names() for q in RANDOM_QUANTITIES]
    if not patterns:
        return standard
    chosen = []
    for pattern in patterns:
        found = [
            name
            for name in standard + random
            if any(fnmatch(part, pattern) for part in (name, *name.split("/")))
            # a quantity alone means that of the standard set
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
    """The reports of problems, one after the other; a word to the user where there is none."""
    for scene, group in groupby(names, key=lambda name: name.split("/")[0]):
        with ChildProcess(partial(prepare, scene)) as child:
            for name in group:
                report = _run(name, effort, folder, child)
                if isinstance(report, str):
                    say(f"{name}: left out, {report}")
                else:
                    say(f"{name}: {len(report.rows)} rows")
                    yield report


def _run(name: str, effort: Effort, folder: Path | None, child: ChildProcess) -> WorkReport | str:
    """The report of one problem; or why there is none, where no independent reference is known in time."""
    scene, quantity = name.split("/")
    try:
        references = child.call(references_of, name, effort.quick, seconds=effort.reference_seconds)
    except OutOfTime:
        return f"its references take more than {effort.reference_seconds:g} s"
    except (ChildCrashed, AsperityError) as reason:
        return f"its references fail: {reason}"
    if not references:
        return "no independent reference is known"
    entries = QUANTITIES[quantity].methods(wall_of(scene))
    ladders = {method.name: (quick if effort.quick else full) for method, quick, full in entries}

    def runner(problem: WorkProblem, method: WorkMethod, budget: float, repeats: int, seconds: float) -> WorkRow:
        task = (name, references, method.name, budget, repeats, seconds)
        try:
            return WorkRow.of_dict(child.call(measured, *task, seconds=effort.row_seconds))
        except OutOfTime:
            return WorkRow(method.name, budget, "timed out", note=f"ended after {effort.row_seconds:g} s")
        except ChildCrashed as reason:
            return WorkRow(method.name, budget, "failed", note=str(reason))

    return work_precision(
        WorkProblem(name, references), [method for method, _, _ in entries], ladders, repeats=effort.repeats,
        seconds=effort.seconds, warm_up=False, path=None if folder is None else folder / f"{file_stem(name)}.json",
        runner=runner,
    )  # fmt: skip


def file_stem(name: str) -> str:
    """What the files of a problem are called."""
    return name.replace("/", "-")


def prepare(scene: str) -> None:
    """What a new process loads before anything is timed: the wall, and the compiled loops for it."""
    from ..geometry import trace
    from ..kernels import Legendre, WallLaw, discretise
    from ..kernels.wall_rows import adaptive_rows

    wall = wall_of(scene)
    trace(wall, [0.3, 0.6], [1.0, 2.0])
    adaptive_rows(wall, [1.0], 1e-2)
    discretise(WallLaw(wall), Legendre(2), "monte-carlo", samples=16)


def references_of(name: str, quick: bool) -> tuple[ReferenceValue, ...]:
    """The references of a problem, made in this process."""
    scene, quantity = name.split("/")
    return QUANTITIES[quantity].references(wall_of(scene), quick)


@cache
def _methods(name: str) -> dict[str, WorkMethod]:
    scene, quantity = name.split("/")
    return {method.name: method for method, _, _ in QUANTITIES[quantity].methods(wall_of(scene))}


def measured(
    name: str, references: tuple[ReferenceValue, ...], method: str, budget: float, repeats: int, seconds: float
) -> dict[str, object]:
    """One row, measured in this process on one core, as a dictionary."""
    with on_few_cores(1), np.errstate(all="ignore"):
        return measure(WorkProblem(name, references), _methods(name)[method], budget, repeats, seconds).as_dict()
