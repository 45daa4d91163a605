"""The benchmark itself, in small: its scenes, its references, its processes, its report, and the extreme cases."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import time

import numpy as np
import pytest
from click.testing import CliRunner

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.bench import quantities, routes, scene_savings
from asperity.bench.bench_run import BenchRun
from asperity.bench.child_process import ChildCrashed, ChildProcess, OutOfTime
from asperity.bench.comparison import compare_runs
from asperity.bench.extreme_report import run_extremes
from asperity.bench.extreme_row import ExtremeRow
from asperity.bench.matrix_references import matrix_references
from asperity.bench.scenes import RANDOM_WALLS, random_wall, scenes, standard_names, wall_of
from asperity.bench.standard_set import Effort, problem_names, references_of, run_problems
from asperity.cli import main
from asperity.errors import InputError

RAYS = 2**12


def run_report(rows, problem="teeth/law"):
    reference = spec.ReferenceValue(0.0, 1e-9, "by hand")
    methods = [spec.WorkMethod(name, float) for name in dict.fromkeys(row[0] for row in rows)]
    report = spec.WorkReport.of(spec.WorkProblem(problem, reference), methods, spec.Machine.here())
    for name, error, seconds in rows:
        report = report.with_row(spec.WorkRow(name, 1, "done", {"absolute": error}, tuple(seconds)))
    return BenchRun((report,))


# scenes and quantities


def test_the_standard_set_has_a_wall_of_every_kind():
    walls = [wall_of(name) for name in standard_names()]
    assert len(walls) == 8
    assert {wall.is_polygonal for wall in walls} == {True, False}
    assert sum(ker.WallLaw(wall).closed_form is not None for wall in walls[:3]) == 3
    assert len(wall_of("koch").pieces) == 256 and len(wall_of("profile").pieces) > 800
    assert set(wall_of("mixed").plan().primitives) == {"lines", "circles", "beziers"}


def test_random_walls_are_walls_and_the_same_for_ever():
    walls = [random_wall(number) for number in range(RANDOM_WALLS)]
    assert [wall.is_polygonal for wall in walls[::2]] == [True] * (RANDOM_WALLS // 2)
    # a curved piece may be drawn as a segment, but hardly all of a wall's
    assert sum(wall.is_polygonal for wall in walls[1::2]) <= 2
    assert len({wall.arc_length for wall in walls}) == RANDOM_WALLS
    assert np.array_equal(random_wall(7).vertices, walls[7].vertices)
    assert len(scenes()) == 8 + RANDOM_WALLS


def test_problems_are_found_by_scene_by_quantity_and_by_both():
    assert len(problem_names()) == 8 * len(quantities.QUANTITIES)
    assert problem_names(["koch/law"]) == ["koch/law"]
    assert problem_names(["cusps"]) == [f"cusps/{quantity}" for quantity in quantities.QUANTITIES]
    assert len(problem_names(["moment"])) == 8
    assert problem_names(["random-3"]) == ["random-3/law", "random-3/moment"]
    with pytest.raises(InputError, match="expected SCENE"):
        problem_names(["hilbert-curve"])


@pytest.mark.parametrize("name", ["triangular-teeth", "rectangular-teeth"])
def test_two_references_of_a_polygon_agree_within_their_errors(name):
    (first, one, _, made), (second, two, _, other) = matrix_references(wall_of(name), ker.Bins(8), quick=True)
    # the matrix and not its diagonal
    assert np.linalg.norm(first.symmetric - second.symmetric) <= one + 3.0 * two
    assert not set(made) & set(other)


@pytest.mark.parametrize("name", ["triangular-teeth", "focusing-arc", "mixed"])
def test_every_sampled_route_is_within_its_reported_error(name):
    wall = wall_of(name)
    (reference, error, _, _) = matrix_references(wall, ker.Bins(4), quick=True)[0]
    for route in routes.routes_for(wall):
        if route.is_random:
            found = route.matrix(wall, ker.Bins(4), 2**14, np.random.default_rng(1))
            distance = float(np.linalg.norm(found.symmetric - reference.symmetric))
            # the Frobenius norm of noise on ten free entries is within a factor of three of its mean
            assert distance <= 3.0 * found.error.value + error, route.name


def test_the_correlation_of_v1_is_that_of_the_ideal_disks():
    smooth, rough = ker.smooth_matrix(quantities.DISK), ker.no_slip_matrix(quantities.DISK)
    velocity = quantities.sampled_velocities(200_000, np.random.default_rng(2))
    square = np.mean(velocity[:, 0] ** 2)
    along, roll = quantities.velocity_share()
    assert square == pytest.approx(along**2 / 4 + roll**2 / 4, rel=0.02)
    for matrix, moment in ((smooth, -1.0), (rough, 1.0)):
        incoming = -velocity
        sampled = np.mean(-incoming[:, 0] * (incoming @ matrix.T)[:, 0]) / square
        assert sampled == pytest.approx(quantities.correlation_of(moment), abs=0.02)


@pytest.mark.parametrize("way", ["operator", "velocities", "action"])
def test_three_ways_to_the_collision_agree(way):
    wall = wall_of("triangular-teeth")
    exact = quantities._collision_references(wall, True)[0].value
    if way == "operator":
        assert float(quantities._by_operator(wall)) == pytest.approx(exact, abs=1e-13)
    elif way == "action":
        assert quantities._by_action(wall, 64) == pytest.approx(exact, abs=1e-3)
    else:
        # standard deviation of one sample below 2
        rng = np.random.default_rng(3)
        assert abs(quantities._by_velocities(wall, RAYS, rng) - exact) <= 4 * 2 / RAYS**0.5


# processes and runs


def test_a_call_that_takes_too_long_is_ended_and_the_next_one_works():
    with ChildProcess() as child:
        first = child.call(os.getpid, seconds=60.0)
        with pytest.raises(OutOfTime):
            child.call(time.sleep, 60.0, seconds=0.2)
        assert child.call(os.getpid, seconds=60.0) not in (first, os.getpid())
        with pytest.raises(ZeroDivisionError):
            child.call(divmod, 1, 0, seconds=60.0)
        with pytest.raises(ChildCrashed, match="code 3"):
            child.call(os._exit, 3, seconds=60.0)


def test_a_problem_runs_in_its_process_and_goes_on_from_its_file(tmp_path):
    effort = Effort(True, 1, 0.01, 60.0, 60.0)
    (report,) = run_problems(["triangular-teeth/collision"], effort, tmp_path, lambda line: None)
    assert {row.status for row in report.rows} <= {"done", "left out"}
    assert report.error(report.rows[0]) <= 1e-12
    path = tmp_path / "triangular-teeth-collision.json"
    assert spec.WorkReport.of_json(path.read_text()) == report
    (again,) = run_problems(["triangular-teeth/collision"], effort, tmp_path, lambda line: None)
    assert again == report


def test_what_has_no_independent_reference_says_so():
    assert references_of("cusps/lambda2", quick=True) == ()
    assert references_of("mixed/disk", quick=True) == ()
    (edge,) = references_of("koch/lambda2", quick=True)
    assert edge.is_exact and "theorem" in edge.source


def test_the_second_eigenvalue_of_the_focusing_arc_has_a_reference_that_holds():
    (reference,) = references_of("focusing-arc/lambda2", quick=True)
    # by another program, from piecewise polynomials on panels of its own
    assert abs(float(reference.value) - 0.3670253152) <= max(reference.error, 1e-6) <= 1e-4


def test_a_run_is_written_and_read_again(tmp_path):
    run = run_report([("auto", 1e-3, [0.2, 0.3]), ("rows", 1e-3, [0.15, 0.2])])
    names = {path.name for path in run.save(tmp_path)}
    assert names == {"summary.md", "tables.md", "bench.json", "teeth-law.png"}
    assert BenchRun.of_json((tmp_path / "bench.json").read_text()) == run
    assert "1 of the 1 problems" in run.summary() and "| 1.3 |" in run.summary()
    json.loads(run.to_json(), parse_constant=lambda word: pytest.fail(word))


# comparison


def test_a_slower_row_is_found_and_noise_is_not():
    before = run_report([("auto", 1e-3, [1.0, 1.1, 1.2, 1.3, 1.4]), ("rows", 1e-3, [1.0, 1.1, 1.2, 1.3, 1.4])])
    now = run_report([("auto", 1e-3, [2.0, 2.1, 2.2, 2.3, 2.4]), ("rows", 1e-3, [1.05, 1.15, 1.25, 1.35, 1.45])])
    found = compare_runs(before, now)
    assert [change.is_slower for change in found.changes] == [True, False]
    assert found.is_worse and not compare_runs(before, before).is_worse
    assert not compare_runs(now, before).is_worse and "faster" in compare_runs(now, before).table()
    assert found.drift == pytest.approx(math.sqrt(2.0 * 1.05))


def test_a_row_that_is_less_exact_or_gone_is_worse():
    before = run_report([("auto", 1e-6, [1.0])])
    assert compare_runs(before, run_report([("auto", 1e-5, [1.0])])).is_worse
    # both below what the reference can tell
    assert not compare_runs(run_report([("auto", 1e-13, [1.0])]), run_report([("auto", 1e-10, [1.0])])).is_worse
    report = before.reports[0]
    gone = dataclasses.replace(report, rows=(spec.WorkRow("auto", 1, "failed", note="no"),))
    assert compare_runs(before, BenchRun((gone,))).is_worse
    with pytest.raises(InputError, match="same problems"):
        compare_runs(before, run_report([("auto", 1e-6, [1.0])], "another"))


# extreme cases


def test_verdicts_tell_apart_what_is_said_and_what_is_not():
    assert ExtremeRow("a", "b", 1.0, 2.0).verdict == "met"
    assert ExtremeRow("a", "b", 3.0, 2.0, reported=4.0).verdict == "degraded as reported"
    assert ExtremeRow("a", "b", 1.0, 2.0, counts={"escaped": 9, "corner": 1}).verdict == "degraded as reported"
    # a flag that is the exact answer is as good as an escape
    aimed = ExtremeRow("a", "b", 1.0, 2.0, counts={"escaped": 9, "corner": 1}, flagged_rightly=1)
    assert aimed.verdict == "met"
    assert ExtremeRow("a", "b", 3.0, 2.0).verdict == "not met"
    assert ExtremeRow("a", "b", float("nan"), 2.0).verdict == "not met"
    assert ExtremeRow("a", "b", ended="refused").verdict == "refused"


def test_a_case_that_would_hang_is_a_row():
    report = run_extremes(True, ["matrix of 2000 bins"], seconds=0.05)
    assert report.rows[0].verdict == "timed out"
    assert "1 cases: 1 timed out." in report.table()


# what scenes leave out


@pytest.mark.parametrize("name", ["rectangular-teeth", "focusing-arc", "mushroom", "profile", "mixed"])
def test_the_result_is_the_same_with_what_is_left_out(name):
    found = scene_savings.savings_of(name, RAYS, 1)
    assert found
    for one in found:
        assert one.is_same, one


# the command


def test_the_command_lists_problems_and_refuses_others(tmp_path):
    result = CliRunner().invoke(main, ["bench", "hilbert-curve", "--out", str(tmp_path)])
    assert result.exit_code == 1 and "expected SCENE" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_and_compares(tmp_path, monkeypatch):
    run = run_report([("auto", 1e-3, [1.0, 1.1, 1.2, 1.3, 1.4])])
    monkeypatch.setattr("asperity.bench.commands.run_problems", lambda *_: iter(run.reports))
    old = tmp_path / "old.json"
    old.write_text(run_report([("auto", 1e-3, [0.1, 0.2, 0.3, 0.4, 0.5])]).to_json())
    out = tmp_path / "new"
    result = CliRunner().invoke(main, ["bench", "--quick", "--out", str(out), "--compare", str(old)])
    assert result.exit_code == 1, result.output
    assert "worse" in result.stdout and (out / "bench.json").exists()
    same = CliRunner().invoke(main, ["bench", "--quick", "--out", str(out), "--compare", str(out / "bench.json")])
    assert same.exit_code == 0
