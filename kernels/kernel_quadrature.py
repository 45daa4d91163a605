"""Matrices of laws with a density, of deterministic laws, and of laws known by their action on functions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import Floats
from ..errors import InputError
from .basis import Basis
from .measure import SINE, gauss_rule
from .products import add_products, cell_index

# Evaluations of a density, values of basis functions in `law.apply`, and points of a map that are affordable: each is
# about a second or two.
MOST_DENSITY_VALUES, MOST_APPLY_VALUES, MOST_MAP_POINTS = 2**25, 2**26, 2**20
# Numbers held at a time.
CHUNK = 2**21
# Rows are refined towards grazing, where angles of reflection vary on the scale of the angle itself.
GRAZING_EDGES = np.pi * 0.25 ** np.arange(2.0, 9.0)
BISECTIONS = 60
# A measure-preserving map keeps measures of intervals; rounding of the map and of the measure stays below this.
JUMP_TOLERANCE = 1e-9
JUMP_PROBES = 4096


class HasDensity(Protocol):
    """What is asked of a law with a density."""

    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats: ...


class HasAction(Protocol):
    """What is asked of a law known by its action on functions."""

    def apply(self, function: Callable[[Floats], Floats], theta: ArrayLike) -> Floats: ...
    def kinks(self, limit: int) -> tuple[Floats, float]: ...
    @property
    def fan_out(self) -> int: ...


def density_matrix(law: HasDensity, basis: Basis, tolerance: float) -> tuple[Floats, float]:
    """<e_i, P e_j> by product Gauss rules whose order doubles; the difference of the last two as error estimate."""
    edges = np.unique(np.concatenate((basis.edges, np.asarray(getattr(law, "breakpoints", ())))))
    return _until_settled(_density_levels(law, basis, edges), tolerance)


def _density_levels(law: HasDensity, basis: Basis, edges: Floats) -> Iterator[Floats]:
    intervals = edges.size - 1
    order = basis.nodes_per_interval
    if basis.is_partition:
        order = 4 if intervals <= 512 else 2 if intervals <= 1024 else 1
    level = 0
    while level < 2 or (intervals * order) ** 2 <= MOST_DENSITY_VALUES:
        yield _density_rule(law, basis, edges, order)
        order, level = 2 * order, level + 1


def _density_rule(law: HasDensity, basis: Basis, edges: Floats, order: int) -> Floats:
    angle, weight = gauss_rule(edges, order)
    mass = weight * SINE.density(angle)
    total = np.zeros((basis.size, basis.size))
    step = max(CHUNK // angle.size // order, 1) * order
    owner = cell_index(basis, 0.5 * (edges[1:] + edges[:-1])) if basis.is_partition else None
    values = basis.evaluate(angle) if owner is None else None
    for start in range(0, angle.size, step):
        rows = slice(start, start + step)
        block = mass[rows, None] * law.density(angle[rows, None], angle) * weight
        if values is not None:
            total += values[rows].T @ (block @ values)
            continue
        assert owner is not None  # a basis is a partition or has values
        block = block.reshape(-1, order, owner.size, order).sum(axis=(1, 3))
        np.add.at(total, (owner[start // order : start // order + block.shape[0], None], owner), block)
    return total if values is not None else basis.heights[:, None] * total * basis.heights


def map_matrix(map_angle: Callable[[Floats], Floats], basis: Basis, tolerance: float) -> tuple[Floats, float]:
    """<e_i, e_j o T> for a measure-preserving map T, whose jumps are found first; the error as for a density."""
    jumps = _jumps(map_angle)
    edges = np.unique(np.concatenate((basis.edges, jumps)))
    return _until_settled(_map_levels(map_angle, basis, edges), tolerance)


def _map_levels(map_angle: Callable[[Floats], Floats], basis: Basis, edges: Floats) -> Iterator[Floats]:
    pieces = 4
    while pieces == 4 or pieces * edges.size * basis.nodes_per_interval <= MOST_MAP_POINTS:
        share = np.arange(pieces) / pieces
        fine = np.concatenate(((edges[:-1, None] + share * np.diff(edges)[:, None]).ravel(), [np.pi]))
        if basis.is_partition:
            fine = np.unique(np.concatenate((fine, _crossings(map_angle, basis, fine))))
            angle, weight = gauss_rule(fine, 1)
            mass = SINE.mass(fine[:-1], fine[1:])
            total = np.zeros((basis.size, basis.size))
            add_products(total, basis, angle, np.asarray(map_angle(angle), dtype=np.float64), mass)
            yield total
        else:
            angle, weight = gauss_rule(fine, basis.nodes_per_interval)
            total = np.zeros((basis.size, basis.size))
            image = np.asarray(map_angle(angle), dtype=np.float64)
            add_products(total, basis, angle, image, weight * SINE.density(angle))
            yield total
        pieces *= 2


def _crossings(map_angle: Callable[[Floats], Floats], basis: Basis, fine: Floats) -> Floats:
    """Angles inside the given intervals at which the image passes from one cell to another, one an interval."""
    inset = 1e-6 * np.diff(fine)
    low, high = fine[:-1] + inset, fine[1:] - inset
    first = cell_index(basis, np.asarray(map_angle(low), dtype=np.float64))
    last = cell_index(basis, np.asarray(map_angle(high), dtype=np.float64))
    changing = first != last
    low, high, first = low[changing], high[changing], first[changing]
    return _bisected(low, high, lambda middle: cell_index(basis, np.asarray(map_angle(middle))) == first)


def _jumps(map_angle: Callable[[Floats], Floats]) -> Floats:
    """Where a measure-preserving map jumps or turns round: there the measure between two images changes."""
    probe = SINE.quantile((np.arange(JUMP_PROBES) + 0.5) / JUMP_PROBES)
    image = SINE.cdf(np.asarray(map_angle(probe), dtype=np.float64))
    broken = np.abs(np.abs(np.diff(image)) - SINE.mass(probe[:-1], probe[1:])) > JUMP_TOLERANCE
    low, high, start = probe[:-1][broken], probe[1:][broken], image[:-1][broken]

    def still_whole(middle: Floats) -> NDArray[np.bool_]:
        moved = np.abs(SINE.cdf(np.asarray(map_angle(middle), dtype=np.float64)) - start)
        return np.asarray(np.abs(moved - SINE.mass(low, middle)) <= JUMP_TOLERANCE)

    return _bisected(low, high, still_whole)


def _bisected(low: Floats, high: Floats, before: Callable[[Floats], NDArray[np.bool_]]) -> Floats:
    low, high = low.copy(), high.copy()
    if low.size:
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            early = before(middle)
            low, high = np.where(early, middle, low), np.where(early, high, middle)
    return high


def action_matrix(law: HasAction, basis: Basis, tolerance: float) -> tuple[Floats, float]:
    """<e_i, P e_j> by Gauss rules in theta between kinks, with P e_j from ``law.apply``: refined until it settles."""
    return _until_settled(_action_levels(law, basis), tolerance)


def action_is_affordable(law: HasAction, basis: Basis) -> bool:
    """Whether the two coarsest levels of `action_matrix` take no more than about a second."""
    return sum(_action_rule(law, basis, level)[2] for level in (0, 1)) <= MOST_APPLY_VALUES


def _action_rule(law: HasAction, basis: Basis, level: int) -> tuple[Floats, int, int]:
    """Edges, order and number of values of basis functions of one level."""
    share = np.arange(1) if basis.is_partition else np.arange(4) / 4
    split = (basis.edges[:-1, None] + share * np.diff(basis.edges)[:, None]).ravel()
    try:
        kinks = law.kinks(32 * 4**level)[0]
    except InputError:
        kinks = np.empty(0)
    edges = np.unique(np.concatenate((split, [np.pi], GRAZING_EDGES, np.pi - GRAZING_EDGES, kinks)))
    order = 2 if basis.is_partition else -(-basis.nodes_per_interval // 4)
    order += 4 * level
    return edges, order, (edges.size - 1) * order * _fan_out(law) * basis.size


def _fan_out(law: HasAction) -> int:
    return max(int(law.fan_out), 1)


def _action_levels(law: HasAction, basis: Basis) -> Iterator[Floats]:
    level, spent = 0, 0
    step = max(1, CHUNK // (_fan_out(law) * basis.size))
    while True:
        edges, order, work = _action_rule(law, basis, level)
        spent += work
        if level >= 2 and spent > MOST_APPLY_VALUES:
            return
        angle, weight = gauss_rule(edges, order)
        mass = weight * SINE.density(angle)
        total = np.zeros((basis.size, basis.size))
        for start in range(0, angle.size, step):
            part = slice(start, start + step)
            image = law.apply(basis.evaluate, angle[part])
            total += basis.evaluate(angle[part]).T @ (mass[part, None] * image)
        yield total
        level += 1


def _until_settled(levels: Iterator[Floats], tolerance: float) -> tuple[Floats, float]:
    """The first level that differs from the one before by no more than the tolerance, or the last; the difference."""
    current = next(levels)
    difference = np.inf
    for finer in levels:
        difference = float(np.linalg.norm(finer - current))
        current = finer
        if difference <= tolerance:
            break
    return current, difference
