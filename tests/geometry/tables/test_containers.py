"""Containers with curved walls: closed forms, an independent tracer, invariance, and what is refused."""

import math
from itertools import cycle

import numpy as np
import pytest
from scipy.optimize import brentq

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.billiards.lyapunov import equilibrium_starts
from disk_shapes import NAMED_TABLES

DISK = geo.Disk(1.0, 0.6)


def lens() -> geo.Container:
    """Two elliptic arcs, a clockwise arc in the floor, and an obstacle of two pieces."""
    return geo.Container.from_curves([
        geo.Segment((-2, 0), (-0.5, 0)), geo.Arc((0, 0), 0.5, math.pi, 0.0), geo.Segment((0.5, 0), (2, 0)),
        geo.Arc((0, 0), (2.0, 1.5), 0.0, math.pi / 2), geo.Arc((0, 0), (2.0, 1.5), math.pi / 2, math.pi),
        geo.Arc((1.0, 0.7), 0.2, math.pi, 0.0), geo.Segment((1.2, 0.7), (0.8, 0.7)),
    ])  # fmt: skip


TABLES = {
    **NAMED_TABLES, "lens": lens(),
    # between the parabola y = x^2 and its chord, and the same with the degrees of both raised
    "bowl": geo.Container.from_curves([geo.Bezier([(-1, 1), (0, -1), (1, 1)]), geo.Segment((1, 1), (-1, 1))]),
    "raised": geo.Container.from_curves(
        [geo.Bezier([(-1, 1), (-1 / 3, -1 / 3), (1 / 3, -1 / 3), (1, 1)]), geo.Bezier([(1, 1), (0.3, 1), (-1, 1)])]
    ),
    # handles retracted at one end, at both, so that the piece is straight, and a cusp at which a curve was split
    "handles": geo.Container.from_curves([
        geo.Bezier([(-1, 0), (-1, 0), (0.4, -0.9), (1, 0)]), geo.Bezier([(1, 0), (1, 0), (1, 1), (1, 1)]),
        geo.Bezier([(1, 1), (0.2, 1.8), (0, 1), (0, 1)]), geo.Bezier([(0, 1), (-0.5, 1.4), (-1, 0), (-1, 0)]),
    ]),
    "cusp": geo.Container.from_curves([
        *geo.Bezier([(-1, 0), (1, 1), (-1, 1), (1, 0)]).split(0.5),
        geo.Segment((1, 0), (0, 3)), geo.Segment((0, 3), (-1, 0)),
    ]),
}  # fmt: skip


def plain_flight(table: geo.Container, position, velocity):
    """The first crossing of a ray with densely sampled curves, refined by bracketing; shares no formula."""
    best = math.inf, -1
    across = np.array([-velocity[1], velocity[0]])
    for index, curve in enumerate(table.curves):
        s = np.linspace(0.0, 1.0, 4001)

        def side(value, curve=curve):
            return float((curve.point(value) - position) @ across)

        values = (curve.point(s) - position) @ across
        for k in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0):
            point = curve.point(brentq(side, s[k], s[k + 1], xtol=1e-15))
            time = float((point - position) @ velocity[:2] / (velocity[:2] @ velocity[:2]))
            if 1e-7 < time < best[0]:
                best = time, index
    return best


@pytest.mark.parametrize("name", TABLES)
def test_the_flights_are_those_of_an_independent_tracer(name):
    table, rng = TABLES[name], np.random.default_rng(1)
    position, velocity, _ = equilibrium_starts(table, DISK, 40, True, rng)
    record = ker.play(table, ker.no_slip(DISK), position, velocity, 4, rng)
    for step in range(1, 4):
        for k in range(0, 40, 2):
            time, wall = plain_flight(table, record.position[step, k], record.velocity[step, k])
            assert wall == record.wall[step + 1, k]
            np.testing.assert_allclose(time, record.time[step + 1, k] - record.time[step, k], rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("name", TABLES)
def test_no_disk_leaves_and_the_energy_stays(name):
    table, rng = TABLES[name], np.random.default_rng(2)
    laws = [ker.CollisionLaw(ker.lambertian(), DISK), ker.no_slip(DISK), ker.smooth(DISK)]
    position, velocity, _ = equilibrium_starts(table, DISK, 200, True, rng)
    record = ker.play(table, [laws[k % 3] for k in range(table.wall_count)], position, velocity, 50, rng)
    assert np.all(record.collisions == 50)
    assert np.all(table.contains(record.position[-1]))
    # in the middle of the last flight as well
    assert np.all(table.contains(0.5 * (record.position[-1] + record.position[-2])))
    np.testing.assert_allclose(record.energy, 0.5 * DISK.mass, rtol=1e-11)


@pytest.mark.parametrize("name", TABLES)
def test_the_reversed_motion_goes_back(name):
    table, rng = TABLES[name], np.random.default_rng(3)
    position, velocity, _ = equilibrium_starts(table, DISK, 100, True, rng)
    law = [ker.no_slip(DISK), *[ker.smooth(DISK)] * (table.wall_count - 1)]
    there = ker.play(table, law, position, velocity, 6, rng)
    # between two collisions, so that the start is inside
    middle = 0.5 * (there.position[-1] + there.position[-2])
    back = ker.play(table, law, middle, -there.velocity[-2], 5, rng)
    np.testing.assert_allclose(back.position[5], there.position[1], atol=1e-8)


def test_a_smooth_disk_in_an_ellipse_keeps_the_product_of_its_momenta_about_the_foci():
    rng = np.random.default_rng(4)
    table, focus = geo.Container.ellipse(2.0, 1.0), math.sqrt(3.0)
    position, velocity, _ = equilibrium_starts(table, DISK, 200, False, rng)
    record = ker.play(table, ker.smooth(DISK), position, velocity, 200, rng)
    x, v = record.position, record.velocity
    product = 1.0
    for sign in (-1.0, 1.0):
        product = product * ((x[..., 0] - sign * focus) * v[..., 1] - x[..., 1] * v[..., 0])
    np.testing.assert_allclose(product, np.broadcast_to(product[0], product.shape), atol=1e-11)


def test_a_no_slip_disk_in_a_circle_keeps_its_angle_of_incidence_every_second_time():
    # the rotation of the circle by which two collisions differ maps one flight to the next but one
    rng = np.random.default_rng(5)
    table = geo.Container.circle(1.0)
    position, velocity, _ = equilibrium_starts(table, DISK, 50, True, rng)
    record = ker.play(table, ker.no_slip(DISK), position, velocity, 41, rng)
    flights = np.diff(record.time, axis=0)[1:]
    np.testing.assert_allclose(flights[::2], np.broadcast_to(flights[0], flights[::2].shape), rtol=1e-9)
    np.testing.assert_allclose(flights[1::2], np.broadcast_to(flights[1], flights[1::2].shape), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "spinning"), [*zip(TABLES, cycle((True, False)), strict=False)])
def test_the_starts_are_in_equilibrium_and_fly_as_far_as_santalo_says(name, spinning):
    table, rng, n = TABLES[name], np.random.default_rng(6), 2_000
    position, velocity, wall = equilibrium_starts(table, DISK, n, spinning, rng)
    flight, _, _ = table.next_wall(position, velocity, wall)
    # volume over flux of the phase space: directions 2 pi over 2 on the circle, 4 pi over pi on the sphere
    expected = (4.0 if spinning else math.pi) * table.area / table.perimeter
    assert abs(flight.mean() - expected) < 4.5 * flight.std() / math.sqrt(n)
    law = ker.no_slip(DISK) if spinning else ker.smooth(DISK)
    late = ker.play(table, law, position, velocity, 5, rng)
    for values in (late.position[-1], late.velocity[-1]):
        first = position if values.shape[1] == 2 else velocity
        for column in range(values.shape[1]):
            for power in (1, 2):
                difference = values[:, column] ** power - first[:, column] ** power
                assert abs(difference.mean()) <= 4.5 * difference.std() / math.sqrt(n) + 1e-14


def test_areas_and_perimeters_are_closed_forms():
    assert TABLES["circle"].area == math.pi * 2.25 and TABLES["circle"].perimeter == 3.0 * math.pi
    assert math.isclose(TABLES["stadium"].area, 1.0 + math.pi / 4)
    assert math.isclose(TABLES["stadium"].perimeter, 2.0 + math.pi)
    assert math.isclose(TABLES["sinai"].area, 4.0 - math.pi * 0.49)
    assert math.isclose(TABLES["lens"].area, math.pi * (1.5 - 0.125 - 0.02))
    for name in ("bowl", "raised"):
        assert math.isclose(TABLES[name].area, 4 / 3)
        assert math.isclose(TABLES[name].perimeter, math.sqrt(5.0) + 0.5 * math.asinh(2.0) + 2.0, rel_tol=1e-12)


def test_membership_is_that_of_the_formulas():
    points = np.random.default_rng(7).uniform(-1.2, 1.2, (5000, 2))
    x, y = points.T
    stadium = (np.abs(y) <= 0.5) & (np.hypot(np.maximum(np.abs(x) - 0.5, 0.0), y) <= 0.5)
    np.testing.assert_array_equal(TABLES["stadium"].contains(points), stadium)
    sinai = (np.abs(points).max(axis=1) <= 1.0) & (np.hypot(x, y) >= 0.7)
    np.testing.assert_array_equal(TABLES["sinai"].contains(points), sinai)
    bowl = (x**2 <= y) & (y <= 1.0)
    np.testing.assert_array_equal(TABLES["bowl"].contains(points), bowl)
    np.testing.assert_array_equal(TABLES["raised"].contains(points), bowl)
    np.testing.assert_array_equal(TABLES["ellipse"].contains(points), x**2 + (y / 2.0) ** 2 <= 1.0)


def test_a_channel_may_have_pillars():
    pillars = [geo.Arc((2.0 * k, 0.5), 0.3, 2.0 * math.pi, 0.0) for k in range(-3, 4)]
    channel = geo.Container([[0, 0], [0, 1]], [[0, 1], [0, -1]], pillars)
    record = ker.play(channel, ker.smooth(DISK), [1.0, 0.5], [1.0, 0.1, 0.0], 1)
    assert record.wall[1].tolist() == [2 + 4]
    assert math.isclose(math.dist(record.position[1, 0], (2.0, 0.5)), 0.3)


def test_laws_and_starts_are_broadcast():
    circle = TABLES["circle"]
    both = ker.play(circle, ker.smooth(DISK), [0.1, 0.2], [[1.0, 0.3, 0.0], [0.0, 1.0, 1.0]], 3)
    assert both.position.shape == (4, 2, 2)
    assert ker.play(circle, ker.smooth(DISK), [[0.1, 0.2], [0, 0], [0, 1]], [0, 1, 0], 2).velocity.shape == (3, 3, 3)


def test_rays_along_the_axis_of_a_parabola_pass_through_its_focus():
    starts = np.stack([np.linspace(-0.9, 0.9, 7), np.full(7, 0.95)], axis=1)
    record = ker.play(TABLES["bowl"], ker.smooth(geo.Disk()), starts, np.tile([0.0, -1.0, 0.0], (7, 1)), 2)
    start, way = record.position[1], record.velocity[1][:, :2]
    away = np.array([0.0, 0.25]) - start
    np.testing.assert_allclose(start[:, 1], start[:, 0] ** 2, atol=1e-15)
    np.testing.assert_allclose(away[:, 0] * way[:, 1] - away[:, 1] * way[:, 0], 0.0, atol=1e-14)


def test_tangents_and_curvatures_of_bezier_walls_are_derivatives():
    table = geo.Container.from_curves([
        geo.Bezier([(0, -1), (1.5, -1.2), (1.8, 0.6), (0.2, 1)]), geo.Segment((0.2, 1), (0, -1)),
    ])  # fmt: skip
    s, h = np.linspace(0.1, 2.3, 12), 1e-5
    ends = [table.touch(0, table.point_at(s + sign * h)[0]) for sign in (-1, 0, 1)]
    slope = (ends[2].position - ends[0].position) / (2 * h)
    turned = (ends[2].tangent - ends[0].tangent) / (2 * h)
    np.testing.assert_allclose(slope, ends[1].tangent, atol=1e-8)
    left = np.stack([-ends[1].tangent[:, 1], ends[1].tangent[:, 0]], axis=1)
    np.testing.assert_allclose(turned, ends[1].curvature[:, None] * left, atol=1e-6)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_disk_is_reflected_by_the_side_of_a_thin_fold_that_it_meets(side):
    # both sides are nearer to each other than guesses along the curve
    fold = geo.Bezier([(1.052, 0), (1.0521, 0.0003), (1.184, 0.487), (1.0555, 0)])
    corners = [(1.0555, 0), (2.4, 0), (2.4, 5), (0, 5), (0, 0), (1.052, 0)]
    table = geo.Container.from_curves([fold, *map(geo.Segment, corners, corners[1:])])
    start = np.column_stack([np.full(40, 1.1 + 0.5 * side), np.linspace(0.02, 0.2, 40)])
    record = ker.play(table, ker.smooth(DISK), start, [-side, 0.0, 0.0], 1)
    assert np.all(record.wall[1] == 0)
    np.testing.assert_allclose(record.energy[1], record.energy[0], rtol=1e-14)
