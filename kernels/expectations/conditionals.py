"""Conditional distributions of the outgoing angle at given incoming angles, as weighted angles with errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, numbers, positive_number, shaped, whole_number
from ...core.errors import InputError
from ...core.estimates import shown, text_of
from ...core.rounding import EPS
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

# Nodes at which a function on an interval is known, its ends among them, and those between, with weights, at which the
# polynomial through the known values is compared with it.
_KNOWN = np.cos(np.pi / 11.0 * np.arange(12.0))
_BETWEEN, BETWEEN_WEIGHTS = np.polynomial.legendre.leggauss(13)
SEEN, KNOWN, BETWEEN = np.concatenate((_KNOWN, _BETWEEN)), slice(0, 12), slice(12, None)
INTERPOLATION = np.linalg.solve(
    np.polynomial.legendre.legvander(_KNOWN, 11).T, np.polynomial.legendre.legvander(_BETWEEN, 11).T
)
# Gauss nodes that a factor of degree 11 needs beside the other factor.
NODES_OF_FACTOR = 6
# Halvings of an interval, to 1e-14; intervals halved at a time; error of an interval that is not halved, as a fraction
# of the tolerance; rounding of the comparison; distance of the nodes from 0 and pi, where functions may be infinite, as
# a fraction of the interval.
MOST_HALVINGS, MOST_INTERVALS, SMALL_PART, NOISE, END = 44, 1024, 1e-3, 16.0 * EPS, 1e-3
# First numbers of intervals of a density; where its integral is not 1 the next number, for peaks between the nodes.
FIRST_INTERVALS = (16, 256, 4096)
# Tolerance for the integral 1 of a density; it admits densities known to single precision.
INTEGRAL_TOLERANCE = 1e-7
# Rounding can make a zero weight or density negative by this fraction of the largest value.
NEGATIVE_TOLERANCE = 1e-12


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
            row, low, high, rest = resolved(values, np.arange(theta.size), marks, allowed)
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


def resolved(
    values: Callable[[NDArray[np.intp], Floats], Floats], owner: NDArray[np.intp], marks: Floats, tolerance: float
) -> tuple[NDArray[np.intp], Floats, Floats, Floats]:
    """Intervals on which functions are polynomials of degree 11, halved where they are not: owner, low, high, distance.

    There is one function for each owner; ``values(owner, angle)`` has the shape of ``angle``, (intervals, nodes). The
    distance is that in L^1, seen at other nodes, at most the tolerance in all. A larger one says that halving has not
    resolved the function there.
    """
    row, low, high = np.repeat(owner, marks.size - 1), *(np.tile(part, owner.size) for part in (marks[:-1], marks[1:]))
    done = []
    for halving in range(MOST_HALVINGS + 1):
        half = 0.5 * (high - low)
        least = np.where(low > 0.0, np.nextafter(low, np.pi), END * high)[:, None]
        most = np.where(high < np.pi, np.nextafter(high, 0.0), high - END * 2.0 * half)[:, None]
        value = values(row, np.clip(0.5 * (least + most) + 0.5 * (most - least) * SEEN, least, most))
        rest = half * (np.abs(value[:, BETWEEN] - value[:, KNOWN] @ INTERPOLATION) @ BETWEEN_WEIGHTS)
        allowed = np.maximum(tolerance * half / np.pi, SMALL_PART * tolerance)
        ready = rest <= np.maximum(allowed, NOISE * half * np.abs(value).max(axis=1))
        ready |= halving == MOST_HALVINGS or row.size > MOST_INTERVALS * owner.size
        done.append((row[ready], low[ready], high[ready], rest[ready]))
        middle = (low + half)[~ready]
        row, low, high = (
            np.repeat(row[~ready], 2),
            *(np.stack(both, axis=1).ravel() for both in ((low[~ready], middle), (middle, high[~ready]))),
        )
        if not row.size:
            break
    row, low, high, rest = (np.concatenate(parts) for parts in zip(*done, strict=True))
    return row, low, high, rest


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
