"""Mean and spread of values that have errors of their own, with their errors."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...core.checks import Floats
from ...core.estimates import LEVEL, NORMAL_95, Estimate, student_95

# Fewer values tell nothing of their spread.
FEWEST = 4
# Values that differ by less than this many roundings are equal.
ROUNDINGS = 64.0


def mean_estimate(values: Sequence[float], errors: Sequence[float]) -> Estimate:
    r"""The mean of the population of which independent values are known to within errors.

    The error is the half width of 95 % by Student's t, plus the mean of the errors, which covers errors that all have
    one sign too. Where the values are skew, the quantile of t is increased by the next term of the expansion in
    1/n, z (gamma^2 (z^4 + 2 z^2 - 3)/18 - kappa (z^2 - 3)/12)/n (Hall, The Bootstrap and Edgeworth Expansion, 1992,
    section 2.6), with skewness gamma and excess kurtosis kappa; it is never decreased.

    Examples
    --------
    >>> mean_estimate([1.0, 2.0, 2.0, 3.0], [0.0] * 4).value, mean_estimate([0.5] * 4, [0.25] * 4).error
    (2.0, 0.25)
    """
    known = np.asarray(values, dtype=np.float64)
    number = len(known)
    deviation = _deviation(known)
    skewness, excess = _shape(known)
    z = NORMAL_95
    further = z * (skewness**2 * (z**4 + 2.0 * z**2 - 3.0) / 18.0 - excess * (z**2 - 3.0) / 12.0) / number
    quantile = student_95(number) + max(further, 0.0)
    error = quantile * deviation / math.sqrt(number) + float(np.mean(errors))
    return Estimate(float(known.mean()), error, "estimate", f"mean of {number} realisations")


def spread_estimate(values: Sequence[float], errors: Sequence[float]) -> Estimate:
    """The standard deviation of the population of which independent values are known to within errors.

    The error is the longest side of two intervals of 95 %: that of normal values by chi^2, and that of the mean squared
    deviation as `mean_estimate` has it, for values of any distribution. The root mean square of the errors is added,
    by which they change the standard deviation at most.
    """
    from scipy.special import chdtri

    known = np.asarray(values, dtype=np.float64)
    number = len(known)
    deviation = _deviation(known)
    low, high = (math.sqrt((number - 1) / float(chdtri(number - 1, 0.5 * (1.0 + end * LEVEL)))) for end in (-1, 1))
    squares = (known - known.mean()) ** 2 * (number / (number - 1))
    below = max(deviation**2 - mean_estimate(squares.tolist(), [0.0] * number).error, 0.0)
    side = max(deviation * (1.0 - low), deviation * (high - 1.0), deviation - math.sqrt(below))
    own = math.sqrt(float(np.sum(np.square(errors))) / (number - 1))
    return Estimate(deviation, side + own, "estimate", f"standard deviation of {number} realisations")


def _deviation(values: Floats) -> float:
    """The standard deviation; 0 for values that are equal to rounding."""
    equal = np.ptp(values) <= ROUNDINGS * np.spacing(np.abs(values).max())
    return 0.0 if equal else float(values.std(ddof=1))


def _shape(values: Floats) -> tuple[float, float]:
    """Skewness and excess kurtosis, with their bias for normal values removed; 0 for equal values."""
    from scipy.stats import kurtosis, skew

    if not _deviation(values):
        return 0.0, 0.0
    return float(skew(values, bias=False)), float(kurtosis(values, bias=False))
