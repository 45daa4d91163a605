"""What lies beyond the listed eigenvalues: laws whose whole spectrum is known."""

import numpy as np
import pytest

from asperity import kernels as ker
from asperity.spectral.bounds import separation
from asperity.spectral.bounds.separation import lambertian_fraction, rest_of_spectrum

EPS = float(np.finfo(float).eps)
CONSTANTS = np.ones(1)


# The power p of a phase function's g for which |g|^p comes nearest to .6 on a scale of logarithms.
POWERS = {0.3: 1, -0.7: 1, 0.9: 5, 0.99: 51}


# ---- the Hilbert-Schmidt remainder -------------------------------------------------------------------------------
@pytest.mark.parametrize("g", [0.3, 0.9, -0.9, 0.9999])
def test_the_remainder_bounds_the_next_eigenvalue_and_is_not_far_above(g):
    apart = rest_of_spectrum(ker.henyey_greenstein(g), g ** np.arange(4.0), 1e-15, np.inf)
    assert abs(g) ** 4 <= apart.radius < abs(g) ** 3
    assert apart.kind == "bound"


@pytest.mark.parametrize("listed", [1, 2, 5])
@pytest.mark.parametrize("g", POWERS)
def test_the_remainder_of_a_phase_function_is_that_of_its_geometric_series(g, listed):
    """Of the eigenvalues g^l the sum of the powers 2 p from l = m on is that from 0 on times g^(2 p m)."""
    power = POWERS[g]
    apart = rest_of_spectrum(ker.henyey_greenstein(g), g ** np.arange(float(listed)), 0.0, np.inf)
    whole = sum(abs(g) ** (2 * power * degree) for degree in range(4000))
    assert apart.radius == pytest.approx(abs(g) ** listed * whole ** (0.5 / power), rel=1e-10)
    name = "P:" if power == 1 else f"P^{power}:"
    assert f"remainder of {name} {whole:.6g} less the squares of the {listed} listed" in apart.reason


def test_a_listed_eigenvalue_counts_only_as_far_as_its_interval_is_sure():
    """Of 1 and .5 with intervals of half width .25 at least .75 and .25 are sure; of .125 nothing is."""
    law = ker.henyey_greenstein(0.5)
    apart = rest_of_spectrum(law, np.array([1.0, -0.5, 0.125]), 0.25, np.inf)
    assert apart.radius == pytest.approx(np.sqrt(4.0 / 3.0 - 0.75**2 - 0.25**2), rel=1e-12)


def test_rounding_is_added_where_nothing_is_left():
    """With eighty of the eigenvalues listed: sixteen roundings of the sum; of rank one the rest is exactly 0."""
    apart = rest_of_spectrum(ker.lambertian(), CONSTANTS, 0.0, np.inf)
    assert apart.kind == "bound" and apart.radius == 0.0
    g = 0.9
    apart = rest_of_spectrum(ker.henyey_greenstein(g), g ** np.arange(80.0), 0.0, np.inf)
    power, whole = POWERS[g], 1.0 / (1.0 - g**10)
    assert 16.0 * EPS * (1.0 - 1e-6) <= apart.radius ** (2 * power) / whole <= 24.0 * EPS


@pytest.mark.parametrize("listed", [1, 2, 3])
def test_of_a_density_with_a_kink_on_the_diagonal_the_next_eigenvalue_and_the_norm_of_the_rest_are_left(listed):
    """In u = sin(theta/2)^2 and v the kernel is 1 plus the sum of 10 cos(k pi u) cos(k pi v)/(k pi)^2."""

    def density(theta, out):
        u, v = np.sin(0.5 * theta) ** 2, np.sin(0.5 * out) ** 2
        return 0.5 * np.sin(out) * (1.0 + 5.0 * (0.5 * (u * u + v * v) - np.maximum(u, v) + 1.0 / 3.0))

    apart = rest_of_spectrum(ker.DensityLaw(density), np.ones(listed), 0.0, np.inf)
    assert 5.0 / (listed * np.pi) ** 2 < apart.radius < 5.0 / (listed * np.pi) ** 2 + 1e-4
    assert apart.kind == "estimate"


def test_of_a_density_of_rank_two_the_second_eigenvalue_is_left():
    """1 + cos cos'/2 has the eigenvalue 1/2 <cos^2> = 1/6 beside 1."""
    law = ker.DensityLaw(lambda theta, out: 0.5 * np.sin(out) * (1.0 + 0.5 * np.cos(theta) * np.cos(out)))
    assert rest_of_spectrum(law, CONSTANTS, 0.0, np.inf).radius == pytest.approx(1.0 / 6.0, rel=1e-11)


@pytest.mark.parametrize("cut", [0.0, 0.3])
def test_a_density_that_jumps_is_integrated_from_jump_to_jump(cut):
    """Two states with the fractions (1 - c)/2 and (1 + c)/2, the same one again with .6: eigenvalues 1 and .6.

    A jump in the middle needs no breakpoint: the panels end there.
    """

    def density(theta, out):
        same = (np.cos(theta) > cut) == (np.cos(out) > cut)
        fraction = np.where(np.cos(out) > cut, 0.5 * (1.0 - cut), 0.5 * (1.0 + cut))
        return 0.5 * np.sin(out) * (0.4 + np.where(same, 0.6 / fraction, 0.0))

    law = ker.DensityLaw(density, [np.arccos(cut)] if cut else [])
    assert law.reversible
    assert rest_of_spectrum(law, CONSTANTS, 0.0, np.inf).radius == pytest.approx(0.6, rel=1e-10)


# ---- laws of which the structure tells ---------------------------------------------------------------------------
def test_a_law_of_rank_one_leaves_nothing():
    apart = rest_of_spectrum(ker.henyey_greenstein(0.0), CONSTANTS, 0.0, 0.4)
    assert apart.radius == 0.0 and apart.kind == "bound"


def test_beyond_the_constants_a_lambertian_fraction_is_a_bound():
    apart = rest_of_spectrum(ker.maxwell(0.25), CONSTANTS, 0.0, 0.4)
    assert (apart.radius, apart.kind) == (0.75, "bound") and "a Lambertian fraction a = 0.25" in apart.reason


@pytest.mark.parametrize(
    ("next_value", "radius", "kind"), [(0.4, 0.75, "bound"), (0.75, 0.75, "bound"), (0.8, 0.8, "estimate")]
)
def test_beyond_other_eigenvalues_it_is_the_essential_edge_or_the_next_value(next_value, radius, kind):
    """Of .25 Lambertian and .75 specular the essential spectrum ends at .75."""
    apart = rest_of_spectrum(ker.maxwell(0.25), np.array([1.0, 0.75]), 0.0, next_value)
    assert (apart.radius, apart.kind) == (radius, kind)
    assert ("norm of the essential part, 0.75" in apart.reason) == (kind == "bound")


def test_without_a_lambertian_fraction_the_next_value_is_an_estimate():
    apart = rest_of_spectrum(ker.CircularArcLaw(1.2), CONSTANTS, 0.0, 0.4)
    assert (apart.radius, apart.kind) == (0.4, "estimate")


@pytest.mark.parametrize(("top", "radius"), [(0.8, 1.0), (0.75, 0.75), (0.7, 0.75), (None, 0.75)])
def test_where_fast_oscillations_reach_further_than_the_next_value_nothing_is_known_to_be_left_below_one(
    monkeypatch, top, radius
):
    shown = None if top is None else (top, "what rays show")
    monkeypatch.setattr(separation, "fast_top", lambda law: shown)
    found = rest_of_spectrum(ker.CircularArcLaw(1.2), np.array([1.0, 0.9]), 0.0, 0.75)
    assert found.radius == radius and found.kind == "estimate"
    assert ("what rays show" in found.reason) == (radius == 1.0)


def test_the_lambertian_fraction_of_sums_and_products():
    diffuse, turned = ker.lambertian(), ker.specular()
    assert lambertian_fraction(diffuse) == 1.0 and lambertian_fraction(turned) == 0.0
    assert lambertian_fraction(0.25 * diffuse + 0.75 * turned) == pytest.approx(0.25)
    assert lambertian_fraction(turned @ diffuse) == 1.0
    assert lambertian_fraction((0.5 * diffuse + 0.5 * turned) ** 3) == pytest.approx(0.875)
    assert lambertian_fraction(ker.maxwell(0.5) @ ker.maxwell(0.25)) == pytest.approx(0.625)
    assert lambertian_fraction(ker.maxwell(0.25).in_specular_frame()) == pytest.approx(0.25)
    # the weights add up to 1 + 2e-16
    fractions = 0.1 * diffuse + 0.1 * diffuse + 0.4 * diffuse + 0.3 * diffuse + 0.1 * diffuse
    assert lambertian_fraction(fractions) == 1.0


def test_the_bound_for_a_matrix_is_beyond_the_rounding_and_the_asymmetry_of_its_entries():
    skew = 1e-9
    for excess, least in ((0.0, 0.4), (skew, 0.4 + skew)):
        law = ker.MatrixLaw([[0.7 + excess, 0.3 - excess], [0.3, 0.7]])
        radius = rest_of_spectrum(law, np.array([1.0]), 0.0, 0.0).radius
        assert least < radius < least + 2.0 * excess + 1e-14
