"""The named tuples of the tracer in double-double arithmetic. Without numba."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ....core.checks import Floats

if TYPE_CHECKING:
    from .numbers import DoubleDouble

# Kinds of pieces.
NO_PIECE, OPENING, SIDE, LINE, ARC, BEZIER = 0, 1, 2, 3, 4, 5


class Tables(NamedTuple):
    """The tables of a wall as in `compiled/records`, except for arcs.

    ``arcs`` is the table of `refined_arcs`, circles first, then ellipses; ``bands`` are the bands of heights of an open
    wall without pieces.
    """

    hollows: Floats
    joints: Floats
    lines: Floats
    pairs: Floats
    arcs: Floats
    first_ellipse: int
    beziers: Floats
    bands: Floats
    cell: float
    is_open: bool


class Scope(NamedTuple):
    """The hollow that contains a ray: tables, row of the hollow, scale of lengths, and slack."""

    tables: Tables
    hollow: Floats
    scale: float
    slack: float


class Hit(NamedTuple):
    """The end of a segment: time, piece, and position on it, the fraction of a line or the parameter of a curve.

    At the start of a segment: the end of the last one. Then the time is the length of the last segment that ended on a
    piece, and the position is -1 but on a Bezier piece.
    """

    time: DoubleDouble
    kind: int
    number: int
    s: DoubleDouble


class Sizes(NamedTuple):
    """The quantities computed along a ray, see `rays`; displacements are in units of the scale.

    The Jacobi fields of a displacement (j1, a1) and of a rotation (j2, a2); the sum C of M M^T, with entries for
    displacement and rotation, and the number of local errors in C; half an ulp of the incoming angle.
    """

    j1: float
    a1: float
    j2: float
    a2: float
    c_jj: float
    c_ja: float
    c_aa: float
    errors: float
    half_ulp: float
