"""Run one method at one budget: its times, its errors, or why there are none."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from ...checks import Floats
from ...errors import AsperityError
from ...estimates import Estimate
from ...kernels import KernelMatrix
from .problem import WorkMethod, WorkProblem
from .work_row import WorkRow

# Independent generators of the repeats come from this and the repeat's number.
SEED = 20220


def measure(problem: WorkProblem, method: WorkMethod, budget: float, repeats: int, seconds: float) -> WorkRow:
    """One row; repeats end early, but not before the first, when together they take longer than ``seconds``.

    Errors of ours, of arithmetic, of linear algebra and of memory become a row with their message.
    """
    times: list[float] = []
    errors: list[dict[str, float]] = []
    try:
        while len(times) < repeats and sum(times) <= seconds:
            start = time.perf_counter()
            result = _solve(method, budget, len(times))
            times.append(time.perf_counter() - start)
            value, reported, note = _parts(result)
            errors.append(problem.errors(value, method.name))
    except (AsperityError, ArithmeticError, MemoryError, np.linalg.LinAlgError) as reason:
        words = " ".join(f"{type(reason).__name__}: {reason}".split())
        return WorkRow(method.name, budget, "failed", seconds=tuple(times), note=words)
    norms = {name: float(np.sqrt(np.mean([one[name] ** 2 for one in errors]))) for name in problem.norms}
    return WorkRow(method.name, budget, "done", norms, tuple(times), reported, note)


def _solve(method: WorkMethod, budget: float, repeat: int) -> Any:
    size = int(budget) if float(budget).is_integer() else budget
    return method.solve(size, np.random.default_rng([SEED, repeat])) if method.is_random else method.solve(size)


def _parts(result: Any) -> tuple[Floats, float | None, str]:
    """Value, reported error and method of whatever a method returns."""
    if isinstance(result, KernelMatrix):
        return result.symmetric, _number(result.error.value), result.method
    if isinstance(result, Estimate):
        return np.asarray(result.value), _number(result.error), result.method
    return np.asarray(result, dtype=np.float64), None, ""


def _number(error: float) -> float | None:
    return float(error) if np.isfinite(error) else None
