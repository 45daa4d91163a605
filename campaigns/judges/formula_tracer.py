"""Rays over a wall y = f(x), from the function itself: steps that are shorter than the way to the wall.

Along a ray the height over the wall, g, has a second derivative of at least -M, if f'' <= M. The first zero of
g + g' s - M s^2/2 is before that of g, and Newton's convergence makes the steps quadratically small.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# Steps, and height over the wall, in units of the period, at which the ray has arrived.
STEPS, ARRIVED = 20_000, 1e-14


def reflected(
    f: Callable[[np.ndarray], np.ndarray],
    slope: Callable[[np.ndarray], np.ndarray],
    bend: float,
    x: np.ndarray,
    theta: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Outgoing angles and numbers of hits of rays that enter at (x, 0) from the direction theta; nan if too long.

    ``bend`` is at least the largest f''. Angles are those of the reversed incoming and of the outgoing velocity to the
    positive x direction.
    """
    place = np.stack([np.array(x, dtype=float), np.zeros(len(x))])
    velocity = np.stack([-np.cos(theta), -np.sin(theta)])
    hits, out, alive = np.zeros(len(x), dtype=int), np.full(len(x), np.nan), np.arange(len(x))
    for _ in range(STEPS):
        if not len(alive):
            break
        (px, py), (vx, vy) = place[:, alive], velocity[:, alive]
        g, rate = py - f(px), vy - slope(px) * vx
        half = 0.5 * bend * vx**2 + 1e-300
        root = np.sqrt(rate**2 + 4.0 * half * np.maximum(g, 0.0))
        # the positive root of g + rate s - half s^2, without cancellation
        step = np.where(rate > 0.0, (rate + root) / (2.0 * half), 2.0 * np.maximum(g, 0.0) / (root - rate + 1e-300))
        at_hit = (g <= ARRIVED) & (rate < 0.0)
        normal = np.stack([-slope(px), np.ones(len(px))]) / np.hypot(1.0, slope(px))
        turned = velocity[:, alive] - 2.0 * np.sum(velocity[:, alive] * normal, axis=0) * normal
        velocity[:, alive[at_hit]] = turned[:, at_hit]
        hits[alive[at_hit]] += 1
        away = np.where(vy > 0.0, -py / np.where(vy > 0.0, vy, 1.0), np.inf)
        # the opening is above the highest point of the wall, so a ray is past it before or at its next hit
        leaves = ~at_hit & (step >= away)
        out[alive[leaves]] = np.arctan2(vy, vx)[leaves]
        step = np.where(at_hit, 0.0, step)
        place[:, alive] += step * velocity[:, alive]
        alive = alive[~leaves]
    return out, hits
