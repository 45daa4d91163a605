"""The number of widths of a crevice that a ray crosses, modulo 2, in double-double arithmetic."""

from __future__ import annotations

import math

import numpy as np

from ....core.compilation import jit
from .numbers import sine_cosine


@jit()
def crossings_modulo_two(double_height, theta):
    """Return d mod 2 for d = double_height |cot theta| < 2^53, with an error of at most about d 2^-100."""
    found = np.empty(theta.size)
    for k in range(theta.size):
        sine, cosine = sine_cosine(theta[k])
        pairs = 0.5 * double_height * (-cosine if cosine < 0.0 else cosine) / sine
        # the high part may be an integer with a negative low part
        whole = math.floor(pairs.high)
        if whole == pairs.high and pairs.low < 0.0:
            whole -= 1.0
        found[k] = min(max(2.0 * (pairs - whole).high, 0.0), 2.0)
    return found
