"""Bounces a second on walls of all kinds, and the first rays of a large profile (python -m campaigns.bounces).

The repeats take one thread and two in turn, so that both meet the same state of the machine. The least times count: on
one thread also in processor seconds, which other processes disturb less. Two threads are measured with eight times as
many rays, too, because a call takes .1 to .2 ms until both threads run and until the caller knows that they have ended.
``--profile`` measures only the profile of 200,000 points.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from asperity import geometry as geo
from asperity.core.tables import table

RAYS, REPEATS = 2**18, 15
MORE, REPEATS_OF_MORE = 8, 3
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


@dataclass(frozen=True)
class Throughput:
    """Bounces a ray on one wall, and bounces a second: of a processor's time, on one thread, and on two.

    ``speed_up_of_more`` compares two threads with one for `MORE` times as many rays.
    """

    wall: str
    bounces_per_ray: float
    work: float
    one_thread: float
    two_threads: float
    speed_up_of_more: float

    @property
    def speed_up(self) -> float:
        """How many times as fast two threads are as one."""
        return self.two_threads / self.one_thread


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


def timed(clock: Callable[[], float], call: Callable[[], Any]) -> tuple[Any, float]:
    """The result, and the time by a clock."""
    begin = clock()
    result = call()
    return result, clock() - begin


def measure_throughput(rays: int = RAYS) -> list[Throughput]:
    """Trace the same rays on every wall, with one thread and with two in turn."""
    walls = {name: make() for name, make in WALLS.items()}
    bounces = {
        name: float(geo.trace(wall, *random_rays(wall, rays), threads=2).collisions.sum())
        for name, wall in walls.items()
    }
    times = {name: np.full((2, 3), np.inf) for name in walls}
    for _ in range(TURNS):
        for name, wall in walls.items():
            few = _times(wall, *random_rays(wall, rays), REPEATS)
            many = _times(wall, *random_rays(wall, MORE * rays), REPEATS_OF_MORE)
            times[name] = np.minimum(times[name], (few, many))
    return [
        Throughput(name, bounces[name] / rays, *(bounces[name] / few), many[1] / many[2])
        for name, (few, many) in times.items()
    ]


def _times(wall: geo.Wall, x: np.ndarray, theta: np.ndarray, repeats: int) -> np.ndarray:
    """Least times of a trace: processor seconds on one thread, seconds on one thread and on two, in turn."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        _, one = timed(time.perf_counter, lambda: geo.trace(wall, x, theta, threads=1))
        work = time.process_time() - begin
        _, two = timed(time.perf_counter, lambda: geo.trace(wall, x, theta, threads=2))
        times.append((work, one, two))
    return np.min(times, axis=0)


def throughput_table(rows: Iterable[Throughput]) -> str:
    """One line for each wall."""
    return table(
        "wall | bounces a ray | million bounces/s, one thread | in processor seconds | two threads | speed-up "
        f"| of {MORE} times as many rays",
        (
            f"{row.wall} | {row.bounces_per_ray:.2f} | {row.one_thread / 1e6:.1f} | {row.work / 1e6:.1f} "
            f"| {row.two_threads / 1e6:.1f} | {row.speed_up:.2f} | {row.speed_up_of_more:.2f}"
            for row in rows
        ),
    )


def first_rays() -> str:
    """A table row with the processor seconds of the steps to the first rays of a large profile."""
    wall, made = timed(time.process_time, lambda: profile_of(LARGE_PROFILE))
    _, tables = timed(time.process_time, lambda: wall.scene)
    x, theta = random_rays(wall, FIRST_RAYS)
    _, traced = timed(time.process_time, lambda: geo.trace(wall, x, theta))
    return f"{LARGE_PROFILE:,} | {made:.2f} | {tables:.2f} | {traced:.2f} | {made + tables + traced:.2f}"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m campaigns.bounces", description=__doc__)
    parser.add_argument("--profile", action="store_true", help="only the profile of 200,000 points")
    if not parser.parse_args().profile:
        from asperity.geometry.tracing.compiled.closed_forms import SIMPLE

        SIMPLE.load()
        print(throughput_table(measure_throughput()))
        print()
    print(table("points | wall, s | tables, s | first 10^6 rays, s | in all, s", iter([first_rays()])))


if __name__ == "__main__":
    main()
