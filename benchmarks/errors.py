"""Reported errors of adaptive rows and matrices against the references of a second method.

``python -m benchmarks.errors`` takes all random curved walls and tolerances from 1e-4 to 1e-9: of each the first moment
and five rows. It prints how many true errors exceed the reported ones, and how many times the reported ones exceed the
true ones in the median.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from asperity import kernels as ker
from asperity.kernels.row_quadrature import row_matrix
from asperity.kernels.wall_rows import adaptive_rows

TESTS = Path(__file__).parents[1] / "tests"
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
RAYS = 2_000_000


@dataclass(frozen=True)
class Outcome:
    """One number: which, the tolerance, the error that was reported, the true one, and that of the reference."""

    what: str
    wall: int
    tolerance: float
    reported: float
    true: float
    reference: float

    @property
    def held(self) -> bool:
        """Whether the true error is below the reported one, as far as the reference can tell."""
        return self.true <= self.reported + self.reference

    @property
    def is_told(self) -> bool:
        """Whether the reference is so much better than the report that it can tell how much that exaggerates."""
        return self.reference < 0.01 * self.reported


def references() -> list[dict[str, object]]:
    """What tests/reference_rows.py has written."""
    found: list[dict[str, object]] = json.loads((TESTS / "reference_rows.json").read_text(encoding="utf-8"))
    return found


def outcomes(
    kinds: Sequence[int], tolerances: Sequence[float], most_rays: int, moments: bool = True
) -> Iterator[Outcome]:
    """Rows and moments of these walls to these tolerances."""
    # of the tests, not of the library
    from random_curved_walls import random_curved_wall

    table = {entry["kind"]: entry for entry in references()}
    for kind in kinds:
        entry, wall = table[kind], random_curved_wall(kind)
        exact = np.array([float.fromhex(value) for value in entry["rows"]])
        for tolerance in tolerances:
            rows = adaptive_rows(wall, entry["angles"], tolerance)
            true = np.abs(rows.mean(np.cos) - exact)
            for k, miss in enumerate(true.tolist()):
                yield Outcome("row", kind, tolerance, float(rows.error[k]), miss, entry["row_errors"][k])
            if moments and "moment" in entry:
                matrix, error, _ = row_matrix(wall, ker.Legendre(2), tolerance, most_rays)
                miss = abs(float(matrix[1, 1]) - float.fromhex(entry["moment"]))
                yield Outcome("moment", kind, tolerance, error, miss, entry["moment_error"])


def summary(found: Sequence[Outcome]) -> str:
    """How many, how many did not hold, and the median of the ratios that can be told."""
    wrong = sum(not outcome.held for outcome in found)
    ratios = [outcome.reported / max(outcome.true, 1e-16) for outcome in found if outcome.is_told]
    median = f"{np.median(ratios):.2g}" if ratios else "-"
    return f"{len(found)} | {wrong} | {len(ratios)} | {median}"


def main() -> None:
    """Print the tables."""
    import sys

    sys.path.insert(0, str(TESTS))
    parser = argparse.ArgumentParser(prog="python -m benchmarks.errors", description=__doc__)
    parser.add_argument("--rays", type=int, default=RAYS, help="rays for a moment at most")
    parser.add_argument("--rows-only", action="store_true", help="leave the moments out")
    arguments = parser.parse_args()
    started = time.process_time()
    found = []
    for kind in [entry["kind"] for entry in references()]:
        for outcome in outcomes([kind], TOLERANCES, arguments.rays, not arguments.rows_only):
            found.append(outcome)
            if not outcome.held:
                print(outcome, flush=True)
    print("| what | tolerance | numbers | not held | told | median of reported/true |\n|---|---|---|---|---|---|")
    for what in ("row", "moment"):
        for tolerance in TOLERANCES:
            some = [outcome for outcome in found if outcome.what == what and outcome.tolerance == tolerance]
            print(f"| {what} | {tolerance:.0e} | {summary(some)} |")
    print(f"| all | | {summary(found)} |\n\n{time.process_time() - started:.0f} s")


if __name__ == "__main__":
    main()
