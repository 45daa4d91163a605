"""The straightened collision: the disk rolls on a line, and its law decouples (Rudzis 2022, sections 4.2, 5.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import Floats, positive_number, whole_number
from . import rolling
from .blocks import in_blocks
from .charts import RollingCharts
from .disk import Disk
from .rigid import check_kinds, checked_states
from .rigid_tables import ground_of, rounding_of_places, shares
from .tracing import MAX_COLLISIONS, Outcomes
from .wall import Wall

# Newton's method on a convex function halves its error at worst, and squares it soon.
LANDING_STEPS = 80


@dataclass(frozen=True)
class CylinderCollision(Outcomes):
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
    from .rigid_engine import roll_disks

    check_kinds(disk, wall)
    eps = positive_number("scale", scale)
    at, moving = checked_states(position, velocity)
    whole_number("max_contacts", max_contacts, 1)
    n = len(at)
    out_position, out_velocity, time = np.empty_like(at), np.empty_like(moving), np.empty(n)
    contacts, status = np.empty(n, np.int64), np.empty(n, np.uint8)
    results = (out_position, out_velocity, time, contacts, status)
    ground, masses, slack = ground_of(wall.scene), shares(disk), rounding_of_places(wall.scene, 0.0)

    def run(part: slice) -> None:
        roll_disks(
            at[part], moving[part], masses, eps, wall.depth, slack, max_contacts, ground,
            *(array[part] for array in results),
        )  # fmt: skip

    in_blocks(run, n, threads)
    for array in results:
        array.setflags(write=False)
    return CylinderCollision(*results)


def collide_modified(
    disk: Disk, wall: Wall, scale: float, position: ArrayLike, velocity: ArrayLike, spacing: float
) -> CylinderCollision:
    """The modified law K~ = eta o K_cyl o eta^(-1): the cylinder's collision in the coordinates of the true disk.

    The disk flies until its lowest satellite comes to the level of the tops, its path there is straightened, it
    collides on the cylinder, and eta takes the outcome back to height 0. Where one satellite takes part, K differs
    from K~ by the bending of the path during the contact alone, which is of the order of spacing.

    Parameters
    ----------
    disk, wall, scale, position, velocity, spacing
        As in `collide`; the spacing is to be given.

    Returns
    -------
    CylinderCollision
        ``time`` is that on the cylinder.

    Source: Rudzis 2022, section 5.2 (eq. 4.75 for eta, the signs of section 5.2 corrected).

    Examples
    --------
    A disk that falls straight down into a crevice comes straight back:

    >>> from asperity import geometry as geo
    >>> notch = geo.Wall.from_vertices([(0, 0), (0, -0.5), (1, -0.5), (1, 0)])
    >>> disk = geo.Disk(mass=1.0, inertia=1.0)
    >>> out = collide_modified(disk, notch, 0.001, [[0.00025, 0.0]], [[0.0, -2.0, 0.0]], spacing=np.pi / 32)
    >>> out.position.tolist(), out.velocity.tolist(), out.time.tolist()
    ([[0.00025, 0.0]], [[0.0, 2.0, 0.0]], [0.0005])
    """
    charts = RollingCharts(spacing)
    at, moving = checked_states(position, velocity)
    landed = _landing(charts, at[:, 1], moving)
    low = np.stack([at[:, 0] + moving[:, 0] * landed, moving[:, 1] * landed, at[:, 1] + moving[:, 2] * landed], axis=-1)
    start = charts.straighten(low)[:, [0, 2]]
    # the line x1 + alpha is unrolled: beside the satellite S_k it is k spacing farther, on the wall it is not
    lap = charts.nearest(low[:, 2]) * charts.spacing
    out = collide_cylinder(disk, wall, scale, start - np.stack([np.zeros_like(lap), lap], axis=-1), moving)
    back = charts.transfer(out.position, out.velocity) + np.stack([np.zeros_like(lap), lap], axis=-1)
    back.setflags(write=False)
    return CylinderCollision(back, out.velocity, out.time, out.contacts, out.status)


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
