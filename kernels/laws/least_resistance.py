"""The symmetric law of least resistance, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ...core.checks import Floats, finite_array
from ..bases.angles import clipped_inside
from ..bases.bins import Bins
from ..bases.measure import SINE, gauss_on_intervals
from ..expectations.conditionals import Conditionals
from .law import Law

# Rays are split from this x = theta - pi/2 on, at which the partner 3 x - pi is grazing.
SPLIT_BEGINS = np.pi / 6.0
# Gauss nodes on intervals that double from 1/1024 of (b, pi - 3 b) on, because x' has a branch point at b - 0.005.
NODES, DOUBLINGS = 16, 10


@dataclass(frozen=True)
class LeastResistanceLaw(Law):
    r"""The minimiser of E[1 + cos(theta' - theta)] among all symmetric laws.

    Let x = theta - pi/2 and x' = theta' - pi/2, both in (-pi/2, pi/2). For x >= 0 (for x < 0 by mirror symmetry):

    - x < pi/6: specular, x' = -x;
    - pi/6 < x < b: x' = 3 x - pi with probability p(x) = -3 cos(3 x)/cos(x), else x' = -x;
    - b < x < pi - 3 b: sin(x') = sin(x) - sin(b) - sin(3 b);
    - pi - 3 b < x: x' = (x - pi)/3.

    The number b = 0.5537931... solves 2 cos(2 b) = int from b to pi - 3 b of sin(x - x') dx. Near-grazing rays are
    returned at a steeper angle. For pi/6 < x < b both outcomes occur, so the law is not deterministic, but
    deterministic involutions approximate it arbitrarily well (`IntervalExchangeLaw`).

    Notes
    -----
    A potential shows that the law is optimal. The even function phi with phi(x) = cos(2 x)/2 for 0 <= x < b and
    phi'(x) = -sin(x - x') for x > b satisfies phi(x) + phi(y) <= cos(x - y) for all x and y, with equality exactly on
    the support of the law. `extremal_resistance` checks the inequality. The resistance is 0.987823750351586; A. Plakhov
    (Arch. Ration. Mech. Anal. 194, 2009) published 0.9878.

    Examples
    --------
    >>> law = LeastResistanceLaw()
    >>> round(law.split_ends, 12), law.reversible, law.mirror_symmetric
    (0.55379314153, True, True)
    >>> float(law.sample(np.pi / 2 - 0.25, np.random.default_rng(0))) - np.pi / 2          # specular
    0.25
    """

    reversible = True
    mirror_symmetric = True

    @property
    def split_ends(self) -> float:
        """The number b, the end of the range of x in which rays are split."""
        return _split_ends()

    def images(self, theta: Floats) -> tuple[Floats, Floats]:
        """Probabilities and outgoing angles, shape ``theta.shape + (2,)``; the specular outcome is the first."""
        x = finite_array("theta", theta) - 0.5 * np.pi
        size = np.abs(x)
        away = np.clip(np.where(size < self.split_ends, -3.0 * np.cos(3.0 * size) / np.cos(size), 1.0), 0.0, 1.0)
        away = np.where(size < SPLIT_BEGINS, 0.0, away)
        partner = np.where(size < SPLIT_BEGINS, -size, partners(size, self.split_ends))
        image = np.stack([-size, partner], axis=-1) * np.where(x < 0.0, -1.0, 1.0)[..., None]
        return np.stack([1.0 - away, away], axis=-1), clipped_inside(image + 0.5 * np.pi)

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """The angles where the formula changes; none are left out."""
        x = np.array([SPLIT_BEGINS, self.split_ends, np.pi - 3.0 * self.split_ends])
        return 0.5 * np.pi + np.concatenate((-x[::-1], x)), 0.0

    def potential(self, theta: Floats) -> Floats:
        """The potential phi: phi(theta) + phi(theta') <= cos(theta' - theta), with equality on the law's support."""
        size = np.abs(finite_array("theta", theta) - 0.5 * np.pi)
        b = self.split_ends
        last = np.pi - 3.0 * b
        # Cumulative integral of sin(x - x') over the sorted x from b to pi - 3 b; beyond, the integral is elementary.
        middle = np.unique(np.concatenate(([b], np.clip(size, b, last).ravel(), _graded(b))))
        table = np.concatenate(([0.0], np.cumsum(_turning(middle[:-1], middle[1:], b))))
        carried = table[np.searchsorted(middle, np.clip(size, b, last))]
        tail = 1.5 * (np.cos((2.0 * np.maximum(size, last) + np.pi) / 3.0) - np.cos((2.0 * last + np.pi) / 3.0))
        return np.asarray(0.5 * np.cos(2.0 * np.minimum(size, b)) - carried + tail)

    @cached_property
    def mean_cosine(self) -> float:
        """E[cos(theta' - theta)] under sin(theta)/2 d theta, by Gauss rules between the breakpoints."""
        edges = np.concatenate(([0.0], self.breakpoints(6)[0], [np.pi]))
        fine = np.concatenate((edges, 0.5 * np.pi + _graded(self.split_ends), 0.5 * np.pi - _graded(self.split_ends)))
        fine = np.unique(fine)
        angle, mass = SINE.quadrature(fine, NODES)
        probability, outgoing = self.images(angle)
        return float(mass @ np.sum(probability * np.cos(outgoing - angle[:, None]), axis=1) / mass.sum())

    def flux(self, cells: Bins) -> Floats:
        """The mass of sin(theta)/2 d theta that goes from each cell to each cell, shape (n, n), to rounding."""
        b = self.split_ends
        edges = cells.edges - 0.5 * np.pi
        edges = np.concatenate((edges, -edges))
        ends = [0.0, SPLIT_BEGINS, b, np.pi - 3.0 * b, 0.5 * np.pi]
        # Breakpoints, edges of cells, and preimages of the edges.
        middle_range = np.arcsin(np.clip(np.sin(edges) + np.sin(b) + np.sin(3.0 * b), -1.0, 1.0))
        cuts = np.concatenate((ends, edges, (edges + np.pi) / 3.0, np.pi + 3.0 * edges, middle_range))
        cuts = np.unique(np.clip(cuts, 0.0, 0.5 * np.pi))
        low, high = cuts[:-1], cuts[1:]
        middle = 0.5 * (low + high)
        whole = SINE.mass(low + 0.5 * np.pi, high + 0.5 * np.pi)
        # In the range of splitting, the rays that are not reflected specularly have the density -3 cos(3 x)/2.
        split = 0.5 * (np.sin(3.0 * low) - np.sin(3.0 * high))
        away = np.where(middle < SPLIT_BEGINS, 0.0, np.where(middle < b, split, whole))
        theta, flux = middle + 0.5 * np.pi, np.zeros((cells.size, cells.size))
        image = self.images(theta)[1]
        for target, mass in ((image[:, 0], whole - away), (image[:, 1], away)):
            np.add.at(flux, (cells.index(theta), cells.index(target)), mass)
            np.add.at(flux, (cells.index(np.pi - theta), cells.index(np.pi - target)), mass)
        return np.asarray(0.5 * (flux + flux.T))

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        probability, outgoing = self.images(theta)
        return np.where(rng.random(theta.shape) < probability[..., 0], outgoing[..., 0], outgoing[..., 1])

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        probability, outgoing = self.images(theta)
        return Conditionals.of_atoms(outgoing, probability, 0.0)


def partners(size: Floats, b: float) -> Floats:
    """x' of the rays that are not reflected specularly, for x between pi/6 and pi/2."""
    middle = np.arcsin(np.clip(np.sin(size) - np.sin(b) - np.sin(3.0 * b), -1.0, 1.0))
    outer = np.where(size < b, 3.0 * size - np.pi, (size - np.pi) / 3.0)
    return np.where((size > b) & (size < np.pi - 3.0 * b), middle, outer)


def _graded(b: float) -> Floats:
    """Increasing x from b to pi - 3 b between which Gauss rules reach rounding."""
    return b + (np.pi - 4.0 * b) * np.concatenate(([0.0], 0.5 ** np.arange(DOUBLINGS, -1.0, -1.0)))


def _turning(low: Floats, high: Floats, b: float) -> Floats:
    """Integrals of sin(x - x') over intervals between b and pi - 3 b."""
    x, weight = gauss_on_intervals(low, high, NODES)
    return np.asarray((weight * np.sin(x - partners(x, b))).reshape(-1, NODES).sum(axis=1))


@lru_cache(maxsize=1)
def _split_ends() -> float:
    from scipy.optimize import brentq

    def excess(b: float) -> float:
        edges = _graded(b)
        return float(2.0 * np.cos(2.0 * b) - _turning(edges[:-1], edges[1:], b).sum())

    return float(brentq(excess, SPLIT_BEGINS, 0.6, xtol=1e-15))
