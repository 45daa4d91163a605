"""The entry points from which the search for changes of itinerary starts."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats

# Samples that a row starts from, at irregular positions so that no symmetry of the wall hides a piece from all of them.
FIRST_SAMPLES = 32
GOLDEN = 0.6180339887498949
# Neighbouring rows have other positions: any large number without pattern does.
ANGLE_SHIFT = 12345.6789
# More of them at either end, each nearer to it by this ratio.
END_SAMPLES, END_RATIO = 10, 0.3
# The first and the last sample are this fraction of the row's tolerance, or of the opening, away from the ends.
MARGIN = 1e-3

_NUMBERS = np.arange(FIRST_SAMPLES)
_ENDS = END_RATIO ** np.arange(1, END_SAMPLES + 1) / FIRST_SAMPLES


def first_nodes(theta: float, left: float, right: float, goal: float) -> Floats:
    """Positions of the samples that a row starts from, in any order.

    They lie elsewhere in every row, so that the rows together leave no large part of all rays unseen, and crowd at the
    ends of the opening, where the pieces of a smooth hollow become ever narrower.
    """
    whole = right - left
    shift = theta * ANGLE_SHIFT % 1.0
    inside = (_NUMBERS + 0.25 + 0.5 * ((_NUMBERS * GOLDEN + shift) % 1.0)) / FIRST_SAMPLES
    ends = np.append(_ENDS * whole, MARGIN * min(goal, MARGIN * whole))
    return np.concatenate((left + whole * inside, left + ends, right - ends))
