"""The algebra of laws: what sums, compositions, powers and frames do to functions, and what they cost."""

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity import InputError
from asperity import kernels as ker
from asperity.kernels.laws.law import Combination
from asperity.kernels.walls.wall_law import made_of_isometries

THETA = np.linspace(0.07, 3.05, 23)
# A law that preserves the measure and is neither reversible nor mirror symmetric: a cycle of three equal bins.
CYCLE = ker.MatrixLaw([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
# Reversible and not mirror symmetric.
LOPSIDED = ker.MatrixLaw([[0.5, 0.5, 0.0], [0.5, 0.25, 0.25], [0.0, 0.25, 0.75]])
MIRROR, DIFFUSE, HG, TEETH = ker.specular(), ker.lambertian(), ker.henyey_greenstein(0.5), ker.RectangularTeethLaw(1.0)
PARTS = [
    ker.specular(),
    ker.retroreflection(),
    ker.lambertian(),
    ker.henyey_greenstein(0.6),
    ker.RectangularTeethLaw(0.8),
    ker.TriangularTeethLaw(0.9),
    ker.CircularArcLaw(1.1),
    LOPSIDED,
    CYCLE,
]
laws = st.sampled_from(PARTS)
cheap = st.sampled_from([law for law in PARTS if law.conditionals(1.0).nodes.size <= 200])


def smooth(angle: np.ndarray) -> np.ndarray:
    return np.exp(np.cos(angle)) + np.sin(2.0 * angle)


def agree(first: ker.Law, second: ker.Law, tolerance: float = 1e-13) -> bool:
    return bool(np.max(np.abs(first.apply(smooth, THETA) - second.apply(smooth, THETA))) < tolerance)


@settings(max_examples=25, deadline=None)
@given(cheap, cheap, laws)
def test_composition_is_associative_and_the_first_law_acts_first(first, second, third) -> None:
    both = (first @ second) @ third, first @ (second @ third)
    assert repr(both[0]) == repr(both[1])
    if math.prod(law.conditionals(1.0).nodes.size for law in (first, second, third)) < 20_000:
        means = [law.apply(smooth, THETA[:5]) for law in both]
        assert np.array_equal(*means)
        if made_of_isometries(both[0]):
            nested = first.apply(lambda a: second.apply(lambda b: third.apply(smooth, b), a), THETA[:5])
            assert np.allclose(means[0], nested, rtol=0.0, atol=1e-13)


def test_powers_are_repeated_compositions() -> None:
    law = 0.5 * ker.TriangularTeethLaw(0.9) + 0.5 * ker.specular()
    assert agree(law**3, law @ law @ law)
    assert agree((law**2) ** 2, law**4)
    assert agree(law**1, law)
    assert np.array_equal((law**0).apply(smooth, THETA), smooth(THETA))
    assert np.array_equal((law**0).sample(THETA, np.random.default_rng(0)), THETA)


def test_specular_and_retroreflection_are_involutions() -> None:
    assert agree(ker.specular() @ ker.specular(), ker.retroreflection())
    assert agree(ker.specular() ** 2, ker.specular() ** 0, 1e-14)
    assert (ker.specular() ** 1001).branches(1.0)[1].tolist() == [math.pi - 1.0]


def test_adjoints_of_a_cycle_are_exact() -> None:
    back = CYCLE.adjoint()
    assert isinstance(back, ker.MatrixLaw)
    assert back.array.tolist() == CYCLE.array.T.tolist()
    assert CYCLE.reversible is False
    assert agree((CYCLE @ CYCLE).adjoint(), back @ back)
    frame, flip = CYCLE.in_specular_frame(), ker.retroreflection().in_specular_frame()
    assert frame.adjoint().frame == "specular"
    # (P J)* P J = J P* P J, the conditional mean in the bins after a flip on both sides
    # jumps between bins are found by halving, to 1e-14
    assert agree(frame.adjoint() @ frame, ker.MatrixLaw(np.eye(3)).in_specular_frame() @ flip, 1e-12)


def test_reversibility_in_the_specular_frame_needs_the_mirror_symmetry() -> None:
    assert ker.TriangularTeethLaw(0.9).in_specular_frame().reversible is True
    assert LOPSIDED.reversible is True and LOPSIDED.mirror_symmetric is False
    assert LOPSIDED.in_specular_frame().reversible is False


def test_promises_of_sums_and_compositions_follow_from_their_parts() -> None:
    teeth, arcs = ker.TriangularTeethLaw(0.9), ker.CircularArcLaw(1.0)
    assert (0.5 * teeth + 0.5 * arcs).reversible is True
    assert (0.5 * teeth + 0.5 * CYCLE).reversible is False
    assert (0.5 * CYCLE + 0.5 * CYCLE.adjoint()).reversible is None
    assert (teeth @ arcs).reversible is None
    assert (teeth @ arcs @ ker.TriangularTeethLaw(0.9)).reversible is True
    assert (teeth @ arcs @ ker.TriangularTeethLaw(0.8)).reversible is None
    assert (teeth**3).reversible is True
    assert (teeth @ arcs).mirror_symmetric is True


# ---- weights and frames -------------------------------------------------------------------------------------------
def test_a_sum_may_be_completed_before_it_is_used() -> None:
    law = 0.3 * ker.specular() + 0.6 * ker.lambertian()
    assert (law + 0.1 * ker.retroreflection()).apply(np.ones_like, 1.0) == pytest.approx(1.0, abs=1e-15)


def test_ten_tenths_are_one() -> None:
    law = Combination(tuple((0.1, ker.specular()) for _ in range(10)))
    assert law.branches(1.0)[0].sum() == pytest.approx(1.0, abs=1e-15)
    assert np.count_nonzero(law.branches(1.0)[0]) == 1


@pytest.mark.parametrize(
    ("law", "name"),
    [
        (TEETH @ MIRROR, "RectangularTeethLaw(height_to_width=1.0) @ specular()"),
        (np.float64(0.3) * MIRROR + 0.7 * DIFFUSE, "0.3*specular() + 0.7*lambertian()"),
        (2 * (0.25 * MIRROR + 0.25 * DIFFUSE), "0.5*specular() + 0.5*lambertian()"),
        ((0.3 * MIRROR + 0.7 * HG) @ TEETH,
         "(0.3*specular() + 0.7*henyey_greenstein(0.5)) @ RectangularTeethLaw(height_to_width=1.0)"),
        ((MIRROR @ TEETH) ** 2, "(specular() @ RectangularTeethLaw(height_to_width=1.0)) ** 2"),
        ((MIRROR**2) ** 3, "(specular() ** 2) ** 3"),
        ((TEETH**2).in_specular_frame(), "(RectangularTeethLaw(height_to_width=1.0) ** 2).in_specular_frame()"),
        (ker.maxwell(0.3).in_specular_frame(),
         "0.3*lambertian().in_specular_frame() + 0.7*specular().in_specular_frame()"),
        (ker.maxwell(0.3).in_specular_frame().in_specular_frame(), "0.3*lambertian() + 0.7*specular()"),
    ],
)  # fmt: skip
def test_names_read_like_the_expressions_that_made_them(law: ker.Law, name: str) -> None:
    assert repr(law) == name


def test_a_law_says_whether_it_knows_its_breakpoints() -> None:
    flat, arc = ker.specular(), ker.CircularArcLaw(1.0)
    for unknown in (ker.lambertian(), ker.maxwell(0.5), flat @ ker.lambertian(), arc @ flat):
        assert unknown.breakpoints(10)[1] == math.inf
    teeth = ker.RectangularTeethLaw(1.0)
    found, left_out = (0.5 * teeth + 0.5 * ker.lambertian()).breakpoints(10)
    assert np.array_equal(found, teeth.breakpoints(10)[0]) and left_out == math.inf
    tilted = ker.MatrixLaw([[0.25, 0.75], [0.75, 0.25]]).in_specular_frame()
    assert tilted.outgoing_breakpoints == pytest.approx(math.pi / 2) and teeth.outgoing_breakpoints.size == 0


# ---- powers --------------------------------------------------------------------------------------------------------
ANGLES, EDGES = np.array([0.3, 1.0, 2.0]), np.linspace(0.0, np.pi, 9)
METHODS = {
    "sample": lambda law: law.sample(ANGLES, rng=0),
    "apply": lambda law: law.apply(np.cos, ANGLES),
    "branches": lambda law: law.branches(ANGLES),
    "breakpoints": lambda law: law.breakpoints(8),
    "isometry_table": lambda law: law.isometry_table(),
    "conditionals": lambda law: law.conditionals(ANGLES, 1e-3, 0, EDGES[1:-1]),
    "adjoint": lambda law: law.adjoint(),
    "in_specular_frame": lambda law: law.in_specular_frame(),
    "repr": repr,
    "discretise": lambda law: ker.discretise(law, ker.Bins(4), tolerance=1e-2),
}
KINDS = [
    "specular", "retroreflection", "lambertian", "maxwell", "scattering", "density", "triangles", "rectangles", "arcs",
    "least resistance", "lopsided matrix", "wall in closed form", "traced wall", "sum", "product",
]  # fmt: skip
# Values of `apply` and branches, fewer than by default, and seconds of this process; the first call may compile.
MOST_VALUES, MOST_BRANCHES, LONGEST = 10**6, 16, 20.0


@pytest.mark.parametrize("law", KINDS, indirect=True)
@pytest.mark.parametrize("exponents", [(2, 3), (2**31 - 1,)], ids=str)
def test_powers_end_soon_or_are_refused(law, exponents, monkeypatch):
    monkeypatch.setattr("asperity.kernels.laws.law.MOST_VALUES", MOST_VALUES)
    monkeypatch.setattr("asperity.kernels.laws.sums.MOST_BRANCHES", MOST_BRANCHES)
    for exponent in exponents:
        law = law**exponent
    for name, method in METHODS.items():
        start = time.process_time()
        try:
            method(law)
        except InputError as reason:
            assert "expected" in str(reason) or "needs" in str(reason) or "use " in str(reason), (name, reason)
        assert time.process_time() - start < LONGEST, name


def test_the_advice_for_large_powers_works():
    law = ker.RectangularTeethLaw(2.0)
    for call in (
        lambda: ker.discretise(law ** (2**31 - 1), ker.Bins(8)),
        lambda: (law ** (2**31 - 1)).sample(ANGLES, rng=0),
        lambda: (ker.CircularArcLaw(1.2) ** 500).apply(np.cos, ANGLES),
    ):
        with pytest.raises(InputError, match="discretise"):
            call()
    power = ker.discretise(law, ker.Bins(8)) ** (2**31 - 1)
    assert np.allclose(power.array.sum(axis=1), 1.0, atol=1e-6)
