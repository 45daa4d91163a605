"""The satellites of the disk: evenly spaced points on its rim, the only points that touch the wall."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ...core.checks import positive_number
from ...core.errors import InputError
from . import rolling

# The theorem asks for spacings that tend to 0 while scale/spacing^2 tends to 0; two fifths is in the middle.
SPACING_POWER = 0.4
# With fewer satellites the lowest of them may turn to the side of the disk.
FEWEST = 4
# 2 pi/n and what a caller computes for it differ by a few rounding errors.
DIVISOR_TOLERANCE = 1e-12


@dataclass(frozen=True)
class Satellites:
    """Points at the angles k spacing, k = 0, ..., count - 1, on the rim of a disk of radius 1 above a wall.

    Parameters
    ----------
    count : int
        At least 4.
    depth : float
        How far the wall reaches below its tops, in units of the disk's radius.

    Raises
    ------
    InputError
        If three satellites could be below the wall's tops at once: depth must be less than 1 - cos(spacing), and less
        than cos(spacing/2) so that no satellite at the disk's side touches the wall.

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
        """The ring with the given spacing, or by default the least spacing of at least scale^0.4 that is allowed.

        Raises
        ------
        InputError
            If the spacing does not divide the circle, or is too small for the depth.
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
        """The depth below which at most two of ``count`` satellites are between the wall's tops and its bottom."""
        return min(float(rolling.rise(2.0 * math.pi / count)), math.cos(math.pi / count))

    @property
    def deepest(self) -> float:
        """The wall must be less deep than this."""
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
        """How far the disk's centre can come below height 0: -x2 <= depth + 1 - cos(spacing/2)."""
        return self.depth + float(rolling.rise(0.5 * self.spacing))
