"""Walls with straight and curved hollows: the law is the mixture of the laws of the hollows."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.cells.hollow_shape import side_by_side
from asperity.kernels.laws.law import Combination
from asperity.kernels.walls.conditionals import adaptive_conditionals


def polygon(*vertices):
    return [geo.Segment(*ends) for ends in pairwise(vertices)]


def arc(left, right, half_angle):
    radius = 0.5 * (right - left) / math.sin(half_angle)
    centre = (0.5 * (left + right), radius * math.cos(half_angle))
    ends = -0.5 * np.pi - half_angle, -0.5 * np.pi + half_angle
    return [geo.Arc(centre, radius, *ends).pinned((left, 0.0), (right, 0.0))]


TRAPEZOID = polygon((0, 0), (0.1, -0.2), (0.2, -0.2), (0.3, 0))
BEZIER = [geo.Bezier([(0.6, 0), (0.7, -0.3), (0.9, 0)])]
DOVETAIL = polygon((0, 0), (0.1, 0), (0.02, -0.2), (0.3, -0.2), (0.25, 0), (0.31, 0))
BOTTLE = [
    *polygon((0.6, 0), (0.7, 0), (0.7, -0.05), (0.65, -0.05)),
    geo.Arc((0.75, -0.05), 0.1, np.pi, 2.0 * np.pi),
    *polygon((0.85, -0.05), (0.8, -0.05), (0.8, 0), (1, 0)),
]
WALLS = {
    "straight, arc and Bezier": [*TRAPEZOID, *arc(0.3, 0.6, 1.0), *BEZIER, *polygon((0.9, 0), (1, 0))],
    "straight and arcs": [
        *TRAPEZOID,
        *arc(0.3, 0.6, 1.0),
        *arc(0.6, 0.8, 0.4),
        *polygon((0.8, 0), (0.9, -0.3), (1, 0)),
    ],
    "overhanging": [*DOVETAIL, *arc(0.31, 0.6, 1.3), *BOTTLE],
}


@pytest.fixture(params=WALLS)
def wall(request):
    return geo.Wall(WALLS[request.param])


def test_the_mixture_of_the_hollows_agrees_with_rays_of_the_whole_wall(wall):
    law, basis = ker.WallLaw(wall), ker.Bins(6)
    assert isinstance(law.replacement, Combination)
    found = ker.discretise(law, basis, tolerance=1e-2, samples=2**17)
    rng = np.random.default_rng(5)
    x, theta = rng.random(2**18), np.arccos(1.0 - 2.0 * rng.random(2**18))
    traced = geo.trace(wall, x, theta)
    pairs = np.histogram2d(theta, traced.theta, bins=[basis.edges, basis.edges])[0] / x.size
    mass = np.diff(-np.cos(basis.edges)) / 2.0
    expected = found.symmetric * np.sqrt(mass[:, None] * mass)
    deviation = np.sqrt(np.maximum(expected * (1.0 - expected), 1e-9) / x.size)
    assert traced.escaped.mean() > 0.9999
    assert np.max(np.abs(pairs - expected) / (deviation + float(found.error) * mass.max())) < 4.5


def test_each_hollow_alone_is_a_valid_wall_with_the_same_opening(wall):
    alone = [
        geo.Wall(side_by_side(wall, [hollow]).pieces, side_by_side(wall, [hollow]).period) for hollow in wall.hollows
    ]
    for one, hollow in zip(alone, wall.hollows, strict=True):
        assert len(one.hollows) == 1 and one.hollows[0].width == pytest.approx(hollow.width, rel=1e-14)
        assert one.period >= hollow.width * (1.0 - 1e-14)


def test_the_hollows_together_have_the_cell_masses_of_quadrature_over_the_whole_wall(wall):
    law, theta, edges = ker.WallLaw(wall), np.array([0.2, 0.9, 1.7, 2.9]), np.linspace(0.0, np.pi, 8)
    whole = adaptive_conditionals(wall, theta, 1e-9, 0, edges[1:-1])
    below = whole.mean(lambda angle: (angle[:, None] < edges).astype(float))
    found = law.replacement.distribution(theta, edges).cumulative(edges)
    assert np.all(np.abs(found - below) <= 1e-9 + whole.error[:, None] + 2.0 * whole.unresolved[:, None])


def test_a_wall_of_straight_hollows_and_arcs_has_an_exact_law():
    law = ker.WallLaw(geo.Wall(WALLS["straight and arcs"]))
    exact = law.exact_law
    assert law.closed_form is None and isinstance(exact, Combination)
    assert math.fsum(weight for weight, _ in exact.terms) == pytest.approx(1.0, abs=1e-14)
    assert {type(part) for _, part in exact.terms} == {ker.PolygonLaw, ker.CircularArcLaw}
    assert ker.WallLaw(geo.Wall(WALLS["overhanging"])).exact_law is None
    assert float(ker.discretise(law, ker.Bins(16), tolerance=1e-6).error) < 1e-6


def test_walls_of_one_kind_of_hollow_or_without_room_for_their_hollows_stay_whole():
    caps = [
        *polygon(
            (0, 0), (0.4, 0), (0.4, -0.5), (0.1, -0.5), (0.1, -0.7), (0.8, -0.7), (0.8, -0.5), (0.5, -0.5), (0.5, 0)
        ),
        *polygon((0.5, 0), (0.75, 0), (0.75, -0.1), (0.65, -0.1)),
        geo.Arc((0.8, -0.1), 0.15, np.pi, 2.0 * np.pi),
        *polygon((0.95, -0.1), (0.85, -0.1), (0.85, 0), (1, 0)),
    ]
    for whole in (geo.Wall(caps), geo.mushrooms(0.3, 0.5), geo.koch(2), geo.dispersing_arcs(1.0)):
        assert ker.WallLaw(whole).replacement is None or ker.WallLaw(whole).closed_form is not None


def test_the_essential_edge_of_a_mixture_is_at_least_its_straight_fraction():
    from asperity.spectral.essential.edge import essential_edge

    edge = essential_edge(ker.WallLaw(geo.Wall(WALLS["straight, arc and Bezier"])))
    assert edge.low >= 0.4 - 1e-12 and edge.high <= 1.0
