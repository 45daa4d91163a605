"""The named tuples of the tracer in double-double arithmetic. Without numba."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from numpy import int64, uint8
from numpy.typing import NDArray

from ....core.checks import Floats

if TYPE_CHECKING:
    from .numbers import DoubleDouble


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


class Results(NamedTuple):
    """The arrays that `refined_rays` fills; x and theta have the shape (n, 2), the others (n,)."""

    x: Floats
    theta: Floats
    collisions: NDArray[int64]
    status: NDArray[uint8]
    amplification: Floats
    rounding: Floats


class Scope(NamedTuple):
    """The hollow that contains a ray: tables, ends of the opening, scale of lengths, slack, and ranges of pieces."""

    tables: Tables
    left: float
    right: float
    scale: float
    slack: float
    joints: tuple[int, int]
    circles: tuple[int, int]
    ellipses: tuple[int, int]
    beziers: tuple[int, int]


class Own(NamedTuple):
    """The start of a segment: piece, parameter on a Bezier piece, length of the last segment that ended on a piece."""

    kind: int
    number: int
    s: DoubleDouble
    flown: float


class Hit(NamedTuple):
    """The end of a segment: time, piece, and position on it, the fraction of a line or the parameter of a curve."""

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
