"""Conditional distributions of the law of a traced wall, by adaptive quadrature in the entry point, with errors."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats
from ...core.errors import AccuracyError
from ...geometry import Wall
from ...geometry.cells.hollow_shape import distinct_hollows
from ...geometry.itineraries.hollow import NO_LIMIT, HollowConditionals
from ...geometry.tracing.tracing import trace
from ..expectations.conditionals import Conditionals
from ..laws.law import Law, entries

# Up to this number of pieces of a wall one conditional distribution takes a few milliseconds.
MOST_PIECES = 64
# Lowest nested rule on a piece that is used for polynomials on panels.
PANEL_LEVEL = 2
# A pilot run at 12 angles detects chaotic hollows: of 120 random walls 11 take 29,000 to 190,000 ray segments an angle,
# two 10,000 and 13,000, and the others 260 to 4,700. One angle stops at MOST_PILOT_SEGMENTS.
PILOT_ANGLES = np.linspace(0.13, 3.01, 12)
PILOT_TOLERANCE = 1e-3
MANY_SEGMENTS, MOST_PILOT_SEGMENTS = 15_000, 400_000


def is_few(wall: Wall) -> bool:
    """Whether the wall has at most `MOST_PIECES` pieces; the cost per angle is about their number squared."""
    return len(wall.cell.pieces) + sum(map(len, wall.cell.islands)) <= MOST_PIECES


class WallConditionals:
    """Conditional distributions of one wall for one kind of functions, with data shared by all calls.

    Parameters
    ----------
    wall : Wall
    degree : int
        Highest degree, as trigonometric polynomials, of the averaged functions; 0 if constant between the edges.
    edges : array
        Outgoing angles where the functions are not smooth.
    least_level : int
        Lowest nested rule on a piece.
    most_segments : int
        Limit on the ray segments for one angle in one hollow; the error includes the intervals undecided at the limit.
    sizes : array, optional
        Bounds of the functions between the edges, or of the norm if they are vectors; 1 by default.
    cuts : array, optional
        Outgoing angles between which functions are polynomials that hardly jump there: between the rays of a piece
        outgoing angles are interpolated, so that cuts cost no rays. The functions change by at most 1 a radian.
    curves_absorb : bool
        Whether rays end on curved pieces, so that the other rays are found in less time; `escaped` has these.

    Attributes
    ----------
    outdated : set of float
        Angles of earlier calls now known to have missed a piece; the caller may clear the set.

    Notes
    -----
    For fixed theta the map from the entry point to theta' is analytic between changes of the itinerary. Bisection finds
    the changes; nested rules integrate between them. Near cusps and grazing there are infinitely many changes: the
    undecided intervals count in the error. The error is an estimate: a piece narrower than the spacing of the samples
    can be missed, unless it was found at a neighbouring angle. Compared with a second method, the true error exceeded
    the reported one for 3 of 720 distributions of 24 walls; the median of reported over true error was 13.

    Examples
    --------
    >>> from math import cos
    >>> from asperity import geometry as geo
    >>> conditionals, unresolved = WallConditionals(geo.flat(), 1, np.empty(0))(np.array([0.5]), 1e-10)
    >>> conditionals.weights.tolist(), bool(conditionals.mean(np.cos)[0] == cos(np.pi - 0.5)), unresolved.tolist()
    ([1.0], True, [0.0])
    """

    def __init__(
        self,
        wall: Wall,
        degree: int,
        edges: Floats,
        least_level: int = 0,
        most_segments: int = NO_LIMIT,
        sizes: Floats | None = None,
        cuts: Floats | None = None,
        curves_absorb: bool = False,
    ) -> None:
        self.wall = wall.cell
        self.cuts = np.empty(0) if cuts is None else np.array(cuts, dtype=np.float64)
        self.curves_absorb = curves_absorb
        self.degree = degree
        self.most_segments = most_segments
        self.least_level = least_level
        # a writable copy: numba would compile again for read-only arrays
        self.edges = np.array(edges, dtype=np.float64)
        self.sizes = np.ones(len(self.edges) + 1) if sizes is None else sizes
        self.outdated: set[float] = set()

    @cached_property
    def hollows(self) -> list[tuple[HollowConditionals, float]]:
        """One hollow of each shape, and the fraction of the period covered by all of this shape."""

        wall, shapes = self.wall, [(0, 1.0)]
        if wall.closes:
            shapes = [
                (wall.hollows.index(hollows[0]), sum(hollow.width for hollow in hollows) / wall.period)
                for _, hollows in distinct_hollows(wall)
            ]
        scene = wall.scene._replace(curves_absorb=self.curves_absorb)
        task = self.degree, self.edges, self.sizes, self.least_level, self.most_segments, self.cuts
        return [(HollowConditionals(scene, number, *task), fraction) for number, fraction in shapes]

    @property
    def flat_fraction(self) -> float:
        """The fraction of the period covered by flat tops."""
        return self.wall.flat_top / self.wall.period if self.wall.closes else 0.0

    def __call__(self, theta: Floats, tolerance: float | Floats) -> tuple[Conditionals, Floats]:
        """The conditional distributions at checked angles, and the probabilities of rays that did not escape.

        These rays count as retroreflected, and in the errors.
        """
        # the compiled march takes doubles by their address
        incoming, group = np.unique(np.asarray(theta, dtype=np.float64), return_inverse=True)
        tolerances = np.full(len(incoming), np.inf)
        np.minimum.at(tolerances, group, np.broadcast_to(tolerance, theta.shape))
        flat = self.flat_fraction
        nodes: list[list[Floats]] = [[] for _ in incoming]
        weights: list[list[Floats]] = [[] for _ in incoming]
        error, unresolved = np.zeros(len(incoming)), np.zeros(len(incoming))
        for conditionals, fraction in self.hollows:
            marched, outdated = conditionals.march(incoming, tolerances)
            self.outdated |= outdated
            scale = fraction / conditionals.width
            for k, conditional in enumerate(marched[angle] for angle in incoming.tolist()):
                nodes[k].append(conditional.nodes)
                weights[k].append(scale * conditional.widths)
                error[k] += scale * conditional.error
                unresolved[k] += scale * conditional.unresolved
        if flat > 0.0:
            for k, angle in enumerate(incoming.tolist()):
                nodes[k].append(np.array([np.pi - angle]))
                weights[k].append(np.array([flat]))
        found = Conditionals(
            np.concatenate([np.empty(0), *(part for k in group.tolist() for part in nodes[k])]),
            np.concatenate([np.empty(0), *(part for k in group.tolist() for part in weights[k])]),
            np.cumsum([0, *(sum(map(len, nodes[k])) for k in group.tolist())]),
            error[group],
        )
        return found, unresolved[group]

    def escaped(self, theta: float) -> tuple[Floats, Floats]:
        """The probabilities and first outgoing angles of the pieces of a known angle whose rays escape."""
        flat = [self.flat_fraction] * (self.flat_fraction > 0.0)
        probabilities, outgoing = [np.array(flat)], [np.full(len(flat), np.pi - theta)]
        for conditionals, fraction in self.hollows:
            widths, out = conditionals.pieces(theta).escaped()
            probabilities.append(fraction / conditionals.width * widths)
            outgoing.append(out)
        return np.concatenate(probabilities), np.concatenate(outgoing)

    def spent(self) -> tuple[int, int]:
        """Rays and ray segments so far."""
        every = [conditionals for conditionals, _ in self.hollows]
        return sum(each.rays for each in every), sum(each.segments for each in every)

    def shared(self, theta: Floats) -> Floats:
        """The probability of entry points whose itinerary also exists at the next of these known angles."""
        total = np.full(len(theta) - 1, self.flat_fraction)
        for conditionals, fraction in self.hollows:
            total += fraction * conditionals.shared(theta)
        return total

    def critical_angles(self, low: float, high: float) -> Floats:
        """Known angles in (low, high), increasing, where the widest pieces appear or disappear."""
        found = [cut for conditionals, _ in self.hollows for cut in conditionals.critical_angles(low, high)]
        return np.unique([angle for angle, _ in found])


def traced_conditionals(wall: Wall, degree: int, edges: Floats) -> WallConditionals:
    """The conditional distributions for functions of a degree, as trigonometric polynomials or between edges."""
    if not edges.size:
        return WallConditionals(wall, degree, edges)
    return WallConditionals(wall, min(degree, 1), edges, PANEL_LEVEL if degree else 0)


def is_chaotic(wall: Wall, segments: int = MANY_SEGMENTS) -> bool:
    """Whether a pilot run takes more than so many ray segments per angle."""
    conditionals = WallConditionals(wall, 1, np.empty(0), most_segments=MOST_PILOT_SEGMENTS)
    conditionals(PILOT_ANGLES, PILOT_TOLERANCE)
    return conditionals.spent()[1] > segments * PILOT_ANGLES.size


# Rays that end in a corner, at a tangency or at the bounce limit count as retroreflected (see `WallLaw`). Their
# fraction bounds the error in total variation. A larger one would be visible in a kernel estimated from a million rays.
UNRESOLVED_TOLERANCE = 1e-4
# Where the caller finds what became of them.
CAUSES = "geometry.trace(wall, x, theta).counts() says how they ended, reflect_with_status() which they were"


def traced_reflection(wall: Wall, x: ArrayLike, theta: ArrayLike) -> tuple[Floats, NDArray[np.bool_]]:
    """Outgoing angles, and the mask of the rays that escaped; the other rays count as retroreflected.

    ``x`` in (0, 1) is the entry point as a fraction of the period. Never raises an AccuracyError.
    """

    x, theta = np.broadcast_arrays(*entries(x, theta))
    traced = trace(wall, x * wall.period, theta)
    escaped = np.asarray(traced.escaped)
    return np.where(escaped, traced.theta, theta), escaped


def if_escaped(law: Law, outgoing: Floats, escaped: NDArray[np.bool_], causes: str = CAUSES) -> Floats:
    """The outgoing angles; raises an AccuracyError if more than a fraction of 1e-4 of the rays did not escape."""
    unresolved = 1.0 - float(np.mean(escaped)) if escaped.size else 0.0
    if unresolved > UNRESOLVED_TOLERANCE:
        lost = f"{unresolved:.2g} of {escaped.size} rays did not escape, more than {UNRESOLVED_TOLERANCE:g}"
        raise AccuracyError(f"{law!r}: {lost}; {causes}", unresolved)
    return outgoing
