"""Where single rays go, from closed forms in many digits: the references of the stability report."""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp
import numpy as np

from ..checks import Floats

# Twice the digits of a double, and what 10^9 hits can lose of them.
DIGITS = 50
# outgoing angle and number of hits of the ray that enters at x in (0, 1) of a hollow's opening
ExactRay = Callable[[mp.mpf, mp.mpf], tuple[mp.mpf, int]]


def tooth(angle: float) -> ExactRay:
    """An isosceles tooth of this apex angle; docs/theory/closed-forms.md."""

    def ray(x: mp.mpf, theta: mp.mpf) -> tuple[mp.mpf, int]:
        psi = mp.mpf(angle)
        c = (1 - x) * mp.cos(theta - psi / 2) + x * mp.cos(theta + psi / 2)
        flip = c < 0
        incoming = mp.pi - theta if flip else theta
        hits = int(mp.ceil((incoming + mp.acos(abs(c))) / psi - mp.mpf(1) / 2))
        out = hits * psi - incoming if hits % 2 else mp.pi + incoming - hits * psi
        return (mp.pi - out if flip else out), hits

    return ray


def crevice(depth_to_width: float) -> ExactRay:
    """A rectangular crevice: unfolded, the ray crosses as many sides as there are integers on its way."""

    def ray(x: mp.mpf, theta: mp.mpf) -> tuple[mp.mpf, int]:
        way = x - 2 * mp.mpf(depth_to_width) * mp.cot(theta)
        sides = abs(int(mp.floor(way)))
        return (theta if sides % 2 else mp.pi - theta), sides + 1

    return ray


def arc(half_angle: float) -> ExactRay:
    """A circular arc; docs/theory/closed-forms.md."""

    def ray(x: mp.mpf, theta: mp.mpf) -> tuple[mp.mpf, int]:
        xi = mp.mpf(half_angle)
        delta = mp.acos(x * mp.cos(theta - xi) + (1 - x) * mp.cos(theta + xi))
        gamma = theta - delta
        if delta >= mp.pi / 2:
            step = 2 * (mp.pi - delta)
            hits = int(mp.ceil((xi - gamma) / step))
            return theta + hits * step - mp.pi, hits
        hits = int(mp.ceil((xi + gamma) / (2 * delta)))
        return theta - 2 * hits * delta + mp.pi, hits

    return ray


def cap(stem_to_cap: float) -> ExactRay:
    """A mushroom without a stem whose opening is the stem's width: one of many hits, all on its semicircle."""

    def ray(x: mp.mpf, theta: mp.mpf) -> tuple[mp.mpf, int]:
        offset = (2 * x - 1) * mp.mpf(stem_to_cap)
        return theta + 2 * mp.asin(offset * mp.sin(theta)), 1

    return ray


def exact_angle(ray: ExactRay, x: float, theta: float, moved: tuple[float, float] = (0.0, 0.0)) -> tuple[float, int]:
    """Outgoing angle rounded once, and hits, of a ray moved by so many ulps of 1 and of its angle."""
    with mp.workdps(DIGITS):
        place = mp.mpf(x) + mp.mpf(moved[0]) * mp.mpf(2) ** -52
        angle = mp.mpf(theta) * (1 + mp.mpf(moved[1]) * mp.mpf(2) ** -52)
        out, hits = ray(place, angle)
        return float(out), hits


def condition(ray: ExactRay, x: float, theta: float) -> float:
    """1 + the sum of the moduli of the outgoing angle's derivatives."""
    with mp.workdps(DIGITS):
        step = mp.mpf(10) ** -30
        at, _ = ray(mp.mpf(x), mp.mpf(theta))
        slopes = [abs(ray(mp.mpf(x) + dx, mp.mpf(theta) + dt)[0] - at) / step for dx, dt in ((step, 0), (0, step))]
        return float(1 + sum(slopes))


def spread_rays(count: int, low: float, seed: int) -> tuple[Floats, Floats]:
    """Places in (0, 1); half the angles from the flux, half uniform in the logarithm from ``low``, from either side."""
    rng = np.random.default_rng(seed)
    grazing = 10.0 ** rng.uniform(np.log10(low), -2.0, count)
    grazing = np.where(rng.random(count) < 0.5, grazing, np.pi - grazing)
    theta = np.where(rng.random(count) < 0.5, np.arccos(1.0 - 2.0 * rng.random(count)), grazing)
    return rng.uniform(0.01, 0.99, count), theta
