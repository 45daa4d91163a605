"""Bounds of the gap of dispersing arcs from rays that are reflected once, against the gap and against traced rays."""

from __future__ import annotations

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.errors import InputError
from asperity.spectral.bounds.curvature import least_density, lowest_seen


# 0.0373305 is computed by enclosures; those of the other curvatures by `spec.spectral_gap` in the specular frame
@pytest.mark.parametrize(("curvature", "gap"), [(1 / 3, 0.0373305), (1.0, None), (1.5, None)])
def test_the_gap_lies_between_the_bounds_which_are_near_each_other(curvature, gap):
    found = spec.curvature_gap_bounds(curvature, 200)
    if gap is None:
        law = ker.WallLaw(geo.dispersing_arcs(curvature)).in_specular_frame()
        known = spec.spectral_gap(law, tolerance=1e-3)
        gap, error = float(known), known.error
        assert error < 0.01 * gap
    else:
        error = 1e-6
    assert found.lower < gap + error
    assert gap - error < float(found.upper) + found.upper.error
    assert found.lower > (0.85 if curvature <= 1.0 else 0.7) * gap


def test_the_lower_bound_approaches_the_gap_with_more_bins():
    lower = [spec.curvature_gap_bounds(1 / 3, bins).lower for bins in (100, 200, 400)]
    assert lower[0] < lower[1] < lower[2] < 0.0373305
    assert 0.0373305 - lower[2] < 0.6 * (0.0373305 - lower[0])


def test_the_upper_bound_of_shallow_arcs_is_a_third_of_the_squared_curvature():
    for curvature in (0.05, 0.1):
        found = spec.curvature_gap_bounds(curvature, 50)
        assert abs(float(found.upper) / curvature**2 - 1 / 3) < 0.5 * curvature


@pytest.mark.parametrize("curvature", [0.4, 1.2])
def test_the_density_is_below_that_of_traced_rays_and_near_it(curvature):
    edges = np.linspace(0.05, math.pi - 0.05, 61)
    weight = 0.5 * (np.cos(edges[:-1]) - np.cos(edges[1:]))
    expected = least_density(curvature, edges) * weight[:, None] * weight
    rng, n = np.random.default_rng(6), 400_000
    theta = np.arccos(1.0 - 2.0 * rng.random(n))
    ray = geo.trace(geo.dispersing_arcs(curvature), rng.random(n), theta)
    once = ray.escaped & (ray.collisions == 1)
    counts, _, _ = np.histogram2d(theta[once], math.pi - ray.theta[once], bins=(edges, edges))
    noise = np.sqrt(counts + 1.0) / n
    assert np.all(counts / n - expected > -4.5 * noise)
    # coarse bins lose about a fifth at the boundary of the exposed pairs
    assert np.sum(expected) > 0.6 * np.sum(counts) / n
    # the density itself, without bins: the middle bin of a row far from the boundary
    assert abs(counts[30, 30] / n - expected[30, 30]) < 5.0 * noise[30, 30] + 0.01 * expected[30, 30]


def test_the_least_elevation_that_sees_the_sky_is_that_of_rays():
    """Rays along the tangent that the formula gives touch the next arc; a ray a little higher reaches the point."""
    curvature = 0.9
    slope = np.array([-0.4, -0.25, -0.1, -0.05])
    lowest = lowest_seen(curvature, slope)
    x, y = -np.sin(slope) / curvature, -(1.0 - np.cos(slope)) / curvature
    wall = geo.dispersing_arcs(curvature)
    for shift, reaches in ((1e-4, True), (-1e-4, False)):
        theta = lowest + shift
        # from the point back to y = 0
        ray = geo.trace(wall, np.mod(x - y / np.tan(theta), 1.0), theta)
        single = np.abs(ray.theta - (math.pi - theta + 2.0 * slope)) < 1e-6
        assert np.all(single == reaches)


def test_wrong_arguments_are_refused():
    for curvature in (0.0, 1.6, math.nan):
        with pytest.raises(InputError, match="curvature"):
            spec.curvature_gap_bounds(curvature)
    with pytest.raises(InputError, match="bins"):
        spec.curvature_gap_bounds(1.0, 10)
