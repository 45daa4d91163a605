"""What holds of the collisions of every disk: energy and momenta are kept, and the reversed collision goes back."""

import numpy as np
import pytest
from campaigns.cases.random_curved_walls import COUNT, random_curved_wall

from asperity import geometry as geo
from disk_shapes import BEZIERS, DISK, TOOTHED, UNEQUAL, WALLS, bodies, gear, starts, states

EPS = np.finfo(float).eps
CURVED = {f"random {number}": random_curved_wall(number) for number in range(0, COUNT, 3)}


@pytest.mark.parametrize("name", [*WALLS, *BEZIERS, *CURVED])
@pytest.mark.parametrize("scale", [1e-1, 1e-4, 1e-8])
def test_a_collision_is_an_involution_within_its_conditioning_and_keeps_the_energy(name, scale):
    n, wall = 40 if name == "still" else 100, {**WALLS, **BEZIERS, **CURVED}[name]
    position, velocity = states(wall, scale, n)
    out = geo.collide(DISK, wall, scale, position, velocity)
    assert out.escaped.all() and np.all(out.velocity[:, 1] > 0)
    np.testing.assert_allclose(DISK.inner(out.velocity, out.velocity), 1.0, rtol=1e-13)
    back = geo.collide(DISK, wall, scale, out.position, -out.velocity)
    assert back.escaped.all()
    # the outgoing state is rounded, which the way back magnifies as it magnifies a rounding of that size put in
    rng, shaken = np.random.default_rng(1), np.zeros(n)
    for _ in range(4):
        size = np.maximum(np.abs(out.position), 1e-3 * scale)
        nudged = out.position + 64 * EPS * size * rng.choice([-1, 1], (n, 2))
        turned = -out.velocity * (1 + 64 * EPS * rng.choice([-1, 1], (n, 3)))
        other = geo.collide(DISK, wall, scale, nudged, turned)
        shaken = np.maximum(shaken, np.abs(other.velocity - back.velocity).max(axis=1))
    error = np.abs(back.velocity + velocity).max(axis=1)
    assert np.median(error) < 1e-11
    # on random curves a few states amplify rounding by ten orders, which four tries may not find
    assert np.count_nonzero(error > 1e-12 + 8 * shaken) <= (2 if name in CURVED else 0)
    assert np.array_equal(back.contacts[shaken < 1e-3], out.contacts[shaken < 1e-3])
    assert np.mean(shaken < 1e-3) > 0.98


@pytest.mark.parametrize("name", ["triangular", "flat"])
def test_teeth_keep_the_energy_and_go_back_when_reversed(name):
    disk, wall, scale, rng = geo.Disk(), WALLS.get(name, geo.flat()), 0.1, np.random.default_rng(2)
    position = rng.uniform([0.0, -0.5], [1.0, 0.5], (30, 2)) * [scale, 0.15]
    _, velocity = states(wall, scale, 30, disk=disk)
    there = geo.collide_rim(gear(), wall, scale, position, velocity)
    good = there.status == geo.Status.ESCAPED
    assert good.mean() > 0.9
    np.testing.assert_allclose(disk.inner(there.velocity, there.velocity), 1.0, atol=1e-12)
    back = geo.collide_rim(gear(), wall, scale, there.position[good], -there.velocity[good])
    few = there.contacts[good] <= 6
    np.testing.assert_array_equal(back.contacts[few], there.contacts[good][few])
    np.testing.assert_allclose(-back.velocity[few], velocity[good][few], atol=1e-6)


def totals(pair, position, velocity):
    """Momentum, angular momentum about the origin, and energy."""
    names = ("mass", "inertia", "radius")
    mass, inertia, radius = (np.array([getattr(body.disk, name) for body in pair]) for name in names)
    spin = velocity[..., 2] / radius
    orbit = position[..., 0] * velocity[..., 1] - position[..., 1] * velocity[..., 0]
    energy = np.sum(mass * np.sum(velocity[..., :2] ** 2, axis=-1) + inertia * spin**2, axis=1)
    momentum, turning = mass[:, None] * velocity[..., :2], mass * orbit + inertia * spin
    return np.sum(momentum, axis=1), np.sum(turning, axis=1), energy


PAIRS = {
    **{f"{count} satellites": bodies(count) for count in (6, 60, 600)},
    "unequal satellites and teeth": (UNEQUAL, TOOTHED),
}


@pytest.mark.parametrize("name", PAIRS)
def test_pairs_keep_energy_momentum_and_angular_momentum_and_go_back_when_reversed(name):
    pair, n = PAIRS[name], 40
    position, velocity = starts(*pair, n)
    there = geo.collide_pair(*pair, position, velocity)
    assert there.counts()["escaped"] == n and there.contacts.max() >= 2
    for kept, before in zip(
        totals(pair, there.position, there.velocity), totals(pair, position, velocity), strict=True
    ):
        np.testing.assert_allclose(kept, before, atol=1e-12)
    turning = np.array([[1.0, 1.0, body.disk.radius] for body in pair])
    back = geo.collide_pair(*pair, there.position + 2.0 * there.velocity / turning, -there.velocity)
    np.testing.assert_array_equal(back.contacts, there.contacts)
    np.testing.assert_allclose(-back.velocity, velocity, atol=1e-8)
