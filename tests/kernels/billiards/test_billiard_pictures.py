"""Paths, phase portraits and animations of disks in containers."""

import numpy as np
import pytest
from matplotlib import pyplot

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.kernels.billiards.lyapunov import equilibrium_starts
from asperity.kernels.billiards.record import BilliardRecord, path_between

DISK = geo.Disk(1.0, 0.5)
STADIUM = geo.Container.stadium(2.0, 1.0)


@pytest.fixture(autouse=True)
def _close():
    yield
    pyplot.close("all")


def record(law=None, n: int = 5, steps: int = 200) -> BilliardRecord:
    rng = np.random.default_rng(0)
    position, velocity, _ = equilibrium_starts(STADIUM, DISK, n, True, rng)
    return ker.play(STADIUM, law or ker.no_slip(DISK), position, velocity, steps, rng)


def test_portraits_lie_in_their_ranges_and_fill_them_evenly():
    found = record(n=200)
    s, along = found.phase_portrait()
    assert s.shape == along.shape == (200, 200)
    assert s.min() >= 0.0 and s.max() <= STADIUM.perimeter and np.abs(along).max() <= 1.0
    # the flux has constant density in the disk of tangential velocity and spin: E[r^2] = 1/2
    first, second = found.phase_portrait("velocity")
    radii = first**2 + second**2
    assert radii.max() <= 1.0
    ends = radii[-1]
    assert abs(ends.mean() - 0.5) < 4.5 * ends.std() / np.sqrt(200)


def test_disks_that_left_have_no_points():
    strip = ker.play(geo.Container.wedge(1.0), ker.smooth(DISK), [1.0, 0.5], [-1.0, 0.1, 0.0], 20)
    first, second = strip.phase_portrait("velocity")
    count = int(strip.collisions[0])
    assert 0 < count < 20
    assert np.isnan(first).sum() == np.isnan(second).sum() == 20 - count


def test_paths_have_the_points_of_the_record():
    found = record()
    axes = found.draw_paths()
    drawn = axes.lines[-1].get_xydata()
    np.testing.assert_array_equal(drawn, found.position[:, -1])
    assert len(axes.lines) == len(STADIUM.curves) + 5


@pytest.mark.parametrize("coordinates", ["boundary", "velocity"])
def test_a_portrait_has_one_colour_a_disk(coordinates):
    axes = record().draw_phase_portrait(coordinates)
    assert len({line.get_color() for line in axes.lines[:5]}) == 5
    assert axes.get_xlabel() and axes.get_ylabel()


def test_an_animation_shows_the_disks_where_they_are(tmp_path):
    found = record(steps=20)
    animation = found.animate(frames=5, duration=1.0)
    animation.save(tmp_path / "disks.gif", writer="pillow")
    assert (tmp_path / "disks.gif").stat().st_size > 1000
    # the last picture: the middle of the circle of the last disk, and its spoke
    end = found.time[-1].min()
    _, edge, spoke = pyplot.gcf().axes[0].lines[-3:]
    path, _ = path_between(found.time[:, 4], found.position[:, 4], found.angle[:, 4], end, end)
    middle = path[-1]
    np.testing.assert_allclose(edge.get_xydata()[:-1].mean(axis=0), middle, atol=1e-12)
    np.testing.assert_allclose(spoke.get_xydata()[0], middle, atol=1e-12)
    assert STADIUM.contains(middle[None]).all()


def test_the_disks_of_a_gas_are_drawn_in_their_size():
    room = geo.Container.polygon([(0, 0), (9, 0), (9, 6), (0, 6)])
    pair = ker.PairLaw(ker.retroreflection(), DISK)
    gas = ker.play_gas(room, pair, [[2, 3], [6, 3]], [[1, 0.1, 0], [0, 0, 0]], 4)
    gas.animate(frames=3)
    edge = pyplot.gcf().axes[0].lines[-2].get_xydata()
    assert np.ptp(edge[:, 0]) == pytest.approx(2.0, rel=1e-2)
