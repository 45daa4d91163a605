"""The channels and wedges of a hollow: pairs of straight pieces that face each other with nothing in between."""

from __future__ import annotations

from fractions import Fraction
from math import atan2, cos, hypot, sin

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ..curves import columns as c

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
