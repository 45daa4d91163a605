"""The true disk at scales from a tenth of its radius to 10^-8: is its collision an involution that keeps the energy?"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from .. import geometry as geo
from .extreme_row import ExtremeRow
from .quantities import DISK, sampled_velocities

EPS = float(np.finfo(np.float64).eps)
# Rounding errors of a handful of contacts, each of which may magnify them some tens of times; measured below 600.
ROUNDED = 2.0**14 * EPS
SCALES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8)


def disk_cases(rays: int) -> dict[str, Callable[[], ExtremeRow]]:
    """The cases by name."""
    return {f"true disk, scale {scale:g}": partial(_there_and_back, scale, rays) for scale in SCALES}


def _there_and_back(scale: float, rays: int) -> ExtremeRow:
    collide: Callable[..., Any] = geo.collide  # type: ignore[attr-defined, unused-ignore]
    wall, rng = geo.triangular_teeth(0.7), np.random.default_rng(6)
    velocity = -sampled_velocities(rays, rng)
    position = np.column_stack([scale * rng.random(rays), 2.0 * np.pi * rng.random(rays)])
    there = collide(DISK, wall, scale, position, velocity)
    gone = there.escaped
    back = collide(DISK, wall, scale, there.position[gone], -there.velocity[gone])
    same = back.escaped & (back.contacts == there.contacts[gone])
    involution = np.abs(back.velocity + velocity[gone])[same].max(initial=0.0)
    energy = np.abs(DISK.inner(there.velocity, there.velocity) - 1.0)[gone].max(initial=0.0)
    note = f"energy to {energy:.1g}; {int((~same).sum())} came back by other contacts"
    return ExtremeRow(
        f"true disk, scale {scale:g}", "its own way back", float(max(involution, energy)), ROUNDED, "absolute",
        counts=there.counts(), note=note,
    )  # fmt: skip
