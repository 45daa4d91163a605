"""The distribution of the outgoing angle at each incoming angle, for every kind of law."""

from __future__ import annotations

import numpy as np

from ...core.checks import Floats
from ..bases.bins import Bins
from ..discretisation.discretisation import discretise
from ..laws.distribution import Distribution
from ..laws.law import Combination, Composition, Law, Power, SpecularFrame, atoms_of
from .transport import Distributions


def outgoing_distributions(law: Law, theta: Floats, edges: Floats) -> Distributions:
    """P(theta_k, .) for every theta_k: exact for laws of isometries, else linear between ``edges``, from 0 to pi."""
    return Distributions.of_parts(edges, *law.distribution(theta, edges))


def on_cells(law: Law) -> Law:
    """The same law, whose products take the distribution of their later factors from a matrix on the cells.

    By `apply` it would be an integral over an integral, and a law does not know how matrices are made.
    """
    if isinstance(law, Combination):
        return Combination(tuple((weight, on_cells(term)) for weight, term in law.terms))
    if isinstance(law, SpecularFrame):
        return SpecularFrame(on_cells(law.law))
    if isinstance(law, Power) and law.exponent:
        return _OnCells((law.law,) * law.exponent)
    return _OnCells(law.laws) if isinstance(law, Composition) else law


class _OnCells(Composition):
    """Its first factor exactly; of the others the matrix of their product on the cells between the edges."""

    def distribution(self, theta: Floats, edges: Floats) -> Distribution:
        atoms = atoms_of(self, theta, edges)
        if atoms is not None:
            return atoms
        first, *rest = self.laws
        found = on_cells(first).distribution(theta, edges)
        if not rest:
            return found
        matrix = discretise(rest[0] if len(rest) == 1 else Composition(tuple(rest)), Bins(edges)).array
        return Distribution.of_cells(np.diff(found.cumulative(edges), axis=1) @ matrix)
