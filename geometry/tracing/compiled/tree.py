"""The first hit of a ray on the lines of a hollow with many: a search in a tree of boxes.

Loads numba. A ray is tested against the boxes, or the lines, in a row of the tree in a loop without branches. Their
number is read from the row, because the compiler would take a loop of a constant number of steps apart.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ...scene import columns as c
from ...scene.boxes import ANCHOR_X, ANCHOR_Y, BOXES, CONTENT, COUNT, OTHER_X, OTHER_Y, PARENT
from ...scene.escapes import ESCAPE_ROOM
from ...scene.tolerances import NEARBY_SLACKS
from .pieces.formulas import side
from .pieces.lines import is_ahead, joint_side, line_at, line_hit, line_sides
from .pieces.options import inlined, inner
from .pieces.records import LINE

# No hit on a line, for `nearest_line`.
NO_LINE_HIT = np.inf, -1, 0.0, np.inf, False
# Mask of all boxes of a row.
ALL_BOXES = (1 << BOXES) - 1
WORD, BIT = ir.IntType(64), ir.IntType(1)


@inlined
def boxes_met(row, px, py, vx, vy, least, most):
    """-> int: mask of the boxes in a row of a tree that a ray meets between the times ``least`` and ``most``.

    Bit k tells about box k.
    """
    mask = np.int64(0)
    for k in range(int(row[COUNT])):
        x, y, width, height = row[ANCHOR_X + k], row[ANCHOR_Y + k], row[OTHER_X + k], row[OTHER_Y + k]
        # of the middle: its distance from the ray's line and its position along it; and those of the box about it
        middle, along = abs(side(x, y, px, py, vx, vy)), (x - px) * vx + (y - py) * vy
        reach, length = width * abs(vy) + height * abs(vx), width * abs(vx) + height * abs(vy)
        mask |= np.int64((middle <= reach) & (along + length >= least) & (along - length <= most)) << k
    return mask


@inlined
def lines_met(row, px, py, vx, vy, slack):
    """-> (met, at_end): mask of the lines in a row of a tree that a ray's line crosses from their free side.

    And of those with an end within the slack of the ray's line.
    """
    met, at_end = np.int64(0), np.int64(0)
    for k in range(int(row[COUNT])):
        before = side(row[ANCHOR_X + k], row[ANCHOR_Y + k], px, py, vx, vy)
        after = side(row[OTHER_X + k], row[OTHER_Y + k], px, py, vx, vy)
        met |= np.int64((before >= 0.0) & (after <= 0.0) & (before > after)) << k
        at_end |= np.int64((abs(before) <= slack) | (abs(after) <= slack)) << k
    return met, at_end


@intrinsic
def first_bit(typing, mask):
    """-> int: the number of the lowest bit of a mask that is not 0."""

    def count(context, builder, signature, values):
        return builder.cttz(values[0], BIT(1))

    return types.int64(types.int64), count


@intrinsic
def last_bit(typing, mask):
    """-> int: the number of the highest bit of a mask that is not 0."""

    def count(context, builder, signature, values):
        return builder.sub(WORD(63), builder.ctlz(values[0], BIT(1)))

    return types.int64(types.int64), count


@inlined
def first_boxes(scope, px, py, vx, vy, least, most):
    """-> search: before the first leaf that a ray meets between two times.

    A search is the row of a node and its level, from 1 above the leaves; the mask of the boxes in the node still to
    visit; and eight bits for each level, those masks of the nodes above.
    """
    root, levels = int(scope.hollow[c.TREE_ROOT]), int(scope.hollow[c.TREE_LEVELS])
    return root, levels - 1, boxes_met(scope.tables.boxes[root], px, py, vx, vy, least, most), np.int64(0)


@inlined
def next_leaf(scope, search, forward, px, py, vx, vy, least, most):
    """-> (leaf, search): the row of the next leaf that a ray meets between two times, -1 after the last one.

    Boxes are visited in the order of the wall, or against it if not ``forward``.
    """
    boxes, top = scope.tables.boxes, int(scope.hollow[c.TREE_LEVELS]) - 1
    node, level, mask, waiting = search
    while True:
        if mask == 0:
            if level == top:
                return -1, (node, level, mask, waiting)
            node = int(boxes[node, PARENT])
            level += 1
            mask = waiting >> (BOXES * level) & ALL_BOXES
            if mask != 0:
                mask &= boxes_met(boxes[node], px, py, vx, vy, least, most)
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
        mask = boxes_met(boxes[node], px, py, vx, vy, least, most)


@inlined
def corner_at_ends(joints, first, at_end, at_entry, px, py, vx, vy, slack):
    """-> float: the least time to a corner at an end of the lines of a leaf that a mask tells, inf if there is none."""
    time = np.inf
    while at_end != 0:
        j = first + first_bit(at_end)
        at_end &= at_end - 1
        _, ahead = joint_side(joints, j, at_entry, px, py, vx, vy, slack)
        time = min(time, ahead)
        if joints[j, c.STARTS_LINE] > 0.0:
            _, ahead = joint_side(joints, j + 1, at_entry, px, py, vx, vy, slack)
            time = min(time, ahead)
    return time


@inlined
def escapes(tables, j, room, px, py, vx, vy):
    """-> bool: whether a ray that starts on line ``j``, at least ``room`` from its ends, surely meets no piece."""
    joints, lines = tables.joints, tables.lines
    x0, y0 = abs(joints[j, c.JOINT_X] - px), abs(joints[j, c.JOINT_Y] - py)
    x1, y1 = abs(joints[j + 1, c.JOINT_X] - px), abs(joints[j + 1, c.JOINT_Y] - py)
    is_inside = (max(x0, y0) > room) & (max(x1, y1) > room)
    return is_inside & (vx < lines[j, c.ESCAPE_RIGHT] * vy) & (-vx < lines[j, c.ESCAPE_LEFT] * vy)


@inner
def nearest_line_in_boxes(scope, own, px, py, vx, vy, time):
    """-> (t, line, fraction, corner, nearby) as `nearest_line`, from the lines in the boxes along the ray."""
    tables, slack, own_line = scope.tables, scope.slack, own.number if own.kind == LINE else -1
    if own_line >= 0 and escapes(tables, own_line, ESCAPE_ROOM * slack, px, py, vx, vy):
        return NO_LINE_HIT
    boxes, close, most = tables.boxes, NEARBY_SLACKS * slack, time + 2.0 * slack
    best, found, best_fraction = np.inf, -1, 0.0
    corner_time, nearby = np.inf, False
    search = first_boxes(scope, px, py, vx, vy, -close, most)
    while True:
        leaf, search = next_leaf(scope, search, vx > 0.0, px, py, vx, vy, -close, most)
        if leaf < 0:
            return best, found, best_fraction, corner_time, nearby
        (met, at_end), first = lines_met(boxes[leaf], px, py, vx, vy, slack), int(boxes[leaf, CONTENT])
        if at_end != 0:
            ahead = corner_at_ends(tables.joints, first, at_end, own.bounces == 0, px, py, vx, vy, slack)
            corner_time = min(corner_time, ahead)
        while met != 0:
            j = first + first_bit(met)
            met &= met - 1
            if j == own_line:
                continue
            line = line_at(tables, j)
            before, after = line_sides(line, px, py, vx, vy)
            t, fraction, _, _ = line_hit(line, before, after, px, py, vx, vy)
            # of two lines at equal distance the first along the wall is hit, as without boxes
            if is_ahead(t, before - after, line.length, close, slack):
                if t < best or (t == best and j < found):
                    best, found, best_fraction = t, j, fraction
                    most = min(best, time) + 2.0 * slack
            elif t >= -close:
                nearby = True
