"""The true disk against a wall: first contact, involution, conservation, and what is refused."""

import math

import numpy as np
import pytest
from campaigns.judges.precise_collision import collide_precisely
from campaigns.rays.true_disks import standing_plate

from asperity import geometry as geo
from asperity.geometry.collisions.compiled.contact import ROOT_STEPS, Path, Span, flight, next_root
from asperity.geometry.collisions.rigid import checked_states
from asperity.geometry.disk.satellites import Satellites
from disk_shapes import DISK, WALLS, states

SCALES = (1e-1, 1e-2, 1e-4, 1e-6, 1e-8)


def test_a_lip_without_thickness_is_met_from_below_by_a_satellite_that_came_in_beside_it():
    # its height is y = .005 - .096 t + .08 t^2 but for smaller terms: below the tops from x = .38, in the opening
    # (.35, .65), to x = .89, under the lip; it comes in at the very height of the lip's lower side
    rng = np.random.default_rng(0)
    position = np.array([0.06781824, -0.03185973]) + 1e-9 * rng.random((200, 2))
    out = geo.collide(DISK, geo.mushrooms(0.3), 0.1, position, [[-0.63075937, -0.04428023, 1.00015155]])
    assert (out.contacts > 1).all() and out.two_satellites.all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "scale", "n"),
    [
        ("triangular", 1e-1, 600), ("triangular", 1e-2, 600), ("rectangular", 1e-1, 100), ("rectangular", 1e-3, 200),
        ("focusing", 1e-2, 200), ("dispersing", 1e-1, 150), ("overhang", 1e-1, 50),
        ("an arc", 1e-3, 60),
        *((name, 1e-3, 30) for name in ("standing, no thickness", "leaning, 3e-16 thick", "floating")),
    ],
)  # fmt: skip
def test_no_contact_is_missed_by_comparison_with_steps_of_the_distance(name, scale, n):
    """Also under an overhang, and at plates that are thinner than rounding."""
    wall, hard = {**WALLS, **PLATES, "overhang": geo.mushrooms(0.3, 0.5)}[name], name not in WALLS
    position, velocity = states(wall, scale, n, seed=3 if name == "overhang" else 7 if hard else 77)
    spacing = Satellites.around(scale, scale * wall.depth).spacing
    out = geo.collide(DISK, wall, scale, position, velocity)
    place, outgoing, contacts = collide_precisely(DISK, wall, scale, spacing, position, velocity)
    # a disk within 1e-8 of a corner is not judged
    done = ~np.isnan(outgoing[:, 0])
    assert out.escaped.all() and done.mean() > 0.99
    assert np.array_equal(contacts[done], out.contacts[done])
    # a few contacts on curved pieces magnify rounding
    few = done & (contacts < 8) if hard else done
    np.testing.assert_allclose(outgoing[few], out.velocity[few], atol=1e-9)
    np.testing.assert_allclose(place[few], out.position[few], atol=1e-9)
    least = {"triangular": 20, "overhang": 5}.get(name, -1)
    assert np.count_nonzero(out.two_satellites) > least


ARC = geo.Arc((0.5, -0.6), 0.3, 2.5, 0.6)
PLATES = {
    "standing, no thickness": standing_plate(0.0, 0.0),
    "leaning, 3e-16 thick": standing_plate(3e-16, 0.04),
    "floating": geo.Wall(
        [geo.Segment((0, -0.9), (1, -0.9))],
        islands=[[geo.Segment((0.2, -0.6), (0.8, -0.4)), geo.Segment((0.8, -0.4), (0.2, -0.6))]],
    ),
    "an arc": geo.Wall([geo.Segment((0, -0.9), (1, -0.9))], islands=[[ARC, ARC.reversed()]]),
}


def test_the_two_sides_of_a_sharp_peak_are_told_apart_next_to_its_tip():
    # a disk that does not turn hits the left side so far below the tip, where the peak is 1e-15 to 1e-12 thick
    wall = geo.Wall.from_vertices([(0, 0), (0, -0.9), (0.4996, -0.9), (0.5, -0.2), (0.5004, -0.9), (1, -0.9), (1, 0)])
    below, scale = np.array([1e-9, 1e-10, 1e-11, 3e-12, 1e-12]), 1e-3
    theta = np.arctan2(0.2 + below, 0.3 - 0.5)
    velocity = -np.stack([np.cos(theta), np.sin(theta), 0.0 * theta], axis=1)
    out = geo.collide(DISK, wall, scale, [[0.3 * scale, 0.0]], velocity)
    assert out.escaped.all() and np.all(out.contacts == out.contacts[0])
    np.testing.assert_allclose(out.velocity, out.velocity[[0] * len(below)], atol=1e-6)


def test_a_root_that_is_too_many_steps_away_is_not_called_none():
    motion = flight.py_func(0.0, -1.0, 0.0, 0.1)
    span, path = Span(0.0, 1e9, (0.0, 0.0)), Path(0.0, 0.0, (0.0, 1.0), motion, 1e-15)
    arguments = (1.0, False, None, (3.0 * ROOT_STEPS, 0.0, 1.0, 0.0, 1.0), None, span, path)
    near, _, found = next_root(*arguments, 1.0)
    assert near == ROOT_STEPS and found == geo.Status.BOUNCE_LIMIT
    at, _, found = next_root(*arguments, 10.0)
    assert at == pytest.approx(3.0 * ROOT_STEPS) and found == geo.Status.ESCAPED


def test_a_disk_that_sinks_far_slower_than_it_turns_does_not_pass_through_the_wall():
    # its lowest satellite rolls on the spot
    sinking = np.array([1e-2, 1e-3, 1e-4])
    velocity = np.stack([np.full(3, -0.5), -sinking, np.full(3, 0.5)], axis=1)
    wall, scale = geo.focusing_arcs(1.2), 1e-8
    out = geo.collide(DISK, wall, scale, [[0.4 * scale, 0.0]], velocity)
    assert out.escaped.all() and np.all(out.contacts > 0)
    back = geo.collide(DISK, wall, scale, out.position, -out.velocity)
    assert np.array_equal(back.contacts, out.contacts)
    np.testing.assert_allclose(back.velocity, -velocity, atol=1e-6)


def test_a_flat_wall_reflects_in_closed_form():
    # the lowest satellite, at the angle a, touches when x2 = cos a - 1; then Proposition 3.2 with k = (0, 1)
    a, v2, omega = 0.01, -1.0, 1e-9
    out = geo.collide(DISK, geo.flat(), 1e-3, [[0.0, a]], [[0.3, v2, omega]])
    sine = math.sin(a)
    impulse = -2 * (v2 + omega * sine) / (1 / DISK.mass + sine**2 / DISK.rim_mass)
    expected = [0.3, v2 + impulse / DISK.mass, omega + impulse * sine / DISK.rim_mass]
    np.testing.assert_allclose(out.velocity[0], expected, rtol=1e-9)
    assert out.contacts.tolist() == [1]


def test_the_wall_is_periodic_and_the_ring_of_satellites_too():
    wall, scale = WALLS["triangular"], 2.0**-7
    spacing = 2 * math.pi / 16
    position, velocity = states(wall, scale, 200, spacing=spacing)
    position = np.round(position, 8)
    out = geo.collide(DISK, wall, scale, position, velocity, spacing)
    moved = geo.collide(DISK, wall, scale, position + np.array([3 * scale, 2 * spacing]), velocity, spacing)
    np.testing.assert_allclose(moved.velocity, out.velocity, atol=1e-9)
    np.testing.assert_allclose(moved.position - out.position, np.tile([3 * scale, 2 * spacing], (200, 1)), atol=1e-11)


def test_the_invariant_measure_is_kept():
    # K preserves <w, e2> dx1 dalpha dw: the mean of a function over incoming states is that over outgoing ones
    wall, scale, n = WALLS["focusing"], 0.05, 20_000
    position, velocity = states(wall, scale, n, seed=5)
    out = geo.collide(DISK, wall, scale, position, velocity)
    for function in (lambda t, p: np.cos(t) ** 2, lambda t, p: np.cos(p), lambda t, p: np.cos(t + 2 * p)):
        before, after = function(*DISK.to_angles(-velocity)), function(*DISK.to_angles(out.velocity))
        difference = after - before
        assert abs(difference.mean()) < 4.5 * difference.std() / math.sqrt(n)


def test_contacts_that_double_precision_does_not_settle_are_named():
    # a satellite that falls straight into the corner of a tooth, and a limit of contacts
    wall = geo.triangular_teeth(1.2)
    out = geo.collide(DISK, wall, 0.01, [[0.005, 0.0]], [[0.0, -1.0, 0.0]])
    assert out.counts()["corner"] == 1
    position, velocity = states(wall, 0.01, 100)
    limited = geo.collide(DISK, wall, 0.01, position, velocity, max_contacts=1)
    assert limited.counts()["bounce_limit"] == np.sum(geo.collide(DISK, wall, 0.01, position, velocity).contacts > 1)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("name", ["triangular", "focusing", "dispersing", "elliptical"])
def test_two_satellites_at_one_time_are_named_where_the_order_decides(name, scale):
    # a disk that falls between two satellites straight above a wall's line of symmetry: whichever is reflected first
    # turns the disk its own way
    wall = WALLS[name]
    half = 0.5 * Satellites.around(scale, scale * wall.depth).spacing
    position = [[0.0, half], [0.0, half * (1 - 1e-6)], [0.0, half * (1 + 1e-6)]]
    out = geo.collide(DISK, wall, scale, position, [[0.0, -1.0, 0.0]])
    assert out.status.tolist() == [geo.Status.CORNER, geo.Status.ESCAPED, geo.Status.ESCAPED]
    assert abs(out.velocity[1, 2] - out.velocity[2, 2]) > 1e-2


def test_a_disk_that_hardly_rises_still_meets_the_teeth_that_its_satellites_pass():
    """After two contacts it rises at 2e-8 of its speed, for two million times its own flight; beside it 1e-5 away."""
    x1, alpha = float.fromhex("0x1.57db386cde54dp-8"), float.fromhex("0x1.1faa321480667p+2")
    velocity = [float.fromhex(v) for v in ("0x1.7110241ce5b49p-2", "-0x1.d98e328f28dcep-2", "-0x1.254823bc9dd96p+0")]
    states = [[x1 + shift, alpha] for shift in (0.0, 1e-9, -1e-9, 1e-6, 1e-5, -1e-5)]
    hit = geo.collide(geo.Disk(), geo.triangular_teeth(0.7), 0.1, states, [velocity] * len(states))
    assert hit.contacts.tolist() == [3] * len(states) and hit.escaped.all()
    assert np.abs(hit.velocity - hit.velocity[0]).max() < 1e-4


def test_states_of_one_disk_and_of_many_are_arrays_of_one_kind():
    # functions are compiled once more for arrays that are read-only
    for rows in (1, 2):
        states_of = checked_states([[0.3, 0.1]] * rows, [[0.2, -1.0, 0.1]])
        assert all(array.flags.writeable and array.flags.c_contiguous for array in states_of)
