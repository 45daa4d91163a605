"""Walls whose period begins anywhere, and below y = 0: their law is that of the cell that begins at a highest point."""

import math
from fractions import Fraction

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import WallError
from asperity.geometry import Arc, Bezier, Segment
from asperity.geometry.cells.cell import Hollow, first_top, merged
from asperity.geometry.tracing.tracing import entries

LOW = geo.Wall.from_vertices([(0, -1.3), (0.2, -0.9), (0.7, -0.3), (0.8, -1.5), (1, -1.3)])


def test_half_a_period_of_shift_keeps_the_closed_form():
    arc = geo.focusing_arcs(1.2).pieces[0]
    falls, rises = arc.split(0.5)
    wall = geo.Wall([rises.moved(-0.5, -0.7), falls.moved(0.5, -0.7)])
    assert wall.closes and wall.origin == pytest.approx((0.5, -0.7), abs=1e-15)
    assert wall.hollows[0].left == pytest.approx(0.5) and wall.hollows[0].right == pytest.approx(1.5)
    ((weight, law),) = ker.WallLaw(wall).parts
    assert weight == 1.0 and isinstance(law, ker.CircularArcLaw)
    assert law.half_angle == pytest.approx(1.2, rel=1e-15)
    teeth = geo.Wall.from_vertices([(0, -0.5), (0.5, 0), (1, -0.5)])
    assert ker.WallLaw(teeth).parts == ((1.0, ker.TriangularTeethLaw(math.pi / 2)),)
    assert teeth.is_mirror_symmetric and teeth.depth == 0.5


def test_the_given_coordinates_are_kept_in_pieces_and_trajectories():
    assert LOW.vertices.tolist() == [[0, -1.3], [0.2, -0.9], [0.7, -0.3], [0.8, -1.5], [1, -1.3]]
    path, ray = geo.trajectory(LOW, 0.1, 1.0), geo.trace(LOW, 0.1, 1.0)
    first = path[1] - path[0]
    assert math.atan2(-first[1], -first[0]) == pytest.approx(1.0, abs=1e-14)
    last = path[-1] - path[-2]
    assert math.atan2(last[1], last[0]) == pytest.approx(float(ray.theta), abs=1e-14)
    # every point in between lies on the pieces that were given
    for x, y in path[1:-1]:
        places = [
            piece.point(np.linspace(0, 1, 20_001)) + np.array([k, 0]) for piece in LOW.pieces for k in (-2, -1, 0, 1)
        ]
        assert min(np.hypot(*(points - [x, y]).T).min() for points in places) < 1e-4


@pytest.mark.parametrize("theta", [1e-3, 1e-7, 1e-12, 3e-16, 1e-40, 1e-300, np.pi - 1e-6, np.nextafter(np.pi, 0.0)])
def test_the_place_where_a_grazing_ray_comes_to_the_tops_is_exact(theta):
    """cot(theta) by mpmath with 400 digits."""
    import mpmath

    with mpmath.workdps(400):
        way = mpmath.mpf(0.3) * mpmath.cot(mpmath.mpf(float(theta)))
        expected = float((mpmath.mpf(0.1) - way - mpmath.mpf(0.7)) % 1)
    found = float(entries(LOW, np.array([0.1]), np.array([theta]))[0]) % 1.0
    assert abs((found - expected + 0.5) % 1.0 - 0.5) < 1e-15


def test_a_grazing_ray_above_a_low_wall_comes_back():
    theta = np.array([1e-4, 1e-8, np.pi - 1e-8])
    there = geo.trace(LOW, 0.25, theta)
    exact = [float((Fraction(0.25) - Fraction(float(there.x[k]))) % 1) for k in range(3)]
    assert there.escaped.all() and np.all(np.isfinite(exact))
    raised = geo.trace(LOW.cell, entries(LOW, np.full(3, 0.25), theta), theta)
    assert np.array_equal(there.theta, raised.theta) and np.array_equal(there.collisions, raised.collisions)


def test_a_cell_begins_at_a_top_that_no_plate_covers():
    # a plate along the level runs back over the joint at which the period begins
    wall = geo.Wall.from_vertices([(0, 0), (0.1, -0.5), (0.7, -0.5), (0.9, 0), (1.2, 0), (1, 0)])
    assert first_top(wall.vertices, 1.0) == 3
    assert wall.hollows == (Hollow(pytest.approx(1.2), pytest.approx(1.9), 1, 5),)
    assert wall.flat_top == pytest.approx(0.3)
    over, beside = geo.trace(wall, [0.1, 0.5], 1.4), geo.trace(wall, 0.5, 1.4)
    assert over.theta[0] == pytest.approx(np.pi - 1.4) and over.collisions[0] == 1
    assert beside.escaped


@pytest.mark.parametrize(
    "plate",
    [
        [Segment((0.35, -0.5), (0.6, -0.4)), Segment((0.6, -0.4), (0.7, -0.5))],
        [Arc((0.5, -0.6), 0.2, 2.8, 0.2)],
        [Bezier([(0.3, -0.6), (0.45, -0.2), (0.7, -0.3), (0.7, -0.65)])],
    ],
    ids=["segments", "arc", "bezier"],
)
def test_a_cell_begins_on_the_upper_face_of_a_plate(plate):
    # its highest point is inside the plate, which the path runs along to the right or to the left
    ends = [Segment((0, -0.95), plate[0].start), Segment(plate[0].start, (1, -0.95))]
    wall = geo.Wall([ends[0], *plate, *(piece.reversed() for piece in plate[::-1]), ends[1]])
    image = wall.mirrored()
    assert geo.Wall(image.pieces) == image and wall.closes
    assert (image.hollows[0].left, image.depth) == pytest.approx((1.0 - wall.hollows[0].left, wall.depth))
    rng = np.random.default_rng(1)
    x, theta = rng.random(200), np.arccos(1.0 - 2.0 * rng.random(200))
    there, back = geo.trace(wall, x, theta), geo.trace(image, 1.0 - x, np.pi - theta)
    assert there.escaped.all() and np.array_equal(there.collisions, back.collisions)
    assert np.abs(there.theta + back.theta - np.pi).max() < 1e-9


def test_pieces_that_the_period_cuts_are_one():
    curve = Bezier([(0, 0), (0.2, -1), (0.9, -0.7), (1, -0.1)])
    for whole in (Arc((0, 0), (1, 2), 3.0, 0.5), Arc((0, 0), 1e7, -1.6, -1.5999), curve):
        before, after = whole.split(0.3)
        back = before.joined(after, 1e-14 * max(1.0, abs(whole.end[1])))
        assert back is not None
        np.testing.assert_allclose(back.point([0.2, 0.6]), whole.point([0.2, 0.6]), atol=1e-8, rtol=1e-14)
    for far in ((2, -2 - 1e-9), (0.5, -0.5)):
        path = (Segment((0, 0), (1, -1)), Segment((1, -1), far))
        assert merged(path) is path
    assert Arc((0, 0), 1.0, 3.0, 4.0).joined(Arc((0, 0), 1.0, 4.0, 3.0), 1e-14) is None


def test_a_flat_top_cut_by_the_period_hides_no_mirror_axis():
    wall = geo.Wall.from_vertices([(0, 0), (0.1, 0), (0.2, -0.5), (0.4, -0.5), (0.5, 0), (1, 0)])
    assert wall.is_mirror_symmetric
    assert not geo.Wall.from_vertices(
        [(0, 0), (0.1, 0), (0.2, -0.5), (0.3, -0.5), (0.5, 0), (1, 0)]
    ).is_mirror_symmetric


def test_a_wall_whose_pieces_would_vanish_by_the_shift_stays_open():
    near = float(np.nextafter(0.1, 0.0))
    wall = geo.Wall.from_vertices([(0, -0.5), (0.1, -0.4), (near, -0.4), (0.3, -0.2), (0.7, 0), (1, -0.5)])
    assert not wall.closes and wall.cell is wall and wall.hollows == () and wall.scene.is_open


def _bezier_up_and_down():
    up = Bezier([(0.5, -1.5), (0.4, -1), (0.5, -0.5)])
    corners = [(0, 0), (0, -1.5), (0.5, -1.5)]
    return [*map(Segment, corners, corners[1:]), up, up.reversed(), Segment((0.5, -1.5), (1, -1.5))]


def test_curves_that_run_back_on_themselves_are_slits_or_plates():
    curve = Bezier([(0, 0), (0.2, -0.5), (0.4, -0.9), (0.5, -1)])
    bowl = Arc((0.5, 0), 0.5, math.pi, 2 * math.pi)
    first, second = bowl.split(0.4)
    there = second.split(0.5)[0]
    rest = curve.split(0.5)[1].reversed()
    for path in (
        [curve, rest, Segment(rest.end, (1, 0))],
        [first, there, there.reversed(), Segment(there.start, (1, 0))],
    ):
        with pytest.raises(WallError, match=r"run back on each other from .* zero width"):
            geo.Wall(path)
    plate = geo.Wall([*_bezier_up_and_down(), Segment((1, -1.5), (1, 0))])
    assert plate.arc_length == pytest.approx(4.0 + 2.0 * _bezier_up_and_down()[2].length)
    # a plate that lies on the floor touches it, and has free space above
    lying = [Segment((0.2, -1), (0.7, -1)), Segment((0.7, -1), (0.2, -1))]
    assert geo.Wall([Segment((0, -1), (1, -1))], islands=[lying]).depth == 1.0
    disk = [Arc((0.5, -0.5), 0.2, 0, math.pi), Arc((0.5, -0.5), 0.2, math.pi, 0)]
    assert not geo.Wall([Segment((0, -1), (1, -1))], islands=[disk]).closes
    with pytest.raises(WallError, match="piece 0 of island 0 and piece 1 of island 0 run back"):
        geo.Wall([Segment((0, -0.1), (1, -0.1))], islands=[disk])
