"""How many bounces a second the tracer makes on four walls, against the floating-point limit of the same core."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from asperity import geometry as geo
from asperity.bench.running.timing import least_time

RAYS = 2**20
REPEATS = 5
# Floating-point operations that one bounce needs at least, with every piece of the hollow tested once: about 9 for
# the side of a joint, 24 for an arc, 30 for the hit, the reflection and the way out.
LINE_FLOPS, ARC_FLOPS, BOUNCE_FLOPS = 9, 24, 30

WALLS = {
    "triangular teeth (2 lines)": geo.triangular_teeth(0.7),
    "focusing arc (1 arc)": geo.focusing_arcs(1.2),
    "mushroom (6 lines, 1 arc)": geo.mushrooms(0.3, 0.5),
    "Koch 4 (256 lines)": geo.koch(4),
}


@dataclass(frozen=True)
class Throughput:
    """Bounces and rays a second on one wall."""

    wall: str
    bounces_per_ray: float
    one_thread: float
    two_threads: float
    flop_limit: float


def measure_throughput(rays: int = RAYS, repeats: int = REPEATS) -> list[Throughput]:
    """Trace the same rays on every wall with one thread and with two; the least time of the repeats counts."""
    rng = np.random.default_rng(0)
    x, theta = rng.random(rays), np.arccos(1 - 2 * rng.random(rays))
    peak = _peak_flops()
    rows = []
    for name, wall in WALLS.items():
        traced = geo.trace(wall, x, theta)
        bounces = int(traced.collisions.sum())
        _, one = least_time(lambda wall=wall: geo.trace(wall, x, theta, threads=1), repeats)
        _, two = least_time(lambda wall=wall: geo.trace(wall, x, theta, threads=2), repeats)
        lines = sum(isinstance(piece, geo.Segment) for piece in wall.pieces)
        flops = BOUNCE_FLOPS + LINE_FLOPS * lines + ARC_FLOPS * (len(wall.pieces) - lines)
        rows.append(Throughput(name, bounces / rays, bounces / one, bounces / two, peak / flops))
    return rows


@njit(fastmath=True)
def _multiply_add(values, rounds):  # type: ignore[no-untyped-def]
    for _ in range(rounds):
        for i in range(values.shape[0]):
            values[i] = values[i] * 0.999999 + 1e-6


def _peak_flops(rounds: int = 200_000) -> float:
    """Multiply-adds a second of one core on an array that stays in the first-level cache, times two."""
    values = np.ones(512)
    _multiply_add(values, 1)
    _, best = least_time(lambda: _multiply_add(values, rounds), 3)
    return 2.0 * rounds * len(values) / best
