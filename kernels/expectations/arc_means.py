"""Means of given piecewise polynomials over rows of the law of circular arcs, by their integrals up to any angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...checks import Floats
from ..bases.intervals import cell_among
from ..bases.measure import gauss_on_intervals, gauss_rule
from ..bases.panels import Panels
from ..bases.polynomial_moments import legendre_moments
from .arcs import outgoing_lines

if TYPE_CHECKING:
    from ..walls.circular_arc import CircularArcLaw

# exp(i theta' / 2 N) on a panel asks for this many Gauss nodes more than a polynomial of half the degree.
MORE_NODES = 3
# Angles at which the variation of functions is looked at.
SPREAD_PROBES = 9
# Ends of pieces held at a time.
CHUNK = 2**15


class ArcMeans:
    r"""E[v(Theta') | theta] for functions v with the coefficients ``vectors`` on panels.

    On a piece with N hits theta' = o + s delta with s = -+2 N, so that the integral of v(theta') sin(delta) is the
    imaginary part of exp(-i o/s)/s times the difference of two values of F_N(t), the integral of v(theta')
    exp(i theta'/s) from 0 to t: a table at the edges, and one Gauss rule from the edge to t.

    Parameters
    ----------
    law : CircularArcLaw
    panels : Panels
    vectors : array of shape (n, k)
    """

    def __init__(self, law: CircularArcLaw, panels: Panels, vectors: Floats) -> None:
        self.law, self.edges = law, panels.edges
        self._polynomials = panels.legendre_series(vectors)
        self._orders = self._polynomials.shape[1] // 2 + 1 + MORE_NODES
        self._angle, weight = (part.reshape(-1, self._orders) for part in gauss_rule(self.edges, self._orders))
        local = 2.0 * (self._angle - self.edges[:-1, None]) / np.diff(self.edges)[:, None] - 1.0
        basis = np.polynomial.legendre.legvander(local, self._polynomials.shape[1] - 1)
        self._weighted = weight[..., None] * np.matmul(basis, self._polynomials)
        self._tables: dict[int, NDArray[np.complex128]] = {}

    def __call__(self, theta: Floats, most_hits: int) -> tuple[Floats, Floats]:
        """The means, shape (rows, k), and how much the rays with more hits can be off in the worst of the functions."""
        lines = outgoing_lines(self.law, theta, most_hits)
        single, share = lines.single, lines.mass
        whole = lines.of_rows(share, theta.size)
        found = np.empty((len(single), self._polynomials.shape[2]))
        long = np.flatnonzero(~single)
        for start in range(0, long.size, CHUNK):
            part = long[start : start + CHUNK]
            found[part] = self._integrals(lines.offset[part], lines.slope[part], lines.lower[part], lines.upper[part])
        known = np.flatnonzero(single)
        angle = lines.angle[known]
        here = self._moments(angle[:, None], cell_among(self.edges, angle), share[known, None])
        found[known] = np.einsum("pd,pdk->pk", here, self._polynomials[cell_among(self.edges, angle)])
        total = np.stack([lines.of_rows(column, theta.size) for column in found.T], axis=1)
        left = lines.of_rows(np.where(lines.rest, share, 0.0), theta.size)
        return total / whole[:, None], left / whole * self._spread(most_hits)

    def _spread(self, most_hits: int) -> float:
        """How much the functions vary where rays with more hits leave: within 2 xi/N of xi and of pi - xi."""
        xi = self.law.half_angle
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
            # for many N at once: products of small matrices, one a panel
            phase = self._angle[:, None] / (2.0 * np.arange(1, most + 1)[:, None])
            whole = np.matmul(np.exp(1j * phase), self._weighted).transpose(1, 0, 2)
            empty = np.zeros((most, 1, whole.shape[2]))
            self._tables[most] = np.concatenate([empty, np.cumsum(whole, axis=1)], axis=1)
        return self._tables[most]

    def _moments(self, angle: Floats, cell: NDArray[np.intp], weight: Floats) -> Floats:
        """Of nodes of shape (cells, nodes) with their weights: of these cells' polynomials, (cells, degree + 1)."""
        low, high = self.edges[cell, None], self.edges[cell + 1, None]
        local = (2.0 * angle - low - high) / (high - low)
        return legendre_moments(local, weight, self._polynomials.shape[1] - 1).T
