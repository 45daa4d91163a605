"""Bounces a second on walls of all kinds, and the seconds to the first rays of a large profile."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise

import numpy as np

from asperity import geometry as geo

RAYS, REPEATS = 2**18, 15
# How often all walls are measured, one after the other: other programs on a machine disturb for seconds.
TURNS = 3
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
    points = np.array([(0, 0), (0.15, -0.25), (0.35, -0.4), (0.5, -0.5), (0.7, -0.35), (0.85, -0.3), (1, 0)])
    pieces = []
    for k, (start, end) in enumerate(pairwise(points)):
        half, side = (0.4, 1.0) if k % 2 else (0.5, -1.0)
        edge = end - start
        radius = 0.5 * np.hypot(*edge) / np.sin(half)
        to_centre = side * np.array([-edge[1], edge[0]]) / np.hypot(*edge)
        middle = np.arctan2(-to_centre[1], -to_centre[0])
        centre = 0.5 * (start + end) + radius * np.cos(half) * to_centre
        pieces.append(geo.Arc(centre, radius, middle - side * half, middle + side * half))
    return geo.Wall(pieces)


WALLS: dict[str, Callable[[], geo.Wall]] = {
    "triangular teeth (2 lines)": lambda: geo.triangular_teeth(0.7),
    "focusing arc (1 arc)": lambda: geo.focusing_arcs(1.2),
    "mushroom (6 lines, 1 arc)": lambda: geo.mushrooms(0.3, 0.5),
    "Koch 4 (256 lines)": lambda: geo.koch(4),
    "dispersing arcs": lambda: geo.dispersing_arcs(1.0),
    "valley of 6 arcs": wall_of_arcs,
    "double parabola (Bezier)": geo.double_parabola,
    "32 Bezier pieces": lambda: geo.random_wall(geo.HeightCorrelation(0.1), 32, rms_slope=0.5, smooth=True, rng=3),
    "profile, 1,000 lines": lambda: profile_of(501),
    "profile, 10^5 lines": lambda: profile_of(50_001),
}


def random_rays(wall: geo.Wall, rays: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays with uniform entries and uniform cosines."""
    rng = np.random.default_rng(0)
    return rng.random(rays) * wall.period, np.arccos(1.0 - 2.0 * rng.random(rays))


def bounces_a_second(rays: int = RAYS) -> dict[str, tuple[float, float]]:
    """Of each wall the bounces a second on one thread and on two, from least times of traces in turn."""
    walls = {name: make() for name, make in WALLS.items()}
    bounces = {name: geo.trace(wall, *random_rays(wall, rays)).collisions.sum() for name, wall in walls.items()}
    times = {name: np.full(2, np.inf) for name in walls}
    for name, wall in (item for _ in range(TURNS) for item in walls.items()):
        x, theta = random_rays(wall, rays)
        for _ in range(REPEATS):
            for threads in (1, 2):
                begin = time.perf_counter()
                geo.trace(wall, x, theta, threads=threads)
                times[name][threads - 1] = min(times[name][threads - 1], time.perf_counter() - begin)
    return {name: (float(bounces[name] / one), float(bounces[name] / two)) for name, (one, two) in times.items()}


def first_rays() -> None:
    """The steps from nothing to the first rays of a large profile."""
    wall = profile_of(LARGE_PROFILE)
    geo.trace(wall, *random_rays(wall, FIRST_RAYS))
