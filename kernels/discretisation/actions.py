"""Matrices of laws that are given by their action on functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats
from ..bases.basis import Basis
from ..bases.legendre import Legendre
from ..expectations.angle_panels import NODES, AnglePanels
from ..laws.law import DrivenLaw, Law
from ..laws.structure import is_compound, lists_branches
from ..matrices.matrix import KernelMatrix
from .method import Budget, MethodName, computed, rounding

# Limit on the values of basis functions in `law.apply`: one or two seconds of work.
MOST_VALUES = 2**26
# Limit on the numbers in memory at a time.
CHUNK = 2**21
# Number of breakpoints among the first panel edges; the fraction of the tolerance that the error of one panel may have;
# and the error that rounding leaves.
FIRST_BREAKPOINTS, PANEL_FRACTION, CONVERGED = 32, 0.02, 1e-15
# First panel edges near grazing, where angles of reflection vary on the scale of the angle itself.
GRAZING_EDGES = np.pi * 0.25 ** np.arange(2.0, 9.0)


class HasAction(Protocol):
    """The methods of a law that `action_matrix` uses."""

    def apply(self, function: Callable[[Floats], Floats], theta: ArrayLike) -> Floats: ...
    def breakpoints(self, limit: int) -> tuple[Floats, float]: ...
    @property
    def evaluations(self) -> int: ...


class Actions:
    """Any law that is not compound and has an accurate `apply`, by Kronrod's rule in the incoming angle."""

    name: MethodName = "quadrature"

    def accepts(self, law: Law, basis: Basis) -> bool:
        if is_compound(law) or _has_too_many_breakpoints(law):
            return False
        # `_apply` of a driven law is a fixed rule in the entry point. A subclass's own `_apply` is accurate for smooth
        # functions such as Legendre's, not for functions with edges.
        own = type(law)._apply is not DrivenLaw._apply and isinstance(basis, Legendre)
        return not isinstance(law, DrivenLaw) or own

    def matrix(self, law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
        symmetric, error = action_matrix(law, basis, budget.tolerance)
        if law.reversible:
            # For a reversible law an under-resolved angle causes asymmetry.
            error = max(error, float(np.linalg.norm(symmetric - symmetric.T)))
        how = "difference of the rules of Gauss and Kronrod, panel by panel"
        return computed(symmetric, basis, self.name, error + rounding(basis), how)


def _has_too_many_breakpoints(law: Law) -> bool:
    """Whether a law with exact integrals has breakpoints that the first panels leave out.

    Where breakpoints are dense, the rules of Gauss and Kronrod can agree by chance: for rectangular teeth the error was
    up to 14 times their difference.
    """
    return lists_branches(law) and law.breakpoints(FIRST_BREAKPOINTS)[1] > 0.0


def action_matrix(law: HasAction, basis: Basis, tolerance: float) -> tuple[Floats, float]:
    """<e_i, P e_j> by Kronrod's rule in theta with P e_j from ``law.apply``, and an estimate of its Frobenius error.

    Panels between edges and breakpoints are halved until each has converged or the work exceeds about a second. The
    error is the sum over the panels of the difference from Gauss's rule, which is safe even if P e_j jumps on a panel.
    """
    breaks = law.breakpoints(FIRST_BREAKPOINTS)[0]
    edges = np.unique(np.concatenate((basis.edges, GRAZING_EDGES, np.pi - GRAZING_EDGES, breaks)))
    low, high = edges[:-1], edges[1:]
    total, error, spent = np.zeros((basis.size, basis.size)), 0.0, 0
    values = NODES.size * basis.size * max(int(law.evaluations), 1)
    while low.size:
        spent += values * low.size
        # The next round is at most twice as large.
        last = spent + 2 * values * low.size > MOST_VALUES
        converged = np.zeros(low.size, dtype=np.bool_)
        step = max(1, CHUNK // max(values, basis.size**2))
        for start in range(0, low.size, step):
            panels = AnglePanels.between(low[start : start + step], high[start : start + step], basis.size)
            panels.image = law.apply(basis.evaluate, panels.angle)
            difference = panels.differences(basis)
            done = last | (difference <= max(PANEL_FRACTION * tolerance, CONVERGED))
            converged[start : start + step] = done
            total += panels.selected(done).total(basis)
            error += float(difference[done].sum())
        middle = 0.5 * (low + high)[~converged]
        low, high = np.append(low[~converged], middle), np.append(middle, high[~converged])
    return total, error
