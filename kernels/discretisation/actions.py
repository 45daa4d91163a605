"""Matrices of laws from their conditional distributions, by Kronrod's rule in the incoming angle."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats
from ...core.long_runs import NUMBERS_AT_ONCE
from ..bases.assembly import largest_square_sum
from ..bases.basis import Basis
from ..bases.legendre import Legendre
from ..expectations.angle_panels import NODES, AnglePanels
from ..expectations.basis_means import functions_of
from ..laws.law import DrivenLaw, Law, knows_errors
from ..laws.structure import is_compound, lists_branches
from ..matrices.matrix import KernelMatrix
from ..walls.wall_law import traced_wall
from .method import Budget, computed, rounding

# Limit on the values of basis functions: one or two seconds of work.
MOST_VALUES = 2**26
# Number of breakpoints among the first panel edges; the fraction of the tolerance that the error of one panel may have;
# and the error that rounding leaves.
FIRST_BREAKPOINTS, PANEL_FRACTION, CONVERGED = 32, 0.02, 1e-15
# Tolerance of the conditional distributions as a fraction of that of the matrix.
MEAN_FRACTION = 0.1
# First panel edges near grazing, where angles of reflection vary on the scale of the angle itself.
GRAZING_EDGES = np.pi * 0.25 ** np.arange(2.0, 9.0)


def has_conditionals(law: Law, basis: Basis) -> bool:
    """Whether a law is not compound, and knows the errors of its conditional distributions and its breakpoints."""
    if is_compound(law) or _has_too_many_breakpoints(law):
        return False
    driven = isinstance(law, DrivenLaw) and law.isometry_table() is None
    return traced_wall(law) is None and (isinstance(basis, Legendre) or not driven) and knows_errors(law)


def by_conditionals(law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
    """The matrix from conditional distributions, by Kronrod's rule."""
    symmetric, error = action_matrix(law, basis, budget.tolerance)
    if law.reversible:
        # For a reversible law an under-resolved angle causes asymmetry.
        error = max(error, float(np.linalg.norm(symmetric - symmetric.T)))
    how = "difference of the rules of Gauss and Kronrod, panel by panel, and errors of conditional means"
    return computed(symmetric, basis, "quadrature", error + rounding(basis), how)


def _has_too_many_breakpoints(law: Law) -> bool:
    """Whether a law with exact integrals has breakpoints that the first panels leave out.

    Where breakpoints are dense, the rules of Gauss and Kronrod can agree by chance: for rectangular teeth the error was
    up to 14 times their difference.
    """
    return lists_branches(law) and law.breakpoints(FIRST_BREAKPOINTS)[1] > 0.0


def action_matrix(law: Law, basis: Basis, tolerance: float) -> tuple[Floats, float]:
    """<e_i, P e_j> by Kronrod's rule in theta with P e_j from conditional distributions, and an estimate of its error.

    Panels between edges and breakpoints are halved until each has converged or the work exceeds about a second. The
    error is the sum over the panels of the difference from Gauss's rule, which is safe even if P e_j jumps on a panel,
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
            difference = panels.differences(basis)
            done = last | (difference <= max(PANEL_FRACTION * tolerance, CONVERGED))
            converged[start : start + step] = done
            total += panels.selected(done).total(basis)
            error += float(difference[done].sum() + panels.mean_errors(basis)[done].sum())
        middle = 0.5 * (low + high)[~converged]
        low, high = np.append(low[~converged], middle), np.append(middle, high[~converged])
    return total, error
