"""Work that is done once for the pieces of a hollow, so that a ray meets few of them: closed forms and trees of boxes.

The closed forms are those of runs between two lines that face each other, and of hollows of two lines or one circular
arc. `tracing/compiled/blocks` reads those of hollows; `columns` names their numbers. A *wedge* is a hollow of two
lines. Its triangle is unfolded about the apex into copies, in which a ray is straight; the ray leaves through the first
copy of the opening that it meets. A *circular hollow* is one circular arc of at most a half circle: all chords of a
ray are equal.

A tree of boxes about the straight pieces of a hollow lets a ray be tested against sixteen boxes at once. Pieces that
follow each other along the wall are close to each other, so sixteen consecutive lines make a leaf, sixteen consecutive
leaves a node, and so on up to the root. A row of the tree has up to sixteen lines with their ends, or boxes with their
middles and half their widths and heights; the rest of it is NaN. Of a ray that escapes, because it leaves its line in
the line's sector of escape, no box is tested.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import atan2, ceil, cos, fsum, hypot, pi, sin
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ..curves import columns as c
from ..curves.arc import Arc
from ..curves.columns import BOX_MARGIN, JOINT_ULPS, NEARBY, row_of

if TYPE_CHECKING:
    from ..curves.curve import Curve, Point

# Widest wedge with runs, radians. In a wider wedge a ray has at most about ten hits, and a run does not pay.
WIDEST_WEDGE = 0.3
# Number of lines in a hollow up to which all pairs are tested; above it, pairs of lines at most two joints apart.
MANY_LINES = 64
# Limit on pairs times pieces tested in one hollow, about one second; pairs above the limit have no runs.
MOST_WORK = 50_000_000
# Depth, in eps times the hollow's size, to which a piece may reach between two lines by rounding.
TOUCH_ULPS = 16.0
PairRow = dict[int, float]


def facing_pairs(
    numbers: NDArray[np.int64], starts: Floats, ends: Floats, hulls: Floats, size: float
) -> list[tuple[int, PairRow]]:
    """Find the facing pairs among the lines of one hollow.

    Parameters
    ----------
    numbers : array of int, shape (m,)
        Row numbers of the lines.
    starts, ends : array, shape (m, 2)
        Ends of the lines; the free side is on the left.
    hulls : array, shape (n, 4, 2)
        For every piece of the hollow, lines included, four points whose convex hull contains it.
    size : float
        Size of the hollow.

    Returns
    -------
    list of (int, row)
        For both lines of every pair the number of the line and its row of the table ``pairs``, by columns.
    """
    count = len(numbers)
    if count < 2:
        return []
    edges = ends - starts
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    normals = np.stack([-edges[:, 1], edges[:, 0]], axis=1) / lengths[:, None]
    if count <= MANY_LINES:
        first, second = np.triu_indices(count, 1)
    else:
        near = np.arange(count)
        first = np.concatenate([near[:-1], near[:-2]])
        second = np.concatenate([near[1:], near[2:]])
    opposed = np.einsum("ij,ij->i", normals[first], normals[second]) < -cos(WIDEST_WEDGE)
    first, second = first[opposed], second[opposed]
    if len(first) * len(hulls) > MOST_WORK:
        affordable = MOST_WORK // len(hulls)
        first, second = first[:affordable], second[:affordable]
    rows: list[tuple[int, PairRow]] = []
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        found = _facing(starts[i], ends[i], starts[j], ends[j], hulls, TOUCH_ULPS * EPS * size)
        if found is not None:
            rows.append((int(numbers[i]), {c.PARTNER: float(numbers[j])} | found[0]))
            rows.append((int(numbers[j]), {c.PARTNER: float(numbers[i])} | found[1]))
    return rows


def _facing(a0: Floats, a1: Floats, b0: Floats, b1: Floats, hulls: Floats, slack: float) -> list[PairRow] | None:
    """Return the rows of two lines without the partners' numbers; None if the lines do not face each other freely."""
    sine, cosine = _turn(a0, a1, b0, b1)
    beta = atan2(abs(sine), -cosine)
    u_a, u_b = _unit(a1 - a0), _unit(b0 - b1)
    n_a, n_b = np.array([-u_a[1], u_a[0]]), np.array([u_b[1], -u_b[0]])
    if u_a @ n_b > 0.0 or (u_a @ n_b == 0.0 and u_b @ n_a > 0.0):
        u_a, u_b = -u_a, -u_b
    # the bisector, towards the apex; points that are mirror images in it have the same coordinate along it
    axis = _unit(u_a + u_b)
    far_a, near_a = sorted((a0, a1), key=lambda p: float(p @ axis))
    far_b, near_b = sorted((b0, b1), key=lambda p: float(p @ axis))
    low, high = max(far_a @ axis, far_b @ axis), min(near_a @ axis, near_b @ axis)
    if not high - low > 2.0 * slack:
        return None
    stretch = 1.0 / cos(0.5 * beta)
    parts = []
    for far, near, u in ((far_a, near_a, u_a), (far_b, near_b, u_b)):
        top = near if near @ axis == high else near - u * ((near @ axis - high) * stretch)
        bottom = far if far @ axis == low else far + u * ((low - far @ axis) * stretch)
        parts.append((top, bottom))
    touching = bool(np.all(near_a == near_b))
    gaps = [
        0.0 if touching else float((parts[0][0] - near_b) @ n_b),
        0.0 if touching else float((parts[1][0] - near_a) @ n_a),
    ]
    # the narrow end must have a positive gap to both lines, or be the apex
    if not touching and min(gaps) <= 2.0 * slack:
        return None
    free = (
        ((hulls - near_a) @ n_a <= slack).all(axis=1)
        | ((hulls - near_b) @ n_b <= slack).all(axis=1)
        | (hulls @ axis <= low + slack).all(axis=1)
        | (hulls @ axis >= high - slack).all(axis=1)
    )
    if not free.all():
        return None
    return [
        {
            c.NEAR_X: top[0],
            c.NEAR_Y: top[1],
            c.FAR_X: bottom[0],
            c.FAR_Y: bottom[1],
            c.APEX_X: u[0],
            c.APEX_Y: u[1],
            c.GAP: gap,
            c.PAIR_SINE: sin(beta),
            c.PAIR_ANGLE: beta,
        }
        for (top, bottom), u, gap in zip(parts, (u_a, u_b), gaps, strict=True)
    ]


def _unit(vector: Floats) -> Floats:
    return vector / hypot(*vector)


def _turn(a0: Floats, a1: Floats, b0: Floats, b1: Floats) -> tuple[float, float]:
    """Return the cross and dot product of two edges, each rounded once: a run multiplies the error of their angle."""
    (ax, ay), (bx, by) = (
        [Fraction(float(q)) - Fraction(float(p)) for p, q in zip(start, end, strict=True)]
        for start, end in ((a0, a1), (b0, b1))
    )
    return float(ax * by - ay * bx), float(ax * bx + ay * by)


# Distance from a joint, as a fraction of the hollow's size, or angle from the end of an arc, within which a ray is
# traced hit by hit instead. This is far above the tolerance of a corner and above all rounding errors, so that both
# methods agree on the number of hits and on the status. About one ray in 10^8 is concerned.
UNCERTAIN_FRACTION = 2.0**-30
# Half angle, radians, below which arcs are traced hit by hit, which is more accurate for positions along flat arcs.
FLATTEST_ARC = 0.05
# Pieces of a hollow with a closed form: two lines, or one arc.
MOST_PIECES = 2
# Angle, radians, up to which a wedge is traced hit by hit, with runs of hits computed in one step.
NARROWEST_WEDGE = WIDEST_WEDGE
# Of a hollow without a closed form.
NONE = c.NO_FORM, np.empty(0)


def closed_form_of(pieces: Sequence[Curve], points: Sequence[Point], size: float) -> tuple[float, Floats]:
    """Return the kind and the numbers of the form of one hollow; ``points`` are its joints from left to right."""
    (left, top), (right, other) = points[0], points[-1]
    if top == other == 0.0 and left < right:
        if len(pieces) == 2 and all(piece.is_straight for piece in pieces):
            return _wedge_form(left, right, points[1], size)
        if len(pieces) == 1 and isinstance(pieces[0], Arc) and pieces[0].is_circular:
            return _arc_form(left, right, pieces[0])
    return NONE


def _wedge_form(left: float, right: float, apex: Point, size: float) -> tuple[float, Floats]:
    x, y = apex
    # inclinations of the two lines, each measured from its own end of the opening
    west, east = atan2(-y, x - left), atan2(-y, right - x)
    angle = fsum([pi, -west, -east])
    # the chain of the unfolded ends of the opening is convex if the apex lies below the opening
    if not left <= x <= right or angle <= NARROWEST_WEDGE:
        return NONE
    # a straight ray turns by less than pi about the apex
    copies = ceil(pi / angle)
    links = copies + 2
    row = row_of(
        c.CHAIN + 2 * links * c.LINK_COLUMNS,
        {
            c.FORM_LEFT: left, c.FORM_RIGHT: right, c.UNCERTAINTY: UNCERTAIN_FRACTION * size,
            c.WEDGE_X: x, c.WEDGE_Y: y, c.COPIES: copies,
        },
    )  # fmt: skip
    lengths = hypot(x - left, y), hypot(right - x, y)
    for start, side, first, (far, near) in ((0, 1.0, east, lengths), (links, -1.0, west, lengths[::-1])):
        for k in range(links):
            polar, length = fsum([first, -(k - 1) * angle]), near if k % 2 else far
            link = c.CHAIN + (start + k) * c.LINK_COLUMNS
            row[link + c.LINK_X], row[link + c.LINK_Y] = x + side * length * cos(polar), y + length * sin(polar)
            row[link + c.LINK_CONSTANT] = _constant(k, side, first, angle)
    return c.WEDGE, row


def _constant(hits: int, side: float, first: float, angle: float) -> float:
    """Return c of theta' = +-theta + c after ``hits`` hits, the first on the right (side 1) or on the left (side -1).

    A line of direction b reflects a ray of direction a to 2 b - a. For side 1 the lines have the directions b = first,
    first + angle, first, ..., and the ray enters in the direction theta + pi. Side -1 is the mirror image.
    """
    if hits % 2 == 0:
        return side * fsum([hits * angle, -pi])
    constant = fsum([2.0 * first, -(hits - 1) * angle, pi])
    return constant if side > 0.0 else 2.0 * pi - constant


def _arc_form(left: float, right: float, arc: Arc) -> tuple[float, Floats]:
    half = 0.5 * (arc.end_angle - arc.start_angle)
    if not FLATTEST_ARC <= half <= 0.5 * pi:
        return NONE
    radius = 0.5 * (right - left) / sin(half)
    # at pi/2 the centre lies on the opening
    height = radius * cos(half) if half < 0.5 * pi else 0.0
    numbers = {
        c.FORM_LEFT: left, c.FORM_RIGHT: right, c.UNCERTAINTY: UNCERTAIN_FRACTION,
        c.CIRCLE_X: 0.5 * (left + right), c.CIRCLE_Y: height, c.RADIUS: radius, c.HALF_ANGLE: half,
    }  # fmt: skip
    return c.CIRCULAR, row_of(c.CIRCULAR_COLUMNS, numbers)


# Most boxes, or lines, in a row; of four levels of nodes the masks are in one number, see `tracing/compiled/tree`.
BOXES = 16
# Columns of a row. Of a line the start and the end, of a box the middle and half of its width and height.
ANCHOR_X = 0
ANCHOR_Y = BOXES
OTHER_X = 2 * BOXES
OTHER_Y = 3 * BOXES
CONTENT = 4 * BOXES  # row of the first box's own row; of a leaf the joint at which the first line starts
PARENT = 4 * BOXES + 1  # row of the node that contains this one
TREE_COLUMNS = 4 * BOXES + 2


def tree_of(starts: Floats, ends: Floats, first: int, base: int, size: float) -> tuple[Floats, int]:
    """Put boxes about lines.

    Parameters
    ----------
    starts, ends : array, shape (m, 2)
        A row with equal ends is a joint where no line starts.
    first : int
        Number of the first line; the numbers are consecutive.
    base : int
        Row of the root in the table ``boxes``.
    size : float
        Size of the hollow.

    Returns
    -------
    array
        Rows of the tree, the root first and the leaves last.
    int
        Number of levels.

    Examples
    --------
    >>> tree, levels = tree_of(np.array([[0.0, -1.0], [1.0, -1.0]]), np.array([[1.0, -1.0], [3.0, -2.0]]), 0, 0, 3.0)
    >>> levels, tree[:, ANCHOR_X].tolist(), tree[:, CONTENT].tolist()
    (2, [1.5, 0.0], [1.0, 0.0])
    """
    leaf = np.concatenate([starts, ends], axis=1)
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    levels = [_rows(leaf)]
    while True:
        firsts = np.arange(0, len(low), BOXES)
        low, high = np.minimum.reduceat(low, firsts), np.maximum.reduceat(high, firsts)
        levels.append(_rows(np.concatenate([0.5 * (low + high), 0.5 * (high - low) + BOX_MARGIN * size], axis=1)))
        if len(levels[-1]) == 1:
            break
    row = base
    for upper, lower in zip(levels[:0:-1], levels[-2::-1], strict=True):
        upper[:, CONTENT] = row + len(upper) + BOXES * np.arange(len(upper))
        lower[:, PARENT] = row + np.arange(len(lower)) // BOXES
        row += len(upper)
    levels[0][:, CONTENT] = first + BOXES * np.arange(len(levels[0]))
    return np.concatenate(levels[::-1]), len(levels)


def _rows(entries: Floats) -> Floats:
    """Return rows of sixteen entries of four numbers each, the last row of those that are left."""
    count = -(-len(entries) // BOXES)
    padded = np.full((count * BOXES, 4), np.nan)
    padded[: len(entries)] = entries
    rows = np.zeros((count, TREE_COLUMNS))
    rows[:, : 4 * BOXES] = padded.reshape(count, BOXES, 4).transpose(0, 2, 1).reshape(count, 4 * BOXES)
    return rows


# Number of lines in a hollow up to which all pairs of them are compared, a few milliseconds.
MOST_LINES = 1024
# Joints compared at once, so that the arrays of pairs stay in the cache.
ROWS = 64
# Least angle, about, between a ray of the sector and a ray from its start to any joint above.
ESCAPE_MARGIN = 2.0**-10
# Distance from the ends of its line, in multiples of the slack at joints, from which on a ray may escape: the
# ends are then 16 slacks or more from the ray, and a neighbour that the ray's line crosses behind the start is 2 away.
ESCAPE_ROOM = 2.0**15


def escape_sectors(points: Floats, size: float) -> Floats:
    """Return the sectors of escape of the lines between consecutive points, which end at the two ends of an opening.

    Let a ray leave a line from A to B upwards. The pieces from B on end on its right, at an end of the opening, those
    up to A on its left; to be in its way they would cross the ray in its direction from A or that from B. Of a piece
    after B only the part above the start of such a ray matters. It is on the right if its ends are, and these are below
    a slope. The greatest of these slopes, and the same on the left, limit the sector of the line.

    Parameters
    ----------
    points : array, shape (n + 1, 2)
    size : float
        Size of the hollow.

    Returns
    -------
    array, shape (n, 2)
        A ray of velocity (vx, vy) that leaves the line at a distance from its ends escapes if vx < right * vy and
        -vx < left * vy, where right and left are the two numbers of a row; both are 0 for a line without one.

    Examples
    --------
    >>> escape_sectors(np.array([[0.0, 0.0], [0.5, -1.0], [1.0, 0.0]]), 1.0).round(2).tolist()
    [[0.5, 0.5], [0.5, 0.5]]
    """
    count = len(points) - 1
    sectors = np.zeros((count, 2))
    if count > MOST_LINES:
        return sectors
    slack = JOINT_ULPS * EPS * size
    right, left = _slopes(points, slack), _slopes(points[::-1] * (-1.0, 1.0), slack)[::-1]
    is_alone = _is_alone(points, NEARBY * size)
    for column, slopes in enumerate((right, left)):
        slope = np.maximum(slopes[:-1], slopes[1:])
        sectors[:, column] = is_alone / (slope + ESCAPE_MARGIN * (1.0 + slope * slope))
    return np.asarray(sectors * (sectors > 0.0).all(axis=1, keepdims=True))


def _slopes(points: Floats, slack: float) -> Floats:
    """Return the greatest slope from each point to the later pieces above it, at least 0; inf if one is on the left."""
    slopes = np.zeros(len(points))
    start, end = points[:-1], points[1:]
    for first in range(0, len(points), ROWS):
        numbers = np.arange(first, min(first + ROWS, len(points)))[:, np.newaxis]
        x, level = points[numbers, 0], points[numbers, 1] - 4.0 * slack
        later, is_next = np.arange(len(start)) >= numbers, np.arange(len(start)) == numbers
        worst = np.zeros(later.shape)
        for here, there in ((start, end), (end, start)):
            matters = later & (np.maximum(here[:, 1], there[:, 1]) >= level) & ~(is_next & (here is start))
            # the end of the part above the level
            below = here[:, 1] < level
            with np.errstate(divide="ignore", invalid="ignore"):
                part = np.where(below, (level - here[:, 1]) / (there[:, 1] - here[:, 1]), 0.0)
            dx = here[:, 0] + part * (there[:, 0] - here[:, 0]) - x
            dy = np.where(below, 0.0, here[:, 1] - level)
            # of the piece that starts here only the other end counts
            matters &= ~(is_next & below)
            slope = np.where(dx > slack, dy / np.where(dx > slack, dx, 1.0), np.inf)
            worst = np.maximum(worst, np.where(matters, slope, 0.0))
        slopes[first : first + len(numbers)] = worst.max(axis=1)
    return slopes


def _is_alone(points: Floats, close: float) -> NDArray[np.bool_]:
    """Return which lines are long, far from all others but their neighbours, and at no spike."""
    start, end = points[:-1], points[1:]
    edges = end - start
    count, lengths = len(edges), np.hypot(edges[:, 0], edges[:, 1])
    low, high = np.minimum(start, end), np.maximum(start, end)
    alone = lengths > 2.0 * close
    alone[1:] &= lengths[:-1] > 2.0 * close
    alone[:-1] &= lengths[1:] > 2.0 * close
    turn = edges[:-1, 0] * edges[1:, 1] - edges[:-1, 1] * edges[1:, 0]
    along = edges[:-1, 0] * edges[1:, 0] + edges[:-1, 1] * edges[1:, 1]
    is_spike = (along < 0.0) & (np.abs(turn) < ESCAPE_MARGIN * lengths[:-1] * lengths[1:])
    alone[1:] &= ~is_spike
    alone[:-1] &= ~is_spike
    for first in range(0, count, ROWS):
        rows = slice(first, min(first + ROWS, count))
        others = np.abs(np.arange(count) - np.arange(count)[rows, np.newaxis]) > 1
        gap = np.maximum(low - high[rows, np.newaxis], low[rows, np.newaxis] - high).max(axis=-1)
        alone[rows] &= ~(others & (gap <= 2.0 * close)).any(axis=1)
    return alone
