"""Two rigid bodies with satellites and edges: free flight to the first contact, and the elastic impact there.

The bodies are two disks, or a disk with satellites of any sizes and positions, or with teeth, and a rough wall.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, instance, number_between, whole_number
from ...core.errors import InputError
from ...core.rounding import EPS
from ..disk.disk import Disk, Features, SatelliteDisk
from ..tracing.tracing import Status
from ..walls.wall import Wall
from .rigid import DiskResults, RigidCollision, check_kinds, checked_states, marked, results_for

MAX_CONTACTS, MAX_STEPS = 1000, 100_000
# Distance at which bodies touch, relative to the size of the region. Positions have some rounding errors.
TOUCHING = 32.0 * EPS
# (x, y) turned by a quarter is (y, x) times this.
TURN = np.array([-1.0, 1.0])


class Surroundings(Protocol):
    """What a pair of bodies looks like for the search: only bodies that are near each other are compared."""

    span: float  # of the region, for rounding errors
    margin: float  # features closer than this are compared, and no step is longer

    def apart(self, here: Floats) -> float:
        """Return a lower bound on the distance of both bodies."""

    def near(self, here: Floats) -> tuple[Features, Features]:
        """Return the features of both bodies that can touch before the next step."""

    def is_over(self, here: Floats, velocity: Floats) -> bool:
        """Return whether no contact can follow."""


class Contact(NamedTuple):
    """The contact point relative to both bodies, and the unit normal from the second to the first."""

    first: Floats
    second: Floats
    normal: Floats


class Pairs(NamedTuple):
    """Pairs of features: gaps, their rates and bounds on the second derivatives, whether a gap of 0 is a contact."""

    gap: Floats
    rate: Floats
    bend: Floats
    real: Floats
    first: Floats
    second: Floats
    normal: Floats


@dataclass
class Encounter:
    """Two bodies whose position and velocity arrays (2, 3) are updated in place; a disk that is None stands still."""

    disks: tuple[Disk, Disk | None]
    radii: tuple[float, float]
    around: Surroundings
    position: Floats
    velocity: Floats
    # angles of the contacts from the first axis of the first body
    angles: list[float] = field(default_factory=list)

    def run(self, max_contacts: int) -> tuple[float, int, int]:
        """Return the time of the last contact, the number of contacts and the status."""
        clock = elapsed = 0.0
        contacts = 0
        for _ in range(MAX_STEPS):
            here = self.position + self.velocity * elapsed
            if self.around.is_over(here, self.velocity) or not self.fastest() > 0.0:
                return clock, contacts, Status.ESCAPED
            step, touching = self.safe_step(here)
            if not touching:
                elapsed += step
                continue
            if len(touching) > 1:
                return clock, contacts, Status.CORNER
            if contacts == max_contacts:
                break
            clock, contacts, elapsed = clock + elapsed, contacts + 1, 0.0
            self.position[:] = here
            arm = touching[0].first
            self.angles.append(math.atan2(arm[1], arm[0]) - float(here[0, 2]))
            self.kick(touching[0])
        return clock, contacts, Status.BOUNCE_LIMIT

    def fastest(self) -> float:
        """Return the largest possible speed of a point of one body relative to one of the other."""
        plane = np.hypot(*(self.velocity[0, :2] - self.velocity[1, :2]))
        return float(plane) + sum(r * abs(float(w)) for r, w in zip(self.radii, self.velocity[:, 2], strict=True))

    def safe_step(self, here: Floats) -> tuple[float, list[Contact]]:
        """Return a time in which no contact begins, or the contacts that there are now."""
        fastest, around = self.fastest(), self.around
        apart = around.apart(here)
        if apart > around.margin:
            return 0.5 * apart / fastest, []
        tolerance, step = TOUCHING * around.span, around.margin / fastest
        touching: list[Contact] = []
        for pairs in self.pairs(here):
            met = pairs.real.astype(bool) & (np.abs(pairs.gap) <= tolerance) & (pairs.rate < 0.0)
            for k in np.flatnonzero(met):
                contact = Contact(pairs.first[k], pairs.second[k], pairs.normal[k])
                # at the joint of two edges in one line there is one contact
                if not any(_is_same(contact, other, tolerance) for other in touching):
                    touching.append(contact)
            # a line beside its edge may be crossed from either side
            gap, rate = np.abs(pairs.gap), np.where(pairs.gap < 0.0, -pairs.rate, pairs.rate)
            root = np.sqrt(rate**2 + 2.0 * pairs.bend * gap)
            with np.errstate(divide="ignore", invalid="ignore"):
                steps = np.where(rate < 0.0, 2.0 * gap / (root - rate), (root + rate) / pairs.bend)
            step = min(step, float(np.min(np.where(np.isnan(steps), np.inf, steps), initial=math.inf)))
        return max(step, 0.5 * tolerance / fastest), touching

    def pairs(self, here: Floats) -> Iterator[Pairs]:
        """Yield the pairs of satellites, of satellites with edges, and of edges with satellites."""
        one, two = self.around.near(here)
        between = here[0, :2] - here[1, :2]
        reach = (one.sizes[:, np.newaxis] + two.sizes[np.newaxis, :]).ravel()
        # points do not meet points
        i, j = (k[reach > 0.0] for k in np.indices((len(one.arms), len(two.arms))).reshape(2, -1))
        if len(i):
            a, b = one.arms[i], two.arms[j]
            apart = between + a - b
            distance = np.hypot(apart[:, 0], apart[:, 1])
            normal = apart / np.maximum(distance, EPS)[:, np.newaxis]
            rate = np.sum((self.speeds(0, a) - self.speeds(1, b)) * normal, axis=1)
            pull = sum(r * w**2 for r, w in zip(self.radii, self.velocity[:, 2], strict=True))
            gap = np.maximum(distance - reach[reach > 0.0], 0.0)
            yield Pairs(gap, rate, np.full(len(i), pull), np.ones(len(i)), a, b, normal)
        for number, points, edges in ((0, one, two), (1, two, one)):
            if len(points.arms) and len(edges.starts):
                yield self.points_on_edges(number, points, edges, between if number == 0 else -between)

    def points_on_edges(self, number: int, points: Features, edges: Features, between: Floats) -> Pairs:
        """Return the pairs of satellites of body ``number`` with edges of the other one, which is ``between`` away.

        The height h = n.(X + a) over the line of an edge, X = ``between``, has |h''| <= w_B^2 |X + a| + 2 |w_B| (|V| +
        |w_A| |a|) + w_A^2 |a|, with the spins w of both bodies.
        """
        i, j = np.indices((len(points.arms), len(edges.starts))).reshape(2, -1)
        a, n, first = points.arms[i], edges.normals[j], edges.starts[j]
        along = edges.ends[j] - first
        where = between + a
        part = np.sum((where - first) * along, axis=1) / np.sum(along**2, axis=1)
        gap = np.sum((where - first) * n, axis=1) - points.sizes[i] - edges.width
        other = 1 - number
        rate = np.sum((self.speeds(number, a) - self.speeds(other, where)) * n, axis=1)
        own, its = abs(self.velocity[number, 2]), abs(self.velocity[other, 2])
        arm, distance = np.hypot(a[:, 0], a[:, 1]), np.hypot(where[:, 0], where[:, 1]) + self.around.margin
        plane = float(np.hypot(*(self.velocity[0, :2] - self.velocity[1, :2])))
        # arms of a body that stands still are positions, not levers
        arm = np.minimum(arm, self.radii[number])
        bend = its**2 * distance + 2.0 * its * (plane + own * arm) + own**2 * arm
        real = (part >= 0.0) & (part <= 1.0)
        levers = (a, where) if number == 0 else (where, a)
        return Pairs(gap, rate, bend, real, *levers, n if number == 0 else -n)

    def speeds(self, number: int, arms: Floats) -> Floats:
        """Return the velocities of points (n, 2) that are fixed to a body."""
        plane, spin = self.velocity[number, :2], self.velocity[number, 2]
        return np.asarray(plane + (spin * arms)[:, ::-1] * TURN)

    def kick(self, contact: Contact) -> None:
        """Reflect the velocities at a contact, specularly in the kinetic metric of both bodies."""
        normal, rate, ease, levers = contact.normal, 0.0, 0.0, []
        sides = zip((1.0, -1.0), self.disks, (contact.first, contact.second), self.velocity, strict=True)
        for sign, disk, arm, moving in sides:
            lever = arm[0] * normal[1] - arm[1] * normal[0]
            levers.append(lever)
            rate += sign * (moving[:2] @ normal + moving[2] * lever)
            if disk is not None:
                ease += 1.0 / disk.mass + lever**2 / disk.inertia
        impulse = -2.0 * rate / ease
        for sign, disk, lever, moving in zip((1.0, -1.0), self.disks, levers, self.velocity, strict=True):
            if disk is not None:
                moving[:2] += sign * impulse / disk.mass * normal
                moving[2] += sign * impulse * lever / disk.inertia


def largest_bend_of(*bodies: SatelliteDisk) -> float:
    """Return the largest curvature of round satellites of bodies, 0 for points."""
    sizes = np.concatenate([body.sizes for body in bodies])
    return float((1.0 / sizes[sizes > 0.0]).max(initial=0.0))


def _is_same(one: Contact, other: Contact, tolerance: float) -> bool:
    apart = np.abs(np.array(one) - np.array(other)).max(axis=1)
    return bool(np.all(apart <= [tolerance, tolerance, TOUCHING]))


# No step moves a point by more than this part of a period, so that it stays in the cells that are looked at.
STRIDE = 0.5
# Sine of the angle between neighbouring edges that are one.
STRAIGHT = 1e-12
# A period that is longer has positions rounded to more than 1e-7 of the disk.
LARGEST_SCALE = 1e9


def collide_rim(
    body: SatelliteDisk,
    wall: Wall,
    scale: float,
    position: ArrayLike,
    velocity: ArrayLike,
    *,
    max_contacts: int = MAX_CONTACTS,
) -> RigidCollision:
    r"""Collide a disk with any satellites, or with teeth, and a rough wall of straight pieces.

    `collide` is the same for equally spaced points, much faster and for walls of all kinds. Satellites may have unequal
    spacings and sizes, and overlap to arcs; joined ones are teeth, which also touch the tips of the wall with their
    edges. At x2 = 0 the largest circle around the disk just clears the tops. A contact is frictionless and elastic.

    Parameters
    ----------
    body : SatelliteDisk
        With a disk of radius 1, as in `collide`.
    wall : Wall
        Polygonal, without islands, with its highest points at height 0. Others can be replaced by
        ``Wall.from_vertices(wall.outline(tolerance))``.
    scale : float
        eps, greater than 0: the period is ``scale * wall.period``.
    position : array_like, shape (n, 2)
        (x1, alpha) at x2 = 0; satellite k is at the angle alpha + ``body.turns[k]`` from the lowest point, against the
        clock.
    velocity : array_like, shape (n, 3)
        Incoming (v1, v2, omega) with v2 < 0.
    max_contacts : int
        Disks with more contacts end with ``DiskStatus.BOUNCE_LIMIT``.

    Returns
    -------
    RigidCollision
        ``two_satellites`` tells whether the contacts were nearest to different satellites.

    Raises
    ------
    InputError
        If a shape is wrong, some v2 is not negative, the wall is of another kind, or an edge of the disk is as long as
        its radius.

    Notes
    -----
    The first contact is found by safe steps as in `collide_pair`. Cost: some 10 milliseconds a collision.

    Source: Rudzis 2022, sections 1.3.1 to 1.3.5 and remark 1.13.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> gear = geo.SatelliteDisk(geo.Disk(), 24, 0.0, [1.0, 0.9] * 12, joined=True)
    >>> hit = geo.collide_rim(gear, geo.flat(), 0.01, [[0.0, 0.0]], [[0.0, -1.0, 0.0]])
    >>> hit.velocity.round(12).tolist(), hit.contacts.tolist()
    ([[0.0, 1.0, 0.0]], [1])
    """
    instance("body", body, SatelliteDisk, "geo.SatelliteDisk(geo.Disk(), 100, 0.05)")
    check_kinds(body.disk, wall)
    eps = number_between("scale", scale, 0.0, LARGEST_SCALE)
    if not wall.is_polygonal or wall.islands or wall.origin[1] != 0.0:
        raise InputError(
            "wall: expected straight pieces without islands and highest points at height 0; a curved wall can be "
            "replaced by Wall.from_vertices(wall.outline(tolerance))"
        )
    whole_number("max_contacts", max_contacts, 1)
    at, moving = checked_states(position, velocity)
    periods = np.abs(at[:, 0]).max(initial=0.0) / (eps * wall.period)
    number_between("position in periods", periods, 0.0, 1e15, closed="low")
    around = _AboveWall(body, wall, eps)

    def collided(at: Floats, moving: Floats) -> DiskResults:
        results = results_for(len(at))
        for k, (x, w) in enumerate(zip(at, moving, strict=True)):
            # the wall is the second body and stands still; alpha counts from the lowest point
            moved = math.floor(x[0] / around.period) * around.period
            state = np.array([[x[0] - moved, 0.0, x[1] - 0.5 * math.pi], [0.0, 0.0, 0.0]])
            speeds = np.array([w, [0.0, 0.0, 0.0]])
            encounter = Encounter((body.disk, None), (body.largest, 0.0), around, state, speeds)
            time, contacts, status = encounter.run(max_contacts)
            rest = -state[0, 1] / speeds[0, 1] if status == Status.ESCAPED else 0.0
            end = state[0] + rest * speeds[0]
            results.position[k] = end[0] + moved, end[2] + 0.5 * math.pi
            results.velocity[k], results.time[k] = speeds[0], time + rest
            results.contacts[k], results.status[k] = contacts, status
            apart = np.array(encounter.angles)[:, np.newaxis] - body.turns
            nearest = np.argmax(np.cos(apart), axis=1)
            results.two_satellites[k] = len(set(nearest.tolist())) > 1
        return results

    bend = eps * (wall.period + wall.depth) * (1.0 + largest_bend_of(body))
    return RigidCollision(*marked(collided, (at, moving), body.disk, bend, (eps, body.spacing)))


class _AboveWall:
    """The surroundings of a disk above a wall, whose tops are at the height -``body.largest``."""

    def __init__(self, body: SatelliteDisk, wall: Wall, scale: float) -> None:
        self.body, self.period = body, scale * wall.period
        corners = scale * wall.vertices
        self.corners = corners - np.array([0.0, body.largest])
        along = np.diff(corners, axis=0)
        before = np.roll(along, 1, axis=0)
        turns = before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0]
        # corners at which the solid is convex; edges cannot reach the others
        self.is_tip = turns < -STRAIGHT * np.hypot(*before.T) * np.hypot(*along.T)
        self.span = 2.0 * body.largest + scale * wall.depth
        self.margin = STRIDE * self.period
        longest = float(np.hypot(*np.diff(body.arms(0.0), axis=0, append=body.arms(0.0)[:1]).T).max())
        if body.joined and longest >= body.largest:
            raise InputError(f"body: expected edges shorter than the radius {body.largest:.6g}, got {longest:.6g}")
        # how many cells to either side edges and round satellites reach
        widest = max(longest * body.joined, 2.0 * float(body.sizes.max()))
        self.beside = 1 + math.ceil(widest / self.period)

    def apart(self, here: Floats) -> float:
        """Return the height of the lowest satellite above the tops."""
        return float((self.body.arms(here[0, 2])[:, 1] - self.body.sizes).min()) + float(here[0, 1]) + self.body.largest

    def near(self, here: Floats) -> tuple[Features, Features]:
        """Return the satellites and edges next to the tops or below, and the corners and edges of the cells there."""
        arms = self.body.arms(here[0, 2])
        low = here[0, 1] + arms[:, 1] - self.body.sizes < self.margin - self.body.largest
        cells = np.floor((here[0, 0] + arms[low, 0]) / self.period).astype(np.int64)
        shifts = np.unique(cells[:, np.newaxis] + np.arange(-self.beside, self.beside + 1))[:, np.newaxis, np.newaxis]
        corners = self.corners + shifts * np.array([self.period, 0.0])
        starts, ends = corners[:, :-1].reshape(-1, 2), corners[:, 1:].reshape(-1, 2)
        along = (ends - starts) / np.hypot(*(ends - starts).T)[:, np.newaxis]
        # the free side is on the left
        normals = np.stack([-along[:, 1], along[:, 0]], axis=1)
        tips = corners[:, :-1][:, self.is_tip].reshape(-1, 2)
        wall = Features(tips, np.zeros(len(tips)), starts, ends, normals, 0.0)
        return self.body.features(here[0, 2], low), wall

    def is_over(self, here: Floats, velocity: Floats) -> bool:
        """Whether the disk is back at height 0 or higher."""
        return bool(velocity[0, 1] > 0.0 and here[0, 1] >= 0.0)
