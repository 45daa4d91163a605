"""Rays aimed at corners and tangencies, and rays at grazing angles, against the double-double twin: every one of them.

``python -m benchmarks.robustness`` traces a million of each on eleven walls and prints what became of them. The twin is
judged in turn by the tests' tracer in 50 digits: on a thousand rays, and on every ray where twin and tracer disagree.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tests.precise_tracer import trace_precisely

from asperity import geometry as geo
from asperity.geometry.double_double import EPS_DOUBLE_DOUBLE
from asperity.geometry.refined_engine import LOST
from asperity.geometry.refinement import RefinedTrace, refined_trace

Floats = NDArray[np.float64]
EPS = 2.0**-52
# The tracer's error on a ray that its twin leaves open: hundreds of bounces with a derivative of some 10^6.
OPEN_ERROR = 1e-6
RAYS = 1_000_000
# Rays that are traced in 50 digits besides those in dispute, on all walls together.
PRECISE_RAYS = 1000
# The twin's error, in units of its own rounding error times the derivative and the bounces.
TWIN_UNITS = 2.0**10
# Rays still inside after so many collisions are not compared: on both sides they end with the bounce limit.
COLLISIONS = 200
# An aimed ray is off its target by up to so many ulps of its angle.
AIM_ULPS = 4
# Bisections from an interval of angles to two neighbouring doubles.
BISECTIONS = 64
# The double tracer's error, in units of EPS times the norm of the derivative, a bounce; measured below 5 in all.
ERROR_UNITS = 32.0
# A disagreement is one of conditioning where the twin, its ray moved by at most so many ulps, does what the tracer did.
CONDITION_ULPS = 64

WALLS: dict[str, geo.Wall] = {
    "triangular teeth": geo.triangular_teeth(0.7),
    "rectangular teeth": geo.rectangular_teeth(2.0),
    "focusing arcs": geo.focusing_arcs(1.2),
    "semicircles": geo.focusing_arcs(0.5 * math.pi),
    "dispersing arcs": geo.dispersing_arcs(1.5),
    "cusps": geo.dispersing_arcs(2.0),
    "elliptical arcs": geo.elliptical_arcs(0.9, geo.Disk(1.0, 0.5)),
    "parabolas": geo.double_parabola(),
    "mushrooms": geo.mushrooms(0.3, 0.5),
    "Koch curve": geo.koch(3),
    "cubic bumps": geo.Wall(
        [
            geo.Segment((0.0, 0.0), (0.1, -0.9)),
            geo.Bezier([(0.1, -0.9), (0.3, -0.2), (0.5, -0.9)]),
            geo.Bezier([(0.5, -0.9), (0.6, -0.95), (0.8, 0.1), (0.9, -0.9)]),
            geo.Segment((0.9, -0.9), (1.0, 0.0)),
        ],
        period=1.0,
    ),
}


# Rays of a kind: places and angles of so many on a wall.
Rays = Callable[[geo.Wall, int, np.random.Generator], tuple[Floats, Floats]]
COUNTED = ("rays", "lost", "flagged", "conditioned", "wrong")


@dataclass(frozen=True)
class Verdict:
    """What became of rays on one wall: all, lost, left flagged, wrong but for conditioning, and wrong."""

    rays: int
    lost: int
    flagged: int
    conditioned: int
    wrong: int
    worst: float
    disagreements: tuple[tuple[float, float], ...]


def aimed_rays(wall: geo.Wall, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Half of the rays at joints straight away; half at the edges between itineraries, found by bisection.

    Such an edge is a later corner or a tangency. ``rng`` also spreads the rays over a few ulps about their target.
    """
    joints = wall.scene.joints[wall.scene.joints[:, 1] < 0.0]
    # a wall of single arcs has no joint below its openings
    straight = count // 2 if len(joints) else 0
    target = joints[rng.integers(max(1, len(joints)), size=straight)]
    x = wall.period * rng.random(straight)
    theta = np.arctan2(-target[:, 1], x - target[:, 0])
    edges_x, edges_theta = _edges(wall, (count - straight + AIM_ULPS) // (AIM_ULPS + 1), rng)
    copies = -(-(count - straight) // max(1, len(edges_x)))
    x = np.concatenate([x, np.repeat(edges_x, copies)[: count - straight]])
    theta = np.concatenate([theta, np.repeat(edges_theta, copies)[: count - straight]])
    return x, theta + rng.integers(-AIM_ULPS, AIM_ULPS + 1, size=count) * np.spacing(theta)


def grazing_rays(wall: geo.Wall, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Angles 1e-12 to 1e-3, uniform in the logarithm, from either side."""
    theta = 10.0 ** rng.uniform(-12.0, -3.0, count)
    return wall.period * rng.random(count), np.where(rng.random(count) < 0.5, theta, math.pi - theta)


def judge(wall: geo.Wall, x: Floats, theta: Floats) -> Verdict:
    """Compare the tracer with the twin on every ray."""
    traced = geo.trace(wall, x, theta, max_collisions=COLLISIONS)
    twin = refined_trace(wall.scene, x, theta, COLLISIONS)
    flagged = (traced.status == geo.Status.CORNER) | (traced.status == geo.Status.GRAZING)
    same, distance = _agree(traced, twin)
    other = np.flatnonzero(~same)
    # lost: the tracer ends a ray that the twin follows to its end, or the twin itself meets nothing
    lost = (flagged & (twin.status == geo.Status.ESCAPED)) | (twin.status == LOST)
    explained = _explained(wall, _part(traced, other), x[other], theta[other])
    # the twin flags a ray where half an ulp of its angle meets a corner; one that misses it is not wrong
    for k in np.flatnonzero(~explained & (twin.status[other] != geo.Status.ESCAPED)):
        explained[k] = _is_precise(wall, traced, other[k], float(x[other[k]]), float(theta[other[k]]))
    worst = float(distance[same].max(initial=0.0))
    return Verdict(
        len(x), int(lost.sum()), int(flagged.sum()), int(explained.sum()), int((~explained).sum()), worst,
        tuple(zip(x[other].tolist(), theta[other].tolist(), strict=True)),
    )  # fmt: skip


def measure_robustness(rays: int) -> dict[str, Verdict]:
    """Rays of each kind, shared among the walls, and what became of them all."""
    each = -(-rays // len(WALLS))

    def judged(number: int, make: Rays) -> Verdict:
        wall = list(WALLS.values())[number]
        return judge(wall, *make(wall, each, np.random.default_rng([0, number])))

    found = {}
    # the twin is a loop on one thread
    with ThreadPoolExecutor() as pool:
        for kind, make in KINDS.items():
            verdicts = list(pool.map(judged, range(len(WALLS)), [make] * len(WALLS)))
            sums = (sum(getattr(one, name) for one in verdicts) for name in COUNTED)
            found[kind] = Verdict(*sums, max(one.worst for one in verdicts), ())
    return found


def wrong_twins(wall: geo.Wall, x: Floats, theta: Floats) -> int:
    """How many of these rays the twin takes elsewhere than the tracer in 50 digits does."""
    twin = refined_trace(wall.scene, x, theta, COLLISIONS)
    wrong = 0
    for k in np.flatnonzero(twin.status == geo.Status.ESCAPED):
        ray = trace_precisely(wall.scene, float(x[k]), float(theta[k]), COLLISIONS)
        if ray.theta is None or ray.bounces != twin.collisions[k]:
            wrong += 1
            continue
        difference = abs(float((ray.theta - twin.theta[k, 0]) - twin.theta[k, 1]))
        room = TWIN_UNITS * EPS_DOUBLE_DOUBLE * twin.amplification[k] * (1.0 + twin.collisions[k])
        # the twin gives the angle in two doubles, and those are no better than this
        wrong += difference > room + EPS**2 * abs(twin.theta[k, 0])
    return wrong


def _is_precise(wall: geo.Wall, traced: geo.Trace, k: int, x: float, theta: float) -> bool:
    """Whether the tracer agrees in 50 digits on a ray that its twin left open or flagged."""
    ray = trace_precisely(wall.scene, x, theta, COLLISIONS)
    if ray.theta is None:
        return bool(traced.status[k] == geo.Status.BOUNCE_LIMIT)
    return bool(ray.bounces == traced.collisions[k]) and abs(float(ray.theta) - traced.theta[k]) < OPEN_ERROR


def _agree(traced: geo.Trace, twin: RefinedTrace) -> tuple[NDArray[np.bool_], Floats]:
    """Which rays end alike within conditioning, and their angles' distance in units of EPS times the derivative."""
    gone = (traced.status == geo.Status.ESCAPED) & (twin.status == geo.Status.ESCAPED)
    difference = np.abs((traced.theta - twin.theta[:, 0]) - twin.theta[:, 1])
    distance = np.where(gone, difference / (EPS * twin.amplification * (1.0 + twin.collisions)), 0.0)
    # a run on an arc is counted in full by the tracer, however long, but followed step by step by the twin
    limited = (twin.status == geo.Status.BOUNCE_LIMIT) & (traced.collisions >= COLLISIONS)
    near = gone & (distance <= ERROR_UNITS) & (traced.collisions == twin.collisions)
    return near | limited | ((traced.status == twin.status) & ~gone), distance


def _explained(wall: geo.Wall, traced: geo.Trace, x: Floats, theta: Floats) -> NDArray[np.bool_]:
    """Which rays the twin takes where the tracer took them, once moved by a few ulps of the cell or of the angle."""
    result = np.zeros(len(x), np.bool_)
    ulps = [sign * 2.0**k for k in range(-2, int(math.log2(CONDITION_ULPS)) + 1) for sign in (-1.0, 1.0)]
    moves = [move for ulp in ulps for move in ((ulp, 0.0), (0.0, ulp), (ulp, ulp), (ulp, -ulp))]
    for dx, dt in moves:
        rest = np.flatnonzero(~result)
        if not len(rest):
            break
        place, angle = x[rest] + dx * EPS * wall.period, theta[rest]
        angle = np.clip(angle + dt * EPS, 0.5 * angle, 0.5 * (angle + math.pi))
        result[rest] = _agree(_part(traced, rest), refined_trace(wall.scene, place, angle, COLLISIONS))[0]
    return result


def _part(traced: geo.Trace, rays: NDArray[np.int64]) -> geo.Trace:
    return geo.Trace(traced.x[rays], traced.theta[rays], traced.collisions[rays], traced.status[rays])


def _edges(wall: geo.Wall, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Rays at the edge between two numbers of collisions: a few more than ``count`` are tried, some pairs agree."""
    x = wall.period * rng.random(4 * count)
    low, high = np.sort(np.arccos(1.0 - 2.0 * rng.random((2, 4 * count))), axis=0)
    hits = [geo.trace(wall, x, angle, max_collisions=COLLISIONS).collisions for angle in (low, high)]
    chosen = np.flatnonzero(hits[0] != hits[1])[:count]
    x, low, high, first = x[chosen], low[chosen], high[chosen], hits[0][chosen]
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        before = geo.trace(wall, x, middle, max_collisions=COLLISIONS).collisions == first
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return x, low


KINDS: dict[str, Rays] = {"corners": aimed_rays, "grazing": grazing_rays}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.robustness", description=__doc__)
    parser.add_argument("--rays", type=int, default=RAYS, help="rays of each kind on all walls together")
    parser.add_argument("--precise", type=int, default=PRECISE_RAYS, help="rays in 50 digits, besides all in dispute")
    options = parser.parse_args()
    rays, precise = options.rays // len(WALLS), options.precise // (2 * len(WALLS))
    print(
        "| wall | rays | aimed | lost | flagged | conditioning | wrong | worst error/(eps derivative bounces) | "
        "in 50 digits | twin wrong |"
    )
    print("|" + "---|" * 10)
    rng = np.random.default_rng(0)
    for name, wall in WALLS.items():
        for kind, make in KINDS.items():
            x, theta = make(wall, rays, rng)
            v = judge(wall, x, theta)
            sample = np.column_stack([x, theta])[:: -(-rays // max(1, precise))]
            judged = np.concatenate([np.reshape(v.disagreements, (-1, 2)), sample])
            twins = wrong_twins(wall, judged[:, 0], judged[:, 1])
            print(
                f"| {name} | {v.rays} | {kind} | {v.lost} | {v.flagged} | {v.conditioned} | {v.wrong} "
                f"| {v.worst:.2g} | {len(judged)} | {twins} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
