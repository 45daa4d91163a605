"""Upper bounds of W_1 between measures on a square of cells, by plans on ever smaller cells.

Only the difference of the measures is transported, because common mass may stay. On the coarsest cells the transport
problem is solved with all pairs of cells, on the next with the pairs beside those of the plan before, by a sparse
network simplex. A plan between the masses of cells, at their means, costs at most what `_plan_cost` says, whichever
pairs it uses.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import AccuracyError

# Cells along a side with which plans begin, and pairs of cells of a sparse problem, at most a few seconds.
CELLS_AT_START, MOST_SPARSE = 16, 2**18
MOST_PIVOTS = 10**8
# Masses below this fraction of the total count as 0.
NO_MASS = 1e-15
# Largest distance on the square.
DIAGONAL = float(np.hypot(np.pi, np.pi))


@dataclass(frozen=True)
class Level:
    """An upper bound of W_1 from ``cells`` times ``cells`` cells."""

    cells: int
    upper: float


@dataclass(frozen=True)
class _Masses:
    """The occupied cells of a level: indices, masses, means, covariances xx, xy, yy, and radii about the means."""

    cell: NDArray[np.intp]
    mass: Floats
    mean: Floats
    spread: Floats
    radius: Floats

    @staticmethod
    def of(points: Floats, array: Floats, level: int) -> _Masses:
        """The point masses ``array`` on the square of ``points``, in ``level`` times ``level`` blocks of equal size."""
        place = np.argwhere(array > NO_MASS)
        weight, position = array[tuple(place.T)], points[place]
        block = place // (points.size // level)
        number, owner = np.unique(block @ np.array([level, 1]), return_inverse=True)
        mass = np.asarray(np.bincount(owner, weight), dtype=np.float64)

        def average(values: Floats) -> Floats:
            return np.asarray(np.bincount(owner, weight * values) / mass)

        mean = np.stack([average(position[:, axis]) for axis in (0, 1)], axis=-1)
        x, y = (position - mean[owner]).T
        radius = np.zeros(mass.size)
        np.maximum.at(radius, owner, np.hypot(x, y))
        spread = np.stack([average(x * x), average(x * y), average(y * y)], axis=-1)
        cell = np.stack(np.divmod(number, level), axis=-1).astype(np.intp)
        return _Masses(cell, mass, mean, spread, radius)

    @property
    def size(self) -> int:
        return self.mass.size


@dataclass(frozen=True)
class _Plan:
    source: NDArray[np.intp]
    target: NDArray[np.intp]
    mass: Floats


def levels_of_transport(points: Floats, difference: Floats, most_cells: int) -> Iterator[Level]:
    """Upper bounds of W_1 between the positive and the negative part of an array on the square of points, ever closer.

    Each level has twice the cells of the one before. The last has ``most_cells``, or is the last that divides the
    number of points and fits the limits.

    Examples
    --------
    >>> array = np.array([[0.5, -0.5], [-0.5, 0.5]])
    >>> [float(level.upper) for level in levels_of_transport(np.array([1.0, 2.0]), array, 2)]
    [1.0]
    """
    cells = min(CELLS_AT_START, most_cells)
    one, other = (_Masses.of(points, sign * difference, cells) for sign in (1.0, -1.0))
    if not one.size or not other.size:
        yield Level(cells, 0.0)
        return
    plan = _plan(one, other, np.indices((one.size, other.size)).reshape(2, -1))
    while plan is not None:
        yield Level(cells, _plan_cost(one, other, plan))
        cells *= 2
        if cells > most_cells or points.size % cells:
            return
        source, target = one.cell[plan.source], other.cell[plan.target]
        one, other = (_Masses.of(points, sign * difference, cells) for sign in (1.0, -1.0))
        pairs = _next_pairs(source, target, one, other, cells)
        if pairs.shape[1] > MOST_SPARSE:
            return
        plan = _plan(one, other, pairs)


def _plan(one: _Masses, other: _Masses, pairs: NDArray[np.intp]) -> _Plan | None:
    """The best plan that uses only these pairs; None if rounding leaves no plan on a part of all pairs."""
    import ot
    from scipy.sparse import coo_array

    every = pairs.shape[1] == one.size * other.size
    length = np.linalg.norm(one.mean[pairs[0]] - other.mean[pairs[1]], axis=1)
    shape = (one.size, other.size)
    cost: Any = length.reshape(shape) if every else coo_array((length, tuple(pairs)), shape=shape)
    total = one.mass.sum()
    found, log = ot.emd(one.mass / total, other.mass / other.mass.sum(), cost, numItermax=MOST_PIVOTS, log=True)
    if log["warning"]:
        if every:
            raise AccuracyError(f"optimal transport: {log['warning']}", float("nan"))
        return None
    flow = coo_array(found)
    used = flow.data > 0.0
    return _Plan(flow.row[used].astype(np.intp), flow.col[used].astype(np.intp), total * flow.data[used])


def _plan_cost(one: _Masses, other: _Masses, plan: _Plan) -> float:
    r"""A bound of the cost of a plan between the masses of cells, independent in each pair of cells.

    Let Z be the difference of the points and d the length of its mean. E|Z| <= sqrt(E|Z|^2) = sqrt(d^2 + var Z). If the
    component a along the mean is at least s > 0, |Z| <= a + b^2 / (2 s) with the component b across. The smaller bound
    counts.
    Mass that the plan lacks by rounding travels along the diagonal.
    """
    shift = one.mean[plan.source] - other.mean[plan.target]
    length = np.hypot(*shift.T)
    xx, xy, yy = (one.spread[plan.source] + other.spread[plan.target]).T
    x, y = np.divide(shift.T, length, out=np.zeros_like(shift.T), where=length > 0.0)
    across = np.maximum(y * y * xx - 2.0 * x * y * xy + x * x * yy, 0.0)
    least = length - one.radius[plan.source] - other.radius[plan.target]
    sharp = length + np.divide(0.5 * across, least, out=np.full_like(length, np.inf), where=least > 0.0)
    bound = np.minimum(np.sqrt(length**2 + xx + yy), sharp)
    lacking = sum(
        float(np.abs(np.bincount(index, plan.mass, part.size) - part.mass).sum())
        for index, part in ((plan.source, one), (plan.target, other))
    )
    return float(plan.mass @ bound) + DIAGONAL * lacking


def _next_pairs(
    source: NDArray[np.intp], target: NDArray[np.intp], one: _Masses, other: _Masses, level: int
) -> NDArray[np.intp]:
    """Pairs of cells of half the size: those in the cells of the plan, and those with one cell beside."""
    rows, columns = (_numbers(part, level) for part in (one, other))
    inner, around = range(2), range(-1, 3)
    keys = []
    for first, second in ((inner, around), (around, inner)):
        offsets = np.stack(np.meshgrid(first, first, second, second, indexing="ij"), axis=-1).reshape(-1, 4)
        for offset in offsets:
            # the table has an empty frame one cell wide
            i = rows[tuple((2 * source + offset[:2] + 1).T)]
            j = columns[tuple((2 * target + offset[2:] + 1).T)]
            both = (i >= 0) & (j >= 0)
            keys.append(i[both] * other.size + j[both])
    return np.stack(np.divmod(np.unique(np.concatenate(keys)), other.size))


def _numbers(part: _Masses, level: int) -> NDArray[np.intp]:
    """The number of each occupied cell, -1 for others, with a frame of -1."""
    table = np.full((level + 2, level + 2), -1, dtype=np.intp)
    table[tuple(part.cell.T + 1)] = np.arange(part.size)
    return table
