"""Measured profiles: files read into positions and heights, and these made into the vertices of a wall."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np

from ...core.checks import Floats, whole_number
from ...core.errors import InputError
from ...core.files import regular_file
from ...core.kinds import explained
from .columns import Columns, NotPairs
from .measured import Profile, heights_of, unit_ratio

Seam = Literal["mirror", "step"]


# A profile that climbs so much for its length has heights in a smaller unit than its positions, or is no surface.
STEEPEST = 100.0
# Words for separators in texts that describe a wall, where the characters have another meaning.
SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}


def vertices_of_profile(profile: Profile, seam: Seam = "mirror") -> Floats:
    """Return the vertices of ``Wall.from_profile``: one period, rolled to start at the highest point, at (0, 0)."""
    x, height = profile
    if profile.undefined:
        raise InputError(
            f"height: {profile.undefined} of {len(x)} heights are undefined, the first at index "
            f"({int(np.argmax(np.isnan(height)))},); use Profile.interpolated() "
            "(interpolate=yes) or leave out those points"
        )
    worst = int(np.argmin(np.diff(x)))
    if not x[worst + 1] > x[worst]:
        raise InputError(
            f"x: expected strictly increasing positions, got {x[worst]:.10g} at row {worst} and {x[worst + 1]:.10g} "
            f"at row {worst + 1}; use Profile.sorted() (sort=yes), which also averages heights at one position"
        )
    slope = float(np.abs(np.diff(height)).sum() / (x[-1] - x[0]))
    if slope > STEEPEST:
        warnings.warn(
            f"the profile's mean slope is {slope:.3g}: are the heights in a smaller unit than the positions? "
            "Give units, for example units=('mm', 'nm')",
            stacklevel=4,
        )
    if seam == "mirror":
        x = np.concatenate([x, 2.0 * x[-1] - x[-2::-1]])
        height = np.concatenate([height, height[-2::-1]])
    elif seam == "step":
        if height[-1] != height[0]:
            x, height = np.append(x, x[-1]), np.append(height, height[0])
    else:
        raise InputError(f"seam: expected 'mirror' or 'step', got {seam!r}")
    return _rolled(x, height)


def _rolled(x: Floats, height: Floats) -> Floats:
    """Start one period (whose last height equals its first) at its highest point and drop joints of flat tops."""
    top = int(np.argmax(height[:-1]))
    period = x[-1] - x[0]
    before = period + (x[1 : top + 1] - x[top])
    before[-1:] = period
    along = np.concatenate([x[top:] - x[top], before])
    down = np.concatenate([height[top:], height[1 : top + 1]]) - height[top]
    inner = (down[1:-1] == 0.0) & (down[:-2] == 0.0) & (down[2:] == 0.0)
    keep = np.concatenate([[True], ~inner, [True]])
    # "+ 0.0" turns the -0.0 of a level profile into 0.0
    return np.asarray(np.column_stack([along, down])[keep] + 0.0)


@explained
def read_profile(
    path: str | PathLike[str],
    row: int | None = None,
    units: str | Sequence[str] | None = None,
    *,
    delimiter: str | None = None,
    decimal: str = ".",
    usecols: Sequence[int] | None = None,
    skiprows: int = 0,
    encoding: str = "utf-8-sig",
) -> Profile:
    """Read a profile from a two-column text file or, with the extra ``profiles``, from an instrument's file.

    Parameters
    ----------
    path : path
        Text: one "x height" pair a line, separated by blanks, tabs, commas or semicolons; lines that start with #
        are comments and a first line of column names is skipped. Units in brackets there, ``x [um], height [nm]``, are
        honoured: heights are converted to the unit of x. Any other file, also a text that is not mostly pairs, is given
        to the SurfaceTopography package.
    row : int, optional
        Of a map z(x, y) take this row along x; the middle one by default. Line scans have no rows.
    units : str or (str, str), optional
        Of positions and heights, or of both, where the file does not say it or says it wrong.
    delimiter : str, optional
        The one separator of columns; two in a row have an undefined height between them.
    decimal : str
        The decimal sign, ``"."`` or ``","``.
    usecols : (int, int), optional
        The columns of x and height, counted from 0.
    skiprows : int
        So many lines are left out at the beginning.
    encoding : str
        Of the text.

    Returns
    -------
    Profile
        ``x, height = read_profile(...)`` unpacks it. Undefined heights, such as masked points, are nan.

    Raises
    ------
    InputError
        If the file cannot be read; the message says why, with the line.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "profile.txt"
    ...     _ = file.write_text("x [um], height [nm]\\n0, 2000\\n1, 5000\\n3, 4000")
    ...     profile = read_profile(file)
    >>> profile.x.tolist(), profile.height.tolist(), profile.unit
    ([0.0, 1.0, 3.0], [2.0, 5.0, 4.0], 'um')
    """
    file = _existing(path)
    columns = Columns(delimiter, decimal, usecols, skiprows)
    given = _pair_of_units(units)
    try:
        text = file.read_text(encoding=encoding)
    except (LookupError, TypeError) as reason:
        raise InputError(f"encoding: expected the name of one such as 'latin-1', got {encoding!r}") from reason
    except UnicodeDecodeError:
        return _read_instrument(file, row, given, "it is not text")
    try:
        return _profile(*columns.parsed(text), given)
    except NotPairs as reason:
        try:
            return _read_instrument(file, row, given, str(reason))
        except InputError as other:
            raise InputError(f"{file}, {reason}; {str(other).removeprefix(f'{file}: ')}") from other
    except InputError as reason:
        raise InputError(f"{file}, {reason}") from None


def _existing(path: str | PathLike[str]) -> Path:
    try:
        file = Path(path)
    except TypeError as reason:
        raise InputError(f"path: expected the path of a file, got {path!r}") from reason
    if not regular_file(file).exists():
        raise InputError(f"{file}: expected a file with a profile, there is none")
    return file


def _pair_of_units(units: str | Sequence[str] | None) -> tuple[str, str] | None:
    if units is None:
        return None
    pair = (units, units) if isinstance(units, str) else units
    try:
        first, second = pair
        unit_ratio(second, first)
    except (TypeError, ValueError) as reason:
        raise InputError(f"units: expected two units of length such as ('um', 'nm'), got {units!r}") from reason
    return first, second


def _profile(x: Floats, height: Floats, written: tuple[str, str] | None, given: tuple[str, str] | None) -> Profile:
    """In the unit of x."""
    units = given or written
    if units is None:
        return Profile(x, height)
    return Profile(x, height * unit_ratio(units[1], units[0]), units[0])


def _read_instrument(file: Path, row: int | None, given: tuple[str, str] | None, why: str) -> Profile:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from SurfaceTopography import read_topography
    except ImportError as reason:
        raise InputError(
            f"{file}: not two columns of numbers ({why}), and reading the formats of instruments needs the extra: "
            "pip install 'asperity[profiles]'"
        ) from reason
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scan = read_topography(str(file))
            heights = heights_of("height", scan.heights())
            positions = scan.positions()
            # that package converts heights to the unit of lengths
            unit = str(scan.unit or "")
    except Exception as reason:  # every reader of that package fails in its own way on a file it cannot read
        first = (str(reason).splitlines() or [type(reason).__name__])[0]
        raise InputError(f"{file}: SurfaceTopography cannot read it ({first})") from reason
    if heights.ndim == 2:
        count = heights.shape[1]
        chosen = count // 2 if row is None else whole_number("row", row, 0, most=count - 1)
        heights, positions = heights[:, chosen], positions[0][:, chosen]
    return _profile(np.asarray(positions, dtype=np.float64), heights, (unit, unit) if unit else None, given)
