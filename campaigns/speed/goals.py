"""The goals of goals.toml beside what is reached: ``python -m campaigns.speed.goals [PATTERN...]``.

A pattern, with wildcards, is a kind or a name. Times are least times of repeats after a run that compiles. Where no
independent value is known the error is the reported one, which other campaigns test.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
import tracemalloc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.linalg import eigvalsh
from threadpoolctl import threadpool_limits

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.bench.standard_set import known_reference
from asperity.geometry.polygons.beams import beams_of
from asperity.kernels.discretisation.isometries import table_matrix
from asperity.kernels.walls.polygons import table_of_beams
from asperity.spectral.work_diagrams.problem import Machine
from campaigns.judges import precise_triangular

from ..pages import print_table
from .throughput import bounces_a_second, first_rays, wall_named
from .timing import least_time

FILE = Path(__file__).with_name("goals.toml")
# Tolerance of the run that compiles.
ROUGH = 1e-2
Reached = tuple[float, ...]
Measure = Callable[[str, Reached], Reached]


@dataclass(frozen=True)
class Goal:
    """What is to be reached: numbers that must be at least, or at most, the limits; ``unit`` prints them."""

    kind: str
    name: str
    unit: str
    limits: Reached
    at_least: bool

    def is_met(self, reached: Reached) -> bool:
        """Whether all numbers are within their limits; NaN is not."""
        pairs = list(zip(reached, self.limits, strict=True))
        return all(value >= limit for value, limit in pairs) if self.at_least else all(a <= b for a, b in pairs)

    def row(self, reached: Reached) -> tuple[str, ...]:
        """A row of the table."""
        met = "yes" if self.is_met(reached) else "**no**"
        return f"{self.kind}: {self.name}", self.unit.format(*self.limits), self.unit.format(*reached), met


def all_goals() -> list[Goal]:
    """The goals in the order of the file."""
    found = []
    for kind, entry in tomllib.loads(FILE.read_text(encoding="utf-8")).items():
        at_least = "least" in entry
        for name, limits in entry["least" if at_least else "most"].items():
            numbers = tuple(map(float, limits if isinstance(limits, list) else [limits]))
            found.append(Goal(kind, name, entry["unit"], numbers, at_least))
    return found


# errors

TEETH, ARC = ker.TriangularTeethLaw(0.7), ker.CircularArcLaw(1.2)
# Limit on the beams of a hollow that is only limited by its tolerance.
MANY_BEAMS = 10**7
# Right matrices of triangular teeth, ours, and the order of the norm of their difference.
MATRICES: Mapping[str, tuple[Callable[[], Any], Callable[[], ker.KernelMatrix], int | None]] = {
    "bins as an operator": (
        precise_triangular.reference,
        lambda: ker.discretise(ker.TriangularTeethLaw(precise_triangular.ANGLE), ker.Bins(precise_triangular.BINS)),
        2,
    ),
    "Legendre(64)": (
        lambda: table_matrix(table_of_beams(beams_of(wall_named("triangular-teeth").vertices)), ker.Legendre(64))[0],
        lambda: ker.discretise(TEETH, ker.Legendre(64)),
        None,
    ),
}


def _matrix(name: str, limits: Reached) -> Reached:
    right, solve, order = MATRICES[name]
    found, seconds = least_time(solve)
    return float(np.linalg.norm(found.symmetric - right(), order)), seconds


def _moment(name: str, limits: Reached) -> Reached:
    right = known_reference(f"{name}/moment")
    assert right is not None
    matrix, seconds = least_time(lambda: ker.discretise(ker.WallLaw(wall_named(name)), ker.Legendre(2)))
    return abs(float(matrix.symmetric[1, 1] - right.value)), seconds


def gap_error(name: str, tolerance: float) -> float:
    """The reported error of a gap, or infinity if the true one is known and larger."""
    found, right = spec.spectral_gap(ker.WallLaw(wall_named(name)), tolerance), known_reference(f"{name}/lambda2")
    holds = right is None or abs(1.0 - found.value - float(right.value)) <= found.error + right.error
    return found.error if holds else float("inf")


def _law_error(name: str, tolerance: float) -> float:
    law = ker.WallLaw(wall_named(name))
    return float(ker.discretise(law, ker.Bins(64), method="quadrature", tolerance=tolerance).error)


def _resistance_error(name: str, tolerance: float) -> float:
    return ker.resistance(ker.WallLaw(wall_named(name)), tolerance).error


def _unresolved(name: str, tolerance: float) -> float:
    law = ker.PolygonLaw(wall_named(name), tolerance, max_beams=MANY_BEAMS)
    law.branches(1.0)
    return float(law.unresolved)


def _distance_error(kind: Any, tolerance: float) -> float:
    return ker.distance(ARC, TEETH, kind=kind, tolerance=tolerance).error


def _reported(solve: Callable[[str, float], float]) -> Measure:
    """Measures the error that is reported for a tolerance, and the time."""

    def measure(name: str, limits: Reached) -> Reached:
        solve(name, ROUGH)
        return least_time(partial(solve, name, limits[0]))

    return measure


# large matrices


@cache
def _large_matrix(name: str, bins: int) -> ker.KernelMatrix:
    """A smooth law, a sampled law of a curved wall, or pairs without a known mirror symmetry."""
    basis, rng = ker.Bins(bins), np.random.default_rng(0)
    if name == "Henyey-Greenstein 0.9":
        return ker.discretise(ker.henyey_greenstein(0.9), basis)
    if name == "focusing arc":
        return ker.discretise(ARC, basis, method="qmc", samples=2**22, rng=rng)
    incoming = np.arccos(1.0 - 2.0 * rng.random(2**22))
    return ker.estimate(incoming, ARC.sample(incoming, rng), basis, symmetrise=True)


def _part_of_eigvalsh(name: str, limits: Reached) -> Reached:
    matrix = _large_matrix(name, 4096)
    with threadpool_limits(1):
        return (
            least_time(lambda: spec.spectrum(matrix, k=2))[1] / least_time(lambda: eigvalsh(matrix.symmetric), 1)[1],
        )


def _seconds_of_gap(name: str, limits: Reached) -> Reached:
    matrix = _large_matrix(name, 10_000)
    return (least_time(lambda: spec.spectrum(matrix, k=2), 1)[1],)


# rays and disks

# Walls, entry points and angles with very long runs of hits. On an arc, 10^9 hits would need a ray within 1e-18 of a
# tip, which is a corner; double precision allows about 10^6 hits.
RUNS = {
    "arc": (geo.focusing_arcs(np.pi / 2), (1e-12, 2e-12), (np.pi / 2 - 1e-6, np.pi / 2 - 0.5e-6)),
    "channel": (geo.rectangular_teeth(1e6), (0.5, 1.0), (1.9e-3, 2.1e-3)),
    "wedge": (geo.triangular_teeth(3e-9), (0.0, 1.0), (1.5, 1.6)),
}
RUN_RAYS, RUN_LIMIT = 2**14, 2**62


def _bounces(name: str, limits: Reached) -> Reached:
    return (bounces_a_second(name)[0] / 1e6,)


def _two_threads(name: str, limits: Reached) -> Reached:
    one, two = bounces_a_second(name)
    return (two / one,)


def _run_of_hits(name: str, limits: Reached) -> Reached:
    rng, (wall, place, angle) = np.random.default_rng(0), RUNS[name]
    x, theta = rng.uniform(*place, RUN_RAYS), rng.uniform(*angle, RUN_RAYS)
    job = partial(geo.trace, wall, x, theta, max_collisions=RUN_LIMIT, threads=1)
    job()
    return (1e6 * least_time(job)[1] / RUN_RAYS,)


def _disks(name: str, limits: Reached) -> Reached:
    from campaigns.rays.true_disks import collisions_a_second

    return (collisions_a_second() / 1e6,)


# memory and processes

# Rays of two estimates; 10^10 rays would be more chunks, each added to the same counts.
FEW, MANY = 2**20, 2**23
TRACE = "from asperity import geometry as geo; geo.trace(geo.{wall}, [0.3, 0.4], [1.0, 2.0])"
GAP = (
    "from asperity import geometry as geo, kernels as ker, spectral as spec; spec.spectral_gap(ker.WallLaw(geo.{wall}))"
)
PROGRAMS = {
    "import asperity": "import asperity",
    "first trace": TRACE.format(wall="focusing_arcs(1.2)"),
    "first trace of a mushroom": TRACE.format(wall="mushrooms(0.3)"),
    "first gap of focusing arcs": GAP.format(wall="focusing_arcs(1.2)"),
    "first gap of triangular teeth": GAP.format(wall="triangular_teeth(0.7)"),
    "first gap of dispersing arcs": GAP.format(wall="dispersing_arcs(1.0)"),
    "asperity study focusing-arcs": (
        "from tempfile import mkdtemp; from asperity.cli import main; "
        "main(['study', 'focusing-arcs', '--out', mkdtemp()])"
    ),
}


def growth_of_memory(few: int = FEW, many: int = MANY) -> float:
    """How much larger the peak of allocated bytes is, as a fraction, if an estimate has more rays."""
    peaks = []
    for rays in (few // 4, few, many):
        tracemalloc.start()
        law = ker.WallLaw(geo.dispersing_arcs(1.0))
        ker.discretise(law, ker.Bins(512), "monte-carlo", samples=rays, rng=np.random.default_rng(0))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # the first loads and compiles
    return peaks[2] / peaks[1] - 1.0


def _memory(name: str, limits: Reached) -> Reached:
    return (max(growth_of_memory(), 0.0),)


def _start(name: str, limits: Reached) -> Reached:
    """Seconds of a fresh process; the first of the repeats reads the libraries from the disk."""
    if name.startswith("profile"):
        return (least_time(first_rays, 1)[1],)
    program, _, cache_is = name.partition(", ")
    # a warm command has its bytecode, too
    keeping = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}

    def run() -> None:
        with TemporaryDirectory() as empty:
            environment = {**keeping, "TMPDIR": empty}
            if cache_is == "empty cache":
                environment["NUMBA_CACHE_DIR"] = empty
            subprocess.run([sys.executable, "-c", PROGRAMS[program]], check=True, env=environment, capture_output=True)

    run()
    return (least_time(run)[1],)


MEASURES: Mapping[str, Measure] = {
    "bounces": _bounces,
    "two threads against one": _two_threads,
    "first moment": _moment,
    "matrix of triangular teeth": _matrix,
    "gap, roughly": _reported(gap_error),
    "gap": _reported(gap_error),
    "law in Bins(64) by quadrature": _reported(_law_error),
    "resistance": _reported(_resistance_error),
    "polygon as an exact law": _reported(_unresolved),
    "distance of arc and teeth": _reported(_distance_error),
    "gap of 4,096 bins, checked to be complete": _part_of_eigvalsh,
    "gap of 10,000 bins, checked to be complete": _seconds_of_gap,
    "run of hits in one step": _run_of_hits,
    "collisions of the true disk": _disks,
    "memory": _memory,
    "start": _start,
}


def main(patterns: Sequence[str]) -> int:
    """Print the table row by row; the exit code tells whether all goals are met."""
    asked = patterns or ["*"]
    chosen = [goal for goal in all_goals() if any(fnmatch(word, p) for word in (goal.kind, goal.name) for p in asked)]
    missed = []

    def row(goal: Goal) -> tuple[str, ...]:
        reached = MEASURES[goal.kind](goal.name, goal.limits)
        missed.extend([] if goal.is_met(reached) else [goal])
        return goal.row(reached)

    print_table("what | goal | reached | met", map(row, chosen))
    print(f"\n{len(missed)} of {len(chosen)} goals are missed. Machine: {Machine.here()}.")
    return 1 if missed or not chosen else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
