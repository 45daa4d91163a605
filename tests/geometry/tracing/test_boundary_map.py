"""The billiard map: its inverse, its measure, known tables; nested domains against the tracer of walls."""

import math

import numpy as np
import pytest
from scipy.stats import kstest

from asperity import geometry as geo
from disk_shapes import NAMED_TABLES

TABLES = {
    **NAMED_TABLES,
    # convex on the right, with a concave wave on the left; neighbours do not join smoothly
    "bezier": geo.Container.from_curves([
        geo.Bezier([(0, -1), (1.5, -1.2), (1.8, 0.6), (0.2, 1)]),
        geo.Bezier([(0.2, 1), (-1.5, 1), (0.1, 0), (-1, -0.4)]),
        geo.Bezier([(-1, -0.4), (-0.6, -1.1), (0, -1)]),
    ]),
    "polygon": geo.Container.polygon([(0, 0), (3, 0), (1, 2)]).closed(),
}  # fmt: skip


def states(table: geo.Container, n: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    return rng.uniform(0.0, table.perimeter, n), np.arccos(rng.uniform(-1.0, 1.0, n))


@pytest.mark.parametrize("name", TABLES)
def test_the_reversed_map_is_the_inverse(name):
    # Rudzis 2022, Lemma 6.1 (i)
    s, theta = states(TABLES[name], 500)
    there = geo.billiard_map(TABLES[name], s, theta, 3)
    back = geo.billiard_map(TABLES[name], there.s, np.pi - there.theta, 3)
    # errors grow with the derivative of six flights
    np.testing.assert_allclose(np.pi - back.theta, theta, atol=1e-7)
    np.testing.assert_allclose(back.s, s, atol=1e-7)
    np.testing.assert_allclose(back.time, there.time, rtol=1e-7)


@pytest.mark.parametrize("name", TABLES)
def test_the_map_preserves_the_flux(name):
    # Lemma 6.2: a uniform sample of s and cos(theta) stays one
    table = TABLES[name]
    after = geo.billiard_map(table, *states(table, 20_000 if name != "bezier" else 4_000), 4)
    assert set(after.counts()) and np.all(after.status == geo.Status.ESCAPED)
    assert kstest(after.s / table.perimeter, "uniform").pvalue > 1e-4
    assert kstest(0.5 * (1.0 - np.cos(after.theta)), "uniform").pvalue > 1e-4


@pytest.mark.parametrize("name", TABLES)
def test_the_jacobian_is_the_ratio_of_the_sines(name):
    table, h = TABLES[name], 1e-5
    s, theta = states(table, 400, 1)
    s, theta = s, np.clip(theta, 0.2, math.pi - 0.2)
    columns, walls = [], []
    for shift in ((h, 0.0), (0.0, h)):
        ends = [geo.billiard_map(table, s + sign * shift[0], theta + sign * shift[1]) for sign in (1, -1)]
        columns.append([(ends[0].s - ends[1].s) / (2 * h), (ends[0].theta - ends[1].theta) / (2 * h)])
        walls += [end.wall for end in ends]
    determinant = columns[0][0] * columns[1][1] - columns[0][1] * columns[1][0]
    after = geo.billiard_map(table, s, theta)
    # neighbours on the same pieces, and not on both sides of s = 0
    same = np.all(np.array(walls) == after.wall, axis=0) & (np.max(np.abs(columns), axis=(0, 1)) < 50.0)
    start = np.array([table.point_at(s + d)[1] for d in (-h, h)])
    same &= (start[0] == start[1]) & (np.sin(after.theta) > 0.1)
    assert same.mean() > 0.5
    np.testing.assert_allclose(
        np.abs(determinant[same]) * np.sin(after.theta[same]) / np.sin(theta[same]), 1, rtol=1e-4
    )


def test_arc_lengths_and_points_are_inverse():
    for table in TABLES.values():
        s = np.linspace(0.0, table.perimeter, 1000, endpoint=False)
        points, wall = table.point_at(s)
        np.testing.assert_allclose(table.length_at(points, wall), s, atol=1e-12 * table.perimeter)
        steps = np.hypot(*np.diff(points, axis=0).T)[np.diff(wall) == 0]
        assert abs(steps.max() / (s[1] - s[0]) - 1.0) < 1e-4


def test_a_polygon_has_the_map_of_its_closed_sides():
    open_sides = geo.Container.polygon([(0, 0), (3, 0), (1, 2)])
    s, theta = states(open_sides, 20)
    maps = [geo.billiard_map(table, s, theta, 3) for table in (open_sides, TABLES["polygon"])]
    assert maps[0].s.tolist() == maps[1].s.tolist() and maps[0].theta.tolist() == maps[1].theta.tolist()


def test_the_map_of_a_circle_is_a_rotation():
    theta = np.linspace(0.1, 3.0, 7)
    after = geo.billiard_map(TABLES["circle"], np.zeros(7), theta, 5)
    np.testing.assert_allclose(after.theta, theta, atol=1e-14)
    turn = (after.s / 1.5 - 10.0 * theta) / (2 * math.pi)
    np.testing.assert_allclose(turn, np.round(turn), atol=1e-13)
    np.testing.assert_allclose(after.time, 5 * 2 * 1.5 * np.sin(theta), rtol=1e-13)


@pytest.mark.parametrize("wall", [geo.focusing_arcs(1.2), geo.triangular_teeth(1.0), geo.mushrooms(0.3, 0.4)])
def test_a_hollow_with_an_opening_reflects_like_the_wall(wall):
    pieces = [piece for piece in wall.pieces if not (piece.start[1] == 0.0 and piece.end[1] == 0.0
                                                     and isinstance(piece, geo.Segment))]  # fmt: skip
    left, right = pieces[0].start[0], pieces[-1].end[0]
    lid = geo.Segment((right, 0.0), (left, 0.0))
    hollow = geo.Container.from_curves([*pieces, lid])
    rng = np.random.default_rng(2)
    x, theta = rng.uniform(left, right, 400), np.arccos(rng.uniform(-0.99, 0.99, 400))
    found = geo.nested_reflection(hollow, [len(pieces)], hollow.perimeter - (x - left), theta)
    traced = geo.trace(wall, x, theta)
    assert np.all(found.status == geo.Status.ESCAPED)
    few = traced.collisions < 40
    np.testing.assert_array_equal(found.collisions[few], traced.collisions[few])
    np.testing.assert_allclose(found.theta[few], traced.theta[few], atol=1e-8)
    np.testing.assert_allclose(left + hollow.perimeter - found.s[few], traced.x[few], atol=1e-8)


def test_the_reflection_of_nested_domains_is_an_involution():
    # section 6.2.1: a stadium that is entered through both straight sides
    table = TABLES["stadium"]
    s, theta = states(table, 500, 3)
    s = np.where(s < table.perimeter / 2, s % 1.0, 1.0 + math.pi / 2 + s % 1.0)
    there = geo.nested_reflection(table, [0, 2], s, theta)
    assert set(there.wall) == {0, 2}
    good = there.status == geo.Status.ESCAPED
    assert good.mean() > 0.99
    back = geo.nested_reflection(table, [0, 2], there.s[good], there.theta[good])
    few = there.collisions[good] < 10
    np.testing.assert_allclose(back.s[few], s[good][few], atol=1e-8)
    np.testing.assert_allclose(back.theta[few], theta[good][few], atol=1e-8)


def test_the_limit_of_collisions_has_a_name():
    two = geo.Container.from_curves([geo.Arc((0, 0), 1.0, 0.0, 0.1), geo.Arc((0, 0), 1.0, 0.1, 2 * math.pi)])
    caught = geo.nested_reflection(two, [0], [0.05], [0.4], max_collisions=2)
    assert caught.counts()["bounce_limit"] == 1 and caught.collisions.tolist() == [3]
