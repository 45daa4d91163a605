"""Conditional distributions of three laws from their formulas in the entry point X, independent of the library's laws.

The formulas for triangular teeth of apex angle psi and circular arcs of half angle xi are in
docs/theory/closed-forms.md. `Row` is the distribution of the outgoing angle for one incoming angle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from asperity.core.checks import Floats

# Longer runs of hits along an arc carry less than 1e-11 of the flux and are counted with the longest runs.
MOST_HITS = 20_000
# Points at which distribution functions of arcs are compared.
POINTS = 4096


@dataclass(frozen=True)
class Atoms:
    """Outgoing angles with their probabilities."""

    angles: Floats
    weights: Floats

    def distribution(self, t: Floats) -> Floats:
        """P(theta' <= t), shape of ``t``."""
        return np.asarray((self.angles <= t[:, None]) @ self.weights)

    def mean(self) -> complex:
        """E exp(i theta')."""
        return complex(self.weights @ np.exp(1j * self.angles))

    def distance_to_lambert(self) -> float:
        """W_1 to sin(t)/2 dt: the integral of the difference of the distribution functions, in closed form."""
        order = np.argsort(self.angles)
        ends = np.concatenate([[0.0], self.angles[order], [np.pi]])
        level = np.concatenate([[0.0], np.cumsum(self.weights[order])]).clip(0.0, 1.0)
        crossing = np.clip(np.arccos(1.0 - 2.0 * level), ends[:-1], ends[1:])

        def excess(t: Floats) -> Floats:
            return 0.5 * (t - np.sin(t)) - level * t

        return float(np.sum(excess(ends[:-1]) + excess(ends[1:]) - 2.0 * excess(crossing)))


def tooth_row(theta: float, psi: float) -> Atoms:
    """Triangular teeth: all rays between two values of X at which the number of hits changes leave at the same
    angle."""
    here, there = np.cos(theta - 0.5 * psi), np.cos(theta + 0.5 * psi)
    hits = np.arange(-1.0, np.ceil(2.0 * np.pi / psi) + 2.0)
    cuts = np.concatenate([np.cos((hits + 0.5) * psi - theta), -np.cos((hits + 0.5) * psi - np.pi + theta), [0.0]])
    x = np.unique(np.concatenate([[0.0, 1.0], np.clip((cuts - here) / (there - here), 0.0, 1.0)]))
    middle = 0.5 * (x[1:] + x[:-1])
    c = (1.0 - middle) * here + middle * there
    angle = np.where(c > 0.0, theta, np.pi - theta)
    number = np.ceil((angle + np.arccos(np.abs(c))) / psi - 0.5)
    out = np.where(number % 2 == 0, np.pi + angle - number * psi, number * psi - angle)
    return Atoms(np.where(c > 0.0, out, np.pi - out), np.diff(x))


def crevice_row(theta: float, height_to_width: float) -> Atoms:
    """Rectangular teeth: specular or retroreflected."""
    turns, rest = np.divmod(2.0 * height_to_width / abs(np.tan(theta)), 1.0)
    specular = 1.0 - 0.5 * rest if turns % 2 == 0 else 0.5 + 0.5 * rest
    return Atoms(np.array([np.pi - theta, theta]), np.array([specular, 1.0 - specular]))


@dataclass(frozen=True)
class ArcRow:
    """The conditional distribution of a circular arc: on pieces [low, high] of delta, theta' = start - 2 hits delta.

    The density of delta is ``scale`` sin(delta).
    """

    low: Floats
    high: Floats
    start: Floats
    hits: Floats
    scale: float

    @classmethod
    def of(cls, theta: float, xi: float) -> ArcRow:
        """The conditional distribution at an incoming angle."""
        low, high = abs(theta - xi), np.pi - abs(np.pi - theta - xi)
        tiny = np.finfo(float).tiny
        # hits at the least and the greatest delta
        most = 2.0 + 0.5 * max((xi + theta) / max(low, tiny), (xi - theta + high) / max(np.pi - high, tiny))
        many = np.arange(int(min(most, MOST_HITS)))
        cuts = np.concatenate([(2.0 * many * np.pi - xi + theta) / (1 + 2 * many), (xi + theta) / (1 + 2 * many)])
        cuts = np.concatenate([[low, high, 0.5 * np.pi], cuts])  # the two formulas meet at a right angle
        ends = np.unique(np.clip(cuts, low, high))
        middle = 0.5 * (ends[1:] + ends[:-1])
        wide = middle >= 0.5 * np.pi
        turns = np.where(wide, (xi - theta + middle) / (np.pi - middle), (xi + theta - middle) / middle)
        hits = np.maximum(np.ceil(0.5 * turns), 1.0)
        start = theta - np.pi + np.where(wide, 2.0 * hits, 2.0) * np.pi
        return cls(ends[:-1], ends[1:], start, hits, 0.5 / (np.sin(theta) * np.sin(xi)))

    def distribution(self, t: Floats) -> Floats:
        """P(theta' <= t), shape of ``t``."""
        first = np.clip((self.start - t[:, None]) / (2.0 * self.hits), self.low, self.high)
        return np.asarray(self.scale * np.sum(np.cos(first) - np.cos(self.high), axis=1))

    def mean(self) -> complex:
        """E exp(i theta')."""
        total = 0.0 + 0.0j
        for sign, ends in ((1.0, self.high), (-1.0, self.low)):
            # exp(i (s - 2 n d)) sin d = (exp(i (s + (1 - 2 n) d)) - exp(i (s - (1 + 2 n) d))) / 2i
            one, two = 1.0 - 2.0 * self.hits, -1.0 - 2.0 * self.hits
            waves = np.exp(1j * (self.start + one * ends)) / one - np.exp(1j * (self.start + two * ends)) / two
            total += sign * complex(np.sum(waves)) / (2j * 1j)
        return self.scale * total

    def distance_to_lambert(self) -> float:
        """W_1 to sin(t)/2 dt, by the midpoint rule."""
        t = (np.arange(POINTS) + 0.5) * np.pi / POINTS
        return float(np.mean(np.abs(self.distribution(t) - 0.5 * (1.0 - np.cos(t)))) * np.pi)


def mean_over_angles(
    function: Callable[[float], Floats], low: float = 0.0, high: float = np.pi, tolerance: float = 1e-12
) -> tuple[Floats, float]:
    """The integral of a function of theta against sin(theta)/2 d theta, and its error, by adaptive Gauss-Kronrod."""
    from scipy.integrate import quad_vec

    value, error = quad_vec(
        lambda theta: 0.5 * np.sin(theta) * np.asarray(function(theta)), low, high,
        epsabs=tolerance, epsrel=0.0, limit=20_000, norm="max",
    )  # fmt: skip
    return value, float(error)
