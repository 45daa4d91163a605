"""The first hit of a ray on the lines of a hollow with many: a search in a tree of boxes.

Loads numba. A ray is tested against all boxes, or all lines, in a row of the tree at once, in vectors that are written
by hand: the compiler vectorises a loop over so few, but not the collection of its truth values in a mask. Comparisons
with NaN, as in an empty place, are false.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ...curves import columns as c
from ...curves.columns import NEARBY_SLACKS
from ...scene.closed_forms import ANCHOR_X, ANCHOR_Y, BOXES, CONTENT, ESCAPE_ROOM, OTHER_X, OTHER_Y, PARENT
from ...scene.compiled.compiling import inlined, inner
from .pieces.formulas import side
from .pieces.lines import is_ahead, joint_side, line_at, line_hit, line_sides
from .pieces.records import Tree

# No hit on a line, for `nearest_line`.
NO_LINE_HIT = np.inf, -1, 0.0, np.inf, False
# Mask of all boxes of a row.
ALL_BOXES = (1 << BOXES) - 1
WORD, NUMBER, BIT = ir.IntType(64), ir.DoubleType(), ir.IntType(1)


def _operation(name: str, *how: str) -> Any:
    return lambda one, other: Vector(one.builder, getattr(one.builder, name)(*how, one.value, other.value))


class Vector:
    """A vector of numbers or truth values in compiled code, with the operations of arithmetic."""

    kind = ir.VectorType(NUMBER, BOXES)
    __add__, __sub__, __mul__ = _operation("fadd"), _operation("fsub"), _operation("fmul")
    __and__, __or__ = _operation("and_"), _operation("or_")
    __le__, __ge__, __gt__ = (_operation("fcmp_ordered", how) for how in ("<=", ">=", ">"))

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def __abs__(self) -> Vector:
        name, kind = f"llvm.fabs.v{BOXES}f64", ir.FunctionType(self.kind, [self.kind])
        function = self.builder.module.declare_intrinsic(name, (), kind)
        return Vector(self.builder, self.builder.call(function, [self.value]))

    def mask(self) -> Any:
        """Return the truth values as bits of a whole number."""
        return self.builder.zext(self.builder.bitcast(self.value, ir.IntType(BOXES)), WORD)


def _vectors(builder: Any, row: Any, *numbers: Any) -> list[Vector]:
    """Return the four vectors of a row of a tree, and vectors of each of some numbers."""
    vectors = []
    for column in (ANCHOR_X, ANCHOR_Y, OTHER_X, OTHER_Y):
        place = builder.bitcast(builder.gep(row, [WORD(column)]), Vector.kind.as_pointer())
        vectors.append(builder.load(place, align=8))
    for number in numbers:
        one = builder.insert_element(ir.Constant(Vector.kind, ir.Undefined), number, ir.IntType(32)(0))
        places = ir.Constant(ir.VectorType(ir.IntType(32), BOXES), [0] * BOXES)
        vectors.append(builder.shuffle_vector(one, one, places))
    return [Vector(builder, vector) for vector in vectors]


@intrinsic
def boxes_met(typing, row, px, py, vx, vy, least, most):
    """-> int: mask of the boxes in a row of a tree that a ray meets between the times ``least`` and ``most``.

    Bit k tells about box k.
    """

    def met(context, builder, signature, values):
        x, y, width, height, px, py, vx, vy, least, most = _vectors(builder, *values)
        # of the middle: its distance from the ray's line and its position along it; and those of the box about it
        middle, along = abs(side.py_func(x, y, px, py, vx, vy)), (x - px) * vx + (y - py) * vy
        reach, length = width * abs(vy) + height * abs(vx), width * abs(vx) + height * abs(vy)
        return ((middle <= reach) & (along + length >= least) & (along - length <= most)).mask()

    return types.int64(row, *[types.float64] * 6), met


@intrinsic
def lines_met(typing, row, px, py, vx, vy, slack):
    """-> (met, at_end): mask of the lines in a row of a tree that a ray's line crosses from their free side.

    And of those with an end within the slack of the ray's line.
    """

    def met(context, builder, signature, values):
        x0, y0, x1, y1, px, py, vx, vy, slack = _vectors(builder, *values)
        before, after, zero = side.py_func(x0, y0, px, py, vx, vy), side.py_func(x1, y1, px, py, vx, vy), px - px
        crossed = (before >= zero) & (zero >= after) & (before > after)
        at_end = (abs(before) <= slack) | (abs(after) <= slack)
        return context.make_tuple(builder, signature.return_type, (crossed.mask(), at_end.mask()))

    return types.UniTuple(types.int64, 2)(row, *[types.float64] * 5), met


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
def tree_of(scope):
    """-> Tree: the tree of a hollow."""
    tables, hollow = scope.tables, scope.hollow
    root, top = np.int64(hollow[c.TREE_ROOT]), np.int64(hollow[c.TREE_LEVELS]) - 1
    return Tree(tables.boxes, tables.joints, tables.lines, root, top, scope.slack)


@inlined
def first_boxes(tree, px, py, vx, vy, least, most):
    """-> search: before the first leaf that a ray meets between two times.

    A search is the row of a node and its level, from 1 above the leaves; the mask of the boxes in the node still to
    visit; and those masks of the nodes above, in sixteen bits for each level from 2 on.
    """
    return tree.root, tree.top, boxes_met(tree.boxes[tree.root], px, py, vx, vy, least, most), np.int64(0)


@inlined
def next_leaf(tree, search, forward, px, py, vx, vy, least, most):
    """-> (leaf, search): the row of the next leaf that a ray meets between two times, -1 after the last one.

    Boxes are visited in the order of the wall, or against it if not ``forward``.
    """
    boxes, top = tree.boxes, tree.top
    node, level, mask, waiting = search
    while True:
        if mask == 0:
            if level == top:
                return -1, (node, level, mask, waiting)
            node = int(boxes[node, PARENT])
            level += 1
            mask = waiting >> (BOXES * (level - 2)) & ALL_BOXES
            if mask != 0:
                mask &= boxes_met(boxes[node], px, py, vx, vy, least, most)
            continue
        box = first_bit(mask) if forward else last_bit(mask)
        mask ^= 1 << box
        row = int(boxes[node, CONTENT]) + box
        if level == 1:
            return row, (node, level, mask, waiting)
        place = BOXES * (level - 2)
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
def escapes(tree, j, room, px, py, vx, vy):
    """-> bool: whether a ray that starts on line ``j``, at least ``room`` from its ends, surely meets no piece."""
    joints, lines = tree.joints, tree.lines
    x0, y0 = abs(joints[j, c.JOINT_X] - px), abs(joints[j, c.JOINT_Y] - py)
    x1, y1 = abs(joints[j + 1, c.JOINT_X] - px), abs(joints[j + 1, c.JOINT_Y] - py)
    is_inside = (max(x0, y0) > room) & (max(x1, y1) > room)
    return is_inside & (vx < lines[j, c.ESCAPE_RIGHT] * vy) & (-vx < lines[j, c.ESCAPE_LEFT] * vy)


@inner
def nearest_line_in_boxes(tree, own_line, at_entry, px, py, vx, vy, time):
    """-> (t, line, fraction, corner, nearby) as `nearest_line`, from the lines in the boxes along the ray.

    The ray starts on a line of this number, or -1.
    """
    slack = tree.slack
    if own_line >= 0 and escapes(tree, own_line, ESCAPE_ROOM * slack, px, py, vx, vy):
        return NO_LINE_HIT
    boxes, close, most = tree.boxes, NEARBY_SLACKS * slack, time + 2.0 * slack
    best, found, best_fraction = np.inf, -1, 0.0
    corner_time, nearby = np.inf, False
    search = first_boxes(tree, px, py, vx, vy, -close, most)
    while True:
        leaf, search = next_leaf(tree, search, vx > 0.0, px, py, vx, vy, -close, most)
        if leaf < 0:
            return best, found, best_fraction, corner_time, nearby
        (met, at_end), first = lines_met(boxes[leaf], px, py, vx, vy, slack), int(boxes[leaf, CONTENT])
        if at_end != 0:
            ahead = corner_at_ends(tree.joints, first, at_end, at_entry, px, py, vx, vy, slack)
            corner_time = min(corner_time, ahead)
        while met != 0:
            j = first + first_bit(met)
            met &= met - 1
            if j == own_line:
                continue
            line = line_at(tree, j)
            before, after = line_sides(line, px, py, vx, vy)
            t, fraction, _, _ = line_hit(line, before, after, px, py, vx, vy)
            # of two lines at equal distance the first along the wall is hit, as without boxes
            if is_ahead(t, before - after, line.length, close, slack):
                if t < best or (t == best and j < found):
                    best, found, best_fraction = t, j, fraction
                    most = min(best, time) + 2.0 * slack
            elif t >= -close:
                nearby = True
