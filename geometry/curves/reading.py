"""Numbers and points of the tables of wall files, with messages that name the key."""

from __future__ import annotations

from typing import Any

from ...core.errors import InputError

Point = tuple[float, float]
Table = dict[str, Any]


def check_keys(table: Table, required: set[str], optional: set[str]) -> None:
    missing, unknown = sorted(required - set(table)), sorted(set(table) - required - optional)
    if missing:
        raise InputError(f"missing key {missing[0]!r}")
    if unknown:
        raise InputError(f"unknown key {unknown[0]!r}; expected {', '.join(sorted(required | optional))}")


def tables_of(name: str, value: Any) -> list[Table]:
    if not isinstance(value, list) or not all(isinstance(table, dict) for table in value):
        raise InputError(f"key {name!r}: expected an array of tables ([[{name}]]), got {value!r}")
    return value


def points_of(name: str, value: Any) -> list[Point]:
    if not isinstance(value, list) or not value:
        raise InputError(f"key {name!r}: expected a list of points, got {value!r}")
    return [pair_of(f"{name}[{i}]", point) for i, point in enumerate(value)]


def pair_of(name: str, value: Any) -> Point:
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"key {name!r}: expected two numbers [a, b], got {value!r}")
    return number_of(name, value[0]), number_of(name, value[1])


def number_of(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"key {name!r}: expected a number, got {value!r}")
    try:
        return float(value)
    except OverflowError as reason:
        raise InputError(
            f"key {name!r}: expected a number below 1e308, got one of {len(str(value))} digits"
        ) from reason
