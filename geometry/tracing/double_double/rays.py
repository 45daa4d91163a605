"""The compiled tracer in double-double arithmetic, for the few rays that double precision does not decide.

Only `refinement` imports this file, because it loads numba. The formulas are those of `compiled/rays`, one for one;
those of curves are in `arcs` and `beziers`. What is exact is the wall: its joints are the doubles of the tables,
segments join them, a circular arc goes through both of its joints and subtends the double in its table (elliptic arcs
in stretched coordinates), and a Bezier piece has the coefficients of its table but the highest, which takes it to its
end joint. The ray starts from exact doubles, too.

Three sizes accompany a ray.

* Its Jacobi fields: displacement and turn of the ray for a unit displacement, and a unit turn, of the incoming one.
* The bound on its rounding error: to first order the error after n bounces is the sum of M(n <- i) e_i over the local
  errors e_i, at most sqrt((n + 1) trace C) max |e_i| with C the sum of M(n <- i) M(n <- i)^T (Cauchy and Schwarz), and
  C goes from bounce to bounce as M C M^T + 1.
* Its width: half an ulp of the incoming angle. An angle stands for the angles that round to it; a ray meets a corner
  exactly if one of them does. (No ray of rational data but a vertical one meets a corner in the strict sense, since
  the tangent of an algebraic angle is transcendental.)

Long runs between two vertical sides that face each other are counted by a division, and so are the cells that a ray
passes at heights at which no piece lies; no other run is left out.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ....core.rounding import EPS
from ...scene.columns import (
    BAND_HIGH,
    BAND_LOW,
    BEZIERS_END,
    CIRCLES_END,
    CORNER_EDGE,
    ELLIPSES_END,
    FAR_Y,
    FIRST_BEZIER,
    FIRST_CIRCLE,
    FIRST_ELLIPSE,
    FIRST_JOINT,
    FIRST_PAIR,
    HIGH,
    IS_CORNER,
    JOINT_X,
    JOINT_Y,
    JOINTS_END,
    LEFT,
    LEFT_EDGE,
    LENGTH,
    LOW,
    NEAR_Y,
    NO_EDGE,
    PAIRS_END,
    PARTNER,
    RIGHT,
    RIGHT_EDGE,
    SIZE,
    STARTS_LINE,
    WIDE_STRETCH,
)
from ...scene.tolerances import JOINT_ULPS
from .arcs import arc_hit, arc_place
from .arithmetic import (
    LOCAL_ERROR,
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
from .beziers import bezier_hit, bezier_place
from .sides import in_front, line_ends, orientation

ESCAPED, CORNER, GRAZING, BOUNCE_LIMIT, LOST, UNSETTLED = 0, 1, 2, 3, 4, 5
NO_PIECE, LID, SIDE, LINE, ARC, BEZIER = 0, 1, 2, 3, 4, 5
# The first-order estimate of the width is trusted to this share.
WIDTH_MARGIN = 1.0 + 2.0**-20
# Where the accumulated rounding exceeds this share of the cell, nothing is settled.
LARGEST_ERROR = 2.0**-50
# Shorter runs are followed hit by hit, so that they check those of `compiled/runs`; of a longer one the last hits are.
LONGEST_FOLLOWED, LAST_HITS = 4096.0, 4.0

_compile = njit(cache=True, nogil=True, error_model="numpy")


@_compile
def crossings(joints, lines, pairs, index, other, py, vx, vy, most):
    """Hits, an even number, between a vertical side and one that faces it; the way along y, and the flight time."""
    way, flight = (0.0, 0.0), 0.0
    if joints[index, JOINT_X] != joints[index + 1, JOINT_X] or joints[other, JOINT_X] != joints[other + 1, JOINT_X]:
        return 0, way, flight
    for row in range(int(lines[index, FIRST_PAIR]), int(lines[index, PAIRS_END])):
        if pairs[row, PARTNER] == other:
            gap = two_sum(joints[other, JOINT_X], -joints[index, JOINT_X])
            time = divide(gap, vx)
            step = multiply(time, vy)
            low, high = min(pairs[row, NEAR_Y], pairs[row, FAR_Y]), max(pairs[row, NEAR_Y], pairs[row, FAR_Y])
            room = high - py[0] if step[0] > 0.0 else py[0] - low
            count = room / abs(step[0]) - LAST_HITS if step[0] != 0.0 else 0.0
            if count > LONGEST_FOLLOWED and count < most and time[0] > 0.0:
                hits = 2 * np.int64(0.5 * count)
                # beyond 2^53 there is no such double, and no double-double knows the ray's place
                return hits, multiply((float(hits), 0.0), step), float(hits) * time[0]
    return 0, way, flight


@_compile
def free_cells(bands, py, vx, vy, cell, width, spread):
    """How many cells a ray that enters one passes without coming near a piece, and the way along y in each.

    ``bands`` are the heights (low, high) at which no piece lies. The ray's width is at most ``width`` plus ``spread``
    times the flight. The last cells before the end of a band are left over.
    """
    if vx[0] == 0.0 or vy[0] == 0.0:
        return 0.0, (0.0, 0.0)
    for row in range(bands.shape[0]):
        low, high = bands[row, BAND_LOW], bands[row, BAND_HIGH]
        if low < py[0] < high:
            behind, room = py[0] - low, min(high, 0.0) - py[0]
            if vy[0] < 0.0:
                behind, room = high - py[0], py[0] - low
            margin = width + spread * room / abs(vy[0])
            cells = math.floor((room - margin) * abs(vx[0] / vy[0]) / cell - LAST_HITS)
            # beyond 2^53 not all whole numbers are doubles
            if behind > margin and 0.0 < cells < 2.0**53:
                return cells, multiply((cell, 0.0), divide(vy, vx if vx[0] > 0.0 else negate(vx)))
    return 0.0, (0.0, 0.0)


@_compile
def earlier(t, time):
    """Whether t < time, which may be (inf, 0): differences of infinities are not numbers."""
    return t[0] < np.inf and (time[0] == np.inf or subtract(t, time)[0] < 0.0)


@_compile
def meets(
    t, height, joints, arcs, beziers, own_kind, own_index, own_s, kind, index, s, px, py, vx, vy, flown, slack, error
):  # fmt: skip
    """Whether a ray meets a piece after the time t; ``height`` is that of its start in front of the piece.

    Within the slack of double precision the pieces' own places decide, so that both tracers go the same way.
    """
    if height > slack or own_kind in (LID, SIDE):
        return height >= -error
    if height < -slack:
        return False
    return in_front(
        joints,
        own_kind, own_index, arcs[own_index if own_kind == ARC else 0], beziers[own_index if own_kind == BEZIER else 0],
        own_s,
        kind, index, arcs[index if kind == ARC else 0], beziers[index if kind == BEZIER else 0], s,
        px, py, vx[0], vy[0], flown, slack, error,
    )  # fmt: skip


@_compile
def is_beside(joints, index, corner):
    """Whether a corner lies on a line or on its free side: a ray that meets the line does not meet one behind it."""
    x0, y0, x1, y1 = line_ends(joints, index)
    return orientation(x0, y0, x1, y1, joints[corner, JOINT_X], joints[corner, JOINT_Y]) >= 0.0


@_compile
def refined_ray(
    place, theta, hollow, joints, lines, pairs, arcs, first_ellipse, beziers, bands, is_open, cell, limit, most_flights
):  # fmt: skip
    """Follow one ray; returns x and angle (double-doubles), bounces, status, amplification and rounding error.

    ``place`` is a double-double in the hollow, ``arcs`` holds the circles, then the ellipses, of `refined_arcs`, and
    ``bands`` are those of `free_cells`.
    The amplification is the norm of the map's derivative in the units (cell, radian).
    """
    left, right = hollow[LEFT], hollow[RIGHT]
    joint_low, joint_high = int(hollow[FIRST_JOINT]), int(hollow[JOINTS_END])
    circle_low, circle_high = int(hollow[FIRST_CIRCLE]), int(hollow[CIRCLES_END])
    ellipse_low, ellipse_high = first_ellipse + int(hollow[FIRST_ELLIPSE]), first_ellipse + int(hollow[ELLIPSES_END])
    bezier_low, bezier_high = int(hollow[FIRST_BEZIER]), int(hollow[BEZIERS_END])
    scale = cell + hollow[SIZE]
    slack = JOINT_ULPS * EPS * hollow[SIZE]
    px, py = place, (0.0, 0.0)
    sine, cosine = sine_cosine(theta)
    vx, vy = negate(cosine), negate(sine)
    # Jacobi fields of a displacement (j1, a1) and of a turn (j2, a2); displacements as shares of the scale
    j1, a1, j2, a2 = 1.0, 0.0, 0.0, 1.0
    _, exponent = math.frexp(theta)
    half_ulp = math.ldexp(1.0, exponent - 54)
    norm = 1.0
    # the sum of M M^T, with entries for displacement and turn, and how many errors there are
    c_jj, c_ja, c_aa, errors = 1.0, 0.0, 1.0, 1.0
    wraps, bounces, steps = 0, 0, 0
    own_kind, own_index, own_s, flown = LID, -1, (-1.0, 0.0), 0.0
    while True:
        # bound on the transversal error of the ray: on the segment, at a distance of up to one scale
        local = LOCAL_ERROR * math.sqrt(errors * (c_jj + c_aa))
        if not local <= LARGEST_ERROR:
            return px, (0.0, 0.0), bounces, UNSETTLED, norm, local
        error = 2.0 * scale * local
        kind, index, hit_s, edge_share = NO_PIECE, -1, (0.0, 0.0), (0.0, 0.0)
        time = (np.inf, 0.0)
        corner_time, graze_time = np.inf, np.inf

        before = (0.0, 0.0)
        for j in range(joint_low, joint_high):
            dx, dy = subtract(wide(joints[j, JOINT_X]), px), subtract(wide(joints[j, JOINT_Y]), py)
            after = cross(dx, dy, vx, vy)
            if joints[j, IS_CORNER] > 0.0:
                ahead = dot(dx, dy, vx, vy)[0]
                width = WIDTH_MARGIN * half_ulp * abs(scale * j2 + ahead * a2) + (1.0 + ahead / scale) * error
                if abs(after[0]) <= width and 0.0 < ahead < corner_time:
                    corner_time = ahead
            starts_here = j > joint_low and joints[j - 1, STARTS_LINE] > 0.0
            if starts_here and before[0] >= 0.0 >= after[0] and before[0] > after[0]:
                if own_kind != LINE or own_index != j - 1:
                    share = divide(before, subtract(before, after))
                    hx = two_sum(joints[j, JOINT_X], -joints[j - 1, JOINT_X])
                    hy = two_sum(joints[j, JOINT_Y], -joints[j - 1, JOINT_Y])
                    dx = subtract(add(wide(joints[j - 1, JOINT_X]), multiply(share, hx)), px)
                    dy = subtract(add(wide(joints[j - 1, JOINT_Y]), multiply(share, hy)), py)
                    t = dot(dx, dy, vx, vy)
                    height = t[0] * (before[0] - after[0]) / lines[j - 1, LENGTH]
                    if earlier(t, time) and meets(
                        t, height, joints, arcs, beziers, own_kind, own_index, own_s, LINE, j - 1, own_s,
                        px, py, vx, vy, flown, slack, error,
                    ):  # fmt: skip
                        time, kind, index, edge_share = t, LINE, j - 1, share
            before = after

        for table in range(2):
            low, high = (circle_low, circle_high) if table == 0 else (ellipse_low, ellipse_high)
            for k in range(low, high):
                widest = max(1.0, arcs[k, WIDE_STRETCH])
                t, undecided, height = arc_hit(arcs[k], own_kind == ARC and own_index == k, px, py, vx, vy, error)
                graze_time = min(graze_time, undecided)
                if earlier(t, time) and meets(
                    t, height, joints, arcs, beziers, own_kind, own_index, own_s, ARC, k, own_s,
                    px, py, vx, vy, flown, slack * widest, error * widest,
                ):  # fmt: skip
                    time, kind, index = t, ARC, k
        for k in range(bezier_low, bezier_high):
            start_s = own_s if own_kind == BEZIER and own_index == k else (-1.0, 0.0)
            t, s, undecided, near_s = bezier_hit(beziers[k], start_s, px, py, vx, vy, slack, error)
            graze_time = min(graze_time, undecided)
            if earlier(t, time):
                time, kind, index, hit_s = t, BEZIER, k, s
            if near_s[0] >= 0.0 and meets(
                (0.0, 0.0), 0.0, joints, arcs, beziers, own_kind, own_index, own_s, BEZIER, k, near_s,
                px, py, vx, vy, flown, slack, error,
            ):  # fmt: skip
                time, kind, index, hit_s = (0.0, 0.0), BEZIER, k, near_s

        # a piece that lies in the opening or in a side within rounding is met before them
        if vy[0] > 0.0 and own_kind != LID and py[0] + time[0] * vy[0] > slack:
            t = divide(negate(py), vy)
            inside = is_open
            if not is_open:
                c_right = add(multiply(subtract(wide(right), px), vy), multiply(py, vx))
                c_left = add(multiply(subtract(wide(left), px), vy), multiply(py, vx))
                inside = c_right[0] >= 0.0 >= c_left[0]
            if inside:
                time, kind = t, LID
        if is_open and vx[0] != 0.0:
            t = divide(subtract(wide(right if vx[0] > 0.0 else left), px), vx)
            beyond = abs(vx[0]) * (time[0] - t[0])
            if beyond > slack or (kind == LID and earlier(t, time)):
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
            ex = two_sum(joints[index + 1, JOINT_X], -joints[index, JOINT_X])
            ey = two_sum(joints[index + 1, JOINT_Y], -joints[index, JOINT_Y])
            size = square_root(dot(ex, ey, ex, ey))
            nx, ny = negate(divide(ey, size)), divide(ex, size)
            qx = add(wide(joints[index, JOINT_X]), multiply(edge_share, ex))
            qy = add(wide(joints[index, JOINT_Y]), multiply(edge_share, ey))
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
        for j in range(joint_low, joint_high if corner_time < np.inf else joint_low):
            if joints[j, IS_CORNER] > 0.0:
                dx, dy = subtract(wide(joints[j, JOINT_X]), px), subtract(wide(joints[j, JOINT_Y]), py)
                ahead = dot(dx, dy, vx, vy)[0]
                width = WIDTH_MARGIN * half_ulp * abs(scale * j2 + ahead * a2) + (1.0 + ahead / scale) * error
                met = 0.0 < ahead and (ahead - time[0]) * incidence <= 2.0 * width
                if met and abs(cross(dx, dy, vx, vy)[0]) <= width:
                    if kind != LINE or is_beside(joints, index, j):
                        return px, (0.0, 0.0), bounces, CORNER, norm, local
        flight = time[0] / scale
        j1 += flight * a1
        j2 += flight * a2
        c_jj += flight * (2.0 * c_ja + flight * c_aa)
        c_ja += flight * c_aa
        if kind == LID:
            x = add(qx, two_product(float(wraps), right - left))
            norm = math.sqrt(j1 * j1 + a1 * a1 + j2 * j2 + a2 * a2)
            return x, direction_angle(vx, vy), bounces, ESCAPED, norm, local
        if (bounces >= limit and kind != SIDE) or steps >= most_flights:
            return px, (0.0, 0.0), bounces, BOUNCE_LIMIT, norm, local
        if kind == SIDE:
            # the ends of the wall are one point of it, and a ray passes a side above them
            end = wide(joints[joint_low, JOINT_Y])
            py = end if subtract(qy, end)[0] < 0.0 else qy
            px = wide(left if vx[0] > 0.0 else right)
            spread = WIDTH_MARGIN * half_ulp * abs(a2) + error / scale
            cells, step = free_cells(bands, py, vx, vy, cell, WIDTH_MARGIN * half_ulp * scale * abs(j2) + error, spread)
            py = add(py, multiply((cells, 0.0), step))
            wraps += (1 if vx[0] > 0.0 else -1) * (1 + np.int64(cells))
            flight = cells * cell / abs(vx[0]) / scale
            j1 += flight * a1
            j2 += flight * a2
            c_jj += flight * (2.0 * c_ja + flight * c_aa)
            c_ja += flight * c_aa
        else:
            flown = time[0]
            px, py = qx, qy
            twice = (2.0 * approach[0], 2.0 * approach[1])
            vx, vy = subtract(vx, multiply(twice, nx)), subtract(vy, multiply(twice, ny))
            speed2 = dot(vx, vy, vx, vy)
            factor = subtract((1.5, 0.0), (0.5 * speed2[0], 0.5 * speed2[1]))
            vx, vy = multiply(factor, vx), multiply(factor, vy)
            if incidence == 0.0:
                return px, (0.0, 0.0), bounces, GRAZING, norm, local
            power = 2.0 * bent * scale / incidence
            a1 -= power * j1
            a2 -= power * j2
            c_aa += power * (power * c_jj - 2.0 * c_ja)
            c_ja -= power * c_jj
            bounces += 1
            if kind == LINE and own_kind == LINE:
                hits, way, flight = crossings(joints, lines, pairs, index, own_index, py, vx, vy, limit - bounces)
                bounces += hits
                py = add(py, way)
                flight /= scale
                j1 += flight * a1
                j2 += flight * a2
                c_jj += flight * (2.0 * c_ja + flight * c_aa)
                c_ja += flight * c_aa
        norm = math.sqrt(j1 * j1 + a1 * a1 + j2 * j2 + a2 * a2)
        c_jj, c_aa, errors = c_jj + 1.0, c_aa + 1.0, errors + 1.0
        own_kind, own_index, own_s = kind, index, hit_s if kind == BEZIER else (-1.0, 0.0)


@_compile
def refined_rays(
    x, theta, hollows, joints, lines, pairs, arcs, first_ellipse, beziers, bands, is_open, cell, limit, most_flights,
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
            if subtract(place, wide(hollows[middle, LEFT]))[0] >= 0.0:
                low = middle + 1
            else:
                high = middle
        h = low - 1
        amplification[i], rounding[i] = 1.0, LOCAL_ERROR
        at_left = h >= 0 and subtract(place, wide(hollows[h, LEFT]))[0] == 0.0 and hollows[h, LEFT_EDGE] != NO_EDGE
        to_right = subtract(place, wide(hollows[h, RIGHT]))[0] if h >= 0 else 1.0
        if h < 0 or to_right >= 0.0 or at_left:
            edge = (at_left and hollows[h, LEFT_EDGE] == CORNER_EDGE) or (
                h >= 0 and to_right == 0.0 and hollows[h, RIGHT_EDGE] == CORNER_EDGE
            )
            out_x[i, HIGH], out_x[i, LOW] = x[i], 0.0
            mirrored = two_sum(math.pi, -theta[i])
            mirrored = add(mirrored, (1.2246467991473532e-16, 0.0))
            out_theta[i, HIGH], out_theta[i, LOW] = mirrored
            bounces[i], status[i] = 1, ESCAPED
            if edge:
                out_theta[i, HIGH], bounces[i], status[i] = theta[i] - math.pi, 0, CORNER
            continue
        end, angle, bounces[i], status[i], amplification[i], rounding[i] = refined_ray(
            place, theta[i], hollows[h], joints, lines, pairs, arcs, first_ellipse, beziers, bands, is_open, cell,
            limit, most_flights,
        )  # fmt: skip
        end = add(base, end)
        out_x[i, HIGH], out_x[i, LOW] = end
        out_theta[i, HIGH], out_theta[i, LOW] = angle
