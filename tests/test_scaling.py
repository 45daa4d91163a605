"""The simulation of workers and scheduler: its limits are those of theory, and small real runs agree with it."""

from __future__ import annotations

import pytest
from benchmarks.scaling import WORKERS, Costs, of_times, processor_seconds, report, returned, simulate

pytest.importorskip("simpy")


@pytest.mark.parametrize("workers", [1, 7, 100])
def test_free_tasks_leave_no_worker_waiting_but_at_the_end(workers):
    run = simulate(workers, 1.0, Costs(0.0, 0.0, 0), tasks=50 * workers)
    # the last tasks end within one duration of each other
    assert 1.0 - 1.3 / 50 < run.efficiency <= 1.0 + 1e-12 and run.load == 0.0


def test_one_worker_waits_for_the_server_alone():
    run = simulate(1, 1.0, Costs(0.1, 0.3, 0), tasks=400)
    # (durations are uneven, but their sum is work)
    assert run.efficiency == pytest.approx(1.0 / 1.4, rel=0.02)
    assert run.rate * (1.0 + 0.4) == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("seconds", [0.1, 1.0])
def test_a_server_that_is_too_slow_sets_the_rate(seconds):
    costs = Costs(1e-3, 2e-3, 0)
    run = simulate(1000, seconds, costs)
    assert run.rate == pytest.approx(1.0 / 3e-3, rel=0.03) and run.load > 0.97
    assert run.efficiency == pytest.approx(seconds / (1000 * 3e-3), rel=0.05)


def test_long_tasks_keep_a_thousand_workers_busy():
    run = simulate(1000, 30.0, Costs(1e-3, 2e-3, 0))
    assert run.efficiency > 0.9 and run.load < 0.15


def test_tasks_in_this_process_cost_little():
    assert processor_seconds(lambda task: returned(8, task), 200, None) < 1e-3


def test_the_report_says_what_the_measurements_mean():
    times = {
        "rays": 64.0, "rays, checkpoint": 64.64, "rays, 1": 65.28, "rays, 2": 34.0, "arcs, 1": 20.0, "arcs, 2": 10.5,
    }  # fmt: skip
    text = report(Costs(1e-3, 2e-3, 32768), of_times(times, 128, 50))
    assert "1.92 times as fast" in text and "1.90 times as fast" in text and "at most 333 tasks a second" in text
    # 1.28 s more in 128 tasks, and 0.64 s with a checkpoint
    assert "takes 10.0 ms more on a worker than in a loop, 1 % of a task of a second" in text
    assert "with a checkpoint 5.0 ms more" in text
    assert "need tasks of 3.0 s" in text and "A million points take 0.8 h" in text and "2.4e+06 tasks, 2.0 h" in text
    assert text.count("\n| ") == 1 + len(WORKERS)
