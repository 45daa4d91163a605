"""Reported errors of adaptive conditionals and matrices, against references by a second method.

``python -m campaigns.errors`` computes the first moment and five conditionals for 24 random curved walls and
tolerances from 1e-4 to 1e-9, matrices in three bases of these walls and of nine with an exact law, matrices of 23
hollows with a channel, and matrices in bins of rectangular teeth of random sizes. It prints how many true errors exceed
the reported errors, and the median ratio of reported to true errors, by wall and by tolerance. Cases beyond the
reference's accuracy are marked.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.tables import table
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.discretisation.traced import traced_matrix
from asperity.kernels.walls.conditionals import adaptive_conditionals

REFERENCES = Path(__file__).parent / "judges" / "reference_rows.json"
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
FLIGHTS = 8_000_000
# Matrices of curved walls are compared with ones of REFERENCE_FACTOR times as many ray segments.
MATRIX_TOLERANCES, MATRIX_FLIGHTS, REFERENCE_FACTOR = (1e-1, 1e-2, 1e-3, 1e-4), 2_000_000, 10
BASES = (ker.Bins(8), ker.Bins(32), ker.Legendre(8))
EXACT = (
    geo.focusing_arcs(0.5), geo.focusing_arcs(1.0), geo.focusing_arcs(1.4), geo.rectangular_teeth(0.5),
    geo.rectangular_teeth(3.0), geo.triangular_teeth(0.4), geo.triangular_teeth(0.9), geo.koch(1), geo.koch(2),
)  # fmt: skip
# Hollows with a channel, of which the angles near grazing have a method of their own, in a basis that it accepts: stem
# over cap and length over width of mushrooms; width, depth and half angle of an arc below parallel sides; and polygons
# below such sides, by fractions of the width and depths below, which have an exact law.
CHANNEL_BASIS, CHANNEL_TOLERANCES, CHANNEL_FLIGHTS = ker.Legendre(4), (1e-3, 1e-4, 1e-5, 1e-6, 1e-7), 40_000_000
MUSHROOMS = (
    (0.05, 0.5), (0.1, 0.3), (0.1, 1.0), (0.2, 0.5), (0.3, 0.2), (0.3, 0.5), (0.3, 1.5), (0.4, 0.7), (0.5, 0.5),
    (0.7, 0.4), (0.8, 1.0), (0.25, 0.5),
)  # fmt: skip
NOTCHES = ((0.5, 0.2, 0.4), (0.5, 0.4, 0.9), (0.5, 0.3, 1.2), (0.5, 0.5, 1.5707), (0.3, 0.4, 0.7), (0.6, 0.1, 0.3))
FLOORS = (
    ((0.5, 0.2),), ((0.5, 0.25),), ((0.25, 0.1), (0.75, 0.1)), ((0.25, 0.15), (0.5, 0.05), (0.75, 0.15)),
    ((0.0, 0.1), (0.5, 0.3), (1.0, 0.1)),
)  # fmt: skip

# Rectangular teeth of random sizes, traced on purpose: ranges of depth over width, of width over period, and bins.
TEETH_COUNT, TEETH_DEPTHS, TEETH_WIDTHS, TEETH_BINS = 40, (0.4, 8.0), (0.2, 0.95), (8, 16, 24, 32, 48)
TEETH_TOLERANCES, TEETH_FLIGHTS = (3e-2, 1e-2, 3e-3, 1e-3), 1_000_000


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
    """The references written by campaigns/judges/reference_rows.py."""
    found: list[dict[str, object]] = json.loads(REFERENCES.read_text(encoding="utf-8"))
    return found


def outcomes(
    kinds: Sequence[int], tolerances: Sequence[float], most_segments: int, moments: bool = True
) -> Iterator[Outcome]:
    """Conditionals and moments of these walls at these tolerances."""
    from campaigns.judges.random_curved_walls import random_curved_wall

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


def matrices(kinds: Sequence[int], most_segments: int) -> Iterator[Outcome]:
    """Matrices of curved walls against much finer ones, and of walls with an exact law against this law."""
    from campaigns.judges.random_curved_walls import random_curved_wall

    for kind in kinds:
        wall = random_curved_wall(kind)
        for basis in BASES:
            fine, error, _ = traced_matrix(wall, basis, Budget(1e-9, segments=REFERENCE_FACTOR * most_segments))
            yield from _against(fine, error, f"matrix {basis!r}", kind, wall, basis, most_segments)
    for kind, wall in enumerate(EXACT):
        for basis in BASES:
            exact = ker.discretise(ker.WallLaw(wall), basis, tolerance=1e-8)
            known = exact.symmetric, float(exact.error)
            yield from _against(*known, f"exact {basis!r}", kind, wall, basis, most_segments)


def channels() -> Iterator[Outcome]:
    """Matrices of hollows with a channel: of polygons against the exact law, of others against the finest one."""
    for kind, floor in enumerate(FLOORS):
        bottom = [(0.2 + 0.5 * x, -0.3 - depth) for x, depth in floor]
        wall = geo.Wall.from_vertices([(0, 0), (0.2, 0), (0.2, -0.3), *bottom, (0.7, -0.3), (0.7, 0), (0.9, 0)])
        exact = ker.discretise(ker.WallLaw(wall), CHANNEL_BASIS, tolerance=1e-8)
        known = exact.symmetric, float(exact.error)
        yield from _against(*known, "channel, exact", kind, wall, CHANNEL_BASIS, CHANNEL_FLIGHTS, CHANNEL_TOLERANCES)
    curved = [geo.mushrooms(*sizes) for sizes in MUSHROOMS] + [_notch(*sizes) for sizes in NOTCHES]
    for kind, wall in enumerate(curved):
        fine, error, _ = traced_matrix(wall, CHANNEL_BASIS, Budget(1e-8, segments=CHANNEL_FLIGHTS))
        what = "channel, mushroom" if kind < len(MUSHROOMS) else "channel, arc"
        yield from _against(fine, error, what, kind, wall, CHANNEL_BASIS, CHANNEL_FLIGHTS, CHANNEL_TOLERANCES)


def teeth() -> Iterator[Outcome]:
    """Matrices in bins of rectangular teeth, hollows with a channel and a level floor, against the exact law."""
    rng = np.random.default_rng(0)
    for kind in range(TEETH_COUNT):
        ratio, width = float(np.exp(rng.uniform(*np.log(TEETH_DEPTHS)))), float(rng.uniform(*TEETH_WIDTHS))
        left, depth = 1.0 - width, ratio * width
        wall = geo.Wall.from_vertices([(0, 0), (left, 0), (left, -depth), (1, -depth), (1, 0)])
        basis = ker.Bins(int(rng.choice(TEETH_BINS)))
        exact = ker.discretise(ker.WallLaw(wall), basis, tolerance=1e-8)
        known = exact.symmetric, float(exact.error)
        yield from _against(*known, "teeth", kind, wall, basis, TEETH_FLIGHTS, TEETH_TOLERANCES)


def _notch(width: float, depth: float, half_angle: float) -> geo.Wall:
    """Parallel sides above an arc."""
    radius = 0.5 * width / math.sin(half_angle)
    center = (0.5 * width, radius * math.cos(half_angle) - depth)
    below = geo.Arc(center, radius, 1.5 * math.pi - half_angle, 1.5 * math.pi + half_angle)
    left, right = (0.0, -depth), (width, -depth)
    sides = geo.Segment((0.0, 0.0), left), geo.Segment(right, (width, 0.0))
    return geo.Wall([sides[0], below.pinned(left, right), sides[1], geo.Segment((width, 0.0), (1.0, 0.0))])


def _against(
    truth: np.ndarray,
    known: float,
    what: str,
    kind: int,
    wall: geo.Wall,
    basis: ker.Basis,
    most_segments: int,
    tolerances: Sequence[float] = MATRIX_TOLERANCES,
) -> Iterator[Outcome]:
    for tolerance in tolerances:
        matrix, error, _ = traced_matrix(wall, basis, Budget(tolerance, segments=most_segments))
        yield Outcome(what, kind, tolerance, error, float(np.linalg.norm(matrix - truth)), known)
        if error > tolerance:
            break


def by_basis(found: Sequence[Outcome]) -> str:
    """A line for each basis and tolerance of the matrices."""
    lines = []
    for what in dict.fromkeys(one.what for one in found):
        for tolerance in dict.fromkeys(one.tolerance for one in found if one.what == what):
            some = [one for one in found if (one.what, one.tolerance) == (what, tolerance)]
            lines.append(f"{what} | {tolerance:.0e} | {summary(some)}")
    lines.append(f"all | | {summary(found)}")
    return table("what | tolerance | numbers | exceed | cannot be told | median of reported/true", lines)


def spread(found: Sequence[Outcome]) -> str:
    """The root mean square of true over reported errors, which is .51 for half widths of 95 %, and the largest."""
    ratios = np.array([1.0 / outcome.ratio for outcome in found if outcome.ratio is not None])
    return f"true/reported: root mean square {np.sqrt(np.mean(ratios**2)):.2f}, largest {ratios.max():.2f}"


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
    parser = argparse.ArgumentParser(prog="python -m campaigns.errors", description=__doc__)
    parser.add_argument("--flights", type=int, default=FLIGHTS, help="flights of rays for a moment at most")
    parser.add_argument("--rows-only", action="store_true", help="leave the moments and matrices out")
    parser.add_argument("--matrices-only", action="store_true", help="leave the rows and moments out")
    parser.add_argument("--channels-only", action="store_true", help="only the matrices of hollows with a channel")
    parser.add_argument("--teeth-only", action="store_true", help="only the matrices of rectangular teeth")
    arguments = parser.parse_args()
    if arguments.teeth_only:
        found = _shown([teeth()])
        print(f"{by_basis(found)}\n{spread(found)}")
        return
    if arguments.channels_only:
        print(by_basis(_shown([channels()])))
        return
    started, kinds = time.process_time(), [entry["kind"] for entry in references()]
    if not arguments.matrices_only:
        moments = not arguments.rows_only
        found = _shown(outcomes([kind], TOLERANCES, arguments.flights, moments) for kind in kinds)
        print(f"\n{by_tolerance(found)}\n\n{by_wall(found)}\n")
    if not arguments.rows_only:
        print(f"{by_basis(_shown([matrices(kinds, MATRIX_FLIGHTS), channels(), teeth()]))}\n")
    print(f"{time.process_time() - started:.0f} s")


def _shown(parts: Iterable[Iterable[Outcome]]) -> list[Outcome]:
    """All outcomes; those that exceed their errors are printed at once."""
    found = []
    for outcome in chain.from_iterable(parts):
        found.append(outcome)
        if outcome.exceeds:
            print(outcome, flush=True)
    return found


if __name__ == "__main__":
    main()
