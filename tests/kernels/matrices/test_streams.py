"""Matrices from streams of pairs: any chunks, sources, stops and restarts give the same bits."""

from __future__ import annotations

import os
import subprocess
import sys
import tracemalloc
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from asperity import InputError
from asperity import kernels as ker
from asperity.kernels.sampling import streams

LAW = ker.TriangularTeethLaw(1.1)
BASES = [ker.Bins(6), ker.Legendre(5), ker.Panels([0.0, 1.0, np.pi], 2)]
NUMBER, BLOCK = 5000, 512


def pairs(number=NUMBER, seed=0, invariant=True):
    rng = np.random.default_rng(seed)
    theta = ker.SINE.sample(number, rng) if invariant else np.pi * rng.beta(1.2, 1.6, number)
    return theta, LAW.sample(theta, rng)


def chunks(theta, image, size):
    return ((theta[k : k + size], image[k : k + size]) for k in range(0, theta.size, size))


def bits(found):
    return (
        found.symmetric.tobytes(),
        found.error,
        found.samples,
        None if found.counts is None else found.counts.tobytes(),
    )


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    monkeypatch.setattr(streams, "BLOCK", BLOCK)
    monkeypatch.setattr(streams, "STORED_EVERY", 0.0)


@pytest.mark.parametrize("symmetrise", [False, True])
def test_in_cells_it_is_the_matrix_of_all_pairs_at_once(symmetrise):
    whole = ker.estimate(*pairs(), ker.Bins(6), symmetrise)
    assert bits(ker.estimate_stream(chunks(*pairs(), 77), ker.Bins(6), symmetrise)) == bits(whole)


@pytest.mark.parametrize("basis", BASES[1:], ids=repr)
def test_in_other_bases_it_differs_by_rounding_from_that_of_all_pairs_at_once(basis):
    whole, found = ker.estimate(*pairs(), basis), ker.estimate_stream(pairs(), basis)
    np.testing.assert_allclose(found.symmetric, whole.symmetric, atol=1e-13)
    assert float(found.error) == pytest.approx(float(whole.error), rel=1e-10) and len(found.replicates) == 32


@pytest.mark.parametrize("invariant", [False, True])
@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_the_bits_depend_neither_on_the_chunks_nor_on_the_source(basis, invariant, tmp_path):
    theta, image = pairs(invariant=invariant)
    both = np.column_stack([theta, image])
    np.save(tmp_path / "a.npy", both)
    found = {
        "two arrays": (theta, image), "one array": both, "memmap": np.load(tmp_path / "a.npy", mmap_mode="r"),
        "whole": [(theta, image)], "rows": chunks(theta, image, 1), "odd": chunks(theta, image, 700),
    }  # fmt: skip
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["pairs"], file["in"], file["out"] = both, theta, image
        found |= {"hdf5": file["pairs"], "hdf5, two": (file["in"], file["out"])}
        all_bits = {name: bits(ker.estimate_stream(one, basis, invariant=invariant)) for name, one in found.items()}
    assert len(set(all_bits.values())) == 1


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_arrays_of_zarr_give_the_bits_of_numpys_whatever_their_chunks(basis, tmp_path):
    import zarr

    theta, image = pairs()
    whole = bits(ker.estimate_stream((theta, image), basis))
    both = zarr.open(str(tmp_path / "both"), mode="w", shape=(NUMBER, 2), chunks=(700, 2), dtype="f8")
    both[:] = np.column_stack([theta, image])
    columns = []
    for name, column in (("in", theta), ("out", image)):
        columns.append(zarr.open(str(tmp_path / name), mode="w", shape=(NUMBER,), chunks=(333,), dtype="f8"))
        columns[-1][:] = column
    found = [ker.estimate_stream(given, basis, checkpoint=tmp_path / "a") for given in (both, tuple(columns))]
    assert [bits(one) for one in found] == [whole, whole]


@pytest.fixture(scope="module")
def workers():
    import distributed

    with distributed.Client(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
    ) as client:
        yield client


@pytest.mark.parametrize("invariant", [False, True])
@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_the_bits_do_not_depend_on_the_workers(basis, invariant, workers, tmp_path, monkeypatch):
    given = pairs(invariant=invariant)
    whole = bits(ker.estimate_stream(given, basis, invariant=invariant))
    assert bits(ker.estimate_stream(given, basis, invariant=invariant, client=workers)) == whole
    # a stream that stops after five blocks, while later ones are with the workers, goes on here
    made, original = [], streams._Sums._merge

    def stops(self, other):
        made.append(other)
        if len(made) == 6:
            raise KeyboardInterrupt
        original(self, other)

    monkeypatch.setattr(streams._Sums, "_merge", stops)
    asked = {"basis": basis, "invariant": invariant, "checkpoint": tmp_path / "a"}
    with pytest.raises(KeyboardInterrupt, match=rf"a has {5 * BLOCK} of them: give the same call"):
        ker.estimate_stream(chunks(*given, 97), client=workers, **asked)
    assert bits(ker.estimate_stream(chunks(*given, 301), **asked)) == whole


def test_blocks_that_come_early_wait(monkeypatch):
    whole = bits(ker.estimate_stream(pairs(), BASES[1]))

    def backwards(function, tasks, client, backlog):
        return [(task, function(task)) for task in reversed(list(tasks))]

    @contextmanager
    def no_workers(client):
        yield SimpleNamespace(nthreads=dict)

    monkeypatch.setattr(streams, "results", backwards)
    monkeypatch.setattr(streams, "connected", no_workers)
    assert bits(ker.estimate_stream(pairs(), BASES[1])) == whole


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_pairs_that_do_not_follow_the_measure_are_weighted_as_in_estimate(basis):
    # the matrix of the law itself, from pairs that have another distribution
    exact = ker.discretise(LAW, basis).symmetric
    covered = []
    for seed in range(40):
        found = ker.estimate_stream(pairs(4 * BLOCK, seed, invariant=False), basis, True, invariant=False)
        covered.append(np.linalg.norm(found.symmetric - exact) <= float(found.error))
    # 95 % of 40, give or take three standard deviations
    assert np.mean(covered) > 0.84


@pytest.mark.parametrize("stop", [1, 6])
@pytest.mark.parametrize("basis", BASES, ids=repr)
@pytest.mark.parametrize("source", ["arrays", "chunks"])
def test_a_stream_that_stopped_goes_on_to_the_same_bits(source, basis, stop, tmp_path, monkeypatch):
    theta, image = pairs()

    def given(size=97):
        return (theta, image) if source == "arrays" else chunks(theta, image, size)

    whole = bits(ker.estimate_stream(given(), basis))
    made, original = [], streams._Sums._add

    def stops(self, *block):
        made.append(block)
        if len(made) == stop + 1:
            # half a block is in the sums
            original(self, *block)
            raise KeyboardInterrupt
        original(self, *block)

    monkeypatch.setattr(streams._Sums, "_add", stops)
    with pytest.raises(KeyboardInterrupt, match=rf"a has {stop * BLOCK} of them: give the same call"):
        ker.estimate_stream(given(), basis, checkpoint=tmp_path / "a")
    again = ker.estimate_stream(given(301), basis, checkpoint=tmp_path / "a")
    assert bits(again) == whole and len(made) == -(-NUMBER // BLOCK) + 1
    assert bits(ker.estimate_stream(given(), basis, checkpoint=tmp_path / "a")) == whole
    assert len(made) == -(-NUMBER // BLOCK) + 1


def test_other_pairs_are_refused_by_the_checkpoint(tmp_path):
    theta, image = pairs()
    ker.estimate_stream((theta, image), ker.Bins(6), checkpoint=tmp_path / "a")
    for other, basis, words in [
        (pairs(seed=1), ker.Bins(6), "first pairs: "),
        ((theta[:-1], image[:-1]), ker.Bins(6), "pairs: 5000 there, 4999 here"),
        ((theta, image), ker.Bins(7), "basis: "),
    ]:
        with pytest.raises(InputError, match="is the checkpoint of something else") as refusal:
            ker.estimate_stream(other, basis, checkpoint=tmp_path / "a")
        assert words in str(refusal.value)
    ker.estimate_stream(chunks(theta, image, 50), ker.Bins(6), checkpoint=tmp_path / "b")
    for number, words in ((NUMBER - BLOCK, "fewer"), (NUMBER - 1, "fewer")):
        with pytest.raises(InputError, match=words):
            ker.estimate_stream(chunks(theta[:number], image[:number], 50), ker.Bins(6), checkpoint=tmp_path / "b")
    longer = np.append(theta, theta[:10]), np.append(image, image[:10])
    with pytest.raises(InputError, match="more"):
        ker.estimate_stream(chunks(*longer, 50), ker.Bins(6), checkpoint=tmp_path / "b")


def test_memory_does_not_grow_with_the_stream():
    def peak(blocks):
        rng = np.random.default_rng(0)
        source = ((ker.SINE.sample(BLOCK, rng), ker.SINE.sample(BLOCK, rng)) for _ in range(blocks))
        tracemalloc.start()
        ker.estimate_stream(source, ker.Bins(64))
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return used

    peak(4)
    # the least of three, because garbage is collected at any time
    assert min(peak(256) for _ in range(3)) < 1.1 * peak(16)


def test_incoming_angles_that_do_not_follow_the_measure_are_refused_by_default():
    with pytest.raises(InputError, match="pass invariant=False"):
        ker.estimate_stream(pairs(invariant=False), ker.Bins(6))


RUN = """
import numpy as np
from asperity import kernels as ker
from asperity.kernels.sampling import streams
streams.BLOCK, streams.STORED_EVERY = 512, 0.0
rng = np.random.default_rng(4)
theta = ker.SINE.sample(20_000, rng)
image = ker.TriangularTeethLaw(1.1).sample(theta, rng)
def told():
    for k in range(0, theta.size, 300):
        print("chunk", flush=True)
        yield theta[k : k + 300], image[k : k + 300]
print(ker.estimate_stream(told(), ker.Legendre(5), checkpoint="a").symmetric.tobytes().hex())
"""


def test_a_killed_process_goes_on_to_the_same_bits(tmp_path):
    source = str(Path(__file__).resolve().parents[3] / "src")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([source, os.environ.get("PYTHONPATH", "")])}
    for name in ("whole", "killed"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.py").write_text(RUN)

    def started(name):
        return subprocess.Popen(
            [sys.executable, "run.py"], cwd=tmp_path / name, env=environment, stdout=subprocess.PIPE, text=True
        )

    with started("killed") as process:
        for _ in range(20):
            assert process.stdout.readline() == "chunk\n"
        process.kill()
    ends = [started(name).communicate()[0].splitlines()[-1] for name in ("whole", "killed")]
    assert ends[0] == ends[1] and len(ends[0]) == 2 * 8 * 25
