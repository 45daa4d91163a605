"""Exact rows by interval marching against closed forms, rays traced one by one, and the beams."""

import numpy as np
import pytest
from campaigns.cases.random_hollows import random_hollow, wall_with
from campaigns.judges.interval_marching import exact_row, exact_rows

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.polygons.beams import beams_of

# Fractions of a row that two methods may see differently: rounding of a vertex's position over sin(theta), for a
# hundred reflections each.
ROW_DEFECT = 1e-12


def cosine_moments(probability, outgoing):
    return np.array([probability @ np.cos(k * outgoing) for k in range(4)])


@pytest.mark.parametrize("angle", [0.05, 0.7, np.pi / 2, 2.5])
def test_rows_of_triangular_teeth_are_the_closed_law(angle):
    law = ker.TriangularTeethLaw(angle)
    theta = np.linspace(0.02, np.pi - 0.02, 41)
    rows = exact_rows(geo.triangular_teeth(angle).vertices, theta)
    probability, outgoing = law.branches(theta)
    for k in range(len(theta)):
        row = rows[k]
        measured = cosine_moments(np.diff(row.edges), row.outgoing)
        assert row.unresolved == 0.0
        assert np.abs(measured - cosine_moments(probability[k], outgoing[k])).max() < ROW_DEFECT


def test_a_deep_crevice_is_followed_through_thousands_of_reflections_to_the_last_digit():
    ratio, theta = 1000.0, 0.25
    row = exact_row([(0, 0), (0, -ratio), (1, -ratio), (1, 0)], theta)
    strip = 2.0 * ratio / np.tan(theta)
    back = np.diff(row.edges)[row.sign > 0].sum()
    expected = strip % 1.0 if np.floor(strip) % 2 == 0 else 1.0 - strip % 1.0
    # the depth over the width, times the rounding of tan
    assert abs(back - expected) < 4.0 * strip * np.finfo(float).eps
    assert row.bounces.max() > 7000
    assert np.abs(row.offset[row.sign > 0]).max() < 1e-15
    assert np.abs(row.offset[row.sign < 0] - np.pi).max() < 1e-15


@pytest.mark.parametrize("seed", range(0, 50, 2))
def test_rows_and_beams_are_one_law_by_two_methods(seed):
    hollow = random_hollow(seed)
    beams = beams_of(hollow, max_beams=20_000)
    theta = np.random.default_rng(seed).uniform(0.05, np.pi - 0.05, 6)
    rows = exact_rows(hollow, theta, max_bounces=100_000)
    for k, angle in enumerate(theta):
        row, cotangent = rows[k], 1.0 / np.tan(angle)
        here = (beams.low <= angle) & (angle < beams.high)
        open_here = (beams.unresolved_low <= angle) & (angle < beams.unresolved_high)
        missing = (beams.unresolved_sine + beams.unresolved_cosine * cotangent)[open_here].sum() + row.unresolved
        probability = (beams.sine + beams.cosine * cotangent)[here]
        outgoing = (beams.sign * angle + beams.offset)[here]
        found = row.sign != 0
        by_rows = cosine_moments(np.diff(row.edges)[found], row.outgoing[found])
        assert np.abs(cosine_moments(probability, outgoing) - by_rows).max() <= ROW_DEFECT + missing


@pytest.mark.parametrize("seed", range(0, 50, 7))
def test_the_middle_of_every_interval_is_traced_to_its_angle(seed):
    hollow = random_hollow(seed)
    row = exact_row(hollow, 1.1, max_bounces=1000)
    wide = (np.diff(row.edges) > 1e-6) & (row.sign != 0)
    middle = (0.5 * (row.edges[1:] + row.edges[:-1]))[wide]
    ray = geo.trace(geo.Wall.from_vertices(wall_with(hollow)), 1.0 + middle, 1.1)
    assert ray.escaped.all()
    assert np.array_equal(ray.collisions, row.bounces[wide])
    assert np.abs(ray.theta - row.outgoing[wide]).max() < 1e-13 * row.bounces.max()


def test_limits_leave_a_fraction_unresolved_and_never_hang():
    crevice = [(0, 0), (0, -1e6), (1, -1e6), (1, 0)]
    row = exact_row(crevice, 0.1, max_bounces=1000)
    assert row.unresolved == 1.0
    assert (row.sign == 0).all()
    row = exact_row(random_hollow(1), 1.0, max_intervals=2)
    assert len(row.sign) == 2
    assert 0.0 < row.unresolved < 1.0
