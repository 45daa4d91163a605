"""Bezier curves as walls of a billiard table: flights to them, tangents, curvatures and arc lengths on them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ..curves.bezier import Bezier
from ..curves.curvature import STILL

# Sine of the angle to the tangent up to which a path along a wall that bends towards it is not resolved.
GRAZE = 64.0 * EPS
# Parameter next to an end at which B' = 0, as where a handle is retracted: B differs from the end by rounding there.
NEXT_TO_END = 2.0**-26
# Parameters from which on a cusp is not one of an end.
INSIDE = 2.0**-20
# Limit on steps for a root; every fourth is a bisection, of which 53 suffice.
ROOT_STEPS = 220
# Halvings after which an interval of parameters has the width of rounding.
HALVINGS = 56
# First guesses of a projection onto the curve, and Newton steps from the nearest.
GUESSES, NEWTON_STEPS = 129, 8
# Local minima of the distance from a point along a cubic.
MOST_NEAREST = 3
# Steps where B' = 0 at an end, to which each step takes a third of the parameter.
STILL_STEPS = 48
# Panels and nodes of Gauss quadrature of the speed.
PANELS, NODES = 32, 12


def _values(coefficients: Floats, s: Floats) -> tuple[Floats, Floats, Floats]:
    """Return B, B' and B'' at parameters (...), shape (..., 2)."""
    a0, a1, a2, a3 = coefficients
    t = s[..., np.newaxis]
    return a0 + t * (a1 + t * (a2 + t * a3)), a1 + t * (2.0 * a2 + 3.0 * t * a3), 2.0 * a2 + 6.0 * t * a3


def _ends(curve: Bezier, slack: float = 0.0) -> tuple[float, float]:
    """Return the first and the last parameter with B' other than 0, beyond the ends by the length ``slack`` if so."""
    speed = np.hypot(*_values(curve.powers, np.array([0.0, 1.0]))[1].T)
    still = speed <= STILL * np.abs(curve.powers[1:]).sum()
    beyond = np.where(still, -NEXT_TO_END, slack / np.where(still, 1.0, speed)).tolist()
    return -beyond[0], 1.0 + beyond[1]


def cusp_of(curve: Bezier) -> float | None:
    """Return a parameter between the ends of a curve at which B' = 0, None if there is none."""
    turns = np.array([s for axis in (0, 1) for s in curve.turning_points(axis)])
    speed = np.hypot(*_values(curve.powers, turns)[1].T)
    inside = (turns > INSIDE) & (turns < 1.0 - INSIDE)
    return next(iter(turns[inside & (speed <= STILL * np.abs(curve.powers[1:]).sum())].tolist()), None)


def arrival(
    curve: Bezier, position: Floats, velocity: Floats, own: NDArray[np.bool_], slack: float, turn: float
) -> Floats:
    """Return the times (n,) at which moving points reach the curve, see `boundary.arrival`.

    The line of a flight meets the curve where a cubic of the parameter vanishes. From a point of the same curve the
    known root is divided out. Between its critical points the cubic is monotone, so that no root is missed.
    """
    a = curve.powers
    v = velocity[:, :2]
    cross = a[:, np.newaxis, 0] * v[:, 1] - a[:, np.newaxis, 1] * v[:, 0]
    c = np.array([cross[0] - (position[:, 0] * v[:, 1] - position[:, 1] * v[:, 0]), *cross[1:]])
    if np.any(own):
        s0 = parameter_of(curve, position)
        divided = np.array([c[1] + s0 * (c[2] + s0 * c[3]), c[2] + s0 * c[3], c[3], np.zeros_like(s0)])
        c = np.where(own, divided, c)
    roots = _roots(c, *_ends(curve, slack))
    point, tangent, _ = _values(a, roots)
    speed = np.hypot(tangent[..., 0], tangent[..., 1])
    normal = turn * np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1) / speed[..., np.newaxis]
    approach = -np.sum(normal * v[:, np.newaxis], axis=-1)
    time = np.sum((point - position[:, np.newaxis]) * v[:, np.newaxis], axis=-1) / np.sum(v**2, axis=1)[:, np.newaxis]
    with np.errstate(invalid="ignore"):
        fresh = np.where(own[:, np.newaxis], time > 0.0, time * approach >= -slack)
        hit = np.isfinite(roots) & (approach > 0.0) & fresh
    first = np.where(hit, np.maximum(time, 0.0), np.inf).min(axis=1)
    return np.asarray(np.minimum(first, _tangency(curve, position, v, own, slack, turn)))


def _tangency(curve: Bezier, position: Floats, v: Floats, own: NDArray[np.bool_], slack: float, turn: float) -> Floats:
    """Return the times (n,) at which paths run along a curve that bends towards them, inf for all others.

    A path from the curve does so where it begins, any other one from an end of the curve.
    """
    speed, found = np.hypot(v[:, 0], v[:, 1]), np.full(len(position), np.inf)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for end in _ends(curve):
            s = np.where(own, parameter_of(curve, position) if np.any(own) else end, end)
            point, first, second = _values(curve.powers, s)
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


def _roots(c: Floats, low: float, high: float) -> Floats:
    """Return the roots (n, 3) in [low, high] of cubics with the coefficients (4, n), nan where there are fewer."""
    # critical points, by the formula without cancellation
    half, ends = -c[2], np.array([low, high])
    with np.errstate(divide="ignore", invalid="ignore"):
        q = half + np.where(half >= 0.0, 1.0, -1.0) * np.sqrt(half * half - 3.0 * c[3] * c[1])
        critical = np.array([q / (3.0 * c[3]), c[1] / q])
    critical = np.where(np.isfinite(critical), np.clip(critical, low, high), high)
    knots = np.concatenate([np.full((1, c.shape[1]), ends[0]), np.sort(critical, axis=0),
                            np.full((1, c.shape[1]), ends[1])])  # fmt: skip

    def value(s: Floats) -> Floats:
        return np.asarray(c[0] + s * (c[1] + s * (c[2] + s * c[3])))

    left, right = knots[:-1], knots[1:]
    at_left, at_right = value(left), value(right)
    crossed = (at_left <= 0.0) != (at_right <= 0.0)
    s = 0.5 * (left + right)
    settled = ~crossed
    for step in range(ROOT_STEPS):
        at = value(s)
        same = (at <= 0.0) == (at_left <= 0.0)
        left, right = np.where(same, s, left), np.where(same, right, s)
        with np.errstate(divide="ignore", invalid="ignore"):
            change = at / (c[1] + s * (2.0 * c[2] + 3.0 * s * c[3]))
        settled |= (np.abs(change) <= EPS) | (right - left <= EPS)
        if np.all(settled):
            break
        newton, middle = s - change, 0.5 * (left + right)
        following = np.where((newton > left) & (newton < right), newton, middle) if step % 4 else middle
        s = np.where(settled, s, following)
    return np.asarray(np.where(crossed, s, np.nan).T)


def parameter_of(curve: Bezier, position: Floats) -> Floats:
    """Return the parameters (n,) in [0, 1] of the points of the curve nearest to points (n, 2) next to it."""
    a = curve.powers
    low, high = _ends(curve)
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


def touch(curve: Bezier, position: Floats) -> tuple[Floats, Floats, Floats]:
    """Return points (n, 2) moved onto the curve, unit tangents (n, 2) and curvatures (n,)."""
    point, first, second = _values(curve.powers, parameter_of(curve, position))
    speed = np.hypot(first[:, 0], first[:, 1])
    bend = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return point, first / speed[:, np.newaxis], bend / speed**3


def length_to(curve: Bezier, s: Floats) -> Floats:
    """Return the arc lengths (n,) from the start to parameters (n,)."""
    a = curve.powers
    nodes, weights = np.polynomial.legendre.leggauss(NODES)

    def integral(low: Floats, high: Floats) -> Floats:
        half = 0.5 * (high - low)
        at = low[:, np.newaxis] + half[:, np.newaxis] * (1.0 + nodes)
        return np.asarray(half * (np.hypot(*np.moveaxis(_values(a, at)[1], -1, 0)) @ weights))

    ends = np.linspace(0.0, 1.0, PANELS + 1)
    sums = np.concatenate([[0.0], np.cumsum(integral(ends[:-1], ends[1:]))])
    panel = np.clip((s * PANELS).astype(np.int64), 0, PANELS - 1)
    return sums[panel] + integral(ends[panel], s)


def point_at_length(curve: Bezier, length: Floats) -> Floats:
    """Return the points (n, 2) at arc lengths (n,) from the start."""
    return curve.point(inverted(lambda s: length_to(curve, s), length, 1.0))


def inverted(length_to: Callable[[Floats], Floats], length: Floats, most: float) -> Floats:
    """Return where in [0, ``most``] an increasing function takes these values (n,), to rounding."""
    low, high = np.zeros_like(length), np.full_like(length, most)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        short = length_to(middle) < length
        low, high = np.where(short, middle, low), np.where(short, high, middle)
    return np.asarray(0.5 * (low + high))


def signed_area(curve: Bezier) -> float:
    """Return (1/2) of the integral of x dy - y dx along the curve, a polynomial of degree 5 at most."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    point, first, _ = _values(curve.powers, 0.5 * (1.0 + nodes))
    return float(0.25 * weights @ (point[:, 0] * first[:, 1] - point[:, 1] * first[:, 0]))
