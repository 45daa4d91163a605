"""Bezier pieces and walls for the tests of rays."""

from __future__ import annotations

import numpy as np

from asperity import geometry as geo


def parabola_as_a_cubic(start, middle, end, bump=0.0):
    """The quadratic Bezier piece of these points as a cubic one, whose second point is raised by ``bump``."""
    start, middle, end = map(np.array, (start, middle, end))
    second = start + (middle - start) * 2 / 3 + [0.0, bump]
    return geo.Bezier([start, second, end + (middle - end) * 2 / 3, end])


def wall_with_inflections():
    """Two pieces with an inflection each."""
    return geo.Wall(
        [
            geo.Bezier([(0, 0), (0.8, -0.3), (-0.1, -0.6), (0.5, -0.9)]),
            geo.Bezier([(0.5, -0.9), (1.1, -0.6), (0.2, -0.3), (1, 0)]),
        ]
    )
