"""A plain tracer of all walls, one ray at a time, from the definitions, in doubles or in 50 digits.

It takes the copies of the cell one after the other in the order in which the ray comes to them; nothing is known of
highest points or openings. Segments are met by a 2x2 system, arcs by the quadratic about their centre, Bezier pieces by
the roots of a polynomial; the nearest front wins. In doubles it is blind very near corners; in 50 digits it tells apart
the faces of plates thinner than doubles.

The pieces are those that were given, or in `trace_precisely` those that the tables of the scene define: joints are
doubles, a circular arc is the one through both of its joints that subtends the double in its table (ellipses are
circles in stretched coordinates), a Bezier piece has the coefficients of its table but the highest, which takes it to
its end joint. There, flights between two vertical sides with nothing between them, and hops along one circular arc with
nothing under it, are counted by one division instead of one by one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import mpmath as mp
import numpy as np

from asperity import geometry as geo
from asperity.geometry.curves.columns import (
    CURVATURE,
    END_X,
    END_Y,
    LEFT,
    RIGHT,
    SPAN,
    START_X,
    START_Y,
    STARTS_LINE,
    STRETCH,
    X1,
    X2,
    X3,
    Y1,
    Y2,
    Y3,
)

# Digits of rays and, in tables, guard digits; a double root of so many digits is two roots.
DIGITS, GUARD = 50, 25
# A segment is looked at unless doubles, off by this fraction of the cell, show that its ends are on one side.
ROOM = 1e-9
# Rounding of the ends of an arc in doubles, as a fraction of its radius.
ROOM_OF_ARCS = 1e-15
# Determinant, as a fraction of the cell, from which on doubles know the time to a segment within ROOM / STEEP.
STEEP = 1e-3
# Copies of the cell that are looked at together; after the last ones a ray without a hit is given up.
BLOCKS = (1, 1, *(2**k for k in range(1, 12)), *(2**12,) * 250)
# Crossings between two sides, or hops along an arc, that are worth a division.
FEW = 4


class PlainRay(NamedTuple):
    """Where a ray leaves y = 0, at which angle, after how many hits, its path, and how clear its hits are.

    The path is pairs of copy and piece, or of "run" and the hits left out; ``length`` is its length but for runs;
    ``from_joint`` the least distance of a hit from the ends of its piece, as a fraction of the piece, and ``incidence``
    the least sine of an angle to a piece.
    """

    x: Any
    theta: Any
    hits: int
    path: tuple[tuple[int | str, int], ...]
    length: float
    from_joint: float
    incidence: float


class Line(NamedTuple):
    """A segment between two points."""

    start: tuple[float, float]
    end: tuple[float, float]

    def span(self):
        """The least and the greatest x, or beyond."""
        return sorted((self.start[0], self.end[0]))

    def hits(self, tracer, p, v):
        """Time, fraction of the piece and normal of every hit."""
        (ax, ay), (bx, by) = (map(tracer.real, end) for end in self)
        ex, ey, rx, ry = bx - ax, by - ay, p[0] - ax, p[1] - ay
        det = ex * v[1] - ey * v[0]
        if det < 0:
            s = (rx * v[1] - ry * v[0]) / det
            if 0 <= s <= 1:
                yield (rx * ey - ry * ex) / det, s, (-ey, ex)


class Arc(NamedTuple):
    """An arc about a centre, ``half`` to either side of the angle of its middle in coordinates in which it is round."""

    center: tuple[Any, Any]
    semi_axes: tuple[Any, Any]
    direction: float
    middle: Any
    half: Any

    def span(self):
        low, high, radius = self.middle - self.half, self.middle + self.half, self.semi_axes[0]
        turns = (low, high, *(k * math.pi for k in range(math.ceil(low / math.pi), math.floor(high / math.pi) + 1)))
        ends = [float(self.center[0] + radius * mp.cos(turn)) for turn in turns]
        return min(ends) - ROOM_OF_ARCS * float(radius), max(ends) + ROOM_OF_ARCS * float(radius)

    def hits(self, tracer, p, v):
        maths, (a, b) = tracer.maths, self.semi_axes
        px, py, vx, vy = (p[0] - self.center[0]) / a, (p[1] - self.center[1]) / b, v[0] / a, v[1] / b
        qa, qb, qc = vx * vx + vy * vy, px * vx + py * vy, px * px + py * py - 1
        square = qb * qb - qa * qc
        for root in (-1, 1) if square >= 0 else ():
            t = (-qb + root * maths.sqrt(square)) / qa
            ux, uy = px + t * vx, py + t * vy
            turn = _within(maths, maths.atan2(uy, ux) - self.middle)
            if abs(turn) <= self.half:
                yield t, (turn + self.half) / (2 * self.half), (-self.direction * ux / a, -self.direction * uy / b)


class Curve(NamedTuple):
    """A polynomial curve: the coefficients of 1, s, s^2, ... for s from 0 to 1."""

    coefficients: list[tuple[Any, Any]]

    def span(self):
        (x, _), *rest = self.coefficients
        reach = float(sum(abs(c) for c, _ in rest))
        return float(x) - reach, float(x) + reach

    def hits(self, tracer, p, v):
        c = self.coefficients
        poly = [x * v[1] - y * v[0] for x, y in c]
        poly[0] -= p[0] * v[1] - p[1] * v[0]
        while len(poly) > 1 and abs(poly[-1]) < tracer.none:
            poly.pop()
        for root in tracer.roots(poly[::-1]) if len(poly) > 1 else ():
            s = tracer.real(root.real)
            if abs(root.imag) < tracer.real_root and -tracer.none <= s <= 1 + tracer.none:
                x, y = (sum(one[i] * s**k for k, one in enumerate(c)) for i in (0, 1))
                tx, ty = (sum(k * one[i] * s ** (k - 1) for k, one in enumerate(c) if k) for i in (0, 1))
                yield (x - p[0]) * v[0] + (y - p[1]) * v[1], s, (-ty, tx)


def _within(maths, angle):
    """The angle between -pi and pi."""
    return angle - 2 * maths.pi * math.floor(angle / (2 * maths.pi) + 0.5)


def given_pieces(wall, real):
    """The pieces of a wall as they were given."""
    for piece in (*wall.pieces, *(piece for island in wall.islands for piece in island)):
        if isinstance(piece, geo.Segment):
            yield Line(tuple(piece.start), tuple(piece.end))
        elif isinstance(piece, geo.Arc):
            low, high = sorted((real(piece.start_angle), real(piece.end_angle)))
            center, axes = (tuple(map(real, pair)) for pair in (piece.center, piece.semi_axes))
            yield Arc(center, axes, piece.direction, (low + high) / 2, (high - low) / 2)
        else:
            control = [tuple(map(real, point)) for point in piece.control_points]
            n = len(control) - 1
            yield Curve([
                tuple(sum((-1) ** (k - j) * math.comb(n, k) * math.comb(k, j) * control[j][i] for j in range(k + 1))
                      for i in (0, 1)) for k in range(n + 1)
            ])  # fmt: skip


def table_pieces(scene):
    """The pieces that the tables of a scene define."""
    for j in np.flatnonzero(scene.joints[:-1, STARTS_LINE] > 0):
        yield Line(*(tuple(end) for end in scene.joints[j : j + 2, :2].tolist()))
    for row in scene.arcs:
        stretch, half = mp.mpf(row[STRETCH]), mp.mpf(row[SPAN]) / 2
        x0, y0, x1, y1 = (mp.mpf(row[column]) for column in (START_X, START_Y, END_X, END_Y))
        ex, ey, direction = x1 - x0, stretch * (y1 - y0), 1 if row[CURVATURE] > 0 else -1
        chord = mp.hypot(ex, ey)
        radius = chord / 2 / mp.sin(half)
        height = direction * radius * mp.cos(half) / chord
        center = (x0 + x1) / 2 - height * ey, (y0 + y1) / 2 + height * ex / stretch
        yield Arc(center, (radius, radius / stretch), direction, mp.atan2(-direction * ex, direction * ey), half)
    for row in scene.beziers:
        c = [(mp.mpf(row[x]), mp.mpf(row[y])) for x, y in ((START_X, START_Y), (X1, Y1), (X2, Y2), (X3, Y3))]
        top = 2 if row[X3] == 0 and row[Y3] == 0 else 3
        end = row[END_X], row[END_Y]
        yield Curve([*c[:top], tuple(mp.mpf(end[i]) - mp.fsum(one[i] for one in c[:top]) for i in (0, 1))])


class PlainTracer:
    """Follows rays through a wall in doubles, or in the digits of mpmath's context.

    ``joints`` are given if runs are to be counted at once where no joint is in their way.
    """

    def __init__(self, wall, precise=False, pieces=None, joints=None):
        self.real, self.maths = (mp.mpf, mp.mp) if precise else (float, math)
        self.period, size = self.real(wall.period), wall.period + wall.depth
        # nearer hits are the ray's own start, or the other face of a plate without thickness
        self.near = wall.period * (mp.mpf(10) ** -40 if precise else 1e-10)
        # smaller coefficients of polynomials, or steps beyond an end of a curve, are none; a root is real up to this
        self.none, self.real_root = (mp.mpf(10) ** -DIGITS,) * 2 if precise else (0.0, 1e-9)
        self.roots = (lambda poly: mp.polyroots(poly, maxsteps=500, extraprec=200)) if precise else np.roots
        self.pieces = list(given_pieces(wall, self.real) if pieces is None else pieces)
        spans = [piece.span() for piece in self.pieces]
        self.low, self.high = min(low for low, _ in spans), max(high for _, high in spans)
        self.straight = np.array([isinstance(piece, Line) for piece in self.pieces])
        self.ends = np.array([piece if isinstance(piece, Line) else ((0.0, 0.0), (0.0, 0.0)) for piece in self.pieces])
        self.steep, self.joints = STEEP * size, joints

    def trace(self, x, theta, limit=100_000):
        """Follow a ray to its exit; None if it is still inside after so many hits, or has met nothing for long."""
        real, maths = self.real, self.maths
        p, theta = (real(x), real(0)), real(theta)
        v = (-maths.cos(theta), -maths.sin(theta))
        path, hits, length, joint, incidence = [], 0, 0.0, math.inf, math.inf
        while hits <= limit:
            leave = -p[1] / v[1] if v[1] > 0 and path else math.inf
            found = self._first_hit(p, v, leave, self.near if path else -self.near)
            if found is None:
                if leave == math.inf:
                    return None
                x, theta = p[0] + leave * v[0], maths.atan2(v[1], v[0])
                return PlainRay(x, theta, hits, tuple(path), length + float(leave), joint, incidence)
            t, s, normal, where = found
            size = maths.sqrt(normal[0] ** 2 + normal[1] ** 2)
            normal = (normal[0] / size, normal[1] / size)
            speed = v[0] * normal[0] + v[1] * normal[1]
            p = (p[0] + t * v[0], p[1] + t * v[1])
            v = (v[0] - 2 * speed * normal[0], v[1] - 2 * speed * normal[1])
            before = path[-1] if path else None
            path.append(where)
            hits, length = hits + 1, length + float(t)
            joint, incidence = min(joint, float(s), float(1 - s)), min(incidence, float(-speed))
            if self.joints is not None and before is not None:
                number, p, v = self._run(before, where, p, v, limit - hits)
                hits += number
                path += [("run", number)] if number else []
        return None

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
                for t, s, normal in self.pieces[k].hits(self, (p[0] - shift, p[1]), v):
                    # of coincident pieces the last, an island, is met
                    is_front = normal[0] * v[0] + normal[1] * v[1] < 0
                    if is_front and after < t <= leave + self.near and (best is None or t < best[0] + self.near):
                        best = t, s, normal, (int(copies[row]), int(k))
            copy += step * block
            if self._entry(copy * self.period, p, v) > (leave if best is None else best[0]) + self.near:
                return best
        return None

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
        steep = left - right > self.steep
        time = np.where(steep, (left * far - right * near) / np.where(steep, left - right, 1.0), 0.0)
        surely = self.straight & steep & (left > ROOM) & (right < -ROOM) & (time > ROOM)
        first = time[surely].min(initial=np.inf) + ROOM / STEEP
        possible = (left >= -ROOM) & (right <= ROOM) & (time >= -ROOM / STEEP) & (time <= first)
        return np.argwhere(~self.straight | possible)

    def _run(self, before, where, p, v, limit):
        """Hits to leave out after these two, and the position and velocity after them."""
        piece, other, number = self.pieces[where[1]], before[0] == where[0] and self.pieces[before[1]], 0
        if isinstance(piece, Line) and isinstance(other, Line) and piece != other and self._faces(piece, other):
            low, high = max(min(one.start[1], one.end[1]) for one in (piece, other)), 0
            high = min(max(one.start[1], one.end[1]) for one in (piece, other))
            step = abs((self.real(piece.start[0]) - other.start[0]) / v[0]) * v[1]
            if low < p[1] < high and step != 0:
                number = int(((low if step < 0 else high) - p[1]) / step) - 1
                number -= number % 2
            if FEW <= number <= limit:
                return number, (p[0], p[1] + number * step), v
        elif (
            isinstance(piece, Arc)
            and piece is other
            and piece.direction > 0
            and piece.semi_axes[0] == piece.semi_axes[1]
        ):
            center = piece.center[0] + where[0] * self.period, piece.center[1]
            r = p[0] - center[0], p[1] - center[1]
            turn = _within(mp.mp, 2 * mp.atan2(-(r[0] * v[0] + r[1] * v[1]), r[0] * v[1] - r[1] * v[0]))
            place = _within(mp.mp, mp.atan2(r[1], r[0]) - piece.middle)
            if turn != 0:
                number = int((piece.half - place if turn > 0 else piece.half + place) / abs(turn)) - 1
            if FEW <= number <= limit:
                r, v = (_turned(vector, number * turn) for vector in (r, v))
                return number, (center[0] + r[0], center[1] + r[1]), v
        return 0, p, v

    def _faces(self, one, other):
        """Whether two lines are vertical and no joint lies between the parts of them that face each other."""
        if one.start[0] != one.end[0] or other.start[0] != other.end[0] or one.start[0] == other.start[0]:
            return False
        left, right = sorted((one.start[0], other.start[0]))
        low = max(min(line.start[1], line.end[1]) for line in (one, other))
        high = min(max(line.start[1], line.end[1]) for line in (one, other))
        return not any(left < x < right and low < y < high for x, y in self.joints)


def _turned(vector, angle):
    c, s = mp.cos(angle), mp.sin(angle)
    return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]


def trace_precisely(wall, x, theta, limit=2000):
    """Follow one ray, whose position and angle are numbers, through the wall that the tables of its scene define."""
    scene = wall.scene
    with mp.workdps(DIGITS + GUARD):
        x, theta = mp.mpf(x), mp.mpf(theta)
        place = x - mp.floor(x / wall.period) * wall.period
        if not any(hollow[LEFT] < place < hollow[RIGHT] for hollow in scene.hollows):
            return PlainRay(x, mp.pi - theta, 1, (), 0.0, math.inf, float(mp.sin(theta)))
        pieces = list(table_pieces(scene))
        # a focusing arc lies beyond its chord; other curves may reach between two sides
        clear = not scene.is_open and all(
            isinstance(one, Line) or (isinstance(one, Arc) and one.direction > 0) for one in pieces
        )
        return PlainTracer(wall, True, pieces, scene.joints[:, :2].tolist() if clear else None).trace(x, theta, limit)


def trace_plainly(wall, x, theta):
    """(x', theta', collisions) of one ray, in doubles."""
    ray = PlainTracer(wall).trace(x, theta)
    return ray.x, ray.theta, ray.hits
