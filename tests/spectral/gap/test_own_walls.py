"""Gaps of curved walls without symmetry: to their tolerance, within the time limit, never worse for more work."""

import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from campaigns.cases.random_curved_walls import random_curved_wall

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.core import long_runs
from asperity.core.long_runs import time_limited
from asperity.spectral.bounds.enclosure import enclosed_trial_space
from asperity.spectral.bounds.operator_residuals import residuals
from asperity.spectral.bounds.rays_on_panels import values_by_rays
from asperity.spectral.bounds.separation import rest_of_spectrum
from asperity.spectral.bounds.trial_space import adapted_trial_space
from asperity.spectral.eigenvalues.spectra import SpectrumErrors, matrix_spectrum
from asperity.spectral.essential.edge import essential_edge
from asperity.spectral.gap import refinement


def bezier_wall(seed):
    """Two or three Bezier pieces below their chords."""
    rng = np.random.default_rng(seed)
    number = rng.integers(2, 4)
    x = np.concatenate([[0], np.sort(rng.random(number - 1)), [1]])
    y = np.concatenate([[0], -0.2 - 0.3 * rng.random(number - 1), [0]])
    pieces = []
    for (a, b), (c, d) in pairwise(zip(x, y, strict=True)):
        inner = [
            (a + part * (c - a) / 3, b + part * (d - b) / 3 - 0.2 * rng.random()) for part in (1, 2)
        ]  # fmt: skip
        pieces.append(geo.Bezier([(a, b), *inner, (c, d)]))
    return geo.Wall(pieces)


SKEW = ker.WallLaw(geo.Wall([geo.Bezier([(0, 0), (0.1, -0.6), (0.7, -0.5), (1, 0)])]))


def counted(function):
    """The result, and the seconds counted."""
    with time_limited(1e9):
        found = function()
        return found, 1e9 - long_runs._seconds_left.get()[0]


# some itineraries are taken in narrow intervals of angles only, between the nodes of coarse panels
@pytest.mark.slow
@pytest.mark.parametrize(("seed", "value"), [(4, 1.0 - 0.0462200), (1, 1.0 - 0.0555477)])
def test_coarse_enclosures_see_narrow_intervals_of_angles(seed, value):
    law = ker.WallLaw(bezier_wall(seed))
    for number, tolerance in ((2, 1e-2), (3, 1e-3), (2, 1e-4)):
        largest = max(
            (one for one in spec.enclosures(law, number, tolerance=tolerance) if one.index != 0),
            key=lambda one: one.value,
        )
        assert largest.low - 5e-7 <= value <= largest.high + 5e-7


# by enclosures of four eigenvalues with another order and tolerance
@pytest.mark.slow
@pytest.mark.parametrize(("seed", "gap", "error"), [(0, 0.063472, 1.2e-5), (1, 0.05557, 4e-5), (4, 0.04623, 4e-5)])
def test_gaps_whose_eigenfunctions_oscillate_reach_their_tolerance(seed, gap, error):
    found = spec.spectral_gap(ker.WallLaw(bezier_wall(seed)), 1e-4)
    assert found.verdict == "isolated" and found.error <= 1e-4
    assert abs(found.value - gap) <= found.error + error


@pytest.mark.slow
def test_a_smaller_tolerance_or_a_longer_limit_gives_no_larger_error():
    law = ker.WallLaw(bezier_wall(5))
    errors = [spec.spectral_gap(law, tolerance, time_limit=2.0).error for tolerance in (1e-2, 1e-4, 1e-8)]
    assert errors == sorted(errors, reverse=True) and errors[-1] < 1e-3
    errors = [spec.spectral_gap(law, 1e-6, time_limit=limit).error for limit in (0.5, 2.0)]
    assert errors == sorted(errors, reverse=True) and errors[-1] < errors[0]


@pytest.mark.slow
@pytest.mark.parametrize("wall", [bezier_wall(0), random_curved_wall(0), random_curved_wall(5)], ids=["1", "2", "3"])
def test_counted_seconds_are_processor_seconds_within_a_factor_of_two(wall):
    law, spent = ker.WallLaw(wall), []
    for _ in range(4):
        # the first one compiles
        begun = time.process_time()
        _, nominal = counted(lambda: enclosed_trial_space(law, 2, None, 1e-3))
        spent.append(time.process_time() - begun)
    assert 0.5 < nominal / min(spent) < 2.0


def test_a_limit_within_a_limit_counts_against_both():
    with time_limited(3.0):
        with time_limited(2.0):
            long_runs.count_time(1.5)
        with pytest.raises(long_runs.OutOfTime), time_limited(2.0):
            long_runs.count_time(1.6)


def test_the_largest_eigenvalue_needs_none_of_larger_modulus():
    """The arc of half angle .6 has .286691174546(10), and -.5378593."""
    found = enclosed_trial_space(ker.CircularArcLaw(0.6), 2, None, 1e-6, np.positive).enclosures
    assert found[1].index == 1 and found[1].width < 2e-6
    assert found[1].low - 1e-8 <= 0.286691174546 <= found[1].high + 1e-8
    assert found.separation.radius < 0.28


@pytest.mark.slow
def test_a_norm_costs_no_more_than_a_gap():
    gap, seconds = counted(lambda: spec.spectral_gap(SKEW, 1e-4))
    norm, longer = counted(lambda: spec.spectral_gap(SKEW.in_specular_frame(), 1e-4))
    assert max(gap.error, norm.error) <= 1e-4 and longer < 1.5 * seconds


@pytest.mark.slow
def test_a_spectrum_has_the_best_enclosures_or_quotients_of_its_time():
    law = ker.WallLaw(bezier_wall(5))
    rough, fine = spec.spectrum(law, 2, tolerance=1e-9, time_limit=4.0), spec.enclosures(law, 4, tolerance=1e-3)
    # enclosures and rays have nearly equal errors after this time
    assert rough.errors.total()[1] < 2e-4
    assert abs(rough.values[1] - fine[1].value) <= rough.errors.total()[1] + 0.5 * fine[1].width


def test_a_refinement_ends_with_the_level_of_least_error(monkeypatch):
    level = matrix_spectrum(ker.discretise(ker.maxwell(0.5), ker.Legendre(4)), 3)
    tops, noise = iter((0.5, 0.6, 0.62, 0.621)), iter((0.0, 0.0, 1e-4, 5e-2))

    def next_level(*_, **__):
        sampling = np.array([next(noise)])
        return replace(level, gap=1.0 - next(tops), gap_errors=SpectrumErrors(0.0 * sampling, 9.0 + sampling, sampling))

    monkeypatch.setattr(refinement, "matrix_spectrum", next_level)
    found = refinement.refined(
        ker.henyey_greenstein(0.5), 1e-6, np.random.default_rng(0), 1.0, essential_edge(ker.henyey_greenstein(0.5))
    )
    assert found.finest.gap == pytest.approx(0.38) and found.error == pytest.approx(0.02 + 1.96e-4, abs=1e-6)


# the wall's eigenfunctions are at grazing angles; the gap is .00537(8) by enclosures to 1e-4
def test_a_rough_gap_does_not_overlook_grazing_eigenfunctions():
    found = spec.spectral_gap(ker.WallLaw(bezier_wall(8)), 0.03)
    assert abs(found.value - 0.00537) <= found.error + 1e-4


def test_rays_on_panels_bound_eigenvalues_from_below():
    """The arc of half angle .6 has .286691174546(10), and -.5378593."""
    above, below = values_by_rays(ker.CircularArcLaw(0.6))
    assert 0.24 < above[0] <= 0.2866912 and 0.5 < below[0] <= 0.5378594
    assert np.all(np.diff(above) <= 0.0) and np.all(np.diff(below) <= 0.0)
    assert values_by_rays(ker.WallLaw(bezier_wall(8)))[0][0] > 0.8


def test_a_rough_gap_does_not_overlook_an_eigenfunction_on_a_milliradian():
    """On the left side of this wall rays stay near 3.136; the gap is .016969(13) by enclosures to 1e-4."""
    points = [
        (0.0, 0.0), (0.031737594411543404, -0.23255464910259996), (0.06347518882308681, -0.2716773589130254),
        (0.09521278323463023, -0.37097678583764937), (0.3952563969880583, -0.5801061442415665),
        (0.6953000107414864, -0.45147293052028287), (0.9953436244949145, -0.4557258125210434),
        (0.9968957496632763, -0.4130341694727618), (0.9984478748316382, -0.29765140732060863), (1.0, 0.0),
    ]  # fmt: skip
    wall = geo.Wall([geo.Bezier(points[k : k + 4]) for k in (0, 3, 6)])
    found = spec.spectral_gap(ker.WallLaw(wall), 1e-2)
    assert abs(found.value - 0.016969) <= found.error + 1.3e-5 and found.error <= 1e-2


def test_no_separation_where_rays_show_another_eigenvalue():
    law = ker.WallLaw(bezier_wall(8))
    left_out = rest_of_spectrum(law, np.ones(1), 0.0, 0.78)
    assert left_out.radius == 1.0 and "rays show another eigenvalue" in left_out.reason
    assert rest_of_spectrum(law, np.ones(1), 0.0, 0.996).radius == 0.996


def test_the_next_panels_are_divided_where_residuals_are_larger_than_expected():
    law = ker.WallLaw(bezier_wall(4))
    space = adapted_trial_space(law, 2, 3e-3, np.positive)
    marked, not_marked = (
        residuals(law, space.basis, space.vectors, space.values, quotient_error=3e-3, expected=square).marks
        for square in (0.0, np.inf)
    )
    assert not not_marked.size
    found = enclosed_trial_space(law, 2, None, 1e-3, np.positive, space.finer)
    assert marked.size and np.any((marked > 0.0) & (marked < np.pi) & ~np.isin(marked, space.basis.edges))
    assert len(found.finer) > len(found.basis.edges)
