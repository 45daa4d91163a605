"""Conditional distributions of the law of a traced wall, by adaptive quadrature in the entry point, with errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, angles, finite_number, instance
from ...core.errors import InputError
from ...geometry import Wall
from ..bases.basis import AngleFunction
from ..bases.legendre import Legendre
from ..expectations.basis_means import Expectations, means_of_basis
from .hollow_conditionals import NO_LIMIT, HollowConditionals

# Pieces of a wall up to which a row takes no more than some milliseconds.
MOST_PIECES = 64
# The first of the Gauss rules on a piece that may be used for polynomials on panels.
PANEL_LEVEL = 2
# A pilot run at some angles tells chaotic hollows: 31,000 and 71,000 flights an angle against 260 to 7,400 of 28 other
# walls. One angle stops at so many.
PILOT_ANGLES = np.linspace(0.13, 3.01, 12)
PILOT_TOLERANCE = 1e-3
MANY_SEGMENTS, MOST_PILOT_SEGMENTS = 15_000, 400_000


@dataclass(frozen=True)
class AdaptiveConditionals:
    """Rows P(theta, d theta') of a wall as weighted outgoing angles.

    Attributes
    ----------
    theta : array, shape (rows,)
    nodes, weights : arrays
        Outgoing angles and their probabilities, row after row; the weights of a row sum to 1.
    starts : array of int, shape (rows + 1,)
        Row k owns ``nodes[starts[k]:starts[k + 1]]``.
    error : array, shape (rows,)
        Estimated error of the mean of a function of sup norm 1 and the degree asked for.
    lost : array, shape (rows,)
        Probability of rays that did not escape; they are sent back.
    rays, flights : int
        Number of rays traced, and of their flights from one collision to the next: what the rows have cost.
    """

    theta: Floats
    nodes: Floats
    weights: Floats
    starts: NDArray[np.int64]
    error: Floats
    unresolved: Floats
    rays: int
    segments: int

    def mean(self, function: AngleFunction) -> Floats:
        """E[f(Theta') | theta] for every angle, shape ``(angles,) + extra`` if f has values ``theta.shape + extra``."""
        values = np.asarray(function(self.nodes), dtype=np.float64)
        weighted = self.weights.reshape((-1,) + (1,) * (values.ndim - 1)) * values
        return np.add.reduceat(weighted, self.starts[:-1], axis=0)


def is_few(wall: Wall) -> bool:
    """Whether the wall has so few pieces that its rows are cheap: a row costs about their number squared."""
    return len(wall.pieces) + sum(map(len, wall.islands)) <= MOST_PIECES


def adaptive_conditionals(
    wall: Wall, theta: ArrayLike, tolerance: float = 1e-10, degree: int = 1, edges: ArrayLike = ()
) -> AdaptiveConditionals:
    r"""Rows of a wall's law to a tolerance.

    Parameters
    ----------
    wall : Wall
    theta : array_like
        Incoming angles in (0, pi), radians; one row each, in this order.
    tolerance : float
        Wanted error of the mean of a function of sup norm 1.
    degree : int
        Highest degree, as a trigonometric polynomial, of the functions that the rows will be used for; 0 if they are
        constant between the edges.
    edges : array_like
        Outgoing angles where the functions are not smooth.

    Returns
    -------
    AdaptiveConditionals

    Raises
    ------
    InputError
        If an angle is not in (0, pi), or the tolerance is not positive.

    Notes
    -----
    For fixed theta the map from the entry point to theta' is analytic between changes of the itinerary. The changes
    are found by bisection; between them Gauss rules take over. Near cusps and grazing there are infinitely many: what
    is left undecided is counted in the error. The error is an estimate: a piece narrower than the distance of the
    samples can be overlooked, unless a row next to it in theta has seen it. Held against references of a second method
    (tests/reference_rows.py), 4 of 720 rows of 24 walls were further off than reported; in the median the report was
    11 times the true error.

    Examples
    --------
    >>> from math import cos
    >>> from asperity import geometry as geo
    >>> conditionals = adaptive_conditionals(geo.flat(), [0.5])
    >>> conditionals.weights.tolist(), bool(conditionals.mean(np.cos)[0] == cos(np.pi - 0.5))
    ([1.0], True)
    """
    instance("wall", wall, Wall, "geo.triangular_teeth(0.7)")
    if not finite_number("tolerance", tolerance) > 0.0:
        raise InputError(f"tolerance: expected a number greater than 0, got {tolerance!r}")
    incoming = np.atleast_1d(angles("theta", theta)).ravel()
    return WallConditionals(wall, int(degree), np.asarray(edges, dtype=np.float64))(incoming, tolerance)


class WallConditionals:
    """Rows of one wall for one kind of functions; what is the same for all calls is made once."""

    def __init__(
        self, wall: Wall, degree: int, edges: Floats, least_level: int = 0, most_segments: int = NO_LIMIT
    ) -> None:
        self.wall = wall.cell
        self.degree = degree
        # of one row in one hollow; its error tells what it had to leave undone
        self.most_segments = most_segments
        # the first of the Gauss rules on a piece that may be used
        self.least_level = least_level
        # a writable copy: for read-only arrays all would be compiled again
        self.edges = np.array(edges, dtype=np.float64)
        # angles of earlier calls whose rows are now known to have overlooked a piece; the owner may clear it
        self.outdated: set[float] = set()

    @cached_property
    def _hollows(self) -> list[HollowConditionals]:
        """The rows of one hollow of each shape."""
        task = self.degree, self.edges, self.least_level, self.most_segments
        return [HollowConditionals(self.wall.scene, k, *task) for k, _ in self._shapes]

    @property
    def _fractions(self) -> list[float]:
        return [fraction for _, fraction in self._shapes]

    @cached_property
    def _shapes(self) -> list[tuple[int, float]]:
        """The number of one hollow of each shape, and the fraction of the period that all of this shape take."""
        from ...geometry.cells.hollow_shape import distinct_hollows

        wall = self.wall
        if not wall.closes:
            return [(0, 1.0)]
        shapes = [hollows for _, hollows in distinct_hollows(wall)]
        return [
            (wall.hollows.index(hollows[0]), sum(hollow.width for hollow in hollows) / wall.period)
            for hollows in shapes
        ]

    def __call__(self, theta: Floats, tolerance: float | Floats) -> AdaptiveConditionals:
        """Rows at checked angles."""
        incoming, group = np.unique(theta, return_inverse=True)
        tolerances = np.full(len(incoming), np.inf)
        np.minimum.at(tolerances, group, np.broadcast_to(tolerance, theta.shape))
        before = self._spent()
        flat = self.wall.flat_top / self.wall.period if self.wall.closes else 0.0
        nodes: list[list[Floats]] = [[] for _ in incoming]
        weights: list[list[Floats]] = [[] for _ in incoming]
        error, unresolved = np.zeros(len(incoming)), np.zeros(len(incoming))
        for conditionals, fraction in zip(self._hollows, self._fractions, strict=True):
            found, outdated = conditionals.march(incoming, tolerances)
            self.outdated |= outdated
            scale = fraction / conditionals.width
            for k, conditional in enumerate(found[angle] for angle in incoming.tolist()):
                nodes[k].append(conditional.nodes)
                weights[k].append(scale * conditional.widths)
                error[k] += scale * conditional.error
                unresolved[k] += scale * conditional.unresolved
        if flat > 0.0:
            for k, angle in enumerate(incoming.tolist()):
                nodes[k].append(np.array([np.pi - angle]))
                weights[k].append(np.array([flat]))
        return AdaptiveConditionals(
            theta,
            np.concatenate([part for k in group.tolist() for part in nodes[k]]),
            np.concatenate([part for k in group.tolist() for part in weights[k]]),
            np.cumsum([0, *(sum(map(len, nodes[k])) for k in group.tolist())]),
            error[group],
            unresolved[group],
            *(now - then for now, then in zip(self._spent(), before, strict=True)),
        )

    def _spent(self) -> tuple[int, int]:
        """Rays and flights so far."""
        return sum(conditionals.rays for conditionals in self._hollows), sum(
            conditionals.segments for conditionals in self._hollows
        )

    def critical_angles(self, low: float, high: float) -> Floats:
        """Angles in (low, high), increasing, where pieces appear or disappear: the most important ones known."""
        found = [cut for conditionals in self._hollows for cut in conditionals.critical_angles(low, high)]
        return np.unique([angle for angle, _ in found])


@dataclass(frozen=True)
class TracedExpectations(Expectations):
    """Those of the law of a wall of few pieces, by adaptive quadrature in the entry point."""

    wall: Wall

    @property
    def has_errors(self) -> bool:
        return True

    @property
    def is_traced(self) -> bool:
        return True

    @cached_property
    def _rows(self) -> WallConditionals:
        basis = self.basis
        inside, degree, level = np.empty(0), max(1, basis.size - 1), 0
        if not isinstance(basis, Legendre):
            inside = basis.edges[1:-1]
            degree, level = (0, 0) if basis.is_partition else (1, PANEL_LEVEL)
        return WallConditionals(self.wall, degree, inside, level)

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        found = self._rows(theta, tolerance)
        means = means_of_basis(self.basis, found.nodes, found.weights, found.starts)
        return means, found.error + 2.0 * found.unresolved

    def are_costly(self) -> bool:
        """Whether a pilot run at some angles takes very many ray segments."""
        conditionals = WallConditionals(self.wall, 1, np.empty(0), most_segments=MOST_PILOT_SEGMENTS)(
            PILOT_ANGLES, PILOT_TOLERANCE
        )
        return conditionals.segments > MANY_SEGMENTS * PILOT_ANGLES.size
