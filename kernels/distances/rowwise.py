"""Mean or supremum over the incoming angle of the Wasserstein distance of conditional distributions."""

from __future__ import annotations

from itertools import count

import numpy as np

from ...core.checks import Floats
from ...core.estimates import Estimate
from ...core.long_runs import progress_bar
from ..bases.measure import SINE, gauss_on_intervals
from ..laws.law import ENTRY_POINTS, Law
from ..matrices.matrix import KernelMatrix, joint_kind
from .distributions import PROBE, cells_error, entry_error, on_cells, outgoing_distributions
from .resampling import distance_of_rows, matrices_error, stochastic_rows
from .transport import power_mean, wasserstein

# Gauss nodes per panel of the incoming angle; panels (breakpoints not counted), breakpoints, and cells of the outgoing
# angle on the coarsest level. Every level doubles panels, breakpoints and cells.
NODES, PANELS, BREAKPOINTS, CELLS = 4, 12, 24, 64
# Limit on the angles times cells of a level, a few seconds of work; FEW_ATOMS is added to the cells.
MOST_CORNERS, FEW_ATOMS = 2**22, 32
# Corners in memory at a time. Each angle counts with at least MOST_ATOMS, the atoms of walls with many pieces.
CORNERS_AT_ONCE, MOST_ATOMS = 2**21, ENTRY_POINTS
FEWEST_LEVELS = 3
# If the distance jumps at unknown incoming angles, a level at least halves the error, and the difference of two levels
# is the error of the finer one. This difference may be small by chance; a fraction of the one before guards against it.
MEMORY = 0.25
# A supremum at grazing, where infinitely many breakpoints accumulate, converges with order 1.
SUPREMUM_FACTOR = 2.0
# Distance of the outermost nodes of a panel from its ends, as a fraction of its width, for the supremum.
INSET = 1e-9
# Refinement ends when its error is this fraction of the error from entry points, which it does not change.
SMALL_PART = 0.1
# Rounding of some hundred sums of angles and probabilities.
ROUNDING = 1e-13


def law_distance(first: Law, second: Law, order: float, sup: bool, tolerance: float) -> Estimate:
    """The mean or the supremum over incoming angles of W_p, by Gauss rules refined until two levels agree.

    The error is estimated from the differences of levels, which differ in nodes, breakpoints and cells.
    """
    first, second = on_cells(first), on_cells(second)
    found: list[float] = []
    error, from_entries = np.inf, entry_error(first, order, sup) + entry_error(second, order, sup)
    smooth = not (_is_atomic(first) and _is_atomic(second))
    for level in count():
        low, high = _panels(first, second, level)
        edges = _edges(first, second, level) if smooth else np.array([0.0, np.pi])
        corners = low.size * NODES * (edges.size + FEW_ATOMS)
        if level >= FEWEST_LEVELS and corners > MOST_CORNERS:
            break
        angle, mass = _nodes(low, high, sup)
        rows = _rows(first, second, angle, edges, order)
        found.append(float(rows.max()) if sup else float(power_mean(rows, mass, order)))
        if level == 0:
            continue
        steps = np.abs(np.diff(found))
        error = float(steps[-1] if level == 1 else max(steps[-1], MEMORY * steps[-2]))
        error = (SUPREMUM_FACTOR if sup else 1.0) * error + ROUNDING
        error += sum(cells_error(law, order, sup) for law in (first, second))
        if level >= FEWEST_LEVELS - 1 and error <= max(tolerance - from_entries, SMALL_PART * from_entries):
            break
    how = f"Gauss rules on {low.size} panels; difference of two refinements"
    how += f", and {from_entries:.2g} from {ENTRY_POINTS} entry points" if from_entries else ""
    return Estimate(found[-1], error + from_entries, "estimate", how)


def matrix_distance(first: KernelMatrix, second: KernelMatrix, order: float, sup: bool) -> Estimate:
    """The mean or the supremum of W_p between matrices on the same cells, with point masses in their middles."""
    between = distance_of_rows(first, order, sup)
    value = float(between(stochastic_rows(first), stochastic_rows(second)))
    error = matrices_error(first, second, order, sup) + ROUNDING
    how = "distribution functions on the cells, and the errors of both matrices"
    return Estimate(value, error, joint_kind(first, second), how)


def _is_atomic(law: Law) -> bool:
    """Whether the conditional distributions consist of atoms, so that no cells are needed."""
    return not np.any(law.distribution(np.array([PROBE]), np.array([0.0, np.pi])).below)


def _panels(first: Law, second: Law, level: int) -> tuple[Floats, Floats]:
    limit = BREAKPOINTS * 2**level
    points = [law.breakpoints(limit)[0] for law in (first, second)]
    coarse = np.unique(np.concatenate((np.linspace(0.0, np.pi, PANELS + 1), *points)))
    pieces = 2**level
    fine = coarse[:-1, None] + np.arange(pieces) / pieces * np.diff(coarse)[:, None]
    edges = np.append(fine.ravel(), np.pi)
    return edges[:-1], edges[1:]


def _edges(first: Law, second: Law, level: int) -> Floats:
    points = [law.outgoing_breakpoints for law in (first, second)]
    return np.unique(np.concatenate((np.linspace(0.0, np.pi, CELLS * 2**level + 1), *points)))


def _nodes(low: Floats, high: Floats, sup: bool) -> tuple[Floats, Floats]:
    angle, weight = gauss_on_intervals(low, high, NODES)
    mass = weight * SINE.density(angle)
    if sup:
        inset = INSET * (high - low)
        return np.concatenate((angle, low + inset, high - inset)), mass
    return angle, mass / mass.sum()


def _rows(first: Law, second: Law, angle: Floats, edges: Floats, order: float) -> Floats:
    step = max(1, CORNERS_AT_ONCE // max(edges.size, MOST_ATOMS))
    parts = []
    with progress_bar(angle.size, "angle", "distance") as bar:
        for start in range(0, angle.size, step):
            theta = angle[start : start + step]
            one, other = (outgoing_distributions(law, theta, edges) for law in (first, second))
            parts.append(wasserstein(one, other, order))
            bar.update(theta.size)
    return np.concatenate(parts)
