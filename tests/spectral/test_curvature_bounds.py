"""Bounds of the gap of dispersing arcs from rays that are reflected once, against the gap and against traced rays."""

import math
import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec
from asperity.spectral.bounds.curvature import least_density, lowest_seen

# 0.03732818 and its error are those of rays of a textbook tracer and 96 polynomials; the gaps of the other
# curvatures are those of `spec.spectral_gap` in the specular frame
GAP, GAP_ERROR = 0.03732818, 3.8e-7


@pytest.mark.parametrize(("curvature", "gap"), [(1 / 3, GAP), (1.0, None), (1.5, None)])
def test_the_gap_lies_between_the_bounds_which_are_near_each_other(curvature, gap):
    found = spec.curvature_gap_bounds(curvature, 200)
    if gap is None:
        law = ker.WallLaw(geo.dispersing_arcs(curvature)).in_specular_frame()
        known = spec.spectral_gap(law, tolerance=1e-3)
        gap, error = float(known), known.error
        assert error < 0.01 * gap
    else:
        error = GAP_ERROR
    assert found.lower < gap + error
    assert gap - error < float(found.upper) + found.upper.error
    assert found.lower > (0.85 if curvature <= 1.0 else 0.7) * gap


@pytest.mark.slow
def test_the_lower_bound_approaches_the_gap_with_more_bins():
    lower = [spec.curvature_gap_bounds(1 / 3, bins).lower for bins in (100, 200, 400)]
    assert lower[0] < lower[1] < lower[2] < GAP - GAP_ERROR
    assert GAP - lower[2] < 0.6 * (GAP - lower[0])


@pytest.mark.slow
def test_the_page_on_spectra_has_the_gaps_and_bounds_that_are_computed():
    """Every number of the table of dispersing arcs but the finest lower bound, which takes minutes."""
    page = (Path(__file__).parents[2] / "docs" / "theory" / "spectra.md").read_text(encoding="utf-8")
    number = r"\$(0\.\d+)\$"
    pattern = rf"^\| \$([\d/.]+)\$ \| {number}, {number}, \$0\.\d+\$ \| {number} \| {number} \|$"
    rows = re.findall(pattern, page, flags=re.MULTILINE)
    assert len(rows) == 3
    for curvature, *printed in rows:
        size = float(Fraction(curvature))
        coarse, fine = (spec.curvature_gap_bounds(size, bins) for bins in (200, 400))
        gap = spec.spectral_gap(ker.WallLaw(geo.dispersing_arcs(size)).in_specular_frame())
        for text, bound in zip(printed[:2], (coarse.lower, fine.lower), strict=True):
            # a lower bound is rounded down
            assert text == f"{math.floor(bound * 1e5) / 1e5:.5f}"
        for text, value in zip(printed[2:], (gap.value, fine.upper.value), strict=True):
            assert text == f"{float(value):.{len(text) - 2}f}"


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
