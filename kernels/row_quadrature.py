"""Matrices of the laws of traced walls to a tolerance: adaptive rows, and adaptive panels in the incoming angle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..checks import Floats
from .adaptive_rows import WallRows
from .basis import Basis
from .legendre import Legendre
from .measure import SINE
from .products import cell_index
from .reflection import is_mirror_symmetric, reflection_matrix

if TYPE_CHECKING:
    from ..geometry import Wall

# Kronrod's rule with 15 nodes and the Gauss rule with 7 among them (Piessens et al., QUADPACK, 1983).
_NODES = (
    0.991455371120812639206854697526329, 0.949107912342758524526189684047851,
    0.864864423359769072789712788640926, 0.741531185599394439863864773280788,
    0.586087235467691130294144691693, 0.405845151377397166906606412076961,
    0.207784955007898467600689403773245, 0.0,
)  # fmt: skip
_KRONROD = (
    0.022935322010529224963732008058970, 0.063092092629978553290700663189204,
    0.104790010322250183839876322541518, 0.140653259715525918745189590510238,
    0.169004726639267902826583426598550, 0.190350578064785409913256402421014,
    0.204432940075298892414161999234649, 0.209482141084727828012999174891714,
)  # fmt: skip
_GAUSS = (
    0.0, 0.129484966168869693270611432679082, 0.0, 0.279705391489276667901467771423780,
    0.0, 0.381830050505118944950369775488975, 0.0, 0.417959183673469387755102040816327,
)  # fmt: skip
NODES = np.array([-x for x in _NODES[:-1]] + list(_NODES[::-1]))
KRONROD = np.array(list(_KRONROD[:-1]) + list(_KRONROD[::-1]))
GAUSS = np.array(list(_GAUSS[:-1]) + list(_GAUSS[::-1]))

# Rays after which the matrix is handed over as it is, with the error that it has: some seconds.
MOST_RAYS = 10_000_000
# For the prediction of the cost: guesses, not measurements; walls differ by more than a factor of ten.
ROWS_A_PIECE, RAYS_A_CHANGE = 100, 100
# The asymmetry shows errors that the panels and rows do not see, but only their antisymmetric part: if the symmetric
# part is of the same size, their sum is about half of sqrt(2) times the asymmetry; the factor leaves a margin to that.
ASYMMETRY_FACTOR = 2.0
# Rows at a time, so that their nodes fit into memory, and outgoing angles times functions at a time.
ROWS_AT_ONCE = 1500
VALUES_AT_ONCE = 2_000_000
# The rows together may spend this share of the tolerance.
ROW_SHARE = 0.1
SMALLEST_ROW_TOLERANCE = 1e-14
# The rows of a narrow panel may be coarser: the panel may spend this share of what all rows together may.
FAIR_SHARE = 0.02
COARSEST_ROW = 1e-4
# Where a half has this share of its panel's difference of the two rules, or more, the integrand is not smooth: a kink
# leaves 1/8 or more of it, a smooth integrand 2^-14.
SMOOTH_SHRINKING = 1e-3
# A smooth half's difference of the two rules is an error of Gauss, not of Kronrod: it is scaled by the ratio that was
# measured on the whole panel, at least this, times a margin.
LEAST_RATIO = 1e-3
RATIO_MARGIN = 4.0
NARROWEST = 1e-13
# Functions beyond those asked for whose integrals also steer the panels, so that no symmetry hides an error.
FEWEST_FUNCTIONS = 3


def is_affordable(wall: Wall, basis: Basis) -> bool:
    """Whether adaptive rows are likely to beat the sampling of rays: few pieces, and few functions with edges.

    A row has several changes of itinerary a piece, each found by about 30 rays, and a matrix needs about a thousand
    rows for an error of 1e-6 and as many kinks in theta as pieces: the cost grows like the square of the pieces. A
    change of cell costs as much as one of itinerary, in each row, and the rows of each cell are integrated anew.
    Where the wall overhangs, rays stay in its cavities for long, and rows have changes without end.
    """
    pieces = len(wall.pieces) + sum(map(len, wall.islands))
    cells = 1 if isinstance(basis, Legendre) else len(basis.edges) - 1
    predicted = ROWS_A_PIECE * RAYS_A_CHANGE * (1 + pieces) ** 2 * (1 + cells) ** 2 / 4.0
    overhangs = bool(np.any(np.diff(wall.vertices[:, 0]) < 0.0))
    return bool(wall.closes) and not overhangs and predicted <= MOST_RAYS


@dataclass
class _Panels:
    """Panels in the incoming angle with their integrals and errors."""

    low: Floats
    high: Floats
    value: list[Floats]
    difference: Floats
    error: Floats
    row_error: Floats

    def kept(self, mask: NDArray[np.bool_]) -> _Panels:
        return _Panels(
            self.low[mask],
            self.high[mask],
            [value for value, keep in zip(self.value, mask, strict=True) if keep],
            self.difference[mask],
            self.error[mask],
            self.row_error[mask],
        )

    def joined(self, other: _Panels) -> _Panels:
        return _Panels(
            np.concatenate((self.low, other.low)),
            np.concatenate((self.high, other.high)),
            self.value + other.value,
            np.concatenate((self.difference, other.difference)),
            np.concatenate((self.error, other.error)),
            np.concatenate((self.row_error, other.row_error)),
        )


def row_matrix(wall: Wall, basis: Basis, tolerance: float, most_rays: int = MOST_RAYS) -> tuple[Floats, float, int]:
    """<e_i, P e_j> of a wall's law, an estimate of its Frobenius error, and the number of rays that it took.

    The error is the sum over the panels, of the difference of Kronrod's and Gauss's rule where the rows have a kink,
    of that difference scaled by what halving the panel showed where they are smooth; plus the errors of the rows;
    plus ASYMMETRY_FACTOR times the asymmetry of the result, which other errors than these would show.
    """
    small = isinstance(basis, Legendre) and basis.size < FEWEST_FUNCTIONS
    inner = Legendre(FEWEST_FUNCTIONS) if small else basis
    matrix, error, rays = _Integrator(wall, inner, tolerance, most_rays).run()
    error += ASYMMETRY_FACTOR * float(np.linalg.norm(matrix - matrix.T))
    return np.ascontiguousarray(matrix[: basis.size, : basis.size]), error, rays


class _Integrator:
    """One matrix in the making."""

    def __init__(self, wall: Wall, basis: Basis, tolerance: float, most_rays: int) -> None:
        self.basis = basis
        self.tolerance = max(tolerance, 8.0 * np.finfo(np.float64).eps * basis.size)
        self.most_rays = most_rays
        self.rays, self.row_count = 0, 0
        self.halved = bool(wall.is_mirror_symmetric) and is_mirror_symmetric(basis)
        inside, degree, least = np.empty(0), 1, 0
        if isinstance(basis, Legendre):
            degree = max(1, basis.size - 1)
            self.scale = float(basis.size)
        else:
            inside = basis.edges[1:-1]
            # piecewise polynomials of this degree, integrated after a substitution of degree 3
            local = 0 if basis.is_partition else basis.nodes_per_interval
            degree, least = (0, 0) if basis.is_partition else (1, 1 if local < 8 else 2)
            middle = 0.5 * (basis.edges[1:] + basis.edges[:-1])
            self.scale = float(np.max(np.linalg.norm(basis.evaluate(middle), axis=1)))
        self.rows = WallRows(wall, degree, inside, least)
        self.row_tolerance = max(ROW_SHARE * self.tolerance / self.scale, SMALLEST_ROW_TOLERANCE)

    def run(self) -> tuple[Floats, float, int]:
        edges = self.basis.edges
        if self.halved:
            edges = np.append(edges[edges < 0.5 * np.pi - 1e-12], 0.5 * np.pi)
        goal = 0.5 * self.tolerance if self.halved else self.tolerance
        panels = self._panels(edges[:-1], edges[1:])
        while True:
            total = float(np.sum(panels.error) + np.sum(panels.row_error))
            if total <= goal or self.rays >= self.most_rays:
                break
            chosen = self._worth_halving(panels, goal)
            if not chosen.any():
                break
            panels = panels.kept(~chosen).joined(self._halves(panels.kept(chosen)))
        matrix = np.sum(np.array(panels.value), axis=0) if isinstance(panels.value[0], np.ndarray) else panels.value[0]
        if self.halved:
            flip = reflection_matrix(self.basis)
            matrix, total = matrix + flip @ matrix @ flip.T, 2.0 * total
        return matrix, total, self.rays

    def _worth_halving(self, panels: _Panels, goal: float) -> NDArray[np.bool_]:
        """The worst panels: those beyond which the others together have less than a part of the goal."""
        able = (panels.high - panels.low > NARROWEST) & (panels.error > 0.5 * panels.row_error)
        order = np.argsort(panels.error)
        cumulative = np.cumsum(panels.error[order])
        chosen = np.zeros(len(order), dtype=np.bool_)
        chosen[order[cumulative > 0.25 * goal]] = True
        # a panel far below the worst waits for a later round
        chosen &= able & (panels.error > 0.02 * np.max(panels.error, where=able, initial=0.0))
        # no more than what is left of the budget buys, at the cost of a row so far
        most = int((self.most_rays - self.rays) * self.row_count / max(1, self.rays)) // (2 * len(NODES))
        worst = np.zeros(len(order), dtype=np.bool_)
        worst[order[max(0, len(order) - most) :]] = True
        return np.asarray(chosen & worst)

    def _halves(self, parents: _Panels) -> _Panels:
        middle = 0.5 * (parents.low + parents.high)
        count = len(middle)
        halves = self._panels(np.append(parents.low, middle), np.append(middle, parents.high))
        for k in range(count):
            pair = [k, k + count]
            actual = float(np.linalg.norm(halves.value[k] + halves.value[k + count] - parents.value[k]))
            before = parents.difference[k]
            for half in pair:
                if halves.difference[half] < SMOOTH_SHRINKING * before:
                    ratio = min(1.0, max(RATIO_MARGIN * actual / before, LEAST_RATIO))
                    halves.error[half] = ratio * halves.difference[half]
        return halves

    def _panels(self, low: Floats, high: Floats) -> _Panels:
        """Integrals over new panels, several at a time."""
        step = max(1, ROWS_AT_ONCE // len(NODES))
        found = None
        for first in range(0, len(low), step):
            part = self._few_panels(low[first : first + step], high[first : first + step])
            found = part if found is None else found.joined(part)
        assert found is not None
        return found

    def _few_panels(self, low: Floats, high: Floats) -> _Panels:
        half = 0.5 * (high - low)
        angle = (0.5 * (low + high))[:, None] + half[:, None] * NODES
        flat = angle.ravel()
        share = FAIR_SHARE / np.maximum(SINE.mass(low, high), np.finfo(np.float64).tiny)
        tolerance = np.minimum(self.row_tolerance * np.maximum(1.0, share), COARSEST_ROW)
        rows = self.rows(flat, np.repeat(tolerance, len(NODES)))
        self.rays += rows.rays
        self.row_count += len(flat)
        shape = (len(low), len(NODES), self.basis.size)
        image = self._images(rows.nodes, rows.weights, rows.starts).reshape(shape)
        here = self.basis.evaluate(flat).reshape(shape)
        density = half[:, None] * SINE.density(angle)
        weight = density * KRONROD
        value = np.einsum("pk,pki,pkj->pij", weight, here, image, optimize=True)
        gauss = density * (KRONROD - GAUSS)
        difference = np.linalg.norm(np.einsum("pk,pki,pkj->pij", gauss, here, image, optimize=True), axis=(1, 2))
        size = np.linalg.norm(here, axis=2)
        row_error = self.scale * np.sum(weight * size * (rows.error + 2.0 * rows.lost).reshape(angle.shape), axis=1)
        return _Panels(low, high, list(value), difference, difference.copy(), row_error)

    def _images(self, nodes: Floats, weights: Floats, starts: NDArray[np.int64]) -> Floats:
        """The means of all functions of the basis, shape (rows, size)."""
        rows, size = len(starts) - 1, self.basis.size
        if self.basis.is_partition:
            owner = np.repeat(np.arange(rows), np.diff(starts))
            cell = owner * size + cell_index(self.basis, nodes)
            mass = np.bincount(cell, weights=weights, minlength=rows * size).reshape(rows, size)
            return np.asarray(mass * self.basis.evaluate(0.5 * (self.basis.edges[1:] + self.basis.edges[:-1])).max(0))
        found = np.empty((rows, size))
        most = max(1, VALUES_AT_ONCE // size)
        first = 0
        while first < rows:
            last = max(first + 1, int(np.searchsorted(starts, starts[first] + most, side="right")) - 1)
            part = slice(starts[first], starts[last])
            values = self.basis.evaluate(nodes[part]) * weights[part, None]
            found[first:last] = np.add.reduceat(values, starts[first:last] - starts[first], axis=0)
            first = last
        return found
