"""Extreme walls and rays against closed forms, scaling laws and the 50-digit tracer."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from campaigns.judges.precise_tracer import trace_precisely

from asperity import geometry as geo
from asperity.geometry.tracing.refinement import refined_trace

EPS = 2.0**-52
RAYS = 1_000
PRECISE_RAYS = 3
# The double tracer's error in units of EPS times the norm of the derivative, a bounce; below 5 wherever measured.
ERROR_UNITS = 32.0
GRAZING = np.array([1e-12, 1e-9, 1e-6, math.pi - 1e-6, math.pi - 1e-9, math.pi - 1e-12])


def island():
    floor = [geo.Segment((0.0, -0.8), (0.5, -1.0)), geo.Segment((0.5, -1.0), (1.0, -0.8))]
    return geo.Wall(floor, period=1.0, islands=[[geo.Arc((0.4, -0.4), 0.2, 0.0, -2.0 * np.pi)]])


WALLS = {
    "sharp teeth": geo.triangular_teeth(0.05),
    "blunt teeth": geo.triangular_teeth(math.pi - 1e-4),
    "flattest arcs": geo.focusing_arcs(1e-8),
    "shallow arcs": geo.focusing_arcs(1e-4),
    "semicircles": geo.focusing_arcs(0.5 * math.pi),
    "cusps": geo.dispersing_arcs(2.0),
    "tiny stems": geo.mushrooms(1e-8, 0.0),
    "short stems": geo.mushrooms(0.3, 0.0),
    "open with an island": island(),
    "overhang": geo.Wall.from_vertices([(0, 0), (0.4, 0), (0.2, -0.5), (0.9, -0.6), (0.6, 0), (1, 0)]),
    "shallow": geo.Wall.from_vertices([(0, 0), (0.5, -1e-9), (1, 0)]),
    "deep": geo.Wall.from_vertices([(0, 0), (0.5, -20.0), (1, 0)]),
    "large mushrooms": geo.mushrooms(0.3, 0.5).scaled(1e6),
    "small mushrooms": geo.mushrooms(0.3, 0.5).scaled(1e-6),
}


def rays(wall, seed, count):
    """Half of them spread over the flux, half at grazing angles."""
    rng = np.random.default_rng(seed)
    theta = np.where(rng.random(count) < 0.5, np.arccos(1.0 - 2.0 * rng.random(count)), rng.choice(GRAZING, count))
    hollow = wall.scene.hollows[rng.integers(len(wall.scene.hollows), size=count)]
    return hollow[:, 0] + (hollow[:, 1] - hollow[:, 0]) * rng.uniform(0.01, 0.99, count), theta


@pytest.mark.parametrize("name", WALLS)
def test_every_ray_is_right_to_rounding_times_its_condition(name):
    wall = WALLS[name]
    # a grazing ray passes a million cells of an open wall
    x, theta = rays(wall, 1, RAYS if wall.closes else RAYS // 8)
    traced = geo.trace(wall, x, theta, max_collisions=2_000)
    twin = refined_trace(wall.scene, x, theta, 2_000)
    gone = traced.escaped & (twin.status == geo.Status.ESCAPED)
    # the twin gives up rays that pass very many cells of an open wall, which are no collisions
    undecided = (twin.status == geo.Status.BOUNCE_LIMIT) & (twin.collisions < 2_000)
    assert wall.scene.is_open or not undecided.any()
    assert np.all((traced.status == twin.status) | undecided)
    error = np.abs((traced.theta - twin.theta[:, 0]) - twin.theta[:, 1])[gone]
    assert np.all(traced.collisions[gone] == twin.collisions[gone])
    assert np.all(error <= ERROR_UNITS * EPS * (twin.amplification * (1.0 + twin.collisions))[gone])


@pytest.mark.parametrize("name", WALLS)
def test_the_twin_agrees_with_fifty_digits(name):
    wall = WALLS[name]
    x, theta = rays(wall, 2, 60)
    twin = refined_trace(wall.scene, x, theta, 40)
    chosen = np.flatnonzero(twin.status == geo.Status.ESCAPED)[:PRECISE_RAYS]
    assert len(chosen) == PRECISE_RAYS
    for i in chosen:
        ray = trace_precisely(wall.scene, x[i], theta[i])
        assert ray.bounces == twin.collisions[i]
        assert abs(ray.theta - mp.mpf(twin.theta[i, 0]) - mp.mpf(twin.theta[i, 1])) <= twin.rounding[i]


@pytest.mark.parametrize("angle", [1e-4, 0.05, 1.0, math.pi - 1e-4])
def test_triangular_teeth_follow_their_closed_form(angle):
    wall = geo.triangular_teeth(angle)
    rng = np.random.default_rng(3)
    x, theta = rng.random(RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))
    traced = geo.trace(wall, x, theta)
    assert traced.escaped.all()
    count, expected = _teeth(x, theta, angle)
    # the closed form's arccos loses digits where |c| is near 1, and at an edge between two numbers of hits
    sure = traced.collisions == count
    assert np.mean(~sure) <= 1e-3
    assert np.max(np.abs(traced.theta - expected)[sure]) <= 64.0 * EPS * (1.0 + count.max())


def _teeth(x, theta, psi):
    """Hits and outgoing angle on triangular teeth, a ray that enters at x = 0 .. 1 from the left tip (fact 2)."""
    c = (1.0 - x) * np.cos(theta - 0.5 * psi) + x * np.cos(theta + 0.5 * psi)
    flip = c < 0.0
    angle, c = np.where(flip, math.pi - theta, theta), np.abs(c)
    hits = np.ceil((angle + np.arccos(np.minimum(c, 1.0))) / psi - 0.5)
    out = np.where(hits % 2 == 0, math.pi + angle - hits * psi, hits * psi - angle)
    return hits.astype(int), np.where(flip, math.pi - out, out)


@pytest.mark.parametrize("factor", [2.0**-20, 2.0**20])
def test_scaling_by_a_power_of_two_changes_no_angle(factor):
    for wall in (geo.mushrooms(0.3, 0.5), geo.triangular_teeth(0.7), geo.focusing_arcs(1.2)):
        x, theta = rays(wall, 4, RAYS)
        one, two = (
            geo.trace(wall, x, theta, max_collisions=500),
            geo.trace(wall.scaled(factor), factor * x, theta, max_collisions=500),
        )
        gone = one.escaped
        assert np.array_equal(one.status, two.status)
        assert np.max(np.abs(one.theta - two.theta)[gone]) <= 1e-9


@pytest.mark.parametrize(("theta", "height_to_width"), [(1e-12, 2.0), (1.0, 1e8), (1e-3, 1e4)])
def test_deep_channels_follow_the_law_of_rectangular_teeth(theta, height_to_width):
    from asperity import kernels as ker

    x = (np.arange(RAYS) + 0.5) / RAYS
    traced = geo.trace(geo.rectangular_teeth(height_to_width), x, np.full(RAYS, theta))
    weights, angles = ker.RectangularTeethLaw(height_to_width).branches(theta)
    # near grazing the last hit can lie within rounding of the bottom corners' depth: such rays are reported
    flagged = np.mean(traced.status == geo.Status.CORNER)
    assert traced.escaped.mean() + flagged == 1.0
    assert flagged <= 0.02
    # the number of crossings is known to a relative eps, and so is the fraction of each outcome
    crossings = 2.0 * height_to_width / np.tan(theta)
    unsure = 4.0 / RAYS + flagged + 4.0 * np.finfo(float).eps * crossings
    for weight, angle in zip(np.ravel(weights), np.ravel(angles), strict=True):
        fraction = np.mean(np.abs(traced.theta - angle) <= 64 * np.finfo(float).eps)
        # equidistant rays resolve the two intervals of each branch to one ray an end
        assert fraction == pytest.approx(weight, abs=unsure)


def test_flags_in_deep_channels_are_settled_where_half_an_ulp_of_the_angle_meets_no_corner():
    # some 10^13 crossings down to the bottom; the position there is known to a hundredth of the width
    depth, width = 5e3, 0.5
    rng = np.random.default_rng(7)
    theta, place = 10.0 ** rng.uniform(-9.4, -8.8, RAYS), rng.random(RAYS)
    traced = geo.trace(geo.rectangular_teeth(1e4), 0.5 + width * place, theta)
    ends = []
    with mp.workdps(50):
        for x, angle in zip(place.tolist(), theta.tolist(), strict=True):
            half_ulp = mp.mpf(float(np.spacing(angle))) / 2
            ways = [x - depth / width * mp.cot(mp.mpf(angle) + sign * half_ulp) for sign in (-1, 1)]
            ends.append([{int(mp.floor(way)) for way in ways}, {int(mp.floor(2 * way - x)) for way in ways}])
    for ray, (bottom, out) in enumerate(ends):
        meets_corner = len(bottom) > 1 or len(out) > 1
        if traced.escaped[ray]:
            exact = theta[ray] if min(out) % 2 else math.pi - theta[ray]
            assert abs(traced.theta[ray] - exact) <= 2.0 * np.spacing(exact) or meets_corner
        else:
            assert traced.status[ray] == geo.Status.CORNER and meets_corner
    assert 0 < np.sum(~traced.escaped) < RAYS / 10
