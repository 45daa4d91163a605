"""The base class of orthonormal bases of functions of the angle."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, Value, finite_array, frozen, instance, is_of_package, shaped, whole_number
from ...core.errors import AsperityError, InputError
from ...core.given import Vectorised
from .angles import cell_among
from .measure import AngularMeasure, gauss_rule

Frame = Literal["paper", "specular"]
AngleFunction = Callable[[Floats], Floats]

# Step of numerical derivatives, relative to an interval between edges.
DIFFERENCE = 1e-6
# Maxima are taken over this many times the nodes of a Gauss rule, with a margin for those between nodes.
DENSER, BETWEEN = 3, 1.02
# Rounding of <e_i, e_j> for each function, and the attribute of a basis that was found to be orthonormal.
ORTHONORMAL, CHECKED = 1e-12, "_is_checked"


class Basis(Value, ABC):
    """An orthonormal family e_0, ..., e_{n-1} in L^2 of a probability measure on (0, pi).

    In every basis the matrix S with entries <e_i, P e_j> represents a kernel P. Two bases are equal if they are of the
    same class with the same parameters.

    An object of a user's own class is examined once, where it is first used: <e_i, e_j> at its own nodes and at more,
    the constant, cells, polynomials and the coarser basis. An InputError says which promise it breaks.
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


def checked_basis(basis: Any) -> None:
    """Refuse what is no basis, and a basis of a user's own class that breaks a promise of `Basis`.

    An object is examined once, at its own nodes and at more. The tests examine the classes of this package.
    """
    instance("basis", basis, Basis, "ker.Bins(64)")
    if is_of_package(basis) or isinstance(basis, BasisOfPoints) or CHECKED in vars(basis):
        return
    try:
        for what, found, expected in _promises(basis):
            defect = np.abs(found - shaped("basis", expected, *found.shape)).max()
            # rounding of functions on narrow cells is larger
            if not defect <= ORTHONORMAL * basis.size * max(1.0, np.abs(found).max()):
                raise InputError(f"basis: expected {what}, got a difference of {defect:.2g}")
    except AsperityError:
        raise
    except Exception as reason:  # of the user's methods
        raise InputError(f"basis: {basis!r} failed ({type(reason).__name__}: {reason}); see ker.Basis") from reason
    vars(basis)[CHECKED] = True


def _promises(basis: Basis) -> Iterator[tuple[str, Floats, Any]]:
    """What a basis promises, what is found, and what is expected."""
    hash(basis)
    size, nodes = whole_number("basis.size", basis.size, 1), whole_number("basis.nodes", basis.nodes_per_interval, 1)
    # lists have no such index
    edges, constant = checked_edges(basis.edges[...]), shaped("basis.constant", basis.constant[...], size)
    for number in (nodes, DENSER * nodes):
        angle, weight = basis.measure.quadrature(edges, number)
        values = shaped("basis.evaluate(angles)", basis.evaluate(frozen(angle)), angle.size, size)
        remedy = "raise nodes_per_interval, or add edges where functions have kinks"
        gram = values.T @ (weight[:, None] * values)
        yield f"orthonormal functions at {number} nodes an interval ({remedy})", gram, np.eye(size)
    yield "evaluate(angle) @ constant = 1", values @ constant, np.ones(angle.size)
    if basis.is_partition:
        cells = basis.index(angle)[:, None] == np.arange(size)
        yield "is_partition of indicators only", values, cells * basis.normalisation
    if basis.is_polynomial:
        powers = np.polynomial.legendre.legvander(np.cos(angle), size - 1)
        triangle = np.triu(np.linalg.lstsq(powers, values)[0])
        yield "is_polynomial of degrees 0, 1, ... in cos(theta) only", values, powers @ triangle
    if (coarser := basis.coarsened()) is not None:
        yield "coarsened() of a subspace", values @ np.transpose(coarser[1]), coarser[0].evaluate(angle)


def checked_edges(values: ArrayLike) -> Floats:
    """Increasing angles from 0 to pi; an InputError for others."""
    edges = finite_array("edges", values)
    if edges.ndim != 1 or edges.size < 2:
        raise InputError(f"edges: expected at least two angles in a row, got an array of shape {edges.shape}")
    step = np.diff(edges)
    if not np.all(step > 0.0):
        worst = int(np.argmin(step))
        raise InputError(
            f"edges: expected increasing angles, got {edges[worst]!r} then {edges[worst + 1]!r} at index {worst}"
        )
    if edges[0] != 0.0 or abs(edges[-1] - np.pi) > 4.0 * np.spacing(np.pi):
        raise InputError(
            f"edges: expected angles from 0 to pi in radians, got {edges[0]!r} to {edges[-1]!r}; add the missing ends"
        )
    return np.concatenate((edges[:-1], [np.pi]))
