"""Long runs of independent rays: the same counts for any workers, chunks a task, crashes and restarts."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from asperity import InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.sampling import chunks
from asperity.kernels.sampling.rays import RaySums

RAYS = 5 * 2**16 + 123
BINS = ker.Bins(8)


def counted(law=None, rays=RAYS, seed=5, **engine):
    law = ker.CircularArcLaw(1.1) if law is None else law
    return ker.discretise(law, BINS, "monte-carlo", samples=rays, rng=np.random.default_rng(seed), **engine)


@pytest.fixture(scope="module")
def plain():
    return counted()


@pytest.mark.parametrize("task", [1, 2**17, 2**30])
def test_counts_are_those_of_the_plain_call_for_any_size_of_the_tasks(plain, task, tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", task)
    found = counted(checkpoint=tmp_path / "a")
    assert np.array_equal(found.counts, plain.counts) and found.counts.sum() == RAYS
    assert np.array_equal(found.array, plain.array) and found.error == plain.error and found.samples == plain.samples


def test_counts_do_not_depend_on_the_workers(plain, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 1)
    assert np.array_equal(counted(client=2).counts, plain.counts)


def test_a_traced_wall_counts_its_lost_rays_too(monkeypatch, tmp_path):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 1)
    law = ker.WallLaw(geo.mushrooms(0.2, 0.5, 1))
    one, other = counted(law, 2**17), counted(law, 2**17, checkpoint=tmp_path / "a")
    assert np.array_equal(one.counts, other.counts) and one.unresolved == other.unresolved


@pytest.mark.parametrize("stop", [1, 3])
def test_a_run_that_is_interrupted_goes_on_and_counts_no_ray_twice(plain, stop, tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 1)
    made, original = [], chunks.RayChunks.rays

    def interrupted(self, *arguments):
        made.append(arguments)
        if len(made) == stop + 1:
            raise KeyboardInterrupt
        return original(self, *arguments)

    monkeypatch.setattr(chunks.RayChunks, "rays", interrupted)
    with pytest.raises(KeyboardInterrupt):
        counted(checkpoint=tmp_path / "a")
    assert np.array_equal(counted(checkpoint=tmp_path / "a").counts, plain.counts)
    # six chunks, and the one that was interrupted once more
    assert len(made) == 7
    assert np.array_equal(counted(checkpoint=tmp_path / "a").counts, plain.counts) and len(made) == 7


RUN = """
import numpy as np
from asperity import kernels as ker
from asperity.kernels.sampling import chunks
from asperity.kernels.sampling.rays import RaySums
chunks.RAYS_A_TASK, chunks.STORED_EVERY = 1, 0.0
original = chunks.RayChunks.rays
def told(self, *arguments):
    print("chunk", flush=True)
    return original(self, *arguments)
chunks.RayChunks.rays = told
found = ker.discretise(ker.CircularArcLaw(1.1), ker.Bins(8), "monte-carlo", samples=5 * 2**16 + 123,
                       rng=np.random.default_rng(5), checkpoint="a")
print(found.counts.tolist())
"""


def test_a_killed_process_goes_on_with_the_same_counts(plain, tmp_path):
    (tmp_path / "run.py").write_text(RUN)
    source = str(Path(__file__).resolve().parents[1] / "src")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([source, os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "run.py"]
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(3):
            assert process.stdout.readline() == "chunk\n"
        process.kill()
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.count("chunk") < 6
    assert done.stdout.splitlines()[-1] == str(plain.counts.tolist())


@pytest.mark.parametrize(
    "changed, words",
    [
        ({"law": ker.CircularArcLaw(1.2)}, "law: "),
        ({"seed": 6}, "seed: "),
        ({"rays": RAYS + 1}, f"rays: {RAYS} there, {RAYS + 1} here"),
    ],
)
def test_the_checkpoint_of_other_rays_is_refused_with_the_difference(changed, words, tmp_path):
    counted(checkpoint=tmp_path / "a")
    with pytest.raises(InputError, match="is the checkpoint of something else") as refusal:
        counted(**changed, checkpoint=tmp_path / "a")
    assert words in str(refusal.value)


@pytest.mark.parametrize("basis", [ker.Legendre(5), ker.Panels([0.0, 1.0, np.pi], 2)], ids=repr)
def test_sums_in_other_bases_are_the_same_bits_after_a_stop_and_with_workers(basis, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    # three chunks and two tasks for each of 32 parts
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 2**10)
    monkeypatch.setattr(chunks, "STORED_EVERY", 0.0)
    monkeypatch.setattr(RaySums, "chunk", 2**9)
    rays = 32 * (2**10 + 2**9)
    law = ker.WallLaw(geo.mushrooms(0.2, 0.5, 1))

    def found(**engine):
        return ker.discretise(law, basis, "monte-carlo", samples=rays, rng=3, **engine)

    whole = found()
    made, original = [], chunks._Summing.summed

    def stops(self, task):
        made.append(task)
        if len(made) == 21:
            raise KeyboardInterrupt
        return original(self, task)

    monkeypatch.setattr(chunks._Summing, "summed", stops)
    with pytest.raises(KeyboardInterrupt):
        found(checkpoint=tmp_path / "a")
    again = found(checkpoint=tmp_path / "a")
    assert again.symmetric.tobytes() == whole.symmetric.tobytes() and again.error == whole.error
    assert again.unresolved == whole.unresolved and made[21:] == list(range(20, 64))
    monkeypatch.setattr(chunks._Summing, "summed", original)
    with distributed.Client(n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None) as client:
        assert found(client=client).symmetric.tobytes() == whole.symmetric.tobytes()


def test_real_sums_wait_for_those_before_them(monkeypatch):
    whole = ker.discretise(ker.maxwell(0.5), ker.Legendre(4), "monte-carlo", samples=2**12, rng=3)

    def backwards(function, tasks, client):
        return [(task, function(task)) for task in reversed(list(tasks))]

    monkeypatch.setattr(chunks, "results", backwards)
    found = ker.discretise(ker.maxwell(0.5), ker.Legendre(4), "monte-carlo", samples=2**12, rng=3)
    assert found.symmetric.tobytes() == whole.symmetric.tobytes()


def test_long_runs_need_independent_rays(tmp_path):
    with pytest.raises(InputError, match="need 'monte-carlo'"):
        ker.discretise(ker.lambertian(), BINS, checkpoint=tmp_path / "a")
