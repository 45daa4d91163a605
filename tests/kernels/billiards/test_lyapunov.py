"""Lyapunov exponents: published limits, tables of exponent 0, two close trajectories in 60 digits, and coverage."""

import math

import mpmath as mp
import numpy as np
import pytest

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.billiards.equilibrium import equilibrium_starts
from asperity.kernels.billiards.lyapunov import Pencil
from asperity.kernels.collisions.velocity_matrices import no_slip_matrix, smooth_matrix

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


def mp_circle_time(position, velocity, radius):
    """Times of both crossings of the circle around the origin."""
    speed = velocity[0] ** 2 + velocity[1] ** 2
    along = position[0] * velocity[0] + position[1] * velocity[1]
    root = along**2 - speed * (position[0] ** 2 + position[1] ** 2 - radius**2)
    return [] if root < 0 else [(-along - mp.sqrt(root)) / speed, (-along + mp.sqrt(root)) / speed]


def mp_collide(position, velocity, half, radius, rough):
    """The next collision in the Sinai table, with the impulses of a disk of radius 1, m = 1, J = 0.6."""
    tiny, best = mp.mpf(10) ** -25, None
    for axis in (0, 1):
        for side in (-half, half):
            if velocity[axis] * side > 0:
                time = (side - position[axis]) / velocity[axis]
                if time > tiny and (best is None or time < best[0]):
                    best = time, [-mp.sign(side) if k == axis else mp.mpf(0) for k in (0, 1)]
    for time in mp_circle_time(position, velocity, radius)[:1]:
        if time > tiny and time < best[0]:
            best = time, None
    time, normal = best
    position = [x + v * time for x, v in zip(position, velocity, strict=False)]
    if normal is None:
        normal = [x / radius for x in position]
    tangent = [normal[1], -normal[0]]
    slip = sum(v * t for v, t in zip(velocity, tangent, strict=False)) + velocity[2]
    normal_speed = sum(v * n for v, n in zip(velocity, normal, strict=False))
    impulse = -2 * slip / (1 + 1 / mp.mpf("0.6")) if rough else mp.mpf(0)
    plane = [v - 2 * normal_speed * n + impulse * t for v, n, t in zip(velocity, normal, tangent, strict=False)]
    return position, [*plane, velocity[2] + impulse / mp.mpf("0.6")]


@pytest.mark.parametrize("spinning", [False, True])
def test_two_close_trajectories_in_sixty_digits_separate_as_the_derivative_says(spinning):
    table, matrix = geo.Container.sinai(1.0, 0.3), (no_slip_matrix if spinning else smooth_matrix)(DISK)
    rng = np.random.default_rng(7)
    position, velocity, wall = equilibrium_starts(table, DISK, 3, spinning, rng)
    # inside, where the plain version needs no wall to start from
    flight, _, _ = table.next_wall(position, velocity, wall)
    position = position + 0.5 * velocity[:, :2] * flight[:, None]
    pencil = first = Pencil.around(position, velocity, np.full(3, -1), rng)
    for _ in range(12):
        pencil = pencil.after_collision(table, [matrix] * 5)
    with mp.workdps(60):
        step = mp.mpf(10) ** -35
        for k in range(3):
            state = [mp.mpf(x) for x in (*first.position[k], *first.velocity[k])]
            other = [x + step * mp.mpf(d) for x, d in zip(state, (*first.shift[k], *first.tilt[k]), strict=True)]
            ends, times = [], []
            for one in (state, other):
                at, moving, clock = one[:2], one[2:], mp.mpf(0)
                for _ in range(12):
                    before = at
                    at, moving_after = mp_collide(at, moving, mp.mpf("0.5"), mp.mpf("0.3"), spinning)
                    axis = 0 if abs(moving[0]) > abs(moving[1]) else 1
                    clock += (at[axis] - before[axis]) / moving[axis]
                    moving = moving_after
                ends.append((at, moving))
                times.append(clock)
            # the neighbour at the same time, on the way out of its last collision
            (at0, v0), (at1, v1) = ends
            at1 = [x + v * (times[0] - times[1]) for x, v in zip(at1, v1, strict=False)]
            separation = [b - a for a, b in zip((*at0, *v0), (*at1, *v1), strict=True)]
            growth = mp.log(mp.sqrt(sum(x**2 for x in separation)) / step)
            assert pencil.growth[k] > 2.0
            assert math.isclose(growth, pencil.growth[k], rel_tol=1e-9)


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
