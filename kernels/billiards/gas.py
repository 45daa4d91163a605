"""A gas of equal rough disks in a container, simulated event by event."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Rng, check_memory, generator, instance, number_between, shaped, whole_number
from ...core.errors import AccuracyError, InputError
from ...core.estimates import Estimate, student_95
from ...core.long_runs import reported
from ...geometry import Container
from ...geometry.tables.boundary import FlightStatus
from ..collisions.collision_law import smooth
from .billiard import Reflector, check_inside, laws_of_walls, reflected
from .pair_law import PairLaw
from .record import BilliardRecord

# Depth, relative to the diameter, up to which two disks may overlap by rounding.
OVERLAP = 1e-9
# Numbers of batches of a mean over time, of which the one with the largest error counts: batches that depend on each
# other show a smaller error than longer ones. The fraction of the events before the first batch, and the least number
# of events in batches, per disk.
BATCHES, BURN_IN, FEWEST_EVENTS = (16, 8, 4), 0.2, 64


@dataclass(frozen=True, repr=False)
class GasRecord(BilliardRecord):
    """States of all disks of a gas after each event; the first entry of every array is the initial state.

    An event is a collision of one disk with a wall or of two disks with each other. The record ends before an event
    that is not resolved, after which the state of no disk would be known; ``status`` tells which disk it is. Beside the
    attributes of `BilliardRecord`, of which ``wall`` is -1 for disks that met no wall in the event:

    Attributes
    ----------
    partner : array of int, shape (events + 1, n)
        Index of the disk with which a disk collided in the event, -1 if with none.
    pair : PairLaw
    """

    partner: NDArray[np.int64]
    pair: PairLaw

    @property
    def radius(self) -> float:
        """The radius of the disks."""
        return self.disk.radius

    @property
    def rotational_energy(self) -> Floats:
        """The energy of all spins, J omega^2/2, shape (events + 1,)."""
        return np.asarray(0.5 * self.disk.rim_mass * np.sum(self.velocity[..., 2] ** 2, axis=1))

    def rotational_fraction(self, burn_in: float = BURN_IN) -> Estimate:
        """Estimate the fraction of the energy in rotation, as a mean over time; 1/3 in equipartition.

        Each disk has two degrees of freedom of translation and one of rotation. The mean is taken over time, not over
        events, because fast states have more of them.

        Parameters
        ----------
        burn_in : float
            Fraction of the events that do not count, in [0, 1).

        Returns
        -------
        Estimate
            The error is the largest half width of 95 % from the means over 16, 8 and 4 intervals with equally many
            events. It is inf for fewer than 64 events per disk after the burn-in.

        Raises
        ------
        InputError
            If ``burn_in`` is not in [0, 1).
        """
        burn_in = number_between("burn_in", burn_in, 0.0, 1.0, closed="low")
        duration, rotation = np.diff(self.time[:, 0]), self.rotational_energy[:-1] / float(self.energy[0].sum())
        first = int(burn_in * len(duration))
        duration, rotation = duration[first:], rotation[first:]
        if not len(duration):
            why = "initial state: no event after the burn-in"
            return Estimate(float(self.rotational_energy[0] / self.energy[0].sum()), math.inf, "estimate", why)
        value = float(rotation @ duration / duration.sum())
        needed = FEWEST_EVENTS * self.velocity.shape[1]
        if len(duration) < needed:
            why = (
                f"mean over {len(duration)} events after the burn-in; an error needs {needed}, {FEWEST_EVENTS} per disk"
            )
            return Estimate(value, math.inf, "estimate", why)
        error = max(_batch_error(duration, rotation - value, count) for count in BATCHES)
        return Estimate(value, error, "estimate", f"mean over time, 95 % from {BATCHES[0]} batches or fewer")


def _batch_error(duration: Floats, deviation: Floats, batches: int) -> float:
    """The half width of 95 % of a mean over time, from the mean deviations in batches of equally many events."""
    parts = np.array_split(np.arange(len(duration)), batches)
    sums = [deviation[part] @ duration[part] for part in parts]
    return student_95(batches) * float(np.std(sums, ddof=1)) * math.sqrt(batches) / float(duration.sum())


@reported("gas")
def play_gas(
    container: Container,
    pair: PairLaw,
    position: ArrayLike,
    velocity: ArrayLike,
    events: int,
    walls: Reflector | Sequence[Reflector] | None = None,
    rng: Rng = None,
) -> GasRecord:
    """Simulate equal disks that collide with each other and with the walls of a container, event by event.

    Parameters
    ----------
    container : Container
        The region of the centres.
    pair : PairLaw
        The law of collisions between disks, of two equal disks.
    position : array_like, shape (n, 2)
        Initial centres, inside the container, at least two radii of the disks apart.
    velocity : array_like, shape (n, 3)
        Initial (v1, v2, r omega).
    events : int
        Number of collisions, with walls and of pairs. Each costs some n operations on arrays.
    walls : Reflector or sequence of Reflector, optional
        The laws of the walls as in `play`; smooth walls by default.
    rng : None, int or numpy.random.Generator
        The result depends on the seed alone.

    Returns
    -------
    GasRecord

    Raises
    ------
    InputError
        If a shape is wrong, disks overlap or are outside, or the laws do not fit.
    AccuracyError
        If no disk meets anything any more.

    Notes
    -----
    In a closed container the dynamics preserves the uniform measure on the energy surface. Where energy is the only
    invariant, each of the 3 n quadratic terms then has the same mean, E/(3 n).

    Source: Rudzis 2022, sections 1.1.2 and 3, for the collision of two bodies; D. S. Broomhead and E. Gutkin (1993) for
    gases of no-slip disks.

    Examples
    --------
    Two no-slip disks that meet head on exchange their velocities:

    >>> from asperity import geometry as geo, kernels as ker
    >>> room = geo.Container.polygon([(0, 0), (10, 0), (10, 8), (0, 8)])
    >>> pair = ker.PairLaw(ker.retroreflection(), geo.Disk())
    >>> record = ker.play_gas(room, pair, [[2, 4], [8, 4]], [[1, 0, 0], [-1, 0, 0]], 1)
    >>> float(record.time[1, 0]), (record.velocity[1, :, 0].round(12) + 0.0).tolist()
    (2.0, [-1.0, 1.0])
    """
    instance("pair", pair, PairLaw, "ker.PairLaw(ker.retroreflection(), geo.Disk())")
    disk, other = pair.disks
    if disk != other:
        raise InputError("pair: expected the law of two equal disks")
    whole_number("events", events, 1)
    laws = laws_of_walls(container, smooth(disk) if walls is None else walls)
    if laws[0].disk != disk:
        raise InputError("walls: expected laws of the disk of the pair")
    located, moving = _start(container, position, velocity, 2.0 * disk.radius)
    check_memory("events", "the record", 10 * events * len(located))
    rng = generator(rng)
    gas = _Gas(container, pair, laws, located, moving)
    states = [gas.state()]
    while len(states) <= events and gas.next_event(rng):
        states.append(gas.state())
    time, place, angle, moving, met, partners = (np.stack(column) for column in zip(*states, strict=True))
    wall, partner = met.astype(np.int64), partners.astype(np.int64)
    made = np.sum((wall[1:] >= 0) | (partner[1:] >= 0), axis=0)
    for array in (time, place, angle, moving, wall, partner, made, gas.status):
        array.setflags(write=False)
    return GasRecord(container, disk, time, place, angle, moving, wall, made, gas.status, partner, pair)


def _start(container: Container, position: ArrayLike, velocity: ArrayLike, diameter: float) -> tuple[Floats, Floats]:
    """Return copies of centres (n, 2) and velocities (n, 3) of disks that do not overlap."""
    located = shaped("position", position, "n", 2).copy()
    moving = shaped("velocity", velocity, len(located), 3).copy()
    if not len(located):
        raise InputError("position: expected the centre of one disk at least, got none")
    check_inside(container, located)
    apart = np.hypot(*np.moveaxis(located[:, None] - located[None, :], -1, 0)) + np.diag(np.full(len(located), np.inf))
    if apart.min() < diameter * (1.0 - OVERLAP):
        first, second = (int(i) for i in np.unravel_index(np.argmin(apart), apart.shape))
        raise InputError(
            f"position: expected centres at least {diameter:g} apart, got disks {first} and {second} at {apart.min():g}"
        )
    return located, moving


class _Gas:
    """The present state, and the times of the next collision of every pair and of every disk with a wall."""

    def __init__(
        self, container: Container, pair: PairLaw, laws: list[Reflector], position: Floats, velocity: Floats
    ) -> None:
        self.container, self.pair, self.laws = container, pair, laws
        self.position, self.velocity = position, velocity
        n = len(position)
        self.now, self.angle = 0.0, np.zeros(n)
        self.last, self.wall, self.partner = (np.full(n, -1) for _ in range(3))
        self.pairs, self.walls = np.full((n, n), np.inf), np.full(n, np.inf)
        self.next_wall, self.ahead = np.full(n, -1), np.zeros(n, dtype=np.uint8)
        self.status = np.full(n, FlightStatus.FLYING, dtype=np.uint8)
        self.predict(np.arange(n))

    def state(self) -> tuple[Floats, ...]:
        """Copies of what a record stores of an event."""
        time = np.full(len(self.position), self.now)
        return tuple(map(np.copy, (time, self.position, self.angle, self.velocity, self.wall, self.partner)))

    def predict(self, disks: NDArray[np.int64]) -> None:
        """Compute the next collisions of these disks."""
        flight, self.next_wall[disks], self.ahead[disks] = self.container.next_wall(
            self.position[disks], self.velocity[disks], self.last[disks]
        )
        self.walls[disks] = self.now + flight
        for k in disks:
            times = self.now + meeting_times(
                self.position - self.position[k], self.velocity - self.velocity[k], 2.0 * self.pair.first.radius
            )
            times[k] = np.inf
            self.pairs[k], self.pairs[:, k] = times, times

    def next_event(self, rng: np.random.Generator) -> bool:
        """Move all disks to the next event, and collide; False, without a change, if the event is not resolved."""
        at_wall = int(np.argmin(self.walls))
        first, second = (int(i) for i in np.unravel_index(np.argmin(self.pairs), self.pairs.shape))
        then = float(min(self.walls[at_wall], self.pairs[first, second]))
        if not math.isfinite(then):
            raise AccuracyError("no disk meets a wall or another disk any more; is the container closed?", math.inf)
        hits_wall = bool(self.walls[at_wall] <= self.pairs[first, second])
        if hits_wall and self.ahead[at_wall] != FlightStatus.FLYING:
            self.status[at_wall] = self.ahead[at_wall]
            return False
        step = max(then - self.now, 0.0)
        self.position += self.velocity[:, :2] * step
        self.angle += self.velocity[:, 2] * (step / self.pair.first.radius)
        self.now = then
        self.wall[:], self.partner[:] = -1, -1
        if hits_wall:
            self.collide_with_wall(at_wall, rng)
            self.predict(np.array([at_wall]))
        else:
            self.collide_pair(first, second, rng)
            self.predict(np.array([first, second]))
        return True

    def collide_with_wall(self, disk: int, rng: np.random.Generator) -> None:
        """Collide one disk with the wall where it is."""
        wall = int(self.next_wall[disk])
        point = self.container.touch(wall, self.position[[disk]])
        self.position[disk] = point.position[0]
        self.velocity[disk] = reflected(point, self.laws[wall], self.velocity[[disk]], rng)[0]
        self.wall[disk] = self.last[disk] = wall

    def collide_pair(self, first: int, second: int, rng: np.random.Generator) -> None:
        """Collide two disks that touch."""
        between = self.position[first] - self.position[second]
        normal = between / np.hypot(*between)
        self.velocity[first], self.velocity[second] = self.pair.sample(
            normal, self.velocity[first], self.velocity[second], rng
        )
        self.partner[first], self.partner[second] = second, first
        # away from a curved wall, or along it: the same wall may be next
        self.last[[first, second]] = -1


def meeting_times(offset: Floats, velocity: Floats, distance: float) -> Floats:
    """Return the times (n,) at which relative positions (n, 2) approach to this distance, inf where they do not."""
    plane = velocity[:, :2]
    closing = -np.sum(offset * plane, axis=1)
    speed = np.sum(plane**2, axis=1)
    across = offset[:, 0] * plane[:, 1] - offset[:, 1] * plane[:, 0]
    excess = np.sum(offset**2, axis=1) - distance**2
    reach = distance * np.sqrt(speed)
    root = np.sqrt(np.maximum((reach - across) * (reach + across), 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        time = np.maximum(excess, 0.0) / (closing + root)
    return np.where((closing > 0.0) & (np.abs(across) <= reach), time, np.inf)
