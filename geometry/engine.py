"""The compiled loop of the planar tracer. Only `tracing` imports this file, because it loads numba.

Every optional table is an array or ``None``; numba compiles one version for each combination that occurs, and the
branches of absent primitives are pruned from it. Layout of the tables: `primitives`.

The formulas are stable by themselves; there is no epsilon that decides which piece is hit:

* The side of a ray on which a joint V lies is the sign of c = (V - p) x v. A segment is hit from its free side exactly
  if c goes from >= 0 at its start to <= 0 at its end. Neighbours share the number c, so that no ray slips between them.
* A circular arc is F(r) = n0.r - kappa |r|^2 / 2 = 0 with r measured from its first joint and n0 the unit normal
  there, towards the free side; kappa > 0 is focusing. Its one front root is (B + sqrt(D)) / (kappa |v|^2), and
  2 B / (kappa |v|^2) where the ray starts on the arc itself. An elliptic arc is the same in stretched coordinates.
* A Bezier piece is hit where g(s) = (b(s) - p) x v falls through zero; the root at the ray's own start is divided out.
* The hit point is put back on its piece, and the velocity is renormalised, once a bounce.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .skips import skip_crossings, skip_hops

ESCAPED, CORNER, GRAZING, BOUNCE_LIMIT = 0, 1, 2, 3
NO_PIECE, LID, SIDE, LINE, CIRCLE, ELLIPSE, BEZIER = 0, 1, 2, 3, 4, 5, 6

EPS = 2.0**-52
# A joint that a ray meets, or a hit that a joint meets, within this share of the hollow's size is not resolved in
# double precision: positions carry a few rounding errors of one ulp of the size each.
JOINT_ULPS = 16.0
# D = B^2 + 2 kappa |v|^2 F carries about eight rounding errors of B^2; below them hit and miss are not told apart.
TANGENT_ULPS = 16.0
ROOT_STEPS = 80
# Flights followed one by one before a ray is given up: 20 to 100 ms. Hits in a run cost one flight together.
MOST_STEPS = 1_000_000
# An odd number without pattern, so that itineraries of the same pieces in another order differ.
HASH_FACTOR = np.uint64(0x9E3779B97F4A7C15)
# Far beyond the numbers of the pieces.
BEND_SHIFT = 40

# The loop over rays takes in the loop over flights: passing some ten tables from one to the other would cost as much as
# a bounce or two. Other callers go through a function of their own that calls `trace_ray` at one place.
_compile = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)


@_compile
def arc_time(arc, own, px, py, vx, vy, stretch):
    """Flight time to the front of one arc, or inf; second value: 1 where the ray is tangent within rounding."""
    rx, ry = px - arc[0], stretch * (py - arc[1])
    wy = stretch * vy
    curvature = arc[4]
    b = arc[2] * vx + arc[3] * wy - curvature * (rx * vx + ry * wy)
    speed2 = vx * vx + wy * wy
    if own:
        if curvature <= 0.0 or b <= 0.0:
            return np.inf, 0
        return 2.0 * b / (curvature * speed2), 0
    f = arc[2] * rx + arc[3] * ry - 0.5 * curvature * (rx * rx + ry * ry)
    d = b * b + 2.0 * curvature * speed2 * f
    tangent = 0
    if curvature < 0.0 and b < 0.0 and abs(d) <= TANGENT_ULPS * EPS * b * b:
        tangent = 1
        d = 0.0
    if d < 0.0:
        return np.inf, 0
    root = math.sqrt(d)
    if b >= 0.0:
        if curvature <= 0.0:
            return np.inf, 0
        return (b + root) / (curvature * speed2), tangent
    return 2.0 * f / (root - b), tangent


@_compile
def on_arc(arc, qx, qy, slack):
    """Whether the point q on the full circle, measured from the first joint, belongs to the arc."""
    if arc[7] > 0.0:
        # up to a half angle of pi/4 the position along the chord decides, on the arc's own side of the circle
        along = qx * arc[5] + qy * arc[6]
        nx, ny = arc[2] - arc[4] * qx, arc[3] - arc[4] * qy
        facing = ny * arc[5] - nx * arc[6]
        return -slack <= along <= arc[7] + slack and facing > 0.0
    # beyond it the side of the chord decides; the arc bulges away from its free side exactly if it is focusing
    height = qy * arc[5] - qx * arc[6]
    return height <= slack if arc[4] > 0.0 else height >= -slack


@_compile
def arc_reflect(arc, t, px, py, vx, vy, stretch):
    """Position on the arc after the time t and the velocity reflected there."""
    qx, qy = px + t * vx - arc[0], stretch * (py + t * vy - arc[1])
    nx, ny = arc[2] - arc[4] * qx, arc[3] - arc[4] * qy
    f = arc[2] * qx + arc[3] * qy - 0.5 * arc[4] * (qx * qx + qy * qy)
    # one Newton step on F puts the point back on the arc
    qx -= f * nx
    qy -= f * ny
    nx, ny = arc[2] - arc[4] * qx, stretch * (arc[3] - arc[4] * qy)
    scale = 1.0 / math.sqrt(nx * nx + ny * ny)
    nx *= scale
    ny *= scale
    px, py = arc[0] + qx, arc[1] + qy / stretch
    w = 2.0 * (vx * nx + vy * ny)
    return px, py, vx - w * nx, vy - w * ny


@_compile
def arc_incidence(arc, t, px, py, vx, vy, stretch):
    """Sine of the angle between the velocity and the arc that it meets after the time t."""
    qx, qy = px + t * vx - arc[0], stretch * (py + t * vy - arc[1])
    nx, ny = arc[2] - arc[4] * qx, stretch * (arc[3] - arc[4] * qy)
    return abs(vx * nx + vy * ny) / math.sqrt(nx * nx + ny * ny)


@_compile
def bezier_value(a0, a1, a2, a3, s):
    return ((a3 * s + a2) * s + a1) * s + a0


@_compile
def falling_root(a0, a1, a2, a3, low, high):
    """The root of the cubic in [low, high], where it falls monotonically from >= 0 to <= 0; safeguarded Newton."""
    s = 0.5 * (low + high)
    for _ in range(ROOT_STEPS):
        value = bezier_value(a0, a1, a2, a3, s)
        if value > 0.0:
            low = s
        elif value < 0.0:
            high = s
        else:
            return s
        slope = (3.0 * a3 * s + 2.0 * a2) * s + a1
        step = s - value / slope if slope != 0.0 else 0.5 * (low + high)
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - s) <= EPS * abs(step) or step == low or step == high:
            return step
        s = step
    return s


@_compile
def curve_size(curve):
    """A bound of a Bezier piece's extent: the sum of its coefficients but the constant ones."""
    return abs(curve[2]) + abs(curve[3]) + abs(curve[4]) + abs(curve[5]) + abs(curve[6]) + abs(curve[7])


@_compile
def contact_time(curve, bend, s, px, py, vx, vy):
    """Time to the point s, where the ray's line touches the curve from its free side; inf where from the other.

    ``bend`` is the second derivative of g there. Of the two hits that merge at s the front one came first exactly if
    the curve runs along the ray where g has a minimum, or against it where g has a maximum.
    """
    tx = (3.0 * curve[6] * s + 2.0 * curve[4]) * s + curve[2]
    ty = (3.0 * curve[7] * s + 2.0 * curve[5]) * s + curve[3]
    if not 0.0 < s < 1.0 or bend * (tx * vx + ty * vy) <= 0.0:
        return np.inf
    dx = bezier_value(curve[0], curve[2], curve[4], curve[6], s) - px
    dy = bezier_value(curve[1], curve[3], curve[5], curve[7], s) - py
    return dx * vx + dy * vy


@_compile
def bezier_hit(curve, own_s, px, py, vx, vy, slack):
    """First front hit of one Bezier piece: flight time (inf if none), parameter, and 1 if it is tangent within rounding.

    ``own_s`` < 0: the ray does not start on this piece.
    """
    share_slack = JOINT_ULPS * EPS
    # b(s) - p in the power basis; columns 0-7 hold x and y coefficients of 1, s, s^2, s^3
    a0 = (curve[0] - px) * vy - (curve[1] - py) * vx
    a1 = curve[2] * vy - curve[3] * vx
    a2 = curve[4] * vy - curve[5] * vx
    a3 = curve[6] * vy - curve[7] * vx
    if own_s >= 0.0:
        # divide out the ray's own start: g(s) = (s - own) (b2 sigma^2 + b1 sigma + b0), sigma = s - own
        b0 = (3.0 * a3 * own_s + 2.0 * a2) * own_s + a1
        b1 = 3.0 * a3 * own_s + a2
        b2 = a3
        best_t, best_s = np.inf, 0.0
        disc = b1 * b1 - 4.0 * b2 * b0
        if abs(disc) <= TANGENT_ULPS * EPS * (b1 * b1 + 4.0 * abs(b2 * b0)) and b2 != 0.0:
            s = own_s - 0.5 * b1 / b2
            t = contact_time(curve, 6.0 * a3 * s + 2.0 * a2, s, px, py, vx, vy)
            if t > slack:
                return t, s, 1
        if disc < 0.0:
            return best_t, best_s, 0
        q = -0.5 * (b1 + math.copysign(math.sqrt(disc), b1))
        for root in range(2):
            bottom, top = (b2, q) if root == 0 else (q, b0)
            if bottom == 0.0:
                continue
            s = own_s + top / bottom
            if -share_slack <= s <= 1.0 + share_slack:
                s = min(max(s, 0.0), 1.0)
                slope = (3.0 * a3 * s + 2.0 * a2) * s + a1
                dx = bezier_value(curve[0], curve[2], curve[4], curve[6], s) - px
                dy = bezier_value(curve[1], curve[3], curve[5], curve[7], s) - py
                t = dx * vx + dy * vy
                if slope <= 0.0 and 0.0 < t < best_t:
                    best_t, best_s = t, s
        return best_t, best_s, 0
    n = curve.shape[0]
    # g is a sum of products of numbers of this size
    spread = max(abs(vx), abs(vy)) * (abs(curve[0] - px) + abs(curve[1] - py) + curve_size(curve))
    # split [0, 1] at the critical points of g; it can fall through zero once on each part
    c1, c2 = 2.0, 2.0
    disc = a2 * a2 - 3.0 * a3 * a1
    if disc > 0.0:
        q = -(a2 + math.copysign(math.sqrt(disc), a2))
        if a3 != 0.0:
            c1 = q / (3.0 * a3)
        if q != 0.0:
            c2 = a1 / q
        if c1 > c2:
            c1, c2 = c2, c1
    best_t, best_s, tangent = np.inf, 0.0, 0
    low, touches = 0.0, False
    value_low = a0
    for part in range(3):
        high = 1.0 if part == 2 else (c1 if part == 0 else c2)
        if high <= low or high > 1.0:
            if part < 2:
                continue
            high = 1.0
        touched, touches = touches, False
        if high == 1.0:
            # the joint itself, so that the next piece sees the same number
            value_high = (curve[n - 4] - px) * vy - (curve[n - 3] - py) * vx
        else:
            value_high = bezier_value(a0, a1, a2, a3, high)
            if abs(value_high) <= TANGENT_ULPS * EPS * spread:
                t = contact_time(curve, 6.0 * a3 * high + 2.0 * a2, high, px, py, vx, vy)
                touches = t > slack and t < np.inf
                if touches and t < best_t:
                    best_t, best_s, tangent = t, high, 1
        # the root beside a contact is the contact itself, within rounding
        if value_low >= 0.0 >= value_high and value_low > value_high and not touched and not touches:
            s = falling_root(a0, a1, a2, a3, low, high)
            dx = bezier_value(curve[0], curve[2], curve[4], curve[6], s) - px
            dy = bezier_value(curve[1], curve[3], curve[5], curve[7], s) - py
            t = dx * vx + dy * vy
            if -slack <= t < best_t:
                best_t, best_s, tangent = max(t, 0.0), s, 0
        low, value_low = high, value_high
    return best_t, best_s, tangent


@_compile
def bend_number(curve, s):
    """Which part between its inflections the point s of a Bezier piece belongs to: 0, 1 or 2.

    A ray that just misses a bump may hit the same piece behind it, and leaves elsewhere; only a part that bends to one
    side has one front hit that moves continuously with the ray.
    """
    # the curvature has the sign of b' x b'', which is a quadratic in s for a cubic b
    c0 = 2.0 * (curve[2] * curve[5] - curve[3] * curve[4])
    c1 = 6.0 * (curve[2] * curve[7] - curve[3] * curve[6])
    c2 = 6.0 * (curve[4] * curve[7] - curve[5] * curve[6])
    disc = c1 * c1 - 4.0 * c2 * c0
    if disc <= 0.0:
        return 0
    q = -0.5 * (c1 + math.copysign(math.sqrt(disc), c1))
    number = 0
    if q != 0.0 and 0.0 < c0 / q < s:
        number += 1
    if c2 != 0.0 and 0.0 < q / c2 < s:
        number += 1
    return number


@_compile
def corner_ahead(dx, dy, c, vx, vy, slack, bounces):
    """Time to a joint within rounding of the ray's line, or inf where it is behind."""
    ahead = dx * vx + dy * vy
    # a ray that has not been reflected yet is exact, and so is its distance from the joint
    exact = bounces > 0 or abs(c) <= 4.0 * EPS * (abs(dx * vy) + abs(dy * vx))
    return ahead if exact and ahead > slack else np.inf


@_compile
def line_time(joints, lines, j, c_before, c_after, px, py, vx, vy):
    """Flight time to the line that starts at joint j, and the share of it at the hit, negative from its end."""
    share = c_before / (c_before - c_after)
    near = j
    if share > 0.5:
        # from the nearer joint, and negative to say so, so that both ends keep their digits
        share = c_after / (c_before - c_after)
        near = j + 1
    hx = joints[near, 0] + share * lines[j, 0]
    hy = joints[near, 1] + share * lines[j, 1]
    return (hx - px) * vx + (hy - py) * vy, share


@_compile
def walk(grid, hollow, joints, lines, own, px, py, vx, vy, slack, bounces, time):
    """Follow a ray through the cells of the grid to its first line before ``time``.

    Returns the flight time (inf if none), the line, the share of it, and the time to the first corner on the way that
    is met within rounding. Lines are listed in every cell that they nearly touch, so the walk's own rounding leaves
    out no line that the ray can meet; the signs at the joints are the same numbers in every cell.
    """
    columns, rows, base = int(hollow[17]), int(hollow[18]), int(hollow[19])
    x, y = (px - hollow[13]) / hollow[15], (py - hollow[14]) / hollow[16]
    column, row = min(max(int(x), 0), columns - 1), min(max(int(y), 0), rows - 1)
    right, up = 1 if vx > 0.0 else -1, 1 if vy > 0.0 else -1
    step_x = hollow[15] / abs(vx) if vx != 0.0 else np.inf
    step_y = hollow[16] / abs(vy) if vy != 0.0 else np.inf
    leave_x = ((column + 1 if vx > 0.0 else column) - x) * (hollow[15] / vx) if vx != 0.0 else np.inf
    leave_y = ((row + 1 if vy > 0.0 else row) - y) * (hollow[16] / vy) if vy != 0.0 else np.inf
    best, found, best_share = np.inf, -1, 0.0
    corner_time = np.inf
    while True:
        cell = base + row * columns + column
        for entry in range(grid[cell], grid[cell + 1]):
            j = grid[entry]
            dx, dy = joints[j, 0] - px, joints[j, 1] - py
            c_before = dx * vy - dy * vx
            if abs(c_before) <= slack and joints[j, 2] > 0.0:
                corner_time = min(corner_time, corner_ahead(dx, dy, c_before, vx, vy, slack, bounces))
            if joints[j, 3] <= 0.0:
                # a joint between curves, listed for its corner
                continue
            dx, dy = joints[j + 1, 0] - px, joints[j + 1, 1] - py
            c_after = dx * vy - dy * vx
            if abs(c_after) <= slack and joints[j + 1, 2] > 0.0:
                corner_time = min(corner_time, corner_ahead(dx, dy, c_after, vx, vy, slack, bounces))
            if c_before >= 0.0 >= c_after and c_before > c_after and j != own:
                t, share = line_time(joints, lines, j, c_before, c_after, px, py, vx, vy)
                # of two lines at one distance the first in the order of the wall is hit, as without a grid
                if -slack <= t and (max(t, 0.0) < best or (max(t, 0.0) == best and j < found)):
                    best, found, best_share = max(t, 0.0), j, share
        if min(leave_x, leave_y) > min(best, time) + 2.0 * slack:
            break
        if leave_x < leave_y:
            column += right
            leave_x += step_x
            if column < 0 or column >= columns:
                break
        else:
            row += up
            leave_y += step_y
            if row < 0 or row >= rows:
                break
    return best, found, best_share, corner_time


@_compile
def trace_ray(
    x, theta, hollow, joints, lines, circles, ellipses, beziers, period, limit, path, itinerary, pairs=None, grid=None
):
    """Follow one ray through one hollow; returns x, the outgoing velocity, bounces and status.

    ``period`` is None for a closed hollow; for an open wall its sides are passed and x is unfolded by it.
    ``path`` is None, or an array (limit + 2, 2) that receives the points of the trajectory. ``itinerary`` is None, or
    an array of one uint64 that receives a hash of the pieces hit, in their order, of the lengths of runs, and of the
    sides passed. ``pairs`` is None, or the table of the channels and wedges in which runs are skipped. ``grid``
    is None, or the table of cells of the hollows that have many lines.
    """
    left, right, size = hollow[0], hollow[1], hollow[2]
    joint_low, joint_high = int(hollow[3]), int(hollow[4])
    circle_low, circle_high = int(hollow[5]), int(hollow[6])
    ellipse_low, ellipse_high = int(hollow[7]), int(hollow[8])
    bezier_low, bezier_high = int(hollow[9]), int(hollow[10])
    slack = JOINT_ULPS * EPS * size
    px, py, vx, vy = x, 0.0, -math.cos(theta), -math.sin(theta)
    shift = 0.0
    bounces, steps = 0, 0
    own_kind, own_index, own_s = LID, -1, -1.0
    third = -1
    if path is not None:
        path[0, 0], path[0, 1] = px, py
    if itinerary is not None:
        itinerary[0] = np.uint64(0)
    while True:
        kind, index, hit_s, tangent = NO_PIECE, -1, 0.0, 0
        time = np.inf
        corner_time = np.inf

        if circles is not None:
            for k in range(circle_low, circle_high):
                own = own_kind == CIRCLE and own_index == k
                t, touch = arc_time(circles[k], own, px, py, vx, vy, 1.0)
                if -slack <= t < time:
                    t = max(t, 0.0)
                    if on_arc(circles[k], px + t * vx - circles[k, 0], py + t * vy - circles[k, 1], slack):
                        time, kind, index, tangent = t, CIRCLE, k, touch
        if ellipses is not None:
            for k in range(ellipse_low, ellipse_high):
                own = own_kind == ELLIPSE and own_index == k
                stretch = ellipses[k, 12]
                t, touch = arc_time(ellipses[k], own, px, py, vx, vy, stretch)
                if -slack <= t < time:
                    t = max(t, 0.0)
                    qx, qy = px + t * vx - ellipses[k, 0], stretch * (py + t * vy - ellipses[k, 1])
                    if on_arc(ellipses[k], qx, qy, slack * max(1.0, stretch)):
                        time, kind, index, tangent = t, ELLIPSE, k, touch
        if beziers is not None:
            for k in range(bezier_low, bezier_high):
                start_s = own_s if own_kind == BEZIER and own_index == k else -1.0
                t, s, touch = bezier_hit(beziers[k], start_s, px, py, vx, vy, slack)
                if t < time:
                    time, kind, index, hit_s, tangent = t, BEZIER, k, s, touch

        # segments, by the signs of the joints: of all of them, or of those in the cells that the ray passes
        walking = False
        if grid is not None:
            walking = hollow[17] > 0.0
        if not walking:
            dx, dy = joints[joint_low, 0] - px, joints[joint_low, 1] - py
            c_before = dx * vy - dy * vx
            if abs(c_before) <= slack and joints[joint_low, 2] > 0.0:
                corner_time = min(corner_time, corner_ahead(dx, dy, c_before, vx, vy, slack, bounces))
            for j in range(joint_low + 1, joint_high):
                dx, dy = joints[j, 0] - px, joints[j, 1] - py
                c_after = dx * vy - dy * vx
                if abs(c_after) <= slack and joints[j, 2] > 0.0:
                    corner_time = min(corner_time, corner_ahead(dx, dy, c_after, vx, vy, slack, bounces))
                if lines is not None:
                    if c_before >= 0.0 >= c_after and c_before > c_after and joints[j - 1, 3] > 0.0:
                        if own_kind != LINE or own_index != j - 1:
                            t, share = line_time(joints, lines, j - 1, c_before, c_after, px, py, vx, vy)
                            if -slack <= t < time:
                                time, kind, index, hit_s, tangent = max(t, 0.0), LINE, j - 1, share, 0
                c_before = c_after
        if grid is not None and walking:
            own = own_index if own_kind == LINE else -1
            t, index_there, share, ahead = walk(grid, hollow, joints, lines, own, px, py, vx, vy, slack, bounces, time)
            corner_time = min(corner_time, ahead)
            if t < time:
                time, kind, index, hit_s, tangent = t, LINE, index_there, share, 0

        # the opening, an edge from right to left, and the sides of an open wall
        if vy > 0.0:
            c_right, c_left = (right - px) * vy + py * vx, (left - px) * vy + py * vx
            t = max(-py / vy, 0.0)
            if (c_right >= 0.0 >= c_left or period is not None) and own_kind != LID and t <= time:
                time, kind = t, LID
        if period is not None:
            if vx != 0.0:
                t = ((right if vx > 0.0 else left) - px) / vx
                if t < time:
                    time, kind = max(t, 0.0), SIDE

        steps += 1
        if kind == NO_PIECE or corner_time <= time + slack:
            return shift + px, vx, vy, bounces, CORNER
        if corner_time < np.inf:
            # at a shallow incidence a corner that the ray meets within the slack lies far beyond the hit
            sine = abs(vy)
            if lines is not None and kind == LINE:
                sine = abs(vx * lines[index, 2] + vy * lines[index, 3])
            if circles is not None and kind == CIRCLE:
                sine = arc_incidence(circles[index], time, px, py, vx, vy, 1.0)
            if ellipses is not None and kind == ELLIPSE:
                sine = arc_incidence(ellipses[index], time, px, py, vx, vy, ellipses[index, 12])
            if kind != BEZIER and kind != SIDE and (corner_time - time) * sine <= 2.0 * slack:
                return shift + px, vx, vy, bounces, CORNER
        if kind == LID:
            if path is not None:
                path[bounces + 1, 0], path[bounces + 1, 1] = shift + px + time * vx, 0.0
            return shift + px + time * vx, vx, vy, bounces, ESCAPED
        if tangent != 0:
            return shift + px, vx, vy, bounces, GRAZING
        if bounces >= limit or steps // 2 > min(limit, MOST_STEPS):
            return shift + px, vx, vy, bounces, BOUNCE_LIMIT
        if itinerary is not None:
            side = 1 if kind == SIDE and vx > 0.0 else 0
            number = 8 * (index + 1 + side) + kind
            if beziers is not None and kind == BEZIER:
                number += bend_number(beziers[index], hit_s) << BEND_SHIFT
            itinerary[0] = HASH_FACTOR * itinerary[0] + np.uint64(number)
        if period is not None:
            if kind == SIDE:
                py += time * vy
                px = left if vx > 0.0 else right
                shift += (right - left) if vx > 0.0 else (left - right)
                own_kind, own_index, own_s = SIDE, -1, -1.0
                third = -1
                continue

        if lines is not None and kind == LINE:
            near = index if hit_s >= 0.0 else index + 1
            px = joints[near, 0] + hit_s * lines[index, 0]
            py = joints[near, 1] + hit_s * lines[index, 1]
            # a first hit below an end of the opening is as exact as the ray, at the smallest distance from that corner
            room = 0.0 if bounces == 0 and joints[near, 1] == 0.0 else slack
            if abs(hit_s) * lines[index, 4] <= room and joints[near, 2] > 0.0:
                return shift + px, vx, vy, bounces, CORNER
            w = 2.0 * (vx * lines[index, 2] + vy * lines[index, 3])
            vx -= w * lines[index, 2]
            vy -= w * lines[index, 3]
            if pairs is not None:
                # the ray came from this line, to that one, and back
                if third == index and own_kind == LINE and path is None and lines[index, 6] > 0.0:
                    for row in range(int(lines[index, 5]), int(lines[index, 6])):
                        if pairs[row, 0] == own_index:
                            px, py, vx, vy, hits = skip_crossings(
                                pairs[row], lines[index, 2], lines[index, 3], px, py, vx, vy, slack, limit - bounces - 1
                            )
                            bounces += hits
                            if itinerary is not None:
                                itinerary[0] = HASH_FACTOR * itinerary[0] + np.uint64(hits)
        if circles is not None and kind == CIRCLE:
            px, py, nvx, nvy = arc_reflect(circles[index], time, px, py, vx, vy, 1.0)
            if near_end(circles[index], px, py, slack):
                return shift + px, vx, vy, bounces, CORNER
            vx, vy = nvx, nvy
            if circles[index, 10] > 0.0 and path is None:
                px, py, vx, vy, hops = skip_hops(circles[index], px, py, vx, vy, limit - bounces - 1)
                bounces += hops
                if itinerary is not None:
                    itinerary[0] = HASH_FACTOR * itinerary[0] + np.uint64(hops)
        if ellipses is not None and kind == ELLIPSE:
            px, py, nvx, nvy = arc_reflect(ellipses[index], time, px, py, vx, vy, ellipses[index, 12])
            if near_end(ellipses[index], px, py, slack):
                return shift + px, vx, vy, bounces, CORNER
            vx, vy = nvx, nvy
        if beziers is not None and kind == BEZIER:
            curve = beziers[index]
            px = bezier_value(curve[0], curve[2], curve[4], curve[6], hit_s)
            py = bezier_value(curve[1], curve[3], curve[5], curve[7], hit_s)
            if near_end(curve, px, py, slack):
                return shift + px, vx, vy, bounces, CORNER
            tx = (3.0 * curve[6] * hit_s + 2.0 * curve[4]) * hit_s + curve[2]
            ty = (3.0 * curve[7] * hit_s + 2.0 * curve[5]) * hit_s + curve[3]
            scale = 1.0 / math.sqrt(tx * tx + ty * ty)
            w = 2.0 * scale * scale * (vy * tx - vx * ty)
            vx += w * ty
            vy -= w * tx
            own_s = hit_s
        third = own_index if own_kind == LINE else -1
        own_kind, own_index = kind, index
        if kind != BEZIER:
            own_s = -1.0
        # one Newton step on |v| = 1 keeps rounding errors of speed and place from feeding each other
        scale = 1.5 - 0.5 * (vx * vx + vy * vy)
        vx *= scale
        vy *= scale
        bounces += 1
        if path is not None:
            path[bounces, 0], path[bounces, 1] = px + shift, py


@_compile
def near_end(piece, px, py, slack):
    """Whether a hit is within rounding of a joint that is a corner; both tables keep the ends in their last columns."""
    n = piece.shape[0]
    x, y = px - piece[n - 6], py - piece[n - 5]
    if piece[n - 2] > 0.0 and x * x + y * y <= slack * slack:
        return True
    x, y = px - piece[n - 4], py - piece[n - 3]
    return piece[n - 1] > 0.0 and x * x + y * y <= slack * slack


@_compile
def trace_rays(
    x, theta, hollows, joints, lines, circles, ellipses, beziers, pairs, grid, period, cell, limit,
    out_x, out_theta, bounces, status,
):  # fmt: skip
    """Trace a block of rays; fills the four output arrays."""
    for i in range(x.shape[0]):
        base = math.floor(x[i] / cell) * cell
        place = x[i] - base
        # the last hollow whose left end is not beyond the place
        low, high = 0, hollows.shape[0]
        while low < high:
            middle = (low + high) // 2
            if hollows[middle, 0] <= place:
                low = middle + 1
            else:
                high = middle
        h = low - 1
        if h < 0 or place >= hollows[h, 1] or (place == hollows[h, 0] and hollows[h, 11] > 0.0):
            # a flat top, or an edge of it; the edges between two hollows are corners
            out_x[i], out_theta[i], bounces[i] = x[i], math.pi - theta[i], 1
            status[i] = ESCAPED
            edge = h >= 0 and (
                (place == hollows[h, 0] and hollows[h, 11] > 1.0) or (place == hollows[h, 1] and hollows[h, 12] > 1.0)
            )
            if edge:
                out_theta[i], bounces[i], status[i] = theta[i] - math.pi, 0, CORNER
            continue
        place, vx, vy, bounces[i], status[i] = trace_ray(
            place,
            theta[i],
            hollows[h],
            joints,
            lines,
            circles,
            ellipses,
            beziers,
            period,
            limit,
            None,
            None,
            pairs,
            grid,
        )
        out_x[i] = base + place
        out_theta[i] = math.atan2(vy, vx)
