"""Fans and bowls in closed form against the loop, which follows them flight by flight, and against the twin."""

from __future__ import annotations

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from campaigns.judges.precise_polynomials import POLYNOMIALS, coefficients
from numba import njit

from asperity import geometry as geo
from asperity.geometry.tracing.compiled import trigonometry as angle_engine
from asperity.geometry.tracing.refinement import refined_trace
from asperity.geometry.tracing.tracing import Status

EPS = 2.0**-52
RAYS = 100_000
TWIN_RAYS = 3_000
# Errors of either way, in units of EPS times the derivative, a bounce; measured below 5.
UNITS = 32.0

WALLS = {
    "triangular teeth": geo.triangular_teeth(0.7),
    "flat teeth": geo.triangular_teeth(3.1),
    "narrowest fan": geo.triangular_teeth(0.301),
    "right angle": geo.triangular_teeth(np.pi / 2),
    "saw": geo.Wall.from_vertices([(0, 0), (0, -0.6), (1, 0)]),
    "leaning tooth": geo.Wall.from_vertices([(0, 0), (0.3, -0.5), (1, 0)]),
    "focusing arcs": geo.focusing_arcs(1.2),
    "semicircles": geo.focusing_arcs(np.pi / 2),
    "shallow arcs": geo.focusing_arcs(0.06),
    "far and large": geo.triangular_teeth(1.0).scaled(3e5),
    "several": geo.Wall(
        [
            geo.Segment((0, 0), (0.1, -0.3)),
            geo.Segment((0.1, -0.3), (0.3, 0)),
            geo.Segment((0.3, 0), (0.4, 0)),
            geo.Arc((0.5, 0.0), 0.1, np.pi, 2.0 * np.pi),
            geo.Segment((0.6, 0), (0.65, -0.2)),
            geo.Segment((0.65, -0.2), (0.85, -0.2)),
            geo.Segment((0.85, -0.2), (0.9, 0)),
            geo.Segment((0.9, 0), (1.0, 0)),
        ]
    ),
}


def flight_by_flight(wall):
    """The same wall without its closed forms."""
    plain = geo.Wall(wall.pieces, wall.period)
    plain.__dict__["scene"] = replace(wall.scene, closed=None)
    return plain


def spread_rays(wall, rng):
    return wall.period * rng.uniform(-2.0, 3.0, RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))


def aimed_rays(wall, rng):
    """At the joints, those of the opening among them, and up to 10^k ulps beside them."""
    joints = wall.scene.joints
    target = joints[rng.integers(len(joints), size=RAYS)]
    x = wall.period * rng.random(RAYS)
    theta = np.arctan2(-target[:, 1], x - target[:, 0])
    theta = theta + np.rint(10.0 ** rng.uniform(0.0, 9.0, RAYS)) * rng.choice([-1, 1], RAYS) * EPS
    return x, np.clip(theta, 1e-12, np.pi - 1e-12)


def grazing_rays(wall, rng):
    theta = 10.0 ** rng.uniform(-12.0, -2.0, RAYS)
    return wall.period * rng.random(RAYS), np.where(rng.random(RAYS) < 0.5, theta, np.pi - theta)


@pytest.mark.parametrize("make", [spread_rays, aimed_rays, grazing_rays])
@pytest.mark.parametrize("name", WALLS)
def test_closed_forms_agree_with_the_loop(name, make):
    wall = WALLS[name]
    x, theta = make(wall, np.random.default_rng(1))
    closed, loop = geo.trace(wall, x, theta), geo.trace(flight_by_flight(wall), x, theta)
    # next to a corner rounding decides in the loop which way a ray goes; the closed forms leave such rays to it
    assert np.array_equal(closed.status, loop.status)
    assert np.array_equal(closed.collisions, loop.collisions)
    assert np.max(np.abs(closed.theta - loop.theta)[closed.escaped]) <= 1e-9
    twin = refined_trace(wall.scene, x[:TWIN_RAYS], theta[:TWIN_RAYS])
    same = closed.escaped[:TWIN_RAYS] & (twin.status == Status.ESCAPED)
    same &= twin.collisions == closed.collisions[:TWIN_RAYS]
    assert same.mean() > (0.9 if make is aimed_rays else 0.999)
    unit = EPS * (1.0 + twin.collisions) * twin.amplification
    for traced in (closed, loop):
        miss = np.abs(traced.theta[:TWIN_RAYS] - twin.theta[:, 0] - twin.theta[:, 1])
        assert np.all(miss[same] <= UNITS * unit[same])
        # the position at the opening is as uncertain as the ray's distance from a fixed point, over the sine of its
        # angle
        miss = np.abs(traced.x[:TWIN_RAYS] - twin.x[:, 0] - twin.x[:, 1]) * np.sin(twin.theta[:, 0]) / wall.period
        assert np.all(miss[same] <= UNITS * unit[same] + EPS * np.abs(x[:TWIN_RAYS][same]) / wall.period)


@pytest.mark.parametrize("name", WALLS)
def test_every_ray_is_computed_alike_whatever_its_neighbours(name):
    wall = WALLS[name]
    x, theta = spread_rays(wall, np.random.default_rng(2))
    x, theta = x[:5000], theta[:5000]
    whole = geo.trace(wall, x, theta, threads=2)
    parts = [geo.trace(wall, x[i : i + 7], theta[i : i + 7]) for i in range(0, 5000, 7)]
    for field in ("x", "theta", "collisions", "status"):
        assert np.array_equal(getattr(whole, field), np.concatenate([getattr(part, field) for part in parts]))


@pytest.mark.parametrize("limit", [1, 2, 3])
def test_the_largest_number_of_collisions_ends_rays_alike(limit):
    for name in ("triangular teeth", "semicircles", "several"):
        x, theta = spread_rays(WALLS[name], np.random.default_rng(3))
        closed = geo.trace(WALLS[name], x, theta, max_collisions=limit)
        loop = geo.trace(flight_by_flight(WALLS[name]), x, theta, max_collisions=limit)
        assert closed.counts() == loop.counts() and closed.counts()["bounce_limit"] > 1000
        assert np.array_equal(closed.collisions, loop.collisions)


def test_the_plan_counts_closed_forms():
    assert WALLS["several"].plan().closed_forms == 2
    for name in set(WALLS) - {"several"}:
        assert WALLS[name].plan().closed_forms == 1
    # too narrow, too shallow, more than a half circle, an apex beside the opening, a third line
    leaning = geo.Wall.from_vertices([(0, 0), (-0.1, -0.5), (1, 0)])
    round_bottle = geo.Arc((0.5, -0.2), np.hypot(0.2, 0.2), 0.75 * np.pi, 2.25 * np.pi)
    bottle = geo.Wall([geo.Segment((0, 0), (0.3, 0)), round_bottle, geo.Segment((0.7, 0), (1, 0))])
    for wall in (geo.triangular_teeth(0.2), geo.focusing_arcs(0.01), bottle, leaning, geo.rectangular_teeth(1.0)):
        assert wall.plan().closed_forms == 0


@pytest.mark.parametrize("name", POLYNOMIALS)
def test_polynomials_have_the_coefficients_of_their_script(name):
    assert getattr(angle_engine, name) == coefficients(name)


@njit(error_model="numpy")
def sines_and_angles(theta, sine, cosine, angle):
    for i in range(theta.shape[0]):
        sine[i], cosine[i] = angle_engine.sine_cosine(theta[i])
        angle[i] = angle_engine.direction_angle(cosine[i], sine[i])


def test_sines_and_angles_are_exact_to_two_ulps():
    rng = np.random.default_rng(4)
    tiny = 10.0 ** rng.uniform(-300.0, 0.0, 500)
    theta = np.concatenate(
        [
            np.pi * rng.random(1500),
            tiny,
            np.pi - 10.0 ** rng.uniform(-15.0, 0.0, 500),
            np.pi / 2 + tiny * rng.choice([-1, 1], 500),
            np.pi / 4 + np.arange(-20, 20) * EPS,
        ]
    )
    sine, cosine, angle = np.empty_like(theta), np.empty_like(theta), np.empty_like(theta)
    sines_and_angles(theta, sine, cosine, angle)
    with mp.workdps(40):
        for t, s, c, a in zip(theta.tolist(), sine.tolist(), cosine.tolist(), angle.tolist(), strict=True):
            for found, exact in ((s, mp.sin(t)), (c, mp.cos(t)), (a, mp.atan2(s, c))):
                assert abs(found - exact) <= 2.0 * np.spacing(abs(float(exact)))
