"""What closed-form laws must fulfil: slots of one isometry, breakpoints, published and derived numbers."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from asperity.kernels.bases.measure import SINE
from asperity.kernels.laws.law import BranchLaw
from asperity.kernels.walls.circular_arc import CircularArcLaw
from asperity.kernels.walls.rectangular import RectangularTeethLaw
from asperity.kernels.walls.triangular import TriangularTeethLaw


# ---- laws that hold for every wall --------------------------------------------------------------------------------
def flux_pairing(law: BranchLaw, f: Callable, g: Callable, limit: int, order: int) -> float:
    breakpoints, _ = law.breakpoints(limit)
    angle, weight = SINE.quadrature(np.concatenate([[0.0], breakpoints, [math.pi]]), order)
    return float(weight @ (f(angle) * law.apply(g, angle)))


@pytest.mark.parametrize("law", [TriangularTeethLaw(0.7), TriangularTeethLaw(2.0), RectangularTeethLaw(1.3)])
def test_every_slot_is_one_isometry_between_kinks(law: BranchLaw) -> None:
    breakpoints, _ = law.breakpoints(400)
    edges = np.concatenate([[0.0], breakpoints, [math.pi]])
    low, width = edges[:-1, None], np.diff(edges)[:, None]
    theta = low + width * np.array([0.1, 0.3, 0.6, 0.9])
    probability, outgoing = law.branches(theta)
    used = probability > 0.0
    assert np.all(used.all(axis=1) | ~used.any(axis=1))
    slope = np.diff(outgoing, axis=1) / np.diff(theta, axis=1)[..., None]
    wide = (width > 1e-6)[:, :, None]
    assert np.all((np.abs(np.abs(slope) - 1.0) < 1e-8) | ~wide)
    assert np.all((np.ptp(np.sign(slope), axis=1) == 0.0) | ~wide[:, 0])


def test_rectangular_kinks_say_how_much_they_leave_out() -> None:
    breakpoints, left_out = RectangularTeethLaw(1.0).breakpoints(101)
    assert breakpoints.size == 101
    # cot(theta) = k/2, k = 1..50: beyond lies cot(theta) > 25, of probability 1 - 25/sqrt(1 + 625)
    assert abs(left_out - (1.0 - 25.0 / math.sqrt(626.0))) < 1e-15
    assert RectangularTeethLaw(1e8).breakpoints(100)[1] > 0.99


def test_triangular_kinks_are_cut_to_the_limit_around_normal_incidence() -> None:
    law = TriangularTeethLaw(1e-3)
    everything, nothing = law.breakpoints(10**6)
    some, left_out = law.breakpoints(200)
    assert nothing == 0.0
    assert some.size <= 200
    assert np.isin(some.round(12), everything.round(12)).all()
    assert abs(left_out - (1.0 - SINE.mass(some[0], some[-1]))) < 1e-15
    assert 0.0 < left_out < 1.0


# ---- published and derived numbers --------------------------------------------------------------------------------
def test_triangular_correlation_has_the_value_found_by_an_independent_program() -> None:
    law = TriangularTeethLaw(0.7)
    ratio = flux_pairing(law, np.cos, np.cos, 10**4, 16) / (1.0 / 3.0)
    assert abs(ratio - 0.134541971359171) < 2e-15


def test_arc_correlation_has_the_value_found_by_an_independent_program() -> None:
    law = CircularArcLaw(1.2)
    breakpoints, _ = law.breakpoints(1000)
    angle, weight = SINE.quadrature(np.concatenate([[0.0], breakpoints, [math.pi]]), 6)
    ratio = 3.0 * float(weight @ (np.cos(angle) * law.apply(np.cos, angle)))
    assert abs(ratio - 0.327558333378) < 1e-12


def test_sawteeth_keep_the_harmonics_of_their_base_angle() -> None:
    for parts in (3, 4, 5):
        law = TriangularTeethLaw(math.pi - 2.0 * math.pi / parts)
        theta = np.linspace(0.05, 3.0, 60)
        for k in (1, 2, 3):
            image = law.apply(lambda angle, k=k, parts=parts: np.cos(parts * k * angle), theta)
            assert np.allclose(image, (-1) ** (parts * k) * np.cos(parts * k * theta), atol=1e-12)


def test_shallow_arcs_relax_at_four_times_their_mean_squared_slope() -> None:
    # <u, P_F u>/<u, u> = 1 - 4h (1 + O(h)) with h = [ln(sec xi + tan xi) - sin xi]/sin xi
    for xi, allowance in ((0.1, 0.01), (0.02, 0.0005)):
        law = CircularArcLaw(xi).in_specular_frame()
        angle, weight = SINE.quadrature(np.concatenate([[0.0], CircularArcLaw(xi).breakpoints(100)[0], [math.pi]]), 16)
        decay = 1.0 - 3.0 * float(weight @ (np.cos(angle) * law.apply(np.cos, angle)))
        h = (math.log(1.0 / math.cos(xi) + math.tan(xi)) - math.sin(xi)) / math.sin(xi)
        assert abs(decay / (4.0 * h) - 1.0) < allowance


def test_arc_rows_by_formula_equal_the_mean_over_entry_points() -> None:
    x = (np.arange(200_000) + 0.5) / 200_000
    for xi in (1e-3, 0.5, 1.2, math.pi / 2):
        law = CircularArcLaw(xi)
        for theta in (1e-5, 0.3 * xi, 0.999 * xi, xi, 1.3 * xi, 1.5, math.pi - 0.4 * xi):
            mean = float(np.mean(np.cos(2.0 * law.reflect(x, theta))))
            assert abs(mean - law.apply(lambda angle: np.cos(2.0 * angle), theta)) < 1e-5
