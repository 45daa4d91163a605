"""Laws of surfaces rough in two directions: beside grooves, mirror images, reversals and invariants of groups."""

import math
import re

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.errors import AccuracyError
from asperity.errors import InputError

HEIGHTS = np.array([0, 0.2, 0.5, 0.4, 0.9, 0.3, 0.1, 0.35, 0.6, 0.2, 0.15, 0.5, 0.1, 0.4, 0.7, 0.3])
PROFILE = ker.WallLaw(geo.Wall.from_profile(np.arange(17) / 8.0, np.append(HEIGHTS, HEIGHTS[0]), seam="step"))
GROOVES = geo.Surface(HEIGHTS[:, None], 1.0 / 8.0)
CHIRAL = geo.Surface(np.array([[3, 2, 1], [2, 1, 2], [3, 0, 1]]) * 0.5)
NOISE = geo.Surface(np.random.default_rng(4).standard_normal((9, 7)) * 0.5, (1.0, 1.3))
LARGEST_Z = 4.5


def cosine_law(rng, count):
    radius, phi = np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    return np.column_stack([radius * np.cos(phi), radius * np.sin(phi), -np.sqrt(1 - radius**2)])


def on_disc(law, degree=4, samples=2**16, **more):
    return ker.discretise(law, ker.Zernike(degree), samples=samples, tolerance=1e-9, **more)


def test_a_flat_surface_is_the_identity():
    for orientation in ("random", 0.4):
        matrix = on_disc(ker.SurfaceLaw(geo.Surface([[1.0]]), orientation))
        # the replicates integrate products of polynomials; the constants are exact
        assert np.linalg.norm(matrix.symmetric - np.eye(15)) < matrix.error.value
        assert np.array_equal(matrix.symmetric[0], np.eye(15)[0])


def test_grooves_of_random_direction_have_the_matrix_of_their_planar_law():
    wanted = ker.discretise(ker.HemisphereLaw(PROFILE), ker.Zernike(8), tolerance=1e-7)
    found = on_disc(ker.SurfaceLaw(GROOVES), 8, 2**18)
    assert np.linalg.norm(found.symmetric - wanted.symmetric) < found.error.value < 0.02
    block = ker.SurfaceLaw(GROOVES).matrix(3, 1, samples=2**18)
    planar = ker.HemisphereLaw(PROFILE).matrix(3, 1, tolerance=1e-7)
    assert block.symmetric.dtype == complex and planar.symmetric.dtype == float
    assert np.linalg.norm(block.symmetric - planar.symmetric) < block.error.value < 0.01


@pytest.mark.parametrize("orientation", [0.0, 0.7, 2.0])
def test_grooves_of_a_fixed_direction_have_signs_and_frame_of_their_planar_law(orientation):
    # the x axis of the surface lies across its grooves
    wanted = ker.discretise(ker.HemisphereLaw(PROFILE, orientation + np.pi / 2), ker.Zernike(4), tolerance=1e-7)
    found = on_disc(ker.SurfaceLaw(GROOVES, orientation), samples=2**17)
    assert np.linalg.norm(found.symmetric - wanted.symmetric) < found.error.value < 0.03
    # the profile leans, so that neither the transposed matrix nor the other way round is the same
    for wrong in (found.symmetric.T, on_disc(ker.SurfaceLaw(GROOVES, orientation - np.pi), samples=2**17).symmetric):
        assert np.linalg.norm(wrong - wanted.symmetric) > 10 * found.error.value
    # P J is symmetric, where J turns by half a turn
    product = found.symmetric * (-1.0) ** found.basis.degrees
    assert np.array_equal(product, product.T)


def test_a_chiral_surface_has_complex_blocks_conjugate_to_those_of_its_mirror_image():
    left, right = (
        ker.SurfaceLaw(geo.Surface(z)).matrix(3, 1, samples=2**19) for z in (CHIRAL.heights, CHIRAL.heights.T)
    )
    error = max(left.error.value, right.error.value)
    for block in (left, right):
        np.testing.assert_allclose(block.symmetric, block.symmetric.conj().T, atol=1e-15)
    assert np.abs(left.symmetric - right.symmetric.conj()).max() < error
    assert left.symmetric[0, 1].imag < -5 * error and right.symmetric[0, 1].imag > 5 * error


def test_the_complex_block_turns_the_velocities_of_rays():
    rng = np.random.default_rng(1)
    incoming = cosine_law(rng, 400_000)
    outgoing = ker.SurfaceLaw(CHIRAL).sample(incoming, rng=rng)
    z, image = incoming[:, 0] + 1j * incoming[:, 1], outgoing[:, 0] + 1j * outgoing[:, 1]
    # f_{3,1} = sqrt(4) (3 r^2 - 2) z and f_{1,1} = sqrt(2) z: E conj(f_{1,1}(v)) f_{3,1}(v')
    values = np.sqrt(8.0) * z.conj() * (3.0 * np.abs(image) ** 2 - 2.0) * image
    block = ker.SurfaceLaw(CHIRAL).matrix(3, 1, samples=2**19)
    noise = np.std(values.imag) / math.sqrt(values.size)
    assert abs(values.imag.mean() - block.symmetric[0, 1].imag) < 4 * noise + block.error.value
    assert values.imag.mean() < -10 * noise


@pytest.mark.parametrize("law", [
    ker.SurfaceLaw(NOISE), ker.SurfaceLaw(NOISE, 0.9), ker.SurfaceLaw(CHIRAL),
    0.3 * ker.SurfaceLaw(NOISE, 0.9) @ ker.HemisphereLaw(ker.lambertian()) + 0.7 * ker.SurfaceLaw(CHIRAL),
], ids=str)  # fmt: skip
def test_samples_keep_the_cosine_law_the_speed_and_what_the_matrix_says(law):
    rng, count = np.random.default_rng(2), 60_000
    incoming = cosine_law(rng, count)
    outgoing = law.sample(2.0 * incoming, rng=rng) / 2.0
    np.testing.assert_allclose(np.sum(outgoing**2, axis=1), 1.0, rtol=1e-12)
    assert np.all(outgoing[:, 2] > 0)
    matrix = on_disc(law, 3, 2**18)
    before, after = (matrix.basis.evaluate(velocity[:, :2]) for velocity in (incoming, outgoing))
    kept = after[:, 1:].mean(axis=0) * math.sqrt(count)
    assert np.abs(kept).max() < LARGEST_Z
    mean, square = before.T @ after / count, (before**2).T @ after**2 / count
    noise = np.sqrt(np.maximum(square - mean**2, 1e-24) / count)
    assert (np.abs(mean - matrix.symmetric) < LARGEST_Z * noise + matrix.error.value).all()
    assert np.abs(mean - matrix.symmetric)[1:, 1:].mean() < 2 * (noise[1:, 1:].mean() + matrix.error.value / 9)


def test_mixed_products_are_those_of_the_planar_law():
    H, S = ker.HemisphereLaw(PROFILE), ker.SurfaceLaw(GROOVES)
    mixed, planar = 0.4 * S @ H + 0.6 * H, 0.4 * H @ H + 0.6 * H
    for order in (0, 1):
        found, wanted = mixed.matrix(4, order, samples=2**17), planar.matrix(4, order, tolerance=1e-7)
        assert np.linalg.norm(found.symmetric - wanted.symmetric) < 2e-3 < found.error.value
    whole = on_disc(mixed, 3, 2**17)
    assert np.linalg.norm(whole.symmetric - ker.discretise(planar, ker.Zernike(3), tolerance=1e-7).symmetric) < 5e-3
    assert whole.error.value >= 2e-4


def test_what_is_known_of_reversibility():
    S, T = ker.SurfaceLaw(NOISE), ker.SurfaceLaw(NOISE, 0.3)
    assert S.reversible and S.rotation_invariant and (S @ S).reversible
    assert T.reversible is None and not T.rotation_invariant
    assert (S @ ker.HemisphereLaw(ker.lambertian())).reversible is None
    assert (S @ ker.HemisphereLaw(ker.lambertian()) @ S).reversible


def test_an_egg_carton_of_45_degrees_keeps_the_invariants_of_its_group():
    # its facets reflect in (+-1, +-1, sqrt 2)/2: a group of order 24, which keeps polynomials of degrees 0, 4 and 6
    carton = geo.Surface(np.add.outer([0.0, 1.0], [0.0, 1.0]) / math.sqrt(2.0))
    matrix = on_disc(ker.SurfaceLaw(carton, 0.0), 6, 2**17)
    values = np.sort(np.linalg.eigvalsh(matrix.symmetric * (-1.0) ** matrix.basis.degrees))[::-1]
    assert np.abs(values[:3] - 1.0).max() < 1e-4 and values[3] < 0.98


def test_the_law_does_not_depend_on_translation_scale_or_position_of_the_axes():
    law = ker.SurfaceLaw(NOISE, 0.3)
    first = on_disc(law)
    moved = ker.SurfaceLaw(geo.Surface(np.roll(NOISE.heights, (2, 3), (0, 1)) + 5.0, NOISE.spacing), 0.3)
    larger = ker.SurfaceLaw(geo.Surface(NOISE.heights * 4.0, np.multiply(4.0, NOISE.spacing)), 0.3)
    half = geo.Surface(np.roll(NOISE.heights[::-1, ::-1], 1, (0, 1)), NOISE.spacing)
    turned = ker.SurfaceLaw(half, 0.3 + np.pi)
    for other in (moved, larger, turned):
        assert np.linalg.norm(on_disc(other).symmetric - first.symmetric) < 2 * first.error.value


def test_errors_of_95_percent_hold():
    truth = on_disc(ker.SurfaceLaw(NOISE), 2, 2**19, rng=99)
    within = 0
    for seed in range(40):
        found = on_disc(ker.SurfaceLaw(NOISE), 2, 2**12, rng=seed)
        within += np.linalg.norm(found.symmetric - truth.symmetric) <= found.error.value
    # at most 6 of 40 fail with a probability of .996
    assert within >= 34


def test_a_tolerance_ends_the_sampling():
    rough = on_disc(ker.SurfaceLaw(NOISE), 2)
    loose = ker.discretise(ker.SurfaceLaw(NOISE), ker.Zernike(2), tolerance=0.1)
    assert loose.samples == 2**15 < rough.samples and loose.error.value <= 0.1
    better = ker.discretise(ker.SurfaceLaw(NOISE), ker.Zernike(2), tolerance=0.4 * loose.error.value)
    assert 2**15 < better.samples < 2**20 and better.error.value <= 0.4 * loose.error.value


def test_checkpoints_and_workers_leave_every_bit(tmp_path):
    law, basis = ker.SurfaceLaw(NOISE), ker.Zernike(3)
    plain = ker.discretise(law, basis, "qmc", samples=2**17, rng=3)
    stored = ker.discretise(law, basis, "qmc", samples=2**17, rng=3, checkpoint=tmp_path / "rays")
    again = ker.discretise(law, basis, "qmc", samples=2**17, rng=3, checkpoint=tmp_path / "rays")
    assert np.array_equal(plain.symmetric, stored.symmetric) and np.array_equal(plain.symmetric, again.symmetric)
    with pytest.raises(InputError, match="checkpoint"):
        ker.discretise(ker.SurfaceLaw(CHIRAL), basis, "qmc", samples=2**17, rng=3, checkpoint=tmp_path / "rays")


def test_rays_that_do_not_escape_end_in_an_error():
    class Swallows(ker.SurfaceLaw):
        def exit_velocities(self, entry, incoming):
            outgoing, escaped = super().exit_velocities(entry, incoming)
            return outgoing, escaped & (entry[:, 0] > 0.01)

    with pytest.raises(AccuracyError, match=re.escape("of a surface that of surface.trace")):
        on_disc(Swallows(NOISE))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ker.SurfaceLaw([[0.0, 1.0]]), "surface: expected a Surface such as geo.Surface"),
        (lambda: ker.SurfaceLaw(NOISE, 90), "orientation: expected an angle in radians, at most 2 pi, got 90.0"),
        (lambda: ker.SurfaceLaw(NOISE, "x"), "orientation: expected an angle in radians or 'random', got 'x'"),
        (lambda: ker.SurfaceLaw(NOISE, math.nan), "orientation: expected finite"),
        (lambda: ker.SurfaceLaw(NOISE).sample([0.0, 0.0, 1.0]), "velocity: expected incoming ones"),
        (lambda: ker.HemisphereLaw(PROFILE).sample([0.0, 0.0, 1.0]), "velocity: expected incoming ones"),
        (lambda: ker.discretise(ker.SurfaceLaw(NOISE), ker.Bins(4)), "basis: expected a Zernike"),
        (lambda: on_disc(ker.SurfaceLaw(NOISE), method="exact"), "method: expected 'auto', 'qmc' or 'by_sobol_rays'"),
        (lambda: on_disc(ker.SurfaceLaw(NOISE, 0.1), symmetrise=True), "symmetrise: .* is not known to be reversible"),
        (lambda: on_disc(ker.SurfaceLaw(NOISE), samples=3), "samples: expected a whole number of at least 16"),
        (lambda: ker.SurfaceLaw(NOISE, 0.1).matrix(2, 1), "a fixed direction couples different orders"),
        (lambda: ker.SurfaceLaw(NOISE) @ PROFILE, "unsupported operand"),
    ],
)  # fmt: skip
def test_bad_input_ends_in_one_clear_error(call, message):
    with pytest.raises((InputError, TypeError), match=message):
        call()
