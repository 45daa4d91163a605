"""The first hit of a ray on the lines of a hollow: compiled, inlined in `rays`. Loads numba.

The sign of c = (V - p) x v is the side of the ray on which a joint V lies. A line is hit from its free side exactly if
c goes from >= 0 at its start to <= 0 at its end. Neighbouring lines share the number c, so no ray passes between them.
"""

from __future__ import annotations

import numpy as np

from ...scene.boxes import BOXES, CONTENT, PARENT
from ...scene.columns import (
    EDGE_X,
    EDGE_Y,
    IS_CORNER,
    JOINT_X,
    JOINT_Y,
    STARTS_LINE,
    TREE_LEVELS,
    TREE_ROOT,
)
from ...scene.tolerances import NEARBY_SLACKS
from .lanes import boxes_met, first_bit, last_bit, lines_met
from .options import inlined
from .records import LINE

# Least absolute value of a fraction from a line's end, so that it is negative even if the ray meets that end.
LEAST_FRACTION = 5e-324
# Mask of all boxes of a row.
ALL_BOXES = (1 << BOXES) - 1


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
def first_boxes(scope, px, py, vx, vy, least, most):
    """-> walk: before the first leaf that a ray meets between two times.

    A walk is the row of a node and its level, from 1 above the leaves; the mask of the boxes in the node still to
    visit; and eight bits for each level, those masks of the nodes above.
    """
    root, levels = int(scope.hollow[TREE_ROOT]), int(scope.hollow[TREE_LEVELS])
    return root, levels - 1, boxes_met(scope.tables.boxes, root, px, py, vx, vy, least, most), np.int64(0)


@inlined
def next_leaf(scope, walk, forward, px, py, vx, vy, least, most):
    """-> (leaf, walk): the row of the next leaf that a ray meets between two times, -1 after the last one.

    Boxes are visited in the order of the wall, or against it if not ``forward``.
    """
    boxes, top = scope.tables.boxes, int(scope.hollow[TREE_LEVELS]) - 1
    node, level, mask, waiting = walk
    while True:
        if mask == 0:
            if level == top:
                return -1, (node, level, mask, waiting)
            node = int(boxes[node, PARENT])
            level += 1
            mask = waiting >> (BOXES * level) & ALL_BOXES
            if mask != 0:
                mask &= boxes_met(boxes, node, px, py, vx, vy, least, most)
            continue
        box = first_bit(mask) if forward else last_bit(mask)
        mask ^= 1 << box
        row = int(boxes[node, CONTENT]) + box
        if level == 1:
            return row, (node, level, mask, waiting)
        place = BOXES * level
        waiting = (waiting & ~(ALL_BOXES << place)) | (mask << place)
        node = row
        level -= 1
        mask = boxes_met(boxes, node, px, py, vx, vy, least, most)


@inlined
def nearest_line_in_boxes(scope, own, px, py, vx, vy, time):
    """-> (t, line, fraction, corner, nearby) as `nearest_line`, from the lines in the boxes along the ray."""
    tables, slack = scope.tables, scope.slack
    joints, boxes = tables.joints, tables.boxes
    close, most = NEARBY_SLACKS * slack, time + 2.0 * slack
    best, found, best_fraction = np.inf, -1, 0.0
    corner_time, nearby = np.inf, False
    walk = first_boxes(scope, px, py, vx, vy, -close, most)
    while True:
        leaf, walk = next_leaf(scope, walk, vx > 0.0, px, py, vx, vy, -close, most)
        if leaf < 0:
            return best, found, best_fraction, corner_time, nearby
        met = lines_met(boxes, leaf, px, py, vx, vy, slack)
        first = int(boxes[leaf, CONTENT])
        at_end, met = met >> BOXES, met & ALL_BOXES
        while at_end != 0:
            j = first + first_bit(at_end)
            at_end &= at_end - 1
            _, ahead = joint_side(joints, j, own, px, py, vx, vy, slack)
            corner_time = min(corner_time, ahead)
            if joints[j, STARTS_LINE] > 0.0:
                _, ahead = joint_side(joints, j + 1, own, px, py, vx, vy, slack)
                corner_time = min(corner_time, ahead)
        while met != 0:
            j = first + first_bit(met)
            met &= met - 1
            if own.kind == LINE and j == own.number:
                continue
            c_before = (joints[j, JOINT_X] - px) * vy - (joints[j, JOINT_Y] - py) * vx
            c_after = (joints[j + 1, JOINT_X] - px) * vy - (joints[j + 1, JOINT_Y] - py) * vx
            t, fraction = line_time(tables, j, (c_before, c_after), px, py, vx, vy)
            # of two lines at equal distance the first along the wall is hit, as without boxes
            if t > close:
                if t < best or (t == best and j < found):
                    best, found, best_fraction = t, j, fraction
                    most = min(best, time) + 2.0 * slack
            elif t >= -close:
                nearby = True
