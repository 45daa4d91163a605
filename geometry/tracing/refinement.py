"""Trace rays that double precision does not resolve again in double-double arithmetic."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ..curves import columns as c
from ..curves.columns import JOINT_ULPS
from ..curves.curve import Curve
from ..scene.scene import Tables

if TYPE_CHECKING:
    from ..scene.scene import Scene

# Limit on the ray segments of a flagged ray, above which its flag stays; a double-double step costs about twenty double
# steps. A long run between vertical sides or along an arc counts as one segment; runs in wedges do not.
REFINED_SEGMENTS = 40_000
_SETTLED, _CORNER, _GRAZING, _BOUNCE_LIMIT = 0, 1, 2, 3


class RefinedTrace(NamedTuple):
    """Rays traced in double-double arithmetic; a double-double is the sum of the two entries of the last axis.

    Attributes
    ----------
    x, theta : array of float, shape (n, 2)
        Position and angle of rays that escaped, as double-doubles.
    collisions : array of int, shape (n,)
    status : array of int, shape (n,)
        Values of `Status`; also 4 if no piece was met (should not occur) and 5 if the result depends on rounding.
    amplification : array of float, shape (n,)
        Norm of the derivative of (x'/scale, theta') by (x/scale, theta), with scale = cell + size of the hollow. An
        error e of the incoming ray becomes about amplification times e in the outgoing ray.
    rounding : array of float, shape (n,)
        First-order bound on the rounding error of the double-double ray, in the same units.
    """

    x: Floats
    theta: Floats
    collisions: NDArray[np.int64]
    status: NDArray[np.uint8]
    amplification: Floats
    rounding: Floats


def refined_trace(scene: Scene, x: Floats, theta: Floats, max_collisions: int = 2**62) -> RefinedTrace:
    """Trace rays (two one-dimensional arrays) in double-double arithmetic from the start."""
    from .compiled.refined_tracing import refined_rays

    count = len(x)
    results = RefinedTrace(
        np.empty((count, 2)), np.empty((count, 2)), np.empty(count, np.int64), np.empty(count, np.uint8),
        np.empty(count), np.empty(count),
    )  # fmt: skip
    starts, angles = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(theta, dtype=np.float64)
    refined_rays(starts, angles, tables_of(scene), _free_bands(scene), max_collisions, REFINED_SEGMENTS, results)
    return results


def tables_of(scene: Scene) -> Tables:
    """Return the tables of a wall for double-double arithmetic, with curves as by `refined_table` of their kinds."""
    from .compiled.pieces.kinds import CURVES

    tables = (piece.refined_table(rows) for piece, rows in zip(CURVES, scene.curves, strict=True))
    return Tables(*scene._replace(curves=tuple(tables)))


def retrace(
    scene: Scene,
    x: Floats,
    theta: Floats,
    max_collisions: int,
    out_x: Floats,
    out_theta: Floats,
    collisions: NDArray[np.int64],
    status: NDArray[np.uint8],
) -> None:
    """Resolve, in place, rays with status corner or grazing by double-double arithmetic if possible.

    A ray that meets a corner within half an ulp of its incoming angle keeps its status, because one of the angles that
    round to its angle meets the corner.

    Parameters
    ----------
    scene : Scene
    x, theta : array of float, shape (n,)
        The incoming rays.
    max_collisions : int
        The caller's limit; each ray has at most ``REFINED_SEGMENTS`` segments.
    out_x, out_theta, collisions, status : arrays of shape (n,)
        The results of double precision, replaced for the resolved rays.
    """
    flagged = np.flatnonzero((status == _CORNER) | (status == _GRAZING))
    if len(flagged) == 0:
        return
    from .compiled.trigonometry import LAST_ANGLE

    refined = refined_trace(scene, x[flagged], theta[flagged], max_collisions)
    # a ray still inside after max_collisions collisions is resolved, too
    limited = (refined.status == _BOUNCE_LIMIT) & (refined.collisions >= max_collisions)
    collisions[flagged[limited]], status[flagged[limited]] = refined.collisions[limited], _BOUNCE_LIMIT
    settled = refined.status == _SETTLED
    rays = flagged[settled]
    out_x[rays], out_theta[rays] = refined.x[settled, 0], np.minimum(refined.theta[settled, 0], LAST_ANGLE)
    collisions[rays], status[rays] = refined.collisions[settled], _SETTLED


def _free_bands(scene: Scene) -> Floats:
    """Return the bands of heights (low, high) of an open wall without any piece, shape (n, 2); empty if not open."""
    if not scene.is_open:
        return np.empty((0, 2))
    lines = np.flatnonzero(scene.joints[:, c.STARTS_LINE] > 0.0)
    heights = [np.column_stack([scene.joints[lines, c.JOINT_Y], scene.joints[lines + 1, c.JOINT_Y]])]
    heights += [cls.heights(rows) for cls, rows in zip(Curve.traced(), scene.curves, strict=True)]
    slack = JOINT_ULPS * EPS * float(scene.hollows[0, c.SIZE])
    extents = sorted((float(row.min()) - slack, float(row.max()) + slack) for part in heights for row in part)
    bands, top = [], extents[0][1]
    for low, high in extents:
        if low > top:
            bands.append((top, low))
        top = max(top, high)
    return np.array([*bands, (top, np.inf)])
