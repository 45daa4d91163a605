"""Runs of hits computed in one step, and lines found through boxes: to be the same as hit by hit, line by line."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from campaigns.judges.plain_tracer import trace_precisely
from campaigns.judges.precise_rays import unfold

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.curves.columns import PARTNER
from asperity.geometry.tracing.compiled.pieces.lines import is_ahead
from asperity.geometry.tracing.refinement import REFINED_SEGMENTS, refined_trace

EPS = np.finfo(float).eps
# Counts fit into int64 up to here.
NO_LIMIT = 2**62


def rays(seed, n):
    rng = np.random.default_rng(seed)
    return rng.random(n), np.arccos(1.0 - 2.0 * rng.random(n))


@pytest.mark.parametrize(
    ("ratio", "theta"), [(1.0, 1e-12), (1e8, 1.0), (1e8, 1e-3), (7.3, 0.01), (1e6, 1e-6), (1e-6, 1e-12), (1e8, 2.9)]
)
def test_channels_of_rectangular_teeth_count_every_hit(ratio, theta):
    x, _ = rays(1, 20_000)
    law = ker.RectangularTeethLaw(ratio)
    traced = geo.trace(geo.rectangular_teeth(ratio), x, theta, max_collisions=NO_LIMIT)
    # A hit within 16 ulp of the depth of a joint is a corner, at the bottom after half of the d crossings or at the top
    # after all; one crossing sinks by the depth over d/2.
    d = law.crossings(theta)
    ahead = 2 * x - 1 if theta < np.pi / 2 else 2 - 2 * x
    slack = 64 * EPS * d * (1 + 1 / ratio)
    miss = [np.abs(place - np.round(place)) for place in (d - ahead, d / 2 - ahead)]
    clear = (x < 0.5) | (np.minimum(*miss) > slack)
    assert clear.mean() > 0.85
    assert traced.escaped[clear].all()
    assert np.array_equal(traced.collisions[clear], law.hits(x, theta)[clear])
    assert np.max(np.abs(traced.theta - law.reflect(x, theta))[clear]) <= 8 * EPS


def test_flags_in_deep_channels_are_settled_where_half_an_ulp_of_the_angle_meets_no_corner():
    # some 10^13 crossings down to the bottom; the position there is known to a hundredth of the width
    depth, width = 5e3, 0.5
    rng = np.random.default_rng(7)
    theta, place = 10.0 ** rng.uniform(-9.4, -8.8, 1_000), rng.random(1_000)
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
            exact = theta[ray] if min(out) % 2 else np.pi - theta[ray]
            assert abs(traced.theta[ray] - exact) <= 2.0 * np.spacing(exact) or meets_corner
        else:
            assert traced.status[ray] == geo.Status.CORNER and meets_corner
    assert 0 < np.sum(~traced.escaped) < 100


@pytest.mark.parametrize("angle", [3e-9, 1e-7, 1e-5, 1e-3, 0.02, 0.29])
@pytest.mark.parametrize("middle", [0.5, 0.83])
def test_rays_that_pass_an_apex_at_any_distance_are_those_of_the_unfolded_wedge(angle, middle):
    rng = np.random.default_rng(9)
    depth = float(0.5 / np.tan(angle / 2))
    vertices = [(0.0, 0.0), (middle, -depth), (1.0, 0.0)]
    wall = geo.Wall.from_vertices(vertices)
    slack = 16 * EPS * depth
    # lines at 4 slacks to 1e-3 of the depth from the apex, on either side, and rays near the axis
    x, far = rng.random(120), 10 ** rng.uniform(np.log10(4 * slack), np.log10(max(1e-3, 16 * slack)), 120)
    theta = np.arctan2(depth, x - middle) + rng.choice([-1, 1], 120) * far / np.hypot(depth, x - middle)
    theta[80:] = np.pi / 2 + rng.choice([-1, 1], 40) * 10 ** rng.uniform(-14, -1, 40)
    traced = geo.trace(wall, x, theta, max_collisions=NO_LIMIT)
    exact = [unfold(vertices, *ray) for ray in zip(x.tolist(), theta.tolist(), strict=True)]
    # nearer to a joint, at the apex or at an end of the opening, a ray is a corner hit within rounding
    clear = np.array([ray.from_joint for ray in exact]) > 8 * slack
    assert clear.mean() > 0.7 and traced.escaped[clear].all()
    for i in np.flatnonzero(clear):
        assert traced.collisions[i] == exact[i].hits
        assert abs(traced.theta[i] - exact[i].theta) <= 8 * EPS
        # the line is moved by some rounding errors of the depth
        assert abs(traced.x[i] - exact[i].x) * np.sin(traced.theta[i]) <= 16 * EPS * max(1.0, depth)


def test_flagged_rays_with_long_runs_along_an_arc_are_traced_in_one_step_too():
    rng = np.random.default_rng(10)
    wall = geo.focusing_arcs(np.pi / 2)
    x, theta = rng.uniform(1e-12, 2e-12, 40), np.pi / 2 - rng.uniform(0.5e-6, 1e-6, 40)
    refined = refined_trace(wall.scene, x, theta)
    assert np.count_nonzero(refined.status == 0) >= 38 and refined.collisions.min() > 10 * REFINED_SEGMENTS
    for i in np.flatnonzero(refined.status == 0):
        ray = trace_precisely(wall, x[i], theta[i], 10**9)
        assert ray.hits == refined.collisions[i]
        with mp.workdps(50):
            miss = [abs(mp.fsum(found[i]) - true) for found, true in ((refined.x, ray.x), (refined.theta, ray.theta))]
        assert max(miss) <= 2 * refined.rounding[i] < 1e-14


def test_a_line_a_slack_away_is_met_without_a_second_test():
    def ahead(t):
        # the height t (c_before - c_after) / length, with close = 1 and slack = 1e-3
        return is_ahead.py_func(t, 1.0, 2.0, 1.0, 1e-3)

    assert [ahead(t) for t in (1.5, 0.5, 2.1e-3, 1.9e-3, -0.5)] == [True, True, True, False, False]


def test_only_lines_that_face_each_other_freely_make_runs():
    assert geo.triangular_teeth(0.7).scene.pairs.size == 0
    assert len(geo.rectangular_teeth(1.0).scene.pairs) == 2
    # a tooth stands between the outer sides of this hollow: only the channels on either side of it make runs
    comb = [(0, 0), (0.1, 0), (0.1, -1), (0.2, -1), (0.2, -0.2), (0.25, -0.2), (0.25, -1), (0.4, -1), (0.4, 0), (1, 0)]
    pairs = geo.Wall.from_vertices(comb).scene.pairs
    assert sorted(pairs[:, PARTNER].tolist()) == [0.0, 2.0, 4.0, 6.0]


def test_a_run_stops_at_the_largest_number_of_collisions():
    wall = geo.rectangular_teeth(1e8)
    traced = geo.trace(wall, [0.7, 0.71], 0.3, max_collisions=100_001)
    assert traced.collisions.tolist() == [100_001] * 2
    assert traced.counts()["bounce_limit"] == 2
    arc = geo.trace(geo.focusing_arcs(np.pi / 2), 1e-11, np.pi / 2 + 1e-5, max_collisions=5_000)
    assert int(arc.collisions) == 5_000 and arc.counts()["bounce_limit"] == 1


def test_the_cost_of_a_run_does_not_grow_with_its_hits():
    """The wedge turns a ray pi/psi times, the channel a ray 2 r cot(theta) times: all of it within the bounce loop."""
    import time

    x, _ = rays(4, 100_000)
    walls = {depth: geo.rectangular_teeth(depth) for depth in (1e4, 1e8, 1e9)}
    least = dict.fromkeys(walls, np.inf)
    for _ in range(3):
        for depth, wall in walls.items():
            start = time.process_time()
            traced = geo.trace(wall, x, 1.0, max_collisions=NO_LIMIT, threads=1)
            least[depth] = min(least[depth], time.process_time() - start)
            assert traced.escaped.mean() > 0.9999
    # 1e5 times and 10 times the hits
    assert least[1e9] < 20 * least[1e4]
    assert least[1e9] < 1.5 * least[1e8]


def test_the_plan_tells_channels_wedges_and_trees():
    assert geo.rectangular_teeth(2.0).plan().channels == 1
    assert geo.triangular_teeth(0.1).plan().wedges == 1
    assert geo.triangular_teeth(0.7).plan().wedges == 0
    assert geo.koch(3).plan().hollows_with_grid == 0 and geo.koch(4).plan().hollows_with_grid == 1
    two = geo.Wall.from_vertices([(0, 0), (0.25, -0.5), (0.5, 0), (0.75, -0.5), (1, 0)]).plan()
    assert two.hollows == 2 and two.distinct_hollows == 1
