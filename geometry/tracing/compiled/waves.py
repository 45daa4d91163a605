"""Rays through hollows of lines, circles and Bezier pieces in waves: all rays that are inside hit their next piece.

Eight rays are computed at once, with every number as by `rays`, so a ray has the same result by both, to the last bit.
A ray for which rounding, a corner or a run of hits would matter has no result here. Loads numba.
"""

from __future__ import annotations

import numpy as np

from ...scene import columns as c
from ...scene.boxes import BOXES
from ...scene.tolerances import NEARBY_SLACKS
from .beziers import gather_near, meet_cubic, meet_parabola
from .lanes import (
    AT_CORNER,
    BEFORE,
    BEFORE_RUN,
    BEZIER_NUMBERS,
    BOUNCES,
    CIRCLE_NUMBERS,
    DOUBT,
    FACE_X,
    FACE_Y,
    FOUND,
    FRACTION,
    HIT_S,
    HIT_X,
    HIT_Y,
    NEAREST,
    NO_LINE,
    NO_PIECE,
    OUT_ANGLE,
    OUT_BOUNCES,
    OUT_RAY,
    OUT_VX,
    OUT_VY,
    OUT_X,
    OWN,
    PIECE,
    PX,
    PY,
    RAY,
    TIME,
    UNCERTAIN,
    VX,
    VY,
    WAVE,
    WORK,
    advance,
    before_runs,
    clear_hits,
    first_bit,
    hits_at,
    hits_on_arcs,
    keep_hits,
    meet_circle,
    meet_corner,
    meet_line,
    no_arcs,
    no_hits,
)
from .lines import nearest_lines_in_boxes
from .options import inlined, inner, linked
from .rays import scope_of
from .runs import skip_chords, skip_crossings
from .trigonometry import LAST_ANGLE, direction_angle, sine_cosine

# In place of the slots of late functions, which waves do not call.
NO_SLOTS = np.int64(0)
# Waves after the entry of the last ray, after which the rays that are left are traced one by one.
MOST_WAVES = 64
# Rays of a wave up to which the next rays come in.
FEW = WAVE // 2
# Number of Bezier pieces in a hollow from which on it is faster to gather the rays near each of them.
MANY_BEZIERS = 6
# Hits after which a ray is traced by itself: rays that stay long would keep the next ones out.
MOST_HITS = 2**8
# Above one by more than all rounding errors of the sine of incidence.
RUN_MARGIN = 1.0 + 2.0**-40


@inlined
def begins_run(tables, work, i, slack, limit):
    """-> bool: whether ray i of a wave makes a run of hits after its hit, which is computed in one step elsewhere."""
    px, py, vx, vy = work[HIT_X + i], work[HIT_Y + i], work[VX + i], work[VY + i]
    nx, ny = work[FACE_X + i], work[FACE_Y + i]
    w = 2.0 * (vx * nx + vy * ny)
    vx, vy = vx - w * nx, vy - w * ny
    piece, most = int(work[PIECE + i]), np.int64(limit - work[BOUNCES + i] - 1)
    if piece < 0:
        _, _, _, _, hits = skip_chords(tables.circles[int(CIRCLE_NUMBERS) - piece], px, py, vx, vy, most)
        return hits > 0
    for row in range(int(tables.lines[piece, c.FIRST_PAIR]), int(tables.lines[piece, c.PAIRS_END])):
        if tables.pairs[row, c.PARTNER] == work[OWN + i]:
            _, _, _, _, hits = skip_crossings(tables.pairs[row], (nx, ny), px, py, vx, vy, slack, most)
            return hits > 0
    return False


@inlined
def corner_slack(is_corner, slack):
    """-> float: the slack at a joint, negative if it is no corner."""
    return slack if is_corner > 0.0 else -1.0


@inlined
def meet_boxes(scope, work, walks, count):
    """Find the nearest hits of all rays of a wave on the lines in the boxes along them, where those are nearer."""
    joints, lines = scope.tables.joints, scope.tables.lines
    nearest_lines_in_boxes(scope, work, walks, count)
    for i in range(count):
        if work[NEAREST + i] < work[TIME + i]:
            line, fraction = walks[FOUND + i], work[FRACTION + i]
            near = line if fraction >= 0.0 else line + 1
            work[TIME + i], work[PIECE + i] = work[NEAREST + i], line
            work[HIT_X + i] = joints[near, c.JOINT_X] + fraction * lines[line, c.EDGE_X]
            work[HIT_Y + i] = joints[near, c.JOINT_Y] + fraction * lines[line, c.EDGE_Y]
            work[FACE_X + i], work[FACE_Y + i] = lines[line, c.LINE_NORMAL_X], lines[line, c.LINE_NORMAL_Y]
            may_run = work[BEFORE + i] == line and lines[line, c.PAIRS_END] > 0.0
            at_corner = abs(fraction) * lines[line, c.LENGTH] <= scope.slack and joints[near, c.IS_CORNER] > 0.0
            work[UNCERTAIN + i] = AT_CORNER if at_corner else (BEFORE_RUN if may_run else 0.0)


@inlined
def has_many_beziers(hollow):
    """-> bool: whether rays of a hollow are gathered for each Bezier piece; circles come before, in the same order."""
    many = hollow[c.BEZIERS_END] - hollow[c.FIRST_BEZIER] >= MANY_BEZIERS
    return many and hollow[c.CIRCLES_END] == hollow[c.FIRST_CIRCLE]


@linked
def meet_bezier(beziers, k, slack, work, first):
    """Find the nearest hits of eight rays on Bezier piece k."""
    curve = beziers[k]
    slacks = corner_slack(curve[c.START_CORNER], slack), corner_slack(curve[c.END_CORNER], slack)
    if curve[c.X3] == 0.0 and curve[c.Y3] == 0.0:
        meet_parabola(work, first, beziers, k, slacks, BEZIER_NUMBERS - k)
    else:
        meet_cubic(work, first, beziers, k, slacks, BEZIER_NUMBERS - k)


@inlined
def meet_gathered(scope, work, count):
    """Find the nearest hits of all rays of a wave on many Bezier pieces; those that are near a piece are gathered."""
    hollow, beziers, slack = scope.hollow, scope.tables.beziers, scope.slack
    some = work[WORK:]
    for first in range(0, count, BOXES):
        clear_hits(work, first)
    for k in range(int(hollow[c.FIRST_BEZIER]), int(hollow[c.BEZIERS_END])):
        number, chosen = BEZIER_NUMBERS - k, 0
        for first in range(0, count, BOXES):
            chosen += gather_near(work, first, count, beziers, k, number, WORK + chosen)
        for j in range(chosen):
            i = int(some[RAY + j])
            for column in (PX, PY, VX, VY, OWN, BEFORE, TIME):
                some[column + j] = work[column + i]
            some[DOUBT + j] = 0.0
        for j in range(chosen, chosen + BOXES):
            # no rays, which meet nothing
            some[TIME + j], some[OWN + j] = -np.inf, NO_PIECE
        for first in range(0, chosen, BOXES):
            meet_bezier(beziers, k, slack, some, first)
        for j in range(chosen):
            i = int(some[RAY + j])
            if some[DOUBT + j] != 0.0:
                work[DOUBT + i] = 1.0
            if some[TIME + j] < work[TIME + i]:
                for column in (TIME, PIECE, HIT_X, HIT_Y, FACE_X, FACE_Y, UNCERTAIN, HIT_S):
                    work[column + i] = some[column + j]


@inlined
def meet_arcs(scope, work, first):
    """-> HITS: the nearest hits of eight rays on the circular arcs of a hollow."""
    circles, close, arcs = scope.tables.circles, NEARBY_SLACKS * scope.slack, no_arcs()
    for k in range(int(scope.hollow[c.FIRST_CIRCLE]), int(scope.hollow[c.CIRCLES_END])):
        arc = circles[k]
        arcs = meet_circle(
            work, first, arcs, (arc[c.START_X], arc[c.START_Y], arc[c.END_X], arc[c.END_Y]),
            (arc[c.NORMAL_X], arc[c.NORMAL_Y]), arc[c.CURVATURE],
            (arc[c.CHORD_X], arc[c.CHORD_Y], arc[c.SHORT_CHORD]), RUN_MARGIN * arc[c.RUN_SINE],
            close, CIRCLE_NUMBERS - k,
        )  # fmt: skip
    return hits_on_arcs(work, first, arcs, close)


@inlined
def meet_lines(scope, work, first, hits):
    """-> HITS: the nearest hits of eight rays, also on the lines of a hollow; rays that meet corners are doubted."""
    joints, lines, hollow, slack = scope.tables.joints, scope.tables.lines, scope.hollow, scope.slack
    for j in range(int(hollow[c.FIRST_JOINT]), int(hollow[c.JOINTS_END])):
        x, y, at_joint = joints[j, c.JOINT_X], joints[j, c.JOINT_Y], corner_slack(joints[j, c.IS_CORNER], slack)
        if joints[j, c.STARTS_LINE] > 0.0:
            end = joints[j + 1, c.JOINT_X], joints[j + 1, c.JOINT_Y], corner_slack(joints[j + 1, c.IS_CORNER], slack)
            hits = meet_line(
                work, first, hits, (x, y, at_joint), end, (lines[j, c.EDGE_X], lines[j, c.EDGE_Y]),
                (lines[j, c.LINE_NORMAL_X], lines[j, c.LINE_NORMAL_Y]), lines[j, c.LENGTH], NEARBY_SLACKS * slack,
                (float(j), float(j) if lines[j, c.PAIRS_END] > 0.0 else NO_LINE),
            )  # fmt: skip
        elif at_joint > 0.0:
            meet_corner(work, first, x, y, slack)
    return hits


@inlined
def meet_pieces(scope, work, first, is_gathered):
    """Find the nearest hits of eight rays on the pieces of a hollow; without Bezier pieces after `meet_gathered`.

    The lines of a tree of boxes are left to `meet_boxes`.
    """
    hollow = scope.hollow
    arcs, curves = hollow[c.CIRCLES_END] - hollow[c.FIRST_CIRCLE], hollow[c.BEZIERS_END] - hollow[c.FIRST_BEZIER]
    has_arcs, has_curves = arcs > 0.0, curves > 0.0
    # the chain of a hollow has one joint more than pieces
    has_lines = not scope.has_tree and hollow[c.JOINTS_END] - hollow[c.FIRST_JOINT] - 1.0 > arcs + curves
    if not is_gathered:
        clear_hits(work, first)
    hits = meet_arcs(scope, work, first) if has_arcs else no_hits()
    if has_curves:
        if has_arcs:
            keep_hits(work, first, hits)
        if not is_gathered:
            for k in range(int(hollow[c.FIRST_BEZIER]), int(hollow[c.BEZIERS_END])):
                meet_bezier(scope.tables.beziers, k, scope.slack, work, first)
        if has_lines:
            hits = hits_at(work, first)
    if not scope.has_tree:
        hits = meet_lines(scope, work, first, hits)
    if has_lines or (has_arcs and not has_curves):
        keep_hits(work, first, hits)


@inlined
def begin_rays(work, following, entry, angle, opening):
    """Put rays, numbered from ``following``, into the wave whose work space begins at the first free place.

    A ray at an end of the opening has no result here: it begins with too many hits.
    """
    left, right = opening
    for i in range(entry.shape[0]):
        sine, cosine = sine_cosine(angle[i])
        work[PX + i], work[PY + i], work[VX + i], work[VY + i] = entry[i], 0.0, -cosine, -sine
        work[OWN + i], work[BEFORE + i], work[RAY + i] = NO_PIECE, NO_PIECE, following + i
        work[BOUNCES + i] = 0.0 if left < entry[i] < right else MOST_HITS + 1.0


@inlined
def end_rays(work, left, entry, angle, hits):
    """Store the results of the rays that have left."""
    for i in range(left):
        gone = direction_angle(work[OUT_VX + i], work[OUT_VY + i])
        work[OUT_ANGLE + i] = gone if gone < LAST_ANGLE else LAST_ANGLE
    for i in range(left):
        j = int(work[OUT_RAY + i])
        entry[j], angle[j], hits[j] = work[OUT_X + i], work[OUT_ANGLE + i], work[OUT_BOUNCES + i]


@inlined
def next_hits(tables, scope, work, walks, count, left, limit):
    """-> (kept, gone): numbers of the rays of a wave that go on after their next hit, and that leave.

    Before, ``count`` rays were in the wave and ``left`` had left.
    """
    slack, opening, most = scope.slack, (scope.left, scope.right), float(min(limit, MOST_HITS))
    kept, gone = 0, 0
    is_gathered = has_many_beziers(scope.hollow)
    if is_gathered:
        meet_gathered(scope, work, count)
    for first in range(0, count, BOXES):
        meet_pieces(scope, work, first, is_gathered)
    if scope.has_tree:
        meet_boxes(scope, work, walks, count)
    for first in range(0, count, BOXES):
        mask = before_runs(work, first)
        while mask != 0:
            i = first + first_bit(mask)
            mask &= mask - 1
            if i < count and not begins_run(tables, work, i, slack, limit):
                work[UNCERTAIN + i] = 0.0
        found = advance(work, first, count, kept, left + gone, opening, slack, most)
        kept += found & 255
        gone += found >> 8
    return kept, gone


@inner
def cross_simple(tables, h, limit, entry, angle, hits, work, walks):
    """Reflect rays by a hollow of lines, circles and Bezier pieces, with results as in `closed_forms.cross_arc`.

    The rays go through the hollow in waves: all rays that are inside hit their next piece, eight at once. The next rays
    take the places of those that have left. Rays with more than ``limit`` or `MOST_HITS` hits, or with runs of hits,
    have no result.
    """
    scope = scope_of(tables, h, NO_SLOTS)
    rays = entry.shape[0]
    for i in range(rays):
        hits[i] = 0.0
    count, left, following, waves = 0, 0, 0, 0
    while waves < MOST_WAVES:
        if following < rays and count <= FEW:
            end = min(following + WAVE - count, rays)
            begin_rays(work[count:], following, entry[following:end], angle[following:end], (scope.left, scope.right))
            count, following = count + end - following, end
        if count == 0:
            break
        if following == rays:
            waves += 1
        if left + count > WAVE:
            end_rays(work, left, entry, angle, hits)
            left = 0
        count, gone = next_hits(tables, scope, work, walks, count, left, limit)
        left += gone
    end_rays(work, left, entry, angle, hits)
