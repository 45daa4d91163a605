"""Sharp peaks, plates thinner than rounding, islands: rays go where the plain tracer sends them."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from campaigns.judges.plain_tracer import trace_precisely
from campaigns.rays.aimed_rays import COLLISIONS, AimedRays
from campaigns.rays.thin_polygons import POLYGONS, follow_plainly, judge_plainly, random_polygon, rays_beside_corners
from numba import njit

from asperity import geometry as geo
from asperity.geometry.polygons.triangulation import ExactPoints
from asperity.geometry.tracing.compiled.pieces.lines import Line, line_hit, orientation
from asperity.geometry.tracing.refinement import refined_trace

PRECISE_RAYS = 6


def judged(wall, x, theta):
    """The judgements of rays by the plain tracer."""
    return list(judge_plainly(AimedRays("", wall, np.asarray(x), np.asarray(theta))))


@pytest.mark.parametrize(
    ("kind", "number", "x", "theta"),
    [
        # in the apex of a wedge, 4e-16 beside the foot of a plate, where one line ends in front of another
        ("standing plates", 11, 0.016413068599111277, 1.6542613177845171),
        # into a corner, off the one line to within 1e-17 of the other
        ("sharp islands", 99, 0.2086541361844363, 0.9038638355308218),
        # past a corner, and out over 109,881 cells
        ("floating plates", 24, 0.5669641334297323, 1.5708013899365827),
        # to the joint at which the period begins, where rounding puts the ray below the floor
        ("sharp islands", 10, 0.7547158996051004, 0.8729736157922413),
    ],
)
def test_rays_that_were_lost_or_wrong(kind, number, x, theta):
    wall = random_polygon(kind, np.random.default_rng([1, number]))
    assert not any(each.fault or each.outcome for each in judged(wall, [x], [theta]))


def test_the_segment_before_a_run_does_not_count_as_the_one_that_ends_it():
    """Next to the apex of a wedge, after fourteen hits in one step, with the gap within rounding."""
    wall = random_polygon("sharp peaks", np.random.default_rng([77, 7]))
    found = judged(wall, [0.9634121487192336], [1.4675613245704422])
    assert not any(each.fault or each.outcome for each in found)


def test_a_line_that_is_met_at_its_end_is_not_met_at_its_start():
    line = Line(0.0, -1.0, 2.0, -1.0, 2.0, 0.0, 0.0, 1.0, 2.0)
    time, fraction, x, y = njit(line_hit.py_func)(line, 2.0, 0.0, 2.0, 0.0, 0.0, -1.0)
    assert (time, x, y) == (1.0, 2.0, -1.0) and fraction < 0.0


@pytest.mark.parametrize("theta", [1e-4, 1e-6, np.pi - 1e-7, 1e-9])
@pytest.mark.parametrize("wall", ["plate on the floor"], indirect=True)
def test_double_doubles_count_the_cells_that_a_ray_passes_without_a_hit(wall, theta):
    """To the floor and out again, with the position by mpmath."""
    twin = refined_trace(wall.scene, np.array([0.3]), np.array([theta]), COLLISIONS)
    assert twin.status[0] == geo.Status.ESCAPED and twin.collisions[0] == 1
    with mp.workdps(50):
        way = 2 * mp.mpf(0.9) * mp.cot(mp.mpf(float(theta)))
        assert abs(mp.mpf(twin.x[0, 0]) + mp.mpf(twin.x[0, 1]) - mp.mpf(0.3) + way) < 1e-25 * abs(way)


@pytest.mark.parametrize("kind", POLYGONS)
def test_the_plain_tracer_agrees_with_fifty_digits(kind):
    for seed in range(2):
        rng = np.random.default_rng([3, seed])
        wall = random_polygon(kind, rng)
        x, theta = rays_beside_corners(wall, PRECISE_RAYS, rng)
        brute = follow_plainly(wall, x, theta, np.ones(PRECISE_RAYS, bool))
        for i in np.flatnonzero(brute.status == geo.Status.ESCAPED):
            ray = trace_precisely(wall, x[i], theta[i], COLLISIONS)
            assert ray.hits == brute.collisions[i]
            assert abs(ray.theta - mp.mpf(brute.theta[i, 0]) - mp.mpf(brute.theta[i, 1])) < 1e-27


def test_a_plate_whose_faces_cross_by_rounding_is_a_plate_without_thickness():
    # on its way down the plate has a vertex that lies on the line but for rounding, on either side of it
    rng = np.random.default_rng(5)
    crossed = 0
    for _ in range(20):
        foot, tip, fraction = (
            rng.uniform([0.3, -0.95], [0.5, -0.7]),
            rng.uniform([0.4, -0.4], [0.7, -0.1]),
            rng.random(),
        )
        middle = tuple(foot + fraction * (tip - foot))
        foot, tip = tuple(foot), tuple(tip)
        crossed += ExactPoints(np.array([foot, tip, middle])).turn(0, 1, 2) > 0
        ends = [(0.0, 0.0), (0.0, -0.95)], [(1.0, -0.95), (1.0, 0.0)]
        plain = geo.Wall.from_vertices([*ends[0], foot, tip, foot, *ends[1]])
        bent = geo.Wall.from_vertices([*ends[0], foot, tip, middle, foot, *ends[1]])
        x, theta = rng.random(200), np.arccos(1.0 - 2.0 * rng.random(200))
        one, other = geo.trace(plain, x, theta), geo.trace(bent, x, theta)
        assert one.escaped.all() and other.escaped.all()
        assert np.array_equal(one.collisions, other.collisions)
        assert np.abs(one.theta - other.theta).max() < 1e-11
    assert crossed > 3


@pytest.mark.parametrize("degree", [2, 3])
def test_no_image_of_a_curved_plate_catches_a_ray(degree):
    rng = np.random.default_rng([7, degree])
    for _ in range(10):
        face = geo.Bezier(rng.uniform([0.1, -0.8], [0.9, -0.1], (degree + 1, 2)))
        floor = geo.Segment((0.0, -0.9), (1.0, -0.9))
        wall = geo.Wall([floor], islands=[[face, face.reversed()]])
        x, theta = rng.random(200), np.arccos(1.0 - 2.0 * rng.random(200))
        for image in (wall, wall.mirrored(), wall.scaled(1.0 / 3.0)):
            assert geo.trace(image, x * image.period, theta, max_collisions=COLLISIONS).escaped.all()


def test_rays_next_to_the_tip_of_a_peak_are_reflected_at_it():
    # 1e-15 to 1e-13 below the tip, where the other side of the peak is closer than rounding
    rng = np.random.default_rng(6)
    for angle in (0.1, 0.01, 0.001):
        half = 0.5 * math.tan(0.5 * angle)
        wall = geo.Wall.from_vertices(
            [(0, 0), (0, -0.9), (0.5 - half, -0.9), (0.5, -0.4), (0.5 + half, -0.9), (1, -0.9), (1, 0)]
        )
        x, below = rng.random(150), 10.0 ** rng.uniform(-15.0, -13.0, 150)
        side = np.where(x < 0.5, -1.0, 1.0)
        theta = np.arctan2(0.4 + below, x - 0.5 - side * below * math.tan(0.5 * angle))
        assert not any(each.fault for each in judged(wall, x, theta))


def test_orientation_has_the_exact_sign():
    rng = np.random.default_rng(7)
    zeros = 0
    for _ in range(300):
        a, step = rng.uniform(-1.0, 1.0, 2), rng.uniform(-1.0, 1.0, 2)
        b, c = a + step, a + rng.random() * step
        c += rng.integers(-1, 2, 2) * np.spacing(c)
        exact = ExactPoints(np.array([a, b, c])).turn(0, 1, 2)
        assert np.sign(orientation(*a, *b, *c)) == exact
        zeros += exact == 0
    assert orientation(0.1, 0.2, 0.3, 0.6, 0.1, 0.2) == 0.0 and orientation(0.0, 0.0, 1.0, 1.0, 0.5, 0.5) == 0.0


@pytest.mark.parametrize(
    "wall", [geo.flat(), geo.triangular_teeth(0.7), geo.rectangular_teeth(2.0), geo.focusing_arcs(1.2), geo.koch(2)]
)
def test_rays_that_leave_along_the_wall_can_be_sent_back(wall):
    theta = np.array([5e-324, 1e-300, 1e-30, 1e-17, 1e-16, 2.2e-16, 3e-16, 1e-15, np.nextafter(np.pi, 0.0)])
    out = geo.trace(wall, 0.3, theta)
    # the corners of the opening are as far away as the incoming angle is large: below 1e-29 all digits are needed
    assert out.escaped[theta > 1e-20].all()
    assert np.all(out.theta[out.escaped] > 0.0) and np.all(out.theta[out.escaped] < np.pi)
    back = geo.trace(wall, out.x[out.escaped], out.theta[out.escaped])
    assert np.all(np.abs(back.theta - theta[out.escaped])[back.escaped] <= 2.0 * np.spacing(np.pi))


@pytest.mark.parametrize("wall", ["plate on the floor"], indirect=True)
def test_cells_passed_without_a_hit_do_not_count_as_collisions(wall):
    one = geo.trace(wall, 0.3, 0.01, max_collisions=1)
    assert one.escaped and one.collisions == 1
