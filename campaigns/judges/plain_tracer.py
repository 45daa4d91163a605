"""A plain tracer of all walls, one ray at a time, from the definitions, in doubles or in 50 digits.

It takes the pieces as they were given, and the copies of the cell one after the other in the order in which the ray
comes to them; nothing is known of hollows, highest points or runs. Segments are met by a 2x2 system, arcs by the
quadratic about their centre, Bezier pieces by the roots of a polynomial; the nearest front wins.
In doubles it is blind very near corners; in 50 digits it tells apart the faces of plates thinner than doubles.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mpmath as mp
import numpy as np

from asperity.geometry import Arc, Bezier, Segment

DIGITS = 50
# A segment is looked at unless doubles, off by this fraction of the cell, show that its ends are on one side.
ROOM = 1e-9
# Determinant, as a fraction of the cell, from which on doubles know the time to a segment within ROOM / STEEP.
STEEP = 1e-3
# Copies of the cell that are looked at together; after the last ones a ray without a hit is given up.
BLOCKS = (1, 1, *(2**k for k in range(1, 12)), *(2**12,) * 250)


class PlainRay(NamedTuple):
    """Where a ray leaves y = 0, at which angle, its path as pairs of copy and piece, and how clear its hits are.

    ``length`` is that of the path; ``from_joint`` the least distance of a hit from the ends of its piece, as a fraction
    of the piece, and ``incidence`` the least sine of an angle to a piece.
    """

    x: float
    theta: float
    path: tuple[tuple[int, int], ...]
    length: float
    from_joint: float
    incidence: float

    @property
    def hits(self):
        """The number of collisions."""
        return len(self.path)


class PlainTracer:
    """Follows rays through a wall in doubles, or in the digits of mpmath's context."""

    def __init__(self, wall, precise=False):
        self.real, self.maths = (mp.mpf, mp.mp) if precise else (float, math)
        # nearer hits are the ray's own start, or the other face of a plate without thickness
        self.near = wall.period * (mp.mpf(10) ** -40 if precise else 1e-10)
        self.precise, self.pieces = precise, [*wall.pieces, *(piece for island in wall.islands for piece in island)]
        self.period, self.size = self.real(wall.period), wall.period + wall.depth
        boxes = np.array([piece.box for piece in self.pieces])
        self.low, self.high = boxes[:, 0].min(), boxes[:, 2].max()
        self.straight = np.array([isinstance(piece, Segment) for piece in self.pieces])
        self.ends = np.array([[piece.start, piece.end] for piece in self.pieces])
        self.exact = [[tuple(map(self.real, end)) for end in ends] for ends in self.ends.tolist()]

    def trace(self, x, theta, limit=100_000):
        """Follow a ray to its exit; an ArithmeticError if it is still inside after so many hits."""
        real, maths = self.real, self.maths
        p, theta = (real(x), real(0)), real(theta)
        v = (-maths.cos(theta), -maths.sin(theta))
        path, length, joint, incidence = [], 0.0, math.inf, math.inf
        while len(path) <= limit:
            leave = -p[1] / v[1] if v[1] > 0 and path else math.inf
            found = self._first_hit(p, v, leave, -self.near if not path else self.near)
            if found is None:
                if leave == math.inf:
                    break
                return PlainRay(
                    p[0] + leave * v[0], maths.atan2(v[1], v[0]), tuple(path), length + float(leave), joint, incidence
                )
            t, s, normal, where = found
            size = maths.sqrt(normal[0] ** 2 + normal[1] ** 2)
            normal = (normal[0] / size, normal[1] / size)
            speed = v[0] * normal[0] + v[1] * normal[1]
            p = (p[0] + t * v[0], p[1] + t * v[1])
            v = (v[0] - 2 * speed * normal[0], v[1] - 2 * speed * normal[1])
            path.append(where)
            length += float(t)
            joint, incidence = min(joint, float(s), float(1 - s)), min(incidence, float(-speed))
        raise ArithmeticError(f"still inside after {len(path)} hits")

    def _first_hit(self, p, v, leave, after):
        """Time, fraction of the piece, normal, and (copy, piece) of the first hit before the exit, or None."""
        best, forward = None, v[0] > 0
        gone = (float(p[0]) - (self.high if forward else self.low)) / float(self.period)
        copy, step = (math.ceil(gone - ROOM), 1) if forward else (math.floor(gone + ROOM), -1)
        for block in BLOCKS:
            copies = copy + step * np.arange(block)
            for row, k in self._candidates(copies, p, v):
                shift = int(copies[row]) * self.period
                if self._entry(shift, p, v) > (leave if best is None else best[0]) + self.near:
                    return best
                for t, s, normal in HITS[type(self.pieces[k])](self, k, (p[0] - shift, p[1]), v):
                    # of coincident pieces the last, an island, is met
                    is_front = normal[0] * v[0] + normal[1] * v[1] < 0
                    if is_front and after < t <= leave + self.near and (best is None or t < best[0] + self.near):
                        best = t, s, normal, (int(copies[row]), int(k))
            copy += step * block
            if self._entry(copy * self.period, p, v) > (leave if best is None else best[0]) + self.near:
                return best
        raise ArithmeticError("no hit within a million cells")

    def _entry(self, shift, p, v):
        """The time at which a ray comes to a copy of the cell."""
        return ((self.low if v[0] > 0 else self.high) + shift - p[0]) / v[0] if v[0] != 0 else 0.0

    def _candidates(self, copies, p, v):
        """All curves, and the segments that doubles do not show to be missed, behind, or behind another one."""
        vx, vy = float(v[0]), float(v[1])
        dx = self.ends[..., 0] - (float(p[0]) - copies[:, None, None] * float(self.period))
        dy = self.ends[..., 1] - float(p[1])
        left, right = np.moveaxis(dx * vy - dy * vx, -1, 0)
        near, far = np.moveaxis(dx * vx + dy * vy, -1, 0)
        # nearly parallel segments have no certain time
        steep = left - right > STEEP * self.size
        time = np.where(steep, (left * far - right * near) / np.where(steep, left - right, 1.0), 0.0)
        surely = self.straight & steep & (left > ROOM) & (right < -ROOM) & (time > ROOM)
        first = time[surely].min(initial=np.inf) + ROOM / STEEP
        possible = (left >= -ROOM) & (right <= ROOM) & (time >= -ROOM / STEEP) & (time <= first)
        return np.argwhere(~self.straight | possible)

    def _segment(self, k, p, v):
        (ax, ay), (bx, by) = self.exact[k]
        ex, ey, rx, ry = bx - ax, by - ay, p[0] - ax, p[1] - ay
        det = ex * v[1] - ey * v[0]
        if det < 0:
            s = (rx * v[1] - ry * v[0]) / det
            if 0 <= s <= 1:
                yield (rx * ey - ry * ex) / det, s, (-ey, ex)

    def _arc(self, k, p, v):
        piece, maths = self.pieces[k], self.maths
        (cx, cy), (a, b) = map(self.real, piece.center), map(self.real, piece.semi_axes)
        px, py, vx, vy = (p[0] - cx) / a, (p[1] - cy) / b, v[0] / a, v[1] / b
        qa, qb, qc = vx * vx + vy * vy, px * vx + py * vy, px * px + py * py - 1
        square = qb * qb - qa * qc
        low, high = sorted((piece.start_angle, piece.end_angle))
        for root in (-1, 1) if square >= 0 else ():
            t = (-qb + root * maths.sqrt(square)) / qa
            ux, uy = px + t * vx, py + t * vy
            angle = maths.atan2(uy, ux)
            angle += 2 * maths.pi * math.ceil((low - angle) / (2 * maths.pi))
            if angle <= high:
                yield t, (angle - low) / (high - low), (-piece.direction * ux / a, -piece.direction * uy / b)

    def _bezier(self, k, p, v):
        control = [tuple(map(self.real, point)) for point in self.pieces[k].control_points]
        cross = [(x - p[0]) * v[1] - (y - p[1]) * v[0] for x, y in control]
        n = len(cross) - 1
        powers = [
            sum((-1) ** (k - j) * math.comb(n, k) * math.comb(k, j) * cross[j] for j in range(k + 1))
            for k in range(n + 1)
        ]
        roots = mp.polyroots(powers[::-1], maxsteps=500, extraprec=200) if self.precise else np.roots(powers[::-1])
        for root in roots:
            s = self.real(root.real)
            if abs(root.imag) < 1e-9 and 0 <= s <= 1:
                tangent = [
                    sum(n * math.comb(n - 1, k) * (1 - s) ** (n - 1 - k) * s**k * (control[k + 1][i] - control[k][i])
                        for k in range(n)) for i in (0, 1)
                ]  # fmt: skip
                x, y = (
                    sum(math.comb(n, k) * (1 - s) ** (n - k) * s**k * control[k][i] for k in range(n + 1))
                    for i in (0, 1)
                )
                yield (x - p[0]) * v[0] + (y - p[1]) * v[1], s, (-tangent[1], tangent[0])


HITS = {Segment: PlainTracer._segment, Arc: PlainTracer._arc, Bezier: PlainTracer._bezier}


def trace_plainly(wall, x, theta):
    """(x', theta', collisions) of one ray, in doubles."""
    ray = PlainTracer(wall).trace(x, theta)
    return ray.x, ray.theta, ray.hits
