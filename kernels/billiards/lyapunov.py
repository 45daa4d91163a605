"""The largest Lyapunov exponent of a disk in a container with smooth and no-slip walls, from starts in equilibrium."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, Rng, check_memory, generator, instance, whole_number
from ...core.errors import AccuracyError, InputError
from ...core.estimates import Estimate, student_95
from ...core.long_runs import reported
from ...geometry import Container, Disk
from ...geometry.tables.boundary import FlightStatus, Touch
from ..collisions.collision_law import CollisionLaw
from ..collisions.operator import no_slip_matrix, smooth_matrix
from ..laws.law import IsometryLaw
from .billiard import Reflector, laws_of_walls

# The exponent is measured between the last two of these fractions of the collisions, and for comparison between the
# first two. A perturbation that grows like the p-th power of the time gives p ln 4 over 3/4 of the time, and four times
# as much between the first two.
MARKS = (0.0625, 0.25, 1.0)
# Fraction of the difference between both that is added to the error: of a growth by powers, whose exponent is 0, it is
# 1.5 times the value.
DRIFT = 0.5
LEAST_COLLISIONS, LEAST_TRAJECTORIES = 64, 8


@reported("Lyapunov exponent")
def lyapunov_exponent(
    container: Container,
    laws: Reflector | Sequence[Reflector],
    collisions: int = 1000,
    trajectories: int = 200,
    rng: Rng = None,
) -> Estimate:
    """Estimate the largest Lyapunov exponent of a disk in a container, per unit of time.

    The disk has the kinetic energy of a disk that flies with speed 1 without spin. Starts are drawn from the invariant
    measure of the billiard map, with spin 0 if all walls are smooth (the spin is then constant) and else uniform on the
    sphere of that energy. Each has a perturbation, which the derivatives of flights and collisions carry along.

    Parameters
    ----------
    container : Container
        A polygon, or curves with an outer loop.
    laws : CollisionLaw or sequence of CollisionLaw
        ``smooth(disk)`` or ``no_slip(disk)``, one for all walls or one per wall.
    collisions : int
        Collisions of each trajectory, at least 64. The first quarter turns the perturbation into the direction that
        grows, and does not count.
    trajectories : int
        Number of independent starts, at least 8.
    rng : None, int or numpy.random.Generator

    Returns
    -------
    Estimate
        The mean growth of the logarithm of a perturbation, divided by the mean time. The error is the half width of
        95 % from the independent trajectories, plus half of the difference to the exponent between 1/16 and 1/4 of the
        collisions. The second part is larger than an exponent that vanishes in the limit because perturbations grow
        like a power of the time, as in polygons, smooth or no-slip. If the table is not ergodic the value is the mean
        over the energy surface.

    Raises
    ------
    InputError
        If the container has no outer loop, a law is neither smooth nor no-slip, or a number is too small.
    AccuracyError
        If fewer than 8 trajectories are resolved; one that runs into a corner does not count.

    Notes
    -----
    At a collision with a wall of curvature k the velocity u = (v1, v2, r omega) becomes A u, where A is the velocity
    matrix rotated into the direction of the tangent. Perturbations change by

        dq' = dq + (v - v') dt,   du' = A du + k ds (Z A - A Z) u,   dt = -(dq.n)/(v.n),   ds = (dq + v dt).t,

    with the unit normal n, the unit tangent t and the generator Z of rotations of (v1, v2).

    Source: Rudzis 2022, eq. 2.25 for A; C. Dellago, H. A. Posch and W. G. Hoover, Phys. Rev. E 53 (1996) for the
    derivative of specular collisions, which is the case A = A_smooth.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> smooth = ker.smooth(geo.Disk())
    >>> chaos = ker.lyapunov_exponent(geo.Container.sinai(2.0, 0.5), smooth, 400, 100, rng=0)
    >>> order = ker.lyapunov_exponent(geo.Container.circle(1.0), smooth, 400, 100, rng=0)
    >>> chaos.value > 10 * chaos.error, order.value < order.error
    (True, True)
    """
    instance("container", container, Container, "geo.Container.stadium()")
    container = container.closed()
    each = laws_of_walls(container, laws)
    matrices = [_velocity_matrix(law) for law in each]
    whole_number("collisions", collisions, LEAST_COLLISIONS)
    n = whole_number("trajectories", trajectories, LEAST_TRAJECTORIES)
    check_memory("trajectories", "their states", 64 * n)
    rng = generator(rng)
    spinning = not all(law.law == IsometryLaw(retro=False) for law in each if isinstance(law, CollisionLaw))
    pencil = Pencil.around(*equilibrium_starts(container, each[0].disk, n, spinning, rng), rng)
    marks, marked = [round(part * collisions) for part in MARKS], []
    for step in range(1, collisions + 1):
        pencil = pencil.after_collision(container, matrices)
        if step in marks:
            marked.append(pencil)
    kept = pencil.resolved
    if kept.sum() < LEAST_TRAJECTORIES:
        raise AccuracyError(
            f"{n - kept.sum()} of {n} trajectories ended at a corner, or along a wall; take another rng", math.inf
        )
    (early, _), (late, spread) = (_rate(first, last, kept) for first, last in pairwise(marked))
    method = (
        f"{kept.sum()} trajectories of {collisions} collisions, the last three quarters; 95 % from their scatter "
        f"({spread:.2g}), plus {DRIFT:g} of the difference to an earlier quarter; {n - kept.sum()} not resolved"
    )
    return Estimate(late, spread + DRIFT * abs(late - early), "estimate", method)


def _rate(first: Pencil, last: Pencil, kept: NDArray[np.bool_]) -> tuple[float, float]:
    """The ratio of the mean growth to the mean time between two collisions, with the 95 % half width."""
    grown, passed = (last.growth - first.growth)[kept], (last.time - first.time)[kept]
    rate = float(grown.sum() / passed.sum())
    deviation = float(np.std(grown - rate * passed, ddof=1)) / (float(passed.mean()) * math.sqrt(len(grown)))
    return rate, student_95(len(grown)) * deviation


def _velocity_matrix(law: Reflector) -> Floats:
    if not isinstance(law, CollisionLaw) or not isinstance(law.law, IsometryLaw):
        raise InputError(
            f"laws: expected ker.smooth(disk) or ker.no_slip(disk), got {law!r}; a random law has no derivative that "
            "is the same for neighbouring trajectories"
        )
    return no_slip_matrix(law.disk) if law.law.retro else smooth_matrix(law.disk)


@dataclass(frozen=True)
class Pencil:
    """Disks, each with an infinitesimally close neighbour.

    Attributes
    ----------
    position, velocity : arrays, shapes (n, 2) and (n, 3)
    wall : array of int, shape (n,)
    shift, tilt : arrays, shapes (n, 2) and (n, 3)
        Differences to the neighbour in position and velocity, scaled to norm 1.
    growth : array, shape (n,)
        Logarithm of the factor by which the difference has grown.
    time : array, shape (n,)
    resolved : array of bool, shape (n,)
        False from a collision on that double precision does not resolve, at which the state stays.
    """

    position: Floats
    velocity: Floats
    wall: NDArray[np.int64]
    shift: Floats
    tilt: Floats
    growth: Floats
    time: Floats
    resolved: NDArray[np.bool_]

    @classmethod
    def around(cls, position: Floats, velocity: Floats, wall: NDArray[np.int64], rng: np.random.Generator) -> Pencil:
        """Return disks with neighbours in random directions."""
        n = len(position)
        difference = rng.standard_normal((n, 5))
        difference /= np.sqrt(np.sum(difference**2, axis=1))[:, None]
        return cls(position, velocity, wall, difference[:, :2], difference[:, 2:], np.zeros(n), np.zeros(n),
                   np.ones(n, dtype=bool))  # fmt: skip

    def after_collision(self, container: Container, matrices: Sequence[Floats]) -> Pencil:
        """Return the disks and their neighbours after the next collision of each."""
        flight, wall, status = container.next_wall(self.position, self.velocity, self.wall)
        resolved = self.resolved & (status == FlightStatus.FLYING)
        flight, wall = np.where(resolved, flight, 0.0), np.where(resolved, wall, -1)
        position = self.position + self.velocity[:, :2] * flight[:, None]
        velocity = self.velocity.copy()
        shift, tilt = self.shift + self.tilt[:, :2] * flight[:, None], self.tilt.copy()
        for k, matrix in enumerate(matrices):
            here = np.flatnonzero(wall == k)
            if here.size:
                point = container.touch(k, position[here])
                position[here] = point.position
                velocity[here], shift[here], tilt[here] = reflected_pair(
                    matrix, point, velocity[here], shift[here], tilt[here]
                )
        size = np.sqrt(np.sum(shift**2, axis=1) + np.sum(tilt**2, axis=1))
        scaled = shift / size[:, None], tilt / size[:, None]
        return Pencil(position, velocity, wall, *scaled, self.growth + np.log(size), self.time + flight, resolved)


def reflected_pair(
    matrix: Floats, point: Touch, velocity: Floats, shift: Floats, tilt: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return velocity, shift and tilt after a collision, by the derivatives in `lyapunov_exponent`."""
    tangent, normal = point.tangent, point.normal
    turn = np.zeros((len(tangent), 3, 3))
    # columns: tangent, normal and spin
    turn[:, :2, 0], turn[:, :2, 1], turn[:, 2, 2] = tangent, normal, 1.0
    rotated = turn @ matrix @ np.swapaxes(turn, 1, 2)
    plane = velocity[:, :2]
    delay = np.sum(shift * normal, axis=1) / -point.incoming(velocity)[:, 1]
    along = np.sum((shift + plane * delay[:, None]) * tangent, axis=1)
    after = _times(rotated, velocity)
    bend = _quarter_turn(after) - _times(rotated, _quarter_turn(velocity))
    new_shift = shift + (plane - after[:, :2]) * delay[:, None]
    return after, new_shift, _times(rotated, tilt) + (point.curvature * along)[:, None] * bend


def _times(matrices: Floats, vectors: Floats) -> Floats:
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def _quarter_turn(velocity: Floats) -> Floats:
    """Z u: the derivative of u with respect to a rotation of (v1, v2)."""
    return np.stack([-velocity[:, 1], velocity[:, 0], np.zeros(len(velocity))], axis=1)


def equilibrium_starts(
    container: Container, disk: Disk, count: int, spinning: bool, rng: np.random.Generator
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Draw starts on the boundary: positions (n, 2), outgoing velocities (n, 3) and walls (n,).

    Positions are uniform in arc length. Velocities have the energy of speed 1 without spin; their density is the normal
    velocity, on the half circle, or with spin on the half sphere in the kinetic metric. Every deterministic or
    symmetric law of the walls preserves this measure (Rudzis 2022, Lemma 6.2).
    """
    # without an outer loop there is no perimeter
    position, wall = container.point_at(container.perimeter * rng.random(count))
    tangent, normal = container.frames(position, wall)
    if spinning:
        radius, angle = np.sqrt(rng.random(count)), rng.uniform(0.0, 2.0 * math.pi, count)
        along, spin = radius * np.cos(angle), radius * np.sin(angle)
        up = np.sqrt(np.maximum((1.0 - radius) * (1.0 + radius), 0.0))
    else:
        along, spin = rng.uniform(-1.0, 1.0, count), np.zeros(count)
        up = np.sqrt((1.0 - along) * (1.0 + along))
    plane = along[:, None] * tangent + up[:, None] * normal
    rim = spin / math.sqrt(disk.inertia_ratio)
    return position, np.concatenate([plane, rim[:, None]], axis=1), wall
