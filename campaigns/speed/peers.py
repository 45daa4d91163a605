"""Other programs beside asperity in the same run: ``python -m campaigns.speed.peers [FOLDER]``.

Every peer is run as its best users run it, in one thread: Embree from C, one call a ray segment; Mitsuba with the whole
loop over reflections compiled by Dr.Jit, which needs a recent LLVM; deeptime told that the chain is reversible. Direct
simulation codes such as SPARTA are not measured: their time goes into moving particles between cells. `make bench`
installs the peers in ``FOLDER/environment``. Each runs in a process with a time limit; one that is not there or fails
is a row that says so.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

from ..pages import print_table
from .timing import least_time

WORKER = Path(__file__).with_name("peer_worker.py")
# Names in `peer_worker`. Embree is a system package, such as libembree-dev in Debian. Mitsuba finds LLVM by itself or
# by DRJIT_LIBLLVM_PATH; on AMD Zen 4 19 works, 16 fails.
TRACERS, SOLVER = ("embree", "mitsuba"), "deeptime"
SECONDS = 40.0


def answer_of(peer: str, folder: Path, **data: Any) -> dict[str, Any] | str:
    """The result of the peer's function in `peer_worker`, or in words why there is none."""
    file = folder / "data.npz"
    np.savez(file, **data)
    command = [str(folder / "environment" / "bin" / "python"), str(WORKER), peer, str(file)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired) as reason:
        return str(reason)
    if done.returncode:
        return f"fails: {(done.stderr.strip() or 'no message').splitlines()[-1].replace('|', '/')}"
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


# rays through polygons

RAYS = 2**15
# Depth of the corners as a multiple of the width of a side: slopes of order 1 at every number of sides.
SHALLOWEST, DEEPEST = 0.3, 1.5
SIDES = (10, 100, 1_000, 10_000, 100_000)
RAY_HEADS = "sides | tracer | version | million rays/s | wrong | median error | lost"
PICTURE = "rays-per-second.png"
# Sides, tracer, rays a second, and the fraction of rays wrong or lost.
Speed = tuple[int, str, float, float]


def random_polygon(sides: int) -> geo.Wall:
    """A hollow of the given number of sides, of equal width, with corners at random depths."""
    depth = np.random.default_rng(sides).uniform(SHALLOWEST, DEEPEST, sides - 1) / sides
    return geo.Wall.from_vertices(np.column_stack([np.linspace(0.0, 1.0, sides + 1), -np.pad(depth, 1)]))


def trace_with_all(folder: Path, measured: list[Speed]) -> Iterator[tuple[object, ...]]:
    """Rows for the same rays through teeth and polygons, by every tracer in one thread; asperity's angles are right."""
    rng = np.random.default_rng(0)
    x, theta = rng.random(RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))
    for wall in (geo.triangular_teeth(0.7), *map(random_polygon, SIDES)):
        sides = len(wall.pieces)
        traced, seconds = least_time(lambda wall=wall: geo.trace(wall, x, theta, threads=1))
        lost, rate = float(np.mean(~traced.escaped)), RAYS / seconds
        measured.append((sides, "asperity", rate, lost))
        yield sides, "asperity, double precision", "-", f"{rate / 1e6:.3g}", "reference", "-", f"{lost:.1e}"
        for peer in TRACERS:
            found = answer_of(peer, folder, corners=wall.vertices, x=x, theta=theta, out=traced.theta)
            if isinstance(found, str):
                yield sides, peer, "-", found, "-", "-", "-"
                continue
            measured.append((sides, peer, found["rate"], found["wrong"] + found["lost"]))
            errors = (f"{found[name]:.1e}" for name in ("wrong", "error", "lost"))
            yield sides, f"{peer}, single precision", found["version"], f"{found['rate'] / 1e6:.3g}", *errors


def draw_speeds(measured: list[Speed], file: Path) -> None:
    """Rays a second against the number of sides, and against the fraction of rays that are wrong or lost."""
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    by_sides, by_error = figure.subplots(1, 2, sharey=True)
    for tracer in dict.fromkeys(tracer for _, tracer, _, _ in measured):
        sides, rates, failed = zip(*((n, rate, bad) for n, one, rate, bad in measured if one == tracer), strict=True)
        by_sides.loglog(sides, rates, "o-", label=tracer)
        by_error.loglog(np.maximum(failed, 1.0 / RAYS), rates, "o", label=tracer)
    by_sides.set(xlabel="sides of the polygon", ylabel="rays a second, one thread")
    by_error.set(xlabel=f"fraction of rays wrong or lost, at least 1/{RAYS}")
    for axes in (by_sides, by_error):
        axes.grid(alpha=0.3)
        axes.legend()
    figure.savefig(file, dpi=120)


# gaps of chains

# Maxwell's law in bins: an easy gap, and a gap that only an accurate solver distinguishes from 0.
BINS, MAXWELL_GAPS = 256, (0.5, 1e-9)
# A gap is wrong if its error exceeds this fraction of it, and rounding.
WRONG, ROUNDING = 0.1, 1e-13
CHAIN_HEADS = "chain | solver | version | gaps wrong | largest relative error | seconds | what it says"


def solve_with_all(folder: Path) -> Iterator[tuple[object, ...]]:
    """Rows for the same chains, by both solvers."""
    for gap in MAXWELL_GAPS:
        matrix = ker.discretise(ker.maxwell(gap), ker.Bins(BINS))
        found, seconds = least_time(lambda matrix=matrix: spec.spectrum(matrix, k=2))
        name, right = f"Maxwell's law of {gap:g}, {BINS} bins", np.array([0.0, gap])
        yield _row(name, "asperity.spectrum", right, np.array([0.0, found.gap]), seconds, str(found.completeness))
        other = answer_of(SOLVER, folder, matrix=matrix.array, wanted=2)
        if isinstance(other, str):
            yield name, SOLVER, "-", "-", "-", "-", other
        else:
            yield _row(name, SOLVER, right, np.array(other["gaps"]), other["seconds"], "-", other["version"])


def _row(
    name: str, solver: str, right: np.ndarray[Any, Any], gaps: np.ndarray[Any, Any], seconds: float, words: str,
    version: str = "-",
) -> tuple[object, ...]:  # fmt: skip
    """The gaps beside the right ones, the constants' 0 included, both in increasing order."""
    found = np.full(len(right), np.nan)
    found[: len(gaps)] = np.sort(gaps)[: len(right)]
    error = np.abs(found - right)
    wrong = int(np.sum(~(error <= np.maximum(WRONG * right, ROUNDING))))
    relative = np.max(error[right > ROUNDING] / right[right > ROUNDING])
    return name, solver, version, wrong, f"{relative:.1e}", f"{seconds:.2g}", words


def main(folder: Path) -> None:
    """Print the tables and draw the picture."""
    folder.mkdir(parents=True, exist_ok=True)
    measured: list[Speed] = []
    print_table(RAY_HEADS, trace_with_all(folder, measured))
    draw_speeds(measured, folder / PICTURE)
    print()
    print_table(CHAIN_HEADS, solve_with_all(folder))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "bench-results/peers"))
