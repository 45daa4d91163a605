"""Bounces a second on walls of all kinds, and the seconds to the first rays of a large profile."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from itertools import pairwise

import numpy as np

from asperity import geometry as geo
from asperity.bench.quantities import wall_of
from campaigns.cases.random_curved_walls import arc_over

from .timing import least_time

RAYS, REPEATS = 2**18, 45
LARGE_PROFILE, FIRST_RAYS = 200_000, 10**6
# Of the random profiles: exponent of the amplitudes, fraction of the wave numbers that are present, mean slope.
DECAY, SMOOTHED, SLOPE = 1.3, 0.125, 0.5


def profile_of(points: int) -> geo.Wall:
    """A random profile and its mirror image."""
    rng = np.random.default_rng(3)
    waves = np.arange(1, points // 2)
    spectrum = np.zeros(points // 2 + 1, complex)
    spectrum[1 : points // 2] = waves**-DECAY * np.exp(
        2j * np.pi * rng.random(len(waves)) - (waves / (SMOOTHED * points)) ** 2
    )
    heights = np.fft.irfft(spectrum, points)
    slope = np.sqrt(np.mean((np.diff(heights) * points) ** 2))
    return geo.Wall.from_profile(np.arange(points) / (points - 1.0), heights * SLOPE / slope)


def wall_of_arcs() -> geo.Wall:
    """A valley of six arcs, focusing and dispersing in turn."""
    points = [(0, 0), (0.15, -0.25), (0.35, -0.4), (0.5, -0.5), (0.7, -0.35), (0.85, -0.3), (1, 0)]
    # half angles .5 and .4 as heights over chords
    heights = (-0.5 * np.tan(0.25), 0.5 * np.tan(0.2))
    return geo.Wall([arc_over(*ends, heights[k % 2]) for k, ends in enumerate(pairwise(points))])


def random_polygon() -> geo.Wall:
    """A polygonal wall with sixteen random vertices below the opening."""
    rng = np.random.default_rng(16)
    x = np.concatenate([[0.0], np.sort(rng.random(14)), [1.0]])
    y = np.concatenate([[0.0], -0.1 - 0.8 * rng.random(14), [0.0]])
    return geo.Wall.from_vertices(np.column_stack([x, y]))


# Walls beside those of the standard set and those that have a name with parameters.
WALLS: dict[str, Callable[[], geo.Wall]] = {
    "valley of 6 arcs": wall_of_arcs,
    "skew Bezier": lambda: geo.Wall([geo.Bezier([(0, 0), (0.1, -0.6), (0.7, -0.5), (1, 0)])]),
    "32 Bezier pieces": lambda: geo.random_wall(geo.HeightCorrelation(0.1), 32, rms_slope=0.5, smooth=True, rng=3),
    "profile, 1,000 lines": lambda: profile_of(501),
    "profile, 10^5 lines": lambda: profile_of(50_001),
    "polygon of 16 vertices": random_polygon,
}


@cache
def wall_named(name: str) -> geo.Wall:
    """One of these walls, of the standard set, or as commands name it."""
    return WALLS[name]() if name in WALLS else wall_of(name)


def random_rays(wall: geo.Wall, rays: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays with uniform entries and uniform cosines."""
    rng = np.random.default_rng(0)
    return rng.random(rays) * wall.period, np.arccos(1.0 - 2.0 * rng.random(rays))


@cache
def bounces_a_second(name: str) -> tuple[float, float]:
    """Bounces a second on a wall on one thread and on two."""
    wall = wall_named(name)
    x, theta = random_rays(wall, RAYS)
    bounces = float(geo.trace(wall, x, theta).collisions.sum())
    one, two = (least_time(partial(geo.trace, wall, x, theta, threads=threads), REPEATS)[1] for threads in (1, 2))
    return bounces / one, bounces / two


def first_rays() -> None:
    """The steps from nothing to the first rays of a large profile."""
    wall = profile_of(LARGE_PROFILE)
    geo.trace(wall, *random_rays(wall, FIRST_RAYS))
