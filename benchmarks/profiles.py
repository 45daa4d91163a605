"""What holds a goal back: shares of the time, measured in the same run as the goal.

Compiled loops are taken apart by stand-ins that do one part of the work; what runs in Python by the profiler, whose own
cost is spread over all shares.
"""

from __future__ import annotations

import cProfile
import math
import pstats
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numba import njit

import asperity
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.bench.running.timing import least_time
from asperity.core.checks import angles, finite_array
from asperity.geometry.tracing.compiled.trigonometry import direction_angle, sine_cosine

from .rigid import DISK, random_states
from .throughput import WALLS

RAYS, DISKS, REPEATS, STARTS = 2**18, 2**15, 5, 3
TOLERANCE = 1e-6
SCALE = 1e-3
SHOWN = 6
PACKAGE = str(Path(asperity.__file__).parent)
ROOMS = {str(Path(room.__file__).resolve().parent): room.__name__ for room in (geo, ker, spec) if room.__file__}
# What a fresh process does up to its first trace: each script goes on where the one before it ends.
STEPS = {
    "python alone": "pass",
    "numpy": "import numpy",
    "asperity and a wall": "from asperity import geometry as geo; wall = geo.focusing_arcs(1.2); wall.scene",
    "numba": "import numba",
    "compiled loops from their cache, and the trace": "geo.trace(wall, [0.3, 0.4], [1.0, 2.0])",
}


def profile_tables() -> list[str]:
    """All tables in Markdown."""
    tables = (tracer_profile(), disk_profile(), gap_profile(), start_profile())
    return [line for table in tables for line in ("", *table)][1:]


def tracer_profile(rays: int = RAYS) -> list[str]:
    """Nanoseconds a ray of the tracer on one thread, by parts."""
    rng = np.random.default_rng(0)
    x, theta = rng.random(rays), np.arccos(1.0 - 2.0 * rng.random(rays))
    scale = 1e9 / rays
    out = np.empty_like(theta)
    _, checks = least_time(lambda: (finite_array("x", x), angles("theta", theta)), REPEATS)
    _, by_library = least_time(lambda: _angles_by_library(theta, out), REPEATS)
    _, by_polynomials = least_time(lambda: _angles_by_polynomials(theta, out), REPEATS)
    # rays that meet nothing but flat tops: all that a ray costs besides its flights and its angles
    _, shell = least_time(lambda: geo.trace(geo.flat(), x, theta, threads=1), REPEATS)
    lines = [
        "| tracer, ns a ray | bounces | in all | checks of x and theta | a ray that meets a flat top | beyond that | "
        "beyond that, a bounce |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, wall in WALLS.items():
        traced, seconds = least_time(lambda wall=wall: geo.trace(wall, x, theta, threads=1), REPEATS)
        bounces = float(traced.collisions.mean())
        lines.append(
            f"| {name} | {bounces:.2f} | {scale * seconds:.0f} | {scale * checks:.1f} | {scale * shell:.0f} "
            f"| {scale * (seconds - shell):.0f} | {scale * (seconds - shell) / bounces:.0f} |"
        )
    return [
        *lines, "",
        f"Sine and cosine of the angle in and the angle out alone take {scale * by_polynomials:.0f} ns a ray by the "
        f"tracer's polynomials, for several rays at once; the mathematical library takes {scale * by_library:.0f} ns.",
    ]  # fmt: skip


def disk_profile(disks: int = DISKS) -> list[str]:
    """Nanoseconds of a collision of the true disk: what a contact costs, and what a sine and a root cost."""
    rng = np.random.default_rng(0)
    angle = rng.random(disks)
    out = np.empty_like(angle)
    _, sines = least_time(lambda: _sines(angle, out), REPEATS)
    lines = [
        "| true disk | contacts | ns a collision | a contact | flat wall: one contact, ns | sin and cos of numba, ns |",
        "|---|---|---|---|---|---|",
    ]
    flat = _collision_seconds(geo.flat(), disks, rng)[0]
    for name, wall in (("triangular teeth, 0.7", geo.triangular_teeth(0.7)), ("arcs, 1.2", geo.focusing_arcs(1.2))):
        seconds, contacts = _collision_seconds(wall, disks, rng)
        lines.append(
            f"| {name} | {contacts:.2f} | {1e9 * seconds:.0f} | {1e9 * seconds / contacts:.0f} | {1e9 * flat:.0f} "
            f"| {1e9 * sines / disks:.0f} |"
        )
    return lines


def gap_profile() -> list[str]:
    """Shares of the time of lambda_2 of the focusing arc by the module that spends it, its calls of numpy included."""
    law = ker.WallLaw(geo.focusing_arcs(1.2))
    spec.spectral_gap(law, TOLERANCE)
    shares = sorted(time_by_module(lambda: spec.spectral_gap(law, TOLERANCE)).items(), key=lambda item: -item[1])
    rows = [f"| {module} | {100.0 * share:.0f} % |" for module, share in shares[:SHOWN]]
    rest = sum(share for _, share in shares[SHOWN:])
    return [
        f"| lambda_2 of the focusing arc to {TOLERANCE:g} | share of the time |", "|---|---|", *rows,
        f"| {len(shares[SHOWN:])} others | {100.0 * rest:.0f} % |",
    ]  # fmt: skip


def start_profile() -> list[str]:
    """Seconds of a fresh process up to its first trace, step by step."""
    lines = ["| first trace, warm cache | seconds |", "|---|---|"]
    script, before = "", 0.0
    for what, step in STEPS.items():
        script += f"{step}\n"
        seconds = min(_seconds(script) for _ in range(STARTS))
        lines.append(f"| {what} | {seconds - before:.2f} |")
        before = seconds
    return lines


def time_by_module(job: Callable[[], object]) -> dict[str, float]:
    """Shares of a job's time: each function's own, and for functions outside of asperity that of their callers."""
    profiler = cProfile.Profile()
    profiler.runcall(job)
    stats = pstats.Stats(profiler).stats  # type: ignore[attr-defined]
    owners: dict[object, dict[str, float]] = {}

    def owner(function: tuple[str, int, str], above: frozenset[object]) -> dict[str, float]:
        """Shares of a function's own time by module."""
        module = _module(function[0])
        if module:
            return {module: 1.0}
        if function in owners:
            return owners[function]
        # by the time that it took for each of its callers; recursion is left out
        callers = {who: times[2] for who, times in stats[function][4].items() if who not in above and who != function}
        total = sum(callers.values())
        shares: dict[str, float] = defaultdict(float)
        for who, seconds in callers.items():
            for module, share in owner(who, above | {function}).items():
                shares[module] += share * (seconds / total if total > 0.0 else 1.0 / len(callers))
        owners[function] = dict(shares) or {"outside": 1.0}
        return owners[function]

    sums: dict[str, float] = defaultdict(float)
    for function, (_, _, own, _, _) in stats.items():
        for module, share in owner(function, frozenset()).items():
            sums[module] += own * share
    return {module: seconds / sum(sums.values()) for module, seconds in sums.items()}


def _module(file: str) -> str:
    """Name of the module of asperity that a file holds, or nothing."""
    path = Path(file)
    for folder, room in ROOMS.items():
        if file.startswith((folder, f"{PACKAGE}/{room.rpartition('.')[2]}/")):
            return f"{room.rpartition('.')[2]}.{path.stem}"
    return f"asperity.{path.stem}" if file.startswith(PACKAGE) else ""


def _collision_seconds(wall: geo.Wall, disks: int, rng: np.random.Generator) -> tuple[float, float]:
    position, velocity = random_states(wall, SCALE, disks, rng)
    found, seconds = least_time(lambda: geo.collide(DISK, wall, SCALE, position, velocity, threads=1), REPEATS)
    return seconds / disks, float(found.contacts.mean())


def _seconds(script: str) -> float:
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", script], check=True)
    return time.perf_counter() - start


@njit
def _angles_by_library(theta, out):  # type: ignore[no-untyped-def]
    for i in range(theta.shape[0]):
        out[i] = math.atan2(math.sin(theta[i]), math.cos(theta[i]))


@njit
def _angles_by_polynomials(theta, out):  # type: ignore[no-untyped-def]
    for i in range(theta.shape[0]):
        sine, cosine = sine_cosine(theta[i])
        out[i] = direction_angle(cosine, sine)


@njit
def _sines(angle, out):  # type: ignore[no-untyped-def]
    for i in range(angle.shape[0]):
        out[i] = math.sin(angle[i]) + math.cos(angle[i])


if __name__ == "__main__":
    print("\n".join(profile_tables()))
