"""Rays in waves, eight at once: to be those of the loop hit by hit, to the last bit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from campaigns.judges.bezier_pieces import parabola_as_a_cubic, wall_with_inflections
from test_runs import random_teeth

from asperity import geometry as geo
from asperity.geometry.scene.columns import FORM_COLUMNS, START_X, START_Y, X1, X2, X3, Y1, Y2, Y3
from asperity.geometry.tracing import tracing
from asperity.geometry.tracing.compiled import closed_forms
from asperity.geometry.tracing.compiled.pointers import Late
from asperity.geometry.tracing.compiled.trigonometry import mirrored
from asperity.geometry.tracing.compiled.waves import MOST_HITS
from asperity.geometry.tracing.threads import new_flag

RAYS = 5_000


def valley_of_arcs():
    """One hollow of five arcs, focusing and dispersing in turn, and a line."""
    points = [(0, 0), (0.15, -0.25), (0.35, -0.4), (0.5, -0.5), (0.7, -0.35), (0.85, -0.3), (1, 0)]
    pieces = [geo.Segment(points[0], points[1])]
    for k, (start, end) in enumerate(pairwise(points[1:])):
        (x0, y0), (x1, y1), focusing = start, end, 1.0 if k % 2 else -1.0
        chord, bearing, half = np.hypot(x1 - x0, y1 - y0), np.arctan2(y1 - y0, x1 - x0), 0.5
        radius = 0.5 * chord / np.sin(half)
        centre = (
            0.5 * (x0 + x1) - focusing * radius * np.cos(half) * np.sin(bearing),
            0.5 * (y0 + y1) + focusing * radius * np.cos(half) * np.cos(bearing),
        )
        middle = bearing - focusing * np.pi / 2
        pieces.append(geo.Arc(centre, radius, middle - focusing * half, middle + focusing * half))
    return geo.Wall(pieces)


WALLS = {
    "mushroom": geo.mushrooms(0.3, 0.5),
    "koch": geo.koch(4),
    "dispersing arcs": geo.dispersing_arcs(1.0),
    "valley of arcs": valley_of_arcs(),
    "deep teeth": geo.rectangular_teeth(30.0),
    "teeth in boxes": random_teeth(400, 5),
    "profile": geo.Wall.from_profile(np.arange(300), np.random.default_rng(4).random(300)),
    "large": geo.mushrooms(0.4, 1.0).scaled(3e5),
    "double parabola": geo.double_parabola(),
    "nearly a parabola": geo.Wall(
        [
            parabola_as_a_cubic((0, 0), (0, -0.7), (0.5, -1.4), 1e-13),
            parabola_as_a_cubic((0.5, -1.4), (1, -0.7), (1, 0)),
        ]
    ),
    "inflections": wall_with_inflections(),
    "mixed": geo.Wall(
        [
            geo.Segment((0, 0), (0.2, -0.5)),
            geo.Bezier([(0.2, -0.5), (0.3, -0.9), (0.5, -0.2), (0.6, -0.5)]),
            geo.Bezier([(0.6, -0.5), (0.7, -0.5), (0.8, -0.3)]),
            geo.Segment((0.8, -0.3), (1, 0)),
        ]
    ),
    "many pieces": geo.random_wall(geo.HeightCorrelation(0.1), 16, rms_slope=0.5, smooth=True, rng=3),
}
BEZIERS = "double parabola", "nearly a parabola", "inflections", "mixed", "many pieces"


def rays_of(wall, seed):
    """Spread rays, some from the ends of the cell; rays through joints and up to 10^k ulps beside them; flat rays."""
    rng = np.random.default_rng(seed)
    x = wall.period * rng.uniform(-2.0, 3.0, RAYS)
    spread = np.arccos(1.0 - 2.0 * rng.random(RAYS))
    below = wall.scene.joints[wall.scene.joints[:, 1] < 0.0]
    x[:: RAYS // 8] = np.rint(x[:: RAYS // 8])
    joint = below[rng.integers(len(below), size=RAYS)]
    start = wall.period * rng.random(RAYS)
    aimed = np.arctan2(-joint[:, 1], start - joint[:, 0])
    aimed += np.rint(10.0 ** rng.uniform(-1.0, 9.0, RAYS)) * rng.choice([-1, 1], RAYS) * np.finfo(float).eps
    flat = 10.0 ** rng.uniform(-9.0, -1.0, RAYS)
    flat = np.where(rng.random(RAYS) < 0.5, flat, np.pi - flat)
    return np.concatenate([x, start, x]), np.clip(np.concatenate([spread, aimed, flat]), 1e-12, np.pi - 1e-12)


def tangent_rays(wall, seed):
    """Rays along tangents of Bezier pieces, up to 10^k ulps beside them, also at the ends of the pieces."""
    rng, curves = np.random.default_rng(seed), wall.scene.beziers
    row, s = curves[rng.integers(len(curves), size=RAYS)], rng.random(RAYS)
    s[::4] = np.rint(s[::4])
    x, y = row[:, START_X] + s * (row[:, X1] + s * row[:, X2]), row[:, START_Y] + s * (row[:, Y1] + s * row[:, Y2])
    x, y = x + s**3 * row[:, X3], y + s**3 * row[:, Y3]
    along = row[:, X1] + s * (2.0 * row[:, X2] + 3.0 * s * row[:, X3])
    theta = np.arctan2(row[:, Y1] + s * (2.0 * row[:, Y2] + 3.0 * s * row[:, Y3]), along) % np.pi
    theta += 10.0 ** rng.uniform(-16.0, -2.0, RAYS) * rng.choice([-1, 1], RAYS)
    theta = np.clip(theta, 1e-6, np.pi - 1e-6)
    return x - y / np.tan(theta), theta


def traced(monkeypatch, in_waves, *arguments, **options):
    monkeypatch.setattr(tracing, "_goes_in_waves", lambda scene, rays: in_waves)
    found = geo.trace(*arguments, **options)
    return found.x, found.theta, found.collisions, found.status


@pytest.mark.parametrize("limit", [3, 2**62])
@pytest.mark.parametrize("name", WALLS)
def test_a_wave_gives_each_ray_the_bits_of_the_loop(name, limit, monkeypatch):
    wall = WALLS[name]
    x, theta = rays_of(wall, 1)
    together = traced(monkeypatch, True, wall, x, theta, max_collisions=limit)
    one_by_one = traced(monkeypatch, False, wall, x, theta, max_collisions=limit)
    for mine, right in zip(together, one_by_one, strict=True):
        assert np.array_equal(mine, right)


@pytest.mark.parametrize("name", BEZIERS)
def test_tangent_rays_in_waves_have_the_bits_of_the_loop(name, monkeypatch):
    wall = WALLS[name]
    together, one_by_one = (traced(monkeypatch, waves, wall, *tangent_rays(wall, 6)) for waves in (True, False))
    for mine, right in zip(together, one_by_one, strict=True):
        assert np.array_equal(mine, right)


@pytest.mark.parametrize("name", ["mushroom", "koch", "dispersing arcs", "valley of arcs", "profile", *BEZIERS])
def test_few_rays_are_left_to_the_loop(name):
    wall = WALLS[name]
    x, theta = (part[:RAYS] for part in rays_of(wall, 2))
    closed = np.empty((0, FORM_COLUMNS)) if wall.scene.closed is None else wall.scene.closed
    results = np.empty(RAYS), np.empty(RAYS), np.empty(RAYS, np.int64), np.empty(RAYS, np.uint8)
    room = closed_forms.room_for(wall.scene.hollows, RAYS)
    closed_forms.trace_closed(x, theta, wall.scene.tables.address, closed, 2**62, results, room, closed_forms.CROSSINGS)
    assert np.mean(results[-1] == closed_forms.UNDECIDED) < 0.01


@pytest.mark.parametrize("name", ["valley of arcs", "teeth in boxes", "double parabola"])
def test_rays_that_enter_at_a_corner_are_flagged_in_waves(name, monkeypatch):
    theta = np.linspace(0.01, 3.13, 999)
    *_, status = traced(monkeypatch, True, WALLS[name], np.zeros(999), theta)
    assert np.all(status == geo.Status.CORNER)


def test_a_ray_is_the_same_whatever_rays_go_with_it(monkeypatch):
    wall = WALLS["mushroom"]
    x, theta = rays_of(wall, 3)
    whole = traced(monkeypatch, True, wall, x, theta)
    part = traced(monkeypatch, True, wall, x[5:2000:3], theta[5:2000:3])
    for all_rays, some in zip(whole, part, strict=True):
        assert np.array_equal(all_rays[5:2000:3], some)


def test_rays_that_come_in_for_others_and_rays_that_stay_long_have_the_bits_of_the_loop(monkeypatch):
    cave = [(0, 0), (0.49, 0), (0.1, -0.1), (0.3, -0.9), (0.8, -0.8), (0.93, -0.15), (0.51, 0), (1, 0)]
    wall, rng = geo.Wall.from_vertices(cave), np.random.default_rng(5)
    x, theta = rng.uniform(0.485, 0.515, tracing.MANY_RAYS + 999), rng.uniform(0.1, 3.0, tracing.MANY_RAYS + 999)
    together, one_by_one = (traced(monkeypatch, waves, wall, x, theta) for waves in (True, False))
    assert np.sum(one_by_one[2] > MOST_HITS) > 100
    for mine, right in zip(together, one_by_one, strict=True):
        assert np.array_equal(mine, right)


def test_waves_end_at_a_raised_flag_as_the_loop_does():
    wall, stop = WALLS["mushroom"], new_flag()
    stop[0] = 1
    x, theta = rays_of(wall, 4)
    results = np.empty_like(x), np.empty_like(x), np.empty(x.shape, np.int64), np.full(x.shape, 77, np.uint8)
    tracing._block_tracer(wall.scene, 10, stop, True)(x, theta, *results)
    assert np.all(results[-1] == 77)


def test_curves_without_waves_and_open_walls_stay_with_the_loop():
    for wall in (geo.triangular_teeth(0.7), geo.elliptical_arcs(1.0, geo.Disk(1.0, 0.6))):
        assert not tracing._goes_in_waves(wall.scene, 2**30)
    assert not tracing._goes_in_waves(geo.mushrooms(0.3, 0.5).scene, tracing.MANY_RAYS - 1)


def test_a_function_is_worth_its_compilation_once_it_is_wanted_often_or_stored():
    late = Late(mirrored, (np.float32(1.0),))
    assert not late.is_worth(4, 10)
    assert not late.is_worth(5, 10)
    assert late.is_worth(1, 10)
    used = Late(closed_forms.cross_simple, closed_forms.SIMPLE._arguments)
    closed_forms.SIMPLE.load()
    assert used.is_worth(1, 10)
