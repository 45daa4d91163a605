"""What the tracer in double-double arithmetic takes, fills, and passes from function to function. No numba here.

A double-double number is a pair (high, low).
"""

from __future__ import annotations

from typing import NamedTuple

from numpy import int64, uint8
from numpy.typing import NDArray

from ....core.checks import Floats

Wide = tuple[float, float]


class WideTables(NamedTuple):
    """The tables of a wall as in `Tables`, but for those of arcs.

    ``arcs`` are those of `refined_arcs`, the circles and then the ellipses; ``bands`` are the heights at which no piece
    of an open wall lies.
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
    """The arrays that `refined_rays` fills; x and theta are (n, 2), the others (n,)."""

    x: Floats
    theta: Floats
    collisions: NDArray[int64]
    status: NDArray[uint8]
    amplification: Floats
    rounding: Floats


class WideScope(NamedTuple):
    """The hollow that a ray is in: the tables, its opening, scale of lengths, slack, and the ranges of its pieces."""

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
    """Where a flight starts: the piece, the parameter on a Bezier piece, and the last flight that ended on a piece."""

    kind: int
    number: int
    s: Wide
    flown: float


class WideHit(NamedTuple):
    """What a flight meets: its time, the piece, and the position on it: fraction of a line, parameter of a curve."""

    time: Wide
    kind: int
    number: int
    s: Wide


class Sizes(NamedTuple):
    """What accompanies a ray, see `rays`; displacements are fractions of the scale.

    Its Jacobi fields, of a displacement (j1, a1) and of a turn (j2, a2); the sum of M M^T, with entries for
    displacement and turn, and how many errors there are; and half an ulp of the incoming angle.
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
