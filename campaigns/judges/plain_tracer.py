"""A plain tracer: the compiled loop's twin, written from the definitions, one ray at a time, with other formulas.

Segments by a 2x2 system, arcs by the quadratic about their centre, Bezier pieces by polynomial roots, the nearest
root beyond a small distance wins. It is slow, and blind very near corners; the tests keep away from those.
"""

from __future__ import annotations

import math

import numpy as np

from asperity.geometry import Arc, Bezier, Segment

# Twin only: hits nearer than this are taken for the ray's own start.
NEAR = 1e-10


def _segment_hits(piece, p, v):
    (ax, ay), (bx, by) = piece.start, piece.end
    ex, ey = bx - ax, by - ay
    det = ex * v[1] - ey * v[0]
    if det == 0.0:
        return
    rx, ry = p[0] - ax, p[1] - ay
    s = (rx * v[1] - ry * v[0]) / det
    t = (rx * ey - ry * ex) / det
    if 0.0 <= s <= 1.0:
        yield t, (-ey, ex)


def _arc_hits(piece, p, v):
    (cx, cy), (a, b) = piece.center, piece.semi_axes
    px, py, vx, vy = (p[0] - cx) / a, (p[1] - cy) / b, v[0] / a, v[1] / b
    qa, qb, qc = vx * vx + vy * vy, px * vx + py * vy, px * px + py * py - 1.0
    disc = qb * qb - qa * qc
    if disc < 0.0:
        return
    low, high = sorted((piece.start_angle, piece.end_angle))
    for t in ((-qb - math.sqrt(disc)) / qa, (-qb + math.sqrt(disc)) / qa):
        ux, uy = px + t * vx, py + t * vy
        angle = math.atan2(uy, ux)
        angle += 2 * math.pi * math.ceil((low - angle) / (2 * math.pi))
        if angle <= high:
            yield t, (ux / a, uy / b)


def _bezier_hits(piece, p, v):
    points = np.array(piece.control_points, dtype=float)
    n = len(points) - 1
    cross = (points[:, 0] - p[0]) * v[1] - (points[:, 1] - p[1]) * v[0]
    binomial = [math.comb(n, k) for k in range(n + 1)]
    poly = sum(
        binomial[k] * cross[k] * np.polynomial.Polynomial([0, 1]) ** k * np.polynomial.Polynomial([1, -1]) ** (n - k)
        for k in range(n + 1)
    )
    for root in poly.roots():
        if abs(root.imag) < 1e-9 and 0.0 <= root.real <= 1.0:
            s = float(root.real)
            x, y = piece.point(s)
            tx, ty = piece.tangent(s)
            yield (x - p[0]) * v[0] + (y - p[1]) * v[1], (-ty, tx)


HITS = {Segment: _segment_hits, Arc: _arc_hits, Bezier: _bezier_hits}


def _opens(wall, x):
    """Whether a wall that begins at a highest point, at y = 0, is open at x; above a lower one y = 0 is free."""
    return wall.origin[1] < 0.0 or any(hollow.left < x < hollow.right for hollow in wall.hollows)


def trace_plainly(wall, x, theta, limit=100_000, cells=25):
    """Return (x', theta', collisions) of one ray; an open wall is unfolded over so many cells on either side."""
    base = math.floor(x / wall.period) * wall.period
    p, v = [x - base, 0.0], [-math.cos(theta), -math.sin(theta)]
    pieces = [*wall.pieces, *(piece for island in wall.islands for piece in island)]
    offsets = (
        [0.0] if wall.closes and wall.origin == (0.0, 0.0) else [k * wall.period for k in range(-cells, cells + 1)]
    )
    for bounce in range(limit):
        best, normal = math.inf, None
        for offset in offsets:
            for piece in pieces:
                for t, n in HITS[type(piece)](piece, (p[0] - offset, p[1]), v):
                    if (NEAR if bounce else 0.0) < t < best or t == bounce == 0:
                        best, normal = t, n
        exit_time = -p[1] / v[1] if v[1] > 0.0 else math.inf
        if bounce and exit_time < best + NEAR:
            there = p[0] + exit_time * v[0]
            # beside the openings, y = 0 is the underside of a plate and not the way out
            if not wall.hollows or _opens(wall, there) or exit_time == 0.0:
                return there + base, math.atan2(v[1], v[0]), bounce
        if normal is None:
            raise RuntimeError("the ray left the unfolded cells")
        p = [p[0] + best * v[0], p[1] + best * v[1]]
        scale = math.hypot(*normal)
        normal = (normal[0] / scale, normal[1] / scale)
        w = 2.0 * (v[0] * normal[0] + v[1] * normal[1])
        v = [v[0] - w * normal[0], v[1] - w * normal[1]]
    raise RuntimeError("the ray did not leave")
