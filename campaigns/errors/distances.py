"""Whether the reported errors of distances of laws hold.

The judge of a distance of conditional distributions is the same distance to 1e-7, so that errors that a rough run
reports too small are found; the tests compare fine runs with closed forms. Tolerances below ten times the error of the
fine run, and below 2e-5, are skipped. The judge of a joint distance replaces maps by points of equal mass and densities
by points of a grid, solves that transport, and allows itself the difference from half as many points. Mixtures of
specular reflection and retroreflection have the joint distance pi - 2 times the difference of their weights.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import ot

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.checks import Floats
from campaigns.engine import Campaign, Judged

TOLERANCES, FINE, WORST_FINE, JUDGE_FRACTION = (1e-3, 1e-4, 1e-5), 1e-7, 2e-5, 0.1
KINDS: tuple[tuple[float, Any], ...] = ((1, "rows"), (2, "rows"), (1, "sup"))
JOINT_TOLERANCES = (1e-2, 1e-4)
# Points of a grid along a side, and for each of these the points on a curve.
GRIDS, ON_CURVE = (20, 40), 8
# Fraction of sums of two laws.
SUMS = 0.35
Pair = tuple[ker.Law, ker.Law]


def random_law(rng: np.random.Generator) -> ker.Law:
    """A law with jumps, with breakpoints that accumulate at grazing, smooth, or a sum of two."""
    first = _simple_law(rng)
    if rng.random() >= SUMS:
        return first
    weight = float(rng.uniform(0.1, 0.9))
    return weight * first + (1.0 - weight) * _simple_law(rng)


def _simple_law(rng: np.random.Generator) -> ker.Law:
    makers = (
        lambda: ker.TriangularTeethLaw(rng.uniform(0.15, 2.8)),
        lambda: ker.RectangularTeethLaw(rng.uniform(0.1, 3.0)),
        lambda: ker.CircularArcLaw(rng.uniform(0.2, 1.57)),
        lambda: ker.maxwell(rng.uniform(0.0, 1.0)),
        lambda: ker.henyey_greenstein(rng.uniform(-0.8, 0.8)),
        lambda: ker.WallLaw(_polygon(rng)),
    )
    return makers[rng.integers(len(makers))]()


def _polygon(rng: np.random.Generator) -> geo.Wall:
    corners = int(rng.integers(1, 5))
    x = np.concatenate([[0.0], np.sort(rng.random(corners)), [1.0]])
    y = np.concatenate([[0.0], -0.1 - 0.8 * rng.random(corners), [0.0]])
    return geo.Wall.from_vertices(np.column_stack([x, y]))


def random_pair(number: int) -> Pair:
    """Two random laws."""
    rng = np.random.default_rng([20261123, number])
    return random_law(rng), random_law(rng)


def conditional_distances(pair: Pair) -> Iterator[Judged]:
    """Distances of conditional distributions against fine ones."""
    for order, kind in KINDS:
        fine = ker.distance(*pair, order, kind, tolerance=FINE)
        for tolerance in (one for one in TOLERANCES if fine.error <= max(WORST_FINE, JUDGE_FRACTION * one)):
            found = ker.distance(*pair, order, kind, tolerance=tolerance)
            yield Judged(f"{kind}, order {order:g}", found.error, abs(found.value - fine.value), fine.error)


@dataclass(frozen=True)
class Part:
    """A law as users write them: of a map of u = -cos(theta), or with the density (1 + c cos cos) sin/2."""

    law: ker.Law
    image: Callable[[Floats], Floats] | None
    slope: float = 0.0

    def points(self, grid: int) -> tuple[Floats, Floats]:
        """Points of the flux measure, and their masses."""
        if self.image is None:
            angle = (np.arange(grid) + 0.5) * np.pi / grid
            here, there = (part.ravel() for part in np.meshgrid(angle, angle, indexing="ij"))
            mass = np.sin(here) * np.sin(there) * (1.0 + self.slope * np.cos(here) * np.cos(there))
            return np.stack((here, there), axis=1), mass / mass.sum()
        number = grid * ON_CURVE
        theta = np.arccos(1.0 - (2.0 * np.arange(number) + 1.0) / number)
        return np.stack((theta, self.image(theta)), axis=1), np.full(number, 1.0 / number)


def _exchange(rng: np.random.Generator) -> Part:
    """An involution that exchanges equal intervals of u, or reflects them."""
    pieces = 2 ** int(rng.integers(1, 4))
    partner, order = np.arange(pieces), rng.permutation(pieces)
    for i, j in order.reshape(-1, 2):
        partner[i], partner[j] = j, i
    turned = bool(rng.integers(2))

    def image(theta: Floats) -> Floats:
        place = 0.5 * pieces * (1.0 - np.cos(theta))
        piece = np.clip(place.astype(int), 0, pieces - 1)
        inside = place - piece
        moved = partner[piece] + (1.0 - inside if turned else inside)
        return np.arccos(np.clip(1.0 - 2.0 * moved / pieces, -1.0, 1.0))

    return Part(ker.InvolutionLaw(image), image)


def _tilted(rng: np.random.Generator) -> Part:
    slope = float(rng.uniform(-0.9, 0.9))
    density = ker.DensityLaw(lambda a, b: 0.5 * np.sin(b) * (1.0 + slope * np.cos(a) * np.cos(b)))
    return Part(density, None, slope)


Mixture = list[tuple[float, Part]]


def random_joint_case(number: int) -> tuple[Mixture, Mixture, float]:
    """Two mixtures of one or two parts, maps or densities, and the order of the distance."""
    rng = np.random.default_rng([20261127, number])

    def mixture(make: Callable[[np.random.Generator], Part]) -> Mixture:
        weight = float(rng.uniform(0.2, 0.8))
        return [(1.0, make(rng))] if rng.random() < 0.5 else [(weight, make(rng)), (1.0 - weight, make(rng))]

    kinds = ((_exchange, _exchange), (_exchange, _tilted), (_tilted, _tilted))[number % 3]
    return mixture(kinds[0]), mixture(kinds[1]), (1.0, 1.0, 2.0, 1.5)[number // 3 % 4]


def joint_distances(case: tuple[Mixture, Mixture, float]) -> Iterator[Judged]:
    """Joint distances against transport between points."""
    *mixtures, order = case
    values = []
    for grid in GRIDS:
        sides = []
        for mixture in mixtures:
            parts = [(weight, part.points(grid)) for weight, part in mixture]
            sides.append([np.concatenate(each) for each in zip(*((p, w * m) for w, (p, m) in parts), strict=True)])
        cost = ot.dist(sides[0][0], sides[1][0], metric="euclidean") ** order
        values.append(float(ot.emd2(sides[0][1], sides[1][1], cost, numItermax=10**8)) ** (1.0 / order))
    first, second = (_sum(mixture) for mixture in mixtures)
    kinds = "maps and densities" if any(p.image is None for m in mixtures for _, p in m) else "maps"
    for tolerance in JOINT_TOLERANCES:
        found = ker.distance(first, second, order, "joint", tolerance=tolerance)
        useless = "useless" if found.error > 0.5 * found.value else f"to {10.0 ** np.ceil(np.log10(found.error)):.0e}"
        name = f"{kinds}, order {order:g}, to {tolerance:g}"
        yield Judged(name, found.error, abs(found.value - values[1]), abs(values[1] - values[0]), outcome=useless)


def _sum(mixture: Mixture) -> ker.Law:
    weights, laws = zip(*((weight, part.law) for weight, part in mixture), strict=True)
    return laws[0] if len(laws) == 1 else weights[0] * laws[0] + weights[1] * laws[1]


def random_weights(number: int) -> tuple[float, float]:
    """Weights of specular reflection in two mixtures with retroreflection."""
    first, second = np.random.default_rng([20261124, number]).random(2)
    return float(first), float(second)


def known_distances(weights: tuple[float, float]) -> Iterator[Judged]:
    """Joint distances of the mixtures against the closed form."""
    pair = (a * ker.specular() + (1.0 - a) * ker.retroreflection() for a in weights)
    first, second = pair
    truth = (np.pi - 2.0) * abs(weights[0] - weights[1])
    for tolerance in JOINT_TOLERANCES:
        found = ker.distance(first, second, kind="joint", tolerance=tolerance)
        yield Judged(f"joint to {tolerance:g}", found.error, abs(found.value - truth))


CAMPAIGNS = (
    Campaign("distances", "Do errors of distances of laws hold?", random_pair, conditional_distances, 84, range(1)),
    Campaign("joint-distances", "Do errors of joint distances hold?", random_joint_case, joint_distances, 48, (0, 5)),
    Campaign("known-distances", "Do they hold against a closed form?", random_weights, known_distances, 12, range(2)),
)
