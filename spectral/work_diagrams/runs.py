"""Errors and run times of each method at each budget, measured or with the reason of a failure."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...core.checks import instance, positive_number, sequence, shortened, whole_number
from ...core.errors import InputError
from ...core.estimates import Estimate
from ...core.files import regular_file, text_of, write_whole
from ...kernels import KernelMatrix
from ..sweeps.running import in_words
from .problem import Machine, WorkMethod, WorkProblem, on_one_core
from .report import WorkReport, WorkRow

# Seed of the generators of the repeats, together with the number of the repeat.
SEED = 20220
Budgets = Sequence[float] | Mapping[str, Sequence[float]]
# A function that measures one row from problem, method, budget, repeats and seconds, in this or another process.
Runner = Callable[[WorkProblem, WorkMethod, float, int, float], WorkRow]


def measure(problem: WorkProblem, method: WorkMethod, budget: float, repeats: int, seconds: float) -> WorkRow:
    """Measure one row; no further repeat begins after a total of ``seconds``.

    An error of the method, or a value that is not of finite numbers, becomes a row with its message.
    """
    times: list[float] = []
    errors: list[float] = []
    reports: list[float | None] = []
    spent = 0.0
    try:
        while len(times) < repeats and spent <= seconds:
            start = time.perf_counter()
            result = solve_once(method, budget, len(times))
            times.append(time.perf_counter() - start)
            spent += times[-1]
            value, reported, note = parts_of(result)
            errors.append(problem.error(value, method.name))
            reports.append(reported)
    except Exception as reason:  # of the method, which must not cost the other rows
        note = " ".join(in_words(reason).split())
        return WorkRow(method.name, budget, "failed", seconds=tuple(times), note=note)
    known = [one for one in reports if one is not None]
    together = _root_mean_square(known) if len(known) == len(reports) else None
    return WorkRow(method.name, budget, "done", _root_mean_square(errors), tuple(times), together, note)


def _root_mean_square(values: Sequence[float]) -> float:
    # without overflow
    return math.hypot(*values) / math.sqrt(len(values))


def solve_once(method: WorkMethod, budget: float, repeat: int) -> Any:
    """The result of a method; the number of the repeat chooses the generator of a random one."""
    size = int(budget) if float(budget).is_integer() else budget
    return method.solve(size, np.random.default_rng([SEED, repeat])) if method.is_random else method.solve(size)


def parts_of(result: Any) -> tuple[Any, float | None, str]:
    """Value, reported error and description from the result of a method."""
    if isinstance(result, KernelMatrix):
        return result.symmetric, _number(result.error.value), result.method
    if isinstance(result, Estimate):
        return result.value, _number(result.error), result.method
    return result, None, ""


def _number(error: float) -> float | None:
    return float(error) if np.isfinite(error) else None


def work_precision(
    problem: WorkProblem,
    methods: Sequence[WorkMethod],
    budgets: Budgets,
    *,
    repeats: int = 5,
    seconds: float = 60.0,
    warm_up: bool = True,
    path: str | PathLike[str] | None = None,
    runner: Runner = measure,
) -> WorkReport:
    """Measure the error against the run time of several methods for one quantity, on one core.

    Parameters
    ----------
    problem : WorkProblem
        The quantity, its references and the norm of the error.
    methods : sequence of WorkMethod
    budgets : sequence of numbers, or mapping from a method's name to one
        Budgets of every method, measured in increasing order.
    repeats : int
        Timed runs per method and budget. A run that fails, or whose value is not of finite numbers, makes a row with
        the reason; the other rows keep their values.
    seconds : float
        Time limit of a row in seconds: no further repeat begins after it. If every run of a row exceeds it, larger
        budgets of the method are left out. A running computation is ended only by a ``runner`` with a hard limit.
    warm_up : bool
        Whether each method first runs once, untimed, at its smallest budget, for compilation and loading.
    path : path-like, optional
        A JSON file that is written after every row. If it exists, its rows are reused and only the rest is measured.
    runner : callable
        Function that measures a row from problem, method, budget, repeats and seconds, by default in this process.
        Compiled code must not be interrupted, so a runner with a hard limit uses another process.

    Returns
    -------
    WorkReport

    Raises
    ------
    InputError
        If names repeat, a method has no budgets or no independent reference, or the file belongs to another problem or
        machine.

    Examples
    --------
    >>> from asperity.spectral import ReferenceValue, WorkMethod, WorkProblem
    >>> problem = WorkProblem("integral of x^2", ReferenceValue(1 / 3, 0.0, "closed form"))
    >>> midpoint = WorkMethod("midpoint", lambda n: sum(((i + 0.5) / n) ** 2 for i in range(n)) / n, order=2.0)
    >>> report = work_precision(problem, [midpoint], [8, 16, 32, 64], repeats=1)
    >>> round(report.order("midpoint").order, 6)
    2.0
    """
    instance("problem", problem, WorkProblem, "spec.WorkProblem('a', spec.ReferenceValue(0.5, 0.0, 'by hand'))")
    whole_number("repeats", repeats, 1)
    positive_number("seconds", seconds)
    ladders = _ladders(methods, budgets)
    report = WorkReport.of(problem, methods, Machine.here())
    file = None if path is None else Path(path)
    if file is not None and regular_file(file).exists():
        report = report.continued(WorkReport.of_json(text_of(file)))
    with on_one_core():
        for method in methods:
            earlier = [row for row in report.rows if row.method == method.name]
            for row in _climb(problem, method, ladders[method.name], earlier, (repeats, seconds, warm_up, runner)):
                report = report.with_row(row)
                if file is not None:
                    write_whole(file, report.to_json(), overwrite=True)
    return report


def _climb(
    problem: WorkProblem, method: WorkMethod, ladder: list[float], earlier: list[WorkRow],
    how: tuple[int, float, bool, Runner],
) -> Iterator[WorkRow]:  # fmt: skip
    """The missing rows of one method; after the time limit is reached, rows are left out."""
    repeats, seconds, warm_up, runner = how
    missing = [budget for budget in ladder if budget not in {row.budget for row in earlier}]
    exhausted = any(_met_the_limit(row, seconds) for row in earlier)
    if warm_up and missing and not exhausted:
        runner(problem, method, missing[0], 1, seconds)
    for budget in missing:
        if exhausted:
            yield WorkRow(method.name, budget, "left out", note="a smaller budget met the time limit")
            continue
        row = runner(problem, method, budget, repeats, seconds)
        exhausted = _met_the_limit(row, seconds)
        yield row


def _met_the_limit(row: WorkRow, seconds: float) -> bool:
    """Whether a run was ended, or its least time exceeds the limit."""
    return row.status == "timed out" or (row.is_done and row.least > seconds)


def _ladders(methods: Sequence[WorkMethod], budgets: Budgets) -> dict[str, list[float]]:
    names = [method.name for method in sequence("methods", methods, WorkMethod, "spec.WorkMethod('by hand', float)")]
    if not names or len(set(names)) < len(names):
        raise InputError(f"methods: expected at least one, with different names, got {names}")
    if not isinstance(budgets, (Mapping, Sequence, np.ndarray)):
        raise InputError(f"budgets: expected numbers, for all methods or by name, got {shortened(budgets)}")
    shared = {} if isinstance(budgets, Mapping) else dict.fromkeys(names, budgets)
    given = budgets if isinstance(budgets, Mapping) else shared
    if missing := [name for name in names if not len(given.get(name, ()))]:
        raise InputError(f"budgets: expected at least one for every method, got none for {', '.join(missing)}")
    return {name: sorted(positive_number("budgets", budget) for budget in given[name]) for name in names}
