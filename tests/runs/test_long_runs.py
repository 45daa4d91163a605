"""Long runs of independent rays: the same counts for any workers, chunks a task, crashes and restarts."""

from __future__ import annotations

import os
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from asperity import InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.workers import connected
from asperity.kernels.sampling import chunks
from asperity.kernels.sampling.rays import RaySums

RAYS = 5 * 2**16 + 123
BINS = ker.Bins(8)
# Chunks of the rays; quasi-Monte Carlo rounds them up to 8 times a power of two.
CHUNKS = {"monte-carlo": 6, "qmc": 8}
METHODS = pytest.mark.parametrize("method", CHUNKS)


def counted(method="monte-carlo", law=None, rays=RAYS, seed=5, **engine):
    law = ker.CircularArcLaw(1.1) if law is None else law
    return ker.discretise(law, BINS, method, samples=rays, rng=np.random.default_rng(seed), **engine)


@pytest.fixture(scope="module")
def plain():
    return {method: counted(method) for method in CHUNKS}


@METHODS
@pytest.mark.parametrize("task", [1, 2**17, 2**30])
def test_counts_are_those_of_the_plain_call_for_any_size_of_the_tasks(plain, method, task, tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", task)
    found, known = counted(method, checkpoint=tmp_path / "a"), plain[method]
    assert np.array_equal(found.counts, known.counts)
    assert method == "qmc" or found.counts.sum() == RAYS
    assert np.array_equal(found.array, known.array) and found.error == known.error and found.samples == known.samples


@pytest.fixture(scope="module")
def workers():
    distributed = pytest.importorskip("distributed")
    with distributed.Client(n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None) as client:
        yield client


def test_counts_do_not_depend_on_processes(plain, monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 1)
    with connected(2) as client:
        for method, known in plain.items():
            assert np.array_equal(counted(method, client=client).counts, known.counts)


@METHODS
def test_a_traced_wall_counts_its_lost_rays_too(method, monkeypatch, tmp_path):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 1)
    law = ker.WallLaw(geo.mushrooms(0.2, 0.5, 1))
    one, other = counted(method, law, 2**17), counted(method, law, 2**17, checkpoint=tmp_path / "a")
    assert np.array_equal(one.counts, other.counts) and one.unresolved == other.unresolved


@METHODS
@pytest.mark.parametrize("stop", [1, 3])
def test_a_run_that_is_interrupted_goes_on_and_counts_no_ray_twice(plain, method, stop, tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 1)
    made, original = [], RaySums.count_unresolved

    def interrupted(self, escaped):
        made.append(escaped)
        if len(made) == stop + 1:
            raise KeyboardInterrupt
        original(self, escaped)

    monkeypatch.setattr(RaySums, "count_unresolved", interrupted)
    with pytest.raises(KeyboardInterrupt, match=rf"after {stop * 2**16} of \d+ rays; .*a has them: give the same call"):
        counted(method, checkpoint=tmp_path / "a")
    known, all_chunks = plain[method].counts, CHUNKS[method] + 1
    assert np.array_equal(counted(method, checkpoint=tmp_path / "a").counts, known)
    # all chunks, and the one that was interrupted once more
    assert len(made) == all_chunks
    assert np.array_equal(counted(method, checkpoint=tmp_path / "a").counts, known) and len(made) == all_chunks


RUN = """
import sys
import tracemalloc
import numpy as np
from asperity import kernels as ker
from asperity.kernels.sampling import chunks
from asperity.kernels.sampling.rays import RaySums
chunks.RAYS_A_TASK, chunks.STORED_EVERY = 1, 0.0
original = RaySums.count_unresolved
def told(self, *arguments):
    print("chunk", flush=True)
    return original(self, *arguments)
RaySums.count_unresolved = told
found = ker.discretise(ker.CircularArcLaw(1.1), ker.Bins(8), sys.argv[1], samples=5 * 2**16 + 123,
                       rng=np.random.default_rng(5), checkpoint="a")
print(found.counts.tolist())
"""


@METHODS
def test_a_killed_process_goes_on_with_the_same_counts(plain, method, tmp_path):
    (tmp_path / "run.py").write_text(RUN)
    source = str(Path(__file__).resolve().parents[2] / "src")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([source, os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "run.py", method]
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for _ in range(3):
            assert process.stdout.readline() == "chunk\n"
        process.kill()
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.count("chunk") < CHUNKS[method]
    assert done.stdout.splitlines()[-1] == str(plain[method].counts.tolist())


@pytest.mark.parametrize(
    "changed, words",
    [
        ({"law": ker.CircularArcLaw(1.2)}, "law: "),
        ({"seed": 6}, "seed: "),
        ({"rays": RAYS + 1}, f"rays: {RAYS} there, {RAYS + 1} here"),
        ({"method": "qmc"}, "computation: 'independent rays' there, 'scrambled Sobol sequences' here"),
    ],
)
def test_the_checkpoint_of_other_rays_is_refused_with_the_difference(changed, words, tmp_path):
    counted(checkpoint=tmp_path / "a")
    with pytest.raises(InputError, match="is the checkpoint of something else") as refusal:
        counted(**changed, checkpoint=tmp_path / "a")
    assert words in str(refusal.value)


@METHODS
@pytest.mark.parametrize("basis", [ker.Legendre(5), ker.Panels([0.0, 1.0, np.pi], 2)], ids=repr)
def test_sums_in_other_bases_are_the_same_bits_after_a_stop_and_with_workers(
    method, basis, workers, tmp_path, monkeypatch
):
    # three chunks and two tasks for each of 32 independent parts, and 64 tasks for all parts of a sequence
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 2**10)
    monkeypatch.setattr(chunks, "STORED_EVERY", 0.0)
    monkeypatch.setattr(RaySums, "chunk", 2**9)
    rays = {"monte-carlo": 32 * (2**10 + 2**9), "qmc": 2**16}[method]
    law = ker.WallLaw(geo.mushrooms(0.2, 0.5, 1))

    def found(**engine):
        return ker.discretise(law, basis, method, samples=rays, rng=3, **engine)

    whole = found()
    made, original = [], chunks._Task.sums

    def stops(self, task):
        made.append(task)
        if len(made) == 21:
            raise KeyboardInterrupt
        return original(self, task)

    monkeypatch.setattr(chunks._Task, "sums", stops)
    with pytest.raises(KeyboardInterrupt):
        found(checkpoint=tmp_path / "a")
    again = found(checkpoint=tmp_path / "a")
    assert again.symmetric.tobytes() == whole.symmetric.tobytes() and again.error == whole.error
    assert again.unresolved == whole.unresolved and made[21:] == list(range(20, 64))
    monkeypatch.setattr(chunks._Task, "sums", original)
    assert found(client=workers).symmetric.tobytes() == whole.symmetric.tobytes()


@METHODS
def test_real_sums_wait_for_those_before_them(method, monkeypatch):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 2**10)
    monkeypatch.setattr(RaySums, "chunk", 2**9)
    law = ker.WallLaw(geo.mushrooms(0.2, 0.5, 1))

    def found():
        return ker.discretise(law, ker.Legendre(4), method, samples=2**13, rng=3)

    whole = found()

    def backwards(function, tasks, client, backlog):
        return [(task, function(task)) for task in reversed(list(tasks))]

    monkeypatch.setattr(chunks, "results", backwards)
    assert found().symmetric.tobytes() == whole.symmetric.tobytes()


def test_large_results_are_asked_for_in_small_numbers(workers):
    law = ker.CircularArcLaw(1.1)

    def backlog(basis, client):
        job = chunks.IndependentRays(law, basis, (1, 2), 2**20, 1)
        return chunks._Run(job, None)._backlog(client)

    # of 8 n^2 bytes a quarter of a gigabyte, and two for each of two workers
    assert backlog(ker.Bins(64), workers) == 2000 and backlog(ker.Bins(1024), workers) == 2**28 // 2**23 + 4
    assert backlog(ker.Bins(8192), workers) == 4


def test_long_runs_need_rays_of_one_law(tmp_path):
    with pytest.raises(InputError, match="need 'monte-carlo' or 'qmc', got 'auto'"):
        ker.discretise(ker.lambertian(), BINS, checkpoint=tmp_path / "a")
    arcs = ker.WallLaw(geo.mushrooms(0.2, 0.5, 1))
    mixture = 0.5 * arcs + 0.5 * ker.WallLaw(geo.mushrooms(0.3, 0.5, 1))
    with pytest.raises(InputError, match="from its parts; use 'monte-carlo'"):
        ker.discretise(mixture, BINS, "qmc", checkpoint=tmp_path / "a")
    assert not (tmp_path / "a").exists()


def test_the_law_of_a_disk_stores_the_rays_of_its_angle(tmp_path):
    basis = ker.TensorBasis((BINS, ker.Bins(2, weight="sin2")))
    law = ker.CollisionLaw(ker.WallLaw(geo.mushrooms(0.2, 0.5, 1)), geo.Disk())
    plain, stored = (
        ker.discretise(law, basis, "qmc", samples=2**10, **engine) for engine in ({}, {"checkpoint": tmp_path / "a"})
    )
    assert (tmp_path / "a").exists() and np.array_equal(plain.array, stored.array)


@METHODS
@pytest.mark.parametrize("basis", [BINS, ker.Legendre(5)], ids=repr)
def test_memory_is_that_of_a_chunk_of_rays_and_of_the_tables(method, basis, tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 2**12)
    monkeypatch.setattr(RaySums, "chunk", 2**12)

    def peak(rays):
        tracemalloc.start()
        ker.discretise(ker.CircularArcLaw(1.1), basis, method, samples=rays, rng=3, checkpoint=tmp_path / str(rays))
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return used

    peak(2**12)
    # the angles of all rays would be four megabytes, and a chunk has 65 kB
    assert peak(2**18) < 1e6
