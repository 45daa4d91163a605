"""The least and the greatest resistance of a rough surface, with bounds over all laws of the continuum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...core.checks import Floats, choice, positive_number, whole_number
from ...core.errors import AccuracyError, InputError
from ...core.estimates import Estimate, Summary
from ...core.long_runs import NUMBERS_AT_ONCE, slices
from ..bases.measure import SINE, gauss_on_intervals
from ..bases.partitions import Bins
from ..discretisation.discretisation import discretise
from ..laws.deterministic import IntervalExchangeLaw, LeastResistanceLaw
from ..laws.law import Law, retroreflection
from ..laws.matrix_law import MatrixLaw
from ..matrices.matrix import KernelMatrix, frobenius_error
from .drag import CostFunction, air_resistance

# Bound of the second derivatives of the air resistance.
AIR_CURVATURE = 0.75
# Transport between n cells takes several arrays of n^2 numbers and n^2 to n^3 steps: a few seconds at this limit.
MOST_CELLS = 2048
# Rounding of sums of thousands of cosines.
ROUNDING = 1e-14


@dataclass(frozen=True, eq=False, repr=False)
class ExtremalResistance(Summary):
    """The extremal mean of a cost over all symmetric laws.

    Attributes
    ----------
    lower, upper : float
        Bounds of the extremum over all symmetric laws of the continuum, to rounding.
    plan : KernelMatrix
        The optimal law, or a law within the bounds, on bins.
    law : Law
        The law of the plan, in closed form for the air resistance, else piecewise uniform.
    """

    lower: float
    upper: float
    plan: KernelMatrix
    law: Law

    @property
    def value(self) -> Estimate:
        """The midpoint of the bounds, with half of their distance as error."""
        half = 0.5 * (self.upper - self.lower)
        return Estimate(self.lower + half, half, "bound", "primal and dual of optimal transport")

    def involution(self) -> IntervalExchangeLaw:
        """A deterministic law with the same matrix as the plan."""
        return IntervalExchangeLaw(self.plan)


def extremal_resistance(
    n: int = 1024,
    which: Literal["min", "max"] = "min",
    *,
    cost: CostFunction | None = None,
    curvature: float | None = None,
) -> ExtremalResistance:
    r"""The least or greatest mean of a cost over all symmetric laws.

    Every symmetric law is a limit of laws of walls (Plakhov), so these are the extremal resistances of rough surfaces.

    Parameters
    ----------
    n : int
        Cells of the grid on which bounds are computed, at least 8; the gap between the bounds decreases like n^-2. With
        ``cost`` at most 2048, which takes a few seconds.
    which : {"min", "max"}
    cost : callable, optional
        Symmetric ``cost(theta, theta_out)`` of two arrays that broadcast; by default that of `resistance`.
    curvature : float
        Required with ``cost``: a bound of the moduli of its second derivatives in either variable.

    Returns
    -------
    ExtremalResistance

    Raises
    ------
    InputError
        If n is out of range, the cost is not symmetric, or its curvature is missing.

    Notes
    -----
    The problem is optimal transport of sin(theta)/2 d theta to itself. Symmetry is no restriction, since a plan may be
    averaged with its transpose. The bounds come from weak duality: a law gives an upper bound of a minimum, a pair of
    potentials a lower bound. For the air resistance both have closed forms (`LeastResistanceLaw`, retroreflection), and
    the grid serves to verify the inequality between potential and cost, also between its points. For other costs both
    come from the network simplex method of POT.

    Examples
    --------
    >>> least = extremal_resistance(256)
    >>> round(least.lower, 3), round(least.upper, 12)
    (0.988, 0.987823750352)
    >>> most = extremal_resistance(8, "max")
    >>> most.lower, most.upper
    (1.5, 1.5)
    """
    whole_number("n", n, 8)
    choice("which", which, ("min", "max"))
    if cost is not None:
        return _by_transport(n, which, cost, curvature)
    if which == "max":
        # cos <= 1, and retroreflection attains it
        return ExtremalResistance(1.5, 1.5, discretise(retroreflection(), Bins(n)), retroreflection())
    law = LeastResistanceLaw()
    # the potential of 1 + cos is the potential of cos plus 1/2 for each of the two angles
    potential = 0.75 * (0.5 + law.potential(np.linspace(0.0, np.pi, n + 1)))
    lower = dual_bound(potential, air_resistance, AIR_CURVATURE) - ROUNDING
    return ExtremalResistance(lower, 0.75 * (1.0 + law.mean_cosine) + ROUNDING, discretise(law, Bins(n)), law)


def _by_transport(n: int, which: str, cost: CostFunction, curvature: float | None) -> ExtremalResistance:
    if curvature is None:
        raise InputError("curvature: expected a bound of the second derivatives of the cost, got None")
    bound = positive_number("curvature", curvature)
    if n > MOST_CELLS:
        raise InputError(f"n: expected at most {MOST_CELLS} cells for a cost of one's own, got {n}")
    nodes = np.linspace(0.0, np.pi, n + 1)
    table = np.asarray(cost(nodes[:, None], nodes), dtype=np.float64)
    if table.shape != (n + 1, n + 1) or np.abs(table - table.T).max() > 1e-12 * np.abs(table).max():
        raise InputError("cost: expected a symmetric, vectorised function of two angles")
    sign = 1.0 if which == "min" else -1.0

    def signed(theta: Floats, outgoing: Floats) -> Floats:
        return np.asarray(sign * cost(theta, outgoing))

    cells = Bins(nodes)
    flux, potential, upper = transport_plan(signed, cells, bound)
    lower = dual_bound(potential, signed, bound)
    bounds = (lower, upper) if which == "min" else (-upper, -lower)
    symmetric = flux * cells.normalisation[:, None] * cells.normalisation
    error = frobenius_error(ROUNDING * cells.size, "bound", "masses of intervals, to rounding")
    name = "optimal transport on the cells"
    plan = KernelMatrix(symmetric, cells, error, method="exact", law=name, reversible=True)
    return ExtremalResistance(*bounds, plan, MatrixLaw(plan))


# Gauss nodes per cell for means of an angle; on the narrow cells of a grid the error is rounding.
NODES = 8
MOST_PIVOTS = 10**9


def dual_bound(potential: Floats, cost: CostFunction, curvature: float) -> float:
    r"""A lower bound of E c(theta, theta') over all symmetric laws, from any potential on equally spaced angles.

    phi is the potential, linear between the nodes 0, h, ..., pi, and psi(y) = inf over x of c(x, y) - phi(x). Then
    E c >= E phi + E psi for every coupling of sin(theta)/2 d theta with itself. Let L bound the second derivatives of c
    in either variable. Then c(., y) - phi is at least its minimum at the nodes minus L h^2/8. Also psi, an infimum of
    functions with second derivatives at most L, is at least its chords minus L h^2/8.
    """
    count = potential.size
    nodes = np.linspace(0.0, np.pi, count)
    transform = np.full(count, np.inf)
    step = max(1, NUMBERS_AT_ONCE // count)
    for part in slices(count, step):
        table = cost(nodes[part, None], nodes) - potential[part, None]
        transform = np.minimum(transform, table.min(axis=0))
    weights = hat_masses(nodes)
    spacing = float(nodes[1])
    return float(weights @ (potential + transform)) - 0.25 * curvature * spacing**2


def hat_masses(nodes: Floats) -> Floats:
    """Integrals of the piecewise linear hat functions against sin(theta)/2 d theta."""
    angle, mass = _masses(nodes)
    fraction = (angle - nodes[:-1, None]) / np.diff(nodes)[:, None]
    hats = np.zeros(nodes.size)
    hats[:-1] += np.sum(mass * (1.0 - fraction), axis=1)
    hats[1:] += np.sum(mass * fraction, axis=1)
    return hats


def _masses(edges: Floats) -> tuple[Floats, Floats]:
    """Angles in every interval between edges and their masses under sin(theta)/2 d theta, shape (intervals, NODES)."""
    angle, weight = gauss_on_intervals(edges[:-1], edges[1:], NODES)
    return angle.reshape(-1, NODES), (weight * SINE.density(angle)).reshape(-1, NODES)


def transport_plan(cost: CostFunction, cells: Bins, curvature: float) -> tuple[Floats, Floats, float]:
    """The optimal symmetric flux between cells, its potential at the edges, and an upper bound for the continuum.

    The masses are placed at the mean angles of the cells. Spreading each mass of the plan independently within its two
    cells gives a symmetric law of the continuum and raises the cost by at most L/2 times the sum of the two variances.
    """
    import ot

    weights = cells.weights
    angle, mass = _masses(cells.edges)
    mass = mass / weights[:, None]
    mean = np.sum(mass * angle, axis=1)
    variance = np.sum(mass * (angle - mean[:, None]) ** 2, axis=1)
    table = np.ascontiguousarray(cost(mean[:, None], mean))
    plan, log = ot.emd(weights, weights, table, numItermax=MOST_PIVOTS, log=True)
    if log["warning"]:
        raise AccuracyError(f"optimal transport: {log['warning']}", float("nan"))
    flux = 0.5 * (plan + plan.T)
    upper = float(np.sum(flux * table)) + curvature * float(weights @ variance)
    # the duals of a symmetric problem may be averaged; any interpolation between the means is allowed
    return flux, np.interp(cells.edges, mean, 0.5 * (log["u"] + log["v"])), upper
