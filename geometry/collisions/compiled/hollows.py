"""The first contact of a satellite with the pieces of one hollow: compiled. Loads numba."""

from __future__ import annotations

import numpy as np

from ...scene import columns as c
from ...tracing.compiled.options import inlined
from ...tracing.compiled.records import BEZIER, LINE, NO_PIECE, SIDE
from .contact import ARC, CLEAR, Span, Touch, first_on_piece, next_root, satellite_after, towards_line
from .graphs import first_on_graph


@inlined
def first_in_hollow(h, own, came_from, path, span, ground):
    """-> Touch: the first contact of one satellite with the pieces of hollow h.

    The sides of the cell of an open wall count as pieces. ``came_from`` is -1 or 1 if the satellite has just entered
    through the left or the right side.
    """
    hollows, joints, motion = ground.hollows, ground.joints, path.motion
    t, end, rotation = span
    kind, number, code, size = NO_PIECE, -1, CLEAR, hollows[h, c.SIZE]
    where = satellite_after(t, rotation, path.turn, motion)
    ranges = (c.FIRST_JOINT, c.JOINTS_END), (c.FIRST_CIRCLE, c.CIRCLES_END), (c.FIRST_ELLIPSE, c.ELLIPSES_END)
    for first, end_of_range in ranges:
        tried = LINE if first == c.FIRST_JOINT else ARC
        for k in range(int(hollows[h, first]), int(hollows[h, end_of_range])):
            if tried == ARC or joints[k, c.STARTS_LINE] > 0.0:
                rest = Span(t, end, rotation)
                hit, there, unclear = first_on_piece(tried, k, own, path, rest, size, ground)
                if hit < end:
                    end, kind, number, code, where = hit, tried, k, unclear, there
    for k in range(int(hollows[h, c.FIRST_BEZIER]), int(hollows[h, c.BEZIERS_END])):
        hit, there, unclear = first_on_graph(k, own, path, Span(t, end, rotation), size, ground)
        if hit < end:
            end, kind, number, code, where = hit, BEZIER, k, unclear, there
    if ground.is_open:
        for side in (-1, 1):
            edge = hollows[h, c.LEFT] if side < 0 else hollows[h, c.RIGHT]
            line = towards_line(side * (edge - path.x), -float(side), 0.0, path.turn, motion)
            rest = Span(t, end, rotation)
            hit, then, unclear = next_root(1.0, came_from == side, line, None, None, rest, path, np.inf)
            if hit < end:
                end, kind, number, code = hit, SIDE, side, unclear
                where = satellite_after(hit, then, path.turn, motion)
    return Touch(end if kind != NO_PIECE else np.inf, kind, number, where, code)
