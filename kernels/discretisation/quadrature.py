"""Matrices by quadrature: of densities and deterministic laws on rules that are refined until two levels agree, of all
laws with conditional distributions by Kronrod's rule in the incoming angle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from ...core.checks import Floats, shortened
from ...core.errors import InputError
from ...core.long_runs import NUMBERS_AT_ONCE, count_time, slices
from ...core.rounding import EPS
from ..bases.angles import bisected
from ..bases.assembly import add_products, largest_square_sum
from ..bases.basis import Basis
from ..bases.measure import SINE, gauss_on_intervals, gauss_rule
from ..bases.partitions import Bins
from ..bases.polynomials import Legendre
from ..expectations.angle_panels import NODES, AnglePanels
from ..expectations.conditionals import functions_of
from ..laws.density import VALUE_TIME, DensityLaw, cut_by_edges, split_panels
from ..laws.deterministic import LeastResistanceLaw
from ..laws.law import Law, knows_errors
from ..laws.matrix_law import finite_matrix, uniform_on_bins
from ..laws.structure import lists_branches
from ..matrices.matrix import KernelMatrix
from .method import Budget, computed, rounding, until_converged

# Limits on the evaluations of a density and on the points of a map: one or two seconds of work each.
MOST_DENSITY_VALUES, MOST_MAP_POINTS = 2**25, 2**20
# Gauss nodes in theta' on an interval, by the interval's fraction r of a panel on which the law's 16 nodes reach
# rounding. Singularities are then at least 3/8 of the panel away from its ends, and the error of q nodes is rho^(-2 q)
# with rho + 1/rho = 2 + 3/(2 r): at most 1e-12 in each case.
FRACTIONS, FRACTION_NODES = np.array([1 / 32, 1 / 4]), (4, 8, 16)
# Gauss nodes in theta on each interval of the coarsest level of conditional distributions: the first affordable number.
# If two levels cost more than MOST_CONDITIONAL_VALUES, some seconds, product rules are used instead.
CONDITIONAL_NODES = (6, 4, 2)
MOST_CONDITIONAL_VALUES = 2**27
# Edges x and pi - y closer than this count as equal.
MIRROR_TOLERANCE = 4.0 * EPS * np.pi
# Evaluations of the density at a time for conditional distributions: the arrays then stay in cache.
CONDITIONAL_CHUNK = 2**17
# Grading of intervals at the jumps of a map, where it may have square-root singularities if it maps from or to grazing.
GRADING = 0.25 ** np.arange(1.0, 17.0)


def by_eigenvalues(law: Law, basis: Legendre, budget: Budget) -> KernelMatrix:
    """The matrix of a law with an ``eigenvalue_ratio`` in Legendre polynomials, in which it is diagonal."""
    assert law.eigenvalue_ratio is not None  # as the table of methods asks
    diagonal = np.diag(law.eigenvalue_ratio ** np.arange(float(basis.size)))
    how = "eigenvalues g^l of the polynomials of degree l, to rounding"
    return computed(diagonal, basis, "exact", EPS * basis.size**0.5, how, "bound")


def by_blocks(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of transitions between bins, also in chains with ideal laws, from means of functions on each bin."""
    inner = finite_matrix(law)
    assert inner is not None  # as `acts_on_bins` asks
    means = uniform_on_bins(inner.basis.edges, *functions_of(basis)).in_basis(basis)
    symmetric = means.T @ (inner.flux @ means)
    error = float(inner.error) + rounding(inner.basis) + rounding(basis)
    return computed(symmetric, basis, "exact", error, "integrals over bins, to rounding", "bound")


def by_density(law: DensityLaw, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a law with a density by Gauss rules whose order doubles."""
    return _settled(*density_matrix(law, basis, budget.tolerance), basis)


def by_map(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a deterministic law by rules on intervals between the jumps of its map, which are halved."""
    assert law.angle_map is not None  # as the table of methods asks
    return _settled(*map_matrix(law.angle_map, law.breakpoints(0)[0], basis, budget.tolerance), basis)


def by_interval_masses(law: LeastResistanceLaw, basis: Bins, budget: Budget) -> KernelMatrix:
    """The matrix of the law of least resistance in bins, from the masses of intervals and their images."""
    symmetric = basis.normalisation[:, None] * law.flux(basis) * basis.normalisation
    return computed(symmetric, basis, "quadrature", rounding(basis), "masses of intervals, to rounding")


def _settled(symmetric: Floats, error: float, basis: Basis) -> KernelMatrix:
    how = "difference of the last two levels of quadrature"
    return computed(symmetric, basis, "quadrature", error + rounding(basis), how)


def density_matrix(law: DensityLaw, basis: Basis, tolerance: float) -> tuple[Floats, float]:
    """<e_i, P e_j> by Gauss rules whose order doubles, and its error by `until_converged`.

    Product rules miss a peak narrower than the cells of a partition. Each conditional distribution is then integrated
    over theta' between the edges of the cells and of the law's panels at that incoming angle.
    """
    edges = np.unique(np.concatenate((basis.edges, law.outgoing_breakpoints)))
    # the kinks of a function of a user's are not known
    smooth = type(law) is not DensityLaw
    if basis.is_partition and law.resolution < np.diff(edges).max():
        outer = np.unique(np.concatenate((edges, law.incoming_edges(edges))))
        mirrored = law.mirror_symmetric is True and np.abs(edges + edges[::-1] - np.pi).max() <= MIRROR_TOLERANCE
        if mirrored:
            outer = np.append(outer[outer < 0.5 * np.pi - MIRROR_TOLERANCE], 0.5 * np.pi)
        # Two levels are needed, of which the second has twice the nodes; three of odd orders cost up to twice as much.
        cost = [3 * _conditional_cost(law, edges, outer, order) for order in CONDITIONAL_NODES]
        affordable = [order for order, each in zip(CONDITIONAL_NODES, cost, strict=True) if each <= MOST_DENSITY_VALUES]
        order = affordable[0] if affordable else CONDITIONAL_NODES[-1]
        if min(cost) <= MOST_CONDITIONAL_VALUES:
            # where kinks are not known, three levels of odd orders: even ones agree on a jump near the middle
            first, least = (order, 2) if smooth else (order // 2 | 1, 3)
            levels = _conditional_levels(law, basis, edges, outer, first, least)
            levels = (half + half[::-1, ::-1] for half in levels) if mirrored else levels
            found, error = until_converged(levels, tolerance, smooth)
            # the rules over theta' are of one order
            return found, error + law._row_error * float(basis.normalisation.max())
    return until_converged(_density_levels(law, basis, edges, smooth), tolerance, smooth)


def _conditional_cost(law: DensityLaw, edges: Floats, outer: Floats, order: int) -> int:
    """Approximate number of evaluations of the density; most intervals are small fractions of a panel."""
    panels: int = law.panels(outer[:1]).shape[-1]
    values: int = (outer.size - 1) * order * (FRACTION_NODES[0] * edges.size + FRACTION_NODES[-1] * panels)
    return values


def _conditional_levels(
    law: DensityLaw, basis: Basis, edges: Floats, outer: Floats, order: int, least: int
) -> Iterator[Floats]:
    level, spent = 0, 0
    while level < least or spent + _conditional_cost(law, edges, outer, order) <= MOST_DENSITY_VALUES:
        spent += _conditional_cost(law, edges, outer, order)
        count_time(VALUE_TIME * _conditional_cost(law, edges, outer, order))
        yield _conditional_rule(law, basis, edges, outer, order)
        order, level = 2 * order + order % 2, level + 1


def _conditional_rule(law: DensityLaw, basis: Basis, edges: Floats, outer: Floats, order: int) -> Floats:
    angle, mass = SINE.quadrature(outer, order)
    source = basis.index(angle)
    flux = np.zeros(basis.size**2)
    step = max(1, CONDITIONAL_CHUNK // (FRACTION_NODES[0] * edges.size))
    for part in slices(angle.size, step):
        row, low, high, fraction = cut_by_edges(law.panels(angle[part]), edges)
        nodes = np.asarray(FRACTION_NODES)[np.searchsorted(FRACTIONS, fraction)]
        target = basis.index(0.5 * (low + high))
        for count in FRACTION_NODES:
            chosen = nodes == count
            outgoing, inner = gauss_on_intervals(low[chosen], high[chosen], count)
            shape = (-1, count)
            value = law.density(angle[part][row[chosen], None], outgoing.reshape(shape)) * inner.reshape(shape)
            cell = source[part][row[chosen]] * basis.size + target[chosen]
            flux += np.bincount(cell, weights=mass[part][row[chosen]] * value.sum(axis=1), minlength=flux.size)
    return basis.normalisation[:, None] * flux.reshape(basis.size, basis.size) * basis.normalisation


def _density_levels(law: DensityLaw, basis: Basis, edges: Floats, smooth: bool) -> Iterator[Floats]:
    intervals = edges.size - 1
    order = basis.nodes_per_interval
    if basis.is_partition:
        order = 4 if intervals <= 512 else 2 if intervals <= 1024 else 1
    order, level = order if smooth else order | 1, 0
    while level < 2 or (intervals * order) ** 2 <= MOST_DENSITY_VALUES:
        count_time(VALUE_TIME * (intervals * order) ** 2)
        yield _density_rule(law, basis, edges, order)
        order, level = 2 * order + order % 2, level + 1


def _density_rule(law: DensityLaw, basis: Basis, edges: Floats, order: int) -> Floats:
    angle, weight = gauss_rule(edges, order)
    mass = weight * SINE.density(angle)
    total = np.zeros((basis.size, basis.size))
    step = max(NUMBERS_AT_ONCE // angle.size // order, 1) * order
    owner = basis.index(0.5 * (edges[1:] + edges[:-1])) if basis.is_partition else None
    values = basis.evaluate(angle) if owner is None else None
    for rows in slices(angle.size, step):
        block = mass[rows, None] * law.density(angle[rows, None], angle) * weight
        if values is not None:
            total += values[rows].T @ (block @ values)
            continue
        assert owner is not None  # a basis is a partition or has values
        block = block.reshape(-1, order, owner.size, order).sum(axis=(1, 3))
        np.add.at(total, (owner[rows.start // order :][: block.shape[0], None], owner), block)
    return total if values is not None else basis.normalisation[:, None] * total * basis.normalisation


def map_matrix(
    map_angle: Callable[[Floats], Floats], jumps: Floats, basis: Basis, tolerance: float
) -> tuple[Floats, float]:
    """<e_i, e_j o T> for a measure-preserving map T, and the difference of the last two levels as error estimate."""
    ends = np.concatenate(([0.0], jumps, [np.pi]))
    width = np.diff(ends)[:, None] * GRADING
    graded = (ends[:-1, None] + width).ravel(), (ends[1:, None] - width).ravel()
    edges = np.unique(np.concatenate((basis.edges, ends, *graded)))
    return until_converged(_map_levels(map_angle, basis, edges), tolerance)


def _map_levels(map_angle: Callable[[Floats], Floats], basis: Basis, edges: Floats) -> Iterator[Floats]:
    pieces = 4
    while pieces == 4 or pieces * edges.size * basis.nodes_per_interval <= MOST_MAP_POINTS:
        fine = split_panels(edges, pieces)
        if not basis.is_polynomial:
            fine = np.unique(np.concatenate((fine, _crossings(map_angle, basis, fine))))
        if basis.is_partition:
            angle, _ = gauss_rule(fine, 1)
            mass = SINE.mass(fine[:-1], fine[1:])
        else:
            angle, mass = SINE.quadrature(fine, basis.nodes_per_interval)
        total = np.zeros((basis.size, basis.size))
        add_products(total, basis, angle, np.asarray(map_angle(angle), dtype=np.float64), mass)
        yield total
        pieces *= 2


def _crossings(map_angle: Callable[[Floats], Floats], basis: Basis, fine: Floats) -> Floats:
    """Angles at which the image passes from one cell to another, at most one in each of the given intervals."""
    inset = 1e-6 * np.diff(fine)
    low, high = fine[:-1] + inset, fine[1:] - inset
    first = basis.index(np.asarray(map_angle(low), dtype=np.float64))
    last = basis.index(np.asarray(map_angle(high), dtype=np.float64))
    changing = first != last
    low, high, first = low[changing], high[changing], first[changing]
    return bisected(low, high, lambda middle: basis.index(np.asarray(map_angle(middle))) == first)


# Limit on the values of basis functions: one or two seconds of work.
MOST_VALUES = 2**26
# Number of breakpoints among the first panel edges; the fraction of the tolerance that the error of one panel may have;
# and the error that rounding leaves.
FIRST_BREAKPOINTS, PANEL_FRACTION, CONVERGED = 32, 0.02, 1e-15
# Tolerance of the conditional distributions as a fraction of that of the matrix.
MEAN_FRACTION = 0.1
# Asymmetry of the matrix of a law that is said to be reversible that refutes this, if it is there at a finer tolerance
# too: so many errors beyond a least one.
UNRESOLVED, LEAST_ASYMMETRY, FINER = 100.0, 1e-3, 1e-3
# First panel edges near grazing, where angles of reflection vary on the scale of the angle itself.
GRAZING_EDGES = np.pi * 0.25 ** np.arange(2.0, 9.0)


def has_conditionals(law: Law, basis: Basis) -> bool:
    """Whether a law is not compound, and knows the errors of its conditional distributions and its breakpoints."""
    if law.is_compound or _has_too_many_breakpoints(law):
        return False
    driven = law.is_driven and law.isometry_table() is None
    return law.traced_wall is None and (isinstance(basis, Legendre) or not driven) and knows_errors(law)


def by_conditionals(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a law whose conditional distributions have errors, by Kronrod's rule in the incoming angle."""
    symmetric, error = action_matrix(law, basis, budget.tolerance)
    if law.reversible and _asymmetry(symmetric) > UNRESOLVED * error + LEAST_ASYMMETRY:
        symmetric, error = action_matrix(law, basis, FINER * budget.tolerance)
        if _asymmetry(symmetric) > UNRESOLVED * error + LEAST_ASYMMETRY:
            raise InputError(
                f"reversible: {shortened(law)} says that it is, but <e_i, P e_j> differs from <e_j, P e_i> by "
                f"{_asymmetry(symmetric):.2g}, with an error of {error:.2g}: say reversible = False, or where the law "
                "has narrow peaks, in `breakpoints`"
            )
    # of a reversible law an under-resolved angle causes asymmetry
    error = max(error, _asymmetry(symmetric)) if law.reversible else error
    how = "null rules of Kronrod's rule, panel by panel, and errors of conditional means"
    return computed(symmetric, basis, "quadrature", error + rounding(basis), how)


def _asymmetry(symmetric: Floats) -> float:
    return float(np.linalg.norm(symmetric - symmetric.T))


def _has_too_many_breakpoints(law: Law) -> bool:
    """Whether a law with exact integrals has breakpoints that the first panels leave out.

    Where breakpoints are dense, the rules of Gauss and Kronrod can agree by chance: for rectangular teeth the error was
    up to 14 times their difference.
    """
    return lists_branches(law) and law.breakpoints(FIRST_BREAKPOINTS)[1] > 0.0


def action_matrix(law: Law, basis: Basis, tolerance: float) -> tuple[Floats, float]:
    """<e_i, P e_j> by Kronrod's rule in theta with P e_j from conditional distributions, and an estimate of its error.

    Panels between edges and breakpoints are halved until each has converged or the work exceeds about a second. The
    error is the sum over the panels of the null rules, of which one alone may vanish by chance where P e_j has a kink,
    and of the errors of the conditional distributions.
    """
    breaks, (degree, inside) = law.breakpoints(FIRST_BREAKPOINTS)[0], functions_of(basis)
    edges = np.unique(np.concatenate((basis.edges, GRAZING_EDGES, np.pi - GRAZING_EDGES, breaks)))
    low, high = edges[:-1], edges[1:]
    total, error, spent = np.zeros((basis.size, basis.size)), 0.0, 0
    nodes = law.conditionals(edges[1:-1], max(MEAN_FRACTION * tolerance, CONVERGED)).nodes.size / (edges.size - 2)
    values = NODES.size * int(nodes) * (1 if basis.is_partition else basis.size)
    heights = np.sqrt(largest_square_sum(basis))
    while low.size:
        spent += values * low.size
        # The next round is at most twice as large.
        last = spent + 2 * values * low.size > MOST_VALUES
        converged = np.zeros(low.size, dtype=np.bool_)
        step = max(1, NUMBERS_AT_ONCE // max(values, basis.size**2))
        for start in range(0, low.size, step):
            panels = AnglePanels.between(low[start : start + step], high[start : start + step], basis.size)
            found = law.conditionals(panels.angle, max(MEAN_FRACTION * tolerance, CONVERGED), degree, inside)
            panels.image = found.in_basis(basis).reshape(panels.image.shape)
            panels.mean_error = heights * found.error.reshape(panels.angle.shape)
            difference = panels.rule_errors(basis)
            done = last | (difference <= max(PANEL_FRACTION * tolerance, CONVERGED))
            converged[start : start + step] = done
            total += panels.selected(done).total(basis)
            error += float(difference[done].sum() + panels.mean_errors(basis)[done].sum())
        middle = 0.5 * (low + high)[~converged]
        low, high = np.append(low[~converged], middle), np.append(middle, high[~converged])
    return total, error
