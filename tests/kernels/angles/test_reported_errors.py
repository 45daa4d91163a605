"""Reported errors of adaptive angles and matrices, against the references of campaigns/judges/reference_rows.py."""

from __future__ import annotations

import numpy as np
import pytest
from campaigns.cases.random_curved_walls import COUNT
from campaigns.errors import adaptive
from campaigns.judges.reference_rows import references

# On these two walls a conditional distribution has thousands of pieces; the campaign takes them.
CHAOTIC = (6, 13)


def test_the_references_are_those_of_all_walls() -> None:
    assert [entry["kind"] for entry in references()] == list(range(COUNT))


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_errors_of_expectations_hold_and_are_not_vacuous(tolerance: float) -> None:
    found = [
        each
        for entry in references()
        if entry["kind"] not in CHAOTIC
        for each in adaptive.expectations(entry, tolerance)
    ]
    # one in a hundred may exceed what was reported
    assert sum(each.verdict == "fails" for each in found) <= len(found) // 100
    assert np.median([each.ratio for each in found if each.ratio is not None]) < 100.0


@pytest.mark.parametrize("kind", [0, 3, 9, 11])
def test_errors_of_first_moments_hold(kind: int) -> None:
    found = [adaptive.first_moment(references()[kind], tolerance, 4_000_000) for tolerance in (1e-3, 1e-5)]
    assert all(each.verdict == "holds" for each in found) and found[1].claimed < 1e-4
