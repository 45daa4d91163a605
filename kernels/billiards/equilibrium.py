"""Starts of disks in a container in equilibrium: the invariant measure of the billiard map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats

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
    # without an outer loop there is no perimeter
    position, wall = container.point_at(container.perimeter * rng.random(count))
    tangent, normal = container.frames(position, wall)
    if spinning:
        radius, angle = np.sqrt(rng.random(count)), rng.uniform(0.0, 2.0 * math.pi, count)
        along, spin = radius * np.cos(angle), radius * np.sin(angle)
        up = np.sqrt(np.maximum((1.0 - radius) * (1.0 + radius), 0.0))
    else:
        along, spin = rng.uniform(-1.0, 1.0, count), np.zeros(count)
        up = np.sqrt((1.0 - along) * (1.0 + along))
    plane = along[:, None] * tangent + up[:, None] * normal
    omega = spin * math.sqrt(disk.mass / disk.inertia)
    return position, np.concatenate([plane, omega[:, None]], axis=1), wall
