"""Walls as TOML files: written exactly, read with an error that names the file and the key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from ...core.errors import InputError
from ...core.files import ending_in, text_of, write_whole
from ...core.long_runs import counted
from ..curves.curve import Curve
from ..curves.reading import Table, check_keys, number_of, points_of, tables_of
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
