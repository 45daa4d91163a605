"""Conditional distributions of the outgoing angle as atoms and masses of cells, for every kind of law."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np

from ...core.checks import Floats
from ..bases.bins import Bins
from ..bases.intervals import cell_among
from ..discretisation.discretisation import discretise
from ..expectations.distribution_functions import Distributions
from ..laws.law import (
    Combination,
    Composition,
    Law,
    Power,
    SpecularFrame,
    has_fixed_nodes,
    is_atomic,
    is_flat_top,
    knows_errors,
)
from ..laws.structure import law_of, words_of
from ..matrices.matrix import KernelMatrix

# Limit on the atoms of the first factors of a product from which the last factor is followed without a matrix.
MOST_FOLLOWED = 32
# Incoming angle at which these are counted.
PROBE = np.array([1.0])
# Error in total variation of conditional distributions of which no error is known.
UNKNOWN = 2.0
# Matrices of later factors in memory.
MATRICES = 4


class Term(NamedTuple):
    """A law without sums, and of a product on cells its first factor, as terms, and the law of the others.

    ``has_atoms``: the conditional distributions are finitely many atoms.
    """

    law: Law
    factors: tuple[Terms, Law] | None
    has_atoms: bool


Terms: TypeAlias = "list[tuple[float, Term]]"


class CellsAndAtoms(NamedTuple):
    """P(theta_k, .) for some theta_k: masses of cells without the atoms, atoms, and errors in total variation.

    The shapes are (angles, cells), twice (angles, atoms), and (angles,). The error of a matrix is its mean over theta,
    or the largest.
    """

    cells: Floats
    position: Floats
    mass: Floats
    error: Floats

    def on(self, edges: Floats) -> Distributions:
        """The distribution functions, linear between the edges but for the atoms."""
        below = np.concatenate((np.zeros((len(self.cells), 1)), np.cumsum(self.cells, axis=1)), axis=1)
        return Distributions.of_parts(edges, below, self.position, self.mass)

    def masses(self, edges: Floats) -> Floats:
        """The masses of cells, with those of the atoms."""
        found = self.cells.copy()
        np.add.at(found, (np.arange(len(found))[:, None], cell_among(edges, self.position)), self.mass)
        return found


def terms_of(law: Law) -> Terms:
    """The law as a weighted sum of laws of atoms, laws without atoms but flat tops, and products of these."""
    words = words_of(law)
    if words is not None:
        return [(weight, _term(law_of(word))) for word, weight in words.items()]
    if isinstance(law, Combination):
        return [(weight * part, term) for weight, one in law.parts for part, term in terms_of(one)]
    return [(1.0, _term(law))]


def _term(law: Law) -> Term:
    factors = None if _is_followed(law) else _first_and_others(law)
    if factors is not None:
        return Term(law, (terms_of(factors[0]), factors[1]), False)
    return Term(law, None, has_fixed_nodes(law))


def _is_followed(law: Law) -> bool:
    """Whether the conditional distributions of a product are known with their errors, and are not too long."""
    if not isinstance(law, Composition):
        return False
    *first, last = law.laws
    if not all(is_atomic(part) for part in first) or not knows_errors(last):
        return False
    return is_atomic(last) or Composition(tuple(first)).conditionals(PROBE).nodes.size <= MOST_FOLLOWED


def _first_and_others(law: Law) -> tuple[Law, Law] | None:
    """The first factor of a product and the law of the others; None for other laws."""
    if isinstance(law, SpecularFrame):
        factors = _first_and_others(law.law)
        return None if factors is None else (factors[0], SpecularFrame.of(factors[1]))
    if isinstance(law, Power):
        return law.law, Power(law.law, law.exponent - 1)
    if isinstance(law, Composition):
        return law.laws[0], law.laws[1] if len(law.laws) == 2 else Composition(law.laws[1:])
    return None


def cells_and_atoms(terms: Terms, theta: Floats, edges: Floats, tolerance: float, sup: bool) -> CellsAndAtoms:
    """The conditional distributions of a sum at incoming angles, with its masses between edges from 0 to pi.

    The first factor of a product is multiplied by the matrix of the others.
    """
    total, wrong = np.zeros((theta.size, edges.size - 1)), np.zeros(theta.size)
    atoms = [np.empty((2, theta.size, 0))]
    for weight, term in terms:
        if term.factors is not None:
            first = cells_and_atoms(term.factors[0], theta, edges, tolerance, sup)
            matrix = _matrix(term.factors[1], edges.tobytes())
            total += weight * first.masses(edges) @ matrix.array
            wrong += weight * (first.error + float(matrix.error) / (np.sqrt(matrix.weights.min()) if sup else 1.0))
            continue
        incoming, back = term.law._distinct(theta)
        given = term.law.conditionals(incoming, tolerance, 0, edges[1:-1])
        error = np.where(np.isnan(given.error), UNKNOWN, given.error)[back]
        table = term.law.isometry_table() if term.has_atoms and not sup else None
        # of a mean over theta, unresolved rays change no more than their fraction
        wrong += weight * (error if table is None else 2.0 * table.unresolved)
        if term.has_atoms:
            position, mass = (part[back] for part in given.atoms())
            atoms.append(np.stack((position, weight * mass / mass.sum(axis=1, keepdims=True))))
            continue
        level = is_flat_top(term.law, incoming, given)
        total += weight * given._replace(weights=np.where(level, 0.0, given.weights)).masses(edges)[back]
        if level.any():
            flat = np.bincount(given.owner, weights=np.where(level, given.weights, 0.0), minlength=incoming.size)[back]
            position = np.pi - theta if not isinstance(term.law, SpecularFrame) else theta
            atoms.append(np.stack((position, weight * flat))[..., None])
    position, mass = np.concatenate(atoms, axis=2)
    return CellsAndAtoms(total, position, mass, wrong)


@lru_cache(maxsize=MATRICES)
def _matrix(law: Law, edges: bytes) -> KernelMatrix:
    return discretise(law, Bins(np.frombuffer(edges)))
