"""The judge of the campaign of users' objects: its quadrature against closed forms, and what it refutes."""

import dataclasses

import numpy as np
import pytest
from campaigns.cases.written_laws import Drawn
from campaigns.errors import users_objects
from campaigns.errors.users_objects import Answer, Case, judge
from campaigns.judges.plain_quadrature import Known, Truth, averaged


def linear(theta, out):
    # cos(theta') has the density (1 + .6 u u')/2
    return 0.5 * np.sin(out) * (1.0 + 0.6 * np.cos(theta) * np.cos(out))


def test_the_judges_quadrature_has_closed_forms_within_its_error():
    truth = Truth(linear, ((lambda x: 0.0 * x, lambda x: np.pi - x),))
    theta = np.array([0.5, 2.0])
    for function, breaks, exact in (
        (np.cos, (), 0.2 * np.cos(theta)),
        (lambda x: (x < 1.0) * 1.0, (1.0,), 0.5 * (1.0 - np.cos(1.0)) + 0.15 * np.cos(theta) * np.sin(1.0) ** 2),
    ):
        found = truth.mean(function, theta, breaks)
        assert np.linalg.norm(found.value - exact) <= found.error < 1e-11
    drag = truth.resistance()
    assert abs(drag.value - 0.75 * (1.0 + 0.2 / 3.0 + np.pi**2 / 16.0)) <= drag.error < 1e-11
    # W_1 between the conditional distributions is .6 |cos(theta)| pi/8
    far = dataclasses.replace(truth, maps=(), breaks=(0.5 * np.pi,)).distance_from_lambertian()
    assert abs(far.value - 0.6 * np.pi / 16.0) <= far.error < 1e-4
    assert averaged(lambda x: np.sqrt(np.abs(np.cos(x))), (0.5 * np.pi,)) == pytest.approx(2.0 / 3.0, abs=1e-9)


def judged(monkeypatch, tool, *, good, **drawn):
    monkeypatch.setitem(users_objects.TOOLS, "tried", tool)
    return list(judge(Case(0, Drawn("by hand", object, ("tried",), **drawn), good)))


def raising(reason):
    def tool(*_):
        raise reason

    return tool


@pytest.mark.parametrize(
    ("tool", "good", "verdict", "outcome"),
    [
        (lambda *_: Answer(1.0, 0.1, Known(1.05, 0.0)), True, "holds", "number"),
        (lambda *_: Answer(1.0, 0.1, Known(1.2, 0.01)), True, "fails", "number"),
        (lambda *_: Answer(np.nan, 0.1, Known(1.2, 0.01)), True, "fails", "number"),
        (lambda *_: Answer(1.0, 0.9, Known(1.05, 0.0)), True, "holds", "useless"),
        (raising(TypeError("expected a function")), True, "holds", "useless"),
        (raising(KeyError("inside")), True, "fails", ""),
        (lambda *_: Answer(1.0, 0.1, Known(0.0, 0.0)), False, "fails", ""),
        (raising(TypeError("expected a function")), False, "holds", "refused"),
        (raising(KeyError("inside")), False, "fails", ""),
    ],
)
def test_the_judge_refutes_misses_raw_errors_and_broken_objects_that_are_taken(
    monkeypatch, tool, good, verdict, outcome
):
    (found,) = judged(monkeypatch, tool, good=good)
    assert (found.verdict, found.outcome) == (verdict, outcome)


def test_a_third_of_the_objects_is_broken_and_a_number_draws_the_same_one_again():
    cases = [users_objects.draw(number) for number in range(300)]
    assert sum(not case.good for case in cases) == 100
    assert [case.drawn.kind for case in cases] == [users_objects.draw(case.number).drawn.kind for case in cases]
    assert {name for case in cases for name in case.drawn.tools} <= set(users_objects.TOOLS)
    assert len({case.drawn.kind for case in cases}) > 50
