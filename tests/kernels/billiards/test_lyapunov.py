"""Lyapunov exponents: published limits, tables of exponent 0, two close trajectories, and coverage."""

import math

import mpmath as mp
import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.billiards.lyapunov import Pencil, equilibrium_starts
from asperity.kernels.collisions.operator import no_slip_matrix, smooth_matrix

DISK = geo.Disk(1.0, 0.6)
SMOOTH, NO_SLIP = ker.smooth(DISK), ker.no_slip(DISK)


@pytest.mark.slow
def test_small_scatterers_have_the_exponent_that_dahlqvist_derived():
    # P. Dahlqvist (arXiv chao-dyn/9601007): -2 ln R + 1 - 4 ln 2 + 27 zeta(3)/(2 pi^2) + O(R ln^2 R) per return to
    # the disk of radius R in the unit square; such returns are (1 - pi R^2)/(2 R) apart on average
    constant = 1.0 - 4.0 * math.log(2.0) + 27.0 * float(mp.zeta(3)) / (2.0 * math.pi**2)
    radius = 0.01
    found = ker.lyapunov_exponent(geo.Container.sinai(1.0, radius), SMOOTH, 800, 200, rng=1)
    returns = (1.0 - math.pi * radius**2) / (2.0 * radius)
    remainder = radius * math.log(radius) ** 2
    difference = found.value * returns - (-2.0 * math.log(radius) + constant)
    assert found.error * returns < 1.0
    assert abs(difference) < remainder + found.error * returns


@pytest.mark.slow
def test_the_triangular_lorentz_gas_has_the_exponent_of_published_runs():
    # the pages of DynamicalBilliards.jl 3.0, 3.1, 3.2 and later show one run of length 1000 each, of unit disks in a
    # periodic hexagon of side 2; by its symmetry reflecting sides give the same motion, folded
    published = np.array([0.62396, 0.68146, 0.70605, 0.64790])
    corners = [(2.0 * math.cos(k * math.pi / 3), 2.0 * math.sin(k * math.pi / 3)) for k in range(6)]
    sides = [geo.Segment(corners[k], corners[(k + 1) % 6]) for k in range(6)]
    hexagon = geo.Container.from_curves([*sides, geo.Arc((0.0, 0.0), 1.0, 2.0 * math.pi, 0.0)])
    found = ker.lyapunov_exponent(hexagon, SMOOTH, 500, 200, rng=5)
    assert found.error < 0.02
    # Student's t of three degrees of freedom at 0.99
    assert abs(found.value - published.mean()) < found.error + 5.84 * published.std(ddof=1) / 2.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("table", "law"),
    [
        (geo.Container.circle(2.0), NO_SLIP), (geo.Container.ellipse(2.0, 1.0), SMOOTH),
        (geo.Container.polygon([(0, 0), (3, 0), (1, 2)]), SMOOTH),
        (geo.Container.polygon([(0, 0), (2, 0), (2, 1), (0, 1)]).closed(), NO_SLIP),
    ],
)  # fmt: skip
def test_integrable_tables_and_polygons_have_exponent_zero_within_the_error(table, law):
    errors = []
    for collisions in (75, 300):
        found = ker.lyapunov_exponent(table, law, collisions, 20, rng=1)
        assert abs(found.value) < found.error
        errors.append(found.error)
    # growth by powers: ln(t)/t
    assert math.log(errors[1] / errors[0]) / math.log(4.0) < -0.5


@pytest.mark.parametrize(
    ("law", "matrix"), [(SMOOTH, smooth_matrix), (NO_SLIP, no_slip_matrix)], ids=["smooth", "rough"]
)
def test_two_close_trajectories_separate_as_the_derivative_says(law, matrix):
    table, rng, collisions, step = geo.Container.sinai(1.0, 0.3), np.random.default_rng(3), 12, 1e-8
    position, velocity, wall = equilibrium_starts(table, DISK, 20, law is NO_SLIP, rng)
    # inside, so that there is room for the neighbours
    flight, _, _ = table.next_wall(position, velocity, wall)
    position = position + 0.5 * velocity[:, :2] * flight[:, None]
    pencil = first = Pencil.around(position, velocity, np.full(20, -1), rng)
    for _ in range(collisions):
        pencil = pencil.after_collision(table, [matrix(DISK)] * 5)
    ends = []
    for sign in (1.0, 0.0, -1.0):
        near = position + sign * step * first.shift, velocity + sign * step * first.tilt
        ends.append(ker.play(table, law, *near, collisions))
    # the neighbours at the same time, on the way out of their last collisions
    after, before = (
        np.hstack([
            one.position[-1] + one.velocity[-1, :, :2] * (ends[1].time[-1] - one.time[-1])[:, None], one.velocity[-1]
        ])
        for one in (ends[0], ends[2])
    )  # fmt: skip
    growth = np.log(np.linalg.norm(after - before, axis=1) / (2.0 * step))
    assert np.median(pencil.growth) > 2.0
    np.testing.assert_allclose(growth, pencil.growth, rtol=0.0, atol=1e-6)


@pytest.mark.slow
def test_a_stadium_of_bezier_curves_has_the_exponent_of_the_stadium():
    # quarter circles by cubic curves, with radii right to 3e-4
    k = 4.0 / 3.0 * math.tan(math.pi / 8.0)
    quarters = []
    for centre, turn in ((1, -math.pi / 2), (1, 0.0), (-1, math.pi / 2), (-1, math.pi)):
        c, s = round(math.cos(turn)), round(math.sin(turn))
        points = [(1, 0), (1, k), (k, 1), (0, 1)]
        quarters.append(geo.Bezier([(centre + c * x - s * y, s * x + c * y) for x, y in points]))
    sides = [geo.Segment((-1, -1), (1, -1)), geo.Segment((1, 1), (-1, 1))]
    tables = geo.Container.from_curves([*sides, *quarters]), geo.Container.stadium(2.0, 1.0)
    found, known = (ker.lyapunov_exponent(table, SMOOTH, 120, 30, rng=6) for table in tables)
    assert abs(found.value - known.value) < found.error + known.error < 0.2


@pytest.mark.slow
def test_no_slip_reduces_the_exponent_of_chaotic_tables_but_does_not_end_it():
    # J. S. Lund, J. Murugan and J. P. Shock, Spinning billiards and chaos (arXiv 2505.15335, second version)
    for table in (geo.Container.stadium(2.0, 1.0), geo.Container.sinai(2.0, 0.5)):
        values = [ker.lyapunov_exponent(table, law, 250, 40, rng=4) for law in (SMOOTH, NO_SLIP)]
        assert values[0].value - values[0].error > values[1].value + values[1].error
        assert values[1].value > 3.0 * values[1].error


@pytest.mark.slow
def test_the_errors_cover():
    table, law = geo.Container.sinai(1.0, 0.45), NO_SLIP
    # 16 small runs against a long one, whose own error is a fifth of one of them
    runs = [ker.lyapunov_exponent(table, law, 96, 16, rng=seed) for seed in range(16)]
    reference = ker.lyapunov_exponent(table, law, 512, 75, rng=1000)
    missed = sum(abs(run.value - reference.value) > run.error for run in runs)
    # 4 or more of 16 at probability 0.05 have probability 0.007
    assert missed <= 3
