"""The stability report: every extreme case runs in a process that can be killed."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

from asperity.core.child import ChildCrashed, ChildProcess, OutOfTime
from asperity.core.errors import AsperityError, InputError
from asperity.core.tables import table

from .row import ExtremeRow

# Disks and collisions in each case, bins of the largest matrix, and seconds for each case.
QUICK_SIZE, QUICK_BINS, QUICK_SECONDS = 100, 2_000, 40.0
SIZE, MOST_BINS, SECONDS = 1_000, 10_000, 180.0


@dataclass(frozen=True)
class ExtremeReport:
    """The rows of the stability report.

    Attributes
    ----------
    rows : tuple of ExtremeRow
    """

    rows: tuple[ExtremeRow, ...]

    def table(self) -> str:
        """A Markdown table and the number of cases by verdict."""
        heads = "case | reference | error | may be | unit | fraction that escaped | seconds | verdict | "
        verdicts = Counter(row.verdict for row in self.rows)
        numbers = ", ".join(f"{number} {verdict}" for verdict, number in verdicts.items())
        return f"{table(heads, map(_cells, self.rows))}\n\n{len(self.rows)} cases: {numbers}."


def _cells(row: ExtremeRow) -> str:
    total = sum(row.counts.values())
    flagged = ", ".join(f"{number} {status}" for status, number in row.counts.items() if status != "escaped" and number)
    escaped = "-" if not total else f"{row.counts['escaped'] / total:.4g}" + (f" ({flagged})" if flagged else "")
    errors = "- | -" if row.ended else f"{row.error:.2g} | {row.allowed:.2g}"
    return (
        f"{row.case} | {row.reference} | {errors} | {row.unit} | {escaped} | {row.seconds:.2g} | {row.verdict} "
        f"| {row.note}"
    )


def case_names(quick: bool) -> tuple[str, ...]:
    """Names of all cases."""
    return tuple(_cases(quick))


def run_case(name: str, quick: bool) -> ExtremeRow:
    """Run one case in this process, without a time limit; a refusal gives a row."""
    if name not in _cases(quick):
        raise InputError(f"case: expected one of {', '.join(_cases(quick))}, got {name!r}")
    start = time.perf_counter()
    try:
        row = _cases(quick)[name]()
    except (AsperityError, MemoryError) as reason:
        row = ExtremeRow(name, "-", ended="refused", note=" ".join(f"{type(reason).__name__}: {reason}".split()))
    return replace(row, seconds=time.perf_counter() - start, counts=dict(row.counts))


def run_extremes(
    quick: bool = False, names: Sequence[str] | None = None, seconds: float | None = None
) -> ExtremeReport:
    """Run all cases, or the cases in ``names``, each within its time limit."""
    limit = seconds if seconds is not None else QUICK_SECONDS if quick else SECONDS
    rows = []
    with ChildProcess(_load) as child:
        for name in case_names(quick) if names is None else names:
            try:
                rows.append(child.call(run_case, name, quick, seconds=limit))
            except OutOfTime:
                note = f"ended after {limit:g} s"
                rows.append(ExtremeRow(name, "-", ended="timed out", note=note, seconds=limit))
            except ChildCrashed as reason:
                rows.append(ExtremeRow(name, "-", ended="failed", note=str(reason)))
    return ExtremeReport(tuple(rows))


@cache
def _cases(quick: bool) -> dict[str, Callable[[], ExtremeRow]]:
    from .disks import disk_cases
    from .laws import law_cases
    from .rays import ray_cases

    size = QUICK_SIZE if quick else SIZE
    return {**ray_cases(), **disk_cases(size), **law_cases(size, QUICK_BINS if quick else MOST_BINS)}


def _load() -> None:
    """Load, and on a new machine compile, the loops that serve all walls, before the first case."""
    import numpy as np

    from asperity import geometry as geo
    from asperity.bench.quantities.collision import DISK
    from asperity.geometry.tracing.refinement import refined_trace

    from .disks import WALL

    # a hollow with a closed form, and a hollow with a grid
    for wall in (geo.triangular_teeth(0.7), geo.koch(4)):
        geo.trace(wall, [0.45, 0.55], [1.0, 2.0])
        refined_trace(wall.scene, np.array([0.5]), np.array([1.0]))
    geo.collide(DISK, WALL, 0.1, [[0.0, 0.0]], [[0.1, -1.0, 0.1]])
