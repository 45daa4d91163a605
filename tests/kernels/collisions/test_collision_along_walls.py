"""Disks in containers whose walls change along their boundary."""

import math
from itertools import pairwise

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker

DISK = geo.Disk(1.0, 0.5)


def room(*angles):
    """An ellipse, cut into arcs at these parametric angles."""
    ends = [*angles, angles[0] + 2.0 * math.pi]
    return geo.Container.from_curves([geo.Arc((0.0, 0.0), (2.0, 1.0), *pair) for pair in pairwise(ends)])


def test_a_law_along_one_wall_is_that_of_the_wall_in_two_pieces_path_by_path():
    """The pieces are walls of their own, of which `play` needs no position."""
    halves, whole = room(0.0, 2.0), room(0.0)
    first = halves.curves[0].length
    laws = [ker.retroreflection(), ker.specular()]
    along = ker.CollisionAlongWall(ker.PositionLaw([0.0, first, whole.perimeter], laws), DISK)
    rng = np.random.default_rng(3)
    position = rng.uniform(-0.5, 0.5, (50, 2))
    velocity = rng.standard_normal((50, 3))
    one = ker.play(whole, along, position, velocity, 12)
    two = ker.play(halves, [ker.CollisionLaw(law, DISK) for law in laws], position, velocity, 12)
    assert np.allclose(one.position, two.position, atol=1e-9)
    assert np.allclose(one.velocity, two.velocity, atol=1e-9)
    # both laws are met, and it matters which
    assert set(np.unique(two.wall[1:])) == {0, 1}
    other = ker.play(whole, ker.no_slip(DISK), position, velocity, 12)
    assert not np.allclose(one.velocity, other.velocity, atol=0.1)


def test_a_law_along_a_straight_wall_is_repeated():
    floor = ker.PositionLaw([0.25, 0.75, 1.25], [ker.specular(), ker.retroreflection()])
    strip = geo.Container.strip(1.0)
    laws = [ker.CollisionAlongWall(floor, DISK), ker.smooth(DISK)]
    x = np.array([0.5, 1.0, 17.5, -20.0, -3.5])
    position = np.stack([x, np.full(5, 0.5)], axis=1)
    record = ker.play(strip, laws, position, [0.0, -1.0, 1.0], 1)
    # a disk that spins and falls straight down leaves a smooth floor with its spin
    slips = np.isclose(record.velocity[1, :, 2], 1.0)
    assert slips.tolist() == [True, False, True, False, True]


def test_gases_in_a_container_of_changing_roughness_stay_in_equilibrium():
    """Positions of collisions stay uniform along the boundary, because the law is reversible at each of them."""
    circle = geo.Container.circle(1.0)
    shares = 0.1 + 0.8 * (np.arange(5) + 0.5) / 5
    family = ker.PositionLaw(np.linspace(0.0, circle.perimeter, 6), [ker.maxwell(share) for share in shares])
    rng = np.random.default_rng(5)
    n = 4000
    radius, turn = np.sqrt(rng.random(n)), 2.0 * np.pi * rng.random(n)
    position = radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    record = ker.play(circle, ker.CollisionAlongWall(family, DISK), position, rng.standard_normal((n, 3)), 20, rng=1)
    at = np.arctan2(record.position[20, :, 1], record.position[20, :, 0])
    counts = np.bincount(((at + np.pi) * 8 / (2 * np.pi)).astype(int) % 8, minlength=8)
    assert np.sum((counts - n / 8) ** 2) / (n / 8) < 29.9  # quantile of chi-square with 7 degrees of freedom, 1 - 1e-4
    assert np.allclose(record.energy[0], record.energy[-1])
