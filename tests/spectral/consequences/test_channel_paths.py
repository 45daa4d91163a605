"""Paths in a channel: flights in Cartesian coordinates, and the variances of both central limit theorems."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, simpson
from scipy.stats import kstest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity import spectral as spec

# it does not preserve the measure of the angles
DRIFTING = ker.MatrixLaw(np.array([[0.9, 0.1], [0.5, 0.5]]))
LEANING = ker.PolygonLaw(geo.Wall.from_vertices([(0, 0), (0.2, -0.5), (1, 0)]))


def rate_of_diffuse_walls(bend, half):
    """Successive flights are uncorrelated: the mean square of one, by polar angles of chords, over its mean time."""
    a, b = bend - half, bend + half
    cut = math.acos(a / b)
    inner, _ = quad(lambda t: (math.acos(a * math.cos(t) / b) - t) ** 2 * math.sin(t), 0.0, 0.5 * math.pi)
    around, _ = quad(lambda t: 4.0 * t * t * math.sin(t), 0.0, cut)
    across, _ = quad(lambda t: (math.acos(min(1.0, b * math.cos(t) / a)) - t) ** 2 * math.sin(t), cut, 0.5 * math.pi)
    # mean flight: pi times the area over the perimeter
    return bend**2 * (a * inner + b * (around + across)) / (a + b) / (math.pi * half)


def test_the_rate_in_a_bent_channel_is_that_of_uncorrelated_flights_and_its_error_holds():
    exact = rate_of_diffuse_walls(3.0, 1.0)
    found = [
        spec.channel_paths(ker.lambertian(), [20, 60, 120], 400, seed, bend=3.0).variance_rate() for seed in range(100)
    ]
    hits = sum(abs(float(one) - exact) <= one.error for one in found)
    assert hits >= 88
    values = np.array([float(one) for one in found])
    assert abs(values.mean() - exact) <= 4.0 * values.std() / 10.0
    assert np.mean([one.error for one in found]) < 2.0 * 1.96 * values.std()


def test_positions_in_a_bent_channel_over_their_scale_are_normal():
    found = spec.channel_paths(ker.lambertian(), [100, 200, 400], 4000, 5, bend=2.0)
    scaled = found.positions[:, -1] / math.sqrt(400.0 * rate_of_diffuse_walls(2.0, 1.0))
    assert kstest(scaled, "norm").pvalue > 1e-3
    assert kstest(1.15 * scaled, "norm").pvalue < 1e-3


def test_the_error_holds_where_flights_under_way_matter_more_than_sampling():
    exact, rows = 2.0 / math.pi, []
    for seed in range(12):
        found = spec.channel_paths(ker.lambertian(), [50, 200, 800], 4000, seed).limit_variance()
        rows.append((float(found), found.error))
    values, errors = np.array(rows).T
    assert np.sum(np.abs(values - exact) <= errors) >= 10
    # without the part for these flights the sampling errors alone would be exceeded too often
    assert abs(values.mean() - exact) < 0.12


def mean_square_of_diffuse_walls(time, radius, speed):
    """Uncorrelated flights begin at the rate speed/(pi radius); each counts as far as it has come."""
    theta = (np.arange(2000) + 0.5) * 0.5 * math.pi / 2000
    weight = np.sin(theta) * 0.5 * math.pi / 2000
    duration = 2.0 * radius / (speed * np.sin(theta))

    def reached(after):
        return float(np.sum(weight * (np.cos(theta) * speed * np.minimum(duration, after)) ** 2))

    # Simpson's rule in the square root of the time, as short times matter most
    root = np.linspace(0.0, math.sqrt(time), 401)
    total = float(simpson([2.0 * u * reached(u * u) for u in root], x=root))
    return reached(time) + total * speed / (math.pi * radius)


def test_the_mean_square_in_a_straight_channel_grows_twice_as_fast_as_the_variance_of_the_limit():
    times = np.array([25.0, 100.0, 400.0])
    found = spec.channel_paths(ker.lambertian(), times, 8000, 3, radius=0.5, speed=2.0)
    expected = np.array([mean_square_of_diffuse_walls(time, 0.5, 2.0) for time in times])
    squares = found.positions**2
    spread = squares.std(axis=0) / math.sqrt(8000)
    assert np.all(np.abs(squares.mean(axis=0) - expected) < 4.0 * spread + 0.01 * expected)
    slopes = np.diff(expected / times) / np.diff(np.log(times))
    assert abs(slopes[-1] * math.pi / (4.0 * 0.5 * 2.0) - 1.0) < 0.05


def paths_in_the_plane(law, bend, upper, time, n, rng, second=None):
    """X_t by vectors in the plane, for channels around the origin, perhaps with another law of the outer wall."""
    outer = rng.random(n) < 0.5 * (1.0 + 1.0 / bend)
    place = np.stack([np.zeros(n), np.where(outer, bend + 1.0, bend - 1.0)], axis=1)
    angle = np.arccos(1.0 - 2.0 * rng.random(n))
    turned, left = np.zeros(n), np.full(n, time)
    while True:
        normal = place / np.hypot(*place.T)[:, None] * np.where(outer, -1.0, 1.0)[:, None]
        # the channel runs clockwise
        along = np.stack([place[:, 1], -place[:, 0]], axis=1) / np.hypot(*place.T)[:, None]
        tangent = along * np.where(outer, upper, 1.0)[:, None]
        u = np.cos(angle)[:, None] * tangent + np.sin(angle)[:, None] * normal
        best, other = np.full(n, np.inf), outer.copy()
        for radius, which in ((bend - 1.0, False), (bend + 1.0, True)):
            b, c = np.sum(place * u, axis=1), np.sum(place**2, axis=1) - radius**2
            root = b * b - c
            for sign in (-1.0, 1.0):
                t = np.where(root > 0.0, -b + sign * np.sqrt(np.maximum(root, 0.0)), np.inf)
                nearer = (t > 1e-7) & (t < best)
                best, other = np.where(nearer, t, best), np.where(nearer, which, other)
        step = np.minimum(best, left)
        after = place + step[:, None] * u
        turned -= np.arctan2(place[:, 0] * after[:, 1] - place[:, 1] * after[:, 0], np.sum(place * after, axis=1))
        left = left - step
        if not np.any(left > 0.0):
            return bend * turned
        place, outer = np.where((left > 0.0)[:, None], after, place), np.where(left > 0.0, other, outer)
        normal = place / np.hypot(*place.T)[:, None] * np.where(outer, -1.0, 1.0)[:, None]
        along = np.stack([place[:, 1], -place[:, 0]], axis=1) / np.hypot(*place.T)[:, None]
        tangent = along * np.where(outer, upper, 1.0)[:, None]
        level = np.sum(-u * tangent, axis=1)
        incoming = np.where(left > 0.0, np.arccos(np.clip(level, -1.0, 1.0)), 1.0)
        incoming = np.clip(incoming, 1e-12, np.pi - 1e-12)
        angle = law.sample(incoming, rng)
        if second is not None:
            angle = np.where(outer, second.sample(incoming, rng), angle)


@pytest.mark.parametrize(("arrangement", "upper"), [("mirror", 1.0), ("half-turn", -1.0)])
def test_paths_agree_with_vectors_in_the_plane(arrangement, upper):
    """A law without mirror symmetry tells both arrangements from each other."""
    n, time = 20_000, 12.0
    plain = paths_in_the_plane(LEANING, 2.5, upper, time, n, np.random.default_rng(1))
    found = spec.channel_paths(LEANING, [1.0, 2.0, time], n, 2, bend=2.5, arrangement=arrangement).positions[:, -1]
    for power in (1, 2, 3):
        one, two = plain**power, found**power
        assert abs(one.mean() - two.mean()) < 4.0 * np.hypot(one.std(), two.std()) / math.sqrt(n)
    if arrangement == "half-turn":
        # a rotation by half a turn exchanges the straight walls, not the bent ones
        straight = spec.channel_paths(LEANING, [1.0, 2.0, time], n, 3, arrangement=arrangement).positions[:, -1]
        assert abs(straight.mean()) < 4.0 * straight.std() / math.sqrt(n)


def test_retroreflected_particles_stay_on_one_chord():
    found = spec.channel_paths(ker.retroreflection(), [5.0, 50.0, 500.0], 500, 0, bend=2.0)
    # the longest chord touches the inner circle
    assert np.all(np.abs(found.positions) <= 2.0 * 2.0 * math.acos(1.0 / 3.0) + 1e-9)


# ---- a lower and an upper law --------------------------------------------------------------------------------------
def same_means(one, two, powers=(1, 2, 3), sigmas=4.0):
    for power in powers:
        first, second = one**power, two**power
        spread = np.hypot(first.std() / math.sqrt(len(first)), second.std() / math.sqrt(len(second)))
        assert abs(first.mean() - second.mean()) < sigmas * spread


@pytest.mark.parametrize(("arrangement", "upper"), [("mirror", 1.0), ("half-turn", -1.0)])
def test_paths_between_two_laws_agree_with_vectors_in_the_plane(arrangement, upper):
    n, time, other = 20_000, 12.0, ker.maxwell(0.3)
    for inner, outer in ((LEANING, other), (other, LEANING)):
        plain = paths_in_the_plane(inner, 2.5, upper, time, n, np.random.default_rng(1), outer)
        found = spec.channel_paths(inner, [1.0, 2.0, time], n, 2, bend=2.5, arrangement=arrangement, other=outer)
        same_means(plain, found.positions[:, -1])


def test_walls_of_a_straight_channel_may_be_exchanged_and_each_counts():
    times, n = [1.0, 5.0, 20.0], 20_000
    paths = [
        spec.channel_paths(first, times, n, seed, other=second).positions[:, -1]
        for seed, (first, second) in enumerate([(LEANING, ker.maxwell(0.3)), (ker.maxwell(0.3), LEANING)])
    ]
    same_means(*paths)
    alike = spec.channel_paths(LEANING, times, n, 3).positions[:, -1]
    assert abs((paths[0] ** 2).mean() - (alike**2).mean()) > 10.0 * (alike**2).std() / math.sqrt(n)


def test_particles_between_a_rough_and_a_smooth_wall_are_those_of_a_channel_twice_as_wide():
    law = 0.5 * LEANING + 0.5 * ker.lambertian()
    for first, second in ((law, ker.specular()), (ker.specular(), law)):
        half = spec.channel_diffusivity(first, [5.0, 20.0], 2000, 1, other=second)
        double = spec.channel_diffusivity(law, [5.0, 20.0], 2000, 2, radius=2.0)
        assert np.all(np.abs(half.values - double.values) < 1.5 * np.hypot(half.errors, double.errors))


def test_the_onset_of_two_laws_is_the_larger_one():
    deep, shallow = ker.lambertian(), ker.CircularArcLaw(0.3)
    onsets = [
        spec.channel_diffusivity(law, [5.0], 2, 0, other=other).onset
        for law, other in ((deep, None), (shallow, None), (deep, shallow), (shallow, deep), (deep, ker.specular()))
    ]
    assert onsets[2] == onsets[3] == onsets[1] > onsets[0] == onsets[4]
    assert spec.channel_diffusivity(shallow, [5.0], 2, 0, other=DRIFTING).onset == math.inf


def test_twice_the_same_law_and_both_conventions_give_the_same_bits():
    for law in (ker.lambertian(), LEANING):
        one = spec.channel_paths(law, [1.0, 2.0, 4.0], 50, 1)
        two = spec.channel_paths(law.in_specular_frame(), [1.0, 2.0, 4.0], 50, 1, other=law.in_specular_frame())
        assert np.array_equal(one.positions, two.positions)
    first, second = LEANING, ker.maxwell(0.3)
    paper = spec.exit_times(first, [1.0, 2.0, 4.0], 50, 1, other=second)
    turned = spec.exit_times(first.in_specular_frame(), [1.0, 2.0, 4.0], 50, 1, other=second.in_specular_frame())
    assert np.array_equal(paper.times, turned.times)
