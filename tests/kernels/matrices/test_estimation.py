"""Kernels from a user's own pairs of angles."""

from __future__ import annotations

import numpy as np
import pytest

from asperity import kernels as ker

LAW = ker.TriangularTeethLaw(1.1)


def pairs(number: int, seed: int, invariant: bool = True) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    theta = ker.SINE.sample(number, rng) if invariant else np.pi * rng.beta(1.2, 1.6, number)
    return theta, LAW.sample(theta, rng)


def test_rows_are_fractions_of_the_counts() -> None:
    theta, image = pairs(5000, 0)
    found = ker.estimate(theta, image, ker.Bins(6))
    expected = np.zeros((6, 6), dtype=int)
    for one, other in zip(np.floor(3 - 3 * np.cos(theta)), np.floor(3 - 3 * np.cos(image)), strict=True):
        expected[int(one), int(other)] += 1
    assert np.array_equal(found.counts, expected)
    assert np.abs(found.array - expected / expected.sum(axis=1, keepdims=True)).max() < 1e-15
    assert found.stochastic_defect() < 1e-15 and found.samples == 5000


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


def test_pairs_of_an_irreversible_law_give_a_large_z_score() -> None:
    rng = np.random.default_rng(3)
    theta = np.pi * rng.beta(1.2, 1.6, 20_000)
    fraction = np.mod(ker.SINE.cdf(theta) + 0.1 + 0.3 * rng.random(theta.size), 1.0)
    found = ker.estimate(theta, ker.SINE.quantile(np.clip(fraction, 1e-12, 1 - 1e-12)), ker.Bins(12), symmetrise=True)
    assert found.symmetry_defect().z_score > 10.0
    assert np.abs(found.flux - found.flux.T).max() < 1e-17


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
