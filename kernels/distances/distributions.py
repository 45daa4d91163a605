"""The distribution of the outgoing angle at each incoming angle, for every kind of law."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...core.checks import Floats
from ..bases.bins import Bins
from ..bases.measure import SINE
from ..discretisation.discretisation import discretise
from ..laws.distribution import Distribution
from ..laws.law import ENTRY_POINTS, Combination, Composition, Law, Power, SpecularFrame, atoms_of
from ..laws.structure import Rules, fold
from ..matrices.matrix import KernelMatrix
from .transport import Distributions, power_mean, wasserstein

# Incoming angles at which the error from entry points is estimated.
ANGLES = 64


def outgoing_distributions(law: Law, theta: Floats, edges: Floats) -> Distributions:
    """P(theta_k, .) for every theta_k: exact for atoms, else linear between ``edges``, which go from 0 to pi."""
    return Distributions.of_parts(edges, *law.distribution(theta, edges))


def on_cells(law: Law) -> Law:
    """The same law, with products that take the distribution of their later factors from a matrix on the cells.

    The default, `apply`, would nest one integral in another.
    """
    if isinstance(law, Combination):
        return Combination(tuple((weight, on_cells(term)) for weight, term in law.terms))
    if isinstance(law, SpecularFrame):
        return SpecularFrame(on_cells(law.law))
    if isinstance(law, Power) and law.exponent:
        law = Composition((law.law,) * law.exponent)
    return _OnCells((on_cells(law.laws[0]), *law.laws[1:])) if isinstance(law, Composition) else law


def cells_error(law: Law, order: float, sup: bool) -> float:
    """Error of a distance from the matrices that replace the later factors of products.

    The Frobenius errors of the last matrices used enter as in `resampling.matrices_error`.
    """
    if isinstance(law, Combination):
        return sum(weight * cells_error(term, order, sup) for weight, term in law.terms)
    if isinstance(law, SpecularFrame):
        return cells_error(law.law, order, sup)
    if not isinstance(law, _OnCells) or law.last is None:
        return 0.0
    error = float(law.last.error) / (float(np.sqrt(law.last.weights.min())) if sup else 1.0)
    return float(np.pi * min(0.5 * error, 1.0) ** (1.0 / order)) + cells_error(law.laws[0], order, sup)


# The parts of a law that its distributions are taken from, with their weights; of a product, those of its first factor.
FIRST_PARTS: Rules[list[tuple[float, Law]]] = Rules(
    lambda law: [(1.0, law)],
    lambda terms: [(weight * own, law) for weight, parts in terms for own, law in parts],
    lambda factors: factors[0] if factors else [],
    lambda parts: parts,
)


def entry_error(law: Law, order: float, sup: bool) -> float:
    """Error of a distance from laws whose distributions are those of equally spaced entry points.

    It is the distance between the distributions of every other entry point: each half has twice the spacing of all
    points, or half of the sample where the angles are chaotic.
    """
    return sum(weight * _entry_error(part, order, sup) for weight, part in fold(law, FIRST_PARTS))


def _entry_error(law: Law, order: float, sup: bool) -> float:
    angle, edges = SINE.quantile((np.arange(ANGLES) + 0.5) / ANGLES), np.array([0.0, np.pi])
    found = law.distribution(angle[:1], edges)
    if found.mass.shape[1] != ENTRY_POINTS:
        return 0.0
    found = law.distribution(angle, edges)
    one, other = (
        Distributions.of_parts(edges, found.below, found.position[:, first::2], 2.0 * found.mass[:, first::2])
        for first in (0, 1)
    )
    rows = wasserstein(one, other, order)
    return float(rows.max() if sup else power_mean(rows, np.full(ANGLES, 1.0 / ANGLES), order))


@dataclass(frozen=True, repr=False)
class _OnCells(Composition):
    """A product whose later factors are replaced by the matrix of their product on the cells between the edges."""

    # the last matrix used, for its error
    last: KernelMatrix | None = field(default=None, compare=False, repr=False)

    def distribution(self, theta: Floats, edges: Floats) -> Distribution:
        atoms = atoms_of(self, theta, edges)
        if atoms is not None:
            return atoms
        first, *rest = self.laws
        found = first.distribution(theta, edges)
        if not rest:
            return found
        matrix = discretise(rest[0] if len(rest) == 1 else Composition(tuple(rest)), Bins(edges))
        object.__setattr__(self, "last", matrix)
        return Distribution.of_cells(np.diff(found.cumulative(edges), axis=1) @ matrix.array)
