"""The least time of a job over repeats."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")


def least_time(job: Callable[[], Result], repeats: int) -> tuple[Result, float]:
    """What a job returns, and the least time of its repeats, in seconds; a run before them is not timed."""
    result, best = job(), float("inf")
    for _ in range(repeats):
        start = time.perf_counter()
        result = job()
        best = min(best, time.perf_counter() - start)
    return result, best
