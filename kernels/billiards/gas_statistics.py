"""Means over time of a gas, with errors, from integrals over intervals of its events."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...core.checks import Floats
from ...core.estimates import Estimate, Summary, student_95
from ...core.rounding import EPS

# Numbers of batches of a mean over time, of which the one with the largest error counts: batches that depend on each
# other show a smaller error than longer ones. The fraction of the events before the first batch, and the least number
# of events in batches, per disk.
BATCHES, BURN_IN, FEWEST_EVENTS = (16, 8, 4), 0.2, 64
# Columns of the integrals: the time, the integrals over it of the sums of (r omega)^2, v1^4 + v2^4 and (r omega)^4, the
# numbers of collisions of pairs and with walls, the sum of r_ij . p_ij, and of each wall the normal and tangential
# impulse.
DURATION, RIM2, V4, RIM4, PAIRS, WALLS, VIRIAL, IMPULSE = range(8)


@dataclass(frozen=True, repr=False)
class GasStatistics(Summary):
    """Means over time of a gas; what is not known is nan with the error inf, and its method says why.

    Attributes
    ----------
    spin_fraction : Estimate
        The fraction of the energy in rotation.
    temperature : Estimate
        k T, twice the energy of translation for each degree of freedom; in a torus that of the centre of mass is none.
    collision_rate, mean_free_time : Estimate
        Collisions of a disk with other disks in a unit of time, and the time between them.
    pressure : Estimate
        By the virial: (sum of m v^2 + sum of r_ij . p_ij in a unit of time)/(2 area), force for each length.
    wall_pressures : tuple of Estimate
        The normal impulse on each wall for each length and time.
    velocity_kurtosis, spin_kurtosis : Estimate
        E[v^4]/E[v^2]^2 of a component of the velocity, and of the spin; 3 for normal distributions.
    self_diffusion : Estimate
        D of the displacements in a torus relative to the centre of mass: half of the rate at which the mean square of a
        component grows between one and two 64ths of the run. In two dimensions it grows with this time, slowly.
    """

    spin_fraction: Estimate
    temperature: Estimate
    collision_rate: Estimate
    mean_free_time: Estimate
    pressure: Estimate
    wall_pressures: tuple[Estimate, ...]
    velocity_kurtosis: Estimate
    spin_kurtosis: Estimate
    self_diffusion: Estimate


def statistics_of(
    rows: Floats,
    displacements: Floats,
    disks: tuple[int, float, float],
    energy: tuple[float, float],
    shape: tuple[float | None, Sequence[float]],
) -> GasStatistics:
    """Means over the time of these rows of integrals.

    ``displacements`` (k, 2) are a rate and a duration of `diffusion_rows`, none in a container. ``disks`` are their
    number, m and J/r^2; ``energy`` is all energy and that of the centre of mass, if it is kept. The shape is the area
    and the lengths of the walls, None where there are none.
    """
    (n, mass, rim), (whole, drift), (area, lengths) = disks, energy, shape
    freedom = 2 * n - (2 if not lengths else 0)
    made = int(rows[:, [PAIRS, WALLS]].sum())
    few = f"mean over {made} events after the burn-in; an error needs {FEWEST_EVENTS * n}, {FEWEST_EVENTS} per disk"
    few = few if made < FEWEST_EVENTS * n or len(rows) < BATCHES[0] else ""

    def spin(s: Floats) -> float:
        return float(0.5 * rim * s[RIM2] / s[DURATION])

    def moving(s: Floats) -> float:
        return whole - drift - spin(s)

    def mean(value: Callable[[Floats], float], *missing: str) -> Estimate:
        return batched(value, rows, few, next(filter(None, missing), ""))

    no_pair = "" if rows[:, PAIRS].any() else "no collision of two disks"
    no_spin = "" if rim * rows[:, RIM2].sum() > EPS * whole * rows[:, DURATION].sum() else "no disk spins"
    no_area = "" if area else "a container without an area"
    pushed = [partial(_pressure, IMPULSE + 2 * k, length) for k, length in enumerate(lengths)]
    return GasStatistics(
        mean(lambda s: spin(s) / whole),
        mean(lambda s: 2.0 * moving(s) / freedom, "" if freedom else "one disk in a torus"),
        mean(lambda s: 2.0 * s[PAIRS] / (n * s[DURATION])),
        mean(lambda s: n * s[DURATION] / (2.0 * s[PAIRS]), no_pair),
        mean(lambda s: (2.0 * moving(s) + s[VIRIAL] / s[DURATION]) / (2.0 * (area or 1.0)), no_area),
        tuple(mean(force) for force in pushed),
        mean(lambda s: 0.5 * n * mass**2 * s[V4] / s[DURATION] / (whole - spin(s)) ** 2),
        mean(lambda s: n * s[RIM4] * s[DURATION] / s[RIM2] ** 2, no_spin),
        batched(
            lambda s: s[0] / s[1], displacements, few,
            "" if len(displacements) >= BATCHES[0] else f"{2 * BATCHES[0]} intervals in a torus have displacements",
        ),
    )  # fmt: skip


def _pressure(column: int, length: float, s: Floats) -> float:
    return float(s[column] / (s[DURATION] * length))


def batched(value: Callable[[Floats], float], rows: Floats, few: str, missing: str = "") -> Estimate:
    """A function of the sum of rows; the error is the largest by the jackknife of batches of rows.

    The error is inf for the reason ``few``, and nothing is known for the reason ``missing``.
    """
    if missing:
        return Estimate(math.nan, math.inf, "estimate", f"not known: {missing}")
    total, errors = rows.sum(axis=0), []
    found = float(value(total))
    if few:
        return Estimate(found, math.inf, "estimate", few)
    for count in BATCHES:
        rest = [value(total - part.sum(axis=0)) for part in np.array_split(rows, count)]
        errors.append(student_95(count) * (count - 1) * float(np.std(rest, ddof=1)) / math.sqrt(count))
    return Estimate(found, max(errors), "estimate", f"mean over time, 95 % from {BATCHES[0]} batches or fewer")


def diffusion_rows(marks: Floats, time: Floats) -> Floats:
    """For pairs of successive intervals between positions (m, n, 2), what grows and how long, shape ((m - 1)//2, 2).

    The mean square over two intervals minus that over one, so that the ballistic start does not count.
    """
    n, pairs = marks.shape[1], (len(marks) - 1) // 2
    steps = np.diff(marks[len(marks) - 1 - 2 * pairs :], axis=0)
    steps = (steps - steps.mean(axis=1, keepdims=True)).reshape(pairs, 2, n, 2)
    squares = np.sum(steps**2, axis=(1, 2, 3))
    grown = 0.5 * squares + 2.0 * np.sum(steps[:, 0] * steps[:, 1], axis=(1, 2))
    lasted = np.diff(time[len(time) - 1 - 2 * pairs :]).reshape(pairs, 2).sum(axis=1)
    return np.column_stack([grown / max(n - 1, 1), 2.0 * lasted])
