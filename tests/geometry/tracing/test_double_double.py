"""Double-double numbers against exact fractions and 50 digits."""

import math
import operator
from fractions import Fraction
from functools import cache

import mpmath as mp
import numpy as np
import pytest
from numba import njit

from asperity.geometry.tracing.double_double.numbers import (
    EPS_DOUBLE_DOUBLE,
    cross,
    direction_angle,
    dot,
    double_double,
    extended,
    root,
    scaled,
    sine_cosine,
)

compiled = njit(error_model="numpy")
NUMBERS = 500
U2 = Fraction(1, 2**106)
# Proven bounds on the relative errors, in u^2, see `numbers`.
BOUNDS = {operator.add: 3, operator.sub: 3, operator.mul: 7, operator.truediv: 15}
COMPARISONS = (operator.lt, operator.le, operator.gt, operator.ge, operator.eq)


def random_pairs(rng, spread=40):
    """Normalised double-doubles of many sizes, shape (NUMBERS, 2)."""
    top = np.ldexp(rng.uniform(-1.0, 1.0, NUMBERS), rng.integers(-spread, spread, NUMBERS))
    low = 0.5 * np.spacing(np.abs(top)) * rng.uniform(-1.0, 1.0, NUMBERS)
    low[: NUMBERS // 10] = 0.0
    return np.column_stack([top, low])


def nearby_pairs(a, rng):
    """Numbers close to ``a``, so that differences cancel, and some equal ones."""
    b = a.copy()
    b[:, 1] *= rng.uniform(-1.0, 1.0, NUMBERS)
    b[: NUMBERS // 4, 0] = np.nextafter(a[: NUMBERS // 4, 0], np.inf)
    b[-NUMBERS // 4 :] = a[-NUMBERS // 4 :]
    return b


def exact(pair):
    return Fraction(float(pair[0])) + Fraction(float(pair[1]))


@cache
def pairwise(operation):
    """The operation on pairs of double-doubles, of double-doubles and doubles, and of doubles and double-doubles."""

    @compiled
    def run(a, b, found):
        for k in range(a.shape[0]):
            left, right = double_double(a[k, 0], a[k, 1]), double_double(b[k, 0], b[k, 1])
            for mixed in range(3):
                value = extended(0.0)
                if mixed == 0:
                    value = extended(operation(left, right))
                elif mixed == 1:
                    value = extended(operation(left, b[k, 0]))
                else:
                    value = extended(operation(a[k, 0], right))
                found[mixed, k, 0], found[mixed, k, 1] = value.high, value.low

    return run


def apply(operation, a, b):
    """Its results, shape (3, NUMBERS, 2)."""
    found = np.empty((3, len(a), 2))
    pairwise(operation)(a, b, found)
    return found


def operands(a, b, k):
    return (exact(a[k]), exact(b[k])), (exact(a[k]), Fraction(b[k, 0])), (Fraction(a[k, 0]), exact(b[k]))


@pytest.fixture(params=["random", "nearby"])
def pairs(request):
    rng = np.random.default_rng(7)
    a = random_pairs(rng)
    return a, random_pairs(rng) if request.param == "random" else nearby_pairs(a, rng)


@pytest.mark.parametrize("operation", BOUNDS, ids=lambda operation: operation.__name__)
def test_operators_keep_their_bounds_of_error(operation, pairs):
    a, b = pairs
    found = apply(operation, a, b)
    for k in range(NUMBERS):
        for mixed, (left, right) in enumerate(operands(a, b, k)):
            expected = operation(left, right)
            assert abs(exact(found[mixed, k]) - expected) <= BOUNDS[operation] * U2 * abs(expected)
            # the result is normalised
            assert found[mixed, k].sum() == found[mixed, k, 0]


@pytest.mark.parametrize("comparison", COMPARISONS, ids=lambda operation: operation.__name__)
def test_comparisons_are_exact(comparison, pairs):
    a, b = pairs
    found = apply(comparison, a, b)[:, :, 0]
    for k in range(NUMBERS):
        assert found[:, k].tolist() == [float(comparison(*both)) for both in operands(a, b, k)]


def test_comparisons_with_infinity_and_no_number():
    special = np.array([[np.inf, 0.0], [1.0, 0.0], [np.nan, 0.0], [-np.inf, 0.0]])
    a, b = np.repeat(special, 4, axis=0), np.tile(special, (4, 1))
    for comparison in COMPARISONS:
        assert np.array_equal(apply(comparison, a, b)[0, :, 0], comparison(a[:, 0], b[:, 0]))


@compiled
def roots_and_halves(a, found):
    for k in range(a.shape[0]):
        x = double_double(a[k, 0], a[k, 1])
        y, z = root(x), scaled(-0.5, -x)
        found[k] = y.high, y.low, z.high, z.low


def test_roots_and_powers_of_two(pairs):
    a = np.abs(pairs[0][:, :1]) * [1.0, 0.0] + pairs[0] * [0.0, 1.0]
    found = np.empty((NUMBERS, 4))
    roots_and_halves(a, found)
    with mp.workdps(50):
        for pair, row in zip(a, found, strict=True):
            expected = mp.sqrt(mp.mpf(pair[0]) + mp.mpf(pair[1]))
            assert abs(mp.mpf(row[0]) + mp.mpf(row[1]) - expected) <= EPS_DOUBLE_DOUBLE * expected
    assert np.array_equal(found[:, 2:], 0.5 * a)


def test_sines_and_angles_agree_with_fifty_digits():
    @compiled
    def run(angles, found):
        for k in range(angles.shape[0]):
            sine, cosine = sine_cosine(angles[k])
            angle = direction_angle(cosine, -sine)
            found[k] = sine.high, sine.low, cosine.high, cosine.low, angle.high, angle.low

    rng = np.random.default_rng(8)
    angles = np.concatenate([rng.uniform(0.0, math.pi, NUMBERS), 10.0 ** rng.uniform(-300, 0, 50), [math.pi / 2]])
    found = np.empty((len(angles), 6))
    run(angles, found)
    with mp.workdps(50):
        for angle, row in zip(angles, found, strict=True):
            for column, expected in enumerate((mp.sin(angle), mp.cos(angle), -mp.mpf(angle))):
                value = mp.mpf(row[2 * column]) + mp.mpf(row[2 * column + 1])
                assert abs(value - expected) <= 16.0 * EPS_DOUBLE_DOUBLE * abs(expected)


def test_formulas_over_both_types_give_doubles_the_bits_of_plain_arithmetic():
    @compiled
    def run(a, found):
        for k in range(a.shape[0]):
            x, y, z, w = a[k]
            found[k] = cross(x, y, z, w), dot(x, y, z, w), root(x * x), scaled(2.0, x)

    a = np.random.default_rng(9).normal(size=(NUMBERS, 4))
    x, y, z, w = a.T
    found = np.empty((NUMBERS, 4))
    run(a, found)
    assert np.array_equal(found, np.column_stack([x * w - y * z, x * z + y * w, np.abs(x), 2.0 * x]))
