"""Eigenvalues at the top of the spectrum, as quotients of eigenfunctions by rays that begin where the quotient varies.

Rays from panels give eigenfunctions, and their quotients with the noise of all rays. For a fixed function less noise is
possible: the square of incoming angles and entry points is cut into cells, and more rays begin in cells where products
of the function at both ends differ. Most rays of a hollow with few reflections leave smoothly, so that a net of a few
points is enough in their cells.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legval
from numpy.typing import NDArray

from ...core.checks import Floats, new_seed
from ...core.estimates import NORMAL_95, with_error
from ...core.long_runs import progress_bar
from ...kernels import Law
from ...kernels.sampling.chunks import RaySums
from ...kernels.sampling.sobol import PARTS, SOBOL_BITS, next_digits, shifted, sobol_sequence
from .rays_on_panels import DEGREE, Level, PanelSums, levels
from .trial_space import Rank

# Cells in each direction, replicates of each, and points of the net of each replicate in the first round. Two
# replicates have the longest nets; variances are then smoothed, by so many cells in each direction and over the rounds.
CELLS, REPLICATES, FIRST_POINTS = 192, 2, 4
SMOOTHED, REMEMBERED = 0.8, 0.5
# Least weight of a cell, relative to the mean, and rays at a time.
LEAST, RAYS_AT_ONCE = 0.05, 2**18
# Points of the sequences on panels from which quotients are computed; nominal seconds of a ray on panels and of one in
# cells, of which more are long.
TOLD_POINTS, RAY_TIME, CELL_TIME = 2**15, 7e-7, 8e-7
# More rays begin on panels if what these miss is more than this fraction of the noise of the quotients.
MISSED = 0.7
# Quotients of eigenfunctions from fewer rays than this fraction do not count.
OLD = 0.25


class Top(NamedTuple):
    """The rank of an eigenvalue with its error, and the interval that panels reach of it."""

    panels: int
    rays: int
    value: float
    error: float
    least: float
    reached: float

    @property
    def centre(self) -> float:
        """The middle of what panels reach."""
        return 0.5 * (self.least + self.reached)

    def __str__(self) -> str:
        return f"{with_error(self.value, self.error)} by {self.rays} rays on {self.panels} panels of degree {DEGREE}"


def tops_by_rays(
    law: Law, rng: np.random.Generator, seconds: float, rank: Rank, number: int = 1
) -> Iterator[tuple[list[Top], Level]]:
    """The eigenvalues of highest rank off the constants from more and more rays, until the time is over.

    Notes
    -----
    See `levels` for the arguments. The quotient of an eigenfunction from all rays on panels is below the eigenvalue by
    as much as the eigenvalue of these rays is above it; half of this counts as error.
    """
    with progress_bar(None, "step", "gap by rays") as bar:
        for tops, level in _tops(law, rng, seconds, rank, number):
            yield tops, level
            bar.describe(f"error {max(top.error for top in tops):.1g}")
            bar.update()


def _tops(
    law: Law, rng: np.random.Generator, seconds: float, rank: Rank, number: int
) -> Iterator[tuple[list[Top], Level]]:
    cells: _Cells | None = None
    rounds, spent, before = list[_Round](), 0.0, None
    for level in levels(law, rng, rank, number):
        # half of the rays on panels that were there before are known
        spent += RAY_TIME * PARTS * level.rays.points / (2.0 if level.rays is before else 1.0)
        before = level.rays
        if level.rays.points < TOLD_POINTS:
            continue
        cells = _Cells(level.rays, rng) if cells is None else cells
        missed = 0.5 * level.raised[:number] + level.unseen[:number]
        while True:
            spent += CELL_TIME * cells.next_rays
            if spent > seconds and rounds:
                return
            rounds.append(cells.next_round(level))
            tops, noise = _joint([one for one in rounds if one.points >= OLD * level.rays.points], level)
            yield tops, level
            if np.any(missed > MISSED * noise):
                break


class _Round(NamedTuple):
    """Quotients of eigenfunctions with their squared standard errors, and how far they are below the eigenvalues."""

    quotients: Floats
    variances: Floats
    below: Floats
    rays: int
    points: int


def _joint(rounds: list[_Round], level: Level) -> tuple[list[Top], Floats]:
    """The eigenvalues from all rounds, which count by their variances, and the noise of their quotients."""
    variances = np.array([one.variances for one in rounds])
    weight = 1.0 / np.maximum(variances, np.finfo(float).tiny)
    weight /= weight.sum(axis=0)
    quotient, below = (
        np.sum(weight * np.array([getattr(one, name) for one in rounds]), axis=0) for name in ("quotients", "below")
    )
    noise = NORMAL_95 * np.sqrt(np.sum(weight**2 * variances, axis=0))
    unseen = level.unseen[: len(noise)]
    value, error = quotient + below + 0.5 * unseen, noise + 0.5 * below + unseen + level.lost
    panels, rays = len(level.rays.share), PARTS * level.rays.points + sum(one.rays for one in rounds)
    numbers = np.stack([value, error, quotient - noise, quotient + 2.0 * below + noise], axis=1)
    return [Top(panels, rays, *each) for each in numbers.tolist()], noise


class _Cells:
    """Cells of the square of incoming angles, in the order of some rays on panels, and entry points.

    Each replicate of each cell has its own random shift of a net, so that their spread in all cells tells the error of
    the sum well, even where that of a cell is not known well.
    """

    def __init__(self, rays: PanelSums, rng: np.random.Generator) -> None:
        self.sums, self.rng = rays, np.random.default_rng(rng.integers(0, 2**63, size=2))
        self.rounds, self.variances = 0, np.ones(CELLS**2)

    @property
    def next_rays(self) -> int:
        """Rays of the next round; every second one has twice as many."""
        return CELLS**2 * REPLICATES * FIRST_POINTS << self.rounds // 2

    def next_round(self, level: Level) -> _Round:
        """Quotients by `next_rays`, of which each cell has some by the spread that earlier rounds saw there."""
        from scipy.ndimage import gaussian_filter

        rays, points = self.next_rays, self._points()
        parts = np.empty((CELLS**2, REPLICATES, level.number))
        digits = next_digits(sobol_sequence(new_seed(self.rng), 0), int(points.max()))
        for each in np.unique(points):
            same = np.flatnonzero(points == each)
            for some in np.array_split(same, -(-same.size * REPLICATES * each // RAYS_AT_ONCE)):
                parts[some] = self._means(level, some, digits[:each])
        variances = parts.var(axis=1, ddof=1)
        seen = gaussian_filter((points * variances.sum(axis=1)).reshape(CELLS, CELLS), SMOOTHED).ravel()
        self.variances = seen if self.rounds == 0 else REMEMBERED * self.variances + (1.0 - REMEMBERED) * seen
        self.rounds += 1
        quotients, below = level.rank(parts.mean(axis=(0, 1))), level.raised[: level.number]
        return _Round(quotients, variances.sum(axis=0) / (REPLICATES * CELLS**4), below, rays, level.rays.points)

    def _points(self) -> NDArray[np.int64]:
        """Points of the net in each cell, powers of two."""
        spread = np.sqrt(self.variances)
        weight = spread + LEAST * spread.mean()
        wanted = self.next_rays / REPLICATES * weight / weight.sum()
        return np.asarray(1 << np.maximum(np.round(np.log2(wanted)), 0.0).astype(np.int64))

    def _means(self, level: Level, cells: NDArray[np.intp], digits: NDArray[np.uint64]) -> Floats:
        """Means over a net of products of each function at both ends, shape (cells, REPLICATES, number)."""
        size = len(cells), REPLICATES, 2
        shifts, beyond = self.rng.integers(0, 2**SOBOL_BITS, size=size, dtype=np.uint64), self.rng.random(size)
        inside = shifted(digits, shifts, beyond * 2.0**-SOBOL_BITS)
        corner = np.stack([cells % CELLS, cells // CELLS], axis=-1)[:, None, None]
        square = ((corner + inside) / CELLS).reshape(1, -1, 2)
        rays, basis = self.sums.rays(0, 0), level.rays.basis
        ends = [angles[0] for angles in rays.traced(RaySums(rays.law, rays.basis, 0), square)]
        series = basis.legendre_series(level.vectors[:, : level.number])
        densities = [self.sums.density[rays.basis.positions(angle)[0]] for angle in ends]
        first, second = (
            legval(position, np.moveaxis(series[panel], 0, -1), tensor=False)
            for panel, position in map(basis.positions, ends)
        )
        weighted = first * second * (2.0 / (densities[0] + densities[1]))
        return np.asarray(np.moveaxis(weighted.reshape(level.number, len(cells), REPLICATES, -1).mean(axis=-1), 0, -1))
