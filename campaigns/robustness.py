"""Rays aimed at corners and tangencies, and rays at grazing angles, all compared with another tracer.

``python -m campaigns.robustness`` traces a million of each on twelve walls against the double-double tracer, its twin.
A million rays aimed at the corners of random polygons of each kind in `POLYGONS` are traced against the tests'
brute-force tracer in 31 digits. The tests' tracer in 50 digits checks both references: on a thousand rays, and on every
ray where a reference and the tracer disagree.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from asperity import geometry as geo
from asperity.errors import WallError
from asperity.geometry.tracing.double_double.arithmetic import EPS_DOUBLE_DOUBLE
from asperity.geometry.tracing.double_double.rays import UNRESOLVED
from asperity.geometry.tracing.refinement import RefinedTrace, refined_trace
from campaigns.judges.brute_tracer import brute_trace
from campaigns.judges.precise_tracer import trace_precisely

from .pages import print_table

Floats = NDArray[np.float64]
EPS = 2.0**-52
# Allowed error on a ray that the twin leaves undecided: hundreds of bounces with a derivative of about 10^6.
OPEN_ERROR = 1e-6
RAYS = 1_000_000
# Rays traced in 50 digits besides the rays in dispute, on all walls together.
PRECISE_RAYS = 1000
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
# A disagreement is due to conditioning if the twin, with its ray moved by at most this many ulps, agrees with the
# tracer.
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
    "four arcs": geo.Wall(
        [
            geo.Arc(
                (0.1546391703711259, -0.02041208723651003), 0.15598053185709104, 3.0103531934108654, 4.617960019657345
            ),
            geo.Arc(
                (0.4178723959764181, -0.1979007325141735), 0.27882584942072397, 3.0618778250273615, 4.723808942654955
            ),
            geo.Arc(
                (0.13104489827115823, -0.029936759920226264),
                0.532645878892581,
                -0.9950349420962289,
                0.056233502659632895,
            ),
            geo.Arc(
                (0.8314244154251915, 0.19555783647241926), 0.25818713198087906, -2.2822297626428414, -0.8593628909469517
            ),
        ],
        period=1.0,
    ),
}


# Number of random polygons of each kind, and ranges of their peaks and plates, uniform on a logarithmic scale.
POLYGON_WALLS = 100
PEAK_ANGLES = (1e-4, 0.1)
PLATE_THICKNESS = (1e-17, 1e-12)
# Fraction of the plates that have no thickness.
THIN_FRACTION = 1 / 3
# Distances from a corner at which rays are aimed.
BESIDE_CORNERS = (1e-17, 1e-9)
FLOOR = -0.9
# Least sine of the angle of rays at edges between itineraries.
SHALLOWEST = 1e-3

Point = tuple[float, float]
# Traces the rays of a wall to the end, as a reference.
Follow = Callable[[geo.Wall, Floats, Floats], RefinedTrace]
# Makes positions and angles of a number of rays on a wall.
Rays = Callable[[geo.Wall, int, np.random.Generator], tuple[Floats, Floats]]
COUNTED = ("rays", "lost", "flagged", "conditioned", "wrong")


@dataclass(frozen=True)
class Verdict:
    """Counts of rays on one wall: all, unresolved, flagged, wrong because of conditioning, and otherwise wrong."""

    rays: int
    lost: int
    flagged: int
    conditioned: int
    wrong: int
    worst: float
    disagreements: tuple[tuple[float, float], ...]
    # unresolved or wrong rays
    failures: tuple[tuple[float, float], ...]


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


def twin_trace(wall: geo.Wall, x: Floats, theta: Floats) -> RefinedTrace:
    """Trace with the double-double twin."""
    return refined_trace(wall.scene, x, theta, COLLISIONS)


def brute_force(wall: geo.Wall, x: Floats, theta: Floats) -> RefinedTrace:
    """Trace with the brute-force tracer of polygons."""
    return brute_trace(wall, x, theta, COLLISIONS)


def rays_beside_corners(wall: geo.Wall, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Two thirds of the rays at positions on the wall's segments next to their ends, the rest as `aimed_rays`."""
    chains = [wall.vertices, *wall.island_vertices]
    start, end = (np.concatenate([chain[part] for chain in chains]) for part in (slice(-1), slice(1, None)))
    straight = 2 * count // 3
    chosen = rng.integers(len(start), size=straight)
    corner, other = start[chosen], end[chosen]
    back = rng.random(straight) < 0.5
    corner, other = np.where(back[:, None], other, corner), np.where(back[:, None], corner, other)
    along = (other - corner) / np.hypot(*(other - corner).T)[:, None]
    target = corner + _log_uniform(BESIDE_CORNERS, rng, straight)[:, None] * along
    target = np.where((target[:, 1] < -0.01)[:, None], target, [0.5 * wall.period, FLOOR])
    x = wall.period * rng.random(straight)
    # half of the rays are steep, along the peaks and plates
    steep = rng.random(straight) < 0.5
    x[steep] = np.clip(target[steep, 0] + rng.normal(0.0, 0.05, steep.sum()), 1e-3 * wall.period, 0.999 * wall.period)
    theta = np.clip(np.arctan2(-target[:, 1], x - target[:, 0]), 1e-12, math.pi - 1e-12)
    rest_x, rest_theta = aimed_rays(wall, count - straight, rng)
    # over an open wall flatter rays would pass a thousand cells
    rest_theta = np.where(np.sin(rest_theta) < SHALLOWEST, 1.0, rest_theta)
    return np.concatenate([x, rest_x]), np.concatenate([theta, rest_theta])


def _log_uniform(limits: tuple[float, float], rng: np.random.Generator, count: int) -> Floats:
    return np.exp(rng.uniform(*np.log(limits), count))


def _slots(rng: np.random.Generator) -> Floats:
    """The midpoints of 3 to 6 intervals of equal width in [0, 1]."""
    count = int(rng.integers(3, 7))
    return (np.arange(count) + 0.5) / count


def _ground(rng: np.random.Generator, feet: list[list[Point]]) -> geo.Wall:
    """A hollow with the given vertices from left to right, between vertical sides or slopes."""
    left, right = ([(x, float(rng.uniform(-0.9, -0.5)))] if rng.random() < 0.5 else [] for x in (0.0, 1.0))
    points = [(0.0, 0.0), *left, *(point for foot in feet for point in foot), *right, (1.0, 0.0)]
    return geo.Wall.from_vertices(_without_repeats(points))


def _without_repeats(points: list[Point]) -> list[Point]:
    return [point for k, point in enumerate(points) if k == 0 or point != points[k - 1]]


def sharp_peaks(rng: np.random.Generator) -> geo.Wall:
    """A polygon with vertical or leaning sharp peaks, from 1e-4 to 0.1 radians."""
    feet = []
    for x in _slots(rng).tolist():
        bottom, top = float(rng.uniform(-1.0, -0.6)), float(rng.uniform(-0.5, -0.02))
        half = (top - bottom) * math.tan(0.5 * float(_log_uniform(PEAK_ANGLES, rng, 1)[0]))
        lean = float(rng.choice([0.0, rng.uniform(-0.04, 0.04)]))
        feet.append([(x - half, bottom), (x + lean, top), (x + half, bottom)] if rng.random() < 0.7 else [(x, bottom)])
    return _ground(rng, feet)


def _thickness(rng: np.random.Generator) -> float:
    return 0.0 if rng.random() < THIN_FRACTION else float(_log_uniform(PLATE_THICKNESS, rng, 1)[0])


def standing_plates(rng: np.random.Generator) -> geo.Wall:
    """A polygon with plates on its ground."""
    feet = []
    for x in _slots(rng).tolist():
        bottom, top = float(rng.uniform(-1.0, -0.6)), float(rng.uniform(-0.5, -0.02))
        lean, thickness = float(rng.choice([0.0, rng.uniform(-0.04, 0.04)])), _thickness(rng)
        plate = [(x, bottom), (x + lean, top), (x + lean + thickness, top), (x + thickness, bottom)]
        feet.append(plate if rng.random() < 0.7 else [(x, bottom)])
    return _ground(rng, feet)


def _floor(rng: np.random.Generator, islands: list[list[Point]]) -> geo.Wall:
    """Islands over a flat floor, with or without side walls."""
    floor = [(0.0, FLOOR), (1.0, FLOOR)]
    path = [(0.0, 0.0), *floor, (1.0, 0.0)] if rng.random() < 0.5 else floor
    pieces = [geo.Segment(a, b) for a, b in pairwise(path)]
    loops = [[geo.Segment(a, b) for a, b in pairwise(_without_repeats([*loop, loop[0]]))] for loop in islands]
    return geo.Wall(pieces, period=1.0, islands=loops)


def floating_plates(rng: np.random.Generator) -> geo.Wall:
    """Plates above a floor, on it, in the opening or in a side; vertical, level or tilted."""
    islands = [[(0.0, -0.7), (0.0, -0.2)]] if rng.random() < 0.3 else []
    for x in _slots(rng).tolist():
        half, thickness = float(rng.uniform(0.02, 0.07)), _thickness(rng)
        y = float(rng.choice([FLOOR, 0.0, *rng.uniform(-0.75, -0.15, 4)], p=[0.15, 0.05, 0.2, 0.2, 0.2, 0.2]))
        angle = float(rng.choice([0.0, 0.5 * math.pi, rng.uniform(-1.5, 1.5)]))
        tilt = (0.0, 1.0) if angle == 0.5 * math.pi else (math.cos(angle), math.sin(angle))
        ex, ey = (1.0, 0.0) if y in (FLOOR, 0.0) else tilt
        a, b = (x - half * ex, y - half * ey), (x + half * ex, y + half * ey)
        # the other face is below, except for plates on the floor
        down = -thickness if y == FLOOR else thickness
        c, d = (b[0] + down * ey, b[1] - down * ex), (a[0] + down * ey, a[1] - down * ex)
        islands.append([a, b, c, d])
    return _floor(rng, islands)


def sharp_islands(rng: np.random.Generator) -> geo.Wall:
    """Triangles with a sharp tip, some with an edge or a tip on the floor."""
    islands = []
    for x in _slots(rng).tolist():
        length, direction = float(rng.uniform(0.03, 0.07)), float(rng.uniform(0.0, 2.0 * math.pi))
        half = length * math.tan(0.5 * float(_log_uniform(PEAK_ANGLES, rng, 1)[0]))
        ex, ey = math.cos(direction), math.sin(direction)
        y = float(rng.uniform(-0.75, -0.15))
        loop = [
            (x + length * ex, y + length * ey),
            (x - length * ex - half * ey, y - length * ey + half * ex),
            (x - length * ex + half * ey, y - length * ey - half * ex),
        ]
        if rng.random() < 0.3:
            loop = [(x + half, FLOOR), (x - half, FLOOR), (x + 0.3 * length * ex, FLOOR + length)]
        elif rng.random() < 0.3:
            loop = [(x, FLOOR), (x - half, FLOOR + length), (x + half, FLOOR + length)]
        islands.append(loop)
    return _floor(rng, islands)


POLYGONS: dict[str, Callable[[np.random.Generator], geo.Wall]] = {
    "sharp peaks": sharp_peaks,
    "standing plates": standing_plates,
    "floating plates": floating_plates,
    "sharp islands": sharp_islands,
}


def random_polygon(kind: str, rng: np.random.Generator) -> geo.Wall:
    """A polygon of a kind in `POLYGONS` that `geo.Wall` accepts."""
    while True:
        try:
            return POLYGONS[kind](rng)
        except WallError:
            continue


def judge(wall: geo.Wall, x: Floats, theta: Floats, follow: Follow = twin_trace) -> Verdict:
    """Compare the tracer with a reference tracer on every ray."""
    traced = geo.trace(wall, x, theta, max_collisions=COLLISIONS)
    twin = follow(wall, x, theta)
    flagged = (traced.status == geo.Status.CORNER) | (traced.status == geo.Status.GRAZING)
    same, distance = _agree(wall, traced, twin)
    other = np.flatnonzero(~same)
    # unresolved: the tracer ends a ray that the twin follows to its end, or the twin itself meets nothing
    lost = (flagged & (twin.status == geo.Status.ESCAPED)) | (twin.status == UNRESOLVED)
    explained = _explained(wall, _part(traced, other), x[other], theta[other], follow)
    # the twin flags a ray if half an ulp of its angle meets a corner; a tracer that passes this corner is not wrong
    for k in np.flatnonzero(~explained & (twin.status[other] != geo.Status.ESCAPED)):
        explained[k] = _is_precise(wall, traced, other[k], float(x[other[k]]), float(theta[other[k]]))
    worst = float(distance[same].max(initial=0.0))
    failed = lost.copy()
    failed[other[~explained]] = True
    return Verdict(
        len(x), int(lost.sum()), int(flagged.sum()), int(explained.sum()), int((~explained).sum()), worst,
        tuple(zip(x[other].tolist(), theta[other].tolist(), strict=True)),
        tuple(zip(x[failed].tolist(), theta[failed].tolist(), strict=True)),
    )  # fmt: skip


def measure_robustness(rays: int) -> dict[str, Verdict]:
    """The verdict for each kind of rays, divided among the walls and summed."""
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
            found[kind] = Verdict(*sums, max(one.worst for one in verdicts), (), ())
    return found


def wrong_twins(wall: geo.Wall, x: Floats, theta: Floats, follow: Follow = twin_trace) -> int:
    """The number of these rays on which a reference and the tracer in 50 digits disagree."""
    twin = follow(wall, x, theta)
    wrong = 0
    for k in np.flatnonzero(twin.status == geo.Status.ESCAPED):
        ray = trace_precisely(wall.scene, float(x[k]), float(theta[k]), COLLISIONS)
        if ray.theta is None or ray.bounces != twin.collisions[k]:
            wrong += 1
            continue
        difference = abs(float((ray.theta - twin.theta[k, 0]) - twin.theta[k, 1]))
        room = TWIN_UNITS * EPS_DOUBLE_DOUBLE * twin.amplification[k] * (1.0 + twin.collisions[k])
        # the twin's angle consists of two doubles, which limits its accuracy
        wrong += difference > room + EPS**2 * abs(twin.theta[k, 0])
    return wrong


def _is_precise(wall: geo.Wall, traced: geo.Trace, k: int, x: float, theta: float) -> bool:
    """Whether the tracer agrees with 50 digits on a ray that its twin left undecided or flagged."""
    ray = trace_precisely(wall.scene, x, theta, COLLISIONS)
    if ray.theta is None:
        return bool(traced.status[k] == geo.Status.BOUNCE_LIMIT)
    apart = max(abs(float(ray.theta) - traced.theta[k]), abs(float(ray.x) - traced.x[k]) * math.sin(float(ray.theta)))
    return bool(ray.bounces == traced.collisions[k]) and apart < OPEN_ERROR


def _agree(wall: geo.Wall, traced: geo.Trace, twin: RefinedTrace) -> tuple[NDArray[np.bool_], Floats]:
    """Which rays end alike within conditioning, and their distances in units of EPS times the derivative.

    The distance is the larger of the difference of angles and the difference of positions across the ray.
    """
    gone = (traced.status == geo.Status.ESCAPED) & (twin.status == geo.Status.ESCAPED)
    difference = np.abs((traced.theta - twin.theta[:, 0]) - twin.theta[:, 1])
    across = np.abs((traced.x - twin.x[:, 0]) - twin.x[:, 1]) * np.sin(twin.theta[:, 0]) / (wall.period + wall.depth)
    difference = np.maximum(difference, across)
    distance = np.where(gone, difference / (EPS * twin.amplification * (1.0 + twin.collisions)), 0.0)
    # the tracer counts a whole run on an arc, but the twin follows it step by step
    limited = (twin.status == geo.Status.BOUNCE_LIMIT) & (traced.collisions >= COLLISIONS)
    near = gone & (distance <= ERROR_UNITS) & (traced.collisions == twin.collisions)
    return near | limited | ((traced.status == twin.status) & ~gone), distance


def _explained(wall: geo.Wall, traced: geo.Trace, x: Floats, theta: Floats, follow: Follow) -> NDArray[np.bool_]:
    """Which rays of the twin agree with the tracer after a move by a few ulps of the cell or of the angle."""
    result = np.zeros(len(x), np.bool_)
    ulps = [sign * 2.0**k for k in range(-2, int(math.log2(CONDITION_ULPS)) + 1) for sign in (-1.0, 1.0)]
    moves = [move for ulp in ulps for move in ((ulp, 0.0), (0.0, ulp), (ulp, ulp), (ulp, -ulp))]
    for dx, dt in moves:
        rest = np.flatnonzero(~result)
        if not len(rest):
            break
        place, angle = x[rest] + dx * EPS * wall.period, theta[rest]
        angle = np.clip(angle + dt * EPS, 0.5 * angle, 0.5 * (angle + math.pi))
        result[rest] = _agree(wall, _part(traced, rest), follow(wall, place, angle))[0]
    return result


def _part(traced: geo.Trace, rays: NDArray[np.int64]) -> geo.Trace:
    return geo.Trace(traced.x[rays], traced.theta[rays], traced.collisions[rays], traced.status[rays])


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


KINDS: dict[str, Rays] = {"corners": aimed_rays, "grazing": grazing_rays}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.robustness", description=__doc__)
    parser.add_argument("--rays", type=int, default=RAYS, help="rays of each kind on all walls together")
    parser.add_argument("--precise", type=int, default=PRECISE_RAYS, help="rays in 50 digits, besides all in dispute")
    options = parser.parse_args()
    failures: list[str] = []
    heads = "wall | rays | aimed | lost | flagged | conditioning | wrong | worst error/(eps derivative bounces)"
    print_table(f"{heads} | in 50 digits | judge wrong", _rows(options.rays, options.precise, failures))
    print("\nRays that are lost or wrong, with the number of a random wall:", *(failures or ["none"]), sep="\n")


def _rows(all_rays: int, all_precise: int, failures: list[str]) -> Iterator[str]:
    """The rows of the table; unresolved or wrong rays are appended to ``failures``."""
    rng = np.random.default_rng(0)
    rays, precise = all_rays // len(WALLS), all_precise // (2 * len(WALLS))
    for name, wall in WALLS.items():
        for kind, make in KINDS.items():
            row = _judged(wall, make, rays, precise, twin_trace, rng)
            yield _cells(name, kind, [row])
            failures += [f"{name}: x = {x!r}, theta = {theta!r}" for x, theta in row[0].failures]
    rays, precise = all_rays // POLYGON_WALLS, all_precise // POLYGON_WALLS
    for name in POLYGONS:
        rows = []
        for number in range(POLYGON_WALLS):
            own = np.random.default_rng([1, number])
            wall = random_polygon(name, own)
            rows.append(_judged(wall, rays_beside_corners, rays, precise, brute_force, own))
            failures += [f"{name} {number}: x = {x!r}, theta = {theta!r}" for x, theta in rows[-1][0].failures]
        yield _cells(f"{POLYGON_WALLS} random: {name}", "beside corners", rows)


def _judged(
    wall: geo.Wall, make: Rays, rays: int, precise: int, follow: Follow, rng: np.random.Generator
) -> tuple[Verdict, int, int]:
    """The verdict on rays of a wall, the number traced in 50 digits, and the number of errors of the reference."""
    x, theta = make(wall, rays, rng)
    verdict = judge(wall, x, theta, follow)
    sample = np.column_stack([x, theta])[:: -(-rays // max(1, precise))]
    judged = np.concatenate([np.reshape(verdict.disagreements, (-1, 2)), sample])
    return verdict, len(judged), wrong_twins(wall, judged[:, 0], judged[:, 1], follow)


def _cells(name: str, kind: str, rows: list[tuple[Verdict, int, int]]) -> str:
    """The sums over several walls as a row of the table."""
    verdicts = [row[0] for row in rows]
    rays, *others = (sum(getattr(one, count) for one in verdicts) for count in COUNTED)
    lost, flagged, conditioned, wrong = others
    worst = max(one.worst for one in verdicts)
    precise, twins = sum(row[1] for row in rows), sum(row[2] for row in rows)
    return (
        f"{name} | {rays} | {kind} | {lost} | {flagged} | {conditioned} | {wrong} | {worst:.2g} | {precise} | {twins}"
    )


if __name__ == "__main__":
    main()
