"""The numbers to reach, beside what this run reached."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.linalg import eigvalsh

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.bench.running.timing import least_time

from .laws import LawTime
from .memory import MemoryUse
from .robustness import Verdict
from .runs import RunTime
from .throughput import Throughput

ARC_LAMBDA2 = 0.3670253152
LARGE_BINS, LARGE_SAMPLES = 4096, 2**22
TRUE_DISKS, DISK_REPEATS = 2**16, 3
# Million bounces a second that the four walls of `throughput` should reach on one thread, in their order.
BOUNCE_GOALS = (50.0, 35.0, 20.0, 5.0)


Result = TypeVar("Result")


@dataclass(frozen=True)
class Goal:
    """One goal: what, how much, and what was reached; ``is_met`` is None where a part of it was not measured."""

    what: str
    goal: str
    reached: str
    is_met: bool | None


def all_goals(
    throughput: Sequence[Throughput],
    laws: Sequence[LawTime],
    runs: Sequence[RunTime],
    start: dict[str, float],
    robustness: dict[str, Verdict],
    memory: MemoryUse,
) -> list[Goal]:
    """The table of goals, from measurements already made and some more."""
    goals = [
        Goal(
            f"bounces, {row.wall}", f"{goal:g} M/s, two threads 1.8 times",
            f"{row.one_thread / 1e6:.1f} M/s, {row.two_threads / row.one_thread:.2f} times",
            row.one_thread >= 1e6 * goal and row.two_threads >= 1.8 * row.one_thread,
        )
        for row, goal in zip(throughput, BOUNCE_GOALS, strict=True)
    ]  # fmt: skip
    wanted = {
        "triangular teeth, first moment": (1e-14, 0.01),
        "triangular teeth, Bins(512) as an operator": (1e-13, 0.1),
        "triangular teeth, Legendre(64)": (1e-13, 0.1),
        "polygon of 16 vertices, whole law": (1e-12, 0.5),
        "focusing arc, first moment": (1e-10, 1.0),
    }
    by_name = {row.what: row for row in laws}
    for what, (error, seconds) in wanted.items():
        row = by_name[what]
        found = row.reported if np.isnan(row.error) else row.error
        goals.append(_in_time(what, found, row.seconds, error, seconds))
    goals += [_eigenvalue(1e-6, 0.5), _eigenvalue(1e-9, 5.0)]
    goals += [
        Goal(f"run of hits: {row.what}", "below 1 us", f"{1e6 * row.seconds:.2f} us for {row.hits:.1e} hits",
             row.seconds < 1e-6)
        for row in runs
    ]  # fmt: skip
    goals += [_robust(kind, verdict) for kind, verdict in robustness.items()]
    goals += [*_large_matrices(), _true_disk(), _memory(memory)]
    for what, limit in (("import asperity", 0.3), ("first trace, warm cache", 1.5)):
        goals.append(Goal(what, f"{limit:g} s", f"{start[what]:.2f} s", start[what] < limit))
    return goals


def goal_table(goals: Sequence[Goal]) -> list[str]:
    """Markdown lines."""
    word = {True: "yes", False: "**no**", None: "-"}
    rows = [f"| {goal.what} | {goal.goal} | {goal.reached} | {word[goal.is_met]} |" for goal in goals]
    return ["| what | reach | reached | met |", "|---|---|---|---|", *rows]


def _in_time(what: str, error: float, seconds: float, goal: float, limit: float) -> Goal:
    return Goal(
        what, f"{goal:.0e} in {limit:g} s", f"{error:.1e} in {seconds:.3g} s", error <= goal and seconds <= limit
    )


def _eigenvalue(tolerance: float, limit: float) -> Goal:
    law = ker.WallLaw(geo.focusing_arcs(1.2))
    found, seconds = _timed(lambda: spec.spectral_gap(law, tolerance))
    error = abs(1.0 - found.value - ARC_LAMBDA2)
    goal = _in_time("focusing arc, lambda_2 with an error that holds", error, seconds, tolerance, limit)
    holds = error <= found.error <= tolerance
    return Goal(goal.what, goal.goal, f"{goal.reached}, reported {found.error:.1e}", bool(goal.is_met and holds))


def _robust(kind: str, verdict: Verdict) -> Goal:
    what = {"corners": "rays aimed at corners and tangencies", "grazing": "rays at grazing angles"}[kind]
    reached = f"{verdict.lost} lost, {verdict.wrong} wrong, {verdict.flagged} flagged of {verdict.rays:.1g}"
    return Goal(what, "0 lost, 0 wrong of 1e+06", reached, verdict.lost == 0 and verdict.wrong == 0)


def _memory(memory: MemoryUse) -> Goal:
    peaks = ", ".join(f"{peak / 1e6:.1f}" for peak in memory.peaks)
    rays = ", ".join(f"{number:.1g}" for number in memory.rays)
    return Goal(
        "memory of a 1e+10-ray estimate", "that of its matrix, for any number of rays",
        f"{peaks} MB for {rays} rays, matrix {memory.matrix / 1e6:.1f} MB", not memory.grows,
    )  # fmt: skip


def _large_matrices() -> list[Goal]:
    """A smooth law, a curved wall's law sampled, and pairs of which no mirror symmetry is known."""
    rng, basis = np.random.default_rng(0), ker.Bins(LARGE_BINS)
    arc = ker.CircularArcLaw(1.2)
    incoming = np.arccos(1.0 - 2.0 * rng.random(LARGE_SAMPLES))
    matrices = {
        "Henyey-Greenstein 0.9": ker.discretise(ker.henyey_greenstein(0.9), basis),
        "focusing arc": ker.discretise(arc, basis, method="qmc", samples=LARGE_SAMPLES, rng=rng),
        "pairs of angles": ker.estimate(incoming, arc.sample(incoming, rng), basis, symmetrise=True),
    }
    # what is imported at the first use is no part of it
    spec.spectrum(ker.discretise(ker.maxwell(0.5), ker.Bins(LARGE_BINS // 4)), k=2)
    return [_large_matrix(name, matrix) for name, matrix in matrices.items()]


def _large_matrix(name: str, matrix: ker.KernelMatrix) -> Goal:
    _, alone = _timed(lambda: eigvalsh(matrix.symmetric))
    found, seconds = _timed(lambda: spec.spectrum(matrix, k=2))
    ratio, error = seconds / alone, float(found.gap_errors.algebraic[0])
    return Goal(
        f"gap of {LARGE_BINS} bins with its proof, {name}", "0.15 of eigvalsh",
        f"{ratio:.2f} of eigvalsh, {seconds:.2g} s; gap proved within {error:.0e}", ratio <= 0.15,
    )  # fmt: skip


def _true_disk() -> Goal:
    from asperity.bench.quantities.collision import DISK, sampled_velocities

    rng = np.random.default_rng(0)
    wall, scale = geo.triangular_teeth(0.7), 1e-3
    velocity = -sampled_velocities(TRUE_DISKS, rng)
    position = np.column_stack([scale * rng.random(TRUE_DISKS), 2.0 * np.pi * rng.random(TRUE_DISKS)])
    _, seconds = least_time(lambda: geo.collide(DISK, wall, scale, position, velocity, threads=1), DISK_REPEATS)
    rate = TRUE_DISKS / seconds
    return Goal("true disk", "2 M collisions/s", f"{rate / 1e6:.2f} M collisions/s", rate >= 2e6)


def _timed(job: Callable[[], Result]) -> tuple[Result, float]:
    """Of a job of seconds the second run is enough."""
    return least_time(job, 1)
