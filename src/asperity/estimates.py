"""A number together with its error: where the error comes from and how big it is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

ErrorKind = Literal["bound", "estimate"]

# A number without error is printed to this many decimals.
DECIMALS = 12


@dataclass(frozen=True)
class Estimate:
    """A quantity that carries its error.

    Parameters
    ----------
    value : float
        The quantity.
    error : float
        Half width of the interval around ``value``; ``inf`` where nothing is known.
    kind : {"bound", "estimate"}
        ``"bound"``: the true value is within ``error`` (to rounding). ``"estimate"``: the error is itself estimated,
        as a standard error or from two resolutions; ``method`` says which.
    method : str
        How value and error were found, in words.

    Examples
    --------
    >>> gap = Estimate(0.25, 0.0, "bound", "closed form")
    >>> float(gap)
    0.25
    >>> print(gap)
    0.25 +- 0 (bound: closed form)
    """

    value: float
    error: float
    kind: ErrorKind
    method: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", float(self.value))
        object.__setattr__(self, "error", float(self.error))

    def __float__(self) -> float:
        return float(self.value)

    def __str__(self) -> str:
        return f"{self.value:.10g} +- {self.error:.2g} ({self.kind}: {self.method})"


def rounded(number: Estimate) -> str:
    """Value and error to the digits that the error leaves.

    Examples
    --------
    >>> from asperity.estimates import Estimate
    >>> rounded(Estimate(0.63297743, 0.00022, "estimate", "")), rounded(Estimate(0.25, 0.0, "bound", ""))
    ('0.63298 +- 0.00022', '0.25 +- 0')
    """
    if number.error == 0.0 or not math.isfinite(number.error):
        return f"{number.value:.{DECIMALS}g} +- {number.error:g}"
    decimals = min(max(1 - math.floor(math.log10(number.error)), 0), DECIMALS)
    if decimals >= DECIMALS:
        return f"{number.value:.{DECIMALS}f} +- {number.error:.2g}"
    return f"{number.value:.{decimals}f} +- {number.error:.{decimals}f}"
