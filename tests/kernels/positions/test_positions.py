"""Walls whose cell changes, laws that depend on the position, the displacement of rays, and the distance of states."""

import numpy as np
import pytest
from scipy.integrate import quad

from asperity import geometry as geo
from asperity import kernels as ker

RNG = 20_260_322
FLOOR = geo.Wall.from_vertices([(0, -1), (1, -1)])


def asteroids():
    """A floor with a floating diamond: the tops are at height 0, but rays pass between them."""
    rock = [(0.5, -0.1), (0.7, -0.3), (0.5, -0.5), (0.3, -0.3)]
    loop = [geo.Segment(a, b) for a, b in zip(rock, [*rock[1:], rock[0]], strict=True)]
    return geo.Wall([geo.Segment((0, -1), (1, -1))], 1.0, [loop])


def test_a_joined_wall_consists_of_its_cells():
    parts = [geo.focusing_arcs(1.1).scaled(0.5), geo.mushrooms(0.4), geo.triangular_teeth(0.8).scaled(0.25)]
    whole = geo.join_walls(parts, [2, 1, 3])
    assert whole.period == 2.75 and whole.closes
    pieces = iter(whole.pieces)
    for k, left in ((0, 0.0), (0, 0.5), (1, 1.0), (2, 2.0), (2, 2.25), (2, 2.5)):
        for own in parts[k].pieces:
            at = np.linspace(0.0, 1.0, 9)
            np.testing.assert_allclose(next(pieces).point(at), np.add(own.point(at), [left, 0.0]), atol=1e-14)
    assert next(pieces, None) is None


def test_a_joined_wall_tends_to_its_position_law():
    """Theorem 1.7, measured: the distance of states falls with the size of the cells."""
    parts = [geo.triangular_teeth(1.2), geo.focusing_arcs(1.2)]
    law = ker.PositionLaw([0.0, 1.0, 2.0], [ker.WallLaw(part) for part in parts])
    found = []
    for fineness in (1, 4, 32):
        wall = geo.join_walls([part.scaled(1.0 / fineness) for part in parts], fineness)
        found.append(ker.position_distance(wall, law, rng=RNG, rays=2**11))
    sizes = [float(one) for one in found]
    assert sizes[0] > sizes[1] > sizes[2]
    assert sizes[2] < 0.2 * sizes[0]
    assert all(one.error < 0.05 for one in found)


def moment(frequency_in, frequency_out, sign):
    """The mean of cos(k theta) cos(l theta') for theta' = theta (sign 1) or pi - theta."""

    def integrand(theta):
        outgoing = theta if sign > 0 else np.pi - theta
        return 0.5 * np.sin(theta) * np.cos(frequency_in * theta) * np.cos(frequency_out * outgoing)

    return quad(integrand, 0.0, np.pi)[0]


def test_the_distance_of_states_is_the_sum_of_its_definition():
    halves = ker.PositionLaw([0, 1, 3], [ker.specular(), ker.retroreflection()])
    other = ker.PositionLaw([0, 1, 3], [ker.retroreflection(), ker.specular()])
    total, last = 0.0, 8
    for j, m in np.ndindex(last, last):
        space = [
            quad(lambda s, j=j, m=m: np.cos(j * np.pi * s) * np.cos(m * np.pi * s), *e)[0]
            for e in ((0, 1 / 3), (1 / 3, 1))
        ]
        for k, n in np.ndindex(last, last):
            gap = moment(k, n, -1) - moment(k, n, 1)
            total += 0.5 ** (j + m + k + n + 4) * abs((space[0] - space[1]) * gap)
    found = ker.position_distance(halves, other, tolerance=1e-3)
    assert abs(float(found) - total) < 2.0 * (1.0 - (1.0 - 0.5**last) ** 4)
    assert float(found) == pytest.approx(total, rel=0.02)
    assert float(ker.position_distance(halves, halves)) == 0.0
    assert float(found) == pytest.approx(float(ker.position_distance(other, halves, tolerance=1e-3)), abs=1e-14)


def test_a_position_law_is_symmetric_and_keeps_the_position():
    law, theta = ker.PositionLaw([0.0, 0.5, 2.0], [ker.TriangularTeethLaw(0.9), ker.maxwell(0.3)]), np.array([0.4, 2.0])
    for at in (0.1, 0.4, 0.9, 1.9):
        own = law.at(at).apply(lambda t, at=at: np.sin(at + t), theta)
        np.testing.assert_allclose(law.apply(lambda x, t: np.sin(x + t), at, theta), own, rtol=1e-14)
    assert law.reversible and law.at(0.4) == ker.TriangularTeethLaw(0.9)
    assert law.weights.tolist() == [0.25, 0.75]
    incoming = np.full(20_000, 1.0)
    drawn = law.sample(np.linspace(0.0, 2.0, 20_000), incoming, rng=RNG)
    mean = float(law.mean().apply(np.cos, 1.0))
    assert abs(np.cos(drawn).mean() - mean) < 4.5 * np.cos(drawn).std() / np.sqrt(20_000)


def test_the_displacement_over_a_floor_has_its_exact_law():
    found = ker.displacements(FLOOR, 200_000, rng=RNG)
    for distance in (0.5, 2.0, 30.0):
        exact = 1.0 - distance / np.hypot(2.0, distance)
        number = found.exceeds(distance)
        assert abs(float(number) - exact) <= 2.3 * number.error
        # a wall of half the size displaces half as far
        assert float(found.exceeds(0.5 * distance, scale=0.5)) == float(number)
    tail = found.tail_exponent()
    assert abs(float(tail) - 2.0) <= 1.5 * tail.error < 0.5


def test_intervals_of_probabilities_hold_in_95_of_100_runs():
    exact = 1.0 - 10.0 / np.hypot(2.0, 10.0)
    hits = sum(
        abs(float(number) - exact) <= number.error
        for number in (ker.displacements(FLOOR, 1_000, rng=seed).exceeds(10.0) for seed in range(200))
    )
    assert hits >= 182


@pytest.mark.parametrize("wall", [asteroids(), geo.Wall.from_vertices([(0, 0), (0.3, -1.0), (0.4, -0.2), (1, 0)])])
def test_displacements_are_symmetric_because_the_map_is_an_involution(wall):
    """x' - x changes its sign under the map, which preserves the measure, even if the cell has no symmetry."""
    found = ker.displacements(wall, 60_000, rng=RNG)
    assert found.unresolved < 1e-3
    for distance in (0.05, 0.3, 0.8):
        up, down = np.sum(found.values > distance), np.sum(found.values < -distance)
        assert abs(up - down) <= 4.0 * np.sqrt(up + down) + 1e-9


def test_an_asteroid_field_displaces_rays_without_bound_and_closed_walls_do_not():
    field = ker.displacements(asteroids(), 60_000, rng=RNG)
    assert not asteroids().closes and field.longest_possible == np.inf
    assert float(field.exceeds(5.0)) > 0.0
    closed = ker.displacements(geo.mushrooms(0.4), 20_000, rng=RNG)
    assert np.max(np.abs(closed.values)) <= closed.longest_possible <= 1.0
    assert closed.exceeds(1.0).kind == "bound"


def test_displacements_of_open_walls_vanish_with_the_scale_like_their_tail():
    """P(scale abs(x' - x) > d) tends to 0 for every d, like the power of the scale that is the exponent of the tail."""
    field = ker.displacements(asteroids(), 100_000, rng=RNG)
    tail = field.tail_exponent()
    for distance in (0.5, 1.0):
        coarse, fine = (field.exceeds(distance, scale) for scale in (0.2, 0.04))
        rate = np.log(float(coarse) / float(fine)) / np.log(5.0)
        noise = (coarse.error / float(coarse) + fine.error / float(fine)) / np.log(5.0)
        assert abs(rate - float(tail)) < noise + tail.error < 0.9
        assert float(fine) + fine.error < 0.2 * float(coarse)
