"""The goals and the tables of speed that they rest on."""

from __future__ import annotations

from asperity.spectral import Machine

from .goals import all_goals, goal_table
from .laws import LawTime, measure_laws
from .memory import measure_memory
from .profiles import profile_tables
from .rigid import speed_table
from .robustness import RAYS as AIMED_RAYS
from .robustness import measure_robustness
from .runs import RunTime, measure_runs
from .start import measure_start
from .throughput import RAYS, Throughput, measure_throughput
from .transport import transport_table


def speed_and_goals(quick: bool) -> str:
    """The machine, the goals, and the tables."""
    throughput = measure_throughput(RAYS // 16 if quick else RAYS)
    laws, runs, start = measure_laws(), measure_runs(), measure_start()
    robustness = measure_robustness(AIMED_RAYS // 50 if quick else AIMED_RAYS)
    goals = goal_table(all_goals(throughput, laws, runs, start, robustness, measure_memory()))
    starts = ["| start | seconds |", "|---|---|", *(f"| {what} | {least:.2f} |" for what, least in start.items())]
    tables = (
        _throughput_table(throughput), _laws_table(laws), _runs_table(runs), speed_table(),
        transport_table(), starts,
    )  # fmt: skip
    head = [f"Machine: {Machine.here()}.", "", "## Goals", "", *goals]
    head += ["", "### What holds back those that are not met", "", *profile_tables(), "", "## Speed"]
    return "\n".join(head + [line for table in tables for line in ("", *table)])


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
