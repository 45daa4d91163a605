"""Walls outside of the package: TOML files, written exactly and read with errors that name file and key, and pictures.

The pictures are small, for notebooks, and drawn without a plotting library.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Sequence
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ...core.checks import Floats
from ...core.errors import InputError
from ...core.files import ending_in, text_of, write_whole
from ...core.long_runs import counted
from ..curves.curve import Curve, Table, check_keys, number_of, points_of, tables_of
from .cell import Cell

FORMAT = "asperity wall 1"
# A key of so many parts, of which the parser takes the square of their number as time; walls have none.
DOTTED = re.compile(r"(?<![\w-])(?:[\w-]+\s*\.\s*){64}")

Result = TypeVar("Result")


def save_wall(wall: Cell, path: str | PathLike[str], overwrite: bool = False) -> None:
    """Write a wall as TOML; see ``Wall.save``."""
    import tomli_w

    document: Table = {"format": FORMAT, "period": wall.period}
    if wall.unit:
        document["unit"] = wall.unit
    if all(piece.is_straight for piece in wall.pieces):
        document["vertices"] = wall.vertices.tolist()
    else:
        document["pieces"] = [piece.to_table() for piece in wall.pieces]
    if wall.islands:
        document["islands"] = [{"pieces": [piece.to_table() for piece in loop]} for loop in wall.islands]
    write_whole(ending_in(".toml", path), tomli_w.dumps(document), overwrite=overwrite)


def read_wall(path: str | PathLike[str], make: Callable[..., Result]) -> Result:
    """What ``make`` makes of the pieces, period, islands and unit of a wall file; see ``load_wall``."""
    file = Path(path)
    text = text_of(file)
    try:
        if DOTTED.search(text):
            raise ValueError("a key has more than 64 parts")
        document = tomllib.loads(text)
    except RecursionError as reason:
        raise InputError(f"{file}: tables or lists are nested too deeply to be those of a wall") from reason
    except ValueError as reason:
        raise InputError(f"{file}: not a TOML file ({reason})") from reason
    try:
        return make(*_parts(document))
    except InputError as reason:
        raise type(reason)(f"{file}: {reason}") from reason


def _parts(document: Table) -> tuple[list[Curve], float, list[list[Curve]], str]:
    check_keys(document, {"period"}, {"format", "vertices", "pieces", "islands", "unit"})
    if document.get("format", FORMAT) != FORMAT:
        raise InputError(f"key 'format': expected {FORMAT!r}, got {document['format']!r}")
    if ("vertices" in document) == ("pieces" in document):
        raise InputError("expected exactly one of the keys 'vertices' and 'pieces'")
    if "vertices" in document:
        corners = points_of("vertices", document["vertices"])
        ends = pairwise(corners)
        pieces = _pieces("vertices", [{"kind": "segment", "start": list(p), "end": list(q)} for p, q in ends])
    else:
        pieces = _pieces("pieces", document["pieces"])
    islands = []
    for k, table in enumerate(tables_of("islands", document.get("islands", []))):
        try:
            check_keys(table, {"pieces"}, set())
            islands.append(_pieces("pieces", table["pieces"]))
        except InputError as reason:
            raise type(reason)(f"islands[{k}]: {reason}") from reason
    unit = document.get("unit", "")
    if not isinstance(unit, str):
        raise InputError(f"key 'unit': expected the name of a unit such as \"µm\", got {unit!r}")
    return pieces, number_of("period", document["period"]), islands, unit


def _pieces(name: str, value: Any) -> list[Curve]:
    pieces = []
    for i, table in enumerate(counted(tables_of(name, value), "piece", "wall")):
        try:
            pieces.append(Curve.of_table(table))
        except InputError as reason:
            raise type(reason)(f"{name}[{i}]: {reason}") from reason
    return pieces


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
