"""The least time of a job over its repeats."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")


def least_time(job: Callable[[], Result], repeats: int) -> tuple[Result, float]:
    """The result of a job and the least time of its repeats in seconds; the first run is not timed."""
    result, best = job(), float("inf")
    for _ in range(repeats):
        start = time.perf_counter()
        result = job()
        best = min(best, time.perf_counter() - start)
    return result, best
