"""Other programs: what one that is not there, fails or hangs says in its row, and the rows."""

import sys

import numpy as np
import pytest
from campaigns.speed import peers


def environment(folder):
    """An environment whose Python is this one, without any peer."""
    python = folder / "environment" / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    return folder


def test_a_peer_that_is_not_there_or_hangs_says_so(tmp_path, monkeypatch):
    assert "No such file" in peers.answer_of("deeptime", tmp_path, matrix=np.eye(2), wanted=2)
    refusal = peers.answer_of("no_such_peer", environment(tmp_path), matrix=np.eye(2), wanted=2)
    assert refusal == "fails: KeyError: 'no_such_peer'"
    monkeypatch.setattr(peers, "SECONDS", 0.01)
    assert "timed out" in peers.answer_of("deeptime", tmp_path, matrix=np.eye(2), wanted=2)


def test_a_peer_answers_by_json(tmp_path, monkeypatch):
    worker = tmp_path / "worker.py"
    worker.write_text("print('loading')\nprint('{\"gaps\": [0.5]}')\n")
    monkeypatch.setattr(peers, "WORKER", worker)
    assert peers.answer_of("deeptime", environment(tmp_path), matrix=np.eye(2), wanted=2) == {"gaps": [0.5]}


def test_every_solver_has_a_row_for_every_gap(tmp_path, monkeypatch):
    monkeypatch.setattr(peers, "answer_of", lambda *_, **__: "not here")
    monkeypatch.setattr(peers, "MAXWELL_GAPS", (0.5,))
    rows = list(peers.solve_with_all(tmp_path))
    assert [row[3] for row in rows] == [0, "-"]
    assert [row[-1] for row in rows if row[3] == "-"] == ["not here"]


def test_a_gap_that_is_missing_or_no_number_is_wrong():
    right = np.array([0.0, 1e-9, 1e-3])
    for gaps, wrong in (([0.0, 1e-9, 1e-3], 0), ([0.0, 1e-9], 1), ([0.0, np.nan, 1e-3], 2), ([0.0, 0.0, 1e-3], 1)):
        assert peers._row("a chain", "a solver", right, np.array(gaps), 1.0, "-")[3] == wrong


def test_every_tracer_has_a_row_for_every_polygon_and_the_picture_is_drawn(tmp_path, monkeypatch):
    answers = {"embree": {"version": "1", "rate": 1e6, "wrong": 0.1, "lost": 0.2, "error": 1e-6}, "mitsuba": "fails"}
    monkeypatch.setattr(peers, "answer_of", lambda peer, *_, **__: answers[peer])
    monkeypatch.setattr(peers, "SIDES", (10,))
    monkeypatch.setattr(peers, "RAYS", 2**8)
    measured = []
    rows = list(peers.trace_with_all(tmp_path, measured))
    assert [row[0] for row in rows] == [2, 2, 2, 10, 10, 10] and [row[3] for row in rows][2::3] == ["fails"] * 2
    assert [(sides, tracer) for sides, tracer, *_ in measured][1::2] == [(2, "embree"), (10, "embree")]
    assert measured[1][2:] == pytest.approx((1e6, 0.3))
    peers.draw_speeds(measured, tmp_path / peers.PICTURE)
    assert (tmp_path / peers.PICTURE).stat().st_size > 0
