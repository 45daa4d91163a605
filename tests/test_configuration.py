"""The configurations of disk and wall, against rigid motions, high precision, and brute force."""

from itertools import pairwise

import mpmath
import numpy as np
import pytest
import shapely
import sympy

from asperity import geometry as geo
from asperity import ledger
from asperity.errors import InputError
from asperity.geometry import rolling
from asperity.geometry.rolling import SERIES_ANGLE

CHARTS = [geo.RollingCharts(2 * np.pi / 40), geo.RollingCharts(2 * np.pi / 9000, scale=1e-8)]
IN_UNITS = pytest.mark.parametrize("charts", CHARTS, ids=["unzoomed", "zoomed"])
STEP = 1e-30


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


def complex_steps(formula, arguments: list[np.ndarray]) -> np.ndarray:
    """Return the matrix of derivatives of ``formula`` in its arguments, exact to rounding."""
    columns = []
    for i in range(len(arguments)):
        moved = [a + 1j * STEP if j == i else a + 0j for j, a in enumerate(arguments)]
        parts = np.broadcast_arrays(*formula(*moved))
        columns.append(np.stack([part.imag / STEP for part in parts], axis=-1))
    return np.stack(columns, axis=-1)


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
    np.testing.assert_allclose(geo.plane_crossing_differential(c, w), expected, rtol=1e-12, atol=1e-15)
    # the line itself is collapsed: (w, 0) is in the null space
    along = np.concatenate([w, np.zeros_like(w)], axis=-1)
    assert np.abs(np.einsum("nij,nj->ni", geo.plane_crossing_differential(c, w), along)).max() < 1e-13


@IN_UNITS
def test_the_transfer_is_bending_followed_by_free_flight(charts):
    c, w = configurations(charts), velocities()
    c[:, 1] = 0.0
    bent = charts.bend(c)
    landed = bent - (bent[:, 1] / w[:, 1])[:, np.newaxis] * w
    found = charts.transfer(c[:, [0, 2]], w)
    np.testing.assert_allclose(found, landed[:, [0, 2]], rtol=1e-14, atol=1e-14 * np.abs(c).max())
    np.testing.assert_allclose(geo.plane_crossing(bent, w), found, rtol=1e-14, atol=1e-14)


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


@pytest.mark.parametrize("disk", [geo.Disk(1.0, 1.0), geo.Disk(9.0, 1.0), geo.Disk(1.0, 0.3)])
def test_the_transfer_is_the_identity_up_to_the_spacing(disk):
    # where v2 > J^(-1/2) sin(rho/2), and unit speed, |eta - id| <= rho J^(1/2)/4 at leading order, attained
    def defect(charts):
        floor = np.sin(0.5 * charts.spacing) / np.sqrt(disk.inertia)
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
    assert defect(geo.RollingCharts(rho)) == pytest.approx(0.25 * rho * np.sqrt(disk.inertia), rel=5e-3)


WALLS = [
    geo.triangular_teeth(1.2),
    geo.rectangular_teeth(0.8),
    geo.focusing_arcs(1.2),
    geo.dispersing_arcs(1.0),
    geo.double_parabola(),
    geo.mushrooms(0.3, 0.4),
    geo.koch(3),
]
OF_EVERY_KIND = pytest.mark.parametrize("wall", WALLS, ids=repr)


def solid_polygon(wall: geo.Wall) -> shapely.Polygon:
    """Return a few periods of the solid, with curves as polylines within 1e-5."""
    line, step = wall.outline(1e-5), np.array([wall.period, 0.0])
    path = np.concatenate([*(line[:-1] + k * step for k in (-1, 0, 1)), line[-1:] + step])
    floor = -wall.depth - 1.0
    return shapely.Polygon([*path, (path[-1, 0], floor), (path[0, 0], floor)])


@OF_EVERY_KIND
def test_a_configuration_is_free_if_no_satellite_is_in_the_solid(wall):
    space = geo.ConfigurationSpace(wall, geo.Disk(), scale=0.02)
    rng = np.random.default_rng(5)
    count = 2000
    x1, alpha = rng.uniform(-1.0, 1.0, count) * space.scale, rng.uniform(-2.0, 2.0, count) * space.spacing
    x2 = rng.uniform(-1.5, 0.5, count) * space.depth - space.spacing**2 / 8 * rng.uniform(0, 1, count)
    c = np.stack([x1, x2, alpha], axis=-1)
    places = space.charts.satellite(c[:, np.newaxis], np.arange(space.charts.satellites)) / space.scale
    x, y = np.mod(places[..., 0], wall.period), places[..., 1]
    near = np.abs(y + 0.5 * wall.depth) < 0.5 * wall.depth + 0.01
    solid = solid_polygon(wall)
    shapely.prepare(solid)
    inside, sure = y < 0.0, np.ones(y.shape, dtype=bool)
    inside[near] = shapely.contains_xy(solid, x[near], y[near])
    sure[near] = ~shapely.dwithin(shapely.points(x[near], y[near]), solid.boundary, 1e-4)
    clear = sure.all(axis=-1)
    assert clear.mean() > 0.95
    free = space.contains(c)
    np.testing.assert_array_equal(free[clear], ~inside.any(axis=-1)[clear])
    assert 0.05 < free.mean() < 0.95


def test_halfway_between_satellites_both_are_looked_at():
    space = geo.ConfigurationSpace(geo.triangular_teeth(1.2), geo.Disk(), scale=1e-5)
    rng = np.random.default_rng(10)
    k = rng.integers(-300, 300, 4000)
    alpha = (k + 0.5) * space.spacing * (1.0 + rng.integers(-2, 3, 4000) * 2.0**-53)
    x2 = rng.uniform(-1.0, 0.0, 4000) * space.depth - 2.0 * np.sin(0.25 * space.spacing) ** 2
    c = np.stack([rng.uniform(-1, 1, 4000) * space.scale, x2, alpha], axis=-1)
    places = space.charts.satellite(c[:, np.newaxis], -k[:, np.newaxis] - [0, 1]) / space.scale
    height = -space.wall.depth * (1.0 - np.abs(2.0 * np.mod(places[..., 0], 1.0) - 1.0))
    above = places[..., 1] - height
    clear = np.abs(above).min(axis=-1) > 1e-9
    np.testing.assert_array_equal(space.contains(c)[clear], (above > 0).all(axis=-1)[clear])
    assert np.mean((above > 0).any(axis=-1) & ~(above > 0).all(axis=-1)) > 0.1


def test_islands_are_solid_and_what_is_under_them_is_free():
    disc = [geo.Arc((0.4, -0.4), 0.2, 0.0, -2.0 * np.pi)]
    wall = geo.Wall([geo.Segment((0.0, -1.0), (1.0, -1.0))], islands=[disc])
    space = geo.ConfigurationSpace(wall, geo.Disk(), scale=0.01)
    rng = np.random.default_rng(9)
    x, y = rng.uniform(-2, 2, 3000), rng.uniform(-1.2, 0.2, 3000)
    free = (np.hypot(np.mod(x, 1.0) - 0.4, y + 0.4) >= 0.2) & (y >= -1.0)
    places = np.stack([x, y, 0.0 * x], axis=-1) * space.scale
    np.testing.assert_array_equal(space.contains(places), free)
    np.testing.assert_array_equal(space.cylinder_contains(places), free)


def test_the_boundary_of_an_island_is_free_also_from_below():
    corners = [(0.25, -0.25), (0.75, -0.25), (0.75, -0.75), (0.25, -0.75), (0.25, -0.25)]
    island = [geo.Segment(a, b) for a, b in pairwise(corners)]
    wall = geo.Wall([geo.Segment((0.0, -1.0), (1.0, -1.0))], islands=[island])
    space = geo.ConfigurationSpace(wall, geo.Disk(), scale=0.5**8)
    sides = [(0.5, -0.25), (0.5, -0.75), (0.25, -0.5), (0.75, -0.5), *corners]
    assert space.cylinder_contains([[space.scale * x, space.scale * y, 0.0] for x, y in sides]).all()
    assert not space.cylinder_contains([0.5 * space.scale, -0.5 * space.scale, 0.0])


def test_the_boundary_of_the_solid_is_free():
    space = geo.ConfigurationSpace(geo.rectangular_teeth(1.0), geo.Disk(), scale=0.5**6)
    eps = space.scale
    # on a top, on the vertical sides from within the crevice, on its floor, in its corner
    heights = {(0.25, 0.0): True, (0.5, -0.25): True, (1.0, -0.25): True, (0.75, -0.5): True, (1.0, -0.5): True}
    heights |= {(0.25, -1e-9): False, (0.5 - 1e-9, -0.25): False, (0.75, -0.5 - 1e-9): False}
    for (x, y), free in heights.items():
        assert space.contains([eps * x, eps * y, 0.0]) == free, (x, y)
        assert space.cylinder_contains([eps * x, eps * y, 0.0]) == free, (x, y)


@OF_EVERY_KIND
def test_rolling_parametrises_the_free_configurations_on_single_contact(wall):
    space = geo.ConfigurationSpace(wall, geo.Disk(), scale=0.01)
    rng = np.random.default_rng(6)
    point = np.stack([rng.uniform(-2, 2, 2000), rng.uniform(-wall.depth, 0, 2000)], axis=-1) * space.scale
    alpha = rng.uniform(-3, 3, 2000) * space.spacing
    single = space.is_single(alpha)
    share = 1.0 - 2.0 * space.gap_radius / space.spacing
    assert abs(single.mean() - share) < 5 * np.sqrt(share * (1 - share) / 2000)
    rolled = space.contains(space.charts.roll(point, alpha))
    straight = space.cylinder_contains(space.charts.roll_linear(point, alpha))
    np.testing.assert_array_equal(rolled[single], straight[single])
    assert 0.1 < straight.mean() < 0.9


def test_in_the_gaps_a_second_satellite_takes_configurations_away():
    space = geo.ConfigurationSpace(geo.triangular_teeth(1.2), geo.Disk(), scale=0.05)
    rng = np.random.default_rng(7)
    point = np.stack([rng.uniform(0, 1, 4000), rng.uniform(-space.wall.depth, 0, 4000)], axis=-1) * space.scale
    alpha = 0.5 * space.spacing + rng.uniform(-1, 1, 4000) * space.gap_radius
    assert not space.is_single(alpha).any()
    rolled = space.contains(space.charts.roll(point, alpha))
    straight = space.cylinder_contains(space.charts.roll_linear(point, alpha))
    assert not np.any(rolled & ~straight)
    assert np.sum(straight & ~rolled) > 100


def test_the_gap_radius_is_where_the_second_satellite_is_as_high_as_the_wall_is_deep():
    space = geo.ConfigurationSpace(geo.triangular_teeth(1.2), geo.Disk(), scale=1e-6)
    alpha = 0.5 * space.spacing - space.gap_radius
    low, second = (space.charts.satellite([0, 0, alpha], k)[1] for k in (0, -1))
    assert second - low == pytest.approx(space.depth, rel=1e-9)
    assert space.is_single(alpha * (1 - 1e-12)) and not space.is_single(alpha * (1 + 1e-9))


def test_the_normal_is_the_kinetic_gradient_of_the_satellites_distance():
    rng = np.random.default_rng(8)
    for disk in (geo.Disk(1.0, 1.0), geo.Disk(2.0, 0.3)):
        space = geo.ConfigurationSpace(geo.triangular_teeth(1.2), disk, scale=0.01)
        beta, alpha, number = rng.uniform(-3, 3, 200), rng.uniform(-3, 3, 200), rng.integers(0, 60, 200)
        k = np.stack([np.sin(beta), np.cos(beta)], axis=-1)
        found = space.normal(alpha, number, k)

        def distance(x1, x2, angle, k=k, number=number, space=space):
            s1, s2 = rolling.satellite(x1, x2, angle + number * space.spacing, 1.0)
            return (k[:, 0] * s1 + k[:, 1] * s2,)

        gradient = complex_steps(distance, [0 * alpha, 0 * alpha, alpha])[:, 0]
        raised = gradient / [disk.mass, disk.mass, disk.inertia]
        expected = raised / np.sqrt(disk.inner(raised, raised))[:, np.newaxis]
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
        # tangent to M are the turning about the satellite and the sliding of the satellite along the wall
        angle = alpha + number * space.spacing
        turning = np.stack([-np.cos(angle), -np.sin(angle), np.ones(200)], axis=-1)
        sliding = np.stack([k[:, 1], -k[:, 0], np.zeros(200)], axis=-1)
        assert np.abs(disk.inner(found, turning)).max() < 1e-13
        assert np.abs(disk.inner(found, sliding)).max() < 1e-13


@pytest.mark.parametrize("scale", [1e-1, 1e-2, 1e-5, 1e-8])
@pytest.mark.parametrize("depth", [1e-3, 0.5, 5.0])
def test_the_default_spacing_is_the_least_that_keeps_a_third_satellite_off(scale, depth):
    wall = geo.Wall.from_vertices([(0, 0), (0.5, -depth), (1, 0)])
    rho = geo.ConfigurationSpace(wall, geo.Disk(), scale).spacing
    finer = 2 * np.pi / (round(2 * np.pi / rho) + 1)

    def allowed(r):
        return r >= scale**0.4 and scale * depth < 2 * np.sin(r / 2) ** 2

    assert allowed(rho) and not allowed(finer)


def test_a_collision_with_the_flat_wall_is_a_reflection_at_the_normal():
    disk, scale, count = geo.Disk(1.3, 0.4), 0.01, 3000
    space = geo.ConfigurationSpace(geo.flat(), disk, scale)
    rng = np.random.default_rng(11)
    w = rng.normal(size=(count, 3)) * [1.0, 1.0, 0.2]
    w[:, 1] = -np.abs(w[:, 1]) - 0.5
    alpha = rng.uniform(-3, 3, count)
    found = geo.collide(disk, geo.flat(), scale, np.stack([0 * alpha, alpha], axis=-1), w)
    lowest = -space.charts.nearest(alpha)
    place = np.stack([0 * alpha, 0 * alpha, alpha], axis=-1)
    for _ in range(30):  # the height of the lowest satellite along the flight, by Newton
        height = space.charts.satellite(place, lowest)[:, 1]
        sinking = w[:, 1] + np.sin(place[:, 2] + lowest * space.spacing) * w[:, 2]
        place = place - (height / sinking)[:, np.newaxis] * w
    n = space.normal(place[:, 2], lowest, [0.0, 1.0])
    reflected = w - 2.0 * disk.inner(w, n)[:, np.newaxis] * n
    same = (found.contacts == 1) & (space.charts.nearest(place[:, 2]) == -lowest)
    assert same.mean() > 0.5
    np.testing.assert_allclose(found.velocity[same], reflected[same], rtol=0, atol=1e-12)
    back = geo.plane_crossing(place[same], reflected[same])
    np.testing.assert_allclose(found.position[same], back, rtol=0, atol=1e-12)


def angle_beyond_the_cylinder(space: geo.ConfigurationSpace, position, velocity, sign: float) -> np.ndarray:
    """Return the outgoing angle of the cylinder's billiard that the disk's trajectory straightens to.

    The entry is eta^-1 of the disk's with ``sign`` 1, the disk's own with 0, and by the printed formula with -1.
    """
    entry = position
    for _ in range(30):  # a contraction by about the spacing
        entry = position - sign * (space.charts.transfer(entry, velocity) - entry)
    theta, _ = space.disk.to_angles(velocity)
    return geo.trace(space.wall.foreshorten(space.disk), entry.sum(axis=-1) / space.scale, theta).theta


def test_the_true_disk_follows_the_cylinder_if_the_entry_is_transferred():
    disk, wall, count = geo.Disk(1.0, 0.5), geo.triangular_teeth(1.6), 2000
    spacings, medians = [], []
    for scale in (1e-4, 1e-6, 1e-8):
        space = geo.ConfigurationSpace(wall, disk, scale)
        rng = np.random.default_rng(12)
        w = disk.from_angles(*rng.uniform(0.5, np.pi - 0.5, (2, count)))
        position = np.stack([rng.uniform(0, 1, count) * scale, rng.uniform(-0.4, 0.4, count) * space.spacing], axis=-1)
        hit = geo.collide(disk, wall, scale, position, -w)
        assert hit.escaped.all() and hit.two_satellites.mean() < 0.01
        angle, _ = disk.to_angles(hit.velocity)

        def errors(sign, space=space, position=position, w=w, angle=angle):
            return np.abs(angle - angle_beyond_the_cylinder(space, position, w, sign))

        # of the order of rho, and hardly a trajectory takes other sides: next to corners only
        other = [np.mean(errors(sign) > 20 * space.spacing) for sign in (1, 0, -1)]
        assert other[0] < 0.01 and min(other[1:]) > 0.1, other
        spacings.append(space.spacing)
        medians.append(np.median(errors(1)))
    assert np.polyfit(np.log(spacings), np.log(medians), 1)[0] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: geo.RollingCharts(1.0), "2 pi divided by a whole number"),
        (lambda: geo.RollingCharts(2 * np.pi / 3), "at least 4"),
        (lambda: geo.RollingCharts(np.pi / 4, scale=0.0), "scale: expected a number greater than 0"),
        (lambda: geo.ConfigurationSpace(geo.koch(2), geo.Disk(), 5.0), "at most two satellites"),
        (lambda: geo.ConfigurationSpace(geo.flat(), None, 0.1), "a Wall and a Disk"),
        (lambda: geo.ConfigurationSpace(geo.koch(2), geo.Disk(), 0.1, np.pi / 50), "at most two satellites"),
        (lambda: geo.ConfigurationSpace(geo.flat(), geo.Disk(), 0.1).contains([0.0, 1.0]), r"shape \(..., 3\)"),
        (lambda: geo.ConfigurationSpace(geo.flat(), geo.Disk(), 0.1).cylinder_contains([0.0]), r"shape \(..., 3\)"),
        (lambda: geo.ConfigurationSpace(geo.flat(), geo.Disk(), 0.1).normal(0, 0, [1.0]), r"shape \(..., 2\)"),
        (lambda: geo.plane_crossing([0, 1, 0], [1, 0, 1]), "v2 other than 0"),
        (lambda: geo.RollingCharts(np.pi / 4).transfer([0, 0, 0], [1, 1, 1]), r"shape \(..., 2\)"),
    ],
)
def test_bad_input_is_refused_with_advice(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(
    ("row", "formula"),
    [
        ("S4.04", rolling.gap_radius),
        ("S4.12", rolling.roll_linear),
        ("S4.13", rolling.bend),
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
        (sym.plane_crossing, geo.plane_crossing(c, w)),
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
    assert geo.plane_crossing_differential(np.zeros((6, 1, 3)), np.ones((5, 3))).shape == (6, 5, 2, 6)
    assert charts.bend_differential(np.zeros(3)).shape == (3, 3)
