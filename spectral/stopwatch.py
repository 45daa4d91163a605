"""Run one method at one budget: its times, its value, and an end to it when its time is up."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import numpy as np

from ..checks import Floats
from ..errors import AsperityError
from ..estimates import Estimate
from ..kernels import KernelMatrix
from .work_problem import WorkMethod, WorkProblem
from .work_row import WorkRow

# Independent generators of the repeats come from this and the repeat's number.
SEED = 20220


class OutOfTime(Exception):
    """The time limit has passed."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise `OutOfTime` in the main thread after so many seconds.

    A compiled loop is interrupted when it returns; what can hang inside one belongs into a process of its own. Outside
    the main thread, and on systems without alarms, there is no limit.
    """
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        raise OutOfTime

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def measure(problem: WorkProblem, method: WorkMethod, budget: float, repeats: int, seconds: float) -> WorkRow:
    """One row; repeats end early, but not before the first, when together they take longer than ``seconds``.

    What goes wrong becomes a row: errors of ours, of linear algebra and of memory with their message, and time-outs.
    """
    times: list[float] = []
    errors: list[dict[str, float]] = []
    reported: float | None = None
    note = ""
    try:
        with time_limit(seconds):
            for repeat in range(repeats):
                start = time.perf_counter()
                result = _solve(method, budget, repeat)
                times.append(time.perf_counter() - start)
                value, reported, note = _parts(result)
                errors.append(problem.errors(value, method.name))
    except OutOfTime:
        if not errors:
            return WorkRow(method.name, budget, "timed out", seconds=(seconds,), note=f"stopped after {seconds:g} s")
    except (AsperityError, ArithmeticError, MemoryError, np.linalg.LinAlgError) as reason:
        words = " ".join(f"{type(reason).__name__}: {reason}".split())
        return WorkRow(method.name, budget, "failed", seconds=tuple(times), note=words)
    # an alarm between the end of a run and its error leaves a time without an error
    norms = {name: float(np.sqrt(np.mean([one[name] ** 2 for one in errors]))) for name in problem.norms}
    return WorkRow(method.name, budget, "done", norms, tuple(times[: len(errors)]), reported, note)


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
