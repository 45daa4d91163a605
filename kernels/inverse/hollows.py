"""Hollows to choose from, and the mixture of their laws that is nearest to a target."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats
from ...core.errors import AsperityError, InputError
from ...geometry import Wall, flat, notched_angle
from ..bases.polynomials import Legendre
from ..discretisation.discretisation import discretise
from ..laws.law import Law
from ..walls.polygons import PolygonLaw
from ..walls.wall_law import WallLaw

# A polygon that leaves more flux than this unresolved by MOST_BEAMS beams is not taken: a search meets thousands.
MOST_BEAMS, RESOLVED = 3000, 1e-11
# Error asked of the moments of curved hollows that are given; polygons have theirs to rounding.
CURVED_TOLERANCE = 1e-9
# Error asked of the moments of traced hollows in the search.
TRACED_TOLERANCE = 1e-2
# Opening angle, radians, and steps a side of the notched angle.
NOTCHED_ANGLE, NOTCHES = 0.1, 300
# Depths of drawn vertices are DEEPEST times the 3/2-th power of a uniform number: shallow ones are more often of use.
DEEPEST, SHALLOWEST, DEPTH_POWER = 2.0, 0.02, 1.5
# Fraction of drawn polygons whose vertices stand in the order of x, without overhangs.
ORDERED = 0.7


@dataclass(frozen=True, eq=False)
class UnitHollow:
    """A wall of period 1 that is one hollow, or flat.

    Parameters
    ----------
    wall : Wall
        Of period 1; its cell, scaled, is put side by side with others.
    traced : bool
        Whether its moments come from rays: a polygon with too many beams.
    """

    wall: Wall
    traced: bool = False

    @classmethod
    def polygon(cls, vertices: ArrayLike) -> UnitHollow | None:
        """The polygon through (0, 0), inner vertices of shape (n, 2), and (1, 0).

        None if it is not one hollow, or does not keep to 0 <= x <= 1: others stand beside it.
        """

        inner = np.asarray(vertices, dtype=np.float64).reshape(-1, 2)
        if np.any(np.abs(inner[:, 0] - 0.5) > 0.5):
            return None
        try:
            wall = Wall.from_vertices(np.concatenate([[(0.0, 0.0)], inner, [(1.0, 0.0)]]))
        except InputError:
            return None
        if len(wall.hollows) != 1 or wall.flat_top > 0.0:
            return None
        return cls(wall)

    @property
    def pieces(self) -> int:
        """How many pieces it has."""
        return len(self.wall.pieces)

    @cached_property
    def is_symmetric(self) -> bool:
        """Whether it is its own mirror image."""
        return self.wall.is_mirror_symmetric

    def mirrored(self) -> UnitHollow:
        """Its mirror image."""
        return UnitHollow(self.wall.mirrored())

    @property
    def is_exact(self) -> bool:
        """Whether its moments come from beams."""
        return self.wall.is_polygonal and not self.traced

    @cached_property
    def law(self) -> Law:
        """The law of the hollow alone."""
        return PolygonLaw(self.wall, max_beams=MOST_BEAMS) if self.is_exact else WallLaw(self.wall)

    def moments(self, basis: Legendre) -> Floats | None:
        """<e_l, P e_m> in a basis; None if they are not known to rounding within the limits of a search."""
        law = self.law
        try:
            if isinstance(law, PolygonLaw):
                return None if float(law.unresolved) > RESOLVED else discretise(law, basis, "exact").symmetric
            tolerance = TRACED_TOLERANCE if self.traced else CURVED_TOLERANCE
            return discretise(law, basis, tolerance=tolerance).symmetric
        except AsperityError:
            return None


def simple_hollows() -> list[UnitHollow]:
    """A flat top, and isosceles triangles and rectangles in steps."""

    slopes = np.tan(np.linspace(0.05, 1.5, 30))
    triangles = [UnitHollow.polygon([(0.5, -0.5 * slope)]) for slope in slopes]
    depths = np.geomspace(0.05, 6.0, 24)
    rectangles = [UnitHollow.polygon([(0.0, -depth), (1.0, -depth)]) for depth in depths]
    return [UnitHollow(flat()), *(hollow for hollow in (*triangles, *rectangles) if hollow is not None)]


def retroreflector() -> UnitHollow:
    """A notched angle, much nearer to a retroreflector than other polygons, with an error of its moments."""

    return UnitHollow(notched_angle(NOTCHED_ANGLE, NOTCHES), traced=True)


def random_polygons(number: int, most_vertices: int, rng: np.random.Generator) -> list[UnitHollow]:
    """Polygons of 1 to ``most_vertices`` drawn vertices, half of them mirror-symmetric; invalid ones are left out."""
    found = []
    for draw in range(number):
        count = int(rng.integers(1, most_vertices + 1))
        x = np.sort(rng.random(count)) if rng.random() < ORDERED else rng.random(count)
        y = -(SHALLOWEST + DEEPEST * rng.random(count) ** DEPTH_POWER)
        vertices = np.column_stack([x, y])
        if draw % 2:
            left = vertices * (0.5, 1.0)
            vertices = np.concatenate([left, (left * (-1.0, 1.0) + (1.0, 0.0))[::-1]])
        hollow = UnitHollow.polygon(vertices)
        if hollow is not None:
            found.append(hollow)
    return found


# Weights below this fraction of the largest are rounding of the solver.
NO_WEIGHT = 1e-15
# Points tried in the place of one, those first along which the distance falls most, and the least gain of an exchange.
EXCHANGES, LEAST_GAIN = 8, 1e-3


def nearest_weights(points: Floats, target: Floats) -> Floats:
    """Weights w >= 0 of sum 1, shape (points,), with the least norm of w @ points - target; most of them are 0.

    The least ||A w|| on the simplex has the direction of the y >= 0 that minimises ||A y||^2 + (1 - sum y)^2 (Lawson
    and Hanson 1974, ch. 23), so that non-negative least squares needs no large weight for the constraint.

    Examples
    --------
    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    >>> nearest_weights(corners, np.array([0.25, 0.25])).round(14).tolist()
    [0.5, 0.25, 0.25]
    """
    from scipy.optimize import nnls

    rows = np.vstack([(points - target).T, np.ones(len(points))])
    wanted = np.zeros(len(rows))
    wanted[-1] = 1.0
    found, _ = nnls(rows, wanted, maxiter=50 * len(points))
    found[found < NO_WEIGHT * found.max()] = 0.0
    return np.asarray(found / found.sum())


def few_weights(points: Floats, target: Floats, cost: Floats, most: float) -> Floats:
    """Weights as `nearest_weights`, of points whose costs sum to at most ``most``; not the best, but a local optimum.

    Orthogonal matching pursuit, then exchanges of one point for another as long as one makes the distance smaller.
    """
    chosen: list[int] = []

    def fitted(members: list[int]) -> tuple[float, Floats]:
        weights = np.zeros(len(points))
        weights[members] = nearest_weights(points[members], target)
        return float(np.linalg.norm(weights @ points - target)), weights

    weights = np.zeros(len(points))
    for _ in range(len(points)):
        residual = weights @ points - target
        order = np.argsort(points @ residual)
        room = most - sum(cost[k] for k in chosen)
        new = next((int(k) for k in order if k not in chosen and cost[k] <= room), None)
        if new is None:
            break
        chosen.append(new)
        weights = fitted(chosen)[1]
        chosen = [k for k in chosen if weights[k] > 0.0]
        if new not in chosen:
            break
    best, weights = fitted(chosen)
    improved = True
    while improved:
        improved = False
        for index in range(len(chosen)):
            others = chosen[:index] + chosen[index + 1 :]
            without = fitted(others)[1] if others else np.zeros(len(points))
            room = most - sum(cost[k] for k in others)
            steepest = np.argsort(points @ (without @ points - target)).tolist()
            for new in [k for k in steepest if cost[k] <= room and k not in others][:EXCHANGES]:
                distance, found = fitted([*others, new])
                if distance < best * (1.0 - LEAST_GAIN):
                    best, weights, improved = distance, found, True
                    chosen = [k for k in (*others, new) if found[k] > 0.0]
                    break
            if improved:
                break
    return weights


def possible_gain(points: Floats, target: Floats, weights: Floats) -> float:
    """By how much the distance to the target could be smaller, at most, for any other weights of the same points.

    With r = w @ points - target and g = max over k of <r, w @ points - point_k>, the duality gap of the conditional
    gradient, all points of the hull lie beyond a plane at the distance ||r|| - g/||r|| from the target.

    Examples
    --------
    >>> possible_gain(np.array([[1.0, 0.0], [0.0, 1.0]]), np.zeros(2), np.array([0.5, 0.5]))
    0.0
    """
    mean = weights @ points
    residual = mean - target
    distance = float(np.linalg.norm(residual))
    gap = max(float(residual @ mean - np.min(points @ residual)), 0.0)
    return gap / distance if gap < distance * distance else distance
