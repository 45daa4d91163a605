"""Koch's curve as a wall."""

from __future__ import annotations

import math

import numpy as np

from ...checks import whole_number
from ...errors import InputError
from .wall import Wall

# 4^10 is a million segments; more does not fit the memory of a laptop as separate pieces.
MOST_GENERATIONS = 10


def koch(generations: int) -> Wall:
    """Return Koch's curve turned downwards, a wall of 4^generations segments.

    Parameters
    ----------
    generations : int
        From 0 (flat) to 10.

    Raises
    ------
    InputError
        If ``generations`` is not a whole number from 0 to 10.

    Notes
    -----
    The vertices are mirror symmetric in x = 1/2 to the bit, and the heights on the baseline are exactly 0. The length
    is (4/3)^generations.

    Examples
    --------
    >>> len(koch(2).pieces)
    16
    >>> [(hollow.first, hollow.last) for hollow in koch(1).hollows]
    [(1, 3)]
    """
    count = whole_number("generations", generations, 0)
    if count > MOST_GENERATIONS:
        raise InputError(f"generations: expected at most {MOST_GENERATIONS}, got {count}")
    points = np.array([0.0, 1.0], dtype=np.complex128)
    down = np.exp(-1j * math.pi / 3.0)
    for _ in range(count):
        third = points / 3.0
        left = np.concatenate([third[:-1], 1.0 / 3.0 + down * third])
        left[-1] = 0.5 - 1j * math.sqrt(3.0) / 6.0
        # 1 - (1 - x) is the nearest number whose mirror image 1 - x is exact
        x = 1.0 - (1.0 - left.real)
        left = x + 1j * left.imag
        right = (1.0 - x[-2::-1]) + 1j * left.imag[-2::-1]
        points = np.concatenate([left, right])
    return Wall.from_vertices(np.column_stack([points.real, points.imag]))
