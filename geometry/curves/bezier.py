"""Quadratic and cubic Bezier curves; the quadratic ones are arcs of parabolas."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, number_between, positive_number, sequence, whole_number
from ...core.errors import WallError
from ...core.rounding import EPS
from .curve import Curve, Point, as_point, parameters, stretch_factors, uniform_parameters

# Distance (in the parameter) from the minimum of the speed to [0, 1] above which the closed formula for the length of
# a quadratic curve cancels. There 24 Gauss nodes are exact to rounding: the branch points are at least as far away.
FAR_MINIMUM = 2.0


@dataclass(frozen=True)
class Bezier(Curve):
    """A Bezier curve of degree 2 or 3.

    Parameters
    ----------
    control_points : sequence of 3 or 4 points
        The first and the last are the ends of the curve.

    Raises
    ------
    WallError
        If there are not 3 or 4 points, a coordinate is not finite, or all points coincide.

    Examples
    --------
    The parabola x = y^2 from (0, 0) to (1, -1):

    >>> parabola = Bezier([(0, 0), (0, -0.5), (1, -1)])
    >>> parabola.point(0.5).tolist()
    [0.25, -0.5]
    """

    control_points: tuple[Point, ...]
    start: Point = field(init=False, repr=False, compare=False)
    end: Point = field(init=False, repr=False, compare=False)
    rounding: float = field(default=0.0, init=False, repr=False, compare=False)

    def __init__(self, control_points: Sequence[ArrayLike]) -> None:
        given = sequence("Bezier control_points", control_points)
        if len(given) not in (3, 4):
            raise WallError(f"Bezier control_points: expected 3 or 4 points, got {len(given)}")
        points = tuple(as_point(f"Bezier control point {i}", p) for i, p in enumerate(given))
        if len(set(points)) == 1:
            raise WallError(f"Bezier control_points: expected points that differ, got {points[0]} only")
        object.__setattr__(self, "control_points", points)
        object.__setattr__(self, "start", points[0])
        object.__setattr__(self, "end", points[-1])
        object.__setattr__(self, "rounding", 0.0)

    @property
    def degree(self) -> int:
        """2 or 3."""
        return len(self.control_points) - 1

    @property
    def powers(self) -> Floats:
        """The coefficients of the curve as a cubic, lowest power first, shape (4, 2)."""
        p = np.array(self.control_points)
        bend = p[0] - 2.0 * p[1] + p[2]
        if self.degree == 2:
            return np.array([p[0], 2.0 * (p[1] - p[0]), bend, [0.0, 0.0]])
        return np.array([p[0], 3.0 * (p[1] - p[0]), 3.0 * bend, p[3] - p[0] + 3.0 * (p[1] - p[2])])

    def point(self, s: ArrayLike) -> Floats:
        """Return the points at the parameters ``s`` in [0, 1], shape ``s.shape + (2,)``."""
        return _bernstein(np.array(self.control_points), parameters(s))

    def _derivative(self) -> Floats:
        """Return the control points of the derivative."""
        return self.degree * np.diff(np.array(self.control_points), axis=0)

    def tangent(self, s: ArrayLike) -> Floats:
        """Return the unit tangents at the parameters ``s`` in [0, 1]; at a stationary point, one from 1e-6 inside."""
        s = parameters(s)
        velocity = _bernstein(self._derivative(), s)
        speed = np.hypot(velocity[..., 0], velocity[..., 1])
        still = speed <= 8.0 * EPS * float(np.abs(self._derivative()).max())
        if np.any(still):
            nudge = np.where(s < 0.5, 1e-6, -1e-6)
            inside = _bernstein(self._derivative(), np.where(still, s + nudge, s))
            velocity = np.where(still[..., np.newaxis], inside, velocity)
            speed = np.hypot(velocity[..., 0], velocity[..., 1])
        unit: Floats = velocity / speed[..., np.newaxis]
        return unit

    @property
    def length(self) -> float:
        """The arc length: a closed formula for degree 2, quadrature between the minima of the speed for degree 3."""
        return _quadratic_length(self._derivative()) if self.degree == 2 else self._cubic_length()

    def _cubic_length(self) -> float:
        from scipy.integrate import quad

        velocity = self._derivative()
        c0, c1, c2 = velocity[0], 2.0 * (velocity[1] - velocity[0]), velocity[0] - 2.0 * velocity[1] + velocity[2]
        # (d|v|^2/ds) / 2 = v . v' as a polynomial, highest power first; the speed is smooth between its minima
        slope = [2.0 * c2 @ c2, 3.0 * c1 @ c2, 2.0 * c0 @ c2 + c1 @ c1, c0 @ c1]
        breaks = [0.0, *_roots_inside(slope), 1.0]
        size = float(np.abs(velocity).max())

        def speed(s: float) -> float:
            v = c0 + s * (c1 + s * c2)
            return math.hypot(v[0], v[1]) / size

        parts = [
            quad(speed, low, high, epsabs=1e-15, epsrel=1e-13, limit=200, full_output=1)[0]
            for low, high in pairwise(breaks)
        ]
        return size * math.fsum(parts)

    def turning_points(self, axis: int) -> list[float]:
        """Return the parameters in (0, 1) where coordinate ``axis`` has zero derivative, ascending."""
        v = self._derivative()[:, whole_number("axis", axis, 0, most=1)]
        if self.degree == 2:
            return _roots_inside([v[1] - v[0], v[0]])
        return _roots_inside([v[0] - 2.0 * v[1] + v[2], 2.0 * (v[1] - v[0]), v[0]])

    def reversed(self) -> Bezier:
        """Return the curve in the opposite direction."""
        return Bezier(self.control_points[::-1])

    def stretched(self, x_factor: float, y_factor: float) -> Bezier:
        """Return the image under (x, y) -> (x_factor x, y_factor y)."""
        fx, fy = stretch_factors(x_factor, y_factor)
        return Bezier([(fx * x, fy * y) for x, y in self.control_points])

    def moved(self, dx: float, dy: float) -> Bezier:
        """Return the curve shifted by (dx, dy)."""
        dx, dy = as_point("moved", (dx, dy))
        return Bezier([(x + dx, y + dy) for x, y in self.control_points])

    def pinned(self, start: Point, end: Point) -> Bezier:
        """Return the curve with its first and last control points replaced."""
        return Bezier((start, *self.control_points[1:-1], end))

    def split(self, s: float) -> tuple[Bezier, Bezier]:
        """Return the parts before and after the parameter ``s`` in (0, 1) (de Casteljau)."""
        s = number_between("s", s, 0.0, 1.0, closed="low high")
        level = np.array(self.control_points)
        first, last = [level[0]], [level[-1]]
        while len(level) > 1:
            level = (1.0 - s) * level[:-1] + s * level[1:]
            first.append(level[0])
            last.append(level[-1])
        return Bezier(first), Bezier(last[::-1])

    def flattened(self, tolerance: float) -> Floats:
        """Return points on the curve, uniform in the parameter, whose polyline is within ``tolerance``."""
        bend = np.diff(np.array(self.control_points), n=2, axis=0)
        most = self.degree * (self.degree - 1) * float(np.hypot(bend[:, 0], bend[:, 1]).max())
        # a step h has an error of at most h^2 max|B''| / 8
        return self.point(uniform_parameters(math.sqrt(most / 8.0 / positive_number("tolerance", tolerance))))


def _bernstein(control: Floats, s: Floats) -> Floats:
    """Evaluate a Bezier curve by de Casteljau's algorithm, which is exact at both ends."""
    t = s[..., np.newaxis]
    level = [np.broadcast_to(p, (*s.shape, 2)) for p in control]
    while len(level) > 1:
        level = [(1.0 - t) * p + t * q for p, q in pairwise(level)]
    return np.array(level[0])


def _roots_inside(coefficients: Any) -> list[float]:
    """Return the real roots in (0, 1), ascending, of a polynomial given highest power first."""
    scale = max(abs(float(c)) for c in coefficients)
    if scale == 0.0:
        return []
    trimmed = [float(c) / scale if abs(c) > EPS * scale else 0.0 for c in coefficients]
    roots = np.roots(trimmed)
    # np.roots returns a double root as a pair with imaginary parts of about sqrt(eps)
    real = roots.real[np.abs(roots.imag) <= 4.0 * math.sqrt(EPS) * np.maximum(1.0, np.abs(roots))]
    return sorted(float(r) for r in real if 0.0 < r < 1.0)


def _quadratic_length(velocity: Floats) -> float:
    """Integrate the speed |v0 + c s| = sqrt(|c|^2 (s - m)^2 + h^2) over [0, 1]."""
    v0, change = velocity[0], velocity[1] - velocity[0]
    growth = float(np.hypot(*change))
    if growth == 0.0:
        return float(np.hypot(*v0))
    minimum = -float(v0 @ change) / growth**2
    height = abs(float(v0[0] * change[1] - v0[1] * change[0])) / growth
    if not -FAR_MINIMUM < minimum < 1.0 + FAR_MINIMUM:
        nodes, weights = np.polynomial.legendre.leggauss(24)
        s = 0.5 * (1.0 + nodes)[:, np.newaxis]
        v = v0 + s * change
        return float(0.5 * np.sum(weights * np.hypot(v[:, 0], v[:, 1])))

    def primitive(u: float) -> float:
        area = u * math.hypot(u, height)
        return area + (height * height * math.asinh(u / height) if height * height > 0.0 else 0.0)

    return (primitive(growth * (1.0 - minimum)) - primitive(-growth * minimum)) / (2.0 * growth)
