"""The law of focusing circular arcs, and its conditional expectations of piecewise polynomials, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, number_between, whole_number
from ...core.long_runs import slices
from ..bases.angles import (
    MOST_BREAKPOINTS,
    between_cuts,
    cell_among,
    clipped_inside,
    edges_inside,
    joined_lists,
    mirrored_angle,
    mixed_arccos,
)
from ..bases.measure import SINE, gauss_on_intervals, gauss_rule
from ..bases.partitions import Panels
from ..bases.polynomials import legendre_moments
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


# Each interval with a constant number of hits N <= MOST_HITS has its own Gauss rule. Rays with more hits are a fraction
# of about 1/(4 N^2), for theta within xi/N of xi. Their outgoing angle lies within xi/N of pi - xi (or xi), and its
# mean within xi/N^2. For a smooth function the error is below 1/(4 N^4) = 4e-12.
FEWEST_HITS, MOST_HITS = 8, 500
# Gauss nodes beyond degree // 2 + 1 for the factor exp(i theta' / 2 N) on a panel.
MORE_NODES = 3
# Angles at which the variation of functions is evaluated.
SPREAD_PROBES = 9
# Limit on the ends of pieces in memory at a time.
PIECES_AT_ONCE = 2**15


class ArcLines(NamedTuple):
    """Pieces of conditional distributions as lines theta' = offset + slope delta, each of shape (pieces,).

    The index of the incoming angle; slope and offset; the ends of delta; the mass, not normalised; the outgoing angle
    if all mass leaves at one angle, and whether it does; whether the piece stands for all rays with more hits.
    """

    ray: NDArray[np.intp]
    slope: Floats
    offset: Floats
    lower: Floats
    upper: Floats
    mass: Floats
    angle: Floats
    single: NDArray[np.bool_]
    rest: NDArray[np.bool_]

    def of_angles(self, values: Floats, rows: int) -> Floats:
        """Sums of the values of the pieces of each incoming angle."""
        return np.asarray(np.bincount(self.ray, weights=values, minlength=rows), dtype=np.float64)


def arc_lines(half_angle: float, theta: Floats, most_hits: int) -> ArcLines:
    """The intervals of delta on which N is constant, for every theta and both sides, sorted by incoming angle."""
    xi, base = half_angle, np.stack([theta, np.pi - theta], axis=-1).reshape(-1)
    total = xi + base
    low, high = np.abs(base - xi), np.minimum(np.pi - np.abs(np.pi - total), 0.5 * np.pi)
    # If theta is below the rounding of xi, one piece of zero width remains, with the right outgoing angle.
    without_width = (np.abs(high - low) <= 0.0) & (base <= 0.5 * np.pi)
    fewest = np.maximum(np.ceil((total - high) / (2.0 * high)), 1.0)
    with np.errstate(divide="ignore"):
        most = np.minimum(np.ceil((total - low) / (2.0 * low)), most_hits)
    most = np.maximum(most, fewest)
    pieces = np.where((high > low) | without_width, most - fewest + 2.0, 0.0).astype(np.intp)
    owner, order = joined_lists(pieces)
    hits = np.asarray(fewest[owner] + order, dtype=np.float64)
    # The last piece of every angle holds all rays with more hits, at the mean of their outgoing angles.
    rest = order == pieces[owner] - 1
    lower = np.where(rest, low[owner], np.maximum(low[owner], total[owner] / (2.0 * hits + 1.0)))
    upper = np.maximum(np.minimum(high[owner], total[owner] / (2.0 * hits - 1.0)), lower)
    mirrored = owner % 2 == 1
    slope = np.where(mirrored, 2.0, -2.0) * hits
    offset = np.where(mirrored, -base[owner], np.pi + base[owner])
    alone = without_width[owner] & ~rest
    mass = np.where(alone, 1.0, SINE.mass(lower, upper))
    # All rays with more hits leave at one angle; so do all rays of an incoming angle with a single outgoing angle.
    end = np.where(mirrored, xi, np.pi - xi)
    angle = np.where(rest, end, offset + slope * lower)
    return ArcLines(owner // 2, slope, offset, lower, upper, mass, angle, rest | alone, rest)


def followed_hits(tolerance: float) -> int:
    """The number of hits N to follow, so that integrals over theta of means of functions of slope 10 meet a tolerance.

    Rays with more hits are a fraction of 1/(4 N^2), occur for theta within xi/N of xi, and leave within 2 xi/N of
    pi - xi (or xi).
    """
    return int(np.clip(np.ceil((100.0 / tolerance) ** 0.25), FEWEST_HITS, MOST_HITS))


class ArcMeans:
    r"""E[v(Theta') | theta] for functions v with the coefficients ``vectors`` on panels.

    On a piece with N hits theta' = o + s delta with s = -+2 N. Let F_N(t) be the integral of v(theta') exp(i theta'/s)
    from 0 to t. The integral of v(theta') sin(delta) over the piece is the imaginary part of exp(-i o/s)/s times the
    difference of F_N at the two ends. F_N is tabulated at the edges, and one Gauss rule integrates from an edge to t.

    Parameters
    ----------
    half_angle : float
    panels : Panels
    vectors : array of shape (n, k)
    """

    def __init__(self, half_angle: float, panels: Panels, vectors: Floats) -> None:
        self.half_angle, self.edges = half_angle, panels.edges
        self._polynomials = panels.legendre_series(vectors)
        self._orders = self._polynomials.shape[1] // 2 + 1 + MORE_NODES
        self._angle, weight = (part.reshape(-1, self._orders) for part in gauss_rule(self.edges, self._orders))
        local = 2.0 * (self._angle - self.edges[:-1, None]) / np.diff(self.edges)[:, None] - 1.0
        basis = np.polynomial.legendre.legvander(local, self._polynomials.shape[1] - 1)
        self._weighted = weight[..., None] * np.matmul(basis, self._polynomials)
        self._tables: dict[int, NDArray[np.complex128]] = {}

    def __call__(self, theta: Floats, tolerance: float) -> tuple[Floats, Floats]:
        """The expectations, shape (angles, k), and the error from rays with many hits, for the worst function."""
        most_hits = followed_hits(tolerance)
        lines = arc_lines(self.half_angle, theta, most_hits)
        single, fraction = lines.single, lines.mass
        whole = lines.of_angles(fraction, theta.size)
        found = np.empty((len(single), self._polynomials.shape[2]))
        long = np.flatnonzero(~single)
        for part in (long[some] for some in slices(long.size, PIECES_AT_ONCE)):
            found[part] = self._integrals(lines.offset[part], lines.slope[part], lines.lower[part], lines.upper[part])
        known = np.flatnonzero(single)
        angle = lines.angle[known]
        here = self._moments(angle[:, None], cell_among(self.edges, angle), fraction[known, None])
        found[known] = np.einsum("pd,pdk->pk", here, self._polynomials[cell_among(self.edges, angle)])
        total = np.stack([lines.of_angles(column, theta.size) for column in found.T], axis=1)
        left = lines.of_angles(np.where(lines.rest, fraction, 0.0), theta.size)
        return total / whole[:, None], left / whole * self._spread(most_hits)

    def _spread(self, most_hits: int) -> float:
        """Variation of the functions within 2 xi/N of xi and of pi - xi, where rays with more than N hits leave."""
        xi = self.half_angle
        near = xi + 2.0 * xi / most_hits * np.linspace(-1.0, 1.0, SPREAD_PROBES)
        values = []
        for angle in (near, np.pi - near):
            cell = cell_among(self.edges, angle)
            moments = self._moments(angle[:, None], cell, np.ones((angle.size, 1)))
            values.append(np.einsum("pd,pdk->pk", moments, self._polynomials[cell]))
        return float(max(np.abs(value - value[SPREAD_PROBES // 2]).max() for value in values))

    def _integrals(self, offset: Floats, slope: Floats, lower: Floats, upper: Floats) -> Floats:
        """The integrals of v(offset + slope delta) sin(delta)/2 over (lower, upper), shape (pieces, k)."""
        ends = np.clip(np.stack([offset + slope * lower, offset + slope * upper]), 0.0, np.pi)
        cell = cell_among(self.edges, ends)
        hits = np.abs(0.5 * slope).astype(np.intp)
        table = self._up_to(int(hits.max(initial=1)))[hits - 1, cell]
        angle, weight = gauss_on_intervals(self.edges[cell].ravel(), ends.ravel(), self._orders)
        angle, weight = angle.reshape(-1, self._orders), weight.reshape(-1, self._orders)
        phase = angle / np.tile(2.0 * hits, 2)[:, None]
        each = self._polynomials[cell.ravel()]
        parts = [
            np.einsum("pd,pdk->pk", self._moments(angle, cell.ravel(), weight * wave(phase)), each)
            for wave in (np.cos, np.sin)
        ]
        primitive = table + (parts[0] + 1j * parts[1]).reshape(table.shape)
        difference = primitive[1] - primitive[0]
        difference = np.where(slope[:, None] > 0.0, difference, difference.conj())
        return np.asarray(0.5 * (np.exp(-1j * offset / slope)[:, None] * difference).imag / slope[:, None])

    def _up_to(self, most: int) -> NDArray[np.complex128]:
        """F_N at the edges for N = 1 ... most, shape (most, edges, k)."""
        if most not in self._tables:
            # Products of small matrices, one for each panel, for many N at once.
            phase = self._angle[:, None] / (2.0 * np.arange(1, most + 1)[:, None])
            whole = np.matmul(np.exp(1j * phase), self._weighted).transpose(1, 0, 2)
            empty = np.zeros((most, 1, whole.shape[2]))
            self._tables[most] = np.concatenate([empty, np.cumsum(whole, axis=1)], axis=1)
        return self._tables[most]

    def _moments(self, angle: Floats, cell: NDArray[np.intp], weight: Floats) -> Floats:
        """Moments of the cells' Legendre polynomials, (cells, degree + 1), by nodes and weights (cells, nodes)."""
        low, high = self.edges[cell, None], self.edges[cell + 1, None]
        local = (2.0 * angle - low - high) / (high - low)
        owner = np.repeat(np.arange(len(local)), local.shape[1])
        return legendre_moments(local.ravel(), weight.ravel(), self._polynomials.shape[1] - 1, owner, len(local)).T
