"""The deterministic collision of two disks with round satellites on their rims."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, instance, positive_number, whole_number
from ...core.errors import InputError
from ...core.kinds import explained, explained_class
from ...core.rounding import EPS
from ..disk.disk import Disk
from ..tracing.tracing import Status, StatusCounts

MAX_CONTACTS, MAX_STEPS = 1000, 100_000
# Distance at which satellites touch, relative to the size of the disks. Positions have some rounding errors.
TOUCHING = 32.0 * EPS
FEWEST = 3


@explained_class
@dataclass(frozen=True)
class SatelliteDisk:
    """A disk that touches other bodies with satellites only: equal round bumps, evenly spaced on its rim.

    Parameters
    ----------
    disk : Disk
        Mass and inertia.
    count : int
        Number of satellites, at least 3. Satellite k is at the angle alpha + 2 pi k/count.
    size : float
        The radius of a satellite; 0 for points.
    radius : float
        The radius of the rim, on which the satellites are centred.

    Raises
    ------
    InputError
        If a number is not in its range.

    Source: Rudzis 2022, section 1.3.1, where the satellites are points.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> round(geo.SatelliteDisk(geo.Disk(), 100, 0.05).spacing, 6)
    0.062832
    """

    disk: Disk
    count: int
    size: float
    radius: float = 1.0

    def __post_init__(self) -> None:
        instance("disk", self.disk, Disk, "geo.Disk(mass=1.0, inertia=0.5)")
        object.__setattr__(self, "count", whole_number("count", self.count, FEWEST))
        object.__setattr__(self, "radius", positive_number("radius", self.radius))
        if self.size != 0.0:
            object.__setattr__(self, "size", positive_number("size", self.size))

    @property
    def spacing(self) -> float:
        """The distance of neighbouring satellites along the rim."""
        return 2.0 * math.pi * self.radius / self.count


@dataclass(frozen=True)
class PairCollision(StatusCounts):
    """The results of `collide_pair` for n pairs.

    Attributes
    ----------
    position, velocity : arrays of shape (n, 2, 3)
        (x1, x2, alpha) and (v1, v2, omega) of the first and of the second disk, at the last contact; the initial ones
        if there was none.
    time : array of shape (n,)
        The time of the last contact.
    contacts : array of int, shape (n,)
    status : array of int, shape (n,)
        Values of `Status`. ``ESCAPED``: the disks separate, or never meet. ``CORNER``: two contacts at once, whose
        order double precision does not resolve. ``BOUNCE_LIMIT``: more contacts, or more steps, than allowed.
    """

    position: Floats
    velocity: Floats
    time: Floats
    contacts: NDArray[np.int64]
    status: NDArray[np.uint8]


@explained
def collide_pair(
    first: SatelliteDisk,
    second: SatelliteDisk,
    position: ArrayLike,
    velocity: ArrayLike,
    max_contacts: int = MAX_CONTACTS,
) -> PairCollision:
    r"""Collide two disks with satellites: free flight, and elastic contacts without friction of their satellites.

    At a contact both disks receive opposite impulses along the line between the centres of the satellites. This is the
    specular reflection in the kinetic metric of both bodies, and keeps the energy, the momentum and the angular
    momentum. If the satellites are small and close, the outgoing velocities are those of `PairLaw` of a wall of arcs:
    seen from the first disk, the satellites of the second have the radius s1 + s2.

    Parameters
    ----------
    first, second : SatelliteDisk
    position : array_like, shape (n, 2, 3)
        (x1, x2, alpha) of both disks, which must not touch.
    velocity : array_like, shape (n, 2, 3)
        (v1, v2, omega) of both disks.
    max_contacts : int
        Pairs with more contacts end with ``Status.BOUNCE_LIMIT``.

    Returns
    -------
    PairCollision

    Raises
    ------
    InputError
        If a shape is wrong, or two disks overlap at the start.

    Notes
    -----
    The first contact of two satellites is found by steps that cannot pass it. The distance of their centres has a
    second derivative of at least -A, A = a1 omega1^2 + a2 omega2^2, so that the first root of g + g' t - A t^2/2, with
    the gap g, is a safe step. Near the contact the steps converge like Newton's method. Cost: a millisecond a pair.

    Source: Rudzis 2022, sections 1.1.2 and 3, Proposition 3.2; the total angular momentum is kept, not the sum of the
    spins (Proposition 3.3 corrected).

    Examples
    --------
    Two satellites meet head on, on the line between the centres:

    >>> from asperity import geometry as geo
    >>> one = geo.SatelliteDisk(geo.Disk(), 4, 0.25)
    >>> hit = geo.collide_pair(one, one, [[[0, 0, 0], [4, 0, 0]]], [[[1, 0, 0], [0, 0, 0]]])
    >>> hit.time.tolist(), (hit.velocity[0].round(12) + 0.0).tolist(), hit.contacts.tolist()
    ([1.5], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [1])
    """
    for name, body in (("first", first), ("second", second)):
        instance(name, body, SatelliteDisk, "geo.SatelliteDisk(geo.Disk(), 100, 0.05)")
    if first.size + second.size <= 0.0:
        raise InputError("first, second: expected satellites of size greater than 0 on one disk; points do not touch")
    whole_number("max_contacts", max_contacts, 1)
    at, moving = finite_array("position", position).copy(), finite_array("velocity", velocity).copy()
    if at.ndim != 3 or at.shape[1:] != (2, 3) or moving.shape != at.shape:
        raise InputError(f"position, velocity: expected two arrays of shape (n, 2, 3), got {at.shape}, {moving.shape}")
    results = [_Encounter(first, second, x, w).run(max_contacts) for x, w in zip(at, moving, strict=True)]
    time, contacts, status = (np.array([result[k] for result in results]) for k in range(3))
    arrays = (at, moving, time.astype(np.float64), contacts.astype(np.int64), status.astype(np.uint8))
    for array in arrays:
        array.setflags(write=False)
    return PairCollision(*arrays)


class _Encounter:
    """One pair, whose position and velocity arrays (2, 3) are updated in place."""

    def __init__(self, first: SatelliteDisk, second: SatelliteDisk, position: Floats, velocity: Floats) -> None:
        self.bodies, self.position, self.velocity = (first, second), position, velocity
        self.reach = first.size + second.size
        self.span = first.radius + second.radius + self.reach
        # satellites that are further from the other rim than this cannot touch before the next step
        self.margin = max(first.spacing, second.spacing, self.reach)
        self.angles = [2.0 * math.pi * np.arange(body.count) / body.count for body in self.bodies]
        apart = float(np.hypot(*(position[0, :2] - position[1, :2])))
        if apart < first.radius + second.radius:
            raise InputError(f"position: expected disks whose rims do not cross, got centres at distance {apart:.6g}")
        _, gaps, _ = self.gaps(position)
        if gaps.size and gaps.min() < -TOUCHING * self.span:
            raise InputError(f"position: expected disks that do not touch, got satellites {-gaps.min():.3g} too close")

    def run(self, max_contacts: int) -> tuple[float, int, int]:
        """Return the time of the last contact, the number of contacts and the status."""
        clock = elapsed = 0.0
        contacts = 0
        for _ in range(MAX_STEPS):
            here = self.position + self.velocity * elapsed
            if self.separating(here) or not self.fastest() > 0.0:
                return clock, contacts, Status.ESCAPED
            step, touching = self.safe_step(here)
            if touching is None:
                elapsed += step
                continue
            if len(touching) > 1:
                return clock, contacts, Status.CORNER
            if contacts == max_contacts:
                break
            clock, contacts, elapsed = clock + elapsed, contacts + 1, 0.0
            self.position[:] = here
            self.kick(touching[0])
        return clock, contacts, Status.BOUNCE_LIMIT

    def separating(self, here: Floats) -> bool:
        """Whether the disks are out of reach and do not come back, or miss each other."""
        offset, relative = here[0, :2] - here[1, :2], self.velocity[0, :2] - self.velocity[1, :2]
        if np.hypot(*offset) <= self.span:
            return False
        closing, speed = float(offset @ relative), float(np.hypot(*relative))
        across = abs(offset[0] * relative[1] - offset[1] * relative[0])
        return bool(closing >= 0.0 or across > self.span * speed)

    def fastest(self) -> float:
        """The largest possible speed of a satellite of one disk relative to one of the other."""
        plane = np.hypot(*(self.velocity[0, :2] - self.velocity[1, :2]))
        spins = zip(self.bodies, self.velocity[:, 2], strict=True)
        return float(plane) + sum(body.radius * abs(float(spin)) for body, spin in spins)

    def gaps(self, here: Floats) -> tuple[list[Floats], Floats, Floats]:
        """Return the arms (k, 2) of satellites near the other rim, the gaps between them, and unit normals."""
        arms = []
        for k, body in enumerate(self.bodies):
            turn = here[k, 2] + self.angles[k]
            arm = body.radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            far = np.hypot(*(here[k, :2] + arm - here[1 - k, :2]).T) - self.bodies[1 - k].radius - self.reach
            arms.append(arm[far < self.margin])
        between = (here[0, :2] - here[1, :2]) + arms[0][:, None] - arms[1][None, :]
        distance = np.hypot(between[..., 0], between[..., 1])
        normal = between / np.maximum(distance, EPS)[..., None]
        return arms, distance - self.reach, normal

    def safe_step(self, here: Floats) -> tuple[float, list[tuple[Floats, Floats, Floats]] | None]:
        """Return a time in which no contact begins, or the contacts (arm, arm, normal) that there are now."""
        (one, two), (spin1, spin2) = self.velocity[:, :2], self.velocity[:, 2]
        fastest = self.fastest()
        apart = float(np.hypot(*(here[0, :2] - here[1, :2]))) - self.span
        if apart > self.margin:
            return 0.5 * apart / fastest, None
        arms, gap, normal = self.gaps(here)
        limit = self.margin / fastest
        if not gap.size:
            return limit, None
        velocity = (one + spin1 * _spin_velocities(arms[0]))[:, None] - (two + spin2 * _spin_velocities(arms[1]))[
            None, :
        ]
        rate = np.sum(velocity * normal, axis=-1)
        touching = np.argwhere((gap <= TOUCHING * self.span) & (rate < 0.0))
        if len(touching):
            return 0.0, [(arms[0][i], arms[1][j], normal[i, j]) for i, j in touching]
        bend = sum(body.radius * spin**2 for body, spin in zip(self.bodies, (spin1, spin2), strict=True))
        gap = np.maximum(gap, 0.0)
        root = np.sqrt(rate**2 + 2.0 * bend * gap)
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.where(rate < 0.0, 2.0 * gap / (root - rate), (root + rate) / bend)
        # without spins separating satellites do not come back
        return min(limit, float(np.min(np.where(np.isnan(steps), np.inf, steps)))), None

    def kick(self, contact: tuple[Floats, Floats, Floats]) -> None:
        """Reflect the velocities at a contact."""
        arm1, arm2, normal = contact
        levers = [arm[0] * normal[1] - arm[1] * normal[0] for arm in (arm1, arm2)]
        (disk1, disk2), (one, two) = (body.disk for body in self.bodies), self.velocity
        rate = (one[:2] - two[:2]) @ normal + one[2] * levers[0] - two[2] * levers[1]
        ease = 1.0 / disk1.mass + 1.0 / disk2.mass + levers[0] ** 2 / disk1.inertia + levers[1] ** 2 / disk2.inertia
        impulse = -2.0 * rate / ease
        for sign, disk, lever, moving in ((1.0, disk1, levers[0], one), (-1.0, disk2, levers[1], two)):
            moving[:2] += sign * impulse / disk.mass * normal
            moving[2] += sign * impulse * lever / disk.inertia


def _spin_velocities(arms: Floats) -> Floats:
    """The velocities of satellites (k, 2) for spin 1."""
    return np.stack([-arms[:, 1], arms[:, 0]], axis=1)
