"""Whether the reported errors of distances of laws hold.

The judge of a distance of conditional distributions is the same distance to 1e-7, so that errors that a rough run
reports too small are found; the tests compare fine runs with closed forms. Tolerances below ten times the error of the
fine run, and below 2e-5, are skipped. The judge of a joint distance has 768 bins, whose edges are others, and twice the
pairs of cells. Mixtures of specular reflection and retroreflection have the joint distance pi - 2 times the difference
of their weights.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from unittest.mock import patch

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.distances import cell_transport
from asperity.kernels.distances.joint import joint_law_distance
from campaigns.engine import Campaign, Judged

TOLERANCES, FINE, WORST_FINE, JUDGE_FRACTION = (1e-3, 1e-4, 1e-5), 1e-7, 2e-5, 0.1
KINDS: tuple[tuple[float, Any], ...] = ((1, "rows"), (2, "rows"), (1, "sup"))
JOINT_TOLERANCES, FINE_JOINT, JUDGE_BINS = (1e-2, 1e-3), 1e-4, 768
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


def joint_distances(pair: Pair) -> Iterator[Judged]:
    """Joint distances against those of other bins."""
    with patch.object(cell_transport, "MOST_SPARSE", 2**19):
        fine = joint_law_distance(*pair, 1.0, FINE_JOINT, JUDGE_BINS)
    for tolerance in JOINT_TOLERANCES:
        found = ker.distance(*pair, kind="joint", tolerance=tolerance)
        yield Judged(f"joint to {tolerance:g}", found.error, abs(found.value - fine.value), fine.error)


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
    Campaign("joint-distances", "Do errors of joint distances hold?", random_pair, joint_distances, 77, range(1)),
    Campaign("known-distances", "Do they hold against a closed form?", random_weights, known_distances, 12, range(2)),
)
