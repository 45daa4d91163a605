"""The law of focusing circular arcs, in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, number_between, whole_number
from ..bases.angles import MOST_BREAKPOINTS, between_cuts, clipped_inside, edges_inside, mirrored_angle, mixed_arccos
from ..bases.measure import SINE
from ..expectations.arcs import arc_lines, followed_hits
from ..expectations.conditionals import Conditionals, gauss_nodes, stiffness_between
from ..laws.law import DrivenLaw, entries


@dataclass(frozen=True)
class CircularArcLaw(DrivenLaw):
    r"""The law of focusing circular arcs of half angle xi, one arc per period, in closed form.

    Every hit rotates the ray's chord by the same angle. With X uniform in (0, 1) from the left tip,

        delta = arccos(X cos(theta - xi) + (1 - X) cos(theta + xi)),
        delta <= pi/2 :  N = ceil((xi + theta - delta) / (2 delta)),  theta' = theta - 2 N delta + pi,

    where N is the number of hits. If delta > pi/2, replace theta, delta and theta' by pi minus themselves.

    Parameters
    ----------
    half_angle : float
        xi in (0, pi/2], radians.

    Raises
    ------
    InputError
        If ``half_angle`` is not in (0, pi/2].

    Notes
    -----
    For N above about 1e8 the number of hits is uncertain by N^2 eps, because the ray ends at a tip within rounding; the
    outgoing angle then changes by 2 delta. For fixed theta the angle delta has the density
    sin(delta) / (2 sin(theta) sin(xi)), so `apply` uses Gauss rules between the changes of N.

    Source: Rudzis 2022, section 2.2.3, corrected (eqs. 2.15, 2.17, 2.18 as printed are wrong).

    Examples
    --------
    A ray through the centre of a semicircle goes back where it came from.

    >>> law = CircularArcLaw(np.pi / 2)
    >>> round(float(law.reflect(0.5, 1.25)), 15), int(law.hits(0.5, 1.25))
    (1.25, 1)
    """

    half_angle: float

    reversible = True
    mirror_symmetric = True

    def __post_init__(self) -> None:
        checked = number_between("half_angle", self.half_angle, 0.0, 0.5 * np.pi, closed="high")
        self._set(half_angle=checked)

    def reflect(self, x: ArrayLike, theta: ArrayLike) -> Floats:
        """Outgoing angle of the ray that enters at ``x`` in (0, 1), measured from the left tip."""
        right, base, chord, hits = self._rotation(*entries(x, theta))
        outgoing = clipped_inside(np.pi + base - 2.0 * hits * chord)
        return np.where(right, mirrored_angle(outgoing), outgoing)

    def hits(self, x: ArrayLike, theta: ArrayLike) -> NDArray[np.int64]:
        """Number of reflections of the ray that enters at ``x`` in (0, 1), measured from the left tip."""
        return np.asarray(self._rotation(*entries(x, theta))[3].astype(np.int64))

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """Incoming angles at which an interval of X appears or disappears, and the probability near the omitted ones.

        They are xi (1 + 1/k), xi k/(k + 1), xi, pi/2 -+ xi and their mirror images, and accumulate at xi and pi - xi.
        """
        count = max((whole_number("limit", limit, 0, most=MOST_BREAKPOINTS) - 4) // 4, 1)
        k = np.arange(1.0, count + 1.0)
        left = self.half_angle * np.concatenate([[1.0], 1.0 + 1.0 / k, k / (k + 1.0)])
        left = np.concatenate([left, [0.5 * np.pi - self.half_angle]])
        breakpoints = np.unique(np.concatenate([left, np.pi - left]))
        low, high = self.half_angle * count / (count + 1.0), self.half_angle * (count + 1.0) / count
        return breakpoints[(breakpoints > 0.0) & (breakpoints < np.pi)], min(
            float(2.0 * SINE.mass(low, min(high, np.pi))), 1.0
        )

    def _rotation(self, x: Floats, theta: Floats) -> tuple[NDArray[np.bool_], Floats, Floats, Floats]:
        """Whether the ray is mirrored, its (mirrored) angle, the chord's angle delta <= pi/2, and N."""
        angle, complement = mixed_arccos(x, theta, self.half_angle)
        right = angle > complement
        base = np.where(right, np.pi - theta, theta)
        chord = np.minimum(angle, complement)
        # The bound is exact; without it rounding could turn the single hit of a grazing ray into none.
        return right, base, chord, np.maximum(np.ceil((self.half_angle + base - chord) / (2.0 * chord)), 1.0)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """Gauss rules in delta between the changes of N and the edges; the error is that of rays with more hits."""
        lines = arc_lines(self.half_angle, theta, followed_hits(tolerance))
        long = np.flatnonzero(~lines.single)
        offset, slope, lower, upper = lines.offset[long], lines.slope[long], lines.lower[long], lines.upper[long]
        ends = offset + slope * lower, offset + slope * upper
        cut, edge = edges_inside(edges, np.minimum(*ends), np.maximum(*ends))
        inside = np.clip((edge - offset[cut]) / slope[cut], lower[cut], upper[cut])
        every = np.arange(long.size)
        piece, low, high = between_cuts(np.concatenate((every, every, cut)), np.concatenate((lower, upper, inside)))
        ends = offset[piece] + slope[piece] * low, offset[piece] + slope[piece] * high
        stiffness = high - low + stiffness_between(edges, degree, np.minimum(*ends), np.maximum(*ends))
        piece, chord, weight = gauss_nodes(piece, low, high, stiffness)
        outgoing, single = offset[piece] + slope[piece] * chord, lines.single
        left = lines.of_angles(np.where(lines.rest, lines.mass, 0.0), theta.size)
        return Conditionals.of_lists(
            np.concatenate((lines.ray[long][piece], lines.ray[single])),
            np.concatenate((outgoing, lines.angle[single])),
            np.concatenate((weight * SINE.density(chord), lines.mass[single])),
            2.0 * left / lines.of_angles(lines.mass, theta.size),
        )
