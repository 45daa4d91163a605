"""The collision on the cylinder, whose law decouples, and the modified collision (Rudzis 2022, sections 4.2, 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, positive_number
from ..disk import rolling
from ..disk.disk import Disk
from ..disk.satellites import RollingCharts
from ..tracing.tracing import MAX_COLLISIONS
from ..walls.wall import Wall
from .configuration_space import ConfigurationSpace
from .rigid import DiskCounts, check_kinds, checked_states, collide, collide_ring, rolling_ring

# Newton steps on a convex function: at worst a step halves the error, near the root it squares the error.
LANDING_STEPS = 80


@dataclass(frozen=True, repr=False)
class CylinderCollision(DiskCounts):
    """The results of `collide_cylinder` for n disks.

    Attributes
    ----------
    position : array of shape (n, 2)
        (y1', y3') = (x1, alpha) at the return to height 0, unfolded.
    velocity : array of shape (n, 3)
        Outgoing (v1, v2, omega).
    time : array of shape (n,)
        The time from height 0 to height 0.
    contacts : array of int, shape (n,)
    status : array of int, shape (n,)
        Values of `DiskStatus`.
    """

    position: Floats
    velocity: Floats
    time: Floats
    contacts: NDArray[np.int64]
    status: NDArray[np.uint8]


def collide_cylinder(
    disk: Disk,
    wall: Wall,
    scale: float,
    position: ArrayLike,
    velocity: ArrayLike,
    *,
    max_contacts: int = MAX_COLLISIONS,
    threads: int | None = None,
) -> CylinderCollision:
    """Collide disks on the cylinder M_cyl, where the contact (x1 + alpha, x2) moves on straight lines: K_cyl.

    The velocity is reflected specularly in the kinetic metric, so -m v1 + J omega is conserved and its conjugate
    coordinate moves uniformly. In the plane orthogonal to chi the motion is the billiard in the foreshortened wall:

        theta' = trace(wall.foreshorten(disk), (x1 + alpha)/scale, theta).theta,   psi' = pi - psi.

    Parameters
    ----------
    disk : Disk
        Of radius 1, as in `collide`.
    wall : Wall
    scale : float
        eps, greater than 0: the wall's unit of length, in units of the disk's radius.
    position : array_like, shape (n, 2)
        (y1, y3) = (x1, alpha) at height 0.
    velocity : array_like, shape (n, 3)
        Incoming (v1, v2, omega) with v2 < 0.
    max_contacts, threads
        As in `collide`.

    Returns
    -------
    CylinderCollision

    Raises
    ------
    InputError
        As in `collide`.

    Source: Rudzis 2022, sections 4.2 and 5.1.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> notch = geo.Wall.from_vertices([(0, 0), (0, -0.5), (1, -0.5), (1, 0)])
    >>> disk = geo.Disk(mass=1.0, inertia_ratio=1.0)
    >>> out = geo.collide_cylinder(disk, notch, 1.0, [[0.25, 0.25]], [[0.0, -2.0, 0.0]])
    >>> out.position.tolist(), out.velocity.tolist(), out.time.tolist()
    ([[0.25, 0.25]], [[0.0, 2.0, 0.0]], [0.5])
    """
    check_kinds(disk, wall)
    ring = rolling_ring(positive_number("scale", scale), wall.cell.depth, wall.scene)
    results = collide_ring(disk, wall, ring, position, velocity, max_contacts, threads)
    return CylinderCollision(results.position, results.velocity, results.time, results.contacts, results.status)


@dataclass(frozen=True, repr=False)
class ModifiedCollision(DiskCounts):
    """The results of `collide_modified` for n disks.

    Attributes
    ----------
    position : array of shape (n, 2)
        (y1', y3') = (x1, alpha), straightened and unfolded, at the return of the lowest satellite to the level of the
        tops. If the disk did not come back, the last position of the true disk.
    velocity : array of shape (n, 3)
        Outgoing (v1, v2, omega).
    contacts : array of int, shape (n,)
    two_satellites : array of bool, shape (n,)
        Whether more than one satellite touched the wall.
    inside : array of bool, shape (n,)
        Whether the paper defines the map: the disk came back; alpha is in Z before and after, so only one satellite is
        within the depth of the wall; and v2 > J^(-1/2) sin(rho/2) for unit velocities, so eta is one to one. There K~
        is an involution. Elsewhere the values follow from the same formulas without a guarantee.
    status : array of int, shape (n,)
        Values of `DiskStatus`, from the true collision.
    """

    position: Floats
    velocity: Floats
    contacts: NDArray[np.int64]
    two_satellites: NDArray[np.bool_]
    inside: NDArray[np.bool_]
    status: NDArray[np.uint8]


def collide_modified(
    disk: Disk,
    wall: Wall,
    scale: float,
    position: ArrayLike,
    velocity: ArrayLike,
    spacing: float | None = None,
    *,
    max_contacts: int = MAX_COLLISIONS,
    threads: int | None = None,
) -> ModifiedCollision:
    """Collide disks by the modified law K~ = eta^(-1) o K o eta, the true collision in coordinates of the cylinder.

    A state of the cylinder is (x1, alpha) at height 0. Bending it gives a disk with its lowest satellite at the level
    of the tops. eta moves the bent disk back along its path to height 0; then the true disk collides. eta^(-1) moves
    the disk until its lowest satellite is at the level of the tops again, and straightens this configuration. As the
    scale tends to 0, K~ tends to K_cyl, the law of `collide_cylinder` (Lemma 5.2 (iii)). If k rho is the multiple of
    rho nearest to alpha, compare with K_cyl at alpha - k rho: the cylinder's line x1 + alpha is unrolled, the satellite
    is not.

    Parameters
    ----------
    disk, wall, scale, position, velocity, spacing, max_contacts, threads
        As in `collide`; the position is on the cylinder.

    Returns
    -------
    ModifiedCollision
        The mask ``inside`` tells for which disks the paper defines the map.

    Raises
    ------
    InputError
        As in `collide`.

    Source: Rudzis 2022, section 5.2 (eq. 4.75 for eta, the signs of section 5.2 corrected; Lemma 4.13 corrected for
    the velocities at which eta is one to one).

    Examples
    --------
    A disk that falls vertically into a crevice is retroreflected:

    >>> from asperity import geometry as geo
    >>> notch = geo.Wall.from_vertices([(0, 0), (0, -0.5), (1, -0.5), (1, 0)])
    >>> disk = geo.Disk(mass=1.0, inertia_ratio=1.0)
    >>> out = collide_modified(disk, notch, 0.001, [[0.00025, 0.0]], [[0.0, -2.0, 0.0]], spacing=np.pi / 32)
    >>> out.position.tolist(), out.velocity.tolist(), out.inside.tolist()
    ([[0.00025, 0.0]], [[0.0, 2.0, 0.0]], [True])
    """
    space = ConfigurationSpace(wall, disk, scale, spacing)
    charts = space.charts
    at, moving = checked_states(position, velocity)
    start = charts.transfer(at, moving)
    true = collide(disk, wall, scale, start, moving, space.spacing, max_contacts=max_contacts, threads=threads)
    back = true.escaped
    out = np.array(true.position)
    out[back] = _straightened(charts, true.position[back], -true.velocity[back])
    floor = np.sin(0.5 * charts.spacing) / np.sqrt(disk.rim_mass)
    inside = back & space.is_single(at[:, 1]) & space.is_single(out[:, 1])
    for w in (moving, true.velocity):
        inside = inside & (np.abs(w[:, 1]) > floor * np.sqrt(disk.inner(w, w)))
    for array in (out, inside):
        array.setflags(write=False)
    return ModifiedCollision(out, true.velocity, true.contacts, true.two_satellites, inside, true.status)


def _straightened(charts: RollingCharts, position: Floats, velocity: Floats) -> Floats:
    """Return eta^(-1): the straightened configuration with the lowest satellite at the level of the tops."""
    time = _landing(charts, position[:, 1], velocity)
    low = np.stack([position[:, 0], np.zeros(len(time)), position[:, 1]], axis=-1) + time[:, None] * velocity
    return charts.straighten(low)[:, [0, 2]]


def _landing(charts: RollingCharts, alpha: Floats, velocity: Floats) -> Floats:
    """Return the time at which the lowest satellite reaches the level of the tops.

    The height of a satellite is convex while it is the lowest, so Newton's method passes no root. If another satellite
    becomes the lowest first, the search continues from that time.
    """
    v2, omega = velocity[:, 1], velocity[:, 2]
    time = np.zeros(len(alpha))
    half = 0.5 * charts.spacing
    for _ in range(LANDING_STEPS):
        bar = charts.residual(alpha + omega * time)
        height = v2 * time + rolling.rise(bar)
        slope = v2 + omega * np.sin(bar)
        with np.errstate(divide="ignore", invalid="ignore"):
            takeover = np.where(omega == 0.0, np.inf, (half - np.sign(omega) * bar) / np.abs(omega))
            step = np.where(slope < 0.0, -height / slope, np.inf)
        time = time + np.minimum(np.maximum(step, 0.0), takeover * (1.0 + 1e-12))
    return time
