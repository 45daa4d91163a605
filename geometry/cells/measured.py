"""A measured profile as a value: positions, heights and their unit; sorted, interpolated and detrended."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, finite_number, frozen, instance, shortened, whole_number
from ...core.errors import InputError
from ...core.estimates import Summary
from ..curves.curve import LARGEST_COORDINATE

# Metres of units of length: signs, which are told from each other by capitals, and words in small letters.
METRES = {
    "pm": 1e-12, "Å": 1e-10, "A": 1e-10, "nm": 1e-9, "um": 1e-6, "μm": 1e-6, "mm": 1e-3, "cm": 1e-2, "dm": 0.1,
    "m": 1.0, "km": 1e3, "in": 0.0254, "mil": 2.54e-5, "thou": 2.54e-5, "uin": 2.54e-8, "μin": 2.54e-8,
    "ft": 0.3048, "angstrom": 1e-10, "ångström": 1e-10, "micron": 1e-6, "inch": 0.0254, "inches": 0.0254,
    "microinch": 2.54e-8, "microinches": 2.54e-8, "foot": 0.3048, "feet": 0.3048,
}  # fmt: skip
PREFIXES = {"": 1.0, "pico": 1e-12, "nano": 1e-9, "micro": 1e-6, "milli": 1e-3, "centi": 1e-2, "deci": 0.1, "kilo": 1e3}
METRES |= {f"{prefix}{metre}": size for prefix, size in PREFIXES.items() for metre in ("meter", "metre")}
# A unit may have a power of ten before it.
SCALED = re.compile(r"(?:1(?:\.0*)?\s*[x*·]?\s*)?(?:e|10\s*(?:\^|\*\*)\s*|E)([+-]?\d{1,2})\s*[x*·]?\s*(\S+)")
# Radians of the units of angles that slopes have.
RADIANS = {
    "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "µrad": 1e-6, "μrad": 1e-6, "microrad": 1e-6, "nrad": 1e-9,
    "deg": math.pi / 180.0, "°": math.pi / 180.0, "arcmin": math.pi / 10800.0, "arcsec": math.pi / 648000.0,
}  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Profile(Summary):
    """Heights above positions along a line, in one unit; ``x, height = profile`` unpacks it.

    Parameters
    ----------
    x : array_like, shape (n,)
        Positions; finite.
    height : array_like, shape (n,)
        Heights in the same unit; masked, infinite and nan ones are undefined.
    unit : str
        Of both, such as ``"µm"``; empty where it is not known.

    Examples
    --------
    >>> raw = Profile([2, 0, 1, 3], [3.0, 1.0, np.nan, 4.0], "mm")
    >>> filled = raw.sorted().interpolated()
    >>> raw.undefined, filled.height.tolist(), filled.detrended().height.tolist()
    (1, [1.0, 2.0, 3.0, 4.0], [0.0, 0.0, 0.0, 0.0])
    """

    x: Floats
    height: Floats
    unit: str = ""

    def __post_init__(self) -> None:
        x, height = finite_array("x", self.x), heights_of("height", self.height)
        if x.ndim != 1 or x.shape != height.shape or len(x) < 2:
            raise InputError(
                f"x and height: expected two arrays of the same length, at least 2, got shapes {x.shape} and "
                f"{height.shape}"
            )
        instance("unit", self.unit, str, "'µm'")
        largest = max(float(np.abs(x).max()), float(np.nanmax(np.abs(height), initial=0.0)))
        if largest > LARGEST_COORDINATE:
            raise InputError(f"x and height: expected numbers of at most {LARGEST_COORDINATE:g}, got {largest:g}")
        object.__setattr__(self, "x", frozen(x))
        object.__setattr__(self, "height", frozen(height))

    def __iter__(self) -> Iterator[Floats]:
        return iter((self.x, self.height))

    @property
    def undefined(self) -> int:
        """The number of undefined heights, which are nan."""
        return int(np.isnan(self.height).sum())

    def sorted(self) -> Profile:
        """The points in the order of their positions; of those at one position the mean of the defined heights."""
        order = np.argsort(self.x, kind="stable")
        x, height = self.x[order], self.height[order]
        positions, owner = np.unique(x, return_inverse=True)
        defined = ~np.isnan(height)
        count = np.bincount(owner, defined, len(positions))
        total = np.bincount(owner, np.where(defined, height, 0.0), len(positions))
        means = np.divide(total, count, out=np.full(len(positions), np.nan), where=count > 0.0)
        return Profile(positions, means, self.unit)

    def interpolated(self) -> Profile:
        """Undefined heights between two defined ones on the straight line between them; at the ends the nearest one.

        Raises
        ------
        InputError
            If fewer than two heights are defined.
        """
        defined = ~np.isnan(self.height)
        if defined.sum() < 2:
            raise InputError(f"height: expected at least two defined heights, got {int(defined.sum())}")
        order = np.argsort(self.x[defined])
        known, heights = self.x[defined][order], self.height[defined][order]
        return Profile(self.x, np.where(defined, self.height, np.interp(self.x, known, heights)), self.unit)

    def detrended(self, degree: int = 1) -> Profile:
        """Less the polynomial that fits best: degree 0 the mean, 1 the tilt too, 2 a bow too."""
        degree = whole_number("degree", degree, 0)
        defined = ~np.isnan(self.height)
        if defined.sum() <= degree:
            raise InputError(f"degree: expected less than the number of defined heights, {int(defined.sum())}")
        trend = np.polynomial.Polynomial.fit(self.x[defined], self.height[defined], degree)
        rest = np.asarray(self.height - trend(self.x))
        # what is left of an exact fit is rounding
        size = np.abs(self.height[defined]).max()
        return Profile(self.x, np.where(np.abs(rest) <= FIT_ROUNDING * size, 0.0, rest), self.unit)

    def in_unit(self, unit: str) -> Profile:
        """Converted to another unit of length."""
        factor = unit_ratio(self.unit, unit)
        return Profile(self.x * factor, self.height * factor, unit)


# Of the best fit, relative to the heights.
FIT_ROUNDING = 1e-14


def heights_of(name: str, value: ArrayLike) -> Floats:
    """Numbers of which some may be undefined: masked and infinite ones become nan."""
    try:
        given: Any = np.ma.asarray(value)
        if given.dtype.kind in "cSUmMV":
            raise TypeError("of another kind")
        array = np.ma.filled(given.astype(np.float64), np.nan)
    except Exception as reason:  # foreign objects fail in their own way
        raise InputError(f"{name}: expected numbers, got {shortened(value)}") from reason
    return np.where(np.isfinite(array), array, np.nan)


def metres(unit: str) -> float | None:
    """How many metres a unit of length is, written as a sign or a word, also after a power of ten; None if none.

    Examples
    --------
    >>> metres("µm"), metres("Microns"), metres("1e-6 m"), metres("MM"), metres("px")
    (1e-06, 1e-06, 1e-06, 0.001, None)
    """
    # the sign of Angstrom is a letter with a ring, and the one of micro a Greek letter
    plain = unicodedata.normalize("NFKC", unit).strip().replace("−", "-")
    scaled = SCALED.fullmatch(plain)
    if scaled is not None:
        size = metres(scaled[2])
        return None if size is None else float(f"{size * 10.0 ** int(scaled[1]):.12g}")
    # capitals tell milli from mega; words, and signs all in capitals, have no other meaning
    small = plain.lower() if plain.isupper() or len(plain) > 3 else plain
    single = small.removesuffix("s") if len(plain) > 3 else small
    found = (METRES.get(name) for name in (plain, small, single))
    return next((size for size in found if size is not None), None)


def unit_ratio(given: str, wanted: str) -> float:
    """How many of the wanted unit one of the given is.

    Examples
    --------
    >>> unit_ratio("nm", "µm"), unit_ratio("px", "px")
    (0.001, 1.0)
    """
    if given == wanted:
        return 1.0
    sizes = []
    for unit in (given, wanted):
        size = metres(unit)
        if size is None:
            raise InputError(f"units: expected units of length such as nm, um, mm, m, in, mil, got {unit!r}")
        sizes.append(size)
    return finite_number("units", float(f"{sizes[0] / sizes[1]:.12g}"))


def is_slope(unit: str) -> bool:
    """Whether slopes are measured in this unit: one of angles, or one length per another.

    Examples
    --------
    >>> is_slope("urad"), is_slope("nm/mm"), is_slope("mm")
    (True, True, False)
    """
    above, per, below = unit.partition("/")
    return unit in RADIANS or bool(per and metres(above) and metres(below))


def integrated(x: Floats, slopes: Floats, unit: str) -> tuple[Floats, Floats]:
    """Positions in their order, and the heights in the same unit by the trapezoidal rule, 0 at the first.

    Parameters
    ----------
    slopes : ndarray
        In ``unit``, which `is_slope`; without one they are ratios.

    Examples
    --------
    >>> integrated(np.array([0.0, 2.0, 4.0]), np.array([0.0, 1.0, 3.0]), "")[1].tolist()
    [0.0, 1.0, 5.0]
    """
    if unit in RADIANS:
        angles = slopes * RADIANS[unit]
        if np.nanmax(np.abs(angles)) >= 0.5 * math.pi:
            raise InputError(f"slopes: expected angles below a right one, got {np.nanmax(np.abs(slopes)):g} {unit}")
        slopes = np.tan(angles)
    elif unit:
        above, _, below = unit.partition("/")
        slopes = slopes * unit_ratio(above, below)
    ordered = Profile(x, slopes).sorted()
    if ordered.undefined:
        raise InputError(f"slopes: {ordered.undefined} of {len(ordered.x)} are undefined; leave those lines out")
    steps = 0.5 * (ordered.height[1:] + ordered.height[:-1]) * np.diff(ordered.x)
    return ordered.x, np.concatenate([[0.0], np.cumsum(steps)])
