"""Matrices from pairs of angles, at once and in streams, of which chunks, sources and stops change no bit."""

import tracemalloc

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
    counts = None if found.counts is None else found.counts.tobytes()
    return found.symmetric.tobytes(), found.error, found.samples, counts


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


def in_zarr(path, array, chunks):
    import zarr

    made = zarr.open(str(path), mode="w", shape=array.shape, chunks=chunks, dtype="f8")
    made[:] = array
    return made


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
@pytest.mark.parametrize("invariant", [False, True])
@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_the_bits_depend_neither_on_the_chunks_nor_on_the_source(basis, invariant, tmp_path):
    theta, image = pairs(invariant=invariant)
    both = np.column_stack([theta, image])
    np.save(tmp_path / "a.npy", both)
    found = {
        "two arrays": (theta, image), "one array": both, "memmap": np.load(tmp_path / "a.npy", mmap_mode="r"),
        "whole": [(theta, image)], "rows": chunks(theta, image, 1), "odd": chunks(theta, image, 700),
        "zarr": in_zarr(tmp_path / "both", both, (700, 2)),
        "zarr, two": tuple(in_zarr(tmp_path / name, part, (333,)) for name, part in (("in", theta), ("out", image))),
    }  # fmt: skip
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["pairs"], file["in"], file["out"] = both, theta, image
        found |= {"hdf5": file["pairs"], "hdf5, two": (file["in"], file["out"])}
        all_bits = {name: bits(ker.estimate_stream(one, basis, invariant=invariant)) for name, one in found.items()}
    assert len(set(all_bits.values())) == 1


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


@pytest.mark.parametrize(("basis", "invariant", "stop"), [(BASES[0], True, 1), (BASES[1], False, 6)])
@pytest.mark.parametrize("source", ["arrays", "chunks"])
def test_a_stream_that_stopped_goes_on_to_the_same_bits(source, basis, invariant, stop, tmp_path, monkeypatch):
    theta, image = pairs(invariant=invariant)

    def given(size=97):
        return (theta, image) if source == "arrays" else chunks(theta, image, size)

    asked = {"basis": basis, "invariant": invariant}
    whole = bits(ker.estimate_stream(given(), **asked))
    made, original = [], streams._Sums._add

    def stops(self, *block):
        made.append(block)
        # half a block is in the sums where it stops
        original(self, *block)
        if len(made) == stop + 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(streams._Sums, "_add", stops)
    asked["checkpoint"] = tmp_path / "a"
    with pytest.raises(KeyboardInterrupt, match=rf"a has {stop * BLOCK} of them: give the same call"):
        ker.estimate_stream(given(), **asked)
    assert bits(ker.estimate_stream(given(301), **asked)) == whole
    count = len(made)
    assert count == -(-NUMBER // BLOCK) + 1
    # nothing is left to do
    assert bits(ker.estimate_stream(given(), **asked)) == whole and len(made) == count


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


def test_whether_the_incoming_angles_follow_the_measure_is_seen() -> None:
    for invariant in (False, True):
        found = ker.estimate(*pairs(4000, 0, invariant), ker.Bins(12))
        assert found.metadata["incoming_angles_follow_measure"] is invariant


@pytest.mark.parametrize("invariant", [False, True])
@pytest.mark.parametrize("symmetrise", [False, True])
def test_the_z_score_is_that_of_the_raw_pairs_for_any_incoming_angles(invariant: bool, symmetrise: bool) -> None:
    scores = [
        ker.estimate(*pairs(3000, seed, invariant), ker.Bins(10), symmetrise).symmetry_defect().z_score
        for seed in range(60)
    ]
    assert abs(np.mean(scores)) < 0.6 and 0.7 < np.std(scores) < 1.3


def test_the_test_of_the_incoming_angles_can_be_overruled() -> None:
    theta, image = pairs(3000, 1)
    found = ker.estimate(theta, image, ker.Bins(8), symmetrise=True, invariant=False)
    plain = ker.estimate(theta, image, ker.Bins(8), symmetrise=True)
    assert found.metadata["incoming_angles_follow_measure"] is False
    assert 0.0 < np.abs(found.flux - plain.flux).max() < 0.01
    assert np.array_equal(found.counts, plain.counts)


def test_a_grid_of_angles_with_repeats_is_weighted_by_the_measure_it_stands_for() -> None:
    rng = np.random.default_rng(5)
    theta = np.repeat((np.arange(400) + 0.5) * np.pi / 400, 16)
    found = ker.estimate(theta, LAW.sample(theta, rng), ker.Legendre(5))
    assert not found.metadata["incoming_angles_follow_measure"]
    exact = ker.discretise(LAW, ker.Legendre(5))
    assert np.linalg.norm(found.symmetric - exact.symmetric) < 2.0 * float(found.error)
    assert found.stochastic_defect() < 1e-14


def test_pairs_of_any_shape_are_taken() -> None:
    theta, image = pairs(600, 2)
    flat = ker.estimate(theta, image, ker.Bins(4))
    assert np.array_equal(ker.estimate(theta.reshape(20, 30), image.reshape(20, 30), ker.Bins(4)).array, flat.array)
