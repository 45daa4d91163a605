"""Sectors of escape: directions in which a ray that leaves a line of a hollow meets nothing.

Let a ray leave a line from A to B upwards. The pieces from B on end on its right, at an end of the opening, and those
up to A on its left; to be in its way they would cross the ray in its direction from A or that from B. Of a piece
after B only the part above the start of such a ray matters. It is on the right if its ends are, and these are below a
slope. The greatest of these slopes, and the same on the left, limit the sector of the line.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ..curves.tolerances import JOINT_ULPS, NEARBY

# Number of lines in a hollow up to which all pairs of them are compared, a few milliseconds.
MOST_LINES = 1024
# Joints compared at once, so that the arrays of pairs stay in the cache.
ROWS = 64
# Least angle, about, between a ray of the sector and a ray from its start to any joint above.
ESCAPE_MARGIN = 2.0**-10
# Distance from the ends of its line, in multiples of the slack at joints, from which on a ray may escape: the
# ends are then 16 slacks or more from the ray, and a neighbour that the ray's line crosses behind the start is 2 away.
ESCAPE_ROOM = 2.0**15


def escape_sectors(points: Floats, size: float) -> Floats:
    """Return the sectors of escape of the lines between consecutive points, which end at the two ends of an opening.

    Parameters
    ----------
    points : array, shape (n + 1, 2)
    size : float
        Size of the hollow.

    Returns
    -------
    array, shape (n, 2)
        A ray of velocity (vx, vy) that leaves the line at a distance from its ends escapes if vx < right * vy and
        -vx < left * vy, where right and left are the two numbers of a row; both are 0 for a line without one.

    Examples
    --------
    >>> escape_sectors(np.array([[0.0, 0.0], [0.5, -1.0], [1.0, 0.0]]), 1.0).round(2).tolist()
    [[0.5, 0.5], [0.5, 0.5]]
    """
    count = len(points) - 1
    sectors = np.zeros((count, 2))
    if count > MOST_LINES:
        return sectors
    slack = JOINT_ULPS * EPS * size
    right, left = _slopes(points, slack), _slopes(points[::-1] * (-1.0, 1.0), slack)[::-1]
    is_alone = _is_alone(points, NEARBY * size)
    for column, slopes in enumerate((right, left)):
        slope = np.maximum(slopes[:-1], slopes[1:])
        sectors[:, column] = is_alone / (slope + ESCAPE_MARGIN * (1.0 + slope * slope))
    return np.asarray(sectors * (sectors > 0.0).all(axis=1, keepdims=True))


def _slopes(points: Floats, slack: float) -> Floats:
    """Return the greatest slope from each point to the later pieces above it, at least 0; inf if one is on the left."""
    slopes = np.zeros(len(points))
    start, end = points[:-1], points[1:]
    for first in range(0, len(points), ROWS):
        numbers = np.arange(first, min(first + ROWS, len(points)))[:, np.newaxis]
        x, level = points[numbers, 0], points[numbers, 1] - 4.0 * slack
        later, is_next = np.arange(len(start)) >= numbers, np.arange(len(start)) == numbers
        worst = np.zeros(later.shape)
        for here, there in ((start, end), (end, start)):
            matters = later & (np.maximum(here[:, 1], there[:, 1]) >= level) & ~(is_next & (here is start))
            # the end of the part above the level
            below = here[:, 1] < level
            with np.errstate(divide="ignore", invalid="ignore"):
                part = np.where(below, (level - here[:, 1]) / (there[:, 1] - here[:, 1]), 0.0)
            dx = here[:, 0] + part * (there[:, 0] - here[:, 0]) - x
            dy = np.where(below, 0.0, here[:, 1] - level)
            # of the piece that starts here only the other end counts
            matters &= ~(is_next & below)
            slope = np.where(dx > slack, dy / np.where(dx > slack, dx, 1.0), np.inf)
            worst = np.maximum(worst, np.where(matters, slope, 0.0))
        slopes[first : first + len(numbers)] = worst.max(axis=1)
    return slopes


def _is_alone(points: Floats, close: float) -> NDArray[np.bool_]:
    """Return which lines are long, far from all others but their neighbours, and at no spike."""
    start, end = points[:-1], points[1:]
    edges = end - start
    count, lengths = len(edges), np.hypot(edges[:, 0], edges[:, 1])
    low, high = np.minimum(start, end), np.maximum(start, end)
    alone = lengths > 2.0 * close
    alone[1:] &= lengths[:-1] > 2.0 * close
    alone[:-1] &= lengths[1:] > 2.0 * close
    turn = edges[:-1, 0] * edges[1:, 1] - edges[:-1, 1] * edges[1:, 0]
    along = edges[:-1, 0] * edges[1:, 0] + edges[:-1, 1] * edges[1:, 1]
    is_spike = (along < 0.0) & (np.abs(turn) < ESCAPE_MARGIN * lengths[:-1] * lengths[1:])
    alone[1:] &= ~is_spike
    alone[:-1] &= ~is_spike
    for first in range(0, count, ROWS):
        rows = slice(first, min(first + ROWS, count))
        others = np.abs(np.arange(count) - np.arange(count)[rows, np.newaxis]) > 1
        gap = np.maximum(low - high[rows, np.newaxis], low[rows, np.newaxis] - high).max(axis=-1)
        alone[rows] &= ~(others & (gap <= 2.0 * close)).any(axis=1)
    return alone
