"""Rows of unequal lengths, laid end to end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def ragged(number: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The row that each entry belongs to, and its place there, of rows with so many entries.

    Examples
    --------
    >>> [part.tolist() for part in ragged(np.array([2, 0, 3]))]
    [[0, 0, 2, 2, 2], [0, 1, 0, 1, 2]]
    """
    owner = np.repeat(np.arange(number.size), number)
    return owner, np.arange(owner.size) - np.repeat(np.cumsum(number) - number, number)
