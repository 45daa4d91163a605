"""The ledger: every check accepts the right formula and refutes the wrong one; the table, its JSON and its page."""

import json
import re
from collections import Counter
from dataclasses import replace

import pytest
from campaigns.cases.equivalent_mutants import EQUIVALENT

from asperity import InputError
from asperity.ledger import by_reading, row
from asperity.ledger import entry as ledger
from asperity.ledger.entry import latex_of, page_of, table_of
from asperity.verification import Verdict, agreement
from commands import run

ROWS = ledger.entries()
MACHINE = [entry for entry in ROWS if entry.kind != "by reading"]
SENTENCE = re.compile(r"[.!?](?=\s|$)")
# abbreviations end with a full stop and no sentence
ABBREVIATIONS = re.compile(r"\b(?:eqs?|Eqs?|Prop|resp)\.")


@pytest.mark.parametrize("entry", MACHINE, ids=lambda entry: entry.id)
def test_the_check_accepts_the_right_formula_and_refutes_the_wrong_one(entry):
    found = entry.run()
    assert found.as_stated, f"right: {found.right}\nwrong: {found.wrong}"


@pytest.mark.parametrize("entry", MACHINE, ids=lambda entry: entry.id)
def test_a_user_can_negate_a_formula_and_the_check_refutes_it_or_says_why_not(entry):
    if entry.id in ("S1.01", "S2.28"):
        # an angle below 0, and a wall
        with pytest.raises(InputError, match=r"expected angles|write the wrong code"):
            entry.check(entry.negated)
        return
    expected = "agrees" if (entry.id, "result negated") in EQUIVALENT else "refuted"
    assert entry.check(entry.negated).answer == expected


def test_every_row_of_the_audit_is_there():
    lengths = {"S1": 28, "S2": 29, "S3": 8, "S4": 23, "S5": 41, "S6": 8}
    assert [entry.id for entry in ROWS] == [f"{s}.{n:02d}" for s, count in lengths.items() for n in range(1, count + 1)]
    assert Counter(entry.status for entry in ROWS) == {"verified": 51, "erratum": 70, "convention": 16}


def test_every_row_says_why_in_two_sentences():
    for entry in ROWS:
        words = ABBREVIATIONS.sub("", entry.reason)
        assert len(SENTENCE.findall(words)) == 2, f"{entry.id}: {entry.reason}"
        assert entry.reason.endswith((".", "?")) and entry.statement.endswith("."), entry.id


def test_the_formulas_are_balanced_latex():
    for entry in ROWS:
        for formula in (entry.printed, entry.corrected):
            if formula is not None:
                latex = formula.replace(r"\{", "").replace(r"\}", "")
                assert latex.strip() and latex.count("{") == latex.count("}"), entry.id
                assert latex.count(r"\left") - latex.count(r"\leftarrow") == latex.count(r"\right") - latex.count(
                    r"\rightarrow"
                ), entry.id
                assert re.findall(r"\\begin\{(\w+)\}", latex) == re.findall(r"\\end\{(\w+)\}", latex), entry.id
                assert not re.search(r"\\quad[a-zA-Z]", latex), entry.id
                assert latex.isascii(), f"{entry.id}: {latex}"


def test_ids_select_rows_by_their_beginning():
    assert [entry.id for entry in ledger.selected(["S2.01"])] == ["S2.01"]
    assert {entry.id[:4] for entry in ledger.selected(["S2.1", "S3"])} == {"S2.1", "S3.0"}
    assert ledger.selected([]) == ROWS
    with pytest.raises(InputError, match="S7: no such entry"):
        ledger.selected(["S7"])


def test_the_table_on_the_command_line():
    result = run("verify", "S2.16", "S1.04")
    assert result.exit_code == 0, result.output
    first, second, total = result.stdout.splitlines()
    assert first.startswith("S1.04  erratum     by reading  not checked")
    assert second.startswith("S2.16  verified    symbolic    as stated")
    assert "2 rows: 1 verified, 1 errata, 0 conventions. 1 checked by machine" in total


def test_json_is_a_list_of_rows():
    result = run("verify", "S2.02", "S2.17", "--json")
    assert result.exit_code == 0, result.output
    first, second = json.loads(result.stdout)
    assert first["id"] == "S2.02" and first["right"]["answer"] == "agrees" and first["wrong"]["answer"] == "refuted"
    assert first["as_stated"] is True and first["wrong"]["counterexample"]
    assert second["id"] == "S2.17" and second["right"] is None and second["as_stated"] is None


def test_latex_runs_no_check(monkeypatch):
    monkeypatch.setattr("asperity.ledger.findings", lambda _: pytest.fail("a check ran"))
    result = run("verify", "--latex")
    assert result.exit_code == 0 and result.stdout.count(r"\paragraph{S") == len(ROWS)
    assert result.stdout.strip() == latex_of(ROWS).strip()


def test_an_unknown_id_is_refused_in_one_line():
    result = run("verify", "S99")
    assert result.exit_code == 1 and result.stderr == "asperity: S99: no such entry; ids run from S1.01 to S6.08\n"


def double(printed, corrected):
    """An entry on 2 x, with formulas that may or may not be what it says."""

    @row(id="S9.01", section="0", kind="numeric", printed="x", wrong=printed, corrected="2x", right=corrected)
    def entry(formula):
        """Twice
        x.

        One.
        Two.
        """
        return agreement(formula(3.0), 6.0, 1e-12)

    return entry


@pytest.mark.parametrize(
    ("entry", "as_stated"),
    [
        (double(lambda x: x, lambda x: 2 * x), True),
        # an erratum whose printed formula is right after all
        (double(lambda x: x + x, lambda x: 2 * x), False),
        # a correction that is wrong
        (double(lambda x: x, lambda x: 3 * x), False),
        # a check that cannot decide
        (double(lambda x: float("nan"), lambda x: 2 * x), False),
        # numbers do not prove
        (replace(double(lambda x: x, lambda x: 2 * x), kind="symbolic"), False),
    ],
)
def test_a_row_is_as_stated_only_if_both_verdicts_are(entry, as_stated, monkeypatch):
    assert entry.run().as_stated is as_stated
    monkeypatch.setattr("asperity.ledger.entry.entries", lambda: (entry,))
    result = run("verify")
    assert result.exit_code == (0 if as_stated else 1)
    assert ("NOT AS STATED" in result.stdout) is not as_stated
    assert ("wrong formula:" in result.stdout) is not as_stated


def test_a_row_by_reading_is_not_counted_as_checked():
    entry = by_reading(id="S9.02", section="0", statement="A.", printed="a", corrected="b", reason="One. Two.")
    assert entry.run().as_stated is None
    assert "0 checked by machine (0 by proof, 0 by numbers), 1 by reading; 0" not in table_of([entry.run()])
    assert "1 by reading. 0 not as stated." in table_of([entry.run()])


def test_unsuitable_entries_are_refused_in_words():
    def check(_):
        return Verdict("agrees", "")

    with pytest.raises(InputError, match="two digits"):
        row(id="S9.3", section="", printed="x", right=abs, wrong=abs)(check)
    with pytest.raises(InputError, match="as code"):
        row(id="S9.04", section="", printed="x", corrected="2x", right=abs)(check)
    with pytest.raises(InputError, match="corrected formula"):
        row(id="S9.05", status="convention", section="", printed="x", right=abs, wrong=abs)(check)


def test_the_words_of_a_row_are_those_of_its_check():
    entry = double(abs, abs)
    assert (entry.status, entry.statement, entry.reason) == ("erratum", "Twice x.", "One. Two.")


def test_the_page_has_every_row_and_the_errata_first():
    page = page_of(ROWS)
    assert page.index("## Errata") < page.index("## Conventions") < page.index("## Verified")
    assert sorted(re.findall(r"^\*\*(S\d\.\d\d)\*\*", page, flags=re.MULTILINE)) == sorted(e.id for e in ROWS)
    assert page.count("$$") == 2 * sum(1 + (entry.corrected is not None) for entry in ROWS)
