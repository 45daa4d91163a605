"""Whether a collision amplifies rounding errors: the disk collides again from disturbed incoming states."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ..tracing.tracing import Status, StatusCounts, numbers_of

# Accuracy of a disk that is not amplified: positions in radii and radians, velocities relative to the speed.
ACCURACY = 1e-6
# Disturbance of the incoming state, of the size of the rounding errors at a contact.
DISTURBANCE = 16.0 * EPS
# Disturbed states of a collision, and the largest change of its end. The changes scatter as the error does, but are of
# two sizes, up to 175 to 1, where a contact is found to one rounding error or to sixteen. One disturbed state is enough
# if its change is at most CLEAR.
DISTURBED, LIMIT, CLEAR = 6, 1e-2 * ACCURACY, 1e-4 * ACCURACY
# Twice the inverse cosine of the angle to the normal that few contacts of a collision exceed on average: 1/5.
STEEP = 10.0
# Growth at a contact of a flat wall, for rounding errors that add up: collisions of a thousand contacts are repeated.
LEAST_GROWTH = 0.02


class DiskStatus(IntEnum):
    """The outcome of colliding a disk: a `Status`, or ``AMPLIFIED``.

    ``AMPLIFIED``: the disk escaped, but rounding may have changed its outgoing state by more than 1e-6: positions in
    radii of the disk and radians, velocities relative to the speed in the kinetic metric. The state is that of a path
    that obeys the laws within rounding, so means over many disks are not affected.
    """

    ESCAPED = Status.ESCAPED
    CORNER = Status.CORNER
    GRAZING = Status.GRAZING
    BOUNCE_LIMIT = Status.BOUNCE_LIMIT
    AMPLIFIED = 4


class DiskCounts(StatusCounts):
    """Mask and counts of the array ``status`` of disks."""

    @property
    def escaped(self) -> NDArray[np.bool_]:
        """Mask of the disks that returned to x2 = 0 or separated, with ``AMPLIFIED`` ones."""
        return np.asarray((self.status == DiskStatus.ESCAPED) | (self.status == DiskStatus.AMPLIFIED))

    def counts(self) -> dict[str, int]:
        """Return the number of disks with every `DiskStatus`, by name in lower case."""
        return numbers_of(self.status, DiskStatus)


def fewest_contacts(bend: float, ratio: float) -> int:
    """Return the number of contacts from which on a collision is repeated, so that ordinary ones cost nothing.

    ``bend`` is the largest curvature times the length of a flight, ``ratio`` the mass over the inertia: in the
    foreshortened wall curvatures are up to 1 + m/J times as large. A flight without contact is exact.
    """
    growth = math.log1p(STEEP * bend * (1.0 + ratio))
    return max(1, int(math.log(ACCURACY / DISTURBANCE) / max(growth, LEAST_GROWTH)))


def mark_amplified(
    again: Callable[[NDArray[np.intp], Floats, Floats], tuple[Floats, Floats, NDArray[np.bool_]]],
    states: tuple[Floats, Floats],
    ends: tuple[Floats, Floats],
    status: NDArray[np.uint8],
    uncertain: NDArray[np.bool_],
    units: tuple[Any, Any],
) -> None:
    """Set the status of amplified disks, among the ``uncertain`` ones that escaped, to ``AMPLIFIED``.

    ``states`` are the incoming positions and velocities, one row for each disk, and ``ends`` the outgoing ones.
    ``again`` collides the disks of some rows from disturbed states, and tells which of them escaped. ``units`` are the
    sizes of positions, for their rounding errors, and the masses of the velocities.
    """
    (at, moving), (position, velocity), (sizes, masses) = states, ends, units
    rows = np.flatnonzero((status == DiskStatus.ESCAPED) & uncertain)
    for k in range(DISTURBED):
        if not len(rows):
            break
        shift = DISTURBANCE * np.random.default_rng(k).uniform(-1.0, 1.0, at.shape[1] + moving.shape[1])
        speeds = np.sqrt(np.sum(masses * moving[rows] ** 2, axis=1, keepdims=True) / masses)
        start = at[rows] + shift[: at.shape[1]] * sizes, moving[rows] + shift[at.shape[1] :] * speeds
        there, w, escaped = again(rows, *start)
        changes = np.abs(there - position[rows]).max(axis=1), np.abs((w - velocity[rows]) / speeds).max(axis=1)
        change = np.maximum(*changes)
        amplified = ~(escaped & (change <= LIMIT))
        status[rows[amplified]] = DiskStatus.AMPLIFIED
        rows = rows[~amplified & (change > CLEAR)]
