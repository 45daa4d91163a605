"""Bounds for the least mean of a cost over all symmetric laws, valid for the continuum and not only for a grid."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ..bases.bins import Bins
from ..bases.measure import SINE, gauss_on_intervals

CostFunction = Callable[[Floats, Floats], Floats]

# Gauss nodes on a cell for means of an angle: rounding for the narrow cells of a grid.
NODES = 8
# Entries of a table held at a time.
CHUNK = 2**22
MOST_PIVOTS = 10**9


def dual_bound(potential: Floats, cost: CostFunction, curvature: float) -> float:
    r"""A lower bound of E c(theta, theta') over all symmetric laws, from any potential on equally spaced angles.

    phi is the potential, linear between the nodes 0, h, ..., pi, and psi(y) = inf over x of c(x, y) - phi(x). Then
    E c >= E phi + E psi for every coupling of sin(theta)/2 d theta with itself. For c with second derivatives at most
    L in either variable, c(., y) - phi is above its least value at the nodes less L h^2/8; and psi, an infimum
    of functions with second derivatives at most L, is above its chords less L h^2/8.
    """
    count = potential.size
    nodes = np.linspace(0.0, np.pi, count)
    transform = np.full(count, np.inf)
    step = max(1, CHUNK // count)
    for start in range(0, count, step):
        part = slice(start, start + step)
        table = cost(nodes[part, None], nodes) - potential[part, None]
        transform = np.minimum(transform, table.min(axis=0))
    weights = hat_masses(nodes)
    spacing = float(nodes[1])
    return float(weights @ (potential + transform)) - 0.25 * curvature * spacing**2


def hat_masses(nodes: Floats) -> Floats:
    """Integrals of the piecewise linear hat functions against sin(theta)/2 d theta."""
    angle, weight = gauss_on_intervals(nodes[:-1], nodes[1:], NODES)
    mass = (weight * SINE.density(angle)).reshape(-1, NODES)
    fraction = (angle.reshape(-1, NODES) - nodes[:-1, None]) / np.diff(nodes)[:, None]
    hats = np.zeros(nodes.size)
    hats[:-1] += np.sum(mass * (1.0 - fraction), axis=1)
    hats[1:] += np.sum(mass * fraction, axis=1)
    return hats


def transport_plan(cost: CostFunction, cells: Bins, curvature: float) -> tuple[Floats, Floats, float]:
    """The optimal symmetric flux between cells, its potential at the edges, and an upper bound for the continuum.

    Masses stand at the mean angles of the cells. Spread out uniformly and independently within its two cells, each
    mass of the plan costs at most L/2 times the two variances more; that is a symmetric law of the continuum.
    """
    import ot

    edges, weights = cells.edges, cells.weights
    angle, weight = gauss_on_intervals(edges[:-1], edges[1:], NODES)
    mass = (weight * SINE.density(angle)).reshape(-1, NODES) / weights[:, None]
    mean = np.sum(mass * angle.reshape(-1, NODES), axis=1)
    variance = np.sum(mass * (angle.reshape(-1, NODES) - mean[:, None]) ** 2, axis=1)
    table = np.ascontiguousarray(cost(mean[:, None], mean))
    plan, log = ot.emd(weights, weights, table, numItermax=MOST_PIVOTS, log=True)
    if log["warning"]:
        raise AccuracyError(f"optimal transport: {log['warning']}", float("nan"))
    flux = 0.5 * (plan + plan.T)
    upper = float(np.sum(flux * table)) + curvature * float(weights @ variance)
    # the duals of a symmetric problem may be averaged; between and beyond the means any continuation is allowed
    return flux, np.interp(edges, mean, 0.5 * (log["u"] + log["v"])), upper
