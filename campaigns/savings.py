"""The time saved by each optimisation of the tracer on the walls of the standard set."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy

import numpy as np

from asperity.bench.quantities.walls import standard_names, wall_of
from asperity.core.tables import table
from asperity.geometry import Trace, Wall, trace
from asperity.geometry.scene.ablations import without_boxes, without_formulas, without_pairs, without_runs
from asperity.geometry.scene.scene import Scene, scene_in_one

from .timing import side_by_side

# Enough rays that 10 % of their time exceeds the noise, and enough alternating runs to estimate the spread.
RAYS, REPEATS, QUICK_REPEATS = 2**18, 7, 3
SEED = 9
# Rays may differ by this rounding error if a run of hits is computed in one step.
ROUNDED = 1e-9


def ablations(wall: Wall) -> Iterator[tuple[str, Scene, Scene]]:
    """The optimisations that the wall's scene uses: a description, a scene with it and a scene without it."""
    plan, scene = wall.plan(), wall.scene
    followed = without_formulas(scene)
    if plan.closed_forms:
        yield f"flights in {plan.closed_forms} hollows of two lines or one arc", scene, followed
    if plan.channels or plan.wedges:
        what = f"runs between {plan.channels} channels and {plan.wedges} wedges"
        yield what, followed, without_pairs(followed)
    if plan.arcs_with_runs:
        yield f"runs on {plan.arcs_with_runs} arcs", followed, without_runs(followed)
    if plan.hollows_with_grid:
        yield f"distant pieces, by boxes in {plan.hollows_with_grid} hollows", followed, without_boxes(followed)
    if plan.pieces_left_out or plan.hollows > 1:
        what = f"{plan.pieces_left_out} flat tops and {plan.hollows - 1} other hollows"
        yield what, followed, without_formulas(scene_in_one(wall))


def job(wall: Wall, scene: Scene, rays: int = RAYS) -> Callable[[], Trace]:
    """Trace rays that enter hollows, because rays on flat tops are never traced, with another scene."""
    rng = np.random.default_rng(SEED)
    hollows = np.array([(hollow.left, hollow.right) for hollow in wall.hollows])
    left, right = hollows[rng.integers(len(hollows), size=rays)].T
    x, theta = left + (right - left) * rng.random(rays), np.arccos(1.0 - 2.0 * rng.random(rays))
    other = copy(wall)
    vars(other)["scene"] = scene
    return lambda: trace(other, x, theta, threads=1)


def largest_difference(first: Trace, second: Trace) -> float:
    """Largest difference of the outgoing angles of rays that escaped in both traces, except for one ray in a thousand.

    Infinite if more rays than that did not escape in both.
    """
    gone = first.escaped & second.escaped
    error = np.sort(np.abs(first.theta - second.theta)[gone])
    return float(error[len(error) - 1 - len(error) // 1000]) if gone.mean() > 0.999 else float("inf")


def savings_table(quick: bool = False) -> str:
    """All scenes: their plans in words, and a line for every optimisation that can be switched off."""
    rows = []
    for name in standard_names():
        wall = wall_of(name)
        for what, with_it, without in ablations(wall):
            times = side_by_side(job(wall, with_it), job(wall, without), QUICK_REPEATS if quick else REPEATS)
            factor = f"{times.ratio:.2g} ({times.low:.2g} to {times.high:.2g}){'' if times.differs else ', noise'}"
            difference = largest_difference(times.first, times.second)
            same = f"{'yes' if difference <= ROUNDED else 'NO'} ({difference:.1g})"
            seconds = f"{times.first_seconds:.2g} s | {times.second_seconds:.2g} s"
            rows.append(f"{name} | {what} | {seconds} | {factor} | {same}")
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
