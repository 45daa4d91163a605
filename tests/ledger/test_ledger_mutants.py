"""The ledger's checks refuse wrong formulas: a sample of the mutants of `python -m campaigns.ledger_mutants`."""

from functools import cache

import numpy as np
import pytest
from campaigns import ledger_mutants
from campaigns.cases.equivalent_mutants import EQUIVALENT, EQUIVALENT_IN_THE_LIBRARY
from campaigns.ledger_mutants import changes, in_place, judged, library, noticed

from asperity.geometry.disk import disk, rolling
from asperity.ledger import entry as ledger
from asperity.ledger import row
from asperity.verification import agreement

ROWS = {entry.id: entry for entry in ledger.entries() if entry.check is not None}
mutants_of = cache(ledger_mutants.mutants_of)


@pytest.mark.slow
@pytest.mark.parametrize("entry", ROWS.values(), ids=ROWS)
def test_a_check_refuses_a_wrong_formula(entry):
    mutants = [mutant for mutant in mutants_of(entry).items() if (entry.id, mutant[0]) not in EQUIVALENT]
    for label, formula in mutants[len(mutants) // 2 :][:1]:
        assert judged(entry, formula) in ("refuted", "undecided", "raised"), label


# Each was accepted by the check of its row as it stood before the mutants were tried.
ONCE_ACCEPTED = {
    "S1.09": lambda right: lambda theta: right(theta) + 1e-3,
    "S1.13": lambda right: lambda spacing: 1 - 3 * spacing**2,
    "S1.23": lambda right: lambda psi, xp: xp.pi + psi,
    "S2.01": lambda right: lambda ratio, theta: right(ratio, theta) + 1e-3,
    "S2.08": lambda right: lambda psi, theta: right(psi + 1e-3, theta),
    "S2.22": lambda right: lambda centre, root, factor: factor * (centre + root),
    "S2.26": lambda right: lambda preserves, twice: False,
    "S4.03": lambda right: lambda rho: rho**2 / 5,
    "S4.09": lambda right: lambda rho, xp: -2 * xp.sin(rho / 2),
    "S4.10": lambda right: lambda *arguments: [-part for part in right(*arguments)],
    "S4.11": lambda right: lambda *arguments: [-part for part in right(*arguments)],
    "S4.15": lambda right: lambda rho, m: 2 * right(rho, m),
    "S5.02": lambda right: lambda J, xp: (0, 1, 1 / xp.sqrt(J)),
    "S5.34": lambda right: lambda rho, eps, L: 10 * right(rho, eps, L),
    "S5.39": lambda right: lambda a, b, eps, rho: (2 * a + 2) * (2 * b + 1) / (eps * rho),
}


@pytest.mark.parametrize("row", ONCE_ACCEPTED)
def test_a_wrong_formula_that_was_once_accepted_is_refuted(row):
    wrong = ONCE_ACCEPTED[row](ROWS[row].right)
    assert judged(ROWS[row], wrong) == "refuted"


def test_outgoing_angles_are_neither_moved_nor_mirrored():
    law = ROWS["S2.08"].right
    for turn in (lambda angle: angle + 1e-3, lambda angle: np.pi - angle):

        def wrong(psi, theta, turn=turn):
            return law(psi, theta)[0], turn(law(psi, theta)[1])

        assert judged(ROWS["S2.08"], wrong) == "refuted"


@pytest.mark.parametrize("row", sorted({row for row, _ in EQUIVALENT}))
def test_what_is_listed_as_equivalent_is_accepted(row):
    mutants = mutants_of(ROWS[row])
    for label in (label for other, label in EQUIVALENT if other == row):
        assert judged(ROWS[row], mutants[label]) == "accepted", label


def test_a_function_is_changed_in_one_place_at_a_time():
    assert set(changes(disk.foreshortening)) == {
        "disk.foreshortening: return 2 / xp.sqrt(1 + mass / inertia)",
        "disk.foreshortening: return -1 / xp.sqrt(1 + mass / inertia)",
        "disk.foreshortening: return 1 * xp.sqrt(1 + mass / inertia)",
        "disk.foreshortening: return 1 / xp.sqrt(2 + mass / inertia)",
        "disk.foreshortening: return 1 / xp.sqrt(-1 + mass / inertia)",
        "disk.foreshortening: return 1 / xp.sqrt(1 - mass / inertia)",
        "disk.foreshortening: return 1 / xp.sqrt(1 + mass * inertia)",
    }


def test_a_change_is_undone():
    code = next(iter(changes(disk.foreshortening).values()))
    with in_place(disk.foreshortening, code):
        assert disk.foreshortening(3.0, 1.0) == 1.0
    assert disk.foreshortening(3.0, 1.0) == 0.5


def test_a_check_that_looks_at_nothing_accepts_what_is_wrong():
    @row(id="S9.01", section="0", kind="numeric", printed="2x", right=lambda x: 2 * x, wrong=lambda x: x)
    def entry(formula):
        return agreement(formula(0.0), 0.0, 1e-12)

    answers = {label: judged(entry, mutant) for label, mutant in mutants_of(entry).items()}
    assert answers["formula: 3 * x"] == "accepted" and answers["result moved"] == "refuted"
    assert judged(entry, lambda x: float("nan")) == "undecided"


@pytest.mark.parametrize(("function", "rows"), [(disk.branch_block, ["S1.23"]), (rolling.slip, ["S4.15"])])
def test_the_rows_see_the_librarys_formulas(function, rows):
    seen = library([ROWS[row] for row in rows])[function]
    assert [entry.id for entry in seen] == rows
    for label, code in list(changes(function).items())[::5]:
        assert label in EQUIVALENT_IN_THE_LIBRARY or noticed(function, code, seen) == rows[0], label
