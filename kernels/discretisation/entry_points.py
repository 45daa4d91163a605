"""Matrices of random maps by a product rule: Gauss nodes in the incoming angle, midpoints in the entry point."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from ...core.checks import Floats
from ..bases.basis import Basis
from ..bases.measure import SINE
from ..laws.law import DrivenLaw, Law
from ..matrices.matrix import KernelMatrix
from .method import Budget, MethodName, computed, rounding

# Limit on the rays in memory at a time.
CHUNK = 2**18
FEWEST_ENTRY_POINTS = 4


class EntryPoints:
    """Laws driven by an entry point, by Gauss rules in the incoming angle and midpoints in the entry point."""

    name: MethodName = "quadrature"

    def accepts(self, law: Law, basis: Basis) -> bool:
        return isinstance(law, DrivenLaw)

    def matrix(self, law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
        symmetric, error = entry_matrix(cast(DrivenLaw, law), basis, budget.rays)
        how = "difference of the last two levels of quadrature"
        return computed(symmetric, basis, self.name, error + rounding(basis), how)


def entry_matrix(law: DrivenLaw, basis: Basis, samples: int) -> tuple[Floats, float]:
    """<e_i, P e_j> from about ``samples`` rays, and its difference from the rule with half the points in each variable.

    The outgoing angle jumps in the entry point. The midpoint rule then has order 1, and the difference is a safe
    estimate of the error.
    """
    fine = _product_rule(law, basis, samples, 2)
    coarse = _product_rule(law, basis, samples // 4, 1)
    return fine, float(np.linalg.norm(fine - coarse))


def _product_rule(law: DrivenLaw, basis: Basis, samples: int, split: int) -> Floats:
    fraction = np.arange(split) / split
    edges = np.append((basis.edges[:-1, None] + fraction * np.diff(basis.edges)[:, None]).ravel(), np.pi)
    angle, mass = SINE.quadrature(edges, 1 if basis.is_partition else basis.nodes_per_interval)
    if basis.is_partition:
        # One node per interval does not integrate the weight exactly; the measure of the interval does.
        mass = SINE.mass(edges[:-1], edges[1:])
    entries = max(samples // angle.size, FEWEST_ENTRY_POINTS)
    x = (np.arange(entries) + 0.5) / entries
    total = np.zeros((basis.size, basis.size))
    step = max(1, CHUNK // entries)
    for start in range(0, angle.size, step):
        rows = slice(start, start + step)
        outgoing = law.reflect(x, angle[rows, None])
        if basis.is_partition:
            _add_masses(total, basis, angle[rows], outgoing, mass[rows] / entries)
        else:
            image = _mean_values(basis, outgoing)
            total += basis.evaluate(angle[rows]).T @ (mass[rows, None] * image)
    return basis.normalisation[:, None] * total * basis.normalisation


def _add_masses(total: Floats, basis: Basis, angle: Floats, outgoing: Floats, mass: Floats) -> None:
    cell = basis.index(angle)[:, None] * basis.size + basis.index(outgoing)
    weights = np.broadcast_to(mass[:, None], cell.shape).ravel()
    total += np.bincount(cell.ravel(), weights=weights, minlength=basis.size**2).reshape(total.shape)


def _mean_values(basis: Basis, outgoing: Floats) -> Floats:
    """Mean of the basis functions over the entry points, in chunks that limit the memory."""
    step = max(1, CHUNK // (outgoing.shape[1] * basis.size))
    parts: list[Any] = [
        basis.evaluate(outgoing[start : start + step]).mean(axis=1) for start in range(0, outgoing.shape[0], step)
    ]
    return np.concatenate(parts)
