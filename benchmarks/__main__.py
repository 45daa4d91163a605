"""Measure, print a table, and with ``--write`` put it into docs/benchmarks.md."""

from __future__ import annotations

import argparse
import os
import platform
from pathlib import Path

from .laws import measure_laws
from .metastable import metastable_table
from .rigid import speed_table
from .runs import measure_runs
from .start import measure_start
from .throughput import RAYS, measure_throughput

PAGE = Path(__file__).parents[1] / "docs" / "benchmarks.md"
BEGIN, END = "<!-- measured -->", "<!-- end -->"


def main() -> None:
    """Run all measurements."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rays", type=int, default=RAYS, help="rays on every wall")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/benchmarks.md")
    arguments = parser.parse_args()
    tables = [
        _throughput_table(arguments.rays), _laws_table(), _runs_table(), speed_table(), metastable_table(),
        _start_table(),
    ]  # fmt: skip
    text = "\n".join([_machine(), *(line for table in tables for line in ("", *table))])
    print(text)
    if arguments.write:
        page = PAGE.read_text(encoding="utf-8")
        head, rest = page.split(BEGIN)
        PAGE.write_text(f"{head}{BEGIN}\n{text}\n{END}{rest.split(END)[1]}", encoding="utf-8")


def _machine() -> str:
    processor = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line.split(":")[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")]
        processor = names[0] if names else processor
    return f"Machine: {processor}, {os.cpu_count()} cores; Python {platform.python_version()}."


def _throughput_table(rays: int) -> list[str]:
    rows = [
        "| wall | bounces a ray | million bounces/s, one thread | two threads | speed-up | share of the flop limit |",
        "|---|---|---|---|---|---|",
    ]
    rows += [
        f"| {row.wall} | {row.bounces_per_ray:.2f} | {row.one_thread / 1e6:.1f} | {row.two_threads / 1e6:.1f} "
        f"| {row.two_threads / row.one_thread:.2f} | {row.one_thread / row.flop_limit:.3f} |"
        for row in measure_throughput(rays)
    ]
    return rows


def _laws_table() -> list[str]:
    rows = [
        "| law | true error | reported error | seconds | Monte Carlo's error in that time |",
        "|---|---|---|---|---|",
    ]
    for row in measure_laws():
        cells = (_figure(value) for value in (row.error, row.reported, row.seconds, row.monte_carlo))
        rows.append(f"| {row.what} | {' | '.join(cells)} |")
    return rows


def _figure(value: float) -> str:
    return "-" if value != value else f"{value:.1e}"


def _runs_table() -> list[str]:
    rows = ["| run of hits in one step | hits a ray | microseconds a ray | share that escaped |", "|---|---|---|---|"]
    rows += [f"| {r.what} | {r.hits:.1e} | {1e6 * r.seconds:.2f} | {r.escaped:.3f} |" for r in measure_runs()]
    return rows


def _start_table() -> list[str]:
    rows = [f"| {what} | {least:.2f} |" for what, least in measure_start().items()]
    return ["| start | seconds |", "|---|---|", *rows]


if __name__ == "__main__":
    main()
