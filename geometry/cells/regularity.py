"""The points where a wall is not twice continuously differentiable, and its largest curvature elsewhere."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...core.checks import Floats, frozen
from ...core.estimates import Estimate
from ..curves.curve import Curve

# Largest angle between tangents, radians, and relative jump of the curvature, at a joint that counts as smooth. They
# agree to a few rounding errors where a curve was cut in two.
SMOOTH_ANGLE, SMOOTH_JUMP = 1e-9, 1e-9


def singular_points_of(paths: Sequence[Sequence[Curve]]) -> Floats:
    """Return the joints, shape (n, 2), of cycles of pieces at which the tangent or the curvature jumps."""
    found = [after.start for path in paths for before, after in _neighbours(path) if not _is_smooth(before, after)]
    return frozen(np.array(found, dtype=np.float64).reshape(-1, 2))


def _neighbours(path: Sequence[Curve]) -> list[tuple[Curve, Curve]]:
    return [(path[i - 1], path[i]) for i in range(len(path))]


def _is_smooth(before: Curve, after: Curve) -> bool:
    (tx, ty), (ux, uy) = before.tangent(1.0), after.tangent(0.0)
    if abs(tx * uy - ty * ux) > SMOOTH_ANGLE or tx * ux + ty * uy < 0.0:
        return False
    left, right = before.curvature(1.0), after.curvature(0.0)
    if not (math.isfinite(left) and math.isfinite(right)):
        return False
    return abs(left - right) <= SMOOTH_JUMP * max(abs(left), abs(right))


def largest_curvature_of(paths: Sequence[Sequence[Curve]]) -> Estimate:
    """Return the largest curvature of all pieces with a bound on its error."""
    found = [piece.largest_curvature() for path in paths for piece in path]
    value = max(v for v, _ in found)
    error = 0.0 if value == math.inf else max(v + e for v, e in found) - value
    method = "critical points of the pieces, checked in floating point by Bernstein coefficients"
    return Estimate(value, max(0.0, error), "bound", method)
