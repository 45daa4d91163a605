"""Nets go on where they were, and of mirror-symmetric laws hold half of the rays."""

import numpy as np
import pytest

from asperity import kernels as ker
from asperity.errors import InputError
from asperity.kernels.bases.assembly import reflection_matrix
from asperity.kernels.sampling import chunks as ray_sums
from asperity.kernels.sampling.sobol import PARTS, SOBOL_BITS, SobolSampler, sobol_sequence

TEETH = ker.TriangularTeethLaw(1.1)
BASES = [ker.Bins(16), ker.Bins(9), ker.Legendre(6), ker.Panels(np.linspace(0.0, np.pi, 5), 2)]


def sampled(law: ker.Law, basis: ker.Basis, seed: int) -> ker.KernelMatrix:
    return ker.discretise(law, basis, "qmc", samples=4096, rng=np.random.default_rng(seed))


def points(net: SobolSampler, number: int) -> np.ndarray:
    """The digits of the first points before the shifts."""
    return (sobol_sequence(net.seed, 0).random(number) * 2.0**SOBOL_BITS).astype(np.uint64)


@pytest.mark.parametrize("basis", BASES, ids=repr)
def test_matrices_from_half_of_the_rays_are_mirror_symmetric_markov_and_right_within_their_errors(basis, bounce):
    exact = ker.discretise(TEETH, basis).symmetric
    flip = reflection_matrix(basis)
    within = []
    for seed in range(24):
        found = sampled(bounce(mirror_symmetric=True), basis, seed)
        assert np.abs(flip @ found.symmetric @ flip.T - found.symmetric).max() < 1e-14
        assert found.stochastic_defect() < 1e-13 and found.samples == 4096
        within.append(np.linalg.norm(found.symmetric - exact) <= float(found.error))
    # six of 24 or more are outside of intervals of 95 % once in a thousand times
    assert sum(within) > 18


@pytest.mark.parametrize("chunk", [1, 8, 64, 4096])
@pytest.mark.parametrize("looks", [(2000,), (1, 100, 1000, 3), (30, 31, 900)], ids=repr)
def test_parts_of_a_net_are_digital_shifts_of_one_sequence_whatever_is_traced_at_a_time(
    looks, chunk, monkeypatch, bounce
):
    monkeypatch.setattr(ray_sums, "SMALLEST_CHUNK", chunk)
    basis, law = ker.Bins(2), bounce()
    net, twin = (SobolSampler(law, basis, np.random.default_rng(5)) for _ in range(2))
    for look in looks:
        net.sampled(look, symmetrise=False)
    digits = points(twin, net.sums.each).tolist()
    assert PARTS * net.sums.each >= max(looks) and len({tuple(shift) for shift in net.shifts.tolist()}) == PARTS
    for table, shift, beyond in zip(net.sums.tables, net.shifts.tolist(), net.beyond, strict=True):
        shifted = [[number ^ by for number, by in zip(point, shift, strict=True)] for point in digits]
        x, u = (np.array(shifted) / 2**SOBOL_BITS + beyond).T
        incoming = ker.SINE.quantile(u)
        cells = [2 * (incoming > np.pi / 2), law.reflect(x, incoming) > np.pi / 2]
        assert np.array_equal(table.ravel(), np.bincount(cells[0] + cells[1], minlength=4))


@pytest.mark.parametrize("rays", [8, 64, 1024])
def test_each_part_is_a_net(rays, bounce):
    # of 2^k points of a (0, k, 2)-net one is in every dyadic rectangle of that area, in any shape
    net = SobolSampler(bounce(), ker.Bins(2), np.random.default_rng(6))
    digits = points(net, rays)
    for shift in net.shifts:
        x, y = ((digits ^ shift) * 2.0**-SOBOL_BITS).T
        for width in 2 ** np.arange(rays.bit_length()):
            cells = np.floor(x * width) * (rays // width) + np.floor(y * (rays // width))
            assert np.array_equal(np.sort(cells), np.arange(rays))


@pytest.mark.parametrize("number", [1, 3, 64])
def test_a_sequence_begun_anywhere_goes_on_as_the_whole(number):
    whole = sobol_sequence((7, 8), 2**20).random(64)
    parts = [sobol_sequence((7, 8), 2**20 + start).random(min(number, 64 - start)) for start in range(0, 64, number)]
    assert np.array_equal(np.concatenate(parts), whole) and len(np.unique(whole, axis=0)) == 64


def test_more_rays_than_a_net_has_are_refused_before_the_first_is_traced(bounce):
    net = SobolSampler(bounce(mirror_symmetric=True), ker.Bins(2), np.random.default_rng(1))
    with pytest.raises(InputError, match="at most 34359738368 rays, got 34359738369; use method 'monte-carlo'"):
        net.sampled(PARTS * 2**SOBOL_BITS + 1, symmetrise=False)
    assert net.sums.each == 0 and not net.sums.tables.any()


def test_mirror_images_are_worth_as_many_rays_again(bounce):
    exact, basis = ker.discretise(TEETH, ker.Bins(16)).symmetric, ker.Bins(16)
    halved, whole = (
        np.sqrt(np.mean([np.sum((sampled(law, basis, seed).symmetric - exact) ** 2) for seed in range(16)]))
        for law in (bounce(mirror_symmetric=True), bounce())
    )
    # nets of order 3/4
    assert whole / halved == pytest.approx(2.0**0.75, rel=0.15)


def test_counts_hold_every_ray_and_its_mirror_image(bounce):
    counts = sampled(bounce(mirror_symmetric=True), ker.Bins(16), 0).counts
    assert counts.sum() == 2 * 4096 and np.array_equal(counts, counts[::-1, ::-1])


def test_a_basis_without_the_symmetry_takes_rays_from_both_sides(bounce):
    basis = ker.Bins(np.array([0.0, 0.5, 1.7, np.pi]))
    exact = ker.discretise(TEETH, basis).symmetric
    found = sampled(bounce(mirror_symmetric=True), basis, 1)
    assert found.counts.sum() == 4096
    assert np.linalg.norm(found.symmetric - exact) < 2.0 * float(found.error)
