"""Properties of the matrix of every law in every basis: mass, balance, mirror images, frames, all methods alike."""

import numpy as np

from asperity import kernels as ker
from asperity.errors import InputError
from asperity.kernels.bases.assembly import is_mirror_symmetric, reflection_matrix

ROUNDING = 1e-11


def test_constants_are_kept_on_both_sides_and_reversible_laws_have_symmetric_matrices(law, basis, matrix) -> None:
    error = 0.0 if matrix.method == "exact" else float(matrix.error)
    assert np.linalg.norm(matrix.symmetric @ basis.constant - basis.constant) <= ROUNDING
    assert np.linalg.norm(basis.constant @ matrix.symmetric - basis.constant) <= error + ROUNDING
    if law.reversible:
        assert np.linalg.norm(matrix.symmetric - matrix.symmetric.T) <= 2.0 * error + ROUNDING
    assert matrix.law == repr(law) and matrix.frame == law.frame


def test_mirror_images_of_functions_have_mirrored_images(law, basis, matrix) -> None:
    if law.mirror_symmetric and is_mirror_symmetric(basis):
        flip = reflection_matrix(basis)
        miss = np.linalg.norm(flip @ matrix.symmetric @ flip.T - matrix.symmetric)
        assert miss <= 2.0 * float(matrix.error) + ROUNDING


def test_the_other_frame_of_a_law_is_that_of_its_matrix(law, basis, matrix) -> None:
    if is_mirror_symmetric(basis):
        direct = ker.discretise(law.in_specular_frame(), basis, tolerance=1e-3, samples=2**13, rng=5)
        turned = matrix.in_specular_frame()
        assert direct.frame == turned.frame != law.frame
        assert np.linalg.norm(direct.symmetric - turned.symmetric) <= direct.error.value + turned.error.value + ROUNDING


def test_entries_are_means_of_products_with_images(law, basis, matrix) -> None:
    """<e_i, P e_j> by a rule in theta that shares no method, for functions that have no jumps."""
    if isinstance(basis, ker.Legendre):
        own, left_out = law.breakpoints(400)
        angle, weight = ker.SINE.quadrature(np.unique([0.0, *own, *np.linspace(0.1, 3.0, 60), np.pi]), 4)
        entries = basis.evaluate(angle).T @ (weight[:, None] * law.apply(basis.evaluate, angle))
        # rows whose jumps are not known are integrated across them
        rule = 1e-7 + (20.0 * left_out if left_out < 1.0 else 1e-2)
        assert np.linalg.norm(entries - matrix.symmetric) <= float(matrix.error) + rule


def test_a_law_has_the_same_matrix_by_every_method_that_it_has(law: ker.Law) -> None:
    bins = ker.Bins(4)
    best = ker.discretise(law, bins, tolerance=1e-3)
    for method in ("exact", "quadrature", "qmc", "monte-carlo"):
        try:
            found = ker.discretise(law, bins, method, 1e-3, samples=2**13, rng=5)
        except InputError as refusal:
            assert "method" in str(refusal)
            continue
        assert method in found.method
        # a sampled error is a half width of 95 %, and here are many cases; of what is rarer than 3 rays it knows
        # nothing
        unseen = 3.0 / found.samples if found.samples else 0.0
        assert np.linalg.norm(found.symmetric - best.symmetric) <= 3.0 * found.error.value + best.error.value + unseen
