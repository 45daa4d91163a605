"""Rays aimed at corners and tangencies: none lost, none wrong but for conditioning."""

from __future__ import annotations

import math

import numpy as np
import pytest
from campaigns.rays.aimed_rays import WALLS, explained, follow_twin

from asperity import geometry as geo
from asperity.geometry.tracing.compiled.pieces.records import Rays, results_for
from asperity.geometry.tracing.compiled.rays import trace_into
from asperity.geometry.tracing.refinement import refined_trace
from asperity.geometry.tracing.threads import new_flag

RAYS = 3_000


def test_a_ray_that_was_moved_is_wrong_and_no_conditioning_explains_it():
    wall, rng = geo.triangular_teeth(0.7), np.random.default_rng(1)
    x, theta = rng.random(50), np.arccos(1.0 - 2.0 * rng.random(50))
    traced = geo.trace(wall, x, theta)
    assert explained(wall, traced, x, theta, follow_twin).all()
    assert not explained(wall, traced, x, theta + 1e-9, follow_twin).any()


def test_rays_over_many_bezier_pieces_hit_what_the_double_double_twin_hits():
    # the twin tests every piece, the loop those whose circles the ray meets; a ray without hit would be traced again
    wall = geo.random_wall(geo.HeightCorrelation(0.1), 32, rms_slope=1.0, smooth=True, rng=3)
    rng = np.random.default_rng(12)
    x, theta = rng.random(RAYS), np.arccos(1.0 - 2.0 * rng.random(RAYS))
    found = results_for(RAYS)
    trace_into(Rays(x, theta, *found, new_flag()), wall.scene.tables, 1000)
    _, out_theta, collisions, status = found
    twin = refined_trace(wall.scene, x, theta)
    assert (status == geo.Status.ESCAPED).all() and collisions.max() > 3
    assert np.array_equal(collisions, twin.collisions)
    assert np.abs(out_theta - twin.theta[:, 0]).max() < 1e-11


@pytest.mark.parametrize(
    ("name", "x", "theta"),
    [
        ("cubic bumps", 0.8301588680018963, 1.2919607451958173),
        ("four arcs", 0.15442430372297744, 1.4884981590669946),
    ],
)
def test_double_doubles_settle_a_ray_that_sensitive_and_insensitive_bounces_take_in_turn(name, x, theta):
    # beside a corner, and inside for 200 bounces more: the product of two norms bounds the rounding by 1e-15, not 1e-20
    twin = refined_trace(WALLS[name].scene, np.array([x]), np.array([theta]), 200)
    assert twin.status[0] == geo.Status.BOUNCE_LIMIT and twin.collisions[0] == 200 and twin.rounding[0] < 1e-19
    assert geo.trace(WALLS[name], x, theta, max_collisions=200).status == geo.Status.BOUNCE_LIMIT


@pytest.mark.parametrize(
    ("x", "theta"), [(0.5, 0.5 * math.pi), (0.0, 0.5 * math.pi), (0.25, 0.75 * math.pi), (0.75, 0.25 * math.pi)]
)
def test_a_corner_hit_exactly_is_reported_and_one_two_ulps_away_is_not(x, theta):
    # aimed straight down, and at 45 degrees, at the corner (1/2, -1/4) of a notch
    notch = geo.Wall.from_vertices([(0.0, 0.0), (0.5, -0.25), (1.0, 0.0)])
    assert geo.trace(notch, x, theta).status == geo.Status.CORNER
    if x > 0.0:
        beside = geo.trace(notch, x, theta + np.spacing(theta) * np.array([-2.0, 2.0]))
        assert beside.escaped.all()
