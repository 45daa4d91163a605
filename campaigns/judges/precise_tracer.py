"""A tracer in 50 digits, from the definitions: the judge of the double-double one, with other formulas throughout.

The wall is the one that the scene's tables define: joints are doubles, a circular arc is the one through both of its
joints that subtends the double in its table (ellipses are circles in stretched coordinates), a Bezier piece has the
coefficients of its table but the highest, which takes it to its end joint. Arcs are found by the quadratic about their
centre and the angle there, segments by a 2x2 system, Bezier pieces by the roots of a polynomial. Flights between two
vertical sides with nothing between them, and hops along one circular arc with nothing under it, are counted by one
division instead of one by one.
"""

from __future__ import annotations

from typing import NamedTuple

import mpmath as mp
import numpy as np

from asperity.geometry.scene.columns import (
    BEZIERS_END,
    CIRCLES_END,
    CURVATURE,
    ELLIPSES_END,
    END_X,
    END_Y,
    FIRST_BEZIER,
    FIRST_CIRCLE,
    FIRST_ELLIPSE,
    FIRST_JOINT,
    JOINTS_END,
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

DIGITS = 50
# Guard digits, and the distance below which a hit is the ray's own start: 50 digits lie between the two.
GUARD, NEAR = 25, mp.mpf(10) ** -40
# Of more lines than so many only those are looked at that doubles, off by this fraction of the cell, do not rule out.
MANY_LINES, DOUBLE_ERROR = 64, 1e-9
# Crossings between two sides, or hops along an arc, that are worth a division.
FEW = 4


class PreciseRay(NamedTuple):
    """Position and angle at the exit, or None, the number of bounces, and the pieces hit or the crossings left out."""

    x: mp.mpf | None
    theta: mp.mpf | None
    bounces: int
    itinerary: tuple[tuple[str, int], ...] = ()


def _line_hits(a, b, p, v):
    e, r = (b[0] - a[0], b[1] - a[1]), (p[0] - a[0], p[1] - a[1])
    det = e[0] * v[1] - e[1] * v[0]
    # det < 0: from the free side, which is on the left of the edge
    if det < 0 and 0 <= (r[0] * v[1] - r[1] * v[0]) / det <= 1:
        yield (r[0] * e[1] - r[1] * e[0]) / det, (-e[1], e[0])


def _arc(row):
    """Centre and radius in stretched coordinates, whether it focuses, the angle of its middle and half its span."""
    stretch = mp.mpf(row[STRETCH])
    x0, y0, x1, y1 = (mp.mpf(row[column]) for column in (START_X, START_Y, END_X, END_Y))
    a, b = (x0, stretch * y0), (x1, stretch * y1)
    half, focusing = mp.mpf(row[SPAN]) / 2, row[CURVATURE] > 0
    chord = mp.sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2)
    radius = chord / 2 / mp.sin(half)
    left = (-(b[1] - a[1]) / chord, (b[0] - a[0]) / chord)
    height = radius * mp.cos(half) * (1 if focusing else -1)
    center = ((a[0] + b[0]) / 2 + height * left[0], (a[1] + b[1]) / 2 + height * left[1])
    side = -1 if focusing else 1
    return center, radius, focusing, mp.atan2(side * left[1], side * left[0]), half, stretch


def _arc_hits(arc, p, v):
    center, radius, focusing, middle, half, stretch = arc
    r, w = (p[0] - center[0], stretch * p[1] - center[1]), (v[0], stretch * v[1])
    a, b = w[0] ** 2 + w[1] ** 2, r[0] * w[0] + r[1] * w[1]
    disc = b * b - a * (r[0] ** 2 + r[1] ** 2 - radius**2)
    if disc < 0:
        return
    # the front of a focusing arc is met on the way out of its circle, that of a dispersing one on the way in
    t = (-b + (1 if focusing else -1) * mp.sqrt(disc)) / a
    q = (r[0] + t * w[0], r[1] + t * w[1])
    turn = mp.atan2(q[1], q[0]) - middle
    turn -= 2 * mp.pi * mp.nint(turn / (2 * mp.pi))
    if abs(turn) <= half:
        sign = -1 if focusing else 1
        yield t, (sign * q[0], sign * stretch * q[1])


def _bezier(row):
    """Coefficients of 1, s, s^2, s^3 as points."""
    c = [(mp.mpf(row[x]), mp.mpf(row[y])) for x, y in ((START_X, START_Y), (X1, Y1), (X2, Y2), (X3, Y3))]
    top = 2 if row[X3] == 0 and row[Y3] == 0 else 3
    end = (mp.mpf(row[END_X]), mp.mpf(row[END_Y]))
    c[top] = tuple(end[i] - mp.fsum(c[k][i] for k in range(top)) for i in (0, 1))
    return c[: top + 1]


def _bezier_hits(c, p, v):
    poly = [a[0] * v[1] - a[1] * v[0] for a in c]
    poly[0] -= p[0] * v[1] - p[1] * v[0]
    while len(poly) > 1 and abs(poly[-1]) < mp.mpf(10) ** (-DIGITS):
        poly.pop()
    if len(poly) < 2:
        return
    for root in mp.polyroots(poly[::-1], maxsteps=500, extraprec=200):
        s = mp.re(root)
        if abs(mp.im(root)) < mp.mpf(10) ** (-DIGITS) and -NEAR <= s <= 1 + NEAR:
            x, y = (mp.fsum(a[i] * s**k for k, a in enumerate(c)) for i in (0, 1))
            tx, ty = (mp.fsum(k * a[i] * s ** (k - 1) for k, a in enumerate(c) if k) for i in (0, 1))
            if -ty * v[0] + tx * v[1] < 0:
                yield (x - p[0]) * v[0] + (y - p[1]) * v[1], (-ty, tx)


def _crossings(sides, p, v):
    """Whole crossings, an even number, that a ray leaving one of two vertical sides makes, and the way of each."""
    low = max(min(a[1], b[1]) for a, b in sides)
    high = min(max(a[1], b[1]) for a, b in sides)
    step = abs((sides[0][0][0] - sides[1][0][0]) / v[0]) * v[1]
    if not low < p[1] < high or step == 0:
        return 0, step
    number = int(((low if step < 0 else high) - p[1]) / step) - 1
    return max(0, number - number % 2), step


def _hops(arc, p, v):
    """How many whole hops a ray that leaves a focusing circular arc makes along it, and the angle of each."""
    center, _, focusing, middle, half, stretch = arc
    r = (p[0] - center[0], p[1] - center[1])
    along, inward = r[0] * v[1] - r[1] * v[0], -(r[0] * v[0] + r[1] * v[1])
    turn = 2 * mp.atan2(inward, along)
    turn = turn if turn <= mp.pi else turn - 2 * mp.pi
    if not focusing or stretch != 1 or turn == 0:
        return 0, turn
    place = mp.atan2(r[1], r[0]) - middle
    place -= 2 * mp.pi * mp.nint(place / (2 * mp.pi))
    return max(0, int((half - place if turn > 0 else half + place) / abs(turn)) - 1), turn


def _turned(vector, angle):
    c, s = mp.cos(angle), mp.sin(angle)
    return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]


def _faces(sides, joints):
    """Whether two lines are vertical and no joint lies between the parts of them that face each other."""
    (a, b), (c, d) = sides
    if a[0] != b[0] or c[0] != d[0] or a[0] == c[0]:
        return False
    left, right = sorted((a[0], c[0]))
    low, high = max(min(a[1], b[1]), min(c[1], d[1])), min(max(a[1], b[1]), max(c[1], d[1]))
    return not any(left < x < right and low < y < high for x, y in joints[:, :2])


def trace_precisely(scene, x, theta, limit=2000):
    """Follow one ray whose position and angle are numbers through the wall that the tables define."""
    with mp.workdps(DIGITS + GUARD):
        base = mp.floor(mp.mpf(x) / mp.mpf(scene.cell)) * mp.mpf(scene.cell)
        p = (mp.mpf(x) - base, mp.mpf(0))
        v = (-mp.cos(mp.mpf(theta)), -mp.sin(mp.mpf(theta)))
        inside = [h for h in scene.hollows if h[LEFT] < p[0] < h[RIGHT]]
        if not inside:
            return PreciseRay(mp.mpf(x), mp.pi - mp.mpf(theta), 1)
        hollow = inside[0]
        left, right = mp.mpf(hollow[LEFT]), mp.mpf(hollow[RIGHT])
        starts = np.arange(int(hollow[FIRST_JOINT]), int(hollow[JOINTS_END]) - 1)
        starts = starts[scene.joints[starts, STARTS_LINE] > 0]
        arcs = [
            _arc(row)
            for table, k, end in (
                (scene.circles, FIRST_CIRCLE, CIRCLES_END),
                (scene.ellipses, FIRST_ELLIPSE, ELLIPSES_END),
            )
            for row in table[int(hollow[k]) : int(hollow[end])]
        ]
        own = slice(int(hollow[FIRST_BEZIER]), int(hollow[BEZIERS_END]))
        curves = [_bezier(row) for row in scene.beziers[own]]
        # a focusing arc lies beyond its chord; other curves may reach between two sides
        clear = not scene.is_open and not curves and all(focusing for _, _, focusing, *_ in arcs)
        bounces, itinerary, enters = 0, [], True
        while bounces <= limit:
            while True:
                near = starts if len(starts) <= MANY_LINES else _candidates(scene, starts, p, v)
                hits = [(*h, ("line", int(j))) for j in near for h in _line_hits(*_line(scene, j), p, v)]
                hits += [(*h, ("arc", k)) for k, arc in enumerate(arcs) for h in _arc_hits(arc, p, v)]
                hits += [(*h, ("curve", k)) for k, curve in enumerate(curves) for h in _bezier_hits(curve, p, v)]
                # a ray meets the top of a plate in the opening, and a face in a side, where it starts
                near = -NEAR * scene.cell if enters else NEAR * scene.cell
                t, normal, piece = min(
                    (h for h in hits if h[0] > near), default=(mp.inf, None, None), key=lambda h: h[0]
                )
                leave = -p[1] / v[1] if v[1] > 0 else mp.inf
                # a plate of no thickness lies as high as the opening beside it
                if leave < mp.inf and not (scene.is_open or left <= p[0] + leave * v[0] <= right):
                    leave = mp.inf
                side = ((right if v[0] > 0 else left) - p[0]) / v[0] if scene.is_open and v[0] != 0 else mp.inf
                # pieces lie in the cell, so that one that is met with a side, or with the opening, is met before
                leave = leave if leave + NEAR * scene.cell < t else mp.inf
                side = side if side + NEAR * scene.cell < t else mp.inf
                if min(leave, t) <= side:
                    break
                enters = True
                # into the next cell: the wall is periodic, and the base counts the periods
                step = right - left if v[0] > 0 else left - right
                base += step
                p = (left if v[0] > 0 else right, p[1] + side * v[1])
            if leave < mp.inf and leave <= t:
                return PreciseRay(base + p[0] + leave * v[0], mp.atan2(v[1], v[0]), bounces, tuple(itinerary))
            if normal is None:
                return PreciseRay(None, None, bounces, tuple(itinerary))
            p, enters = (p[0] + t * v[0], p[1] + t * v[1]), False
            size = mp.sqrt(normal[0] ** 2 + normal[1] ** 2)
            n = (normal[0] / size, normal[1] / size)
            w = 2 * (v[0] * n[0] + v[1] * n[1])
            v = (v[0] - w * n[0], v[1] - w * n[1])
            bounces, before = bounces + 1, itinerary[-1] if itinerary else ("", -1)
            itinerary.append(piece)
            if clear and before[0] == piece[0] == "line" and before != piece:
                sides = _line(scene, before[1]), _line(scene, piece[1])
                number, step = _crossings(sides, p, v) if _faces(sides, scene.joints) else (0, 0)
                if FEW <= number <= limit - bounces:
                    p = (p[0], p[1] + number * step)
                    bounces += number
                    itinerary.append(("crossings", number))
            if before == piece and piece[0] == "arc":
                center = arcs[piece[1]][0]
                number, turn = _hops(arcs[piece[1]], p, v)
                if FEW <= number <= limit - bounces:
                    r = _turned((p[0] - center[0], p[1] - center[1]), number * turn)
                    p, v = (center[0] + r[0], center[1] + r[1]), _turned(v, number * turn)
                    bounces += number
                    itinerary.append(("hops", number))
        return PreciseRay(None, None, limit)


def _line(scene, j):
    """The ends of the line that starts at joint j."""
    return tuple((mp.mpf(x), mp.mpf(y)) for x, y in scene.joints[j : j + 2, :2])


def _candidates(scene, starts, p, v):
    """Those of many lines that a ray may meet, by doubles and with room for their rounding."""
    sides = (scene.joints[:, 0] - float(p[0])) * float(v[1]) - (scene.joints[:, 1] - float(p[1])) * float(v[0])
    room = DOUBLE_ERROR * scene.cell
    return starts[(sides[starts] >= -room) & (sides[starts + 1] <= room)]
