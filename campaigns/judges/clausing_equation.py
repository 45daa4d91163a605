"""Clausing's equation by the trapezoidal rule, extrapolated: the transmission of channels and tubes.

Walls are diffuse, or smooth with some diffuse reflections; flights between these are summed one by one.
"""

from __future__ import annotations

import math

import numpy as np

from asperity.core.checks import Floats
from asperity.core.rounding import EPS

# Intervals of the rules, each time twice as many, and the rounding of a sum of probabilities.
INTERVALS, ROUNDING = (64, 128, 256, 512, 1024), 64.0 * EPS
# Flights in units of the inverse diffuse fraction, of which more are below rounding.
FLIGHTS = 40.0


def _channel(z: Floats) -> tuple[Floats, Floats, Floats]:
    """From a wall to the other at the distance z along it, beyond z, and from one end to a section at z; width 1."""
    sine = z / np.hypot(1.0, z)
    return 0.5 * (1.0 - sine**2) ** 1.5, 0.5 * (1.0 - sine), np.hypot(1.0, z) - z


def _tube(z: Floats) -> tuple[Floats, Floats, Floats]:
    """The same for a tube of radius 1."""
    root = np.hypot(2.0, z)
    return 0.5 - 0.5 * z * (z**2 + 6.0) / root**3, 0.5 * (z**2 + 2.0) / root - 0.5 * z, 0.25 * (root - z) ** 2


SECTIONS = {"channel": _channel, "tube": _tube}


def by_trapezoids(section: str, length: float, diffuse: float = 1.0) -> tuple[float, float]:
    """The transmission and its error.

    The kernel has a kink where both places are the same, which is a node: so the error of the rule is a series in the
    square of the interval, and Romberg's extrapolation removes its terms one by one. The error is the last change.
    """
    values = np.array([_by_rule(section, length, diffuse, number) for number in INTERVALS])
    for order in range(1, values.size):
        before, values = values[-1], values[1:] + np.diff(values) / (4.0**order - 1.0)
    # rounding of the rule, and of the sum over flights
    return float(values[0]), abs(float(values[0] - before)) + ROUNDING + EPS * math.sqrt(FLIGHTS / diffuse)


def _by_rule(section: str, length: float, diffuse: float, intervals: int) -> float:
    x = np.linspace(0.0, length, intervals + 1)
    weight = np.full(x.size, length / intervals)
    weight[[0, -1]] *= 0.5
    kernel, beyond, passing = np.zeros((3, x.size))
    for flights in range(1, 2 if diffuse == 1.0 else int(FLIGHTS / diffuse)):
        probability = diffuse * math.exp((flights - 1) * math.log1p(-diffuse)) if flights > 1 else diffuse
        for total, part, factor in zip((kernel, beyond, passing), SECTIONS[section](x / flights),
                                       (1.0 / flights, 1.0, flights * diffuse), strict=True):  # fmt: skip
            total += probability * factor * part
    # of places by their distance
    apart = np.abs(np.arange(x.size)[:, None] - np.arange(x.size))
    # the chance to leave at the far end after the collision at x
    chance = np.linalg.solve(np.eye(x.size) - kernel[apart] * weight, beyond[::-1])
    # as many particles arrive from the end at x as go from x to the end, in units of the half section
    return float(passing[-1] + (2.0 * diffuse * weight * beyond) @ chance)
