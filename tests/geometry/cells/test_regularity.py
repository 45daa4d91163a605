"""Singular points and the largest curvature of walls, against closed forms and a search."""

import math

import numpy as np
import pytest
from scipy.interpolate import BPoly
from scipy.optimize import minimize_scalar

from asperity import geometry as geo
from disk_shapes import PARABOLAS, STILL, WAVES


@pytest.mark.parametrize(
    ("wall", "expected"),
    [
        (geo.flat(), 0.0),
        (geo.koch(2), 0.0),
        (geo.dispersing_arcs(0.7), 0.7),
        # radius 1/(2 sin xi)
        (geo.focusing_arcs(1.2), 2 * math.sin(1.2)),
        # y^2 = 4x has the curvature 1/2 at its vertex
        (PARABOLAS, 0.5),
        (PARABOLAS.scaled(3.0), 0.5 / 3.0),
    ],
)
def test_the_largest_curvature_of_named_walls_is_known(wall, expected):
    found = wall.largest_curvature
    assert found.kind == "bound"
    assert abs(found.value - expected) <= found.error + 4e-16 * expected
    assert found.error <= 1e-11 * expected


def test_the_largest_curvature_of_an_ellipse_is_at_an_axis_inside_the_arc_or_at_an_end():
    # (a b)/(a^2 sin^2 + b^2 cos^2)^(3/2) from -pi to 0 passes its largest value a/b^2 or b/a^2
    for a, b in ((0.5, 0.2), (0.5, 0.9)):
        wall = geo.Wall([geo.Arc((0.5, 0.0), (a, b), -math.pi, 0.0)])
        assert float(wall.largest_curvature) == pytest.approx(max(a / b**2, b / a**2), rel=1e-14)
    half = geo.Arc((0.5, 0.0), (0.5, 0.2), -0.75 * math.pi, -0.25 * math.pi)
    low = half.start
    wall = geo.Wall([geo.Segment((0, 0), low), half, geo.Segment(half.end, (1, 0))])
    t = 0.25 * math.pi
    expected = 0.1 / math.hypot(0.5 * math.sin(t), 0.2 * math.cos(t)) ** 3
    assert float(wall.largest_curvature) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("number", range(15))
def test_the_largest_curvature_of_cubic_pieces_agrees_with_a_search(number):
    piece = [*WAVES.pieces, *map(geo.Bezier, np.random.default_rng(0).random((12, 4, 2)))][number]
    curve = BPoly(np.array(piece.control_points)[:, None], [0.0, 1.0])
    first, second = curve.derivative(), curve.derivative(2)

    def negative(s):
        (x, y), (u, v) = first(s).T, second(s).T
        return -np.abs(x * v - y * u) / np.hypot(x, y) ** 3

    grid = np.linspace(0.0, 1.0, 2001)
    best = grid[np.argmin(negative(grid))]
    found = minimize_scalar(negative, bounds=(max(best - 1e-3, 0.0), min(best + 1e-3, 1.0)), options={"xatol": 1e-12})
    searched = -min(found.fun, negative(best))
    value, error = piece.largest_curvature()
    assert value - error - 1e-9 * value <= searched <= value + error + 1e-12 * value


def test_a_vanishing_tangent_vector_has_no_finite_curvature():
    assert STILL.largest_curvature.value == math.inf


def test_singular_points_are_corners_and_jumps_of_the_curvature():
    # a segment that touches an arc smoothly: its tangent goes on, its curvature does not
    quarter = geo.Arc((0.5, 0.0), 0.5, -math.pi, -0.5 * math.pi)
    wall = geo.Wall([quarter, geo.Segment((0.5, -0.5), (1.0, -0.5)), geo.Segment((1.0, -0.5), (1.0, 0.0))])
    np.testing.assert_allclose(wall.singular_points, [[0, 0], [0.5, -0.5], [1, -0.5]], atol=1e-15)
    assert len(geo.flat().singular_points) == 0
    # a curve that is cut in two stays smooth
    bend = geo.Bezier([(0, 0), (0.2, -0.7), (0.6, -0.1), (1, 0)])
    cut = geo.Wall([*bend.split(0.4)])
    np.testing.assert_allclose(cut.singular_points, [[0, 0]], atol=1e-15)
    assert not cut.singular_points.flags.writeable


def test_islands_have_singular_points_and_curvature_too():
    wall = geo.Wall(
        [geo.Segment((0, -0.5), (1, -0.5))], islands=[[geo.Arc((0.4, -0.2), 0.1, 0.0, -2 * math.pi)]]
    )  # fmt: skip
    assert len(wall.singular_points) == 0
    assert float(wall.largest_curvature) == pytest.approx(10.0)
