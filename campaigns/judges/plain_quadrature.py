"""Means, matrices, distances and gaps of laws that are given by a density and by maps of the angle.

All integrals are composite Gauss rules between angles where the integrand may not be smooth, finer towards these, with
the difference of two of them as the error. numpy only.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]
# Nodes on a panel of the finer and the rougher rule, the widest panel, and the ratio of panels towards an end.
NODES, WIDEST, RATIO = (14, 10), 0.08, 0.2
ROUNDING = 1e-13


def rule(breaks: Iterable[float], nodes: int, levels: int = 12, widest: float = WIDEST) -> tuple[Array, Array]:
    """Angles and weights of d theta on (0, pi)."""
    ends = np.unique(np.clip([0.0, np.pi, *breaks], 0.0, np.pi))
    near = RATIO ** np.arange(levels, 0, -1)
    near = np.concatenate([[0.0], near, 1.0 - near[::-1], [1.0]])
    marks = np.unique(np.concatenate([low + (high - low) * near for low, high in pairwise(ends)]))
    parts = [np.linspace(low, high, 1 + int((high - low) / widest), endpoint=False) for low, high in pairwise(marks)]
    cuts = np.concatenate([*parts, [np.pi]])
    x, w = np.polynomial.legendre.leggauss(nodes)
    half = 0.5 * np.diff(cuts)[:, None]
    return (cuts[:-1, None] + half * (1.0 + x)).ravel(), (half * w).ravel()


def averaged(function: Callable[[Array], Array], breaks: Iterable[float] = ()) -> float:
    """The mean of a function for sin(theta)/2 d theta."""
    angle, weight = rule(breaks, NODES[0])
    return float(weight @ (0.5 * np.sin(angle) * function(angle)))


@dataclass(frozen=True)
class Known:
    """A number or array, and a bound of its error."""

    value: Any
    error: float


def by_two_rules(computed: Callable[[int], Any]) -> Known:
    """What a computation gives with the finer rule, and its distance from that with the rougher one."""
    fine, rough = (np.asarray(computed(nodes)) for nodes in NODES)
    scale = max(1.0, float(np.linalg.norm(fine)))
    return Known(fine, 2.0 * float(np.linalg.norm(fine - rough)) + ROUNDING * scale)


@dataclass(frozen=True)
class Truth:
    """A law: a density with respect to d theta', and angles to which a fraction goes.

    Attributes
    ----------
    density : callable or None
        Of incoming and outgoing angles, which broadcast.
    maps : tuple of (callable, callable)
        The fraction and the outgoing angle as functions of the incoming one.
    breaks : tuple of float
        Angles, incoming and outgoing, between which all these are smooth.
    gap, slem : float or None
        1 less the largest number and the largest modulus in the spectrum off the constants; None if not known.
    eta : float or None
        The diffusivity over 4/pi.
    """

    density: Callable[[Array, Array], Array] | None = None
    maps: tuple[tuple[Callable[[Array], Any], Callable[[Array], Array]], ...] = ()
    breaks: tuple[float, ...] = ()
    gap: float | None = None
    slem: float | None = None
    eta: float | None = None

    def mean(self, function: Callable[[Array], Array], theta: Array, more: Iterable[float] = ()) -> Known:
        """E[f(Theta') | theta] for each incoming angle."""

        def computed(nodes: int) -> Array:
            total = sum((part(theta) * function(image(theta)) for part, image in self.maps), np.zeros(theta.size))
            if self.density is not None:
                angle, weight = rule((*self.breaks, *more), nodes, levels=20, widest=0.02)
                values = function(angle) * weight
                total = total + np.array([np.sum(self.density(np.array(each), angle) * values) for each in theta])
            return total

        return by_two_rules(computed)

    def matrix(self, functions: Callable[[Array], Array], more: Iterable[float] = ()) -> Known:
        """<e_i, P e_j> for functions with values of shape (angles, n)."""
        return by_two_rules(lambda nodes: self._pairs(functions, (*self.breaks, *more), nodes))

    def _pairs(self, functions: Callable[[Array], Array], breaks: tuple[float, ...], nodes: int) -> Array:
        angle, weight = rule(breaks, nodes, levels=6)
        flux, values = 0.5 * np.sin(angle) * weight, functions(angle)
        total = sum(
            (values.T @ (flux * part(angle) * functions(image(angle)).T).T for part, image in self.maps),
            np.zeros((values.shape[1],) * 2),
        )
        if self.density is not None:
            inner = self.density(angle[:, None], angle) @ (weight[:, None] * values)
            total = total + values.T @ (flux[:, None] * inner)
        return np.asarray(total)

    def resistance(self) -> Known:
        """The mean of (3/4)(1 + cos(theta' - theta))."""

        def both(angle: Array) -> Array:
            return np.stack([np.cos(angle), np.sin(angle)], axis=-1)

        found = self.matrix(both)
        return Known(0.75 * (1.0 + float(np.trace(found.value))), 1.5 * found.error)

    def distance_from_lambertian(self) -> Known:
        """The mean of the Wasserstein distance of the conditional distributions from sin(theta')/2, of a density."""
        density = self.density
        assert density is not None and not self.maps

        def computed(nodes: int) -> float:
            angle, weight = rule(self.breaks, nodes, levels=4, widest=0.2)
            out, mass = rule(self.breaks, nodes, levels=4, widest=0.1 / nodes)
            # the distribution functions at the ends of panels, and the trapezoidal rule between these
            excess = (density(angle[:, None], out) - 0.5 * np.sin(out)) * mass
            excess = excess.reshape(angle.size, -1, nodes).sum(axis=2)
            away = np.abs(np.cumsum(excess, axis=1))
            width = mass.reshape(-1, nodes).sum(axis=1)
            between = 0.5 * (width + np.append(width[1:], 0.0))
            return float((weight * 0.5 * np.sin(angle)) @ (away @ between))

        found = by_two_rules(computed)
        # the absolute value has kinks that no panel knows, and both rules may miss them alike
        return Known(float(found.value), 10.0 * found.error)
