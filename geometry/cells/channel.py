"""The channel of a hollow: two vertical sides that face each other at the opening, and the hollow below them."""

from __future__ import annotations

from typing import Generic, NamedTuple, TypeVar

from ..curves.curve import Curve
from ..curves.segment import Segment
from .cell import Cell
from .hollow import Hollow
from .hollow_shape import BESIDE, SHAPE_TOLERANCE

# Where a piece below is higher than the lower end of a side, the channel ends at this fraction of the piece's depth.
BELOW_PIECES = 0.9
AnyCell = TypeVar("AnyCell", bound=Cell)


class Channel(NamedTuple, Generic[AnyCell]):
    """A channel and what is below it.

    ``height_to_width`` is the length of its shorter side over the width of the opening. ``below`` is the cell with one
    hollow, whose opening is the lower end of the channel.
    """

    height_to_width: float
    below: AnyCell


def channel_of(cell: AnyCell, hollow: Hollow) -> Channel[AnyCell] | None:
    """Return the channel of one hollow of a wall that is its own ``cell``; None if its sides are not vertical.

    None also for a rectangle, with only a level floor below the channel. The channel ends above all other pieces of the
    hollow, also where these are higher than the lower end of a side.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> wall = geo.mushrooms(0.25, 2.0)
    >>> channel = channel_of(wall, wall.hollows[0])
    >>> channel.height_to_width, channel.below.depth, channel.below.hollows[0].width
    (2.0, 0.5, 0.25)
    >>> [channel_of(wall, wall.hollows[0]) for wall in (geo.triangular_teeth(0.7), geo.rectangular_teeth(2.0))]
    [None, None]
    """
    path = cell.pieces[hollow.first : hollow.last]
    rounding = SHAPE_TOLERANCE * cell.period
    if len(path) < 3 or not all(_is_vertical(piece, rounding) for piece in (path[0], path[-1])):
        return None
    (_, left), (_, right) = path[0].end, path[-1].start
    inside = list(path[1:-1])
    height = min(-left, -right)
    highest = max(piece.box[3] for piece in inside)
    if highest > rounding - height:
        height = -BELOW_PIECES * highest
    if -left > height + rounding:
        inside = [Segment((hollow.left, -height), path[0].end), *inside]
    if -right > height + rounding:
        inside = [*inside, Segment(path[-1].start, (hollow.right, -height))]
    if height <= rounding:
        return None
    below = _alone(cell, inside, hollow, height)
    return Channel(height / hollow.width, below) if below.hollows else None


def _is_vertical(piece: Curve, rounding: float) -> bool:
    return isinstance(piece, Segment) and abs(piece.end[0] - piece.start[0]) <= rounding


def _alone(cell: AnyCell, inside: list[Curve], hollow: Hollow, height: float) -> AnyCell:
    """The cell of the pieces below a channel, raised to the level of the opening, between flat tops."""
    least, most = min(piece.box[0] for piece in inside), max(piece.box[2] for piece in inside)
    before = BESIDE * max(hollow.left - least, 0.0) + hollow.width
    after = BESIDE * max(most - hollow.right, 0.0) + hollow.width
    shift, first, last = before - hollow.left, (before, 0.0), (before + hollow.width, 0.0)
    moved = [piece.moved(shift, height) for piece in inside]
    ends = [first, *(piece.end for piece in moved[:-1]), last]
    pieces = [piece.pinned(start, end) for piece, start, end in zip(moved, ends[:-1], ends[1:], strict=True)]
    period = before + hollow.width + after
    found = object.__new__(type(cell))
    found._fill((Segment((0.0, 0.0), first), *pieces, Segment(last, (period, 0.0))), period, (), cell.unit)
    return found
