"""Scenes without one of the tracer's optimisations: the traced rays must be the same."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TypeVar

from asperity.core.checks import Floats
from asperity.geometry import Wall
from asperity.geometry.scene.columns import FIRST_PAIR, PAIRS_END, RUN_SINE, TREE_LEVELS
from asperity.geometry.scene.scene import Scene, scene_in_one

Table = TypeVar("Table", Floats, Floats | None)


def ablations(wall: Wall) -> Iterator[tuple[str, Scene, Scene]]:
    """The optimisations that the wall's scene uses: a description, a scene with it and a scene without it."""
    plan, scene = wall.plan(), wall.scene
    # without closed forms every ray segment is traced
    followed = replace(scene, closed=None)
    if plan.closed_forms:
        yield "closed forms", scene, followed
    if plan.channels or plan.wedges:
        yield (
            "runs between lines",
            followed,
            replace(followed, pairs=None, lines=_cleared(followed.lines, (FIRST_PAIR, PAIRS_END))),
        )
    if plan.arcs_with_runs:
        yield "runs on arcs", followed, replace(followed, circles=_cleared(followed.circles, (RUN_SINE,)))
    if plan.hollows_with_grid:
        yield "boxes", followed, replace(followed, hollows=_cleared(followed.hollows, (TREE_LEVELS,)), boxes=None)
    if plan.pieces_left_out or plan.hollows > 1:
        yield "flat tops and other hollows", followed, replace(scene_in_one(wall), closed=None)


def _cleared(table: Table, columns: tuple[int, ...]) -> Table:
    """Return a copy of the table with zeros in the given columns, None for None."""
    if table is None:
        return table
    copy = table.copy()
    copy[:, columns] = 0.0
    return copy
