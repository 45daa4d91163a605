"""The quantities of the standard set."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from .collision_quantities import COLLISION, TRUE_DISK
from .distance_quantities import DISTANCE
from .matrix_quantities import LAW, MOMENT, RESISTANCE
from .quantity import Quantity
from .spectral_quantities import DIFFUSIVITY, EIGENVALUE
from .uniform_disk import DISK as DISK
from .uniform_disk import sampled_velocities as sampled_velocities

QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {one.name: one for one in (LAW, MOMENT, EIGENVALUE, COLLISION, TRUE_DISK, RESISTANCE, DISTANCE, DIFFUSIVITY)}
)
