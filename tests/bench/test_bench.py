"""The benchmark itself, in small: its scenes, its references, its processes, its report."""

import dataclasses
import json
import os
import time

import numpy as np
import pytest
from campaigns.speed.exact_rows import ArcRow
from matplotlib.figure import Figure
from scipy.stats import norm, t

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.bench import problems as collision_quantities
from asperity.bench import problems as uniform_disk
from asperity.bench import standard_set
from asperity.bench.problems import OWN_QUANTITIES, QUANTITIES, methods_of, problem_names
from asperity.bench.quantities import (
    LAW_BASIS,
    RANDOM_WALLS,
    eta_at,
    matrix_methods,
    random_wall,
    resistance_of,
    scenes,
    standard_names,
    wall_of,
)
from asperity.bench.standard_set import (
    FINEST,
    QUICK,
    Effort,
    TimePlan,
    known_reference,
    made_references,
    run_problems,
    save,
)
from asperity.core.child import ChildCrashed, ChildProcess, OutOfTime
from asperity.errors import InputError
from asperity.estimates import student_95
from asperity.kernels.bases.polynomials import Directions
from asperity.kernels.sampling.sobol import PARTS
from asperity.spectral.work_diagrams.problem import Machine
from asperity.spectral.work_diagrams.report import WorkRow
from commands import run

RAYS = 2**12


def report_of(rows, problem="teeth/law"):
    reference = spec.ReferenceValue(0.0, 1e-9, "by hand")
    methods = [spec.WorkMethod(name, float) for name in dict.fromkeys(row[0] for row in rows)]
    report = spec.WorkReport.of(spec.WorkProblem(problem, reference), methods, Machine.here())
    for name, error, seconds in rows:
        report = report.with_row(WorkRow(name, 1, "done", error, tuple(seconds)))
    return report


# scenes and quantities


def test_the_standard_set_has_a_wall_of_every_kind():
    walls = [wall_of(name) for name in standard_names()]
    assert len(walls) == 8
    assert {wall.is_polygonal for wall in walls} == {True, False}
    assert not any(ker.WallLaw(wall).has_traced_parts for wall in walls[:3])
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
    assert len(problem_names()) == sum(len(one.scenes) for one in QUANTITIES.values())
    assert problem_names(["koch/law"]) == ["koch/law"]
    assert problem_names(["cusps"]) == [f"cusps/{name}" for name in ("law", "moment", "lambda2", "collision", "disk")]
    assert len(problem_names(["moment"])) == 8
    assert problem_names(["diffuse-tube"]) == ["diffuse-tube/transmission"]
    assert problem_names(["distance"]) == [f"{name}/distance" for name in standard_names()[:3]]
    assert problem_names(["random-3"]) == ["random-3/moment"]


def test_every_problem_has_a_reference():
    assert [name for name in problem_names() if known_reference(name) is None] == []
    assert all(known_reference(f"random-{number}/moment") is not None for number in range(RANDOM_WALLS))


@pytest.mark.parametrize("name", ["triangular-teeth", "focusing-arc", "cusps", "mushroom", "profile", "mixed"])
def test_a_law_that_is_kept_is_markov_symmetric_and_that_of_the_wall(name):
    law = known_reference(f"{name}/law")
    size = LAW_BASIS.size
    assert law.value.shape == (size, size) and np.array_equal(law.value, law.value.T)
    # equal bins: the constant is kept
    assert np.abs(law.value.sum(axis=1) - 1.0).max() <= 4.0 * law.error + 1e-12
    # rays of another seed
    seen = ker.discretise(ker.WallLaw(wall_of(name)), LAW_BASIS, "qmc", samples=2**16, rng=np.random.default_rng(5))
    assert np.linalg.norm(seen.symmetric - law.value) <= 2.0 * seen.error.value + law.error


@pytest.mark.parametrize("name", standard_names())
def test_a_moment_that_is_kept_is_that_of_the_wall(name):
    moment = known_reference(f"{name}/moment")
    seen = ker.discretise(ker.WallLaw(wall_of(name)), ker.Legendre(2), "qmc", samples=2**16)
    beyond = max(abs(seen.symmetric[1, 1] - float(moment.value)) - moment.error, 0.0)
    # a half width of 95 % from the spread of eight nets: multiples of the standard error follow Student's distribution
    assert norm.isf(t.sf(student_95(PARTS) * beyond / seen.error.value, PARTS - 1)) < 4.0
    assert moment.error <= 5e-5


def test_rows_of_arcs_by_formula_are_those_of_the_law():
    law = ker.CircularArcLaw(1.2)
    for theta in np.random.default_rng(4).uniform(0.0, np.pi, 20):
        row = ArcRow.of(theta, 1.2)
        assert row.mean() == pytest.approx(law.apply(np.cos, theta) + 1j * law.apply(np.sin, theta), abs=1e-10)
        assert row.distribution(np.array([0.0, np.pi])) == pytest.approx([0.0, 1.0], abs=1e-12)


def test_known_numbers_are_the_references():
    assert float(known_reference("triangular-teeth/moment").value) == pytest.approx(0.134541971359171, abs=1e-14)
    assert float(known_reference("focusing-arc/moment").value) == pytest.approx(0.327558333378, abs=1e-12)
    # Chumley, Feres, Zhang 2013: zeta = -(ln 3)/4 for semicircles
    assert float(known_reference("mixed/eta").value) == pytest.approx(1.0358390705, abs=1e-10)
    edge = known_reference("koch/lambda2")
    assert edge.is_exact and "theorem" in edge.source


@pytest.mark.parametrize("name", ["triangular-teeth", "focusing-arc", "mixed"])
def test_every_sampled_route_is_within_its_reported_error(name):
    wall = wall_of(name)
    reference = known_reference(f"{name}/law")
    for route, *_ in matrix_methods(wall, LAW_BASIS):
        if route.is_random:
            found = route.solve(2**14, np.random.default_rng(1))
            distance = float(np.linalg.norm(found.symmetric - reference.value))
            # the Frobenius norm of noise on a thousand entries is close to its mean
            assert distance <= 2.0 * found.error.value + reference.error, route.name


@pytest.mark.parametrize(("law", "expected"), [(ker.specular(), 1.0), (ker.retroreflection(), 1.5)])
def test_the_resistance_is_read_off_a_matrix(law, expected):
    matrix = ker.discretise(law, Directions())
    assert resistance_of(matrix.symmetric) == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize(("name", "angle"), [("koch", 1e-5), ("mixed", 1e-5), ("focusing-arc", 1e-4)])
def test_rays_at_a_small_angle_come_to_the_diffusivity(name, angle):
    wall = wall_of(name)
    assert eta_at(wall, angle) == pytest.approx(float(known_reference(f"{name}/eta").value), abs=2e-3)


@pytest.mark.parametrize(("scene", "known"), [("diffuse-channel", 0.24056), ("diffuse-tube", 0.1909424)])
def test_the_transmission_of_diffuse_walls_is_known_beyond_the_printed_digits(scene, known):
    reference = known_reference(f"{scene}/transmission")
    assert float(reference.value) == pytest.approx(known, abs=5e-6) and reference.error < 1e-12


@pytest.mark.parametrize("scene", ["diffuse-channel", "diffuse-tube", "focusing-arc"])
def test_errors_of_transmissions_hold_at_every_tolerance(scene):
    reference = known_reference(f"{scene}/transmission")
    for method, budgets, _ in methods_of(f"{scene}/transmission"):
        for budget in budgets:
            found = method.solve(budget, np.random.default_rng(2))
            assert abs(float(found) - float(reference.value)) <= found.error + 2.0 * reference.error
            assert found.error <= 1.0 / budget and (method.name == "flights") == found.method.startswith("flights")


def test_the_correlation_of_v1_is_that_of_the_ideal_disks():
    smooth, rough = ker.smooth_matrix(uniform_disk.DISK), ker.no_slip_matrix(uniform_disk.DISK)
    velocity = uniform_disk.sampled_velocities(200_000, np.random.default_rng(2))
    square = np.mean(velocity[:, 0] ** 2)
    along, roll = uniform_disk.velocity_fraction()
    assert square == pytest.approx(along**2 / 4 + roll**2 / 4, rel=0.02)
    for matrix, moment in ((smooth, -1.0), (rough, 1.0)):
        incoming = -velocity
        sampled = np.mean(-incoming[:, 0] * (incoming @ matrix.T)[:, 0]) / square
        assert sampled == pytest.approx(uniform_disk.correlation_of(moment), abs=0.02)


@pytest.mark.parametrize("way", ["operator", "velocities", "action"])
def test_three_ways_to_the_collision_agree(way):
    wall = wall_of("triangular-teeth")
    exact = known_reference("triangular-teeth/collision").value
    if way == "operator":
        assert float(collision_quantities.by_operator(wall)) == pytest.approx(exact, abs=1e-13)
    elif way == "action":
        assert collision_quantities.by_action(wall, 64) == pytest.approx(exact, abs=1e-3)
    else:
        # standard deviation of one sample below 2
        rng = np.random.default_rng(3)
        assert abs(collision_quantities.by_velocities(wall, RAYS, rng) - exact) <= 4 * 2 / RAYS**0.5


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
    effort = Effort(True, 1, 0.01, 60.0, 5.0, 120.0)
    (report,) = run_problems(["triangular-teeth/collision"], effort, tmp_path, lambda line: None)
    assert {row.status for row in report.rows} <= {"done", "left out"}
    assert report.rows[0].error <= 1e-12
    path = tmp_path / "triangular-teeth-collision.json"
    assert spec.WorkReport.of_json(path.read_text()) == report
    (again,) = run_problems(["triangular-teeth/collision"], effort, tmp_path, lambda line: None)
    assert again == report


def test_what_has_no_independent_reference_says_so(monkeypatch):
    said = []
    monkeypatch.setattr("asperity.bench.standard_set.known_reference", lambda name: None)
    assert list(run_problems(["cusps/lambda2"], QUICK, None, said.append)) == []
    assert said == ["cusps/lambda2: left out, no independent reference is known"]


def test_a_plan_is_kept_whatever_the_parts_take(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("asperity.bench.standard_set.time.monotonic", lambda: now[0])
    for greedy in (lambda number: True, lambda number: number % 2, lambda number: number > 6):
        start, plan = now[0], TimePlan(100.0, 10)
        for number in range(10):
            fraction = plan.next_fraction()
            assert 0.0 < fraction <= 100.0 - (now[0] - start)
            now[0] += fraction if greedy(number) else 0.0
        assert now[0] - start <= 100.0 + 1e-9


def test_the_time_of_a_run_is_kept_and_what_it_left_out_is_said(tmp_path):
    effort = dataclasses.replace(QUICK, total_seconds=0.01)
    said = []
    (report,) = run_problems(["triangular-teeth/collision"], effort, tmp_path, said.append)
    assert ", without a result: " in said[0] and "left out, the time planned for this method was spent" in said[0]
    assert "left out: the time planned for this method was spent" in standard_set.summary([report])
    assert {(row.status, row.note) for row in report.rows} <= {
        ("left out", "the time planned for this method was spent"),
        ("left out", "a smaller budget met the time limit"),
    }


def test_a_run_is_written(tmp_path):
    report = report_of([("auto", 1e-3, [0.2, 0.3]), ("rows", 1e-3, [0.15, 0.2])])
    names = {path.name for path in save([report], tmp_path)}
    assert names == {"summary.md", "tables.md", "bench.json", "teeth.png"}
    data = json.loads((tmp_path / "bench.json").read_text(), parse_constant=lambda word: pytest.fail(word))
    assert [spec.WorkReport.of_json(json.dumps(one)) for one in data["reports"]] == [report]
    summary = (tmp_path / "summary.md").read_text()
    assert "in 1 of the 1 problems where" in summary and "| 1.3 |" in summary
    assert "| teeth/law | by hand | 1.0e-09 |" in summary


def test_a_picture_has_all_problems_of_a_scene_whatever_their_order(tmp_path, monkeypatch):
    reports = [report_of([("auto", 1e-3, [0.2])], f"{scene}/{what}") for what in "ab" for scene in "xy"]
    drawn = []
    monkeypatch.setattr(
        "asperity.bench.standard_set._draw", lambda shown: drawn.append([one.problem for one in shown]) or Figure()
    )
    save(reports, tmp_path)
    assert drawn == [["x/a", "x/b"], ["y/a", "y/b"]]


# a wall of the user


NOTCHES = [(0.0, 0.0), (0.2, -0.5), (0.5, -0.1), (0.7, -0.6), (1.0, 0.0)]
SHORT = Effort(True, 1, 0.01, 20.0, 60.0, 600.0)


@pytest.fixture
def rough_references(monkeypatch):
    """Budgets that take less than a second."""
    monkeypatch.setitem(FINEST, "beams", (1e4,))
    monkeypatch.setitem(FINEST, "adaptive angles", (1e3,))
    monkeypatch.setitem(FINEST, "randomised QMC", (4.0**9,))
    monkeypatch.setitem(FINEST, "flights", (1e2,))


@pytest.fixture
def notches(tmp_path):
    geo.Wall.from_vertices(NOTCHES).save(tmp_path / "notches.toml")
    return str(tmp_path / "notches.toml")


def test_what_is_no_problem_of_the_standard_set_is_a_wall(notches):
    assert problem_names([notches]) == [f"{notches}/{quantity}" for quantity in OWN_QUANTITIES]
    assert problem_names(["koch:generations=2"])[0] == "koch:generations=2/law"
    # a wall of the standard set has stored references and more quantities
    assert "koch/lambda2" in problem_names(["koch"])
    with pytest.raises(InputError, match="half_angle"):
        problem_names(["focusing-arcs:half_angle=9"])


@pytest.mark.parametrize(
    ("text", "exact"), [("triangular-teeth:angle=0.7", "closed form"), ("focusing-arcs:half_angle=1.2", "closed form"),
                        ("dispersing-arcs:curvature=2", None)],
)  # fmt: skip
@pytest.mark.usefixtures("rough_references")
def test_references_made_for_a_wall_are_those_that_are_stored(text, exact):
    stored = {"tri": "triangular-teeth", "foc": "focusing-arc", "dis": "cusps"}[text[:3]]
    with ChildProcess() as child:
        found = made_references(f"{text}/moment", child, 60.0)
    right = known_reference(f"{stored}/moment")
    for one in found:
        assert abs(float(one.value) - float(right.value)) <= 2.0 * (one.error + right.error), one.source
    assert [one.error for one in found] == sorted(one.error for one in found)
    assert exact is None or found[0].made_by == ("closed form", "auto")
    # nothing is measured beside what it made itself, and everything has a reference
    for method in (*FINEST, "auto", "stratified", "Monte Carlo"):
        beside = next(one for one in found if method not in one.made_by)
        assert method == "randomised QMC" or not beside.source.startswith(method)


@pytest.mark.usefixtures("rough_references")
def test_flights_are_the_reference_of_the_transmission_of_a_wall_for_all_methods():
    with ChildProcess() as child:
        (found,) = made_references("focusing-arcs:half_angle=1.2/transmission", child, 60.0)
    right = known_reference("focusing-arc/transmission")
    assert abs(float(found.value) - float(right.value)) <= found.error + 2.0 * right.error
    assert found.made_by == () and found.source.startswith("flights with budget 100")


@pytest.fixture
def references(monkeypatch):
    """The references that are made if the methods give these answers."""

    def made(answer):
        monkeypatch.setattr(ChildProcess, "call", lambda self, function, name, *asked, seconds: answer(*asked))
        monkeypatch.setattr(ChildProcess, "start", lambda self: None)
        return made_references("koch:generations=2/moment", ChildProcess(), 1.0)

    return made


def test_a_reference_that_rays_do_not_confirm_has_the_distance_as_its_error(references):
    answers = {"beams": (0.5, 1e-12, ""), "adaptive angles": (0.3, 1e-6, "")}
    found = references(lambda method, budget: answers.get(method, (0.3, 1e-4, "")))
    assert [one.source.split(" with")[0] for one in found] == ["adaptive angles", "randomised QMC", "beams"]
    assert found[2].error == pytest.approx(0.2) and "not confirmed by rays" in found[2].source


def test_a_method_that_is_not_done_in_time_makes_no_reference(references):
    def answer(method, budget):
        if method != "beams" or budget > 1e4:
            raise OutOfTime
        return 0.5, 1e-12, ""

    (beams,) = references(answer)
    assert beams.made_by == ("beams", "auto") and "budget 10000" in beams.source


@pytest.mark.usefixtures("rough_references")
def test_a_wall_of_a_file_is_measured_and_goes_on_until_it_is_another(notches, tmp_path):
    name = f"{notches}/moment"
    (report,) = run_problems([name], SHORT, tmp_path, lambda line: None)
    assert list(report.methods) == ["auto", "beams", "adaptive angles", "randomised QMC", "stratified", "Monte Carlo"]
    assert all(row.error <= 1e-3 for row in report.rows if row.method in ("auto", "beams") and row.is_done)
    assert any(row.is_done for row in report.rows if row.method == "auto")
    known = tmp_path / "notches.toml-moment.json"
    assert spec.WorkReport.of_json(known.read_text()) == report
    (again,) = run_problems([name], SHORT, tmp_path, lambda line: None)
    assert again.rows == report.rows
    wall_of.cache_clear()
    methods_of.cache_clear()
    geo.Wall.from_vertices([(x, 0.9 * y) for x, y in NOTCHES]).save(notches, overwrite=True)
    (other,) = run_problems([name], SHORT, tmp_path, lambda line: None)
    assert not {row.seconds for row in other.rows if row.is_done} & {row.seconds for row in report.rows}


# the command


def test_the_command_lists_problems_and_refuses_others(tmp_path):
    result = run("bench", "hilbert-curve", "--out", tmp_path)
    assert result.exit_code == 1 and "neither a named wall nor a file" in result.stderr
    assert "SCENE, QUANTITY or SCENE/QUANTITY" in result.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("rough_references")
def test_the_command_measures_a_wall_of_a_file(tmp_path, monkeypatch, notches):
    monkeypatch.setattr("asperity.bench.problems.OWN_QUANTITIES", ("moment",))
    monkeypatch.setattr("asperity.bench.standard_set.QUICK", SHORT)
    result = run("bench", notches, "--quick", "--out", tmp_path / "new")
    assert result.exit_code == 0, result.output
    names = {"summary.md", "tables.md", "bench.json", "notches.toml.png", "notches.toml-moment.json"}
    assert {path.name for path in (tmp_path / "new").iterdir()} == names
    assert "| beams with budget" in (tmp_path / "new" / "summary.md").read_text()
    refused = run("bench", "koch:generations=1", "--quick", "--out", tmp_path / "new")
    assert refused.exit_code == 1 and "--force" in refused.output
