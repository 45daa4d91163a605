"""The algebra of laws: what sums, compositions, powers and frames do to functions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity.kernels import Combination, Composition, mixture
from asperity.kernels.laws.ideal import lambertian, maxwell
from asperity.kernels.laws.law import Law, retroreflection, specular
from asperity.kernels.laws.matrix_law import MatrixLaw
from asperity.kernels.laws.phase_function import henyey_greenstein
from asperity.kernels.walls.circular_arc import CircularArcLaw
from asperity.kernels.walls.rectangular import RectangularTeethLaw
from asperity.kernels.walls.triangular import TriangularTeethLaw

THETA = np.linspace(0.07, 3.05, 23)
# A law that preserves the measure and is neither reversible nor mirror symmetric: a cycle of three equal bins.
CYCLE = MatrixLaw([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
# Reversible and not mirror symmetric.
LOPSIDED = MatrixLaw([[0.5, 0.5, 0.0], [0.5, 0.25, 0.25], [0.0, 0.25, 0.75]])
PARTS = [
    specular(),
    retroreflection(),
    lambertian(),
    henyey_greenstein(0.6),
    RectangularTeethLaw(0.8),
    TriangularTeethLaw(0.9),
    CircularArcLaw(1.1),
    LOPSIDED,
    CYCLE,
]
laws = st.sampled_from(PARTS)
cheap = st.sampled_from([law for law in PARTS if law.evaluations <= 200])


def smooth(angle: np.ndarray) -> np.ndarray:
    return np.exp(np.cos(angle)) + np.sin(2.0 * angle)


def agree(first: Law, second: Law, tolerance: float = 1e-13) -> bool:
    return bool(np.max(np.abs(first.apply(smooth, THETA) - second.apply(smooth, THETA))) < tolerance)


@settings(max_examples=40, deadline=None)
@given(laws, laws, st.floats(0.0, 1.0))
def test_sums_act_linearly(first: Law, second: Law, fraction: float) -> None:
    law = fraction * first + (1.0 - fraction) * second
    expected = fraction * first.apply(smooth, THETA) + (1.0 - fraction) * second.apply(smooth, THETA)
    assert np.allclose(law.apply(smooth, THETA), expected, rtol=0.0, atol=1e-14)
    assert np.allclose(law.apply(lambda a: 3.0 * smooth(a) - 2.0, THETA), 3.0 * expected - 2.0, rtol=0.0, atol=1e-13)


@settings(max_examples=25, deadline=None)
@given(cheap, cheap, laws)
def test_composition_is_associative_and_the_first_law_acts_first(first: Law, second: Law, third: Law) -> None:
    both = (first @ second) @ third, first @ (second @ third)
    assert all(isinstance(law, Composition) and len(law.laws) == 3 for law in both)
    if both[0].evaluations < 20_000:
        nested = first.apply(lambda a: second.apply(lambda b: third.apply(smooth, b), a), THETA[:5])
        assert all(np.array_equal(law.apply(smooth, THETA[:5]), nested) for law in both)


def test_composition_distributes_over_sums() -> None:
    first, second, last = TriangularTeethLaw(0.9), specular(), RectangularTeethLaw(1.4)
    assert agree((0.3 * first + 0.7 * second) @ last, 0.3 * (first @ last) + 0.7 * (second @ last))
    assert agree(last @ (0.3 * first + 0.7 * second), 0.3 * (last @ first) + 0.7 * (last @ second))


def test_powers_are_repeated_compositions() -> None:
    law = 0.5 * TriangularTeethLaw(0.9) + 0.5 * specular()
    assert agree(law**3, law @ law @ law)
    assert agree((law**2) ** 2, law**4)
    assert agree(law**1, law)
    assert np.array_equal((law**0).apply(smooth, THETA), smooth(THETA))
    assert np.array_equal((law**0).sample(THETA, np.random.default_rng(0)), THETA)


def test_specular_and_retroreflection_are_involutions() -> None:
    assert agree(specular() @ specular(), retroreflection())
    assert agree(specular() ** 2, specular() ** 0, 1e-14)
    assert (specular() ** 1001).branches(1.0)[1].tolist() == [math.pi - 1.0]


def test_adjoints_of_a_cycle_are_exact() -> None:
    back = CYCLE.adjoint()
    assert isinstance(back, MatrixLaw)
    assert back.array.tolist() == CYCLE.array.T.tolist()
    assert CYCLE.reversible is False
    assert agree((CYCLE @ CYCLE).adjoint(), back @ back)
    assert agree((CYCLE @ back), LambertianInBins())
    frame = CYCLE.in_specular_frame()
    assert frame.adjoint().frame == "specular"
    # (P J)* P J = J P* P J, the conditional mean in the bins after a flip on both sides
    assert agree(frame.adjoint() @ frame, (LambertianInBins() @ specular() @ specular()).in_specular_frame() @ flip())


class LambertianInBins(MatrixLaw):
    """Uniform in the own bin of three equal ones."""

    def __init__(self) -> None:
        super().__init__(np.eye(3))


def flip() -> Law:
    """J as a law of the specular frame."""
    return retroreflection().in_specular_frame()


def test_the_specular_frame_of_a_sum_is_the_sum_of_the_frames() -> None:
    law = maxwell(0.3)
    frame = law.in_specular_frame()
    assert isinstance(frame, Combination)
    assert repr(frame) == "0.3*lambertian().in_specular_frame() + 0.7*specular().in_specular_frame()"
    assert repr(frame.in_specular_frame()) == repr(law)


def test_a_composition_that_reads_the_same_backwards_is_reversible() -> None:
    ends, middle = [TriangularTeethLaw(0.7) for _ in range(2)], CircularArcLaw(1.2)
    assert Composition((ends[0], middle, ends[1])).reversible
    assert Composition((ends[0], middle, TriangularTeethLaw(0.8))).reversible is None


def test_reversibility_in_the_specular_frame_needs_the_mirror_symmetry() -> None:
    assert TriangularTeethLaw(0.9).in_specular_frame().reversible is True
    assert LOPSIDED.reversible is True and LOPSIDED.mirror_symmetric is False
    assert LOPSIDED.in_specular_frame().reversible is False


def test_promises_of_sums_and_compositions_follow_from_their_parts() -> None:
    teeth, arcs = TriangularTeethLaw(0.9), CircularArcLaw(1.0)
    assert (0.5 * teeth + 0.5 * arcs).reversible is True
    assert (0.5 * teeth + 0.5 * CYCLE).reversible is False
    assert (0.5 * CYCLE + 0.5 * CYCLE.adjoint()).reversible is None
    assert (teeth @ arcs).reversible is None
    assert (teeth @ arcs @ teeth).reversible is True
    assert (teeth**3).reversible is True
    assert (teeth @ arcs).mirror_symmetric is True


# ---- weights and frames -------------------------------------------------------------------------------------------
def test_a_sum_may_be_completed_before_it_is_used() -> None:
    law = 0.3 * specular() + 0.6 * lambertian()
    assert (law + 0.1 * retroreflection()).apply(np.ones_like, 1.0) == pytest.approx(1.0, abs=1e-15)


def test_ten_tenths_are_one() -> None:
    law = Combination(tuple((0.1, specular()) for _ in range(10)))
    assert law.branches(1.0)[0].sum() == pytest.approx(1.0, abs=1e-15)
    assert np.count_nonzero(law.branches(1.0)[0]) == 1


def test_a_mixture_is_a_sum() -> None:
    law = mixture([specular(), lambertian()], [0.25, 0.75])
    assert agree(law, 0.25 * specular() + 0.75 * lambertian())


def test_scalars_of_numpy_scale() -> None:
    assert repr(np.float64(0.5) * specular()) == "0.5*specular()"
    assert repr(2 * (0.25 * specular() + 0.25 * lambertian())) == "0.5*specular() + 0.5*lambertian()"


def test_compositions_stay_in_the_frame_of_their_laws() -> None:
    both = TriangularTeethLaw(0.9).in_specular_frame() @ RectangularTeethLaw(1.0).in_specular_frame()
    assert both.frame == "specular"
    assert both.in_specular_frame().frame == "paper"


def test_names_read_like_the_expressions_that_made_them() -> None:
    teeth = RectangularTeethLaw(height_to_width=1.0)
    assert repr(teeth) == "RectangularTeethLaw(height_to_width=1.0)"
    assert repr(0.3 * specular() + 0.7 * lambertian()) == "0.3*specular() + 0.7*lambertian()"
    assert repr((0.3 * specular() + 0.7 * lambertian()) @ teeth) == (
        "(0.3*specular() + 0.7*lambertian()) @ RectangularTeethLaw(height_to_width=1.0)"
    )
    assert repr((specular() @ teeth) ** 2) == "(specular() @ RectangularTeethLaw(height_to_width=1.0)) ** 2"
    assert repr((specular() ** 2) ** 3) == "(specular() ** 2) ** 3"
    assert repr(teeth.in_specular_frame()) == "RectangularTeethLaw(height_to_width=1.0).in_specular_frame()"
    assert repr((teeth**2).in_specular_frame()) == (
        "(RectangularTeethLaw(height_to_width=1.0) ** 2).in_specular_frame()"
    )
    assert repr(henyey_greenstein(0.5)) == "henyey_greenstein(0.5)"


# ---- branches of compounds ------------------------------------------------------------------------------------------


def test_a_law_says_whether_it_knows_its_breakpoints() -> None:
    for unknown in (lambertian(), maxwell(0.5), specular() @ lambertian(), CircularArcLaw(1.0) @ specular()):
        assert unknown.breakpoints(10)[1] == math.inf
    teeth = RectangularTeethLaw(1.0)
    found, left_out = (0.5 * teeth + 0.5 * lambertian()).breakpoints(10)
    assert np.array_equal(found, teeth.breakpoints(10)[0]) and left_out == math.inf
    tilted = MatrixLaw([[0.25, 0.75], [0.75, 0.25]]).in_specular_frame()
    assert tilted.outgoing_breakpoints == pytest.approx(math.pi / 2) and teeth.outgoing_breakpoints.size == 0


# ---- samples -------------------------------------------------------------------------------------------------------
