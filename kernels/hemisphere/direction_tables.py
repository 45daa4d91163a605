"""Tables of laws of directions: quantiles of the outgoing normal velocity, and then of the outgoing azimuth."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, Rng, check_memory, frozen, generator, number_between, shaped, whole_number
from ...core.errors import InputError
from ...core.given import seed_by_name
from ..discretisation.method import SEED_WITHOUT_RNG
from ..laws.tables import SavedTable

# Outgoing normal components are positive: the square of the least.
LEAST_SQUARE = 1e-300
# Azimuths begin here, so that many velocities near 0 or pi are not on both sides of the end.
FIRST = -0.5 * np.pi
# Tolerances that need fewer than 1e7 rays for each incoming velocity.
LEAST_TOLERANCE = 1e-3
# Outgoing velocities of a law for incoming ones.
Sampler: TypeAlias = Callable[[Floats, np.random.Generator], Floats]


@dataclass(frozen=True, eq=False, repr=False)
class DirectionTable(SavedTable):
    """The inverse distribution functions of a law of directions on a grid, for other codes to interpolate.

    An outgoing velocity is drawn with two random numbers: the first gives the square of its normal component and a
    slice between two neighbouring probabilities, the second the azimuth among the velocities of the slice. A .csv has
    a row for each incoming velocity and slice: the square of the incoming normal component, the incoming azimuth, the
    quantiles of the square at both ends of the slice, and those of the azimuth; its first row has four times 0 and the
    probabilities of the azimuth.

    Attributes
    ----------
    square : array of shape (n_in,)
        Squares of the normal component of incoming velocities of speed 1, (i + 1/2)/n_in, which the cosine law has
        uniformly. Specular reflection, retroreflection and the cosine law are linear in them.
    turn : array of shape (n_turn,)
        Azimuths of incoming velocities, the angle of (v_x, v_y) with the x axis, 2 pi t/n_turn in radians: 0 only if
        the law is rotation-invariant.
    probability : array of shape (n_out,)
        Probabilities j/(n_out - 1).
    azimuth_probability : array of shape (n_azimuth,)
        Probabilities k/(n_azimuth - 1).
    quantile : array of shape (n_in, n_turn, n_out)
        Squares of the normal component of outgoing velocities.
    azimuth : array of shape (n_in, n_turn, n_out - 1, n_azimuth)
        Outgoing less incoming azimuth, from -pi/2 to 3 pi/2, of the velocities of each slice.
    error : float
        Mean distance of outgoing velocities of speed 1 between table and law at the same probabilities, over incoming
        velocities of the cosine law between those of the grid. It is an estimate by independent rays and includes their
        noise. Averaged over incoming velocities, mean values of a function with the Lipschitz constant 1 differ by no
        more.
    distribution_error : float
        Half width of 95 % of the distribution functions of the square, at all incoming velocities of the grid together.
        Those of the azimuth in a slice come from fewer rays, which ``error`` contains.
    tolerance : float
        The distribution error that was asked for.
    law : str
    """

    square: Floats
    turn: Floats
    probability: Floats
    azimuth_probability: Floats
    quantile: Floats
    azimuth: Floats
    error: float
    distribution_error: float
    tolerance: float
    law: str

    @seed_by_name
    def sample(self, velocity: ArrayLike, rng: Rng = None) -> Floats:
        """Draw one outgoing velocity for every incoming velocity, shape (..., 3), as the law's ``sample`` does."""
        incoming, source = incoming_velocities(velocity), generator(rng)
        speed, square, turn = polar(incoming)
        found, azimuth = self._at(square, turn, *source.random((2, *square.shape)))
        return np.asarray(speed[..., None] * directions(found, turn + azimuth))

    def _at(self, square: Floats, turn: Floats, first: Floats, second: Floats) -> tuple[Floats, Floats]:
        """Square and azimuth at two probabilities, linear in each number but the slice."""
        n_in, n_turn, slices, n_azimuth = self.azimuth.shape
        row, column = square * n_in - 0.5, turn * (n_turn / (2.0 * np.pi)) % n_turn
        i, t = np.clip(row.astype(np.intp), 0, n_in - 2), column.astype(np.intp)
        p, q = first * slices, second * (n_azimuth - 1)
        j, k = np.minimum(p.astype(np.intp), slices - 1), np.minimum(q.astype(np.intp), n_azimuth - 2)
        found = np.zeros((2, *np.broadcast_shapes(i.shape, j.shape)))
        for one, part in ((i, 1.0 - (row - i)), (i + 1, row - i)):
            for other, weight in ((t, 1.0 - (column - t)), (t + 1, column - t)):
                at = one, other % n_turn, j
                low, high = self.quantile[at], self.quantile[(*at[:2], j + 1)]
                left, right = self.azimuth[(*at, k)], self.azimuth[(*at, k + 1)]
                found += part * weight * np.stack([low + (p - j) * (high - low), left + (q - k) * (right - left)])
        return np.clip(found[0], LEAST_SQUARE, 1.0), found[1]

    def _rows(self) -> Floats:
        grid = self.square[:, None, None], self.turn[:, None], self.quantile[..., :-1], self.quantile[..., 1:]
        rows = np.concatenate([np.stack(np.broadcast_arrays(*grid), axis=-1), self.azimuth], axis=-1)
        head = np.concatenate((np.zeros(4), self.azimuth_probability))
        return np.vstack([head, rows.reshape(-1, head.size)])

    def _header(self) -> list[str]:
        n_in, n_turn, slices, n_azimuth = self.azimuth.shape
        return [
            f"asperity table of directions 1: outgoing by incoming velocity of the law {json.dumps(self.law)}",
            "v_n^2: square of the component along the normal, of velocities of speed 1; azimuth: angle of (v_x, v_y) "
            "with the x axis in radians, of the outgoing less that of the incoming velocity; 0 is specular reflection",
            f"rows: v_n^2 = (i + 1/2) / {n_in}, azimuths 2 pi t / {n_turn}, slices j = 0 .. {slices - 1}",
            f"columns: incoming v_n^2, incoming azimuth, outgoing v_n^2 at p = j / {slices} and at (j + 1) / {slices}, "
            f"then quantiles of the azimuth for q = k / {n_azimuth - 1}; first row: 0, 0, 0, 0, then q",
            f"error of interpolation, mean distance of velocities of speed 1, estimated: {self.error:.3g}",
            f"error of the distribution functions of v_n^2, 95 %: {self.distribution_error:.3g}",
        ]


def tabulated(
    sample: Sampler, is_isotropic: bool, law: str, sizes: Sequence[int], tolerance: float, rng: Rng
) -> DirectionTable:
    """The table of a law, compared with rays at intermediate incoming velocities."""
    names = ("n_in", "n_out", "n_azimuth", "n_turn")
    n_in, n_out, n_azimuth, turns = (whole_number(*one, 2) for one in zip(names, sizes, strict=True))
    wanted, source = number_between("tolerance", tolerance, LEAST_TOLERANCE, 1.0), generator(rng, SEED_WITHOUT_RNG)
    n_turn, slices = 1 if is_isotropic else turns, n_out - 1
    # the distance of n distribution functions of N rays exceeds sqrt(log(2 n/q)/(2 N)) with probability q at most
    each = math.ceil(math.log(40.0 * n_in * n_turn) / (2.0 * wanted**2 * slices))
    chance = math.sqrt(math.log(40.0 * n_in * n_turn) / (2.0 * each * slices))
    check_memory(", ".join(names), "the table", 2 * n_in * n_turn * slices * n_azimuth)
    square, turn = (np.arange(n_in) + 0.5) / n_in, np.arange(n_turn) * (2.0 * np.pi / n_turn)
    probability, second = np.linspace(0.0, 1.0, n_out), np.linspace(0.0, 1.0, n_azimuth)
    quantile, azimuth = np.empty((n_in, n_turn, n_out)), np.empty((n_in, n_turn, slices, n_azimuth))
    for i, t in np.ndindex(n_in, n_turn):
        found, angle = _drawn(sample, float(square[i]), float(turn[t]), slices, each, source)
        quantile[i, t] = _nodes(found.ravel(), n_out)
        azimuth[i, t] = _nodes(np.sort(angle, axis=1), n_azimuth)
    grids = frozen(square), frozen(turn), frozen(probability), frozen(second)
    unchecked = DirectionTable(*grids, frozen(quantile), frozen(azimuth), 0.0, chance, wanted, law)
    # the middle between neighbours, and the outer half cells
    between, p = np.concatenate(([0.25], np.arange(1, n_in), [n_in - 0.25])) / n_in, np.arange(slices * each) + 0.5
    distance = np.empty(n_in + 1)
    for i, middle in enumerate(between):
        direction = 2.0 * np.pi * (i * n_turn // (n_in + 1) + 0.5) / n_turn
        found, angle = _drawn(sample, middle, direction, slices, each, source)
        q = (np.argsort(np.argsort(angle, axis=1), axis=1) + 0.5) / each
        own = unchecked._at(middle, np.array(direction), p.reshape(q.shape) / p.size, q)
        distance[i] = np.linalg.norm(directions(*own) - directions(found, angle), axis=-1).mean()
    return replace(unchecked, error=float(np.trapezoid(distance, np.arange(n_in + 1)) / n_in))


def _drawn(
    sample: Sampler, square: float, turn: float, slices: int, each: int, source: np.random.Generator
) -> tuple[Floats, Floats]:
    """Squares of the normal component in order, and changes of the azimuth, shape (slices, each), by rays of a law."""
    incoming = directions(np.array(square), np.array(turn)) * [1.0, 1.0, -1.0]
    _, found, azimuth = polar(sample(np.tile(incoming, (slices * each, 1)), source))
    # equal ones stay in the order of the rays, which is random
    order = np.argsort(found.round(12), kind="stable").reshape(slices, each)
    return found[order], (azimuth[order] - turn - FIRST) % (2.0 * np.pi) + FIRST


def _nodes(sorted_values: Floats, count: int) -> Floats:
    """Quantiles along the last axis, and at the ends what keeps the mean of the first and of the last interval."""
    nodes = np.moveaxis(np.quantile(sorted_values, np.linspace(0.0, 1.0, count), axis=-1), 0, -1)
    part = max(round(sorted_values.shape[-1] / (count - 1)), 1)
    nodes[..., 0] = 2.0 * sorted_values[..., :part].mean(axis=-1) - nodes[..., 1]
    nodes[..., -1] = 2.0 * sorted_values[..., -part:].mean(axis=-1) - nodes[..., -2]
    return nodes


def directions(square: Floats, azimuth: Floats) -> Floats:
    """Velocities of speed 1 away from the wall, with these squares of the normal component and azimuths."""
    across = np.sqrt(1.0 - square)
    return np.stack(np.broadcast_arrays(across * np.cos(azimuth), across * np.sin(azimuth), np.sqrt(square)), axis=-1)


def polar(velocity: Floats) -> tuple[Floats, Floats, Floats]:
    """Speeds, squares of the normal component of velocities of speed 1, and azimuths."""
    # scaled, because squares of the largest doubles overflow
    size = np.abs(velocity).max(axis=-1)
    x, y, up = np.moveaxis(velocity / size[..., None], -1, 0)
    speed = np.sqrt(x * x + y * y + up * up)
    return size * speed, (up / speed) ** 2, np.arctan2(y, x)


def incoming_velocities(velocity: ArrayLike) -> Floats:
    """Velocities that come down to the wall, shape (..., 3); raises InputError for others."""
    incoming = shaped("velocity", velocity, "...", 3)
    bad = np.argwhere(~(incoming[..., 2] < 0.0))
    if len(bad):
        raise InputError(
            "velocity: expected incoming ones, with a negative component along the outward normal, the third, got "
            f"{incoming[tuple(bad[0])].tolist()} at row {bad[0].tolist()} ({len(bad)} such)"
        )
    return incoming
