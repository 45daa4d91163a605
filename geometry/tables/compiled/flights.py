"""The flight of a point to the walls of a table: times of arrival, the first wall, and what becomes of it. Loads numba.

A wall is a row of the table ``walls``. The wall of a curve without a row is given: Python computes the time.
"""

from __future__ import annotations

import math

from ....core.compilation import jit
from ....core.rounding import EPS
from ...curves import columns as c
from ...curves.arc import AHEAD, FULL_CIRCLE, TANGENT
from ...curves.bezier import GRAZE

# The values of `FlightStatus`.
FLYING, CORNER, GRAZING, FREE = 0, 1, 2, 3
# Distance from a corner, relative to the coordinates, up to which rounding decides which wall is met first.
CORNER_ROUNDING = 16.0 * EPS

compiled, linked = jit(_nrt=False), jit(_nrt=False, linked=True)


@linked
def arrival(walls, w, px, py, vx, vy, own, slack, turn):
    """-> float: the time at which a moving point reaches wall w from its left, or from its right if ``turn`` is -1.

    It is inf if it does not. ``own``: the point begins on the wall. Walls are longer by ``slack`` at both ends, and a
    point may be as far behind them. A point that is tangent to a wall flies on, except where it bends towards it.
    """
    kind = walls[w, c.WALL_KIND]
    if kind == c.ARC_WALL:
        return arc_arrival(walls, w, px, py, vx, vy, own, slack, turn)
    nx, ny = turn * walls[w, c.INNER_X], turn * walls[w, c.INNER_Y]
    dx, dy = px - walls[w, c.WALL_X], py - walls[w, c.WALL_Y]
    approach, distance = -(vx * nx + vy * ny), dx * nx + dy * ny
    if kind == c.GIVEN_WALL or own or not approach > 0.0:
        return math.inf
    time = max(distance, 0.0) / approach
    if kind == c.SEGMENT_WALL:
        at = turn * ((dx + vx * time) * ny - (dy + vy * time) * nx)
        if distance < -slack or at < -slack or at > walls[w, c.WALL_LENGTH] + slack:
            return math.inf
    return time if math.isfinite(time) else math.inf


@linked
def arc_arrival(walls, w, px, py, vx, vy, own, slack, turn):
    """-> float: `arrival` at an arc of an ellipse, in the coordinates in which it is a unit circle."""
    a, b = walls[w, c.SEMI_X], walls[w, c.SEMI_Y]
    px, py, vx, vy = (px - walls[w, c.WALL_X]) / a, (py - walls[w, c.WALL_Y]) / b, vx / a, vy / b
    square, along, across = vx * vx + vy * vy, px * vx + py * vy, abs(px * vy - py * vx)
    excess = 0.0 if own else px * px + py * py - 1.0
    speed, behind, tangent = math.sqrt(square), slack / min(a, b), False
    root = math.sqrt(max((speed - across) * (speed + across), 0.0))
    if walls[w, c.DIRECTION] * turn > 0.0:
        # the way out of the circle; from the circle itself C = 0
        if own:
            time, hit = -2.0 * along / square, True
        else:
            time = -excess / (along + root) if along > 0.0 else (root - along) / square
            # within rounding the path is tangent: it is reached unless it leaves the arc there
            tangent = abs(across - speed) <= TANGENT * speed * (1.0 + math.hypot(px, py))
            hit = (tangent or across < speed) and time * speed >= -behind
    else:
        time = excess / (root - along)
        hit = not own and along < 0.0 and across < speed and excess >= -behind
    if not hit or not math.isfinite(time):
        return math.inf
    time = max(time, 0.0)
    ahead = time + AHEAD / speed if tangent else time
    return time if is_within(walls, w, px + vx * ahead, py + vy * ahead, behind) else math.inf


@linked
def is_within(walls, w, x, y, slack):
    """-> bool: whether a point of the unit circle belongs to an arc."""
    span = walls[w, c.WALL_SPAN]
    if span + slack >= FULL_CIRCLE:
        return True
    swept = walls[w, c.DIRECTION] * (math.atan2(y, x) - walls[w, c.FIRST_ANGLE]) % FULL_CIRCLE
    return swept <= span + slack or swept >= FULL_CIRCLE - slack


@linked
def begins_along(walls, w, px, py, slack):
    """-> bool: whether a point is on a wall that bends towards the table, up to rounding, and not at its ends."""
    if walls[w, c.WALL_KIND] != c.ARC_WALL or walls[w, c.DIRECTION] < 0.0:
        return False
    a, b, size = walls[w, c.SEMI_X], walls[w, c.SEMI_Y], walls[w, c.WALL_SIZE] + max(abs(px), abs(py))
    ux, uy, near = (px - walls[w, c.WALL_X]) / a, (py - walls[w, c.WALL_Y]) / b, TANGENT * size
    if abs(math.hypot(ux, uy) - 1.0) * min(a, b) > near:
        return False
    room, is_whole = slack + CORNER_ROUNDING * size, walls[w, c.WALL_SPAN] + slack / min(a, b) >= FULL_CIRCLE
    inner = math.hypot(walls[w, c.FROM_X] - px, walls[w, c.FROM_Y] - py) > room
    inner = inner and math.hypot(walls[w, c.TO_X] - px, walls[w, c.TO_Y] - py) > room
    return is_whole or (inner and is_within(walls, w, ux, uy, near / min(a, b)))


@linked
def frame(walls, w, px, py):
    """-> (x, y, nx, ny): a point on wall w without its rounding error, and the unit normal into the table."""
    if walls[w, c.WALL_KIND] != c.ARC_WALL:
        return px, py, walls[w, c.INNER_X], walls[w, c.INNER_Y]
    a, b = walls[w, c.SEMI_X], walls[w, c.SEMI_Y]
    ux, uy = (px - walls[w, c.WALL_X]) / a, (py - walls[w, c.WALL_Y]) / b
    length = math.hypot(ux, uy)
    ux, uy = ux / length, uy / length
    nx, ny = -walls[w, c.DIRECTION] * b * ux, -walls[w, c.DIRECTION] * a * uy
    size = math.hypot(nx, ny)
    return walls[w, c.WALL_X] + a * ux, walls[w, c.WALL_Y] + b * uy, nx / size, ny / size


@linked
def next_wall(walls, count, corners, corner_count, slack, px, py, vx, vy, last, time, wall):
    """-> (time, wall, status): the first wall that a moving point meets before a ``time`` at which it meets a ``wall``.

    ``last`` is the wall on which it begins, or -1. The status is one of `FlightStatus`.
    """
    for w in range(count):
        own = w == last if last >= 0 else begins_along(walls, w, px, py, slack)
        t = arrival(walls, w, px, py, vx, vy, own, slack, 1.0)
        if t < time:
            time, wall = t, w
    if wall < 0:
        return time, wall, FREE
    x, y = px + vx * time, py + vy * time
    room = slack + CORNER_ROUNDING * max(abs(px), abs(py), abs(x), abs(y))
    for k in range(corner_count):
        if math.hypot(x - corners[k, c.POINT_X], y - corners[k, c.POINT_Y]) <= room:
            return time, wall, CORNER
    if walls[wall, c.WALL_KIND] == c.ARC_WALL and walls[wall, c.DIRECTION] > 0.0:
        _, _, nx, ny = frame(walls, wall, x, y)
        if vx * nx + vy * ny >= -GRAZE * math.hypot(vx, vy):
            return time, wall, GRAZING
    return time, wall, FLYING


@compiled
def arrivals(walls, position, velocity, own, slack, turn, times):
    """Fill ``times`` (n,) with the `arrival` of points (n, 2) at the only wall of a table."""
    for i in range(len(times)):
        px, py, vx, vy = position[i, c.POINT_X], position[i, c.POINT_Y], velocity[i, c.POINT_X], velocity[i, c.POINT_Y]
        times[i] = arrival(walls, 0, px, py, vx, vy, own[i], slack, turn)


@compiled
def next_walls(walls, corners, slack, position, velocity, last, time, wall, status):
    """Replace what is met (time, wall) by points (n, 2) with what they meet earlier, and fill the status."""
    for i in range(len(time)):
        px, py, vx, vy = position[i, c.POINT_X], position[i, c.POINT_Y], velocity[i, c.POINT_X], velocity[i, c.POINT_Y]
        time[i], wall[i], status[i] = next_wall(
            walls, len(walls), corners, len(corners), slack, px, py, vx, vy, last[i], time[i], wall[i]
        )
