"""Measured profiles: files read into positions and heights, and these made into the vertices of a wall."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from ...core.checks import Floats, choice, finite_number, whole_number
from ...core.errors import InputError
from ...core.files import text_of
from .columns import GROUPED, Columns, Header, NotPairs, remedy
from .measured import Profile, heights_of, integrated, is_slope, metres, unit_ratio

Seam = Literal["mirror", "step", "wrap"]
Quantity = Literal["height", "slope"]


# A profile that climbs so much for its length has heights in a smaller unit than its positions, or is no surface.
STEEPEST = 100.0
# One so wide, in metres, and so flat has positions in a smaller unit; one flatter still is no surface in any unit.
WIDEST, FLATTEST_WIDE, FLATTEST = 10.0, 1e-6, 1e-9
# Steps of a profile that wraps round differ by at most this fraction of them: positions are printed with few digits.
EVEN = 1e-3
# A trace in order of its positions is the same one if it is at most this much longer.
LONGER = 1.1
# Heights that instruments write for none; at most this fraction of heights, farther from the median than FAR times the
# span of 96 % of them, with sides steeper than STEEPER times all other slopes, are taken for such.
CODES = (-9999.0, -99999.0, -999.0, 9999.0, 99999.0, 999.0, -32768.0, 32767.0, 65535.0, 1e10, -1e10, 1e30, -1e30)
FEW, FAR, STEEPER = 0.01, 10.0, 3.0
# What headers of maps say.
MAP = re.compile(r"^\W*(width|channel)\s*:", re.IGNORECASE | re.MULTILINE)
# Of texts, in the order in which they are tried.
ENCODINGS = "utf-8-sig", "utf-16", "latin-1"
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
        ordered = profile.sorted()
        lengths = [float(np.hypot(np.diff(one.x), np.diff(one.height)).sum()) for one in (profile, ordered)]
        remedy = "use Profile.sorted() (sort=yes), which also averages heights at one position"
        if lengths[1] > LONGER * lengths[0]:
            remedy = (
                f"the trace turns back, and in order its length would be {lengths[1]:.3g}, not {lengths[0]:.3g}; "
                "Wall.from_vertices takes vertices that overhang"
            )
        raise InputError(
            f"x: expected strictly increasing positions, got {x[worst]:.10g} at row {worst} and {x[worst + 1]:.10g} "
            f"at row {worst + 1}; {remedy}"
        )
    _warn_of_units(profile)
    _warn_of_dropouts(profile)
    choice("seam", seam, get_args(Seam))
    if seam == "mirror":
        x = np.concatenate([x, 2.0 * x[-1] - x[-2::-1]])
        height = np.concatenate([height, height[-2::-1]])
    elif seam == "step":
        if height[-1] != height[0]:
            x, height = np.append(x, x[-1]), np.append(height, height[0])
    else:
        step = (x[-1] - x[0]) / (len(x) - 1)
        if np.abs(np.diff(x) - step).max() > EVEN * step:
            raise InputError(
                "seam: 'wrap' expects equal steps between positions; append the first height at the end of the "
                "period and pass seam='step'"
            )
        x, height = np.append(x, x[-1] + step), np.append(height, height[0])
    return rolled(x, height)


def _warn_of_units(profile: Profile) -> None:
    x, height = profile
    width, change = float(x[-1] - x[0]), float(np.ptp(height))
    slope = float(np.abs(np.diff(height)).sum()) / width
    wide = width * (metres(profile.unit) or 0.0) > WIDEST
    if slope > STEEPEST:
        oddity = f"mean slope is {slope:.3g}: are the heights in a smaller unit than the positions"
    elif 0.0 < change < (FLATTEST_WIDE if wide else FLATTEST) * width:
        oddity = f"width is {width:.3g} and its heights differ by {change:.3g}: are the positions in a smaller unit"
    else:
        return
    warnings.warn(f"the profile's {oddity}? Give units, for example units=('mm', 'nm')", stacklevel=4)


def _warn_of_dropouts(profile: Profile) -> None:
    """Warn of few heights far from all others, between which and the others the profile is steeper than elsewhere."""
    x, height = profile
    low, middle, high = np.quantile(height, [2.0 * FEW, 0.5, 1.0 - 2.0 * FEW])
    away = np.abs(height - middle) > np.where(np.isin(height, CODES), 1.0, FAR) * (high - low)
    if not 0.0 < away.mean() <= FEW or low == high:
        return
    slopes = np.abs(np.diff(height) / np.diff(x))
    edges, rest = away[1:] != away[:-1], ~(away[1:] | away[:-1])
    if slopes[edges].min() <= STEEPER * slopes[rest].max(initial=0.0):
        return
    first, values = int(np.argmax(away)), np.unique(height[away])
    remedy = f"read the file with undefined={values[0]:g} (undefined={values[0]:g})"
    if len(values) > 1:
        remedy = "make them nan before Profile(x, height)"
    warnings.warn(
        f"{int(away.sum())} of {len(x)} heights, the first {height[first]:g} at index ({first},), are far from all "
        f"others and beyond any of their slopes. If they are dropouts, {remedy} and use Profile.interpolated() "
        "(interpolate=yes)",
        stacklevel=4,
    )


def rolled(x: Floats, height: Floats) -> Floats:
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


def read_profile(
    path: str | PathLike[str],
    row: int | None = None,
    units: str | Sequence[str] | None = None,
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    usecols: Sequence[int] | None = None,
    skiprows: int = 0,
    encoding: str | None = None,
    quantity: Quantity | None = None,
    undefined: float | None = None,
) -> Profile:
    """Read a profile from a two-column text file or, with the extra ``profiles``, from an instrument's file.

    Parameters
    ----------
    path : path
        Text: one "x height" pair a line, separated by blanks, tabs, commas or semicolons; lines that start with #
        are comments and a first line of column names is skipped. Units there, ``x [um], height [nm]`` or
        ``x mm; slope urad``, are honoured: heights are converted to the unit of x, and slopes integrated. Heights such
        as ``Bad``, ``***`` and ``NaN`` are undefined. Any other file, also a text with the header of a map, is given to
        the SurfaceTopography package.
    row : int, optional
        Of a map z(x, y) take this row along x; the middle one by default. Line scans have no rows. A text of many
        columns is a map if it is given.
    units : str or (str, str), optional
        Of positions and heights, or of both, where the file does not say it or says it wrong; of slopes units such as
        ``"urad"`` or ``"nm/mm"``.
    delimiter : str, optional
        The one separator of columns; two in a row have an undefined height between them.
    decimal : {".", ","}, optional
        The decimal sign; by default a point, or a comma where the text is readable with it alone.
    usecols : (int, int), optional
        The columns of x and height, counted from 0.
    skiprows : int
        So many lines are left out at the beginning.
    encoding : str, optional
        Of the text; by default UTF-8, or UTF-16 or Latin-1 where the file is readable in it alone. A warning says what
        was taken in place of the point and UTF-8.
    quantity : {"height", "slope"}, optional
        Of the second column, where units do not tell. Slopes are integrated by the trapezoidal rule, from height 0 at
        the first position.
    undefined : float, optional
        The number that the file has for an undefined height.

    Returns
    -------
    Profile
        ``x, height = read_profile(...)`` unpacks it. Undefined heights, such as masked points, are nan.

    Raises
    ------
    InputError
        If the file cannot be read, or it is not clear what its columns are; the message has the line, and the options
        with which it is read.

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
    file = Path(path)
    columns = Columns(delimiter, "." if decimal is None else decimal, usecols, skiprows)
    given, undefined = pair_of_units(units), None if undefined is None else finite_number("undefined", undefined)
    if quantity is not None:
        choice("quantity", quantity, get_args(Quantity))
    taken: dict[str, str] = {}
    try:
        text = text_of(file, ENCODINGS[0] if encoding is None else encoding)
    except InputError as reason:
        if not isinstance(reason.__cause__, UnicodeDecodeError):
            raise
        other = _other_encoding(file, columns)
        if other is None:
            return _read_instrument(file, row, given, quantity, "it is not text")
        if encoding is not None:
            raise InputError(f"{file}: not in the encoding given; {remedy({'encoding': other})}") from None
        taken["encoding"], text = other, text_of(file, other)
    is_map = row is not None or MAP.search(text) is not None
    try:
        try:
            found = columns.parsed(text, is_map=is_map)
        except InputError:
            comma = _with_a_comma(text, columns) if decimal is None else None
            if comma is None:
                raise
            taken["decimal"], found = ",", comma
        values = found[1] if undefined is None else np.where(found[1] == undefined, np.nan, found[1])
        profile = _profile(found[0], values, *_meaning(found[2], given, quantity))
    except NotPairs as reason:
        try:
            return _read_instrument(file, row, given, quantity, str(reason))
        except InputError as other_reason:
            words = str(other_reason).removeprefix(f"{file}: ")
            raise InputError(f"{file}, {reason}; {words}") from other_reason
    except InputError as reason:
        raise InputError(f"{file}, {reason}") from None
    if taken:
        warnings.warn(f"{file}: readable in one way alone; to be silent, {remedy(taken)}", stacklevel=2)
    return profile


def _other_encoding(file: Path, columns: Columns) -> str | None:
    """The other encoding in which a file is a text of pairs, or of something that options would make pairs."""
    for encoding in ENCODINGS[1:]:
        for decimal in (columns.decimal, ","):
            try:
                replace(columns, decimal=decimal).parsed(text_of(file, encoding))
            except InputError as reason:
                if isinstance(reason, NotPairs) or not str(reason).startswith("line"):
                    continue
            return encoding
    return None


def _with_a_comma(text: str, columns: Columns) -> tuple[Floats, Floats, Header | None] | None:
    """The columns of a text with decimal commas; None if it is none, or if the commas may set off thousands."""
    words = re.findall(r"\d[\d.,]*", text)
    commas, points = ([word for word in words if sign in word] for sign in ",.")
    mixed = any(not GROUPED[","].fullmatch(word) for word in points)
    if columns.delimiter == "," or mixed or all(map(GROUPED["."].fullmatch, commas)):
        return None
    try:
        return replace(columns, decimal=",").parsed(text)
    except InputError:
        return None


def pair_of_units(units: str | Sequence[str] | None) -> tuple[str, str] | None:
    """The units of lengths and of heights or slopes, or one of both."""
    if units is None:
        return None
    pair = (units, units) if isinstance(units, str) else units
    try:
        first, second = pair
        unit_ratio(first if is_slope(second) else second, first)
    except (AttributeError, TypeError, ValueError) as reason:
        raise InputError(f"units: expected two units of length such as ('um', 'nm'), got {units!r}") from reason
    return first, second


def _meaning(
    header: Header | None, given: tuple[str, str] | None, quantity: Quantity | None
) -> tuple[tuple[str, str] | None, bool]:
    """The units of the columns, and whether the second has slopes; if unclear, an error names the option."""
    line, units, slopes = header or Header("", ("", ""), False)
    first, second = given or units
    wanted = {None: slopes or is_slope(second), "slope": True, "height": False}[quantity]
    if not (first or second) and (quantity is not None or not slopes):
        return None, wanted
    known = metres(first) and (metres(second) or is_slope(second))
    if is_slope(second) == wanted and (known or given is not None):
        return (first, second), wanted
    what = (
        "two units of length as in 'x [um], height [nm]'"
        if known or not wanted
        else "units as in 'x [mm], slope [urad]'"
    )
    likely = ("mm", "urad") if wanted else ("um", second if metres(second) else "nm")
    call = remedy({"units": (first if metres(first) else likely[0], likely[1])})
    alternative = f"; of heights {remedy({'quantity': 'height'})}" if slopes and quantity is None else ""
    raise InputError(f"header: expected {what}, got {line!r}; if these are the units, {call}{alternative}")


def _profile(x: Floats, values: Floats, units: tuple[str, str] | None, slopes: bool) -> Profile:
    """In the unit of x."""
    if slopes:
        x, height = integrated(x, values, units[1] if units else "")
        return Profile(x, height, units[0] if units else "")
    return Profile(x, values) if units is None else Profile(x, values * unit_ratio(units[1], units[0]), units[0])


def _read_instrument(
    file: Path, row: int | None, given: tuple[str, str] | None, quantity: Quantity | None, why: str
) -> Profile:
    scan, heights = instrument_scan(file, f"not two columns of numbers ({why})")
    # that package converts heights to the unit of lengths
    positions, unit = scan.positions(), str(scan.unit or "")
    if heights.ndim == 2:
        count = heights.shape[1]
        chosen = count // 2 if row is None else whole_number("row", row, 0, most=count - 1)
        heights, positions = heights[:, chosen], positions[0][:, chosen]
    header = Header("", (unit, unit), False) if metres(unit) else None
    return _profile(np.asarray(positions, dtype=np.float64), heights, *_meaning(header, given, quantity))


def instrument_scan(file: Path, why: str) -> tuple[Any, Floats]:
    """A line or map of SurfaceTopography, and its heights; ``why`` says why the file is nothing simpler."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from SurfaceTopography import read_topography
    except ImportError as reason:
        raise InputError(
            f"{file}: {why}, and reading the formats of instruments needs the extra: pip install 'asperity[profiles]'"
        ) from reason
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scan = read_topography(str(file))
            return scan, heights_of("height", scan.heights())
    except Exception as reason:  # every reader of that package fails in its own way on a file it cannot read
        first = (str(reason).splitlines() or [type(reason).__name__])[0]
        raise InputError(f"{file}: SurfaceTopography cannot read it ({first})") from reason
