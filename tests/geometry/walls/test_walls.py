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

pi = math.pi


def polygon(*corners):
    return [Segment(p, q) for p, q in pairwise(corners)]


def square(x, y, side):
    return polygon((x, y), (x + side, y), (x + side, y + side), (x, y + side), (x, y))


FLOOR = polygon((0, -1), (1, -1))


def flask(radius, neck=0.1):
    """A round cavity below an opening of half width ``neck`` in the middle of the cell."""
    tilt = math.asin(neck / radius)
    cave = Arc((0.5, -radius * math.cos(tilt)), radius, pi / 2 + tilt, pi / 2 - tilt + 2 * pi)
    return [Segment((0, 0), (0.5 - neck, 0)), cave, Segment((0.5 + neck, 0), (1, 0))]


CLOSED = {
    "overhanging": Wall.from_vertices([(0, 0), (0.5, -1), (1.5, -1), (1, 0)]),
    "far overhanging": Wall.from_vertices([(0, 0), (5, -1), (6, -1), (1, 0)]),
    "cavities that touch": Wall.from_vertices(
        [(0, 0), (0.45, 0), (0.45, -0.1), (0, -0.1), (0, -1), (1, -1), (1, -0.1), (0.55, -0.1), (0.55, 0), (1, 0)]
    ),
    "flasks that touch": Wall(flask(0.5)),
    "flasks": Wall(flask(0.4)),
    "bumps": Wall(
        [Arc((0, -0.25), 0.25, pi / 2, 0), Arc((0.5, -0.25), 0.25, pi, 0), Arc((1, -0.25), 0.25, pi, pi / 2)]
    ),
    "caves": Wall([Arc((0.25, 0), 0.25, pi, 2 * pi), Arc((0.75, 0), (0.25, 0.6), pi, 2 * pi)]),
    "plate": Wall.from_vertices([(0, 0), (0.7, 0), (0.2, 0), (0.2, -1), (1, -1), (1, 0)]),
    "inner plate": Wall.from_vertices([(0, 0), (0, -1), (0.5, -1), (0.5, -0.2), (0.5, -1), (1, -1), (1, 0)]),
    "corner on an edge": Wall.from_vertices([(0, 0), (0, -1), (0.4, -0.4), (0, -0.4), (0, -0.2), (1, -0.2), (1, 0)]),
    "cubic": Wall([Bezier([(0, 0), (0.2, -1), (0.8, -1), (1, 0)])]),
    "floor": Wall(FLOOR),
    "low teeth": Wall.from_vertices([(0, -0.5), (0.5, -0.1), (0.5, -0.6), (1, -0.5)]),
    "begun in a cavity": Wall.from_vertices(
        [(0, -1), (0.3, -1), (0.3, -0.5), (-0.2, -0.5), (-0.2, 0), (0.4, 0), (0.4, -1), (1, -1)]
    ),
}
OPEN = {
    "disk": Wall(FLOOR, islands=[[Arc((0.5, -0.5), 0.2, 0, 2 * pi)]]),
    "touching squares": Wall(FLOOR, islands=[square(0.2, -0.5, 0.2), square(0.4, -0.5, 0.2)]),
    "floating plate": Wall(FLOOR, islands=[polygon((0.2, -0.5), (0.7, -0.5), (0.2, -0.5))]),
    "square on the floor": Wall(FLOOR, islands=[square(0.2, -1, 0.2)]),
}
WALLS = {**CLOSED, **OPEN}


@pytest.mark.parametrize("name", WALLS)
def test_pieces_fraction_their_joints_to_the_bit(name):
    wall = WALLS[name]
    assert wall.vertices.shape == (len(wall.pieces) + 1, 2)
    for piece, start, end in zip(wall.pieces, wall.vertices[:-1], wall.vertices[1:], strict=True):
        assert piece.start == tuple(start) and piece.end == tuple(end)
    assert wall.vertices[0, 0] == 0.0 and wall.vertices[-1, 0] == wall.period
    assert wall.vertices[0, 1] == wall.vertices[-1, 1]
    assert not wall.vertices.flags.writeable
    for loop, joints in zip(wall.islands, wall.island_vertices, strict=True):
        assert tuple(joints[0]) == tuple(joints[-1]) and not joints.flags.writeable
        for piece, start, end in zip(loop, joints[:-1], joints[1:], strict=True):
            assert piece.start == tuple(start) and piece.end == tuple(end)


@pytest.mark.parametrize("name", CLOSED)
def test_walls_without_islands_close(name):
    assert CLOSED[name].closes
    assert CLOSED[name].flat_top + sum(h.width for h in CLOSED[name].hollows) == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("name", OPEN)
def test_walls_with_islands_are_open(name):
    assert not OPEN[name].closes
    assert OPEN[name].hollows == ()


@pytest.mark.parametrize("name", WALLS)
@pytest.mark.parametrize("factor", [1e-6, 3.7, 1e6])
def test_validity_does_not_depend_on_scale(name, factor):
    wall = WALLS[name]
    paths = [[p.stretched(factor, factor) for p in path] for path in (wall.pieces, *wall.islands)]
    assert Wall(paths[0], wall.period * factor, paths[1:]) == wall.scaled(factor)
    assert wall.scaled(factor).depth == pytest.approx(factor * wall.depth, rel=1e-15)
    assert wall.scaled(factor).arc_length == pytest.approx(factor * wall.arc_length, rel=1e-14)


@pytest.mark.parametrize("name", WALLS)
def test_images_of_walls_are_valid_walls(name):
    wall, disk = WALLS[name], geo.Disk(1.0, 0.5)
    for image in (wall.mirrored(), wall.foreshorten(disk), wall.unforeshorten(disk), wall.scaled(0.3)):
        assert Wall(image.pieces, image.period, image.islands) == image
        assert image.closes == wall.closes and len(image.hollows) == len(wall.hollows)
    assert wall.foreshorten(disk).depth == pytest.approx(wall.depth * math.sqrt(3.0), rel=1e-14)
    assert wall.foreshorten(disk).period == wall.period
    assert np.allclose(wall.foreshorten(disk).unforeshorten(disk).vertices, wall.vertices, rtol=1e-15, atol=0)
    twice = wall.mirrored().mirrored()
    assert np.allclose(twice.vertices, wall.vertices, rtol=0, atol=1e-15)
    assert wall.mirrored().is_mirror_symmetric == wall.is_mirror_symmetric


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
        assert tuple(wall.vertices[hollow.first]) == (hollow.left, 0.0)
        assert tuple(wall.vertices[hollow.last]) == (hollow.right, 0.0)
        assert np.all(wall.vertices[hollow.first + 1 : hollow.last, 1] < 0.0)


def test_a_plate_of_zero_thickness_does_not_split_its_hollow():
    assert CLOSED["plate"].hollows == (geo.Hollow(0.7, 1.0, 1, 5),)
    mushroom = geo.mushrooms(0.25)
    assert mushroom.hollows == (geo.Hollow(0.375, 0.625, 1, 4),)
    assert mushroom.vertices.tolist() == [[0, 0], [0.375, 0], [0, 0], [1, 0], [0.625, 0], [1, 0]]


def test_curves_are_cut_where_their_tops_touch_the_opening():
    bumps = CLOSED["bumps"]
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
        joints = Wall(FLOOR, islands=[loop]).island_vertices[0]
        x, y = joints[:-1].T
        assert np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) < 0.0
    ellipse = OPEN["disk"].islands[0][0]
    assert ellipse.direction == -1


def test_mirror_symmetry():
    symmetric = ["caves", "cavities that touch", "flasks", "flasks that touch", "inner plate", "cubic", "floor", "disk"]
    for name, wall in WALLS.items():
        assert wall.is_mirror_symmetric == (name in symmetric or name == "bumps"), name
    shifted = Wall(FLOOR, islands=[[Arc((0.5 + 1e-9, -0.5), 0.2, 0, 2 * pi)]])
    assert not shifted.is_mirror_symmetric
    pair = Wall(FLOOR, islands=[square(0.1, -0.5, 0.25), square(0.65, -0.5, 0.25)])
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
    wall = Wall(flask(0.4))
    twin = Wall(flask(0.4))
    assert wall == twin and hash(wall) == hash(twin) and wall != CLOSED["flasks that touch"]
    wall.vertices, wall.hollows  # noqa: B018  fill the caches
    for again in (copy.deepcopy(wall), pickle.loads(pickle.dumps(wall))):
        assert again == wall and not again.vertices.flags.writeable
    with pytest.raises(AttributeError):
        wall.period = 2.0


def test_repr_is_one_informative_line():
    assert repr(Wall(flask(0.4))) == "Wall(2 segments, 1 arc, period 1, depth 0.787298, closes)"
    assert repr(OPEN["touching squares"]) == "Wall(9 segments, 2 islands, period 1, depth 1, open)"


def test_outline_is_the_path_within_tolerance():
    outline = Wall(flask(0.4)).outline(1e-4)
    center = np.array([0.5, -0.4 * math.cos(math.asin(0.25))])
    inside = outline[(outline[:, 1] < 0.0)]
    assert np.hypot(*(inside - center).T) == pytest.approx(0.4, rel=1e-12)
    assert outline[0].tolist() == [0.0, 0.0] and outline[-1].tolist() == [1.0, 0.0]
    assert np.array_equal(geo.triangular_teeth(1.0).outline(0.1), geo.triangular_teeth(1.0).vertices)


def test_tangential_contacts_raise_no_alarm():
    for radius in np.random.default_rng(3).uniform(0.2, 0.5, 20):
        # a round cavity and, beside it, a bump of the neighbouring wall that touches it in one point
        assert Wall(flask(float(radius), neck=0.5 * float(radius))).closes
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
