"""Rectangular crevices of any depth: integrals over up to 10^12 periods against expansions derived another way."""

import math

import mpmath
import numpy as np
import pytest

from asperity import kernels as ker
from asperity.kernels.walls.rectangular import sum_rule

# Moments, as below, of crevices whose Fourier series is too long: period by period up to d = 2000 by antiderivatives of
# (1, d) (1 + c^2)^(-3/2) and (1, d) c^2 (1 + c^2)^(-5/2) in 40 digits, d = 2 r c, then with the mean of q.
SHALLOW = {
    1e-6: (1.999997227411278e-06, 1.3333305607446111e-06),
    1e-3: (0.001997227414883923, 0.00133056075062136),
}
EPS = float(np.finfo(np.float64).eps)
DEPTHS = [1e-6, 1e-3, 0.3, 1.0, 7.3, 1e2, 1e4, 1e8, 1e12]


@pytest.mark.parametrize("count", [10, 23, 1000, 10**9])
def test_the_sum_rule_sums_polynomials_exactly(count: int) -> None:
    nodes = 8
    node, weight = sum_rule(np.array([float(count)]), nodes)
    assert np.all((node > -0.5) & (node < count - 0.5))
    for degree in range(2 * nodes):
        # Faulhaber's formula
        exact = sum(
            mpmath.binomial(degree + 1, k) * mpmath.bernoulli(k) * mpmath.mpf(count - 1) ** (degree + 1 - k) * (-1) ** k
            for k in range(degree + 1)
        ) / (degree + 1) + (1 if degree == 0 else 0)
        found = float((weight * (node / count) ** degree).sum())
        # the Bernoulli number with B_1 = +1/2 sums from 1 to count - 1; the term 0^0 is added above
        assert found == pytest.approx(float(exact / mpmath.mpf(count) ** degree), rel=1e-12)


def moments(r: float) -> tuple[float, float]:
    """The integrals of q sin(theta)/2 and q cos(theta)^2 sin(theta)/2 over (0, pi), q of a crevice of depth r.

    q = 1/2 - 4/pi^2 sum over odd m of cos(pi m d)/m^2; with c = cot(theta) and w = 2 pi r m,

        int_0^oo cos(w c) (1 + c^2)^(-3/2) dc = w K_1(w),   int_0^oo cos(w c) (1 + c^2)^(-5/2) dc = w^2 K_2(w)/3.
    """
    if r in SHALLOW:
        return SHALLOW[r]
    mpmath.mp.dps = 30
    zeroth, second = mpmath.mpf(1) / 2, mpmath.mpf(1) / 6
    for m in range(1, int(40.0 / (2.0 * math.pi * r)) + 2, 2):
        w = 2 * mpmath.pi * mpmath.mpf(r) * m
        first = w * mpmath.besselk(1, w)
        zeroth -= 4 / mpmath.pi**2 / m**2 * first
        second -= 4 / mpmath.pi**2 / m**2 * (first - w**2 * mpmath.besselk(2, w) / 3)
    return float(zeroth), float(second)


@pytest.mark.parametrize("r", DEPTHS)
def test_the_first_moments_are_those_of_the_fourier_series(r: float) -> None:
    zeroth, second = moments(r)
    law = ker.RectangularTeethLaw(r)
    for size in (2, 64):
        found = ker.discretise(law, ker.Legendre(size), tolerance=0.0)
        # <e_1, P e_1> = 3 (<u, retro u> - <u, specular u>); half of the wall is flat
        assert found.symmetric[1, 1] == pytest.approx(3.0 * second - 1.0, abs=4e-15 * size)
        assert found.method == "exact" and found.error.kind == "bound" and float(found.error) < 3e-13
    halves = ker.discretise(law, ker.Bins(2), tolerance=0.0)
    assert halves.array[0, 0] == pytest.approx(0.5 * zeroth, abs=1e-15)


def mass_of_retro(r: float, low: float, high: float) -> float:
    """The integral of q sin(theta)/2 over (low, high), both below pi/2, for large r.

    By parts: q - 1/2 is the antiperiodic Euler polynomial E_1 of d, whose antiderivatives are E_(n+1)/(n+1)!.
    """
    mpmath.mp.dps = 60
    r = mpmath.mpf(r)

    def boundary(theta: float) -> mpmath.mpf:
        if theta == 0.0:
            return mpmath.mpf(0)
        d = 2 * r * mpmath.cot(mpmath.mpf(theta)) if theta < 0.5 * math.pi else mpmath.mpf(0)
        whole = mpmath.floor(d)
        slope = mpmath.taylor(lambda c: (1 + c * c) ** mpmath.mpf(-1.5) / 2, d / (2 * r), 12)
        sign = -1 if int(whole) % 2 else 1
        return sum(
            (-1) ** j
            * sign
            * mpmath.eulerpoly(j + 2, d - whole)
            / mpmath.factorial(j + 2)
            * slope[j]
            * mpmath.factorial(j)
            / (2 * r) ** (j + 1)
            for j in range(12)
        )

    mean = (mpmath.cos(mpmath.mpf(low)) - mpmath.cos(mpmath.mpf(high))) / 4
    return float(mean + boundary(low) - boundary(high))


@pytest.mark.parametrize("r", [1e2, 1e4, 1e8, 1e12])
def test_the_masses_of_bins_are_those_of_integration_by_parts(r: float) -> None:
    bins = ker.Bins(12)
    flux = ker.discretise(ker.RectangularTeethLaw(r), bins, tolerance=0.0).flux
    for cell in range(6):
        low, high = float(bins.edges[cell]), float(bins.edges[cell + 1])
        retro = 0.5 * mass_of_retro(r, low, high)
        assert flux[cell, cell] == pytest.approx(retro, abs=2e-16)
        assert flux[cell, 11 - cell] == pytest.approx(float(bins.weights[cell]) - retro, abs=2e-16)


@pytest.mark.parametrize("r", DEPTHS)
@pytest.mark.parametrize(
    "basis",
    [ker.Bins(64), ker.Legendre(24), ker.Panels([0.0, 1e-3, 0.1, 0.7, 1.5, 2.0, 3.0, math.pi], 4), ker.Legendre(150)],
    ids=repr,
)
def test_crevices_are_markov_reversible_and_do_nothing_to_even_functions(r: float, basis: ker.Basis) -> None:
    found = ker.discretise(ker.RectangularTeethLaw(r), basis, tolerance=0.0).symmetric
    allowed = 16.0 * EPS * basis.size
    assert np.linalg.norm(found @ basis.constant - basis.constant) < allowed
    assert np.linalg.norm(found - found.T) < 4.0 * allowed
    if isinstance(basis, ker.Legendre):
        # even functions are left alone, and odd ones stay odd
        assert np.allclose(found[::2, ::2], np.eye(-(-basis.size // 2)), atol=allowed)
        assert np.abs(found[::2, 1::2]).max() < allowed
