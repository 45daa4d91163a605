"""Measured profiles: files read into positions and heights, and these made into the vertices of a wall."""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array
from ...core.errors import InputError

Seam = Literal["mirror", "step"]


def vertices_of_profile(x: ArrayLike, height: ArrayLike, seam: Seam = "mirror") -> Floats:
    """Return the vertices of ``Wall.from_profile``: one period, rolled to start at the highest point, at (0, 0)."""
    x, height = finite_array("x", x), finite_array("height", height)
    if x.ndim != 1 or x.shape != height.shape or len(x) < 2:
        raise InputError(
            f"x and height: expected two arrays of the same length, at least 2, got shapes {x.shape} and {height.shape}"
        )
    worst = int(np.argmin(np.diff(x)))
    if not x[worst + 1] > x[worst]:
        raise InputError(
            f"x: expected strictly increasing positions, got {x[worst]:.10g} at row {worst} and {x[worst + 1]:.10g} "
            f"at row {worst + 1}; sort the rows or average those at the same position"
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


def read_profile(path: str | PathLike[str], row: int | None = None) -> tuple[Floats, Floats]:
    """Read a profile from a two-column text file or, with the extra ``profiles``, from an instrument's file.

    Parameters
    ----------
    path : path
        Text: one "x height" pair a line, separated by blanks, tabs, commas or semicolons; lines that start with #
        are comments and a first line of column names is skipped. Any other file is given to the SurfaceTopography
        package.
    row : int, optional
        Of a map z(x, y) take this row along x; the middle one by default. Line scans have no rows.

    Returns
    -------
    x, height : ndarray, shape (n,)
        In one unit: the file's own.

    Raises
    ------
    InputError
        If the file cannot be read; the message says why, with the line.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "profile.txt"
    ...     _ = file.write_text("x, height\\n0, 2\\n1, 5\\n3, 4")
    ...     x, height = read_profile(file)
    >>> x.tolist(), height.tolist()
    ([0.0, 1.0, 3.0], [2.0, 5.0, 4.0])
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"{file}: expected a file with a profile, there is none")
    try:
        text = file.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        return _read_instrument(file, row, "it is not text")
    try:
        return _parse_columns(text)
    except InputError as reason:
        if file.suffix.lower() in (".txt", ".csv", ".tsv", ".dat", ""):
            raise InputError(f"{file}, {reason}") from None
        return _read_instrument(file, row, str(reason))


def _parse_columns(text: str) -> tuple[Floats, Floats]:
    rows: list[tuple[float, float]] = []
    names_allowed = True
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").replace(";", " ").split()
        if not words:
            continue
        try:
            x, height = (float(word) for word in words)
        except ValueError:
            if names_allowed and not any(_is_number(word) for word in words):
                names_allowed = False
                continue
            raise InputError(f"line {number}: expected two numbers, x and height, got {line.strip()!r}") from None
        names_allowed = False
        rows.append((x, height))
    if len(rows) < 2:
        raise InputError(f"all lines: expected at least two rows of x and height, got {len(rows)}")
    table = np.array(rows)
    return table[:, 0], table[:, 1]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _read_instrument(file: Path, row: int | None, why: str) -> tuple[Floats, Floats]:
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
            heights = np.ma.filled(np.ma.asarray(scan.heights(), dtype=np.float64), np.nan)
            positions = scan.positions()
    except Exception as reason:  # every reader of that package fails in its own way on a file it cannot read
        first = (str(reason).splitlines() or [type(reason).__name__])[0]
        raise InputError(f"{file}: SurfaceTopography cannot read it ({first})") from reason
    if heights.ndim == 2:
        count = heights.shape[1]
        chosen = count // 2 if row is None else row
        if not 0 <= chosen < count:
            raise InputError(f"row: expected a whole number from 0 to {count - 1}, got {row!r}")
        heights, positions = heights[:, chosen], positions[0][:, chosen]
    missing = int(np.sum(~np.isfinite(heights)))
    if missing:
        raise InputError(f"{file}: {missing} of {heights.size} heights are undefined; fill or leave out those points")
    return np.asarray(positions, dtype=np.float64), np.asarray(heights, dtype=np.float64)
