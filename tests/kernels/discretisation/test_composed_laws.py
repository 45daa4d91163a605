"""Matrices of composed laws: the algebra against the action on functions, and reported errors against references."""

import numpy as np
import pytest
from campaigns.errors.composed_laws import arcs, crevices, teeth
from campaigns.judges.reference_operators import Expression, exchanged, flip, identity, leaf, reference

from asperity import kernels as ker
from asperity import spectral as spec
from asperity.kernels.expectations.conditionals import Conditionals
from asperity.kernels.laws.structure import law_of, words_of

TEETH, CREVICES = ker.TriangularTeethLaw(0.7), ker.RectangularTeethLaw(0.8)
HG = ker.henyey_greenstein
CYCLE = ker.MatrixLaw([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
MIRROR, BACK = ker.specular(), ker.retroreflection()
THETA = np.linspace(0.07, 3.05, 4)


def smooth(angle: np.ndarray) -> np.ndarray:
    return np.exp(np.cos(angle)) + np.sin(2.0 * angle)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (BACK @ HG(0.6), 1),
        (MIRROR @ HG(0.6) @ TEETH @ MIRROR @ HG(0.5), 1),
        (CYCLE @ MIRROR @ TEETH @ MIRROR @ CYCLE, 1),
        (MIRROR @ CYCLE @ MIRROR, 1),
        ((HG(0.6).in_specular_frame() @ CYCLE.in_specular_frame()).in_specular_frame(), 1),
        (CYCLE @ ker.lambertian() @ HG(0.3) @ MIRROR, 1),
        (ker.maxwell(0.25) ** 2, 2),
        ((0.3 * TEETH + 0.7 * HG(0.4)) ** 2, 4),
        ((0.3 * TEETH + 0.7 * BACK) ** 5, 6),
        (0.5 * (MIRROR @ MIRROR) + 0.5 * CYCLE**0, 2),
    ],
    ids=repr,
)
def test_words_are_the_same_operator_as_the_law(law: ker.Law, words: int) -> None:
    found = words_of(law)
    assert found is not None and len(found) == words
    total = sum(weight * law_of(word).apply(smooth, THETA) for word, weight in found.items())
    # polynomials in place of the smooth images of densities
    assert np.abs(total - law.apply(smooth, THETA)).max() < 1e-8


def test_laws_without_effect_are_left_out_where_laws_are_composed() -> None:
    arc, diffuse = ker.CircularArcLaw(0.9), ker.lambertian()
    assert arc @ diffuse @ arc == diffuse @ TEETH @ diffuse == diffuse
    assert arc @ BACK == BACK @ arc == arc and BACK @ BACK == BACK
    mirrored = [law.in_specular_frame() for law in (arc, diffuse, BACK, MIRROR)]
    assert mirrored[0] @ mirrored[1] @ mirrored[2] == mirrored[1] and mirrored[3] @ mirrored[0] == mirrored[0]
    # whether a law preserves the measure is known of reversible ones only
    assert repr(arc @ diffuse @ arc @ CYCLE) == f"lambertian() @ {CYCLE!r}"


@pytest.mark.parametrize("frame", ["paper", "specular"])
def test_a_chain_of_rank_one_has_its_gap_exactly(frame: str) -> None:
    laws = [ker.CircularArcLaw(0.9), ker.lambertian(), ker.CircularArcLaw(0.9)]
    first, second, third = laws if frame == "paper" else [law.in_specular_frame() for law in laws]
    gap = spec.spectral_gap(first @ second @ third)
    assert gap.kind == "bound" and gap.error < 1e-14 and gap.value == pytest.approx(1.0, abs=gap.error)


def test_too_many_words_are_left_as_they_are() -> None:
    assert words_of((0.5 * TEETH + 0.5 * HG(0.4)) ** 6) is None


@pytest.mark.parametrize(
    "law", [HG(0.6) @ TEETH @ HG(0.6), CREVICES @ HG(0.7) @ CREVICES, (BACK @ HG(0.6)) ** 2], ids=repr
)
def test_palindromes_are_symmetric_for_spectral_tools(law: ker.Law) -> None:
    found = spec.spectrum(ker.discretise(law, ker.Legendre(64)))
    assert found.values[0] == pytest.approx(1.0, abs=1e-12) and found.gap > 0.0


def test_kinks_of_two_crevices_are_followed_far_towards_grazing_or_reported() -> None:
    # breakpoints without number near grazing on both sides of the product: no number of panels follows them
    both = crevices(2.5) @ crevices(1.3)
    exact, error = reference(both, ker.Bins(3))
    panels, isometries = (ker.discretise(both.law, ker.Bins(3), method=how) for how in ("quadrature", "exact"))
    assert error < 1e-9 and 1e-6 < np.linalg.norm(panels.symmetric - exact) < float(panels.error) < 1e-2
    assert np.linalg.norm(isometries.symmetric - exact) - error <= float(isometries.error) < 2e-7


@pytest.mark.parametrize(
    ("basis", "turned"), [(ker.Bins(5), False), (ker.Legendre(12), True), (ker.Panels([0.0, 1.0, np.pi], 1), False)]
)
def test_rectangular_teeth_several_times_have_the_errors_that_they_report(basis: ker.Basis, turned: bool) -> None:
    expression = crevices(1.7).power(3)
    expression = expression.turned() if turned else expression
    exact, error = reference(expression, basis)
    found = ker.discretise(expression.law, basis)
    assert error < 1e-14 and np.linalg.norm(found.symmetric - exact) <= float(found.error) < 1e-4


def test_the_reference_follows_the_kinks_of_arcs() -> None:
    exact, error = reference(arcs(0.8), ker.Bins(2))
    found = ker.discretise(ker.CircularArcLaw(0.8), ker.Bins(2))
    assert error < 1e-13 and np.linalg.norm(found.symmetric - exact) <= float(found.error) < 2e-14


class Known(ker.Law):
    """A map of which only conditional distributions are known: half of (0, pi) is turned round."""

    def _sample(self, theta: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        return exchanged(theta)

    def _conditionals(self, theta: np.ndarray, *_: object) -> Conditionals:
        return Conditionals.of_atoms(exchanged(theta)[:, None], np.ones((theta.size, 1)), 0.0)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("basis", [ker.Bins(7), ker.Panels([0.0, 0.4, 2.0, np.pi], 2)], ids=repr)
def test_errors_of_laws_known_by_their_conditional_distributions_hold(basis: ker.Basis, tolerance: float) -> None:
    exact = ker.discretise(ker.InvolutionLaw(exchanged), basis).symmetric
    found = ker.discretise(Known(), basis, tolerance=tolerance)
    assert 1e-14 < np.linalg.norm(found.symmetric - exact) <= float(found.error) <= tolerance


EDGES = np.array([0.0, 0.6, 1.2, 1.2 + 1e-4, 2.2, np.pi])
AT_GRAZING = np.array([0.0, 1e-3, 1.0, 2.0, np.pi - 1e-3, np.pi])
NARROW = {
    "bins": ker.Bins(EDGES),
    "panels": ker.Panels(EDGES, 3),
    "bins at grazing": ker.Bins(AT_GRAZING),
    "panels at grazing": ker.Panels(AT_GRAZING, 3),
    # here only the nodes matter
    "polynomials": ker.Legendre(64),
}


@pytest.mark.slow
@pytest.mark.parametrize("basis", NARROW.values(), ids=NARROW)
@pytest.mark.parametrize(
    "expression",
    [leaf(BACK, identity), leaf(MIRROR, flip), teeth(0.7), teeth(0.7).power(2)],
    ids=lambda expression: repr(expression.law),
)
def test_errors_hold_where_the_rounding_of_angles_is_large(expression: Expression, basis: ker.Basis) -> None:
    found = ker.discretise(expression.law, basis)
    exact, uncertain = reference(expression, basis)
    assert found.method == "exact" and found.error.kind == "bound"
    assert np.linalg.norm(found.symmetric - exact) <= float(found.error) + uncertain < 1e-8
