"""A ray in a polygonal hollow in 60 digits, from the definitions: the judge of leaves with many bounces."""

from __future__ import annotations

from itertools import pairwise

import mpmath as mp
import numpy as np
from numpy.typing import ArrayLike

from asperity.core.checks import Floats

DIGITS = 60
# Distance below which a hit is the ray's own start.
NEAR = mp.mpf(10) ** -30
# In double precision the distances of sides are right within this bound, unless they are nearly parallel to the ray.
ROUGH = 1e-6


def precise_exit(hollow_vertices: ArrayLike, x: float, theta: float) -> tuple[float, float, int]:
    """The outgoing angle as the sum of two doubles, and the number of bounces, of a ray that enters at (x, 0)."""
    with mp.workdps(DIGITS):
        points = [(mp.mpf(float(a)), mp.mpf(float(b))) for a, b in np.asarray(hollow_vertices)]
        sides = list(pairwise(points))
        (px, py), (vx, vy) = (mp.mpf(float(x)), mp.mpf(0)), (-mp.cos(mp.mpf(theta)), -mp.sin(mp.mpf(theta)))
        bounces = 0
        while True:
            hit = _nearest(np.asarray(hollow_vertices), sides, px, py, vx, vy)
            if hit is None:
                angle = mp.atan2(vy, vx)
                return float(angle), float(angle - mp.mpf(float(angle))), bounces
            time, (ax, ay), (bx, by) = hit
            px, py = px + time * vx, py + time * vy
            ex, ey = bx - ax, by - ay
            along = 2 * (vx * ex + vy * ey) / (ex * ex + ey * ey)
            vx, vy = along * ex - vx, along * ey - vy
            bounces += 1


def _nearest(rough, sides, px, py, vx, vy):
    """The time of the first hit and the ends of its side, None at the opening."""
    best = None
    for k in _candidates(rough, float(px), float(py), float(vx), float(vy)):
        (ax, ay), (bx, by) = sides[k]
        ex, ey = bx - ax, by - ay
        det = vy * ex - vx * ey
        if det == 0:
            continue
        time = ((ay - py) * ex - (ax - px) * ey) / det
        place = ((ay - py) * vx - (ax - px) * vy) / det
        if time > NEAR and 0 <= place <= 1 and (best is None or time < best[0]):
            best = time, (ax, ay), (bx, by)
    if best is None or (vy > 0 and py + best[0] * vy > 0):
        return None
    return best


def _candidates(points: Floats, px: float, py: float, vx: float, vy: float):
    """The sides that the ray may hit: all whose ends do not lie far on one side of its line."""
    side = (points[:, 0] - px) * vy - (points[:, 1] - py) * vx
    apart = (np.minimum(side[1:], side[:-1]) > ROUGH) | (np.maximum(side[1:], side[:-1]) < -ROUGH)
    return np.flatnonzero(~apart)
