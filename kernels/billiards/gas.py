"""A gas of equal rough disks in a container or a torus, simulated event by event."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checkpoints import Checkpoint, Stored, packed_arrays, unpacked_arrays
from ...core.checks import (
    Floats,
    Rng,
    check_memory,
    generator,
    instance,
    new_seed,
    number_between,
    positive_number,
    shaped,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import Estimate
from ...core.long_runs import Progress, progress_bar, report, reported
from ...core.version import __version__
from ...geometry import Container, Disk, Torus
from ...geometry.tables.boundary import FlightStatus
from ...geometry.tracing.threads import in_blocks, new_flag
from ..collisions.collision_law import smooth
from .billiard import Reflector, check_inside, laws_of_walls
from .gas_statistics import BURN_IN, DURATION, RIM2, RIM4, V4, GasStatistics, diffusion_rows, statistics_of
from .pair_law import PairLaw
from .record import BilliardRecord

if TYPE_CHECKING:
    from .event_loop import EventLoop

# Depth, relative to the diameter, up to which two disks may overlap by rounding.
OVERLAP = 1e-9
# Least periods of a torus, in diameters.
LEAST_PERIOD = 3.01
# Rows of integrals of a record, of which every 16th has positions in a torus; events between two looks at Ctrl-C.
ROWS, MARKED, TOGETHER = 1024, 16, 50_000
# Seconds between two writes into a checkpoint, and how much longer at least than a write they are.
SAVED, PATIENCE = 10.0, 20.0
# What is kept of a state.
# Events for each disk whose time predicts that of all.
PILOT = 8
STATES = ("time", "met", "position", "angle", "velocity")


@dataclass(frozen=True, repr=False)
class GasRecord(BilliardRecord):
    """States of all disks of a gas at some events or times; the first entry of every array is the initial state.

    An event is a collision of one disk with a wall or of two disks with each other. The record ends before an event
    that is not resolved, after which the state of no disk would be known; ``status`` tells which disk it is. The last
    entry is the last state. Positions in a torus are not reduced to one period. Beside the attributes of
    `BilliardRecord`, of which ``wall`` is -1 for disks that met no wall in the event of the entry:

    Attributes
    ----------
    partner : array of int, shape (entries, n)
        Index of the disk with which a disk collided in the event, -1 if with none.
    pair : PairLaw
    integrals : array, shape (rows, 7 + 2 walls)
        Of up to 1024 intervals with equally many events, over all events whatever is stored: the duration; the
        integrals over time of the sums of (r omega)^2, v1^4 + v2^4 and (r omega)^4; the numbers of collisions of pairs
        and with walls; the sum of distance times impulse of pairs; the normal and tangential impulse of each wall.
    marks : array, shape (m, n, 2)
        Positions after every 16 of these intervals, in a torus.
    stopped : bool
        Whether Ctrl-C ended the run.
    """

    container: Container | Torus  # type: ignore[assignment]
    partner: NDArray[np.int64]
    pair: PairLaw
    integrals: Floats
    marks: Floats
    stopped: bool = False

    @property
    def _at_walls(self) -> NDArray[np.bool_]:
        return self.wall[1:] >= 0

    def _seen(self, position: Floats) -> Floats:
        """In one period of a torus."""
        return position if isinstance(self.container, Container) else position % self.container.periods

    def _corners(self, seen: Floats) -> Floats:
        if isinstance(self.container, Container):
            return super()._corners(seen)
        return np.array([(0.0, 0.0), self.container.periods])

    def _images(self, position: Floats) -> Floats:
        """In a torus the images that lie in this period in part, of a disk with its centre in it."""
        if isinstance(self.container, Container):
            return position[None]
        periods = np.array(self.container.periods)
        all_images = position + np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2) * periods
        beyond = np.maximum(np.maximum(-all_images, all_images - periods), 0.0)
        return np.asarray(all_images[np.hypot(*beyond.T) < self.radius])

    @property
    def radius(self) -> float:
        """The radius of the disks."""
        return self.disk.radius

    @property
    def rotational_energy(self) -> Floats:
        """The energy of all spins, J omega^2/2, shape (entries,)."""
        return np.asarray(0.5 * self.disk.rim_mass * np.sum(self.velocity[..., 2] ** 2, axis=1))

    def rotational_fraction(self, burn_in: float = BURN_IN) -> Estimate:
        """Estimate the fraction of the energy in rotation, as a mean over time; 1/3 in equipartition.

        Each disk has two degrees of freedom of translation and one of rotation. The mean is taken over time, not over
        events, because fast states have more of them. It is that of `statistics`, as are its arguments and errors.
        """
        return self.statistics(burn_in).spin_fraction

    def statistics(self, burn_in: float = BURN_IN) -> GasStatistics:
        """Estimate means over time, exact over all events whatever is stored.

        Parameters
        ----------
        burn_in : float
            Fraction of the events that do not count, in [0, 1).

        Returns
        -------
        GasStatistics
            The error of each number is the largest half width of 95 % from the means over 16, 8 and 4 intervals with
            equally many events. It is inf for fewer than 64 events per disk after the burn-in.

        Raises
        ------
        InputError
            If ``burn_in`` is not in [0, 1).

        Examples
        --------
        >>> from asperity import geometry as geo, kernels as ker
        >>> seats = [(4.0 * i + 2.0, 4.0 * j + 2.0) for i in range(4) for j in range(4)]
        >>> velocity = np.random.default_rng(0).standard_normal((16, 3))
        >>> pair = ker.PairLaw(ker.retroreflection(), geo.Disk())
        >>> found = ker.play_gas(geo.Torus(16.0, 16.0), pair, seats, velocity, 20_000, every=20_000).statistics()
        >>> found.spin_fraction.error < 0.05, found.collision_rate.error < 0.05
        (True, True)
        """
        burn_in = number_between("burn_in", burn_in, 0.0, 1.0, closed="low")
        rows, n, mass = self.integrals, self.velocity.shape[1], self.disk.mass
        first = min(int(burn_in * len(rows)), max(len(rows) - 1, 0))
        displacements, drift, lengths, area = np.empty((0, 2)), 0.0, [], None
        if isinstance(self.container, Torus):
            time = np.concatenate([[0.0], np.cumsum(rows[:, DURATION])])[::MARKED][: len(self.marks)]
            used = -(-first // MARKED)
            if len(self.marks) - used > 2:
                displacements = diffusion_rows(self.marks[used:], time[used:])
            drift, area = 0.5 * mass * n * float(np.sum(self.velocity[0, :, :2].mean(axis=0) ** 2)), self.container.area
        else:
            table = self.container.closed()
            closed = not len(table.points) and table.has_outer_loop
            area = table.area if closed else None
            lengths = [curve.length for curve in table.curves] if closed else [math.inf] * table.wall_count
        rows = rows[first:]
        if not rows[:, DURATION].any():
            # no time has passed: the initial state for a moment
            v2, rims = self.velocity[0, :, :2] ** 2, self.velocity[0, :, 2] ** 2
            rows = np.zeros((1, rows.shape[1]))
            rows[0, [DURATION, RIM2, V4, RIM4]] = 1.0, rims.sum(), np.sum(v2**2), np.sum(rims**2)
        energy = float(self.energy[0].sum()), drift
        return statistics_of(rows, displacements, (n, mass, self.disk.rim_mass), energy, (area, lengths))


@reported("gas")
def play_gas(
    container: Container | Torus,
    pair: PairLaw,
    position: ArrayLike,
    velocity: ArrayLike,
    events: int,
    walls: Reflector | Sequence[Reflector] | None = None,
    rng: Rng = None,
    every: int = 1,
    interval: float | None = None,
    checkpoint: str | Path | None = None,
    key: str | None = None,
) -> GasRecord:
    """Simulate equal disks that collide with each other and with the walls of a container, event by event.

    Parameters
    ----------
    container : Container or Torus
        The region of the centres; a torus for quantities of a gas without walls.
    pair : PairLaw
        The law of collisions between disks, of two equal disks.
    position : array_like, shape (n, 2)
        Initial centres, inside the container, at least two radii of the disks apart.
    velocity : array_like, shape (n, 3)
        Initial (v1, v2, r omega).
    events : int
        Number of collisions, with walls and of pairs. Each takes some microseconds.
    walls : Reflector or sequence of Reflector, optional
        The laws of the walls as in `play`; smooth walls by default.
    rng : None, int or numpy.random.Generator
        The result depends on the seed alone, not on what is stored.
    every : int
        States are stored after every so many events, and at the end. A state takes 72 bytes for each disk.
    interval : float, optional
        A time after which a state is stored each time, for pictures, in place of ``every``.
    checkpoint : path, optional
        A file to which the state is written every ten seconds; the same call goes on with it, to the same bits.
    key : str, optional
        As of `asperity.spectral.sweep`.

    Returns
    -------
    GasRecord
        After Ctrl-C that of the events so far, with ``stopped``.

    Raises
    ------
    InputError
        If a shape is wrong, disks overlap or are outside, the torus is smaller than three diameters, the laws do not
        fit, or the checkpoint is of another gas.
    AccuracyError
        If no disk meets anything any more, or too many rays do not escape from a rough wall.

    Notes
    -----
    In a closed container the dynamics preserves the uniform measure on the energy surface. Where energy is the only
    invariant, each of the 3 n quadratic terms then has the same mean, E/(3 n). In a torus the momentum of n disks is
    kept too, and the fraction of the energy in rotation is n/(3 n - 2) if it vanishes.

    Specular, no-slip and Lambertian laws, those of walls and mixtures of these take part in the compiled loop: a few
    hundred thousand events a second. Others are asked for each collision, and take some 0.1 ms.

    Source: Rudzis 2022, sections 1.1.2 and 3, for the collision of two bodies; D. S. Broomhead and E. Gutkin (1993) for
    gases of no-slip disks; B. D. Lubachevsky (1991) for one event a disk.

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
    whole_number("every", every, 1)
    wanted = math.inf if interval is None else positive_number("interval", interval)
    laws = _laws(container, disk, walls)
    located = shaped("position", position, "n", 2).copy()
    moving = shaped("velocity", velocity, len(located), 3).copy()
    if not len(located):
        raise InputError("position: expected the centre of one disk at least, got none")
    if isinstance(container, Container):
        check_inside(container, located)
    check_memory("events", "the record", 9 * len(located) * (events // every + 2 if interval is None else 2))
    _check_apart(located, container, 2.0 * disk.radius)
    from .event_loop import EventLoop

    root = new_seed(generator(rng))
    identity = {
        "computation": "gas", "version": __version__, "container": container, "pair": pair, "walls": tuple(laws),
        "position": located, "velocity": moving, "events": events, "every": every, "interval": wanted,
        "seed": root,
    }  # fmt: skip
    loop = EventLoop(container, pair.law, laws, disk, located, moving, np.random.default_rng(root))
    if interval is not None:
        _check_states(loop, events, wanted)
    store = _Store(loop, events, every if interval is None else events + 1, wanted)
    store.fill(lambda: nullcontext() if checkpoint is None else Checkpoint(checkpoint, identity, key=key))
    return store.record(container, pair)


def _laws(container: Container | Torus, disk: Disk, walls: Reflector | Sequence[Reflector] | None) -> list[Reflector]:
    """The laws of the walls, of the disk of the pair."""
    if isinstance(container, Torus):
        least = 2.0 * LEAST_PERIOD * disk.radius
        if min(container.periods) < least:
            raise InputError(
                f"container: expected a torus with periods of at least {least:g}, {LEAST_PERIOD:g} diameters, got "
                f"{container!r}; take a larger one or fewer disks"
            )
        if walls is not None:
            raise InputError("walls: expected None in a torus, which has no walls")
        return []
    laws = laws_of_walls(container, smooth(disk) if walls is None else walls)
    if laws[0].disk != disk:
        raise InputError("walls: expected laws of the disk of the pair")
    return laws


def _check_states(loop: EventLoop, events: int, interval: float) -> None:
    """Refuse states for which there is no memory, by the time of the first events, which are made and forgotten."""
    begun = {name: array.copy() for name, array in loop.snapshot().items()}
    loop.run(min(events, PILOT * len(loop.floats)))
    states = loop.time * events / max(loop.events, 1) / interval
    check_memory("duration over interval", "the record", int(min(9.0 * len(loop.floats) * states, 1e30)))
    loop.restore(begun)


def _check_apart(located: Floats, container: Container | Torus, diameter: float) -> None:
    """Raise an InputError if two disks overlap."""
    from scipy.spatial import cKDTree

    periods = container.periods if isinstance(container, Torus) else None
    points = located if periods is None else located % periods
    # rounding may reach the period
    points = points if periods is None else np.where(points < periods, points, 0.0)
    tree: Any = cKDTree
    apart, nearest = tree(points, boxsize=periods).query(points, k=2)
    if apart[:, 1].min() < diameter * (1.0 - OVERLAP):
        first = int(apart[:, 1].argmin())
        second, distance = int(nearest[first, 1]), apart[first, 1]
        raise InputError(
            f"position: expected centres at least {diameter:g} apart, got disks {first} and {second} at {distance:g}"
        )


class _Store:
    """What is kept of a gas, in lists of rows: states, integrals, and positions in a torus."""

    def __init__(self, loop: EventLoop, events: int, every: int, interval: float) -> None:
        self.loop, self.events, self.every, self.interval = loop, events, every, interval
        self.in_torus = len(loop.laws) == 1
        self.states, self.integrals, self.marks = [(0.0, loop.last, *loop.state())], [loop.integrals], list[Floats]()
        self.mark()
        # events at the last row of integrals, and at the last state
        self.counted = self.kept = 0
        self.stopped, self.status = False, np.full(len(loop.floats), FlightStatus.FLYING, dtype=np.uint8)

    def fill(self, file: Callable[[], AbstractContextManager[Checkpoint | None]]) -> None:
        """Make the events in another thread, until Ctrl-C or an event that is not resolved."""
        flag, ended = new_flag(), Event()

        def work(_: slice) -> None:
            try:
                with file() as opened, progress_bar(self.events, "event", "gas") as progress:
                    self.make(progress, opened, flag)
            finally:
                ended.set()

        try:
            in_blocks(work, 1, 1, stop=flag)
        except KeyboardInterrupt:
            ended.wait()
            self.stopped = True
            report(f"gas: stopped after {self.loop.events} of {self.events} events; the record has them")
        if self.counted < self.loop.events:
            self.count()
        if self.kept < self.loop.events:
            self.keep(self.loop.time, self.loop.last)

    def make(self, progress: Progress, file: Checkpoint | None, flag: NDArray[np.int64]) -> None:
        """Make the events after those of the checkpoint, and keep what is wanted."""
        from ...geometry.collisions.compiled.gas import UNRESOLVED

        loop, edges, code = self.loop, np.unique(np.arange(1, ROWS + 1) * self.events // ROWS), -1
        if file is not None:
            self.restore(file)
            progress.update(loop.events)
        due = monotonic() + SAVED
        while loop.events < self.events and code != UNRESOLVED and not flag[0]:
            made, edge = loop.events, int(edges[np.searchsorted(edges, loop.events, side="right")])
            code = self.reach(min(edge, (made // self.every + 1) * self.every, made + TOGETHER))
            progress.update(loop.events - made)
            if code == UNRESOLVED:
                self.status = loop.unresolved_status()
            elif loop.events == edge:
                self.count()
                self.mark()
            if code != UNRESOLVED and loop.events % self.every == 0:
                self.keep(loop.time, loop.last)
            if file is not None and monotonic() > due:
                begun = monotonic()
                self.save(file)
                due = monotonic() + max(SAVED, PATIENCE * (monotonic() - begun))
        if file is not None:
            self.save(file)

    def save(self, file: Checkpoint) -> None:
        """Store all that is kept, and the state of the loop."""
        states = dict(zip(STATES, map(np.array, zip(*self.states, strict=True)), strict=True))
        marks = np.reshape(self.marks, (-1, len(self.loop.floats), 2))
        kept = {"integrals": self.integrals, "marks": marks, "counts": [self.counted, self.kept]}
        file.put("gas", packed_arrays({**self.loop.snapshot(), **states, **kept}), now=True)

    def restore(self, file: Checkpoint) -> None:
        """Go on from what is stored."""
        for _, arrays in file.parts(lambda _, content: self.read(content)):
            self.states = list(zip(*(arrays[name] for name in STATES), strict=True))
            self.integrals, self.marks = list(arrays["integrals"]), list(arrays["marks"])
            self.counted, self.kept = arrays["counts"].tolist()
            self.loop.restore(arrays)

    def read(self, content: bytes) -> dict[str, NDArray[Any]]:
        """The arrays of a part; raises an error if they are not those of such a gas."""
        n, most = len(self.loop.floats), max(len(self.loop.floats), len(self.loop.laws))
        expected = {
            **self.loop.stored(), "time": Stored("f", (None,), 0.0), "met": Stored("i", (None, 3), -1, most - 1),
            "position": Stored("f", (None, n, 2)), "angle": Stored("f", (None, n)),
            "velocity": Stored("f", (None, n, 3)), "integrals": Stored("f", (None, len(self.integrals[0]))),
            "marks": Stored("f", (None, n, 2)), "counts": Stored("i", (2,), 0, self.events),
        }  # fmt: skip
        arrays = unpacked_arrays(content, expected)
        if len({len(arrays[name]) for name in STATES}) > 1:
            raise ValueError("states of different numbers")
        self.loop.check(arrays, self.events)
        json.loads(arrays["rng"].tobytes())
        return arrays

    def mark(self) -> None:
        """Keep the positions in a torus after every 16th row of integrals."""
        if self.in_torus and (len(self.integrals) - 1) % MARKED == 0:
            self.marks.append(self.loop.state()[0])

    def count(self) -> None:
        """Keep the integrals up to the last event."""
        self.integrals.append(self.loop.integrals)
        self.counted = self.loop.events

    def reach(self, stop: int) -> int:
        """Make events up to this number, and keep the states at the times that are passed; why it ended."""
        from ...geometry.collisions.compiled.gas import TIME

        while True:
            stored = len(self.states)
            code = self.loop.run(stop, stored * self.interval)
            if code != TIME:
                return code
            if stored & (stored - 1) == 0:
                check_memory("duration over interval", "the record", 18 * len(self.loop.floats) * stored)
            self.keep(stored * self.interval, [-1, -1, -1], stored * self.interval)

    def keep(self, time: float, met: list[int], at: float | None = None) -> None:
        """Keep the state after an event, or at a time."""
        self.states.append((time, met, *self.loop.state(at)))
        self.kept = self.loop.events if at is None else self.kept

    def record(self, container: Container | Torus, pair: PairLaw) -> GasRecord:
        """The record of what was kept."""
        shape, columns = (len(self.states), len(self.loop.floats)), zip(*self.states, strict=True)
        times, events, position, angle, velocity = map(np.array, columns)
        time = np.broadcast_to(times[:, None], shape)
        wall, partner = np.full(shape, -1), np.full(shape, -1)
        disk, other, met = events.T
        for of, what, value in ((disk, partner, other), (other, partner, disk), (disk, wall, met)):
            rows = np.flatnonzero(of >= 0)
            what[rows, of[rows]] = value[rows]
        integrals, made = np.diff(self.integrals, axis=0), self.loop.collisions
        marks = np.array(self.marks).reshape(-1, shape[1], 2)
        for array in (position, angle, velocity, wall, partner, made, self.status, integrals, marks):
            array.setflags(write=False)
        found = time, position, angle, velocity, wall, made, self.status, partner, pair, integrals, marks
        return GasRecord(container, pair.first, *found, self.stopped)
