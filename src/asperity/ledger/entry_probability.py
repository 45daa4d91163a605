"""The probability of an outcome over the entry points, by tracing and bisection."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

ENTRIES = 1000
HALVINGS = 40
# Error bound: a few changes of outcome, each known to (1/ENTRIES) 2^-HALVINGS and to the tracer's rounding.
FRACTION_ERROR = 1e-10


def fraction(occurs: Callable[[Any, Any], Any], theta: Any, low: float = 0.0) -> Any:
    """The fraction of the entry points from ``low`` to 1 that have an outcome, for every angle.

    ``occurs`` maps arrays of entry points and angles to booleans. An outcome that occurs only between two neighbours of
    ENTRIES equally spaced points is missed.
    """
    x = low + (1.0 - low) * (np.arange(ENTRIES) + 0.5) / ENTRIES
    found = occurs(*np.broadcast_arrays(x[:, None], theta))
    row, column = np.nonzero(found[1:] != found[:-1])
    left, right = x[row], x[row + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (left + right)
        still = occurs(middle, theta[column]) == found[row, column]
        left, right = np.where(still, middle, left), np.where(still, right, middle)
    total = np.where(found[-1], 1.0, 0.0) - np.where(found[0], low, 0.0)
    np.add.at(total, column, np.where(found[row, column], left, -left))
    return total / (1.0 - low)
