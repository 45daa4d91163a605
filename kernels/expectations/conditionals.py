"""Conditional distributions of the outgoing angle at given incoming angles, as weighted angles with errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.estimates import shown, text_of
from ..bases.angles import clipped_inside
from ..bases.basis import AngleFunction, Basis
from ..bases.given import Vectorised
from ..bases.intervals import cell_among, joined_lists
from ..bases.measure import gauss_on_intervals
from .basis_means import means_of_basis

# Gauss nodes on an interval on which cos(s x / 2) and sin(s x / 2), -1 < x < 1, reach rounding, for s up to the limits.
STIFFNESS, NODES = np.array([0.2, 3.0, 16.0, 48.0, 120.0, 300.0]), np.array([4, 8, 16, 32, 64, 128, 256])
# Chebyshev points at which functions are examined, the size of the coefficients that count, and the highest degree.
POINTS, SMALLEST_COEFFICIENT, MOST_DEGREE = 1024, 1e-14, 256
# Chebyshev coefficients beyond pi d / 2 that a trigonometric polynomial of degree d has, and the lowest degree.
MORE_COEFFICIENTS, LEAST_DEGREE = 16, 8


class Conditionals(NamedTuple):
    """The conditional distributions P~(theta_k, .) of a law at incoming angles theta_k.

    Attributes
    ----------
    nodes, weights : arrays
        Outgoing angles and their probabilities, one distribution after the other; the weights of each sum to 1.
    starts : array of int, shape (angles + 1,)
        Distribution k has the nodes ``nodes[starts[k]:starts[k + 1]]``.
    error : array, shape (angles,)
        Error of the mean of a function of sup norm 1 and the degree asked for; nan if unknown.
    """

    nodes: Floats
    weights: Floats
    starts: NDArray[np.int64]
    error: Floats

    def __repr__(self) -> str:
        return text_of("Conditionals", {name: shown(value) for name, value in self._asdict().items()})

    @classmethod
    def of_atoms(cls, nodes: Floats, weights: Floats, error: float = 0.0) -> Conditionals:
        """The distributions of finitely many atoms each, from arrays of shape (angles, atoms)."""
        used = weights > 0.0
        starts = np.concatenate(([0], np.cumsum(np.count_nonzero(used, axis=1))))
        return cls(nodes[used], weights[used], starts, np.full(len(nodes), error))

    @classmethod
    def of_lists(cls, owner: NDArray[np.intp], nodes: Floats, weights: Floats, error: Floats) -> Conditionals:
        """The distributions of nodes in any order, with the index of the incoming angle of each.

        The weights of each distribution are divided by their sum.
        """
        total = np.bincount(owner, weights=weights, minlength=error.size)
        order = np.argsort(owner, kind="stable")
        starts = np.concatenate(([0], np.cumsum(np.bincount(owner, minlength=error.size))))
        return cls(clipped_inside(nodes[order]), (weights / total[owner])[order], starts, error)

    @staticmethod
    def mixed(terms: Sequence[tuple[float, Conditionals]]) -> Conditionals:
        """The weighted sum of conditional distributions at the same incoming angles."""
        owner = np.concatenate([part.owner for _, part in terms])
        order = np.argsort(owner, kind="stable")
        nodes = np.concatenate([part.nodes for _, part in terms])[order]
        weights = np.concatenate([weight * part.weights for weight, part in terms])[order]
        starts = sum((part.starts for _, part in terms), start=np.zeros_like(terms[0][1].starts))
        error = sum((weight * part.error for weight, part in terms), start=np.zeros_like(terms[0][1].error))
        return Conditionals(nodes, weights, starts, error)

    @property
    def owner(self) -> NDArray[np.intp]:
        """The index of the incoming angle of each node."""
        return np.repeat(np.arange(self.error.size), np.diff(self.starts))

    def atoms(self) -> tuple[Floats, Floats]:
        """Nodes and weights, shape (angles, nodes); unused slots have weight 0 and the first node."""
        owner, slot = joined_lists(np.diff(self.starts))
        nodes = np.repeat(self.nodes[self.starts[:-1]], slot.max(initial=0) + 1).reshape(self.error.size, -1)
        weights = np.zeros(nodes.shape)
        nodes[owner, slot], weights[owner, slot] = self.nodes, self.weights
        return nodes, weights

    def mean(self, function: AngleFunction) -> Floats:
        """E[f(Theta') | theta] for every angle, shape ``(angles,) + extra`` if f has values ``theta.shape + extra``."""
        values = Vectorised.of(function)(self.nodes)
        weighted = self.weights.reshape((-1,) + (1,) * (values.ndim - 1)) * values
        return np.asarray(np.add.reduceat(weighted, self.starts[:-1], axis=0))

    def masses(self, edges: Floats) -> Floats:
        """The probabilities between neighbouring edges, which go from 0 to pi, shape (angles, cells)."""
        shape = self.error.size, edges.size - 1
        cell = self.owner * shape[1] + cell_among(edges, self.nodes)
        masses = np.bincount(cell, weights=self.weights, minlength=shape[0] * shape[1])
        return np.asarray(masses.reshape(shape), dtype=np.float64)

    def in_basis(self, basis: Basis) -> Floats:
        """The means of the functions of a basis, shape (angles, size)."""
        return means_of_basis(basis, self.nodes, self.weights, self.starts)

    def mirrored(self) -> Conditionals:
        """The distributions of pi minus the outgoing angle."""
        return self._replace(nodes=clipped_inside(np.pi - self.nodes))

    def followed_by(self, after: Callable[[Floats], Conditionals], exact: bool) -> Conditionals:
        """The distributions after another law, whose conditional distributions ``after`` gives at all nodes.

        The error is unknown unless these distributions are ``exact`` for any function, because means under the other
        law may have breakpoints that they do not resolve.
        """
        found = after(self.nodes)
        weights = np.repeat(self.weights, np.diff(found.starts)) * found.weights
        error = np.add.reduceat(self.weights * found.error, self.starts[:-1])
        error = self.error + error if exact else np.full(self.error.shape, np.nan)
        return Conditionals(found.nodes, weights, found.starts[self.starts], error)


def gauss_nodes(
    owner: NDArray[np.intp], low: Floats, high: Floats, stiffness: Floats
) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Gauss rules on intervals, more nodes for stiffer integrands: the index of each interval's owner, nodes, weights.

    A trigonometric polynomial of degree d on an interval of width w has the stiffness d w, a polynomial 2 d.
    """
    number = NODES[np.searchsorted(STIFFNESS, stiffness)]
    owners, nodes, weights = [np.empty(0, dtype=np.intp)], [np.empty(0)], [np.empty(0)]
    for count in np.unique(number).tolist():
        chosen = np.flatnonzero(number == count)
        angle, weight = gauss_on_intervals(low[chosen], high[chosen], count)
        owners.append(np.repeat(owner[chosen], count))
        nodes.append(angle)
        weights.append(weight)
    return np.concatenate(owners), np.concatenate(nodes), np.concatenate(weights)


def stiffness_between(edges: Floats, degree: int, low: Floats, high: Floats) -> Floats:
    """The stiffness of functions on intervals: trigonometric polynomials, or polynomials between given edges."""
    if not edges.size:
        return degree * (high - low)
    whole = np.concatenate(([0.0], edges, [np.pi]))
    return 2.0 * degree * (high - low) / np.diff(whole)[cell_among(whole, 0.5 * (low + high))]


def degree_of(function: Callable[[Floats], Any]) -> int:
    """The degree of a function on (0, pi) as a trigonometric polynomial, to rounding; at most `MOST_DEGREE`.

    Examples
    --------
    >>> degree_of(np.cos), degree_of(lambda theta: np.cos(60.0 * theta)) >= 60, degree_of(lambda theta: theta < 1.0)
    (8, True, 256)
    """
    from scipy.fft import dct

    points = 0.5 * np.pi * (1.0 + np.cos((np.arange(POINTS) + 0.5) * (np.pi / POINTS)))
    values = np.asarray(function(points), dtype=np.float64).reshape(POINTS, -1)
    coefficients = np.abs(dct(values, axis=0)).max(axis=1, initial=0.0) / POINTS
    counted = np.flatnonzero(coefficients > SMALLEST_COEFFICIENT * max(float(np.abs(values).max(initial=0.0)), 1e-300))
    last = int(counted[-1]) if counted.size else 0
    return int(np.clip(np.ceil((last - MORE_COEFFICIENTS) * 2.0 / np.pi), LEAST_DEGREE, MOST_DEGREE))
