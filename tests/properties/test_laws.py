"""Properties of every law: mass, balance, mirror images, frames; samples and branches as `apply` says."""

import math

import numpy as np
import pytest

from asperity import kernels as ker
from asperity.errors import InputError

EPS = float(np.finfo(float).eps)
THETA = np.array([0.07, 0.3, 0.9, 1.4, 1.58, 2.1, 2.6, 3.05])
EXTREME = np.array([1e-12, 1e-9, 1e-5, 0.3, 1.5, 2.8, math.pi - 1e-5, math.pi - 1e-9, math.pi - 1e-12])
# Rows that jump with theta where a rule in theta does not: errors of the first order in the width of its intervals.
JUMPS = {
    "product of matrices": 1e-2,
    "product of isometries": 1e-2,
    "mushrooms": 1e-2,
    "rays alone": 1e-2,
    "rays and their mirror images": 1e-2,
    "product": 1e-3,
    "involution": 1e-4,
    "traced wall": 1e-6,
    "least resistance": 1e-6,
    # drawn rows, of many angles here
    "facets diffuse in part": 5e-3,
}
# Means over a drawn row of 4096 angles, by 4.5 standard deviations of a function of size 1.
DRAWN = {"facets diffuse in part": 4.5 / 64.0}


def f(angle: np.ndarray) -> np.ndarray:
    return np.exp(0.7 * np.cos(angle)) * np.cos(angle)


def g(angle: np.ndarray) -> np.ndarray:
    return np.sin(2.3 * angle) + angle**2


def test_probabilities_add_up_to_one_down_to_grazing(law: ker.Law) -> None:
    # of traced rays at smaller angles some end at tips
    angles = EXTREME[2:-2] if isinstance(law, ker.WallLaw | ker.MushroomLaw) else EXTREME
    assert np.abs(law.apply(np.ones_like, angles) - 1.0).max() <= 4 * EPS
    drawn = law.sample(np.repeat(angles, 20), rng=0)
    assert np.all((drawn > 0.0) & (drawn < math.pi))


def test_images_and_samples_have_the_shapes_of_their_arguments(law: ker.Law) -> None:
    assert law.sample([], rng=0).shape == (0,)
    assert law.apply(np.cos, np.empty((3, 0))).shape == (3, 0)
    assert law.apply(ker.Legendre(4).evaluate, np.full((2, 3), 1.0)).shape == (2, 3, 4)
    assert law.sample(1.0, rng=0).shape == ()


def test_adjoints_pass_to_the_other_side_and_the_measure_is_kept(law: ker.Law, request) -> None:
    own, _ = law.breakpoints(400)
    angle, weight = ker.SINE.quadrature(np.unique([0.0, *own, *np.linspace(0.1, 3.0, 30), math.pi]), 8)
    allowed = JUMPS.get(request.node.callspec.params["law"], 1e-10)
    there, back = weight @ (f(angle) * law.apply(g, angle)), weight @ (g(angle) * law.adjoint().apply(f, angle))
    assert abs(there - back) < allowed
    assert abs(weight @ law.apply(g, angle) - weight @ g(angle)) < allowed
    assert law.adjoint() is law or not law.reversible


def test_mirrored_angles_have_mirrored_images_where_a_law_says_so(law: ker.Law, request) -> None:
    there, back = law.apply(g, math.pi - THETA), law.apply(lambda angle: g(math.pi - angle), THETA)
    if law.mirror_symmetric is not None:
        # the probability of an entry point changes by its rounding; g has the size 10
        allowed = 10.0 * DRAWN.get(request.node.callspec.params["law"], 2e-9)
        assert (np.abs(there - back).max() < allowed) == law.mirror_symmetric


def test_the_other_frame_turns_outgoing_angles_over_and_is_undone_by_itself(law: ker.Law) -> None:
    turned = law.in_specular_frame()
    assert {law.frame, turned.frame} == {"paper", "specular"}
    expected = law.apply(lambda angle: g(math.pi - angle), THETA)
    assert np.allclose(turned.apply(g, THETA), expected, rtol=0.0, atol=1e-14)
    assert np.allclose(turned.in_specular_frame().apply(g, THETA), law.apply(g, THETA), rtol=0.0, atol=1e-14)


def test_samples_follow_expectations_and_distributions_and_depend_on_the_generator_alone(law: ker.Law, request) -> None:
    rng, number, edges = np.random.default_rng(5), 10_000, np.linspace(0.0, math.pi, 8)
    drawn_row = DRAWN.get(request.node.callspec.params["law"], 0.0)
    for theta in (0.3, 1.4, 2.6):
        drawn = law.sample(np.full(number, theta), rng)
        for function in (np.cos, g, lambda a: np.cos(5.0 * a)):
            value = function(drawn)
            spread = value.std() / math.sqrt(number)
            assert (
                abs(value.mean() - float(law.apply(function, theta))) <= 4.5 * spread + drawn_row * value.std() + 5e-5
            )
        masses = law.conditionals(theta, degree=0, edges=edges[1:-1]).masses(edges)[0]
        assert masses.sum() == pytest.approx(1.0, abs=1e-14)
        below = np.append(0.0, np.cumsum(masses))
        counted = np.mean(drawn[:, None] < edges, axis=0)
        deviation = np.sqrt(below * np.maximum(1.0 - below, 0.0))
        assert np.all(np.abs(counted - below) <= (4.5 / math.sqrt(number) + drawn_row) * deviation + 1e-3)
    assert np.array_equal(law.sample(THETA, rng=7), law.sample(THETA, rng=7))


def test_branches_and_isometry_tables_are_merged_and_act_like_the_law(law: ker.Law) -> None:
    table = law.isometry_table()
    try:
        pairs = [law.branches(THETA)]
    except InputError as refusal:
        assert "not known to be a mixture" in str(refusal) and table is None
        return
    for probability, outgoing in pairs + ([] if table is None else [table.branches(THETA)]):
        assert probability.min() >= 0.0 and probability.shape == outgoing.shape
        assert np.allclose(probability.sum(axis=-1), 1.0, rtol=0.0, atol=1e-14)
        assert np.allclose((probability * g(outgoing)).sum(axis=-1), law.apply(g, THETA), rtol=0.0, atol=1e-12)
    for row, angle in zip(*pairs[0], strict=True):
        assert np.all(np.diff(np.sort(angle[row > 0.0])) > 1e-13)
    assert table is None or table.mass() == pytest.approx(1.0, abs=1e-14)


def test_expectations_of_polynomials_are_those_of_apply(law: ker.Law) -> None:
    smooth = ker.Legendre(6)
    found = law.conditionals(THETA, 1e-8, smooth.size)
    wrong = np.abs(found.in_basis(smooth) - law.apply(smooth.evaluate, THETA)).max(axis=1)
    # traced means have errors of their own
    assert np.all(wrong <= np.where(np.isnan(found.error), 1e-12, found.error + 1e-8))


def test_rows_of_isometries_are_smooth_between_breakpoints(law: ker.Law) -> None:
    own, left_out = law.breakpoints(300)
    if law.isometry_table() is None:
        return
    edges = np.unique([0.0, *own, *np.linspace(0.1, 3.0, 7), math.pi])
    rules = [ker.SINE.quadrature(edges, order) for order in (8, 16)]
    sums = [(weight * law.apply(g, angle)).reshape(edges.size - 1, -1).sum(axis=1) for angle, weight in rules]
    assert np.abs(sums[0] - sums[1]).max() < 1e-12 + left_out
