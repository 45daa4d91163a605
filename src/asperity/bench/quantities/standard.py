"""The quantities of the standard set."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from .collision import COLLISION, TRUE_DISK
from .collision import DISK as DISK
from .collision import sampled_velocities as sampled_velocities
from .distance import DISTANCE
from .matrix import LAW, MOMENT, RESISTANCE
from .quantity import Quantity
from .spectral import DIFFUSIVITY, EIGENVALUE

QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {one.name: one for one in (LAW, MOMENT, EIGENVALUE, COLLISION, TRUE_DISK, RESISTANCE, DISTANCE, DIFFUSIVITY)}
)
