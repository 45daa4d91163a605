"""What errors are measured against: a value, how well it is known, and where it comes from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...checks import Floats, finite_array, finite_number, frozen
from ...errors import InputError
from ...rounding import EPS


@dataclass(frozen=True, eq=False)
class ReferenceValue:
    """A reference value of a quantity.

    Parameters
    ----------
    value : array_like
        A number or an array of any shape.
    error : float
        How far the truth may be from ``value``, in the problem's first norm; 0 if it is exact to rounding.
    source : str
        Where it comes from, in words: "closed form", "beams", "2^24 rays of independent Sobol sequences".
    made_by : tuple of str
        Names of methods that share their code with the reference; they are measured against another one.

    Raises
    ------
    InputError
        If a number is not finite, the error negative, or the source empty.

    Examples
    --------
    >>> ReferenceValue(0.25, 0.0, "closed form").is_exact
    True
    """

    value: Floats
    error: float
    source: str
    made_by: tuple[str, ...] = ()

    def __init__(self, value: ArrayLike, error: float, source: str, made_by: tuple[str, ...] = ()) -> None:
        object.__setattr__(self, "value", frozen(finite_array("value", value)))
        object.__setattr__(self, "error", finite_number("error", error))
        object.__setattr__(self, "source", str(source))
        object.__setattr__(self, "made_by", tuple(made_by))
        if self.error < 0.0:
            raise InputError(f"error: expected a number of at least 0, got {error!r}")
        if not self.source:
            raise InputError("source: expected words that say where the reference comes from, got none")

    @property
    def is_exact(self) -> bool:
        """Whether its error is no more than rounding."""
        return self.error <= ROUNDED * max(1.0, float(np.max(np.abs(self.value), initial=0.0)))


# A value that is exact in the text may carry the rounding of a few thousand operations.
ROUNDED = 4096.0 * EPS
