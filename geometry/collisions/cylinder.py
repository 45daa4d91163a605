"""The straightened collision: the disk rolls on a line, and its law decouples (Rudzis 2022, sections 4.2, 5.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, positive_number, whole_number
from ..disk import rolling
from ..disk.charts import RollingCharts
from ..disk.disk import Disk
from ..tracing.threads import in_blocks
from ..tracing.tracing import MAX_COLLISIONS, StatusCounts
from ..walls.wall import Wall
from .configuration_space import ConfigurationSpace
from .records import Rolling, ground_of, mass_fractions, position_rounding, results_for
from .rigid import at_the_tops, check_kinds, checked_states, collide, from_the_tops

# Newton's method on a convex function halves its error at worst, and squares it soon.
LANDING_STEPS = 80


@dataclass(frozen=True)
class CylinderCollision(StatusCounts):
    """What became of the disks, the first axis of every array running over them.

    Attributes
    ----------
    position : array of shape (n, 2)
        (y1', y3') = (x1, alpha) where the disk is back at height 0, unfolded.
    velocity : array of shape (n, 3)
        Outgoing (v1, v2, omega).
    time : array of shape (n,)
        From height 0 to height 0.
    contacts : array of int, shape (n,)
    status : array of int, shape (n,)
        Values of `Status`.
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

    It is reflected specularly in the kinetic metric, so that -m v1 + J omega is conserved and its conjugate coordinate
    moves uniformly: in the plane across chi the motion is the billiard in the foreshortened wall,

        theta' = trace(wall.foreshorten(disk), (x1 + alpha)/scale, theta).theta,   psi' = pi - psi.

    Parameters
    ----------
    disk : Disk
    wall : Wall
        Of segments and arcs, circular or elliptic.
    scale : float
        eps, greater than 0: the size of the wall's unit of length.
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
    >>> disk = geo.Disk(mass=1.0, inertia=1.0)
    >>> out = geo.collide_cylinder(disk, notch, 1.0, [[0.25, 0.25]], [[0.0, -2.0, 0.0]])
    >>> out.position.tolist(), out.velocity.tolist(), out.time.tolist()
    ([[0.25, 0.25]], [[0.0, 2.0, 0.0]], [0.5])
    """
    from .compiled.rigid import roll_disks

    check_kinds(disk, wall)
    eps = positive_number("scale", scale)
    at, moving = checked_states(position, velocity)
    whole_number("max_contacts", max_contacts, 1)
    start = at_the_tops(wall, eps, at, moving)
    n = len(at)
    results, ground, masses = results_for(n), ground_of(wall.scene), mass_fractions(disk)
    rolling = Rolling(eps, wall.cell.depth, position_rounding(wall.scene, 0.0))

    def run(part: slice) -> None:
        roll_disks(start[part], moving[part], masses, rolling, max_contacts, ground, results.part(part))

    in_blocks(run, n, threads, stop=ground.stop)
    from_the_tops(wall, eps, at, start, moving, results)
    for array in results:
        array.setflags(write=False)
    return CylinderCollision(results.position, results.velocity, results.time, results.contacts, results.status)


@dataclass(frozen=True)
class ModifiedCollision(StatusCounts):
    """What became of the disks, the first axis of every array running over them.

    Attributes
    ----------
    position : array of shape (n, 2)
        (y1', y3') = (x1, alpha), straightened, where the lowest satellite is back at the level of the tops, unfolded;
        where the disk did not come back the last position of the true disk.
    velocity : array of shape (n, 3)
        Outgoing (v1, v2, omega).
    contacts : array of int, shape (n,)
    two_satellites : array of bool, shape (n,)
        Whether more than one satellite touched the wall.
    inside : array of bool, shape (n,)
        Where the map is that of the paper: the disk came back, alpha is in Z before and after, so that one satellite
        alone is within the depth of the wall, and v2 > J^(-1/2) sin(rho/2) for unit velocities, so that eta is one to
        one. There K~ is an involution. Elsewhere the values are what the same formulas give, and nothing is claimed.
    status : array of int, shape (n,)
        Values of `Status`, those of the true collision.
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
    """The modified law K~ = eta^(-1) o K o eta: the true collision in the coordinates of the cylinder.

    A state of the cylinder is (x1, alpha) at height 0. The same disk, bent, has its lowest satellite at the level of
    the tops; eta takes it back along its path to height 0, the true disk collides, and eta^(-1) follows it until its
    lowest satellite leaves the level of the tops, and straightens that. As the scale tends to 0, K~ tends to K_cyl,
    the law of `collide_cylinder` (Lemma 5.2 (iii)). Where alpha is nearest to k rho, K_cyl is to be taken at
    alpha - k rho: the cylinder's line x1 + alpha is unrolled, the satellite is not.

    Parameters
    ----------
    disk, wall, scale, position, velocity, spacing, max_contacts, threads
        As in `collide`; the position is that on the cylinder.

    Returns
    -------
    ModifiedCollision
        Its mask ``inside`` says where the map is defined as in the paper.

    Raises
    ------
    InputError
        As in `collide`.

    Source: Rudzis 2022, section 5.2 (eq. 4.75 for eta, the signs of section 5.2 corrected; Lemma 4.13 corrected for
    the velocities at which eta is one to one).

    Examples
    --------
    A disk that falls straight down into a crevice comes straight back:

    >>> from asperity import geometry as geo
    >>> notch = geo.Wall.from_vertices([(0, 0), (0, -0.5), (1, -0.5), (1, 0)])
    >>> disk = geo.Disk(mass=1.0, inertia=1.0)
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
    floor = np.sin(0.5 * charts.spacing) / np.sqrt(disk.inertia)
    inside = back & space.is_single(at[:, 1]) & space.is_single(out[:, 1])
    for w in (moving, true.velocity):
        inside = inside & (np.abs(w[:, 1]) > floor * np.sqrt(disk.inner(w, w)))
    for array in (out, inside):
        array.setflags(write=False)
    return ModifiedCollision(out, true.velocity, true.contacts, true.two_satellites, inside, true.status)


def _straightened(charts: RollingCharts, position: Floats, velocity: Floats) -> Floats:
    """eta^(-1): down along the velocity until the lowest satellite is at the level of the tops, straightened."""
    time = _landing(charts, position[:, 1], velocity)
    low = np.stack([position[:, 0], np.zeros(len(time)), position[:, 1]], axis=-1) + time[:, None] * velocity
    return charts.straighten(low)[:, [0, 2]]


def _landing(charts: RollingCharts, alpha: Floats, velocity: Floats) -> Floats:
    """The time at which the lowest satellite comes to the level of the tops.

    Its height is convex while it is the lowest one, so that Newton's method comes from above and passes no root; where
    the next satellite takes over first, the search goes on from there.
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
