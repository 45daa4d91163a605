"""Distances between flux measures on the square of incoming and outgoing angles, by optimal transport."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from typing import NamedTuple

import numpy as np

from ...core.checks import Floats
from ...core.estimates import ErrorKind, Estimate
from ...core.long_runs import progress_bar, slices
from ...core.rounding import EPS
from ..bases.angles import cell_among
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..bases.partitions import Bins, Panels
from ..discretisation.discretisation import discretise
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix, frobenius_error, joint_kind
from ..sampling.streams import estimate
from .cell_transport import DIAGONAL, Cells, flow_cost, potential_value, transport_bounds
from .conditional import CellsAndAtoms, Term, Terms, cells_and_atoms, terms_of
from .transport import cell_middles, matrices_error, stochastic_rows

# Limits on the pairs of occupied cells, at 100 bytes and some microseconds per pair, and on the cells along a side.
MOST_PAIRS, MOST_CELLS = 2**21, 768
# The same limit for matrices, whose cells are points.
MOST_POINT_PAIRS = 2**22
# Cells along a side for a first result, and by how much more than expected there are then.
FIRST_CELLS, MORE = 32, 1.1
# If the limits allow less than this growth, the bounds gain little. Of mirror-symmetric laws a multiple of 4 has fewer
# cells in which curves cross.
LEAST_GROWTH, MULTIPLE = 1.5, 4
# More occupied cells than this multiple of those along a side lie on areas, else on curves.
AREA = 6
# If the error is larger than this fraction of the distance, these cells along a side serve a potential and a flow.
POOR, POTENTIAL_CELLS, FLOW_CELLS = 0.1, 128, 1024
# The tolerance of the matrices of laws, as a fraction of the wanted error and between these limits, and that of
# conditional distributions for the mass that both laws have in common.
LAW_PART, LAW_TOLERANCES, COMMON_TOLERANCE = 0.01, (1e-10, 1e-5), 1e-6
# Bins on which the error of a sampled law is that of the distance of resamples, and its rays.
SAMPLED_BINS, RAYS = 32, 2**20
# Incoming angles for each cell at which mass in common is found, and angles times cells in memory at a time.
NODES, MASSES_AT_ONCE = 8, 2**22
# Smaller differences of weights are rounding.
SAME_WEIGHT = 1e-14


class _Side(NamedTuple):
    """Terms of a law with their weights, and of those that only rays know the drawn angles."""

    terms: Terms
    drawn: list[tuple[Floats, Floats] | None]

    @staticmethod
    def of(terms: Terms, order: float) -> tuple[_Side, float]:
        """The terms, and the error of W_p from the rays."""
        drawn, error = [], 0.0
        for weight, term in terms:
            rays = None
            if discretise(term.law, Bins(SAMPLED_BINS), tolerance=LAW_TOLERANCES[1]).samples:
                rng = np.random.default_rng(0)
                theta = SINE.quantile((np.arange(RAYS) + rng.random(RAYS)) / RAYS)
                rays = theta, term.law.sample(theta, rng)
                counted = estimate(*rays, Bins(SAMPLED_BINS))
                exact = replace(counted, counts=None, error=frobenius_error(0.0, "bound", ""))
                error += weight ** (1.0 / order) * matrices_error(counted, exact, order, False)
            drawn.append(rays)
        return _Side(terms, drawn), error

    def known(self) -> Terms:
        """The terms whose conditional distributions are known."""
        return [term for term, rays in zip(self.terms, self.drawn, strict=True) if rays is None]

    def moments(self, edges: Floats, tolerance: float) -> tuple[Floats, float, bool]:
        """The moments of `Cells`, a bound of the mass that is wrong in them, and whether it is one for certain."""
        basis, size = Panels(edges, 2), edges.size - 1
        angle, weight = basis.measure.quadrature(edges, basis.nodes_per_interval)
        panel, values = basis.local(angle)
        power = ((angle - cell_middles(edges)[panel]) / DIAGONAL)[:, None] ** np.arange(3)
        table = (weight[:, None, None] * power[:, :, None] * values[:, None, :]).reshape(size, -1, 3, 3).sum(axis=1)

        def of_matrix(found: KernelMatrix) -> Floats:
            symmetric = found.symmetric.reshape(size, 3, size, 3)
            return np.asarray(np.einsum("ika,iajb,jlb->ikjl", table, symmetric, table, optimize=True))

        return self._summed(basis, of_matrix, lambda rays: _counted(rays, edges), tolerance)

    def masses(self, edges: Floats, tolerance: float) -> tuple[Floats, float, bool]:
        """The masses of cells, a bound of the mass that is wrong in them, and whether it is one for certain."""
        return self._summed(
            Bins(edges), lambda found: found.flux, lambda rays: _counted(rays, edges)[:, 0, :, 0], tolerance
        )

    def _summed(
        self, basis: Basis, of_matrix: Callable[[KernelMatrix], Floats],
        of_rays: Callable[[tuple[Floats, Floats]], Floats], tolerance: float,
    ) -> tuple[Floats, float, bool]:  # fmt: skip
        """The sum over the terms of tables of their matrices or rays, the error, and whether it is a bound."""
        total, error, certain = np.zeros(()), 0.0, True
        for (share, term), rays in zip(self.terms, self.drawn, strict=True):
            if rays is not None:
                total, certain = total + share * of_rays(rays), False
                continue
            found = discretise(term.law, basis, tolerance=tolerance)
            total, error = total + share * of_matrix(found), error + share * float(found.error)
            certain &= found.error.kind == "bound"
        return np.asarray(total), error, certain


def joint_law_distance(first: Law, second: Law, order: float, tolerance: float) -> Estimate:
    """W_p between the flux measures of two laws: the middle of two bounds, from ever more cells.

    For p = 1 a potential and a flow replace the plan if it has too few cells, as of curves near an area.

    For p = 1 only the difference of the laws matters, so that equal terms cancel. Mass that both laws send from one
    angle to the same cell stays within the cell, at the cost of moving it there.
    """
    parts = _differing(terms_of(first), terms_of(second)) if order == 1.0 else (terms_of(first), terms_of(second))
    if not (parts[0] and parts[1]):
        return Estimate(0.0, 0.0, "bound", "equal laws")
    sides, own = zip(*(_Side.of(part, order) for part in parts), strict=True)
    low, high, size = 0.0, np.inf, FIRST_CELLS
    with progress_bar(None, "transport", "distance") as bar:
        while True:
            edges = np.linspace(0.0, np.pi, size + 1)
            wanted = float(np.clip(LAW_PART * tolerance, *LAW_TOLERANCES))
            (one, wrong, certain), (other, more, also) = (side.moments(edges, wanted) for side in sides)
            staying, matched = 0.0, False
            if order == 1.0:
                one, other, staying, matched = _matched([side.known() for side in sides], edges, one, other)
            cells = Cells.of(edges, one), Cells.of(edges, other)
            bounds = transport_bounds(*cells, order)
            found = _roots(bounds[0] - wrong - more, bounds[1] + staying + wrong + more, order)
            bar.update()
            low, high = max(low, found[0]), min(high, found[1])
            error = 0.5 * abs(high - low) + sum(own)
            following = _next_size(size, cells, (high - low) / max(2.0 * (tolerance - sum(own)), sum(own), EPS))
            if error <= tolerance or following <= size:
                break
            size = following
    kind: ErrorKind = "bound" if certain and also and not matched else "estimate"
    how = f"a potential and a plan on {size} x {size} cells"
    if order == 1.0 and error > max(tolerance, POOR * high):
        below, above, known = _by_flows(sides, wanted)
        low, high, kind = max(low, below), min(high, above), kind if known else "estimate"
        error, how = 0.5 * abs(high - low) + sum(own), how + f", and a flow on {FLOW_CELLS} x {FLOW_CELLS}"
    if order > 1.0 and error > tolerance:  # distances do not fall with the order
        least = joint_law_distance(first, second, 1.0, tolerance)
        low, kind = max(low, least.value - least.error), kind if least.kind == "bound" else "estimate"
        error = 0.5 * abs(high - low) + sum(own)
    return Estimate(0.5 * (low + high), error, kind, f"{how}, between {low:.8g} and {high:.8g}")


def _by_flows(sides: Sequence[_Side], wanted: float) -> tuple[float, float, bool]:
    """Bounds of W_1 by a potential and by a flow, and whether they are bounds for certain."""
    edges, fine = (np.linspace(0.0, np.pi, size + 1) for size in (POTENTIAL_CELLS, FLOW_CELLS))
    (one, wrong, certain), (other, more, also) = (side.moments(edges, wanted) for side in sides)
    scale = (DIAGONAL / edges[1]) ** np.arange(3)
    difference = scale[:, None, None] * (one - other) * scale
    (first, less, known), (second, lost, counted) = (side.masses(fine, wanted) for side in sides)
    below = potential_value(difference, edges[1]) - DIAGONAL * (wrong + more)
    above = flow_cost(first, second, fine[1]) + DIAGONAL * (less + lost)
    return below, above, certain and also and known and counted


def _differing(first: Terms, second: Terms) -> tuple[Terms, Terms]:
    """The terms of the positive and of the negative part of a difference, without those that cancel."""
    total: dict[str, tuple[float, Term]] = {}
    for sign, terms in ((1.0, first), (-1.0, second)):
        for weight, term in terms:
            before = next((key for key, (_, known) in total.items() if known.law == term.law), str(len(total)))
            total[before] = (total[before][0] if before in total else 0.0) + sign * weight, term
    both = [[(sign * w, term) for w, term in total.values() if sign * w > SAME_WEIGHT] for sign in (1.0, -1.0)]
    return both[0], both[1]


def _counted(rays: tuple[Floats, Floats], edges: Floats) -> Floats:
    """The moments of drawn pairs of angles."""
    size, found = edges.size - 1, np.zeros((edges.size - 1, 3, edges.size - 1, 3))
    place = [cell_among(edges, side) for side in rays]
    shift = [(side - cell_middles(edges)[cell]) / DIAGONAL for side, cell in zip(rays, place, strict=True)]
    for k, m in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)):
        weight = shift[0] ** k * shift[1] ** m / shift[0].size
        found[:, k, :, m] = np.bincount(place[0] * size + place[1], weight, size**2).reshape(size, size)
    return found


def _matched(sides: list[Terms], edges: Floats, one: Floats, other: Floats) -> tuple[Floats, Floats, float, bool]:
    """Both measures without mass in common, what the rest costs in `DIAGONAL`, and whether there was any.

    Atoms of both laws in a cell are matched from the same incoming angle, densities where they agree on both halves of
    the cell.
    """
    size = edges.size - 1
    fine = np.sort(np.concatenate((edges, cell_middles(edges))))
    angle, weight = SINE.quadrature(edges, NODES)
    common, cost = np.zeros((size, size)), 0.0
    step = NODES * max(1, MASSES_AT_ONCE // (NODES * fine.size))
    for some in slices(angle.size, step):
        laws = [cells_and_atoms(terms, angle[some], fine, COMMON_TOLERANCE, False) for terms in sides if terms]
        if len(laws) < 2:
            return one, other, 0.0, False
        halves = [law.cells.reshape(-1, size, 2) for law in laws]
        (mass, mean, spread), (mass2, mean2, spread2) = (_atoms_in_cells(law, edges) for law in laws)
        uneven = np.abs(np.diff(halves[0] - halves[1], axis=2)[..., 0]) @ np.diff(edges) / 4.0
        same = np.minimum(mass, mass2)
        moved = uneven + np.sum(same * (np.abs(mean - mean2) + spread + spread2), axis=1)
        cost += float(weight[some] @ moved) / DIAGONAL
        same = weight[some, None] * (same + np.minimum(halves[0].sum(axis=2), halves[1].sum(axis=2)))
        common[some.start // NODES : some.stop // NODES] = same.reshape(-1, NODES, size).sum(axis=1)
    masses = one[:, 0, :, 0], other[:, 0, :, 0]
    common = np.clip(common, 0.0, np.minimum(*masses))
    # the smaller mass keeps its mean, the difference stays exact
    parts = [np.divide(m - common, m, out=np.zeros_like(m), where=m > 0.0)[:, None, :, None] for m in masses]
    less = (masses[0] < masses[1])[:, None, :, None]
    difference = one - other
    rest = np.where(less, parts[0] * one, difference + parts[1] * other)
    return rest, np.where(less, parts[0] * one - difference, parts[1] * other), cost, bool(common.any())


def _atoms_in_cells(law: CellsAndAtoms, edges: Floats) -> tuple[Floats, Floats, Floats]:
    """Of the atoms at each incoming angle the mass in each cell, their mean, and the mean distance from it."""
    size = edges.size - 1
    place = np.arange(len(law.mass))[:, None] * size + cell_among(edges, law.position)

    def summed(values: Floats) -> Floats:
        return np.bincount(place.ravel(), values.ravel(), len(law.mass) * size).astype(np.float64)

    mass = summed(law.mass)
    inverse = np.divide(1.0, mass, out=np.zeros_like(mass), where=mass > 0.0)
    mean = inverse * summed(law.mass * law.position)
    spread = inverse * summed(law.mass * np.abs(law.position - mean[place]))
    return mass.reshape(-1, size), mean.reshape(-1, size), spread.reshape(-1, size)


def _next_size(size: int, cells: tuple[Cells, Cells], excess: float) -> int:
    """The cells along a side that reduce the width of the bounds by the excess, with order 2; 0 beyond the limits."""
    dimensions = sum(2 if part.mass.size > AREA * size else 1 for part in cells)
    pairs = cells[0].mass.size * cells[1].mass.size
    room = min((MOST_PAIRS / max(pairs, 1)) ** (1.0 / dimensions), MOST_CELLS / size)
    growth = min(MORE * max(excess, 0.0) ** 0.5, room)
    return 0 if room < LEAST_GROWTH else MULTIPLE * math.ceil(growth * size / MULTIPLE)


def _roots(low: float, high: float, order: float) -> tuple[float, float]:
    return DIAGONAL * max(low, 0.0) ** (1.0 / order), DIAGONAL * max(high, 0.0) ** (1.0 / order)


def joint_matrix_distance(first: KernelMatrix, second: KernelMatrix, order: float) -> Estimate:
    """W_p between the flux measures of two matrices, as point masses in the middle of the cells.

    The result is exact up to ``MOST_POINT_PAIRS`` pairs of occupied cells. For more pairs neighbouring cells are
    merged, and the result is the middle of two bounds.
    """
    own = matrices_error(first, second, order, False)
    fluxes = [matrix.weights[:, None] * stochastic_rows(matrix) for matrix in (first, second)]
    if order == 1.0:  # common mass may stay
        difference = fluxes[0] - fluxes[1]
        fluxes = [np.maximum(difference, 0.0), np.maximum(-difference, 0.0)]
    edges, middles = first.basis.edges, cell_middles(first.basis.edges)
    with progress_bar(None, "transport", "distance") as bar:
        for block in count(1):
            merged = np.append(edges[:-1:block], edges[-1])
            owner = np.arange(middles.size) // block
            power = ((middles - cell_middles(merged)[owner]) / DIAGONAL)[:, None] ** np.arange(3)
            table = np.zeros((merged.size - 1, 3, middles.size))
            table[owner, :, np.arange(middles.size)] = power
            cells = [
                Cells.of(merged, np.einsum("ikx,xy,jly->ikjl", table, flux, table, optimize=True)) for flux in fluxes
            ]
            if cells[0].mass.size * cells[1].mass.size <= MOST_POINT_PAIRS:
                break
        low, high = _roots(*transport_bounds(cells[0], cells[1], order), order)
        bar.update()
    where = f"{first.basis!r}" if block == 1 else f"{merged.size - 1} x {merged.size - 1} cells of {first.basis!r}"
    how = f"optimal transport between {where}, between {low:.8g} and {high:.8g}"
    return Estimate(0.5 * (low + high), own + 0.5 * (high - low), joint_kind(first, second), how)
