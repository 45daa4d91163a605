"""The straightened collision: it decouples, and the true disk shadows it."""

import numpy as np
import pytest
from campaigns.rays import modified_law

from asperity import geometry as geo
from asperity.geometry.disk.satellites import Satellites
from disk_shapes import BEZIERS, WALLS, states

RATIOS = (0.1, 1.0, 2.0, 10.0)


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("name", [*(name for name in WALLS if name != "islands"), "waves"])
def test_the_cylinder_is_the_foreshortened_billiard_times_a_free_motion(name, ratio):
    disk, wall, scale = geo.Disk(ratio, 1.0 / ratio), {**WALLS, **BEZIERS}[name], 1e-3
    position, velocity = states(wall, scale, 400, disk=disk)
    out = geo.collide_cylinder(disk, wall, scale, position, velocity)
    theta, psi = disk.to_angles(-velocity)
    outgoing, rolled = disk.to_angles(out.velocity)
    ray = geo.trace(wall.foreshorten(disk), position.sum(axis=1) / scale, theta)
    both = out.escaped & ray.escaped
    assert both.mean() > 0.99
    np.testing.assert_allclose(outgoing[both], ray.theta[both], atol=1e-11)
    np.testing.assert_allclose(out.position.sum(axis=1)[both] / scale, ray.x[both], atol=1e-10)
    np.testing.assert_array_equal(out.contacts[both], ray.collisions[both])
    np.testing.assert_allclose(rolled, np.pi - psi, atol=1e-13)


@pytest.mark.parametrize("name", WALLS)
def test_the_rolling_momentum_is_conserved_to_rounding_and_its_coordinate_moves_freely(name):
    disk, scale = geo.Disk(1.0, 0.4), 1e-2
    position, velocity = states(WALLS[name], scale, 500, disk=disk)
    out = geo.collide_cylinder(disk, WALLS[name], scale, position, velocity)
    momentum = disk.rolling_momentum(velocity)
    np.testing.assert_allclose(disk.rolling_momentum(out.velocity), momentum, atol=2e-16 * (4 + out.contacts.max()))
    step = np.insert(out.position - position, 1, 0.0, axis=1)
    np.testing.assert_allclose(disk.rolling_momentum(step), out.time * momentum, atol=1e-13)
    # a flat top turns the disk round at height 0
    assert np.all(out.time >= 0.0) and np.mean(out.time > 0.0) >= 0.25


def test_the_flight_time_is_the_length_of_the_foreshortened_ray():
    disk, wall = geo.Disk(1.0, 0.4), WALLS["focusing"]
    position, velocity = states(wall, 1.0, 20, disk=disk, spacing=np.pi / 2)
    out = geo.collide_cylinder(disk, wall, 1.0, position, velocity)
    theta, psi = disk.to_angles(-velocity)
    for row in range(20):
        ray = geo.trajectory(wall.foreshorten(disk), float(position[row].sum()), float(theta[row]))
        length = np.hypot(*np.diff(ray, axis=0).T).sum()
        # lengths in the kinetic metric: kappa m^(1/2) times those of the foreshortened wall of the same period
        speed = np.sin(psi[row]) / (disk.foreshortening * np.sqrt(disk.mass))
        assert out.time[row] == pytest.approx(length / speed, rel=1e-12)


@pytest.mark.parametrize("name", ["triangular", "focusing"])
def test_the_modified_law_follows_that_of_the_cylinder_with_order_one_in_the_spacing(name):
    disk, wall = geo.Disk(1.0, 0.6), WALLS[name]
    scales = np.array([1e-4, 1e-5, 1e-6, 1e-7])
    spacings, errors, outliers = [], [], []
    for scale in scales:
        spacing = Satellites.around(scale, scale * wall.depth).spacing
        position, velocity = states(wall, scale, 2000, disk=disk)
        # on Z^0, where the cylinder's line is the satellite's
        position[:, 1] -= spacing * np.rint(position[:, 1] / spacing)
        modified = geo.collide_modified(disk, wall, scale, position, velocity)
        straight = geo.collide_cylinder(disk, wall, scale, position, velocity)
        error = np.abs(modified.velocity - straight.velocity).max(axis=1)
        spacings.append(spacing)
        errors.append(np.median(error))
        outliers.append(np.mean(error > 0.1))
    slope = np.polyfit(np.log(spacings), np.log(errors), 1)[0]
    assert abs(slope - 1.0) < 0.1
    assert outliers[-1] < 0.5 * outliers[0] and outliers[-1] < 0.02


@pytest.mark.parametrize("name", WALLS)
def test_the_modified_law_is_the_true_one_conjugated_by_eta(name):
    disk, wall, scale = geo.Disk(1.0, 0.6), WALLS[name], 1e-4
    position, velocity = states(wall, scale, 500, disk=disk)
    modified = geo.collide_modified(disk, wall, scale, position, velocity)
    charts = geo.ConfigurationSpace(wall, disk, scale).charts
    true = geo.collide(disk, wall, scale, charts.transfer(position, velocity), velocity)
    np.testing.assert_array_equal(modified.velocity, true.velocity)
    inside = modified.inside
    landed = charts.transfer(modified.position[inside], modified.velocity[inside])
    np.testing.assert_allclose(landed, true.position[inside], atol=1e-15)


def test_states_outside_the_domain_of_the_modified_law_are_flagged():
    # a wide crevice, so that what comes down on the middle of the bottom hits nothing else
    wall = geo.Wall.from_vertices([(0, 0), (0.01, -1), (0.99, -1), (1, 0)])
    disk, scale, spacing = geo.Disk(1.0, 0.5), 1e-6, np.pi / 20
    gap = np.arcsin(scale / (2 * np.sin(spacing / 2)))  # adjacent satellites differ by the depth
    alpha = np.array([0.0, spacing / 2 - 1.2 * gap, spacing / 2 - 0.8 * gap, spacing, 0.0, 0.0])
    # rolling, but for the last ones hardly sinking
    up = np.array([1.0, 1.0, 1.0, 1.0, *(np.sin(spacing / 2) / np.sqrt(0.5) * np.array([1.01, 0.99]))])
    velocity = np.sqrt(1 - up**2)[:, None] * disk.frame[2] - up[:, None] * disk.frame[1]
    position = np.stack([np.full(6, 0.5 * scale), alpha], axis=-1)
    inside = geo.collide_modified(disk, wall, scale, position, 3.0 * velocity, spacing).inside
    assert inside.tolist() == [True, True, False, True, True, False]


@pytest.mark.parametrize("wall", modified_law.WALLS.values(), ids=modified_law.WALLS)
def test_most_states_are_inside_the_domain_of_the_modified_law_and_some_outside_do_not_return(wall):
    disk, rng = modified_law.DISK, np.random.default_rng(3)
    for scale in (1e-2, 1e-6):
        spacing = geo.ConfigurationSpace(wall, disk, scale).spacing
        position, velocity = modified_law.states(wall, scale, spacing, rng)
        out = geo.collide_modified(disk, wall, scale, position, velocity, spacing)
        outside = out.escaped & ~out.inside
        back = geo.collide_modified(disk, wall, scale, out.position[outside], -out.velocity[outside], spacing)
        moved = np.abs(back.position - position[outside]).max(axis=1)
        assert np.any(moved > modified_law.MISMATCH * scale) if scale == 1e-2 else out.inside.mean() > 0.85
