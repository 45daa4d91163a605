"""What each scene of the standard set leaves out, and what that saves: timed with it, and with it switched off."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import Floats
from ..geometry import Trace, trace
from ..geometry.scene import Scene
from ..kernels import Legendre, WallLaw, discretise
from ..kernels.row_quadrature import row_matrix
from .scenes import standard_names, wall_of
from .timing import least_time

if TYPE_CHECKING:
    from ..geometry import Wall

QUICK_RAYS, RAYS, REPEATS = 2**12, 2**17, 3
SEED = 9
# The column of `Scene.circles` below whose value a run along an arc is skipped, and the first of a hollow's grid.
RUN_COLUMN, GRID_COLUMNS = 10, slice(13, 20)
# Rays differ by rounding where a run of hits is taken in one step.
ROUNDED = 1e-9
# Adaptive rows are compared on walls of so few pieces, to this tolerance: a second at most.
ROW_PIECES, ROW_TOLERANCE = 3, 1e-2
# Columns of `Scene.lines` with the range of a line's rows in `pairs`.
PAIR_COLUMNS = slice(5, 7)


@dataclass(frozen=True)
class Saving:
    """One thing that a scene leaves out.

    Attributes
    ----------
    scene, what : str
    seconds, seconds_without : float
        Least times with it left out and with it computed.
    difference : float
        Largest difference of the results, or that in units of their errors where they have some.
    is_same : bool
        Whether the results are the same: to rounding, or within their errors, five of those from samples.
    """

    scene: str
    what: str
    seconds: float
    seconds_without: float
    difference: float
    is_same: bool

    @property
    def factor(self) -> float:
        """How many times as long it takes without."""
        return self.seconds_without / self.seconds


class WithoutMirror:
    """A wall that does not know of its mirror axis."""

    is_mirror_symmetric = False

    def __init__(self, wall: Wall) -> None:
        self._wall = wall

    def __getattr__(self, name: str) -> Any:
        return getattr(self._wall, name)


class SceneWithout:
    """A wall whose rays are traced with other tables; it has what `trace` asks of a wall."""

    def __init__(self, wall: Wall, scene: Scene) -> None:
        self.period, self.scene = wall.period, scene


def savings_of(name: str, rays: int = RAYS, repeats: int = REPEATS) -> list[Saving]:
    """Everything that one scene leaves out and that can be switched off."""
    wall = wall_of(name)
    plan, scene = wall.plan(), wall.scene
    found = []
    if plan.closed_forms:
        what = f"flights in {plan.closed_forms} hollows of two lines or one arc"
        found.append(_traced(name, what, wall, scene, without_closed_forms(scene), rays, repeats))
    scene = without_closed_forms(scene)
    if plan.channels or plan.wedges:
        what = f"runs between {plan.channels} channels and {plan.wedges} wedges"
        found.append(_traced(name, what, wall, scene, without_pairs(scene), rays, repeats))
    if plan.arcs_with_runs:
        what = f"runs on {plan.arcs_with_runs} arcs"
        found.append(_traced(name, what, wall, scene, without_runs(scene), rays, repeats))
    if plan.hollows_with_grid:
        what = f"pieces off the way, by a grid in {plan.hollows_with_grid} hollows"
        found.append(_traced(name, what, wall, scene, without_grid(scene), rays, repeats))
    if plan.pieces_left_out or plan.hollows > 1:
        what = f"{plan.pieces_left_out} flat tops and {plan.hollows - 1} other hollows"
        found.append(_traced(name, what, wall, scene, as_one_hollow(wall), rays, repeats))
    if WallLaw(wall).exact_law is not None or WallLaw(wall).closed_form is not None:
        found.append(_tracing(name, wall, rays, repeats))
    if plan.mirror_symmetric and len(wall.pieces) <= ROW_PIECES:
        found.append(_half(name, wall, repeats))
    return found


def without_pairs(scene: Scene) -> Scene:
    """The tables without channels and wedges: every hit between facing lines is a step."""
    assert scene.lines is not None
    lines = scene.lines.copy()
    lines[:, PAIR_COLUMNS] = 0.0
    return replace(scene, pairs=None, lines=lines)


def without_runs(scene: Scene) -> Scene:
    """The tables without runs along arcs: every hit on an arc is a step."""
    assert scene.circles is not None
    circles = scene.circles.copy()
    circles[:, RUN_COLUMN] = 0.0
    return replace(scene, circles=circles)


def without_closed_forms(scene: Scene) -> Scene:
    """The tables without closed forms: every ray is followed from flight to flight."""
    return replace(scene, closed=None)


def without_grid(scene: Scene) -> Scene:
    """The tables without grids: every line of a hollow is tested."""
    hollows = scene.hollows.copy()
    hollows[:, GRID_COLUMNS] = 0.0
    return replace(scene, hollows=hollows, grid=None)


def as_one_hollow(wall: Wall) -> Scene:
    """The tables of the whole cell as one hollow: a single list of all pieces, the flat tops among them."""
    from ..geometry.scene import _Chain, _corners, _Tables

    tables = _Tables()
    places = [(float(x), float(y)) for x, y in wall.vertices]
    chain = _Chain(list(wall.pieces), places, _corners(list(wall.pieces)))
    tables.add_hollow(0.0, wall.period, [chain], edges=(2, 2))
    return tables.scene(wall.period, False)


def _traced(name: str, what: str, wall: Wall, scene: Scene, other: Scene, rays: int, repeats: int) -> Saving:
    rng = np.random.default_rng(SEED)
    # rays that enter a hollow: those on flat tops are never traced
    hollow = scene_hollows(wall)[rng.integers(len(wall.hollows), size=rays)]
    x = hollow[:, 0] + (hollow[:, 1] - hollow[:, 0]) * rng.random(rays)
    theta = np.arccos(1.0 - 2.0 * rng.random(rays))
    whole, plain = SceneWithout(wall, scene), SceneWithout(wall, other)
    with_it, seconds = least_time(lambda: trace(whole, x, theta, threads=1), repeats)  # type: ignore[arg-type]
    without, longer = least_time(lambda: trace(plain, x, theta, threads=1), repeats)  # type: ignore[arg-type]
    difference = largest_difference(with_it, without)
    return Saving(name, what, seconds, longer, difference, difference <= ROUNDED)


def scene_hollows(wall: Wall) -> Floats:
    """Ends of the openings, shape (hollows, 2)."""
    return np.array([(hollow.left, hollow.right) for hollow in wall.hollows])


def largest_difference(first: Trace, second: Trace) -> float:
    """Of the outgoing angles of the rays that escaped with the same number of hits in both, but for one in a thousand.

    Infinite where more rays than that part ways: at a corner rounding decides.
    """
    gone = first.escaped & second.escaped
    error = np.sort(np.abs(first.theta - second.theta)[gone])
    most = len(error) - 1 - len(error) // 1000
    return float(error[most]) if gone.mean() > 0.999 else float("inf")


def _tracing(name: str, wall: Wall, rays: int, repeats: int) -> Saving:
    """The law's matrix without tracing, against the same from as many rays."""
    law, basis = WallLaw(wall), Legendre(2)
    exact, seconds = least_time(lambda: discretise(WallLaw(wall), basis), repeats)
    sampled, longer = least_time(
        lambda: discretise(law, basis, "qmc", samples=rays, rng=np.random.default_rng(SEED)), repeats
    )
    distance = float(np.linalg.norm(exact.symmetric - sampled.symmetric))
    score = distance / (exact.error.value + sampled.error.value)
    return Saving(name, f"tracing altogether (against {rays} rays)", seconds, longer, score, score <= 5.0)


def _half(name: str, wall: Wall, repeats: int) -> Saving:
    """Adaptive rows of half of the angles, against those of all."""
    whole = WithoutMirror(wall)
    halved, seconds = least_time(lambda: row_matrix(wall, Legendre(2), ROW_TOLERANCE), repeats)
    full, longer = least_time(lambda: row_matrix(whole, Legendre(2), ROW_TOLERANCE), repeats)  # type: ignore[arg-type]
    score = float(np.linalg.norm(halved[0] - full[0])) / (halved[1] + full[1])
    return Saving(name, "half of the angles, by symmetry", seconds, longer, score, score <= 1.0)


def savings_table(quick: bool = False) -> str:
    """All scenes: their plans in words, and a line for everything that can be switched off."""
    lines = ["| scene | leaves out | seconds | without that | times | same result |", "|---|---|---|---|---|---|"]
    for name in standard_names():
        for one in savings_of(name, QUICK_RAYS if quick else RAYS):
            same = f"{'yes' if one.is_same else 'NO'} ({one.difference:.1g})"
            lines.append(
                f"| {name} | {one.what} | {one.seconds:.2g} | {one.seconds_without:.2g} | {one.factor:.2g} | {same} |"
            )
    lines += ["", "| scene | what the tracer does |", "|---|---|"]
    return "\n".join([*lines, *(f"| {name} | {plan_words(wall_of(name))} |" for name in standard_names())])


def plan_words(wall: Wall) -> str:
    """The plan of a wall in words."""
    plan = wall.plan()
    half = "; mirror-symmetric: half of the angles give the other half" if plan.mirror_symmetric else ""
    return (
        f"{plan.pieces_traced} pieces ({', '.join(plan.primitives)}) in {plan.hollows} hollows, "
        f"{plan.distinct_hollows} distinct; {plan.pieces_left_out} flat tops of {plan.flat_share:.0%} of the period "
        f"left out; {plan.closed_forms} hollows in closed form; runs on {plan.arcs_with_runs} arcs, in {plan.channels} "
        f"channels, {plan.wedges} wedges; {plan.hollows_with_grid} grids{half}"
    )
