"""The true disk at scales from 0.1 to 10^-8, against 50 digits and its reversed path."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from asperity import geometry as geo
from asperity.bench.quantities.collision import DISK, sampled_velocities
from asperity.core.rounding import EPS

from .row import ExtremeRow, stored

# Written by campaigns/judges/precise_collision.py
DATA = Path(__file__).with_name("extreme_disks.json")
# Measured errors are below 0.4; the limit is the limit for single rays.
UNITS = 32.0
# Rounding errors of a few contacts, each magnified up to tens of times; measured below 600 EPS.
ROUNDED = 2.0**14 * EPS
SCALES = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
WALL = geo.triangular_teeth(0.7)


def disk_cases(disks: int) -> dict[str, Callable[[], ExtremeRow]]:
    """The cases by name."""
    return {f"true disk, scale {scale:g}": partial(_case, scale, disks) for scale in SCALES}


def _case(scale: float, disks: int) -> ExtremeRow:
    """Compare the stored disks with 50 digits, and reverse ``disks`` random disks."""
    rows = stored(DATA)[f"{scale:g}"]
    start = np.array([[float.fromhex(number) for number in row[0]] for row in rows])
    exact = np.array([[float.fromhex(number) for number in row[1]] for row in rows])
    contacts, condition = (np.array([row[k] for row in rows]) for k in (2, 3))
    found = geo.collide(DISK, WALL, scale, start[:, :2], start[:, 2:])
    error = np.abs(found.velocity - exact).max(axis=1) / (EPS * (1.0 + contacts) * condition)
    error[found.contacts != contacts] = np.inf
    back, energy, others, counts = _there_and_back(scale, disks)
    worst = max(float(error[found.escaped].max(initial=0.0)), UNITS * max(back, energy) / ROUNDED)
    note = f"{disks} more come back to {back:.1g}, energy to {energy:.1g}; {others} came back by other contacts"
    for status, number in found.counts().items():
        counts[status] += number
    return ExtremeRow(
        f"true disk, scale {scale:g}", "50 digits, and its own way back", worst, UNITS, "eps x condition",
        counts=counts, note=note,
    )  # fmt: skip


def _there_and_back(scale: float, disks: int) -> tuple[float, float, int, dict[str, int]]:
    """Errors of the involution and of the energy, number of disks with another reversed path, and status counts."""
    rng = np.random.default_rng(6)
    velocity = -sampled_velocities(disks, rng)
    position = np.column_stack([scale * rng.random(disks), 2.0 * np.pi * rng.random(disks)])
    there = geo.collide(DISK, WALL, scale, position, velocity)
    gone = there.escaped
    back = geo.collide(DISK, WALL, scale, there.position[gone], -there.velocity[gone])
    same = back.escaped & (back.contacts == there.contacts[gone])
    involution = np.abs(back.velocity + velocity[gone])[same].max(initial=0.0)
    energy = np.abs(DISK.inner(there.velocity, there.velocity) - 1.0)[gone].max(initial=0.0)
    return float(involution), float(energy), int((~same).sum()), there.counts()
