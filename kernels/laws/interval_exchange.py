"""Involutions with a given symmetric matrix: exchanges of intervals of angles."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, angles, frozen
from ...core.errors import InputError
from ..bases.angles import clipped_inside
from ..bases.bins import Bins
from ..bases.measure import SINE
from ..expectations.conditionals import Conditionals
from ..matrices.matrix import KernelMatrix
from .law import Law

# Fluxes that differ by less than this fraction of a cell are equal; fluxes below NO_MASS are rounding errors.
FLUX_TOLERANCE = 1e-9
NO_MASS = 1e-14


@dataclass(frozen=True, eq=False)
class IntervalExchangeLaw(Law):
    r"""A deterministic law with a given symmetric matrix: it exchanges piece (i, j) of cell i with piece (j, i) of
    cell j.

    The pieces of cell i are sorted by j and have the masses of the flux. The exchange therefore preserves
    sin(theta) d theta and is an involution, and its matrix on the cells is exactly the given one.

    Parameters
    ----------
    matrix : KernelMatrix
        A matrix on `Bins` in theta, with a symmetric flux whose rows sum to the weights, both within 1e-9 of a cell.

    Attributes
    ----------
    starts, widths : ndarray, shape (pieces,)
        Pieces in increasing order, as fractions of sin(theta)/2 d theta.
    partner : ndarray of int, shape (pieces,)
        The piece with which each piece is exchanged.

    Raises
    ------
    InputError
        If the matrix is not as described.

    Notes
    -----
    Every symmetric law is thus a limit of involutions, which are limits of laws of walls. Images are computed from
    fractions of the measure; within 1e-8 of 0 and pi they are accurate to 1e-8 only. Source: A. Plakhov, "Exterior
    Billiards" (2012), ch. 4; Rudzis 2022, section 1.2.5.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> law = IntervalExchangeLaw(ker.discretise(ker.lambertian(), ker.Bins(2)))
    >>> law.partner.tolist(), law.widths.round(12).tolist()
    ([0, 2, 1, 3], [0.25, 0.25, 0.25, 0.25])
    >>> ker.discretise(law, ker.Bins(2)).array.round(12).tolist()
    [[0.5, 0.5], [0.5, 0.5]]
    """

    matrix: KernelMatrix
    starts: Floats = field(init=False, repr=False)
    widths: Floats = field(init=False, repr=False)
    partner: NDArray[np.int64] = field(init=False, repr=False)

    reversible = True

    def __post_init__(self) -> None:
        flux, edges = self._checked_flux(), self.matrix.basis.edges
        row, column = np.nonzero(flux > NO_MASS)
        widths = flux[row, column]
        # The pieces of each cell start at its left end, so that rounding errors do not add up across cells.
        inside = np.cumsum(widths)
        first = np.searchsorted(row, np.arange(self.matrix.size))
        before = inside - widths
        starts = SINE.cdf(edges[:-1])[row] + before - before[first][row]
        number = np.full(flux.shape, -1, dtype=np.int64)
        number[row, column] = np.arange(row.size)
        partner = number[column, row]
        partner.setflags(write=False)
        for name, value in (("starts", frozen(starts)), ("widths", frozen(widths)), ("partner", partner)):
            object.__setattr__(self, name, value)

    def image(self, theta: Floats) -> Floats:
        """The outgoing angle of every incoming angle."""
        theta = angles("theta", theta)
        fraction = SINE.cdf(theta)
        piece = np.clip(np.searchsorted(self.starts, fraction, side="right") - 1, 0, self.starts.size - 1)
        moved = fraction + (self.starts[self.partner[piece]] - self.starts[piece])
        angle = SINE.quantile(np.clip(moved, 0.0, 1.0))
        return clipped_inside(np.where(self.partner[piece] == piece, theta, angle))

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """All angles between two pieces; none are left out."""
        return np.asarray(SINE.quantile(self.starts[1:])), 0.0

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return self.image(theta)

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        return Conditionals.of_atoms(self.image(theta)[:, None], np.ones((theta.size, 1)), 0.0)

    def _checked_flux(self) -> Floats:
        matrix = self.matrix
        if not isinstance(matrix, KernelMatrix) or not isinstance(matrix.basis, Bins) or matrix.basis.measure != SINE:
            raise InputError(f"matrix: expected a KernelMatrix on Bins in theta, got {matrix!r}")
        flux, cell = matrix.flux, float(matrix.weights.min())
        if flux.min() < -FLUX_TOLERANCE * cell:
            raise InputError(f"matrix: expected probabilities, got a flux of {flux.min():.3g}")
        unequal = float(np.abs(flux - flux.T).max())
        if unequal > FLUX_TOLERANCE * cell:
            raise InputError(f"matrix: expected a symmetric flux, got entries that differ by {unequal:.3g}")
        missing = float(np.abs(flux.sum(axis=1) - matrix.weights).max())
        if missing > FLUX_TOLERANCE * cell:
            raise InputError(f"matrix: expected rows that sum to 1, got a flux that misses {missing:.3g} of a cell's")
        return np.maximum(0.5 * (flux + flux.T), 0.0)
