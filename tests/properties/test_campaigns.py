"""Every campaign in small: the numbers that it names, in this process, must not refute the library."""

import dataclasses
import subprocess
import time
from collections.abc import Generator
from multiprocessing import connection

import pytest
from campaigns import engine
from campaigns.engine import Campaign, Judged, campaigns, faults, refuted, rows


@pytest.mark.parametrize("campaign", campaigns().values(), ids=list(campaigns()))
def test_no_campaign_refutes_the_library_in_small(campaign):
    found = [(number, campaign.judged(number)) for number in campaign.small]
    judgements = [each for _, case in found for each in case]
    assert judgements
    assert refuted(campaign, judgements) == [], [line for number, case in found for line in faults(number, case)]


def drawn(number):
    return number


def judge(number):
    if number == 3:
        raise SystemExit(3)
    yield Judged("errors", claimed=1.0, true=2.0 if number == 1 else 0.5)


CAMPAIGN = Campaign("by hand", "?", drawn, judge, 4, range(3))


def test_a_judgement_holds_fails_or_is_open():
    assert Judged("a", 1.0, 1.0).verdict == Judged("a", 1.0, 0.7, 0.3).verdict == "holds"
    assert Judged("a", 1.0, 0.9, 0.3).verdict == Judged("a", 1.0, 1.2, 0.3).verdict == "open"
    assert Judged("a", 1.0, 1.4, 0.3).verdict == Judged("a", 1.0, float("nan")).verdict == "fails"
    assert Judged("a", fault="hangs").verdict == "fails"


def test_a_bound_is_refuted_by_one_case_and_a_half_width_beyond_chance():
    found = CAMPAIGN.judged(0) * 19 + CAMPAIGN.judged(1)
    assert refuted(CAMPAIGN, found) == ["errors"]
    half_width = dataclasses.replace(CAMPAIGN, level=0.95)
    assert refuted(half_width, found) == [] and refuted(half_width, found + CAMPAIGN.judged(1) * 9) == ["errors"]
    ((kind, cases, failing, unknown, held, *_),) = rows(found)
    assert (kind, cases, failing, unknown) == ("errors", 20, 1, 0) and held.startswith("0.950 (")


def throw(run):
    with pytest.raises(KeyError):
        run.throw(KeyError())


@pytest.mark.parametrize("leave", [list, Generator.close, throw])
def test_the_processes_of_a_run_end_with_it(leave, monkeypatch):
    processes, begun = [], time.monotonic()
    started = subprocess.Popen.__init__
    monkeypatch.setattr(
        subprocess.Popen, "__init__", lambda self, *a, **k: (processes.append(self), started(self, *a, **k))[1]
    )
    # without connections it only waits, as many seconds as the number of the case
    monkeypatch.setattr(engine, "judged", connection.wait)
    run = dataclasses.replace(CAMPAIGN, name=()).run([0, 0, 0] if leave is list else [0, 100, 0, 100], 2)
    next(run)
    leave(run)
    # a third one, if a case began as the run was left
    assert len(processes) in (2, 3) and all(process.poll() is not None for process in processes)
    assert time.monotonic() - begun < 60.0


def test_a_run_goes_on_from_its_record_and_a_case_without_end_fails_alone(tmp_path, monkeypatch):
    known = campaigns()["known-distances"]
    record = tmp_path / "record.jsonl"
    first = list(known.run(range(1), 1, record))
    assert [each.verdict for each in first[0][1]] == ["holds", "holds"]
    text = record.read_text()
    assert list(known.run(range(1), 1, record)) == first and record.read_text() == text
    ((_, late),) = dataclasses.replace(known, seconds=1e-3).run([1], 1)
    assert late[0].verdict == "fails" and "within 0.001 s" in late[0].fault
