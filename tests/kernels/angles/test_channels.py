"""Angles near grazing of hollows with a channel, against exact laws of polygons and against rays."""

import math

import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.geometry.cells.channel import channel_of
from asperity.kernels.channels.below_channel import LOWEST, BelowChannel
from asperity.kernels.channels.grazing import GrazingIntegrals, PatchIntegrals, damping
from asperity.kernels.discretisation.method import Budget
from asperity.kernels.discretisation.traced import traced_matrix

BASIS = ker.Legendre(4)
MUSHROOM = geo.mushrooms(0.3, 0.5)


def _polygon(floor):
    """A crevice of width 0.5 and depth 0.3 above a floor, given by fractions of the width and depths below."""
    bottom = [(0.2 + 0.5 * x, -0.3 - depth) for x, depth in floor]
    return geo.Wall.from_vertices([(0, 0), (0.2, 0), (0.2, -0.3), *bottom, (0.7, -0.3), (0.7, 0), (0.9, 0)])


def _behind(channel, entries, angles):
    """The angles of rays after a crossing of the channel, up or down, with the points where they arrive."""
    phase = entries + channel / np.tan(angles)
    even = np.floor(phase) % 2 == 0
    inside = phase - np.floor(phase)
    return np.where(even, inside, 1.0 - inside), np.where(even, angles, np.pi - angles)


@pytest.mark.parametrize(
    "wall", [MUSHROOM, _polygon([(0.5, 0.2)]), _polygon([(0.5, -0.1)]), _polygon([(0.0, 0.1), (0.5, 0.3), (1.0, 0.2)])]
)
def test_a_ray_crosses_the_channel_then_the_hollow_below_then_the_channel(wall):
    rng = np.random.default_rng(1)
    entries, angles = rng.uniform(size=300), rng.uniform(0.05, 3.1, 300)
    hollow = wall.hollows[0]
    channel, below = channel_of(wall, hollow)
    opening = below.hollows[0]
    inside, down = _behind(-channel, entries, angles)
    # an incoming ray moves against its angle, so that its way down is the way up of the outgoing one
    found = geo.trace(below, opening.left + opening.width * inside, down)
    _, out = _behind(channel, (found.x - opening.left) / opening.width, found.theta)
    expected = geo.trace(wall, hollow.left + hollow.width * entries, angles)
    assert opening.width == pytest.approx(hollow.width, rel=1e-14)
    assert np.median(np.abs(out - expected.theta)) < 1e-12


def test_no_channel_without_vertical_sides():
    for wall in (geo.triangular_teeth(0.7), geo.focusing_arcs(1.0), geo.mushrooms(0.3, 0.0)):
        assert channel_of(wall.cell, wall.cell.hollows[0]) is None


def test_expectations_on_patches_are_those_of_rays():
    integrals = GrazingIntegrals.of(MUSHROOM, BASIS)
    angles = np.array([0.021, 0.1031, 0.34, 0.66])
    found = np.zeros((len(angles), 4))
    for panel in integrals.below.panels(1e-9):
        own = (panel.low <= angles) & (angles < panel.high)
        crossings = integrals.height / np.tan(angles[own])
        for patch in panel.patches if own.any() else []:
            part = PatchIntegrals(patch, BASIS, integrals.height)
            found[own] += part.interpolation(angles[own]) @ part.even
            found[np.ix_(own, part.odd)] += part(crossings, np.floor(crossings))[0]
    conditionals = ker.WallLaw(MUSHROOM).conditionals(angles, 1e-10, 3)
    expected = conditionals.mean(BASIS.evaluate) - 0.7 * BASIS.evaluate(np.pi - angles)
    assert np.abs(0.3 * found - expected).max() < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("floor", [[(0.5, 0.2)], [(0.25, 0.15), (0.5, 0.05), (0.75, 0.15)]])
def test_matrices_of_crevices_with_straight_floors_are_the_exact_ones(floor):
    wall = _polygon(floor)
    exact = ker.discretise(ker.WallLaw(wall), BASIS, tolerance=1e-9)
    matrix, error, _ = traced_matrix(wall, BASIS, Budget(2e-6, segments=20_000_000))
    distance = np.linalg.norm(matrix - exact.symmetric)
    assert float(exact.error) < 2e-8
    assert distance < error < 2e-6


@pytest.mark.slow
def test_the_first_moment_and_the_resistance_of_mushrooms_reach_six_digits():
    # references with K = 113 instead of 80 crossings, agreeing with panels in theta to 4e-8
    law = ker.WallLaw(MUSHROOM)
    moment = ker.discretise(law, ker.Legendre(2), tolerance=1e-6)
    assert float(moment.error) < 2e-6
    assert moment.symmetric[1, 1] == pytest.approx(-0.756313928817, abs=float(moment.error))
    resistance = ker.resistance(law, 1e-6)
    assert resistance.error < 1e-6
    assert float(resistance) == pytest.approx(1.059828846044, abs=resistance.error)


@pytest.mark.slow
def test_integrals_near_grazing_have_the_errors_that_they_report():
    integrals = GrazingIntegrals.of(MUSHROOM, BASIS)
    fine, least = integrals.matrix(1e-7)
    for tolerance in (1e-3, 1e-5):
        matrix, error = integrals.matrix(tolerance)
        assert np.linalg.norm(matrix - fine) < error + least
        assert error < 4.0 * tolerance


def test_a_hollow_replaced_by_a_flat_top_reflects_specularly():
    # cos(theta) becomes -cos(theta): minus the integral of 3 cos^2 sin / 2 over (0, a), (cos(a)^3 - 1) / 2
    integrals = GrazingIntegrals.of(MUSHROOM, BASIS)
    assert integrals.flat[1, 1] == pytest.approx(0.5 * (math.cos(integrals.highest) ** 3 - 1.0), abs=1e-14)


def test_chaotic_hollows_and_other_bases_are_left_to_panels():
    wide = geo.Wall.from_vertices(
        [
            (0, 0),
            (0.4, 0),
            (0.4, -0.2),
            (0.1, -0.2),
            (0.1, -0.7),
            (1.0, -0.7),
            (1.0, -0.2),
            (0.7, -0.2),
            (0.7, 0),
            (1.1, 0),
        ]
    )
    assert GrazingIntegrals.of(MUSHROOM, ker.Bins(8)) is None
    assert GrazingIntegrals.of(geo.triangular_teeth(0.7), BASIS) is None
    below = BelowChannel(channel_of(wide, wide.hollows[0]).below, 2.0 / 3.0, 4.0)
    assert below.highest < 0.8


def test_patches_cover_all_angles_down_to_the_lowest():
    below = BelowChannel(channel_of(MUSHROOM, MUSHROOM.hollows[0]).below, 0.5, 4.0)
    panels = below.panels(1e-8)
    assert panels[0].low == LOWEST
    assert [panel.high for panel in panels[:-1]] == [panel.low for panel in panels[1:]]
    assert panels[-1].high == below.highest
    for panel in panels[1:]:
        width = sum(patch.ends[:, 1] - patch.ends[:, 0] for patch in panel.patches)
        assert np.abs(width - 1.0).max() < 1e-7


def test_the_damping_is_one_half_at_its_middle_and_negligible_beyond_its_reach():
    values = damping(np.array([0.0, 10.0, 15.0]), 10.0)
    assert values[0] == pytest.approx(1.0, abs=1e-15)
    assert values[1] == 0.5
    assert values[2] < 0.5 * math.erfc(3.49)
