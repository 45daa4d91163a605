"""The law of a kernel matrix, whose outgoing angle has a piecewise constant density in cos(theta)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, common_shape, finite_array, frozen
from ...core.errors import InputError
from ...core.kinds import explained, explained_class
from ..bases.angles import clipped_inside
from ..bases.basis import AngleFunction, Basis, Frame
from ..bases.bins import Bins
from ..bases.intervals import cell_among
from ..bases.measure import SINE
from ..matrices.matrix import KernelMatrix
from .density import GAUSS_NODES, NEGATIVE_TOLERANCE, SYMMETRY_TOLERANCE, DensityLaw
from .law import set_properties

# Rows divided by their sums add up to 1 within a few roundings. Rows of a matrix with symmetrised flux may not; such a
# matrix is not a law.
ROW_SUM_TOLERANCE = 1e-9


@explained_class
class MatrixLaw(DensityLaw):
    """From bin i the particle goes to bin j with probability P[i, j], uniformly in cos(theta) within bin j.

    Parameters
    ----------
    matrix : KernelMatrix or array_like, shape (n, n)
        A matrix on `Bins` in theta, or a row-stochastic array; an array stands for bins of equal width in cos(theta).

    Attributes
    ----------
    array : ndarray, shape (n, n)
        The transition probabilities.
    edges : ndarray, shape (n + 1,)
        Angles between the bins, from 0 to pi.
    reversible, mirror_symmetric : bool
        Computed from the matrix; ``mirror_symmetric`` is None if the bins are not symmetric about pi/2.

    Raises
    ------
    InputError
        If the matrix is not square, not on bins in theta, has a negative entry, or a row does not sum to 1 within
        1e-9; the message names the worst row.

    Examples
    --------
    >>> law = MatrixLaw([[0.25, 0.75], [0.75, 0.25]])
    >>> round(float(law.apply(lambda theta: theta < np.pi / 2, 1.0)), 14)
    0.25
    >>> law.reversible, law.evaluations
    (True, 32)
    """

    array: Floats
    edges: Floats
    _masses: Floats

    @explained
    def __init__(self, matrix: KernelMatrix | ArrayLike) -> None:
        basis = matrix.basis if isinstance(matrix, KernelMatrix) else None
        array = finite_array("matrix", matrix.array if isinstance(matrix, KernelMatrix) else matrix)
        if array.ndim != 2 or array.shape[0] != array.shape[1] or array.size == 0:
            raise InputError(f"matrix: expected a square array of probabilities, got shape {array.shape}")
        size = array.shape[0]
        edges = SINE.quantile(np.arange(size + 1) / size) if basis is None else _bin_edges(basis, size)
        self._fill(array, edges, matrix.frame if isinstance(matrix, KernelMatrix) else "paper")

    def _fill(self, array: Floats, edges: Floats, frame: Frame) -> None:
        if array.min() < -NEGATIVE_TOLERANCE:
            row, column = np.unravel_index(int(np.argmin(array)), array.shape)
            raise InputError(
                f"matrix: expected probabilities, got {array[row, column]:g} in row {row}, column {column}"
            )
        array = np.maximum(array, 0.0)
        sums = array.sum(axis=1)
        worst = int(np.argmax(np.abs(sums - 1.0)))
        if abs(sums[worst] - 1.0) > ROW_SUM_TOLERANCE:
            raise InputError(
                f"matrix: expected rows that sum to 1, got {sums[worst]:.12g} in row {worst}; a matrix whose flux was "
                "symmetrised is not a law until its rows are divided by their sums"
            )
        masses = SINE.mass(edges[:-1], edges[1:])
        array = array / sums[:, None]
        set_properties(self, array=frozen(array), edges=frozen(edges), _masses=masses)
        set_properties(self, outgoing_breakpoints=frozen(edges[1:-1]))
        set_properties(self, frame=frame, evaluations=array.shape[0] * GAUSS_NODES)
        flux = masses[:, None] * array
        set_properties(self, reversible=bool(np.max(np.abs(flux - flux.T)) <= SYMMETRY_TOLERANCE * np.max(flux)))
        even = bool(np.max(np.abs(masses - masses[::-1])) <= SYMMETRY_TOLERANCE)
        mirror = bool(np.max(np.abs(array - array[::-1, ::-1])) <= SYMMETRY_TOLERANCE)
        # On bins that are not symmetric about pi/2 the entries do not determine the mirror symmetry.
        set_properties(self, mirror_symmetric=mirror if even else None)

    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats:
        """p(theta, theta') with respect to d theta', in the shape to which the two arguments broadcast."""
        theta, theta_out = finite_array("theta", theta), finite_array("theta_out", theta_out)
        common_shape(theta=theta, theta_out=theta_out)
        source, target = cell_among(self.edges, theta), cell_among(self.edges, theta_out)
        return np.asarray(self.array[source, target] * SINE.density(theta_out) / self._masses[target])

    def panels(self, theta: Floats) -> Floats:
        """The edges of the bins."""
        return np.broadcast_to(self.edges, (*finite_array("theta", theta).shape, self.edges.size))

    def adjoint(self) -> MatrixLaw:
        """The law of W^-1 P^T W with bin masses W; raises InputError if P does not preserve sin(theta) d theta."""
        if self.reversible:
            return self
        reverse = self.array.T * self._masses / self._masses[:, None]
        defect = float(np.max(np.abs(reverse.sum(axis=1) - 1.0)))
        if defect > ROW_SUM_TOLERANCE:
            raise InputError(
                f"{self!r} does not preserve sin(theta) d theta (defect {defect:.2g}), so its adjoint is not a law"
            )
        law = object.__new__(MatrixLaw)
        law._fill(reverse, self.edges, self.frame)
        return law

    def _apply(self, function: AngleFunction, theta: Floats) -> Floats:
        angle, weight = SINE.quadrature(self.edges, GAUSS_NODES)
        value = np.asarray(function(angle), dtype=np.float64)
        shape = (self._masses.size, GAUSS_NODES)
        weight = weight.reshape(shape) / weight.reshape(shape).sum(axis=1, keepdims=True)
        means = np.einsum("ij,ij...->i...", weight, value.reshape(shape + value.shape[1:]))
        return np.asarray(np.tensordot(self.array, means, axes=1)[cell_among(self.edges, theta)])

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        cumulative = np.cumsum(self.array, axis=1)
        cumulative /= cumulative[:, -1:]
        start, size = cell_among(self.edges, theta), self._masses.size
        # One search covers all rows: row i occupies the values from i to i + 1. This costs log2(n) of 53 bits.
        rows = cumulative + np.arange(size)[:, None]
        cell = np.searchsorted(rows.ravel(), start + rng.random(theta.shape), side="right") - size * start
        cell = np.clip(cell, 0, size - 1)
        return _uniform_between(self.edges[cell], self.edges[cell + 1], rng.random(theta.shape))

    def __repr__(self) -> str:
        return f"MatrixLaw({self.array.shape[0]} bins)"


def _bin_edges(basis: Basis, size: int) -> Floats:
    if not isinstance(basis, Bins) or basis.size != size or basis.measure != SINE:
        raise InputError(
            f"matrix: expected a KernelMatrix on Bins in theta, got one on {basis!r}; discretise the law on Bins, or "
            "pass a plain array of probabilities"
        )
    return basis.edges


def _uniform_between(low: Floats, high: Floats, fraction: Floats) -> Floats:
    """The angle below which ``fraction`` of the measure of (low, high) lies, accurate at both ends of (0, pi)."""
    upper = low >= 0.5 * np.pi
    low, high = np.where(upper, np.pi - high, low), np.where(upper, np.pi - low, high)
    fraction = np.where(upper, 1.0 - fraction, fraction)
    angle = SINE.quantile(SINE.cdf(low) + fraction * SINE.mass(low, high))
    angle = np.clip(angle, low, high)
    return clipped_inside(np.where(upper, np.pi - angle, angle))
