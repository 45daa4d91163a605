"""Where single rays go, from closed forms in the digits of the context: a second judge beside `plain_tracer`.

`tooth`, `crevice`, `arc` and `cap` return a function of the position x in (0, 1) of the opening and of the angle. That
gives the outgoing angle, the number of hits, and a tuple of integers that changes where the ray meets a corner.
`unfold` follows a straight line through a wedge unfolded about its apex, for any number of hits, in 60 digits.
"""

from __future__ import annotations

from typing import NamedTuple

import mpmath as mp

DIGITS = 60
# Unfolded ends of the opening, before the computed last hit, at which the search for the exit begins.
BACK = 8


def tooth(angle):
    """An isosceles tooth of this apex angle; docs/theory/closed-forms.md."""

    def ray(x, theta):
        psi = mp.mpf(angle)
        c = (1 - x) * mp.cos(theta - psi / 2) + x * mp.cos(theta + psi / 2)
        flip = c < 0
        incoming = mp.pi - theta if flip else theta
        hits = int(mp.ceil((incoming + mp.acos(abs(c))) / psi - mp.mpf(1) / 2))
        out = hits * psi - incoming if hits % 2 else mp.pi + incoming - hits * psi
        return (mp.pi - out if flip else out), hits, (hits, flip)

    return ray


def crevice(depth_to_width):
    """A rectangular crevice: unfolded, the ray crosses as many sides as there are integers on its way."""

    def ray(x, theta):
        bottom = x - mp.mpf(depth_to_width) * mp.cot(theta)
        way = 2 * bottom - x
        sides = abs(int(mp.floor(way)))
        return (theta if sides % 2 else mp.pi - theta), sides + 1, (int(mp.floor(bottom)), int(mp.floor(way)))

    return ray


def arc(half_angle):
    """A circular arc; docs/theory/closed-forms.md."""

    def ray(x, theta):
        xi = mp.mpf(half_angle)
        delta = mp.acos(x * mp.cos(theta - xi) + (1 - x) * mp.cos(theta + xi))
        gamma = theta - delta
        if delta >= mp.pi / 2:
            step = 2 * (mp.pi - delta)
            hits = int(mp.ceil((xi - gamma) / step))
            return theta + hits * step - mp.pi, hits, (hits,)
        hits = int(mp.ceil((xi + gamma) / (2 * delta)))
        return theta - 2 * hits * delta + mp.pi, hits, (hits,)

    return ray


def cap(stem_to_cap):
    """A mushroom without a stem whose opening is the stem's width: one of many hits, all on its semicircle."""

    def ray(x, theta):
        offset = (2 * x - 1) * mp.mpf(stem_to_cap)
        return theta + 2 * mp.asin(offset * mp.sin(theta)), 1, (1,)

    return ray


def cap_clearance(stem_to_cap, x, theta):
    """How far such a ray passes the nearer lip on its way out, in units of the cell; negative where it does not."""
    half, offset = mp.mpf(stem_to_cap) / 2, abs((2 * x - 1) * mp.mpf(stem_to_cap) / 2)
    out = mp.sin(cap(stem_to_cap)(x, theta)[0])
    # the ray keeps its distance from the centre of the semicircle
    return half * out - offset * mp.sin(theta)


class UnfoldedRay(NamedTuple):
    """Position and angle at the exit, hits, and distances of the line: from the apex, and from the nearest joint."""

    x: mp.mpf
    theta: mp.mpf
    hits: int
    from_apex: float
    from_joint: float


def unfold(vertices, x, theta):
    """Follow one ray into the hollow of three vertices (left end of the opening, apex, right end) and out of it."""
    with mp.workdps(DIGITS):
        (x0, _), (apex, bottom), (x1, _) = [tuple(map(mp.mpf, vertex)) for vertex in vertices]
        right, left = (x1 - apex, -bottom), (x0 - apex, -bottom)
        p, v = (mp.mpf(x) - apex, -bottom), (-mp.cos(mp.mpf(theta)), -mp.sin(mp.mpf(theta)))
        side = 1 if p[0] * v[1] > p[1] * v[0] else -1
        if side < 0:
            # the mirror image, so that the left line is hit first
            right, left, p, v = (-left[0], left[1]), (-right[0], right[1]), (-p[0], p[1]), (-v[0], v[1])
        first, beta = mp.atan2(left[1], left[0]), mp.atan2(left[1], left[0]) - mp.atan2(right[1], right[0])
        lengths = mp.hypot(*right), mp.hypot(*left)
        moment, way = p[0] * v[1] - p[1] * v[0], mp.atan2(v[1], v[0]) % (2 * mp.pi)

        def beyond(k):
            """By how much the line passes unfolded line k outside of its end."""
            angle = way - first - (k - 1) * beta
            return (moment / mp.sin(angle) if angle > 0 else mp.inf) - lengths[k % 2]

        def end(k):
            angle = first + (k - 1) * beta
            return lengths[k % 2] * mp.cos(angle), lengths[k % 2] * mp.sin(angle)

        last = way - mp.asin(min(1, moment / max(lengths)))
        hits = max(1, int((last - first) / beta) - BACK)
        assert hits == 1 or beyond(hits) < 0
        while beyond(hits + 1) <= 0:
            hits += 1
        a, b = end(hits), end(hits + 1)
        inside, outside = ((q[0] - p[0]) * v[1] - (q[1] - p[1]) * v[0] for q in (a, b))
        fraction, width = inside / (inside - outside), mp.hypot(b[0] - a[0], b[1] - a[1])
        near, far = (left[0], right[0]) if hits % 2 else (right[0], left[0])
        cosine = (v[0] * (b[0] - a[0]) + v[1] * (b[1] - a[1])) / width * mp.sign(far - near)
        out, angle = near + fraction * (far - near), mp.acos(cosine)
        joint = min(moment, abs(inside), abs(outside), *(abs(beyond(k)) * mp.sin(angle) for k in (hits, hits + 1)))
        return UnfoldedRay(apex + side * out, angle if side > 0 else mp.pi - angle, hits, float(moment), float(joint))
