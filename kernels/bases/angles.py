"""Angles to full relative accuracy at the ends of (0, pi), and their positions among sorted edges."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats
from .measure import LARGEST_ANGLE, SINE, SMALLEST_ANGLE


def clipped_inside(angle: Floats) -> Floats:
    """Clip angles to [SMALLEST_ANGLE, LARGEST_ANGLE], because rounding can put them on or past an end of (0, pi)."""
    return np.asarray(np.clip(angle, SMALLEST_ANGLE, LARGEST_ANGLE))


def mirrored_angle(angle: Floats) -> Floats:
    """Return pi - angle, clipped to the open interval (0, pi)."""
    return clipped_inside(np.pi - angle)


def mixed_arccos(fraction: Floats, theta: Floats, half: float) -> tuple[Floats, Floats]:
    """Return delta = arccos(fraction cos(theta - half) + (1 - fraction) cos(theta + half)) and pi - delta.

    Both have full relative accuracy, because sin(delta/2)^2 and cos(delta/2)^2 are sums of non-negative terms.
    Cosines near pi/2 are computed as sines of the complement, so that theta -> pi - theta only exchanges the results.
    """
    complement = np.pi - theta
    sine = fraction * np.sin(0.5 * (theta - half)) ** 2 + (1.0 - fraction) * np.sin(0.5 * (theta + half)) ** 2
    cosine = (
        fraction * np.sin(0.5 * (complement + half)) ** 2 + (1.0 - fraction) * np.sin(0.5 * (complement - half)) ** 2
    )
    sine, cosine = np.sqrt(sine), np.sqrt(cosine)
    return 2.0 * np.arctan2(sine, cosine), 2.0 * np.arctan2(cosine, sine)


# Number of halvings that shrink an interval of angles to the spacing of float64.
BISECTIONS = 60
# Limit on the breakpoints that a law lists, less than a second of work.
MOST_BREAKPOINTS = 2**20


def joined_lists(number: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """For lists of lengths ``number`` joined end to end: the index of each entry's list, and its position in the list.

    Examples
    --------
    >>> [part.tolist() for part in joined_lists(np.array([2, 0, 3]))]
    [[0, 0, 2, 2, 2], [0, 1, 0, 1, 2]]
    """
    owner = np.repeat(np.arange(number.size), number)
    return owner, np.arange(owner.size) - np.repeat(np.cumsum(number) - number, number)


def cell_among(edges: Floats, position: ArrayLike) -> NDArray[np.intp]:
    """The index i of the cell [edges[i], edges[i + 1]) of each position; positions beyond an end get the end's cell.

    Examples
    --------
    >>> cell_among(np.array([0.0, 1.0, 3.0]), np.array([-1.0, 0.0, 1.0, 3.0])).tolist()
    [0, 0, 1, 1]
    """
    return np.asarray(np.clip(np.searchsorted(edges, position, side="right") - 1, 0, len(edges) - 2))


def edges_inside(edges: Floats, low: Floats, high: Floats) -> tuple[NDArray[np.intp], Floats]:
    """All edges strictly between low[i] and high[i], for all i: the indices i and the edges, as flat arrays.

    Examples
    --------
    >>> [part.tolist() for part in edges_inside(np.arange(4.0), np.array([0.5, 2.0, 3.0]), np.array([2.5, 3.0, 1.0]))]
    [[0, 0], [1.0, 2.0]]
    """
    first = np.searchsorted(edges, low, side="right")
    owner, rank = joined_lists(np.maximum(np.searchsorted(edges, high, side="left") - first, 0))
    return owner, edges[first[owner] + rank]


def between_cuts(owner: NDArray[np.intp], cut: Floats) -> tuple[NDArray[np.intp], Floats, Floats]:
    """The intervals of positive length between neighbouring cuts of the same owner: owner, low, high.

    Examples
    --------
    >>> [part.tolist() for part in between_cuts(np.array([0, 1, 0, 0, 1]), np.array([3.0, 0.0, 1.0, 2.0, 0.0]))]
    [[0, 0], [1.0, 2.0], [2.0, 3.0]]
    """
    order = np.lexsort((cut, owner))
    owner, cut = owner[order], cut[order]
    selected = np.flatnonzero((owner[1:] == owner[:-1]) & (cut[1:] > cut[:-1]))
    return owner[selected], cut[selected], cut[selected + 1]


def without_extremal(angles: Floats, number: int) -> tuple[Floats, float]:
    """Sorted angles without ``number`` of them, half at either end, and the SINE measure outside the others' range.

    Examples
    --------
    >>> selected, beyond = without_extremal(np.array([0.5, 1.0, 2.0]), 2)
    >>> selected.tolist(), round(beyond, 12)
    ([1.0], 1.0)
    """
    selected = angles[(number + 1) // 2 : angles.size - number // 2]
    return selected, float(SINE.cdf(selected[0]) + SINE.mass(selected[-1], np.pi)) if selected.size else 1.0


def bisected(low: Floats, high: Floats, before: Callable[[Floats], NDArray[np.bool_]]) -> Floats:
    """The angle in each interval (low, high) at which ``before`` changes from true to false, by bisection."""
    low, high = low.copy(), high.copy()
    if low.size:
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            early = before(middle)
            low, high = np.where(early, middle, low), np.where(early, high, middle)
    return high
