"""Conditional expectations theta -> E[e_j(Theta') | theta] of basis functions, with their errors if known."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..bases.basis import Basis
from ..bases.measure import gauss_rule
from ..bases.mirror import reflection_matrix
from ..bases.panels import Panels

# Incoming angle and tolerance at which a law is asked whether its errors are known.
PROBE, PROBE_TOLERANCE = np.array([1.0]), 1e-2
# Incoming angles at a time.
ANGLES_AT_ONCE = 512
# Limit on the values of functions in memory at a time.
VALUES_AT_ONCE = 2_000_000
# Angles on an interval at which the largest absolute value of functions is sought.
HEIGHT_PROBES = 5

# A function of angles and the wanted error of expectations of functions of sup norm 1. It returns the expectations,
# shape (angles, functions), and their errors, shape (angles,), nan if unknown.
Means: TypeAlias = Callable[[Floats, float], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Expectations(ABC):
    """The conditional expectations of all functions of a basis under a law; called like `Means`.

    Attributes
    ----------
    basis : Basis
    has_errors : bool
        Whether the errors are known.
    is_traced : bool
        Whether rays are traced. This takes about a millisecond per angle, fifty times as long as closed forms.
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
        """The expectations of functions with coefficients ``vectors``, shape (n, k), with errors for the worst one."""
        height = height_of(self.basis, vectors)

        def means(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
            step = max(1, VALUES_AT_ONCE // self.basis.size)
            finer = tolerance / max(height, 1.0)
            parts = [self(theta[start : start + step], finer) for start in range(0, theta.size, step)]
            images = np.concatenate([image @ vectors for image, _ in parts])
            return images, height * np.concatenate([error for _, error in parts])

        return means


@dataclass(frozen=True)
class ByConditionals(Expectations):
    """Expectations from the conditional distributions of a law, whose errors one incoming angle shows to be known.

    Densities count as without errors: cut at the edges of many panels, they take too long, and polynomials suffice.
    """

    conditionals: Callable[[Floats, float, int, Floats], Any]
    traced: bool = False
    density: bool = False

    @property
    def has_errors(self) -> bool:
        return not self.density and not np.isnan(self.conditionals(PROBE, PROBE_TOLERANCE, 0, np.empty(0)).error).any()

    @property
    def is_traced(self) -> bool:
        return self.traced

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        basis = self.basis
        edges, degree = np.empty(0), max(1, basis.size - 1)
        if not basis.is_polynomial:
            edges, degree = basis.edges[1:-1], 0 if basis.is_partition else basis.nodes_per_interval
            degree = basis.degree if isinstance(basis, Panels) else degree
        images, errors = [], []
        for start in range(0, theta.size, ANGLES_AT_ONCE):
            found = self.conditionals(theta[start : start + ANGLES_AT_ONCE], tolerance, degree, edges)
            images.append(found.in_basis(basis))
            errors.append(found.error)
        return np.concatenate(images), np.concatenate(errors)


@dataclass(frozen=True)
class Unconditional(Expectations):
    """Expectations under sin(theta)/2 d theta, the same for every incoming angle."""

    @property
    def has_errors(self) -> bool:
        return True

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        return np.tile(self.basis.constant, (theta.size, 1)), np.zeros(theta.size)


@dataclass(frozen=True)
class Weighted(Expectations):
    """Expectations under a weighted sum of laws."""

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
    """Expectations under a law in the other frame, in a mirror-symmetric basis.

    Attributes
    ----------
    inner : Expectations
    adaptable : bool
        Whether the law is mirror-symmetric. Panels adapted to it are then mirror-symmetric, so that errors are known.
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
    """The expectations under a weighted sum of laws, from the expectations under its terms."""

    def means(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        found = [(weight, *term(theta, tolerance)) for weight, term in terms]
        images = sum((weight * image for weight, image, _ in found[1:]), start=found[0][0] * found[0][1])
        return images, np.asarray(sum(abs(weight) * error for weight, _, error in found))

    return means


def height_of(basis: Basis, vectors: Floats) -> float:
    """Approximate largest absolute value of the functions with these coefficients, from nodes and ends of intervals."""
    edges = basis.edges
    ends = np.concatenate((np.nextafter(edges[:-1], np.pi), np.nextafter(edges[1:], 0.0)))
    angle = np.append(gauss_rule(edges, HEIGHT_PROBES)[0], ends)
    if basis.is_polynomial:
        angle = np.append(angle, gauss_rule(edges, basis.nodes_per_interval)[0])
    return float(np.abs(basis.evaluate(angle) @ vectors).max())


def means_of_basis(basis: Basis, nodes: Floats, weights: Floats, starts: NDArray[np.int64]) -> Floats:
    """The weighted sums of all basis functions over groups of angles, shape (groups, size).

    Group k consists of ``nodes[starts[k]:starts[k + 1]]`` with their weights.
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
