"""Scenes without one of the tracer's optimisations: the traced rays must be the same."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from asperity.core.checks import Floats
from asperity.geometry import Wall
from asperity.geometry.scene.columns import FIRST_PAIR, FORM, PAIRS_END, RUN_SINE, TREE_LEVELS
from asperity.geometry.scene.scene import Scene, scene_in_one


def ablations(wall: Wall) -> Iterator[tuple[str, Scene, Scene]]:
    """The optimisations that the wall's scene uses: a description, a scene with it and a scene without it."""
    plan, scene = wall.plan(), wall.scene
    # without closed forms every ray segment is traced
    followed = replace(scene, closed=_cleared(scene.closed, (FORM,)))
    if plan.closed_forms:
        yield "closed forms", scene, followed
    if plan.channels or plan.wedges:
        lines = _cleared(followed.lines, (FIRST_PAIR, PAIRS_END))
        yield "runs between lines", followed, replace(followed, lines=lines)
    if plan.arcs_with_runs:
        yield "runs on arcs", followed, replace(followed, circles=_cleared(followed.circles, (RUN_SINE,)))
    if plan.hollows_with_grid:
        yield "boxes", followed, replace(followed, hollows=_cleared(followed.hollows, (TREE_LEVELS,)))
    if plan.pieces_left_out or plan.hollows > 1:
        whole = scene_in_one(wall)
        yield "flat tops and other hollows", followed, replace(whole, closed=_cleared(whole.closed, (FORM,)))


def _cleared(table: Floats, columns: tuple[int, ...]) -> Floats:
    """Return a copy of the table with zeros in the given columns."""
    copy = table.copy()
    copy[:, columns] = 0.0
    return copy
