"""The distribution of the outgoing angle at each incoming angle, for every kind of law."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...core.checks import Floats
from ..bases.bins import Bins
from ..bases.measure import SINE
from ..discretisation.discretisation import discretise
from ..expectations.conditionals import Conditionals
from ..laws.distribution import Distribution
from ..laws.law import ENTRY_POINTS, Combination, Composition, Law, Power, SpecularFrame, is_atomic
from ..matrices.matrix import KernelMatrix
from .transport import Distributions, power_mean, wasserstein

# Incoming angles at which the error from entry points is estimated, and the number of cells for products.
ANGLES = 64
# Incoming angle at which laws are tested for entry points; the result does not depend on it.
PROBE = 1.0


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

    The Frobenius errors of the last matrices used enter as in `resampling.matrices_error`; they bound total variations,
    which further factors do not increase. W_p^p is convex in both measures, so the p-th powers of the errors of the
    terms of a sum are averaged.
    """
    if isinstance(law, Combination):
        errors = np.array([cells_error(term, order, sup) for _, term in law.terms])
        return float(power_mean(errors, np.array([weight for weight, _ in law.terms]), order))
    if isinstance(law, SpecularFrame):
        return cells_error(law.law, order, sup)
    if not isinstance(law, _OnCells) or law.last is None:
        return 0.0
    error = float(law.last.error) / (float(np.sqrt(law.last.weights.min())) if sup else 1.0)
    return float(np.pi * min(0.5 * error, 1.0) ** (1.0 / order)) + cells_error(law.laws[0], order, sup)


def entry_error(law: Law, order: float, sup: bool) -> float:
    """Error of a distance from laws whose distributions are those of equally spaced entry points.

    It is the distance between the laws with every other entry point: each half has twice the spacing of all points, or
    half of the sample where the angles are chaotic. The law is one that `on_cells` returned.
    """
    if not _has_entry_points(law):
        return 0.0
    angle, edges = SINE.quantile((np.arange(ANGLES) + 0.5) / ANGLES), np.linspace(0.0, np.pi, ANGLES + 1)
    one, other = (outgoing_distributions(_with_half(law, first), angle, edges) for first in (0, 1))
    rows = wasserstein(one, other, order)
    return float(rows.max() if sup else power_mean(rows, np.full(ANGLES, 1.0 / ANGLES), order))


def _has_entry_points(law: Law) -> bool:
    """Whether a distribution of the law, or of the first factor of a product, is that of entry points."""
    if isinstance(law, Combination):
        return any(_has_entry_points(term) for weight, term in law.terms if weight > 0.0)
    if isinstance(law, (SpecularFrame, Composition)):
        return _has_entry_points(law.law if isinstance(law, SpecularFrame) else law.laws[0])
    return bool(law.distribution(np.array([PROBE]), np.array([0.0, np.pi])).mass.shape[1] == ENTRY_POINTS)


def _with_half(law: Law, first: int) -> Law:
    """The law with every other entry point."""
    if isinstance(law, Combination):
        return Combination(tuple((weight, _with_half(term, first)) for weight, term in law.terms))
    if isinstance(law, SpecularFrame):
        return SpecularFrame(_with_half(law.law, first))
    if isinstance(law, Composition):
        return _OnCells((_with_half(law.laws[0], first), *law.laws[1:]))
    return _HalfOfEntries(law, first) if _has_entry_points(law) else law


@dataclass(frozen=True, repr=False)
class _HalfOfEntries(Law):
    """The distributions of a law from every other one of its entry points; nothing else is asked of it."""

    law: Law
    first: int

    def _distribution(self, theta: Floats, edges: Floats) -> Distribution:
        found = self.law.distribution(theta, edges)
        return Distribution(found.below, found.position[:, self.first :: 2], 2.0 * found.mass[:, self.first :: 2])

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self.law.sample(theta, rng)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        return self.law._conditionals(theta, tolerance, degree, edges)


@dataclass(frozen=True, repr=False)
class _OnCells(Composition):
    """A product whose later factors are replaced by the matrix of their product on the cells between the edges."""

    # the last matrix used, for its error
    last: KernelMatrix | None = field(default=None, compare=False, repr=False)

    def _distribution(self, theta: Floats, edges: Floats) -> Distribution:
        if is_atomic(self):
            return super()._distribution(theta, edges)
        first, *rest = self.laws
        found = first.distribution(theta, edges)
        if not rest:
            return found
        matrix = self.last
        if matrix is None or not np.array_equal(matrix.basis.edges, edges):
            matrix = discretise(rest[0] if len(rest) == 1 else Composition(tuple(rest)), Bins(edges))
            object.__setattr__(self, "last", matrix)
        return Distribution.of_cells(np.diff(found.cumulative(edges), axis=1) @ matrix.array)
