"""Measured height maps: read, levelled, freed of dropouts and spikes, and made periodic."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, check_memory, choice, finite_number, shaped, whole_number
from ...core.errors import InputError
from ...core.files import regular_file, text_of
from ..cells.columns import word_number
from ..cells.measured import heights_of, metres, unit_ratio
from ..cells.profile import instrument_scan, pair_of_units
from ..walls.catalogue import PROFILE_PARAMETERS, file_and_parameters, values_of
from .surface import COPIES, Surface, mirrored

Tiling = Literal["mirror", "wrap"]
Spikes = Literal["keep", "fill"]

# A spike differs from the median of the 3 x 3 heights about it by more than ABOVE_ALL times the normal spread of such
# differences over the map, and by more than ABOVE_NEAR times the range of these 9 heights without their largest and
# smallest. So corners of steps are none, nor are rare heights of a normal distribution. More than FEW are a shape.
ABOVE_ALL, ABOVE_NEAR, FEW = 12.0, 3.0, 0.01
# Standard deviation of a normal distribution over the median of its absolute values.
NORMAL = 1.4826
# How parameters of `read_surface` are read from texts.
MAP_PARAMETERS: dict[str, Callable[[str], Any]] = {
    "degree": int, "tiling": str, "spikes": str, "undefined": float, "units": PROFILE_PARAMETERS["units"],
}  # fmt: skip
# Arrays of the size of the map in memory at a time, by measurement: for each term of the fit, and when it is mirrored.
COPIES_OF_TERM, MIRRORED_COPIES = 2, 10
# Fraction of heights that must be defined.
LEAST_DEFINED = 0.5


def read_surface(
    path: str | PathLike[str],
    spacing: float | Sequence[float] | None = None,
    units: str | Sequence[str] | None = None,
    *,
    degree: int = 1,
    tiling: Tiling | None = None,
    spikes: Spikes = "keep",
    undefined: float | None = None,
) -> Surface:
    """Read a height map from a file and make it a periodic surface.

    Parameters
    ----------
    path : path
        What ``Surface.save`` wrote, which is restored as it is; a matrix in numpy's .npy or as a text of one row a
        line, with blanks, tabs, commas or semicolons between the heights and # before comments; or, with the extra
        ``profiles``, any map that the SurfaceTopography package reads. Of a matrix the first axis, the rows of a
        text, goes along x.
    spacing : float or (float, float), optional
        Distances of the points along x and y: needed for a matrix, and else that of the file.
    units : str or (str, str), optional
        Of lengths, or of the spacing and of the heights, such as ``("um", "nm")``: heights are converted to the unit
        of the spacing.
    degree : int
        Of the polynomial in x and y that is subtracted, the best fit to the defined heights: 0 the mean, 1 the tilt
        too, 2 a bow too.
    tiling : {"mirror", "wrap"}, optional
        How the map becomes periodic: followed by its mirror image in both directions, which takes four times the
        memory, or repeated as it is. By default mirrored, unless the file says that the map is periodic.
    spikes : {"keep", "fill"}
        What is done with single heights far from their neighbours, of which a warning tells: by "fill" they are
        interpolated like undefined ones.
    undefined : float, optional
        The number that the file has for an undefined height; NaN, infinite and masked ones are undefined too.

    Returns
    -------
    Surface
        Undefined heights are interpolated linearly between those beside them, outside of all by the nearest.

    Raises
    ------
    InputError
        If the file cannot be read, is a line scan or a matrix without spacing, or fewer than half of the heights are
        defined.

    Warns
    -----
    UserWarning
        Of spikes, with their number and the worst of them.

    Notes
    -----
    The order is: the tilt is taken off the defined heights, then gaps are filled, then the map is mirrored. A patch is
    a sample: `Surface.quarters` says by how much its quarters differ, which as a rule exceeds all other errors.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "map.txt"
    ...     _ = file.write_text("# nm\\n0 1000 0\\n0 nan 0\\n0 1000 0")
    ...     surface = read_surface(file, 2.0, ("um", "nm"), degree=0, tiling="wrap")
    >>> surface.unit, (surface.heights - surface.heights.min()).round(12).tolist()
    ('um', [[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    """
    file = Path(path)
    if tiling is not None:
        choice("tiling", tiling, get_args(Tiling))
    choice("spikes", spikes, get_args(Spikes))
    order, pair = whole_number("degree", degree, 0), pair_of_units(units)
    if file.suffix.lower() == ".npz":
        return _restored(file)
    z, found, unit, periodic = _map_of(file, spacing is None)
    if undefined is not None:
        z = np.where(z == finite_number("undefined", undefined), np.nan, z)
    if pair is not None:
        z, unit = z * unit_ratio(pair[1], pair[0]), pair[0]
    apart = shaped("spacing", found, 2) if spacing is None else spacing
    try:
        chosen = tiling or ("wrap" if periodic else "mirror")
        return surface_of(z, apart, degree=order, tiling=chosen, spikes=spikes, unit=unit)
    except InputError as reason:
        raise InputError(f"{file}: {reason}") from reason


def surface_from_text(text: str, spacing: float | Sequence[float] | None) -> Surface:
    """The surface of a map's file, whose name parameters of `read_surface` may follow: ``map.txt:units=um/nm``.

    Raises
    ------
    InputError
        If there is no such file, `read_surface` refuses it, or a parameter is unknown.
    """
    found = file_and_parameters(text)
    if found is None:
        raise InputError(f"{text!r} is no file; expected a height map")
    return read_surface(found[0], spacing, **values_of(*found, MAP_PARAMETERS, "a map"))


def surface_of(heights: Floats, spacing: Any, *, degree: int, tiling: Tiling, spikes: Spikes, unit: str) -> Surface:
    """A measured patch as a surface; see `read_surface`."""
    if heights.ndim != 2 or heights.size == 0:
        raise InputError(f"heights: expected a map of two dimensions, got shape {heights.shape}")
    terms = (degree + 1) * (degree + 2) // 2
    copies = max(COPIES_OF_TERM * terms + 1, MIRRORED_COPIES * (tiling == "mirror"))
    check_memory("heights", f"what makes a surface of a map of {heights.size} heights", copies * heights.size)
    lengths = np.array(Surface(np.zeros((1, 1)), spacing).spacing)
    levelled = filled(_levelled(heights, degree), lengths)
    bad = spikes_of(levelled) & np.isfinite(heights)
    if bad.any():
        worst = np.unravel_index(np.argmax(np.where(bad, np.abs(levelled), -1.0)), bad.shape)
        warnings.warn(
            f"{int(bad.sum())} of {bad.size} heights, the worst {heights[worst]:g} at index "
            f"({worst[0]}, {worst[1]}), are far from all their neighbours"
            + ("; pass spikes='fill' to interpolate them" if spikes == "keep" else " and are interpolated"),
            stacklevel=3,
        )
        if spikes == "fill":
            levelled = filled(_levelled(np.where(bad, np.nan, heights), degree), lengths)
    return Surface(mirrored(levelled) if tiling == "mirror" else levelled, spacing, unit)


def _levelled(z: Floats, degree: int) -> Floats:
    """Heights less the polynomial that fits the defined ones best."""
    known = np.isfinite(z)
    terms = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    if known.mean() < LEAST_DEFINED or known.sum() < len(terms):
        least = max(int(np.ceil(LEAST_DEFINED * z.size)), len(terms))
        raise InputError(f"heights: expected at least {least} of {z.size} to be defined, got {int(known.sum())}")
    x, y = (np.linspace(-1.0, 1.0, count) if count > 1 else np.zeros(1) for count in z.shape)
    along_x, along_y = (np.polynomial.legendre.legvander(one, degree) for one in (x, y))
    # normal equations of Legendre polynomials, which need no matrix of all heights
    products = np.stack([np.where(known, np.outer(along_x[:, i], along_y[:, j]), 0.0).ravel() for i, j in terms])
    fit = np.linalg.lstsq(products @ products.T, products @ np.where(known, z, 0.0).ravel(), rcond=None)[0]
    trend = sum(c * np.outer(along_x[:, i], along_y[:, j]) for c, (i, j) in zip(fit, terms, strict=True))
    return np.asarray(z - trend)


def filled(z: Floats, spacing: Floats) -> Floats:
    """Heights of which undefined ones are interpolated from those around each gap."""
    from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
    from scipy.ndimage import binary_dilation
    from scipy.spatial import QhullError

    missing = ~np.isfinite(z)
    if not missing.any():
        return z
    rim, inside = np.argwhere(binary_dilation(missing, np.ones((3, 3), dtype=bool)) & ~missing), np.argwhere(missing)
    values, whole = z[tuple(rim.T)], z.copy()
    found = np.full(len(inside), np.nan)
    # it fails if all points of the rim are on one line
    with suppress(QhullError):
        found = LinearNDInterpolator(rim * spacing, values)(inside * spacing)
    nearest = NearestNDInterpolator(rim * spacing, values)(inside * spacing)
    whole[missing] = np.where(np.isnan(found), nearest, found)
    return whole


def spikes_of(z: Floats) -> Any:
    """Mask of single heights far from their neighbours; none if there are many."""
    from scipy.ndimage import median_filter, rank_filter

    if min(z.shape) < 3:
        return np.zeros(z.shape, dtype=bool)
    away = np.abs(z - median_filter(z, 3, mode="mirror"))
    near = rank_filter(z, 7, 3, mode="mirror") - rank_filter(z, 1, 3, mode="mirror")
    # a tilt alone has differences of the size of rounding
    least = max(ABOVE_ALL * NORMAL * np.median(away), 1e-9 * np.ptp(z))
    bad = (away > least) & (away > ABOVE_NEAR * near)
    return bad if bad.mean() <= FEW else np.zeros(z.shape, dtype=bool)


def _map_of(file: Path, needs_spacing: bool) -> tuple[Floats, ArrayLike, str, bool]:
    """Heights, spacing, unit and whether the map is periodic, as far as the file says it."""
    regular_file(file)
    is_array, matrix, why = file.suffix.lower() == ".npy", None, "it is no text"
    try:
        matrix = _array_of(file) if is_array else _matrix_of(text_of(file, "utf-8-sig"))
    except ValueError as reason:
        if isinstance(reason, InputError) and (is_array or not isinstance(reason.__cause__, UnicodeDecodeError)):
            raise
        why = why if isinstance(reason, InputError) else str(reason)
    if matrix is None or (needs_spacing and not is_array):
        # a text of an instrument may be a matrix below comments
        try:
            return _scan_of(file, why)
        except InputError as reason:
            if matrix is None:
                raise InputError(f"{file}, {why}; {str(reason).removeprefix(f'{file}: ')}") from reason
    assert matrix is not None
    if needs_spacing:
        raise InputError(f"{file}: a matrix of shape {matrix.shape} has no spacing; pass spacing=1.0, or (dx, dy)")
    return matrix, (1.0, 1.0), "", False


def _scan_of(file: Path, why: str) -> tuple[Floats, ArrayLike, str, bool]:
    scan, heights = instrument_scan(file, f"no matrix ({why})")
    if heights.ndim != 2:
        raise InputError(f"{file}: expected a map, got a line; use geo.read_profile")
    sizes = np.asarray(scan.physical_sizes, dtype=np.float64) / heights.shape
    unit = str(scan.unit or "")
    return heights, sizes, unit if metres(unit) else "", bool(scan.is_periodic)


def _array_of(file: Path) -> Floats:
    try:
        # not in memory yet
        stored = np.load(file, mmap_mode="r", allow_pickle=False)
        check_memory("heights", f"a map of {stored.size} heights", COPIES * stored.size)
        return heights_of("heights", stored)
    except InputError as reason:
        raise InputError(f"{file}: {reason}") from reason
    except Exception as reason:  # of a damaged file, and of arrays of objects
        raise InputError(f"{file}: expected an array of numbers in numpy's format ({reason})") from reason


def _matrix_of(text: str) -> Floats:
    """The numbers of a text, one row a line; raises ValueError with the line that is none."""
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.partition("#")[0].strip()
        if not content:
            continue
        words = [word.strip(",") for word in re.split(r"[;\s]+", content)]
        if len(words) == 1:
            words = words[0].split(",")
        try:
            rows.append([word_number(word.strip()) for word in words if word.strip()])
        except ValueError as reason:
            comma = "; write decimal points for commas" if "," in str(reason) else ""
            raise ValueError(f"line {number}: expected heights, got {str(reason)!r}{comma}") from None
        if len(rows[-1]) != len(rows[0]):
            raise ValueError(f"line {number}: expected {len(rows[0])} heights as in the first row, got {len(rows[-1])}")
    if not rows:
        raise ValueError("it has no numbers")
    return np.array(rows)


def _restored(file: Path) -> Surface:
    """What ``Surface.save`` wrote."""
    try:
        with np.load(regular_file(file), allow_pickle=False) as stored:
            return Surface(stored["heights"], stored["spacing"], str(stored["unit"]))
    except InputError as reason:
        raise InputError(f"{file}: {reason}") from reason
    except Exception as reason:  # of a damaged or foreign archive
        raise InputError(f"{file}: expected a surface as Surface.save writes it ({reason})") from reason
