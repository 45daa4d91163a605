"""Rays through hollows of lines, circles and Bezier pieces in waves: all rays that are inside hit their next piece.

Every piece in turn meets all rays, in a loop without branches over the columns of a work array, see `work`, which the
compiler turns into vector instructions. The formulas are those of the loop over one ray, in `pieces`, so a ray has the
same result by both, to the last bit. A ray for which rounding, a corner or a run of hits would matter has no result
here. Loads numba.

In these loops the compiler does not know the number of rays, conditions are joined by & and |, and numbers are chosen
by `where`; else it would not use vectors.
"""

from __future__ import annotations

import math

import numpy as np

from ....core.rounding import EPS
from ...curves import columns as c
from ...curves.columns import NEARBY, NEARBY_SLACKS, TANGENT_ULPS
from ...scene.compiled.compiling import inlined, inner, linked
from ..double_double.numbers import where
from . import work as w
from .pieces import arcs, beziers, formulas, lines
from .pieces.records import ARC, LINE, Hit, Own
from .rays import scope_of, skip_run
from .trigonometry import LAST_ANGLE, direction_angle, sine_cosine
from .work import NATURAL, ray_at

# In place of the slots of late functions, which waves do not call.
NO_SLOTS = np.int64(0)
# Waves after the entry of the last ray, after which the rays that are left are traced one by one.
MOST_WAVES = 64
# Hits after which a ray is traced by itself: rays that stay long would keep the next ones out.
MOST_HITS = 2**8
# Above one by more than all rounding errors of the sine of incidence.
RUN_MARGIN = 1.0 + 2.0**-40


@inlined
def numbers_of(curve):
    """-> tuple: the numbers of a curve, read before a loop over rays; an arc has other names for these columns."""
    return (
        curve[c.START_X], curve[c.START_Y], curve[c.END_X], curve[c.END_Y], curve[c.START_CORNER], curve[c.END_CORNER],
        curve[c.X1], curve[c.Y1], curve[c.X2], curve[c.Y2], curve[c.X3], curve[c.Y3],
        curve[c.MIDDLE_X], curve[c.MIDDLE_Y], curve[c.REACH],
    )  # fmt: skip


@inlined
def kept(work, place):
    """-> float: the number in a column, which is not negative, in a choice whether to keep it.

    The compiler does not know that: else it would write the other number with a mask, slow on many processors.
    """
    return abs(work[place])


@inlined
def keep(work, i, time, number):
    """Keep a hit of ray i, inf for none, if it is nearer than those before."""
    best, piece = kept(work, w.TIME + i), kept(work, w.PIECE + i)
    work[w.TIME + i], work[w.PIECE + i] = where(time < best, time, best), where(time < best, number, piece)


@inlined
def keep_root(work, i, time, number, s):
    """Keep a hit of ray i on a Bezier piece, with its parameter."""
    old = kept(work, w.HIT_S + i)
    work[w.HIT_S + i] = where(time < work[w.TIME + i], s, old)
    keep(work, i, time, number)


@linked
def list_rays(work, places, count, column, low, high, found):
    """-> int: list rays that have a number from low to high in a column, after ``found`` others; the new length."""
    # parts, because a place in the whole array could be negative for all that the compiler knows
    numbers, rest, listed = work[column:], places[found:], 0
    for i in range(count):
        listed += np.int64((numbers[i] >= low) & (numbers[i] <= high))
    if listed == 0:
        return found
    listed = 0
    for i in range(count):
        # written in any case, counted if true
        rest[listed & NATURAL] = i
        listed += np.int64((numbers[i] >= low) & (numbers[i] <= high))
    return found + listed


@linked
def meet_corner(work, count, x, y, slack):
    """Let rays that meet a corner be uncertain."""
    for i in range(count):
        px, py, vx, vy = ray_at(work, i)
        at_entry = work[w.OWN + i] == w.OPENING
        is_faced = lines.is_faced(x - px, y - py, at_entry, vx, vy, slack)
        is_met = (abs(formulas.side(x, y, px, py, vx, vy)) <= slack) & is_faced
        work[w.UNCERTAIN + i] += where(is_met, 1.0, 0.0)


@linked
def meet_line(work, count, line, number, corner_slack, close):
    """Find the hits of rays on a line that are nearer, and rays that meet the corner at its start.

    The slack is negative if there is no corner; a hit before the time ``close`` is uncertain.
    """
    for i in range(count):
        px, py, vx, vy = ray_at(work, i)
        own = work[w.OWN + i]
        before, after = lines.line_sides(line, px, py, vx, vy)
        is_ahead = lines.is_faced(line.x0 - px, line.y0 - py, own == w.OPENING, vx, vy, corner_slack)
        is_met = (before >= 0.0) & (after <= 0.0) & (before > after) & (own != number)
        t, _, _, _ = lines.line_hit(line, before, after, px, py, vx, vy)
        is_uncertain = (is_ahead & (abs(before) <= corner_slack)) | (is_met & (abs(t) <= close))
        work[w.UNCERTAIN + i] += where(is_uncertain, 1.0, 0.0)
        keep(work, i, where(is_met & (t > close), t, np.inf), number)


@linked
def meet_arc(work, count, arc, number, close):
    """Find the hits of rays on a circular arc that are nearer; a hit before the time ``close`` is uncertain."""
    form = arcs.arc_form(arc)
    # bounds of B of rays that meet the front, from elsewhere and from the arc itself
    most, least = where(arc[c.CURVATURE] > 0.0, np.inf, 0.0), where(arc[c.CURVATURE] > 0.0, 0.0, np.inf)
    for i in range(count):
        px, py, vx, vy = ray_at(work, i)
        is_own, is_other = work[w.OWN + i] == number, work[w.OWN + i] != number
        b, f, d, speed2 = arcs.arc_terms(form, px - arc[c.START_X], py - arc[c.START_Y], vx, vy)
        from_afar = is_other & (d >= 0.0) & (b < most)
        t = arcs.arc_root(form, is_own, b, f, math.sqrt(d), speed2)
        is_uncertain = (is_other & arcs.is_nearly_tangent(arc, b, d, speed2)) | (from_afar & (abs(t) <= close))
        work[w.UNCERTAIN + i] += where(is_uncertain, 1.0, 0.0)
        is_met = from_afar | (is_own & (b > least))
        work[w.ARC_TIME + i] = where(is_met & (t >= 0.0), t, np.inf)
    # a second loop, because the processor looks ahead over few of the many instructions
    for i in range(count):
        (px, py, vx, vy), t = ray_at(work, i), work[w.ARC_TIME + i]
        # at grazing incidence rounding moves the point along the arc by more than the slack
        on_arc = arcs.end_excess(arc, px + t * vx - arc[c.START_X], py + t * vy - arc[c.START_Y]) <= close
        keep(work, i, where(on_arc, t, np.inf), number)


@linked
def meet_parabola(work, count, curve, number):
    """Find the hits of rays on a quadratic Bezier piece that are nearer; see `find_fall` and `find_own_root`."""
    for i in range(count):
        px, py, vx, vy = ray_at(work, i)
        is_own, is_other = work[w.OWN + i] == number, work[w.OWN + i] != number
        a0, a1, a2, _ = beziers.bezier_sides(beziers.bezier_coefficients(curve), px, py, vx, vy)
        spread, last = beziers.side_spread(curve, px, py, vx, vy), beziers.end_side(curve, px, py, vx, vy)
        g, turn, own_s = (a0, a1, a2, 0.0), a1 / (-2.0 * a2), work[w.BEFORE + i]
        value, room = beziers.cubic(g, turn), (TANGENT_ULPS * EPS) * spread
        is_inside = (turn > 0.0) & (turn < 1.0)
        touches = (abs(a0) <= room) | (abs(last) <= room) | (is_inside & (abs(value) <= room))
        falls = beziers.is_falling(a0, where(is_inside, value, last)) | (is_inside & beziers.is_falling(value, last))
        own_root, is_front = beziers.own_point(g, own_s, beziers.cubic_slope(g, own_s) / -a2, beziers.OWN_SLACK)
        s = where(is_own, own_root, beziers.quadratic_root(a0, a1, a2))
        t = beziers.bezier_time(beziers.bezier_coefficients(curve), s, px, py, vx, vy)
        is_near = is_other & beziers.meets_circle(curve, px, py, vx, vy, work[w.TIME + i])
        is_uncertain = is_near & (touches | (falls & (abs(t) <= NEARBY * spread)))
        work[w.UNCERTAIN + i] += where(is_uncertain, 1.0, 0.0)
        t = where(((is_own & is_front) | (is_near & falls)) & (t > 0.0), t, np.inf)
        keep_root(work, i, t, number, s)


@linked
def mark_near(work, count, curve, number):
    """Mark rays that meet the circle about a Bezier piece, on which they do not start."""
    for i in range(count):
        px, py, vx, vy = ray_at(work, i)
        is_near = beziers.meets_circle(curve, px, py, vx, vy, work[w.TIME + i]) & (work[w.OWN + i] != number)
        work[w.NEAR + i] = where(is_near, 1.0, 0.0)


@inlined
def gather(work, places, count, some, columns):
    """Copy columns of the rays that are listed to another work array."""
    for j in range(count):
        i = places[j] & NATURAL
        for column in columns:
            some[column + j] = work[column + i]


@inlined
def keep_roots(work, places, count, some, number):
    """Keep the hits of the rays that are listed, on one Bezier piece."""
    for j in range(count):
        i = places[j] & NATURAL
        work[w.UNCERTAIN + i] += some[w.UNCERTAIN + j]
        keep_root(work, i, some[w.TIME + j], number, some[w.ROOT + j])


@linked
def find_fall(some, count, curve, turn):
    """-> int: find the part of a cubic piece on which g falls through zero; how many rays have two such parts.

    At turn 0 the first part is taken, at turn 1 the last. A ray's line that passes an end of the piece, or touches it
    at an extremum of g, within rounding is uncertain.
    """
    both = 0
    for j in range(count):
        px, py, vx, vy = ray_at(some, j)
        g = beziers.bezier_sides(beziers.bezier_coefficients(curve), px, py, vx, vy)
        a0, _, _, _ = g
        last = beziers.end_side(curve, px, py, vx, vy)
        room = (TANGENT_ULPS * EPS) * beziers.side_spread(curve, px, py, vx, vy)
        low, high = beziers.extrema(g)
        value_low, value_high = beziers.cubic(g, low), beziers.cubic(g, high)
        has_low, has_high = (low > 0.0) & (low < 1.0), (high > 0.0) & (high < 1.0)
        touches = (abs(a0) <= room) | (abs(last) <= room)
        touches = touches | (has_low & (abs(value_low) <= room)) | (has_high & (abs(value_high) <= room))
        some[w.UNCERTAIN + j] += where(touches, 1.0, 0.0)
        low, value_low = where(has_low, low, 0.0), where(has_low, value_low, a0)
        high, value_high = where(has_high, high, 1.0), where(has_high, value_high, last)
        first, third = beziers.is_falling(a0, value_low), beziers.is_falling(value_high, last)
        middle = beziers.is_falling(value_low, value_high)
        both += np.int64(first & third)
        first, middle = first & (turn == 0), middle & (turn == 0)
        falls = first | middle | third
        some[w.FALLS + j] = some[w.SOUGHT + j] = where(falls, 1.0, 0.0)
        some[w.LOW + j] = where(first, 0.0, where(middle, low, high))
        some[w.HIGH + j] = where(first, low, where(middle, high, 1.0))
        some[w.VALUE_LOW + j] = where(first, a0, where(middle, value_low, value_high))
        some[w.VALUE_HIGH + j] = where(first, value_low, where(middle, value_high, last))
    return both


@linked
def start_roots(some, count, curve):
    """Begin the search of the roots of g."""
    for j in range(count):
        px, py, vx, vy = ray_at(some, j)
        g = beziers.bezier_sides(beziers.bezier_coefficients(curve), px, py, vx, vy)
        ends = some[w.LOW + j], some[w.HIGH + j], some[w.VALUE_LOW + j], some[w.VALUE_HIGH + j]
        some[w.ROOT + j] = beziers.root_start(g, *ends)


@linked
def improve_roots(some, count, curve):
    """-> int: one step to each root that is still sought; how many are."""
    more = 0
    for j in range(count):
        px, py, vx, vy = ray_at(some, j)
        g = beziers.bezier_sides(beziers.bezier_coefficients(curve), px, py, vx, vy)
        old, low, high = kept(some, w.ROOT + j), kept(some, w.LOW + j), kept(some, w.HIGH + j)
        s, low, high, is_last = beziers.root_step(g, old, low, high)
        is_sought = some[w.SOUGHT + j] > 0.0
        some[w.ROOT + j] = where(is_sought, s, old)
        some[w.LOW + j], some[w.HIGH + j] = low, high
        some[w.SOUGHT + j] = where(is_sought & (not is_last), 1.0, 0.0)
        more += np.int64(is_sought & (not is_last))
    return more


@linked
def find_own_root(some, count, curve):
    """Find the front hits of rays that start on a Bezier piece themselves."""
    for j in range(count):
        px, py, vx, vy = ray_at(some, j)
        coefficients, own_s = beziers.bezier_coefficients(curve), some[w.BEFORE + j]
        g = beziers.bezier_sides(coefficients, px, py, vx, vy)
        b0, b1, b2, disc = beziers.own_terms(g, own_s)
        t, some[w.ROOT + j] = beziers.nearest_own_hit(coefficients, g, own_s, px, py, vx, vy, beziers.OWN_SLACK)
        is_uncertain = (abs(disc) <= beziers.own_error(curve, b0, b1, b2)) & (b2 != 0.0)
        some[w.UNCERTAIN + j] += where(is_uncertain, 1.0, 0.0)
        some[w.FALLS + j] = where(t < np.inf, 1.0, 0.0)


@linked
def time_roots(some, count, curve, number):
    """Compute the times of the hits at the roots, inf for those that are none."""
    for j in range(count):
        px, py, vx, vy = ray_at(some, j)
        t = beziers.bezier_time(beziers.bezier_coefficients(curve), some[w.ROOT + j], px, py, vx, vy)
        is_met = some[w.FALLS + j] > 0.0
        is_close = (some[w.OWN + j] != number) & (abs(t) <= NEARBY * beziers.side_spread(curve, px, py, vx, vy))
        some[w.UNCERTAIN + j] += where(is_met & is_close, 1.0, 0.0)
        some[w.TIME + j] = where(is_met & (t > 0.0), t, np.inf)


@linked
def meet_cubic(work, places, count, curve, number, some):
    """Find the hits of rays on a cubic piece that are nearer; the rays near the piece are gathered in ``some``."""
    mark_near(work, count, curve, number)
    others = list_rays(work, places, count, w.NEAR, 1.0, 1.0, 0)
    end = list_rays(work, places, count, w.OWN, number, number, others)
    if end == 0:
        return
    gather(work, places, end, some, w.STARTS)
    some[w.UNCERTAIN : w.UNCERTAIN + end] = 0.0
    find_own_root(some[others:], end - others, curve)
    for turn in range(2):
        if find_fall(some, others, curve, turn) == 0 and turn > 0:
            break
        start_roots(some, others, curve)
        steps = beziers.ROOT_STEPS
        while steps > 0 and improve_roots(some, others, curve) > 0:
            steps -= 1
        time_roots(some, end, curve, number)
        keep_roots(work, places, end, some, number)


@inlined
def meet_lines(scope, work, count):
    """Find the nearest hits of rays on the lines of a hollow, and the corners that rays meet."""
    tables, slack = scope.tables, scope.slack
    joints = tables.joints
    for j in range(scope.joints[0], scope.joints[1]):
        corner_slack = slack if joints[j, c.IS_CORNER] > 0.0 else -1.0
        if joints[j, c.STARTS_LINE] > 0.0:
            meet_line(work, count, lines.line_at(tables, j), w.LINES + j, corner_slack, NEARBY_SLACKS * slack)
        elif corner_slack > 0.0:
            meet_corner(work, count, joints[j, c.JOINT_X], joints[j, c.JOINT_Y], slack)


@inlined
def meet_pieces(scope, work, places, count):
    """Find the nearest hits of all rays on the pieces of a hollow."""
    tables, close = scope.tables, NEARBY_SLACKS * scope.slack
    for k in range(scope.curves[arcs.TABLE][0], scope.curves[arcs.TABLE][1]):
        meet_arc(work, count, numbers_of(tables.curves[arcs.TABLE][k]), w.ARCS + k, close)
    for k in range(scope.curves[beziers.TABLE][0], scope.curves[beziers.TABLE][1]):
        curve, number = numbers_of(tables.curves[beziers.TABLE][k]), w.BEZIERS + k
        if curve[c.X3] == 0.0 and curve[c.Y3] == 0.0:
            meet_parabola(work, count, curve, number)
        else:
            meet_cubic(work, places, count, curve, number, work[w.WORK :])
    meet_lines(scope, work, count)


@inlined
def keep_point(work, i, x, y, nx, ny, at_corner, may_run):
    """Keep the point and the unit normal of the hit of ray i, and what the hit needs."""
    work[w.HIT_X + i], work[w.HIT_Y + i], work[w.HIT_NX + i], work[w.HIT_NY + i] = x, y, nx, ny
    work[w.NEED + i] = where(at_corner, w.AT_CORNER, where(may_run, w.BEFORE_RUN, 0.0))


@linked
def place_on_arc(some, count, arc, slack):
    """Compute the points at which rays meet an arc; within rounding of an end, at grazing incidence, as at a corner."""
    room = 2.0 * NEARBY_SLACKS * slack
    for j in range(count):
        px, py, vx, vy = ray_at(some, j)
        x, y, nx, ny = arcs.arc_point(arcs.arc_form(arc), arc, 1.0, some[w.TIME + j], px, py, vx, vy)
        dx, dy, ex, ey = x - arc[c.START_X], y - arc[c.START_Y], x - arc[c.END_X], y - arc[c.END_Y]
        at_end = (dx * dx + dy * dy <= room * room) | (ex * ex + ey * ey <= room * room)
        sine = RUN_MARGIN * arc[c.RUN_SINE]
        keep_point(some, j, x, y, nx, ny, at_end, (sine > 0.0) & (abs(vx * nx + vy * ny) <= sine))


@inlined
def place_on_arcs(scope, work, places, count):
    """Compute the points at which rays meet arcs, for the rays of each arc in vectors."""
    some = work[w.WORK :]
    for k in range(scope.curves[arcs.TABLE][0], scope.curves[arcs.TABLE][1]):
        hits = list_rays(work, places, count, w.PIECE, w.ARCS + k, w.ARCS + k, 0)
        gather(work, places, hits, some, w.BEFORE_HIT)
        place_on_arc(some, hits, numbers_of(scope.tables.curves[arcs.TABLE][k]), scope.slack)
        for j in range(hits):
            i = places[j] & NATURAL
            for column in w.AT_HIT:
                work[column + i] = some[column + j]


@inlined
def place_hits(scope, work, places, count):
    """Compute the points at which rays meet their pieces, kind by kind, so that the processor guesses no branch."""
    tables, slack = scope.tables, scope.slack
    joints = tables.joints
    place_on_arcs(scope, work, places, count)
    for k in range(list_rays(work, places, count, w.PIECE, w.LINES, np.inf, 0)):
        i = places[k] & NATURAL
        j, (px, py, vx, vy) = int(work[w.PIECE + i] - w.LINES) & NATURAL, ray_at(work, i)
        line = lines.line_at(tables, j)
        before, after = lines.line_sides(line, px, py, vx, vy)
        _, fraction, x, y = lines.line_hit(line, before, after, px, py, vx, vy)
        is_corner = where(fraction < 0.0, joints[j + 1, c.IS_CORNER], joints[j, c.IS_CORNER]) > 0.0
        may_run = (work[w.BEFORE + i] == w.LINES + j) & (tables.lines[j, c.PAIRS_END] > 0.0)
        at_corner = is_corner & (abs(fraction) * line.length <= slack)
        keep_point(work, i, x, y, line.normal_x, line.normal_y, at_corner, may_run)
    if scope.curves[beziers.TABLE][0] < scope.curves[beziers.TABLE][1]:
        for k in range(list_rays(work, places, count, w.PIECE, w.BEZIERS, w.LINES - 1.0, 0)):
            i = places[k] & NATURAL
            curve, s = tables.curves[beziers.TABLE][int(work[w.PIECE + i] - w.BEZIERS) & NATURAL], work[w.HIT_S + i]
            coefficients = beziers.bezier_coefficients(curve)
            (x, y), (nx, ny) = beziers.bezier_point(coefficients, s), beziers.bezier_normal(coefficients, s)
            keep_point(work, i, x, y, nx, ny, formulas.near_end(curve, x, y, slack), False)


@inlined
def begins_run(scope, work, i, limit):
    """-> bool: whether ray i of a wave makes a run of hits after its hit, which is computed in one step elsewhere."""
    px, py, nx, ny = work[w.HIT_X + i], work[w.HIT_Y + i], work[w.HIT_NX + i], work[w.HIT_NY + i]
    vx, vy = formulas.mirror(work[w.VX + i], work[w.VY + i], nx, ny)
    piece, own = work[w.PIECE + i], work[w.OWN + i]
    kind, first = (ARC, w.ARCS) if piece < w.LINES else (LINE, w.LINES)
    hit, start = Hit(0.0, kind, int(piece - first), 0.0, 0), Own(LINE, int(own - w.LINES), -1.0, 0.0, -1, 0)
    most = np.int64(limit - work[w.BOUNCES + i] - 1)
    _, _, _, _, hits = skip_run(scope, hit, start, px, py, vx, vy, most)
    return hits > 0


@inlined
def clear_hit(work, i):
    """Begin the search of the nearest hit of ray i."""
    work[w.TIME + i], work[w.PIECE + i], work[w.UNCERTAIN + i], work[w.NEED + i] = np.inf, w.NO_HIT, 0.0, 0.0


@linked
def reflect_rays(work, count, opening, slack, limit):
    """Let rays leave through the opening, or reflect them at their hits; uncertain ones are given up, with no hits."""
    left, right = opening
    for i in range(count):
        px, py, vx, vy = ray_at(work, i)
        time, own, piece, bounces = work[w.TIME + i], work[w.OWN + i], work[w.PIECE + i], work[w.BOUNCES + i]
        t, leaves = formulas.opening_met(left, right, px, py, vx, vy)
        is_certain = work[w.UNCERTAIN + i] == 0.0
        leaves = leaves & ((time - t) * vy > slack)
        stays = is_certain & (not leaves) & (work[w.NEED + i] == 0.0) & (time < np.inf) & (bounces < limit)
        wx, wy = formulas.mirror(vx, vy, work[w.HIT_NX + i], work[w.HIT_NY + i])
        wx, wy = formulas.with_length_one(wx, wy)
        before = where(own >= w.LINES, own, w.OPENING)
        work[w.GONE + i] = where(stays, 0.0, 1.0)
        work[w.PX + i], work[w.PY + i] = where(stays, work[w.HIT_X + i], px + t * vx), work[w.HIT_Y + i]
        work[w.VX + i], work[w.VY + i], work[w.OLD_VX + i], work[w.OLD_VY + i] = wx, wy, vx, vy
        work[w.OWN + i] = piece
        work[w.BEFORE + i] = where(piece >= w.LINES, before, work[w.HIT_S + i])
        work[w.BOUNCES + i] = where(stays, bounces + 1.0, where(is_certain & leaves, bounces, 0.0))
        clear_hit(work, i)


@linked
def end_rays(work, places, count, entry, angle, hits):
    """Store the results of the rays in the list: no hits for those that are given up."""
    for k in range(count):
        i = places[k] & NATURAL
        work[w.END_VX + k], work[w.END_VY + k] = work[w.OLD_VX + i], work[w.OLD_VY + i]
    for k in range(count):
        gone = direction_angle(work[w.END_VX + k], work[w.END_VY + k])
        work[w.END_ANGLE + k] = gone if gone < LAST_ANGLE else LAST_ANGLE
    for k in range(count):
        i = places[k] & NATURAL
        j = int(work[w.RAY + i]) & NATURAL
        entry[j], angle[j], hits[j] = work[w.PX + i], work[w.END_ANGLE + k], work[w.BOUNCES + i]


@linked
def begin_rays(work, places, count, following, entry, angle, opening):
    """Put rays, numbered from ``following``, into the places in the list.

    A ray at an end of the opening has no result here: it begins with too many hits.
    """
    left, right = opening
    x, theta = entry[following:], angle[following:]
    for k in range(count):
        sine, cosine = sine_cosine(theta[k])
        work[w.END_VX + k], work[w.END_VY + k] = -cosine, -sine
    for k in range(count):
        i = places[k] & NATURAL
        work[w.PX + i], work[w.PY + i] = x[k], 0.0
        work[w.VX + i], work[w.VY + i] = work[w.END_VX + k], work[w.END_VY + k]
        work[w.OWN + i], work[w.RAY + i] = w.OPENING, float(following + k)
        work[w.BOUNCES + i] = where((left < x[k]) & (x[k] < right), 0.0, MOST_HITS + 1.0)


@inlined
def close_ranks(work, places, first, end, count):
    """-> int: the number of rays of a wave after the last rays have taken the places from ``first`` on in the list."""
    for k in range(end - 1, first - 1, -1):
        i = places[k] & NATURAL
        count -= 1
        for column in w.RAY_COLUMNS:
            work[column + i] = work[column + count]
    return count


@inner
def cross_simple(tables, h, limit, entry, angle, hits, work, places):
    """Reflect rays by a hollow of lines, circles and Bezier pieces, with results as in `closed_forms.cross_arc`.

    The rays go through the hollow in waves: all rays that are inside hit their next piece. The next rays take the
    places of those that have left. Rays with more than ``limit`` or `MOST_HITS` hits, or with runs of hits, have no
    result.
    """
    scope = scope_of(tables, h, NO_SLOTS)
    opening, slack, most = (scope.left, scope.right), scope.slack, float(min(limit, MOST_HITS))
    rays = entry.shape[0]
    for i in range(rays):
        hits[i] = 0.0
    count = following = min(rays, w.WAVE)
    for i in range(count):
        places[i], work[w.BEFORE + i], work[w.HIT_S + i] = i, 0.0, 0.0
        clear_hit(work, i)
    begin_rays(work, places, count, 0, entry, angle, opening)
    waves = 0
    while count > 0 and waves < MOST_WAVES:
        waves += np.int64(following == rays)
        meet_pieces(scope, work, places, count)
        place_hits(scope, work, places, count)
        for k in range(list_rays(work, places, count, w.NEED, w.BEFORE_RUN, w.BEFORE_RUN, 0)):
            i = places[k] & NATURAL
            if not begins_run(scope, work, i, limit):
                work[w.NEED + i] = 0.0
        reflect_rays(work, count, opening, slack, most)
        done = list_rays(work, places, count, w.GONE, 1.0, 1.0, 0)
        end_rays(work, places, done, entry, angle, hits)
        fresh = min(done, rays - following)
        begin_rays(work, places, fresh, following, entry, angle, opening)
        following += fresh
        count = close_ranks(work, places, fresh, done, count)
