"""The peers' environment: made from scratch, and where a peer cannot be had, a row that says so."""

import numpy as np
import pytest
from campaigns.speed import peers


@pytest.fixture
def data(tmp_path):
    file = tmp_path / "chain.npz"
    np.savez(file, matrix=np.eye(2), gap=0.5)
    return file


def commands(monkeypatch, **codes):
    """Replace processes by what they would say; returns the commands that were asked for."""
    asked = []

    def run(command, **options):
        asked.append(command)
        word = next(word for word in ("venv", "--version", "install", "peer_worker") if word in " ".join(command))
        code, out, err = codes.get(word.strip("-"), (0, '{"gap": 0.5}\n', ""))
        return peers.subprocess.CompletedProcess(command, code, out, err)

    monkeypatch.setattr(peers.subprocess, "run", run)
    return asked


@pytest.mark.parametrize(
    ("codes", "found", "steps"),
    [
        ({}, {"gap": 0.5}, "venv install ask ask"),
        ({"install": (1, "", "WARNING: retrying\nERROR: No matching | distribution\n")},
         "cannot be installed: ERROR: No matching / distribution", "venv install"),
        ({"peer_worker": (1, "", "IndexError: index -1\n")}, "fails: IndexError: index -1", "venv install ask ask"),
        ({"venv": (1, "ensurepip is not available\n", "")}, "no environment: ensurepip is not available", "venv"),
    ],
)  # fmt: skip
def test_the_environment_is_made_and_filled_once_and_what_fails_is_the_row(
    codes, found, steps, tmp_path, data, monkeypatch
):
    asked = commands(monkeypatch, **codes)
    environment = peers.PeerEnvironment(tmp_path / "environment")
    assert [environment.run("deeptime", "deeptime", data) for _ in range(2)] == [found] * 2
    taken = [next((word for word in ("venv", "install") if word in command), "ask") for command in asked]
    assert " ".join(taken) == steps


def test_the_limits_hold(tmp_path, data, monkeypatch):
    monkeypatch.setattr(peers, "MAKE_SECONDS", 0.01)
    assert "ended after 0 s" in peers.PeerEnvironment(tmp_path / "a").run("deeptime", "deeptime", data)
    monkeypatch.setattr(peers, "ALL_SECONDS", 0.0)
    assert "time was up" in peers.PeerEnvironment(tmp_path / "b").run("deeptime", "deeptime", data)


def test_every_solver_has_a_row_for_every_gap(tmp_path, monkeypatch):
    monkeypatch.setattr(peers.PeerEnvironment, "run", lambda *_: "not here")
    monkeypatch.setattr(peers, "MAXWELL_GAPS", (0.5,))
    rows = list(peers.solve_with_all(tmp_path, peers.PeerEnvironment(tmp_path / "environment")))
    assert [row[3] for row in rows] == [0, "-", "-"]
    assert [row[-1] for row in rows if row[3] == "-"] == ["not here"] * 2


def test_a_gap_that_is_missing_or_no_number_is_wrong():
    right = np.array([0.0, 1e-9, 1e-3])
    for gaps, wrong in (([0.0, 1e-9, 1e-3], 0), ([0.0, 1e-9], 1), ([0.0, np.nan, 1e-3], 2), ([0.0, 0.0, 1e-3], 1)):
        assert peers._row("a chain", "a solver", right, np.array(gaps), 1.0, "-")[3] == wrong


def test_every_tracer_has_a_row_for_every_polygon_and_the_picture_is_drawn(tmp_path, monkeypatch):
    answers = {"embree": {"version": "1", "rate": 1e6, "wrong": 0.1, "lost": 0.2, "error": 1e-6}, "mitsuba": "fails"}
    monkeypatch.setattr(peers.PeerEnvironment, "run", lambda self, peer, *_: answers[peer])
    monkeypatch.setattr(peers, "SIDES", (10,))
    monkeypatch.setattr(peers, "RAYS", 2**8)
    measured = []
    rows = list(peers.trace_with_all(tmp_path, peers.PeerEnvironment(tmp_path / "environment"), measured))
    assert [row[0] for row in rows] == [2, 2, 2, 10, 10, 10] and [row[3] for row in rows][2::3] == ["fails"] * 2
    assert [(sides, tracer) for sides, tracer, *_ in measured][1::2] == [(2, "embree"), (10, "embree")]
    assert measured[1][2:] == pytest.approx((1e6, 0.3))
    peers.draw_speeds(measured, tmp_path / peers.PICTURE)
    assert (tmp_path / peers.PICTURE).stat().st_size > 0
