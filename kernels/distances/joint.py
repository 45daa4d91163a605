"""Distances between flux measures on the square of incoming and outgoing angles, by optimal transport."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ...core.estimates import Estimate
from ...core.long_runs import progress_bar
from ...core.rounding import EPS
from ..bases.basis import Basis
from ..bases.bins import Bins
from ..discretisation.discretisation import discretise
from ..expectations.distribution_functions import Distributions
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix, joint_kind
from .cell_transport import MOST_PIVOTS, NO_MASS, Level, levels_of_transport
from .resampling import cell_middles, matrices_error, stochastic_rows
from .rowwise import matrix_distance
from .transport import power_mean, wasserstein

# Limit on the pairs of occupied cells for an exact solution, at about 40 bytes per pair, 160 MB, and a few seconds.
MOST_PAIRS = 2**22
# Bins on which laws are compared, for p > 1 and for p = 1, and the tolerance of their matrices.
LAW_BINS, FINE_LAW_BINS, LAW_TOLERANCE = 128, 512, 1e-7
# If the wanted error is at least this, half as many bins are enough for p = 1.
ROUGH = 4e-3
# Merging bins has an effect of second order: 1 + 4 parts after two steps, and 1 part after one.
EXPECTED_RATIO = 5.0
# If the changes of upper bounds fall by this factor, the rest is between these parts of the last change, which belong
# to orders of convergence from 2.6 to 1.3; else it is between 0 and the last change.
FALL, REST = 2.2, (0.2, 0.7)
# The solver stops at reduced costs of 10 eps times the largest cost; the rest is for the rounding of its sums.
SOLVER_ROUNDING = 64.0 * EPS
# If rounding changes the distance by more than this, a bracket is computed.
SMALL_DOUBT = 1e-6
# Directions of the lower bound by projection.
DIRECTIONS = 32


def joint_law_distance(first: Law, second: Law, order: float, tolerance: float, bins: int | None = None) -> Estimate:
    """W_p between the flux measures of two laws, from their matrices on bins; the error is an estimate.

    For p = 1 the number of ``bins`` may be chosen, a multiple of 64.
    """
    if order != 1.0:
        basis = Bins(LAW_BINS)
        pair = [discretise(law, basis, tolerance=LAW_TOLERANCE) for law in (first, second)]
        return joint_matrix_distance(pair[0], pair[1], order, of_laws=True)
    basis = Bins(bins or FINE_LAW_BINS // (2 if tolerance >= ROUGH else 1))
    pair = [discretise(law, basis, tolerance=LAW_TOLERANCE) for law in (first, second)]
    with progress_bar(None, "transport", "distance") as bar:
        return _between_fine(pair[0], pair[1], tolerance, bar)


def _between_fine(first: KernelMatrix, second: KernelMatrix, tolerance: float, bar: Any) -> Estimate:
    """W_1 between laws: upper bounds for point masses in the middle of the bins, and the effect of the bins.

    The effect is estimated by the changes of the bound when bins are merged, once and twice. The second change is
    expected to be five times the first. The larger one of both estimates counts, up to the largest possible effect.
    """
    own = matrices_error(first, second, 1.0, False)
    flux = [matrix.weights[:, None] * stochastic_rows(matrix) for matrix in (first, second)]
    fine, *merged = islice(_levels(first.basis, flux[0], flux[1], 1.0), 3)
    found = _refined(fine, 0.5 * tolerance, first.basis.size, bar)
    uppers = {level.cells: level.upper for level in found}
    changes = []
    for level in merged:
        coarse = _refined(level, 0.0, min(level[0].size, found[-1].cells), bar)[-1]
        changes.append(abs(uppers[coarse.cells] - coarse.upper))
    step = max(changes[0], changes[1] / EXPECTED_RATIO)
    step = min(step, sum(_within_cells(first.basis, part, 1.0) for part in flux))
    value, rest = _limit([level.upper for level in found])
    how = f"upper bounds by transport on up to {found[-1].cells} x {found[-1].cells} cells, to {rest:.2g}"
    return Estimate(value, own + rest + step, "estimate", f"{how}, and {step:.2g} from {first.basis!r}")


def _refined(level: tuple[Basis, Floats, Floats, float], wanted: float, most_cells: int, bar: Any) -> list[Level]:
    """Upper bounds of W_1 from ever smaller cells, until the limit is known to the wanted error."""
    found = []
    for bound in levels_of_transport(cell_middles(level[0].edges), level[1] - level[2], most_cells):
        found.append(bound)
        bar.update()
        if len(found) > 2 and _limit([each.upper for each in found])[1] <= wanted:
            break
    return found


def _limit(uppers: list[float]) -> tuple[float, float]:
    """The limit of upper bounds from cells that were halved, and its error."""
    if len(uppers) < 2:
        return 0.5 * uppers[-1], 0.5 * uppers[-1]
    changes = np.abs(np.diff(uppers))
    low, high = REST if len(changes) > 1 and changes[-2] >= FALL * changes[-1] else (0.0, 1.0)
    return max(float(uppers[-1] - 0.5 * (low + high) * changes[-1]), 0.0), float(0.5 * (high - low) * changes[-1])


def joint_matrix_distance(first: KernelMatrix, second: KernelMatrix, order: float, of_laws: bool = False) -> Estimate:
    """W_p between the flux measures of two matrices; see `_joint`."""
    with progress_bar(None, "transport", "distance") as bar:
        return _joint(first, second, order, of_laws, bar)


def _joint(first: KernelMatrix, second: KernelMatrix, order: float, of_laws: bool, bar: Any) -> Estimate:
    r"""W_p between the flux measures of two matrices, as point masses in the middle of the cells.

    The result is exact up to ``MOST_PAIRS`` pairs of occupied cells. For more pairs, neighbouring cells are merged.
    Merging moves masses by known distances, which gives a bracket. Further bounds are the distance of kind ``"rows"``
    (from above) and W_p of projections to lines (from below). The error is the difference from the next coarser level
    if it is smaller than the bracket. Where rounding spoils p-th powers, the result is the middle of the bracket.
    """
    own = matrices_error(first, second, order, False)
    flux, flux2 = (matrix.weights[:, None] * stochastic_rows(matrix) for matrix in (first, second))
    levels = _levels(first.basis, flux, flux2, order)
    basis, one, other, moved = next(level for level in levels if _pairs(*level[1:3], order) <= MOST_PAIRS)
    merged = basis != first.basis
    value, doubt = _solved(basis, one, other, order)
    bar.update()
    exact = joint_kind(first, second)
    if not (merged or of_laws) and doubt <= SMALL_DOUBT:
        return Estimate(value, own + doubt, exact, f"optimal transport between the occupied cells of {basis!r}")
    upper = float(matrix_distance(first, second, order, False))
    lower = _largest_projection(first.basis, flux, flux2, order)
    bar.update()
    moved += doubt
    low, high = max(lower, value - moved), min(upper, value + moved)
    coarser = next(levels, None) if merged or of_laws else None
    step = np.inf if coarser is None else abs(_solved(*coarser[:3], order)[0] - value) + doubt
    how = f"optimal transport on {basis!r}"
    if of_laws:
        moved += sum(_within_cells(first.basis, part, order) for part in (flux, flux2))
        return Estimate(value, own + min(step, moved), "estimate", how + " and coarser")
    value = float(np.clip(value, low, high)) if merged else 0.5 * (low + high)
    bound = max(high - value, value - low)
    if bound <= step:
        return Estimate(value, own + bound, exact, how + f", bracketed by ({low:.6g}, {high:.6g})")
    return Estimate(value, own + step, "estimate", how + f" and coarser, within ({low:.6g}, {high:.6g})")


def _levels(basis: Basis, one: Floats, other: Floats, order: float) -> Iterator[tuple[Basis, Floats, Floats, float]]:
    """Fluxes on successively coarser cells, and the total W_p distance by which merging has moved both of them."""
    start = cell_middles(basis.edges)
    parent = np.arange(basis.size)
    fluxes = [one, other]
    while True:
        middles = cell_middles(basis.edges)[parent]
        square = (start - middles) ** 2
        step = np.sqrt(square[:, None] + square).ravel()
        moved = sum(float(power_mean(step, flux.ravel(), order)) for flux in (one, other))
        yield basis, fluxes[0], fluxes[1], moved
        coarse = basis.coarsened()
        if coarse is None:
            return
        owner = np.asarray(coarse[1].argmax(axis=0))
        merge = (np.arange(coarse[0].size)[:, None] == owner).astype(np.float64)
        fluxes = [merge @ flux @ merge.T for flux in fluxes]
        basis, parent = coarse[0], owner[parent]


def _masses(one: Floats, other: Floats, order: float) -> tuple[Floats, Floats]:
    """The masses to transport: for p = 1 only the differences, because common mass may stay."""
    if order == 1.0:
        one, other = np.maximum(one - other, 0.0), np.maximum(other - one, 0.0)
    return np.where(one > NO_MASS, one, 0.0), np.where(other > NO_MASS, other, 0.0)


def _pairs(one: Floats, other: Floats, order: float) -> int:
    parts = _masses(one, other, order)
    return int(np.count_nonzero(parts[0]) * np.count_nonzero(parts[1]))


def _solved(basis: Basis, one: Floats, other: Floats, order: float) -> tuple[float, float]:
    """W_p between fluxes on the cells, and its error from the rounding of the p-th power."""
    import ot
    from scipy.spatial.distance import cdist

    parts = _masses(one, other, order)
    total = float(parts[0].sum())
    if total <= NO_MASS or not parts[1].any():
        return 0.0, 0.0
    points = cell_middles(basis.edges)
    source, target = (np.argwhere(part > 0.0) for part in parts)
    length = cdist(points[source], points[target])
    longest = float(length.max()) or 1.0
    cost = (length / longest) ** order
    weights = [part[part > 0.0] for part in parts]
    value, log = ot.emd2(
        weights[0] / weights[0].sum(), weights[1] / weights[1].sum(), cost, numItermax=MOST_PIVOTS, log=True
    )
    if log["warning"]:
        raise AccuracyError(f"optimal transport: {log['warning']}", float("nan"))
    power = max(total * float(value), 0.0)
    low, found, high = (
        longest * moved ** (1.0 / order)
        for moved in (max(power - SOLVER_ROUNDING * total, 0.0), power, power + SOLVER_ROUNDING * total)
    )
    return found, max(high - found, found - low)


def _largest_projection(basis: Basis, one: Floats, other: Floats, order: float) -> float:
    """The largest W_p of the projections to lines through the origin, a lower bound of W_p in the plane."""
    points = cell_middles(basis.edges)
    largest = 0.0
    for angle in np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
        position = (np.cos(angle) * points[:, None] + np.sin(angle) * points).reshape(1, -1)
        first, second = (Distributions.of_atoms(position, flux.reshape(1, -1)) for flux in (one, other))
        largest = max(largest, float(wasserstein(first, second, order)[0]))
    return largest


def _within_cells(basis: Basis, flux: Floats, order: float) -> float:
    """A bound of W_p between a flux measure and the point masses in the middle of its cells."""
    half = 0.5 * np.diff(basis.edges)
    return float(power_mean(np.hypot(half[:, None], half).ravel(), flux.ravel(), order))
