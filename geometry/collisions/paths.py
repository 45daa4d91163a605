"""The path of one collision of the disk with satellites, from contact to contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array
from ...core.errors import InputError
from ..disk.disk import Disk
from ..walls.wall import Wall
from .rigid import collide

MOST_CONTACTS = 200


def collision_path(
    disk: Disk, wall: Wall, scale: float, position: ArrayLike, velocity: ArrayLike, spacing: float | None = None
) -> Floats:
    """Return the configurations (x1, x2, alpha) of one disk at height 0, at k contacts, and at height 0 again.

    Parameters
    ----------
    disk, wall, scale, spacing
        As in `collide`.
    position : array_like, shape (2,)
    velocity : array_like, shape (3,)

    Returns
    -------
    ndarray, shape (k + 2, 3)

    Raises
    ------
    InputError
        As in `collide`, and if the disk does not come back or has more than 200 contacts.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> path = collision_path(geo.Disk(), geo.triangular_teeth(2.0), 0.01, [0.0025, 0.0], [0.0, -1.0, 0.0])
    >>> path.shape, bool(path[0, 1] == 0.0), bool(path[1, 1] < 0.0), abs(float(path[-1, 1])) < 1e-15
    ((4, 3), True, True, True)
    """
    start, moving = finite_array("position", position)[None], finite_array("velocity", velocity)[None]
    whole = collide(disk, wall, scale, start, moving, spacing)
    contacts = int(whole.contacts[0])
    if not whole.escaped[0] or contacts > MOST_CONTACTS:
        state = next(name for name, count in whole.counts().items() if count)
        raise InputError(
            f"position, velocity: expected a disk that comes back after at most {MOST_CONTACTS} contacts, got {state} "
            f"after {contacts}"
        )
    # a run limited to k contacts ends at contact k + 1; the heights follow from the times
    states = [(start[0], moving[0], 0.0)]
    legs = [collide(disk, wall, scale, start, moving, spacing, max_contacts=k) for k in range(1, contacts)]
    states += [(leg.position[0], leg.velocity[0], float(leg.time[0])) for leg in [*legs, whole]]
    height, path = 0.0, [(*start[0], 0.0)]
    if contacts:
        first = _first_time(disk, wall, scale, start, moving, spacing, states[-1] if contacts == 1 else states[1])
        path.append((*(start[0] + moving[0, [0, 2]] * first), moving[0, 1] * first))
        height, before = moving[0, 1] * first, first
        for configuration, w, at in states[1:]:
            height += w[1] * (at - before)
            before = at
            path.append((*configuration, height))
    else:
        path.append((*whole.position[0], 0.0))
    return np.array([(x1, x2, alpha) for x1, alpha, x2 in path])


def _first_time(
    disk: Disk, wall: Wall, scale: float, start: Floats, moving: Floats, spacing: float | None,
    after: tuple[Floats, Floats, float],
) -> float:  # fmt: skip
    """Return the time of the first contact from the velocities before and after it and the state ``after``."""
    configuration, w, end = after
    change = w[[0, 2]] - moving[0, [0, 2]]
    reached = configuration - start[0] - end * w[[0, 2]]
    # start + v first + w (end - first) = position
    if not np.any(change):
        # only v2 changed: the time follows from the return to height 0
        return float(end * w[1] / (w[1] - moving[0, 1]))
    return float(-(change @ reached) / (change @ change))
