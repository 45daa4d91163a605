"""The motion of a disk in a container, with any collision laws of its walls, which may change along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, Unpack, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checkpoints import Stored
from ...core.checks import (
    Floats,
    Rng,
    check_memory,
    finite_array,
    generator,
    instance,
    new_seed,
    shaped,
    shortened,
    whole_number,
)
from ...core.errors import InputError
from ...core.estimates import Summary
from ...core.given import seed_by_name
from ...core.long_runs import Engine, all_parts, identity_of, reported
from ...geometry import Container, Disk
from ...geometry.tables.boundary import FlightStatus, Touch
from ..collisions.collision_law import CollisionLaw
from ..collisions.satellite_law import SatelliteLaw
from ..laws.law import Law
from ..laws.sums import outcomes_of
from ..positions.position_law import PositionLaw
from .record import BilliardRecord

# Relative change of the energy of a disk at a wall that is rounding.
SAME_ENERGY = 1e-9
# Disks of a part: their random numbers depend on its number alone.
TOGETHER = 1024


@runtime_checkable
class Reflector(Protocol):
    """Protocol for the collision law of one wall of a container, met by `CollisionLaw` and `SatelliteLaw`."""

    @property
    def disk(self) -> Disk: ...

    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Outgoing (v1, v2, r omega) with v2 > 0, of equal energy, for incoming ones with v2 < 0; the wall is below."""
        ...


@reported("billiard")
def play(
    container: Container,
    laws: Reflector | CollisionAlongWall | Sequence[Reflector | CollisionAlongWall],
    position: ArrayLike,
    velocity: ArrayLike,
    collisions: int,
    rng: Rng = None,
    **engine: Unpack[Engine],
) -> BilliardRecord:
    """Simulate disks that move in a container and collide with its walls.

    Parameters
    ----------
    container : Container
        The region of the centres.
    laws : Reflector or sequence of Reflector
        One law for all walls or one per wall, all for the same disk: ``no_slip(disk)``, ``smooth(disk)``,
        ``CollisionLaw.from_wall(wall, disk)`` for a rough wall, ``CollisionLaw(law, disk)`` for a law of angles. Each
        law is applied in coordinates in which its wall is below the disk. ``CollisionAlongWall(law, disk)`` is for a
        wall whose roughness changes along it.
    position : array_like, shape (n, 2) or (2,)
        Initial centres, inside the container.
    velocity : array_like, shape (n, 3) or (3,)
        Initial (v1, v2, r omega). One position is repeated for many velocities, and the other way round.
    collisions : int
        Number of collisions per disk.
    rng : None, int or numpy.random.Generator
    checkpoint : path, optional
        A file to which the states of every 1024 disks are added; the same call goes on with it.
    client : int, str or distributed.Client, optional
        As of `asperity.spectral.sweep`. The record is the same to the last bit without checkpoint and workers.
    key : str, optional
        As of `asperity.spectral.sweep`.

    Returns
    -------
    BilliardRecord

    Raises
    ------
    InputError
        If a shape is wrong, a centre is outside, a law is one of angles, or the laws do not match the walls; if a law
        of your own returns no velocities, some into the wall, or some of another energy; if the checkpoint is of
        another simulation.

    Notes
    -----
    A curved wall is curved on a scale far larger than its roughness: the law acts as on the tangent of the wall.

    Examples
    --------
    Between a no-slip floor and ceiling, a disk without initial spin moves back and forth:

    >>> import numpy as np
    >>> from asperity import geometry as geo, kernels as ker
    >>> no_slip = ker.no_slip(geo.Disk(1.0, 1.0))
    >>> record = ker.play(geo.Container.strip(), no_slip, [0.0, 0.0], [1.0, 1.0, 0.0], 4)
    >>> record.position[:, 0, 0].round(12).tolist()
    [0.0, 1.0, 1.0, 0.0, 0.0]

    A smooth disk in a round room, from wall to wall along a square:

    >>> record = ker.play(geo.Container.circle(1.0), ker.smooth(geo.Disk()), [1.0, 0.0], [-1.0, 1.0, 0.0], 4)
    >>> (record.position[1:, 0].round(12) + 0.0).tolist()
    [[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]]
    """
    root = new_seed(generator(rng))
    whole_number("collisions", collisions, 1)
    check_memory("collisions", "the record", 8 * collisions)
    each = laws_of_walls(container, laws, CollisionAlongWall)
    for k, law in enumerate(each):
        if isinstance(law, CollisionAlongWall):
            law.check_wall(container, k)
    disk = each[0].disk
    located, moving = _starts(container, position, velocity)
    job = _Disks(container, tuple(each), located, moving, collisions, root)
    parts = all_parts(
        job.states, -(-len(located) // TOGETHER), identity_of("disks between walls", job), engine, job.stored
    )
    columns = {name: np.concatenate([part[name] for part in parts], axis=-1 if parts[0][name].ndim == 1 else 1)
               for name in parts[0]}  # fmt: skip
    for array in columns.values():
        array.setflags(write=False)
    return BilliardRecord(container, disk, **columns)


@dataclass(frozen=True, eq=False)
class _Disks:
    """Disks in a container, ``TOGETHER`` of them at a time; what a worker is sent."""

    container: Container
    laws: tuple[Reflector | CollisionAlongWall, ...]
    position: Floats
    velocity: Floats
    collisions: int
    seed: tuple[int, ...]

    def stored(self, part: int) -> dict[str, Stored]:
        """What the columns of a part must be."""
        shape = self.collisions + 1, min(TOGETHER, len(self.position) - part * TOGETHER)
        return {
            "time": Stored("f", shape, 0.0), "position": Stored("f", (*shape, 2)), "angle": Stored("f", shape),
            "velocity": Stored("f", (*shape, 3)), "wall": Stored("i", shape, -1, len(self.laws) - 1),
            "collisions": Stored("i", shape[1:], 0, self.collisions),
            "status": Stored("u", shape[1:], 0, max(FlightStatus)),
        }  # fmt: skip

    def states(self, part: int) -> dict[str, NDArray[Any]]:
        """The columns of the record for the disks of one part, whose random numbers depend on its number alone."""
        rng = np.random.default_rng([*self.seed, part])
        own = slice(part * TOGETHER, (part + 1) * TOGETHER)
        located, moving = self.position[own].copy(), self.velocity[own].copy()
        n = len(located)
        time, angle, last = np.zeros(n), np.zeros(n), np.full(n, -1)
        made, status = np.zeros(n, dtype=np.int64), np.full(n, FlightStatus.FLYING, dtype=np.uint8)
        state = (time, located, angle, moving, last)
        states = [tuple(map(np.copy, state))]
        for _ in range(self.collisions):
            rows = np.flatnonzero(status == FlightStatus.FLYING)
            flight, wall, status[rows] = self.container.next_wall(located[rows], moving[rows], last[rows])
            for k, law in enumerate(self.laws):
                own = (wall == k) & (status[rows] == FlightStatus.FLYING)
                here, step = rows[own], flight[own]
                if not here.size:
                    continue
                point = self.container.touch(k, located[here] + moving[here, :2] * step[:, None])
                if isinstance(law, CollisionAlongWall):
                    x = law.coordinate(self.container, k, point.position)
                    after = point.outgoing(law.sample_at(x, point.incoming(moving[here]), rng=rng))
                else:
                    after = reflected(point, law, moving[here], rng)
                found = np.all(np.isfinite(after), axis=1)
                status[here[~found]] = FlightStatus.UNREFLECTED
                here, step = here[found], step[found]
                time[here], angle[here] = time[here] + step, angle[here] + moving[here, 2] * (step / law.disk.radius)
                located[here], moving[here], last[here] = point.position[found], after[found], k
                made[here] += 1
            states.append(tuple(map(np.copy, state)))
        columns = [np.stack(column) for column in zip(*states, strict=True)]
        return {
            "time": columns[0], "position": columns[1], "angle": columns[2], "velocity": columns[3],
            "wall": columns[4].astype(np.int64), "collisions": made, "status": status,
        }  # fmt: skip


def laws_of_walls(container: Container, laws: Any, *others: type) -> list[Any]:
    """The law of every wall, a `Reflector` or of one of the other types.

    Raises an InputError if they do not match the walls or belong to two disks.
    """
    instance("container", container, Container, "geo.Container.circle()")
    walls = container.wall_count
    each = list(laws) if isinstance(laws, Sequence) else [laws] * walls
    for law in each:
        if isinstance(law, Law):
            raise InputError(
                f"laws: expected collision laws, got {shortened(law)}, a law of angles, which does not know the disk; "
                f"pass ker.CollisionLaw(law, disk), or ker.smooth(disk) and ker.no_slip(disk) for specular reflection "
                "and retroreflection"
            )
    if not all(isinstance(law, (Reflector, *others)) for law in each):
        raise InputError(f"laws: expected collision laws such as ker.CollisionLaw(law, disk), got {shortened(laws)}")
    if len(each) != walls:
        raise InputError(f"laws: expected one law or one for each of the {walls} walls, got {len(each)}")
    if any(law.disk != each[0].disk for law in each):
        raise InputError("laws: expected laws of the same disk")
    return each


def _starts(container: Container, position: ArrayLike, velocity: ArrayLike) -> tuple[Floats, Floats]:
    """Return centres (n, 2) inside the container and velocities (n, 3), repeated to the same length."""
    located, moving = np.atleast_2d(finite_array("position", position)), finite_array("velocity", velocity)
    if located.ndim != 2 or located.shape[1] != 2:
        raise InputError(f"position: expected shape (n, 2) or (2,), got {np.shape(position)}")
    n = len(located) if len(located) != 1 or moving.ndim != 2 else len(moving)
    if moving.ndim not in (1, 2) or moving.shape[-1] != 3 or (moving.ndim == 2 and len(moving) not in (1, n)):
        raise InputError(f"velocity: expected shape ({n}, 3) for (v1, v2, r omega), got {moving.shape}")
    check_inside(container, located)
    return np.broadcast_to(located, (n, 2)).copy(), np.broadcast_to(moving, (n, 3)).copy()


def check_inside(container: Container, centres: Floats) -> None:
    """Raise an InputError unless all centres are in the container."""
    inside = container.contains(centres)
    if not inside.all():
        raise InputError(f"position: expected centres in the container, got {centres[int(np.argmin(inside))].tolist()}")


def reflected(point: Touch, law: Reflector, moving: Floats, rng: np.random.Generator) -> Floats:
    """Velocities (n, 3) after a collision with a wall at these points; nan where a true disk has none.

    Raises an InputError if a law does not return velocities away from the wall with the energy of the incoming ones.
    """
    incoming = point.incoming(moving)
    if isinstance(law, SatelliteLaw):
        return point.outgoing(law.attempt(incoming, rng))
    outgoing = shaped(f"laws: what {shortened(law)} returns", law.sample(incoming.copy(), rng), len(incoming), 3)
    before, after = (law.disk.inner(w, w) for w in (incoming, outgoing))
    wrong = ~((outgoing[:, 1] > 0.0) & (np.abs(after - before) <= SAME_ENERGY * before))
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(
            f"laws: expected velocities (v1, v2, r omega) with v2 > 0 and the energy {0.5 * before[k]:.10g} of the "
            f"incoming {incoming[k].tolist()}, got {outgoing[k].tolist()} of energy {0.5 * after[k]:.10g} from "
            f"{shortened(law)} at {point.position[k].tolist()}; the wall is below in these coordinates"
        )
    return point.outgoing(outgoing)


# Arc lengths have rounding errors of this size, relative to that of the wall.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class CollisionAlongWall(Summary):
    r"""The collision law delta_x (x) P~(x, .) (x) delta_{pi - psi} of a disk and a wall whose cell changes along it.

    Parameters
    ----------
    law : PositionLaw
        P~(x, .), already that of the foreshortened walls. On a curve of a container x is the arc length from the start
        of the curve, and the edges run from 0 to its length. On a straight wall without ends x is the coordinate along
        the tangent from the point of the wall, and the law is repeated periodically.
    disk : Disk

    Raises
    ------
    InputError
        If an argument is not as described.

    Source: Rudzis 2022, sections 1.2.5 and 1.3.7.

    Examples
    --------
    A floor that is smooth for x < 1 and no-slip beyond:

    >>> from asperity import geometry as geo, kernels as ker
    >>> floor = ker.PositionLaw([0.0, 1.0, 2.0], [ker.specular(), ker.retroreflection()])
    >>> K = ker.CollisionAlongWall(floor, geo.Disk(1.0, 1.0))
    >>> (K.sample_at([0.5, 1.5], [[1.0, -1.0, 0.0], [1.0, -1.0, 0.0]], rng=0).round(12) + 0.0).tolist()
    [[1.0, 1.0, 0.0], [0.0, 1.0, -1.0]]
    """

    law: PositionLaw
    disk: Disk
    parts: tuple[CollisionLaw, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        instance("law", self.law, PositionLaw, "ker.PositionLaw([0, 1], [ker.specular()])")
        instance("disk", self.disk, Disk, "geo.Disk()")
        self._set(parts=tuple(CollisionLaw(law, self.disk) for law in self.law.laws))

    @seed_by_name
    def sample_at(self, x: ArrayLike, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Draw an outgoing velocity (n, 3) for every incoming one with v2 < 0 at the positions x (n,)."""
        at, incoming = finite_array("x", x), finite_array("velocity", velocity)
        if at.ndim != 1 or incoming.shape != (len(at), 3):
            raise InputError(f"velocity: expected shape (n, 3) for n positions, got {incoming.shape} for {at.shape}")
        return outcomes_of(self.parts, self.law.interval(at), incoming, generator(rng))

    def check_wall(self, container: Container, wall: int) -> None:
        """Raise an InputError if the wall is a curve and the edges do not run from 0 to its length."""
        curve = _number_of(container, wall) - len(container.points)
        if curve < 0:
            return
        length = container.curves[curve].length
        first, last = float(self.law.edges[0]), float(self.law.edges[-1])
        if max(abs(first), abs(last - length)) > ROUNDING * length:
            raise InputError(
                f"law: expected edges from 0 to {length!r}, the length of wall {wall}, got from {first!r} to {last!r}"
            )

    def coordinate(self, container: Container, wall: int, position: Floats) -> Floats:
        """The coordinates x (n,) of points (n, 2) on a wall, within the edges of the law."""
        (first, last), position = self.law.edges[[0, -1]], finite_array("position", position)
        if _number_of(container, wall) < len(container.points):
            along = (position - container.points[wall]) @ container.tangents[wall]
            return np.asarray(first + np.mod(along - first, last - first))
        return np.clip(container.length_on(wall, position), first, last)


def _number_of(container: Container, wall: int) -> int:
    instance("container", container, Container, "geo.Container.circle()")
    return whole_number("wall", wall, 0, most=container.wall_count - 1)
