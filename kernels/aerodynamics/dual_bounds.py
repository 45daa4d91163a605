"""Bounds for the least mean of a cost over all symmetric laws of the continuum, not only of a grid."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ...core.long_runs import NUMBERS_AT_ONCE
from ..bases.bins import Bins
from ..bases.measure import SINE, gauss_on_intervals
from .drag import CostFunction

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
    for start in range(0, count, step):
        part = slice(start, start + step)
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
