"""W_p between the conditional distributions of two laws at given incoming angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.long_runs import progress_bar
from ..bases.intervals import cell_among
from ..laws.distribution import Distribution
from ..laws.law import Law
from .transport import Distributions, absolute_area, power_mean, wasserstein

# Incoming angle at which laws are tested for densities; the result does not depend on it.
PROBE = 1.0
# Fewest cells of the outgoing angle if the cuts of the densities are known, and if not.
CELLS_BETWEEN_CUTS, CELLS = 8, 64
# Numbers in memory at a time. Walls with many pieces have an atom for each entry point.
NUMBERS_AT_ONCE = 2**21
# Numbers in memory at a time between cuts, of which each angle has another number.
NUMBERS_BETWEEN_CUTS = 2**18
# The cells contribute at most this fraction of the tolerance.
CELLS_PART = 0.1
# Levels of polygons are extrapolated if their p-th powers differ by at most this fraction.
CLOSE = 0.1


@dataclass(frozen=True)
class ConditionalDistance:
    """W_p(P(theta, .), Q(theta, .)) for two laws P and Q, as a function of the incoming angles.

    Atoms are exact. If both laws know the cuts of their densities, distribution functions are computed at the atoms,
    the cuts, the edges of cells and the middles between all these; they are smooth in between. Else they count as
    linear between the edges of cells.
    """

    first: Law
    second: Law
    order: float

    @cached_property
    def is_atomic(self) -> bool:
        """Whether all conditional distributions consist of atoms, so that no cells are needed."""
        theta, edges = np.array([PROBE]), np.array([0.0, np.pi])
        return not any(np.any(law.distribution(theta, edges).below) for law in (self.first, self.second))

    @cached_property
    def knows_cuts(self) -> bool:
        """Whether distribution functions are computed between the cuts of both densities."""
        return all(law.density_cuts(np.array([PROBE])) is not None for law in (self.first, self.second))

    @property
    def halves(self) -> int:
        """2 if the distances at theta and pi - theta are equal, else 1."""
        return 2 if self.first.mirror_symmetric and self.second.mirror_symmetric else 1

    @cached_property
    def atoms(self) -> int:
        """The number of atoms of both laws at an incoming angle."""
        theta, edges = np.array([PROBE]), np.array([0.0, np.pi])
        return sum(law.distribution(theta, edges).mass.shape[1] for law in (self.first, self.second))

    def cells(self, theta: Floats, sup: bool, tolerance: float, most: int) -> tuple[int, float]:
        """The number of cells that the tolerance needs, and the error that remains, from the difference of two numbers.

        The error is the p-mean, or the largest, of the differences at incoming angles, which stand for equal parts of
        the measure. The number is at most ``most``.
        """
        least = CELLS_BETWEEN_CUTS if self.knows_cuts else CELLS
        if self.is_atomic:
            return least, 0.0
        number, found, error = least, self(theta, least), np.inf
        while number < most and error > CELLS_PART * tolerance:
            number *= 2
            before, found = found, self(theta, number)
            step = np.abs(found - before)
            error = float(step.max() if sup else power_mean(step, np.full(theta.size, 1.0 / theta.size), self.order))
        return number, error

    def __call__(self, theta: Floats, cells: int) -> Floats:
        """The distances at incoming angles, with this number of cells of the outgoing angle."""
        # neighbouring angles have about the same number of cuts
        sequence = np.argsort(theta, kind="stable")
        found = np.empty(theta.size)
        points = [law.outgoing_breakpoints for law in (self.first, self.second)]
        edges = np.linspace(0.0, np.pi, (1 if self.is_atomic else cells) + 1)
        edges = np.unique(np.concatenate((edges, *points)))
        numbers = NUMBERS_BETWEEN_CUTS if self.knows_cuts else NUMBERS_AT_ONCE
        step = max(1, numbers // max(edges.size, self.atoms))
        rows = self._between_cuts if self.knows_cuts else self._on_cells
        with progress_bar(theta.size, "angle", "distance") as bar:
            for start in range(0, theta.size, step):
                part = sequence[start : start + step]
                found[part] = rows(theta[part], edges)
                bar.update(part.size)
        return found

    def _on_cells(self, theta: Floats, edges: Floats) -> Floats:
        """W_p between distributions that are linear between edges, apart from atoms."""
        parts = [law.distribution(theta, edges) for law in (self.first, self.second)]
        if self.order != 1.0:
            pair = [Distributions.of_parts(edges, *part) for part in parts]
            return wasserstein(pair[0], pair[1], self.order)
        gap, position, jump = _difference(parts, [part.below for part in parts])
        corner = np.broadcast_to(edges, gap.shape)
        if position.shape[1]:
            cell = cell_among(edges, position)
            low, high = (np.take_along_axis(gap, cell + side, axis=1) for side in (0, 1))
            inside = low + (position - edges[cell]) / (edges[cell + 1] - edges[cell]) * (high - low)
            corner, order, jumps = _sorted(corner, position, jump)
            gap = np.take_along_axis(np.concatenate((gap, inside), axis=1), order, axis=1)
            above = gap + np.cumsum(jumps, axis=1)
            start, end = above[:, :-1], (above - jumps)[:, 1:]
        else:
            start, end = gap[:, :-1], gap[:, 1:]
        return absolute_area(np.diff(corner, axis=1), start, 0.5 * (start + end), end)

    def _between_cuts(self, theta: Floats, edges: Floats) -> Floats:
        """W_p from distribution functions at the atoms, the cuts, the edges and the middles between all these."""
        laws = (self.first, self.second)
        parts = [law.distribution(theta, np.array([0.0, np.pi])) for law in laws]
        cuts = [law.density_cuts(theta) for law in laws]
        listed = [found for found in cuts if found is not None]
        grid = np.concatenate((np.broadcast_to(edges, (theta.size, edges.size)), *listed), axis=1)
        position = np.concatenate([part.position for part in parts], axis=1)
        corner = _sorted(grid, position, position)[0]
        points = np.empty((theta.size, 2 * corner.shape[1] - 1))
        points[:, ::2], points[:, 1::2] = corner, 0.5 * (corner[:, 1:] + corner[:, :-1])
        below = [
            law.distribution(theta, points).below if np.any(part.below) else np.zeros(points.shape)
            for law, part in zip(laws, parts, strict=True)
        ]
        if self.order == 1.0:
            gap, _, jump = _difference(parts, below)
            step = np.cumsum(_sorted(grid, position, jump)[2], axis=1)[:, :-1]
            ends = (gap[:, :-1:2] + step, gap[:, 1::2] + step, gap[:, 2::2] + step)
            return absolute_area(np.diff(corner, axis=1), *ends)
        masses = (parts[0].mass, np.zeros(parts[1].mass.shape)), (np.zeros(parts[0].mass.shape), parts[1].mass)
        jumps = [_sorted(grid, position, np.concatenate(pair, axis=1))[2] for pair in masses]
        levels = []
        for every in (1, 2):
            pair = [_with_jumps(points[:, ::every], below[k][:, ::every], jumps[k]) for k in (0, 1)]
            levels.append(wasserstein(pair[0], pair[1], self.order))
        return self._extrapolated(levels[0], levels[1])

    def _extrapolated(self, fine: Floats, coarse: Floats) -> Floats:
        """From distances between polygons with two numbers of corners: the error of the p-th power is of order 2."""
        if self.is_atomic:
            return fine
        ratio = np.divide(coarse, fine, out=np.ones_like(fine), where=fine > 0.0)
        change = np.where(np.abs(ratio - 1.0) * self.order <= CLOSE, 1.0 - ratio**self.order, 0.0)
        return np.asarray(fine * (1.0 + change / 3.0) ** (1.0 / self.order))


def _difference(parts: Sequence[Distribution], below: Sequence[Floats]) -> tuple[Floats, Floats, Floats]:
    """The difference of atomless parts, and the positions and signed masses of all atoms, of measures of total 1."""
    totals = [(part.below[:, -1] + part.mass.sum(axis=1))[:, None] for part in parts]
    mass = np.concatenate((parts[0].mass / totals[0], -parts[1].mass / totals[1]), axis=1)
    return below[0] / totals[0] - below[1] / totals[1], np.concatenate([part.position for part in parts], axis=1), mass


def _sorted(grid: Floats, position: Floats, jump: Floats) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Grid points and positions of atoms in increasing order, their order, and the jumps at each."""
    corner = np.concatenate((grid, position), axis=1)
    order = np.argsort(corner, axis=1, kind="stable")
    jumps = np.concatenate((np.zeros(grid.shape), jump), axis=1)
    return np.take_along_axis(corner, order, axis=1), order, np.take_along_axis(jumps, order, axis=1)


def _with_jumps(points: Floats, below: Floats, jump: Floats) -> Distributions:
    """Distribution functions that are linear between points, with jumps at equally many points."""
    jumps = np.zeros(points.shape)
    jumps[:, :: (points.shape[1] - 1) // (jump.shape[1] - 1)] = jump
    above = below + np.cumsum(jumps, axis=1)
    level = np.stack((above - jumps, above), axis=-1).reshape(len(points), -1)
    level = np.maximum.accumulate(level, axis=1)
    return Distributions(np.repeat(points, 2, axis=1), level / level[:, -1:])
