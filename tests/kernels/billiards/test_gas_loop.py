"""The compiled loop of a gas against a plain one, exact cases, what is stored, and means over time."""

import math
import time
from _thread import interrupt_main
from dataclasses import dataclass

import numpy as np
import pytest
from campaigns.cases.gases import ROOMS, on_a_lattice, pair_of, scattered
from campaigns.judges.plain_gas import PlainGas, plain_law

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.errors import AccuracyError, InputError
from asperity.kernels.billiards import event_loop
from asperity.kernels.billiards.gas_statistics import IMPULSE, PAIRS, RIM2, RIM4, V4, VIRIAL, WALLS

ROOM = geo.Container.polygon([(0, 0), (9, 0), (9, 6), (0, 6)])
SEATS = np.array([(1.5 + 3.0 * i, 1.5 + 3.0 * j) for i in range(3) for j in range(2)])
VELOCITY = np.random.default_rng(3).standard_normal((6, 3))
ARCS = ker.WallLaw(geo.focusing_arcs(1.2))


def play(law, wall, events, room=ROOM, seats=SEATS, velocity=VELOCITY, **options):
    pair = pair_of(law, 0.4)
    walls = ker.CollisionLaw(wall, pair.first) if isinstance(wall, ker.Law) else wall
    return ker.play_gas(room, pair, seats, velocity, events, walls=walls, rng=1, **options)


@pytest.mark.parametrize("name", ROOMS)
def test_the_loop_and_a_plain_gas_have_the_same_events(name):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        seats, velocity = scattered(ROOMS[name], 5, rng)
        kinds = rng.choice([1.0, -1.0], 2)
        laws = [ker.specular() if kind > 0.0 else ker.retroreflection() for kind in kinds]
        record = play(*laws, 8, ROOMS[name], seats, velocity)
        wall = plain_law(kinds[1], 0.4, True)
        judge = PlainGas(ROOMS[name], plain_law(kinds[0], 0.4, False), [wall] * 9, 2.0, seats, velocity)
        for k in range(1, 9):
            judge.next_event()
            assert record.time[k, 0] == pytest.approx(judge.now, abs=1e-12)
            for found, wanted in ((record.position, judge.position), (record.velocity, judge.velocity)):
                np.testing.assert_allclose(found[k], wanted, atol=2e-12)
            np.testing.assert_allclose(record.angle[k], judge.angle, atol=2e-12)


def test_a_floor_reverses_the_slip_of_a_disk_of_radius_one_half():
    pair = pair_of(ker.retroreflection(), 0.5, 0.5)
    record = ker.play_gas(ROOM, pair, [[5, 2]], [[0.3, -1, 0.35]], 1, walls=ker.no_slip(pair.first))
    np.testing.assert_allclose(record.velocity[1, 0], [-0.4 / 3.0, 1.0, -1.55 / 3.0], rtol=1e-14)


@pytest.mark.parametrize("law", [ker.retroreflection(), ARCS, ker.maxwell(0.3)], ids=str)
def test_half_as_large_a_gas_has_the_same_bits(law):
    small = geo.Container.polygon([(0, 0), (4.5, 0), (4.5, 3), (0, 3)])
    pair = pair_of(law, 0.4, 0.5)
    wall = ker.CollisionLaw(law, pair.first)
    half = ker.play_gas(small, pair, SEATS / 2, 0.5 * VELOCITY, 300, walls=wall, rng=1)
    whole = play(law, law, 300)
    assert np.array_equal(whole.position, 2.0 * half.position) and np.array_equal(whole.angle, half.angle)
    assert np.array_equal(whole.velocity, 2.0 * half.velocity) and np.array_equal(whole.time, half.time)


@pytest.mark.parametrize("law", [ker.specular(), ker.retroreflection()], ids=str)
@pytest.mark.parametrize("gap", [0.0, 1e-13, -1e-13, 1e-16])
def test_disks_that_touch_in_a_row_collide_as_often_as_pairs_approach(law, gap):
    room = geo.Container.polygon([(0, 0), (1e4, 0), (1e4, 1e4), (0, 1e4)])
    for n, turn in ((4, 0.7), (6, 1.234)):
        along = np.array([math.cos(turn), math.sin(turn)])
        seats = 50.0 + np.arange(n)[:, None] * (2.0 + gap) * along
        velocity = np.column_stack([np.arange(n, 0, -1)[:, None] * along, np.zeros(n)])
        record = play(law, ker.specular(), n * (n - 1) // 2 + 1, room, seats, velocity)
        # all pairs, and then a wall
        assert np.all(record.partner[1:-1].max(axis=1) >= 0) and record.wall[-1].max() >= 0
        np.testing.assert_allclose(record.velocity[-2], velocity[::-1], atol=1e-12)
        cradle = play(law, ker.specular(), n, room, seats, velocity * (np.arange(n) == 0)[:, None])
        assert cradle.collisions.tolist() == [1, *[2] * (n - 2), 2] and cradle.wall[-1, -1] >= 0


@dataclass(frozen=True)
class Asked(ker.Law):
    """A law of which the loop knows nothing; of the same number it makes the same angle."""

    law: ker.Law

    def random_map(self):
        if self.law.is_lambertian:
            return lambda x, theta: (2.0 * np.arcsin(np.sqrt(x)), None)
        return self.law.random_map()

    def _sample(self, theta, rng):
        return self.law.sample(theta, rng)

    def _conditionals(self, theta, tolerance, degree, edges):
        return self.law.conditionals(theta, tolerance, degree, edges)


def test_laws_in_the_loop_are_those_in_python():
    terms = (0.2, ker.specular()), (0.2, ker.lambertian()), (0.3, ARCS), (0.3, ker.retroreflection())
    mixed, asked = (sum((w * kind(law) for w, law in terms[1:]), terms[0][0] * kind(terms[0][1]))
                    for kind in (lambda law: law, Asked))  # fmt: skip
    for pair, wall in ((mixed, ARCS), (ARCS, mixed)):
        first, second = play(pair, wall, 12), play(Asked(pair) if pair is ARCS else asked, wall, 12)
        np.testing.assert_allclose(first.velocity, second.velocity, atol=1e-9)
        np.testing.assert_array_equal(first.partner, second.partner)


@dataclass(frozen=True)
class Own:
    """A law of velocities as users write them."""

    disk: geo.Disk

    def sample(self, velocity, rng=None):
        return velocity * [1.0, -1.0, 1.0]


@pytest.mark.parametrize("name", ["polygon", "circle", "Bezier"])
def test_a_law_of_velocities_is_asked(name):
    seats, velocity = scattered(ROOMS[name], 4, np.random.default_rng(5))
    own = play(ker.retroreflection(), Own(pair_of(ker.specular(), 0.4).first), 10, ROOMS[name], seats, velocity)
    smooth = play(ker.retroreflection(), ker.specular(), 10, ROOMS[name], seats, velocity)
    np.testing.assert_allclose(own.velocity, smooth.velocity, atol=1e-11)
    np.testing.assert_allclose(own.integrals, smooth.integrals, atol=1e-10)


def test_a_law_without_a_map_and_a_true_disk_keep_the_energy(monkeypatch):
    law = ker.SatelliteLaw(geo.triangular_teeth(1.0), pair_of(ker.specular(), 0.4).first, scale=0.2)
    record = play(ker.henyey_greenstein(0.5), law, 40)
    np.testing.assert_allclose(record.energy.sum(axis=1), record.energy[0].sum(), rtol=1e-12)
    monkeypatch.setattr(type(law), "attempt", lambda self, moving, rng: np.full_like(moving, np.nan))
    ended = play(ker.specular(), law, 40)
    assert ended.counts()["unreflected"] == 1 and np.isfinite(ended.velocity).all()


def test_the_same_seed_has_the_same_bits_whatever_is_stored():
    options = [{}, {"every": 7}, {"every": 3000}, {"interval": 0.73}]
    first, *others = (play(ARCS, ker.TriangularTeethLaw(1.0), 3000, **option) for option in options)
    for record in others:
        assert np.array_equal(first.velocity[-1], record.velocity[-1]) and first.time[-1, 0] == record.time[-1, 0]
        assert np.array_equal(first.integrals, record.integrals)
    every, last, timed = others
    assert np.array_equal(every.velocity[1:-1], first.velocity[7:-1:7]) and len(last.time) == 2
    np.testing.assert_allclose(np.diff(timed.time[:-1, 0]), 0.73, rtol=1e-12)
    # between two events disks fly freely
    k = int(np.searchsorted(first.time[:, 0], 0.73 * 9)) - 1
    flown = first.position[k] + first.velocity[k, :, :2] * (0.73 * 9 - first.time[k, 0])
    np.testing.assert_allclose(timed.position[9], flown, atol=1e-12)
    assert np.all(
        timed.partner == -1 + (timed.partner + 1) * (np.arange(len(timed.time)) == len(timed.time) - 1)[:, None]
    )


@pytest.mark.parametrize("room", [ROOM, geo.Torus(9.0, 6.1)], ids=["box", "torus"])
def test_integrals_and_counts_are_those_of_the_states(room):
    record = play(ker.retroreflection(), None if isinstance(room, geo.Torus) else ARCS, 1024, room)
    duration, before = np.diff(record.time[:, 0]), record.velocity[:-1]
    found = record.integrals
    assert found.shape == (1024, 7 + (0 if isinstance(room, geo.Torus) else 8))
    np.testing.assert_allclose(found[:, 0], duration, atol=1e-12)
    sums = (
        np.sum(before[..., 2] ** 2, axis=1),
        np.sum(before[..., :2] ** 4, axis=(1, 2)),
        np.sum(before[..., 2] ** 4, 1),
    )
    for column, values in zip((RIM2, V4, RIM4), sums, strict=True):
        np.testing.assert_allclose(found[:, column], values * duration, atol=1e-11)
    assert np.array_equal(found[:, PAIRS], record.partner[1:].max(axis=1) >= 0)
    assert np.array_equal(found[:, WALLS], record.wall[1:].max(axis=1) >= 0)
    change = np.diff(record.velocity[..., :2], axis=0)
    for k in np.flatnonzero(found[:, PAIRS])[:200]:
        i = int(np.argmax(record.partner[k + 1]))
        other = record.partner[k + 1, i]
        offset = record.position[k + 1, i] - record.position[k + 1, other]
        if isinstance(room, geo.Torus):
            offset -= np.round(offset / room.periods) * room.periods
        assert found[k, VIRIAL] == pytest.approx(offset @ change[k, i], abs=1e-12)
    for wall, normal in enumerate(room.normals) if isinstance(room, geo.Container) else ():
        pushed = np.sum(change * (record.wall[1:] == wall)[..., None], axis=1)
        np.testing.assert_allclose(found[:, IMPULSE + 2 * wall], pushed @ normal, atol=1e-12)
        np.testing.assert_allclose(found[:, IMPULSE + 2 * wall + 1], pushed @ [normal[1], -normal[0]], atol=1e-12)


def test_a_torus_keeps_the_momentum_and_has_the_pressure_of_its_collisions():
    side, seats, velocity = on_a_lattice(64, 0.2, 0.5, np.random.default_rng(0))
    pair = pair_of(ker.retroreflection())
    record = ker.play_gas(geo.Torus(side, side), pair, seats, velocity, 60_000, every=10_000)
    np.testing.assert_allclose(record.velocity[..., :2].sum(axis=1), 0.0, atol=1e-11)
    np.testing.assert_allclose(record.energy.sum(axis=1), record.energy[0].sum(), rtol=1e-12)
    # not reduced to one period
    assert np.abs(record.position).max() > 2.0 * side and record.marks.shape == (65, 64, 2)
    found = record.statistics()
    # Z = 1 + 2 phi g, virial coefficients of hard disks up to the fifth
    packed = 1.0 + 2.0 * 0.2 + 3.12802 * 0.2**2 + 4.25785 * 0.2**3 + 5.33690 * 0.2**4
    pressure = packed * 64 * found.temperature.value / side**2
    assert abs(found.pressure.value / pressure - 1.0) < 0.03
    assert abs(found.spin_fraction.value - 64.0 / 190.0) < 2.0 * found.spin_fraction.error < 0.02
    assert 0.0 < found.self_diffusion.error < found.self_diffusion.value


def test_numbers_that_are_not_known_say_why():
    short = play(ker.specular(), None, 50, velocity=VELOCITY * [1.0, 1.0, 0.0]).statistics()
    assert "an error needs 384, 64 per disk" in short.temperature.method and math.isinf(short.temperature.error)
    assert "self_diffusion    not known: 32 intervals in a torus have displacements" in repr(short)
    assert "no disk spins" in short.spin_kurtosis.method and "torus" in short.self_diffusion.method
    strip = geo.Container.strip(6.0)
    still = ker.play_gas(strip, pair_of(ker.specular()), [[0, 1]], [[0, 1, 0]], 5).statistics()
    assert "an area" in still.pressure.method and "no collision" in still.mean_free_time.method
    corner = ker.play_gas(ROOM, pair_of(ker.specular()), [[1, 1]], [[-1, -1, 0.5]], 5)
    assert len(corner.time) == 1 and corner.statistics().spin_fraction.value == pytest.approx(0.0625 / 1.0625)


def test_ctrl_c_returns_the_events_so_far(monkeypatch):
    run, calls = event_loop.EventLoop.run, []

    def stopped(self, *arguments):
        calls.append(arguments)
        if len(calls) == 5:
            raise KeyboardInterrupt
        return run(self, *arguments)

    whole = play(ARCS, ARCS, 100)
    monkeypatch.setattr(event_loop.EventLoop, "run", stopped)
    record = play(ARCS, ARCS, 100)
    assert record.stopped and not whole.stopped and len(record.time) == 5
    assert np.array_equal(record.velocity, whole.velocity[:5]) and len(record.integrals) == 4


def test_disks_that_never_meet_are_reported():
    with pytest.raises(AccuracyError, match="no disk meets"):
        ker.play_gas(geo.Torus(9.0, 9.0), pair_of(ker.specular()), [[1, 1], [1, 4]], [[1, 0, 0], [1, 0, 0]], 1)
    with pytest.raises(InputError, match=r"periods of at least 6\.02"):
        ker.play_gas(geo.Torus(6.0, 9.0), pair_of(ker.specular()), [[1, 1]], [[1, 0, 0]], 1)
    with pytest.raises(InputError, match="which has no walls"):
        ker.play_gas(geo.Torus(9, 9), pair_of(ker.specular()), [[1, 1]], [[1, 0, 0]], 1, ker.smooth(geo.Disk()))
    with pytest.raises(InputError, match="got disks 0 and 1 at 1"):
        ker.play_gas(geo.Torus(9, 9), pair_of(ker.specular()), [[0.5, 1], [8.5, 1]], np.ones((2, 3)), 1)


def test_pictures_of_a_torus_show_one_period():
    record = play(ker.specular(), None, 400, geo.Torus(9.0, 6.1), every=20)
    axes = record.animate(frames=3)._fig.axes[0]
    assert axes.get_xlim()[1] < 9.0 + 1.3 and np.ptp(record.position[..., 0]) > 18.0


def test_a_disk_at_the_edge_of_a_torus_has_images():
    pair, torus = pair_of(ker.specular()), geo.Torus(9.0, 7.0)
    still = ker.play_gas(torus, pair, [[0.2, 6.9], [4.0, 6.9]], [[0, 0, 0], [-1.0, 0, 0]], 1)
    for place, centres in (
        ([4.0, 3.0], [(4, 3)]),
        ([8.5, 3.0], [(8.5, 3), (-0.5, 3)]),
        ([0.2, 6.9], [(0.2, 6.9), (9.2, 6.9), (0.2, -0.1), (9.2, -0.1)]),
    ):
        assert {tuple(one) for one in still._images(np.array(place)).round(9).tolist()} == set(centres)
    # the corner between two images is not drawn: the disk does not reach it
    assert len(still._images(np.array([0.9, 0.9]))) == 3
    axes = still.animate(frames=2)._fig.axes[0]
    edge, spoke = (line.get_xydata() for line in axes.lines[-5:-3])
    assert np.isnan(edge[:, 0]).sum() == np.isnan(spoke[:, 0]).sum() == 3
    assert axes.get_xlim() == (-1.2, 10.2) and axes.get_ylim() == (-1.2, 8.2)


def test_states_for_which_there_is_no_memory_are_refused_before_the_run(monkeypatch):
    from asperity.kernels.billiards import gas as module

    made = []
    monkeypatch.setattr(module._Store, "fill", lambda *_: made.append(1))
    with pytest.raises(InputError, match=r"^duration over interval: the record takes .* GB of memory"):
        play(ker.specular(), None, 10**6, interval=1e-9)
    assert not made


def test_the_events_that_predict_the_number_of_states_change_no_bit():
    law = 0.5 * ker.lambertian() + 0.5 * ker.retroreflection()
    plain, timed = (play(law, ker.specular(), 300, **more) for more in ({"every": 300}, {"interval": 50.0}))
    assert np.array_equal(plain.position[-1], timed.position[-1]) and plain.time[-1, 0] == timed.time[-1, 0]


def test_a_phase_portrait_shows_the_collisions_with_walls():
    record = play(ker.retroreflection(), ARCS, 50, ROOM.closed())
    for kind in ("boundary", "velocity"):
        found = np.isfinite(record.phase_portrait(kind)[0])
        assert np.array_equal(found, record.wall[1:] >= 0) and 10 < found.sum() < 50
    with pytest.raises(InputError, match="container: expected a Container"):
        play(ker.specular(), None, 5, geo.Torus(9.0, 6.1)).phase_portrait("velocity")


def test_events_at_one_time_are_all_counted():
    room = geo.Container.polygon([(0, 0), (60, 0), (60, 60), (0, 60)])
    seats = np.array([(10.0, 10.0), (12.0, 10.0), (10.0, 40.0), (12.0, 40.0)])
    velocity = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)] * 2)
    for events in (1, 2):
        record = play(ker.specular(), None, events, room, seats, velocity)
        assert (
            record.time[:, 0].tolist() == [0.0] * (events + 1) and record.integrals[:, PAIRS].tolist() == [1.0] * events
        )
        assert record.statistics().temperature.value == pytest.approx(0.25)


@pytest.mark.parametrize("option", [{"every": 7}, {"interval": 0.4}], ids=str)
def test_a_checkpoint_goes_on_to_the_same_bits(option, tmp_path, monkeypatch):
    room = geo.Torus(9.0, 6.1)
    whole = play(ARCS, None, 2000, room, **option)
    run, calls = event_loop.EventLoop.run, []

    def stopped(self, *arguments):
        calls.append(arguments)
        if len(calls) in (300, 500):
            # as Ctrl-C, which the main thread notices while it waits
            interrupt_main()
            time.sleep(0.5)
        return run(self, *arguments)

    monkeypatch.setattr(event_loop.EventLoop, "run", stopped)
    record = play(ARCS, None, 2000, room, checkpoint=tmp_path / "gas", **option)
    assert record.stopped and len(calls) < 350 and len(record.integrals) < 400
    while record.stopped:
        record = play(ARCS, None, 2000, room, checkpoint=tmp_path / "gas", **option)
    assert len(calls) < 4000
    for name in ("time", "position", "angle", "velocity", "partner", "integrals", "marks", "collisions"):
        np.testing.assert_array_equal(getattr(record, name), getattr(whole, name))
    with pytest.raises(InputError, match="checkpoint of something else"):
        play(ARCS, None, 2001, room, checkpoint=tmp_path / "gas", **option)
