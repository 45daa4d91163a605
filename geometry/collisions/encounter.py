"""Two rigid bodies with satellites and edges: free flight to the first contact, and the elastic impact there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from ...core.checks import Floats
from ...core.rounding import EPS
from ..disk.disk import Disk, Features, SatelliteDisk
from ..tracing.tracing import Status

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
