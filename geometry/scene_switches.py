"""Scenes with one of their short cuts switched off: what they save can be measured, and must not change a ray."""

from __future__ import annotations

from dataclasses import replace

from .scene import Scene

# Columns of the tables, see the head of scene.py: the sine below which a run along an arc is skipped, the frame of a
# hollow's grid, the range of a line's rows in the table of pairs.
RUN_COLUMN, GRID_COLUMNS, PAIR_COLUMNS = 10, slice(13, 20), slice(5, 7)


def without_pairs(scene: Scene) -> Scene:
    """Without channels and wedges: every hit between facing lines is a step."""
    if scene.lines is None:
        return scene
    lines = scene.lines.copy()
    lines[:, PAIR_COLUMNS] = 0.0
    return replace(scene, pairs=None, lines=lines)


def without_runs(scene: Scene) -> Scene:
    """Without runs along arcs: every hit on an arc is a step."""
    if scene.circles is None:
        return scene
    circles = scene.circles.copy()
    circles[:, RUN_COLUMN] = 0.0
    return replace(scene, circles=circles, closed=None)


def without_grid(scene: Scene) -> Scene:
    """Without grids: every line of a hollow is tested."""
    hollows = scene.hollows.copy()
    hollows[:, GRID_COLUMNS] = 0.0
    return replace(scene, hollows=hollows, grid=None)


def without_formulas(scene: Scene) -> Scene:
    """Without closed forms of whole hollows: every flight is followed."""
    return replace(scene, closed=None)
