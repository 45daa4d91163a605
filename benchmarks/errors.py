"""Reported errors of adaptive conditionals and matrices, against references by a second method.

``python -m benchmarks.errors`` computes the first moment and five conditionals for 24 random curved walls and
tolerances from 1e-4 to 1e-9. It prints how many true errors exceed the reported errors, and the median ratio of
reported to true errors, by wall and by tolerance. Cases beyond the reference's accuracy are marked.
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
from asperity.core.tables import table
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.discretisation.traced import traced_matrix
from asperity.kernels.walls.conditionals import adaptive_conditionals

TESTS = Path(__file__).parents[1] / "tests"
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
FLIGHTS = 8_000_000


@dataclass(frozen=True)
class Outcome:
    """One number: its name, tolerance, reported error, distance from the reference, and the reference's error."""

    what: str
    wall: int
    tolerance: float
    reported: float
    distance: float
    reference: float

    @property
    def exceeds(self) -> bool:
        """Whether the true error certainly exceeds the reported error, given the reference's error."""
        return self.distance > self.reported + self.reference

    @property
    def is_open(self) -> bool:
        """Whether the error of the reference decides if the reported error holds."""
        return not self.exceeds and self.distance + self.reference > self.reported

    @property
    def ratio(self) -> float | None:
        """Reported over true error, if the reference is accurate enough to resolve a ratio of 100."""
        return self.reported / max(self.distance, 1e-16) if self.reference < 0.01 * self.reported else None


def references() -> list[dict[str, object]]:
    """The references written by tests/reference_rows.py."""
    found: list[dict[str, object]] = json.loads((TESTS / "reference_rows.json").read_text(encoding="utf-8"))
    return found


def outcomes(
    kinds: Sequence[int], tolerances: Sequence[float], most_segments: int, moments: bool = True
) -> Iterator[Outcome]:
    """Conditionals and moments of these walls at these tolerances."""
    # a module of the tests, not of the library
    from random_curved_walls import random_curved_wall

    table = {entry["kind"]: entry for entry in references()}
    for kind in kinds:
        entry, wall = table[kind], random_curved_wall(kind)
        exact = np.array([float.fromhex(value) for value in entry["rows"]])
        within = moments
        for tolerance in tolerances:
            rows = adaptive_conditionals(wall, entry["angles"], tolerance)
            distance = np.abs(rows.mean(np.cos) - exact)
            for k, miss in enumerate(distance.tolist()):
                yield Outcome("row", kind, tolerance, float(rows.error[k]), miss, entry["row_errors"][k])
            if within:
                matrix, error, _ = traced_matrix(wall, ker.Legendre(2), Budget(tolerance, segments=most_segments))
                miss = abs(float(matrix[1, 1]) - float.fromhex(entry["moment"]))
                yield Outcome("moment", kind, tolerance, error, miss, entry["moment_error"])
                # finer tolerances would end at the same number of ray segments
                within = error <= tolerance


def summary(found: Sequence[Outcome]) -> str:
    """Counts of all outcomes, of exceeded errors and of undecided outcomes, and the median of the ratios."""
    ratios = [outcome.ratio for outcome in found if outcome.ratio is not None]
    median = f"{np.median(ratios):.2g} of {len(ratios)}" if ratios else "-"
    exceeding, unknown = (sum(getattr(outcome, name) for outcome in found) for name in ("exceeds", "is_open"))
    return f"{len(found)} | {exceeding} | {unknown} | {median}"


def by_wall(found: Sequence[Outcome]) -> str:
    """A line for each wall: conditionals and moments together, errors reached, and the reference moment's error."""
    lines = []
    for wall in sorted({outcome.wall for outcome in found}):
        some = [outcome for outcome in found if outcome.wall == wall]
        finest = min(outcome.tolerance for outcome in some)
        row = max(one.reported for one in some if one.what == "row" and one.tolerance == finest)
        moment = min((one for one in some if one.what == "moment"), key=lambda one: one.reported, default=None)
        reached = f"{moment.reported:.0e} | {moment.reference:.0e}" if moment else "- | -"
        lines.append(f"{wall} | {summary(some)} | {row:.0e} | {reached}")
    heads = "wall | numbers | exceed | cannot be told | median of reported/true | worst row | moment | reference"
    return table(heads, lines)


def by_tolerance(found: Sequence[Outcome]) -> str:
    """A line for each tolerance, with separate counts for conditionals and moments."""
    lines = []
    for what in ("row", "moment"):
        some = [outcome for outcome in found if outcome.what == what]
        for tolerance in TOLERANCES:
            lines.append(f"{what} | {tolerance:.0e} | {summary([o for o in some if o.tolerance == tolerance])}")
        lines.append(f"{what}, all |  | {summary(some)}")
    return table("what | tolerance | numbers | exceed | cannot be told | median of reported/true", lines)


def main() -> None:
    """Print the tables."""
    import sys

    sys.path.insert(0, str(TESTS))
    parser = argparse.ArgumentParser(prog="python -m benchmarks.errors", description=__doc__)
    parser.add_argument("--flights", type=int, default=FLIGHTS, help="flights of rays for a moment at most")
    parser.add_argument("--rows-only", action="store_true", help="leave the moments out")
    arguments = parser.parse_args()
    started = time.process_time()
    found = []
    for kind in [entry["kind"] for entry in references()]:
        for outcome in outcomes([kind], TOLERANCES, arguments.flights, not arguments.rows_only):
            found.append(outcome)
            if outcome.exceeds:
                print(outcome, flush=True)
    print(f"\n{by_tolerance(found)}\n\n{by_wall(found)}\n\n{time.process_time() - started:.0f} s")


if __name__ == "__main__":
    main()
