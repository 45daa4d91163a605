"""Conditional distributions of the outgoing angle as weighted angles with errors, and their means of functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, numbers, positive_number, shaped, whole_number
from ...core.errors import InputError
from ...core.estimates import shown, text_of
from ...core.given import Vectorised
from ...core.long_runs import NUMBERS_AT_ONCE
from ...core.rounding import EPS
from ..bases.angles import cell_among, clipped_inside, joined_lists
from ..bases.basis import AngleFunction, Basis, checked_basis
from ..bases.measure import gauss_on_intervals, gauss_rule
from ..bases.partitions import Panels
from ..bases.polynomials import legendre_moments
from .piecewise import halved

# Gauss nodes on an interval on which cos(s x / 2) and sin(s x / 2), -1 < x < 1, reach rounding, for s up to the limits.
STIFFNESS, NODES = np.array([0.2, 3.0, 16.0, 48.0, 120.0, 300.0]), np.array([4, 8, 16, 32, 64, 128, 256])
# Gauss nodes that the factor of degree 11 needs beside the other one.
NODES_OF_FACTOR = 6
# First numbers of intervals of a density; where its integral is not 1 the next number, for peaks between the nodes.
FIRST_INTERVALS = (16, 256, 4096)
# Tolerance for the integral 1 of a density; it admits densities known to single precision.
INTEGRAL_TOLERANCE = 1e-7
# Rounding can make a zero weight or density negative by this fraction of the largest value.
NEGATIVE_TOLERANCE = 1e-12
# Rounding of the sum of many weights; by this it puts angles past an end of (0, pi).
SUM_TOLERANCE, ROUNDED_ANGLE = 1e-9, 8.0 * EPS


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
    def of_atoms(cls, nodes: ArrayLike, weights: ArrayLike, error: ArrayLike) -> Conditionals:
        """The distributions of finitely many atoms each, from arrays of shape (angles, atoms).

        The error is 0 only if the law has no other outgoing angles. Nodes of a quadrature rule have the error of the
        rule; `of_density` finds it. An unknown error is nan.
        """
        nodes, weights = numbers("nodes", nodes), numbers("weights", weights)
        if nodes.ndim != 2 or nodes.shape != weights.shape:
            raise InputError(f"nodes, weights: expected one shape (angles, atoms), got {nodes.shape}, {weights.shape}")
        # what rounding makes of 0 is no atom; other negative weights are refused where a law returns them
        used = ~((weights <= 0.0) & (weights >= -NEGATIVE_TOLERANCE))
        starts = np.concatenate(([0], np.cumsum(np.count_nonzero(used, axis=1))))
        return cls(nodes[used], weights[used], starts, np.zeros(len(nodes)) + numbers("error", error))

    @classmethod
    def of_density(
        cls,
        density: Callable[[Floats, Floats], Floats],
        theta: ArrayLike,
        degree: int,
        edges: ArrayLike,
        breakpoints: ArrayLike | None = None,
        tolerance: float = 1e-12,
    ) -> Conditionals:
        """The distributions with a density p(theta, theta') with respect to d theta', with the error that they have.

        Parameters
        ----------
        density : callable
            ``density(theta, theta_out)`` of two arrays that broadcast, radians; returns the broadcast shape.
        theta, degree, edges, tolerance
            As in `Law.conditionals`. A density that is not resolved to the tolerance has a larger ``error``.
        breakpoints : array, optional
            Outgoing angles at which the density jumps or has a kink. Others are found by halving, which takes longer.

        Raises
        ------
        InputError
            If a value is negative or not finite, or if the density does not integrate to 1 within 1e-7.

        Notes
        -----
        Intervals are halved until the density agrees with a polynomial of degree 11 at other nodes. Their distance in
        L^1 bounds the error of the mean of a function of sup norm 1. Twice the distance of the integral from 1 is
        added, because a peak may lie between the nodes. The weights are divided by the integral.

        Examples
        --------
        >>> found = Conditionals.of_density(lambda theta, out: 0.5 * np.sin(out), [1.0], degree=2, edges=())
        >>> found.mean(lambda out: np.cos(out) ** 2).round(14).tolist(), bool(found.error[0] < 1e-13)
        ([0.33333333333333], True)
        """
        theta, edges = np.atleast_1d(angles("theta", theta)).ravel(), shaped("edges", edges, "n")
        degree, allowed = whole_number("degree", degree, 0), positive_number("tolerance", tolerance)
        known = np.append(edges, shaped("breakpoints", () if breakpoints is None else breakpoints, "n"))
        given = Vectorised(density, scalar=True)
        if not theta.size:
            return cls.of_atoms(np.empty((0, 1)), np.empty((0, 1)), 0.0)

        def values(row: NDArray[np.intp], angle: Floats) -> Floats:
            found = given(theta[row].reshape(-1, *(1,) * (angle.ndim - 1)), angle)
            bad = ~((found >= -NEGATIVE_TOLERANCE * max(1.0, float(found.max(initial=0.0)))) & (found < np.inf))
            if bad.any():
                at = tuple(np.argwhere(bad)[0])
                raise InputError(
                    f"density: expected finite values of at least 0, got {found[at]:g} at theta = "
                    f"{theta[row[at[0]]]:g}, theta' = {angle[at]:g}"
                )
            return found

        for intervals in FIRST_INTERVALS:
            marks = np.unique(np.clip(np.concatenate((np.linspace(0.0, np.pi, intervals + 1), known)), 0.0, np.pi))
            row, low, high, rest, _ = halved(values, np.arange(theta.size), marks, allowed)
            owner, nodes, weights = gauss_nodes(
                row, low, high, stiffness_between(edges, degree, low, high), NODES_OF_FACTOR
            )
            weights = weights * values(owner, nodes)
            total, error = (
                np.bincount(own, weights=part, minlength=theta.size) for own, part in ((owner, weights), (row, rest))
            )
            missing = np.abs(total - 1.0)
            if np.all(missing <= INTEGRAL_TOLERANCE + error):
                return cls.of_lists(owner, nodes, weights, error + 2.0 * missing)
        worst = int(np.argmax(missing - error))
        raise InputError(
            f"density: expected an integral of 1 over theta', got {total[worst]:.9g} at theta = {theta[worst]:.6g}; "
            "divide it by its integral, or give angles beside a peak narrower than 1e-4 as breakpoints"
        )

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

    def fault(self, number: int) -> tuple[int, str] | None:
        """What makes these no distributions on (0, pi) at ``number`` angles, and the index of the angle; else None."""
        nodes, weights, starts, error = self
        shapes = [np.shape(array) for array in self]
        if shapes[2:] != [(number + 1,), (number,)] or shapes[:2] != [(starts[-1],)] * 2 or np.any(np.diff(starts) < 1):
            return 0, f"at least one atom for each of {number} angles, got arrays of shapes {shapes}"
        total = np.add.reduceat(weights, starts[:-1])
        for expected, values, right in (
            ("an error of at least 0, or nan", error, ~(error < 0.0)),
            ("outgoing angles in (0, pi)", nodes, (nodes >= -ROUNDED_ANGLE) & (nodes <= np.pi + ROUNDED_ANGLE)),
            ("weights of at least 0", weights, weights >= -NEGATIVE_TOLERANCE),
            ("weights of sum 1 within the error", total, np.abs(total - 1.0) <= SUM_TOLERANCE + np.nan_to_num(error)),
        ):
            if not right.all():
                at = int(np.argmin(right))
                owner = at if values.size == number else int(np.searchsorted(starts, at, side="right")) - 1
                return owner, f"{expected}, got {float(values[at])!r}"
        return None

    def atoms(self) -> tuple[Floats, Floats]:
        """Nodes and weights, shape (angles, nodes); unused slots have weight 0 and the first node."""
        owner, slot = joined_lists(np.diff(self.starts))
        nodes = np.repeat(self.nodes[self.starts[:-1]], slot.max(initial=0) + 1).reshape(self.error.size, -1)
        weights = np.zeros(nodes.shape)
        nodes[owner, slot], weights[owner, slot] = self.nodes, self.weights
        return nodes, weights

    def mean(self, function: AngleFunction) -> Floats:
        """E[f(Theta') | theta] for every angle, shape ``(angles,) + extra`` if f has values ``theta.shape + extra``."""
        return self.sums(Vectorised.of(function)(self.nodes))

    def sums(self, values: Floats) -> Floats:
        """The weighted sums of values at the nodes, shape ``(angles,) + extra``."""
        weighted = self.weights.reshape((-1,) + (1,) * (values.ndim - 1)) * values
        return np.asarray(np.add.reduceat(weighted, self.starts[:-1], axis=0))

    def masses(self, edges: Floats) -> Floats:
        """The probabilities between neighbouring edges, which go from 0 to pi, shape (angles, cells)."""
        edges = shaped("edges", edges, "n")
        shape = self.error.size, edges.size - 1
        cell = self.owner * shape[1] + cell_among(edges, self.nodes)
        masses = np.bincount(cell, weights=self.weights, minlength=shape[0] * shape[1])
        return np.asarray(masses.reshape(shape), dtype=np.float64)

    def in_basis(self, basis: Basis) -> Floats:
        """The means of the functions of a basis, shape (angles, size)."""
        checked_basis(basis)
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
    owner: NDArray[np.intp], low: Floats, high: Floats, stiffness: Floats, more: int = 0
) -> tuple[NDArray[np.intp], Floats, Floats]:
    """Gauss rules on intervals, more nodes for stiffer integrands: the index of each interval's owner, nodes, weights.

    A trigonometric polynomial of degree d on an interval of width w has the stiffness d w, a polynomial 2 d. Another
    factor, a polynomial of degree 2 m - 1, takes ``more`` = m nodes.
    """
    number = NODES[np.searchsorted(STIFFNESS, stiffness)] + more
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


# Smallest step of a cumulative distribution.
SMALLEST_STEP = 1e-300


@dataclass(frozen=True)
class Distributions:
    """Cumulative distribution functions as polygons, one per row; jumps are vertical sides, densities slanted ones.

    Parameters
    ----------
    position, level : arrays, shape (rows, corners)
        Corners (x, F(x)), both non-decreasing along a row; F ends at 1.
    """

    position: Floats
    level: Floats

    @classmethod
    def of_atoms(cls, position: Floats, probability: Floats) -> Distributions:
        """Sums of point masses; both arrays of shape (rows, atoms), in any order."""
        order = np.argsort(position, axis=1, kind="stable")
        above = np.cumsum(np.take_along_axis(probability, order, axis=1), axis=1)
        above /= above[:, -1:]
        below = np.concatenate((np.zeros_like(above[:, :1]), above[:, :-1]), axis=1)
        level = np.stack((below, above), axis=-1).reshape(len(above), -1)
        return cls(np.repeat(np.take_along_axis(position, order, axis=1), 2, axis=1), level)

    @classmethod
    def of_parts(cls, edges: Floats, cumulative: Floats, position: Floats, probability: Floats) -> Distributions:
        """A continuous part, linear between edges, shape (rows, edges), plus point masses, shape (rows, atoms)."""
        if position.shape[1] == 0:
            corners = np.broadcast_to(edges, cumulative.shape)
            return cls(corners, cumulative / cumulative[:, -1:])
        rows, count = cumulative.shape
        cell = cell_among(edges, position)
        fraction = (position - edges[cell]) / (edges[cell + 1] - edges[cell])
        low = np.take_along_axis(cumulative, cell, axis=1)
        at_atom = low + fraction * (np.take_along_axis(cumulative, cell + 1, axis=1) - low)
        # every atom has two corners at the same position, before and after the jump
        corner = np.concatenate((np.broadcast_to(edges, (rows, count)), position, position), axis=1)
        base = np.concatenate((cumulative, at_atom, at_atom), axis=1)
        jump = np.concatenate((np.zeros((rows, count + position.shape[1])), probability), axis=1)
        order = np.argsort(corner, axis=1, kind="stable")
        level = np.take_along_axis(base, order, axis=1) + np.cumsum(np.take_along_axis(jump, order, axis=1), axis=1)
        level = np.maximum.accumulate(level, axis=1)
        return cls(np.take_along_axis(corner, order, axis=1), level / level[:, -1:])

    def quantile(self, fraction: Floats) -> Floats:
        """The inverse function at ``fraction``, shape (rows, any)."""
        rows, corners = self.level.shape
        # one search in all rows at once: row i is shifted to the values from 2 i to 2 i + 1
        shift = 2.0 * np.arange(rows)[:, None]
        index = np.searchsorted((self.level + shift).ravel(), (fraction + shift).ravel(), side="left").reshape(
            fraction.shape
        )
        right = np.clip(index - corners * np.arange(rows)[:, None], 1, corners - 1)
        low, high = (np.take_along_axis(self.level, right - back, axis=1) for back in (1, 0))
        left_end, right_end = (np.take_along_axis(self.position, right - back, axis=1) for back in (1, 0))
        part = np.clip((fraction - low) / np.maximum(high - low, SMALLEST_STEP), 0.0, 1.0)
        return np.asarray(left_end + part * (right_end - left_end))


# Nodes at a time for polynomials on panels.
NODES_AT_ONCE = 2**15
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
    found = np.empty((rows, size))
    # of polynomials on panels the nodes of a part fit into the processor's cache
    most = NODES_AT_ONCE if isinstance(basis, Panels) else max(1, NUMBERS_AT_ONCE // size)
    first = 0
    while first < rows:
        last = max(first + 1, int(np.searchsorted(starts, starts[first] + most, side="right")) - 1)
        part, own = slice(starts[first], starts[last]), starts[first : last + 1] - starts[first]
        if isinstance(basis, Panels):
            found[first:last] = _means_on_panels(basis, nodes[part], weights[part], own)
        else:
            found[first:last] = np.add.reduceat(basis.evaluate(nodes[part]) * weights[part, None], own[:-1], axis=0)
        first = last
    return found


def _means_on_panels(basis: Panels, nodes: Floats, weights: Floats, starts: NDArray[np.int64]) -> Floats:
    rows, panels = len(starts) - 1, basis.size // (basis.degree + 1)
    panel, local = basis.positions(nodes)
    cell = np.repeat(np.arange(rows), np.diff(starts)) * panels + panel
    moments = legendre_moments(local, weights, basis.degree, cell, rows * panels)
    return basis.of_legendre(moments.T.reshape(rows, panels, -1))
