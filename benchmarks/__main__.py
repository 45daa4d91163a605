"""Everything that is measured, in one run: ``python -m benchmarks --write`` regenerates the pages of the documentation.

The tables of speed and of the goals, the standard set and the random walls, the stability report, and what scenes
leave out; with ``--peers`` the peers too. A run that was stopped goes on where it was, in the folder ``--out``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from asperity.bench.bench_run import BenchRun
from asperity.bench.extreme_report import run_extremes
from asperity.bench.scene_savings import savings_table
from asperity.bench.scenes import RANDOM_WALLS
from asperity.bench.standard_set import FULL, QUICK, problem_names, run_problems
from asperity.spectral import Machine

from .goals import all_goals, goal_table
from .laws import LawTime, measure_laws
from .metastable import Solver, metastable_table
from .pages import BENCHMARKS, STABILITY, pictures, write_between_marks
from .peers import deeptime_solver, peer_table
from .rigid import speed_table
from .runs import RunTime, measure_runs
from .start import measure_start
from .throughput import RAYS, Throughput, measure_throughput


def main() -> None:
    """Run all measurements."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="short ladders and small cases")
    parser.add_argument("--peers", action="store_true", help="install the peers beside the rows and measure them too")
    parser.add_argument("--write", action="store_true", help="put the tables and pictures into docs/")
    parser.add_argument("--out", type=Path, default=Path("bench-results"), help="folder of the rows and pictures")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    flags = [f"--{name}" for name in ("quick", "peers", "write") if getattr(options, name)]
    command = f"Measured by `{' '.join(['python -m benchmarks', *flags])}`."
    peers = {"deeptime": deeptime_solver(options.out / "peers")} if options.peers else {}
    speed = [command, "", *_speed(RAYS // 16 if options.quick else RAYS, peers)]
    _say("the standard set")
    standard = _run(problem_names(), options.quick, options.out / "standard")
    _say("random walls")
    # short ladders in any case: there are many of them, and only the choice is asked for
    random = _run([f"random-{k}/moment" for k in range(RANDOM_WALLS)], True, options.out / "random")
    sections = [
        speed,
        ["## The standard set", "", standard.summary(), "", *pictures(standard, options.out / "standard")],
        ["## Twenty random walls", "", random.summary()],
        ["## What the scenes leave out", "", savings_table(options.quick)],
    ]
    if options.peers:
        _say("peers")
        sections.append(["## Peers", "", peer_table(options.out / "peers")])
    text = "\n\n".join("\n".join(section) for section in sections)
    _say("extreme cases")
    stability = f"{command}\n\n{run_extremes(options.quick).table()}\n\nMachine: {Machine.here()}."
    print(text, stability, sep="\n\n")
    if options.write:
        write_between_marks(BENCHMARKS, text)
        write_between_marks(STABILITY, stability)


def _say(what: str) -> None:
    print(f"measuring {what}", file=sys.stderr, flush=True)


def _run(names: list[str], quick: bool, folder: Path) -> BenchRun:
    folder.mkdir(parents=True, exist_ok=True)
    run = BenchRun(tuple(run_problems(names, QUICK if quick else FULL, folder, _say)))
    run.save(folder)
    return run


def _speed(rays: int, peers: dict[str, Solver]) -> list[str]:
    """The machine, the goals, and the tables that they rest on."""
    throughput, laws, runs, start = measure_throughput(rays), measure_laws(), measure_runs(), measure_start()
    goals = goal_table(all_goals(throughput, laws, runs, start))
    starts = ["| start | seconds |", "|---|---|", *(f"| {what} | {least:.2f} |" for what, least in start.items())]
    return [
        f"Machine: {Machine.here()}.", "", "## Goals", "", *goals, "", "## Speed", "",
        *_throughput_table(throughput), "", *_laws_table(laws), "", *_runs_table(runs), "", *speed_table(), "",
        *metastable_table(peers), "", *starts,
    ]  # fmt: skip


def _throughput_table(measured: list[Throughput]) -> list[str]:
    return [
        "| wall | bounces a ray | million bounces/s, one thread | two threads | speed-up | share of the flop limit |",
        "|---|---|---|---|---|---|",
        *(
            f"| {row.wall} | {row.bounces_per_ray:.2f} | {row.one_thread / 1e6:.1f} | {row.two_threads / 1e6:.1f} "
            f"| {row.two_threads / row.one_thread:.2f} | {row.one_thread / row.flop_limit:.3f} |"
            for row in measured
        ),
    ]


def _laws_table(measured: list[LawTime]) -> list[str]:
    rows = [
        "| law | true error | reported error | seconds | Monte Carlo's error in that time |",
        "|---|---|---|---|---|",
    ]
    for row in measured:
        cells = (_figure(value) for value in (row.error, row.reported, row.seconds, row.monte_carlo))
        rows.append(f"| {row.what} | {' | '.join(cells)} |")
    return rows


def _figure(value: float) -> str:
    return "-" if value != value else f"{value:.1e}"


def _runs_table(measured: list[RunTime]) -> list[str]:
    rows = [f"| {r.what} | {r.hits:.1e} | {1e6 * r.seconds:.2f} | {r.escaped:.3f} |" for r in measured]
    return [
        "| run of hits in one step | hits a ray | microseconds a ray | share that escaped |",
        "|---|---|---|---|",
        *rows,
    ]


if __name__ == "__main__":
    main()
