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
    legs = [collide(disk, wall, scale, start, moving, spacing, max_contacts=k) for k in range(1, contacts)]
    states = [(leg.position[0], leg.velocity[0], float(leg.time[0])) for leg in [*legs, whole]]
    before = _first_time(start[0], moving[0], *states[0])
    height = moving[0, 1] * before
    path = [(*start[0], 0.0), (*(start[0] + moving[0, [0, 2]] * before), height)]
    for configuration, w, at in states:
        height += w[1] * (at - before)
        before = at
        path.append((*configuration, height))
    return np.array(path)[:, [0, 2, 1]]


def _first_time(start: Floats, moving: Floats, configuration: Floats, w: Floats, end: float) -> float:
    """Return the time of the first contact of a disk that is at ``configuration`` at the time ``end``.

    ``moving`` and ``w`` are its velocities before and after the contact.
    """
    change = w[[0, 2]] - moving[[0, 2]]
    reached = configuration - start - end * w[[0, 2]]
    # start + v first + w (end - first) = position
    if not np.any(change):
        # only v2 changed: the time follows from the return to height 0
        return float(end * w[1] / (w[1] - moving[1]))
    return float(-(change @ reached) / (change @ change))
