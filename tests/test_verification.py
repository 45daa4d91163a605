"""Verdicts on identities: true ones are proved, false ones refuted where they fail, and nothing is claimed beyond."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
import sympy as sp
from flint import ctx
from hypothesis import given, settings
from hypothesis import strategies as st

from asperity import InputError, Verdict, verify
from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry import symbolic as sym
from asperity.verification import agreement, every, holds, no_excess
from asperity.verification.balls import evaluate

theta, psi, x, y = sp.symbols("theta psi x y", real=True)
m, J, eps, rho = sp.symbols("m J epsilon rho", positive=True)
ANGLES = [theta > 0, theta < sp.pi, psi > 0, psi < sp.pi]
w = sp.Matrix(sp.symbols("v1 v2 omega", real=True))
AREA = sym.volume_density(sym.G, [sym.theta, sym.psi])
NEAR_AN_END = sp.Rational(1, 10**4)

TRUE = {
    "the length of a chord": (sp.sqrt((1 - sp.cos(rho)) ** 2 + sp.sin(rho) ** 2), 2 * sp.sin(rho / 2), [rho < sp.pi]),
    "foreshortening by either mass": (sp.sqrt(1 + m / J) * sp.sqrt(J), sp.sqrt(m + J), []),
    "a root of a square on the half circle": (sp.sqrt(m**2 * (1 - sp.cos(theta) ** 2)), m * sp.sin(theta), ANGLES),
    "the inverse of the cosine": (sp.acos(-sp.cos(theta)), sp.pi - theta, ANGLES),
    "half an angle": (sp.tan(psi / 2), (1 - sp.cos(psi)) / sp.sin(psi), ANGLES),
    "complementary arctangents": (sp.atan(x) + sp.atan(1 / x), sp.pi / 2, [x > 0]),
    "the no-slip matrix keeps the energy": (sym.inner(sym.no_slip * w, sym.no_slip * w), sym.inner(w, w), []),
    "no-slip twice": (sym.no_slip**2, sp.eye(3), []),
    "two collisions, the velocity reversed in between": (
        -sym.branch_matrix(1, y) * sym.branch_matrix(1, x),
        (sp.eye(3) - 2 * sym.chi * sym.chi.T * sym.metric) * sym.branch_matrix(1, x + y),
        [],
    ),
    "the area of the sphere of velocities": (AREA, sp.sin(sym.psi), sym.ANGLES),
    "adjacent satellites differ in height": (
        sp.cos(rho - x) - sp.cos(x), 2 * sp.sin(rho / 2) * sp.sin(x - rho / 2), [],
    ),
}  # fmt: skip

FALSE = {
    "a root of a square beyond the half circle": (
        sp.sqrt(1 - sp.cos(theta) ** 2), sp.sin(theta), [theta > 0, theta < 4],
    ),
    "the inverse of the cosine, the other way round": (sp.acos(sp.cos(theta)), theta, [theta > -1, theta < sp.pi]),
    "foreshortening with the other exponent": (sp.sqrt(1 + m / J), sp.sqrt(J / (m + J)), []),
    "complementary arctangents on the whole line": (sp.atan(x) + sp.atan(1 / x), sp.pi / 2, []),
    "the area of the sphere, with the printed sine": (
        AREA, sp.sin(sym.theta), sym.ANGLES,
    ),
    "no-slip leaves the spin alone": ((sym.no_slip * w)[2], w[2], []),
    "the normal at the next satellite, with the printed sign": (
        sym.satellite_normal(1), sym.satellite_normal(-1), [],
    ),
    "a difference of one part in a million": (sp.sin(x) ** 2 + sp.cos(x) ** 2, 1 + x**2 / 10**6, []),
    "a difference beside one end": (sp.sqrt((x - NEAR_AN_END) ** 2), x - NEAR_AN_END, [x > 0, x < 1]),
    "whole parts of a sum": (sp.floor(x + y), sp.floor(x) + sp.floor(y), []),
    "adjacent satellites to second order": (1 - sp.cos(rho), rho**2 / 2, [rho < sp.Rational(1, 10)]),
}  # fmt: skip


@pytest.mark.parametrize("name", TRUE)
def test_a_true_identity_is_proved(name):
    assert verify(*TRUE[name]).answer == "proved"


@pytest.mark.parametrize("name", FALSE)
def test_a_false_identity_is_refuted_at_a_point_where_it_fails(name):
    lhs, rhs, assumptions = FALSE[name]
    verdict = verify(lhs, rhs, assumptions)
    assert verdict.answer == "refuted"
    # independently, at the point given: the assumptions hold and the sides differ
    point = {sp.Symbol(key): sp.Rational(value) for key, value in verdict.counterexample.items()}
    named = {s: point[sp.Symbol(s.name)] for s in _symbols(lhs, rhs, assumptions)}
    assert all(sp.simplify(assumption.subs(named)) == sp.true for assumption in assumptions)
    sides = [sp.N(sp.Matrix([side]).subs(named), 60) for side in (lhs, rhs)]
    assert max(abs(entry) for entry in sides[0] - sides[1]) > 1e-18
    first, second = (mpmath.mpf(value) for value in verdict.values)
    assert first != second


def _symbols(*parts):
    return {
        s for part in parts for one in (part if isinstance(part, list | tuple) else [part]) for s in one.free_symbols
    }


def test_what_is_neither_proved_nor_refuted_is_undecided():
    # true, but the routes know no functional equation of the gamma function
    verdict = verify(sp.gamma(m + 1), m * sp.gamma(m))
    assert verdict.answer == "undecided" and not verdict.stands


@pytest.mark.parametrize(
    ("lhs", "rhs", "assumptions"),
    [
        # equal but at the end of a closed interval, or at one point inside
        (sp.sign(x), 1, [x >= 0]),
        (sp.ceiling(x), 1, [x >= 0, x < 1]),
        (0**x, 0, [x >= 0]),
        (0 ** sp.Abs(x - sp.pi / 7), 0, []),
        (sp.Piecewise((1, sp.Eq(x, sp.Rational(5, 7))), (0, True)), 0, []),
        # equal but on an interval shorter than any that is sampled
        (sp.Abs(x - sp.Rational(1, 10**30)), x - sp.Rational(1, 10**30), [x > 0]),
        (sp.acos(sp.cos(x)), x, [x > 0, x < sp.pi + sp.Rational(1, 10**30)]),
    ],
)
def test_an_identity_that_fails_where_hardly_any_point_lies_is_refuted(lhs, rhs, assumptions):
    assert verify(lhs, rhs, assumptions).answer == "refuted"


@settings(max_examples=25)
@given(st.integers(-4, 4), st.integers(1, 4), st.integers(-5, 5), st.integers(1, 6))
def test_sums_of_angles_are_proved_and_their_neighbours_refuted(k, n, p, q):
    a, b = k * x, n * y / 2 + sp.pi * sp.Rational(p, q)
    expanded = sp.sin(a) * sp.cos(b) + sp.cos(a) * sp.sin(b)
    assert verify(sp.sin(a + b), expanded).answer == "proved"
    assert verify(sp.sin(a + b), expanded + sp.Rational(1, 10**9)).answer == "refuted"


@settings(max_examples=40)
@given(st.fractions(-3, 3, max_denominator=97))
def test_an_enclosure_contains_the_value(number):
    value = sp.Rational(number.numerator, number.denominator)
    e = sp.atan(x) + sp.sqrt(1 + x**2) * sp.exp(-x) + sp.acos(x / 4) - sp.sin(x) / (2 + sp.cos(x)) + sp.Abs(x)
    ball = evaluate(e, {x: value}, 200).ball
    with mpmath.workdps(80):
        exact = mpmath.mpf(sp.N(e.subs(x, value), 70))
        # both ends, to more digits than the ball has
        with ctx.workprec(300):
            low, high = (mpmath.mpf(end.str(75, radius=False)) for end in (ball.lower(), ball.upper()))
        assert low <= exact <= high
        assert high - low < 1e-50


def test_matrices_are_compared_entry_by_entry_and_shapes_must_agree():
    verdict = verify(sp.eye(2), [[1, 0], [x - x, 1 + y]])
    assert verdict.answer == "refuted" and "y" in verdict.counterexample
    with pytest.raises(InputError, match="one shape"):
        verify([1, 2], [1, 2, 3])
    with pytest.raises(InputError, match="one shape"):
        verify(sp.ones(2, 3), sp.ones(3, 2))


@pytest.mark.parametrize(
    ("assumptions", "words"),
    [
        ([sp.Eq(x, y)], "inequalities"),
        ([x > 1, x < 0], "no point"),
        ([x > y, y > x + 1], "no point"),
        (["x"], "ineq"),
    ],
)
def test_unsuitable_assumptions_are_refused_in_words(assumptions, words):
    with pytest.raises(InputError, match=words):
        verify(x, y, assumptions)


def test_assumptions_may_be_one_relation_or_intervals():
    root = sp.sqrt(1 - sp.cos(theta) ** 2)
    assert verify(root, sp.sin(theta), {theta: (0, sp.pi)}).answer == "proved"
    assert verify(root, sp.sin(theta), sp.And(theta > 0, theta < sp.pi)).answer == "proved"
    assert verify(root, sp.sin(theta), {theta: (0, 4)}).answer == "refuted"
    assert verify(sp.sqrt(x**2), x, x > 0).answer == "proved"


def test_the_symbols_of_the_disk_are_those_of_its_numbers():
    disk = geo.Disk(mass=2.0, inertia=0.7)
    point = {sym.m: 2.0, sym.J: 0.7, sym.theta: 1.1, sym.psi: 0.4}
    assert np.allclose(np.array(sym.frame.subs(point), dtype=float), disk.frame)
    assert np.allclose(np.array(sym.G.subs(point), dtype=float)[:, 0], disk.from_angles(1.1, 0.4))
    assert np.allclose(np.array(sym.smooth.subs(point), dtype=float), ker.smooth_matrix(disk))
    assert np.allclose(np.array(sym.no_slip.subs(point), dtype=float), ker.no_slip_matrix(disk))
    step = 1e-6
    numeric = (disk.from_angles(1.1, 0.4 + step) - disk.from_angles(1.1, 0.4 - step)) / (2 * step)
    assert np.allclose(np.array(sym.G_jacobian.subs(point), dtype=float)[:, 1], numeric, atol=1e-9)
    law = ker.TriangularTeethLaw(0.8)
    for _, matrix in ker.CollisionLaw(law, disk).branches(0.5):
        assert any(
            np.allclose(matrix, np.array(sym.branch_matrix(sign, turn).subs(point), dtype=float))
            for sign, turn in ((1, sp.pi - 2 * sp.Rational(4, 5)), (-1, sp.Rational(4, 5)))
        )


def test_points_have_the_properties_that_their_symbols_carry():
    even, whole = sp.Symbol("n", even=True), sp.Symbol("n", integer=True)
    odd = sp.Symbol("k", odd=True, positive=True)
    assert verify(sp.floor(even / 2), even / 2).answer != "refuted"
    assert verify(sp.floor(whole / 2), whole / 2).answer == "refuted"
    assert verify(sp.Mod(odd, 2), 0).answer == "refuted"
    assert verify(sp.Abs(odd), odd).answer == "proved"
    with pytest.raises(InputError, match="substitute 0"):
        verify(sp.Symbol("z", zero=True) * x, 1)


def test_intervals_may_be_shorter_than_floats_can_tell():
    tiny = sp.Rational(1, 10**30)
    assert verify(x**2, 2 * x, [x > 1, x < 1 + tiny]).answer == "refuted"
    assert verify(sp.sqrt(x**2), x, [x > 1, x < 1 + tiny]).answer == "proved"


def test_complex_symbols_are_refused():
    with pytest.raises(InputError, match="real symbol"):
        verify(sp.Symbol("z", imaginary=True), 0)


def test_a_verdict_has_no_truth_value():
    with pytest.raises(InputError, match="ask for"):
        bool(verify(x, x))


def test_conditions_between_symbols_are_used_in_proofs():
    lhs, rhs = sp.Abs(rho - eps), rho - eps
    assert verify(lhs, rhs).answer == "refuted"
    assert verify(lhs, rhs, [eps < rho]).answer == "proved"
    assert verify(sp.Max(x, y), x, [x >= y]).answer == "proved"
    assert verify(sp.Abs(x * y - x), x - x * y, [y > 0, y < x, x < 1]).answer == "proved"


def test_decimal_numbers_are_the_fractions_that_they_are():
    assert verify(sp.Float(0.5) * x, x / 2).answer == "proved"
    assert verify(sp.Float(0.1), sp.Rational(1, 10)).answer == "refuted"


def test_measurements_name_the_worst_place():
    verdict = agreement([1.0, 2.0, 3.0], [1.0, 2.5, 3.1], 0.2, x=[7.0, 8.0, 9.0])
    assert verdict.answer == "refuted" and verdict.counterexample == {"x": 8.0} and verdict.values == ("2", "2.5")
    assert agreement([1.0, 2.0], [1.0, 2.1], 0.2).answer == "agrees"
    assert no_excess([1.0, 5.0], [2.0, 4.0], x=[0.0, 1.0]).counterexample == {"x": 1.0}
    assert no_excess([1.0, 5.0], 5.0).answer == "agrees"
    assert holds([True, False], "points", x=[0.0, 1.0]).counterexample == {"x": 1.0}
    # what is not a number speaks neither for nor against a formula
    assert agreement([1.0, math.nan], [1.0, 1.0], 1.0).answer == "undecided"


def test_a_conjunction_is_as_good_as_its_worst_part():
    proved, agrees, undecided, refuted = (
        Verdict(answer, answer) for answer in ("proved", "agrees", "undecided", "refuted")
    )
    assert every(proved, proved).answer == "proved"
    assert every(proved, agrees).answer == "agrees"
    assert every(agrees, undecided, proved).answer == "undecided"
    assert every(undecided, refuted, proved).answer == "refuted"
    assert not np.any([verdict.stands for verdict in (undecided, refuted)])
