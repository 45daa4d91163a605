"""The time saved by each optimisation of the tracer on the walls of the standard set."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.checks import Floats
from ..core.tables import table
from ..geometry import Trace, trace
from ..geometry.scene.ablations import without_boxes, without_formulas, without_pairs, without_runs
from ..geometry.scene.scene import Scene, scene_in_one
from ..kernels import KernelMatrix, Legendre, PolygonLaw, WallLaw, discretise
from ..kernels.discretisation.method import Budget
from ..kernels.discretisation.traced import traced_matrix
from .quantities.walls import standard_names, wall_of
from .running.timing import SideBySide, side_by_side

if TYPE_CHECKING:
    from ..geometry import Wall

# Enough rays that 10 % of their time exceeds the noise, and enough alternating runs to estimate the spread.
RAYS, REPEATS, QUICK_REPEATS = 2**18, 7, 3
SEED = 9
# Rays may differ by this rounding error if a run of hits is computed in one step.
ROUNDED = 1e-9
# Adaptive conditionals are compared on walls with at most this many pieces, at these tolerances.
MIRROR_PIECES, MIRROR_TOLERANCES = 3, (1e-2, 3e-3, 1e-3)
BASIS = Legendre(2)
# Beams for each hollow, in the comparison of walls with equal hollows.
BEAMS = 1000


@dataclass(frozen=True)
class Saving:
    """The saving by one optimisation on one scene.

    Attributes
    ----------
    scene, what : str
    seconds, seconds_without : float
        Least times with and without the optimisation.
    low, high : float
        Least and greatest time ratio in one pair of runs; for half of the angles, over the tolerances.
    difference : float
        Largest difference of the results, in units of their errors if they have errors.
    is_same : bool
        Whether the results agree: to rounding, or within their errors, five times the errors for samples.
    unit : str
        Unit of the times: seconds, or rays, which have no noise.
    """

    scene: str
    what: str
    seconds: float
    seconds_without: float
    low: float
    high: float
    difference: float
    is_same: bool
    unit: str = "s"

    @property
    def factor(self) -> float:
        """The time without the optimisation over the time with it."""
        return self.seconds_without / self.seconds

    def row(self) -> str:
        """A line of the table; it says if the factor does not exceed its noise."""
        same = f"{'yes' if self.is_same else 'NO'} ({self.difference:.1g})"
        times = f"{self.factor:.2g} ({self.low:.2g} to {self.high:.2g})"
        if self.low <= 1.0 <= self.high:
            times += ", noise"
        with_it, without = (f"{time:.2g} {self.unit}" for time in (self.seconds, self.seconds_without))
        return f"{self.scene} | {self.what} | {with_it} | {without} | {times} | {same}"


class WithoutMirror:
    """A wall without information on its mirror axis."""

    is_mirror_symmetric = False

    def __init__(self, wall: Wall) -> None:
        self._wall = wall

    def __getattr__(self, name: str) -> Any:
        return getattr(self._wall, name)


def with_scene(wall: Wall, scene: Scene) -> Wall:
    """A copy of the wall whose rays are traced with another scene."""
    other = copy(wall)
    vars(other)["scene"] = scene
    return other


def savings_of(name: str, rays: int = RAYS, repeats: int = REPEATS) -> list[Saving]:
    """The savings by all optimisations of one scene that can be switched off."""
    wall = wall_of(name)
    plan, scene = wall.plan(), wall.scene
    followed = without_formulas(scene)
    found = []

    def traced(what: str, with_it: Scene, without: Scene) -> None:
        found.append(_traced(name, what, wall, (with_it, without), rays, repeats))

    if plan.closed_forms:
        traced(f"flights in {plan.closed_forms} hollows of two lines or one arc", scene, followed)
    if plan.channels or plan.wedges:
        traced(f"runs between {plan.channels} channels and {plan.wedges} wedges", followed, without_pairs(followed))
    if plan.arcs_with_runs:
        traced(f"runs on {plan.arcs_with_runs} arcs", followed, without_runs(followed))
    if plan.hollows_with_grid:
        what = f"pieces off the way, by boxes in {plan.hollows_with_grid} hollows"
        traced(what, followed, without_boxes(followed))
    if plan.pieces_left_out or plan.hollows > 1:
        what = f"{plan.pieces_left_out} flat tops and {plan.hollows - 1} other hollows"
        traced(what, followed, without_formulas(scene_in_one(wall)))
    if plan.distinct_hollows < plan.hollows and wall.is_polygonal:
        found.append(_equal_hollows(name, wall, repeats))
    if WallLaw(wall).exact_law is not None or WallLaw(wall).closed_form is not None:
        found.append(_tracing(name, wall, rays, repeats))
    if plan.mirror_symmetric and len(wall.pieces) <= MIRROR_PIECES:
        found.append(_half(name, wall))
    return found


def _traced(name: str, what: str, wall: Wall, scenes: tuple[Scene, Scene], rays: int, repeats: int) -> Saving:
    rng = np.random.default_rng(SEED)
    # rays that enter a hollow, because rays on flat tops are never traced
    hollow = scene_hollows(wall)[rng.integers(len(wall.hollows), size=rays)]
    x = hollow[:, 0] + (hollow[:, 1] - hollow[:, 0]) * rng.random(rays)
    theta = np.arccos(1.0 - 2.0 * rng.random(rays))

    def job(scene: Scene) -> Callable[[], Trace]:
        other = with_scene(wall, scene)
        return lambda: trace(other, x, theta, threads=1)

    times = side_by_side(job(scenes[0]), job(scenes[1]), repeats)
    difference = largest_difference(times.first, times.second)
    return _saving(name, what, times, difference, difference <= ROUNDED)


def _saving(name: str, what: str, times: SideBySide[Any, Any], difference: float, is_same: bool) -> Saving:
    seconds = times.first_seconds, times.second_seconds
    return Saving(name, what, *seconds, times.low, times.high, difference, is_same)


def scene_hollows(wall: Wall) -> Floats:
    """Ends of the openings, shape (hollows, 2)."""
    return np.array([(hollow.left, hollow.right) for hollow in wall.hollows])


def largest_difference(first: Trace, second: Trace) -> float:
    """Largest difference of the outgoing angles of rays that escaped in both traces, except for one ray in a thousand.

    Infinite if more rays than that did not escape in both.
    """
    gone = first.escaped & second.escaped
    error = np.sort(np.abs(first.theta - second.theta)[gone])
    most = len(error) - 1 - len(error) // 1000
    return float(error[most]) if gone.mean() > 0.999 else float("inf")


def _equal_hollows(name: str, wall: Wall, repeats: int) -> Saving:
    """Beams of every hollow compared with beams of the different hollows only."""
    plan = wall.plan()
    parts = [_alone(wall, number) for number in range(len(wall.hollows))]

    def together() -> tuple[Floats, float]:
        matrix = _by_beams(wall)
        return matrix.symmetric, matrix.error.value

    def one_by_one() -> tuple[Floats, float]:
        fractions = [part.period / wall.period for part in parts]
        laws = [_by_beams(part) for part in parts]
        level = (1.0 - sum(fractions)) * np.diag([1.0, -1.0])
        total = sum((fraction * law.symmetric for fraction, law in zip(fractions, laws, strict=True)), level)
        return total, sum(fraction * law.error.value for fraction, law in zip(fractions, laws, strict=True))

    times = side_by_side(together, one_by_one, repeats)
    distance = float(np.linalg.norm(times.first[0] - times.second[0]))
    score = distance / (times.first[1] + times.second[1])
    what = f"{plan.hollows - plan.distinct_hollows} hollows that are like others ({BEAMS} beams each)"
    return _saving(name, what, times, score, score <= 1.0)


def _by_beams(wall: Wall) -> KernelMatrix:
    return discretise(PolygonLaw(wall, max_beams=BEAMS), BASIS, "exact")


def _alone(wall: Wall, number: int) -> Wall:
    """One hollow of a polygonal wall, as a wall whose period is the opening."""
    from ..geometry import Wall

    hollow = wall.hollows[number]
    corners = wall.vertices[hollow.first : hollow.last + 1] - [hollow.left, 0.0]
    corners[[0, -1]] = (0.0, 0.0), (hollow.width, 0.0)
    return Wall.from_vertices(corners)


def _tracing(name: str, wall: Wall, rays: int, repeats: int) -> Saving:
    """The law's matrix from rays, compared with the matrix without tracing at the same error."""
    sampled = _by_rays(wall, rays)
    tolerance = sampled.error.value
    # laws cache their results, so each run has its own law
    times = side_by_side(
        lambda: discretise(WallLaw(wall), BASIS, tolerance=tolerance), lambda: _by_rays(wall, rays), repeats
    )
    distance = float(np.linalg.norm(times.first.symmetric - times.second.symmetric))
    score = distance / (times.first.error.value + times.second.error.value)
    what = f"tracing altogether, for an error of {tolerance:.0e} ({rays} rays)"
    return _saving(name, what, times, score, score <= 5.0)


def _by_rays(wall: Wall, rays: int) -> KernelMatrix:
    return discretise(WallLaw(wall), BASIS, "qmc", samples=rays, rng=np.random.default_rng(SEED))


def _half(name: str, wall: Wall) -> Saving:
    """Adaptive conditionals at half of the angles compared with all angles, at equal error.

    Both runs stop at their own errors below the tolerance. The costs are compared at the errors of the halved run; the
    cost of the other run is interpolated in log-log scale.
    """
    halved, whole = ([_rows(one, tolerance) for tolerance in MIRROR_TOLERANCES] for one in (wall, WithoutMirror(wall)))
    errors, rays = (np.array([row[k] for row in whole], dtype=np.float64) for k in (1, 2))
    log_error, log_time = (np.log(part) for part in (errors, rays))
    slope, shift = np.polyfit(log_error, log_time, 1)
    others = [float(np.exp(slope * np.log(row[1]) + shift)) for row in halved]
    ratios = [other / row[2] for other, row in zip(others, halved, strict=True)]
    scores = [
        float(np.linalg.norm(row[0] - other[0])) / (row[1] + other[1]) for row, other in zip(halved, whole, strict=True)
    ]
    seconds = halved[-1][2], others[-1]
    what = "half of the angles, by symmetry (rows, at equal error)"
    return Saving(name, what, *seconds, min(ratios), max(ratios), max(scores), max(scores) <= 1.0, "rays")


def _rows(wall: Wall | WithoutMirror, tolerance: float) -> tuple[Floats, float, float]:
    """Matrix, error and number of rays of adaptive conditionals; rays measure the cost without noise."""
    symmetric, error, rays = traced_matrix(wall, BASIS, Budget(tolerance))  # type: ignore[arg-type]
    return symmetric, error, float(rays)


def savings_table(quick: bool = False) -> str:
    """All scenes: their plans in words, and a line for every optimisation that can be switched off."""
    repeats = QUICK_REPEATS if quick else REPEATS
    rows = (one.row() for name in standard_names() for one in savings_of(name, repeats=repeats))
    plans = ((name, plan_words(wall_of(name))) for name in standard_names())
    saved = table("scene | leaves out | time | without that | times | same result", rows)
    return f"{saved}\n\n{table('scene | what the tracer does', plans)}"


def plan_words(wall: Wall) -> str:
    """The plan of a wall in words, without the parts that do not apply."""
    plan = wall.plan()
    words = [
        f"{plan.pieces_traced} pieces ({', '.join(plan.primitives)}) in {plan.hollows} hollow{'s' * (plan.hollows > 1)}"
    ]
    if plan.hollows > plan.distinct_hollows:
        words[0] += f", {plan.distinct_hollows} of them different"
    if plan.pieces_left_out:
        words.append(f"{plan.pieces_left_out} flat tops of {plan.flat_fraction:.0%} of the period left out")
    if plan.closed_forms:
        words.append(f"{plan.closed_forms} of two lines or one arc, in closed form")
    runs = {"arcs": plan.arcs_with_runs, "channels": plan.channels, "wedges": plan.wedges}
    if any(runs.values()):
        words.append("runs of hits on " + ", ".join(f"{number} {what}" for what, number in runs.items() if number))
    if plan.hollows_with_grid:
        words.append(f"{plan.hollows_with_grid} trees of boxes")
    if plan.mirror_symmetric:
        words.append("mirror-symmetric: half of the angles give the other half")
    return "; ".join(words)
