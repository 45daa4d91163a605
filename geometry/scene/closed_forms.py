"""The closed forms of the reflection by hollows of two lines, or of one circular arc.

`tracing/compiled/closed_forms` reads them; `columns` names their numbers. A *wedge* is a hollow of two lines. Its
triangle is unfolded about the apex into copies, in which a ray is straight; the ray leaves through the first copy of
the opening that it meets. A *circular hollow* is one circular arc of at most a half circle: all chords of a ray are
equal.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, ceil, cos, fsum, hypot, pi, sin
from typing import TYPE_CHECKING

import numpy as np

from ...core.checks import Floats
from ..curves import columns as c
from ..curves.arc import Arc
from ..curves.columns import row_of
from .facing import WIDEST_WEDGE

if TYPE_CHECKING:
    from ..curves.curve import Curve, Point

# Distance from a joint, as a fraction of the hollow's size, or angle from the end of an arc, within which a ray is
# traced hit by hit instead. This is far above the tolerance of a corner and above all rounding errors, so that both
# methods agree on the number of hits and on the status. About one ray in 10^8 is concerned.
UNCERTAIN_FRACTION = 2.0**-30
# Half angle, radians, below which arcs are traced hit by hit, which is more accurate for positions along flat arcs.
FLATTEST_ARC = 0.05
# Pieces of a hollow with a closed form: two lines, or one arc.
MOST_PIECES = 2
# Angle, radians, up to which a wedge is traced hit by hit, with runs of hits computed in one step.
NARROWEST_WEDGE = WIDEST_WEDGE
# Of a hollow without a closed form.
NONE = c.NO_FORM, np.empty(0)


def closed_form_of(pieces: Sequence[Curve], points: Sequence[Point], size: float) -> tuple[float, Floats]:
    """Return the kind and the numbers of the form of one hollow; ``points`` are its joints from left to right."""
    (left, top), (right, other) = points[0], points[-1]
    if top == other == 0.0 and left < right:
        if len(pieces) == 2 and all(piece.is_straight for piece in pieces):
            return _wedge_form(left, right, points[1], size)
        if len(pieces) == 1 and isinstance(pieces[0], Arc) and pieces[0].is_circular:
            return _arc_form(left, right, pieces[0])
    return NONE


def _wedge_form(left: float, right: float, apex: Point, size: float) -> tuple[float, Floats]:
    x, y = apex
    # inclinations of the two lines, each measured from its own end of the opening
    west, east = atan2(-y, x - left), atan2(-y, right - x)
    angle = fsum([pi, -west, -east])
    # the chain of the unfolded ends of the opening is convex if the apex lies below the opening
    if not left <= x <= right or angle <= NARROWEST_WEDGE:
        return NONE
    # a straight ray turns by less than pi about the apex
    copies = ceil(pi / angle)
    links = copies + 2
    row = row_of(
        c.CHAIN + 2 * links * c.LINK_COLUMNS,
        {
            c.FORM_LEFT: left, c.FORM_RIGHT: right, c.UNCERTAINTY: UNCERTAIN_FRACTION * size,
            c.WEDGE_X: x, c.WEDGE_Y: y, c.COPIES: copies,
        },
    )  # fmt: skip
    lengths = hypot(x - left, y), hypot(right - x, y)
    for start, side, first, (far, near) in ((0, 1.0, east, lengths), (links, -1.0, west, lengths[::-1])):
        for k in range(links):
            polar, length = fsum([first, -(k - 1) * angle]), near if k % 2 else far
            link = c.CHAIN + (start + k) * c.LINK_COLUMNS
            row[link + c.LINK_X], row[link + c.LINK_Y] = x + side * length * cos(polar), y + length * sin(polar)
            row[link + c.LINK_CONSTANT] = _constant(k, side, first, angle)
    return c.WEDGE, row


def _constant(hits: int, side: float, first: float, angle: float) -> float:
    """Return c of theta' = +-theta + c after ``hits`` hits, the first on the right (side 1) or on the left (side -1).

    A line of direction b reflects a ray of direction a to 2 b - a. For side 1 the lines have the directions b = first,
    first + angle, first, ..., and the ray enters in the direction theta + pi. Side -1 is the mirror image.
    """
    if hits % 2 == 0:
        return side * fsum([hits * angle, -pi])
    constant = fsum([2.0 * first, -(hits - 1) * angle, pi])
    return constant if side > 0.0 else 2.0 * pi - constant


def _arc_form(left: float, right: float, arc: Arc) -> tuple[float, Floats]:
    half = 0.5 * (arc.end_angle - arc.start_angle)
    if not FLATTEST_ARC <= half <= 0.5 * pi:
        return NONE
    radius = 0.5 * (right - left) / sin(half)
    # at pi/2 the centre lies on the opening
    height = radius * cos(half) if half < 0.5 * pi else 0.0
    numbers = {
        c.FORM_LEFT: left, c.FORM_RIGHT: right, c.UNCERTAINTY: UNCERTAIN_FRACTION,
        c.CIRCLE_X: 0.5 * (left + right), c.CIRCLE_Y: height, c.RADIUS: radius, c.HALF_ANGLE: half,
    }  # fmt: skip
    return c.CIRCULAR, row_of(c.CIRCULAR_COLUMNS, numbers)
