"""The least time of one job over repeats, and of two jobs in alternation."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

Result = TypeVar("Result")
Other = TypeVar("Other")


def least_time(job: Callable[[], Result], repeats: int) -> tuple[Result, float]:
    """The result of a job and the least time of its repeats in seconds; the first run is not timed."""
    result, best = job(), float("inf")
    for _ in range(repeats):
        result, seconds = _timed(job)
        best = min(best, seconds)
    return result, best


@dataclass(frozen=True)
class SideBySide(Generic[Result, Other]):
    """Two jobs run in alternation.

    Attributes
    ----------
    first, second : object
        Results of the jobs.
    first_seconds, second_seconds : float
        Least times.
    low, high : float
        Least and greatest ratio of the second's time to the first's in one pair of runs.
    """

    first: Result
    second: Other
    first_seconds: float
    second_seconds: float
    low: float
    high: float

    @property
    def ratio(self) -> float:
        """The second's least time over the first's."""
        return self.second_seconds / self.first_seconds

    @property
    def differs(self) -> bool:
        """Whether the same job was slower in every pair of runs."""
        return self.low > 1.0 or self.high < 1.0


def side_by_side(first: Callable[[], Result], second: Callable[[], Other], repeats: int) -> SideBySide[Result, Other]:
    """Run two jobs alternately, so that drift affects both; the first run of each is not timed."""
    results = first(), second()
    times = [(_timed(first)[1], _timed(second)[1]) for _ in range(repeats)]
    ratios = [other / one for one, other in times]
    return SideBySide(*results, min(t for t, _ in times), min(t for _, t in times), min(ratios), max(ratios))


def _timed(job: Callable[[], Result]) -> tuple[Result, float]:
    start = time.perf_counter()
    result = job()
    return result, time.perf_counter() - start
