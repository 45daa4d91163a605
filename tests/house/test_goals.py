"""The table of goals and what it rests on: limits, errors in a time, memory."""

import numpy as np
import pytest
from campaigns.speed import goals, throughput

from asperity import spectral as spec


def test_every_goal_can_be_measured_by_its_name():
    names = {kind: {goal.name for goal in goals.all_goals() if goal.kind == kind} for kind in goals.MEASURES}
    assert sum(map(len, names.values())) == len(goals.all_goals()) > 60
    kinds = ("first moment", "gap", "law in Bins(64) by quadrature", "resistance", "polygon as an exact law")
    walls = set.union(names["bounces"], *(names[kind] for kind in kinds))
    assert names["bounces"] == names["two threads against one"] and walls >= set(throughput.WALLS)
    assert all(throughput.wall_named(name).pieces for name in walls - set(throughput.WALLS))
    assert names["matrix of triangular teeth"] == set(goals.MATRICES) and names["distance of arc and teeth"]
    assert names["run of hits in one step"] == set(goals.RUNS)
    assert {name.partition(", ")[0] for name in names["start"]} >= set(goals.PROGRAMS)


def test_a_goal_is_met_if_all_numbers_are_within_their_limits():
    most = goals.Goal("error in a time", "a law", "{:.0e} in {:g} s", (1e-4, 5.0), False)
    assert most.row((1e-5, 4.0)) == ("error in a time: a law", "1e-04 in 5 s", "1e-05 in 4 s", "yes")
    assert [most.is_met(reached) for reached in ((1e-3, 4.0), (1e-5, 6.0), (np.nan, 4.0))] == [False] * 3
    least = goals.Goal("bounces", "a wall", "{:g}", (50.0,), True)
    assert [least.is_met((reached,)) for reached in (51.0, 49.0, np.nan)] == [True, False, False]


@pytest.mark.parametrize(("off", "is_infinite"), [(0.0, False), (1e-3, True)])
def test_a_reported_error_that_does_not_hold_reaches_no_goal(off, is_infinite, monkeypatch):
    known = goals.known_reference("focusing-arc/lambda2")
    moved = spec.ReferenceValue(known.value + off, known.error, "moved")
    monkeypatch.setattr(goals, "known_reference", lambda name: moved)
    assert np.isinf(goals.gap_error("focusing-arc", 1e-4)) == is_infinite


def test_the_table_says_what_is_missed_and_the_exit_code_too(monkeypatch, capsys):
    monkeypatch.setitem(goals.MEASURES, "run of hits in one step", lambda name, limits: (2.0 * (name == "arc"),))
    assert goals.main(["channel", "wedge"]) == 0
    assert goals.main(["run of *"]) == 1
    table = capsys.readouterr().out
    assert "| run of hits in one step: arc | 1.00 us a ray | 2.00 us a ray | **no** |" in table
    assert "1 of 3 goals are missed" in table and goals.main(["no such goal"]) == 1


def test_the_memory_of_an_estimate_does_not_grow_with_its_rays():
    # several chunks of 65,536 rays each
    assert goals.growth_of_memory(2**20, 2**21) <= 0.02
