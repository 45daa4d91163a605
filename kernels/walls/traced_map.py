"""Outgoing angles of a wall's rays by tracing, and the mask of the rays that escaped."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ..laws.law import Law, entries

if TYPE_CHECKING:
    from ...geometry import Wall

# Rays that end in a corner, at a tangency or at the bounce limit count as retroreflected (see `WallLaw`). Their
# fraction bounds the error in total variation. A larger one would be visible in a kernel estimated from a million rays.
UNRESOLVED_TOLERANCE = 1e-4


def traced_reflection(wall: Wall, x: ArrayLike, theta: ArrayLike) -> tuple[Floats, NDArray[np.bool_]]:
    """Outgoing angles, and the mask of the rays that escaped; the other rays count as retroreflected.

    ``x`` in (0, 1) is the entry point as a fraction of the period. Never raises an AccuracyError.
    """
    from ...geometry.tracing.tracing import trace

    x, theta = np.broadcast_arrays(*entries(x, theta))
    traced = trace(wall, x * wall.period, theta)
    escaped = np.asarray(traced.escaped)
    return np.where(escaped, traced.theta, theta), escaped


def if_escaped(law: Law, outgoing: Floats, escaped: NDArray[np.bool_]) -> Floats:
    """The outgoing angles; raises an AccuracyError if more than a fraction of 1e-4 of the rays did not escape."""
    unresolved = 1.0 - float(np.mean(escaped)) if escaped.size else 0.0
    if unresolved > UNRESOLVED_TOLERANCE:
        raise AccuracyError(
            f"{law!r}: {unresolved:.2g} of {escaped.size} rays did not escape, more than {UNRESOLVED_TOLERANCE:g}; "
            "geometry.trace(wall, x, theta).counts() says how they ended, reflect_with_status() which they were",
            unresolved,
        )
    return outgoing
