"""Functions on (0, pi) as polynomials on intervals, which are halved where two rules show that they are none."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.given import Vectorised
from ..bases.angles import cell_among
from ..bases.basis import AngleFunction
from ..bases.measure import LARGEST_ANGLE, SINE, SMALLEST_ANGLE

# Chebyshev points at which functions are examined, the size of the coefficients that count, and the highest degree.
POINTS, SMALLEST_COEFFICIENT, MOST_DEGREE = 2048, 1e-14, 256
WIDTH = 0.5 * np.pi**2 / POINTS
# Chebyshev coefficients beyond pi d / 2 that a trigonometric polynomial of degree d has, and the lowest degree.
MORE_COEFFICIENTS, LEAST_DEGREE = 16, 8
# The polynomial on an interval agrees with the function at as many nodes, both ends among them, as it has coefficients.
# It is compared with the function at nodes between, which have weights.
DEGREE = 11
_KNOWN = np.cos(np.pi / DEGREE * np.arange(DEGREE + 1.0))
_BETWEEN, BETWEEN_WEIGHTS = np.polynomial.legendre.leggauss(DEGREE + 2)
SEEN, KNOWN, BETWEEN = np.concatenate((_KNOWN, _BETWEEN)), slice(0, DEGREE + 1), slice(DEGREE + 1, None)
COEFFICIENTS = np.linalg.inv(np.polynomial.legendre.legvander(_KNOWN, DEGREE))
INTERPOLATION = np.polynomial.legendre.legvander(_BETWEEN, DEGREE) @ COEFFICIENTS
# Halvings of an interval, to 1e-14; error of an interval that is not halved, as a fraction of the tolerance; rounding
# of the comparison; distance of the nodes from 0 and pi, where functions may be infinite, as a part of the interval.
MOST_HALVINGS, SMALL_PART, NOISE, END = 44, 1e-3, 2.0**-48, 1e-3
# First intervals of a function; intervals halved at a time; wanted distance from polynomials, and the error of a mean
# at which the function counts as unresolved, as fractions of the size.
INTERVALS, MOST_INTERVALS, RESOLUTION, TOLERANCE = 64, 1024, 1e-10, 1e-8
# The same of functions whose values take long: means of smooth functions under a law.
INTERVALS_OF_MEANS, MOST_OF_MEANS, RESOLUTION_OF_MEANS, TOLERANCE_OF_MEANS = 4, 128, 1e-7, 1e-4
# Intervals this narrow enclose jumps.
JUMP = 3e-14


class Piecewise(NamedTuple):
    """A function on (0, pi) whose means are wanted, and intervals on which it is a polynomial.

    Attributes
    ----------
    function : Vectorised
        The function, or polynomials in its place.
    degree, edges
        Its degree between the edges, or as a trigonometric polynomial if there are none; see `Law.conditionals`.
    distance : array
        Mean distance of the function from a polynomial on each of the intervals that the edges separate.
    size : float
        Mean absolute value under sin(theta)/2 d theta.
    first : array
        First edges for means of the function: those that it has, because isometries carry its features over.
    tolerance : float
        Largest error of a mean, as a fraction of the size.
    """

    function: Vectorised
    degree: int
    edges: Floats
    distance: Floats
    size: float
    first: Floats
    tolerance: float = TOLERANCE

    @classmethod
    def of(cls, function: AngleFunction, edges: Floats) -> Piecewise:
        """The function itself. Intervals are needed unless it is a trigonometric polynomial of low degree."""
        given = Vectorised.of(function)
        degree, size = _degree_and_size(given)
        if degree < MOST_DEGREE and not edges.size:
            return cls(given, degree, edges, np.zeros(1), size, np.linspace(0.0, np.pi, INTERVALS_OF_MEANS + 1))
        marks = np.append(np.linspace(0.0, np.pi, INTERVALS + 1), edges)
        low, high, rest, _ = _pieces(given, marks, RESOLUTION * size, MOST_INTERVALS)
        jumps = np.append(edges, high[high - low < JUMP])
        return cls(given, DEGREE, low[1:], rest / (high - low), size, np.concatenate((marks, jumps, np.pi - jumps)))

    @classmethod
    def mean_of(cls, before: Piecewise, function: AngleFunction, edges: Floats, most: int) -> Piecewise:
        """Polynomials in place of the mean of a function under a law; ``most`` intervals may be halved at a time."""
        tolerance, marks = RESOLUTION_OF_MEANS * before.size, np.append(before.first, edges)
        low, high, rest, coefficients = _pieces(function, marks, tolerance, most)
        first, last = _seen_ends(low, high)
        extra = np.shape(function(0.5 * (low[:1] + high[:1])))[1:]

        def interpolant(angle: Floats) -> Floats:
            cell = cell_among(np.append(low, np.pi), angle.ravel())
            local = (2.0 * angle.ravel() - first[cell] - last[cell]) / np.maximum(last - first, SMALLEST_ANGLE)[cell]
            powers = np.polynomial.legendre.legvander(np.clip(local, -1.0, 1.0), DEGREE)
            return np.asarray(np.einsum("nd,ndk->nk", powers, coefficients[cell])).reshape(angle.shape + extra)

        given = Vectorised(interpolant)
        return cls(given, DEGREE, low[1:], rest / (high - low), before.size, before.first, TOLERANCE_OF_MEANS)


def halved(
    values: Callable[[NDArray[np.intp], Floats], Floats],
    owner: NDArray[np.intp],
    marks: Floats,
    tolerance: float,
    most: int = MOST_INTERVALS,
) -> tuple[NDArray[np.intp], Floats, Floats, Floats, Floats]:
    """Intervals on which functions are polynomials of degree 11, halved where they are not.

    There is one function for each owner; ``values(owner, angle)`` has the shape of ``angle``, (intervals, nodes), and
    perhaps more axes. Returns the owner and both ends of each interval, the distance in L^1 that other nodes show, at
    most the tolerance in all unless halving has not resolved the function, and the Legendre coefficients.
    """
    row, low, high = np.repeat(owner, marks.size - 1), *(np.tile(part, owner.size) for part in (marks[:-1], marks[1:]))
    done = []
    for halving in range(MOST_HALVINGS + 1):
        half = 0.5 * (high - low)
        first, last = (end[:, None] for end in _seen_ends(low, high))
        angle = np.clip(0.5 * (first + last) + 0.5 * (last - first) * SEEN, first, last)
        value = values(row, angle).reshape(*angle.shape, -1)
        rest = half * (np.abs(value[:, BETWEEN] - INTERPOLATION @ value[:, KNOWN]).max(axis=2) @ BETWEEN_WEIGHTS)
        allowed = np.maximum(tolerance * half / np.pi, SMALL_PART * tolerance)
        # of the values, and of the angles
        rounding = NOISE * (half * np.abs(value).max(axis=(1, 2)) + 0.25 * high * np.ptp(value, axis=1).max(axis=1))
        ready = rest <= np.maximum(allowed, rounding)
        ready |= halving == MOST_HALVINGS or row.size > (most + marks.size) * owner.size
        done.append((row[ready], low[ready], high[ready], rest[ready], COEFFICIENTS @ value[ready, KNOWN]))
        halves = ((row, row), (low, low + half), (low + half, high))
        row, low, high = (np.concatenate((left[~ready], right[~ready])) for left, right in halves)
        if not row.size:
            break
    row, low, high, rest, coefficients = map(np.concatenate, zip(*done, strict=True))
    return row, low, high, rest, coefficients


def _seen_ends(low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """The first and last nodes of intervals: inside, where a function that jumps at an end has one value."""
    first = np.where(low > 0.0, np.nextafter(low, np.pi), END * high)
    return first, np.where(high < np.pi, np.nextafter(high, 0.0), np.minimum(high - END * (high - low), LARGEST_ANGLE))


def _pieces(
    function: AngleFunction, marks: Floats, tolerance: float, most: int
) -> tuple[Floats, Floats, Floats, Floats]:
    """The intervals of one function in increasing order: both ends, distances and coefficients."""
    edges = np.unique(np.clip(marks, 0.0, np.pi))
    found = halved(lambda _, angle: function(angle), np.zeros(1, dtype=np.intp), edges, tolerance, most)
    order = np.argsort(found[1])
    low, high, rest, coefficients = (part[order] for part in found[1:])
    return low, high, rest, coefficients


def _degree_and_size(function: Vectorised) -> tuple[int, float]:
    """The degree of a function as a trigonometric polynomial, to rounding, at most `MOST_DEGREE`; its mean size.

    Examples
    --------
    >>> [_degree_and_size(Vectorised(each))[0] for each in (np.cos, lambda theta: theta < 1.0)]
    [8, 256]
    """
    from scipy.fft import dct

    turn = (np.arange(POINTS) + 0.5) * (np.pi / POINTS)
    points = 0.5 * np.pi * (1.0 + np.cos(turn))
    values = function(points).reshape(POINTS, -1)
    coefficients = np.abs(dct(values, axis=0)).max(axis=1, initial=0.0) / POINTS
    counted = np.flatnonzero(
        ~(coefficients <= SMALLEST_COEFFICIENT * max(float(np.abs(values).max(initial=0.0)), 1e-300))
    )
    last = int(counted[-1]) if counted.size else 0
    degree = int(np.clip(np.ceil((last - MORE_COEFFICIENTS) * 2.0 / np.pi), LEAST_DEGREE, MOST_DEGREE))
    return degree, float(np.max(SINE.density(points) * np.sin(turn) @ np.abs(values), initial=0.0)) * WIDTH
