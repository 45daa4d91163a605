"""The compiled loop of the planar tracer: the hollow that a ray enters, and its flights to the exit.

Every optional table is an array or ``None``; numba compiles one version for each combination that occurs, and the
branches of absent primitives are pruned from it. Layout of the tables: `scene/scene`.

The formulas are stable by themselves; there is no epsilon that decides which piece is hit:

* The side of a ray on which a joint V lies is the sign of c = (V - p) x v. A segment is hit from its free side exactly
  if c goes from >= 0 at its start to <= 0 at its end. Neighbours share the number c, so that no ray slips between them.
* Arcs and Bezier pieces: see `arcs` and `beziers`.
* A piece within rounding of the ray's start is hit only if the start lies in front of it by the exact joints, see
  `double_double/sides`: not the other face of a plate without thickness, nor the other side of a sharp peak.
* The hit point is put back on its piece, and the velocity is renormalised, once a bounce.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ....core.rounding import EPS
from ...scene.columns import (
    BEZIERS_END,
    CELL_HEIGHT,
    CELL_WIDTH,
    CIRCLES_END,
    CORNER_EDGE,
    EDGE_X,
    EDGE_Y,
    ELLIPSES_END,
    END_CORNER,
    END_X,
    END_Y,
    FIRST_BEZIER,
    FIRST_CIRCLE,
    FIRST_ELLIPSE,
    FIRST_JOINT,
    FIRST_PAIR,
    GRID_COLUMNS,
    GRID_ROWS,
    GRID_START,
    GRID_X,
    GRID_Y,
    IS_CORNER,
    JOINT_X,
    JOINT_Y,
    JOINTS_END,
    LEFT,
    LEFT_EDGE,
    LENGTH,
    LINE_NORMAL_X,
    LINE_NORMAL_Y,
    NO_EDGE,
    PAIRS_END,
    PARTNER,
    POINT_X,
    POINT_Y,
    RIGHT,
    RIGHT_EDGE,
    RUN_SINE,
    SIZE,
    START_CORNER,
    START_X,
    START_Y,
    STARTS_LINE,
    STRETCH,
    X1,
    X2,
    X3,
    Y1,
    Y2,
    Y3,
)
from ...scene.tolerances import JOINT_ULPS, NEARBY
from .arcs import arc_incidence, arc_reflect, arc_time, on_arc
from .beziers import bend_number, bezier_hit, bezier_value
from .interruption import is_raised
from .nearby import BEZIER, CIRCLE, DOUBTFUL, ELLIPSE, LEAST_SHARE, LID, LINE, NO_PIECE, SIDE, hit_nearby, line_time
from .runs import skip_crossings, skip_hops
from .trigonometry import LAST_ANGLE, direction_angle, mirrored, sine_cosine

# In place of a hollow's number: a flat top, and an end of one that is a corner.
FLAT_TOP, TOP_CORNER = -1, -2
_compile = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
ESCAPED, CORNER, GRAZING, BOUNCE_LIMIT = 0, 1, 2, 3
# Flights followed one by one before a ray is given up: 20 to 100 ms. Hits in a run cost one flight together.
MOST_STEPS = 1_000_000
# An odd number without pattern, so that itineraries of the same pieces in another order differ.
HASH_FACTOR = np.uint64(0x9E3779B97F4A7C15)
# Far beyond the numbers of the pieces.
BEND_SHIFT = 40


@_compile
def last_hollow(place, hollows):
    """Number of the last hollow whose left end is not beyond a place of the cell, -1 where there is none."""
    low, high = 0, hollows.shape[0]
    while low < high:
        middle = (low + high) // 2
        if hollows[middle, LEFT] <= place:
            low = middle + 1
        else:
            high = middle
    return low - 1


@_compile
def opening_at(place, hollows):
    """Number of the hollow that opens at a place of the cell, or `FLAT_TOP`, or `TOP_CORNER`."""
    h = last_hollow(place, hollows)
    if h < 0 or place >= hollows[h, RIGHT] or (place == hollows[h, LEFT] and hollows[h, LEFT_EDGE] != NO_EDGE):
        # a flat top, or an edge of it; the edges between two hollows are corners
        edge = h >= 0 and (
            (place == hollows[h, LEFT] and hollows[h, LEFT_EDGE] == CORNER_EDGE)
            or (place == hollows[h, RIGHT] and hollows[h, RIGHT_EDGE] == CORNER_EDGE)
        )
        return TOP_CORNER if edge else FLAT_TOP
    return h


@_compile
def corner_ahead(dx, dy, vx, vy, slack, bounces):
    """Time to a joint within rounding of the ray's line, or inf where it is behind."""
    ahead = dx * vx + dy * vy
    # the corners of the opening are left behind for certain, however shallow the ray comes
    return ahead if (bounces > 0 or dy != 0.0) and ahead > slack else np.inf


@_compile
def near_end(curve, px, py, slack):
    """Whether a hit of a curve is within rounding of an end that is a corner."""
    x, y = px - curve[START_X], py - curve[START_Y]
    if curve[START_CORNER] > 0.0 and x * x + y * y <= slack * slack:
        return True
    x, y = px - curve[END_X], py - curve[END_Y]
    return curve[END_CORNER] > 0.0 and x * x + y * y <= slack * slack


@_compile
def walk(grid, hollow, joints, lines, own, px, py, vx, vy, slack, close, bounces, time):
    """Follow a ray through the cells of the grid to its first line before ``time``.

    Returns the flight time (inf if none), the line, the share of it, the time to the first corner on the way that is
    met within rounding, and whether lines are nearby (see `nearby`). Lines are listed in every cell that they
    nearly touch, so the walk's own rounding leaves
    out no line that the ray can meet; the signs at the joints are the same numbers in every cell.
    """
    columns, rows, base = int(hollow[GRID_COLUMNS]), int(hollow[GRID_ROWS]), int(hollow[GRID_START])
    x, y = (px - hollow[GRID_X]) / hollow[CELL_WIDTH], (py - hollow[GRID_Y]) / hollow[CELL_HEIGHT]
    column, row = min(max(int(x), 0), columns - 1), min(max(int(y), 0), rows - 1)
    right, up = 1 if vx > 0.0 else -1, 1 if vy > 0.0 else -1
    step_x = hollow[CELL_WIDTH] / abs(vx) if vx != 0.0 else np.inf
    step_y = hollow[CELL_HEIGHT] / abs(vy) if vy != 0.0 else np.inf
    leave_x = ((column + 1 if vx > 0.0 else column) - x) * (hollow[CELL_WIDTH] / vx) if vx != 0.0 else np.inf
    leave_y = ((row + 1 if vy > 0.0 else row) - y) * (hollow[CELL_HEIGHT] / vy) if vy != 0.0 else np.inf
    best, found, best_share = np.inf, -1, 0.0
    corner_time, nearby = np.inf, False
    while True:
        cell = base + row * columns + column
        for entry in range(grid[cell], grid[cell + 1]):
            j = grid[entry]
            dx, dy = joints[j, JOINT_X] - px, joints[j, JOINT_Y] - py
            c_before = dx * vy - dy * vx
            if abs(c_before) <= slack and joints[j, IS_CORNER] > 0.0:
                corner_time = min(corner_time, corner_ahead(dx, dy, vx, vy, slack, bounces))
            if joints[j, STARTS_LINE] <= 0.0:
                # a joint between curves, listed for its corner
                continue
            dx, dy = joints[j + 1, JOINT_X] - px, joints[j + 1, JOINT_Y] - py
            c_after = dx * vy - dy * vx
            if abs(c_after) <= slack and joints[j + 1, IS_CORNER] > 0.0:
                corner_time = min(corner_time, corner_ahead(dx, dy, vx, vy, slack, bounces))
            if c_before >= 0.0 >= c_after and c_before > c_after and j != own:
                t, share = line_time(joints, lines, j, c_before, c_after, px, py, vx, vy)
                # of two lines at one distance the first in the order of the wall is hit, as without a grid
                if t > close:
                    if t < best or (t == best and j < found):
                        best, found, best_share = t, j, share
                elif t >= -close:
                    nearby = True
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
    return best, found, best_share, corner_time, nearby


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
    left, right, size = hollow[LEFT], hollow[RIGHT], hollow[SIZE]
    joint_low, joint_high = int(hollow[FIRST_JOINT]), int(hollow[JOINTS_END])
    circle_low, circle_high = int(hollow[FIRST_CIRCLE]), int(hollow[CIRCLES_END])
    ellipse_low, ellipse_high = int(hollow[FIRST_ELLIPSE]), int(hollow[ELLIPSES_END])
    bezier_low, bezier_high = int(hollow[FIRST_BEZIER]), int(hollow[BEZIERS_END])
    slack, close = JOINT_ULPS * EPS * size, NEARBY * size
    sine, cosine = sine_cosine(theta)
    px, py, vx, vy = x, 0.0, -cosine, -sine
    shift = 0.0
    bounces, steps = 0, 0
    own_kind, own_index, own_s, flown = LID, -1, -1.0, 0.0
    third = -1
    if path is not None:
        path[0, POINT_X], path[0, POINT_Y] = px, py
    if itinerary is not None:
        itinerary[0] = np.uint64(0)
    while True:
        kind, index, hit_s, tangent = NO_PIECE, -1, 0.0, 0
        time = np.inf
        corner_time = np.inf
        nearby = False

        if circles is not None:
            for k in range(circle_low, circle_high):
                own = own_kind == CIRCLE and own_index == k
                t, touch, _ = arc_time(circles[k], own, px, py, vx, vy, 1.0)
                if abs(t) <= close and not own:
                    nearby = True
                elif 0.0 <= t < time:
                    if on_arc(circles[k], px + t * vx - circles[k, START_X], py + t * vy - circles[k, START_Y], slack):
                        time, kind, index, tangent = t, CIRCLE, k, touch
        if ellipses is not None:
            for k in range(ellipse_low, ellipse_high):
                own = own_kind == ELLIPSE and own_index == k
                stretch = ellipses[k, STRETCH]
                t, touch, _ = arc_time(ellipses[k], own, px, py, vx, vy, stretch)
                if abs(t) <= close and not own:
                    nearby = True
                elif 0.0 <= t < time:
                    qx, qy = px + t * vx - ellipses[k, START_X], stretch * (py + t * vy - ellipses[k, START_Y])
                    if on_arc(ellipses[k], qx, qy, slack * max(1.0, stretch)):
                        time, kind, index, tangent = t, ELLIPSE, k, touch
        if beziers is not None:
            for k in range(bezier_low, bezier_high):
                start_s = own_s if own_kind == BEZIER and own_index == k else -1.0
                t, s, touch, near_s = bezier_hit(beziers[k], start_s, px, py, vx, vy, slack)
                if t < time:
                    time, kind, index, hit_s, tangent = t, BEZIER, k, s, touch
                nearby = nearby or near_s >= 0.0

        # segments, by the signs of the joints: of all of them, or of those in the cells that the ray passes
        walking = False
        if grid is not None:
            walking = hollow[GRID_COLUMNS] > 0.0
        if not walking:
            dx, dy = joints[joint_low, JOINT_X] - px, joints[joint_low, JOINT_Y] - py
            c_before = dx * vy - dy * vx
            if abs(c_before) <= slack and joints[joint_low, IS_CORNER] > 0.0:
                corner_time = min(corner_time, corner_ahead(dx, dy, vx, vy, slack, bounces))
            for j in range(joint_low + 1, joint_high):
                dx, dy = joints[j, JOINT_X] - px, joints[j, JOINT_Y] - py
                c_after = dx * vy - dy * vx
                if abs(c_after) <= slack and joints[j, IS_CORNER] > 0.0:
                    corner_time = min(corner_time, corner_ahead(dx, dy, vx, vy, slack, bounces))
                if lines is not None:
                    if c_before >= 0.0 >= c_after and c_before > c_after and joints[j - 1, STARTS_LINE] > 0.0:
                        if own_kind != LINE or own_index != j - 1:
                            t, share = line_time(joints, lines, j - 1, c_before, c_after, px, py, vx, vy)
                            if t > close:
                                if t < time:
                                    time, kind, index, hit_s, tangent = t, LINE, j - 1, share, 0
                            elif t >= -close:
                                nearby = True
                c_before = c_after
        if grid is not None and walking:
            own = own_index if own_kind == LINE else -1
            t, index_there, share, ahead, near = walk(
                grid, hollow, joints, lines, own, px, py, vx, vy, slack, close, bounces, time
            )
            nearby = nearby or near
            corner_time = min(corner_time, ahead)
            if t < time:
                time, kind, index, hit_s, tangent = t, LINE, index_there, share, 0

        if nearby:
            t, near_kind, near_index, near_s, touch = hit_nearby(
                hollow, joints, lines, circles, ellipses, beziers,
                own_kind, own_index, own_s, px, py, vx, vy, flown, slack, close,
            )  # fmt: skip
            if t < time:
                if touch == DOUBTFUL:
                    return shift + px, vx, vy, bounces, CORNER
                time, kind, index, hit_s, tangent = t, near_kind, near_index, near_s, touch

        # the opening, an edge from right to left, and the sides of an open wall, unless a piece is met before; one that
        # lies in the opening or in a side within rounding is
        if vy > 0.0:
            c_right, c_left = (right - px) * vy + py * vx, (left - px) * vy + py * vx
            t = max(-py / vy, 0.0)
            if (c_right >= 0.0 >= c_left or period is not None) and own_kind != LID and (time - t) * vy > slack:
                time, kind = t, LID
        if period is not None:
            if vx != 0.0:
                t = ((right if vx > 0.0 else left) - px) / vx
                if t < time and (kind == LID or (time - t) * abs(vx) > slack):
                    time, kind = max(t, 0.0), SIDE

        steps += 1
        if kind == NO_PIECE or corner_time <= time + slack:
            return shift + px, vx, vy, bounces, CORNER
        if corner_time < np.inf:
            # at a shallow incidence a corner that the ray meets within the slack lies far beyond the hit
            sine = abs(vy)
            if lines is not None and kind == LINE:
                sine = abs(vx * lines[index, LINE_NORMAL_X] + vy * lines[index, LINE_NORMAL_Y])
            if circles is not None and kind == CIRCLE:
                sine = arc_incidence(circles[index], time, px, py, vx, vy, 1.0)
            if ellipses is not None and kind == ELLIPSE:
                sine = arc_incidence(ellipses[index], time, px, py, vx, vy, ellipses[index, STRETCH])
            if kind != BEZIER and kind != SIDE and (corner_time - time) * sine <= 2.0 * slack:
                return shift + px, vx, vy, bounces, CORNER
        if kind == LID:
            if path is not None:
                path[bounces + 1, POINT_X], path[bounces + 1, POINT_Y] = shift + px + time * vx, 0.0
            return shift + px + time * vx, vx, vy, bounces, ESCAPED
        if tangent != 0:
            return shift + px, vx, vy, bounces, GRAZING
        if (bounces >= limit and kind != SIDE) or steps > MOST_STEPS:
            return shift + px, vx, vy, bounces, BOUNCE_LIMIT
        if itinerary is not None:
            side = 1 if kind == SIDE and vx > 0.0 else 0
            number = 8 * (index + 1 + side) + kind
            if beziers is not None and kind == BEZIER:
                number += bend_number(beziers[index], hit_s) << BEND_SHIFT
            itinerary[0] = HASH_FACTOR * itinerary[0] + np.uint64(number)
        if period is not None:
            if kind == SIDE:
                # the ends of the wall are one point of it, and a ray passes a side above them
                py = max(py + time * vy, joints[joint_low, JOINT_Y])
                px = left if vx > 0.0 else right
                shift += (right - left) if vx > 0.0 else (left - right)
                own_kind, own_index, own_s = SIDE, -1, -1.0
                third = -1
                continue
        flown = time

        if lines is not None and kind == LINE:
            near = index if hit_s >= 0.0 else index + 1
            px = joints[near, JOINT_X] + hit_s * lines[index, EDGE_X]
            py = joints[near, JOINT_Y] + hit_s * lines[index, EDGE_Y]
            # a first hit below an end of the opening is as exact as the ray, at the smallest distance from that corner
            room = LEAST_SHARE * lines[index, LENGTH] if bounces == 0 and joints[near, JOINT_Y] == 0.0 else slack
            if abs(hit_s) * lines[index, LENGTH] <= room and joints[near, IS_CORNER] > 0.0:
                return shift + px, vx, vy, bounces, CORNER
            w = 2.0 * (vx * lines[index, LINE_NORMAL_X] + vy * lines[index, LINE_NORMAL_Y])
            vx -= w * lines[index, LINE_NORMAL_X]
            vy -= w * lines[index, LINE_NORMAL_Y]
            if pairs is not None:
                # the ray came from this line, to that one, and back
                if third == index and own_kind == LINE and path is None and lines[index, PAIRS_END] > 0.0:
                    for row in range(int(lines[index, FIRST_PAIR]), int(lines[index, PAIRS_END])):
                        if pairs[row, PARTNER] == own_index:
                            px, py, vx, vy, hits = skip_crossings(
                                pairs[row],
                                lines[index, LINE_NORMAL_X],
                                lines[index, LINE_NORMAL_Y],
                                px,
                                py,
                                vx,
                                vy,
                                slack,
                                limit - bounces - 1,
                            )
                            bounces += hits
                            if itinerary is not None:
                                itinerary[0] = HASH_FACTOR * itinerary[0] + np.uint64(hits)
        if circles is not None and kind == CIRCLE:
            px, py, nvx, nvy = arc_reflect(circles[index], time, px, py, vx, vy, 1.0)
            if near_end(circles[index], px, py, slack):
                return shift + px, vx, vy, bounces, CORNER
            vx, vy = nvx, nvy
            if circles[index, RUN_SINE] > 0.0 and path is None:
                px, py, vx, vy, hops = skip_hops(circles[index], px, py, vx, vy, limit - bounces - 1)
                bounces += hops
                if itinerary is not None:
                    itinerary[0] = HASH_FACTOR * itinerary[0] + np.uint64(hops)
        if ellipses is not None and kind == ELLIPSE:
            px, py, nvx, nvy = arc_reflect(ellipses[index], time, px, py, vx, vy, ellipses[index, STRETCH])
            if near_end(ellipses[index], px, py, slack):
                return shift + px, vx, vy, bounces, CORNER
            vx, vy = nvx, nvy
        if beziers is not None and kind == BEZIER:
            curve = beziers[index]
            px = bezier_value(curve[START_X], curve[X1], curve[X2], curve[X3], hit_s)
            py = bezier_value(curve[START_Y], curve[Y1], curve[Y2], curve[Y3], hit_s)
            if near_end(curve, px, py, slack):
                return shift + px, vx, vy, bounces, CORNER
            tx = (3.0 * curve[X3] * hit_s + 2.0 * curve[X2]) * hit_s + curve[X1]
            ty = (3.0 * curve[Y3] * hit_s + 2.0 * curve[Y2]) * hit_s + curve[Y1]
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
            path[bounces, POINT_X], path[bounces, POINT_Y] = px + shift, py


@_compile
def trace_rays(
    x, theta, hollows, joints, lines, circles, ellipses, beziers, pairs, grid, period, cell, limit, stop,
    out_x, out_theta, bounces, status,
):  # fmt: skip
    """Trace a block of rays; fills the four output arrays, as far as it comes before ``stop`` is raised."""
    for i in range(x.shape[0]):
        if is_raised(stop):
            break
        base = math.floor(x[i] / cell) * cell
        place = x[i] - base
        h = opening_at(place, hollows)
        if h == FLAT_TOP:
            out_x[i], out_theta[i], bounces[i], status[i] = x[i], mirrored(theta[i]), 1, ESCAPED
            continue
        if h == TOP_CORNER:
            out_x[i], out_theta[i], bounces[i], status[i] = x[i], theta[i] - math.pi, 0, CORNER
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
        angle = direction_angle(vx, vy)
        out_theta[i] = min(angle, LAST_ANGLE) if status[i] == ESCAPED else angle
