"""The compiled tracer in double-double arithmetic, for the few rays that double precision does not settle.

Only `refinement` imports this file, because it loads numba. The formulas are those of `engine`, one for one; what is
exact is the wall: its joints are the doubles of the tables, segments join them, a circular arc goes through both of its
joints and subtends the double in its table (elliptic arcs in stretched coordinates), and a Bezier piece has the
coefficients of its table but the highest, which takes it to its end joint. The ray starts from exact doubles, too.

Three sizes accompany a ray.

* Its Jacobi fields: displacement and turn of the ray for a unit displacement, and a unit turn, of the incoming one.
* The bound on its rounding error: to first order the error after n bounces is the sum of M(n <- i) e_i over the local
  errors e_i, and |M(n <- i)| <= |M_n| |M_i| because an area-preserving map has |M^-1| = |M| in two dimensions. The
  sum of absolute values from bounce to bounce is a second bound: better after a near tangency, worse along an arc.
* Its width: half an ulp of the incoming angle. An angle stands for the angles that round to it; a ray meets a corner
  exactly if one of them does. (No ray of rational data but a vertical one meets a corner in the strict sense, since
  the tangent of an algebraic angle is transcendental.)

Long runs between two vertical sides that face each other are counted by a division; no other run is left out.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .double_double import (
    EPS_DOUBLE_DOUBLE,
    add,
    cross,
    direction_angle,
    divide,
    dot,
    multiply,
    negate,
    sine_cosine,
    square_root,
    subtract,
    two_product,
    two_sum,
    wide,
)

ESCAPED, CORNER, GRAZING, BOUNCE_LIMIT, LOST, UNSETTLED = 0, 1, 2, 3, 4, 5
NO_PIECE, LID, SIDE, LINE, ARC, BEZIER = 0, 1, 2, 3, 4, 5
# A bounce is fewer than 64 operations in a row on each coordinate, each within EPS_DOUBLE_DOUBLE of the cell's size.
LOCAL_ERROR = 64.0 * EPS_DOUBLE_DOUBLE
# The first-order estimate of the width is trusted to this share.
WIDTH_MARGIN = 1.0 + 2.0**-20
# Where the accumulated rounding exceeds this share of the cell, nothing is settled.
LARGEST_ERROR = 2.0**-50
ROOT_STEPS = 200
ARC_COLUMNS = 22
# Shorter runs are followed hit by hit, so that they check those of `skips`; of a longer one the last hits are.
LONGEST_FOLLOWED, LAST_HITS = 4096.0, 4.0

_compile = njit(cache=True, nogil=True, error_model="numpy")


@_compile
def refined_arcs(arcs):
    """The table of arcs that go through both joints exactly and subtend their span exactly.

    Columns: first joint (2), then pairs: normal there (2 x 2), curvature, chord direction (2 x 2), chord length; then
    1 where the chord decides by position, stretch, stretched end y (2 unused), sign.
    """
    table = np.zeros((arcs.shape[0], ARC_COLUMNS))
    for k in range(arcs.shape[0]):
        stretch = arcs[k, 12]
        x0, y0, x1, y1 = arcs[k, 13], arcs[k, 14], arcs[k, 15], arcs[k, 16]
        cx = two_sum(x1, -x0)
        cy = multiply(wide(stretch), two_sum(y1, -y0))
        length = square_root(dot(cx, cy, cx, cy))
        ex, ey = divide(cx, length), divide(cy, length)
        sine, cosine = sine_cosine(0.5 * arcs[k, 11])
        if arcs[k, 4] < 0.0:
            sine = negate(sine)
        # n0 = (s ex - c ey, s ey + c ex), kappa = 2 s / length
        nx = subtract(multiply(sine, ex), multiply(cosine, ey))
        ny = add(multiply(sine, ey), multiply(cosine, ex))
        curvature = divide((2.0 * sine[0], 2.0 * sine[1]), length)
        row = table[k]
        row[0], row[1] = x0, y0
        row[2], row[3] = nx
        row[4], row[5] = ny
        row[6], row[7] = curvature
        row[8], row[9] = ex
        row[10], row[11] = ey
        row[12], row[13] = length
        row[14] = 1.0 if arcs[k, 7] > 0.0 else 0.0
        row[15] = stretch
    return table


@_compile
def arc_hit(arc, own, px, py, vx, vy, error):
    """Flight time to the front of one arc, inf if none; second value: time of a contact that is undecided, or inf.

    ``error`` bounds the transversal error of the ray there.
    """
    nothing = (np.inf, 0.0)
    n0x, n0y, curvature = (arc[2], arc[3]), (arc[4], arc[5]), (arc[6], arc[7])
    stretch = wide(arc[15])
    rx, ry = subtract(px, wide(arc[0])), multiply(stretch, subtract(py, wide(arc[1])))
    wy = multiply(stretch, vy)
    b = subtract(dot(n0x, n0y, vx, wy), multiply(curvature, dot(rx, ry, vx, wy)))
    speed2 = dot(vx, wy, vx, wy)
    bend = multiply(curvature, speed2)
    undecided = np.inf
    if own:
        if curvature[0] <= 0.0 or b[0] <= 0.0:
            return nothing, undecided
        t = divide((2.0 * b[0], 2.0 * b[1]), bend)
    else:
        r2 = multiply(curvature, dot(rx, ry, rx, ry))
        f = subtract(dot(n0x, n0y, rx, ry), (0.5 * r2[0], 0.5 * r2[1]))
        product = multiply(bend, f)
        d = add(multiply(b, b), (2.0 * product[0], 2.0 * product[1]))
        if curvature[0] < 0.0 and b[0] < 0.0:
            # d = w^2 - kappa^2 (distance of the line from the centre)^2 w^2, and kappa distance is about 1 where d is 0
            wide_stretch = max(1.0, arc[15]) ** 2
            noise = 8.0 * LOCAL_ERROR * (b[0] * b[0] + 2.0 * abs(product[0]))
            if abs(d[0]) <= noise + 4.0 * abs(curvature[0]) * wide_stretch * wide_stretch * error:
                t = divide((2.0 * f[0], 2.0 * f[1]), negate(b))
                if t[0] > 0.0 and on_arc(arc, add(rx, multiply(t, vx)), add(ry, multiply(t, wy)), error):
                    undecided = t[0]
        if d[0] < 0.0:
            return nothing, undecided
        root = square_root(d)
        if b[0] >= 0.0:
            if curvature[0] <= 0.0:
                return nothing, undecided
            t = divide(add(b, root), bend)
        else:
            t = divide((2.0 * f[0], 2.0 * f[1]), subtract(root, b))
    slack = error * max(1.0, arc[15])
    if t[0] < -slack or not on_arc(arc, add(rx, multiply(t, vx)), add(ry, multiply(t, wy)), slack):
        return nothing, undecided
    return t, undecided


@_compile
def on_arc(arc, qx, qy, slack):
    """Whether the point q on the full circle, measured from the first joint, belongs to the arc."""
    ex, ey = (arc[8], arc[9]), (arc[10], arc[11])
    if arc[14] > 0.0:
        along = dot(qx, qy, ex, ey)[0]
        facing = (arc[4] - arc[6] * qy[0]) * ex[0] - (arc[2] - arc[6] * qx[0]) * ey[0]
        return -slack <= along and subtract((along, 0.0), (arc[12], arc[13]))[0] <= slack and facing > 0.0
    height = cross(ex, ey, qx, qy)[0]
    return height <= slack if arc[6] > 0.0 else height >= -slack


@_compile
def arc_place(arc, t, px, py, vx, vy):
    """Position on the arc after the time t, unit normal there, and the curvature of the arc there (a double)."""
    n0x, n0y, curvature = (arc[2], arc[3]), (arc[4], arc[5]), (arc[6], arc[7])
    stretch = wide(arc[15])
    qx = subtract(add(px, multiply(t, vx)), wide(arc[0]))
    qy = multiply(stretch, subtract(add(py, multiply(t, vy)), wide(arc[1])))
    nx, ny = subtract(n0x, multiply(curvature, qx)), subtract(n0y, multiply(curvature, qy))
    r2 = multiply(curvature, dot(qx, qy, qx, qy))
    f = subtract(dot(n0x, n0y, qx, qy), (0.5 * r2[0], 0.5 * r2[1]))
    qx, qy = subtract(qx, multiply(f, nx)), subtract(qy, multiply(f, ny))
    nx = subtract(n0x, multiply(curvature, qx))
    ny = multiply(stretch, subtract(n0y, multiply(curvature, qy)))
    size = square_root(dot(nx, ny, nx, ny))
    nx, ny = divide(nx, size), divide(ny, size)
    bent = arc[6] * (ny[0] * ny[0] + (arc[15] * nx[0]) ** 2) / size[0]
    x = add(wide(arc[0]), qx)
    y = add(wide(arc[1]), divide(qy, stretch) if arc[15] != 1.0 else qy)
    return x, y, nx, ny, bent


@_compile
def cubic(a0, a1, a2, a3, s):
    return add(multiply(add(multiply(add(multiply(a3, s), a2), s), a1), s), a0)


@_compile
def cubic_slope(a1, a2, a3, s):
    three = multiply((3.0, 0.0), multiply(a3, s))
    return add(multiply(add(three, (2.0 * a2[0], 2.0 * a2[1])), s), a1)


@_compile
def falling_root(a0, a1, a2, a3, low, high):
    """The root in [low, high], where the cubic falls from >= 0 to <= 0: bisection to a double, then Newton steps."""
    for _ in range(ROOT_STEPS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        if cubic(a0, a1, a2, a3, (middle, 0.0))[0] >= 0.0:
            low = middle
        else:
            high = middle
    s = (low, 0.0)
    for _ in range(4):
        slope = cubic_slope(a1, a2, a3, s)
        if slope[0] == 0.0:
            break
        step = divide(cubic(a0, a1, a2, a3, s), slope)
        if abs(step[0]) > 4.0 * (high - low):
            break
        s = subtract(s, step)
    return s


@_compile
def bezier_coefficients(curve):
    """The coefficients in x and in y; the highest one takes the curve to its end joint exactly."""
    n = curve.shape[0]
    ax0, ax1, ax2, ax3 = wide(curve[0]), wide(curve[2]), wide(curve[4]), wide(curve[6])
    ay0, ay1, ay2, ay3 = wide(curve[1]), wide(curve[3]), wide(curve[5]), wide(curve[7])
    rest_x = subtract(subtract(wide(curve[n - 4]), ax0), ax1)
    rest_y = subtract(subtract(wide(curve[n - 3]), ay0), ay1)
    if curve[6] == 0.0 and curve[7] == 0.0:
        ax2, ay2 = rest_x, rest_y
    else:
        ax3, ay3 = subtract(rest_x, ax2), subtract(rest_y, ay2)
    return ax0, ay0, ax1, ay1, ax2, ay2, ax3, ay3


@_compile
def bezier_hit(curve, own_s, px, py, vx, vy, error):
    """First front hit of one Bezier piece: time (inf if none), parameter, time of an undecided contact (or inf)."""
    ax0, ay0, ax1, ay1, ax2, ay2, ax3, ay3 = bezier_coefficients(curve)
    n = curve.shape[0]
    a0 = cross(subtract(ax0, px), subtract(ay0, py), vx, vy)
    a1, a2, a3 = cross(ax1, ay1, vx, vy), cross(ax2, ay2, vx, vy), cross(ax3, ay3, vx, vy)
    best_t, best_s, undecided = (np.inf, 0.0), (0.0, 0.0), np.inf
    if own_s[0] >= 0.0:
        b0 = cubic_slope(a1, a2, a3, own_s)
        b1 = add(multiply(multiply((3.0, 0.0), a3), own_s), a2)
        product = multiply(a3, b0)
        disc = subtract(multiply(b1, b1), (4.0 * product[0], 4.0 * product[1]))
        if disc[0] < 0.0:
            return best_t, best_s, undecided
        root = square_root(disc)
        q = add(b1, root if b1[0] >= 0.0 else negate(root))
        q = (-0.5 * q[0], -0.5 * q[1])
        for which in range(2):
            bottom, top = (a3, q) if which == 0 else (q, b0)
            if bottom[0] == 0.0:
                continue
            s = add(own_s, divide(top, bottom))
            if -LOCAL_ERROR <= s[0] and subtract(s, (1.0, 0.0))[0] <= LOCAL_ERROR:
                dx = subtract(cubic(ax0, ax1, ax2, ax3, s), px)
                dy = subtract(cubic(ay0, ay1, ay2, ay3, s), py)
                t = dot(dx, dy, vx, vy)
                if cubic_slope(a1, a2, a3, s)[0] <= 0.0 and 0.0 < t[0] < best_t[0]:
                    best_t, best_s = t, s
        return best_t, best_s, undecided
    # the critical points of g are needed as doubles only: g there changes in second order
    c1, c2 = 2.0, 2.0
    disc = subtract(multiply(a2, a2), multiply((3.0, 0.0), multiply(a3, a1)))
    if disc[0] > 0.0:
        root = square_root(disc)
        q = negate(add(a2, root if a2[0] >= 0.0 else negate(root)))
        if a3[0] != 0.0:
            c1 = divide(q, multiply((3.0, 0.0), a3))[0]
        if q[0] != 0.0:
            c2 = divide(a1, q)[0]
        if c1 > c2:
            c1, c2 = c2, c1
    low, value_low = 0.0, a0
    for part in range(3):
        high = 1.0 if part == 2 else (c1 if part == 0 else c2)
        if high <= low or high > 1.0:
            if part < 2:
                continue
            high = 1.0
        if high == 1.0:
            value_high = cross(subtract(wide(curve[n - 4]), px), subtract(wide(curve[n - 3]), py), vx, vy)
        else:
            value_high = cubic(a0, a1, a2, a3, (high, 0.0))
            if abs(value_high[0]) <= error:
                dx = subtract(cubic(ax0, ax1, ax2, ax3, (high, 0.0)), px)
                dy = subtract(cubic(ay0, ay1, ay2, ay3, (high, 0.0)), py)
                contact = dot(dx, dy, vx, vy)[0]
                if 0.0 < contact < undecided:
                    undecided = contact
        if value_low[0] >= 0.0 >= value_high[0] and value_low[0] > value_high[0]:
            s = falling_root(a0, a1, a2, a3, low, high)
            dx = subtract(cubic(ax0, ax1, ax2, ax3, s), px)
            dy = subtract(cubic(ay0, ay1, ay2, ay3, s), py)
            t = dot(dx, dy, vx, vy)
            if -error <= t[0] < best_t[0]:
                best_t, best_s = t, s
        low, value_low = high, value_high
    return best_t, best_s, undecided


@_compile
def bezier_place(curve, s):
    """Position at the parameter s, unit normal there, and the curvature there (a double, positive where focusing)."""
    ax0, ay0, ax1, ay1, ax2, ay2, ax3, ay3 = bezier_coefficients(curve)
    tx, ty = cubic_slope(ax1, ax2, ax3, s), cubic_slope(ay1, ay2, ay3, s)
    size = square_root(dot(tx, ty, tx, ty))
    bx, by = 2.0 * ax2[0] + 6.0 * ax3[0] * s[0], 2.0 * ay2[0] + 6.0 * ay3[0] * s[0]
    bent = (tx[0] * by - ty[0] * bx) / size[0] ** 3
    nx, ny = negate(divide(ty, size)), divide(tx, size)
    return cubic(ax0, ax1, ax2, ax3, s), cubic(ay0, ay1, ay2, ay3, s), nx, ny, bent


@_compile
def crossings(joints, lines, pairs, index, other, py, vx, vy, most):
    """Hits, an even number, between a vertical side and one that faces it; the way along y, and the flight time."""
    way, flight = (0.0, 0.0), 0.0
    if joints[index, 0] != joints[index + 1, 0] or joints[other, 0] != joints[other + 1, 0]:
        return 0, way, flight
    for row in range(int(lines[index, 5]), int(lines[index, 6])):
        if pairs[row, 0] == other:
            gap = two_sum(joints[other, 0], -joints[index, 0])
            time = divide(gap, vx)
            step = multiply(time, vy)
            low, high = min(pairs[row, 2], pairs[row, 4]), max(pairs[row, 2], pairs[row, 4])
            room = high - py[0] if step[0] > 0.0 else py[0] - low
            count = room / abs(step[0]) - LAST_HITS if step[0] != 0.0 else 0.0
            if count > LONGEST_FOLLOWED and count < most and time[0] > 0.0:
                hits = 2 * np.int64(0.5 * count)
                # beyond 2^53 there is no such double, and no double-double knows the ray's place
                return hits, multiply((float(hits), 0.0), step), float(hits) * time[0]
    return 0, way, flight


@_compile
def earlier(t, time):
    """Whether t < time, which may be (inf, 0): differences of infinities are not numbers."""
    return t[0] < np.inf and (time[0] == np.inf or subtract(t, time)[0] < 0.0)


@_compile
def refined_ray(
    place, theta, hollow, joints, lines, pairs, arcs, first_ellipse, beziers, is_open, cell, limit, most_flights
):  # fmt: skip
    """Follow one ray; returns x and angle (double-doubles), bounces, status, amplification and rounding error.

    ``place`` is a double-double in the hollow, and ``arcs`` holds the circles, then the ellipses, of `refined_arcs`.
    The amplification is the norm of the map's derivative in the units (cell, radian).
    """
    left, right = hollow[0], hollow[1]
    joint_low, joint_high = int(hollow[3]), int(hollow[4])
    circle_low, circle_high = int(hollow[5]), int(hollow[6])
    ellipse_low, ellipse_high = first_ellipse + int(hollow[7]), first_ellipse + int(hollow[8])
    bezier_low, bezier_high = int(hollow[9]), int(hollow[10])
    scale = cell + hollow[2]
    px, py = place, (0.0, 0.0)
    sine, cosine = sine_cosine(theta)
    vx, vy = negate(cosine), negate(sine)
    # Jacobi fields of a displacement (j1, a1) and of a turn (j2, a2); displacements as shares of the scale
    j1, a1, j2, a2 = 1.0, 0.0, 0.0, 1.0
    half_ulp = math.ldexp(1.0, math.frexp(theta)[1] - 54)
    spread, norm = 1.0, 1.0
    step_j, step_a = 1.0, 1.0
    wraps, bounces, steps = 0, 0, 0
    own_kind, own_index, own_s = LID, -1, (-1.0, 0.0)
    while True:
        # bound on the transversal error of the ray: on the segment, at a distance of up to one scale
        local = LOCAL_ERROR * min(norm * spread, step_j + step_a)
        if not local <= LARGEST_ERROR:
            return px, (0.0, 0.0), bounces, UNSETTLED, norm, local
        error = 2.0 * scale * local
        kind, index, hit_s, edge_share = NO_PIECE, -1, (0.0, 0.0), (0.0, 0.0)
        time = (np.inf, 0.0)
        corner_time, corner_width, graze_time = np.inf, 0.0, np.inf

        before = (0.0, 0.0)
        for j in range(joint_low, joint_high):
            dx, dy = subtract(wide(joints[j, 0]), px), subtract(wide(joints[j, 1]), py)
            after = cross(dx, dy, vx, vy)
            if joints[j, 2] > 0.0:
                ahead = dot(dx, dy, vx, vy)[0]
                width = WIDTH_MARGIN * half_ulp * abs(scale * j2 + ahead * a2) + (1.0 + ahead / scale) * error
                if abs(after[0]) <= width and 0.0 < ahead < corner_time:
                    corner_time, corner_width = ahead, width
            starts_here = j > joint_low and joints[j - 1, 3] > 0.0
            if starts_here and before[0] >= 0.0 >= after[0] and before[0] > after[0]:
                if own_kind != LINE or own_index != j - 1:
                    share = divide(before, subtract(before, after))
                    hx = two_sum(joints[j, 0], -joints[j - 1, 0])
                    hy = two_sum(joints[j, 1], -joints[j - 1, 1])
                    dx = subtract(add(wide(joints[j - 1, 0]), multiply(share, hx)), px)
                    dy = subtract(add(wide(joints[j - 1, 1]), multiply(share, hy)), py)
                    t = dot(dx, dy, vx, vy)
                    if -error <= t[0] and earlier(t, time):
                        time, kind, index, edge_share = t, LINE, j - 1, share
            before = after

        for table in range(2):
            low, high = (circle_low, circle_high) if table == 0 else (ellipse_low, ellipse_high)
            for k in range(low, high):
                t, undecided = arc_hit(arcs[k], own_kind == ARC and own_index == k, px, py, vx, vy, error)
                graze_time = min(graze_time, undecided)
                if earlier(t, time):
                    time, kind, index = t, ARC, k
        for k in range(bezier_low, bezier_high):
            start_s = own_s if own_kind == BEZIER and own_index == k else (-1.0, 0.0)
            t, s, undecided = bezier_hit(beziers[k], start_s, px, py, vx, vy, error)
            graze_time = min(graze_time, undecided)
            if earlier(t, time):
                time, kind, index, hit_s = t, BEZIER, k, s

        if vy[0] > 0.0 and own_kind != LID:
            t = divide(negate(py), vy)
            inside = is_open
            if not is_open:
                c_right = add(multiply(subtract(wide(right), px), vy), multiply(py, vx))
                c_left = add(multiply(subtract(wide(left), px), vy), multiply(py, vx))
                inside = c_right[0] >= 0.0 >= c_left[0]
            if inside and not earlier(time, t):
                time, kind = t, LID
        if is_open and vx[0] != 0.0:
            t = divide(subtract(wide(right if vx[0] > 0.0 else left), px), vx)
            if earlier(t, time):
                time, kind = t, SIDE

        steps += 1
        if time[0] < 0.0:
            time = (0.0, 0.0)
        if graze_time < np.inf and graze_time <= time[0] + error:
            return px, (0.0, 0.0), bounces, GRAZING, norm, local
        if kind == NO_PIECE:
            return px, (0.0, 0.0), bounces, CORNER if corner_time < np.inf else LOST, norm, local
        nx, ny, bent = (0.0, 0.0), (0.0, 0.0), 0.0
        qx, qy = px, py
        if kind == LINE:
            ex = two_sum(joints[index + 1, 0], -joints[index, 0])
            ey = two_sum(joints[index + 1, 1], -joints[index, 1])
            size = square_root(dot(ex, ey, ex, ey))
            nx, ny = negate(divide(ey, size)), divide(ex, size)
            qx = add(wide(joints[index, 0]), multiply(edge_share, ex))
            qy = add(wide(joints[index, 1]), multiply(edge_share, ey))
        elif kind == ARC:
            qx, qy, nx, ny, bent = arc_place(arcs[index], time, px, py, vx, vy)
        elif kind == BEZIER:
            qx, qy, nx, ny, bent = bezier_place(beziers[index], hit_s)
        else:
            nx, ny = (0.0, 0.0) if kind == LID else (1.0, 0.0), (1.0, 0.0) if kind == LID else (0.0, 0.0)
            qx, qy = add(px, multiply(time, vx)), add(py, multiply(time, vy))
        approach = dot(vx, vy, nx, ny)
        incidence = abs(approach[0])
        # a corner at the end of what is hit is as far away as the hit up to the width over the sine of incidence
        if corner_time <= time[0] or (corner_time - time[0]) * incidence <= 2.0 * corner_width:
            return px, (0.0, 0.0), bounces, CORNER, norm, local
        flight = time[0] / scale
        j1 += flight * a1
        j2 += flight * a2
        step_j += flight * step_a + 1.0
        if kind == LID:
            x = add(qx, two_product(float(wraps), right - left))
            norm = math.sqrt(j1 * j1 + a1 * a1 + j2 * j2 + a2 * a2)
            return x, direction_angle(vx, vy), bounces, ESCAPED, norm, local
        if bounces >= limit or steps >= most_flights:
            return px, (0.0, 0.0), bounces, BOUNCE_LIMIT, norm, local
        if kind == SIDE:
            py = qy
            px = wide(left if vx[0] > 0.0 else right)
            wraps += 1 if vx[0] > 0.0 else -1
        else:
            px, py = qx, qy
            twice = (2.0 * approach[0], 2.0 * approach[1])
            vx, vy = subtract(vx, multiply(twice, nx)), subtract(vy, multiply(twice, ny))
            speed2 = dot(vx, vy, vx, vy)
            factor = subtract((1.5, 0.0), (0.5 * speed2[0], 0.5 * speed2[1]))
            vx, vy = multiply(factor, vx), multiply(factor, vy)
            if incidence == 0.0:
                return px, (0.0, 0.0), bounces, GRAZING, norm, local
            power = 2.0 * bent * scale / incidence
            step_a += abs(power) * step_j + 1.0
            a1 -= power * j1
            a2 -= power * j2
            bounces += 1
            if kind == LINE and own_kind == LINE:
                hits, way, flight = crossings(joints, lines, pairs, index, own_index, py, vx, vy, limit - bounces)
                bounces += hits
                py = add(py, way)
                flight /= scale
                j1 += flight * a1
                j2 += flight * a2
                step_j += flight * step_a
        norm = math.sqrt(j1 * j1 + a1 * a1 + j2 * j2 + a2 * a2)
        spread += norm
        own_kind, own_index, own_s = kind, index, hit_s if kind == BEZIER else (-1.0, 0.0)


@_compile
def refined_rays(
    x, theta, hollows, joints, lines, pairs, arcs, first_ellipse, beziers, is_open, cell, limit, most_flights,
    out_x, out_theta, bounces, status, amplification, rounding,
):  # fmt: skip
    """Trace rays; fills the output arrays, ``out_x`` and ``out_theta`` (n, 2) with double-doubles."""
    for i in range(x.shape[0]):
        turns = math.floor(x[i] / cell)
        base = two_product(turns, cell)
        place = subtract(wide(x[i]), base)
        if place[0] < 0.0:
            turns -= 1.0
            base = two_product(turns, cell)
            place = subtract(wide(x[i]), base)
        low, high = 0, hollows.shape[0]
        while low < high:
            middle = (low + high) // 2
            if subtract(place, wide(hollows[middle, 0]))[0] >= 0.0:
                low = middle + 1
            else:
                high = middle
        h = low - 1
        amplification[i], rounding[i] = 1.0, LOCAL_ERROR
        at_left = h >= 0 and subtract(place, wide(hollows[h, 0]))[0] == 0.0 and hollows[h, 11] > 0.0
        to_right = subtract(place, wide(hollows[h, 1]))[0] if h >= 0 else 1.0
        if h < 0 or to_right >= 0.0 or at_left:
            edge = (at_left and hollows[h, 11] > 1.0) or (h >= 0 and to_right == 0.0 and hollows[h, 12] > 1.0)
            out_x[i, 0], out_x[i, 1] = x[i], 0.0
            mirrored = two_sum(math.pi, -theta[i])
            mirrored = add(mirrored, (1.2246467991473532e-16, 0.0))
            out_theta[i, 0], out_theta[i, 1] = mirrored
            bounces[i], status[i] = 1, ESCAPED
            if edge:
                out_theta[i, 0], bounces[i], status[i] = theta[i] - math.pi, 0, CORNER
            continue
        end, angle, bounces[i], status[i], amplification[i], rounding[i] = refined_ray(
            place, theta[i], hollows[h], joints, lines, pairs, arcs, first_ellipse, beziers, is_open, cell, limit,
            most_flights,
        )  # fmt: skip
        end = add(base, end)
        out_x[i, 0], out_x[i, 1] = end
        out_theta[i, 0], out_theta[i, 1] = angle
