"""A small picture of a wall for notebooks, drawn without a plotting library."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...core.checks import Floats
from ..curves.curve import Curve
from .cell import Cell

# Pixels; curves and long polygons are drawn to a quarter of one.
WIDTH, MOST_HEIGHT, LEAST_HEIGHT, MARGIN, ACCURACY = 280.0, 160.0, 40.0, 4.0, 0.25


def wall_miniature(wall: Cell) -> str:
    """One period as SVG, its solid in grey; shallow walls are stretched to a visible height, deep ones compressed."""
    paths = [_points(path, wall.period) for path in (wall.pieces, *wall.islands)]
    low, high = np.min([p.min(axis=0) for p in paths], axis=0), np.max([p.max(axis=0) for p in paths], axis=0)
    across = WIDTH / (high[0] - low[0])
    down = float(np.clip(across * (high[1] - low[1]), LEAST_HEIGHT, MOST_HEIGHT))
    scale = np.array([across, -down / (high[1] - low[1]) if high[1] > low[1] else -1.0])
    drawn = [(p - (low[0], high[1])) * scale + MARGIN for p in paths]
    bottom = down + 4.0 * MARGIN
    closed = [np.concatenate([drawn[0], [(drawn[0][-1, 0], bottom), (drawn[0][0, 0], bottom)]]), *drawn[1:]]
    shapes = "".join(f'<path d="{_path(points)}Z" fill="#ddd"/>' for points in closed)
    lines = "".join(f'<path d="{_path(points)}" fill="none" stroke="#444"/>' for points in drawn)
    size = f'width="{WIDTH + 2 * MARGIN:g}" height="{bottom:g}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} style="display:block">{shapes}{lines}</svg>'


def _points(path: Sequence[Curve], period: float) -> Floats:
    """The path as a polyline with no more points than can be seen."""
    from shapely import LineString, get_coordinates

    seen = ACCURACY * period / WIDTH
    chunks = [piece.flattened(seen) for piece in path]
    line = LineString(np.concatenate([*(chunk[:-1] for chunk in chunks), chunks[-1][-1:]]))
    return np.asarray(get_coordinates(line.simplify(seen, preserve_topology=False)))


def _path(points: Floats) -> str:
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points.tolist())
