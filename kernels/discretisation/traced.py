"""Matrices of the laws of undivided walls, by the first method that is exact enough.

The costliest is quadrature that is adaptive in the entry point and the incoming angle.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, check_memory
from ...core.errors import AccuracyError
from ...core.long_runs import slices
from ...core.rounding import EPS
from ...geometry import Wall
from ..bases.assembly import is_mirror_symmetric, mirror_image
from ..bases.basis import Basis
from ..bases.partitions import Panels
from ..bases.polynomials import Legendre
from ..expectations.angle_panels import NODES, NORMAL, NULL_RULES, AnglePanels
from ..matrices.matrix import KernelMatrix
from ..sampling.sobol import SobolSampler
from ..walls.cell_masses import CellMasses
from ..walls.conditionals import WallConditionals
from ..walls.wall_law import FEW_PIECES, WallLaw
from .isometries import by_isometry_table
from .method import Budget, computed, rounding, sobol_matrix

# These rays take .02 to .1 s. Their error has hardly ever been below the second number.
FIRST_RAYS, LEAST_ERROR = 2**17, 1e-5
# Walls of more pieces, and walls that do not close, have no conditionals.
MOST_PIECES = 16
# Nor walls whose first panels are predicted to need more than this fraction of the limit on ray segments.
FRACTION_OF_PANELS = 0.5
# All rays, eight times as many as the first, have hardly ever an error below this fraction of that of the first.
RAYS_GAIN = 1.0 / 16.0


def by_rays_or_conditionals(law: WallLaw, basis: Basis, budget: Budget) -> KernelMatrix:
    """The first of these matrices of an undivided wall that meets the tolerance, or else the most exact one.

    1. Isometries of a polygonal wall, if its beams resolve. If it has many pieces, after the first rays, but not on
       panels, and not if no rays reach the tolerance.
    2. The first rays.
    3. Conditional distributions, of walls that close and have few pieces.
    4. All rays.

    The error does not grow if the tolerance falls.
    """
    # on panels, mostly between the factors of a chain, rays would have to resolve hundreds of functions
    few = len(law.wall.cell.pieces) <= FEW_PIECES
    if (few or isinstance(basis, Panels) or budget.tolerance < LEAST_ERROR) and law.isometry_table() is not None:
        return by_isometry_table(law, basis, budget)
    sampler = SobolSampler(law, basis, budget.rng)
    first = _by_rays(sampler, replace(budget, rays=min(FIRST_RAYS, budget.rays)))
    if first is not None and float(first.error) <= budget.tolerance:
        return first
    reached, first = 0.0 if first is None else float(first.error), None
    if law.isometry_table() is not None:
        return by_isometry_table(law, basis, budget)
    if not _has_conditionals(law, basis, budget):
        return sobol_matrix(sampler, budget)
    found = by_adaptive_angles(law, basis, budget)
    if float(found.error) <= max(budget.tolerance, RAYS_GAIN * reached):
        return found
    rays = _by_rays(sampler, budget)
    return found if rays is None else min(found, rays, key=lambda matrix: float(matrix.error))


def _by_rays(sampler: SobolSampler, budget: Budget) -> KernelMatrix | None:
    """The matrix by rays; None if a bin has none or too many do not escape."""
    try:
        return sobol_matrix(sampler, budget)
    except AccuracyError:
        return None


def _has_conditionals(law: WallLaw, basis: Basis, budget: Budget) -> bool:
    """Whether the conditional distributions at the first panels are affordable."""
    few = law.wall.closes and len(law.wall.cell.pieces) <= MOST_PIECES
    return few and first_segments(law.wall, basis) <= FRACTION_OF_PANELS * budget.segments


# Fraction of a matrix's limit on ray segments that one angle may use, and the least such number. In bottles with a neck
# of a hundredth of their width no number completes an angle.
ANGLE_FRACTION, LEAST_SEGMENTS = 0.02, 80_000
# The same fraction for cells, where all nodes of a panel are computed together, and patches on their pieces sampled.
CELL_FRACTION = 0.005
# The asymmetry ||S - S^T|| shows the antisymmetric part of errors that the error estimates of panels and angles miss.
# If the symmetric part has the same size, the whole error is sqrt(2)/2 times the asymmetry; the rest is a margin,
# larger for few functions, whose pairs may agree by chance.
ASYMMETRY_FACTOR, FEW_PAIRS = 1.25, 3.0
# Error of Kronrod's rule as a fraction of its difference from Gauss's rule. Its root mean square over the positions of
# a singularity is 0.38 for the square root at which a piece appears and 0.26 for a breakpoint; its mean is 0.
KRONROD_FRACTION = 0.5
# Where neighbouring nodes share less than this fraction of their itineraries, the nodes sample noise.
LEAST_SHARED = 0.8
# Incoming angles computed at a time, so that their nodes fit into memory.
ANGLES_AT_ONCE = 1500
# The errors of all conditional expectations together may be this fraction of the tolerance.
MEAN_FRACTION = 0.3
SMALLEST_MEAN_TOLERANCE = 1e-14
# The tolerances of the stages: the first, and the ratio of each to the one before. They do not depend on the wanted
# tolerance, so a computation to a smaller one continues that to a larger one.
FIRST_STAGE, STAGE_RATIO = 1e-2, 0.1
# The cost of the cells of a panel as a multiple of that of its conditional expectations.
PATCH_COST = 3.0
# Factor of the tolerance of expectations, if their errors have more than this fraction of the tolerance together.
TIGHTENING, MOST_MEANS = 0.2, 0.4
# Fraction of the remaining segments that is spent on better expectations before the limit is looked at again.
CHUNK_FRACTION = 0.1
SAMPLED_ANGLES = np.array([0.1, 0.5, 1.0, 1.5])
# Conditional expectations on a panel of smaller measure may be coarser, up to the error of a panel of this measure.
FAIR_FRACTION = 0.02
COARSEST_MEAN = 1e-3
# The integrand is not smooth if a part of a divided panel has at least this fraction of the panel's difference of the
# rules. With halves, a kink leaves 1/8 or more, a smooth integrand 2^-14.
SMOOTH_SHRINKING = 1e-3
# On a smooth part the difference of the rules is the error of Gauss's rule, not of Kronrod's. It is scaled by the ratio
# measured on the divided panel times RATIO_MARGIN, but at least by LEAST_RATIO.
LEAST_RATIO = 1e-3
RATIO_MARGIN = 4.0
NARROWEST = 1e-13
# Least distance of cuts from each other and from the ends of a panel, as a fraction of the panel.
LEAST_CUT = 1e-7
# Smaller Legendre bases are extended to this many functions, so that no symmetry hides an error. The error then belongs
# to all products except those with the constant; the wanted ones get their fraction of it times a margin. On 37 walls,
# the root mean square of the fraction of one product was a tenth.
FEWEST_FUNCTIONS, SPREAD_MARGIN = 4, 1.5
# Limit on the rounds that recompute conditional expectations in which a piece was missed.
MOST_MENDINGS = 8


def by_adaptive_angles(law: WallLaw, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a wall's law by adaptive quadrature in the entry point and in the incoming angle."""
    symmetric, error, rays = traced_matrix(law.wall, basis, budget)
    how = f"adaptive angles and panels, {rays} rays: null rules and asymmetry, plus undecided entry points"
    return computed(symmetric, basis, "quadrature", error + rounding(basis), how)


def first_segments(wall: Wall, basis: Basis) -> float:
    """The predicted ray segments of the first panels, from conditional distributions at a few angles."""
    return _Integrator(wall, basis, Budget(FIRST_STAGE, segments=1)).first_segments()


def traced_matrix(wall: Wall, basis: Basis, budget: Budget) -> tuple[Floats, float, int]:
    """<e_i, P e_j> of a wall's law, an estimate of its Frobenius error, and the number of rays used.

    The error does not grow if the tolerance falls or the number of segments rises.

    The error of a panel is half the size of the null rules, of which the difference of Kronrod's and Gauss's rule is
    one, if the expectations have a kink there. If they are smooth, it is scaled by a ratio measured when the panel was
    divided. If neighbouring nodes share few itineraries, the expectations are a sample, which tells its standard error.
    `AnglePanels.total_error` adds the errors of panels; a multiple of the asymmetry of the result, which shows other
    errors, is added in quadrature. The errors of the expectations are bounded whatever their signs.
    """
    inner, fraction = basis, 1.0
    if basis.is_polynomial and basis.size < FEWEST_FUNCTIONS:
        inner = Legendre(FEWEST_FUNCTIONS)
        fraction = min(SPREAD_MARGIN * max(basis.size - 1, 1) / (FEWEST_FUNCTIONS - 1), 1.0)
    scaled = replace(budget, tolerance=budget.tolerance / fraction)
    matrix, error, rays = _Integrator(wall, inner, scaled).run()
    return np.ascontiguousarray(matrix[: basis.size, : basis.size]), fraction * error, rays


def panel_edges(wall: Wall, basis: Basis, budget: Budget) -> tuple[Floats, float]:
    """The cuts in theta that `traced_matrix` makes, from 0 to pi, and its error, for other quadratures in theta."""
    integrator = _Integrator(wall, basis, budget)
    _, error, _ = integrator.run()
    edges = np.union1d(integrator.panels.low, integrator.panels.high)
    return np.union1d(edges, np.pi - edges) if integrator.halved else edges, error


class _Integrator:
    """The computation of one matrix: its panels, conditional distributions and error estimates."""

    def __init__(self, wall: Wall, basis: Basis, budget: Budget) -> None:
        self.basis, self.budget = basis, budget
        self.tolerance = max(budget.tolerance, 8.0 * EPS * basis.size)
        self.angle_count = 0
        self.best: tuple[Floats, float] = np.zeros((basis.size, basis.size)), float("inf")
        self.halved = bool(wall.is_mirror_symmetric) and is_mirror_symmetric(basis)
        inside, degree, least = np.empty(0), 1, 0
        if basis.is_polynomial:
            degree = max(1, basis.size - 1)
        else:
            inside = basis.edges[1:-1]
            # Piecewise polynomials of this degree are integrated after a substitution of degree 3.
            local = basis.nodes_per_interval
            degree, least = 1, 1 if local < 8 else 2
        fraction = CELL_FRACTION if basis.is_partition else ANGLE_FRACTION
        longest = max(int(fraction * budget.segments), LEAST_SEGMENTS)
        self.sizes, _ = basis.magnitudes()
        self.cells: CellMasses | None = None
        if basis.is_partition:
            self.conditionals = WallConditionals(wall, 0, np.empty(0), 0, longest, np.array([np.median(self.sizes)]))
            self.cells = CellMasses(self.conditionals, basis)
        else:
            self.conditionals = WallConditionals(wall, degree, inside, least, longest, self.sizes)
        edges = basis.edges
        self.sided = bool(np.any(np.abs(edges - 0.5 * np.pi) < 1e-12))
        if self.halved:
            edges = np.append(edges[edges < 0.5 * np.pi - 1e-12], 0.5 * np.pi)
        self.edges, self.mean_tolerance = edges, MEAN_FRACTION * FIRST_STAGE
        self.panels = AnglePanels.between(np.empty(0), np.empty(0), basis.size)

    def run(self) -> tuple[Floats, float, int]:
        """Divide panels, in stages of decreasing tolerance, until the error is small enough or no segments are left.

        The matrix with the least error is returned, because an interrupted stage may increase the error.
        """
        # expectations at the nodes of the first panels, and a copy when panels are added
        values = 2 * (len(self.edges) - 1) * (len(NODES) + 1) * self.basis.size
        check_memory("basis", f"quadrature of rays in {self.basis!r}", values)
        self._add_panels(self.edges[:-1], self.edges[1:])
        stage = FIRST_STAGE
        while True:
            self._renew(stage)
            self._meet(stage)
            if self._is_done() or stage <= self.tolerance:
                return *self.best, self.conditionals.spent()[0]
            stage *= STAGE_RATIO

    def first_segments(self) -> float:
        """The predicted ray segments of the first panels, from some angles."""
        of_means = min(self.mean_tolerance / math.sqrt(FAIR_FRACTION), self._coarsest_mean)
        self.conditionals(SAMPLED_ANGLES, of_means)
        patches = PATCH_COST if self.cells is not None else 1.0
        return patches * len(NODES) * (len(self.edges) - 1) * self.segments / len(SAMPLED_ANGLES)

    @property
    def segments(self) -> int:
        """The ray segments so far."""
        return self.conditionals.spent()[1]

    def _is_done(self) -> bool:
        """Whether the error is small enough or no segments are left."""
        return self.best[1] <= self.tolerance or self.segments >= self.budget.segments

    @property
    def _coarsest_mean(self) -> float:
        """The largest tolerance of an expectation."""
        return COARSEST_MEAN * float(np.median(self.sizes))

    def _renew(self, tolerance: float, among: NDArray[np.bool_] | bool = True) -> None:
        """Recompute the expectations on some or all panels, where their error is too large for this tolerance."""
        self.mean_tolerance = max(MEAN_FRACTION * tolerance, SMALLEST_MEAN_TOLERANCE)
        mass = np.maximum(self.panels.mass, FAIR_FRACTION)
        coarse = self.panels.mean_errors(self.basis) > 2.0 * self.mean_tolerance * mass
        coarse &= among & (self.panels.mean_squares() > (2.0 * self.mean_tolerance) ** 2 * mass)
        step = len(coarse)
        if self.cells is not None:
            # a part of the remaining segments at a time
            left = self.budget.segments - self.segments
            step = max(1, int(CHUNK_FRACTION * left * self.angle_count / (len(NODES) * max(1, self.segments))))
        chosen = np.flatnonzero(coarse)
        for first in range(0, len(chosen), step):
            if first > 0 and self.segments >= self.budget.segments:
                break
            mask = np.zeros(self.panels.angle.shape, dtype=np.bool_)
            mask[chosen[first : first + step]] = True
            self._fill(self.panels, mask)
        self._recompute()

    def _meet(self, tolerance: float) -> None:
        """Divide panels until the error is below the tolerance, or no segments are left."""
        goal = means = pieces = tolerance
        while True:
            error, panels, conditionals, hidden = self._measure()
            if error <= tolerance or self._is_done():
                return
            if self.cells is not None and conditionals > MOST_MEANS * tolerance and means > 0.01 * tolerance:
                # gaps where a change hardly changes the angle may count more in cells
                means *= TIGHTENING
                self._renew(means)
                continue
            if self.cells is not None and panels + conditionals <= tolerance and pieces > 0.01 * tolerance:
                pieces *= TIGHTENING
                self._find_pieces(pieces, tolerance)
                continue
            # Errors that only the asymmetry shows lie in panels whose rules agree by chance.
            goal = min(goal, max(tolerance - hidden, 0.25 * (panels + conditionals)))
            chosen = self._worth_dividing(0.5 * goal if self.halved else goal)
            if not chosen.any():
                return
            self._divide(chosen)

    def _find_pieces(self, pieces: float, tolerance: float) -> None:
        """Find missed pieces, which only the asymmetry shows: recompute the cells that have most of it."""
        matrix, *_ = self._state()
        asymmetry = np.sum((matrix - matrix.T) ** 2, axis=1)
        order = np.argsort(asymmetry)
        most = (0.5 * tolerance / self._asymmetry_factor) ** 2
        cells = np.zeros(len(order), dtype=np.bool_)
        cells[order[np.cumsum(asymmetry[order]) > most]] = True
        before = self.mean_tolerance
        self._renew(pieces, cells[self.basis.index(0.5 * (self.panels.low + self.panels.high))])
        self.mean_tolerance = before

    @property
    def _asymmetry_factor(self) -> float:
        return ASYMMETRY_FACTOR + FEW_PAIRS / self.basis.size

    def _measure(self) -> tuple[float, float, float, float]:
        """The present error and its parts: from the panels, from the expectations, and from the asymmetry."""
        matrix, panels, conditionals, hidden = self._state()
        error = conditionals + math.hypot(panels, hidden)
        if error < self.best[1]:
            self.best = matrix, error
        return error, panels, conditionals, hidden

    def _state(self) -> tuple[Floats, float, float, float]:
        """The matrix and its errors from the panels, from the expectations, and from the asymmetry."""
        matrix = self.panels.total(self.basis)
        panels = self.panels.total_error(self.basis)
        conditionals = self.panels.total_mean_error(self.basis)
        if self.halved:
            # the halves share no row of the matrix if each basis function lives on one side
            both = math.sqrt(2.0) if self.sided else 2.0
            matrix, panels, conditionals = matrix + mirror_image(matrix, self.basis), both * panels, both * conditionals
        return matrix, panels, conditionals, self._asymmetry_factor * float(np.linalg.norm(matrix - matrix.T))

    def _worth_dividing(self, goal: float) -> NDArray[np.bool_]:
        """The panels to divide: the worst ones, so many that the others have an error below goal / 2 together."""
        panels = self.panels
        able = (panels.high - panels.low > NARROWEST) & (panels.error > 0.5 * panels.mean_errors(self.basis))
        order = np.argsort(panels.error)
        together = np.sqrt(np.cumsum(panels.error[order] ** 2))
        together *= panels.total_error(self.basis) / max(together[-1], np.finfo(np.float64).tiny)
        chosen = np.zeros(len(order), dtype=np.bool_)
        chosen[order[together > 0.5 * goal]] = True
        # A panel with a much smaller error than the worst waits for a later round.
        chosen &= able & (panels.error > 0.02 * np.max(panels.error, where=able, initial=0.0))
        # At most the number of panels that the remaining segments allow, at the mean cost of an angle so far.
        left = (self.budget.segments - self.segments) * self.angle_count / max(1, self.segments)
        most = int(left) // (2 * len(NODES))
        worst = np.zeros(len(order), dtype=np.bool_)
        worst[order[max(0, len(order) - most) :]] = True
        return np.asarray(chosen & worst)

    def _divide(self, chosen: NDArray[np.bool_]) -> None:
        parents = self.panels.selected(chosen)
        before, whole = parents.differences(self.basis, NULL_RULES), parents.values(self.basis)
        cuts = [self._cuts(low, high) for low, high in zip(parents.low.tolist(), parents.high.tolist(), strict=True)]
        parts = [
            np.concatenate(([low], cut, [high])) for low, cut, high in zip(parents.low, cuts, parents.high, strict=True)
        ]
        owner = np.repeat(np.arange(len(parts)), [len(part) - 1 for part in parts])
        self.panels = self.panels.selected(~chosen)
        self._add_panels(np.concatenate([p[:-1] for p in parts]), np.concatenate([p[1:] for p in parts]))
        children = self.panels.selected(np.arange(-len(owner), 0))
        after, value = children.differences(self.basis, NULL_RULES), children.values(self.basis)
        total = np.zeros_like(whole)
        np.add.at(total, owner, value)
        actual = np.linalg.norm(total - whole, axis=(1, 2))
        before = np.maximum(before, np.finfo(np.float64).tiny)
        ratio = np.clip(RATIO_MARGIN * actual / before, LEAST_RATIO, 1.0)[owner]
        smooth = after < SMOOTH_SHRINKING * before[owner]
        # not where the nodes sample noise, and not for the errors of patches
        smooth &= (self.cells is None) & (children.factor > 0.0)
        self.panels.error[-len(owner) :] = np.where(smooth, ratio * after, children.error)
        self.panels.factor[-len(owner) :] = np.where(smooth, ratio, children.factor)

    def _cuts(self, low: float, high: float) -> Floats:
        """The angles at which a panel is divided: the critical angles inside it, or its middle if none is known."""
        margin = LEAST_CUT * (high - low)
        cuts = self.conditionals.critical_angles(low + margin, high - margin)
        cuts = cuts[np.concatenate(([True], np.diff(cuts) > margin))[: len(cuts)]]
        return cuts if len(cuts) else np.array([0.5 * (low + high)])

    def _add_panels(self, low: Floats, high: Floats) -> None:
        """Append panels and compute their expectations."""
        fresh = AnglePanels.between(low, high, self.basis.size)
        self._fill(fresh, np.ones(fresh.angle.shape, dtype=np.bool_))
        self.panels = self.panels.joined(fresh)
        self._recompute()

    def _recompute(self) -> None:
        """Recompute the expectations at angles where a piece was missed."""
        for _ in range(MOST_MENDINGS):
            outdated = np.isin(self.panels.angle, list(self.conditionals.outdated))
            self.conditionals.outdated.clear()
            if not outdated.any():
                break
            self._fill(self.panels, outdated)

    def _fill(self, panels: AnglePanels, mask: NDArray[np.bool_]) -> None:
        """Compute the expectations at the nodes of the mask, and the errors of their panels."""
        fraction = FAIR_FRACTION / np.maximum(panels.mass, np.finfo(np.float64).tiny)
        tolerance = np.minimum(self.mean_tolerance * np.sqrt(np.maximum(1.0, fraction)), self._coarsest_mean)
        if self.cells is not None:
            self._fill_cells(self.cells, panels, np.flatnonzero(mask.any(axis=1)), tolerance)
            return
        panel, node = np.nonzero(mask)
        for few in slices(len(panel), ANGLES_AT_ONCE):
            conditionals, _ = self.conditionals(panels.angle[panel[few], node[few]], tolerance[panel[few]])
            self.angle_count += conditionals.error.size
            panels.image[panel[few], node[few]] = conditionals.in_basis(self.basis)
            panels.mean_error[panel[few], node[few]] = conditionals.error
        self._estimate(panels, np.unique(panel))

    def _fill_cells(self, cells: CellMasses, panels: AnglePanels, chosen: NDArray[np.int64], tolerance: Floats) -> None:
        """Compute the integrals and expectations of indicators of cells on chosen panels."""
        step = max(1, ANGLES_AT_ONCE // len(NODES))
        for few in (chosen[part] for part in slices(len(chosen), step)):
            found = cells(panels.low[few], panels.high[few], panels.angle[few], tolerance[few])
            self.angle_count += len(few) * len(NODES)
            panels.image[few], panels.integral[few] = found.rest, found.integrals
            panels.mean_error[few] = found.mean_error
            self._estimate(panels, few)
            here = np.linalg.norm(self.basis.evaluate(panels.angle[few, 0]), axis=1)
            panels.error[few] = np.hypot(panels.error[few], here * found.error)

    def _estimate(self, panels: AnglePanels, touched: NDArray[np.int64]) -> None:
        """Estimate the errors of the quadrature over panels whose expectations were computed."""
        shared = np.array([self.conditionals.shared(panels.angle[k]) for k in touched.tolist()])
        least = shared.min(axis=1, initial=1.0)
        if self.cells is not None:
            # of the entry points outside patches, which share all their itineraries
            outside = np.sum(panels.image[touched] @ self.basis.constant, axis=1)
            least = np.minimum(least, 1.0 - np.sum(1.0 - shared, axis=1) / np.maximum(outside, EPS))
        found, of_rules = panels.selected(touched), least >= LEAST_SHARED
        panels.factor[touched] = np.where(of_rules, KRONROD_FRACTION, 0.0)
        panels.error[touched] = np.where(
            of_rules,
            KRONROD_FRACTION * found.differences(self.basis, NULL_RULES),
            NORMAL * found.standard_errors(self.basis),
        )
