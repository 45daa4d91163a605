"""Rays aimed at corners and tangencies, and rays at grazing angles: is any lost or wrong?

The judge is the double-double twin of the tracer. The tracer in 50 digits judges the twin, on some rays of each case
and on every ray where the twin and the tracer disagree.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from asperity import geometry as geo
from asperity.core.checks import Floats
from asperity.core.rounding import EPS
from asperity.geometry.tracing.compiled.refined_tracing import UNRESOLVED
from asperity.geometry.tracing.double_double.numbers import EPS_DOUBLE_DOUBLE
from asperity.geometry.tracing.refinement import RefinedTrace, refined_trace
from asperity.geometry.tracing.tracing import Trace
from campaigns.engine import Campaign, Judged
from campaigns.judges.plain_tracer import trace_precisely

RAYS = 500
# Allowed error on a ray that the twin leaves undecided: hundreds of bounces with a derivative of about 10^6.
OPEN_ERROR = 1e-6
# Every so many rays one is traced in 50 digits, besides the rays in dispute.
PRECISE = 100
# Allowed error of the twin, in units of its rounding error times the derivative and the bounces.
TWIN_UNITS = 2.0**10
# Rays still inside after this many collisions are not compared: both tracers end them with the bounce limit.
COLLISIONS = 200
# Largest deviation of an aimed ray from its target, in ulps of its angle.
AIM_ULPS = 4
# Bisections from an interval of angles to two neighbouring doubles.
BISECTIONS = 64
# Allowed error of the double tracer, in units of EPS times the norm of the derivative times the bounces; measured < 5.
ERROR_UNITS = 32.0
# A disagreement is due to conditioning if the judge, with its ray moved by so many ulps of the cell or of the angle,
# agrees with the tracer.
CONDITION_ULPS = [sign * 2.0**k for k in range(-2, 7) for sign in (-1.0, 1.0)]
MOVES = list(product(CONDITION_ULPS, ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0))))

FOUR_ARCS = (
    (0.1546391703711259, -0.02041208723651003, 0.15598053185709104, 3.0103531934108654, 4.617960019657345),
    (0.4178723959764181, -0.1979007325141735, 0.27882584942072397, 3.0618778250273615, 4.723808942654955),
    (0.13104489827115823, -0.029936759920226264, 0.532645878892581, -0.9950349420962289, 0.056233502659632895),
    (0.8314244154251915, 0.19555783647241926, 0.25818713198087906, -2.2822297626428414, -0.8593628909469517),
)
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
    "four arcs": geo.Wall([geo.Arc((x, y), radius, start, end) for x, y, radius, start, end in FOUR_ARCS]),
}


@dataclass(frozen=True)
class AimedRays:
    """Rays into a wall."""

    kind: str
    wall: geo.Wall
    x: Floats
    theta: Floats


# Traces the rays of a wall to the end, and says of those in the mask whether they meet a corner.
Follow = Callable[[geo.Wall, Floats, Floats, NDArray[np.bool_]], RefinedTrace]


def draw(number: int) -> AimedRays:
    """The walls in turn, with aimed and grazing rays in turn."""
    name, rng = list(WALLS)[number % len(WALLS)], np.random.default_rng([0, number])
    kind, make = (("aimed", aimed_rays), ("grazing", grazing_rays))[number // len(WALLS) % 2]
    return AimedRays(f"{name}, {kind}", WALLS[name], *make(WALLS[name], RAYS, rng))


def aimed_rays(wall: geo.Wall, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Half of the rays aim at visible joints; half lie at edges between itineraries, found by bisection.

    Such an edge is a later corner or a tangency. ``rng`` also spreads the rays by a few ulps around their targets.
    """
    joints = wall.scene.joints[wall.scene.joints[:, 1] < 0.0]
    # a wall of single arcs has no joint below its openings
    straight = count // 2 if len(joints) else 0
    target = joints[rng.integers(max(1, len(joints)), size=straight)]
    x = wall.period * rng.random(straight)
    theta = np.arctan2(-target[:, 1], x - target[:, 0])
    edges_x, edges_theta = _edges(wall, (count - straight + AIM_ULPS) // (AIM_ULPS + 1), rng)
    if not len(edges_x):
        # no edge was found among the few tries
        edges_x, edges_theta = np.array([0.5 * wall.period]), np.array([1.0])
    copies = -(-(count - straight) // max(1, len(edges_x)))
    x = np.concatenate([x, np.repeat(edges_x, copies)[: count - straight]])
    theta = np.concatenate([theta, np.repeat(edges_theta, copies)[: count - straight]])
    return x, theta + rng.integers(-AIM_ULPS, AIM_ULPS + 1, size=count) * np.spacing(theta)


def grazing_rays(wall: geo.Wall, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Angles 1e-12 to 1e-3 from either side, uniform on a logarithmic scale."""
    theta = 10.0 ** rng.uniform(-12.0, -3.0, count)
    return wall.period * rng.random(count), np.where(rng.random(count) < 0.5, theta, math.pi - theta)


def _edges(wall: geo.Wall, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Rays at the edge between two numbers of collisions; more pairs than ``count`` are tried, because some agree."""
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


def follow_twin(wall: geo.Wall, x: Floats, theta: Floats, flagged: NDArray[np.bool_]) -> RefinedTrace:
    """Trace with the double-double twin."""
    return refined_trace(wall.scene, x, theta, COLLISIONS)


def judge(case: AimedRays, follow: Follow = follow_twin) -> Iterator[Judged]:
    """Compare the tracer with the judge on every ray, and the judge with 50 digits on some and on those in dispute."""
    wall, x, theta = case.wall, case.x, case.theta
    traced = geo.trace(wall, x, theta, max_collisions=COLLISIONS)
    flagged = (traced.status == geo.Status.CORNER) | (traced.status == geo.Status.GRAZING)
    known = follow(wall, x, theta, flagged)
    same, units = agreement(wall, traced, known)
    moved = ~same
    moved[moved] = explained(wall, part(traced, ~same), x[~same], theta[~same], follow)
    # the twin flags a ray if half an ulp of its angle meets a corner; a tracer that passes this corner is not wrong
    for k in np.flatnonzero(~same & ~moved & (known.status != geo.Status.ESCAPED)):
        moved[k] = _is_precise(wall, traced, k, float(x[k]), float(theta[k]))
    # unresolved: the tracer ends a ray that the judge follows to its end, or the judge itself meets nothing
    lost = (flagged & (known.status == geo.Status.ESCAPED)) | (known.status == UNRESOLVED)
    failed = lost | ~(same | moved)
    for word, rays in (("", same & ~flagged), ("flagged", same & flagged), ("conditioned", moved)):
        if number := int((rays & ~failed).sum()):
            worst = float(units[rays & ~failed].max()) if not word else 0.0
            yield Judged(case.kind, 0.0 if word else ERROR_UNITS, worst, outcome=word, number=number)
    for k in np.flatnonzero(failed):
        what = "lost" if lost[k] else "wrong"
        yield Judged(case.kind, fault=f"{what}: x = {float(x[k])!r}, theta = {float(theta[k])!r}")
    disputed = ~same
    disputed[PRECISE - 1 :: PRECISE] = True
    yield from _judges_compared(case, known, np.flatnonzero(disputed & (known.status == geo.Status.ESCAPED)))


def _judges_compared(case: AimedRays, known: RefinedTrace, rays: NDArray[np.int64]) -> Iterator[Judged]:
    """The judge of these rays, as double-doubles, against the tracer in 50 digits."""
    for k in rays:
        ray = trace_precisely(case.wall, float(case.x[k]), float(case.theta[k]), COLLISIONS)
        right = ray is not None and ray.hits == known.collisions[k]
        room = TWIN_UNITS * EPS_DOUBLE_DOUBLE * known.amplification[k] * (1.0 + known.collisions[k])
        # the judge's angle consists of two doubles, which limits its accuracy
        room += EPS**2 * abs(known.theta[k, 0])
        right = right and abs(float((ray.theta - known.theta[k, 0]) - known.theta[k, 1])) <= room
        fault = "" if right else f"x = {float(case.x[k])!r}, theta = {float(case.theta[k])!r}"
        yield Judged("the judge in 50 digits", fault=fault)


def _is_precise(wall: geo.Wall, traced: Trace, k: int, x: float, theta: float) -> bool:
    """Whether the tracer agrees with 50 digits on a ray that its judge left undecided or flagged."""
    ray = trace_precisely(wall, x, theta, COLLISIONS)
    if ray is None:
        return bool(traced.status[k] == geo.Status.BOUNCE_LIMIT)
    apart = max(abs(float(ray.theta) - traced.theta[k]), abs(float(ray.x) - traced.x[k]) * math.sin(float(ray.theta)))
    return bool(ray.hits == traced.collisions[k]) and apart < OPEN_ERROR


def agreement(wall: geo.Wall, traced: Trace, known: RefinedTrace) -> tuple[NDArray[np.bool_], Floats]:
    """Which rays end alike within conditioning, and their distances in units of EPS times the derivative.

    The distance is the larger of the difference of angles and the difference of positions across the ray.
    """
    gone = (traced.status == geo.Status.ESCAPED) & (known.status == geo.Status.ESCAPED)
    difference = np.abs((traced.theta - known.theta[:, 0]) - known.theta[:, 1])
    across = np.abs((traced.x - known.x[:, 0]) - known.x[:, 1]) * np.sin(known.theta[:, 0]) / (wall.period + wall.depth)
    difference = np.maximum(difference, across)
    distance = np.where(gone, difference / (EPS * known.amplification * (1.0 + known.collisions)), 0.0)
    # the tracer counts a whole run on an arc, but the twin follows it step by step
    limited = (known.status == geo.Status.BOUNCE_LIMIT) & (traced.collisions >= COLLISIONS)
    near = gone & (distance <= ERROR_UNITS) & (traced.collisions == known.collisions)
    return near | limited | ((traced.status == known.status) & ~gone), distance


def explained(wall: geo.Wall, traced: Trace, x: Floats, theta: Floats, follow: Follow) -> NDArray[np.bool_]:
    """Which rays of the judge agree with the tracer after a move by a few ulps of the cell or of the angle."""
    result = np.zeros(len(x), np.bool_)
    for ulps, (dx, dt) in MOVES:
        rest = ~result
        if not rest.any():
            break
        angle = np.clip(theta[rest] + ulps * dt * EPS, 0.5 * theta[rest], 0.5 * (theta[rest] + math.pi))
        here = part(traced, rest)
        known = follow(wall, x[rest] + ulps * dx * EPS * wall.period, angle, here.status == geo.Status.CORNER)
        result[rest] = agreement(wall, here, known)[0]
    return result


def part(traced: Trace, rays: NDArray[np.bool_]) -> Trace:
    """These rays of a trace."""
    return Trace(traced.x[rays], traced.theta[rays], traced.collisions[rays], traced.status[rays])


CAMPAIGNS = (Campaign("aimed-rays", "Is any ray lost or wrong?", draw, judge, 4000, range(24)),)
