"""The least time of a job over its repeats."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

Result = TypeVar("Result")
# Repeats of a job, and seconds after which no further repeat starts.
REPEATS, SECONDS = 4, 10.0


def least_time(job: Callable[[], Result], repeats: int = REPEATS) -> tuple[Result, float]:
    """The result, and the least time of the repeats in seconds; where there are several the first one may compile."""
    begun, least = time.perf_counter(), float("inf")
    for _ in range(repeats):
        start = time.perf_counter()
        result = job()
        end = time.perf_counter()
        least = min(least, end - start)
        if end - begun > SECONDS:
            break
    return result, least
