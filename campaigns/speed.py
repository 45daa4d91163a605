"""Speed of the tracers, of a fresh process and of transport, with the goals that depend on it: one section."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass

import numpy as np

from asperity import geometry as geo
from asperity.core.tables import table
from asperity.spectral import Machine

from .bounces import RAYS, measure_throughput, throughput_table
from .goals import all_goals, goal_table
from .memory import measure_memory
from .rays.true_disks import collisions_a_second
from .timing import least_time
from .transport import PAGE_CELLS, PAGE_JOINT, transport_table

REPEATS = 5
# Walls, entry points and angles with very long runs of hits. On an arc, 10^9 hits would need a ray within 1e-18 of a
# tip, which is a corner; double precision allows about 10^6 hits.
RUNS = {
    "arc": (geo.focusing_arcs(np.pi / 2), (1e-12, 2e-12), (np.pi / 2 - 1e-6, np.pi / 2 - 0.5e-6)),
    "channel": (geo.rectangular_teeth(1e6), (0.5, 1.0), (1.9e-3, 2.1e-3)),
    "wedge": (geo.triangular_teeth(3e-9), (0.0, 1.0), (1.5, 1.6)),
}
RUN_RAYS, RUN_LIMIT = 2**14, 2**62
SCRIPTS = {
    "python alone": "pass",
    "numpy": "import numpy",
    "import asperity": "import asperity",
    "first trace, warm cache": (
        "from asperity import geometry as geo; geo.trace(geo.focusing_arcs(1.2), [0.3, 0.4], [1.0, 2.0])"
    ),
}


@dataclass(frozen=True)
class RunTime:
    """Mean number of hits of a ray, seconds a ray, and the fraction of the rays that escaped."""

    what: str
    hits: float
    seconds: float
    escaped: float


def speed_and_goals(quick: bool) -> str:
    """The machine, the goals, and the tables."""
    throughput = measure_throughput(RAYS // 16 if quick else RAYS)
    runs, start = measure_runs(), measure_start()
    goals = all_goals(
        throughput,
        [(row.what, row.hits, row.seconds) for row in runs],
        start, measure_memory(), collisions_a_second(),
    )  # fmt: skip
    tables = (
        throughput_table(throughput), _runs_table(runs), transport_table(PAGE_JOINT, PAGE_CELLS),
        table("start | seconds", (f"{what} | {least:.2f}" for what, least in start.items())),
    )  # fmt: skip
    return "\n\n".join([f"Machine: {Machine.here()}.", "## Goals", goal_table(goals), "## Speed", *tables])


def measure_runs() -> list[RunTime]:
    """Trace rays with very many hits in a row: along an arc, in a channel, in a wedge."""
    rng = np.random.default_rng(0)
    rows = []
    for what, (wall, (low, high), (first, last)) in RUNS.items():
        x, theta = low + (high - low) * rng.random(RUN_RAYS), first + (last - first) * rng.random(RUN_RAYS)
        traced, seconds = least_time(
            lambda wall=wall, x=x, theta=theta: geo.trace(wall, x, theta, max_collisions=RUN_LIMIT, threads=1), REPEATS
        )
        escaped = float(traced.escaped.mean())
        rows.append(RunTime(what, float(traced.collisions.mean()), seconds / RUN_RAYS, escaped))
    return rows


def measure_start() -> dict[str, float]:
    """Seconds of a fresh process for each script, with warm caches."""
    return {
        what: least_time(lambda script=script: subprocess.run([sys.executable, "-c", script], check=True), REPEATS)[1]
        for what, script in SCRIPTS.items()
    }


def _runs_table(measured: list[RunTime]) -> str:
    rows = (f"{run.what} | {run.hits:.1e} | {1e6 * run.seconds:.2f} | {run.escaped:.3f}" for run in measured)
    return table("run of hits in one step | hits a ray | microseconds a ray | fraction that escaped", rows)
