"""Conditional expectations theta -> E[e_j(Theta') | theta] of basis functions, as exact as each kind of law allows."""

from __future__ import annotations

from collections.abc import Callable
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..bases.assembly import cell_index
from ..bases.basis import Basis
from ..bases.legendre import Legendre
from ..bases.measure import gauss_rule
from ..bases.mirror import is_mirror_symmetric, reflection_matrix
from ..bases.panels import Panels
from ..laws.ideal import LambertianLaw
from ..laws.law import Combination, Law, SpecularFrame
from ..walls.circular_arc import CircularArcLaw, followed_hits
from ..walls.conditionals import WallRows, is_few
from ..walls.wall_law import WallLaw
from .arcs import ArcMeans, arc_images

# Values of functions held at a time.
VALUES_AT_ONCE = 2_000_000
# The first of the Gauss rules on a piece of a row that may be used for polynomials on panels.
PANEL_LEVEL = 2
# Angles on an interval at which the height of functions is looked at.
HEIGHT_PROBES = 5

# A look at some rows tells chaotic hollows: 31,000 and 71,000 flights a row against 260 to 7,400 of 28 other walls. One
# row stops at so many.
LOOK_ANGLES = np.linspace(0.13, 3.01, 12)
LOOK_TOLERANCE = 1e-3
MANY_FLIGHTS, MOST_FLIGHTS_OF_A_LOOK = 15_000, 400_000

# From angles and the wanted errors of the means of functions of sup norm 1: the images, shape (rows, size), and the
# errors, shape (rows,); nan where nothing is known of them.
BasisRows = Callable[[Floats, float], tuple[Floats, Floats]]


def integrates_panels(law: Law) -> bool:
    """Whether the rows of a law against functions on panels have errors that are known: others go through `apply`."""
    if isinstance(law, Combination):
        return all(integrates_panels(term) for _, term in law.terms)
    if isinstance(law, SpecularFrame):
        return law.mirror_symmetric is True and integrates_panels(law.law)
    if isinstance(law, WallLaw):
        return is_few(law.wall) if law.exact_law is None else integrates_panels(law.exact_law)
    return isinstance(law, (CircularArcLaw, LambertianLaw))


def traces_rows(law: Law) -> bool:
    """Whether `basis_rows` traces rays, which takes about a millisecond a row, fifty times as long as closed forms."""
    if isinstance(law, Combination):
        return any(traces_rows(term) for _, term in law.terms)
    if isinstance(law, SpecularFrame):
        return traces_rows(law.law)
    return isinstance(law, WallLaw) and law.exact_law is None


def has_costly_rows(law: Law) -> bool:
    """Whether rows have so many pieces that a thousand of them take minutes."""
    if isinstance(law, Combination):
        return any(has_costly_rows(term) for _, term in law.terms)
    if isinstance(law, SpecularFrame):
        return has_costly_rows(law.law)
    if not isinstance(law, WallLaw) or not traces_rows(law):
        return False
    rows = WallRows(law.wall, 1, np.empty(0), most_flights=MOST_FLIGHTS_OF_A_LOOK)(LOOK_ANGLES, LOOK_TOLERANCE)
    return rows.flights > MANY_FLIGHTS * LOOK_ANGLES.size


@singledispatch
def basis_rows(law: Law, basis: Basis) -> BasisRows:
    """What gives E[e_j(Theta') | theta] for all functions of the basis: of most laws by their own `apply`."""

    def rows(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        step = max(1, VALUES_AT_ONCE // (basis.size * max(law.fan_out, 1)))
        parts = [law.apply(basis.evaluate, theta[start : start + step]) for start in range(0, theta.size, step)]
        return np.concatenate(parts), np.full(theta.size, np.nan)

    return rows


@basis_rows.register
def _(law: LambertianLaw, basis: Basis) -> BasisRows:
    return lambda theta, tolerance: (np.tile(basis.constant, (theta.size, 1)), np.zeros(theta.size))


@basis_rows.register
def _(law: CircularArcLaw, basis: Basis) -> BasisRows:
    if not isinstance(basis, Panels):
        return basis_rows.dispatch(Law)(law, basis)
    return lambda theta, tolerance: arc_images(law, basis, theta, followed_hits(tolerance))


@basis_rows.register
def _(law: Combination, basis: Basis) -> BasisRows:
    return weighted_rows([(weight, basis_rows(term, basis)) for weight, term in law.terms_checked()])


@basis_rows.register
def _(law: SpecularFrame, basis: Basis) -> BasisRows:
    if not is_mirror_symmetric(basis):
        return basis_rows.dispatch(Law)(law, basis)
    inner, flip = basis_rows(law.law, basis), reflection_matrix(basis)

    def rows(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        images, errors = inner(theta, tolerance)
        return images @ flip, errors

    return rows


@basis_rows.register
def _(law: WallLaw, basis: Basis) -> BasisRows:
    if law.exact_law is not None:
        return basis_rows(law.exact_law, basis)
    if not is_few(law.wall):
        return basis_rows.dispatch(Law)(law, basis)
    inside, degree, level = np.empty(0), max(1, basis.size - 1), 0
    if not isinstance(basis, Legendre):
        inside = basis.edges[1:-1]
        degree, level = (0, 0) if basis.is_partition else (1, PANEL_LEVEL)
    march = WallRows(law.wall, degree, inside, level)

    def rows(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        found = march(theta, tolerance)
        return means_of_basis(basis, found.nodes, found.weights, found.starts), found.error + 2.0 * found.lost

    return rows


def height_of(basis: Basis, vectors: Floats) -> float:
    """About the largest modulus of the functions with these coefficients, which polynomials often have at an end."""
    edges = basis.edges
    ends = np.concatenate((np.nextafter(edges[:-1], np.pi), np.nextafter(edges[1:], 0.0)))
    angle = np.append(gauss_rule(edges, HEIGHT_PROBES)[0], ends)
    if isinstance(basis, Legendre):
        angle = np.append(angle, gauss_rule(edges, basis.nodes_per_interval)[0])
    return float(np.abs(basis.evaluate(angle) @ vectors).max())


@singledispatch
def function_rows(law: Law, basis: Basis, vectors: Floats) -> BasisRows:
    """As `basis_rows` for functions with the coefficients ``vectors``, shape (n, k); errors are those of the worst."""
    rows = basis_rows(law, basis)
    height = height_of(basis, vectors)

    def means(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        step = max(1, VALUES_AT_ONCE // basis.size)
        finer = tolerance / max(height, 1.0)
        parts = [rows(theta[start : start + step], finer) for start in range(0, theta.size, step)]
        images = np.concatenate([image @ vectors for image, _ in parts])
        return images, height * np.concatenate([error for _, error in parts])

    return means


@function_rows.register
def _(law: CircularArcLaw, basis: Basis, vectors: Floats) -> BasisRows:
    if not isinstance(basis, Panels):
        return function_rows.dispatch(Law)(law, basis, vectors)
    means = ArcMeans(law, basis, vectors)
    return lambda theta, tolerance: means(theta, followed_hits(tolerance))


@function_rows.register
def _(law: Combination, basis: Basis, vectors: Floats) -> BasisRows:
    return weighted_rows([(weight, function_rows(term, basis, vectors)) for weight, term in law.terms_checked()])


@function_rows.register
def _(law: SpecularFrame, basis: Basis, vectors: Floats) -> BasisRows:
    if not is_mirror_symmetric(basis):
        return function_rows.dispatch(Law)(law, basis, vectors)
    return function_rows(law.law, basis, reflection_matrix(basis) @ vectors)


@function_rows.register
def _(law: WallLaw, basis: Basis, vectors: Floats) -> BasisRows:
    if law.exact_law is not None:
        return function_rows(law.exact_law, basis, vectors)
    return function_rows.dispatch(Law)(law, basis, vectors)


def weighted_rows(terms: list[tuple[float, BasisRows]]) -> BasisRows:
    """Rows of a sum of laws with their weights, from those of its terms."""

    def rows(theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        found = [(weight, *term(theta, tolerance)) for weight, term in terms]
        images = sum((weight * image for weight, image, _ in found[1:]), start=found[0][0] * found[0][1])
        return images, np.asarray(sum(abs(weight) * error for weight, _, error in found))

    return rows


def means_of_basis(basis: Basis, nodes: Floats, weights: Floats, starts: NDArray[np.int64]) -> Floats:
    """The means of all functions over rows of weighted angles, shape (rows, size).

    Row k owns ``nodes[starts[k]:starts[k + 1]]``.
    """
    rows, size = len(starts) - 1, basis.size
    if basis.is_partition:
        owner = np.repeat(np.arange(rows), np.diff(starts))
        cell = owner * size + cell_index(basis, nodes)
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
