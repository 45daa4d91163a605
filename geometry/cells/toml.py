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
from ..curves.arc import Arc
from ..curves.bezier import Bezier
from ..curves.curve import Curve, Point
from ..curves.segment import Segment
from .cell import Cell

FORMAT = "asperity wall 1"
# A key of so many parts, of which the parser takes the square of their number as time; walls have none.
DOTTED = re.compile(r"(?<![\w-])(?:[\w-]+\s*\.\s*){64}")

Table = dict[str, Any]
Result = TypeVar("Result")


def save_wall(wall: Cell, path: str | PathLike[str], overwrite: bool = False) -> None:
    """Write a wall as TOML; see ``Wall.save``."""
    import tomli_w

    document: Table = {"format": FORMAT, "period": wall.period}
    if wall.unit:
        document["unit"] = wall.unit
    if all(isinstance(piece, Segment) for piece in wall.pieces):
        document["vertices"] = wall.vertices.tolist()
    else:
        document["pieces"] = [_table(piece) for piece in wall.pieces]
    if wall.islands:
        document["islands"] = [{"pieces": [_table(piece) for piece in loop]} for loop in wall.islands]
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


def _table(piece: Curve) -> Table:
    if isinstance(piece, Segment):
        return {"kind": "segment", "start": list(piece.start), "end": list(piece.end)}
    if isinstance(piece, Arc):
        return {
            "kind": "arc",
            "center": list(piece.center),
            "semi_axes": list(piece.semi_axes),
            "angles": [piece.start_angle, piece.end_angle],
            "start": list(piece.start),
            "end": list(piece.end),
        }
    if isinstance(piece, Bezier):
        return {"kind": "bezier", "control_points": [list(p) for p in piece.control_points]}
    raise InputError(f"save: expected a Segment, an Arc or a Bezier, got {piece!r}")


def _parts(document: Table) -> tuple[list[Curve], float, list[list[Curve]], str]:
    _check_keys(document, {"period"}, {"format", "vertices", "pieces", "islands", "unit"})
    if document.get("format", FORMAT) != FORMAT:
        raise InputError(f"key 'format': expected {FORMAT!r}, got {document['format']!r}")
    if ("vertices" in document) == ("pieces" in document):
        raise InputError("expected exactly one of the keys 'vertices' and 'pieces'")
    if "vertices" in document:
        corners = _points("vertices", document["vertices"])
        ends = pairwise(corners)
        pieces = _pieces("vertices", [{"kind": "segment", "start": list(p), "end": list(q)} for p, q in ends])
    else:
        pieces = _pieces("pieces", document["pieces"])
    islands = []
    for k, table in enumerate(_tables("islands", document.get("islands", []))):
        try:
            _check_keys(table, {"pieces"}, set())
            islands.append(_pieces("pieces", table["pieces"]))
        except InputError as reason:
            raise type(reason)(f"islands[{k}]: {reason}") from reason
    unit = document.get("unit", "")
    if not isinstance(unit, str):
        raise InputError(f"key 'unit': expected the name of a unit such as \"µm\", got {unit!r}")
    return pieces, _number("period", document["period"]), islands, unit


def _pieces(name: str, value: Any) -> list[Curve]:
    pieces = []
    for i, table in enumerate(counted(_tables(name, value), "piece", "wall")):
        try:
            pieces.append(_piece(table))
        except InputError as reason:
            raise type(reason)(f"{name}[{i}]: {reason}") from reason
    return pieces


def _piece(table: Table) -> Curve:
    kind = table.get("kind")
    if kind == "segment":
        _check_keys(table, {"kind", "start", "end"}, set())
        return Segment(_pair("start", table["start"]), _pair("end", table["end"]))
    if kind == "arc":
        _check_keys(table, {"kind", "center", "semi_axes", "angles"}, {"start", "end"})
        axes = table["semi_axes"]
        start, end = _pair("angles", table["angles"])
        semi_axes = _pair("semi_axes", axes if isinstance(axes, list) else [axes, axes])
        arc = Arc(_pair("center", table["center"]), semi_axes, start, end)
        if "start" not in table and "end" not in table:
            return arc
        _check_keys(table, {"kind", "center", "semi_axes", "angles", "start", "end"}, set())
        return arc.pinned(_pair("start", table["start"]), _pair("end", table["end"]))
    if kind == "bezier":
        _check_keys(table, {"kind", "control_points"}, set())
        return Bezier(_points("control_points", table["control_points"]))
    _check_keys(table, {"kind"}, set(table))
    raise InputError(f"key 'kind': expected 'segment', 'arc' or 'bezier', got {kind!r}")


def _check_keys(table: Table, required: set[str], optional: set[str]) -> None:
    missing, unknown = sorted(required - set(table)), sorted(set(table) - required - optional)
    if missing:
        raise InputError(f"missing key {missing[0]!r}")
    if unknown:
        raise InputError(f"unknown key {unknown[0]!r}; expected {', '.join(sorted(required | optional))}")


def _tables(name: str, value: Any) -> list[Table]:
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        raise InputError(f"key {name!r}: expected an array of tables ([[{name}]]), got {value!r}")
    return value


def _points(name: str, value: Any) -> list[Point]:
    if not isinstance(value, list) or not value:
        raise InputError(f"key {name!r}: expected a list of points, got {value!r}")
    return [_pair(f"{name}[{i}]", point) for i, point in enumerate(value)]


def _pair(name: str, value: Any) -> Point:
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"key {name!r}: expected two numbers [a, b], got {value!r}")
    return _number(name, value[0]), _number(name, value[1])


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"key {name!r}: expected a number, got {value!r}")
    try:
        return float(value)
    except OverflowError as reason:
        raise InputError(
            f"key {name!r}: expected a number below 1e308, got one of {len(str(value))} digits"
        ) from reason
