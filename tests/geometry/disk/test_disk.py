"""The disk: its metric, frame and charts."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from asperity import geometry as geo
from asperity.errors import InputError
from asperity.geometry.disk.disk import branch_block, contact_normal, direction

EPS = np.finfo(float).eps
logs = st.floats(-6.0, 6.0)


def disk_of(log_mass, log_inertia):
    return geo.Disk.from_inertia(10.0**log_mass, 10.0**log_inertia, 1.0)


@given(logs, logs)
def test_the_frame_is_orthonormal_and_right_handed(log_mass, log_inertia):
    disk = disk_of(log_mass, log_inertia)
    products = disk.inner(disk.frame[:, np.newaxis], disk.frame[np.newaxis])
    assert np.allclose(products, np.eye(3), rtol=0, atol=8 * EPS)
    # the corrected sign of chi makes a rotation
    assert np.linalg.det(disk.frame * np.sqrt([disk.mass, disk.mass, disk.rim_mass])) == pytest.approx(1.0)
    assert not disk.frame.flags.writeable


def test_chi_carries_the_rolling_momentum():
    disk = geo.Disk(mass=2.0, inertia_ratio=1.5)
    w = np.random.default_rng(0).normal(size=(50, 3))
    chi = np.array([-1.0, 0.0, 1.0]) / math.sqrt(5.0)
    assert disk.frame[2] == pytest.approx(chi)
    assert np.allclose(disk.rolling_momentum(w), -2.0 * w[:, 0] + 3.0 * w[:, 2], rtol=1e-15)
    assert np.allclose(disk.inner(w, chi), disk.rolling_momentum(w) / math.sqrt(5.0))


@given(logs, logs, st.floats(1e-9, math.pi - 1e-9), st.floats(1e-6, math.pi - 1e-6))
def test_angles_come_back_from_velocities(log_mass, log_inertia, theta, psi):
    disk = disk_of(log_mass, log_inertia)
    w = disk.from_angles(theta, psi, speed=3.7)
    assert disk.inner(w, w) == pytest.approx(3.7**2, rel=1e-12)
    again = disk.to_angles(w)
    # v1 + omega and -m v1 + J omega cancel when one of the two terms is far larger than their difference
    w1, _, w3 = np.abs(w)
    across = 1.0 / math.sqrt(1.0 / disk.mass + 1.0 / disk.rim_mass)
    noise = EPS * (across * (w1 + w3) + (disk.mass * w1 + disk.rim_mass * w3) / math.sqrt(disk.mass + disk.rim_mass))
    assert again[0] == pytest.approx(theta, rel=8 * EPS, abs=4 * noise / math.sin(psi))
    assert again[1] == pytest.approx(psi, rel=8 * EPS, abs=4 * noise)


@pytest.mark.parametrize("ratio", [1e-12, 1e-6, 0.3, 1.0, 2.0, 1e6, 1e12])
def test_frame_and_angles_equal_fifty_digits_at_extreme_ratios(ratio):
    mpmath.mp.dps = 50
    disk = geo.Disk(mass=1.0, inertia_ratio=1.0 / ratio)
    m, j = mpmath.mpf(disk.mass), mpmath.mpf(disk.rim_mass)
    assert disk.foreshortening == pytest.approx(float(1 / mpmath.sqrt(1 + m / j)), rel=2 * EPS)
    w = (0.3, 1e-9, 0.2)
    v1, v2, omega = (mpmath.mpf(v) for v in w)
    across = (v1 + omega) / mpmath.sqrt(1 / m + 1 / j)
    upward, rolling = mpmath.sqrt(m) * v2, (-m * v1 + j * omega) / mpmath.sqrt(m + j)
    theta, psi = disk.to_angles(w)
    assert theta == pytest.approx(float(mpmath.atan2(upward, across)), rel=8 * EPS)
    assert psi == pytest.approx(float(mpmath.atan2(mpmath.hypot(across, upward), rolling)), rel=32 * EPS)


def test_grazing_directions_keep_all_their_digits():
    disk = geo.Disk()
    for angle in (1e-300, 1e-20, 1e-12):
        theta, psi = disk.to_angles(disk.from_angles(angle, math.pi / 2))
        assert theta == pytest.approx(angle, rel=8 * EPS)
        assert psi == pytest.approx(math.pi / 2, rel=8 * EPS)
        # near the pole psi = 0
        assert disk.to_angles(disk.from_angles(1.0, angle))[1] == pytest.approx(angle, rel=1e-3, abs=4 * EPS)


def test_the_speed_is_dropped_and_shapes_broadcast():
    disk = geo.Disk(1.0, 1 / 3)
    w = disk.from_angles(np.full((4, 1), 0.5), np.full(3, 1.0), speed=2.0)
    assert w.shape == (4, 3, 3)
    slow, fast = disk.to_angles(w), disk.to_angles(1e6 * w)
    assert np.allclose(slow, fast, rtol=4 * EPS)
    assert slow[0].shape == (4, 3)


def test_the_definition_of_the_angles():
    disk = geo.Disk(2.0, 0.35)
    theta, psi = 0.4, 2.2
    parts = np.array([math.cos(theta) * math.sin(psi), math.sin(theta) * math.sin(psi), math.cos(psi)])
    assert disk.from_angles(theta, psi) == pytest.approx(parts @ disk.frame, rel=1e-14)


def test_foreshortening_of_known_disks():
    assert geo.Disk(1.0, 0.5).foreshortening == pytest.approx(3**-0.5, rel=2 * EPS)  # a uniform disk
    assert geo.Disk(1.0, 1.0).foreshortening == pytest.approx(2**-0.5, rel=2 * EPS)  # a ring
    assert geo.Disk(1.0, 4.0).foreshortening < 1.0  # no real disk, accepted
    assert geo.Disk() == geo.Disk(1, 0.5) and hash(geo.Disk()) == hash(geo.Disk(1, 0.5))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_block_of_a_branch_turns_minus_the_incoming_velocity(sign):
    """theta' = sign theta + offset and psi' = pi - psi."""
    theta, psi, offset = 0.7, 1.1, 0.4
    block = np.array(branch_block(sign, np.cos(offset), np.sin(offset)))
    outgoing = direction(sign * theta + offset, np.pi - psi)
    assert block @ -np.array(direction(theta, psi)) == pytest.approx(outgoing, rel=0.0, abs=1e-15)
    assert block @ [0.0, 0.0, 1.0] == pytest.approx([0.0, 0.0, 1.0], rel=0.0, abs=0.0)


@pytest.mark.parametrize("turn", [0.0, 0.6, -1.1])
def test_the_normal_of_a_contact_measures_the_speed_of_the_satellite_along_the_normal_of_the_wall(turn):
    mass, inertia, wall_normal = 2.0, 0.5, np.array([0.6, 0.8])
    metric = np.array([mass, mass, inertia])
    normal = np.array(contact_normal(mass, inertia, wall_normal, turn))
    assert normal @ (metric * normal) == pytest.approx(1.0, rel=1e-14)
    # v + omega d/d turn (sin turn, -cos turn)
    speeds = np.append(wall_normal, wall_normal @ [np.cos(turn), np.sin(turn)])
    ratio = metric * normal / speeds
    assert ratio[0] > 0.0 and ratio == pytest.approx(np.full(3, ratio[0]), rel=1e-14)


def test_a_disk_knows_its_inertia_in_its_own_units():
    # a steel disk of 5 mm in SI units, and the same one in mm and g
    si, small = geo.Disk(0.0061, 0.5, 5e-3), geo.Disk(6.1, 0.5, 5.0)
    assert si.inertia == pytest.approx(0.5 * 0.0061 * 5e-3**2, rel=4 * EPS)
    assert si.rim_mass == 0.5 * 0.0061 and small.inertia == pytest.approx(1e9 * si.inertia, rel=4 * EPS)
    again = geo.Disk.from_inertia(si.mass, si.inertia, si.radius)
    assert again.inertia_ratio == pytest.approx(0.5, rel=4 * EPS)
    # whatever the mass, the default is a uniform disk
    assert geo.Disk(4.0).inertia == 2.0 and geo.Disk(mass=4.0, radius=3.0).inertia == 18.0


def test_an_inertia_is_refused_with_the_ratio_to_write():
    with pytest.raises(InputError, match=r"write Disk\(mass=4\.0, inertia_ratio=0\.5, radius=0\.5\)"):
        geo.Disk(4.0, radius=0.5, inertia=0.5)
    with pytest.raises(InputError, match=r"inertia_ratio=0\.5, radius=1\.0\) if the radius is 1\.0, or pass another"):
        geo.Disk(mass=2.0, inertia=1.0)
    for name in ("mass", "inertia", "radius"):
        with pytest.raises(InputError, match=f"^{name}"):
            geo.Disk.from_inertia(**{"mass": 1.0, "inertia": 1.0, "radius": 1.0, name: 0.0})
    with pytest.raises(TypeError, match="inertia"):
        geo.Disk.from_inertia(1.0)
    with pytest.raises(InputError, match=r"^mass \* inertia_ratio"):
        geo.Disk(1e200, 1e200)
    with pytest.raises(InputError, match=r"^mass \* inertia_ratio \* radius"):
        geo.Disk(1e200, 1.0, 1e100)
