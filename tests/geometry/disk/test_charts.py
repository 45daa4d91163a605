"""Rolling, bending and the transfer, against rigid motions, complex steps and high precision."""

import mpmath
import numpy as np
import pytest
import sympy
from campaigns.judges.differentiation import complex_steps

from asperity import geometry as geo
from asperity.geometry.disk import rolling
from asperity.geometry.disk.rolling import SERIES_ANGLE
from asperity.ledger import entry as ledger

CHARTS = [geo.RollingCharts(2 * np.pi / 40), geo.RollingCharts(2 * np.pi / 9000, scale=1e-8)]
IN_UNITS = pytest.mark.parametrize("charts", CHARTS, ids=["unzoomed", "zoomed"])


def configurations(charts: geo.RollingCharts, count: int = 400) -> np.ndarray:
    """Return configurations whose angles spread over several satellites."""
    rng = np.random.default_rng(17)
    alpha = rng.uniform(-3.0, 3.0, count) * charts.spacing / charts.scale
    return np.stack([*rng.normal(size=(2, count)), alpha], axis=-1)


def velocities(count: int = 400) -> np.ndarray:
    rng = np.random.default_rng(18)
    w = rng.normal(size=(count, 3))
    w[:, 1] = np.abs(w[:, 1]) + 0.1
    return w


def rolled_by_rigid_motion(charts: geo.RollingCharts, point: np.ndarray, alpha: float) -> np.ndarray:
    """Turn the disk about the satellite at ``point``, in many steps, from where that satellite is lowest."""
    k = int(charts.nearest(alpha))
    centre = point + np.array([0.0, 1.0])
    angle = (alpha - k * charts.spacing) / 64
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    for _ in range(64):
        centre = point + turn @ (centre - point)
    return np.array([*(centre - [0.0, 1.0]), alpha])


def test_rolling_is_the_rigid_motion_about_the_lowest_satellite():
    charts = CHARTS[0]
    for configuration in configurations(charts, 50):
        point, alpha = configuration[:2], float(configuration[2])
        moved = rolled_by_rigid_motion(charts, point, alpha)
        np.testing.assert_allclose(charts.roll(point, alpha), moved, rtol=0, atol=1e-14)
        number = -charts.nearest(alpha)
        np.testing.assert_allclose(charts.satellite(moved, number), point, rtol=0, atol=2e-14)


def test_satellites_are_the_turned_rim():
    charts = CHARTS[0]
    numbers = np.arange(charts.satellites)
    for x1, x2, alpha in configurations(charts, 20):
        rim = 1j * np.exp(1j * (alpha + np.pi + numbers * charts.spacing)) + (x1 + 1j * (1.0 + x2))
        places = charts.satellite([x1, x2, alpha], numbers)
        np.testing.assert_allclose(places, np.stack([rim.real, rim.imag], axis=-1), rtol=0, atol=1e-14)
        assert np.argmin(places[:, 1]) == -charts.nearest(alpha) % charts.satellites


@IN_UNITS
def test_rolling_and_contact_are_inverses(charts):
    c = configurations(charts)
    size = max(1.0, charts.spacing / charts.scale)
    assert np.abs(charts.contact(charts.roll(c[:, :2], c[:, 2])) - c[:, :2]).max() < 4e-16 * size


@IN_UNITS
def test_bending_and_straightening_are_inverses(charts):
    c = configurations(charts)
    size = max(1.0, charts.spacing**2 / charts.scale)
    assert np.abs(charts.straighten(charts.bend(c)) - c).max() < 4e-16 * size
    assert np.abs(charts.bend(charts.straighten(c)) - c).max() < 4e-16 * size


@IN_UNITS
def test_bending_the_linear_rolling_is_rolling_up_to_whole_spacings(charts):
    # on Z^0 exactly; elsewhere the centre is off by kbar rho, a period of the wall or not (ledger S4.13, S4.14)
    c = configurations(charts)
    point, alpha = c[:, :2], c[:, 2]
    bent = charts.bend(charts.roll_linear(point, alpha))
    bent[:, 0] += charts.nearest(alpha) * charts.spacing / charts.scale
    np.testing.assert_allclose(bent, charts.roll(point, alpha), rtol=0, atol=1e-14 * np.abs(alpha).max())


def test_linear_rolling_is_the_linear_part_of_rolling():
    charts, point = CHARTS[0], np.array([0.3, -0.2])
    steps = np.array([1e-2, 1e-3, 1e-4])
    far = charts.roll(point, steps) - charts.roll_linear(point, steps)
    slopes = np.polyfit(np.log(steps), np.log(np.abs(far[:, :2])), 1)[0]
    np.testing.assert_allclose(slopes, [3.0, 2.0], atol=0.01)


@IN_UNITS
def test_the_differential_of_bending(charts):
    c = configurations(charts)
    bar = charts.residual(c[:, 2])
    expected = complex_steps(lambda x1, x2, b: (*rolling.bend(x1, x2, b, charts.scale), b), [c[:, 0], c[:, 1], bar])
    np.testing.assert_allclose(charts.bend_differential(c), expected, rtol=1e-13, atol=1e-18)
    np.testing.assert_allclose(np.linalg.det(charts.bend_differential(c)), 1.0, rtol=1e-15)


@IN_UNITS
def test_the_differential_of_the_contact(charts):
    c = configurations(charts)
    bar = charts.residual(c[:, 2])
    expected = complex_steps(lambda x1, x2, b: rolling.satellite(x1, x2, b, charts.scale), [c[:, 0], c[:, 1], bar])
    np.testing.assert_allclose(charts.contact_differential(c), expected, rtol=1e-13, atol=1e-18)


@IN_UNITS
def test_the_differential_of_the_transfer(charts):
    c, w = configurations(charts), velocities()
    bar = charts.residual(c[:, 2])
    expected = complex_steps(lambda x1, b, *v: rolling.transfer(x1, b, b, v, charts.scale), [c[:, 0], bar, *w.T])
    found = charts.transfer_differential(c[:, [0, 2]], w)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)
    jacobian = 1.0 + np.sin(charts.scale * bar) * w[:, 2] / w[:, 1]
    np.testing.assert_allclose(np.linalg.det(found[:, :, :2]), jacobian, rtol=1e-13)


def test_the_differential_of_the_plane_crossing():
    c, w = configurations(CHARTS[0]), velocities()
    expected = complex_steps(rolling.project, [*c.T, *w.T])
    np.testing.assert_allclose(geo.RollingCharts.plane_crossing_differential(c, w), expected, rtol=1e-12, atol=1e-15)
    # the line itself is collapsed: (w, 0) is in the null space
    along = np.concatenate([w, np.zeros_like(w)], axis=-1)
    assert np.abs(np.einsum("nij,nj->ni", geo.RollingCharts.plane_crossing_differential(c, w), along)).max() < 1e-13


@IN_UNITS
def test_the_transfer_is_bending_followed_by_free_flight(charts):
    c, w = configurations(charts), velocities()
    c[:, 1] = 0.0
    bent = charts.bend(c)
    landed = bent - (bent[:, 1] / w[:, 1])[:, np.newaxis] * w
    found = charts.transfer(c[:, [0, 2]], w)
    np.testing.assert_allclose(found, landed[:, [0, 2]], rtol=1e-14, atol=1e-14 * np.abs(c).max())
    np.testing.assert_allclose(geo.RollingCharts.plane_crossing(bent, w), found, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("scale", [1.0, 1e-2, 1e-5, 1e-8])
def test_no_digit_cancels_when_the_scale_is_small(scale):
    charts = geo.RollingCharts(2 * np.pi / 700, scale)
    alpha = np.geomspace(1e-9, 0.499, 40) * charts.spacing / scale
    w = np.array([0.3, 0.8, -0.5])
    found = np.concatenate(
        [charts.transfer(np.stack([0.0 * alpha, alpha], axis=-1), w)[:, :1], charts.bend([[0, 0, a] for a in alpha])],
        axis=-1,
    )
    with mpmath.workdps(60):
        for a, row in zip(alpha, found, strict=True):
            e, b = mpmath.mpf(scale), mpmath.mpf(a)
            slip, rise = b - mpmath.sin(e * b) / e, (1 - mpmath.cos(e * b)) / e
            exact = [slip + rise * mpmath.mpf(0.3) / mpmath.mpf(0.8), slip, -rise]
            for number, value in zip(row[:3], exact, strict=True):
                assert abs(mpmath.mpf(float(number)) / value - 1) < 1e-14


def test_the_slip_is_accurate_on_both_sides_of_the_change_of_formula():
    x = np.concatenate([np.geomspace(1e-12, 3.0, 200), SERIES_ANGLE + np.array([-1e-15, 0.0, 1e-15])])
    with mpmath.workdps(60):
        exact = np.array([float(mpmath.mpf(v) - mpmath.sin(mpmath.mpf(v))) for v in x])
    np.testing.assert_allclose(rolling.slip(x), exact, rtol=2e-15)
    np.testing.assert_array_equal(rolling.slip(-x), -rolling.slip(x))


def fitted_order(defect) -> float:
    """Return the slope of log defect(rho) over a range of spacings."""
    counts = np.array([100, 400, 1600, 6400])
    defects = [defect(geo.RollingCharts(2 * np.pi / n)) for n in counts]
    return float(-np.polyfit(np.log(counts), np.log(defects), 1)[0])


def kinetic_size(disk: geo.Disk, displacement: np.ndarray) -> np.ndarray:
    return np.sqrt(disk.inner(displacement, displacement))


def test_bending_is_the_identity_up_to_the_square_of_the_spacing():
    # the supremum is |sin(rho/2) - rho/2| and 1 - cos(rho/2), hence rho^2/8 at leading order (ledger S4.15)
    def defect(charts):
        alpha = np.linspace(-0.5, 0.5, 201) * charts.spacing
        c = np.stack([0.0 * alpha, 0.0 * alpha, alpha], axis=-1)
        moved = np.linalg.norm(charts.bend(c) - c, axis=-1).max()
        half = 0.5 * charts.spacing
        assert moved <= rolling.slip(half) + rolling.rise(half)
        return moved

    assert fitted_order(defect) == pytest.approx(2.0, abs=0.01)
    assert defect(geo.RollingCharts(2 * np.pi / 6400)) == pytest.approx((2 * np.pi / 6400) ** 2 / 8, rel=1e-6)


@pytest.mark.parametrize("disk", [geo.Disk(1.0, 1.0), geo.Disk(9.0, 1 / 9), geo.Disk(1.0, 0.3)])
def test_the_transfer_is_the_identity_up_to_the_spacing(disk):
    # where v2 > J^(-1/2) sin(rho/2), and unit speed, |eta - id| <= rho J^(1/2)/4 at leading order, attained
    def defect(charts):
        floor = np.sin(0.5 * charts.spacing) / np.sqrt(disk.rim_mass)
        rng = np.random.default_rng(3)
        w = rng.normal(size=(4000, 3))
        w /= kinetic_size(disk, w)[:, np.newaxis]
        w[:2000, 1] = floor * (1 + 1e-9)
        across = kinetic_size(disk, w * [1, 0, 1])
        room = np.sqrt(np.maximum(0.0, 1.0 - disk.mass * w[:, 1] ** 2))
        w *= np.stack([room / across, np.ones(4000), room / across], axis=-1)
        w = w[w[:, 1] > floor]
        alpha = rng.choice([-0.5, 0.4999], len(w)) * charts.spacing
        y = np.stack([0.0 * alpha, alpha], axis=-1)
        moved = charts.transfer(y, w) - y
        return kinetic_size(disk, np.stack([moved[:, 0], 0 * alpha, moved[:, 1]], axis=-1)).max()

    assert fitted_order(defect) == pytest.approx(1.0, abs=0.02)
    rho = 2 * np.pi / 6400
    assert defect(geo.RollingCharts(rho)) == pytest.approx(0.25 * rho * np.sqrt(disk.rim_mass), rel=5e-3)


@pytest.mark.parametrize(
    ("row", "formula"),
    [
        ("S4.04", rolling.gap_radius),
        ("S4.12", rolling.roll_linear),
        ("S4.16", rolling.straight_contact),
        ("S4.19", rolling.project),
        ("S5.09", rolling.transfer),
        ("S5.15", rolling.bend),
        ("S5.18", rolling.satellite_differential),
    ],
)
def test_the_ledger_checks_the_very_formula_that_the_charts_use(row, formula):
    (entry,) = ledger.selected([row])
    assert entry.right is formula


def test_the_ledger_checks_the_bending_of_the_charts_at_the_size_of_the_disk():
    (entry,) = ledger.selected(["S4.13"])
    assert entry.right(0.3, -0.2, 0.1, np) == rolling.bend(0.3, -0.2, 0.1, 1, np)


def test_the_symbolic_charts_are_the_maps_that_arrays_go_through():
    charts, sym = CHARTS[1], geo.symbolic
    x1, x2, bar = configurations(charts, 1)[0] * [1.0, 1.0, 0.1]
    v1, v2, omega = velocities(1)[0]
    values = {sym.x1: x1, sym.x2: x2, sym.alpha: bar, sym.v1: v1, sym.v2: v2, sym.omega: omega, sym.epsilon: 1e-8}

    def number(expressions):
        return [float(e.subs({s: sympy.Rational(float(v)) for s, v in values.items()}).evalf(40)) for e in expressions]

    c, w = [x1, x2, bar], [v1, v2, omega]
    pairs = [
        (sym.roll, charts.roll(c[:2], bar)),
        (sym.roll_linear, charts.roll_linear(c[:2], bar)),
        (sym.bend, charts.bend(c)),
        (sym.straighten, charts.straighten(c)),
        (sym.contact, charts.contact(c)),
        (sym.plane_crossing, geo.RollingCharts.plane_crossing(c, w)),
        (sym.transfer, charts.transfer([x1, bar], w)),
    ]
    for expressions, found in pairs:
        np.testing.assert_allclose(found, number(expressions), rtol=1e-14)


def test_arrays_broadcast():
    charts = CHARTS[0]
    assert charts.satellite(np.zeros((5, 1, 3)), np.arange(4)).shape == (5, 4, 2)
    assert charts.roll(np.zeros((5, 1, 2)), np.zeros(4)).shape == (5, 4, 3)
    assert charts.transfer(np.zeros(2), np.ones((5, 3))).shape == (5, 2)
    assert charts.transfer_differential(np.zeros(2), np.ones((5, 3))).shape == (5, 2, 5)
    assert geo.RollingCharts.plane_crossing_differential(np.zeros((6, 1, 3)), np.ones((5, 3))).shape == (6, 5, 2, 6)
    assert charts.bend_differential(np.zeros(3)).shape == (3, 3)
