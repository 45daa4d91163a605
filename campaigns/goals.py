"""The performance goals, with the values reached in this run."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigvalsh
from threadpoolctl import threadpool_limits

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.tables import table
from asperity.geometry.polygons.beams import beams_of
from asperity.kernels.discretisation.isometry_tables import table_matrix
from asperity.kernels.walls.polygon import table_of_beams
from asperity.spectral.work_diagrams.runs import measure
from campaigns.judges import precise_triangular

from .bounces import MORE, Throughput
from .memory import MemoryUse
from .timing import least_time
from .wall_goals import Goal, wall_goals

# <u, P u> / <u, u> for u = cos(theta): closed forms and independent quadrature, see docs/theory/closed-forms.md
TRIANGULAR_MOMENT, ARC_MOMENT = 0.134541971359171, 0.327558333378
ARC_LAMBDA2 = 0.3670253152
# Repeats of a computation, and seconds after which no further repeat starts.
REPEATS, SECONDS = 4, 10.0
LARGE_BINS, LARGE_SAMPLES = 4096, 2**22
# Goals in million bounces a second on one thread; of the last six walls three times what the tracer reached without
# waves and trees of boxes.
BOUNCE_GOALS = {
    "triangular teeth (2 lines)": 50.0,
    "focusing arc (1 arc)": 35.0,
    "mushroom (6 lines, 1 arc)": 40.0,
    "Koch 4 (256 lines)": 10.0,
    "dispersing arcs": 25.0,
    "valley of 6 arcs": 18.0,
    "double parabola (Bezier)": 20.0,
    "32 Bezier pieces": 3.8,
    "profile, 1,000 lines": 9.5,
    "profile, 10^5 lines": 2.4,
}
SPEED_UP = 1.9


def all_goals(
    throughput: Sequence[Throughput],
    runs: Sequence[tuple[str, float, float]],
    start: Mapping[str, float],
    memory: MemoryUse,
    disks: float,
) -> list[Goal]:
    """The goals, from the given measurements and further ones.

    The arguments are: bounces a second on walls; runs with hits and seconds for each ray;
    seconds of fresh processes; the memory of estimates; true disks a second.
    """
    goals = [
        Goal(
            f"bounces, {row.wall}", f"{BOUNCE_GOALS[row.wall]:g} M/s", f"{row.one_thread / 1e6:.1f} M/s",
            row.one_thread >= 1e6 * BOUNCE_GOALS[row.wall],
        )
        for row in throughput
    ]  # fmt: skip
    goals += [
        Goal(
            f"two threads against one, {row.wall}", f"{SPEED_UP:g} times",
            f"{row.speed_up:.2f} times; of {MORE} times as many rays {row.speed_up_of_more:.2f}",
            row.speed_up >= SPEED_UP,
        )
        for row in throughput
    ]  # fmt: skip
    goals += _laws()
    goals += [
        Goal(f"run of hits: {what}", "below 1 us", f"{1e6 * seconds:.2f} us for {hits:.1e} hits", seconds < 1e-6)
        for what, hits, seconds in runs
    ]
    goals += _large_matrices()
    goals += [Goal("true disk", "2 M collisions/s", f"{disks / 1e6:.2f} M collisions/s", disks >= 2e6)]
    goals += [_memory(memory)]
    for what, limit in (("import asperity", 0.3), ("first trace, warm cache", 1.5)):
        goals.append(Goal(what, f"{limit:g} s", f"{start[what]:.2f} s", start[what] < limit))
    return goals + wall_goals()


def goal_table(goals: Sequence[Goal]) -> str:
    """All goals in Markdown."""
    rows = (f"{goal.what} | {goal.goal} | {goal.reached} | {'yes' if goal.is_met else '**no**'}" for goal in goals)
    return table("what | reach | reached | met", rows)


def _laws() -> list[Goal]:
    """Errors and times of moments, matrices and eigenvalues."""
    teeth, arc, closed = geo.triangular_teeth(0.7), geo.focusing_arcs(1.2), ker.TriangularTeethLaw(0.7)
    bins, legendre = ker.Bins(precise_triangular.BINS), ker.Legendre(64)
    precise = ker.TriangularTeethLaw(precise_triangular.ANGLE)
    beams, _ = table_matrix(table_of_beams(beams_of(teeth.vertices)), legendre)
    goals = [
        _in_time("triangular teeth, first moment", TRIANGULAR_MOMENT, lambda: _moment(teeth), 1e-14, 0.01),
        # the next goal uses the Frobenius norm, which a matrix error bounds
        _in_time(
            f"triangular teeth, Bins({bins.size}) as an operator", precise_triangular.reference(),
            lambda: ker.discretise(precise, bins), 1e-13, 0.1, norm="operator",
        ),
        _in_time("triangular teeth, Legendre(64)", beams, lambda: ker.discretise(closed, legendre), 1e-13, 0.1),
        # the error bound from its beams
        _in_time("polygon of 16 vertices, whole law", 0.0, lambda: _unresolved(random_polygon()), 1e-12, 0.5),
        _in_time("focusing arc, first moment", ARC_MOMENT, lambda: _moment(arc), 1e-10, 1.0),
    ]  # fmt: skip
    what = "focusing arc, lambda_2 with an error that holds"
    return goals + [
        _in_time(
            what, 1.0 - ARC_LAMBDA2, lambda tolerance=tolerance: spec.spectral_gap(ker.WallLaw(arc), tolerance),
            tolerance, limit, holds=True,
        )
        for tolerance, limit in ((1e-6, 0.5), (1e-9, 5.0))
    ]  # fmt: skip


def _in_time(
    what: str, right: ArrayLike, solve: Callable[[], Any], goal: float, limit: float, *, norm: str = "",
    holds: bool = False,
) -> Goal:  # fmt: skip
    """A goal of error and time; if ``holds``, the reported error must lie between the true error and the goal."""
    problem = spec.WorkProblem(what, spec.ReferenceValue(right, 0.0, "closed form or independent quadrature"))
    row = measure(problem, spec.WorkMethod("auto", lambda _: solve()), 1.0, REPEATS, SECONDS)
    error = row.errors[norm or next(iter(problem.norms))]
    met, reached = error <= goal and row.least <= limit, f"{error:.1e} in {row.least:.3g} s"
    if holds and row.reported is not None:
        met, reached = met and error <= row.reported <= goal, f"{reached}, reported {row.reported:.1e}"
    return Goal(what, f"{goal:.0e} in {limit:g} s", reached, met)


def _moment(wall: geo.Wall) -> float:
    """By the method that the library chooses."""
    return float(ker.discretise(ker.WallLaw(wall), ker.Legendre(2)).symmetric[1, 1])


def random_polygon() -> geo.Wall:
    """A polygonal wall with sixteen random vertices below the opening."""
    rng = np.random.default_rng(16)
    x = np.concatenate([[0.0], np.sort(rng.random(14)), [1.0]])
    y = np.concatenate([[0.0], -0.1 - 0.8 * rng.random(14), [0.0]])
    return geo.Wall.from_vertices(np.column_stack([x, y]))


def _unresolved(wall: geo.Wall) -> float:
    law = ker.PolygonLaw(wall)
    law.branches(1.0)
    return float(law.unresolved)


def _memory(memory: MemoryUse) -> Goal:
    peaks = ", ".join(f"{peak / 1e6:.1f}" for peak in memory.peaks)
    rays = ", ".join(f"{number:.1g}" for number in memory.rays)
    return Goal(
        "memory of a 1e+10-ray estimate", "that of its matrix, for any number of rays",
        f"{peaks} MB for {rays} rays, matrix {memory.matrix / 1e6:.1f} MB", not memory.grows,
    )  # fmt: skip


def _large_matrices() -> list[Goal]:
    """A smooth law, a sampled law of a curved wall, and pairs without a known mirror symmetry."""
    rng, basis = np.random.default_rng(0), ker.Bins(LARGE_BINS)
    arc = ker.CircularArcLaw(1.2)
    incoming = np.arccos(1.0 - 2.0 * rng.random(LARGE_SAMPLES))
    matrices = {
        "Henyey-Greenstein 0.9": ker.discretise(ker.henyey_greenstein(0.9), basis),
        "focusing arc": ker.discretise(arc, basis, method="qmc", samples=LARGE_SAMPLES, rng=rng),
        "pairs of angles": ker.estimate(incoming, arc.sample(incoming, rng), basis, symmetrise=True),
    }
    # exclude imports at first use
    spec.spectrum(ker.discretise(ker.maxwell(0.5), ker.Bins(LARGE_BINS // 4)), k=2)
    with threadpool_limits(1):
        return [_large_matrix(name, matrix) for name, matrix in matrices.items()]


def _large_matrix(name: str, matrix: ker.KernelMatrix) -> Goal:
    _, alone = least_time(lambda: eigvalsh(matrix.symmetric), 1)
    found, seconds = least_time(lambda: spec.spectrum(matrix, k=2), 1)
    ratio, error = seconds / alone, float(found.gap_errors.algebraic[0])
    return Goal(
        f"gap of {LARGE_BINS} bins, checked to be complete, {name}", "0.15 of eigvalsh",
        f"{ratio:.2f} of eigvalsh, {seconds:.2g} s; gap to {error:.0e}", ratio <= 0.15,
    )  # fmt: skip
