"""Walls of vertical and horizontal sides that send nearly every ray back: the notched angle and the tube."""

from __future__ import annotations

import math

from ...core.checks import number_between, whole_number
from ...core.errors import InputError
from .wall import Wall

# Walls with more pieces than this do not fit the memory of a laptop.
MOST_STEPS = 1_000_000
# Thickness of a plate over its height. A ray that meets the rim of a plate keeps its vertical direction.
THICKNESS = 1e-3


def notched_angle(angle: float, notches: int) -> Wall:
    """Return Plakhov's notched angle: a wedge that narrows downwards, its sides cut into vertical and horizontal steps.

    A ray that is less steep than the sides is sent back by the corner between a step and the side above it. It then
    retraces its path up to a shift of the size of the steps. So the law tends to retroreflection when first the notches
    become fine, and then the angle small.

    Parameters
    ----------
    angle : float
        Opening angle of the wedge in (0, pi), radians; its depth is cot(angle/2)/2.
    notches : int
        Notches on each side, from 1 to 10^6.

    Raises
    ------
    InputError
        If a parameter is out of range.

    Notes
    -----
    Source: A. Plakhov, "Mathematical retroreflectors", Discrete Contin. Dyn. Syst. 30 (2011) 1211, for the idea; the
    measures here are chosen so that the steps have equal size.

    Examples
    --------
    One notch on each side is a crevice:

    >>> notched_angle(math.pi / 2, 1)
    Wall(3 segments, period 1, depth 0.5, closes)
    """
    opening = number_between("angle", angle, 0.0, math.pi)
    count = whole_number("notches", notches, 1)
    if count > MOST_STEPS:
        raise InputError(f"notches: expected at most {MOST_STEPS}, got {count}")
    depth = 0.5 / math.tan(0.5 * opening)
    steps = [(0.5 * (k // 2) / count, -depth * ((k + 1) // 2) / count) for k in range(2 * count)]
    return _symmetric(steps)


def tube(plates: int, height: float, spacing: float = 1.0) -> Wall:
    """Return the tube of Bachurin, Khanin, Marklof and Plakhov, cut off: a shaft with thin plates on both its sides.

    A ray that is sent up by a plate after k plates passes k plates on the way back. If it meets none of them, its
    horizontal direction is reversed as well: the height at which it met the plate is nearly that of a reflection at a
    side. The law tends to retroreflection when the plates become short, in a tube of infinite depth.

    Parameters
    ----------
    plates : int
        Plates on each side, from 1 to 10^6. The floor is one spacing below the last.
    height : float
        Length of each plate in (0, 1/2), in units of the tube's width 1. Its thickness is a thousandth of this.
    spacing : float
        Vertical distance of the plates, at least the height.

    Raises
    ------
    InputError
        If a parameter is out of range.

    Notes
    -----
    Source: P. Bachurin, K. Khanin, J. Marklof and A. Plakhov, "Perfect retroreflectors and billiard dynamics", J. Mod.
    Dyn. 5 (2011) 33.

    Examples
    --------
    >>> tube(2, 0.125)
    Wall(19 segments, period 1, depth 3, closes)
    """
    count, length = whole_number("plates", plates, 1), number_between("height", height, 0.0, 0.5)
    if count > MOST_STEPS:
        raise InputError(f"plates: expected at most {MOST_STEPS}, got {count}")
    apart = number_between("spacing", spacing, 0.0, math.inf)
    if apart < length:
        raise InputError(f"spacing: expected at least the height {length:g}, got {apart:g}")
    half = 0.5 * THICKNESS * length
    left = [(0.0, 0.0)]
    for k in range(1, count + 1):
        upper, lower = -apart * k + half, -apart * k - half
        left += [(0.0, upper), (length, upper), (length, lower), (0.0, lower)]
    return _symmetric([*left, (0.0, -apart * (count + 1))])


def _symmetric(left: list[tuple[float, float]]) -> Wall:
    """The polygonal wall of period 1 with these vertices on its left half, and their mirror images."""
    return Wall.from_vertices([*left, *((1.0 - x, y) for x, y in reversed(left))])
