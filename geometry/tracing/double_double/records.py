"""The named tuples of the tracer in double-double arithmetic; a double-double is a pair (high, low). Without numba."""

from __future__ import annotations

from typing import NamedTuple

from numpy import int64, uint8
from numpy.typing import NDArray

from ....core.checks import Floats

Wide = tuple[float, float]


class WideTables(NamedTuple):
    """The tables of a wall as in `Tables`, except for arcs.

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


class WideResults(NamedTuple):
    """The arrays that `refined_rays` fills; x and theta have the shape (n, 2), the others (n,)."""

    x: Floats
    theta: Floats
    collisions: NDArray[int64]
    status: NDArray[uint8]
    amplification: Floats
    rounding: Floats


class WideScope(NamedTuple):
    """The hollow that contains a ray: tables, ends of the opening, scale of lengths, slack, and ranges of pieces."""

    tables: WideTables
    left: float
    right: float
    scale: float
    slack: float
    joints: tuple[int, int]
    circles: tuple[int, int]
    ellipses: tuple[int, int]
    beziers: tuple[int, int]


class WideOwn(NamedTuple):
    """The start of a segment: piece, parameter on a Bezier piece, length of the last segment that ended on a piece."""

    kind: int
    number: int
    s: Wide
    flown: float


class WideHit(NamedTuple):
    """The end of a segment: time, piece, and position on it, the fraction of a line or the parameter of a curve."""

    time: Wide
    kind: int
    number: int
    s: Wide


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
