"""Triangles of hollows that are awkward: plates, slits, vertices in line, parts that hang together by a point."""

import numpy as np
import pytest
from campaigns.cases.random_hollows import graph_hollow, random_hollow
from campaigns.judges.interval_marching import exact_row

from asperity.geometry.polygons.beams import beams_of
from asperity.geometry.polygons.compiled.columns import FIRST_WALL, OPENING
from asperity.geometry.polygons.triangulation import triangulated

AWKWARD = {
    "plate at a side": [(0, 0), (0, -1), (1, -1), (1, -0.5), (0.3, -0.5), (1, -0.5), (1, 0)],
    "plate on the floor": [(0, 0), (0, -1), (0.5, -1), (0.5, -0.2), (0.5, -1), (1, -1), (1, 0)],
    "vertices in line": [(0, 0), (0, -0.3), (0, -1), (0.2, -1), (0.7, -1), (1, -1), (1, -0.5), (1, -0.1), (1, 0)],
    "plate under the top": [(0, 0), (-1, 0), (-1, -1), (1, -1), (1, 0)],
    "slit of no width": [(0, 0), (0.5, -0.5), (0.5, -1), (0.5, -0.5), (1, 0)],
    "pocket behind a point": [(0, 0), (0, -1), (0.5, -0.5), (1, -1), (1, -0.5), (0.5, -0.5), (1, 0)],
    "vertices twice": [(0, 0), (0, 0), (0.5, -0.5), (0.5, -0.5), (1, 0)],
}
HOLLOWS = [*AWKWARD.values(), *(random_hollow(seed).tolist() for seed in range(20))]


def signed_areas(triangulation):
    corner = triangulation.vertices[triangulation.corners]
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    return 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])


@pytest.mark.parametrize("hollow", HOLLOWS)
def test_the_triangles_fill_the_hollow_and_none_is_turned_over(hollow):
    triangulation = triangulated(hollow)
    areas = signed_areas(triangulation) * triangulation.unit**2
    x, y = np.transpose(hollow)
    shoelace = 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
    assert areas.min() > -1e-15
    assert abs(areas.sum() - shoelace) < 1e-14


@pytest.mark.parametrize("hollow", HOLLOWS)
def test_every_side_is_a_wall_the_opening_or_shared_by_two(hollow):
    triangulation = triangulated(hollow)
    beyond, count = triangulation.beyond, len(triangulation.vertices)
    shared = np.flatnonzero(beyond >= 0)
    assert np.array_equal(beyond[beyond[shared]], shared)
    assert np.count_nonzero(beyond == OPENING) == 1
    assert sorted(FIRST_WALL - beyond[beyond <= FIRST_WALL]) == list(range(count - 1))
    start = triangulation.corners.ravel()
    end = np.roll(triangulation.corners, -1, axis=1).ravel()
    assert np.array_equal(start[shared], end[beyond[shared]])


@pytest.mark.parametrize("hollow", AWKWARD.values(), ids=AWKWARD)
def test_beams_and_rows_agree_in_awkward_hollows(hollow):
    beams = beams_of(hollow, max_beams=5000)
    for theta in (0.8, 1.5, 2.2):
        row = exact_row(hollow, theta)
        here = (beams.low <= theta) & (theta < beams.high)
        open_here = (beams.unresolved_low <= theta) & (theta < beams.unresolved_high)
        missing = (beams.unresolved_sine + beams.unresolved_cosine / np.tan(theta))[open_here].sum() + row.unresolved
        ours = (beams.sine + beams.cosine / np.tan(theta))[here] @ np.cos(beams.sign * theta + beams.offset)[here]
        found = row.sign != 0
        theirs = np.diff(row.edges)[found] @ np.cos(row.outgoing[found])
        assert abs(ours - theirs) < 1e-13 + missing


def test_pieces_of_one_wall_that_are_in_line_reflect_like_one():
    plain = beams_of([(0, 0), (0.5, -0.5), (1, 0)])
    parted = beams_of([(0, 0), (0.25, -0.25), (0.5, -0.5), (0.75, -0.25), (0.875, -0.125), (1, 0)])
    for theta in np.linspace(0.1, 3.0, 9):
        rows = []
        for beams in (plain, parted):
            here = (beams.low <= theta) & (theta < beams.high)
            probability = (beams.sine + beams.cosine / np.tan(theta))[here]
            rows.append([probability[beams.bounces[here] == n].sum() for n in (1, 2)])
        assert np.allclose(rows[0], rows[1], rtol=0.0, atol=1e-14)


def test_parallel_walls_have_equal_directions():
    # edges 0 and 2 are (1, -3) / 4 and (1, -3) / 8
    hollow = [(0, 0), (0.25, -0.75), (0.375, -1), (0.5, -1.375), (1.0, -1.5), (1.0, 0)]
    triangulation = triangulated(hollow)
    assert triangulation.turn_high[0] == triangulation.turn_high[2]
    assert triangulation.turn_low[0] == triangulation.turn_low[2]


def test_a_profile_of_hundreds_of_vertices_is_cut():
    triangulation = triangulated(graph_hollow(200, np.random.default_rng(3)))
    assert signed_areas(triangulation).min() >= 0.0


@pytest.mark.parametrize("hollow", HOLLOWS)
def test_no_diagonal_is_longer_than_the_other_one_of_its_convex_quadrilateral(hollow):
    triangulation = triangulated(hollow)
    points, corners, beyond = triangulation.vertices, triangulation.corners, triangulation.beyond

    def turn(i, j, k):
        (ax, ay), (bx, by) = points[j] - points[i], points[k] - points[i]
        return ax * by - ay * bx

    for edge in np.flatnonzero(beyond > np.arange(beyond.size)):
        (triangle, k), (other, j) = divmod(edge, 3), divmod(beyond[edge], 3)
        a, b, c, d = *np.roll(corners[triangle], -k), corners[other, (j + 2) % 3]
        if turn(d, b, c) > 1e-12 and turn(c, a, d) > 1e-12:
            assert np.linalg.norm(points[a] - points[b]) <= np.linalg.norm(points[c] - points[d]) * (1.0 + 1e-8)
