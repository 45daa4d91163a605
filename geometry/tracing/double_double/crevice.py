"""The number of widths of a crevice that a ray crosses, modulo 2, in double-double arithmetic."""

from __future__ import annotations

import math

import numpy as np

from ....core.compilation import jit
from .arithmetic import divide, multiply, sine_cosine, subtract, wide


@jit()
def crossings_modulo_two(double_height, theta):
    """Return d mod 2 for d = double_height |cot theta| < 2^53, with an error of at most about d 2^-100."""
    found = np.empty(theta.size)
    for k in range(theta.size):
        sine, cosine = sine_cosine(theta[k])
        if cosine[0] < 0.0:
            cosine = -cosine[0], -cosine[1]
        pairs = divide(multiply(wide(0.5 * double_height), cosine), sine)
        # the high part may be an integer with a negative low part
        whole = math.floor(pairs[0])
        if whole == pairs[0] and pairs[1] < 0.0:
            whole -= 1.0
        rest = subtract(pairs, wide(whole))
        found[k] = min(max(2.0 * rest[0], 0.0), 2.0)
    return found
