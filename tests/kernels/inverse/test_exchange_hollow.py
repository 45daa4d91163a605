"""Chambers whose mirrors perform an exchange of intervals: exact paths, traced rays, and the order of the loss."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.estimates import Estimate
from asperity.kernels.inverse.mirror_layout import CLEARANCE, MirrorPair, arranged, mirror_groups


def exchange_of(law, cells):
    return ker.IntervalExchangeLaw(ker.discretise(law, ker.Bins(cells)))


def pair_of(low, high, start, **others):
    return MirrorPair((low, high), (start, float(np.arccos(np.cos(start) + np.cos(high) - np.cos(low)))), **others)


def air_resistance(theta, outgoing):
    """Plakhov's cost, of which `resistance` is the mean."""
    return 0.75 * (1.0 + np.cos(outgoing - theta))


PAIRS = [
    pair_of(0.3, 0.9, 1.2, ratio=1.7), pair_of(0.0, 0.6, 1.5, least_angle=1e-3), pair_of(1.0, 1.3, 2.0),
    pair_of(0.0, 0.6, 1.5, least_angle=1e-4),
]  # fmt: skip


@pytest.mark.parametrize("pair", PAIRS)
def test_rays_from_the_focus_return_to_it_at_the_prescribed_angles(pair):
    t = np.linspace(*pair.ends, 41)
    first, second = pair.curve(0, t), pair.curve(1, t)
    theta, image = pair.angles(t)
    assert np.ptp(np.cos(image) - np.cos(theta)) < 1e-14
    outwards = first.position / np.linalg.norm(first.position, axis=1)[:, None]
    assert np.abs(outwards + np.stack([np.cos(theta), np.sin(theta)], axis=1)).max() < 1e-14

    def reflected(velocity, tangent):
        return 2.0 * np.sum(velocity * tangent, axis=1)[:, None] * tangent - velocity

    across = reflected(outwards, first.tangent)
    joining = second.position - first.position
    assert np.abs(across - joining / np.linalg.norm(joining, axis=1)[:, None]).max() < 1e-12
    back = reflected(across, second.tangent)
    assert np.abs(back - np.stack([np.cos(image), np.sin(image)], axis=1)).max() < 1e-12


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("which", [0, 1])
def test_tangents_are_those_of_the_curve_and_its_bezier_pieces(pair, which):
    t = np.linspace(*pair.ends, 9)[1:-1]
    step = 1e-5
    chord = pair.curve(which, t + step).position - pair.curve(which, t - step).position
    chord /= np.linalg.norm(chord, axis=1)[:, None]
    assert np.abs(chord - pair.curve(which, t).tangent).max() < 1e-8
    assert np.abs(pair.parameter(which, pair.angles(t)[which]) - t).max() < 1e-9
    for piece in pair.pieces(which, 1e-8):
        place, tangent = piece.point(np.linspace(0.0, 1.0, 51)), piece.tangent(np.linspace(0.0, 1.0, 51))
        wanted = pair.curve(which, pair.parameter(which, np.arctan2(-place[:, 1], -place[:, 0])))
        assert np.linalg.norm(place - wanted.position, axis=1).max() < 1e-7
        # between the parameters that are compared
        assert np.abs(tangent - wanted.tangent).max() < 1.5e-8


def test_the_ratio_of_the_distances_is_that_asked_for():
    pair = pair_of(0.3, 0.9, 1.2, ratio=1.7)
    middle = 0.5 * sum(pair.ends)
    assert float(pair.distance(0, middle) / pair.distance(1, middle)) == pytest.approx(1.7)
    assert min(float(pair.distance(which, t)) for which in (0, 1) for t in pair.ends) == pytest.approx(1.0)


@pytest.mark.slow
def test_the_loss_falls_in_proportion_to_the_opening():
    exchange = exchange_of(ker.henyey_greenstein(0.5), 3)
    wide, narrow = (
        ker.exchange_hollow(exchange, opening).loss(rays) for opening, rays in ((1e-2, 2**14), (1e-4, 2**19))
    )
    order = np.log10(wide.value / narrow.value) / 2.0
    spread = np.hypot(wide.error / wide.value, narrow.error / narrow.value) / np.log(100.0)
    assert abs(order - 1.0) < 0.15 and spread < 0.1
    assert wide.value < 0.05 and narrow.value < 5e-4


def test_rays_leave_where_the_exchange_sends_them():
    exchange = exchange_of(ker.lambertian(), 4)
    hollow = ker.exchange_hollow(exchange, 1e-3)
    assert hollow.mirrors == 16
    theta = ker.SINE.sample(2000, np.random.default_rng(2))
    middle = 0.5 * sum(hollow.opening)
    traced = geo.trace(hollow.wall, np.full(2000, middle), theta)
    image = exchange.image(theta)
    away = np.abs(traced.theta - image)
    # but for the rays under the ceiling
    assert np.mean(away < 1e-5) > 0.999
    assert np.array_equal(np.unique(traced.collisions[away < 1e-5]), [1, 2])
    # the exchange and its matrix: from cell to cell with equal probabilities
    cells = np.digitize(np.cos(theta), [-0.5, 0.0, 0.5]) * 4 + np.digitize(np.cos(traced.theta), [-0.5, 0.0, 0.5])
    counts = np.bincount(cells, minlength=16)
    assert np.sum((counts - 125.0) ** 2 / 125.0) < 40.0


def random_exchanges():
    """Exchanges of neighbours by different fractions of cells, and mixtures of permutations and their inverses."""
    rng = np.random.default_rng(3)
    matrix = np.diag(rng.uniform(0.1, 0.45, 2), 1)
    matrix += matrix.T
    yield matrix + np.diag(1.0 - matrix.sum(axis=1))
    matrix = np.mean([np.eye(5)[rng.permutation(5)] for _ in range(2)], axis=0)
    yield 0.5 * (matrix + matrix.T)
    yield np.eye(4)[[1, 0, 3, 2]]


@pytest.mark.parametrize("matrix", list(random_exchanges()), ids=lambda matrix: f"{len(matrix)} cells")
def test_every_symmetric_matrix_has_its_chamber(matrix):
    nothing = Estimate(0.0, 0.0, "bound", "given")
    exchange = ker.IntervalExchangeLaw(ker.KernelMatrix(matrix, ker.Bins(len(matrix)), nothing))
    hollow = ker.exchange_hollow(exchange, 1e-3)
    assert hollow.mirrors >= exchange.starts.size
    assert float(hollow.loss(2**14)) < 2e-4 * hollow.mirrors + 1e-3
    distances = [np.hypot(x - 0.5 * sum(hollow.opening), y) for loop in hollow.wall.island_vertices for x, y in loop]
    assert min(distances) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.slow
def test_a_chamber_for_the_least_resistance_has_one_below_0_990():
    exchange = exchange_of(ker.LeastResistanceLaw(), 16)
    hollow = ker.exchange_hollow(exchange, 1e-4)
    found = hollow.mean(air_resistance, 1.5, 2**14)
    assert float(ker.resistance(exchange)) < float(found)
    # also with the flat necks of many generations, whose resistance is 1
    limit = hollow.generations(1, neck=1e-3, samples=2).limit
    assert limit * (float(found) + found.error) + 1.0 - limit < 0.9895


def test_the_mean_over_an_exchange_is_that_of_its_law():
    exchange = exchange_of(ker.henyey_greenstein(0.5), 3)
    found = ker.exchange_hollow(exchange, 1e-4).mean(air_resistance, 1.5, 2**12, np.random.default_rng(5))
    assert abs(float(found) - float(ker.resistance(exchange))) < 2.0 * found.error < 1e-2


def test_generations_approach_the_exchange():
    hollow = ker.exchange_hollow(exchange_of(ker.lambertian(), 2), 1e-2)
    first, some, many = (hollow.generations(number, neck=1e-3) for number in (1, 300, 10_000))
    width = hollow.opening[1] - hollow.opening[0]
    assert first.covered == pytest.approx(width / hollow.wall.period)
    assert first.covered < some.covered < many.covered < many.limit * (1 + 1e-12) < 1.0
    assert float(many.distance) < 0.03 < float(some.distance) < float(first.distance)
    # the bound holds for the mixture: its own distance is smaller
    law = ker.distance(some.law, hollow.exchange, kind="joint", tolerance=1e-2)
    assert float(law) - law.error < float(some.distance) + some.distance.error
    # no copies but in the ceiling: two generations by hand
    copies = 1.0 - 1.002 * first.covered
    second = hollow.generations(2, neck=1e-3)
    assert second.covered == pytest.approx(first.covered * (1.0 + copies))


def test_no_beam_meets_a_third_mirror():
    exchange = exchange_of(ker.lambertian(), 5)
    ends = np.concatenate([[0.0], ker.SINE.quantile(exchange.starts[1:]), [np.pi]])
    groups = mirror_groups(ends, exchange.partner.tolist(), 1e-3, 1e-6)
    factors = arranged(groups)
    assert factors.min() == 1.0
    beams = 0
    for beam, scale in zip(groups, factors, strict=True):
        if beam.pair is None:
            continue
        t = np.linspace(*beam.pair.ends, 50)
        near, far = (scale * beam.pair.curve(which, t).position for which in (0, 1))
        theta, image = beam.pair.angles(t)
        for other, factor in zip(groups, factors, strict=True):
            for angles, distance in () if other is beam else other.points:
                between = (angles[0] >= theta.max() - 1e-12) & (angles[-1] <= image.min() + 1e-12)
                if not between:
                    assert angles[-1] <= theta.max() + 1e-12 or angles[0] >= image.min() - 1e-12
                    continue
                # where the line from near to far crosses the ray at each angle
                ray = -np.stack([np.cos(angles), np.sin(angles)], axis=1)
                join = far - near
                numerator = near[:, 0] * join[:, 1] - near[:, 1] * join[:, 0]
                crossing = numerator[:, None] / (ray[:, 0] * join[:, 1:] - ray[:, 1] * join[:, :1])
                quotient = crossing / (factor * distance)
                assert quotient.max() < 1.0 / (1.0 + 0.9 * CLEARANCE) or quotient.min() > 1.0 + 0.9 * CLEARANCE
                beams += 1
    assert beams > 20
