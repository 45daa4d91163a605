"""The order of convergence that measurements show, with its confidence interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ..checks import finite_array
from ..errors import InputError

# Fits need this many points to have a confidence interval.
FEWEST_POINTS = 3
CONFIDENCE = 0.95
# Orders are told apart to this: the next ones worth a name are a quarter away.
ALLOWANCE = 0.15

OrderVerdict = Literal["agrees", "differs", "not resolved"]


@dataclass(frozen=True)
class FittedOrder:
    """The slope p of error ~ size^-p in the logarithms.

    Attributes
    ----------
    order : float
    low, high : float
        Ends of its 95 % confidence interval by Student's t.
    points : int
        Number of measurements that the fit rests on.
    """

    order: float
    low: float
    high: float
    points: int

    def agrees_with(self, declared: float) -> bool:
        """Whether the declared order is within 0.15 of the fitted one."""
        return abs(self.order - declared) <= ALLOWANCE

    def verdict(self, declared: float) -> OrderVerdict:
        """Whether the declared order is within 0.15; if not, whether the interval excludes it.

        Examples
        --------
        >>> FittedOrder(1.5, 1.2, 1.8, 4).verdict(1.75), FittedOrder(1.5, 1.4, 1.6, 4).verdict(1.75)
        ('not resolved', 'differs')
        """
        if self.agrees_with(declared):
            return "agrees"
        return "not resolved" if self.low <= declared <= self.high else "differs"

    def __str__(self) -> str:
        return f"{self.order:.2f} [{self.low:.2f}, {self.high:.2f}]"


def fit_order(size: ArrayLike, error: ArrayLike) -> FittedOrder | None:
    """Least squares of log(error) on log(size); None for fewer than three different sizes.

    Examples
    --------
    >>> fit = fit_order([1, 2, 4, 8], [1, 1 / 4, 1 / 16, 1 / 64])
    >>> round(fit.order, 12), fit.points
    (2.0, 4)
    """
    sizes, errors = finite_array("size", size), finite_array("error", error)
    if sizes.shape != errors.shape or np.any(sizes <= 0.0) or np.any(errors <= 0.0):
        raise InputError(f"size, error: expected positive numbers of one shape, got {size!r}, {error!r}")
    if len(np.unique(sizes)) < FEWEST_POINTS:
        return None
    from scipy.stats import linregress, t

    fit = linregress(np.log(sizes), np.log(errors))
    half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, len(sizes) - 2) * fit.stderr)
    return FittedOrder(-float(fit.slope), -float(fit.slope) - half, -float(fit.slope) + half, len(sizes))
