"""Exact beams of polygonal hollows: mass, closed forms, detailed balance, and rays traced one by one."""

import mpmath as mp
import numpy as np
import pytest
from campaigns.cases.random_hollows import random_hollow
from campaigns.judges.interval_marching import exact_row
from campaigns.judges.plain_tracer import PlainTracer

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.cells.hollow_shape import distinct_hollows
from asperity.geometry.polygons import beams as beam_module
from asperity.geometry.polygons.beams import beams_of
from asperity.geometry.polygons.compiled import division
from asperity.kernels.discretisation.isometries import table_matrix
from asperity.kernels.walls.polygons import table_of_beams


def row(beams, theta):
    """Probabilities by isometry at one angle, straight from the pieces."""
    inside = (beams.low <= theta) & (theta < beams.high)
    probability = beams.sine[inside] + beams.cosine[inside] / np.tan(theta)
    return probability, beams.sign[inside], beams.offset[inside]


def mean_cosine(beams, theta):
    probability, sign, offset = row(beams, theta)
    return probability @ np.cos(sign * theta + offset), probability.sum()


@pytest.mark.parametrize("ratio", [0.2, 1.0, 2.5])
def test_a_rectangular_crevice_reflects_by_the_fractional_part_of_its_depth(ratio):
    beams = beams_of([(0, 0), (0, -ratio), (1, -ratio), (1, 0)], max_beams=20_000)
    for theta in np.linspace(0.3, np.pi - 0.3, 17):
        probability, sign, offset = row(beams, theta)
        strip = 2.0 * ratio * abs(np.cos(theta) / np.sin(theta))
        back = probability[sign > 0].sum()
        expected = strip % 1.0 if np.floor(strip) % 2 == 0 else 1.0 - strip % 1.0
        assert abs(back - expected) < 1e-12
        assert abs(probability.sum() - 1.0) < 1e-12
        assert np.abs(offset[sign > 0]).max(initial=0.0) < 1e-18
        assert np.abs(offset[sign < 0] - np.pi).max(initial=0.0) == 0.0


@pytest.mark.parametrize("seed", range(25))
def test_the_pieces_of_a_random_hollow_have_mass_one_and_isometries_are_as_likely_as_their_inverses(seed):
    beams = beams_of(random_hollow(seed), max_beams=20_000)
    assert beams.defect < 1e-13
    assert abs(beams.resolved() + beams.unresolved - 1.0) < 1e-13
    assert beams.rounding < 1e-10 and (seed % 2 == 1 or beams.unresolved <= 1e-12)
    theta = np.random.default_rng(seed).uniform(0.1, np.pi - 0.1, 4)
    for angle in theta:
        probability, sign, offset = row(beams, angle)
        for s, a in {(int(s), round(a, 9)) for s, a in zip(sign, offset, strict=True)}:
            same = (sign == s) & (np.abs(offset - a) < 1e-8)
            image = s * angle + offset[same][0]
            if not 0.01 < image < np.pi - 0.01:
                continue
            back, back_sign, back_offset = row(beams, image)
            # theta' = -theta + a is its own inverse; theta' = theta + a has the inverse theta' - a
            inverse = (back_sign == s) & (np.abs(back_offset - (-a if s > 0 else a)) < 1e-8)
            defect = probability[same].sum() * np.sin(angle) - back[inverse].sum() * np.sin(image)
            missing = unresolved_at(beams, angle) + unresolved_at(beams, image)
            assert abs(defect) < 1e-12 + missing


def unresolved_at(beams, theta):
    inside = (beams.unresolved_low <= theta) & (theta < beams.unresolved_high)
    return (beams.unresolved_sine + beams.unresolved_cosine / np.tan(theta))[inside].sum()


@pytest.mark.parametrize("scale", [1e-6, 1e6, 3.0])
@pytest.mark.parametrize("seed", [2, 3, 4, 7, 13])
def test_the_law_does_not_depend_on_the_size_of_the_hollow(seed, scale):
    hollow = random_hollow(seed)
    plain, scaled = beams_of(hollow), beams_of(scale * hollow + [scale, 0.0])
    for theta in (0.3, 1.0, 2.2):
        ours, theirs = mean_cosine(plain, theta), mean_cosine(scaled, theta)
        assert np.abs(np.subtract(ours, theirs)).max() < 1e-12


@pytest.mark.parametrize("seed", [0, 2, 6, 10])
def test_half_of_the_rays_into_a_mirror_symmetric_hollow_tell_the_other_half(seed):
    left = random_hollow(seed)
    hollow = np.vstack([left[:-1], [1.0, -0.3], np.array([2.0, 0.0]) + left[-2::-1] * [-1.0, 1.0]])
    whole, half = beams_of(hollow), beams_of(hollow, mirror_symmetric=True)
    assert half.leaf[-1] >= whole.leaf[-1] and np.all(np.diff(np.unique(half.leaf)) == 1)
    assert abs(half.resolved() + half.unresolved - 1.0) < 1e-13 and half.complete
    for theta in (0.3, 1.0, 2.2, 3.0):
        assert np.abs(np.subtract(mean_cosine(half, theta), mean_cosine(whole, theta))).max() < 1e-12


def test_a_plate_of_no_thickness_shields_what_is_behind_it():
    # a plate from the left corner to the middle of the opening, 0.2 below it
    chain = [(0, 0), (0, -0.2), (0.5, -0.2), (0, -0.2), (0, -1), (1, -1), (1, 0)]
    beams = beams_of(chain, max_beams=50_000)
    theta = np.pi / 2
    probability, sign, offset = row(beams, theta)
    # at vertical incidence half of the rays meet the plate, the others the floor, and all come straight back
    assert abs(probability.sum() - 1.0) < 1e-12
    assert np.allclose(np.abs(sign * theta + offset - theta), 0.0, atol=1e-12)
    first = beams.bounces == 1
    assert beams.defect < 1e-13
    here = first & (beams.low <= theta) & (theta < beams.high)
    assert abs((beams.sine[here]).sum() - 1.0) < 1e-12


def test_the_unresolved_flux_between_parallel_sides_falls_as_the_square_of_the_number_of_beams():
    hollow = max((shape for shape, _ in distinct_hollows(geo.koch(3))), key=lambda shape: len(shape.vertices))
    few, many = (beams_of(hollow.vertices, max_beams=count).unresolved for count in (8_000, 32_000))
    assert many < few / 4**1.7


def largest_hollow(generation):
    return max((shape.vertices for shape, _ in distinct_hollows(geo.koch(generation))), key=len)


def test_beams_do_not_depend_on_the_number_of_threads():
    one, two = (beams_of(largest_hollow(3), max_beams=20_000, threads=threads) for threads in (1, 2))
    for name in ("sign", "offset", "low", "high", "sine", "cosine", "leaf", "bounces", "unresolved_sine"):
        assert np.array_equal(getattr(one, name), getattr(two, name))
    assert one.unresolved == two.unresolved and one.rounding == two.rounding


def test_beams_that_skip_periods_between_parallel_sides_have_the_itineraries_of_single_rays():
    hollow = largest_hollow(3)
    beams = beams_of(hollow, max_beams=100_000)
    rng, seen = np.random.default_rng(5), 0
    long = rng.choice(np.flatnonzero((beams.bounces > 100) & (beams.flux() > 1e-13)), 60, replace=False)
    for k in long:
        theta = beams.low[k] + rng.uniform(0.1, 0.9) * (beams.high[k] - beams.low[k])
        found = exact_row(hollow, theta, max_bounces=100_000)
        here = (beams.low <= theta) & (theta < beams.high) & (beams.bounces == beams.bounces[k])
        here &= beams.sign == beams.sign[k]
        probability = (beams.sine + beams.cosine / np.tan(theta))[here]
        same = (found.bounces == beams.bounces[k]) & (found.sign == beams.sign[k])
        wanted = np.diff(found.edges)[same]
        # beams that are left could hide a part
        missing = unresolved_at(beams, theta)
        assert abs(probability.sum() - wanted.sum()) < 1e-12 + missing
        mean = probability @ (beams.sign * theta + beams.offset)[here]
        assert abs(mean - wanted @ found.outgoing[same]) < 4.0 * (1e-12 + missing)
        seen += wanted.sum() > 100.0 * missing
    assert seen > 30


def test_long_ways_between_parallel_sides_cost_no_triangles():
    # without skipped periods the limit of triangles is reached before that of beams
    beams = beams_of(largest_hollow(3), max_beams=100_000, mirror_symmetric=True)
    assert beams.leaf[-1] > 70_000 and beams.unresolved < 2e-7
    assert beams.bounces.max() > 2_000


def test_the_tolerance_is_met_whatever_the_limit_on_beams():
    assert beams_of([(0, 0), (0.5, -0.5), (1, 0)], tolerance=0.0).unresolved == 0.0
    assert beams_of(random_hollow(2), tolerance=0.0, max_beams=2000).unresolved < 1e-12
    for tolerance in (1e-3, 1e-5):
        beams = beams_of(largest_hollow(3), tolerance=tolerance, max_beams=10**7)
        assert beams.complete and 0.2 * tolerance < beams.unresolved <= tolerance


@pytest.mark.slow
def test_a_hollow_symmetric_within_rounding_is_off_by_no_more_than_its_leaves_say():
    # sides of Koch curves, and of their mirror images, differ by 3e-15 radians
    given = min((shape.vertices for shape, _ in distinct_hollows(geo.koch(3)) if len(shape.vertices) > 3), key=len)
    beams = beams_of(given, max_beams=20_000, mirror_symmetric=True)
    worst = 0.0
    long = np.flatnonzero((beams.bounces > 600) & (beams.flux() > 1e-12) & (beams.low > 0.5 * np.pi))
    for k in np.random.default_rng(1).choice(long, 4, replace=False):
        theta = 0.5 * (beams.low[k] + beams.high[k])
        found = exact_row(given, theta, max_bounces=100_000)
        apart = np.abs(found.offset - beams.offset[k])
        apart[(found.bounces != beams.bounces[k]) | (found.sign != beams.sign[k])] = np.inf
        nearest = np.argmin(apart)
        with mp.workdps(60):
            ray = PlainTracer(geo.Wall.from_vertices(given), precise=True).trace(
                found.edges[nearest : nearest + 2].mean(), theta
            )
            difference = float(abs(beams.sign[k] * theta + beams.offset[k] - ray.theta))
        assert ray.hits == beams.bounces[k] and difference <= beams.offset_error + 1e-14
        worst = max(worst, difference)
    # beyond the rounding of a few angles
    assert worst > 1e-13


def test_exact_mirror_symmetry_costs_no_error_and_a_departure_its_growth():
    exact = np.array([(0, 0), (0.25, -1), (0.75, -1), (1, 0)])
    moved = np.add(exact, [[0, 0], [2.0**-50, 0], [0, 0], [0, 0]])
    plain, changed = (beams_of(chain, mirror_symmetric=True) for chain in (exact, moved))
    assert plain.offset_error == 0.0
    # twice the change of the direction of the floor, whose length is 1/2, for every bounce
    assert changed.offset_error == pytest.approx(2.0 * changed.bounces.max() * 2.0**-49, rel=1e-12)
    assert changed.rounding > plain.rounding
    # the hollow is made symmetric, so that both have one law
    assert np.array_equal(plain.offset, changed.offset) and np.array_equal(plain.sine, changed.sine)


@pytest.mark.parametrize("seed", [0, 2, 4, 6, 8, 10])
def test_half_of_the_rays_keep_their_error_where_the_mirror_image_departs(seed, monkeypatch):
    monkeypatch.setattr(beam_module, "MOST_TURNED", 1.0)
    left = random_hollow(seed)
    hollow = np.vstack([left[:-1], [1.0, -0.3], np.array([2.0, 0.0]) + left[-2::-1] * [-1.0, 1.0]])
    hollow[1:-1] += 1e-10 * np.random.default_rng(seed).uniform(-1.0, 1.0, (len(hollow) - 2, 2))
    whole, half = beams_of(hollow), beams_of(hollow, mirror_symmetric=True)
    matrices = [table_matrix(table_of_beams(beams), ker.Bins(64)) for beams in (whole, half)]
    difference = np.linalg.norm(matrices[0][0] - matrices[1][0])
    assert 10.0 * matrices[0][1] < difference <= matrices[0][1] + matrices[1][1]


def test_polygons_of_few_sides_are_resolved_by_one_call(monkeypatch):
    calls, divide = [], division.divide
    monkeypatch.setattr(division, "divide", lambda *given: calls.append(given) or divide(*given))
    for seed in (2, 3, 6, 8):
        calls.clear()
        assert beams_of(random_hollow(seed)).unresolved == 0.0 and len(calls) == 1


def test_mirror_images_that_would_cost_accuracy_give_way_to_all_rays():
    # a rough bottom of 40 sides, whose directions depart by 1e-13
    left = np.column_stack([np.linspace(0.0, 0.475, 20), [0.0, *-0.3 - 0.1 * np.random.default_rng(3).random(19)]])
    hollow = np.vstack([left, (left * [-1.0, 1.0] + [1.0, 0.0])[::-1]])
    hollow[1:-1] += 1e-13 * np.random.default_rng(4).uniform(-1.0, 1.0, (len(hollow) - 2, 2))
    whole, half = beams_of(hollow), beams_of(hollow, mirror_symmetric=True)
    assert half.offset_error == 0.0 and half.rounding == whole.rounding < 1e-11
