"""Where single rays go, from closed forms in 50 digits: a second judge beside the tracer of `precise_tracer`.

Each function returns a function of the position x in (0, 1) of the opening and of the angle. That gives the outgoing
angle, the number of hits, and a tuple of integers that changes where the ray meets a corner.
"""

from __future__ import annotations

import mpmath as mp


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
