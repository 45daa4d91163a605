"""Long runs in parts: the same bits for any workers, crashes and restarts, and refusals of other checkpoints."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from asperity import AsperityError, InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.long_runs import all_parts
from asperity.kernels.billiards import billiard
from asperity.spectral.consequences import channel

DISK = geo.Disk(1.0, 0.5)
SOURCE = str(Path(__file__).resolve().parents[2] / "src")


def exits(**changed):
    asked = {"law": ker.maxwell(0.5), "lengths": [2.0, 4.0, 8.0], "particles": 50, "rng": 7}
    return spec.exit_times(**{**asked, **changed})


def played(**changed):
    law = ker.CollisionLaw.from_wall(geo.focusing_arcs(0.9), DISK)
    n = 50
    velocity = DISK.from_angles(np.linspace(0.5, 2.5, n), np.full(n, 1.0))
    asked = {"laws": law, "position": np.zeros((n, 2)), "velocity": velocity, "collisions": 5, "rng": 7}
    return ker.play(geo.Container.strip(), **{**asked, **changed})


def studied(**changed):
    asked = {"scales": [1e-3, 1e-4, 1e-5], "rng": 7, "samples": (2, 3, 4), "repetitions": 3}
    return ker.limit_study(geo.Disk(1.0, 1.0), geo.triangular_teeth(1.2), **{**asked, **changed})


def bits(found):
    """All arrays of a result but the seconds, to the bit."""
    values = {name: value for name, value in vars(found).items() if name != "seconds"}
    values |= values.pop("errors", {})
    return {name: value.tobytes() for name, value in values.items() if isinstance(value, np.ndarray)}


RUNS = {"exit_times": (exits, 7), "play": (played, 7), "limit_study": (studied, 9)}


@pytest.fixture(autouse=True)
def small_parts(monkeypatch):
    monkeypatch.setattr(channel, "TOGETHER", 8)
    monkeypatch.setattr(billiard, "TOGETHER", 8)


@pytest.mark.parametrize("name", RUNS)
def test_a_run_that_was_stopped_goes_on_to_the_same_bits(name, tmp_path, monkeypatch):
    run, parts = RUNS[name]
    whole = bits(run())
    from asperity.core import long_runs

    made, original = [], long_runs._Packed.part

    def stops(self, number):
        made.append(number)
        if len(made) == 4:
            raise KeyboardInterrupt
        return original(self, number)

    monkeypatch.setattr(long_runs._Packed, "part", stops)
    with pytest.raises(KeyboardInterrupt, match=f"stopped after 3 of {parts} parts; .*a has them: give the same call"):
        run(checkpoint=tmp_path / "a")
    assert bits(run(checkpoint=tmp_path / "a")) == whole and len(made) == parts + 1
    assert bits(run(checkpoint=tmp_path / "a")) == whole and len(made) == parts + 1
    made.clear()
    with pytest.raises(KeyboardInterrupt, match="without a checkpoint they are lost"):
        run()


def test_the_bits_do_not_depend_on_the_workers(tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.Client(n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None) as client:
        for run, _ in RUNS.values():
            assert bits(run(client=client, checkpoint=tmp_path / run.__name__)) == bits(run())


@pytest.mark.parametrize(
    ("name", "changed", "words"),
    [
        ("exit_times", {"particles": 51}, "particles: 50 there, 51 here"),
        ("exit_times", {"law": ker.maxwell(0.25)}, "law: "),
        ("exit_times", {"rng": 8}, "seed: "),
        ("exit_times", {"lengths": [2.0, 4.0, 9.0]}, "lengths: "),
        ("exit_times", {"speed": 2.0}, "speed: "),
        ("exit_times", {"arrangement": "half-turn"}, "arrangement: "),
        ("play", {"laws": ker.CollisionLaw.from_wall(geo.focusing_arcs(0.8), DISK)}, "laws: "),
        ("play", {"position": np.full((50, 2), 0.25)}, "start: "),
        ("play", {"collisions": 6}, "collisions: "),
        ("limit_study", {"scales": [1e-3, 1e-4, 1e-6]}, "sizes: "),
        ("limit_study", {"psi": 1.0}, "psi: "),
        ("limit_study", {"samples": (2, 3, 5)}, "samples: "),
        ("limit_study", {"limit": geo.triangular_teeth(1.3)}, "limit: "),
    ],
)
def test_the_checkpoint_of_another_run_is_refused_with_the_difference(name, changed, words, tmp_path):
    run, _ = RUNS[name]
    run(checkpoint=tmp_path / "a")
    with pytest.raises(InputError, match="is the checkpoint of something else") as refusal:
        run(**changed, checkpoint=tmp_path / "a")
    assert words in str(refusal.value)


def test_each_part_has_random_numbers_of_its_own():
    times = exits(particles=16).times
    assert len({row.tobytes() for row in times}) == 16
    # the first part of more particles is that of fewer
    assert exits(particles=24).times[:16].tobytes() == times.tobytes()


def test_an_error_of_a_part_is_that_of_the_run(tmp_path):
    def fails(number):
        raise (InputError if number else AsperityError)("too late")

    with pytest.raises(AsperityError, match="too late"):
        all_parts(fails, 1, {}, {})
    with pytest.raises(InputError, match="too late"):
        all_parts(lambda number: fails(1), 1, {}, {"checkpoint": tmp_path / "a"})


RUN = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
import numpy as np
from asperity import kernels as ker, spectral as spec
from asperity.core import checkpoints, long_runs
from asperity.spectral.consequences import channel
channel.TOGETHER, checkpoints.MOMENT = 1000, 0.0
original = long_runs._Packed.part
def told(self, number):
    print("part", flush=True)
    return original(self, number)
long_runs._Packed.part = told
found = spec.exit_times(ker.maxwell(0.1), np.geomspace(5.0, 200.0, 5), 12_000, 3, checkpoint="a")
print(found.times.tobytes().hex()[:4000] + str(found.times.sum()))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="a signal to another process is sent differently here")
def test_a_killed_and_an_interrupted_process_go_on_to_the_same_bits(tmp_path):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([SOURCE, os.environ.get("PYTHONPATH", "")])}
    command, pipe = [sys.executable, "run.py"], subprocess.PIPE

    def started(folder):
        folder.mkdir(exist_ok=True)
        (folder / "run.py").write_text(RUN)
        return subprocess.Popen(command, cwd=folder, env=environment, stdout=pipe, stderr=pipe, text=True)

    whole, _ = started(tmp_path / "whole").communicate()
    parts = 0
    for stop in (signal.SIGKILL, signal.SIGINT):
        with started(tmp_path / "stopped") as process:
            for _ in range(4):
                assert process.stdout.readline() == "part\n"
            process.send_signal(stop)
            sent = time.monotonic()
            rest, message = process.communicate()
            parts += 4 + rest.count("part")
        if stop == signal.SIGINT:
            assert process.returncode == -signal.SIGINT and "of 12 parts; a has them: give the same call" in message
            # a part is some tenths of a second; the end of the process is not ours
            assert time.monotonic() - sent < 20.0
    done, _ = started(tmp_path / "stopped").communicate()
    assert done.splitlines()[-1] == whole.splitlines()[-1]
    assert done.count("part") == 12 + 2 - parts


OTHERS = """
import sys
sys.path.insert(0, sys.argv[1])
from test_parts_of_runs import RUNS, bits
from asperity.core import checkpoints, long_runs
from asperity.kernels.billiards import billiard
billiard.TOGETHER, checkpoints.MOMENT = 8, 0.0
original = long_runs._Packed.part
def told(self, number):
    print("part", flush=True)
    return original(self, number)
long_runs._Packed.part = told
RUNS[sys.argv[2]][0](checkpoint="a")
"""


@pytest.mark.skipif(os.name != "posix", reason="processes are ended differently here")
@pytest.mark.parametrize("name", ["play", "limit_study"])
def test_what_a_killed_process_stored_is_gone_on_with_to_the_same_bits(name, tmp_path, monkeypatch):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([SOURCE, os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "-c", OTHERS, str(Path(__file__).parent), name]
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True) as process:
        for _ in range(4):
            assert process.stdout.readline() == "part\n"
        process.kill()
    from asperity.core import long_runs

    run, parts = RUNS[name]
    made, original = [], long_runs._Packed.part

    def told(self, number):
        made.append(number)
        return original(self, number)

    monkeypatch.setattr(long_runs._Packed, "part", told)
    again = bits(run(checkpoint=tmp_path / "a"))
    # three parts are stored, the fourth and later ones are or were lost
    assert len(made) <= parts - 3
    assert again == bits(run())
