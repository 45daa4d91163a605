"""The part of a wall's law that comes from straight pieces alone, and the edge of its spectrum."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...kernels import WallLaw
from .grazing import REMEMBERED

if TYPE_CHECKING:
    from ...geometry import Wall

# Entry points a short step apart leave by the same angle where all reflections are at straight pieces: rounding is
# below this, and a curved piece turns the ray by the step over its radius, 1e-7 or more unless it is flat.
STEP, SAME_ANGLE = 1e-7, 1e-11
# Outgoing angles of the same angle nearer than this are of one isometry, and so are nodes of one orbit.
SAME_NODE = 1e-8
# Entry points of a row at first, and on the last level, where the changes between them are halved so often.
POINTS, FINE_POINTS, HALVINGS = 256, 2048, 40
# Orbits are followed from so many angles, through so many layers while they have no more nodes than this.
ANGLES, LAYERS, MOST_NODES = 96, 6, 60
# The largest values are looked at again, so often and the last of these times with all entry points, between so many
# angles that are nearer by this factor.
PEAKS, LEVELS, FINE_LEVELS, NEARBY_ANGLES, NEARER = 4, 5, 2, 9, 6.0
# Of what the last level, or the last layers, added: what may still be missing.
BEYOND = 2.0
ROUNDING = 1e-9


@dataclass(frozen=True)
class StraightPart:
    """Rays of a wall that meet straight pieces only, an operator Q between 0 and P.

    Attributes
    ----------
    fraction : float
        <1, Q 1>: the probability of these rays.
    low, high : float
        An interval that holds the top of Q's spectrum, which is all essential: estimated, unless they are equal.
    """

    fraction: float
    low: float
    high: float


@lru_cache(maxsize=REMEMBERED)
def straight_part(law: WallLaw) -> StraightPart:
    r"""How far the spectrum of the straight part of a wall's law reaches.

    Notes
    -----
    Q f(theta) = sum of q_k(theta) f(+-theta + c_k) is symmetric and positive, and so is its restriction to the orbit of
    one angle under the isometries: a matrix with the entries q_k(theta) (sin(theta)/sin(theta'))^(1/2). Functions near
    the points of an orbit show that the top of Q is the supremum of the largest eigenvalues of these matrices, over
    all orbits; those of orbits that are cut off are below it. The supremum is sought on a grid of angles and then near
    its largest values.

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
    angle = np.pi * (np.arange(ANGLES) + 0.5) / ANGLES
    found = _largest_of_orbits(law, angle, POINTS)
    fraction = float(found.fractions @ np.sin(angle) / np.sin(angle).sum())
    if np.all(found.fractions <= flat + 2.0 / POINTS):
        # what more there is would need a fraction of rays below what is seen
        return StraightPart(fraction, flat, min(flat + 2.0 / POINTS, 1.0))
    spacing, best = np.pi / ANGLES, found
    candidates, values = angle, found.roots
    for level in range(LEVELS):
        peaks = candidates[np.argsort(-values)[: PEAKS if level == 0 else 2]]
        spacing /= NEARER
        steps = spacing * np.linspace(-NEARER, NEARER, NEARBY_ANGLES)
        candidates = np.unique(np.clip((peaks[:, None] + steps).ravel(), 1e-6, np.pi - 1e-6))
        fine = level >= LEVELS - FINE_LEVELS
        before, best = best, _largest_of_orbits(law, candidates, FINE_POINTS if fine else POINTS, fine)
        values = best.roots
    low = max(float(best.roots.max()), fraction, flat)
    change = abs(float(best.roots.max()) - float(before.roots.max()))
    high = low + BEYOND * (change + float(best.missing[np.argmax(best.roots)])) + ROUNDING
    return StraightPart(fraction, low - ROUNDING, float(min(high, max(found.fractions.max() + 2.0 / POINTS, low), 1.0)))


@dataclass(frozen=True)
class _Orbits:
    """For each starting angle: the largest eigenvalue of its orbit's matrix, the last layers' part, the fraction."""

    roots: Floats
    missing: Floats
    fractions: Floats


def _largest_of_orbits(law: WallLaw, starts: Floats, points: int, halved: bool = False) -> _Orbits:
    conditionals: dict[int, tuple[Floats, Floats]] = {}
    orbits = [[_node(theta)] for theta in starts]
    angles = {_node(theta): float(theta) for theta in starts}
    roots = np.zeros((LAYERS, len(starts)))
    fresh = list(dict.fromkeys(node for orbit in orbits for node in orbit))
    for layer in range(LAYERS):
        conditionals |= _conditionals(law, [(node, angles[node]) for node in fresh], points, halved)
        fresh = []
        for k, orbit in enumerate(orbits):
            roots[layer, k] = _root(orbit, conditionals, angles)
            if layer == LAYERS - 1:
                continue
            reached = {_node(out): float(out) for node in orbit for out in conditionals[node][1]}
            new = [node for node in reached if not _near(node, orbit)]
            if len(orbit) + len(new) <= MOST_NODES:
                for node in new:
                    angles.setdefault(node, reached[node])
                    orbit.append(node)
                fresh += [node for node in new if node not in conditionals]
        fresh = list(dict.fromkeys(fresh))
    fractions = np.array([conditionals[_node(theta)][0].sum() for theta in starts])
    return _Orbits(roots[-1], roots[-1] - roots[-2], fractions)


def _node(theta: float) -> int:
    return round(float(theta) / SAME_NODE)


def _near(node: int, orbit: list[int]) -> bool:
    return any(abs(node - other) <= 1 for other in orbit)


def _root(orbit: list[int], conditionals: dict[int, tuple[Floats, Floats]], angles: dict[int, float]) -> float:
    """The largest eigenvalue on the nodes of an orbit, all of whose rows are known."""
    matrix = np.zeros((len(orbit), len(orbit)))
    for i, node in enumerate(orbit):
        for weight, out in zip(*conditionals[node], strict=True):
            target = _node(out)
            j = next((j for j, other in enumerate(orbit) if abs(other - target) <= 1), None)
            if j is not None:
                matrix[i, j] += weight * np.sqrt(np.sin(angles[node]) / np.sin(angles[orbit[j]]))
    return float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[-1])


def _conditionals(
    law: WallLaw, nodes: list[tuple[int, float]], points: int, halved: bool
) -> dict[int, tuple[Floats, Floats]]:
    """Weights and outgoing angles of the straight rays of each node's angle."""
    if not nodes:
        return {}
    theta = np.array([angle for _, angle in nodes])
    x = np.broadcast_to((np.arange(points) + 0.5) / points, (len(nodes), points))
    out = _straight(law, x.ravel(), np.repeat(theta, points)).reshape(len(nodes), points)
    labels = np.rint(np.nan_to_num(out, nan=-1.0) / SAME_NODE).astype(np.int64)
    row, entry = np.nonzero(np.abs(np.diff(labels, axis=1)) > 1)
    low, high = x[row, entry], x[row, entry + 1]
    if halved:
        low, high = _changes(law, theta[row], low, high, labels[row, entry])
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


def _changes(law: WallLaw, theta: Floats, low: Floats, high: Floats, label: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """The first change of the label to the right of ``low``, nearer than rounding shows."""
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        here = np.rint(np.nan_to_num(_straight(law, middle, theta), nan=-1.0) / SAME_NODE).astype(np.int64)
        same = np.abs(here - label) <= 1
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return low, high


def _straight(law: WallLaw, x: Floats, theta: Floats) -> Floats:
    """Outgoing angles of the rays that meet straight pieces only; nan of the others."""
    if not x.size:
        return np.empty(0)
    here, there = (law.reflect_with_status(entry, theta)[0] for entry in (x, np.minimum(x + STEP, 1.0 - 2.0**-53)))
    return np.where(np.abs(here - there) <= SAME_ANGLE, here, np.nan)


def _has_straight_pieces_below(wall: Wall) -> bool:
    from ...geometry import Segment

    if not wall.closes:
        return any(isinstance(piece, Segment) for loop in (wall.pieces, *wall.islands) for piece in loop)
    below = [piece for hollow in wall.hollows for piece in wall.cell.pieces[hollow.first : hollow.last]]
    return any(isinstance(piece, Segment) for piece in below)
