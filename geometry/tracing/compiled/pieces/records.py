"""The named tuples passed between the compiled functions of the tracer, and the kinds of pieces; without numba."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .....core.checks import Floats
from ....curves.arc import Arc
from ....curves.bezier import Bezier
from ....curves.columns import Struct

# Kinds of obstacles; OPENING is the opening of the hollow, SIDE a side of an open wall. That of a curve is FIRST_CURVE
# plus its table.
NO_PIECE, OPENING, SIDE, LINE, FIRST_CURVE = 0, 1, 2, 3, 4
ARC, BEZIER = FIRST_CURVE + Arc.table, FIRST_CURVE + Bezier.table


class Slots(NamedTuple):
    """The slots (`Late`) of functions that few rays or few walls need.

    `hit_nearby`, `starts_in_front`, `line_starts_in_front`, `nearest_line_in_boxes`, `skip_run`, `nearest_bezier`,
    `on_smooth_end`, `incidence` and `piece_label`.
    """

    nearby: int
    in_front: int
    line_in_front: int
    boxes: int
    run: int
    bezier: int
    smooth_end: int
    incidence: int
    label: int


class Scope(NamedTuple):
    """The hollow that contains a ray.

    The tables of the wall, the row of the hollow, the ends of its opening, and the slack: double precision does not
    resolve hits within the slack of a joint. Then the ranges of the hollow's joints and pieces in the tables, whether
    its lines have a tree, and the slots of late functions.
    """

    tables: Any
    hollow: Any
    left: float
    right: float
    slack: float
    joints: tuple[int, int]
    # of each table of curves
    curves: tuple[tuple[int, int], ...]
    has_tree: bool
    slots: Any


class Tree(NamedTuple):
    """The lines of a hollow that has a tree of boxes: the tables, row and level of the root, and the slack."""

    boxes: Any
    joints: Any
    lines: Any
    root: int
    top: int
    slack: float


class RefinedScope(NamedTuple):
    """The hollow that contains a ray in double-double arithmetic: as `Scope`.

    And the bands of heights of an open wall without pieces, and the scale of lengths.
    """

    tables: Any
    bands: Floats
    scale: float
    left: float
    right: float
    slack: float
    joints: tuple[int, int]
    # of each table of curves
    curves: tuple[tuple[int, int], ...]


class Own(NamedTuple):
    """The start of a ray segment.

    The kind of the piece and its row in the table, -1 for the opening and the sides; the parameter on a Bezier piece,
    else -1; the length of the last segment that ended on a piece, 0 after a run; the row of the line that was hit
    before this piece, or -1; and the number of collisions so far.
    """

    kind: int
    number: int
    s: float
    flown: float
    before: int
    bounces: int


class Hit(NamedTuple):
    """The end of a ray segment: time (inf for no hit), kind and row of the piece, position s on it, and uncertainty.

    On a line, s is a fraction, negative if relative to the line's end; on a Bezier piece, s is the parameter. The
    uncertainty is 0, 1 if hit and miss are not distinguished, or `UNCERTAIN`. In double-doubles, time and s are.
    """

    time: float
    kind: int
    number: int
    s: float
    uncertainty: int


class Sizes(NamedTuple):
    """The quantities computed along a ray, see `refined_tracing`; displacements are in units of the scale.

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


class Rays(NamedTuple):
    """The arrays of `trace_rays`, one entry for each ray: position and angle, and the results to fill.

    A ``stop`` that is not 0 ends the call.
    """

    x: Floats
    theta: Floats
    out_x: Floats
    out_theta: Floats
    collisions: NDArray[np.int64]
    status: NDArray[np.uint8]
    stop: NDArray[np.int64]


class Details(NamedTuple):
    """Further arrays to fill, empty if they are not wanted.

    ``velocity`` is the outgoing velocity, shape (n, 2). ``itinerary`` is a hash of the pieces hit, in order, of the
    lengths of runs, and of the sides passed; ``segments`` counts the segments that were computed, where a run of hits
    is one segment. These three are wanted together. ``path``, shape (limit + 2, 2), for a single ray, has the points of
    the trajectory, with every hit of a run.
    """

    velocity: Floats
    itinerary: NDArray[np.uint64]
    segments: NDArray[np.int64]
    path: Floats
    with_itinerary: bool
    with_path: bool


def details_for(rays: int = 0, path: int = 0) -> Struct:
    """Return arrays for so many rays with itineraries, or with so many rows for the path."""
    labels, segments = np.zeros(rays, np.uint64), np.zeros(rays, np.int64)
    return Struct(Details(np.empty((rays, 2)), labels, segments, np.full((path, 2), np.nan), rays > 0, path > 0))


# The details, if only the ends of the rays are wanted.
NO_DETAILS = details_for()


def results_for(count: int) -> tuple[Floats, Floats, NDArray[np.int64], NDArray[np.uint8]]:
    """Return the results in `Rays`, to fill."""
    return np.empty(count), np.empty(count), np.empty(count, np.int64), np.empty(count, np.uint8)


# The types of the arrays of all rays.
NO_RAYS = Rays(np.empty(0), np.empty(0), *results_for(0), np.empty(0, np.int64))


# The status of a ray on a facet; the others are those of `Status`.
FLYING = 4


class States(NamedTuple):
    """The rays ``who`` to move, and of every ray the hollow, the piece that it is on, with the parameter of `Own`, the
    position, the facet's tangent with the free side on its left, the angle with it, and the status.
    """

    who: NDArray[np.int64]
    hollow: NDArray[np.int64]
    kind: NDArray[np.int64]
    number: NDArray[np.int64]
    s: Floats
    point: Floats
    tangent: Floats
    angle: Floats
    status: NDArray[np.uint8]


_NUMBERS, _PAIRS = np.empty(0, np.int64), np.empty((0, 2))
NO_STATES = States(
    _NUMBERS, _NUMBERS, _NUMBERS, _NUMBERS, np.empty(0), _PAIRS, _PAIRS, np.empty(0), np.empty(0, np.uint8)
)
