"""Quadratic and cubic Bezier curves; the quadratic ones are arcs of parabolas."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, number_between, positive_number, sequence, whole_number
from ...core.errors import WallError
from ...core.rounding import EPS
from . import columns as c
from .curve import (
    ROUNDED,
    Bools,
    Curve,
    Point,
    Table,
    as_point,
    check_keys,
    cubic_roots,
    inverted,
    parameters,
    points_of,
    stretch_factors,
)

# Distance (in the parameter) from the minimum of the speed to [0, 1] above which the closed formula for the length of
# a quadratic curve cancels. There 24 Gauss nodes are exact to rounding: the branch points are at least as far away.
FAR_MINIMUM = 2.0
# Relative errors of a Bezier piece's largest curvature that are tried, and limit on the intervals of a check.
WIDTHS, MOST_INTERVALS = tuple(10.0**-k for k in range(12, 1, -1)), 2000
# Speed, relative to the largest, below which b' = 0: a double zero of |b'|^2 is found to the root of a rounding error.
STILL = 8.0 * math.sqrt(EPS)
# Sine of the angle to the tangent up to which a path along a wall that bends towards it is not resolved.
GRAZE = 64.0 * EPS
# Parameter next to an end at which B' = 0, as where a handle is retracted: B differs from the end by rounding there.
NEXT_TO_END = 2.0**-26
# Parameters from which on a cusp is not one of an end.
INSIDE = 2.0**-20
# First guesses of a projection onto the curve, and Newton steps from the nearest.
GUESSES, NEWTON_STEPS = 129, 8
# Local minima of the distance from a point along a cubic.
MOST_NEAREST = 3
# Steps where B' = 0 at an end, to which each step takes a third of the parameter.
STILL_STEPS = 48
# Panels and nodes of Gauss quadrature of the speed.
PANELS, NODES = 32, 12


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

    kind = "bezier"
    table, columns, meets_disks = 1, c.BEZIER_COLUMNS, True

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
        v = self._derivative()[:, whole_number("axis", axis, 0, most=1)]
        if self.degree == 2:
            return _roots_inside([v[1] - v[0], v[0]])
        return _roots_inside([v[0] - 2.0 * v[1] + v[2], 2.0 * (v[1] - v[0]), v[0]])

    def reversed(self) -> Bezier:
        """Return the curve in the opposite direction."""
        return Bezier(self.control_points[::-1])

    def stretched(self, x_factor: float, y_factor: float) -> Bezier:
        fx, fy = stretch_factors(x_factor, y_factor)
        return Bezier([(fx * x, fy * y) for x, y in self.control_points])

    def moved(self, dx: float, dy: float) -> Bezier:
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
        return self.point(self.steps(math.sqrt(most / 8.0 / positive_number("tolerance", tolerance))))

    def curvature(self, s: float) -> float:
        velocity, cross, _ = _polynomials(self)
        vx, vy = (float(np.polynomial.polynomial.polyval(s, part)) for part in velocity.T)
        speed = math.hypot(vx, vy)
        if speed <= STILL * float(np.abs(velocity).sum()):
            return math.inf
        return float(np.polynomial.polynomial.polyval(s, cross)) / speed**3

    def largest_curvature(self) -> tuple[float, float]:
        """At the critical points, and the least of the tried errors that holds."""
        poly = np.polynomial.polynomial
        _, cross, square = _polynomials(self)
        critical = poly.polysub(
            2.0 * poly.polymul(poly.polyder(cross), square), 3.0 * poly.polymul(cross, poly.polyder(square))
        )
        # where b' = 0 the speed is least
        roots = [poly.polyroots(np.trim_zeros(q, "b")) for q in (critical, poly.polyder(square)) if np.any(q)]
        inside = [float(s) for s in np.concatenate([[0.0, 1.0], *(np.real(r) for r in roots)]) if 0.0 <= s <= 1.0]
        found = max(abs(self.curvature(s)) for s in inside)
        if found in (0.0, math.inf):
            return found, 0.0
        cube = poly.polymul(square, poly.polymul(square, square))
        turning = poly.polymul(cross, cross)
        for width in WIDTHS:
            if _is_positive(poly.polysub((found * (1.0 + width)) ** 2 * cube, turning)):
                return found, width * found
        return found, math.inf

    def joined(self, after: Curve, tolerance: float) -> Bezier | None:
        if not isinstance(after, Bezier) or self.degree != after.degree:
            return None
        first, second = (np.array(part.control_points) for part in (self, after))
        # each distance is proportional to the derivative at the joint times the part's fraction of the parameter
        left, right = math.dist(first[-1], first[-2]), math.dist(second[1], second[0])
        if left == 0.0 or right == 0.0:
            return None
        fraction = left / (left + right)
        inner = [first[0] + (first[1] - first[0]) / fraction]
        if self.degree == 3:
            inner.append(second[-1] + (second[-2] - second[-1]) / (1.0 - fraction))
        whole = Bezier([self.start, *(tuple(p) for p in inner), after.end])
        return whole if whole.has_parts(self, after, fraction, tolerance) else None

    def to_table(self) -> Table:
        return {"kind": self.kind, "control_points": [list(p) for p in self.control_points]}

    @classmethod
    def from_table(cls, table: Table) -> Bezier:
        check_keys(table, {"kind", "control_points"}, set())
        return cls(points_of("control_points", table["control_points"]))

    def row(self, ends: Mapping[int, float]) -> Floats:
        self = self.pinned((ends[c.START_X], ends[c.START_Y]), (ends[c.END_X], ends[c.END_Y]))
        points, powers = np.array(self.control_points), self.powers[1:]
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        reach = float(np.hypot(*(points - middle).T).max()) + c.NEARBY_MARGIN * float(np.abs(powers).sum())
        columns = {c.MIDDLE_X: middle[0], c.MIDDLE_Y: middle[1], c.REACH: reach}
        return c.row_of(c.BEZIER_COLUMNS, {**ends, **dict(enumerate(powers.ravel(), c.X1)), **columns})

    @staticmethod
    def heights(rows: Floats) -> Floats:
        """The Bernstein coefficients."""
        c0, c1, c2, c3 = rows[:, (c.START_Y, c.Y1, c.Y2, c.Y3)].T
        return np.column_stack([c0, c0 + c1 / 3, c0 + (2 * c1 + c2) / 3, c0 + c1 + c2 + c3])

    @staticmethod
    def goes_in_waves(rows: Floats) -> bool:
        return True

    def hull(self, start: Point, end: Point) -> list[Point]:
        return [start, *list(self.control_points[1:-1])[:2], *[end] * (5 - len(self.control_points))]

    def cusp(self) -> float | None:
        turns = np.array([s for axis in (0, 1) for s in self.turning_points(axis)])
        speed = np.hypot(*_values(self.powers, turns)[1].T)
        inside = (turns > INSIDE) & (turns < 1.0 - INSIDE)
        return next(iter(turns[inside & (speed <= STILL * np.abs(self.powers[1:]).sum())].tolist()), None)

    def _ends(self, slack: float = 0.0) -> tuple[float, float]:
        """Return the first and the last parameter with B' other than 0, beyond the ends by ``slack`` if so."""
        speed = np.hypot(*_values(self.powers, np.array([0.0, 1.0]))[1].T)
        still = speed <= STILL * np.abs(self.powers[1:]).sum()
        beyond = np.where(still, -NEXT_TO_END, slack / np.where(still, 1.0, speed)).tolist()
        return -beyond[0], 1.0 + beyond[1]

    @property
    def signed_area(self) -> float:
        """A polynomial of degree 5 at most."""
        nodes, weights = np.polynomial.legendre.leggauss(3)
        point, first, _ = _values(self.powers, 0.5 * (1.0 + nodes))
        return float(0.25 * weights @ (point[:, 0] * first[:, 1] - point[:, 1] * first[:, 0]))

    def arrival(self, position: Floats, velocity: Floats, own: Bools, slack: float, front: bool = True) -> Floats:
        """See `Curve`. The line of a flight meets the curve where a cubic of the parameter vanishes.

        From a point of the same curve the known root is divided out. Between its critical points the cubic is monotone,
        so that no root is missed.
        """
        turn = 1.0 if front else -1.0
        a = self.powers
        v = velocity[:, :2]
        cross = a[:, np.newaxis, 0] * v[:, 1] - a[:, np.newaxis, 1] * v[:, 0]
        c = np.array([cross[0] - (position[:, 0] * v[:, 1] - position[:, 1] * v[:, 0]), *cross[1:]])
        if np.any(own):
            s0 = self.parameter_of(position)
            divided = np.array([c[1] + s0 * (c[2] + s0 * c[3]), c[2] + s0 * c[3], c[3], np.zeros_like(s0)])
            c = np.where(own, divided, c)
        roots = cubic_roots(c, *self._ends(slack))
        point, tangent, _ = _values(a, roots)
        speed = np.hypot(tangent[..., 0], tangent[..., 1])
        normal = turn * np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1) / speed[..., np.newaxis]
        approach = -np.sum(normal * v[:, np.newaxis], axis=-1)
        along = np.sum((point - position[:, np.newaxis]) * v[:, np.newaxis], axis=-1)
        time = along / np.sum(v**2, axis=1)[:, np.newaxis]
        with np.errstate(invalid="ignore"):
            fresh = np.where(own[:, np.newaxis], time > 0.0, time * approach >= -slack)
            hit = np.isfinite(roots) & (approach > 0.0) & fresh
        first = np.where(hit, np.maximum(time, 0.0), np.inf).min(axis=1)
        return np.asarray(np.minimum(first, self._tangency(position, v, own, slack, turn)))

    def _tangency(self, position: Floats, v: Floats, own: Bools, slack: float, turn: float) -> Floats:
        """Return the times (n,) at which paths run along a curve that bends towards them, inf for all others."""
        speed, found = np.hypot(v[:, 0], v[:, 1]), np.full(len(position), np.inf)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for end in self._ends():
                s = np.where(own, self.parameter_of(position) if np.any(own) else end, end)
                point, first, second = _values(self.powers, s)
                size = np.hypot(first[:, 0], first[:, 1])
                up = turn * (first[:, 0] * v[:, 1] - first[:, 1] * v[:, 0]) / size
                bends = turn * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) > 0.0
                off = point - position
                time = np.where(own, 0.0, np.sum(off * v, axis=1) / speed**2)
                aside = np.where(own, 0.0, np.abs(off[:, 0] * v[:, 1] - off[:, 1] * v[:, 0]) / speed)
                onward = own | ((np.sum(first * v, axis=1) > 0.0) == (end < 0.5))
                near = bends & onward & (aside <= slack) & (time * speed >= -slack)
                along = near & np.where(own, up <= GRAZE * speed, np.abs(up) <= GRAZE * speed)
                found = np.where(along, np.minimum(found, np.maximum(time, 0.0)), found)
        return found

    def parameter_of(self, position: Floats) -> Floats:
        """Return the parameters (n,) in [0, 1] of the nearest points to points (n, 2) next to the curve."""
        a = self.powers
        low, high = self._ends()
        guesses = np.linspace(0.0, 1.0, GUESSES)
        guesses = guesses[(guesses >= low) & (guesses <= high)]
        away = np.hypot(*np.moveaxis(position[:, np.newaxis] - _values(a, guesses)[0], -1, 0))
        # the nearest guess may lie on another branch of a fold than the nearest point
        beside = np.pad(away, ((0, 0), (1, 1)), constant_values=np.inf)
        away = np.where(away <= np.minimum(beside[:, :-2], beside[:, 2:]), away, np.inf)
        chosen = np.argsort(away, axis=1)[:, :MOST_NEAREST]
        s, position = guesses[chosen], position[:, np.newaxis]
        for _ in range(NEWTON_STEPS if len(guesses) == GUESSES else STILL_STEPS):
            point, first, second = _values(a, s)
            off = point - position
            slope = np.sum(first * first + off * second, axis=-1)
            slope = np.where(slope > 0.0, slope, np.sum(first * first, axis=-1))
            s = np.clip(s - np.sum(off * first, axis=-1) / slope, low, high)
        reached = np.hypot(*np.moveaxis(_values(a, s)[0] - position, -1, 0))
        reached[np.isinf(np.take_along_axis(away, chosen, axis=1))] = np.inf
        return np.take_along_axis(s, np.argmin(reached, axis=1)[:, np.newaxis], axis=1)[:, 0]

    def touch(self, position: Floats) -> tuple[Floats, Floats, Floats]:
        point, first, second = _values(self.powers, self.parameter_of(position))
        speed = np.hypot(first[:, 0], first[:, 1])
        bend = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        return point, first / speed[:, np.newaxis], bend / speed**3

    def length_to(self, position: Floats) -> Floats:
        return self._length_before(self.parameter_of(position))

    def _length_before(self, s: Floats) -> Floats:
        """Return the arc lengths (n,) from the start to parameters (n,)."""
        a = self.powers
        nodes, weights = np.polynomial.legendre.leggauss(NODES)

        def integral(low: Floats, high: Floats) -> Floats:
            half = 0.5 * (high - low)
            at = low[:, np.newaxis] + half[:, np.newaxis] * (1.0 + nodes)
            return np.asarray(half * (np.hypot(*np.moveaxis(_values(a, at)[1], -1, 0)) @ weights))

        ends = np.linspace(0.0, 1.0, PANELS + 1)
        sums = np.concatenate([[0.0], np.cumsum(integral(ends[:-1], ends[1:]))])
        panel = np.clip((s * PANELS).astype(np.int64), 0, PANELS - 1)
        return sums[panel] + integral(ends[panel], s)

    def point_at_length(self, length: Floats) -> Floats:
        return self.point(inverted(self._length_before, length, 1.0))


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


def _polynomials(piece: Bezier) -> tuple[Floats, Floats, Floats]:
    """Return b', b' x b'' and |b'|^2 as polynomials, lowest power first; b' has shape (degree, 2)."""
    velocity: Floats = (piece.powers[1:] * [[1.0], [2.0], [3.0]])[: piece.degree]
    vx, vy = velocity.T
    product = np.polynomial.polynomial.polymul
    bend = np.polynomial.polynomial.polyder(velocity)
    cross: Floats = np.polynomial.polynomial.polysub(product(vx, bend[:, 1]), product(vy, bend[:, 0]))
    return velocity, cross, np.polynomial.polynomial.polyadd(product(vx, vx), product(vy, vy))


def _is_positive(polynomial: Floats) -> bool:
    """Return whether a polynomial is positive on [0, 1], to rounding: by its Bernstein coefficients."""
    degree = len(polynomial) - 1
    room = ROUNDED * float(np.abs(polynomial).sum())
    todo = [
        np.array([sum(polynomial[k] * comb(i, k) / comb(degree, k) for k in range(i + 1)) for i in range(degree + 1)])
    ]
    for _ in range(MOST_INTERVALS):
        if not todo:
            return True
        level = todo.pop()
        if level.min() > room:
            continue
        if min(level[0], level[-1]) <= room:
            return False
        # de Casteljau's halves
        first, last = [level[0]], [level[-1]]
        while len(level) > 1:
            level = 0.5 * (level[:-1] + level[1:])
            first.append(level[0])
            last.append(level[-1])
        todo += [np.array(first), np.array(last[::-1])]
    return False


def _values(coefficients: Floats, s: Floats) -> tuple[Floats, Floats, Floats]:
    """Return B, B' and B'' at parameters (...), shape (..., 2)."""
    a0, a1, a2, a3 = coefficients
    t = s[..., np.newaxis]
    return a0 + t * (a1 + t * (a2 + t * a3)), a1 + t * (2.0 * a2 + 3.0 * t * a3), 2.0 * a2 + 6.0 * t * a3
