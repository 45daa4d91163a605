"""Conditional expectations theta -> E[e_j(Theta') | theta] of basis functions, as exact as each kind of law allows."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats
from ..bases.basis import AngleFunction, Basis
from ..bases.legendre import Legendre
from ..bases.measure import gauss_rule
from ..bases.mirror import reflection_matrix
from ..bases.panels import Panels

# Values of functions held at a time.
VALUES_AT_ONCE = 2_000_000
# Angles on an interval at which the height of functions is looked at.
HEIGHT_PROBES = 5

# From angles and the wanted error of the means of functions of sup norm 1: the means, shape (angles, functions), and
# the errors, shape (angles,); nan where nothing is known of them.
Means: TypeAlias = Callable[[Floats, float], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Expectations(ABC):
    """What a law makes of the functions of a basis: called like `Means`, it gives the means of all of them.

    Attributes
    ----------
    basis : Basis
    has_errors : bool
        Whether the errors are known.
    is_traced : bool
        Whether rays are traced, which takes about a millisecond an angle, fifty times as long as closed forms.
    """

    basis: Basis

    @property
    def has_errors(self) -> bool:
        return False

    @property
    def is_traced(self) -> bool:
        return False

    @abstractmethod
    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]: ...

    def are_costly(self) -> bool:
        """Whether a thousand angles take minutes."""
        return False

    def of(self, vectors: Floats) -> Means:
        """The same for functions with the coefficients ``vectors``, shape (n, k); errors are those of the worst."""
        height = height_of(self.basis, vectors)

        def means(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
            step = max(1, VALUES_AT_ONCE // self.basis.size)
            finer = tolerance / max(height, 1.0)
            parts = [self(theta[start : start + step], finer) for start in range(0, theta.size, step)]
            images = np.concatenate([image @ vectors for image, _ in parts])
            return images, height * np.concatenate([error for _, error in parts])

        return means


@dataclass(frozen=True)
class ByApply(Expectations):
    """By the operator of a law, whose errors are not known, at ``evaluations`` angles for each."""

    apply: Callable[[AngleFunction, ArrayLike], Floats]
    evaluations: int
    traced: bool = False

    @property
    def is_traced(self) -> bool:
        return self.traced

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        step = max(1, VALUES_AT_ONCE // (self.basis.size * max(self.evaluations, 1)))
        parts = [self.apply(self.basis.evaluate, theta[start : start + step]) for start in range(0, theta.size, step)]
        return np.concatenate(parts), np.full(theta.size, np.nan)


@dataclass(frozen=True)
class Unconditional(Expectations):
    """Those under sin(theta)/2 d theta, whatever the incoming angle."""

    @property
    def has_errors(self) -> bool:
        return True

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        return np.tile(self.basis.constant, (theta.size, 1)), np.zeros(theta.size)


@dataclass(frozen=True)
class Weighted(Expectations):
    """Those of a sum of laws with their weights."""

    terms: tuple[tuple[float, Expectations], ...]

    @property
    def has_errors(self) -> bool:
        return all(term.has_errors for _, term in self.terms)

    @property
    def is_traced(self) -> bool:
        return any(term.is_traced for _, term in self.terms)

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        return weighted_means(self.terms)(theta, tolerance)

    def are_costly(self) -> bool:
        return any(term.are_costly() for _, term in self.terms)

    def of(self, vectors: Floats) -> Means:
        return weighted_means([(weight, term.of(vectors)) for weight, term in self.terms])


@dataclass(frozen=True)
class Mirrored(Expectations):
    """Those of a law in the other frame, in a basis that is mirror-symmetric.

    Attributes
    ----------
    inner : Expectations
    adaptable : bool
        Whether the law is mirror-symmetric: then panels that are adapted to it are, and errors are known on them too.
    """

    inner: Expectations
    adaptable: bool

    @property
    def has_errors(self) -> bool:
        return self.adaptable and self.inner.has_errors

    @property
    def is_traced(self) -> bool:
        return self.inner.is_traced

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        images, errors = self.inner(theta, tolerance)
        return images @ reflection_matrix(self.basis), errors

    def are_costly(self) -> bool:
        return self.inner.are_costly()

    def of(self, vectors: Floats) -> Means:
        return self.inner.of(reflection_matrix(self.basis) @ vectors)


def weighted_means(terms: Sequence[tuple[float, Means]]) -> Means:
    """Means under a sum of laws with their weights, from those of its terms."""

    def means(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        found = [(weight, *term(theta, tolerance)) for weight, term in terms]
        images = sum((weight * image for weight, image, _ in found[1:]), start=found[0][0] * found[0][1])
        return images, np.asarray(sum(abs(weight) * error for weight, _, error in found))

    return means


def height_of(basis: Basis, vectors: Floats) -> float:
    """About the largest modulus of the functions with these coefficients, which polynomials often have at an end."""
    edges = basis.edges
    ends = np.concatenate((np.nextafter(edges[:-1], np.pi), np.nextafter(edges[1:], 0.0)))
    angle = np.append(gauss_rule(edges, HEIGHT_PROBES)[0], ends)
    if isinstance(basis, Legendre):
        angle = np.append(angle, gauss_rule(edges, basis.nodes_per_interval)[0])
    return float(np.abs(basis.evaluate(angle) @ vectors).max())


def means_of_basis(basis: Basis, nodes: Floats, weights: Floats, starts: NDArray[np.int64]) -> Floats:
    """The means of all functions over rows of weighted angles, shape (rows, size).

    Row k owns ``nodes[starts[k]:starts[k + 1]]``.
    """
    rows, size = len(starts) - 1, basis.size
    if basis.is_partition:
        owner = np.repeat(np.arange(rows), np.diff(starts))
        cell = owner * size + basis.index(nodes)
        mass = np.bincount(cell, weights=weights, minlength=rows * size).reshape(rows, size)
        return np.asarray(mass * basis.evaluate(0.5 * (basis.edges[1:] + basis.edges[:-1])).max(0))
    if isinstance(basis, Panels):
        panel, values = basis.local(nodes)
        cell = np.repeat(np.arange(rows), np.diff(starts)) * (size // (basis.degree + 1)) + panel
        columns = [
            np.bincount(cell, weights=weights * value, minlength=rows * size // (basis.degree + 1))
            for value in values.T
        ]
        return np.asarray(np.stack(columns, axis=1).reshape(rows, size), dtype=np.float64)
    found = np.empty((rows, size))
    most = max(1, VALUES_AT_ONCE // size)
    first = 0
    while first < rows:
        last = max(first + 1, int(np.searchsorted(starts, starts[first] + most, side="right")) - 1)
        part = slice(starts[first], starts[last])
        values = basis.evaluate(nodes[part]) * weights[part, None]
        found[first:last] = np.add.reduceat(values, starts[first:last] - starts[first], axis=0)
        first = last
    return found
