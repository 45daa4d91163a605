"""The deterministic collision of a disk with a rough wall (Rudzis 2022, section 1.3): its arguments and its results.

The compiled calculation has lengths in units of the wall, so the disk's radius is 1/scale. A disk collides again from
disturbed incoming states, which tells whether the collision amplifies rounding errors.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, instance, positive_number, shaped, whole_number
from ...core.errors import InputError
from ...core.rounding import EPS
from ..curves import columns as c
from ..curves.curve import Curve
from ..disk.disk import Disk
from ..disk.satellites import Satellites
from ..tracing.threads import in_blocks, new_flag
from ..tracing.tracing import MAX_COLLISIONS, Status, StatusCounts, numbers_of
from ..walls.wall import Wall
from .compiled.graph_table import LEAST_BEND, MOST_BEND, graphs_of

if TYPE_CHECKING:
    from ..scene.scene import Scene


class DiskResults(NamedTuple):
    """The arrays that the compiled collision fills, one row for each disk; see `RigidCollision`."""

    position: Floats
    velocity: Floats
    time: Floats
    contacts: NDArray[np.int64]
    two_satellites: NDArray[np.bool_]
    status: NDArray[np.uint8]

    def part(self, block: slice) -> DiskResults:
        """Return the results of the disks in ``block``."""
        return DiskResults._make(array[block] for array in self)


# A function of positions and velocities.
Collide = Callable[[Floats, Floats], DiskResults]


class DiskCounts(StatusCounts):
    """Mask and counts of the array ``status`` of disks."""

    @property
    def escaped(self) -> NDArray[np.bool_]:
        """Mask of the disks that returned to x2 = 0 or separated, with ``AMPLIFIED`` ones."""
        return np.asarray((self.status == DiskStatus.ESCAPED) | (self.status == DiskStatus.AMPLIFIED))

    def counts(self) -> dict[str, int]:
        """Return the number of disks with every `DiskStatus`, by name in lower case."""
        return numbers_of(self.status, DiskStatus)


@dataclass(frozen=True, repr=False)
class RigidCollision(DiskCounts):
    """The results of `collide` for n disks.

    Attributes
    ----------
    position : array of shape (n, 2)
        (x1, alpha) at the return to x2 = 0, both unfolded; the last position if the disk did not come back.
    velocity : array of shape (n, 3)
        Outgoing (v1, v2, omega) with v2 > 0; the last velocity if the disk did not come back.
    time : array of shape (n,)
        The time from the start to this position.
    contacts : array of int, shape (n,)
        Number of contacts of satellites with the wall.
    two_satellites : array of bool, shape (n,)
        Whether more than one satellite touched the wall.
    status : array of int, shape (n,)
        Values of `DiskStatus`. ``ESCAPED``: the disk came back to x2 = 0. ``CORNER`` and ``GRAZING``: double precision
        does not resolve a contact, for example two simultaneous contacts. ``BOUNCE_LIMIT``: the disk did not come back.
        ``AMPLIFIED``: the disk came back, but rounding may have changed its outgoing state by more than 1e-6.
    """

    position: Floats
    velocity: Floats
    time: Floats
    contacts: NDArray[np.int64]
    two_satellites: NDArray[np.bool_]
    status: NDArray[np.uint8]


def collide(
    disk: Disk,
    wall: Wall,
    scale: float,
    position: ArrayLike,
    velocity: ArrayLike,
    spacing: float | None = None,
    *,
    max_contacts: int = MAX_COLLISIONS,
    threads: int | None = None,
) -> RigidCollision:
    r"""Collide a disk with satellites and a rough wall: the map K^{Sigma, eps}.

    Only the satellites S_k = (x1 + sin(alpha + k rho), x2 - cos(alpha + k rho)) on the disk's rim touch the wall. The
    wall is ``wall`` enlarged by ``scale``, with its tops at height -1, so the disk at x2 = 0 is just above the tops.
    The disk moves freely between contacts. A contact reflects the velocity specularly in the kinetic metric, with the
    normal (k1/m, k2/m, (k1 cos(alpha + j rho) + k2 sin(alpha + j rho))/J) up to its length, where j is the satellite
    and k the wall's normal. The map conserves the energy, preserves the measure <w, e2> dx1 dalpha dw, and is an
    involution if the input is minus the incoming velocity (Rudzis 2022, section 1.3.5).

    Parameters
    ----------
    disk : Disk
        Of radius 1: lengths and times are in units of the radius.
    wall : Wall
    scale : float
        eps, greater than 0: the period is ``scale * wall.period`` in units of the disk's radius.
    position : array_like, shape (n, 2)
        (x1, alpha) at x2 = 0, finite; alpha in radians.
    velocity : array_like, shape (n, 3)
        Incoming (v1, v2, omega) with v2 < 0.
    spacing : float, optional
        rho, 2 pi over a whole number; by default the least spacing of at least eps^0.4 at which no three satellites
        reach the wall.
    max_contacts : int
        Disks still near the wall after ``max_contacts`` contacts end with ``DiskStatus.BOUNCE_LIMIT``.
    threads : int, optional
        Number of threads, by default one for each processor that the process may use. The result does not depend on
        it.

    Returns
    -------
    RigidCollision

    Raises
    ------
    InputError
        If a shape is wrong, some v2 is not negative, the spacing does not divide the circle, or three satellites could
        touch the wall.

    Notes
    -----
    Positions are computed in units of the wall, relative to its cell. So small scales lose no accuracy except by the
    rounding of x1 and alpha. The first contact is found by safe steps, which pass no root (see `compiled.contact`).
    Cost: 0.3 to 0.7 microseconds per contact on a wall of few pieces; every piece of a hollow is tested.

    Disks with many contacts, the fewer the larger m/J and the curvature of the wall, collide again from incoming states
    that differ by rounding; where the outgoing states differ by more than 1e-8 the status is ``AMPLIFIED``. The state
    is that of a path that obeys the laws within rounding. So laws and means over many disks count it as any other, and
    ``escaped`` includes it. It must not be compared with another computation of the same disk.

    Source: Rudzis 2022, sections 1.3.1 to 1.3.5, and Proposition 3.2 with the angle alpha + j rho (eq. 3.26 prints
    alpha - j rho).

    Examples
    --------
    On a flat wall the disk is reflected like a smooth disk if its lowest satellite is at alpha = 0:

    >>> from asperity import geometry as geo
    >>> hit = geo.collide(geo.Disk(), geo.flat(), 0.01, [[0.5, 0.0]], [[0.0, -1.0, 0.0]])
    >>> hit.velocity.round(12).tolist(), hit.contacts.tolist(), hit.counts()["escaped"]
    ([[0.0, 1.0, 0.0]], [1], 1)
    """
    check_kinds(disk, wall)
    eps = positive_number("scale", scale)
    ring = ring_of(Satellites.around(eps, eps * wall.depth, spacing), eps, wall.scene)
    return RigidCollision(*collide_ring(disk, wall, ring, position, velocity, max_contacts, threads))


def collide_ring(
    disk: Disk, wall: Wall, ring: Ring, position: ArrayLike, velocity: ArrayLike, max_contacts: int, threads: int | None
) -> DiskResults:
    """Return the results of disks at x2 = 0 with the satellites of a ring, read-only, amplified ones marked."""
    from .compiled.rigid import collide_disks

    states = checked_states(position, velocity)
    whole_number("max_contacts", max_contacts, 1)
    ground, total = ground_of(wall.scene), disk.mass + disk.rim_mass
    masses = disk.mass / total, disk.rim_mass / total

    def collided(at: Floats, moving: Floats) -> DiskResults:
        start, results = at_the_tops(wall, ring.scale, at, moving), results_for(len(at))

        def run_part(part: slice) -> None:
            collide_disks(start[part], moving[part], masses, ring, max_contacts, ground, results.part(part))

        in_blocks(run_part, len(at), threads, stop=ground.stop)
        from_the_tops(wall, ring.scale, at, start, moving, results)
        return results

    # on the cylinder the paths are straight, and alpha is of the size of x1
    curvature, angle = (0.0, ring.scale) if ring.is_rolling else (ring.scale, ring.reach)
    bend = (largest_bend(ground) + curvature) * (wall.period + wall.depth)
    return marked(collided, states, disk, bend, (ring.scale, angle))


def marked(
    collided: Collide, states: tuple[Floats, Floats], disk: Disk, bend: float, sizes: tuple[float, float]
) -> DiskResults:
    """Return the results of disks from ``states``, read-only, amplified ones marked.

    ``bend`` is that of `fewest_contacts`; ``sizes`` are those of x1 and alpha for rounding errors.
    """
    results, masses = collided(*states), np.array([disk.mass, disk.mass, disk.rim_mass])
    uncertain = results.contacts >= fewest_contacts(bend, 1.0 / disk.inertia_ratio)

    def again(rows: NDArray[np.intp], at: Floats, moving: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        moving[:, 1] = np.minimum(moving[:, 1], 0.5 * states[1][rows, 1])
        there = collided(at, moving)
        return there.position, there.velocity, there.status == Status.ESCAPED

    ends = results.position, results.velocity
    mark_amplified(again, states, ends, results.status, uncertain, (np.array(sizes), masses))
    for array in results:
        array.setflags(write=False)
    return results


def at_the_tops(wall: Wall, scale: float, position: Floats, velocity: Floats) -> Floats:
    """Return where disks from x2 = 0 reach the level of the highest points, in the coordinates of ``wall.cell``."""
    x, level = wall.origin
    time = (scale * level / velocity[:, 1])[:, np.newaxis]
    return np.asarray(position + time * velocity[:, [0, 2]] - [scale * x, 0.0])


def from_the_tops(
    wall: Wall, scale: float, position: Floats, start: Floats, velocity: Floats, results: DiskResults
) -> None:
    """Convert, in place, results of disks from ``start`` to results of disks that begin and end at x2 = 0."""
    level = scale * wall.origin[1]
    if wall.origin == (0.0, 0.0):
        return
    down = level / velocity[:, 1]
    up = np.zeros_like(down)
    np.divide(-level, results.velocity[:, 1], out=up, where=results.status == Status.ESCAPED)
    results.position[:] += position - start + down[:, np.newaxis] * velocity[:, [0, 2]]
    results.position[:] += up[:, np.newaxis] * results.velocity[:, [0, 2]]
    results.time[:] += down + up


def check_kinds(disk: Disk, wall: Wall) -> None:
    """Raise an InputError unless ``disk`` is a Disk of radius 1 and ``wall`` a Wall."""
    if in_radii(disk) != disk:
        raise InputError(
            "disk: expected radius 1, because lengths and times are in units of the radius, got radius "
            f"{disk.radius!r}; pass {in_radii(disk)!r}, and divide x1 by the radius"
        )
    instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")


def in_radii(disk: Disk) -> Disk:
    """Return the disk in units of its radius; InputError if it is no Disk."""
    instance("disk", disk, Disk, "geo.Disk(mass=1.0, inertia_ratio=0.5)")
    return replace(disk, radius=1.0)


def checked_states(position: ArrayLike, velocity: ArrayLike) -> tuple[Floats, Floats]:
    """Return positions (n, 2) and incoming velocities (n, 3) as contiguous arrays of the same length."""
    at, moving = shaped("position", position, "n", 2), shaped("velocity", velocity, "n", 3)
    if len(at) != len(moving) and 1 not in (len(at), len(moving)):
        raise InputError(f"position and velocity: expected equally many rows, got {len(at)} and {len(moving)}")
    away = ~(moving[:, 1] < 0.0)
    if away.any():
        row = int(away.argmax())
        raise InputError(
            f"velocity: expected incoming velocities with v2 < 0, got v2 = {moving[row, 1]!r} at row {row} "
            f"({int(away.sum())} such)"
        )
    n = max(len(at), len(moving))
    # copies, because compiled functions are compiled once more for arrays that are read-only
    return np.broadcast_to(at, (n, 2)).copy(), np.broadcast_to(moving, (n, 3)).copy()


# Relative allowance for rounding in bounds on the reach of satellites and on the depth of the disk.
ROOM = 1e-9
# Relative error of positions, a few rounding errors of their size, as for rays (`curves/columns`).
SLACK = 16.0 * EPS


class Ground(NamedTuple):
    """The wall: its period, whether satellites pass from cell to cell below its tops, and the tables of its scene.

    ``exact_arcs`` is the table of `refined_arcs`, ``graphs`` that of `graphs_of`; the hollows have ranges of graphs in
    the columns of Bezier pieces. ``stop`` is the flag that interrupts a collision.
    """

    cell: float
    is_open: bool
    hollows: Floats
    joints: Floats
    lines: Floats
    arcs: Floats
    exact_arcs: Floats
    beziers: Floats
    graphs: Floats
    stop: NDArray[np.int64]


class Ring(NamedTuple):
    """The satellites and their disk.

    At an angle of more than ``reach`` from the lowest point a satellite is above the wall; ``-floor`` is the least
    height of the disk; ``slack`` bounds the rounding error of a satellite's position. ``half_sine`` and ``half_cosine``
    are the sine and cosine of half the spacing. ``is_rolling`` tells that the disk is on the cylinder, where one
    satellite stays the lowest point: the contact moves with the velocity (v1 + omega, v2).
    """

    scale: float
    spacing: float
    reach: float
    floor: float
    slack: float
    half_sine: float
    half_cosine: float
    is_rolling: bool


def results_for(count: int) -> DiskResults:
    """Return empty results for ``count`` disks."""
    return DiskResults(
        np.empty((count, 2)), np.empty((count, 3)), np.empty(count),
        np.empty(count, np.int64), np.empty(count, np.bool_), np.empty(count, np.uint8),
    )  # fmt: skip


def ground_of(scene: Scene) -> Ground:
    """Return the tables of a wall."""
    from ..tracing.compiled.pieces.arcs import refined_arcs

    for cls, rows in zip(Curve.traced(), scene.curves, strict=True):
        if len(rows) and not cls.meets_disks:
            raise InputError(f"wall: expected pieces that disks meet, got a {cls.__name__}; write it as Bezier curves")
    hollows = scene.hollows.copy()
    graphs = graphs_of(scene.beziers, hollows)
    return Ground(
        scene.cell, scene.is_open, hollows, scene.joints, scene.lines, scene.arcs, refined_arcs(scene.arcs),
        scene.beziers, graphs, new_flag(),
    )  # fmt: skip


def largest_bend(ground: Ground) -> float:
    """Return an upper bound on the curvature of the wall's pieces."""
    arcs = np.abs(ground.arcs[:, c.CURVATURE]) * np.maximum(ground.arcs[:, c.STRETCH], 1.0) ** 2
    bends = np.abs(ground.graphs[:, [LEAST_BEND, MOST_BEND]])
    return float(max(arcs.max(initial=0.0), bends.max(initial=0.0)))


def ring_of(satellites: Satellites, scale: float, scene: Scene) -> Ring:
    """Return the satellites above a wall of the given scale."""
    half = 0.5 * satellites.spacing
    return Ring(
        scale,
        satellites.spacing,
        satellites.reach * (1.0 + ROOM),
        satellites.lowest / scale * (1.0 + ROOM),
        position_rounding(scene, math.sin(satellites.reach) / scale),
        math.sin(half),
        math.cos(half),
        False,
    )


def rolling_ring(scale: float, depth: float, scene: Scene) -> Ring:
    """Return the one satellite of a disk on the cylinder over a wall of the given scale and depth."""
    return Ring(scale, 1.0, 0.0, depth + scene.cell, position_rounding(scene, 0.0), 0.0, 1.0, True)


def position_rounding(scene: Scene, farthest: float) -> float:
    """Return a bound on the rounding error of a satellite's position, from the wall's size and ``farthest``."""
    size = float(scene.hollows[:, c.SIZE].max()) if len(scene.hollows) else 0.0
    return SLACK * (size + scene.cell + farthest)


# Accuracy of a disk that is not amplified: positions in radii and radians, velocities relative to the speed.
ACCURACY = 1e-6
# Disturbance of the incoming state, of the size of the rounding errors at a contact.
DISTURBANCE = 16.0 * EPS
# Disturbed states of a collision, and the largest change of its end. The changes scatter as the error does, but are of
# two sizes, up to 175 to 1, where a contact is found to one rounding error or to sixteen. One disturbed state is enough
# if its change is at most CLEAR.
DISTURBED, LIMIT, CLEAR = 6, 1e-2 * ACCURACY, 1e-4 * ACCURACY
# Twice the inverse cosine of the angle to the normal that few contacts of a collision exceed on average: 1/5.
STEEP = 10.0
# Growth at a contact of a flat wall, for rounding errors that add up: collisions of a thousand contacts are repeated.
LEAST_GROWTH = 0.02


class DiskStatus(IntEnum):
    """The outcome of colliding a disk: a `Status`, or ``AMPLIFIED``.

    ``AMPLIFIED``: the disk escaped, but rounding may have changed its outgoing state by more than 1e-6: positions in
    radii of the disk and radians, velocities relative to the speed in the kinetic metric. The state is that of a path
    that obeys the laws within rounding, so means over many disks are not affected.
    """

    ESCAPED = Status.ESCAPED
    CORNER = Status.CORNER
    GRAZING = Status.GRAZING
    BOUNCE_LIMIT = Status.BOUNCE_LIMIT
    AMPLIFIED = 4


def fewest_contacts(bend: float, ratio: float) -> int:
    """Return the number of contacts from which on a collision is repeated, so that ordinary ones cost nothing.

    ``bend`` is the largest curvature times the length of a flight, ``ratio`` the mass over the inertia: in the
    foreshortened wall curvatures are up to 1 + m/J times as large. A flight without contact is exact.
    """
    growth = math.log1p(STEEP * bend * (1.0 + ratio))
    return max(1, int(math.log(ACCURACY / DISTURBANCE) / max(growth, LEAST_GROWTH)))


def mark_amplified(
    again: Callable[[NDArray[np.intp], Floats, Floats], tuple[Floats, Floats, NDArray[np.bool_]]],
    states: tuple[Floats, Floats],
    ends: tuple[Floats, Floats],
    status: NDArray[np.uint8],
    uncertain: NDArray[np.bool_],
    units: tuple[Any, Any],
) -> None:
    """Set the status of amplified disks, among the ``uncertain`` ones that escaped, to ``AMPLIFIED``.

    ``states`` are the incoming positions and velocities, one row for each disk, and ``ends`` the outgoing ones.
    ``again`` collides the disks of some rows from disturbed states, and tells which of them escaped. ``units`` are the
    sizes of positions, for their rounding errors, and the masses of the velocities.
    """
    (at, moving), (position, velocity), (sizes, masses) = states, ends, units
    rows = np.flatnonzero((status == DiskStatus.ESCAPED) & uncertain)
    for k in range(DISTURBED):
        if not len(rows):
            break
        shift = DISTURBANCE * np.random.default_rng(k).uniform(-1.0, 1.0, at.shape[1] + moving.shape[1])
        speeds = np.sqrt(np.sum(masses * moving[rows] ** 2, axis=1, keepdims=True) / masses)
        start = at[rows] + shift[: at.shape[1]] * sizes, moving[rows] + shift[at.shape[1] :] * speeds
        there, w, escaped = again(rows, *start)
        changes = np.abs(there - position[rows]).max(axis=1), np.abs((w - velocity[rows]) / speeds).max(axis=1)
        change = np.maximum(*changes)
        amplified = ~(escaped & (change <= LIMIT))
        status[rows[amplified]] = DiskStatus.AMPLIFIED
        rows = rows[~amplified & (change > CLEAR)]
