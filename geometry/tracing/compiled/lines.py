"""The first hit of a ray on the lines of a hollow: compiled, inlined in `rays`. Loads numba.

The sign of c = (V - p) x v is the side of the ray on which a joint V lies. A line is hit from its free side exactly if
c goes from >= 0 at its start to <= 0 at its end. Neighbouring lines share the number c, so no ray passes between them.
"""

from __future__ import annotations

import numpy as np

from ...scene.columns import (
    CELL_HEIGHT,
    CELL_WIDTH,
    EDGE_X,
    EDGE_Y,
    GRID_COLUMNS,
    GRID_ROWS,
    GRID_START,
    GRID_X,
    GRID_Y,
    IS_CORNER,
    JOINT_X,
    JOINT_Y,
    STARTS_LINE,
)
from ...scene.tolerances import NEARBY_SLACKS
from .options import inlined
from .records import LINE

# Least absolute value of a fraction from a line's end, so that it is negative even if the ray meets that end.
LEAST_FRACTION = 5e-324


@inlined
def line_time(tables, j, sides, px, py, vx, vy):
    """-> (t, fraction): time to the line that starts at joint j, and the position on the line as a fraction.

    A negative fraction is relative to the line's end. ``sides`` are the numbers c of the line's joints.
    """
    joints, lines = tables.joints, tables.lines
    c_before, c_after = sides
    fraction = c_before / (c_before - c_after)
    near = j
    if fraction > 0.5:
        # relative to the nearer joint, for accuracy at both ends
        fraction = min(c_after / (c_before - c_after), -LEAST_FRACTION)
        near = j + 1
    hx = joints[near, JOINT_X] + fraction * lines[j, EDGE_X]
    hy = joints[near, JOINT_Y] + fraction * lines[j, EDGE_Y]
    return (hx - px) * vx + (hy - py) * vy, fraction


@inlined
def joint_side(joints, j, own, px, py, vx, vy, slack):
    """-> (c, t): the number c of joint j, and the time to the joint if it is a corner that the ray meets, else inf."""
    dx, dy = joints[j, JOINT_X] - px, joints[j, JOINT_Y] - py
    c = dx * vy - dy * vx
    if abs(c) <= slack and joints[j, IS_CORNER] > 0.0:
        ahead = dx * vx + dy * vy
        # at entry the corners of the opening are always behind the ray, at any angle
        if (own.bounces > 0 or dy != 0.0) and ahead > slack:
            return c, ahead
    return c, np.inf


@inlined
def nearest_line(scope, own, px, py, vx, vy, time):
    """-> (t, line, fraction, corner, nearby): the first line before ``time``, and the time to the first corner; or inf.

    ``nearby`` is true if a line is so close that rounding of the start may decide the hit; see `nearby`.
    """
    tables, slack = scope.tables, scope.slack
    joints = tables.joints
    close = NEARBY_SLACKS * slack
    best, found, best_fraction, nearby = np.inf, -1, 0.0, False
    first, end = scope.joints
    c_before, corner_time = joint_side(joints, first, own, px, py, vx, vy, slack)
    for j in range(first, end - 1):
        c_after, ahead = joint_side(joints, j + 1, own, px, py, vx, vy, slack)
        corner_time = min(corner_time, ahead)
        if c_before >= 0.0 >= c_after and c_before > c_after and joints[j, STARTS_LINE] > 0.0:
            is_own = own.kind == LINE and own.number == j
            if not is_own:
                t, fraction = line_time(tables, j, (c_before, c_after), px, py, vx, vy)
                if t > close:
                    if t < min(best, time):
                        best, found, best_fraction = t, j, fraction
                elif t >= -close:
                    nearby = True
        c_before = c_after
    return best, found, best_fraction, corner_time, nearby


@inlined
def nearest_line_in_grid(scope, own, px, py, vx, vy, time):
    """-> (t, line, fraction, corner, nearby) as `nearest_line`, from the lines in the grid cells along the ray.

    Every cell lists all lines within a margin, so rounding in the grid traversal misses no line that the ray can meet.
    The numbers c of the joints are the same in every cell.
    """
    tables, hollow, slack = scope.tables, scope.hollow, scope.slack
    joints, grid = tables.joints, tables.grid
    close = NEARBY_SLACKS * slack
    columns, rows, base = int(hollow[GRID_COLUMNS]), int(hollow[GRID_ROWS]), int(hollow[GRID_START])
    x, y = (px - hollow[GRID_X]) / hollow[CELL_WIDTH], (py - hollow[GRID_Y]) / hollow[CELL_HEIGHT]
    column, row = min(max(int(x), 0), columns - 1), min(max(int(y), 0), rows - 1)
    right, up = 1 if vx > 0.0 else -1, 1 if vy > 0.0 else -1
    step_x = hollow[CELL_WIDTH] / abs(vx) if vx != 0.0 else np.inf
    step_y = hollow[CELL_HEIGHT] / abs(vy) if vy != 0.0 else np.inf
    leave_x = ((column + 1 if vx > 0.0 else column) - x) * (hollow[CELL_WIDTH] / vx) if vx != 0.0 else np.inf
    leave_y = ((row + 1 if vy > 0.0 else row) - y) * (hollow[CELL_HEIGHT] / vy) if vy != 0.0 else np.inf
    best, found, best_fraction = np.inf, -1, 0.0
    corner_time, nearby = np.inf, False
    while True:
        cell = base + row * columns + column
        for entry in range(grid[cell], grid[cell + 1]):
            j = grid[entry]
            c_before, ahead = joint_side(joints, j, own, px, py, vx, vy, slack)
            corner_time = min(corner_time, ahead)
            if joints[j, STARTS_LINE] <= 0.0:
                # a joint where no line starts, listed because it may be a corner
                continue
            c_after, ahead = joint_side(joints, j + 1, own, px, py, vx, vy, slack)
            corner_time = min(corner_time, ahead)
            if c_before >= 0.0 >= c_after and c_before > c_after and (own.kind != LINE or j != own.number):
                t, fraction = line_time(tables, j, (c_before, c_after), px, py, vx, vy)
                # of two lines at equal distance the first along the wall is hit, as without a grid
                if t > close:
                    if t < best or (t == best and j < found):
                        best, found, best_fraction = t, j, fraction
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
    return best, found, best_fraction, corner_time, nearby
