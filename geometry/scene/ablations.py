"""Scenes without one of the tracer's optimisations, to measure its saving; the traced rays must not change."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

from ...core.checks import Floats
from .columns import FIRST_PAIR, PAIRS_END, RUN_SINE, TREE_LEVELS
from .scene import Scene

Table = TypeVar("Table", Floats, Floats | None)


def without_pairs(scene: Scene) -> Scene:
    """Return the scene without channels and wedges: every hit between facing lines is a step."""
    return replace(scene, pairs=None, lines=_cleared(scene.lines, (FIRST_PAIR, PAIRS_END)))


def without_runs(scene: Scene) -> Scene:
    """Return the scene without runs along arcs: every hit on an arc outside closed forms is a step."""
    return replace(scene, circles=_cleared(scene.circles, (RUN_SINE,)))


def without_boxes(scene: Scene) -> Scene:
    """Return the scene without trees of boxes: every line of a hollow is tested."""
    return replace(scene, hollows=_cleared(scene.hollows, (TREE_LEVELS,)), boxes=None)


def without_formulas(scene: Scene) -> Scene:
    """Return the scene without closed forms of hollows: every ray segment is traced."""
    return replace(scene, closed=None)


def _cleared(table: Table, columns: tuple[int, ...]) -> Table:
    """Return a copy of the table with zeros in the given columns, None for None."""
    if table is None:
        return table
    copy = table.copy()
    copy[:, columns] = 0.0
    return copy
