"""Walls whose cell changes: cells of several walls one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import sequence, whole_number
from ...core.errors import InputError
from ..curves.curve import Curve
from .wall import Wall

# More pieces than this are refused before they are made; the largest named walls have 10^5.
MOST_PIECES = 10**6


def join_walls(walls: Sequence[Wall], repeats: ArrayLike = 1) -> Wall:
    """Return one wall that consists of the cells of several walls, from left to right.

    The result is the finite piece of a wall on [0, period]. If every cell closes, no ray that enters it leaves it
    elsewhere, so its periodic continuation has no effect: this is a wall that is not periodic (condition A5a of the
    paper). A single curve that is no cell, such as a measured profile, is given as `Wall` itself.

    Parameters
    ----------
    walls : sequence of Wall
        Each begins at a highest point at height 0, as the named walls and every ``wall.cell`` of them do. Use
        ``wall.scaled(c)`` for another size.
    repeats : int or array_like of int
        How often each cell is repeated.

    Returns
    -------
    Wall
        Its period is the sum of the widths.

    Raises
    ------
    InputError
        If there are no walls, one begins below height 0, or a number of repeats is not a whole number of at least 1.

    Source: Rudzis 2022, sections 1.2.4 and 1.2.5.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> wall = geo.join_walls([geo.flat(), geo.Wall.from_vertices([(0, 0), (0.5, -1), (1, 0)]).scaled(0.5)], [1, 2])
    >>> wall.vertices.tolist()
    [[0.0, 0.0], [1.0, 0.0], [1.25, -0.5], [1.5, 0.0], [1.75, -0.5], [2.0, 0.0]]
    """
    walls = sequence("walls", walls, Wall, "geo.triangular_teeth(0.7)")
    if not walls:
        raise InputError("walls: expected a list of walls such as [geo.flat(), geo.triangular_teeth(0.7)], got none")
    numbers = np.asarray(repeats, dtype=object)
    if numbers.ndim and numbers.shape != (len(walls),):
        raise InputError(f"repeats: expected one whole number or {len(walls)}, got shape {numbers.shape}")
    counts = [whole_number("repeats", n, 1) for n in np.broadcast_to(numbers, (len(walls),)).tolist()]
    total = sum(len(wall.pieces) * count for wall, count in zip(walls, counts, strict=True))
    if total > MOST_PIECES:
        raise InputError(f"repeats: expected at most {MOST_PIECES} pieces in all, got {total:.3g}")
    pieces: list[Curve] = []
    islands: list[list[Curve]] = []
    right = 0.0
    for number, (wall, count) in enumerate(zip(walls, counts, strict=True)):
        if wall.pieces[0].start[1] != 0.0:
            raise InputError(
                f"walls: expected cells that begin at height 0, got one at {wall.pieces[0].start[1]:g} in wall {number}"
            )
        for _ in range(count):
            pieces += _moved(wall.pieces, right, right + wall.period)
            islands += [[piece.moved(right, 0.0) for piece in loop] for loop in wall.islands]
            right += wall.period
    return Wall(pieces, right, islands)


def _moved(pieces: Sequence[Curve], left: float, right: float) -> list[Curve]:
    """The pieces shifted by ``left``, joined exactly, the last ending at (right, 0)."""
    corners = [(left + piece.start[0], piece.start[1]) for piece in pieces] + [(right, 0.0)]
    return [
        piece.moved(left, 0.0).pinned(start, end) for piece, (start, end) in zip(pieces, pairwise(corners), strict=True)
    ]
