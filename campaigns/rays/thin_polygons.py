"""Rays beside the corners of polygons with sharp peaks, plates thinner than doubles, and islands: is any lost or wrong?

The judge is the plain tracer in 50 digits. It says that a ray meets a corner if half an ulp of its angle, and a little
more, decides which pieces it meets.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

import mpmath as mp
import numpy as np
from numpy.typing import NDArray

from asperity import geometry as geo
from asperity.core.checks import Floats
from asperity.errors import WallError
from asperity.geometry.tracing.refinement import RefinedTrace
from campaigns.engine import Campaign, Judged
from campaigns.judges.plain_tracer import DIGITS, PlainTracer

from .aimed_rays import COLLISIONS, AimedRays, aimed_rays, judge

RAYS = 100
# Ranges of peaks and plates, uniform on a logarithmic scale.
PEAK_ANGLES = (1e-4, 0.1)
PLATE_THICKNESS = (1e-17, 1e-12)
# Fraction of the plates that have no thickness.
THIN_FRACTION = 1 / 3
# Distances from a corner at which rays are aimed.
BESIDE_CORNERS = (1e-17, 1e-9)
FLOOR = -0.9
# Least sine of the angle of rays at edges between itineraries.
SHALLOWEST = 1e-3
# The half ulp of an angle, with some room: a ray that another judge calls a corner hit is one here.
HALF_ULP = 0.5 * (1.0 + 1e-4)

Point = tuple[float, float]


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


def draw(number: int) -> AimedRays:
    """A polygon of each kind in turn, and rays."""
    kind, rng = list(POLYGONS)[number % len(POLYGONS)], np.random.default_rng([1, number // len(POLYGONS)])
    wall = random_polygon(kind, rng)
    return AimedRays(kind, wall, *rays_beside_corners(wall, RAYS, rng))


def follow_plainly(wall: geo.Wall, x: Floats, theta: Floats, flagged: NDArray[np.bool_]) -> RefinedTrace:
    """Trace by the plain tracer in many digits, with ends as double-doubles."""
    n, ends = len(x), np.zeros((2, len(x), 2))
    collisions, status, size = np.zeros(n, np.int64), np.full(n, geo.Status.ESCAPED, np.uint8), wall.period + wall.depth
    length = np.zeros(n)
    with mp.workdps(DIGITS):
        tracer = PlainTracer(wall, precise=True)

        def pieces(angle: mp.mpf) -> object:
            ray = tracer.trace(x[k], angle, COLLISIONS)
            return ray and ray.path

        for k in range(n):
            ray = tracer.trace(x[k], theta[k], COLLISIONS)
            if ray is None:
                status[k] = geo.Status.BOUNCE_LIMIT
                continue
            collisions[k], length[k] = ray.hits, ray.length
            for end, value in zip(ends, (ray.x, ray.theta), strict=True):
                end[k] = float(value), float(value - mp.mpf(float(value)))
            if flagged[k]:
                half = mp.mpf(float(np.spacing(theta[k]))) * HALF_ULP
                if pieces(mp.mpf(theta[k]) - half) != pieces(mp.mpf(theta[k]) + half):
                    status[k] = geo.Status.CORNER
    return RefinedTrace(*ends, collisions, status, np.sqrt(2.0 + (length / size) ** 2), np.zeros(n))


def judge_plainly(case: AimedRays) -> Iterator[Judged]:
    """Compare the tracer with the plain one."""
    yield from judge(case, follow_plainly)


CAMPAIGNS = (
    Campaign("thin-polygons", "Is any ray beside a corner lost or wrong?", draw, judge_plainly, 40_000, range(8)),
)
