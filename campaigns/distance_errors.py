"""Whether the reported errors of distances hold, for random pairs of laws: ``python -m campaigns.distance_errors``.

The judge is the same distance to 1e-7, so that the campaign shows errors that a rough run reports too small; the tests
compare fine runs with closed forms. Pairs whose fine run reports more than 2e-5 are left out.

The judge of a joint distance has 768 bins, whose edges are others, and twice the pairs of cells. The weighted
sums of the specular law and of retroreflection have the joint distance pi - 2 times the difference of their weights.
``--joint`` judges joint distances alone.
"""

from __future__ import annotations

import argparse
import time
from typing import Any
from unittest.mock import patch

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.distances import cell_transport
from asperity.kernels.distances.joint import joint_law_distance

from .pages import print_table

TOLERANCES, FINE, WORST_FINE = (1e-3, 1e-4, 1e-5), 1e-7, 2e-5
KINDS: tuple[tuple[float, Any], ...] = ((1, "rows"), (2, "rows"), (1, "sup"))
# Joint distances: wanted errors, that of the judge and its bins, and pairs with a closed form.
JOINT_TOLERANCES, FINE_JOINT, JUDGE_BINS, KNOWN = (1e-2, 1e-3), 1e-4, 768, 12
# Fraction of sums of two laws.
SUMS = 0.35


def random_law(rng: np.random.Generator) -> ker.Law:
    """A law with jumps, with cuts that accumulate at grazing, smooth, or a sum of two."""
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


def campaign(seed: int, seconds: float) -> list[str]:
    """Rows of a table: kind, order, runs, errors that did not hold, and the largest fraction of an error."""
    rng, end = np.random.default_rng(seed), time.monotonic() + seconds
    ratios: dict[tuple[float, Any], list[float]] = {kind: [] for kind in KINDS}
    while time.monotonic() < end:
        pair = random_law(rng), random_law(rng)
        for order, kind in KINDS:
            fine = ker.distance(*pair, order, kind, tolerance=FINE)
            if fine.error > WORST_FINE:
                continue
            for tolerance in TOLERANCES:
                found = ker.distance(*pair, order, kind, tolerance=tolerance)
                ratios[order, kind].append(abs(found.value - fine.value) / (found.error + fine.error))
                if ratios[order, kind][-1] > 1.0:
                    print(f"{kind} {order:g} to {tolerance:g}: {found} for {fine}, {pair}", flush=True)
    return [
        f"{kind}, order {order:g} | {len(found)} | {sum(one > 1.0 for one in found)} | {max(found, default=0.0):.2f}"
        for (order, kind), found in ratios.items()
    ]


def joint_campaign(seed: int, seconds: float) -> list[str]:
    """Rows of a table: tolerance of joint distances, runs, errors that did not hold, and the largest fraction."""
    rng, end = np.random.default_rng(seed), time.monotonic() + seconds
    known: dict[float, list[float]] = {tolerance: [] for tolerance in JOINT_TOLERANCES}
    judged: dict[float, list[float]] = {tolerance: [] for tolerance in JOINT_TOLERANCES}
    for _ in range(KNOWN):
        weights = rng.random(2)
        first, second = (a * ker.specular() + (1.0 - a) * ker.retroreflection() for a in weights)
        truth = (np.pi - 2.0) * abs(weights[0] - weights[1])
        for tolerance in JOINT_TOLERANCES:
            found = ker.distance(first, second, kind="joint", tolerance=tolerance)
            known[tolerance].append(abs(found.value - truth) / found.error)
    while time.monotonic() < end:
        pair = random_law(rng), random_law(rng)
        with patch.object(cell_transport, "MOST_SPARSE", 2**19):
            fine = joint_law_distance(*pair, 1.0, FINE_JOINT, JUDGE_BINS)
        for tolerance in JOINT_TOLERANCES:
            found = ker.distance(*pair, kind="joint", tolerance=tolerance)
            judged[tolerance].append(abs(found.value - fine.value) / (found.error + fine.error))
            if judged[tolerance][-1] > 1.0:
                print(f"joint to {tolerance:g}: {found} for {fine}, {pair}", flush=True)
    return [
        f"joint to {tolerance:g}, {judge} | {len(found)} | {sum(part > 1.0 for part in found)} | "
        f"{max(found, default=0.0):.2f}"
        for judge, table in (("closed form", known), (f"{JUDGE_BINS} bins", judged))
        for tolerance, found in table.items()
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.distance_errors", description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=240.0)
    parser.add_argument("--joint", action="store_true")
    options = parser.parse_args()
    rows = (joint_campaign if options.joint else campaign)(options.seed, options.seconds)
    print_table("distance | runs | errors that did not hold | largest part of an error", rows)


if __name__ == "__main__":
    main()
