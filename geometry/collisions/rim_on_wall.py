"""The deterministic collision of a disk with satellites of any sizes and places, or with teeth, and a rough wall."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, instance, number_between, whole_number
from ...core.errors import InputError
from ..disk.disk import Features, SatelliteDisk
from ..tracing.tracing import Status
from ..walls.wall import Wall
from .encounter import MAX_CONTACTS, Encounter, largest_bend_of
from .records import DiskResults, results_for
from .rigid import RigidCollision, checked_states, marked

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
    instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
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
