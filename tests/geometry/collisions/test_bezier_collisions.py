"""The true disk against walls with Bezier pieces: segments, graphs, the plane law, and the limit of no slip."""

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.collisions.compiled import graph_table as graphs
from asperity.geometry.collisions.rigid import ground_of
from disk_shapes import BEZIERS, DISK, PARABOLAS, states


def test_straight_bezier_pieces_collide_like_segments():
    wall = geo.triangular_teeth(1.2)
    (a, b, c) = wall.vertices
    straight = geo.Wall([geo.Bezier([a, a + (b - a) / 4, a + (b - a) / 2, b]), geo.Bezier([b, (b + c) / 2, c])])
    for scale in (1e-1, 1e-3):
        position, velocity = states(wall, scale, 2000)
        lines, curves = (geo.collide(DISK, w, scale, position, velocity) for w in (wall, straight))
        assert np.array_equal(lines.contacts, curves.contacts)
        np.testing.assert_allclose(curves.velocity, lines.velocity, atol=1e-9)


def test_the_parts_of_a_piece_are_graphs_within_their_bounds():
    for wall in BEZIERS.values():
        table, beziers = ground_of(wall.scene).graphs, wall.scene.beziers
        for row in table:
            sigma = np.linspace(row[graphs.LEAST_SIGMA], row[graphs.MOST_SIGMA], 41)
            xi = np.polyval([row[graphs.XI3], row[graphs.XI2], row[graphs.XI1], 0.0], sigma)
            eta = np.polyval([row[graphs.ETA3], row[graphs.ETA2], row[graphs.ETA1], 0.0], sigma)
            assert np.all(np.diff(xi) > 0)
            slope = np.gradient(eta, xi)
            bend = np.diff(np.diff(eta) / np.diff(xi)) / (0.5 * (xi[2:] - xi[:-2]))
            room = 1e-6 * (1.0 + np.abs(bend).max())
            assert np.hypot(1, slope).max() <= row[graphs.STEEPNESS] + 1e-3
            if row[graphs.WIDTH] > 1e-3:
                assert row[graphs.LEAST_BEND] - room <= bend.min() <= bend.max() <= row[graphs.MOST_BEND] + room
            curve = beziers[int(row[graphs.PIECE])]
            s = row[graphs.FIRST_S] + sigma
            x = np.polyval([curve[10], curve[8], curve[6], curve[0]], s)
            y = np.polyval([curve[11], curve[9], curve[7], curve[1]], s)
            along, up = row[graphs.ALONG_X], row[graphs.ALONG_Y]
            np.testing.assert_allclose(row[0] + along * xi - up * eta, x, atol=1e-14)
            np.testing.assert_allclose(row[1] + up * xi + along * eta, y, atol=1e-14)


def test_double_parabolas_of_shrinking_scale_approach_no_slip():
    # the limit is the law of the double parabola itself, whose mean deflection from no slip is 0.0581
    wall, matrix = PARABOLAS.unforeshorten(DISK), ker.no_slip_matrix(DISK)
    reached = []
    for scale in (1e-3, 1e-5, 1e-8):
        position, velocity = states(wall, scale, 2000, seed=1)
        out = geo.collide(DISK, wall, scale, position, velocity)
        gap = out.velocity - velocity @ matrix.T
        reached.append(np.mean(np.sqrt(DISK.inner(gap, gap))))
    assert reached[0] > reached[1] > reached[2]
    assert reached[2] == pytest.approx(0.054, abs=0.003)
    assert math.isclose(float(ker.distance(ker.WallLaw(PARABOLAS), ker.retroreflection())), 0.0581, abs_tol=3e-4)


def test_the_double_parabola_is_near_no_slip_in_the_papers_pseudometric():
    assert float(ker.distance(ker.WallLaw(PARABOLAS), ker.retroreflection(), kind="pseudometric")) < 0.03
