"""The motion of disks between rough walls, with any collision law, deterministic or random."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Rng, check_memory, finite_array, generator, shortened, whole_number
from ...core.errors import InputError
from ...core.kinds import explained

if TYPE_CHECKING:
    from ...geometry import Container, Disk


@runtime_checkable
class Reflector(Protocol):
    """Protocol for the collision law of one wall of a container, met by `CollisionLaw` and `SatelliteLaw`."""

    @property
    def disk(self) -> Disk: ...

    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Outgoing (v1, v2, omega) for incoming ones with v2 < 0; the wall is below the disk."""
        ...


@dataclass(frozen=True)
class BilliardRecord:
    """States of n disks after each of their collisions; the first entry of every array is the initial state.

    A disk that meets no further wall has fewer ``collisions`` than ``steps``; its last state is repeated.

    Attributes
    ----------
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

    disk: Disk
    time: Floats
    position: Floats
    angle: Floats
    velocity: Floats
    wall: NDArray[np.int64]
    collisions: NDArray[np.int64]

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
        along = self.position[1:] @ finite_array("direction", direction)
        return np.asarray(np.ptp(along, axis=0))


@explained
def play(
    container: Container,
    laws: Reflector | Sequence[Reflector],
    position: ArrayLike,
    velocity: ArrayLike,
    collisions: int,
    rng: Rng = None,
) -> BilliardRecord:
    """Simulate disks that move in a container and collide with its walls.

    Parameters
    ----------
    container : Container
        The region of the centres.
    laws : Reflector or sequence of Reflector
        One law for all walls or one per wall, all for the same disk: ``CollisionLaw(retroreflection(), disk)`` for a
        no-slip wall, ``CollisionLaw.from_wall(wall, disk)`` for a rough wall. Each law is applied in coordinates in
        which its wall is below the disk.
    position : array_like, shape (n, 2)
        Initial centres, inside the container.
    velocity : array_like, shape (n, 3)
        Initial (v1, v2, omega).
    collisions : int
        Number of collisions per disk.
    rng : None, int or numpy.random.Generator

    Returns
    -------
    BilliardRecord

    Raises
    ------
    InputError
        If a shape is wrong, a centre is outside, or the laws do not match the walls.

    Examples
    --------
    Between a no-slip floor and ceiling, a disk without initial spin moves back and forth:

    >>> import numpy as np
    >>> from asperity import geometry as geo, kernels as ker
    >>> no_slip = ker.CollisionLaw(ker.retroreflection(), geo.Disk(1.0, 1.0))
    >>> record = ker.play(geo.Container.strip(), no_slip, [[0.0, 0.0]], [[1.0, 1.0, 0.0]], 4, np.random.default_rng(0))
    >>> record.position[:, 0, 0].round(12).tolist()
    [0.0, 1.0, 1.0, 0.0, 0.0]
    """
    rng = generator(rng)
    whole_number("collisions", collisions, 1)
    check_memory("collisions", "the record", 8 * collisions)
    walls = len(container.normals)
    each = list(laws) if isinstance(laws, Sequence) else [laws] * walls
    if not all(isinstance(law, Reflector) for law in each):
        raise InputError(f"laws: expected collision laws such as ker.CollisionLaw(law, disk), got {shortened(laws)}")
    if len(each) != walls:
        raise InputError(f"laws: expected one law or one for each of the {walls} walls, got {len(each)}")
    disk = each[0].disk
    if any(law.disk != disk for law in each):
        raise InputError("laws: expected laws of the same disk")
    located, moving = finite_array("position", position).copy(), finite_array("velocity", velocity).copy()
    inside = container.contains(located)
    if moving.shape != (len(located), 3):
        raise InputError(f"velocity: expected shape ({len(located)}, 3) for (v1, v2, omega), got {moving.shape}")
    if not inside.all():
        raise InputError(f"position: expected centres in the container, got {located[int(np.argmin(inside))].tolist()}")
    n = len(located)
    time, angle, last = np.zeros(n), np.zeros(n), np.full(n, -1)
    made = np.zeros(n, dtype=np.int64)
    states = [(time.copy(), located.copy(), angle.copy(), moving.copy(), last.copy())]
    for _ in range(collisions):
        flight, wall = _next_wall(container, located, moving, last)
        hit = wall >= 0
        made[hit] += 1
        step = np.where(hit, flight, 0.0)
        time, angle = time + step, angle + moving[:, 2] * step
        located = located + moving[:, :2] * step[:, None]
        last = np.where(hit, wall, last)
        for k, law in enumerate(each):
            here = wall == k
            if here.any():
                moving[here] = _collide(container, k, law, moving[here], rng)
        states.append((time.copy(), located.copy(), angle.copy(), moving.copy(), last.copy()))
    columns = [np.stack(column) for column in zip(*states, strict=True)]
    for array in (*columns, made):
        array.setflags(write=False)
    return BilliardRecord(disk, columns[0], columns[1], columns[2], columns[3], columns[4].astype(np.int64), made)


def _next_wall(
    container: Container, located: Floats, moving: Floats, last: NDArray[np.int64]
) -> tuple[Floats, NDArray[np.int64]]:
    """Time to the next wall and its index, -1 if there is none."""
    approach = moving[:, :2] @ container.normals.T
    distance = np.maximum(container.distances(located), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.where(approach < 0.0, distance / -approach, np.inf)
    # a disk that leaves a straight wall cannot meet the same wall next
    rows = np.flatnonzero(last >= 0)
    times[rows, last[rows]] = np.inf
    wall = np.argmin(times, axis=1)
    first = times[np.arange(len(located)), wall]
    return first, np.where(np.isfinite(first), wall, -1)


def _collide(container: Container, k: int, law: Reflector, moving: Floats, rng: np.random.Generator) -> Floats:
    """Velocities after a collision with wall k, by its law in coordinates in which the wall is below."""
    normal, tangent = container.normals[k], container.tangents[k]
    local = np.stack([moving[:, :2] @ tangent, moving[:, :2] @ normal, moving[:, 2]], axis=1)
    out = law.sample(local, rng)
    return np.concatenate([out[:, :1] * tangent + out[:, 1:2] * normal, out[:, 2:]], axis=1)
