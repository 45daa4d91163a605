"""Walls y = f(x): rays of the function itself, exact pieces, joints, and refusals."""

import math
import re

import numpy as np
import pytest
from campaigns.judges.formula_tracer import reflected

from asperity import InputError, WallError
from asperity import geometry as geo
from asperity import kernels as ker

of = geo.Wall.from_function


@pytest.mark.parametrize("amplitude", [0.05, 0.2, 0.5])
def test_rays_of_a_sinusoid_are_those_of_the_sine(amplitude):
    rng = np.random.default_rng(3)
    x, theta = rng.random(4000), np.arccos(rng.uniform(-1.0, 1.0, 4000))
    found = geo.trace(geo.sinusoid(amplitude), x, theta)
    out, hits = reflected(
        lambda x: -amplitude * np.sin(np.pi * x) ** 2,
        lambda x: -amplitude * np.pi * np.sin(2.0 * np.pi * x),
        2.0 * np.pi**2 * amplitude, x, theta,
    )  # fmt: skip
    off = np.abs(found.theta - out)
    assert np.array_equal(found.collisions, hits)
    # 10 tolerances over the width of a piece, twice at a mirror
    assert off[hits == 1].max() < 20.0 * 1e-9 * 64
    assert np.median(off) < 1e-7 and np.quantile(off, 0.99) < 1e-5


def test_gaps_of_a_sinusoid_do_not_depend_on_the_tolerance():
    from asperity import spectral as spec

    def gap(tolerance):
        wall = of(lambda x: -0.2 * np.sin(np.pi * x) ** 2, tolerance=tolerance)
        return spec.spectral_gap(ker.WallLaw(wall), 1e-3)

    coarse, fine = gap(1e-5), gap(1e-9)
    assert abs(coarse.value - fine.value) <= coarse.error + fine.error and fine.error <= 1e-3


def test_linear_parts_are_segments_and_jumps_are_vertical():
    teeth = of(lambda x: np.where(x < 0.5, 1.0, np.where(x < 0.75, 0.0, 4.0 * (x - 0.75))), breakpoints=[0.5, 0.75])
    assert teeth.vertices == pytest.approx(np.array([(0, 0), (0.5, 0), (0.5, -1), (0.75, -1), (1, 0)]), abs=1e-15)
    assert all(piece.is_straight for piece in teeth.pieces)
    assert of(lambda x: 3.0).depth == 0.0 and of(lambda x: 3.0).arc_length == 1.0
    # the height of the seam is that before it
    saw = of(lambda x: 0.5 * x)
    assert saw.vertices == pytest.approx(np.array([(0, 0), (0, -0.5), (1, 0)]), abs=1e-15)


def test_parabolas_and_cubics_are_exact():
    wall = of(lambda x: 4.0 * (x - 0.5) ** 3 - x, tolerance=1e-3)
    assert len(wall.pieces) <= 3
    x = wall.pieces[0].point(np.linspace(0, 1, 7))
    top = x[0, 1] - (4.0 * (-0.5) ** 3)
    assert x[:, 1] - top == pytest.approx(4.0 * (x[:, 0] - 0.5) ** 3 - x[:, 0], abs=1e-14)


@pytest.mark.parametrize(
    "height",
    [lambda x: np.cos(2 * np.pi * x), lambda x: 1 / (1 + 25 * (x - 0.5) ** 2), lambda x: np.sin(2 * np.pi * x)],
)
@pytest.mark.parametrize("tolerance", [1e-4, 1e-8])
def test_joints_of_a_smooth_function_are_smooth(height, tolerance):
    wall = of(height, tolerance=tolerance)
    assert wall.is_mirror_symmetric == (abs(height(np.array(0.3)) - height(np.array(0.7))) < 1e-9)
    for before, after in zip(wall.pieces, wall.pieces[1:], strict=False):
        (ax, ay), (bx, by) = before.tangent(1.0), after.tangent(0.0)
        assert abs(ax * by - ay * bx) < 1e-12


def test_the_function_may_have_any_period_and_level_and_is_called_with_arrays():
    shapes = []

    def height(x):
        shapes.append(np.shape(x))
        return 7e3 + 2.5 * np.cos(2 * np.pi * x / 80)

    wall = of(height, period=80.0, unit="µm")
    assert wall.depth == pytest.approx(5.0, abs=1e-7) and wall.unit == "µm" and all(len(one) == 1 for one in shapes)


@pytest.mark.parametrize(
    ("height", "options", "words"),
    [
        ("cos", {}, "height: expected a function of arrays of positions, got 'cos'"),
        (lambda x: np.where(x < 0.3, 0.0, x - 0.3), {}, "but near x = 0.3 heights differ by"),
        (lambda x: -np.sqrt(0.25 - (x - 0.5) ** 2), {}, "make an Arc where the wall is vertical"),
        (lambda x: np.where(x < 0.31, 0.0, -1.0), {}, "near x = 0.31 heights differ by 0.6"),
        (lambda x: np.where(x < 0.3, 0.0, np.nan), {}, "height: expected finite heights, got nan at x = 0.30"),
        (lambda x: 1.0 if x < 0.5 else 0.0, {}, "numpy.vectorize(function)"),
        (np.cos, {"tolerance": 1e-13}, "tolerance: expected a number in [1e-11, 0.01]"),
        (np.cos, {"tolerance": 0.1}, "tolerance: expected a number in [1e-11, 0.01]"),
        (np.cos, {"period": 0.0}, "period"),
        (np.cos, {"breakpoints": [0.5, 1.5]}, "breakpoints: expected a list of positions in [0, 1], got [0.5, 1.5]"),
        (np.cos, {"breakpoints": [math.nan]}, "breakpoints"),
        (np.cos, {"breakpoints": 0.5}, "breakpoints: expected a list of positions in [0, 1], got 0.5"),
        (lambda x: x + 1j, {}, "values of the function"),
        (lambda x: 1e5 + 0.1 * np.cos(2 * np.pi * x + 1), {}, "a tolerance above the rounding or noise of the heights"),
    ],
)
def test_what_is_no_wall_is_refused_with_the_place(height, options, words):
    with pytest.raises((InputError, WallError), match=re.escape(words)):
        of(height, **options)


def test_what_the_refusals_advise_is_taken():
    assert len(of(lambda x: np.where(x < 0.3, 0.0, x - 0.3), breakpoints=[0.3]).pieces) == 3
    assert of(np.vectorize(lambda x: 1.0 if x < 0.5 else 0.0), breakpoints=[0.5]).depth == 1.0
    wall = geo.Wall([geo.Arc((0.5, 0.0), 0.5, math.pi, 2 * math.pi)])
    assert wall.depth == 0.5


@pytest.mark.parametrize(
    ("height", "slope", "bend", "tolerance"),
    [
        (lambda u: 0.0246 * np.arctan(u), lambda u: 0.0246 / (1 + u**2), lambda u: -0.0492 * u / (1 + u**2) ** 2, 9e-5),
        (lambda u: 0.2 / (1 + u**2), lambda u: -0.4 * u / (1 + u**2) ** 2,
         lambda u: (1.2 * u**2 - 0.4) / (1 + u**2) ** 3, 1e-3),
    ],
    ids=["step", "peak"],
)  # fmt: skip
def test_derivatives_hold_beside_narrow_details_at_coarse_tolerances(height, slope, bend, tolerance):
    middle, width = 0.476, 6e-4
    wall = of(lambda x: height((x - middle) / width), tolerance=tolerance)
    s = np.linspace(0.0, 1.0, 65)
    for piece in wall.pieces:
        h = piece.end[0] - piece.start[0]
        if h > 0.0:
            u = (piece.point(s)[:, 0] - middle) / width
            tangent = piece.tangent(s)
            steep = tangent[:, 1] / tangent[:, 0]
            second = np.array([piece.curvature(t) for t in s]) * np.hypot(1.0, steep) ** 3
            assert np.abs(steep - slope(u) / width).max() <= 10.0 * tolerance / h
            assert np.abs(second - bend(u) / width**2).max() <= 100.0 * tolerance / h**2


def test_a_narrow_peak_with_breakpoints_at_both_sides_is_seen_and_the_arguments_are_kept():
    wall = of(lambda x: 0.1 * np.exp(-(((x - 0.4) / 1e-5) ** 2)), breakpoints=[0.4 - 1e-4, 0.4 + 1e-4])
    assert wall.depth == pytest.approx(0.1, abs=1e-9)

    def changed(x):
        x -= 0.5
        return 0.1 * np.cos(2 * np.pi * x)

    assert of(changed).depth == pytest.approx(0.2, abs=1e-9)
