"""The base class of orthonormal bases of functions of the angle."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array
from .given import Vectorised
from .intervals import cell_among
from .measure import AngularMeasure, gauss_rule

Frame = Literal["paper", "specular"]
AngleFunction = Callable[[Floats], Floats]

# Step of numerical derivatives, relative to an interval between edges.
DIFFERENCE = 1e-6
# Maxima are taken over this many times the nodes of a Gauss rule, with a margin for those between nodes.
DENSER, BETWEEN = 3, 1.02


class Basis(ABC):
    """An orthonormal family e_0, ..., e_{n-1} in L^2 of a probability measure on (0, pi).

    In every basis the matrix S with entries <e_i, P e_j> represents a kernel P. Two bases are equal if they are of the
    same class with the same parameters.
    """

    # numpy would take a basis for an entry of an array
    __array_ufunc__ = None

    @property
    def is_partition(self) -> bool:
        """Whether the functions are normalised indicators of cells; only then are masses from cell to cell defined."""
        return False

    @property
    def is_polynomial(self) -> bool:
        """Whether the functions are polynomials in cos(theta) of the degrees 0, ..., n - 1 on the whole of (0, pi).

        Edges then divide quadratures only, and integrals need no cuts at them.
        """
        return False

    @property
    @abstractmethod
    def measure(self) -> AngularMeasure:
        """The measure in which the family is orthonormal."""

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of functions n."""

    @property
    @abstractmethod
    def edges(self) -> Floats:
        """Increasing angles from 0 to pi between which every function is smooth."""

    @property
    @abstractmethod
    def nodes_per_interval(self) -> int:
        """Number of Gauss nodes between two edges that integrate products of two functions to rounding."""

    @property
    @abstractmethod
    def constant(self) -> Floats:
        """Coefficients of the constant function 1, a unit vector of shape (n,)."""

    @abstractmethod
    def evaluate(self, angle: ArrayLike) -> Floats:
        """Values of all functions, shape ``angle.shape + (n,)``."""

    def nonzero(self, angle: Floats) -> Floats:
        """Values of the functions of the interval that contains each angle, by default of all functions."""
        return self.evaluate(angle)

    @property
    def weights(self) -> Floats:
        """Squared coefficients of the constant 1, shape (n,), sum 1; for a partition, the measures of the cells."""
        return np.asarray(self.constant**2)

    @property
    def normalisation(self) -> Floats:
        """Value h_i of each e_i on its cell for a partition, ones for other bases: P.array[i, j] = h_i S_ij / h_j."""
        return np.ones(self.size)

    @abstractmethod
    def key(self) -> tuple[object, ...]:
        """A hashable value that determines the basis within its class."""

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and isinstance(other, Basis) and self.key() == other.key()

    def __hash__(self) -> int:
        return hash((type(self).__name__, self.key()))

    def index(self, angle: ArrayLike) -> NDArray[np.int64]:
        """The index of the interval between edges that contains each angle: its left edge, and the last one also pi."""
        return cell_among(self.edges, finite_array("angle", angle))

    def magnitudes(self) -> tuple[Floats, Floats]:
        """Bounds of the root of the sum of e_i^2, and of sin(theta)^(1/2) times it, on each interval between edges.

        Two arrays of shape (intervals,). The default takes the largest values at the ends and at Gauss nodes.
        """
        low, high = self.edges[:-1], np.nextafter(self.edges[1:], 0.0)
        nodes = gauss_rule(self.edges, DENSER * self.nodes_per_interval)[0].reshape(low.size, -1)
        angle = np.concatenate((low[:, None], nodes, high[:, None]), axis=1)
        squares = np.sum(self.nonzero(angle) ** 2, axis=-1)
        return np.sqrt(squares.max(axis=1)), BETWEEN * np.sqrt((squares * np.sin(angle)).max(axis=1))

    def derivative_norm(self) -> float:
        """The square root of the sum of the integrals of (d e_i / d theta)^2, apart from jumps at edges.

        A rounding error h of all angles changes a Galerkin matrix by at most h times this norm. The default takes
        differences between neighbouring angles.
        """
        step = np.repeat(DIFFERENCE * np.diff(self.edges), self.nodes_per_interval)
        angle, weight = self.measure.quadrature(self.edges, self.nodes_per_interval)
        slope = (self.nonzero(angle + step) - self.nonzero(angle - step)) / (2.0 * step[:, None])
        return float(np.sqrt(weight @ np.sum(slope**2, axis=1)))

    @abstractmethod
    def coarsened(self) -> tuple[Basis, Floats] | None:
        """A basis of a subspace of about half the size, and the (coarse, n) matrix R of its coefficients in this basis.

        ``None`` if there is no such subspace. The subspace has the Galerkin matrix R S R^T, so S serves two grids.
        """

    def project(self, function: Callable[[Floats], Floats]) -> Floats:
        """Coefficients <e_i, f> of a vectorised function of the angle, shape (n,)."""
        angle, weight = self.measure.quadrature(self.edges, self.nodes_per_interval)
        return np.asarray(self.evaluate(angle).T @ (weight * Vectorised(function, scalar=True)(angle)))


class BasisOfPoints(Basis):
    """A basis of functions of points, which has no measure, edges and nodes of functions of one angle."""

    @property
    def measure(self) -> AngularMeasure:
        self._refuse("measure")

    @property
    def edges(self) -> Floats:
        self._refuse("edges")

    @property
    def nodes_per_interval(self) -> int:
        self._refuse("nodes_per_interval")

    @abstractmethod
    def _refuse(self, what: str) -> NoReturn:
        """Raise an InputError that says what to use in place of a property."""
