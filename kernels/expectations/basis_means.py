"""Conditional expectations theta -> E[e_j(Theta') | theta] of basis functions, with their errors if known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.long_runs import NUMBERS_AT_ONCE
from ..bases.basis import Basis
from ..bases.measure import gauss_rule
from ..bases.partitions import Panels
from ..bases.polynomials import legendre_moments

# Angles on an interval at which the largest absolute value of functions is sought.
HEIGHT_PROBES = 5

# A function of angles and the wanted error of expectations of functions of sup norm 1. It returns the expectations,
# shape (angles, functions), and their errors, shape (angles,), nan if unknown.
Means: TypeAlias = Callable[[Floats, float], tuple[Floats, Floats]]


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


def functions_of(basis: Basis) -> tuple[int, Floats]:
    """Degree of the functions of a basis as `Law.conditionals` counts it, and the edges between which they have it."""
    if basis.is_polynomial:
        return max(1, basis.size - 1), np.empty(0)
    degree = basis.degree if isinstance(basis, Panels) else 0 if basis.is_partition else basis.nodes_per_interval
    return degree, basis.edges[1:-1]


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
        panel, local = basis.positions(nodes)
        panels = size // (basis.degree + 1)
        cell = np.repeat(np.arange(rows), np.diff(starts)) * panels + panel
        moments = legendre_moments(local, weights, basis.degree, cell, rows * panels)
        return basis.of_legendre(moments.T.reshape(rows, panels, -1))
    found = np.empty((rows, size))
    most = max(1, NUMBERS_AT_ONCE // size)
    first = 0
    while first < rows:
        last = max(first + 1, int(np.searchsorted(starts, starts[first] + most, side="right")) - 1)
        part = slice(starts[first], starts[last])
        values = basis.evaluate(nodes[part]) * weights[part, None]
        found[first:last] = np.add.reduceat(values, starts[first:last] - starts[first], axis=0)
        first = last
    return found
