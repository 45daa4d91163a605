"""The named walls with their default parameters, and the parser of the command line's argument WALL."""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os.path import isfile
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ...core.checks import instance
from ...core.errors import InputError
from ...core.estimates import Summary
from ..cells.profile import SEPARATORS, read_profile
from ..disk.disk import Disk
from .mushroom import mushrooms
from .named import (
    dispersing_arcs,
    double_parabola,
    elliptical_arcs,
    flat,
    focusing_arcs,
    koch,
    rectangular_teeth,
    sinusoid,
    triangular_teeth,
)
from .wall import Wall, load_wall


@dataclass(frozen=True, repr=False)
class NamedWall(Summary):
    """A wall's constructor with its name, a one-line summary, and the defaults of its parameters as numbers."""

    name: str
    constructor: Callable[..., Wall]
    defaults: Mapping[str, float | int]
    summary: str

    def build(self, **parameters: float | int) -> Wall:
        """Return the wall with the given parameters and the defaults for the others."""
        return self.constructor(**{**self.defaults, **parameters})


def _elliptical(half_angle: float, inertia_ratio: float) -> Wall:
    return elliptical_arcs(half_angle, Disk(inertia_ratio=inertia_ratio))


def _entry(function: Callable[..., Wall], summary: str, constructor: Callable[..., Wall] | None = None) -> NamedWall:
    """The entry of a function with its defaults; ``constructor`` takes the ratio of a disk in its place."""
    defaults: dict[str, float | int] = {}
    for parameter in inspect.signature(function).parameters.values():
        value = parameter.default
        of_disk = isinstance(value, Disk)
        defaults |= {"inertia_ratio": value.inertia_ratio} if of_disk else {parameter.name: value}
    name = function.__name__.replace("_", "-")
    return NamedWall(name, constructor or function, MappingProxyType(defaults), summary)


_ENTRIES = (
    _entry(flat, "a flat wall: specular reflection"),
    _entry(triangular_teeth, "triangular teeth, apex angle in radians"),
    _entry(rectangular_teeth, "half flat tops, half crevices"),
    _entry(focusing_arcs, "one circular arc below each period's chord"),
    _entry(dispersing_arcs, "circular bumps that meet in corners"),
    _entry(elliptical_arcs, "arcs that the disk feels as circular", _elliptical),
    _entry(double_parabola, "Plakhov's parabolas: nearly retroreflecting"),
    _entry(sinusoid, "a cosine, from its tops down by the amplitude"),
    _entry(mushrooms, "semicircular caps on straight stems"),
    _entry(koch, "Koch's curve turned downwards"),
)

WALLS: Mapping[str, NamedWall] = MappingProxyType({entry.name: entry for entry in _ENTRIES})


def wall_from_text(text: str) -> Wall:
    """Return the wall given by a name with parameters, a TOML file, or a file with a profile.

    Parameters
    ----------
    text : str
        ``"name"`` or ``"name:parameter=value,parameter=value"`` with a name from ``WALLS``; or the path of a file:
        one that ends in ``.toml`` is read by ``load_wall``, any other by ``read_profile``. The path of a profile may
        be followed by parameters: ``seam=step`` (see ``Wall.from_profile``), those of ``read_profile``
        (``units=um/nm``, ``delimiter=semicolon``, ``decimal=comma``, ``usecols=0/2``, ``skiprows=3``,
        ``encoding=latin-1``, ``row=5``,
        ``quantity=slope``, ``undefined=-9999``), and ``sort=yes``, ``interpolate=yes``, ``detrend=1`` (see `Profile`).

    Raises
    ------
    InputError
        If no named wall and no file has this name (the message lists near matches and all names), a parameter is
        unknown, or a value is not a number.

    Examples
    --------
    >>> wall_from_text("rectangular-teeth:height_to_width=4").depth
    2.0
    """
    instance("text", text, str, "'focusing-arcs'")
    name, _, tail = text.partition(":")
    entry = WALLS.get(name.strip().lower().replace("_", "-"))
    if entry is not None and not isfile(text):
        return entry.build(**{key: _value(entry, key, value) for key, value in _parameters(text, tail).items()})
    found = file_and_parameters(text)
    if found is not None:
        return _wall_from_file(*found)
    near = difflib.get_close_matches(name, WALLS, n=3)
    guess = f" Did you mean {' or '.join(near)}?" if near else ""
    raise InputError(f"{name!r} is neither a named wall nor a file.{guess} Named walls: {', '.join(WALLS)}")


def file_and_parameters(text: str) -> tuple[Path, dict[str, str]] | None:
    """The file that a text names, with the parameters behind a colon; None if there is no such file."""
    # the name of a file may have colons too
    for split in (len(text), *(found.start() for found in re.finditer(":", text))):
        if isfile(text[:split]):
            return Path(text[:split]), _parameters(text, text[split + 1 :])
    return None


def _parameters(text: str, tail: str) -> dict[str, str]:
    parameters: dict[str, str] = {}
    for part in filter(None, (p.strip() for p in tail.split(","))):
        key, equals, value = (word.strip() for word in part.partition("="))
        if not (key and equals and value):
            raise InputError(f"wall {text!r}: expected name:parameter=value,parameter=value, got {part!r}")
        if key in parameters:
            raise InputError(f"wall {text!r}: parameter {key!r} is given twice")
        parameters[key.replace("-", "_")] = value
    return parameters


def _value(entry: NamedWall, key: str, value: str) -> float | int:
    if key not in entry.defaults:
        known = ", ".join(entry.defaults) or "it has none"
        near = difflib.get_close_matches(key, entry.defaults, n=1)
        guess = f"; did you mean {near[0]}?" if near else ""
        raise InputError(f"wall {entry.name}: unknown parameter {key!r}{guess} (parameters: {known})")
    kind = type(entry.defaults[key])
    try:
        return kind(value)
    except ValueError as reason:
        wanted = "a whole number" if kind is int else "a number"
        raise InputError(f"wall {entry.name}, parameter {key}: expected {wanted}, got {value!r}") from reason


def _wall_from_file(file: Path, parameters: Mapping[str, str]) -> Wall:
    if file.suffix.lower() == ".toml":
        if parameters:
            raise InputError(f"{file}: unknown parameter {next(iter(parameters))!r}; a wall file takes none")
        return load_wall(file)
    chosen = values_of(file, parameters, PROFILE_PARAMETERS, "a profile")
    seam, sort, interpolate, detrend = (chosen.pop(key, None) for key in PREPARATIONS)
    profile = read_profile(file, **chosen)
    try:
        profile = profile.sorted() if sort else profile
        profile = profile.interpolated() if interpolate else profile
        profile = profile if detrend is None else profile.detrended(detrend)
        return Wall.from_profile(profile, seam=seam or "mirror")
    except InputError as reason:
        raise type(reason)(f"{file}: {reason}") from reason


def values_of(
    file: Path, parameters: Mapping[str, str], readers: Mapping[str, Callable[[str], Any]], what: str
) -> dict[str, Any]:
    """The values of the parameters of a file, from their texts."""
    values = {}
    for key, text in parameters.items():
        if key not in readers:
            raise InputError(f"{file}: unknown parameter {key!r}; {what} takes {', '.join(readers)}")
        try:
            values[key] = readers[key](text)
        except (ValueError, KeyError) as reason:
            raise InputError(f"{file}, parameter {key}: cannot read {text!r}") from reason
    return values


def _flag(text: str) -> bool:
    return {"yes": True, "no": False}[text.lower()]


PREPARATIONS = ("seam", "sort", "interpolate", "detrend")
PROFILE_PARAMETERS: Mapping[str, Callable[[str], Any]] = MappingProxyType({
    "seam": str, "sort": _flag, "interpolate": _flag, "detrend": int, "row": int, "skiprows": int, "encoding": str,
    "quantity": str, "undefined": float,
    "units": lambda text: tuple(text.split("/")) if "/" in text else text,
    "usecols": lambda text: tuple(int(part) for part in text.split("/")),
    "delimiter": lambda text: SEPARATORS.get(text, text),
    "decimal": lambda text: SEPARATORS.get(text, text),
})  # fmt: skip
