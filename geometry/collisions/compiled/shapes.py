"""The graph eta = h(xi) of a part of a Bezier piece: its values, slopes and points. Compiled, inlined."""

from __future__ import annotations

import math
from typing import NamedTuple

from ....core.rounding import EPS
from ...curves import columns as c
from ...scene.compiled.compiling import inlined
from . import graph_table as g

# Limit on Newton steps for the parameter at an abscissa; a bisection would need 53.
NEWTON_STEPS = 60


class Start(NamedTuple):
    """The start of a path in the frame of a graph.

    The abscissa, and the position from which displacements count: the start of the graph, or the point of the graph
    with the parameter sigma, if the path starts there. Then F has no rounding error but that of the displacement.
    """

    abscissa: float
    xi: float
    eta: float
    sigma: float


@inlined
def parameter_at(graph, xi):
    """-> sigma: the parameter of the graph at an abscissa, at most the ends of its formula."""
    low, high = graph[g.LEAST_SIGMA], graph[g.MOST_SIGMA]
    x1, x2, x3 = graph[g.XI1], graph[g.XI2], graph[g.XI3]
    if xi <= low * (x1 + low * (x2 + low * x3)):
        return low
    if xi >= high * (x1 + high * (x2 + high * x3)):
        return high
    sigma = min(max(xi / x1, low), high)
    for _ in range(NEWTON_STEPS):
        value = sigma * (x1 + sigma * (x2 + sigma * x3)) - xi
        if value > 0.0:
            high = sigma
        elif value < 0.0:
            low = sigma
        else:
            break
        step = sigma - value / (x1 + sigma * (2.0 * x2 + 3.0 * sigma * x3))
        if not low < step < high:
            step = 0.5 * (low + high)
        done = abs(step - sigma) <= EPS * abs(step) or step in (low, high)
        sigma = step
        if done:
            break
    return sigma


@inlined
def height_above(graph, begin, d_xi, d_eta):
    """-> (F, slope, bend): F, h' and h'' after a displacement from the start; h'' is 0 where the graph is continued."""
    sigma, first = parameter_at(graph, begin.abscissa + d_xi), begin.sigma
    xi1 = graph[g.XI1] + sigma * (2.0 * graph[g.XI2] + 3.0 * sigma * graph[g.XI3])
    eta1 = graph[g.ETA1] + sigma * (2.0 * graph[g.ETA2] + 3.0 * sigma * graph[g.ETA3])
    xi2, eta2 = 2.0 * graph[g.XI2] + 6.0 * sigma * graph[g.XI3], 2.0 * graph[g.ETA2] + 6.0 * sigma * graph[g.ETA3]
    slope = eta1 / xi1
    inside = graph[g.LEAST_SIGMA] < sigma < graph[g.MOST_SIGMA]
    bend = (eta2 - slope * xi2) / (xi1 * xi1) if inside else 0.0
    # h(xi) - h(xi0) by divided differences, which do not cancel
    both, squares = sigma + first, sigma * (sigma + first) + first * first
    run = (sigma - first) * (graph[g.XI1] + graph[g.XI2] * both + graph[g.XI3] * squares)
    rise = (sigma - first) * (graph[g.ETA1] + graph[g.ETA2] * both + graph[g.ETA3] * squares)
    return begin.eta + d_eta - rise - slope * (begin.xi + d_xi - run), slope, bend


@inlined
def in_frame(graph, x, y):
    """-> (xi, eta): the components of a vector along the chord and to its left."""
    ux, uy = graph[g.ALONG_X], graph[g.ALONG_Y]
    return ux * x + uy * y, ux * y - uy * x


@inlined
def graph_surface(graph, x, y):
    """-> (x, y, n1, n2): the point projected onto the graph, and the unit normal towards the free side."""
    xi, eta = in_frame(graph, x - graph[c.START_X], y - graph[c.START_Y])
    f, slope, _ = height_above(graph, Start(xi, xi, eta, 0.0), 0.0, 0.0)
    square = 1.0 + slope * slope
    # along the normal (-slope, 1)
    xi, eta = xi + f * slope / square, eta - f / square
    ux, uy, norm = graph[g.ALONG_X], graph[g.ALONG_Y], 1.0 / math.sqrt(square)
    nx, ny = (-slope * ux - uy) * norm, (ux - slope * uy) * norm
    return graph[c.START_X] + ux * xi - uy * eta, graph[c.START_Y] + uy * xi + ux * eta, nx, ny
