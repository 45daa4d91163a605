"""The table of goals and what it rests on: errors in a time, memory."""

from __future__ import annotations

from campaigns import bounces, goals, memory, wall_goals

from asperity.estimates import Estimate


def test_the_memory_of_an_estimate_does_not_grow_with_its_rays():
    # several chunks of 65,536 rays each
    used = memory.measure_memory((2**20, 2**21))
    assert not used.grows and min(used.peaks) > used.matrix
    assert memory.MemoryUse((1, 2, 4), (100, 100, 103), 1).grows
    assert not memory.MemoryUse((1, 2, 4), (100, 101, 90), 1).grows


def test_a_goal_of_error_and_time_needs_both_and_an_error_that_holds():
    for found, reported, limit, is_met in ((1.25, 0.3, 9.0, True), (1.25, 0.1, 9.0, False), (1.25, 0.3, 0.0, False)):
        answer = Estimate(found, reported, "bound", "by hand")
        goal = goals._in_time("a number", 1.0, lambda answer=answer: answer, 0.5, limit, holds=True)
        assert goal.is_met == is_met and f"reported {reported:.1e}" in goal.reached
    assert not goals._in_time("a number", 1.0, lambda: 1.75, 0.5, 9.0).is_met


def test_a_goal_of_a_tolerance_needs_the_error_and_the_seconds():
    for error, seconds, is_met in ((1e-5, 4.0, True), (1e-3, 4.0, False), (1e-5, 6.0, False)):
        goal = wall_goals.in_time("a law", 1e-4, 5.0, error, seconds)
        assert goal.is_met == is_met and goal.goal == "1e-04 in 5 s"


def test_every_wall_whose_bounces_are_counted_has_a_goal():
    assert set(goals.BOUNCE_GOALS) == set(bounces.WALLS)
