"""Costs of tasks on workers, measured here, and what a thousand workers would do by a simulation with these costs.

``python -m benchmarks.scaling`` measures the processor time that the client and the scheduler spend on a task, its
bytes, and the time from one to two workers. Then simpy simulates workers, a scheduler and a client that passes on one
message at a time. ``--quick`` measures few tasks.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.workers import connected, results

BINS = 64
# Random deviation of the durations of tasks in the simulation, as a fraction; they are uniform.
UNEVEN = 0.2
WORKERS = (2, 10, 100, 1000)
SECONDS_A_TASK = (0.1, 1.0, 10.0, 60.0)
# Tasks of each simulated worker: beginning and end are a small part of the run.
EACH = 30


@dataclass(frozen=True)
class Costs:
    """What one task costs the one process of client and scheduler.

    Attributes
    ----------
    submit, result : float
        Processor seconds before and after the work: half each of what empty tasks take, and after it what the bytes of
        the result take besides.
    payload : int
        Bytes of a result.
    """

    submit: float
    result: float
    payload: int


@dataclass(frozen=True)
class Simulated:
    """A simulated run: fraction of the workers' time that is work, tasks a second, and the server's load."""

    workers: int
    seconds_a_task: float
    efficiency: float
    rate: float
    load: float


def simulate(workers: int, seconds_a_task: float, costs: Costs, tasks: int | None = None, seed: int = 0) -> Simulated:
    """Simulate workers that take tasks from one server and bring results back to it, first come first served."""
    import simpy

    environment = simpy.Environment()
    server = simpy.Resource(environment, capacity=1)
    rng = np.random.default_rng(seed)
    number = EACH * workers if tasks is None else tasks
    durations = iter(seconds_a_task * rng.uniform(1.0 - UNEVEN, 1.0 + UNEVEN, number))
    served = worked = 0.0

    def served_for(cost: float) -> Iterator[Any]:
        nonlocal served
        with server.request() as turn:
            yield turn
            yield environment.timeout(cost)
        served += cost

    def worker() -> Iterator[Any]:
        nonlocal worked
        while (duration := next(durations, None)) is not None:
            yield from served_for(costs.submit)
            yield environment.timeout(duration)
            worked += duration
            yield from served_for(costs.result)

    for _ in range(workers):
        environment.process(worker())
    environment.run()
    whole = environment.now
    return Simulated(workers, seconds_a_task, worked / (workers * whole), number / whole, served / whole)


def returned(payload: int, task: int) -> np.ndarray:
    """An empty task whose result has so many bytes."""
    return np.zeros(payload // 8, dtype=np.int64)


def processor_seconds(function: Callable[[int], Any], tasks: int, client: Any) -> float:
    """Of this process, which holds the client and the scheduler, for each task."""
    list(results(function, range(20), client))
    begin = time.process_time()
    for _ in results(function, range(tasks), client):
        pass
    return (time.process_time() - begin) / tasks


def measured_costs(tasks: int, workers: int = 2) -> Costs:
    """The costs of tasks whose results are the counts of 64 by 64 cells."""
    payload = 8 * BINS**2
    with connected(workers) as client:
        empty = processor_seconds(partial(returned, 8), tasks, client)
        full = processor_seconds(partial(returned, payload), tasks, client)
    return Costs(0.5 * empty, max(full - 0.5 * empty, 0.5 * empty), payload)


def measured_times(rays: int) -> dict[str, float]:
    """Seconds of a count of rays on Koch's curve: in this process by its processor; by the clock with workers."""
    law, basis = ker.WallLaw(geo.koch(4)), ker.Bins(BINS)
    count = partial(ker.discretise, law, basis, "monte-carlo", samples=rays, rng=0)
    count(samples=2**16)
    begin = time.process_time()
    count()
    found = {"this process": time.process_time() - begin}
    with TemporaryDirectory() as folder:
        begin = time.process_time()
        count(checkpoint=Path(folder) / "rays")
        found["with a checkpoint"] = time.process_time() - begin
    for workers in (1, 2):
        with connected(workers) as client:
            # workers load the library and the compiled loops first
            client.run(count, samples=2**16)
            begin = time.perf_counter()
            count(client=client)
            found[f"{workers} workers"] = time.perf_counter() - begin
    return found


def report(costs: Costs, times: dict[str, float]) -> str:
    """Measurements, and the table of simulated runs."""
    one = costs.submit + costs.result
    lines = [
        f"A task costs client and scheduler {1e3 * one:.2f} ms of processor time, with {costs.payload} bytes of "
        f"result; that is at most {1.0 / one:.0f} tasks a second.",
        "",
    ]
    if times:
        lines += [
            ", ".join(f"{name} {seconds:.1f} s" for name, seconds in times.items())
            + f"; from one to two workers {times['1 workers'] / times['2 workers']:.2f} times as fast.",
            "",
        ]
    lines += [
        "| workers | seconds a task | efficiency | tasks a second | load of the scheduler |",
        "|---|---|---|---|---|",
    ]
    for workers in WORKERS:
        for seconds in SECONDS_A_TASK:
            run = simulate(workers, seconds, costs)
            lines.append(f"| {workers} | {seconds:g} | {run.efficiency:.3f} | {run.rate:.3g} | {run.load:.2f} |")
    return "\n".join(lines)


def main() -> None:
    """Measure, simulate, and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few tasks and rays")
    parser.add_argument("--rays", type=int, default=2**30, help="rays of the run with one and with two workers")
    options = parser.parse_args()
    rays = min(options.rays, 2**24) if options.quick else options.rays
    print(report(measured_costs(300 if options.quick else 3000), measured_times(rays)))


if __name__ == "__main__":
    main()
