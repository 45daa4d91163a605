"""The regression watch: what makes a run worse than an earlier one, down to the fewest repeats that are run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from campaigns.comparison import DRIFT, SIGNIFICANT, compare_runs

from asperity import spectral as spec
from asperity.bench.run import BenchRun

ROOT = Path(__file__).parents[2]
TIMES = (1.0, 1.1, 1.2, 1.3)


def run_with(*times, error=1e-3):
    problem = spec.WorkProblem("teeth/law", spec.ReferenceValue(0.0, 1e-9, "by hand"))
    report = spec.WorkReport.of(problem, [spec.WorkMethod("auto", float)], spec.Machine.here())
    return BenchRun((report.with_row(spec.WorkRow("auto", 1, "done", {"absolute": error}, times)),))


def test_four_repeats_are_enough_to_find_a_row_twice_as_slow():
    slow = run_with(*(2.0 * seconds for seconds in TIMES))
    (change,) = compare_runs(run_with(*TIMES), slow).changes
    assert change.p_value == pytest.approx(1.0 / 70.0) and change.p_value < SIGNIFICANT
    assert change.is_slower and change.is_worse and change.time_ratio == pytest.approx(2.0)
    (back,) = compare_runs(slow, run_with(*TIMES)).changes
    assert not back.is_worse and back.time_ratio == pytest.approx(0.5) and back.p_value < SIGNIFICANT


@pytest.mark.parametrize("now", [(1.2, 2.1, 2.2, 2.3), (1.2, 1.31, 1.4, 1.5), TIMES])
def test_one_fast_repeat_or_less_than_the_drift_of_machines_is_no_slower_row(now):
    assert min(now) <= DRIFT
    assert not compare_runs(run_with(*TIMES), run_with(*now)).is_worse


def test_the_command_ends_with_one_where_a_row_is_worse_and_says_which(tmp_path):
    run = run_with(*TIMES)
    old, latest = tmp_path / "old.json", tmp_path / "new.json"
    latest.write_text(run.to_json())
    for factor, code in ((1.0, 0), (0.5, 1), (2.0, 0)):
        data = json.loads(run.to_json())
        for row in data["reports"][0]["rows"]:
            row["seconds"] = [factor * seconds for seconds in row["seconds"]]
        old.write_text(json.dumps(data))
        command = [sys.executable, "-m", "campaigns.comparison", str(old), str(latest)]
        result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert result.returncode == code, result.stderr
        assert ("| teeth/law | auto | 1 | 2.00 | 0.014 | 1 | worse |" in result.stdout) == bool(code)
        assert ("faster" in result.stdout) == (factor == 2.0)
