"""The motion of a disk in a container, with any collision law of its walls, deterministic or random."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, Unpack, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Rng, check_memory, finite_array, generator, shaped, shortened, whole_number
from ...core.errors import InputError
from ...core.kinds import explained, explained_class
from ...core.long_runs import Engine, all_parts, digest
from ...core.version import __version__
from ..collisions.collision_law import CollisionLaw
from ..collisions.satellite_law import SatelliteLaw
from ..laws.law import Law
from ..walls.identity import law_digest, wall_digest
from .along_walls import CollisionAlongWall, Located

if TYPE_CHECKING:
    from ...geometry import Container, Disk

# Disks of a part: their random numbers depend on its number alone.
TOGETHER = 1024


@runtime_checkable
class Reflector(Protocol):
    """Protocol for the collision law of one wall of a container, met by `CollisionLaw` and `SatelliteLaw`."""

    @property
    def disk(self) -> Disk: ...

    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Outgoing (v1, v2, omega) for incoming ones with v2 < 0; the wall is below the disk."""
        ...


@explained_class
@dataclass(frozen=True)
class BilliardRecord:
    """States of n disks after each of their collisions; the first entry of every array is the initial state.

    A disk that meets no further wall has fewer ``collisions`` than ``steps``; its last state is repeated.

    Attributes
    ----------
    container : Container
    disk : Disk
    time : array, shape (steps + 1, n)
    position : array, shape (steps + 1, n, 2)
    angle : array, shape (steps + 1, n)
        Angle of rotation since the start, radians, not reduced modulo 2 pi.
    velocity : array, shape (steps + 1, n, 3)
        (v1, v2, omega) after the collision.
    wall : array of int, shape (steps + 1, n)
        Index of the wall, -1 at the start.
    collisions : array of int, shape (n,)
    """

    container: Container
    disk: Disk
    time: Floats
    position: Floats
    angle: Floats
    velocity: Floats
    wall: NDArray[np.int64]
    collisions: NDArray[np.int64]

    @property
    def radius(self) -> float | None:
        """The radius of the disks relative to the container; None where only the centres count."""
        return None

    @property
    def energy(self) -> Floats:
        """Kinetic energies <w, w>/2, shape (steps + 1, n)."""
        return np.asarray(0.5 * self.disk.inner(self.velocity, self.velocity))

    @property
    def angular_momentum(self) -> Floats:
        """m (x1 v2 - x2 v1) + J omega about the origin, shape (steps + 1, n)."""
        x, v = self.position, self.velocity
        orbital = x[..., 0] * v[..., 1] - x[..., 1] * v[..., 0]
        return np.asarray(self.disk.mass * orbital + self.disk.inertia * v[..., 2])

    def extent(self, direction: ArrayLike = (1.0, 0.0)) -> Floats:
        """Range, shape (n,), of the collision positions along a direction, without the start."""
        along = self.position[1:] @ shaped("direction", direction, 2)
        return np.asarray(np.ptp(along, axis=0))


@explained
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
        Initial (v1, v2, omega). One position is repeated for many velocities, and the other way round.
    collisions : int
        Number of collisions per disk.
    rng : None, int or numpy.random.Generator
    checkpoint : path, optional
        A file to which the states of every 1024 disks are added; the same call goes on with it.
    client : int, str or distributed.Client, optional
        As of `asperity.spectral.sweep`. The record is the same to the last bit without checkpoint and workers.

    Returns
    -------
    BilliardRecord

    Raises
    ------
    InputError
        If a shape is wrong, a centre is outside, a law is one of angles, or the laws do not match the walls; if the
        checkpoint is of another simulation.

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
    root = tuple(int(word) for word in generator(rng).integers(0, 2**63, size=2))
    whole_number("collisions", collisions, 1)
    check_memory("collisions", "the record", 8 * collisions)
    each = _laws_at_positions(container, laws)
    disk = each[0].disk
    located, moving = _starts(container, position, velocity)
    job = _Disks(container, tuple(each), located, moving, collisions, root)
    parts = all_parts(job.states, -(-len(located) // TOGETHER), job.identity(), engine)
    columns = {
        name: np.concatenate([part[name] for part in parts], axis=0 if name == "collisions" else 1) for name in parts[0]
    }
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
    root: tuple[int, ...]

    def identity(self) -> dict[str, Any]:
        """What tells these disks from others."""
        container = self.container
        return {
            "computation": "disks between walls", "version": __version__, "laws": [*map(_told, self.laws)],
            "container": digest(container.points, container.normals, container.curves), "collisions": self.collisions,
            "start": digest(self.position, self.velocity), "seed": list(self.root),
        }  # fmt: skip

    def states(self, part: int) -> dict[str, NDArray[Any]]:
        """The columns of the record for the disks of one part, whose random numbers depend on its number alone."""
        rng = np.random.default_rng([*self.root, part])
        own = slice(part * TOGETHER, (part + 1) * TOGETHER)
        located, moving = self.position[own].copy(), self.velocity[own].copy()
        n = len(located)
        time, angle, last = np.zeros(n), np.zeros(n), np.full(n, -1)
        made = np.zeros(n, dtype=np.int64)
        states = [(time.copy(), located.copy(), angle.copy(), moving.copy(), last.copy())]
        for _ in range(self.collisions):
            flight, wall = self.container.next_wall(located, moving, last)
            hit = wall >= 0
            made[hit] += 1
            step = np.where(hit, flight, 0.0)
            time, angle = time + step, angle + moving[:, 2] * step
            located = located + moving[:, :2] * step[:, None]
            last = np.where(hit, wall, last)
            for k, law in enumerate(self.laws):
                here = np.flatnonzero(wall == k)
                if here.size:
                    point = self.container.touch(k, located[here])
                    located[here] = point.position
                    if isinstance(law, CollisionAlongWall):
                        law = Located(law, law.coordinate(self.container, k, point.position))
                    moving[here] = reflected(point.tangent, law, moving[here], rng)
            states.append((time.copy(), located.copy(), angle.copy(), moving.copy(), last.copy()))
        columns = [np.stack(column) for column in zip(*states, strict=True)]
        return {
            "time": columns[0], "position": columns[1], "angle": columns[2], "velocity": columns[3],
            "wall": columns[4].astype(np.int64), "collisions": made,
        }  # fmt: skip


def _told(law: Reflector | CollisionAlongWall) -> str:
    """What tells a collision law from others."""
    if isinstance(law, CollisionAlongWall):
        return digest(law.disk, law.law.edges, [law_digest(part) for part in law.law.laws])
    if isinstance(law, CollisionLaw):
        return digest(law.disk, law_digest(law.law))
    if isinstance(law, SatelliteLaw):
        return digest(law.disk, wall_digest(law.wall), law.scale, law.spacing)
    return repr(law)


def _laws_at_positions(
    container: Container, laws: Reflector | CollisionAlongWall | Sequence[Reflector | CollisionAlongWall]
) -> list[Reflector | CollisionAlongWall]:
    """Return the law of every wall, as `laws_of_walls` does, which may depend on the position."""
    each = list(laws) if isinstance(laws, Sequence) else [laws] * container.wall_count
    # the first collision law of each piece stands for all of them: they have the same disk
    plain = [law.parts[0] if isinstance(law, CollisionAlongWall) else law for law in each]
    laws_of_walls(container, plain)
    for k, law in enumerate(each):
        if isinstance(law, CollisionAlongWall):
            law.check_wall(container, k)
    return each


def laws_of_walls(container: Container, laws: Reflector | Sequence[Reflector]) -> list[Reflector]:
    """Return the law of every wall; raise an InputError if they do not match the walls or belong to two disks."""
    walls = container.wall_count
    each = list(laws) if isinstance(laws, Sequence) else [laws] * walls
    for law in each:
        if isinstance(law, Law):
            raise InputError(
                f"laws: expected collision laws, got {shortened(law)}, a law of angles, which does not know the disk; "
                f"pass ker.CollisionLaw(law, disk), or ker.smooth(disk) and ker.no_slip(disk) for specular reflection "
                "and retroreflection"
            )
    if not all(isinstance(law, Reflector) for law in each):
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
        raise InputError(f"velocity: expected shape ({n}, 3) for (v1, v2, omega), got {moving.shape}")
    inside = container.contains(located)
    if not inside.all():
        raise InputError(f"position: expected centres in the container, got {located[int(np.argmin(inside))].tolist()}")
    return np.broadcast_to(located, (n, 2)).copy(), np.broadcast_to(moving, (n, 3)).copy()


def reflected(tangent: Floats, law: Reflector, moving: Floats, rng: np.random.Generator) -> Floats:
    """Velocities after a collision with a wall of these unit tangents (n, 2), on whose left the disk is."""
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    along, up = np.sum(moving[:, :2] * tangent, axis=1), np.sum(moving[:, :2] * normal, axis=1)
    out = law.sample(np.stack([along, up, moving[:, 2]], axis=1), rng)
    return np.concatenate([out[:, :1] * tangent + out[:, 1:2] * normal, out[:, 2:]], axis=1)
