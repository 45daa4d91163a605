"""Long runs in parts: counts, random numbers, errors and memory, and the refusal of the checkpoint of another run."""

import tracemalloc

import numpy as np
import pytest

from asperity import AsperityError, InputError
from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core.long_runs import all_parts
from asperity.kernels.sampling import chunks
from asperity.kernels.sampling.rays import RaySums
from asperity.spectral.consequences import channel

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


DISK = geo.Disk(1.0, 0.5)
MANY_RAYS = 2**16 + 123


def exits(**changed):
    asked = {"law": ker.maxwell(0.5), "lengths": [2.0, 4.0, 8.0], "particles": 50, "rng": 7}
    return spec.exit_times(**{**asked, **changed})


def played(**changed):
    law = ker.CollisionLaw.from_wall(geo.focusing_arcs(0.9), DISK)
    velocity = DISK.from_angles(np.linspace(0.5, 2.5, 50), np.full(50, 1.0))
    asked = {"container": geo.Container.strip(), "laws": law, "position": np.zeros((50, 2)), "velocity": velocity}
    return ker.play(**{**asked, "collisions": 5, "rng": 7, **changed})


def studied(**changed):
    asked = {"wall": geo.triangular_teeth(1.2), "scales": [1e-3, 1e-4, 1e-5], "rng": 7, "samples": (2, 3, 4)}
    return ker.limit_study(geo.Disk(1.0, 1.0), **{**asked, "repetitions": 3, **changed})


def discretised(**changed):
    asked = {
        "law": ker.CircularArcLaw(1.1),
        "basis": ker.Bins(8),
        "method": "monte-carlo",
        "samples": MANY_RAYS,
        "rng": 5,
    }
    return ker.discretise(**{**asked, **changed})


def swept(**changed):
    asked = {"family": ker.maxwell, "grid": {"diffuse_fraction": [0.25, 0.5, 1.0]}, "quantities": ["gap"]}
    return spec.sweep(**{**asked, "tolerance": 1e-6, **changed})


CHANGED = [
    (exits, {"particles": 51}, "particles: 50 there, 51 here"),
    (exits, {"law": ker.maxwell(0.25)}, "law: "),
    (exits, {"rng": 8}, "seed: "),
    (exits, {"lengths": [2.0, 4.0, 9.0]}, "lengths: "),
    (exits, {"speed": 2.0}, "speed: "),
    (exits, {"arrangement": "half-turn"}, "arrangement: "),
    (played, {"laws": ker.CollisionLaw.from_wall(geo.focusing_arcs(0.8), DISK)}, "laws: "),
    (played, {"position": np.full((50, 2), 0.25)}, "position: "),
    (played, {"collisions": 6}, "collisions: "),
    (played, {"container": geo.Container.strip(2.0)}, "container: "),
    (studied, {"scales": [1e-3, 1e-4, 1e-6]}, "sizes: "),
    (studied, {"psi": 1.0}, "psi: "),
    (studied, {"wall": geo.triangular_teeth(1.2000000001)}, "wall: "),
    (studied, {"samples": (2, 3, 5)}, "samples: "),
    (studied, {"limit": geo.triangular_teeth(1.3)}, "limit: "),
    (discretised, {"law": ker.CircularArcLaw(1.2)}, "law: "),
    (discretised, {"rng": 6}, "seed: "),
    (discretised, {"basis": ker.Bins(9)}, "basis: "),
    (discretised, {"samples": MANY_RAYS + 1}, f"rays: {MANY_RAYS} there, {MANY_RAYS + 1} here"),
    (discretised, {"method": "qmc"}, "computation: 'independent rays' there, 'scrambled Sobol sequences' here"),
    (swept, {"tolerance": 1e-3}, "tolerance: 1e-06 there, 0.001 here"),
    (swept, {"quantities": ["eta"]}, "quantities: ['gap'] there, ['eta'] here"),
    (swept, {"grid": {"diffuse_fraction": [0.25, 0.5]}}, "grid.diffuse_fraction: '3 from 0.25 to 1.0"),
    (swept, {"family": lambda diffuse_fraction: ker.maxwell(diffuse_fraction / 2.0)}, "last wall"),
]


@pytest.mark.parametrize(("run", "changed", "words"), CHANGED)
def test_the_checkpoint_of_another_run_is_refused_with_the_difference(run, changed, words, tmp_path):
    run(checkpoint=tmp_path / "a")
    before = (tmp_path / "a").read_bytes()
    with pytest.raises(InputError, match="is the checkpoint of something else") as refusal:
        run(**changed, checkpoint=tmp_path / "a")
    assert words in str(refusal.value) and (tmp_path / "a").read_bytes() == before


def test_each_part_has_random_numbers_of_its_own(monkeypatch):
    monkeypatch.setattr(channel, "TOGETHER", 8)
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
