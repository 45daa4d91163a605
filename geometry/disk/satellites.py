"""The satellites of the disk: evenly spaced points on its rim, the only points that touch the wall."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ...core.checks import positive_number
from ...core.errors import InputError
from . import rolling

# Power of the scale in the default spacing, in (0, 1/2): the theorem needs spacing -> 0 and scale/spacing^2 -> 0.
SPACING_POWER = 0.4
# Least number of satellites; with fewer, the lowest satellite may be at the side of the disk.
FEWEST = 4
# Relative difference allowed between a given spacing and 2 pi/n, which differ by a few rounding errors.
DIVISOR_TOLERANCE = 1e-12


@dataclass(frozen=True)
class Satellites:
    """Points at the angles k spacing, k = 0, ..., count - 1, on the rim of a disk of radius 1 above a wall.

    Parameters
    ----------
    count : int
        At least 4.
    depth : float
        The depth of the wall below its tops, in units of the disk's radius.

    Raises
    ------
    InputError
        If there are fewer than 4 satellites, or the depth is not less than both 1 - cos(spacing) (at most two
        satellites touch the wall) and cos(spacing/2) (no satellite at the side of the disk touches the wall).

    Source: Rudzis 2022, section 1.3.1, eq. 1.38, and Proposition 4.1 (vi).

    Examples
    --------
    >>> Satellites.around(scale=0.01, depth=0.01).count
    39
    """

    count: int
    depth: float

    def __post_init__(self) -> None:
        if self.count < FEWEST:
            raise InputError(f"spacing: expected at least {FEWEST} satellites on the circle, got {self.count}")
        if not self.depth < self.deepest:
            raise InputError(
                f"scale and spacing: expected scale * depth < {self.deepest:.6g} (1 - cos(spacing), and below "
                f"cos(spacing/2)) so that at most two satellites touch the wall, got {self.depth:.6g}; make the scale "
                "smaller or the spacing larger"
            )

    @classmethod
    def around(cls, scale: float, depth: float, spacing: Any = None) -> Satellites:
        """Return the satellites of the given spacing, by default the least allowed spacing of at least scale^0.4.

        Raises
        ------
        InputError
            If the spacing does not divide 2 pi, or is too small for the depth.
        """
        if spacing is not None:
            gap = positive_number("spacing", spacing)
            count = round(2.0 * math.pi / gap)
            if count < 1 or abs(count * gap - 2.0 * math.pi) > DIVISOR_TOLERANCE * 2.0 * math.pi:
                below, above = (2.0 * math.pi / max(n, 1) for n in (math.ceil(2.0 * math.pi / gap), count or 1))
                raise InputError(
                    f"spacing: expected 2 pi divided by a whole number, got {gap!r}; for example {below!r} or {above!r}"
                )
            return cls(count, depth)
        count = max(FEWEST, math.floor(2.0 * math.pi / scale**SPACING_POWER))
        while count > FEWEST and not depth < cls.deepest_for(count):
            count -= 1
        return cls(count, depth)

    @staticmethod
    def deepest_for(count: int) -> float:
        """Return the depth of the wall below which at most two of ``count`` satellites are below the wall's tops."""
        return min(float(rolling.rise(2.0 * math.pi / count)), math.cos(math.pi / count))

    @property
    def deepest(self) -> float:
        """The upper bound, exclusive, on the depth of the wall."""
        return self.deepest_for(self.count)

    @property
    def spacing(self) -> float:
        """rho = 2 pi / count, the angle between neighbours, in radians."""
        return 2.0 * math.pi / self.count

    @property
    def reach(self) -> float:
        """The largest angle from the lowest point at which a satellite can be below the wall's tops."""
        return 2.0 * math.asin(math.sqrt(0.5 * self.lowest))

    @property
    def lowest(self) -> float:
        """The largest depth of the disk's centre below height 0: -x2 <= depth + 1 - cos(spacing/2)."""
        return self.depth + float(rolling.rise(0.5 * self.spacing))
