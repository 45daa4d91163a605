"""Walls: joints, conditions, hollows and images."""

import copy
import math
import pickle
import time
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asperity import geometry as geo
from asperity.geometry import Arc, Bezier, Segment, Wall
from asperity.geometry.cells.cell import Hollow
from wall_shapes import CLOSED, OPEN, flask, over_floor, square

pi = math.pi


@given(st.lists(st.tuples(st.floats(0.01, 1.0), st.sampled_from([0.0, 1e-9, 0.1, 0.3, 2.0])), min_size=1, max_size=12))
def test_every_graph_of_a_function_is_a_wall(steps):
    x = np.cumsum([0.0, *(s for s, _ in steps), 0.5])
    y = np.array([0.0, *(-d for _, d in steps), 0.0])
    wall = Wall.from_vertices(np.column_stack([x, y]))
    assert wall.depth == max(d for _, d in steps)
    assert wall.arc_length == pytest.approx(np.sum(np.hypot(np.diff(x), np.diff(y))), rel=1e-14)
    assert wall.is_polygonal and wall.closes
    hollows = wall.hollows
    for left, right in pairwise(hollows):
        assert left.right <= right.left and left.last <= right.first
    for hollow in hollows:
        assert tuple(wall.cell.vertices[hollow.first]) == (hollow.left, 0.0)
        assert tuple(wall.cell.vertices[hollow.last]) == (hollow.right, 0.0)
        assert np.all(wall.cell.vertices[hollow.first + 1 : hollow.last, 1] < 0.0)


def test_a_plate_of_zero_thickness_does_not_split_its_hollow():
    assert CLOSED["plate along the top"]().hollows == (Hollow(0.7, 1.0, 1, 5),)
    mushroom = geo.mushrooms(0.25)
    assert mushroom.hollows == (Hollow(0.375, 0.625, 1, 4),)
    assert mushroom.vertices.tolist() == [[0, 0], [0.375, 0], [0, 0], [1, 0], [0.625, 0], [1, 0]]


def test_curves_are_cut_where_their_tops_touch_the_opening():
    bumps = CLOSED["bumps"]()
    assert bumps.vertices.tolist() == [[0, 0], [0.25, -0.25], [0.5, 0], [0.75, -0.25], [1, 0]]
    assert [(h.left, h.right, h.first, h.last) for h in bumps.hollows] == [(0, 0.5, 0, 2), (0.5, 1, 2, 4)]
    arch = Wall([Segment((0, 0), (0, -1)), Bezier([(0, -1), (0.5, 1), (1, -1)]), Segment((1, -1), (1, 0))])
    assert arch.vertices[2].tolist() == [0.5, 0.0] and len(arch.hollows) == 2


def test_joints_within_rounding_of_the_opening_lie_on_it():
    noisy = Wall.from_vertices([(1e-17, -1e-17), (0.5, -0.3), (0.7, 3e-17), (0.8, -0.2), (1, 1e-17)])
    assert noisy.vertices[[0, 2, 4], 1].tolist() == [0.0, 0.0, 0.0]
    assert len(noisy.hollows) == 2
    # ten digits typed by hand
    typed = Wall([Arc((0.5, 0.2886751346), 0.5773502692, -2.6179938780, -0.5235987756)])
    assert typed.vertices.tolist() == [[0.0, 0.0], [1.0, 0.0]]


def test_islands_run_clockwise():
    for loop in (square(0.2, -0.5, 0.2), [p.reversed() for p in reversed(square(0.2, -0.5, 0.2))]):
        joints = over_floor(loop).island_vertices[0]
        x, y = joints[:-1].T
        assert np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0.0
    assert over_floor([Arc((0.5, -0.5), 0.2, 0, 2 * pi)]).islands[0][0].direction == -1


def test_mirror_symmetry():
    symmetric = "caves", "cavities that touch", "flasks", "flasks that touch", "bumps", "vertical ends", "floor", "comb"
    crooked = "saw", "leaning teeth", "overhang", "cave", "leaning box", "corner on an edge", "plate along the top"
    assert all(CLOSED[name]().is_mirror_symmetric for name in symmetric)
    assert not any(CLOSED[name]().is_mirror_symmetric for name in crooked)
    disk, squares = over_floor([Arc((0.5, -0.5), 0.2, 0, 2 * pi)]), OPEN["squares that touch"]()
    assert disk.is_mirror_symmetric and not squares.is_mirror_symmetric
    shifted = over_floor([Arc((0.5 + 1e-9, -0.5), 0.2, 0, 2 * pi)])
    assert not shifted.is_mirror_symmetric
    pair = over_floor(square(0.1, -0.5, 0.25), square(0.65, -0.5, 0.25))
    assert pair.is_mirror_symmetric
    assert Wall.from_vertices([(0, 0), (0.5 + 1e-11, -1), (1, 0)]).is_mirror_symmetric is False


def test_the_mirror_axis_may_lie_anywhere_in_the_cell():
    height = np.random.default_rng(3).random(12)
    assert Wall.from_profile(np.arange(12), height, seam="mirror").is_mirror_symmetric
    assert not Wall.from_profile(np.arange(12), height, seam="step").is_mirror_symmetric
    # a tooth, then a crevice: the axes are at 1/4 and 3/4
    assert Wall.from_vertices([(0, 0), (0.5, 0), (0.5, -1), (1, -1), (1, 0)]).is_mirror_symmetric
    # the same for curves: two arcs of different radius, the cell cut between them
    arcs = [Arc((0.25, 0.0), 0.25, pi, 2 * pi), Arc((0.75, 0.0), (0.25, 0.1), pi, 2 * pi)]
    assert Wall(arcs).is_mirror_symmetric


def test_profiles_of_repeated_heights_have_the_axes_that_a_comparison_of_all_starts_finds():
    rng = np.random.default_rng(8)
    for points in (40, 75, 200):
        for levels in (2, 4):
            height = rng.integers(levels, size=points) / 8.0
            for seam in ("mirror", "step"):
                wall = Wall.from_profile(np.arange(points), height, seam=seam)
                # a slope read backwards changes its sign
                steps = np.diff(wall.vertices, axis=0)
                image = (steps * [1.0, -1.0])[::-1]
                axes = [np.allclose(np.roll(steps, -k, axis=0), image, atol=1e-12) for k in range(len(steps))]
                assert wall.is_mirror_symmetric == any(axes), (points, levels, seam)


@pytest.mark.usefixtures("uncollected")
def test_one_changed_height_among_many_repeated_ones_takes_the_axis_away():
    height = np.random.default_rng(9).integers(2, size=10_000) / 8.0
    wall = Wall.from_profile(np.arange(10_000), height)
    assert wall.is_mirror_symmetric
    vertices = wall.vertices.copy()
    vertices[7_001, 1] -= 1e-6
    changed = Wall.from_vertices(vertices)
    begin = time.process_time()
    assert not changed.is_mirror_symmetric
    # a comparison from each of the thousands of starts takes several seconds
    assert time.process_time() - begin < 1.0


def test_walls_are_values():
    wall = flask(0.4)
    twin = flask(0.4)
    assert wall == twin and hash(wall) == hash(twin) and wall != flask(0.5)
    wall.vertices, wall.hollows  # noqa: B018  fill the caches
    for again in (copy.deepcopy(wall), pickle.loads(pickle.dumps(wall))):
        assert again == wall and not again.vertices.flags.writeable
    with pytest.raises(AttributeError):
        wall.period = 2.0


def test_repr_is_one_informative_line():
    assert repr(flask(0.4)) == "Wall(2 segments, 1 arc, period 1, depth 0.787298, closes)"
    assert repr(OPEN["squares that touch"]()) == "Wall(9 segments, 2 islands, period 1, depth 0.9, open)"


def test_outline_is_the_path_within_tolerance():
    outline = flask(0.4).outline(1e-4)
    center = np.array([0.5, -0.4 * math.cos(math.asin(0.25))])
    inside = outline[(outline[:, 1] < 0.0)]
    assert np.hypot(*(inside - center).T) == pytest.approx(0.4, rel=1e-12)
    assert outline[0].tolist() == [0.0, 0.0] and outline[-1].tolist() == [1.0, 0.0]
    assert np.array_equal(geo.triangular_teeth(1.0).outline(0.1), geo.triangular_teeth(1.0).vertices)


def test_tangential_contacts_raise_no_alarm():
    for radius in np.random.default_rng(3).uniform(0.2, 0.5, 20):
        # a round cavity and, beside it, a bump of the neighbouring wall that touches it in one point
        assert flask(float(radius), neck=0.5 * float(radius)).closes
    # two cavities of different radius in one cell that touch below the opening, at height -0.24
    for small in (0.1, 0.17, 0.24):
        big = 0.5 - small
        pieces, left = [], 0.0
        for r in (small, big):
            tilt = 0.3
            middle, drop = left + r, r * math.cos(tilt)
            pieces += [
                Segment((left, 0), (middle - r * math.sin(tilt), 0)),
                Arc((middle, -drop), r, pi / 2 + tilt, pi / 2 - tilt + 2 * pi),
                Segment((middle + r * math.sin(tilt), 0), (left + 2 * r, 0)),
            ]
            left += 2 * r
        assert len(Wall(pieces).hollows) == 2


@given(
    st.lists(st.tuples(st.floats(1e-3, 10.0), st.integers(-3, 3)), min_size=2, max_size=15),
    st.sampled_from(["mirror", "step"]),
    st.sampled_from([1e-9, 1.0, 1e4]),
)
@pytest.mark.filterwarnings("ignore:the profile.s")
def test_every_profile_makes_a_closed_wall(rows, seam, unit):
    x = np.cumsum([dx for dx, _ in rows])
    height = unit * np.array([h for _, h in rows], dtype=float)
    wall = Wall.from_profile(x, height, seam)
    assert wall.closes
    assert wall.period == pytest.approx((1 + (seam == "mirror")) * (x[-1] - x[0]), rel=1e-14)
    assert wall.depth == pytest.approx(np.ptp(height), rel=1e-14)
    length = np.sum(np.hypot(np.diff(x), np.diff(height)))
    whole = 2 * length if seam == "mirror" else length + abs(height[-1] - height[0])
    assert wall.arc_length == pytest.approx(whole, rel=1e-13)
    assert wall.flat_top + sum(h.width for h in wall.hollows) == pytest.approx(wall.period, rel=1e-13)


def test_a_curve_with_its_top_next_to_its_end_is_cut_once():
    # the handle before the end is above it by rounding
    curve = geo.Bezier([(0.0, -0.0238), (0.01, -0.0082), (0.02, 3.3290416e-09), (0.03, -1e-15)])
    wall = geo.Wall([geo.Segment((0, 0), (0, -0.0238)), curve, geo.Segment((0.03, -1e-15), (1, 0))])
    assert len(wall.pieces) <= 4 and wall.depth == 0.0238
