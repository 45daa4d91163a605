"""The rays of a wall that meet straight pieces only: isometries, and the top of the spectrum of their share of P."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.estimates import student_95
from ...core.long_runs import progress_bar
from ...geometry import Wall
from ...kernels import Bins, FacetedLaw, WallLaw
from ...kernels.discretisation.radiosity import specular_sums
from ...kernels.walls.conditionals import WallConditionals
from .grazing import REMEMBERED

# Outgoing angles closer than this are one node of an orbit, and constants of isometries so close are one.
SAME_NODE, SAME_HALF = 1e-10, 1e-8
# Errors of the weights on the first levels, on the last ones, and at the largest values.
ROUGH, FINE, FINEST = 1e-6, 1e-7, 1e-9
# Number of angles of the grid, of those at which orbits begin, and limit on special directions.
GRID, ANGLES, MOST_DIRECTIONS = 384, 96, 512
# Intervals in each of which the widest pieces that appear or disappear are looked for.
INTERVALS = 16
# Layers of an orbit, and limits on its nodes, in the search and at its end.
LAYERS, FEW_NODES, MOST_NODES = 10, 12, 200
# Search near the largest values: peaks, levels, rough levels, ratio of spacings, and the change that ends the search.
PEAKS, LEVELS, ROUGH_LEVELS, NEARER, SMALL_CHANGE = 4, 8, 3, 6, 1e-9
# Rounds, and iterations in each, of Q^n 1, and the least value of this function beside its largest.
ROUNDS, ITERATIONS, LEAST_VALUE = 6, 32, 1e-3
# Least and largest angle of an orbit.
LIMITS = 1e-6, np.pi - 1e-6
# Error as a multiple of the change by the last level plus the last layer, and its least value. In a chain of equal
# weights the layers beyond the tenth add 4.4 times as much as the tenth. If they may add more than that, or if orbits
# nearby have so much lower values, which few nodes do, Q is iterated.
BEYOND, LEAST_ERROR, MUCH_MISSING, TOO_STEEP = 5.0, 1e-9, 1e-6, 1e-3
# Of specular rays between facets: points of each Sobol sequence, its seed, and numbers of bins of trial functions.
POINTS_OF_FACETS, SEED, CELLS = 2**15, (0,), (1, 32, 128, 512)


@dataclass(frozen=True)
class StraightPart:
    """The operator Q of the rays of a wall that meet straight pieces only, 0 <= Q <= P.

    Attributes
    ----------
    fraction : float
        A lower bound of <1, Q 1>, the probability of these rays, from a grid.
    low, high : float
        An interval that contains the top of the spectrum of Q, all of which is essential. It is estimated, unless the
        ends are equal.
    """

    fraction: float
    low: float
    high: float


@lru_cache(maxsize=REMEMBERED)
def straight_part(law: WallLaw) -> StraightPart:
    r"""The operator Q of the rays that meet straight pieces only: its fraction and the top of its spectrum.

    Notes
    -----
    Q f(theta) = sum of q_k(theta) f(+-theta + c_k) is symmetric and positive. So is its restriction to the orbit of one
    angle under the isometries, a matrix with the entries q_k(theta) (sin(theta)/sin(theta'))^(1/2). The top of Q is the
    supremum over all orbits of the largest eigenvalues of these matrices, as functions near the points of an orbit
    show. Truncated orbits give lower values. The supremum is searched on a grid of angles and near its largest values.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> bowl = geo.Bezier([(0, 0), (0.5, -1), (1, 0)])
    >>> wall = geo.Wall([bowl, geo.Segment((1, 0), (2, 0))], period=2.0)
    >>> straight_part(WallLaw(wall))
    StraightPart(fraction=0.5, low=0.5, high=0.5)
    """
    # in which curves that are straight to rounding are segments
    wall = law.wall.cell
    flat = wall.flat_top / wall.period
    if not _has_straight_pieces_below(wall):
        return StraightPart(flat, flat, flat)
    with progress_bar(LAYERS * (2 + LEVELS), "layer", "essential edge") as bar:
        return _searched(wall, flat, bar)


@lru_cache(maxsize=REMEMBERED)
def specular_part(law: FacetedLaw) -> StraightPart:
    r"""The isometries of a wall with facets a Lambertian + (1 - a) specular: rays that no facet scatters.

    Notes
    -----
    B f(theta) = E[(1 - a)^N f(theta')], with N hits of a specular ray. For straight pieces B is made of isometries, so
    its whole spectrum is essential. Its top is at least the quotient of any function: of constants, E[(1 - a)^N], and
    of the top function of a matrix from one half of the rays, with the other half. Since N >= 1 it is at most 1 - a.
    With curved pieces only the rays that meet straight ones alone count.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> found = specular_part(FacetedLaw(geo.triangular_teeth(0.9), ker.maxwell(0.2)))
    >>> 0.7 < found.low < found.high == 0.8
    True
    """
    wall, kept = law.wall, 1.0 - (law.diffuse_fraction or 0.0)
    if not wall.is_polygonal:
        flat = kept * wall.flat_top / wall.period
        return StraightPart(flat, flat, kept * straight_part(WallLaw(wall)).high)
    bounds, most = [], CELLS[-1]
    fine, _ = specular_sums(wall.cell, kept, Bins(most), POINTS_OF_FACETS, SEED)
    for cells in CELLS:
        each = most // cells
        parts = fine.reshape(-1, cells, each, cells, each).sum(axis=(2, 4)) / each
        seen, others = np.split(parts, 2)
        top = np.linalg.eigh(seen.sum(axis=0) + seen.sum(axis=0).T)[1][:, -1]
        quotients = others @ top @ top
        bounds.append(
            max(float(quotients.mean() - student_95(len(others)) * quotients.std(ddof=1) / np.sqrt(len(others))), 0.0)
        )
    return StraightPart(bounds[0], max(bounds), kept)


def _searched(wall: Wall, flat: float, bar: Any) -> StraightPart:
    """The straight part of a wall with straight pieces below its top, of which a fraction is flat."""
    straight = _Straight(wall)
    grid = np.pi * (np.arange(GRID) + 0.5) / GRID
    first = straight(grid, ROUGH)
    sums = np.array([each.weights.sum() for each in first])
    fraction = max(_least_mean(sums, np.sin(grid)), flat)
    directions = np.clip(_directions(wall), *LIMITS)
    # critical angles are known between angles of earlier calls
    straight(directions, ROUGH)
    axes = np.concatenate([directions, straight.critical_angles(), _fixed_angles(grid, first)])
    axes = np.unique(np.clip(axes, *LIMITS))
    at_axes = np.array([each.weights.sum() for each in straight(axes, ROUGH)])
    error = max(each.error for each in first)
    if max(sums.max(), at_axes.max()) <= flat + error:
        # more straight rays would be fewer than the errors
        return StraightPart(fraction, flat, min(flat + error, 1.0))
    low, high = _by_orbits(straight, grid, axes[np.argsort(-at_axes, kind="stable")[:ANGLES]], bar)
    return StraightPart(fraction, max(low, flat), min(max(high, low, flat), 1.0))


def _least_mean(values: Floats, mass: Floats) -> float:
    """The weighted mean on a grid, less the distance of those on its halves."""
    whole, *halves = (
        float(mass[part] @ values[part] / mass[part].sum())
        for part in (slice(None), slice(0, None, 2), slice(1, None, 2))
    )
    return whole - abs(halves[0] - halves[1])


def _directions(wall: Wall) -> Floats:
    """Angles of rays that meet a straight piece at right angles, or along a line through two joints, or after mirrors.

    A deep channel is open for few angles only.
    """
    pieces = [piece for loop in (wall.pieces, *wall.islands) for piece in loop if piece.is_straight]
    side = np.unique([np.arctan2(*np.subtract(piece.end, piece.start)[::-1]) for piece in pieces])
    normal = side + 0.5 * np.pi
    joints = np.concatenate([wall.vertices, *wall.island_vertices])
    lines = [np.arctan2(*(joints[apart:] - joints[:-apart]).T[::-1]) for apart in range(1, len(joints))]

    def mirrored(directions: Floats) -> Floats:
        return np.subtract.outer(2.0 * side, directions).ravel()

    found = normal
    for more in (mirrored(normal), mirrored(mirrored(normal)), *lines, *map(mirrored, lines)):
        if len(found) + len(more) <= MOST_DIRECTIONS:
            found = np.unique(np.mod(np.append(found, more), np.pi))
    return np.asarray(found)


def _by_orbits(straight: _Straight, grid: Floats, axes: Floats, bar: Any) -> tuple[float, float]:
    """An interval for the top of Q from the orbits of a grid, of special angles, and near the largest roots."""
    candidates, spacing = np.unique(np.append(grid[:: GRID // ANGLES], axes)), np.pi / ANGLES
    found = _roots_of_orbits(straight, candidates, ROUGH, FEW_NODES, bar)
    values = found.roots
    for level in range(LEVELS):
        axes = _peaks(axes, values[np.searchsorted(candidates, axes)], PEAKS, 0.0)
        peaks = _peaks(candidates, values, PEAKS if level == 0 else 2, 1.5 * spacing)
        # a peak that is steep on one side may be a whole spacing away from the largest value
        candidates, spacing = np.union1d(_around(peaks, spacing), axes), spacing / NEARER
        before = values.max()
        found = _roots_of_orbits(straight, candidates, ROUGH if level < ROUGH_LEVELS else FINE, FEW_NODES, bar)
        values = found.roots
        # a cusp between two angles is higher by as much as the values next to the largest one are lower
        peak = int(np.argmax(values))
        steep = float(values[peak] - values[np.abs(candidates - candidates[peak]) <= 1.5 * spacing].min())
        change = abs(float(values[peak] - before))
        if level >= ROUGH_LEVELS and change + steep <= SMALL_CHANGE:
            break
    best = _roots_of_orbits(straight, _peaks(candidates, values, PEAKS, 0.0), FINEST, MOST_NODES, bar)
    top = int(np.argmax(best.roots))
    value, error = float(best.roots[top]), float(best.errors[top]) + LEAST_ERROR
    missing = BEYOND * float(best.missing[top])
    low, high = value - error, value + BEYOND * change + steep + missing + error
    if not (best.is_cut or missing > MUCH_MISSING or steep > TOO_STEEP):
        return low, high
    # at the nodes of an orbit the supremum is at least its eigenvalue
    least, most = _by_iteration(straight, grid, np.concatenate([axes, candidates, *best.nodes]), bar)
    most = max(value + error, most)
    seen = not best.is_cut and steep <= TOO_STEEP and least <= value
    return max(low, least), min(high, most) if seen else most


def _around(peaks: Floats, spacing: float) -> Floats:
    """Angles around some, up to a spacing away."""
    steps = spacing * np.linspace(-1.0, 1.0, 2 * NEARER + 1)
    return np.unique(np.clip(peaks[:, None] + steps, *LIMITS))


def _fixed_angles(starts: Floats, found: list[_Isometries]) -> Floats:
    """The angles c/2 that isometries c - theta keep, where an orbit and its mirror image meet in a cusp."""
    halves = np.concatenate([0.5 * (theta + np.unique(out)) for theta, (_, out, _) in zip(starts, found, strict=True)])
    _, first, count = np.unique(np.rint(halves / SAME_HALF), return_index=True, return_counts=True)
    return np.asarray(halves[first[count > 1]])


def _peaks(candidates: Floats, values: Floats, number: int, apart: float) -> Floats:
    """The angles of the largest values, no two of them closer than ``apart``."""
    chosen: list[float] = []
    for angle in candidates[np.argsort(-values, kind="stable")].tolist():
        if len(chosen) < number and all(abs(angle - other) > apart for other in chosen):
            chosen.append(angle)
    return np.array(chosen)


def _by_iteration(straight: _Straight, grid: Floats, special: Floats, bar: Any) -> tuple[float, float]:
    """An interval for the top of Q where orbits have too many nodes: <v, Q v>/<v, v> and sup Q v/v, for v = Q^n 1.

    Every such quotient is a lower bound, every such supremum an upper bound (Collatz and Wielandt). The function v is
    linear between angles, to which others near the largest values of Q v/v are added in rounds.
    """
    theta = np.unique(np.concatenate([grid, special, np.clip(straight.critical_angles(), *LIMITS)]))
    found = straight(theta, ROUGH)
    v, low, spacing = np.ones(len(theta)), 0.0, np.pi / len(grid)
    for _ in range(ROUNDS):
        on_grid, rows = np.searchsorted(theta, grid), _Rows.of(found)
        for _ in range(ITERATIONS):
            image = rows.applied(theta, v)
            mass = np.sin(grid) * v[on_grid] ** 2
            low = max(low, _least_mean(image[on_grid] / v[on_grid], mass))
            v = image / image.max() + LEAST_VALUE
        ratio = (rows.applied(theta, v) + rows.errors) / v
        peaks = _peaks(theta, ratio, PEAKS, 1.5 * spacing)
        more = np.setdiff1d(_around(peaks, spacing), theta)
        spacing /= NEARER
        nearer, there = straight(more, ROUGH), np.interp(more, theta, v)
        fresh = _Rows.of(nearer)
        beyond = (fresh.applied(theta, v) + fresh.errors) / there
        growth = max(float(beyond.max() - ratio.max()), 0.0)
        order = np.argsort(np.append(theta, more))
        found = [(found + nearer)[k] for k in order]
        theta, v = np.append(theta, more)[order], np.append(v, there)[order]
        bar.update()
    of_one = max(float(each.weights.sum()) + each.error for each in found)
    high = min(max(float(ratio.max()), float(beyond.max())) + BEYOND * growth, of_one)
    orbits = _roots_of_orbits(straight, peaks, FINE, MOST_NODES, bar)
    return max(low - ROUGH, float((orbits.roots - orbits.errors).max())), high


class _Rows(NamedTuple):
    """The isometries of several angles one after another, with the number of their angle, and the errors of angles."""

    owner: NDArray[np.intp]
    weights: Floats
    outgoing: Floats
    errors: Floats

    @staticmethod
    def of(found: list[_Isometries]) -> _Rows:
        weights, outgoing, errors = zip(*found, strict=True)
        owner = np.repeat(np.arange(len(found)), list(map(len, weights)))
        return _Rows(owner, np.concatenate(weights), np.concatenate(outgoing), np.array(errors))

    def applied(self, nodes: Floats, v: Floats) -> Floats:
        """Q v at the angles, for v linear between nodes."""
        image = np.bincount(self.owner, self.weights * np.interp(self.outgoing, nodes, v), len(self.errors))
        return np.asarray(image)


class _Isometries(NamedTuple):
    """The weights and outgoing angles of the straight rays at one angle, with the error of the weights."""

    weights: Floats
    outgoing: Floats
    error: float


class _Straight:
    """The rays of a wall that meet straight pieces only: tracing ends at the first curve."""

    def __init__(self, wall: Wall) -> None:
        self.conditionals = WallConditionals(wall, 0, np.empty(0), curves_absorb=True)

    def critical_angles(self) -> Floats:
        """Angles where the widest pieces appear or disappear between angles of earlier calls, of some intervals."""
        parts = np.linspace(*LIMITS, INTERVALS + 1)
        return np.concatenate([self.conditionals.critical_angles(low, high) for low, high in pairwise(parts.tolist())])

    def __call__(self, theta: Floats, tolerance: float) -> list[_Isometries]:
        """The isometries at some angles, with weights to a tolerance."""
        found, unresolved = self.conditionals(theta, tolerance)
        return [
            _Isometries(*self.conditionals.escaped(angle), float(found.error[k] + unresolved[k]))
            for k, angle in enumerate(theta.tolist())
        ]


class _Orbits(NamedTuple):
    """For each initial angle the largest eigenvalue of its orbit, its change by the last layer, and its error.

    Then the nodes, and whether any orbit has too many.
    """

    roots: Floats
    missing: Floats
    errors: Floats
    nodes: list[Floats]
    is_cut: bool


def _roots_of_orbits(straight: _Straight, starts: Floats, tolerance: float, most_nodes: int, bar: Any) -> _Orbits:
    known: dict[float, _Isometries] = {}
    orbits = [_Orbit(angle) for angle in starts.tolist()]
    for layer in range(LAYERS):
        # no orbit takes the weights at an angle nearby: they may change within 1e-8
        fresh = list(dict.fromkeys(angle for orbit in orbits for angle in orbit.last_layer() if angle not in known))
        if fresh:
            known |= zip(fresh, straight(np.array(fresh), tolerance), strict=True)
        if layer < LAYERS - 1:
            for orbit in orbits:
                orbit.grow(known, most_nodes)
        bar.update()
    (roots, errors), (before, _) = (
        np.array([orbit.root(known, layers) for orbit in orbits]).T for layers in (LAYERS, LAYERS - 1)
    )
    nodes = [np.array(orbit.angles) for orbit in orbits]
    return _Orbits(roots, np.maximum(roots - before, 0.0), errors, nodes, any(orbit.is_cut for orbit in orbits))


class _Orbit:
    """The nodes that isometries reach from one angle: their angles, and how many there are after each layer."""

    def __init__(self, angle: float) -> None:
        self.angles, self.places, self.sizes, self.is_cut = [angle], {_node(angle): 0}, [0, 1], False

    def last_layer(self) -> list[float]:
        """The angles of the last layer."""
        return self.angles[self.sizes[-2] :]

    def grow(self, known: dict[float, _Isometries], most_nodes: int) -> None:
        """Add the nodes that the last layer reaches, with those of the largest weights first if they are too many."""
        reached: dict[int, tuple[float, float]] = {}
        for angle in self.last_layer():
            for weight, out in zip(known[angle].weights.tolist(), known[angle].outgoing.tolist(), strict=True):
                if self._place(out) is None:
                    reached[_node(out)] = reached.get(_node(out), (0.0, out))[0] + weight, out
        room = most_nodes - len(self.angles)
        self.is_cut |= len(reached) > room
        for _, out in sorted(reached.values(), reverse=True)[:room]:
            if self._place(out) is None:
                self.places[_node(out)] = len(self.angles)
                self.angles.append(out)
        self.sizes.append(len(self.angles))

    def root(self, known: dict[float, _Isometries], layers: int) -> tuple[float, float]:
        """The largest eigenvalue on the nodes of the first layers, and its error.

        The matrix is symmetric but for rounding of angles, at which weights may change fast: the lesser of two entries
        counts, and the greater in the error, which the largest probability of straight rays limits.
        """
        size, roots = self.sizes[layers], np.sqrt(np.sin(self.angles))
        matrix = np.zeros((size, size))
        for i, angle in enumerate(self.angles[:size]):
            for weight, out in zip(known[angle].weights.tolist(), known[angle].outgoing.tolist(), strict=True):
                if (j := self._place(out)) is not None and j < size:
                    matrix[i, j] += weight * roots[i] / roots[j]
        least, most = (np.linalg.eigvalsh(of(matrix, matrix.T))[-1] for of in (np.minimum, np.maximum))
        nodes = [known[angle] for angle in self.angles[:size]]
        most = max(min(most, max(each.weights.sum() for each in nodes)), least)
        return float(least), float(most - least) + max(each.error for each in nodes)

    def _place(self, angle: float) -> int | None:
        """The place of the node that is within rounding of an angle."""
        node = _node(angle)
        return next((self.places[other] for other in (node, node - 1, node + 1) if other in self.places), None)


def _node(theta: float) -> int:
    return round(theta / SAME_NODE)


def _has_straight_pieces_below(wall: Wall) -> bool:
    loops = [wall.pieces, *wall.islands]
    if wall.closes:
        loops = [wall.pieces[hollow.first : hollow.last] for hollow in wall.hollows]
    return any(piece.is_straight for loop in loops for piece in loop)
