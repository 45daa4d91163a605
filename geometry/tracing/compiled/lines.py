"""The first hit of a ray on the lines of a hollow: compiled, inlined in `rays`. Loads numba.

The sign of c = (V - p) x v is the side of the ray on which a joint V lies. A line is hit from its free side exactly if
c goes from >= 0 at its start to <= 0 at its end. Neighbouring lines share the number c, so no ray passes between them.
"""

from __future__ import annotations

import numpy as np

from ...scene import columns as c
from ...scene.boxes import BOXES, CONTENT, PARENT
from ...scene.sky import MOST_LINES, SKY_ROOM
from ...scene.tolerances import NEARBY_SLACKS
from .lanes import (
    AT_LEAVES,
    AT_NODES,
    BOUNCES,
    DOUBT,
    FOUND,
    FRACTION,
    LEAF,
    LEAST_FRACTION,
    LEVEL,
    MOST,
    NEAREST,
    OWN,
    PX,
    PY,
    ROW,
    TIME,
    VX,
    VY,
    WAITING,
    boxes_met,
    first_bit,
    last_bit,
    lines_met,
    nearest_of_lines,
)
from .options import inlined, inner
from .records import LINE, OPENING, Own

# No hit on a line, for `nearest_line`.
NO_LINE_HIT = np.inf, -1, 0.0, np.inf, False
# Mask of all boxes of a row.
ALL_BOXES = (1 << BOXES) - 1
# Mask that tells the compiler that an index is not negative, so that it need not count from the end. A longer mask is
# an instruction whose register of one byte makes a step of a ray wait for that of the ray before, in some compilations.
NATURAL = (1 << 31) - 1


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
    hx = joints[near, c.JOINT_X] + fraction * lines[j, c.EDGE_X]
    hy = joints[near, c.JOINT_Y] + fraction * lines[j, c.EDGE_Y]
    return (hx - px) * vx + (hy - py) * vy, fraction


@inlined
def is_ahead(tables, j, sides, t, close, slack):
    """-> bool: whether a line lies ahead of the start for any rounding: at a time above ``close``, or a slack away."""
    c_before, c_after = sides
    return t > close or t * (c_before - c_after) > slack * tables.lines[j, c.LENGTH]


@inlined
def joint_side(joints, j, own, px, py, vx, vy, slack):
    """-> (c, t): the number c of joint j, and the time to the joint if it is a corner that the ray meets, else inf."""
    dx, dy = joints[j, c.JOINT_X] - px, joints[j, c.JOINT_Y] - py
    side = dx * vy - dy * vx
    if abs(side) <= slack and joints[j, c.IS_CORNER] > 0.0:
        ahead = dx * vx + dy * vy
        # at entry the corners of the opening are always behind the ray, at any angle
        if (own.bounces > 0 or dy != 0.0) and ahead > slack:
            return side, ahead
    return side, np.inf


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
        if c_before >= 0.0 >= c_after and c_before > c_after and joints[j, c.STARTS_LINE] > 0.0:
            is_own = own.kind == LINE and own.number == j
            if not is_own:
                t, fraction = line_time(tables, j, (c_before, c_after), px, py, vx, vy)
                if is_ahead(tables, j, (c_before, c_after), t, close, slack):
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
    root, levels = int(scope.hollow[c.TREE_ROOT]), int(scope.hollow[c.TREE_LEVELS])
    return root, levels - 1, boxes_met(scope.tables.boxes, root, px, py, vx, vy, least, most), np.int64(0)


@inlined
def next_leaf(scope, walk, forward, px, py, vx, vy, least, most):
    """-> (leaf, walk): the row of the next leaf that a ray meets between two times, -1 after the last one.

    Boxes are visited in the order of the wall, or against it if not ``forward``.
    """
    boxes, top = scope.tables.boxes, int(scope.hollow[c.TREE_LEVELS]) - 1
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


@inner
def nearest_line_in_boxes(tree, own_line, bounces, px, py, vx, vy, time):
    """-> (t, line, fraction, corner, nearby) as `nearest_line`, from the lines in the boxes along the ray.

    ``own_line`` is the line that the ray leaves after so many bounces, or -1.
    """
    tables, slack = tree.tables, tree.slack
    own = Own(LINE, own_line, -1.0, 0.0, -1, bounces)
    joints, boxes = tables.joints, tables.boxes
    close, most = NEARBY_SLACKS * slack, time + 2.0 * slack
    best, found, best_fraction = np.inf, -1, 0.0
    corner_time, nearby = np.inf, False
    walk = first_boxes(tree, px, py, vx, vy, -close, most)
    while True:
        leaf, walk = next_leaf(tree, walk, vx > 0.0, px, py, vx, vy, -close, most)
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
            if joints[j, c.STARTS_LINE] > 0.0:
                _, ahead = joint_side(joints, j + 1, own, px, py, vx, vy, slack)
                corner_time = min(corner_time, ahead)
        while met != 0:
            j = first + first_bit(met)
            met &= met - 1
            if j == own_line:
                continue
            c_before = (joints[j, c.JOINT_X] - px) * vy - (joints[j, c.JOINT_Y] - py) * vx
            c_after = (joints[j + 1, c.JOINT_X] - px) * vy - (joints[j + 1, c.JOINT_Y] - py) * vx
            t, fraction = line_time(tables, j, (c_before, c_after), px, py, vx, vy)
            # of two lines at equal distance the first along the wall is hit, as without boxes
            if is_ahead(tables, j, (c_before, c_after), t, close, slack):
                if t < best or (t == best and j < found):
                    best, found, best_fraction = t, j, fraction
                    most = min(best, time) + 2.0 * slack
            elif t >= -close:
                nearby = True


@inlined
def leaves_to_sky(tables, own, room, px, py, vx, vy):
    """-> bool: whether a ray that starts on line ``own`` certainly meets no piece; see `sky`.

    ``room`` is the distance from the ends of the line from which on this is known.
    """
    joints, lines, j = tables.joints, tables.lines, own
    x0, y0 = abs(joints[j, c.JOINT_X] - px), abs(joints[j, c.JOINT_Y] - py)
    x1, y1 = abs(joints[j + 1, c.JOINT_X] - px), abs(joints[j + 1, c.JOINT_Y] - py)
    is_inside = (max(x0, y0) > room) & (max(x1, y1) > room)
    is_free = (vx < lines[j, c.SKY_RIGHT] * vy) & (-vx < lines[j, c.SKY_LEFT] * vy)
    return is_inside & is_free


@inlined
def begin_walks(scope, work, walks, count):
    """-> int: the number of rays of a wave that begin at the root of the tree; the other ones meet no line."""
    root, top, room = int(scope.hollow[c.TREE_ROOT]), int(scope.hollow[c.TREE_LEVELS]) - 1, SKY_ROOM * scope.slack
    first, end = scope.joints
    nodes, has_sky = 0, end - first <= MOST_LINES + 1
    for i in range(count):
        walks[ROW + i], walks[LEVEL + i], walks[WAITING + i] = root, top, ALL_BOXES << BOXES * top
        walks[FOUND + i], walks[AT_NODES + nodes] = -1, i
        work[NEAREST + i], work[MOST + i] = np.inf, work[TIME + i] + 2.0 * scope.slack
        nodes += 1
        if has_sky and work[OWN + i] >= 0.0:
            own, px, py, vx, vy = int(work[OWN + i]) & NATURAL, work[PX + i], work[PY + i], work[VX + i], work[VY + i]
            nodes -= np.int64(leaves_to_sky(scope.tables, own, room, px, py, vx, vy))
    return nodes


@inlined
def step_on(boxes, work, walks, i, waiting, nodes, leaves):
    """-> (nodes, leaves): numbers of rays at nodes and at leaves, with ray i at its next one if there is one.

    The walk is that of `next_leaf`, one step at a time, and without branches, which the processor could not predict.
    ``waiting`` are the boxes still to visit, eight bits for each level.
    """
    row, level = walks[ROW + i] & NATURAL, walks[LEVEL + i]
    place = BOXES * level
    mask = waiting >> place & ALL_BOXES
    up = np.int64(mask == 0)
    box = first_bit(mask | up) if work[VX + i] > 0.0 else last_bit(mask | up)
    to_leaf = np.int64(level == 1) & ~up
    down = 1 - up - to_leaf
    # the node above, or the box; bit 0 stands for no box
    following = int(boxes[row, PARENT if up != 0 else CONTENT]) + box
    waiting ^= (1 - up) << (place + box)
    walks[WAITING + i] = waiting | (down * ALL_BOXES) << (place - BOXES)
    walks[LEVEL + i] = level + up - down
    walks[ROW + i] = row if to_leaf != 0 else following
    walks[LEAF + i] = following
    # written in any case, counted if true
    walks[AT_NODES + nodes] = walks[AT_LEAVES + leaves] = i
    return nodes + (down | (up & np.int64(waiting != 0))), leaves + to_leaf


@inlined
def doubt_at_ends(scope, work, i, first, at_end):
    """Doubt ray i of a wave if it meets a corner at an end of the lines of a leaf that a mask tells."""
    joints, slack = scope.tables.joints, scope.slack
    px, py, vx, vy = work[PX + i], work[PY + i], work[VX + i], work[VY + i]
    start = Own(OPENING, -1, -1.0, 0.0, -1, int(work[BOUNCES + i]))
    while at_end != 0:
        j = first + first_bit(at_end)
        at_end &= at_end - 1
        _, ahead = joint_side(joints, j, start, px, py, vx, vy, slack)
        if joints[j, c.STARTS_LINE] > 0.0:
            _, other = joint_side(joints, j + 1, start, px, py, vx, vy, slack)
            ahead = min(ahead, other)
        if ahead < np.inf:
            work[DOUBT + i] = 1.0


@inlined
def meet_leaf(scope, work, walks, i):
    """Find the nearest hit of ray i of a wave on the lines of its leaf, if that is nearer."""
    slack, leaf = scope.slack, walks[LEAF + i] & NATURAL
    px, py, vx, vy = work[PX + i], work[PY + i], work[VX + i], work[VY + i]
    first = int(scope.tables.boxes[leaf, CONTENT]) & NATURAL
    t, fraction, place, masks = nearest_of_lines(
        scope.tables.boxes, leaf, int(work[OWN + i]) - first, px, py, vx, vy, slack, NEARBY_SLACKS * slack
    )
    if masks != 0:
        doubt_at_ends(scope, work, i, first, masks & ALL_BOXES)
        if masks > ALL_BOXES:
            work[DOUBT + i] = 1.0
    # of two lines at equal distance the first along the wall is hit, as without boxes
    j, best, found = first + place, work[NEAREST + i], walks[FOUND + i]
    is_nearer = (t < best) | ((t == best) & (j < found))
    work[NEAREST + i] = t if is_nearer else best
    work[FRACTION + i] = fraction if is_nearer else work[FRACTION + i]
    walks[FOUND + i] = j if is_nearer else found
    work[MOST + i] = min(min(t, best), work[TIME + i]) + 2.0 * slack


@inlined
def nearest_lines_in_boxes(scope, work, walks, count):
    """Find the first lines that all rays of a wave meet, as `nearest_line_in_boxes`; a corner or a near start is doubt.

    All rays take a step in turn, so that the processor works on some while it waits for the others.
    """
    boxes, close = scope.tables.boxes, NEARBY_SLACKS * scope.slack
    nodes, leaves = begin_walks(scope, work, walks, count), 0
    while nodes + leaves > 0:
        rays, leaves = leaves, 0
        for k in range(rays):
            i = walks[AT_LEAVES + k] & NATURAL
            meet_leaf(scope, work, walks, i)
            nodes, leaves = step_on(boxes, work, walks, i, walks[WAITING + i], nodes, leaves)
        rays, nodes = nodes, 0
        for k in range(rays):
            i = walks[AT_NODES + k] & NATURAL
            met = boxes_met(
                boxes, walks[ROW + i] & NATURAL, work[PX + i], work[PY + i], work[VX + i], work[VY + i], -close,
                work[MOST + i],
            )  # fmt: skip
            others = ~((ALL_BOXES ^ met) << BOXES * walks[LEVEL + i])
            nodes, leaves = step_on(boxes, work, walks, i, walks[WAITING + i] & others, nodes, leaves)
