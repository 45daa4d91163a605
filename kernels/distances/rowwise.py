"""Mean or supremum over the incoming angle of the Wasserstein distance of conditional distributions."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import count

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.estimates import Estimate
from ..bases.measure import SINE, gauss_on_intervals
from ..expectations.angle_panels import KRONROD, NULL_RULES, SLOPES, STRETCHED, error_of_null_rules
from ..laws.density import split_panels
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix, joint_kind
from .conditional import ConditionalDistance
from .transport import distance_of_rows, matrices_error, power_mean, stochastic_rows

# Panels of the incoming angle from 0 to pi on the coarsest level, breakpoints not counted, and breakpoints.
PANELS, BREAKPOINTS = 32, 24
# Incoming angles at which the number of cells is chosen.
PROBES = 128
# Limits on the angles times cells and atoms for a mean and for a level of a supremum, a few seconds of work;
# FEW_ATOMS is added to the cells.
MOST_CORNERS, MOST_OF_LEVEL, FEW_ATOMS = 2**21, 2**22, 32
# Limits on the cells of the outgoing angle; the second is tried if, with the first, the error of a mean is mostly that
# of cells. A supremum would take a minute.
MOST_CELLS = (256, 1024)
# Breakpoints at which panels are divided.
MOST_BREAKPOINTS = 1536
# If the distance jumps at unknown incoming angles, halving a panel halves its error. All null rules may be small by
# chance; a fraction of the change at the last halving guards against it.
MEMORY = 0.25
# Turning points of values on a panel that count as smooth.
MOST_TURNS = 2
# Panels are halved until those that remain have at most this fraction of the wanted error.
REMAINING = 0.3
# Gauss nodes per panel, for the supremum. Every level doubles panels and breakpoints.
NODES = 4
FEWEST_LEVELS = 3
# A supremum at grazing, where infinitely many breakpoints accumulate, converges with order 1.
SUPREMUM_FACTOR = 2.0
# At the end so many panels with the largest values are searched again with so many nodes: between the nodes of a level
# a smooth maximum hides a little, and two levels may miss it alike.
LARGEST_PANELS, FINE_NODES = 8, 32
# Distance of the outermost nodes of a panel from its ends, as a fraction of its width, for the supremum.
INSET = 1e-9
# Refinement in the incoming angle ends when its error is this fraction of the error from cells, which it does not
# change.
SMALL_PART = 0.1
# Rounding of some hundred sums of angles and probabilities.
ROUNDING = 1e-13


def law_distance(first: Law, second: Law, order: float, sup: bool, tolerance: float) -> Estimate:
    """The mean or the supremum over incoming angles of W_p; the error is estimated.

    The mean is an integral by Kronrod's rule on panels, of which those with large errors are halved.
    The supremum is that over the nodes of panels that are refined until two levels agree. Two numbers of cells of the
    outgoing angle are compared.
    """
    between = ConditionalDistance(first, second, order, sup, tolerance)
    probes = SINE.quantile((np.arange(PROBES) + 0.5) / PROBES)
    probes = np.concatenate((probes, _nodes_and_ends(_panel_edges(between, 0)))) if sup else probes
    for most in MOST_CELLS[: 1 if sup else 2]:
        cells, from_cells, from_laws = between.cells(probes, tolerance, most)
        left = max(tolerance - from_cells - from_laws, SMALL_PART * (from_cells + from_laws))
        value, error, from_laws, panels = (_supremum if sup else _mean)(between, cells, left)
        if error > left or from_cells <= max(tolerance, from_laws):
            break
    how = f"levels with up to {panels} panels" if sup else f"Kronrod's rule on {panels} panels"
    return Estimate(value, error + from_cells + from_laws + ROUNDING, "estimate", how)


def matrix_distance(first: KernelMatrix, second: KernelMatrix, order: float, sup: bool) -> Estimate:
    """The mean or the supremum of W_p between matrices on the same cells, with point masses in their middles."""
    between = distance_of_rows(first, order, sup)
    value = float(between(stochastic_rows(first), stochastic_rows(second)))
    error = matrices_error(first, second, order, sup) + ROUNDING
    how = "distribution functions on the cells, and the errors of both matrices"
    return Estimate(value, error, joint_kind(first, second), how)


@dataclass(frozen=True)
class _Panels:
    """Panels of the incoming angle, the distances at their nodes and errors from the laws, and errors from halving.

    ``rows`` and ``wrong`` have the shape (panels, 15). ``change`` is the error of the integral of the p-th power over
    the panel that was halved, for each half, divided by the p-th power of ``unit``.
    """

    low: Floats
    high: Floats
    rows: Floats
    wrong: Floats
    change: Floats
    unit: Floats

    @staticmethod
    def at(between: ConditionalDistance, cells: int, low: Floats, high: Floats) -> _Panels:
        """The panels with these ends, which no one was halved for."""
        angle = _nodes(low, high)
        rows, wrong = (found.reshape(angle.shape) for found in between(angle.ravel(), cells))
        return _Panels(low, high, rows, wrong, np.zeros(low.size), np.ones(low.size))

    def parts(self, order: float, rule: Floats, unit: float) -> Floats:
        """The integrals of (distance / unit)^p over the panels."""
        return np.asarray(np.sum((self.rows / unit) ** order * self.weights(rule), axis=1))

    def weights(self, rule: Floats) -> Floats:
        """The weights of the nodes under sin(theta)/2 d theta."""
        nodes = _nodes(self.low, self.high)
        return np.asarray((self.high - self.low)[:, None] * SLOPES * SINE.density(nodes) * rule)

    def errors(self, order: float, unit: float, cuts: Floats) -> Floats:
        """The errors of the integrals of (distance / unit)^p over the panels.

        Distances may oscillate within a panel that has cuts inside, or that reaches grazing at 0 or pi. All rules can
        then agree by chance. If such values turn more than twice, the error is at least their range times the measure.
        """
        squares = np.array([self.parts(order, rule, unit) ** 2 for rule in NULL_RULES])
        found = error_of_null_rules(squares)
        powers = (self.rows / unit) ** order
        inside = np.searchsorted(cuts, self.high, side="left") > np.searchsorted(cuts, self.low, side="right")
        rough = inside | (self.low <= 0.0) | (self.high >= np.pi)
        steps = np.diff(powers, axis=1)
        rough &= np.count_nonzero(steps[:, 1:] * steps[:, :-1] < 0.0, axis=1) > MOST_TURNS
        spread = np.where(rough, np.ptp(powers, axis=1) * SINE.mass(self.low, self.high), 0.0)
        return np.asarray(np.maximum(np.maximum(found, spread), MEMORY * self.change * (self.unit / unit) ** order))

    def selected(self, chosen: NDArray[np.intp]) -> _Panels:
        """The panels with these indices."""
        return _Panels(*(getattr(self, name.name)[chosen] for name in fields(self)))

    def halved(self, between: ConditionalDistance, cells: int, cuts: Floats, unit: float) -> _Panels:
        """The halves of all panels, divided at the cut nearest to the middle, or in the middle."""
        middle = _nearest_cut(self.low, self.high, cuts)
        halves = _Panels.at(between, cells, np.concatenate((self.low, middle)), np.concatenate((middle, self.high)))
        after = halves.parts(between.order, KRONROD, unit).reshape(2, -1).sum(axis=0)
        change = 0.5 * np.abs(after - self.parts(between.order, KRONROD, unit))
        return replace(halves, change=np.tile(change, 2), unit=np.full(halves.low.size, unit))


def _mean(between: ConditionalDistance, cells: int, wanted: float) -> tuple[float, float, float, int]:
    """The p-mean over the incoming angle, its error, the part of the laws, and the number of panels."""
    order, halves = between.order, between.halves
    edges, cuts = _panel_edges(between, 0), _breakpoints(between, MOST_BREAKPOINTS)
    panels = _Panels.at(between, cells, edges[:-1], edges[1:])
    while True:
        # divided by the largest, because powers of angles underflow or overflow at high orders
        unit = float(panels.rows.max()) or 1.0
        errors = halves * panels.errors(order, unit, cuts)
        total, doubt = halves * float(panels.parts(order, KRONROD, unit).sum()), float(errors.sum())
        value, high, low = (unit * max(power, 0.0) ** (1.0 / order) for power in (total, total + doubt, total - doubt))
        error = max(high - value, value - low)
        if error <= wanted or panels.rows.size * (cells + between.atoms + FEW_ATOMS) > MOST_CORNERS:
            from_laws = power_mean(panels.wrong.ravel(), halves * panels.weights(KRONROD).ravel(), order)
            return value, error, float(from_laws), halves * panels.low.size
        ranked = np.argsort(errors)
        many = np.cumsum(errors[ranked]) > REMAINING * doubt * wanted / error
        new = panels.selected(ranked[many]).halved(between, cells, cuts, unit)
        old = panels.selected(ranked[~many])
        panels = _Panels(
            *(np.concatenate((getattr(old, name.name), getattr(new, name.name))) for name in fields(_Panels))
        )


def _supremum(between: ConditionalDistance, cells: int, wanted: float) -> tuple[float, float, float, int]:
    """The supremum over the incoming angle, its error, the part of the laws, and the number of panels."""
    found: list[float] = []
    error, number = np.inf, 0
    for level in count():
        edges = _panel_edges(between, level)
        corners = edges.size * NODES * (cells + between.atoms + FEW_ATOMS)
        if level >= FEWEST_LEVELS and corners > MOST_OF_LEVEL:
            break
        number = between.halves * (edges.size - 1)
        angle = _nodes_and_ends(edges)
        values, wrong = between(angle, cells)
        found.append(float(values.max()))
        steps = np.abs(np.diff(found))
        if level == 0:
            continue
        error = SUPREMUM_FACTOR * float(steps[-1] if level == 1 else max(steps[-1], MEMORY * steps[-2]))
        if level >= FEWEST_LEVELS - 1 and error <= wanted:
            break
    panel = np.clip(np.searchsorted(edges, angle) - 1, 0, edges.size - 2)
    largest = np.unique(panel[np.argsort(values)[-LARGEST_PANELS * NODES :]])[:, None]
    inside = edges[largest] + np.diff(edges)[largest] * (np.arange(FINE_NODES) + 0.5) / FINE_NODES
    value = max(found[-1], float(between(inside.ravel(), cells)[0].max()))
    return value, max(error, value - found[-1]), float(wrong.max()), number


def _nodes_and_ends(edges: Floats) -> Floats:
    """Gauss nodes between the edges, and angles near both ends of each panel."""
    inset = INSET * np.diff(edges)
    angle = gauss_on_intervals(edges[:-1], edges[1:], NODES)[0]
    return np.concatenate((angle, edges[:-1] + inset, edges[1:] - inset))


def _nodes(low: Floats, high: Floats) -> Floats:
    return np.asarray(low[:, None] + (high - low)[:, None] * STRETCHED)


def _breakpoints(between: ConditionalDistance, limit: int) -> Floats:
    """Sorted breakpoints of both laws inside the range of incoming angles."""
    points = np.concatenate([law.breakpoints(limit)[0] for law in (between.first, between.second)])
    return np.unique(points[(points > 0.0) & (points < np.pi / between.halves)])


def _panel_edges(between: ConditionalDistance, level: int) -> Floats:
    end = np.pi / between.halves
    points = _breakpoints(between, BREAKPOINTS * 2**level)
    coarse = np.unique(np.concatenate((np.linspace(0.0, end, PANELS // between.halves + 1), points)))
    return split_panels(coarse, 2**level)


def _nearest_cut(low: Floats, high: Floats, cuts: Floats) -> Floats:
    """The cut nearest to the middle of each interval, if one lies inside; else the middle."""
    middle = 0.5 * (low + high)
    if not cuts.size:
        return middle
    right = np.searchsorted(cuts, middle)
    near = cuts[np.clip(np.stack((right - 1, right)), 0, cuts.size - 1)]
    best = np.where(np.abs(near[0] - middle) <= np.abs(near[1] - middle), *near)
    return np.where((best > low) & (best < high), best, middle)
