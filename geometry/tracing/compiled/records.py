"""What the compiled loop of the tracer passes from function to function, and the kinds of pieces. No numba here."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....core.checks import Floats
from ...scene.scene import Tables

# Kinds of what a ray meets; LID is the opening, SIDE a side of an open wall.
NO_PIECE, OPENING, SIDE, LINE, CIRCLE, ELLIPSE, BEZIER = 0, 1, 2, 3, 4, 5, 6


class Scope(NamedTuple):
    """The hollow that a ray is in.

    The tables of the wall, the row of the hollow, its opening, and the slack: a joint that is met within it, and a hit
    of one, are not resolved in double precision. Then the ranges of its joints and pieces in the tables, whether its
    lines have a grid, and the address of `hit_nearby`.
    """

    tables: Tables
    hollow: Floats
    left: float
    right: float
    slack: float
    joints: tuple[int, int]
    circles: tuple[int, int]
    ellipses: tuple[int, int]
    beziers: tuple[int, int]
    has_grid: bool
    nearby: int


class Own(NamedTuple):
    """Where a flight starts.

    The piece by kind and row of its table, -1 for the opening and the sides; the parameter on a Bezier piece, else -1;
    the length of the last flight that ended on a piece; the row of the line that was hit before this piece, or -1; and
    the collisions so far.
    """

    kind: int
    number: int
    s: float
    flown: float
    before: int
    bounces: int


class Hit(NamedTuple):
    """What a flight meets: its time, inf for none, kind and row of the piece, where on it, and a doubt.

    The position on a line is the fraction of it, negative from its end; on a Bezier piece it is the parameter. The
    doubt is 0, or 1 where hit and miss are not told apart, or `DOUBTFUL`.
    """

    time: float
    kind: int
    number: int
    s: float
    doubt: int


class Results(NamedTuple):
    """The arrays that `trace_rays` fills, with a row for each ray; the last three have no row if they are not wanted.

    ``velocity`` is the outgoing one, (n, 2). ``itinerary`` is a hash of the pieces hit, in their order, of the lengths
    of runs, and of the sides passed. ``path``, (limit + 2, 2), is for a single ray: the points of its trajectory, with
    the hits of runs one by one.
    """

    x: Floats
    theta: Floats
    collisions: NDArray[np.int64]
    status: NDArray[np.uint8]
    velocity: Floats
    itinerary: NDArray[np.uint64]
    path: Floats


# The last three of the results of rays of which only where and how they end is wanted.
NOT_WANTED = np.empty((0, 2)), np.zeros(0, np.uint64), np.empty((0, 2))


def results_for(count: int, velocity: int = 0, itinerary: int = 0, path: int = 0) -> Results:
    """Room for rays, and for so many rows of the three that may have none."""
    return Results(
        np.empty(count), np.empty(count), np.empty(count, np.int64), np.empty(count, np.uint8),
        np.empty((velocity, 2)), np.zeros(itinerary, np.uint64), np.full((path, 2), np.nan),
    )  # fmt: skip
