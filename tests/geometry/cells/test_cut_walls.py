"""Joints along a side or a curve, at which nothing changes: computations use pieces without them."""

import math
from itertools import pairwise

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import WallError
from asperity.geometry import Arc, Bezier, Segment, Wall

CORNERS = [(0, 0), (0.3, 0), (0.3, -0.7), (1, -0.7), (1, 0)]


def cut(vertices, parts):
    """The path with every side cut in equal parts."""
    sides = [np.linspace(p, q, parts + 1)[:-1] for p, q in pairwise(vertices)]
    return np.concatenate([*sides, [vertices[-1]]])


@pytest.mark.parametrize("parts", [3, 7])
def test_joints_along_a_side_change_neither_a_matrix_nor_its_error(parts):
    wall, same = Wall.from_vertices(CORNERS), Wall.from_vertices(cut(CORNERS, parts))
    assert len(same.pieces) == 4 * parts and same.cell == wall and same.cell.cell is same.cell
    matrix, other = (ker.discretise(ker.WallLaw(each), ker.Bins(16)) for each in (wall, same))
    assert np.array_equal(matrix.symmetric, other.symmetric) and float(other.error) == float(matrix.error) < 1e-12
    # also below y = 0, begun in the middle of a side, and compressed
    rolled = Wall.from_vertices(cut([(0, -1), (0.4, -1), (0.4, -0.3), (0.7, -0.3), (0.7, -1), (1, -1)], parts))
    disk = geo.Disk(1.0, 0.37)
    assert [len(each.cell.pieces) for each in (rolled, rolled.foreshorten(disk), rolled.mirrored())] == [4, 4, 4]


def test_parts_of_arcs_and_bezier_curves_are_joined_and_keep_closed_forms():
    arc = geo.focusing_arcs(1.2).pieces[0]
    first, rest = arc.split(0.3)
    ((_, law),) = ker.WallLaw(Wall([first, *rest.split(0.6)])).parts
    assert isinstance(law, ker.CircularArcLaw) and law.half_angle == pytest.approx(1.2, rel=1e-14)
    bowl = Bezier([(0, 0), (0.2, -0.9), (0.7, -0.8), (1, 0)])
    before, after = bowl.split(0.4)
    (whole,) = Wall([before, after]).cell.pieces
    assert np.allclose(whole.control_points, bowl.control_points, rtol=0, atol=1e-15)
    floor = [Segment((0, -1), (0.6, -1)), Segment((0.6, -1), (1, -1))]
    quarters = [Arc((0.5, -0.5), (0.3, 0.2), -k * 0.5 * math.pi, -(k + 1) * 0.5 * math.pi) for k in range(4)]
    cell = Wall(floor, islands=[quarters]).cell
    assert cell.pieces == (Segment((0, -1), (1, -1)),) and len(cell.islands[0]) == 1
    assert cell.islands[0][0].half_span == pytest.approx(math.pi, abs=1e-15)
    square = cut([(0.3, -0.6), (0.3, -0.3), (0.7, -0.3), (0.7, -0.6), (0.3, -0.6)], 3)
    loop = Segment.path(np.roll(square[:-1], 1, axis=0)[[*range(12), 0]])
    assert len(Wall(floor, islands=[loop]).cell.islands[0]) == 4


def test_joints_stay_where_something_changes():
    # where a top touches the level, and along a polygon of many sides
    bump = Wall([Segment((0, 0), (0, -0.3)), Arc((0.5, -0.5), 0.5, math.pi, 0.0).pinned((0, -0.3), (1, -0.3)),
                 Segment((1, -0.3), (1, 0))])  # fmt: skip
    assert [type(piece) for piece in bump.cell.pieces] == [type(piece) for piece in bump.pieces]
    turns = np.linspace(-math.pi, 0.0, 200_001)
    bowl = Wall.from_vertices(np.column_stack([0.5 + 0.5 * np.cos(turns), np.minimum(0.5 * np.sin(turns), 0.0)]))
    assert bowl.cell is bowl


def test_a_crossing_names_the_pieces_that_were_given():
    with pytest.raises(WallError, match=r"piece 3 and piece \d+ cross"):
        Wall.from_vertices([*cut([(0, 0), (0.5, -1)], 6), (0.9, -0.6), (0.1, -0.7), (1, 0)])
