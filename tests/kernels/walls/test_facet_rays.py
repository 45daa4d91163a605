"""Rays from facet to facet: mirrors give the traced rays, retroreflectors all rays back, diffuse sides a slit."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.tracing.tracing import Status
from asperity.kernels.walls import faceted_law
from asperity.kernels.walls.faceted_law import FacetRays, follow_facets
from conftest import made
from wall_shapes import CLOSED, OPEN

RAYS = 200
# A ray of many hits doubles its rounding at each of them on dispersing pieces.
SAME = 1e-6


def rays_over(wall: geo.Wall, number: int = RAYS) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    return rng.random(number) * wall.period, ker.SINE.sample(number, rng)


@pytest.mark.parametrize("name", CLOSED | OPEN)
def test_facets_that_are_mirrors_reflect_as_the_wall_does_and_retroreflectors_send_back(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(faceted_law, "MOST_HITS", 30)
    wall = made((CLOSED | OPEN)[name])
    x, theta = rays_over(wall)
    rays = geo.trace(wall, x, theta)
    few = rays.escaped & (rays.collisions <= 30)
    outgoing, hits, status = follow_facets(wall, x, theta, lambda angle, _: np.pi - angle)
    assert few.mean() > 0.02 and np.mean(status[few] == Status.ESCAPED) > 0.99
    same = few & (status == Status.ESCAPED)
    assert np.array_equal(hits[same], rays.collisions[same])
    assert np.mean(np.abs(outgoing - rays.theta)[same] < SAME) > 0.99
    back, hits, status = follow_facets(wall, x, theta, lambda angle, _: angle)
    returned = status == Status.ESCAPED
    assert np.abs(back - theta)[returned].max() < 1e-8 and returned.mean() > 0.99 and hits[returned].max() == 1


def test_a_ray_does_not_depend_on_the_threads() -> None:
    wall = geo.focusing_arcs(1.0)
    found = []
    for threads in (1, 3):
        rays = FacetRays.entering(wall, *rays_over(wall, 20_000))
        who = rays.advance(np.arange(20_000), threads)
        rays.states.angle[who] = 0.5 * rays.states.angle[who]
        found.append((rays.advance(who, threads), *rays.states[1:]))
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other)


def test_rays_that_stay_longer_than_the_limit_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(faceted_law, "MOST_HITS", 2)
    wall = geo.triangular_teeth(0.3)
    x, theta = rays_over(wall)
    outgoing, hits, status = follow_facets(wall, x, theta, lambda angle, _: np.pi - angle)
    traced = geo.trace(wall, x, theta)
    late = traced.collisions > 2
    assert np.array_equal(status == Status.BOUNCE_LIMIT, late) and late.any()
    assert np.array_equal(outgoing[late], theta[late]) and np.all(hits[late] == 2)


def test_a_horizontal_ray_over_a_floor_ends_at_the_limit_of_segments_and_is_not_lost() -> None:
    wall = geo.Wall([geo.Segment((0.0, -1.0), (1.0, -1.0))], islands=[list(OPEN["island"]().islands[0])])
    rays = FacetRays.leaving(
        wall, *np.array([[0], [3], [0]]), np.array([[0.5, -1.0]]), np.array([[1.0, 0.0]]), np.array([1e-9])
    )
    assert not len(rays.advance(np.arange(1)))
    assert rays.states.status[0] == Status.BOUNCE_LIMIT


@pytest.mark.parametrize(("depth", "expected"), [(0.5, 0.80472), (1.0, 0.68438), (5.0, 0.35641)])
def test_diffuse_sides_of_a_notch_let_as_many_rays_to_its_floor_as_a_slit_lets_through(depth, expected) -> None:
    # transmission of slits by the integral equation of Clausing
    wall = geo.Wall.from_vertices([(0, 0), (0, -depth), (1, -depth), (1, 0)])
    rng, number = np.random.default_rng(2), 40_000
    rays = FacetRays.entering(wall, *rays_over(wall, number))
    who, reached = np.arange(number), 0
    while len(who := rays.advance(who)):
        is_floor = rays.states.point[who, 1] < -depth * (1.0 - 1e-12)
        reached += int(is_floor.sum())
        who = who[~is_floor]
        rays.states.angle[who] = np.arccos(1.0 - 2.0 * rng.random(len(who)))
    assert abs(reached / number - expected) < 4.0 * np.sqrt(0.25 / number)
