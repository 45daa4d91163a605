"""Conditional expectations of piecewise polynomials under the law of circular arcs, by integrals over its pieces."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ..bases.intervals import cell_among
from ..bases.legendre import legendre_moments
from ..bases.measure import SINE, gauss_on_intervals, gauss_rule
from ..bases.panels import Panels

# Gauss nodes beyond degree // 2 + 1 for the factor exp(i theta' / 2 N) on a panel.
MORE_NODES = 3
# Angles at which the variation of functions is evaluated.
SPREAD_PROBES = 9
# Limit on the ends of pieces in memory at a time.
PIECES_AT_ONCE = 2**15


class ArcPieces(NamedTuple):
    """Pieces of conditional distributions, each of shape (pieces,): the index of the incoming angle; whether the ray is
    mirrored; the ends of the chord's angle delta; the number of hits N; whether the piece stands for all rays with more
    hits; whether the incoming angle has a single outgoing angle.
    """

    ray: NDArray[np.intp]
    mirrored: NDArray[np.bool_]
    lower: Floats
    upper: Floats
    hits: Floats
    rest: NDArray[np.bool_]
    alone: NDArray[np.bool_]


# A function of the incoming angles and the largest number of hits of listed pieces.
PiecesOfAngles: TypeAlias = Callable[[Floats, int], ArcPieces]


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


def outgoing_lines(half_angle: float, pieces: ArcPieces, theta: Floats) -> ArcLines:
    """The pieces of the conditional distributions at ``theta`` as lines."""
    base = np.where(pieces.mirrored, np.pi - theta[pieces.ray], theta[pieces.ray])
    slope = np.where(pieces.mirrored, 2.0, -2.0) * pieces.hits
    offset = np.where(pieces.mirrored, -base, np.pi + base)
    lower, upper = pieces.lower, np.maximum(pieces.upper, pieces.lower)
    alone = pieces.alone & ~pieces.rest
    mass = np.where(alone, 1.0, SINE.mass(lower, upper))
    # All rays with more hits leave at one angle; so do all rays of an incoming angle with a single outgoing angle.
    end = np.where(pieces.mirrored, half_angle, np.pi - half_angle)
    angle = np.where(pieces.rest, end, offset + slope * lower)
    return ArcLines(pieces.ray, slope, offset, lower, upper, mass, angle, pieces.rest | alone, pieces.rest)


class ArcMeans:
    r"""E[v(Theta') | theta] for functions v with the coefficients ``vectors`` on panels.

    On a piece with N hits theta' = o + s delta with s = -+2 N. Let F_N(t) be the integral of v(theta') exp(i theta'/s)
    from 0 to t. The integral of v(theta') sin(delta) over the piece is the imaginary part of exp(-i o/s)/s times the
    difference of F_N at the two ends. F_N is tabulated at the edges, and one Gauss rule integrates from an edge to t.

    Parameters
    ----------
    half_angle : float
    pieces : callable
        Returns the pieces of the conditional distributions at incoming angles, up to a given number of hits.
    panels : Panels
    vectors : array of shape (n, k)
    """

    def __init__(self, half_angle: float, pieces: PiecesOfAngles, panels: Panels, vectors: Floats) -> None:
        self.half_angle, self.pieces, self.edges = half_angle, pieces, panels.edges
        self._polynomials = panels.legendre_series(vectors)
        self._orders = self._polynomials.shape[1] // 2 + 1 + MORE_NODES
        self._angle, weight = (part.reshape(-1, self._orders) for part in gauss_rule(self.edges, self._orders))
        local = 2.0 * (self._angle - self.edges[:-1, None]) / np.diff(self.edges)[:, None] - 1.0
        basis = np.polynomial.legendre.legvander(local, self._polynomials.shape[1] - 1)
        self._weighted = weight[..., None] * np.matmul(basis, self._polynomials)
        self._tables: dict[int, NDArray[np.complex128]] = {}

    def __call__(self, theta: Floats, most_hits: int) -> tuple[Floats, Floats]:
        """The expectations, shape (angles, k), and the error from rays with more hits, for the worst function."""
        lines = outgoing_lines(self.half_angle, self.pieces(theta, most_hits), theta)
        single, fraction = lines.single, lines.mass
        whole = lines.of_angles(fraction, theta.size)
        found = np.empty((len(single), self._polynomials.shape[2]))
        long = np.flatnonzero(~single)
        for start in range(0, long.size, PIECES_AT_ONCE):
            part = long[start : start + PIECES_AT_ONCE]
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
