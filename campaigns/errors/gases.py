"""Gases of rough disks: the compiled loop against a plain one, kinetic theory, and the errors of means over time.

The theory: the virial coefficients of hard disks and Enskog's rate of collisions at contact; equipartition on the
energy surface of a torus, of 3 n - 2 dimensions because the momentum vanishes; and the spin that no-slip collisions
give to disks that do not spin, 2 K/(1 + K)^2 of k T with K = J/(m r^2), from the impulse (1 + K)^-1 K m slip / 2.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.core.estimates import NORMAL_95
from asperity.kernels.billiards.event_loop import EventLoop
from campaigns.cases.gases import ROOMS, on_a_lattice, pair_of, scattered
from campaigns.engine import Campaign, Judged
from campaigns.judges.plain_gas import PlainGas, plain_law

# Events in which the trajectories of the loop and of the judge are compared; rounding grows about fivefold in each.
COMPARED, AGREES = 6, 1e-12
EVENTS, KEPT, APART = 10**6, 1e-12, 1e-13
# Packing fraction, and Z = p A/(n k T) by the virial series with nine terms.
EQUATION_OF_STATE = {0.02: 1.04129, 0.1: 1.23614, 0.3: 2.06316}
ENSKOG = 0.005
RATIOS = (0.2, 0.5, 1.0)
NO_SLIP, ARCS = ker.retroreflection(), ker.WallLaw(geo.focusing_arcs(1.2))


def exact_cases(number: int) -> Iterator[Judged]:
    """A gas beside the judge in a room, a row of touching disks, or a long run."""
    rng = np.random.default_rng([61, number])
    if number % 3 == 0:
        yield from beside_the_judge(list(ROOMS)[number // 3 % len(ROOMS)], rng)
    elif number % 3 == 1:
        yield row(int(rng.integers(2, 10)), rng)
    else:
        yield from long_run(number // 3, rng)


def beside_the_judge(name: str, rng: np.random.Generator) -> Iterator[Judged]:
    room, ratio, radius = ROOMS[name], float(rng.uniform(0.1, 1.0)), float(rng.choice([0.5, 0.7, 1.0]))
    seats, velocity = scattered(room, 6, rng, 2.0 * radius)
    kinds = rng.choice([1.0, -1.0], 2)
    laws = [ker.specular() if kind > 0.0 else ker.retroreflection() for kind in kinds]
    pair = pair_of(laws[0], ratio, radius)
    record = ker.play_gas(room, pair, seats, velocity, COMPARED, ker.CollisionLaw(laws[1], pair.first))
    wall = plain_law(kinds[1], ratio, True)
    judge = PlainGas(room, plain_law(kinds[0], ratio, False), [wall] * room.wall_count, 2.0 * radius, seats, velocity)
    for _ in range(COMPARED):
        judge.next_event()
    size = float(np.abs(judge.position).max())
    for kind, found, wanted in (
        ("positions", record.position[-1] / size, judge.position / size),
        ("velocities", record.velocity[-1], judge.velocity),
        ("time", record.time[-1, 0], judge.now),
    ):
        yield Judged(f"{kind} beside the judge", AGREES, float(np.abs(found - wanted).max()))


def row(n: int, rng: np.random.Generator) -> Judged:
    """Touching disks, the faster ones behind, make n (n - 1)/2 collisions and exchange their velocities."""
    turn, gap = rng.uniform(0.1, 1.4), float(rng.choice([0.0, 1e-13, -1e-13, 1e-16]))
    along, speed = np.array([math.cos(turn), math.sin(turn)]), np.sort(rng.uniform(0.1, 2.0, n))[::-1]
    room = geo.Container.polygon([(0, 0), (1e5, 0), (1e5, 1e5), (0, 1e5)])
    velocity = np.column_stack([speed[:, None] * along, np.zeros(n)])
    law = [ker.specular(), NO_SLIP][int(rng.integers(2))]
    record = ker.play_gas(room, pair_of(law), 50.0 + np.arange(n)[:, None] * (2.0 + gap) * along, velocity, n * n)
    first_wall = int(np.argmax(record.wall.max(axis=1) >= 0))
    return Judged("collisions of a touching row", 0.0, abs(first_wall - 1.0 - n * (n - 1) / 2))


def long_run(number: int, rng: np.random.Generator) -> Iterator[Judged]:
    """A million events of 200 disks in a torus or a box, thin or dense, no-slip or with rough walls."""
    fraction, law, in_torus = (0.2, 0.6)[number % 2], (NO_SLIP, ARCS)[number // 2 % 2], number // 4 % 2 == 0
    side, seats, velocity = on_a_lattice(200, fraction, 0.5, rng)
    pair = pair_of(law)
    room = geo.Torus(side, side) if in_torus else geo.Container.polygon([(0, 0), (side, 0), (side, side), (0, side)])
    walls = [] if in_torus else [ker.CollisionLaw(law, pair.first)] * 4
    loop = EventLoop(room, law, walls, pair.first, seats, velocity, rng)
    least, energy = math.inf, float(np.sum(velocity**2 * [1.0, 1.0, 0.5]))
    for made in range(EVENTS // 20, EVENTS + 1, EVENTS // 20):
        loop.run(made)
        tree = cKDTree(loop.state()[0] % side if in_torus else loop.state()[0], boxsize=side if in_torus else None)
        least = min(least, float(tree.query(tree.data, k=2)[0][:, 1].min()) / 2.0 - 1.0)
    found = float(np.sum(loop.state()[2] ** 2 * [1.0, 1.0, 0.5]))
    yield Judged("energy after 10^6 events", KEPT, abs(found / energy - 1.0))
    yield Judged("overlap after 10^6 events", APART, max(0.0, -least))


def theory(number: int) -> Iterator[Judged]:
    """The equation of state, the rate of collisions and equipartition of a gas in a torus, or the gain of spin."""
    rng = np.random.default_rng([6100, number])
    if number % 4 == 3:
        yield spin_gain(RATIOS[number // 4 % len(RATIOS)], rng)
        return
    fraction, n = list(EQUATION_OF_STATE)[number % 4], 2000 if number >= 12 else 500
    side, seats, velocity = on_a_lattice(n, fraction, 0.5, rng)
    events = 1000 * n
    found = ker.play_gas(geo.Torus(side, side), pair_of(NO_SLIP), seats, velocity, events, rng=rng, every=events)
    means, z = found.statistics(), EQUATION_OF_STATE[fraction]
    temperature, dense = means.temperature.value, n / side**2
    # by the virial over the energy of translation
    packed = means.pressure.value * side**2 / ((n - 1) * temperature)
    error = means.pressure.error * side**2 / ((n - 1) * temperature)
    yield Judged("equation of state", error, abs(packed - z))
    rate = 2.0 * math.sqrt(math.pi * temperature) * dense * 2.0 * (z - 1.0) / (2.0 * fraction)
    off = abs(means.collision_rate.value / rate * n / (n - 1) - 1.0)
    yield Judged("Enskog's rate within .5 %", ENSKOG, off, means.collision_rate.error / rate)
    yield Judged("equipartition", means.spin_fraction.error, abs(means.spin_fraction.value - n / (3.0 * n - 2.0)))


def spin_gain(ratio: float, rng: np.random.Generator) -> Judged:
    """The mean spin energy from first collisions of no-slip disks that do not spin, after an equilibrium of places."""
    n, gains, temperature = 2000, [], 1.0
    side, seats, velocity = on_a_lattice(n, 0.1, ratio, rng, spin=False)
    smooth, rough, room = pair_of(ker.specular(), ratio), pair_of(NO_SLIP, ratio), geo.Torus(side, side)
    for number in range(80):
        events = (2 if number else 40) * n
        calm = ker.play_gas(room, smooth, seats, velocity, events, every=events)
        seats, velocity = calm.position[-1], calm.velocity[-1] * [1.0, 1.0, 0.0]
        temperature = float(np.sum(velocity[:, :2] ** 2)) / (2.0 * (n - 1))
        # few enough that the fast disks, which collide first, are not missing among the later ones
        record = ker.play_gas(room, rough, seats, velocity, n // 50)
        seen: set[int] = set()
        for k in range(1, len(record.time)):
            met = np.flatnonzero(record.partner[k] >= 0).tolist()
            if not seen.intersection(met):
                gains.append(float(np.sum(0.5 * ratio * record.velocity[k, met, 2] ** 2)) / temperature)
            seen.update(met)
    error = NORMAL_95 * float(np.std(gains, ddof=1)) / math.sqrt(len(gains))
    return Judged("spin gained from cold spins", error, abs(float(np.mean(gains)) - 2.0 * ratio / (1.0 + ratio) ** 2))


def coverage(number: int) -> Iterator[Judged]:
    """Means of short runs in a torus, of which the exact values are those of a sphere of 3 n - 2 dimensions."""
    rng, n = np.random.default_rng([61000, number]), (8, 32)[number % 2]
    events, dimension = n * (160, 640)[number // 2 % 2], 3 * n - 2
    side, seats, velocity = on_a_lattice(n, 0.2, 0.5, rng)
    velocity *= math.sqrt(dimension / float(np.sum(velocity**2 * [1.0, 1.0, 0.5])))
    means = ker.play_gas(
        geo.Torus(side, side), pair_of(NO_SLIP), seats, velocity, events, rng=rng, every=events
    ).statistics()
    exact = {
        "spin_fraction": n / dimension, "temperature": 1.0,
        "velocity_kurtosis": 3.0 * dimension / (dimension + 2.0), 
        "spin_kurtosis": 3.0 * dimension / (dimension + 2.0),
    }  # fmt: skip
    for name, value in exact.items():
        found = getattr(means, name)
        yield Judged(name, found.error, abs(found.value - value))


CAMPAIGNS = (
    Campaign(
        "gas-loop", "Does the compiled loop of a gas keep what is exact, and agree with a plain gas?", int, exact_cases,
        cases=63, small=(0, 3, 9, 18, 1, 4, 7),
    ),
    Campaign(
        "gas-theory", "Does a gas of rough disks have the numbers of kinetic theory?", int, theory, cases=48,
        small=(0, 2), level=0.95,
    ),
    Campaign(
        "gas-coverage", "Do the errors of means over time of a gas hold in 95 % of runs?", int, coverage, cases=400,
        small=tuple(range(16)), level=0.95,
    ),
)  # fmt: skip
