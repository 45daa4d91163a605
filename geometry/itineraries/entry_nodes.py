"""The entry points from which the search for changes of itinerary starts."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats

# Samples per incoming angle, at irregular positions, so that no symmetry of the wall hides a piece from all samples.
FIRST_SAMPLES = 32
GOLDEN = 0.6180339887498949
# Shift of the positions per radian; any large number without pattern gives neighbouring angles other positions.
ANGLE_SHIFT = 12345.6789
# Further samples at each end of the opening, at geometrically decreasing distances from the end.
END_SAMPLES, END_RATIO = 10, 0.3
# Distance of the first and last sample from the ends, as a fraction of the tolerance or, times MARGIN, of the opening.
MARGIN = 1e-3

_NUMBERS = np.arange(FIRST_SAMPLES)
_ENDS = END_RATIO ** np.arange(1, END_SAMPLES + 1) / FIRST_SAMPLES


def first_nodes(theta: float, left: float, right: float, goal: float) -> Floats:
    """Return the positions of the first samples at one incoming angle, in any order.

    The positions differ from angle to angle, so that all angles together leave no large part of the rays unsampled.
    The positions accumulate at the ends of the opening, where the pieces of a smooth hollow become narrow.
    """
    whole = right - left
    shift = theta * ANGLE_SHIFT % 1.0
    inside = (_NUMBERS + 0.25 + 0.5 * ((_NUMBERS * GOLDEN + shift) % 1.0)) / FIRST_SAMPLES
    ends = np.append(_ENDS * whole, MARGIN * min(goal, MARGIN * whole))
    return np.concatenate((left + whole * inside, left + ends, right - ends))
