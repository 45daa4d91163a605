"""The order of convergence fitted to measured errors, with its confidence interval."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import finite_array
from ...core.errors import InputError
from ...core.estimates import Summary, with_error

# Least number of points of a fit with a confidence interval.
FEWEST_POINTS = 3
CONFIDENCE = 0.95
# Largest difference of orders that agree.
ALLOWANCE = 0.15

OrderVerdict = Literal["agrees", "differs", "not resolved"]


@dataclass(frozen=True, repr=False)
class FittedOrder(Summary):
    """The order p of error ~ size^-p, fitted in the logarithms.

    Attributes
    ----------
    order : float
    low, high : float
        Ends of its 95 % confidence interval; see `fit_order`.
    points : int
        Number of measurements.
    """

    order: float
    low: float
    high: float
    points: int

    def agrees_with(self, declared: float) -> bool:
        """Whether the declared order is within 0.15 of the fitted one."""
        return abs(self.order - declared) <= ALLOWANCE

    def verdict(self, declared: float) -> OrderVerdict:
        """The verdict: "agrees" within 0.15, "differs" if the interval excludes ``declared``, else "not resolved".

        Examples
        --------
        >>> FittedOrder(1.5, 1.2, 1.8, 4).verdict(1.75), FittedOrder(1.5, 1.4, 1.6, 4).verdict(1.75)
        ('not resolved', 'differs')
        """
        if self.agrees_with(declared):
            return "agrees"
        return "not resolved" if self.low <= declared <= self.high else "differs"

    def __str__(self) -> str:
        return with_error(self.order, max(self.high - self.order, self.order - self.low))

    def _headline(self) -> str:
        return str(self)


def fit_order(size: ArrayLike, error: ArrayLike, repeats: ArrayLike | None = None) -> FittedOrder | None:
    """Fit the order by least squares of log(error) on log(size); None for fewer than three different sizes.

    Parameters
    ----------
    size, error : array_like, shape (points,)
        Positive numbers.
    repeats : array_like, shape (points,), optional
        For random methods, the number of independent repeats whose root mean square is the error.

    Returns
    -------
    FittedOrder or None
        Without ``repeats`` the interval is Student's, from the scatter about the line. With ``repeats`` errors are
        treated as random: for Gaussian errors, n times the squared error is proportional to a chi-square with n degrees
        of freedom, and the variance of its logarithm is trigamma(n/2)/4. The points are weighted accordingly, and the
        interval is Gaussian; a scatter larger than these variances widens it by Birge's ratio. Errors of arrays scatter
        less, so their interval is conservative.

    Raises
    ------
    InputError
        If the shapes differ, a size or an error is not above 0, or a number of repeats is below 1.

    Examples
    --------
    >>> fit = fit_order([1, 2, 4, 8], [1, 1 / 4, 1 / 16, 1 / 64])
    >>> round(fit.order, 12), fit.points
    (2.0, 4)
    >>> few = fit_order([1, 4, 16], [1, 0.5, 0.25], repeats=[5, 5, 5])
    >>> round(few.order, 12), round(few.high - few.low, 2)
    (0.5, 0.7)
    """
    from scipy.special import polygamma
    from scipy.stats import norm, t

    sizes, errors = finite_array("size", size), finite_array("error", error)
    if sizes.shape != errors.shape or np.any(sizes <= 0.0) or np.any(errors <= 0.0):
        raise InputError(f"size, error: expected positive numbers of one shape, got {size!r}, {error!r}")
    number = None if repeats is None else finite_array("repeats", repeats)
    if number is not None and (number.shape != sizes.shape or np.any(number < 1.0)):
        raise InputError(f"repeats: expected a number of at least 1 for each of {sizes.size} sizes, got {repeats!r}")
    if len(np.unique(sizes)) < FEWEST_POINTS:
        return None
    x, y = np.log(sizes), np.log(errors) - np.log(errors[0])
    weight = np.ones(x.size) if number is None else 4.0 / polygamma(1, 0.5 * number)
    (slope, level), ((variance, _), _) = np.polyfit(x, y, 1, w=np.sqrt(weight), cov="unscaled")
    spread = float(np.sqrt(weight @ (y - slope * x - level) ** 2 / (x.size - 2)))
    if number is None:
        half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, x.size - 2) * spread * variance**0.5)
    else:
        half = float(norm.ppf(0.5 + 0.5 * CONFIDENCE) * max(spread, 1.0) * variance**0.5)
    order = -float(slope)
    return FittedOrder(order, order - half, order + half, len(sizes))
