"""The ledger: every check accepts the right formula and refutes the wrong one."""

import pytest

from asperity import ledger

MACHINE = [entry for entry in ledger.entries() if entry.kind != "by reading"]


@pytest.mark.parametrize("entry", MACHINE, ids=lambda entry: entry.id)
def test_the_check_accepts_the_right_formula_and_refutes_the_wrong_one(entry):
    found = entry.run()
    assert found.as_stated, f"right: {found.right}\nwrong: {found.wrong}"
