"""Long runs in parts: counts, errors and memory."""

import tracemalloc

import numpy as np
import pytest

from asperity import AsperityError, InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.long_runs import all_parts
from asperity.kernels.sampling import chunks
from asperity.kernels.sampling.chunks import RaySums

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
@pytest.mark.parametrize("task", [1, 2**30])
def test_counts_are_those_of_the_plain_call_for_any_size_of_the_tasks(plain, method, task, tmp_path, monkeypatch):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", task)
    found, known = counted(method, checkpoint=tmp_path / "a"), plain[method]
    assert np.array_equal(found.counts, known.counts)
    assert method == "qmc" or found.counts.sum() == RAYS
    assert np.array_equal(found.array, known.array) and found.error == known.error and found.samples == known.samples


def test_counts_do_not_depend_on_processes(plain, worker_processes, monkeypatch):
    monkeypatch.setattr(chunks, "RAYS_A_TASK", 1)
    for method, known in plain.items():
        assert np.array_equal(counted(method, client=worker_processes).counts, known.counts)


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


def test_large_results_are_asked_for_in_small_numbers(worker_processes):
    law = ker.CircularArcLaw(1.1)

    def backlog(basis, client):
        job = chunks.IndependentRays(law, basis, (1, 2), 2**20, 1)
        return chunks._Run(job, None)._backlog(client)

    # of 8 n^2 bytes a quarter of a gigabyte, and two for each of two workers
    for bins, most in ((64, 2000), (1024, 2**28 // 2**23 + 4), (8192, 4)):
        assert backlog(ker.Bins(bins), worker_processes) == most


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


def test_an_error_of_a_part_is_that_of_the_run(tmp_path):
    def fails(number):
        raise (InputError if number else AsperityError)("too late")

    with pytest.raises(AsperityError, match="too late"):
        all_parts(fails, 1, {}, {})
    with pytest.raises(InputError, match="too late"):
        all_parts(lambda number: fails(1), 1, {}, {"checkpoint": tmp_path / "a"})
