"""Time of one ray with very many hits in a row: along an arc, in a channel, in a wedge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from asperity import geometry as geo
from asperity.bench.running.timing import least_time

RAYS, REPEATS = 2**14, 5
LIMIT = 2**62

# Entry points and angles for which very many hits follow each other. On an arc, 10^9 of them would begin and end within
# 1e-18 of its tips, which are corners: double precision has room for some 10^6.
CASES = {
    "arc": (geo.focusing_arcs(np.pi / 2), (1e-12, 2e-12), (np.pi / 2 - 1e-6, np.pi / 2 - 0.5e-6)),
    "channel": (geo.rectangular_teeth(1e6), (0.5, 1.0), (1.9e-3, 2.1e-3)),
    "wedge": (geo.triangular_teeth(3e-9), (0.0, 1.0), (1.5, 1.6)),
}


@dataclass(frozen=True)
class RunTime:
    """Mean number of hits of a ray, and seconds a ray."""

    what: str
    hits: float
    seconds: float
    escaped: float


def measure_runs(rays: int = RAYS, repeats: int = REPEATS) -> list[RunTime]:
    """One row a case; the least time of the repeats counts."""
    rng = np.random.default_rng(0)
    rows = []
    for what, (wall, (low, high), (first, last)) in CASES.items():
        x, theta = low + (high - low) * rng.random(rays), first + (last - first) * rng.random(rays)
        traced, best = least_time(
            lambda wall=wall, x=x, theta=theta: geo.trace(wall, x, theta, max_collisions=LIMIT, threads=1), repeats
        )
        rows.append(RunTime(what, float(traced.collisions.mean()), best / rays, float(traced.escaped.mean())))
    return rows
