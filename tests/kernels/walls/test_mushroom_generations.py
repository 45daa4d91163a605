"""Generations of mushrooms whose pieces are not listed: against listed ones, in laws, and towards retroreflection."""

from fractions import Fraction

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker


def rays(n, seed=0):
    rng = np.random.default_rng(seed)
    return rng.random(n), np.arccos(1 - 2 * rng.random(n))


@pytest.mark.parametrize(("s", "a", "generations"), [(0.25, 0.5, 3), (0.4, 0.3, 2), (0.3, 0.0, 1)])
def test_rays_agree_with_the_wall_whose_pieces_are_listed(s, a, generations):
    x, theta = rays(4000)
    wall, listed = geo.MushroomGenerations(s, a, generations), geo.mushrooms(s, a, generations)
    ours, theirs = wall.trace(x - 1.0, theta), geo.trace(listed, x - 1.0, theta)
    assert np.array_equal(ours.collisions, theirs.collisions)
    assert np.array_equal(ours.status, theirs.status)
    np.testing.assert_allclose(ours.theta, theirs.theta, atol=1e-9)
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-9)
    openings = sum(hollow.right - hollow.left for hollow in listed.hollows)
    assert wall.opened == pytest.approx(openings, rel=1e-12)


def test_the_generation_of_a_position_agrees_with_nested_intervals_in_rationals():
    # s = 1/4 and a = 1/2: a stem is [3/8, 5/8], and each flat top holds two cells
    wall = geo.MushroomGenerations(0.25, 0.5, 30)

    def judged(x):
        left, width = Fraction(0), Fraction(1)
        for number in range(1, 31):
            inside = (x - left) / width
            if Fraction(3, 8) <= inside <= Fraction(5, 8):
                return number
            start = left if inside < Fraction(3, 8) else left + width * Fraction(5, 8)
            width *= Fraction(3, 16)
            left = start if x < start + width else start + width
        return 0

    x = np.random.default_rng(3).random(300)
    assert wall.generation(x).tolist() == [judged(Fraction(float(value))) for value in x]
    assert wall.generation(x).max() > 12


def test_the_fraction_of_rays_that_enter_is_the_opened_fraction():
    x, theta = rays(20_000, seed=4)
    wall = geo.MushroomGenerations(0.1, 0.2, 12)
    entered = np.count_nonzero(wall.generation(x))
    spread = np.sqrt(len(x) * wall.opened * (1 - wall.opened))
    assert abs(entered - len(x) * wall.opened) < 4.5 * spread
    on_top = wall.generation(x) == 0
    assert np.all(wall.trace(x, theta).theta[on_top] == np.pi - theta[on_top])


def test_one_generation_has_the_law_of_its_wall_and_more_generations_a_mixture():
    single = ker.WallLaw(geo.mushrooms(0.25, 0.5))
    angle, edges = np.array([0.3, 1.1, 2.5]), np.linspace(0.0, np.pi, 9)
    one, many = (ker.MushroomLaw(geo.MushroomGenerations(0.25, 0.5, k)) for k in (1, 6))
    np.testing.assert_allclose(one.apply(np.cos, angle), single.apply(np.cos, angle), atol=1e-12)
    masses = [law.conditionals(angle, degree=0, edges=edges[1:-1]).masses(edges) for law in (one, single, many)]
    np.testing.assert_allclose(masses[0], masses[1], atol=1e-12)
    # six generations: the fraction 1 - 0.75^6 instead of 0.25 enters
    factor = (1 - 0.75**6) / 0.25
    expected = factor * (single.apply(np.cos, angle) + 0.75 * np.cos(angle)) - 0.75**6 * np.cos(angle)
    np.testing.assert_allclose(many.apply(np.cos, angle), expected, atol=1e-7)
    np.testing.assert_allclose(masses[2].sum(axis=1), 1.0, atol=1e-9)


def test_a_distance_has_the_errors_of_walls_with_many_pieces() -> None:
    # the same law twice, from the wall of generation 1 and from all pieces
    found = ker.distance(
        ker.MushroomLaw(geo.MushroomGenerations(0.25, 0.5, 3)), ker.WallLaw(geo.mushrooms(0.25, 0.5, 3))
    )
    assert 0.0 < found.value <= found.error < 1e-4


def test_many_generations_of_narrow_mushrooms_approach_retroreflection():
    x, theta = rays(20_000, seed=8)
    reached = []
    for s, a, generations in ((0.1, 0.02, 40), (0.04, 0.01, 120), (0.02, 0.005, 250)):
        law = ker.MushroomLaw(geo.MushroomGenerations(s, a, generations))
        reached.append(np.abs(law.reflect(x, theta) - theta).mean())
    # the mean deflection bounds the distance of the laws from above
    assert reached[0] > reached[1] > reached[2]
    assert reached[2] < 0.06
