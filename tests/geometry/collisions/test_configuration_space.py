"""The configuration space of disk and wall, against brute force and the true disk; the disk inside the satellites."""

import math

import numpy as np
import pytest
import shapely
from campaigns.judges.differentiation import complex_steps

from asperity import geometry as geo
from asperity.geometry.disk import rolling
from wall_shapes import square

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
    wall = geo.Wall([geo.Segment((0.0, -1.0), (1.0, -1.0))], islands=[square(0.25, -0.75, 0.5)])
    space = geo.ConfigurationSpace(wall, geo.Disk(), scale=0.5**8)
    sides = [(0.5, -0.25), (0.5, -0.75), (0.25, -0.5), (0.75, -0.5), *wall.island_vertices[0].tolist()]
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
    fraction = 1.0 - 2.0 * space.gap_radius / space.spacing
    assert abs(single.mean() - fraction) < 5 * np.sqrt(fraction * (1 - fraction) / 2000)
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
    for disk in (geo.Disk(1.0, 1.0), geo.Disk(2.0, 0.15)):
        space = geo.ConfigurationSpace(geo.triangular_teeth(1.2), disk, scale=0.01)
        beta, alpha, number = rng.uniform(-3, 3, 200), rng.uniform(-3, 3, 200), rng.integers(0, 60, 200)
        k = np.stack([np.sin(beta), np.cos(beta)], axis=-1)
        found = space.normal(alpha, number, k)

        def distance(x1, x2, angle, k=k, number=number, space=space):
            s1, s2 = rolling.satellite(x1, x2, angle + number * space.spacing, 1.0)
            return (k[:, 0] * s1 + k[:, 1] * s2,)

        gradient = complex_steps(distance, [0 * alpha, 0 * alpha, alpha])[:, 0]
        raised = gradient / [disk.mass, disk.mass, disk.rim_mass]
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
    disk, scale, count = geo.Disk(1.3, 0.4 / 1.3), 0.01, 3000
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
    back = geo.RollingCharts.plane_crossing(place[same], reflected[same])
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


@pytest.mark.parametrize("count", [12, 40, 400])
def test_the_disk_inside_never_touches_the_wall_in_a_free_configuration(count):
    rho = 2 * math.pi / count
    teeth = geo.rectangular_teeth(0.9)
    scale = 0.4 * rho**2
    space = geo.ConfigurationSpace(teeth, geo.Disk(), scale, rho)
    inner = space.inner_disk
    assert inner.is_clear and inner.radius == 1 - 2 * rho**2
    rng = np.random.default_rng(count)
    low = -inner.depth - 2 * math.sin(rho / 4) ** 2
    n = 20_000
    states = np.stack([rng.random(n) * scale, rng.uniform(low, 0, n), rng.uniform(-0.5, 0.5, n) * rho], axis=1)
    states[::2, 2] = 0.5 * rho * (1 - 1e-9)
    free = states[space.contains(states)]
    assert len(free) > 500
    bottom = 1 + free[:, 1] - inner.radius
    assert bottom.min() >= inner.clearance - 1e-15
    at_bottom = np.stack([free[:, 0], bottom], axis=-1)
    assert inner.contains(free, at_bottom + np.array([0.0, 1e-9])).all()
    assert not inner.contains(free, at_bottom - np.array([0.0, 1e-9])).any()


def test_the_clearance_is_attained_where_two_satellites_are_level_at_the_bottom():
    rho, depth = 0.2, 0.01
    inner = geo.InnerDisk(rho, depth)
    # the satellites at the angles -rho/2 and rho/2 are at the depth of the wall
    centre = -depth + math.cos(rho / 2)
    assert inner.clearance == pytest.approx(centre - (1 - 2 * rho**2), abs=1e-15)
    # 15/8 rho^2 is enough, and not much more is
    assert geo.InnerDisk(rho, 15 / 8 * rho**2).is_clear
    assert not geo.InnerDisk(rho, 1.877 * rho**2).is_clear
