"""Starts of disks in a container in equilibrium: the invariant measure of the billiard map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...geometry.curves.bezier import Bezier
from ...geometry.curves.segment import Segment
from ...geometry.tables.boundary import Piece, point_at_length

if TYPE_CHECKING:
    from ...geometry import Container, Disk


def equilibrium_starts(
    container: Container, disk: Disk, count: int, spinning: bool, rng: np.random.Generator
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Draw starts on the boundary: positions (n, 2), outgoing velocities (n, 3) and walls (n,).

    Positions are uniform in arc length. Velocities have the energy of speed 1 without spin; their density is the normal
    velocity, on the half circle, or with spin on the half sphere in the kinetic metric. Every deterministic or
    symmetric law of the walls preserves this measure (Rudzis 2022, Lemma 6.2).
    """
    lengths = np.array([curve.length for curve in container.curves])
    container.perimeter  # noqa: B018 - refuses containers without an outer loop
    wall = rng.choice(len(lengths), size=count, p=lengths / lengths.sum())
    position, tangent = np.empty((count, 2)), np.empty((count, 2))
    for k, curve in enumerate(container.curves):
        here = np.flatnonzero(wall == k)
        point = container.touch(k, _uniform_points(curve, len(here), rng))
        position[here], tangent[here] = point.position, point.tangent
    if spinning:
        radius, angle = np.sqrt(rng.random(count)), rng.uniform(0.0, 2.0 * math.pi, count)
        along, spin = radius * np.cos(angle), radius * np.sin(angle)
        up = np.sqrt(np.maximum((1.0 - radius) * (1.0 + radius), 0.0))
    else:
        along, spin = rng.uniform(-1.0, 1.0, count), np.zeros(count)
        up = np.sqrt((1.0 - along) * (1.0 + along))
    normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    plane = along[:, None] * tangent + up[:, None] * normal
    omega = spin * math.sqrt(disk.mass / disk.inertia)
    return position, np.concatenate([plane, omega[:, None]], axis=1), wall.astype(np.int64)


def _uniform_points(curve: Piece, count: int, rng: np.random.Generator) -> Floats:
    """Points on a curve, uniform in arc length: by rejection where the parameter is no arc length."""
    if isinstance(curve, Bezier):
        return point_at_length(curve, rng.uniform(0.0, curve.length, count))
    if isinstance(curve, Segment) or curve.is_circular:
        return curve.point(rng.random(count))
    a, b = curve.semi_axes
    found = np.empty(0)
    while len(found) < count:
        s = rng.random(2 * count)
        angle = curve.start_angle + s * (curve.end_angle - curve.start_angle)
        speed = np.hypot(a * np.sin(angle), b * np.cos(angle))
        found = np.concatenate([found, s[rng.random(2 * count) * max(a, b) < speed]])
    return curve.point(found[:count])
