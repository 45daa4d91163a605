"""W_p between the conditional distributions of two laws, as atoms and masses of cells, and its mean and supremum."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from itertools import count
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.estimates import Estimate
from ...core.long_runs import progress_bar, slices
from ..bases.angles import cell_among
from ..bases.measure import SINE, gauss_on_intervals
from ..bases.partitions import Bins
from ..discretisation.discretisation import discretise
from ..expectations.angle_panels import KRONROD, NULL_RULES, SLOPES, STRETCHED, error_of_null_rules
from ..expectations.conditionals import Distributions
from ..laws.density import split_panels
from ..laws.law import (
    Combination,
    Composition,
    Law,
    Power,
    SpecularFrame,
    has_fixed_nodes,
    is_atomic,
    is_flat_top,
    knows_errors,
)
from ..laws.structure import law_of, words_of
from ..matrices.matrix import KernelMatrix, joint_kind
from .transport import absolute_area, distance_of_rows, matrices_error, power_mean, stochastic_rows, wasserstein

# Incoming angle at which atoms are counted.
PROBE = np.array([1.0])
# Fewest cells of the outgoing angle.
CELLS = 32
# Edges and atoms in memory at a time; on each cell a conditional distribution has some nodes.
POINTS_AT_ONCE = 2**16
# The cells, and the laws by their tolerance, contribute at most this fraction of the tolerance.
CELLS_PART = 0.1
# Where a distribution is narrower than a cell, its error halves when cells are halved. The largest change is then as
# large as the error that remains; so it is at grazing, where infinitely many breakpoints accumulate.
SUPREMUM_FACTOR = 2.0
# Tolerances in total variation of conditional distributions: tighter ones cost more than they gain, and W_p for large p
# is not known better by them.
LAW_TOLERANCES = 1e-9, 1e-2


@dataclass(frozen=True)
class ConditionalDistance:
    """W_p(P(theta, .), Q(theta, .)) for two laws P and Q, as a function of the incoming angles.

    Atoms are exact. The distribution functions of the atomless parts are computed at the edges and in the middles of
    cells of the outgoing angle. Between these they count as quadratic for p = 1, else as linear.
    """

    first: Law
    second: Law
    order: float
    sup: bool
    tolerance: float

    @cached_property
    def terms(self) -> tuple[Terms, Terms]:
        """Both laws as sums."""
        return terms_of(self.first), terms_of(self.second)

    @cached_property
    def is_atomic(self) -> bool:
        """Whether all conditional distributions consist of atoms, so that no cells are needed."""
        return all(term.has_atoms for terms in self.terms for _, term in terms)

    @property
    def halves(self) -> int:
        """2 if the distances at theta and pi - theta are equal, else 1."""
        return 2 if self.first.mirror_symmetric and self.second.mirror_symmetric else 1

    @cached_property
    def atoms(self) -> int:
        """The number of atoms of both laws at an incoming angle."""
        return sum(part.mass.shape[1] for part in self._parts(PROBE, np.linspace(0.0, np.pi, 3)))

    @property
    def law_tolerance(self) -> float:
        """The error in total variation that contributes `CELLS_PART` of the tolerance to the distance."""
        return float(np.clip(2.0 * (CELLS_PART * self.tolerance / np.pi) ** self.order, *LAW_TOLERANCES))

    def cells(self, theta: Floats, wanted: float, most: int) -> tuple[int, float, float]:
        """The number of cells that a wanted error needs, the error that remains from cells, and that from both laws.

        The first error is the p-mean, or the largest, of the differences from half the number at incoming angles, which
        stand for equal parts of the measure. The number is at most ``most``.
        """
        (found, wrong), number, error = self(theta, CELLS), CELLS, np.inf
        from_laws = self._norm(wrong)
        while number < most and error > CELLS_PART * max(wanted, from_laws) and not self.is_atomic:
            number *= 2
            before, found = found, self(theta, number)[0]
            error = (SUPREMUM_FACTOR if self.sup else 1.0) * self._norm(np.abs(found - before))
        return number, 0.0 if self.is_atomic else error, from_laws

    def __call__(self, theta: Floats, cells: int) -> tuple[Floats, Floats]:
        """The distances at incoming angles with this number of cells, and their errors from those of both laws."""
        outgoing = [term.law.outgoing_breakpoints for terms in self.terms for _, term in terms]
        edges = np.unique(np.concatenate((np.linspace(0.0, np.pi, (1 if self.is_atomic else cells) + 1), *outgoing)))
        points = _with_middles(edges)
        found, error = np.empty(theta.size), np.empty(theta.size)
        step = max(1, POINTS_AT_ONCE // max(points.size, self.atoms))
        with progress_bar(theta.size, "angle", "distance") as bar:
            for part in slices(theta.size, step):
                one, other = self._parts(theta[part], points)
                if self.order == 1.0:
                    found[part] = _area_between(points, one, other)
                else:
                    found[part] = wasserstein(one.on(points), other.on(points), self.order)
                # an error E in total variation moves the mass E/2 by pi at most
                wrong = np.minimum(0.5 * np.stack((one.error, other.error)), 1.0)
                error[part] = np.pi * (wrong ** (1.0 / self.order)).sum(axis=0)
                bar.update(wrong.shape[1])
        return found, error

    def _parts(self, theta: Floats, edges: Floats) -> list[CellsAndAtoms]:
        return [cells_and_atoms(terms, theta, edges, self.law_tolerance, self.sup) for terms in self.terms]

    def _norm(self, values: Floats) -> float:
        same = np.full(values.size, 1.0 / values.size)
        return float(values.max() if self.sup else power_mean(values, same, self.order))


def _area_between(points: Floats, one: CellsAndAtoms, other: CellsAndAtoms) -> Floats:
    """The area between distribution functions, without their jumps quadratic on cells; edges and middles are given."""
    cells = one.cells - other.cells
    gap = np.concatenate((np.zeros((len(cells), 1)), np.cumsum(cells, axis=1)), axis=1)
    edges = np.broadcast_to(points[::2], (len(gap), points[::2].size))
    corner = np.concatenate((edges, one.position, other.position), axis=1)
    jumps = np.concatenate((np.zeros(edges.shape), one.mass, -other.mass), axis=1)
    order = np.argsort(corner, axis=1, kind="stable")
    corner, jumps = (np.take_along_axis(given, order, axis=1) for given in (corner, jumps))
    above = np.cumsum(jumps, axis=1)[:, :-1]
    values = _quadratic(points, gap, _with_middles(corner)) if corner.shape[1] > edges.shape[1] else gap
    return absolute_area(np.diff(corner), values[:, :-1:2] + above, values[:, 1::2] + above, values[:, 2::2] + above)


def _with_middles(edges: Floats) -> Floats:
    """Edges in the last axis and the middles between them."""
    found = np.empty((*edges.shape[:-1], 2 * edges.shape[-1] - 1))
    found[..., ::2], found[..., 1::2] = edges, 0.5 * (edges[..., 1:] + edges[..., :-1])
    return found


def _quadratic(points: Floats, values: Floats, position: Floats) -> Floats:
    """Functions that are quadratic on the cells whose edges and middles are the points, from their values there."""
    cell = cell_among(points[::2], position)
    start, middle, end = (np.take_along_axis(values, 2 * cell + k, axis=1) for k in range(3))
    t = (position - points[2 * cell]) / (points[2 * cell + 2] - points[2 * cell])
    return np.asarray(start + t * (4.0 * middle - 3.0 * start - end + 2.0 * t * (start + end - 2.0 * middle)))


# Limit on the atoms of the first factors of a product from which the last factor is followed without a matrix.
MOST_FOLLOWED = 32
# Error in total variation of conditional distributions of which no error is known.
UNKNOWN = 2.0
# Matrices of later factors in memory.
MATRICES = 4


class Term(NamedTuple):
    """A law without sums, and of a product on cells its first factor, as terms, and the law of the others.

    ``has_atoms``: the conditional distributions are finitely many atoms.
    """

    law: Law
    factors: tuple[Terms, Law] | None
    has_atoms: bool


Terms: TypeAlias = "list[tuple[float, Term]]"


class CellsAndAtoms(NamedTuple):
    """P(theta_k, .) for some theta_k: masses of cells without the atoms, atoms, and errors in total variation.

    The shapes are (angles, cells), twice (angles, atoms), and (angles,). The error of a matrix is its mean over theta,
    or the largest.
    """

    cells: Floats
    position: Floats
    mass: Floats
    error: Floats

    def on(self, edges: Floats) -> Distributions:
        """The distribution functions, linear between the edges but for the atoms."""
        below = np.concatenate((np.zeros((len(self.cells), 1)), np.cumsum(self.cells, axis=1)), axis=1)
        return Distributions.of_parts(edges, below, self.position, self.mass)

    def masses(self, edges: Floats) -> Floats:
        """The masses of cells, with those of the atoms."""
        found = self.cells.copy()
        np.add.at(found, (np.arange(len(found))[:, None], cell_among(edges, self.position)), self.mass)
        return found


def terms_of(law: Law) -> Terms:
    """The law as a weighted sum of laws of atoms, laws without atoms but flat tops, and products of these."""
    words = words_of(law)
    if words is not None:
        return [(weight, _term(law_of(word))) for word, weight in words.items()]
    if isinstance(law, Combination):
        return [(weight * part, term) for weight, one in law.parts for part, term in terms_of(one)]
    return [(1.0, _term(law))]


def _term(law: Law) -> Term:
    factors = None if _is_followed(law) else _first_and_others(law)
    if factors is not None:
        return Term(law, (terms_of(factors[0]), factors[1]), False)
    return Term(law, None, has_fixed_nodes(law))


def _is_followed(law: Law) -> bool:
    """Whether the conditional distributions of a product are known with their errors, and are not too long."""
    if not isinstance(law, Composition):
        return False
    *first, last = law.laws
    if not all(is_atomic(part) for part in first) or not knows_errors(last):
        return False
    return is_atomic(last) or Composition(tuple(first)).conditionals(PROBE).nodes.size <= MOST_FOLLOWED


def _first_and_others(law: Law) -> tuple[Law, Law] | None:
    """The first factor of a product and the law of the others; None for other laws."""
    if isinstance(law, SpecularFrame):
        factors = _first_and_others(law.law)
        return None if factors is None else (factors[0], factors[1].in_specular_frame())
    if isinstance(law, Power):
        return law.law, Power(law.law, law.exponent - 1)
    if isinstance(law, Composition):
        return law.laws[0], law.laws[1] if len(law.laws) == 2 else Composition(law.laws[1:])
    return None


def cells_and_atoms(terms: Terms, theta: Floats, edges: Floats, tolerance: float, sup: bool) -> CellsAndAtoms:
    """The conditional distributions of a sum at incoming angles, with its masses between edges from 0 to pi.

    The first factor of a product is multiplied by the matrix of the others.
    """
    total, wrong = np.zeros((theta.size, edges.size - 1)), np.zeros(theta.size)
    atoms = [np.empty((2, theta.size, 0))]
    for weight, term in terms:
        if term.factors is not None:
            first = cells_and_atoms(term.factors[0], theta, edges, tolerance, sup)
            matrix = _matrix(term.factors[1], edges.tobytes())
            total += weight * first.masses(edges) @ matrix.array
            wrong += weight * (first.error + float(matrix.error) / (np.sqrt(matrix.weights.min()) if sup else 1.0))
            continue
        incoming, back = term.law._distinct(theta)
        given = term.law.conditionals(incoming, tolerance, 0, edges[1:-1])
        error = np.where(np.isnan(given.error), UNKNOWN, given.error)[back]
        table = term.law.isometry_table() if term.has_atoms and not sup else None
        # of a mean over theta, unresolved rays change no more than their fraction
        wrong += weight * (error if table is None else 2.0 * table.unresolved)
        if term.has_atoms:
            position, mass = (part[back] for part in given.atoms())
            atoms.append(np.stack((position, weight * mass / mass.sum(axis=1, keepdims=True))))
            continue
        level = is_flat_top(term.law, incoming, given)
        total += weight * given._replace(weights=np.where(level, 0.0, given.weights)).masses(edges)[back]
        if level.any():
            flat = np.bincount(given.owner, weights=np.where(level, given.weights, 0.0), minlength=incoming.size)[back]
            position = np.pi - theta if term.law.frame == "paper" else theta
            atoms.append(np.stack((position, weight * flat))[..., None])
    position, mass = np.concatenate(atoms, axis=2)
    return CellsAndAtoms(total, position, mass, wrong)


@lru_cache(maxsize=MATRICES)
def _matrix(law: Law, edges: bytes) -> KernelMatrix:
    return discretise(law, Bins(np.frombuffer(edges)))


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
