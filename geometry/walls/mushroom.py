"""Walls of mushroom-shaped hollows, a stem with a wide cap, and further generations in their flat tops."""

from __future__ import annotations

import math
from itertools import pairwise

from ...core.checks import number_between, whole_number
from ...core.errors import InputError
from ...core.rounding import EPS
from ..curves.arc import Arc
from ..curves.curve import Curve
from ..curves.segment import Segment
from .wall import Wall

# Largest number of pieces; more take minutes to validate and trace.
MOST_PIECES = 200_000

# Shortest stem that differs from rounding of coordinates of size 1. The plate above the cap of a shorter stem has
# zero thickness, as for stem_aspect = 0.
SHORTEST_STEM = 256.0 * EPS


def mushrooms(stem_to_cap: float = 0.2, stem_aspect: float = 0.0, generations: int = 1) -> Wall:
    """Return a wall of mushroom-shaped hollows.

    A hollow is a straight stem, open in the middle of the cell, above a cap as wide as the cell: a semicircle below a
    flat ceiling. Generation g + 1 divides every flat top of generation g into equal cells with mushrooms of the same
    proportions, the largest that fit strictly above the ceiling of the cap beneath.

    Parameters
    ----------
    stem_to_cap : float
        s in (0, 1): the width of the stem over the width of the cap.
    stem_aspect : float
        a >= 0: the length of the stem over its width. For a = 0 the flat top is a plate of zero thickness.
    generations : int
        At least 1; more than 1 needs a > 0. The openings cover 1 - (1 - s)^generations of the period.

    Raises
    ------
    InputError
        If a parameter is out of range, or the generations do not fit or have too many pieces.

    Examples
    --------
    >>> wall = mushrooms(0.25)
    >>> wall.hollows
    (Hollow(left=0.375, right=0.625, first=1, last=4),)
    >>> wall.depth
    0.5
    """
    s, a, count = checked_mushrooms(stem_to_cap, stem_aspect, generations)
    return Wall(_cells(0.0, 1.0, 1, s, a, _cells_per_top(s, a, count)))


def checked_mushrooms(stem_to_cap: float, stem_aspect: float, generations: int) -> tuple[float, float, int]:
    """Return the parameters of `mushrooms` as numbers, the aspect 0 for stems without length; raise its errors."""
    s = number_between("stem_to_cap", stem_to_cap, 0.0, 1.0)
    a = number_between("stem_aspect", stem_aspect, 0.0, math.inf, closed="low")
    count = whole_number("generations", generations, 1)
    if a * s >= SHORTEST_STEM:
        return s, a, count
    if count > 1:
        raise InputError(
            f"generations: expected 1 for stems without length (stem_aspect = {a!r}), got {count}: "
            "the next generation needs room above the caps, pass a larger stem_aspect"
        )
    return s, 0.0, count


def fewest_per_top(s: float, a: float) -> int:
    """Return the least number of mushrooms of the next generation that fit into each flat top; 0 without stems.

    In units of the cap's width, flat tops are (1 - s)/2 wide and a s thick, and a mushroom of width d has the depth
    d (a s + 1/2). So d = (1 - s)/(2 n) fits strictly if n a s > (1 - s)/2 (a s + 1/2), in every generation.
    """
    return math.floor(0.5 * (1.0 - s) * (a * s + 0.5) / (a * s)) + 1 if a > 0.0 else 0


def _cells_per_top(s: float, a: float, generations: int) -> list[int]:
    """Return for each generation the number of next-generation mushrooms per flat top, 0 for the last."""
    if generations == 1:
        return [0]
    per_top = fewest_per_top(s, a)
    pieces = 9 * sum((2 * per_top) ** g for g in range(min(generations, 60)))
    if pieces > MOST_PIECES:
        raise InputError(
            f"generations: expected at most {MOST_PIECES} pieces, got about {pieces:.3g} "
            f"({per_top} mushrooms in each flat top); pass fewer generations or a larger stem_aspect"
        )
    return [per_top] * (generations - 1) + [0]


def _cells(left: float, right: float, count: int, s: float, a: float, deeper: list[int]) -> list[Curve]:
    """Return ``count`` mushrooms side by side on [left, right]."""
    edges = [left + (right - left) * (k / count) for k in range(count)] + [right]
    pieces: list[Curve] = []
    for low, high in pairwise(edges):
        pieces += _cell(low, high, s, a, deeper)
    return pieces


def _cell(left: float, right: float, s: float, a: float, deeper: list[int]) -> list[Curve]:
    """Return one mushroom on [left, right] with the mushrooms in its flat tops."""
    width = right - left
    middle = left + 0.5 * width
    stem_right = middle + 0.5 * s * width
    stem_left = left + (right - stem_right)  # exact on [0, 1]: mirror symmetry is exact
    ceiling = -a * s * width
    cap = Arc((middle, ceiling), 0.5 * width, math.pi, 2.0 * math.pi).pinned((left, ceiling), (right, ceiling))
    inside: list[Curve] = [
        Segment((stem_left, ceiling), (left, ceiling)),
        cap,
        Segment((right, ceiling), (stem_right, ceiling)),
    ]
    if ceiling != 0.0:
        down = Segment((stem_left, 0.0), (stem_left, ceiling))
        up = Segment((stem_right, ceiling), (stem_right, 0.0))
        inside = [down, *inside, up]
    return [*_top(left, stem_left, s, a, deeper), *inside, *_top(stem_right, right, s, a, deeper)]


def _top(left: float, right: float, s: float, a: float, deeper: list[int]) -> list[Curve]:
    if deeper[0] == 0:
        return [Segment((left, 0.0), (right, 0.0))]
    return _cells(left, right, deeper[0], s, a, deeper[1:])
