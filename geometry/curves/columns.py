"""Tables for compiled functions: their columns by name, the kinds and tolerances in them, and their place in memory.

Lengths are in units of the wall, angles in radians. Each table is an array of floats with one row for each hollow,
joint, pair, curve or closed form; row numbers and flags are stored as floats. A curve is an arc or a Bezier piece; the
tables of all curves begin with the same columns. A `Struct` passes many tables by one address: numba passes an array as
seven numbers or more, which took most of the time of a compilation.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from ctypes import addressof, c_char
from typing import Any

import numpy as np

from ...core.checks import Floats
from ...core.rounding import EPS

# Points and tables of points.
POINT_X = 0
POINT_Y = 1
# Tables of double-double numbers: a number is the sum of its two parts.
HIGH = 0
LOW = 1
# Bands of heights without any piece of an open wall.
BAND_LOW = 0
BAND_HIGH = 1

# hollows: one row for each hollow; an open wall has one row, the whole cell.
LEFT = 0  # x of the left end of the opening
RIGHT = 1  # x of the right end
SIZE = 2  # maximum of the width of the opening and the extents of the joints in x and y
FIRST_JOINT = 3  # row of the first joint in `joints`
JOINTS_END = 4  # row after the last joint
LEFT_EDGE = 5  # the left end of the opening: NO_EDGE, SMOOTH_EDGE or CORNER_EDGE
RIGHT_EDGE = 6  # the right end
TREE_ROOT = 7  # row of the root in `boxes`, of the tree over the lines of a hollow that has many
TREE_LEVELS = 8  # number of levels of the tree, 0 without a tree
FORM = 9  # kind of the closed form of the reflection
FORM_START = 10  # place of its first number in `closed`
FIRST_CURVE = 11  # from here on for each table of curves its first row, and the row after the last; see `range_of`
# Kinds of ends of an opening; NO_EDGE for an open wall.
NO_EDGE, SMOOTH_EDGE, CORNER_EDGE = 0.0, 1.0, 2.0
# Kinds of closed forms.
NO_FORM, WEDGE, CIRCULAR = 0.0, 1.0, 2.0

# joints: the ends of pieces, chain by chain; row j + 1 is the other end of the piece that starts at row j.
JOINT_X = 0
JOINT_Y = 1
IS_CORNER = 2  # 1 if the tangents of the two pieces differ
STARTS_LINE = 3  # 1 if the piece that starts here is a segment
JOINT_COLUMNS = 4

# lines: one row for each joint, zeros if no segment starts there.
EDGE_X = 0  # vector from the start of the segment to its end
EDGE_Y = 1
LINE_NORMAL_X = 2  # unit normal on the left, the free side
LINE_NORMAL_Y = 3
LENGTH = 4
FIRST_PAIR = 5  # row of the line's first entry in `pairs`
PAIRS_END = 6  # row after the last entry
ESCAPE_RIGHT = 7  # of a line in a tree of boxes, with ESCAPE_LEFT: the directions in which a ray escapes, see `boxes`
ESCAPE_LEFT = 8
LINE_COLUMNS = 9

# pairs: for each line of two that face each other with nothing in between one row, sorted by line.
PARTNER = 0  # row of the other line in `lines`
NEAR_X = 1  # end towards the apex of the part of the line that faces the other line
NEAR_Y = 2
FAR_X = 3  # the other end of that part
FAR_Y = 4
APEX_X = 5  # unit vector along the line, towards the apex
APEX_Y = 6
GAP = 7  # distance to the other line at the end towards the apex
PAIR_SINE = 8  # sine of the angle between the lines
PAIR_ANGLE = 9  # angle between the lines, 0 if parallel
PAIR_COLUMNS = 10

# The first columns of every curve; each kind has a table of its own.
START_X = 0
START_Y = 1
END_X = 2
END_Y = 3
START_CORNER = 4  # 1 if the start is a corner of the wall
END_CORNER = 5  # 1 if the end is a corner

# arcs: columns 6 to 13 are in coordinates with y multiplied by STRETCH, in which the arc is circular.
NORMAL_X = 6  # unit normal at the start, towards the free side
NORMAL_Y = 7
CURVATURE = 8  # positive if the arc is focusing
CHORD_X = 9  # unit vector from the start to the end
CHORD_Y = 10
SHORT_CHORD = 11  # length of the chord, 0 for half angles beyond pi/4
RUN_SINE = 12  # sine of the angle of incidence below which a run of hits is computed in one step, 0 if never
SPAN = 13  # angle of the arc
STRETCH = 14  # 1 for circular arcs
ARC_COLUMNS = 15

# beziers: b(s) = start + s (X1, Y1) + s^2 (X2, Y2) + s^3 (X3, Y3).
X1 = 6
Y1 = 7
X2 = 8
Y2 = 9
X3 = 10
Y3 = 11
MIDDLE_X = 12  # centre of a circle about the control points
MIDDLE_Y = 13
REACH = 14  # its radius, with a margin of NEARBY_MARGIN times the extent of the piece
BEZIER_COLUMNS = 15

# Arcs in double-double arithmetic, made by `refined_arcs`: the low part of a number from NORMAL_X to SHORT_CHORD is so
# many columns behind its high part.
LOWS = 9
REFINED_ARC_COLUMNS = 21

# walls of a table in which points move: one row for each line without ends, segment or arc of an ellipse.
WALL_KIND = 0
WALL_X = 1  # a point of a straight wall; the centre of an ellipse
WALL_Y = 2
INNER_X = 3  # of straight walls the unit normal into the table, and the length
INNER_Y = 4
WALL_LENGTH = 5
SEMI_X = 3  # of arcs the semi-axes, 1 or -1 for the direction, the first angle and the span
SEMI_Y = 4
DIRECTION = 5
FIRST_ANGLE = 6
WALL_SPAN = 7
WALL_SIZE = 8  # of arcs the diagonal of the box, and the ends
FROM_X = 9
FROM_Y = 10
TO_X = 11
TO_Y = 12
WALL_COLUMNS = 13
# Kinds of walls; the times of arrival at a given one are computed elsewhere.
GIVEN_WALL, LINE_WALL, SEGMENT_WALL, ARC_WALL = 0.0, 1.0, 2.0, 3.0

# closed: one after another the closed forms of the hollows that have one, see `blocks`; places in a form.
FORM_LEFT = 0  # x of the ends of the opening
FORM_RIGHT = 1
UNCERTAINTY = 2  # a ray closer to a joint is traced hit by hit: a length in wedges, an angle in circular hollows
CIRCLE_X = 3  # the centre
CIRCLE_Y = 4
RADIUS = 5
HALF_ANGLE = 6  # of the arc
CIRCULAR_COLUMNS = 7
WEDGE_X = 3  # the apex
WEDGE_Y = 4
COPIES = 5  # number K of copies of the triangle that a straight ray can meet
CHAIN = 6  # K + 2 links for rays that meet the right line first, then K + 2 links for the other rays
# Columns of a link of a wedge's chain, relative to its first column: the unfolded end of the opening, and c in
# theta' = +-theta + c after k hits for link k. Link 0 is the end of the opening on the other side.
LINK_X = 0
LINK_Y = 1
LINK_CONSTANT = 2
LINK_COLUMNS = 3

# ---- the tolerances of the planar tracer ---------------------------------------------------------------------------
# Distance from a joint, in eps times the hollow's size, within which double precision does not resolve a hit:
# positions have a few rounding errors of one ulp of the size each.
JOINT_ULPS = 16.0
# Error, in eps times the size of the terms, below which a tangent hit and a miss are not distinguished. Each of B and F
# in D = B^2 + 2 kappa |v|^2 F has about eight rounding errors of its terms, see `pieces.tangent_error`; so has g of a
# Bezier piece at its extrema and at its ends.
TANGENT_ULPS = 16.0
# Largest angle, radians, between the tangents at a smooth joint. Both pieces then reflect a ray at the joint alike,
# within twice this angle. Tangents at joints meant to be smooth agree to a few rounding errors.
SMOOTH_JOINT = 1e-9
# Distance from the start of a ray, as a fraction of the hollow's size, within which a hit is tested again: rounding may
# have put the start on either side of the piece. From a start within 16 ulps of a piece, a ray at an angle of 1e-8 or
# more to the piece meets it within this distance.
NEARBY = 2.0**-20
# Margin of the circles about Bezier pieces, as a fraction of the sizes that NEARBY refers to: outside of them there is
# no hit, no contact and no hit to be tested again.
NEARBY_MARGIN = 4.0 * NEARBY
# NEARBY as a multiple of the slack, JOINT_ULPS rounding errors of the hollow's size; all are powers of 2.
NEARBY_SLACKS = NEARBY / (JOINT_ULPS * EPS)
# Margin of the boxes about lines, in units of the hollow's size: corners within the slack of a ray lie in boxes that it
# meets, and rounding in the test of a box loses none.
BOX_MARGIN = 4.0 * JOINT_ULPS * EPS


def range_of(table: int) -> tuple[int, int]:
    """Return the columns of a hollow for the first row of a table of curves and for the row after the last."""
    return FIRST_CURVE + 2 * table, FIRST_CURVE + 2 * table + 1


def row_of(columns: int, values: Mapping[int, float]) -> Floats:
    """Return a row of a table with the given values, zero in all other columns.

    Examples
    --------
    >>> row_of(JOINT_COLUMNS, {JOINT_X: 0.5, JOINT_Y: -1.0, IS_CORNER: True}).tolist()
    [0.5, -1.0, 1.0, 0.0]
    """
    row = np.zeros(columns)
    for column, value in values.items():
        row[column] = value
    return row


def table_of(rows: list[Floats], columns: int) -> Floats:
    """Return rows as a table of shape (rows, columns), also without rows."""
    return np.array(rows, dtype=np.float64).reshape(-1, columns)


class Struct:
    """A named tuple of numbers, arrays, structs and named tuples, laid out in memory; see `scene/compiled`.

    The numbers in an array may change, the tuple may not.

    Attributes
    ----------
    values : named tuple
    address : int
        Of the words of 8 bytes in memory: of a number its bits, of an array the address of its data, of a struct its
        address, of a named tuple its words.

    Raises
    ------
    ValueError
        If an array is not contiguous.

    Examples
    --------
    >>> from typing import NamedTuple
    >>> class Corner(NamedTuple):
    ...     x: float
    ...     is_smooth: bool
    >>> Struct(Corner(0.25, True)).values.x
    0.25
    """

    def __init__(self, values: Any) -> None:
        self.values = values
        self._words = array("q", _words(values))
        self.address, _ = self._words.buffer_info()

    def __reduce__(self) -> tuple[Any, ...]:
        # an address holds in one process only
        return Struct, (self.values,)


def _words(values: Any) -> list[int]:
    words = []
    for value in values:
        if isinstance(value, np.ndarray):
            if not value.flags.carray:
                raise ValueError("expected a contiguous array, got one with gaps; use numpy.require")
            # in a third of the time of the attribute ctypes of an array
            words.append(addressof(c_char.from_buffer(value.data)) if value.size else 0)
        elif isinstance(value, Struct):
            words.append(value.address)
        elif isinstance(value, tuple):
            words += _words(value)
        else:
            words.append(int(np.float64(value).view(np.int64)) if isinstance(value, float) else value)
    return words
