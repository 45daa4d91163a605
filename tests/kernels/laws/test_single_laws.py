"""Ideal laws, Henyey-Greenstein, laws with a density, involutions and laws of matrices."""

import dataclasses
import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import legendre

from asperity import kernels as ker
from asperity.errors import AccuracyError, InputError
from asperity.estimates import Estimate
from asperity.kernels.bases.polynomials import Directions
from asperity.kernels.laws.density import HenyeyGreensteinLaw

THETA = np.array([1e-12, 1e-4, 0.2, 0.9, math.pi / 2, 2.2, 3.0, math.pi - 1e-4, math.pi - 1e-12])
EXACT = Estimate(0.0, 0.0, "bound", "given")


def polynomial(degree: int):
    coefficients = np.zeros(degree + 1)
    coefficients[degree] = 1.0
    return lambda theta: legendre.legval(np.cos(theta), coefficients)


def assert_z(value: np.ndarray, mean: float) -> None:
    spread = value.std() / math.sqrt(value.size)
    assert abs(value.mean() - mean) < 4.5 * spread + 1e-12


# ---- ideal laws -------------------------------------------------------------------------------------------------
def test_ideal_laws_do_what_their_names_say() -> None:
    rng = np.random.default_rng(1)
    assert np.array_equal(ker.retroreflection().sample(THETA, rng), THETA)
    assert np.allclose(ker.specular().sample(THETA, rng), math.pi - THETA, rtol=0.0, atol=1e-15)
    assert np.allclose(ker.lambertian().apply(np.cos, THETA), 0.0, atol=1e-14)
    drawn = ker.lambertian().sample(np.full(20_000, 0.3), rng)
    assert_z(np.cos(drawn), 0.0)
    assert_z(np.cos(drawn) ** 2, 1.0 / 3.0)


# ---- Henyey-Greenstein --------------------------------------------------------------------------------------------
@pytest.mark.parametrize("g", [-0.7, -0.2, 0.0, 0.4, 0.8])
def test_henyey_greenstein_density_is_its_legendre_series(g: float) -> None:
    theta, out = np.array([0.05, 1.0, 2.5])[:, None], np.linspace(0.01, 3.1, 40)
    series = sum(
        0.5 * (2 * degree + 1) * g**degree * polynomial(degree)(theta) * polynomial(degree)(out)
        for degree in range(250)
    )
    expected = series * np.sin(out)
    assert np.allclose(ker.henyey_greenstein(g).density(theta, out), expected, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("g", [1.0 - 1e-6, 1.0 - 1e-10, -(1.0 - 1e-8)])
def test_narrow_henyey_greenstein_laws_stay_resolved(g: float) -> None:
    law = ker.henyey_greenstein(g)
    # g close to 1 is close to retroreflection, to -1 to specular reflection: <P_1, P P_1> = g
    assert np.allclose(law.apply(np.cos, THETA), g * np.cos(THETA), rtol=0.0, atol=1e-12)
    near = law.sample(np.full(1000, 1.0), np.random.default_rng(3))
    target = 1.0 if g > 0 else math.pi - 1.0
    assert np.median(np.abs(near - target)) < 10.0 * (1.0 - abs(g))


def test_henyey_greenstein_keeps_grazing_angles_apart() -> None:
    drawn = ker.henyey_greenstein(1.0 - 1e-12).sample(np.full(1000, 1e-10), np.random.default_rng(5))
    assert np.all(drawn > 0.0)
    assert np.median(np.abs(drawn - 1e-10)) < 1e-11


def test_henyey_greenstein_laws_know_their_eigenvalues() -> None:
    assert ker.henyey_greenstein(0.5) == HenyeyGreensteinLaw(0.5)
    assert [ker.henyey_greenstein(-0.5).eigenvalue(degree) for degree in range(3)] == [1.0, -0.5, 0.25]


# ---- densities ----------------------------------------------------------------------------------------------------
def tilted(theta: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Preserves sin(theta) d theta, is not reversible: 1 + P_1(theta) P_2(theta') / 2."""
    return (1.0 + 0.5 * polynomial(1)(theta) * polynomial(2)(out)) * ker.SINE.density(out)


def test_a_density_law_measures_its_symmetries() -> None:
    even = ker.DensityLaw(lambda a, b: (1.0 + 0.5 * np.cos(a) * np.cos(b)) * ker.SINE.density(b))
    assert (even.reversible, even.mirror_symmetric) == (True, True)
    assert even.adjoint() is even
    law = ker.DensityLaw(tilted)
    assert (law.reversible, law.mirror_symmetric) == (False, False)
    assert law.sampling_error < 1e-5


def stepped(theta: np.ndarray, out: np.ndarray) -> np.ndarray:
    """Twice as dense below 1 as above it."""
    return np.where(out < 1.0, 2.0, 1.0) * ker.SINE.density(out) / (1.5 - 0.5 * math.cos(1.0)) + 0.0 * theta


def test_densities_that_jump_are_refused_with_the_defect() -> None:
    with pytest.raises(AccuracyError, match="breakpoints") as info:
        ker.DensityLaw(stepped)
    assert 1e-7 < info.value.defect < 1e-2


@pytest.mark.parametrize("end", [0.9, 1.0, 1.3])
def test_jumps_that_are_mirror_images_do_not_hide_each_other(end: float) -> None:
    """The two errors of quadrature have opposite signs, so the density integrates to 1 by any symmetric rule."""

    def odd(angle: np.ndarray) -> np.ndarray:
        return np.where(angle < end, 1.0, 0.0) - np.where(angle > np.pi - end, 1.0, 0.0)

    def density(theta: np.ndarray, out: np.ndarray) -> np.ndarray:
        return ker.SINE.density(out) * (1.0 + 0.8 * odd(theta) * odd(out))

    with pytest.raises(AccuracyError, match="breakpoints"):
        ker.DensityLaw(density)
    found = ker.DensityLaw(density, [end, np.pi - end]).conditionals([0.3])
    assert abs(found.mean(np.cos)[0] - 0.4 * math.sin(end) ** 2) <= found.error[0] + 1e-15 < 1e-13


def test_breakpoints_let_densities_jump() -> None:
    fraction = float(ker.SINE.mass(0.0, 1.0))
    law = ker.DensityLaw(stepped, breakpoints=[1.0])
    assert abs(float(law.apply(lambda a: a < 1.0, 0.5)) - 2.0 * fraction / (1.0 + fraction)) < 1e-14
    drawn = law.sample(np.full(20_000, 0.5), np.random.default_rng(2))
    assert_z((drawn < 1.0).astype(float), 2.0 * fraction / (1.0 + fraction))


def test_laws_are_immutable() -> None:
    laws = ker.DensityLaw(tilted), ker.specular(), ker.henyey_greenstein(0.1)
    for law, name in zip(laws, ("sampling_error", "retro", "g"), strict=True):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(law, name, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        ker.MatrixLaw([[1.0]]).array[0, 0] = 2.0


# ---- matrices -------------------------------------------------------------------------------------------------------
@settings(max_examples=25, deadline=None)
@given(size=st.integers(1, 12), seed=st.integers(0, 10**6))
def test_a_matrix_law_moves_bins_as_its_matrix_says(size: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = rng.random((size, size))
    matrix /= matrix.sum(axis=1, keepdims=True)
    law = ker.MatrixLaw(matrix)
    centres = ker.SINE.quantile((np.arange(size) + 0.5) / size)
    for column in range(size):
        low, high = law.edges[column], law.edges[column + 1]
        inside = law.apply(lambda a, low=low, high=high: (a >= low) & (a < high), centres)
        assert np.allclose(inside, matrix[:, column], rtol=0.0, atol=1e-14)
    assert np.allclose(law.edges, np.arccos(1.0 - 2.0 * np.arange(size + 1) / size), atol=1e-12)


def on_bins(array, edges) -> ker.KernelMatrix:
    basis = ker.Bins(np.array(edges))
    root = np.sqrt(basis.weights)
    return ker.KernelMatrix(root[:, None] * np.array(array) / root, basis, EXACT)


def random_matrix_law(size: int, seed: int = 4) -> ker.MatrixLaw:
    """On unequal bins, with a tenth of the entries."""
    rng = np.random.default_rng(seed)
    array = rng.random((size, size)) * (rng.random((size, size)) < 0.1) + np.eye(size)
    edges = np.concatenate(([0.0], np.sort(rng.uniform(0.0, math.pi, size - 1)), [math.pi]))
    return ker.MatrixLaw(on_bins(array / array.sum(axis=1, keepdims=True), edges))


BASES = [
    ker.Legendre(12), ker.Panels([0.0, 0.4, 1.7, math.pi], 3), ker.Panels(np.linspace(0.0, math.pi, 50), 1),
    ker.Bins(7), ker.Bins(60), Directions(),
]  # fmt: skip


@pytest.mark.parametrize("basis", BASES, ids=repr)
@pytest.mark.parametrize("kind", ["alone", "mirrored", "squared", "mixed"])
def test_the_matrix_of_a_law_on_bins_is_that_of_a_rule_between_all_edges(kind, basis) -> None:
    law = random_matrix_law(40)
    edges = np.concatenate((law.edges, basis.edges, math.pi - basis.edges))
    angle, weight = ker.SINE.quadrature(np.unique(edges), 16)
    cell = np.searchsorted(law.edges, angle) - 1
    after = law.array[cell][:, cell] * (weight / np.bincount(cell, weight)[cell])
    values, mirrored = basis.evaluate(angle), basis.evaluate(math.pi - angle)
    whole, images = {
        "alone": (law, after @ values),
        "mirrored": (law @ ker.specular(), after @ mirrored),
        "squared": (law @ law, after @ (after @ values)),
        "mixed": (0.25 * law + 0.75 * ker.specular(), 0.25 * after @ values + 0.75 * mirrored),
    }[kind]
    exact = (weight[:, None] * values).T @ images
    found = ker.discretise(whole, basis)
    assert found.method == "exact" and np.linalg.norm(found.symmetric - exact) <= float(found.error) < 1e-11


def test_two_thousand_states_take_seconds() -> None:
    law = random_matrix_law(2000)
    begun = time.process_time()
    found, matrix = ker.resistance(law), ker.discretise(law, ker.Legendre(16))
    means = law.apply(lambda a: np.stack([np.cos(a), np.sin(a)], axis=-1), 0.5 * (law.edges[1:] + law.edges[:-1]))
    distance = ker.distance(law, ker.lambertian(), kind="pseudometric")
    # it took minutes when every incoming angle was integrated over all bins
    assert time.process_time() - begun < 30.0
    low, high = law.edges[:-1], law.edges[1:]
    masses = 0.5 * (np.cos(low) - np.cos(high))
    cosine = 0.25 * (np.sin(high) ** 2 - np.sin(low) ** 2) / masses
    sine = 0.25 * (high - low - 0.5 * (np.sin(2.0 * high) - np.sin(2.0 * low))) / masses
    np.testing.assert_allclose(means, law.array @ np.stack([cosine, sine], axis=-1), atol=1e-8)
    exact = 0.75 * (1.0 + masses @ (cosine * (law.array @ cosine) + sine * (law.array @ sine)))
    assert abs(found.value - exact) <= found.error + 1e-9 and found.error < 1e-10
    assert float(matrix.error) < 1e-10 and distance.error < 1e-3


def test_a_matrix_law_measures_reversibility_with_the_masses_of_its_bins() -> None:
    # masses 1/4 and 3/4: detailed balance needs P[0, 1] = 3 P[1, 0]
    edges = [0.0, math.pi / 3, math.pi]
    assert ker.MatrixLaw(on_bins([[0.4, 0.6], [0.2, 0.8]], edges)).reversible is True
    assert ker.MatrixLaw(on_bins([[0.4, 0.6], [0.6, 0.4]], edges)).reversible is False
    assert ker.MatrixLaw(on_bins([[0.4, 0.6], [0.2, 0.8]], edges)).mirror_symmetric is None
    with pytest.raises(InputError, match=r"one that preserves sin.*its adjoint is not a law"):
        ker.MatrixLaw(on_bins([[0.4, 0.6], [0.6, 0.4]], edges)).adjoint()
