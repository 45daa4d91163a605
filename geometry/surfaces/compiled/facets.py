"""Rays on a triangulated periodic height map, column by column: compiled. Loads numba.

Over each square of the grid stand two columns, whose tops are the facets on both sides of the diagonal through the
corners (0, 0) and (1, 1). In a column, (p, q) with 0 <= q <= p <= 1 are the coordinates in the square, exchanged in the
column above the diagonal, so that both columns have the same formulas, and each crossing exchanges p and q once more. A
ray carries its height f over the surface from column to column: f is continuous across edges and linear in a column, so
that the ray hits a facet where f changes its sign inside a column. No point is assigned to a facet, so that no ray is
lost at an edge or a vertex. Each bounce adds to the upward velocity, because all facets look up, so that rays end.
"""

from __future__ import annotations

import math

import numpy as np

from ...scene.compiled.compiling import compiled, inlined, is_raised, linked

ESCAPED, GRAZING, BOUNCE_LIMIT = 0, 2, 3
# Columns that a ray may cross, 10 ms of work. Level rays in a straight valley, and some grazing ones over slopes of
# 100, reach it.
MOST_STEPS = 10**6
# Sides of a column: p = 1, q = 0 and the diagonal p = q.
FAR, NEAR, DIAGONAL = 1, 2, 3


@inlined
def first_side(p, q, a, b):
    """-> (time, side): where a ray leaves its column; never for a vertical one. The sign tests keep divisors from 0."""
    t, side = (1.0 - p) / a if a > 0.0 else np.inf, FAR
    if b < 0.0 and -q / b < t:
        t, side = -q / b, NEAR
    if a < b and (p - q) / (b - a) < t:
        t, side = (p - q) / (b - a), DIAGONAL
    return max(t, 0.0), side


@inlined
def moved(index, shift, step, count):
    """-> (index, shift): the next row or column of the map, and the sum of the periods that were crossed."""
    new = index + step
    crossed = count if new == count else -count if new < 0 else 0
    return new - crossed, shift + crossed


@linked
def follow(heights, top, scale, ray, most, path):
    """-> (x, y, a, b, c, bounces, outcome): the end of a ray (x, y, a, b, c) from the height of the highest point.

    The hits are added to ``path`` from its second row on, if it has rows.
    """
    x, y, a, b, c = ray
    rows, columns = heights.shape[0] - 1, heights.shape[1] - 1
    i, j = math.floor(x), math.floor(y)
    p, q, upper, (mp, mq) = x - i, y - j, False, scale
    if q > p:
        upper, p, q, a, b, mp, mq = True, q, p, b, a, mq, mp
    shift_x, shift_y = i // rows * rows, j // columns * columns
    i, j = i - shift_x, j - shift_y
    w, f, own, bounces, outcome = top, -1.0, False, 0, BOUNCE_LIMIT
    for _ in range(MOST_STEPS):
        low, high = heights[i, j], heights[i + 1, j + 1]
        corner = heights[i, j + 1] if upper else heights[i + 1, j]
        gp, gq = corner - low, high - corner
        if f < 0.0:
            f = max(w - low - gp * p - gq * q, 0.0)
        if c == 0.0 and w >= top:
            outcome = GRAZING
            break
        rate = c - gp * a - gq * b
        t, side = first_side(p, q, a, b)
        if c > 0.0 and w + t * c >= top:
            outcome, t = ESCAPED, max((top - w) / c, 0.0)
            p, q = p + t * a, q + t * b
            break
        if rate < 0.0 and not own and f + t * rate < 0.0:
            if bounces == most:
                break
            t, k = f / -rate, 2.0 * rate / (1.0 + gp * gp * mp + gq * gq * mq)
            p, q, w, f = p + t * a, q + t * b, w + t * c, 0.0
            a, b, c = a + k * gp * mp, b + k * gq * mq, c - k
            # the same facet is hit again only after a side: else rounding would loop
            own, bounces = True, bounces + 1
            if bounces < len(path):
                path[bounces] = (q if upper else p) + i + shift_x, (p if upper else q) + j + shift_y, w
            continue
        p, q, w, f = p + t * a, q + t * b, w + t * c, max(f + t * rate, 0.0)
        if side == DIAGONAL:
            p, q = q, p
        else:
            if (side == FAR) != upper:
                i, shift_x = moved(i, shift_x, 1 if side == FAR else -1, rows)
            else:
                j, shift_y = moved(j, shift_y, 1 if side == FAR else -1, columns)
            p, q = (q, 0.0) if side == FAR else (1.0, p)
        upper, own, a, b, mp, mq = not upper, False, b, a, mq, mp
    p, q, a, b = (q, p, b, a) if upper else (p, q, a, b)
    return p + i + shift_x, q + j + shift_y, a, b, c, bounces, outcome


@compiled
def trace_facets(heights, top, scale, points, velocities, most, path, results, stop):
    """Trace rays from the height ``top`` of the highest point until the flag is raised.

    ``heights`` has its first row and column again at its ends. Points are in squares of the grid, velocities in squares
    and, upwards, in lengths; both are replaced by those of the end. ``scale`` has the squares of the numbers of squares
    a length. The results to fill are the numbers of bounces and the statuses.
    """
    bounces, status = results
    for ray in range(len(points)):
        if is_raised(stop):
            return
        (x, y), (a, b, c) = points[ray], velocities[ray]
        x, y, a, b, c, bounces[ray], status[ray] = follow(heights, top, scale, (x, y, a, b, c), most, path)
        points[ray] = x, y
        velocities[ray] = a, b, c
