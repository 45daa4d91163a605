"""Matrices of laws made of isometries, by quadrature between their breakpoints: exact to rounding."""

from __future__ import annotations

import math

import numpy as np

from ...core.checks import Floats
from ...core.long_runs import NUMBERS_AT_ONCE
from ..bases.assembly import add_products, largest_square_sum
from ..bases.basis import Basis
from ..bases.displacement import Displacement
from ..bases.measure import gauss_on_intervals
from ..laws.branches import preimages
from ..laws.law import Law
from ..laws.structure import Rules, fold
from ..matrices.matrix import KernelMatrix
from .isometry_tables import bounded
from .method import Budget, rounding

# A probability linear in cot(theta), times sin(theta), is a combination of sin and cos. A Gauss rule with m nodes has
# an error of about (width/2)^(2m)/(2m)! for it. Probabilities of compositions are products of such terms, smooth on the
# scale of the distance to grazing. Pieces narrower than NARROW on both scales get 6 nodes: an error of 0.05^12 / 12!.
NARROW, NODES_NARROW, NODES_WIDE = 0.1, 6, 20
# Breakpoints that accumulate at grazing are listed until the omitted fraction is negligible or their use would take
# more than about a second.
FEWEST_BREAKPOINTS, BREAKPOINT_WORK, FUNCTION_WORK = 2**10, 2**20, 2**21
# Angles at which branches are counted.
PROBES = np.linspace(0.1, 3.0, 30)
# Number of branches that are computed before those of a chain merge.
BRANCHES_COMPUTED = Rules(
    lambda law: law.branches(PROBES)[0].shape[-1], lambda terms: sum(n for _, n in terms), math.prod, lambda n: n
)


def by_branches(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix of a law that lists its isometries, by Gauss rules between their breakpoints."""
    symmetric, error = branch_matrix(law, basis, budget.tolerance)
    how = "Gauss rules between the breakpoints of isometries: rounding and omitted breakpoints"
    return bounded(symmetric, basis, error, how)


def branch_matrix(law: Law, basis: Basis, tolerance: float) -> tuple[Floats, float]:
    """<e_i, P e_j> for a law of isometries, and a bound on its Frobenius error.

    The interval (0, pi) is cut at the breakpoints of the law, the edges of the basis and the angles that a branch maps
    to edges. On each piece every integrand is smooth. Let m be the measure of angles near grazing whose breakpoints the
    law leaves out. There, both the integral and its approximation are integrals of e(theta) e(theta')^T over a measure
    of mass m, so they differ by at most 2 m sup |e|^2, with |e|^2 the sum of squares of the basis functions.
    """
    worst = 2.0 * largest_square_sum(basis)
    limit = FEWEST_BREAKPOINTS
    breakpoints, omitted = law.breakpoints(limit)
    branches = law.branches(PROBES)[0].shape[-1]
    most = BREAKPOINT_WORK // fold(law, BRANCHES_COMPUTED) ** 2
    if not basis.is_partition:
        most = min(most, FUNCTION_WORK // basis.size)
    while omitted * worst > tolerance and 2 * limit <= most:
        limit *= 2
        breakpoints, omitted = law.breakpoints(limit)
    edges = np.unique(np.concatenate((basis.edges, breakpoints)))
    sources = preimages(law.branches, np.concatenate(([0.0], breakpoints, [np.pi])), basis.edges)
    assert sources is not None  # `branches` raises an InputError instead
    edges = np.unique(np.concatenate((edges, sources)))
    total, displacement = np.zeros((basis.size, basis.size)), Displacement(basis)
    width, near = np.diff(edges), np.minimum(edges[1:], np.pi - edges[:-1])
    narrow = (width < NARROW) & (width < NARROW * near)
    order, order_narrow = NODES_WIDE, NODES_NARROW
    if not basis.is_partition:
        # On such short pieces the functions of the basis are as smooth as the probabilities.
        order = max(order, basis.nodes_per_interval)
        tame = width * basis.nodes_per_interval < np.diff(basis.edges).min()
        narrow, order_narrow = narrow & tame, NODES_NARROW + 2
    for chosen, nodes in ((narrow, order_narrow), (~narrow, order)):
        step = NUMBERS_AT_ONCE // (nodes * branches)
        _add_pieces(law, basis, edges[:-1][chosen], edges[1:][chosen], nodes, total, step)
    for middle in np.array_split(0.5 * (edges[1:] + edges[:-1]), 1 + edges.size * branches // NUMBERS_AT_ONCE):
        _add_cuts(law, basis, middle, displacement)
    return total, omitted * worst + rounding(basis) + displacement.bound()


def _add_cuts(law: Law, basis: Basis, middle: Floats, displacement: Displacement) -> None:
    probability, outgoing = law.branches(middle)
    density, source = np.sin(middle), basis.index(middle)
    for slot in range(outgoing.shape[-1]):
        image = outgoing[:, slot]
        displacement.add(middle, image, density * probability[:, slot], source, basis.index(image))


def _add_pieces(law: Law, basis: Basis, low: Floats, high: Floats, order: int, total: Floats, pieces: int) -> None:
    # Large steps, because every step adds whole matrices.
    step = max(pieces, 1)
    for start in range(0, low.size, step):
        angle, weight = gauss_on_intervals(low[start : start + step], high[start : start + step], order)
        mass = weight * basis.measure.density(angle)
        probability, outgoing = law.branches(angle)
        for slot in range(outgoing.shape[-1]):
            used = probability[:, slot] > 0.0
            add_products(total, basis, angle[used], outgoing[used, slot], (mass * probability[:, slot])[used])
