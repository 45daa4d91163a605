"""Error against run time, on synthetic problems whose orders are known."""

import json
import math
import time

import numpy as np
import pytest

from asperity import spectral as spec
from asperity.errors import AccuracyError, InputError
from asperity.estimates import Estimate
from asperity.spectral.work_diagrams.problem import Machine
from asperity.spectral.work_diagrams.report import WorkRow
from asperity.spectral.work_diagrams.runs import measure

EXACT = np.e - 1.0
BUDGETS = [8, 16, 32, 64]


def trapezoid(n):
    x = np.linspace(0.0, 1.0, n + 1)
    return np.sum(np.exp(x[1:]) + np.exp(x[:-1])) / (2 * n)


def simpson(n):
    return (4.0 * trapezoid(2 * n) - trapezoid(n)) / 3.0


def rectangles(n):
    return np.mean(np.exp(np.arange(n) / n))


def monte_carlo(n, rng):
    return np.mean(np.exp(rng.random(n)))


def stratified(n, rng):
    return np.mean(np.exp((np.arange(n) + rng.random(n)) / n))


DECLARED = {
    "rectangles": spec.WorkMethod("rectangles", rectangles, order=1.0),
    "trapezoid": spec.WorkMethod("trapezoid", trapezoid, order=2.0),
    "simpson": spec.WorkMethod("simpson", simpson, order=4.0),
    "monte-carlo": spec.WorkMethod("monte-carlo", monte_carlo, is_random=True, order=0.5),
    "stratified": spec.WorkMethod("stratified", stratified, is_random=True, order=1.5),
}


def problem(auto="auto"):
    return spec.WorkProblem("integral of exp", spec.ReferenceValue(EXACT, 0.0, "closed form"), auto=auto)


@pytest.mark.parametrize("name", DECLARED)
def test_the_fitted_order_is_the_declared_one(name):
    method = DECLARED[name]
    report = spec.work_precision(problem(), [method], BUDGETS, repeats=200 if method.is_random else 1)
    fitted = report.order(name)
    assert fitted.points == len(BUDGETS)
    assert fitted.agrees_with(method.order)
    assert fitted.low <= fitted.order <= fitted.high


def test_a_wrongly_declared_order_is_shown():
    wrong = spec.WorkMethod("trapezoid", trapezoid, order=3.0)
    report = spec.work_precision(problem(), [wrong], BUDGETS, repeats=1)
    assert report.order("trapezoid").verdict(3.0) == "differs"
    assert "declared 3: differs" in report.table()


def test_the_confidence_interval_covers_the_slope_as_often_as_it_says():
    rng = np.random.default_rng(0)
    size = 2.0 ** np.arange(6)
    covered = 0
    for _ in range(400):
        fit = spec.fit_order(size, size**-1.5 * np.exp(0.2 * rng.standard_normal(6)))
        covered += fit.low <= 1.5 <= fit.high
    # 380 expected, standard deviation 4.4
    assert abs(covered - 380) <= 4 * 4.4


def test_the_interval_of_root_mean_squares_covers_the_slope_as_often_as_it_says():
    rng = np.random.default_rng(1)
    size = 4.0 ** np.arange(3)
    repeats = np.array([16, 16, 4])
    covered, by_scatter = 0, 0
    for _ in range(1000):
        error = size**-0.5 * np.sqrt([np.mean(rng.standard_normal(n) ** 2) for n in repeats])
        fit = spec.fit_order(size, error, repeats)
        covered += fit.low <= 0.5 <= fit.high
        by_scatter += fit.high - fit.low < 0.2
    # 950 expected, standard deviation 6.9; widening where the scatter is large adds some, so only few are too many
    assert 950 - 4 * 6.9 <= covered <= 1000
    # three points that happen to lie on a line must not look certain
    assert by_scatter == 0


def test_errors_below_the_reference_take_no_part_in_the_order():
    known = spec.WorkProblem("shifted", spec.ReferenceValue(EXACT + 1e-5, 1e-5, "a rough value"))
    report = spec.work_precision(known, [DECLARED["trapezoid"]], [4, 8, 16, 32, 1024, 2048], repeats=1)
    assert report.order("trapezoid").points == 4
    assert report.order("trapezoid").agrees_with(2.0)


def synthetic_report(rows, auto="auto"):
    methods = [spec.WorkMethod(name, float) for name in dict.fromkeys(row[0] for row in rows)]
    report = spec.WorkReport.of(problem(auto), methods, Machine.here())
    for name, budget, error, seconds in rows:
        report = report.with_row(WorkRow(name, budget, "done", error, (seconds,)))
    return report


def test_the_front_holds_what_no_other_row_beats():
    report = synthetic_report([("a", 1, 1e-2, 1.0), ("a", 2, 1e-3, 2.0), ("b", 1, 1e-2, 3.0), ("b", 2, 1e-4, 4.0)])
    assert [(row.method, row.budget) for row in report.front()] == [("a", 1), ("a", 2), ("b", 2)]
    assert report.choice() is None


def test_the_choice_is_compared_with_the_best_method_at_equal_error():
    rows = [("best", 1, 1e-2, 1.0), ("best", 2, 1e-4, 100.0), ("slow", 1, 1e-4, 400.0), ("auto", 1, 1e-3, 30.0)]
    # half way in the logarithm of the error is half way in that of the time
    assert synthetic_report(rows).choice() == pytest.approx(3.0)
    # errors below rounding are equal
    equal = [("best", 1, 1e-16, 1.0), ("auto", 1, 1e-17, 2.0)]
    assert synthetic_report(equal).choice() == pytest.approx(2.0)


def test_an_error_that_a_larger_budget_loses_again_does_not_count():
    lucky = [("other", 1, 1e-2, 1.0), ("other", 2, 1e-5, 2.0), ("other", 3, 1e-3, 4.0), ("auto", 1, 1e-3, 3.0)]
    assert synthetic_report(lucky).choice() == pytest.approx(3.0 / 2.0)
    # nor does it for the method that chooses
    late = [("other", 1, 1e-2, 1.0), ("auto", 1, 1e-3, 3.0), ("auto", 2, 1e-2, 1.5)]
    assert synthetic_report(late).choice() == pytest.approx(3.0)


def test_a_method_is_measured_against_a_reference_that_it_did_not_make():
    first = spec.ReferenceValue(EXACT, 0.0, "closed form", made_by=("closed form",))
    second = spec.ReferenceValue(EXACT + 1e-3, 1e-3, "quadrature", made_by=("quadrature",))
    both = spec.WorkProblem("two", (first, second))
    methods = [spec.WorkMethod("closed form", lambda n: EXACT), spec.WorkMethod("quadrature", lambda n: EXACT + 1e-3)]
    report = spec.work_precision(both, methods, [1], repeats=1)
    assert [row.error for row in report.rows] == pytest.approx([1e-3, 1e-3])
    with pytest.raises(InputError, match="independent"):
        spec.WorkProblem("one", first).reference_for("closed form")


def test_failures_and_time_outs_are_rows():
    def fails(n):
        raise AccuracyError("too rough for this", 1.0)

    def sleeps(n):
        time.sleep(0.2)
        return EXACT

    methods = [spec.WorkMethod("fails", fails), spec.WorkMethod("sleeps", sleeps), DECLARED["trapezoid"]]
    report = spec.work_precision(problem(), methods, [1, 2], repeats=2, seconds=0.1)
    assert [row.status for row in report.rows] == ["failed", "failed", "done", "left out", "done", "done"]
    assert "too rough for this" in report.rows[0].note
    assert "too rough for this" in report.table() and "left out" in report.table()
    assert "fails" not in [row.method for row in report.front()]


ODD = {
    "complex": EXACT + 1e-3j, "nan": math.nan, "inf": math.inf, "none": None, "text": "0.3", "an object": object(),
    "two numbers": [EXACT, EXACT],
}  # fmt: skip


def test_a_value_that_is_no_number_is_a_row_with_the_reason_and_costs_no_other():
    def raises(n):
        raise KeyError(n)

    methods = [spec.WorkMethod(name, lambda n, value=value: value) for name, value in ODD.items()]
    methods = [*methods, spec.WorkMethod("raises", raises), spec.WorkMethod("no function", 3), DECLARED["trapezoid"]]
    report = spec.work_precision(problem(), methods, [1, 2], repeats=2)
    *odd, first, last = report.rows
    assert {row.status for row in odd} == {"failed"} and first.is_done and last.is_done
    assert all("expected " in row.note for row in odd[: 2 * len(ODD)])
    assert [row.note for row in odd[2 * len(ODD) :]][::2] == ["KeyError: 1", "TypeError: 'int' object is not callable"]
    assert spec.WorkReport.of_json(report.to_json()).rows == report.rows and "expected numbers" in report.table()


@pytest.mark.parametrize("norm", [lambda d: 1j, lambda d: math.nan, lambda d: -1.0, lambda d: "far", 5])
def test_a_norm_that_is_no_number_is_a_row_with_the_reason(norm):
    one = spec.WorkProblem("one third", spec.ReferenceValue(EXACT, 0.0, "by hand"), norm=norm)
    (row,) = spec.work_precision(one, [DECLARED["trapezoid"]], [2], repeats=1).rows
    assert row.status == "failed" and row.note


def test_the_root_mean_square_of_large_errors_does_not_overflow():
    one = spec.WorkProblem("one third", spec.ReferenceValue(EXACT, 0.0, "by hand"), norm=abs)
    (row,) = spec.work_precision(one, [spec.WorkMethod("far", lambda n: 1e200)], [2], repeats=2).rows
    assert row.error == pytest.approx(1e200)


def test_repeats_end_with_the_time():
    slow = spec.WorkMethod("slow", lambda n: time.sleep(0.05) or EXACT)
    row = measure(problem(), slow, 1, 1000, 0.2)
    assert row.is_done and 1 <= len(row.seconds) < 1000


def test_the_norm_of_a_matrix_is_frobenius_or_the_one_of_the_problem():
    reference, method = spec.ReferenceValue(np.zeros((2, 2)), 0.0, "by hand"), spec.WorkMethod("m", lambda n: matrix)
    matrix = np.array([[3.0, 0.0], [0.0, -4.0]])
    assert measure(spec.WorkProblem("matrix", reference), method, 1, 1, 10.0).error == 5.0
    largest = spec.WorkProblem("matrix", reference, norm=lambda difference: np.abs(difference).max())
    assert measure(largest, method, 1, 1, 10.0).error == 4.0
    shape = spec.WorkMethod("shape", lambda n: np.zeros(3))
    assert measure(problem(), shape, 1, 1, 1.0).note == "shape: expected a value of shape (), got (3,)"


def test_a_run_goes_on_where_its_file_ends(tmp_path):
    path = tmp_path / "work.json"
    first = spec.work_precision(problem(), [DECLARED["trapezoid"]], [8, 16], repeats=2, path=path)
    called = []

    def counted(n):
        called.append(n)
        return trapezoid(n)

    method = spec.WorkMethod("trapezoid", counted, order=2.0)
    second = spec.work_precision(problem(), [method], [8, 16, 32], repeats=2, path=path)
    assert set(called) == {32}
    assert second.rows[:2] == first.rows and len(second.rows) == 3
    assert spec.WorkReport.of_json(path.read_text()) == second


def test_a_file_of_another_problem_or_machine_is_refused(tmp_path):
    path = tmp_path / "work.json"
    spec.work_precision(problem(), [DECLARED["trapezoid"]], [8], repeats=1, path=path)
    other = spec.WorkProblem("another", spec.ReferenceValue(1.0, 0.0, "by hand"))
    with pytest.raises(InputError, match="another file"):
        spec.work_precision(other, [DECLARED["trapezoid"]], [8], repeats=1, path=path)
    data = json.loads(path.read_text())
    data["machine"]["hardware"] = "a slide rule"
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match="slide rule"):
        spec.work_precision(problem(), [DECLARED["trapezoid"]], [8], repeats=1, path=path)
    path.write_text("{}")
    with pytest.raises(InputError, match="to_json"):
        spec.work_precision(problem(), [DECLARED["trapezoid"]], [8], repeats=1, path=path)


def test_the_machine_and_its_software_are_named():
    machine = Machine.here()
    assert machine.hardware.endswith(" cores") and f"numpy {np.__version__}" in machine.software
    assert str(machine) == f"{machine.hardware}; {machine.software}" and machine.software.startswith("1 thread")


def test_the_picture_shows_every_method_and_the_chosen_one_in_black():
    rows = [("best", 1, 1e-2, 1.0), ("best", 2, 1e-4, 100.0), ("auto", 1, 1e-3, 30.0)]
    ax = synthetic_report(rows).plot()
    labels = [text.get_text() for text in ax.get_legend().get_texts()]
    assert labels == ["best", "auto", "reference known to"]
    assert ax.get_xscale() == ax.get_yscale() == "log"
    assert [line.get_color() for line in ax.lines if line.get_label() == "auto"] == ["black"]


def test_a_kernel_matrix_brings_its_reported_error():
    from asperity import kernels as ker

    law = ker.henyey_greenstein(0.5)
    reference = spec.ReferenceValue(np.diag(0.5 ** np.arange(4.0)), 0.0, "eigenvalues g^l")
    # by quadrature, since "auto" knows the eigenvalues
    basis = ker.Legendre(4)
    matrix = spec.WorkMethod("rules", lambda n: ker.discretise(law, basis, method="quadrature", tolerance=1.0 / n))
    row = measure(spec.WorkProblem("law", reference), matrix, 1e8, 1, 60.0)
    assert row.error <= row.reported <= 1e-7
    assert row.note == "quadrature"


def test_errors_reported_by_a_random_method_are_a_root_mean_square_as_its_errors_are():
    reports = iter([3.0, 4.0, 0.0])
    method = spec.WorkMethod("any", lambda n, rng: Estimate(EXACT, next(reports), "estimate", "any"), is_random=True)
    assert measure(problem(), method, 1, 3, 60.0).reported == pytest.approx((25.0 / 3.0) ** 0.5)
    silent = spec.WorkMethod("silent", lambda n, rng: EXACT, is_random=True)
    assert measure(problem(), silent, 1, 3, 60.0).reported is None


def test_equal_errors_have_the_order_0_without_an_interval_even_if_they_are_tiny():
    found = spec.fit_order([1.0, 2.0, 4.0], [5e-324] * 3)
    assert found.order == found.low == found.high == 0.0
