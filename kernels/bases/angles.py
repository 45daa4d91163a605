"""Angles to full relative accuracy near grazing and at the ends of (0, pi), where cosines cannot distinguish them."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats
from .measure import LARGEST_ANGLE, SMALLEST_ANGLE


def clipped_inside(angle: Floats) -> Floats:
    """Clip angles to [SMALLEST_ANGLE, LARGEST_ANGLE], because rounding can put them on or past an end of (0, pi)."""
    return np.asarray(np.clip(angle, SMALLEST_ANGLE, LARGEST_ANGLE))


def mirrored_angle(angle: Floats) -> Floats:
    """Return pi - angle, clipped to the open interval (0, pi)."""
    return clipped_inside(np.pi - angle)


def mixed_arccos(fraction: Floats, theta: Floats, half: float) -> tuple[Floats, Floats]:
    """Return delta = arccos(fraction cos(theta - half) + (1 - fraction) cos(theta + half)) and pi - delta.

    Both have full relative accuracy, because sin(delta/2)^2 and cos(delta/2)^2 are sums of non-negative terms.
    Cosines near pi/2 are computed as sines of the complement, so that theta -> pi - theta only exchanges the results.
    """
    complement = np.pi - theta
    sine = fraction * np.sin(0.5 * (theta - half)) ** 2 + (1.0 - fraction) * np.sin(0.5 * (theta + half)) ** 2
    cosine = (
        fraction * np.sin(0.5 * (complement + half)) ** 2 + (1.0 - fraction) * np.sin(0.5 * (complement - half)) ** 2
    )
    sine, cosine = np.sqrt(sine), np.sqrt(cosine)
    return 2.0 * np.arctan2(sine, cosine), 2.0 * np.arctan2(cosine, sine)
