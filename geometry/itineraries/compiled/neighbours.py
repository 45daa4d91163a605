"""Compiled comparison of the itineraries at two neighbouring angles, and the critical angle at which one appears."""

from __future__ import annotations

import numpy as np

from ....core.rounding import EPS
from ...scene.columns import LEFT, RIGHT
from ...tracing.compiled.options import compiled, linked
from .changes import probe, setting_at, task_of

# Number of positions, at most the last width away from the expected middle, at which a piece is searched. Near a
# critical angle the width is proportional to the distance from this angle or to its square root; both cases are found.
POINTS_TRIED = 17
# Bisections for the ends of a piece, enough to follow its middle.
EDGE_STEPS = 5
MOST_STEPS = 80
# Difference, radians, up to which critical angles are equal; its effect through a square root is below rounding.
SAME_ANGLE = 1e-11


@linked
def label_at(x, task):
    """Return the label of one ray."""
    _, label = probe(x, task)
    return label


@compiled
def find_missed(thetas, least_widths, pieces, starts, linked, setting, found):
    """Return entry points whose ray has another label than the piece around them.

    The candidates are the middles of the pieces at a neighbouring angle: angles ``k`` and ``k + 1`` are compared if
    ``linked[k]``. Pieces no wider than ``least_widths`` of the other angle are ignored. Of the setting the address is
    given. ``found`` are arrays to fill, with the numbers of the angles and with the positions; each piece may be found
    twice. Returns the numbers of positions and of rays.
    """
    setting = setting_at(setting)
    lows, highs, labels = pieces
    owners, entries = found
    count, rays = np.int64(0), np.int64(0)
    for k in range(thetas.shape[0] - 1):
        if not linked[k]:
            continue
        for here, there in ((k, k + 1), (k + 1, k)):
            task = task_of(setting, thetas[there])
            m, end = starts[there], starts[there + 1]
            for p in range(starts[here], starts[here + 1]):
                if highs[p] - lows[p] <= least_widths[there]:
                    continue
                x = 0.5 * (lows[p] + highs[p])
                while m < end - 1 and highs[m] <= x:
                    m += 1
                # positions in gaps are ignored: the error of the angle includes the gaps
                if labels[m] != labels[p] and lows[m] < x < highs[m]:
                    rays += 1
                    if label_at(x, task) != labels[m]:
                        owners[count], entries[count] = there, x
                        count += 1
    return count, rays


@linked
def edge_from(x, step, label, task):
    """Return the end of the piece around x in the direction of ``step``, to a small fraction of its distance."""
    left, right = task.setting.hollow[LEFT], task.setting.hollow[RIGHT]
    inside, outside = x, x + step
    while left < outside < right and label_at(outside, task) == label:
        inside = outside
        step *= 2.0
        outside = inside + step
    outside = min(max(outside, left), right)
    for _ in range(EDGE_STEPS):
        middle = 0.5 * (inside + outside)
        if label_at(middle, task) == label:
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
        task = task_of(setting, angle)
        width, before = high - low, 0.5 * (low + high)
        centre = before + drift * (angle - present)
        found = np.nan
        for n in range(POINTS_TRIED):
            # from the middle outwards, to either side in turn
            x = centre + width * (1.0 - 2.0 * (n % 2)) * ((n + 1) // 2) / (POINTS_TRIED // 2)
            if left < x < right and label_at(x, task) == label:
                found = x
                break
        if np.isnan(found):
            absent = angle
            continue
        step = max(0.25 * width, 4.0 * EPS * abs(found))
        low, high = edge_from(found, -step, label, task), edge_from(found, step, label, task)
        if high <= low:
            break
        drift = (0.5 * (low + high) - before) / (angle - present)
        present = angle
    return 0.5 * (present + absent)
