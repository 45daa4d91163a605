"""Rays that leave each facet of a wall at an angle that the caller gives, as by a reflection law of the facets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..curves import columns as c
from ..curves.columns import Struct
from ..walls.wall import Wall
from .compiled.pieces.records import FLYING, NO_STATES, OPENING, States
from .threads import in_blocks
from .tracing import Status, entries

# Limit on the hits of a ray, some seconds of work for the last rays.
MOST_HITS = 100_000


@dataclass(frozen=True)
class FacetRays:
    """Rays on facets of a wall or on its openings; `advance` moves them on, and changes the arrays of ``states``."""

    wall: Wall
    states: States

    @classmethod
    def entering(cls, wall: Wall, x: Floats, theta: Floats) -> FacetRays:
        """Rays that enter at y = 0 as those of `geometry.trace`; those on flat tops have kind -1."""
        scene, count = wall.scene, len(x)
        at = entries(wall, x, theta)
        at -= np.floor(at / scene.cell) * scene.cell
        hollow = np.searchsorted(scene.hollows[:, c.LEFT], at, side="right") - 1
        is_flat = (hollow < 0) | (at >= scene.hollows[hollow, c.RIGHT]) if len(scene.hollows) else np.ones(count, bool)
        kind = np.where(is_flat & (not scene.is_open), -1, OPENING)
        # an opening, seen from below, has the free side on the left of (-1, 0)
        tangent = np.broadcast_to([-1.0, 0.0], (count, 2)).copy()
        point = np.column_stack([at, np.zeros(count)])
        return cls.leaving(wall, np.maximum(hollow, 0), kind, np.full(count, -1), point, tangent, np.array(theta))

    @classmethod
    def leaving(cls, wall: Wall, *start: NDArray[Any]) -> FacetRays:
        """Rays that leave segments, arcs or openings, by hollow, kind, number, point, tangent and angle of `States`."""
        hollow, kind, number, point, tangent, angle = map(np.ascontiguousarray, start)
        at, status = np.full(len(angle), -1.0), np.full(len(angle), FLYING, np.uint8)
        return cls(wall, States(NO_STATES.who, hollow, kind, number, at, point, tangent, angle, status))

    def advance(self, who: NDArray[np.int64], threads: int | None = None) -> NDArray[np.int64]:
        """Let some rays fly to their next facet, and return those that are on one, for any number of threads."""
        from ..scene.compiled.compiling import checked
        from .compiled.blocks import next_facets
        from .compiled.rays import SLOTS

        if not len(who):
            return who
        states, tables = Struct(self.states._replace(who=np.ascontiguousarray(who))), self.wall.scene.tables

        def run(part: slice) -> None:
            checked(lambda: next_facets(part.start, part.stop, states.address, tables.address, SLOTS.address))

        in_blocks(run, len(who), threads)
        return np.asarray(who[self.states.status[who] == FLYING])


def follow_facets(
    wall: Wall, x: Floats, theta: Floats, turn: Callable[[Floats, NDArray[np.int64]], Floats]
) -> tuple[Floats, NDArray[np.int64], NDArray[np.uint8]]:
    """Reflect rays, shape (n,), by facets whose law is ``turn``: outgoing angles, numbers of hits, and `Status`.

    ``turn`` takes the reversed arriving angles of some rays, in the frame of their facets, with the numbers of the
    rays, and returns the angles at which they leave. Rays that are still inside after `MOST_HITS` hits end with
    ``Status.BOUNCE_LIMIT``. The angle of a ray that does not escape is its incoming one.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> theta, hits, _ = follow_facets(geo.triangular_teeth(1.0), np.array([0.3]), np.array([1.2]), lambda a, _: a)
    >>> theta.round(12).tolist(), hits.tolist()
    ([1.2], [1])
    """
    rays = FacetRays.entering(wall, x, theta)
    kind, angle, status = rays.states.kind, rays.states.angle, rays.states.status
    hits = np.zeros(len(x), np.int64)
    is_flat = kind < 0
    flat, who = np.flatnonzero(is_flat), np.flatnonzero(~is_flat)
    if len(flat):
        angle[flat], hits[flat], status[flat] = turn(angle[flat], flat), 1, Status.ESCAPED
    for most in range(MOST_HITS + 1):
        who = rays.advance(who)
        if not len(who) or most == MOST_HITS:
            break
        hits[who] += 1
        angle[who] = turn(angle[who], who)
    status[who] = Status.BOUNCE_LIMIT
    return np.where(status == Status.ESCAPED, angle, theta), hits, status
