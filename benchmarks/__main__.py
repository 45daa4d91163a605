"""Measure, print a table, and with ``--write`` put it into docs/benchmarks.md."""

from __future__ import annotations

import argparse
import os
import platform
from pathlib import Path

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
    text = "\n".join([_machine(), "", *_throughput_table(arguments.rays), "", *_start_table()])
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


def _start_table() -> list[str]:
    rows = [f"| {what} | {least:.2f} |" for what, least in measure_start().items()]
    return ["| start | seconds |", "|---|---|", *rows]


if __name__ == "__main__":
    main()
