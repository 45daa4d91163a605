"""Costs of tasks on workers, measured here, and what a thousand workers would do by a simulation with these costs.

``python -m benchmarks.scaling`` measures the processor time that the client and the scheduler spend on a task, its
bytes, what a task and a checkpoint cost beside the work, and how much faster two workers are than one, for rays on
Koch's curve and for a sweep. Then simpy simulates workers, a scheduler and a client that passes on one message at a
time. It takes five minutes and needs two processors with nothing else to do; ``--quick`` measures few tasks in one.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.workers import results
from asperity.kernels.sampling import chunks

BINS = 64
# Rays of a task here: an eighth of the usual number, so that 2^26 rays are as many tasks as 2^29 rays are.
RAYS_A_TASK = 2**19
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
    with scheduled(workers) as client:
        empty = processor_seconds(partial(returned, 8), tasks, client)
        full = processor_seconds(partial(returned, payload), tasks, client)
    return Costs(0.5 * empty, max(full - 0.5 * empty, 0.5 * empty), payload)


@contextmanager
def on_one_processor() -> Iterator[int]:
    """Keep this thread, and the threads that it starts, on one processor; yields its number."""
    usable = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {min(usable)})
        yield min(usable)
    finally:
        os.sched_setaffinity(0, usable)


@contextmanager
def scheduled(workers: int) -> Iterator[Any]:
    """Workers of dask with one processor each, and their scheduler in this process."""
    from distributed import Client

    usable = sorted(os.sched_getaffinity(0))
    with Client(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address="127.0.0.1:0") as client:
        for number, address in enumerate(client.nthreads()):
            client.run(os.sched_setaffinity, 0, {usable[number % len(usable)]}, workers=[address])
        yield client


def seconds_of(function: Callable[..., Any], **given: Any) -> float:
    begin = time.perf_counter()
    function(**given)
    return time.perf_counter() - begin


def measured_times(rays: int, arcs: int) -> dict[str, float]:
    """Seconds by the clock of a count of rays on Koch's curve and of a sweep, on one processor and on workers."""
    law, basis = ker.WallLaw(geo.koch(4)), ker.Bins(BINS)
    count = partial(ker.discretise, law, basis, "monte-carlo", samples=rays, rng=0)
    swept = partial(spec.sweep, geo.focusing_arcs, {"half_angle": np.linspace(0.2, 1.5, arcs)}, "gap", 1e-6)
    one_gap = partial(spec.spectral_gap, ker.WallLaw(geo.focusing_arcs(0.3)), 1e-6)
    found: dict[str, float] = {}
    with patch.object(chunks, "RAYS_A_TASK", RAYS_A_TASK), TemporaryDirectory() as folder:
        with on_one_processor():
            count(samples=2**16)
            found["rays"] = seconds_of(count)
            found["rays, checkpoint"] = seconds_of(count, checkpoint=Path(folder) / "rays")
        for workers in (1, 2):
            with scheduled(workers) as client:
                # workers load the library and the compiled loops first
                client.run(count, samples=2**16)
                client.run(one_gap)
                found[f"rays, {workers}"] = seconds_of(count, client=client)
                found[f"arcs, {workers}"] = seconds_of(swept, client=client)
    return found


def of_times(times: dict[str, float], tasks: int, arcs: int) -> list[str]:
    """What the measured times say."""
    one = times["rays"] / tasks
    more, stored = (times[f"rays, {name}"] / tasks - one for name in ("1", "checkpoint"))
    return [
        f"{tasks} tasks of {one:.2f} s, rays on Koch's curve: one worker {times['rays, 1']:.1f} s, two "
        f"{times['rays, 2']:.1f} s, {times['rays, 1'] / times['rays, 2']:.2f} times as fast.",
        f"A sweep of {arcs} focusing arcs: one worker {times['arcs, 1']:.1f} s, two {times['arcs, 2']:.1f} s, "
        f"{times['arcs, 1'] / times['arcs, 2']:.2f} times as fast.",
        f"A task takes {1e3 * more:.1f} ms more on a worker than in a loop, {100 * more:.2g} % of a task of a second; "
        f"with a checkpoint {1e3 * stored:.1f} ms more.",
    ]


def report(costs: Costs, times: list[str]) -> str:
    """Measurements, what they mean for long runs, and the table of simulated runs, fraction of time that is work."""
    one = costs.submit + costs.result
    tasks = 1e13 / chunks.RAYS_A_TASK
    lines = [
        f"A task costs client and scheduler {1e3 * one:.2f} ms of processor time, with {costs.payload} bytes of "
        f"result; that is at most {1.0 / one:.0f} tasks a second.",
        f"A thousand workers need tasks of {1000 * one:.1f} s or more. A million points take {1e6 * one / 3600:.1f} h "
        f"or more, and 10^13 rays, {tasks:.2g} tasks, {tasks * one / 3600:.1f} h.",
        *times,
        "",
        f"| workers | {' | '.join(f'tasks of {seconds:g} s' for seconds in SECONDS_A_TASK)} |",
        f"|---{'|---' * len(SECONDS_A_TASK)}|",
    ]
    for workers in WORKERS:
        runs = [simulate(workers, seconds, costs) for seconds in SECONDS_A_TASK]
        lines.append(f"| {workers} | {' | '.join(f'{run.efficiency:.2f}' for run in runs)} |")
    return "\n".join(lines)


def main() -> None:
    """Measure, simulate, and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scaling", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few tasks, rays and arcs")
    quick = parser.parse_args().quick
    tasks, arcs = (4, 4) if quick else (128, 50)
    times = measured_times(tasks * RAYS_A_TASK, arcs)
    print(report(measured_costs(100 if quick else 3000), of_times(times, tasks, arcs)))


if __name__ == "__main__":
    main()
