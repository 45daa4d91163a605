"""Compiled search for the critical angle at which an itinerary appears or disappears."""

from __future__ import annotations

import numpy as np

from ....core.rounding import EPS
from ...curves.columns import LEFT, RIGHT
from ...tracing.compiled.pieces.options import compiled, linked
from .changes import probe, set_angle, setting_at

# Number of positions, at most the last width away from the expected middle, at which a piece is searched. Near a
# critical angle the width is proportional to the distance from this angle or to its square root; both cases are found.
POINTS_TRIED = 17
# Bisections for the ends of a piece, enough to follow its middle.
EDGE_STEPS = 5
MOST_STEPS = 80
# Difference, radians, up to which critical angles are equal; its effect through a square root is below rounding.
SAME_ANGLE = 1e-11


@linked
def edge_from(x, step, label, setting):
    """Return the end of the piece around x in the direction of ``step``, to a small fraction of its distance."""
    left, right = setting.hollow[LEFT], setting.hollow[RIGHT]
    inside, outside = x, x + step
    while left < outside < right and probe(outside, setting)[1] == label:
        inside = outside
        step *= 2.0
        outside = inside + step
    outside = min(max(outside, left), right)
    for _ in range(EDGE_STEPS):
        middle = 0.5 * (inside + outside)
        if probe(middle, setting)[1] == label:
            inside = middle
        else:
            outside = middle
    return inside


@compiled
def find_critical(label, present, absent, low, high, drift, setting):
    """Return the critical angle between ``present`` and ``absent`` of the piece [low, high] at the angle ``present``.

    ``drift`` is the estimated derivative of the piece's middle by the angle; of the setting the address is given.
    """
    setting = setting_at(setting)
    hollow = setting.hollow
    left, right = hollow[LEFT], hollow[RIGHT]
    for _ in range(MOST_STEPS):
        if abs(present - absent) <= SAME_ANGLE:
            break
        angle = 0.5 * (present + absent)
        set_angle(angle, setting)
        width, before = high - low, 0.5 * (low + high)
        centre = before + drift * (angle - present)
        found = np.nan
        for n in range(POINTS_TRIED):
            # from the middle outwards, to either side in turn
            x = centre + width * (1.0 - 2.0 * (n % 2)) * ((n + 1) // 2) / (POINTS_TRIED // 2)
            if left < x < right and probe(x, setting)[1] == label:
                found = x
                break
        if np.isnan(found):
            absent = angle
            continue
        step = max(0.25 * width, 4.0 * EPS * abs(found))
        low, high = edge_from(found, -step, label, setting), edge_from(found, step, label, setting)
        if high <= low:
            break
        drift = (0.5 * (low + high) - before) / (angle - present)
        present = angle
    return 0.5 * (present + absent)
