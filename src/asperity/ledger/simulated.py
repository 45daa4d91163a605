"""Random disks and velocities, and independent simulations, for the numeric checks of the ledger."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.checks import Floats
from ..geometry import Disk, Wall

MOST_BOUNCES = 1000
# Newton steps to a side: the path of a satellite is straight up to the order of the scale.
STEPS, TOLERANCE = 6, 1e-9
ENTRIES, HALVINGS = 1000, 40
# Error of `fraction`: a few changes of outcome, each known to (1/ENTRIES) 2^-HALVINGS and to the tracer's rounding.
FRACTION_ERROR = 1e-10


def outgoing_velocity(disk: Disk, wall: Wall, position: Any, velocity: Any, scale: float = 0.0) -> Any:
    """The velocity of a disk after its satellite has left a polygonal wall, by the impulse law of eq. 3.2.

    Lengths are in units of the wall. The satellite is a point of a turning circle of radius 1/``scale``; scale 0 is the
    limit, the cylinder, where it is at (x1 + alpha, x2). NaN after MOST_BOUNCES bounces.
    """
    position, velocity = np.array(position, dtype=float), np.array(velocity, dtype=float)
    weights = np.array([disk.mass, disk.mass, disk.rim_mass])
    for _ in range(MOST_BOUNCES):
        times = [_time_to(*ends, position, velocity, scale) for ends in pairwise(wall.vertices)]
        if min(times) == math.inf:
            return velocity
        position = position + min(times) * velocity
        side = int(np.argmin(times))
        k, turn = _normal(*wall.vertices[side : side + 2]), scale * position[2]
        covector = np.array([*k, k[0] * math.cos(turn) + k[1] * math.sin(turn)])
        velocity = velocity - 2 * (velocity @ covector) / np.sum(covector**2 / weights) * covector / weights
    return np.full(3, np.nan)


def _time_to(start: Floats, end: Floats, position: Floats, velocity: Floats, scale: float) -> float:
    """The time at which the satellite meets a side from above; infinity if it does not."""
    k: Floats = _normal(start, end)
    time = 0.0
    if _satellite(position, velocity, scale, time)[1] @ k >= 0:
        return math.inf
    for _ in range(STEPS):
        point, along = _satellite(position, velocity, scale, time)
        time -= float((point - start) @ k / (along @ k))
    point, _ = _satellite(position, velocity, scale, time)
    fraction = (point - start) @ (end - start) / np.sum((end - start) ** 2)
    return time if time > -TOLERANCE and -TOLERANCE <= fraction <= 1 + TOLERANCE else math.inf


def _normal(start: Floats, end: Floats) -> Floats:
    edge = end - start
    return np.asarray(np.array([-edge[1], edge[0]]) / np.hypot(*edge))


def _satellite(position: Floats, velocity: Floats, scale: float, time: float) -> tuple[Floats, Floats]:
    """The satellite's position and velocity after a time of free motion."""
    alpha = position[2] + time * velocity[2]
    half = 0.5 * scale * alpha
    chord = alpha * np.sinc(half / np.pi) * np.array([math.cos(half), math.sin(half)])
    rim = np.array([math.cos(2 * half), math.sin(2 * half)])
    return position[:2] + time * velocity[:2] + chord, velocity[:2] + velocity[2] * rim


def tooth(x: Floats) -> Floats:
    """The height of the sampled wall: triangular teeth of period 1 and depth 1, with corners at the integers."""
    return np.abs(2.0 * (x - np.floor(x)) - 1.0) - 1.0


def satellites(configuration: Floats, count: int) -> Floats:
    """The positions (2, n, count) of all satellites of a rotated disk, with heights relative to the lowest contact."""
    x1, x2, alpha = configuration
    rotated = np.exp(1j * (alpha[:, np.newaxis] + 2 * np.pi * np.arange(count) / count)) * -1j
    return np.stack([x1[:, np.newaxis] + rotated.real, x2[:, np.newaxis] + 1.0 + rotated.imag])


def clearance(configuration: Floats, eps: float, count: int) -> Floats:
    """The least height (n,) of all satellites over the wall eps W; negative if a satellite is in the solid."""
    x, height = satellites(configuration, count)
    return np.asarray(np.min(height - eps * tooth(x / eps), axis=-1))


def is_free(configuration: Floats, eps: float, count: int) -> NDArray[np.bool_]:
    """Whether configurations (3, n) are in M, tested at every satellite."""
    return clearance(configuration, eps, count) >= 0.0


def fraction(occurs: Callable[[Any, Any], Any], theta: Any, low: float = 0.0) -> Any:
    """The fraction of the entry points from ``low`` to 1 that have an outcome, for every angle.

    ``occurs`` maps arrays of entry points and angles to booleans. An outcome that occurs only between two neighbours of
    ENTRIES equally spaced points is missed.
    """
    x = low + (1.0 - low) * (np.arange(ENTRIES) + 0.5) / ENTRIES
    found = occurs(*np.broadcast_arrays(x[:, None], theta))
    row, column = np.nonzero(found[1:] != found[:-1])
    left, right = x[row], x[row + 1]
    for _ in range(HALVINGS):
        middle = 0.5 * (left + right)
        still = occurs(middle, theta[column]) == found[row, column]
        left, right = np.where(still, middle, left), np.where(still, right, middle)
    total = np.where(found[-1], 1.0, 0.0) - np.where(found[0], low, 0.0)
    np.add.at(total, column, np.where(found[row, column], left, -left))
    return total / (1.0 - low)


SAMPLES = 4000


def generator() -> np.random.Generator:
    """The random generator of every check, with a fixed seed."""
    return np.random.default_rng(2022)


def random_disks(count: int = SAMPLES) -> tuple[np.random.Generator, Floats, Floats]:
    """The generator, and random m and J between 1/10 and 10."""
    rng = generator()
    return rng, *np.exp(rng.uniform(-np.log(10), np.log(10), (2, count)))


def kinetic_norm(w: Floats, m: Floats | float, J: Floats | float) -> Floats:
    """The kinetic-energy norm of velocities (3, n)."""
    return np.asarray(np.sqrt(m * (w[0] ** 2 + w[1] ** 2) + J * w[2] ** 2))


def unit_velocities(rng: np.random.Generator, m: Floats | float, J: Floats | float) -> Floats:
    """Random velocities (3, n) of kinetic norm 1 with v2 > 0; some are grazing, some nearly rolling."""
    w = rng.normal(size=(3, SAMPLES)) * np.exp(rng.uniform(-4, 0, (3, SAMPLES)))
    w[1] = np.abs(w[1])
    return w / kinetic_norm(w, m, J)


def residual(alpha: Floats, spacing: float) -> tuple[NDArray[np.int64], Floats]:
    """The nearest multiple of the spacing and the remainder."""
    k = np.rint(alpha / spacing).astype(np.int64)
    return k, alpha - k * spacing
