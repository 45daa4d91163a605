"""Compiled: when a satellite of the flying disk first meets a piece of the wall. Only `rigid_engine` imports this file.

A satellite meets a line or an upright conic where F = 0, see `flight_engine`.

**No root is passed.** On [t, t + ahead] the second derivative of F(D(t)) is at least c = F''(t) - L ahead, where L
bounds the third one. So F lies above the parabola with F(t), F'(t) and c, and the first root of the parabola is a
safe step; where the parabola has none, F has none. The steps converge quadratically because c tends to F''. All roots
of F are visited in their order, in both directions, until one lies on the piece.

**No face is met from behind.** A satellite that leaves one piece within rounding of another one has F = 0 there, too.
Whether it lies in front of that one is decided by the pieces' own places, see `sides_engine`: not of the other face of
a plate without thickness, nor of the other side of a sharp peak.
"""

from __future__ import annotations

import math

import numpy as np

from ...tracing.compiled.arcs import on_arc
from ...tracing.compiled.nearby import LINE, NO_PIECE, SIDE
from ...tracing.compiled.rays import BOUNCE_LIMIT, CORNER, ESCAPED, GRAZING, near_end
from ...tracing.double_double.sides import ARC as CURVED
from ...tracing.double_double.sides import in_front_at
from .flight_engine import compiled, conic_after, inlined, line_after, satellite_after, towards_line, turning

# A contact is clear, or double precision does not settle it; the codes are those of the statuses of rays.
CLEAR = ESCAPED
# numba compiles a function again for every literal that it is called with, but not for constants of these types
NOTHING, ZERO, NO = np.int64(-1), np.int64(0), np.bool_(False)
# Of the slack, 16 rounding errors, a root's own error may be this share.
ROOT_SHARE = 1.0 / 16.0
# Incidences below 1e-6 radians are treated as that one, so that the slack stays far below the pieces' lengths.
WIDEST_SLACK = 1e6
# A near tangency halves its distance at every step at worst, from the wall's size to its rounding in about 100 steps.
# The others are for disks that sink slowly while they turn fast: a step is a few of the wall's sizes on the rim.
ROOT_STEPS = 100_000
# Circles and ellipses together, a number that no kind of piece of the planar tracer has.
ARC = 8


@inlined
def safe_step(f, f1, c):
    """First positive root of the parabola f + f1 t + c t^2/2 with f >= 0, or inf; 0 only where f = 0 > f1."""
    disc = f1 * f1 - 2.0 * c * f
    if f1 < 0.0:
        return 2.0 * f / (math.sqrt(disc) - f1) if disc >= 0.0 else np.inf
    return (f1 + math.sqrt(disc)) / -c if c < 0.0 else np.inf


@compiled
def next_root(sign, leaving, line, conic, t, end, turned, turn, motion, patience, slack):
    """First time in [t, end) at which sign F falls through 0 (inf if none), the turning until then, and a code.

    F is that of a ``line``, see `towards_line`, or of a ``conic`` (f, g1, g2, curvature, stretch); the other one is
    None. ``turned`` is the `turning` until t. ``leaving`` says that F(t) = 0 to rounding, a root that is not to be
    found again, and ``patience`` is the longest time for which the bounds are worth having. Where the steps run out the
    time is the last one up to which there is no root, and the code `BOUNCE_LIMIT`.
    """
    third, growth = motion.spin * motion.spin * abs(motion.omega), 0.0
    for number in range(ROOT_STEPS):
        if conic is not None:
            f, f1, f2, third, growth = conic_after(conic, t, turned, turn, motion)
        if line is not None:
            f, f1, f2 = line_after(line, t, turned, motion)
        f, f1, f2 = sign * f, sign * f1, sign * f2
        if number == 0 and leaving:
            if f1 <= 0.0:
                return t, turned, GRAZING
            f = 0.0
        elif f <= 0.0:
            # at the start: behind the piece by a rounding error
            return t, turned, CLEAR if number > 0 else CORNER
        ahead = min(end - t, patience)
        doubt = (third + growth * ahead) * ahead
        step = safe_step(f, f1, f2 - doubt)
        if step >= ahead:
            if f2 - doubt > 0.0 and -f2 * ahead <= f1 < 0.0 and f - 0.5 * f1 * f1 / f2 <= slack:
                # so near a tangency that rounding decides between two roots and none
                t -= f1 / f2
                return t, turning(motion.spin * t), GRAZING
            if end - t <= patience:
                break
            step = ahead
        before = t
        t += step
        turned = turning(motion.spin * t)
        # what F may still be there is its gap to the parabola; far below the slack it counts as 0
        if step < ahead and (doubt * step * step <= ROOT_SHARE * slack or t == before):
            return t, turned, CLEAR
    else:
        return t, turned, BOUNCE_LIMIT
    return np.inf, turned, CLEAR


@inlined
def where_on_line(joints, lines, j, x, y, slack):
    """How a point of the line through segment j lies to the segment: inside, and within the slack of a corner."""
    along = (x - joints[j, 0]) * lines[j, 0] + (y - joints[j, 1]) * lines[j, 1]
    length = lines[j, 4]
    from_start, from_end = along / length, length - along / length
    corner = (from_start <= slack and joints[j, 2] > 0.0) or (from_end <= slack and joints[j + 1, 2] > 0.0)
    return from_start >= -slack and from_end >= -slack, corner


@compiled
def is_in_front(own_kind, own_index, kind, index, x, y, slack, ground):
    """Whether a satellite at (x, y) on one piece lies in front of another one, which is within the slack of it."""
    own_arc, arc = own_index if own_kind == ARC else 0, index if kind == ARC else 0
    row, other = ground.exact_arcs[own_arc], ground.exact_arcs[arc]
    # there are no Bezier pieces, and no flight: a face that it came through in that is not looked for
    return in_front_at(
        ground.joints, CURVED if own_kind == ARC else LINE, own_index, row, row, (0.0, 0.0),
        CURVED if kind == ARC else LINE, index, other, other, (0.0, 0.0),
        (x, 0.0), (y, 0.0), 0.0, 0.0, 0.0, slack, slack,
    )  # fmt: skip


@inlined
def first_on_piece(kind, index, own_kind, own_index, x, y, t, end, turned, turn, motion, size, slack, ground):
    """First contact in [t, end) of one satellite with the front of one piece, its state there, and a code.

    (x, y) is where the satellite was at the start of the flight, on the piece ``own_kind``, ``own_index`` if any.
    ``turned`` is its `turning` until t, and its state is what `satellite_after` gives.
    """
    own = own_kind == kind and own_index == index
    joints, lines, arcs = ground.joints, ground.lines, ground.arcs
    line, conic = (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 1.0)
    stretch, patience = 1.0, np.inf
    leaving = own and t == 0.0
    if kind == LINE:
        g1, g2 = lines[index, 2], lines[index, 3]
        level = 0.0 if own else g1 * (x - joints[index, 0]) + g2 * (y - joints[index, 1])
        line = towards_line(level, g1, g2, turn, motion)
        here, rate, bend = line_after(line, t, turned, motion)
        if t == 0.0 and own_kind != NO_PIECE and not own and abs(here) <= slack:
            leaving = not is_in_front(own_kind, own_index, kind, index, x, y, slack, ground)
        ahead = end - t
        # F lies above a parabola that is not convex, and so above the lower one of its ends
        doubt = motion.spin * motion.spin * abs(motion.omega) * ahead
        lowest = here + (rate + 0.5 * min(bend - doubt, 0.0) * ahead) * ahead
        if lowest > slack and (here > slack or (leaving and rate > 0.0)):
            return np.inf, satellite_after(t, turned, turn, motion), CLEAR
    else:
        curvature, stretch = arcs[index, 4], arcs[index, 12]
        rx, ry = x - arcs[index, 0], stretch * (y - arcs[index, 1])
        g1, g2 = arcs[index, 2] - curvature * rx, arcs[index, 3] - curvature * ry
        level = 0.0 if own else 0.5 * ((arcs[index, 2] + g1) * rx + (arcs[index, 3] + g2) * ry)
        conic = (level, g1, g2, curvature, stretch)
        here, rate, _, _, _ = conic_after(conic, t, turned, turn, motion)
        if t == 0.0 and own_kind != NO_PIECE and not own and abs(here) <= slack * max(1.0, stretch):
            leaving = not is_in_front(own_kind, own_index, kind, index, x, y, slack * max(1.0, stretch), ground)
        patience = 2.0 * size / motion.fastest
    sign = 1.0 if here >= 0.0 or (here >= -slack and rate < 0.0) else -1.0
    if leaving:
        # to the front, or, from the back of a face, away from it
        sign = 1.0 if own or rate > 0.0 else -1.0
    while True:
        if kind == LINE:
            t, turned, code = next_root(sign, leaving, line, None, t, end, turned, turn, motion, patience, slack)
        else:
            t, turned, code = next_root(sign, leaving, None, conic, t, end, turned, turn, motion, patience, slack)
        state, inward = satellite_after(t, turned, turn, motion), 0.0
        if t >= end:
            return np.inf, state, CLEAR
        if code == BOUNCE_LIMIT:
            return t, state, code
        if sign > 0.0:
            px, py = x + state[0], y + state[1]
            # at a shallow incidence a rounding error across the piece is a longer way along it
            if kind == LINE:
                _, inward, _ = line_after(line, t, turned, motion)
                wide = slack * max(1.0, min(motion.fastest / abs(inward), WIDEST_SLACK))
                inside, corner = where_on_line(joints, lines, index, px, py, wide)
            else:
                _, inward, _, _, _ = conic_after(conic, t, turned, turn, motion)
                wide = slack * max(1.0, min(motion.fastest / abs(inward), WIDEST_SLACK))
                ax, ay = px - arcs[index, 0], stretch * (py - arcs[index, 1])
                inside = on_arc(arcs[index], ax, ay, wide * max(1.0, stretch))
                corner = near_end(arcs[index], px, py, wide)
            if inside:
                return t, state, CORNER if corner else code
        if code == GRAZING:
            # a tangency beside the piece: of a line it is the only one, and of a circle the way leads on outside
            return np.inf, state, CLEAR
        if code == CLEAR or inward < 0.0:
            sign = -sign
        leaving = True


@inlined
def first_in_hollow(h, own_kind, own_index, came_from, x, y, t, end, turned, turn, motion, slack, ground):
    """First contact of one satellite with the pieces of the hollow h: time (inf), kind, index, state and code.

    For an open wall the sides of the cell count as pieces; ``came_from`` is -1 or 1 for a satellite that has just come
    in through the left or the right one.
    """
    hollows, joints = ground.hollows, ground.joints
    kind, index, code, size = NO_PIECE, -1, CLEAR, hollows[h, 2]
    where = satellite_after(t, turned, turn, motion)
    for part in (3, 5, 7):
        tried = LINE if part == 3 else ARC
        for k in range(int(hollows[h, part]), int(hollows[h, part + 1])):
            if tried == ARC or joints[k, 3] > 0.0:
                hit, place, unclear = first_on_piece(
                    tried, k, own_kind, own_index, x, y, t, end, turned, turn, motion, size, slack, ground
                )
                if hit < end:
                    end, kind, index, code, where = hit, tried, k, unclear, place
    if ground.is_open:
        for side in (-1, 1):
            edge = hollows[h, 0] if side < 0 else hollows[h, 1]
            line = towards_line(side * (edge - x), -float(side), 0.0, turn, motion)
            hit, then, unclear = next_root(
                1.0, came_from == side, line, None, t, end, turned, turn, motion, np.inf, slack
            )
            if hit < end:
                end, kind, index, code = hit, SIDE, side, unclear
                where = satellite_after(hit, then, turn, motion)
    return end if kind != NO_PIECE else np.inf, kind, index, where, code
