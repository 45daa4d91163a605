"""The true disk against walls with Bezier pieces: two judges of their own, involution, and the limit of no slip."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from campaigns.judges.precise_collision import Flight

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.collisions.compiled import graph_table as graphs
from asperity.geometry.collisions.records import ground_of
from asperity.geometry.disk.satellites import Satellites
from disk_shapes import BEZIERS, DISK, PARABOLAS, WAVES, states


class ParabolaFlight(Flight):
    """Over the double parabola by its equations y^2 = 4x and y^2 = 4(1 - x), in many digits."""

    @staticmethod
    def fronts(x, y):
        """4x - y^2 and 4(1 - x) - y^2, positive on the free side, with gradients."""
        x -= mp.floor(x)
        return (4 * x - y * y, (4, -2 * y)), (4 * (1 - x) - y * y, (-4, -2 * y))

    def rates(self, k, x, y, angle):
        _, (n1, n2) = self.fronts(x, y)[k]
        return n1 * (self.v[0] + self.v[2] * mp.cos(angle)) + n2 * (self.v[1] + self.v[2] * mp.sin(angle))

    def next_contact(self, own):
        fastest = mp.hypot(self.v[0], self.v[1]) + abs(self.v[2])
        steepest = mp.sqrt(16 + 8)
        bend = steepest * self.scale * self.v[2] ** 2 + 2 * fastest**2
        end = -self.height / self.v[1] if self.v[1] > 0 else mp.inf
        time = mp.mpf(0)
        for _ in range(20_000):
            free = mp.mpf(1) / (8 * fastest)
            for number, (x, y, angle) in enumerate(self.satellites(time)):
                if y > 0:
                    free = min(free, max(y, mp.mpf(10) ** -12) / fastest)
                    continue
                for k, (side, _) in enumerate(self.fronts(x, y)):
                    rate = self.rates(k, x, y, angle)
                    if own is not None and time == 0 and (number, k) == own[:2]:
                        free = min(free, rate / bend)
                    elif side < 1e-9 and rate < 0:
                        return self.refined(time, number, k)
                    else:
                        free = min(free, max(side, mp.mpf(10) ** -9) / (steepest * fastest))
            if time >= end:
                return end, None
            time = min(time + free, end)
        raise ArithmeticError("too many steps")

    def refined(self, time, number, k):
        for _ in range(8):
            x, y, angle = self.satellites(time)[number]
            time -= self.fronts(x, y)[k][0] / self.rates(k, x, y, angle)
        x, y, angle = self.satellites(time)[number]
        _, (n1, n2) = self.fronts(x, y)[k]
        size = mp.hypot(n1, n2)
        return time, (number, k, (n1 / size, n2 / size), angle)

    def collide(self):
        own, contacts = None, 0
        while contacts <= 60:
            time, contact = self.next_contact(own)
            self.x, self.height = self.x + self.v[0] * time, self.height + self.v[1] * time
            self.alpha += self.scale * self.v[2] * time
            if contact is None:
                return (self.scale * self.x, self.alpha), tuple(self.v), contacts
            own, contacts = contact, contacts + 1
            _, _, (n1, n2), angle = contact
            arm = n1 * mp.cos(angle) + n2 * mp.sin(angle)
            push = 2 * (n1 * self.v[0] + n2 * self.v[1] + arm * self.v[2])
            push /= (n1**2 + n2**2) / self.mass + arm**2 / self.inertia
            self.v = [self.v[0] - push * n1 / self.mass, self.v[1] - push * n2 / self.mass,
                      self.v[2] - push * arm / self.inertia]  # fmt: skip
        raise ArithmeticError("too many contacts")


@pytest.mark.parametrize("scale", [1e-1, 1e-4])
def test_collisions_with_the_double_parabola_agree_with_thirty_digits(scale):
    position, velocity = states(PARABOLAS, scale, 12, seed=3)
    spacing = Satellites.around(scale, scale * PARABOLAS.depth).spacing
    out = geo.collide(DISK, PARABOLAS, scale, position, velocity)
    with mp.workdps(30):
        for k in range(len(position)):
            start = [mp.mpf(float(p)) for p in position[k]], [mp.mpf(float(v)) for v in velocity[k]]
            _, judged, contacts = ParabolaFlight(PARABOLAS, DISK, scale, spacing, *start).collide()
            assert contacts == out.contacts[k]
            np.testing.assert_allclose(out.velocity[k], [float(v) for v in judged], atol=1e-16 / scale + 1e-12)


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


def test_satellites_on_the_cylinder_follow_the_foreshortened_plane_law():
    position, velocity = states(WAVES, 1.0, 2000)
    out = geo.collide_cylinder(DISK, WAVES, 1.0, position, velocity)
    theta, _ = DISK.to_angles(-velocity)
    plane = geo.trace(WAVES.foreshorten(DISK), position.sum(axis=1), theta)
    both = out.escaped & plane.escaped
    assert both.mean() > 0.999
    angles, _ = DISK.to_angles(out.velocity)
    assert np.quantile(np.abs(angles - plane.theta)[both], 0.99) < 1e-9
    assert np.mean(out.contacts[both] == plane.collisions[both]) > 0.999


def test_double_parabolas_of_shrinking_scale_approach_no_slip():
    # the limit is the law of the double parabola itself, whose mean deflection from no slip is 0.0581
    wall, matrix = PARABOLAS.unforeshorten(DISK), ker.no_slip_matrix(DISK)
    reached = []
    for scale in (1e-3, 1e-5, 1e-8):
        position, velocity = states(wall, scale, 8000, seed=1)
        out = geo.collide(DISK, wall, scale, position, velocity)
        gap = out.velocity - velocity @ matrix.T
        reached.append(np.mean(np.sqrt(DISK.inner(gap, gap))))
    assert reached[0] > reached[1] > reached[2]
    assert reached[2] == pytest.approx(0.054, abs=0.003)
    assert math.isclose(float(ker.distance(ker.WallLaw(PARABOLAS), ker.retroreflection())), 0.0581, abs_tol=3e-4)


def test_the_double_parabola_is_near_no_slip_in_the_papers_pseudometric():
    assert float(ker.distance(ker.WallLaw(PARABOLAS), ker.retroreflection(), kind="pseudometric")) < 0.03
