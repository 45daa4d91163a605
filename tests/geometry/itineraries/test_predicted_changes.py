"""Changes of itinerary predicted from neighbouring angles, nested rules on pieces, and the bound of errors of means."""

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.itineraries.compiled.march import LEVELS, nested_rules
from asperity.geometry.itineraries.hollow import Pieces, samples_between
from asperity.kernels.expectations.angle_panels import AnglePanels
from asperity.kernels.walls.conditionals import WallConditionals

LABELS = np.array([7, 11, 13, 17], dtype=np.uint64)


def curves(angle):
    """Three changes of itinerary that move analytically with the angle."""
    return np.array([0.2 + 0.1 * np.sin(angle), 0.5 + 0.05 * angle**2, 0.9 - 0.1 * np.exp(-angle)])


def pieces(angle, keep=(True, True, True), error=1e-12, miss=0.0):
    """Pieces between these changes, each known within an error; without a change its piece ends at the next one.

    The changes lie beside the middle of the gaps, by ``miss`` times the error.
    """
    changes, labels = curves(angle)[list(keep)] + miss * error, LABELS[np.append(True, keep)]
    low, high = np.append(0.0, changes + error), np.append(changes - error, 1.0)
    return Pieces(angle, low, high, labels, low, 1e-9)


def enclosures(angle, nearest, farther, least=1e-13):
    """Half the distance of the two samples around each change; asserts that they enclose it."""
    samples = np.sort(samples_between(angle, nearest, farther, least))
    below, above = samples[::2], samples[1::2]
    assert np.all((below < curves(angle)) & (curves(angle) < above))
    return 0.5 * (above - below).max()


@pytest.mark.parametrize(("known", "order"), [(2, 1), (3, 2), (4, 3)])
def test_samples_enclose_the_changes_ever_closer_as_the_angles_do(known, order):
    """Two known angles give a line, three a parabola, four a cubic that errs by the parabola's order plus one."""
    distances = []
    for h in (0.1, 0.05, 0.025):
        nearest = pieces(1.0 - h), pieces(1.0 + 1.2 * h)
        farther = [pieces(1.0 - 2.5 * h), pieces(1.0 + 2.3 * h)][: known - 2]
        distances.append(enclosures(1.0, nearest, farther))
    orders = np.log2(np.array(distances[:-1]) / distances[1:])
    assert np.all(np.abs(orders - order) < 0.5), orders


@pytest.mark.parametrize("misses", [(0.9, 0.9, 0.9, 0.9), (-0.9, 0.9, 0.9, -0.9), (0.5, -0.9, -0.9, 0.5)])
def test_samples_enclose_changes_that_neighbours_know_within_an_error_only(misses):
    """Where a change hardly matters its gap is wide, and the prediction is as uncertain as this gap."""
    error, h = 1e-6, 1e-4
    known = [pieces(1.0 + step * h, error=error, miss=miss) for step, miss in zip((-3, -1, 1, 3), misses, strict=True)]
    distance = enclosures(1.0, (known[1], known[2]), [known[0], known[3]])
    assert error <= distance < 2.0 * error


def test_a_piece_that_is_absent_at_one_angle_gets_a_sample_in_its_middle():
    present, absent = pieces(1.0), pieces(1.1, (True, False, False))
    samples = samples_between(1.05, (present, absent), [], 1e-9)
    middles = 0.5 * (present.low + present.high)
    for wanted in middles[2:]:
        assert np.min(np.abs(samples - wanted)) < 1e-9
    # the first change is at both angles
    assert np.any(samples < curves(1.05)[0]) and np.min(np.abs(samples - curves(1.05)[0])) < 1e-3


def test_equal_changes_at_one_angle_predict_nothing():
    """Two changes between the same labels cannot be told apart."""
    low, high = np.array([0.0, 0.3, 0.5, 0.8]), np.array([0.3, 0.5, 0.8, 1.0])
    twice = Pieces(1.0, low, high, np.array([3, 5, 3, 5], dtype=np.uint64), low, 1e-9)
    assert len(twice.changes.keys) == 1 and twice.changes.positions.tolist() == [0.5]


@pytest.mark.parametrize("level", range(LEVELS))
def test_nested_rules_integrate_constants_and_square_roots_at_both_ends(level):
    rules = nested_rules(0, np.empty(0)).values
    count = 2 ** (level + 2) - 1
    x, weight = rules.positions[:count], rules.weights[level, :count]
    assert np.all(weight > 0.0) and not rules.weights[level, count:].any()
    assert abs(weight.sum() - 1.0) < 1e-14
    # the integral of sqrt(x (1 - x)) is pi/8
    assert abs(weight @ np.sqrt(x * (1.0 - x)) - np.pi / 8.0) < (3e-2, 1e-4, 1e-8, 1e-14, 1e-14)[level]


def test_the_error_of_all_integrals_together_bounds_every_choice_of_signs():
    rng = np.random.default_rng(5)
    for basis in (ker.Bins(6), ker.Legendre(5), ker.Panels(np.linspace(0.0, np.pi, 4), 2)):
        edges = np.sort(np.concatenate((basis.edges, rng.uniform(0.0, np.pi, 5))))
        panels = AnglePanels.between(edges[:-1], edges[1:], basis.size)
        panels.mean_error[:] = 10.0 ** rng.uniform(-9.0, -3.0, panels.mean_error.shape)
        panels.mean_error[2, 7] = 1.0
        bound = panels.total_mean_error(basis)
        worst = 0.0
        for _ in range(50):
            direction = rng.normal(size=panels.image.shape)
            direction /= np.linalg.norm(direction, axis=2, keepdims=True)
            panels.image[:] = direction * panels.mean_error[..., None]
            worst = max(worst, float(np.linalg.norm(panels.total(basis))))
        # one node dominates, so the bound is nearly attained
        assert worst <= bound < 1.5 * worst
        panels.mean_error[2, 7] = 0.0
        assert panels.total_mean_error(basis) <= float(np.sum(panels.mean_errors(basis)))


def test_errors_of_vectors_count_each_gap_by_the_functions_in_its_cells():
    """Functions eight times as large give eight times the error at the same samples; the masses stay the same."""
    edges, angles = np.linspace(0.0, np.pi, 9)[1:-1], np.array([0.4, 1.3])
    one, eight = (
        WallConditionals(geo.focusing_arcs(1.2), 0, edges, sizes=np.full(8, size))(angles, 1e-4 * size)[0]
        for size in (1.0, 8.0)
    )
    assert np.array_equal(one.weights, eight.weights) and np.array_equal(8.0 * one.error, eight.error)
