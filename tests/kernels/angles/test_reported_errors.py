"""Reported errors of adaptive angles and matrices, against the references of campaigns/judges/reference_rows.py."""

from __future__ import annotations

import numpy as np
import pytest
from campaigns.errors import outcomes, references
from campaigns.judges.random_curved_walls import COUNT

# On these two walls a row has thousands of pieces; the benchmark takes them.
CHAOTIC = (6, 13)
OTHERS = [kind for kind in range(COUNT) if kind not in CHAOTIC]


def test_the_references_are_those_of_all_walls() -> None:
    assert [entry["kind"] for entry in references()] == list(range(COUNT))


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_errors_of_rows_hold_and_are_not_vacuous(tolerance: float) -> None:
    found = list(outcomes(OTHERS, [tolerance], most_segments=0, moments=False))
    # one in a hundred may exceed what was reported
    assert sum(outcome.exceeds for outcome in found) <= len(found) // 100
    assert np.median([outcome.ratio for outcome in found if outcome.ratio is not None]) < 100.0


@pytest.mark.parametrize("kind", [0, 3, 9, 11])
def test_errors_of_first_moments_hold(kind: int) -> None:
    found = [outcome for outcome in outcomes([kind], [1e-3, 1e-5], most_segments=4_000_000) if outcome.what == "moment"]
    assert not any(outcome.exceeds or outcome.is_open for outcome in found)
    assert found[1].reported < 1e-4
