"""The part of a wall's law from rays that meet straight pieces only, and the edge of its spectrum."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.estimates import student_95
from ...core.long_runs import progress_bar
from ...geometry import Wall
from ...kernels import Bins, FacetedLaw, WallLaw
from ...kernels.discretisation.radiosity import specular_sums
from .grazing import REMEMBERED

# Two rays with entry points this step apart leave at the same angle, to rounding, if all reflections are at straight
# pieces. A curved piece changes the angle by the step over its radius, 1e-7 or more unless the piece is flat.
STEP, SAME_ANGLE = 1e-7, 1e-11
# Outgoing angles closer than this belong to one isometry, or are one node of an orbit.
SAME_NODE = 1e-8
# Entry points per angle on the first levels and on the last ones, and bisections of changes on the last ones.
POINTS, FINE_POINTS, HALVINGS = 256, 2048, 24
# Number of initial angles, layers of an orbit, and limit on its nodes.
ANGLES, LAYERS, MOST_NODES = 96, 6, 60
# Search near the largest values: peaks, levels, levels with all entry points, angles per peak, ratio of spacings.
PEAKS, LEVELS, FINE_LEVELS, NEARBY_ANGLES, NEARER = 4, 5, 2, 9, 6.0
# Error as a multiple of the change by the last level plus the last layer.
BEYOND = 2.0
ROUNDING = 1e-9
# Of specular rays between facets: points of each Sobol sequence, its seed, and numbers of bins of trial functions.
POINTS_OF_FACETS, SEED, CELLS = 2**15, (0,), (1, 32, 128, 512)


@dataclass(frozen=True)
class StraightPart:
    """The operator Q of the rays of a wall that meet straight pieces only, 0 <= Q <= P.

    Attributes
    ----------
    fraction : float
        <1, Q 1>, the probability of these rays.
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
    wall = law.wall
    flat = wall.flat_top / wall.period
    if not _has_straight_pieces_below(wall):
        return StraightPart(flat, flat, flat)
    with progress_bar(LAYERS * (1 + LEVELS), "layer", "essential edge") as bar:
        return _searched(law, flat, bar)


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


def _searched(law: WallLaw, flat: float, bar: Any) -> StraightPart:
    """The straight part of a wall with straight pieces below its top, of which a fraction is flat."""
    angle = np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    found = _largest_of_orbits(law, angle, POINTS, bar)
    fraction = float(found.fractions @ np.sin(angle) / np.sin(angle).sum())
    if np.all(found.fractions <= flat + 2.0 / POINTS):
        # more straight rays would be a smaller fraction than the entry points resolve
        return StraightPart(fraction, flat, min(flat + 2.0 / POINTS, 1.0))
    spacing, best = np.pi / ANGLES, found
    candidates, values = angle, found.roots
    for level in range(LEVELS):
        peaks = candidates[np.argsort(-values)[: PEAKS if level == 0 else 2]]
        spacing /= NEARER
        steps = spacing * np.linspace(-NEARER, NEARER, NEARBY_ANGLES)
        candidates = np.unique(np.clip((peaks[:, None] + steps).ravel(), 1e-6, np.pi - 1e-6))
        fine = level >= LEVELS - FINE_LEVELS
        before, best = best, _largest_of_orbits(law, candidates, FINE_POINTS if fine else POINTS, bar, fine)
        values = best.roots
    low = max(float(best.roots.max()), fraction, flat)
    change = abs(float(best.roots.max()) - float(before.roots.max()))
    high = low + BEYOND * (change + float(best.missing[np.argmax(best.roots)])) + ROUNDING
    return StraightPart(fraction, low - ROUNDING, float(min(high, max(found.fractions.max() + 2.0 / POINTS, low), 1.0)))


class _Orbits(NamedTuple):
    """For each initial angle the largest eigenvalue of its orbit, its change by the last layer, and the fraction."""

    roots: Floats
    missing: Floats
    fractions: Floats


def _largest_of_orbits(law: WallLaw, starts: Floats, points: int, bar: Any, halved: bool = False) -> _Orbits:
    conditionals: dict[int, tuple[Floats, Floats]] = {}
    orbits = [[_node(theta)] for theta in starts]
    angles = {_node(theta): float(theta) for theta in starts}
    roots = np.zeros((LAYERS, len(starts)))
    fresh = list(angles)
    for layer in range(LAYERS):
        conditionals |= _conditionals(law, [(node, angles[node]) for node in fresh], points, halved)
        fresh = []
        for k, orbit in enumerate(orbits):
            roots[layer, k] = _root(orbit, conditionals, angles)
            if layer == LAYERS - 1:
                continue
            reached = {_node(out): float(out) for node in orbit for out in conditionals[node][1]}
            new = [node for node in reached if _index(node, orbit) is None]
            if len(orbit) + len(new) <= MOST_NODES:
                for node in new:
                    angles.setdefault(node, reached[node])
                    orbit.append(node)
                fresh += [node for node in new if node not in conditionals]
        fresh = list(dict.fromkeys(fresh))
        bar.update()
    fractions = np.array([conditionals[_node(theta)][0].sum() for theta in starts])
    return _Orbits(roots[-1], roots[-1] - roots[-2], fractions)


def _node(theta: float) -> int:
    return round(float(theta) / SAME_NODE)


def _index(node: int, orbit: list[int]) -> int | None:
    """The index of the first node of an orbit that is within rounding of a node."""
    return next((j for j, other in enumerate(orbit) if abs(other - node) <= 1), None)


def _root(orbit: list[int], conditionals: dict[int, tuple[Floats, Floats]], angles: dict[int, float]) -> float:
    """The largest eigenvalue on the nodes of an orbit."""
    matrix = np.zeros((len(orbit), len(orbit)))
    for i, node in enumerate(orbit):
        for weight, out in zip(*conditionals[node], strict=True):
            if (j := _index(_node(out), orbit)) is not None:
                matrix[i, j] += weight * np.sqrt(np.sin(angles[node]) / np.sin(angles[orbit[j]]))
    return float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[-1])


def _conditionals(
    law: WallLaw, nodes: list[tuple[int, float]], points: int, halved: bool
) -> dict[int, tuple[Floats, Floats]]:
    """Weights and outgoing angles of the straight rays for the angle of each node."""
    theta = np.array([angle for _, angle in nodes])
    x = np.broadcast_to((np.arange(points) + 0.5) / points, (len(nodes), points))
    out = _straight(law, x.ravel(), np.repeat(theta, points)).reshape(len(nodes), points)
    labels = _labels(out)
    row, entry = np.nonzero(np.abs(np.diff(labels, axis=1)) > 1)
    low, high = x[row, entry], x[row, entry + 1]
    if halved:
        low, high = _changes(law, theta[row], low, high, labels[row, entry], labels[row, entry + 1])
    middle = 0.5 * (low + high)
    found = {}
    for k, (node, _) in enumerate(nodes):
        own = row == k
        ends = np.concatenate([[0.0], middle[own], [1.0]])
        first = np.concatenate([[0], entry[own] + 1])
        here = out[k, first]
        finite = np.isfinite(here)
        found[node] = (np.diff(ends)[finite], here[finite])
    return found


def _labels(out: Floats) -> NDArray[np.int64]:
    """The nodes of outgoing angles, and one number for all other rays."""
    return np.rint(np.nan_to_num(out, nan=-1.0) / SAME_NODE).astype(np.int64)


def _changes(
    law: WallLaw, theta: Floats, low: Floats, high: Floats, before: NDArray[np.int64], after: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Intervals, bisected to less than `ROUNDING`, that contain a change of the label that is ``before`` at ``low``.

    A ray that meets a curved piece has the angle of an isometry with probability 0, so one ray tells a straight label.
    """
    curved = before == _labels(np.array([np.nan]))
    known = np.where(curved, after, before)
    for _ in range(HALVINGS if low.size else 0):
        middle = 0.5 * (low + high)
        same = (np.abs(_labels(law.reflect_with_status(middle, theta)[0]) - known) <= 1) != curved
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low, high


def _straight(law: WallLaw, x: Floats, theta: Floats) -> Floats:
    """Outgoing angles of the rays that meet straight pieces only, and nan for other rays."""
    if not x.size:
        return np.empty(0)
    here, there = (law.reflect_with_status(entry, theta)[0] for entry in (x, np.minimum(x + STEP, 1.0 - 2.0**-53)))
    return np.where(np.abs(here - there) <= SAME_ANGLE, here, np.nan)


def _has_straight_pieces_below(wall: Wall) -> bool:
    loops = [wall.pieces, *wall.islands]
    if wall.closes:
        loops = [wall.cell.pieces[hollow.first : hollow.last] for hollow in wall.hollows]
    return any(piece.is_straight for loop in loops for piece in loop)
