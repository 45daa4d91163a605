"""Functions on a partition of (0, pi): piecewise polynomials on panels, and the constants of histograms."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, check_memory, finite_array, frozen, instance, number_between, shaped, whole_number
from ...core.long_runs import slices
from .angles import cell_among
from .basis import Basis, checked_edges
from .measure import SINE, AngularMeasure, WeightName, measure_by_name

if TYPE_CHECKING:
    from ...geometry import Wall

# p + EXTRA_NODES Gauss nodes integrate degree 2 p polynomials times a sine on a panel of width up to pi: the first
# missed Chebyshev coefficient of the sine is (pi/2)^(2 EXTRA_NODES) / ((2 EXTRA_NODES)! 2^(2 EXTRA_NODES - 1)).
EXTRA_NODES = 11
# Graded panels shrink by the factor RATIO down to SMALLEST times half the distance to the next special angle. The
# L^2(sin theta d theta) error for a function that behaves like theta^s at grazing is then SMALLEST^(s + 1).
RATIO, SMALLEST = 0.35, 1e-4
WIDEST = np.pi / 24
# Breakpoints xi (1 +- 1/N) of a circular arc become panel edges until their spacing falls below this fraction of xi.
BREAKPOINT_SPACING = 0.05
# Angles evaluated at a time.
AT_ONCE = 2048


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Panels(Basis):
    r"""Polynomials of bounded degree in theta on each panel, orthonormal for the invariant measure.

    Parameters
    ----------
    edges : array_like
        Panel edges, increasing from 0 to pi, in radians.
    degree : int
        Largest degree on each panel; the functions ``p (degree + 1), ..., p (degree + 1) + degree`` belong to panel p.
    weight : {"sin", "sin2"}
        The measure.

    Raises
    ------
    InputError
        If the edges do not increase from 0 to pi or the degree is not a whole number of at least 0.

    Notes
    -----
    For a smooth kernel the eigenvalues converge with order 2 (degree + 1) in the panel width.

    Examples
    --------
    >>> basis = Panels([0, 1, 3.141592653589793], degree=2)
    >>> basis.size, float((basis.constant ** 2).sum().round(12))
    (6, 1.0)
    """

    _cells: Bins
    degree: int
    _coefficients: Floats

    def __init__(self, edges: ArrayLike, degree: int, weight: WeightName = "sin") -> None:
        cells = Bins(np.atleast_1d(finite_array("edges", edges)), weight)
        self._set(_cells=cells, degree=whole_number("degree", degree, 0))
        check_memory("degree", "the basis", cells.size * (self.degree + 1) ** 2)
        self._set(_coefficients=frozen(self._orthonormalise()))

    @classmethod
    def for_wall(cls, wall: Wall, degree: int = 6, smallest: float = SMALLEST) -> Panels:
        """Panels for the law of a wall: graded towards grazing and, for one circular arc, its critical angles.

        Parameters
        ----------
        wall : Wall
            The wall; the panels depend on the pieces of its ``cell``.
        degree : int
            Degree on each panel.
        smallest : float
            Width of the smallest panel at grazing, relative to half the distance to the next critical angle.

        Notes
        -----
        The conditional distributions of a circular arc of half angle xi have breakpoints at theta = xi (1 +- 1/N) and
        at the mirror images. They accumulate at xi; panels are graded towards xi, down to the root of ``smallest``.
        """
        smallest = number_between("smallest", smallest, 1e-12, 0.5)
        special, followed, half_angle = [0.0, np.pi], [], _single_arc_half_angle(wall)
        if half_angle is not None:
            special += [half_angle, np.pi - half_angle]
            last = int(np.ceil(BREAKPOINT_SPACING**-0.5))
            breakpoints = [half_angle * (1.0 + sign / n) for n in range(1, last + 1) for sign in (-1.0, 1.0)]
            followed = [
                angle for breakpoint in breakpoints for angle in (breakpoint, np.pi - breakpoint) if 0.0 < angle < np.pi
            ]
        return cls(_graded_edges(special, followed, smallest), degree)

    @property
    def measure(self) -> AngularMeasure:
        return self._cells.measure

    @property
    def size(self) -> int:
        return self._cells.size * (self.degree + 1)

    @property
    def edges(self) -> Floats:
        return self._cells.edges

    @property
    def order(self) -> int:
        """Order of convergence of eigenvalues in the panel width, for smooth kernels."""
        return 2 * (self.degree + 1)

    @property
    def nodes_per_interval(self) -> int:
        return self.degree + EXTRA_NODES

    @property
    def constant(self) -> Floats:
        unit = np.zeros((self._cells.size, self.degree + 1))
        unit[:, 0] = self._cells.constant
        return unit.ravel()

    def key(self) -> tuple[object, ...]:
        return (self._cells.key(), self.degree)

    def local(self, angle: ArrayLike) -> tuple[NDArray[np.int64], Floats]:
        """The panel of each angle and the values of this panel's functions, shape ``angle.shape + (degree + 1,)``."""
        angle = finite_array("angle", angle)
        panel, position = self.positions(angle)
        polynomials, owner = np.polynomial.legendre.legvander(position.ravel(), self.degree), panel.ravel()
        values = np.empty(polynomials.shape)
        # in parts whose coefficients fit into the processor's cache
        for part in slices(owner.size, AT_ONCE):
            np.einsum("ak,aki->ai", polynomials[part], self._coefficients[owner[part]], out=values[part])
        return panel, values.reshape(*angle.shape, self.degree + 1)

    def positions(self, angle: Floats) -> tuple[NDArray[np.int64], Floats]:
        """The panel of each angle, and its position there from -1 to 1; angles beyond the ends count as these."""
        panel = cell_among(self.edges, angle)
        low, high = self.edges[panel], self.edges[panel + 1]
        return panel, np.asarray((2.0 * np.clip(angle, low, high) - low - high) / (high - low))

    def of_legendre(self, moments: Floats) -> Floats:
        """Integrals of the functions, shape (..., size), from the integrals of the panels' Legendre polynomials.

        These integrals, ``moments``, have shape (..., panels, degree + 1).
        """
        moments = shaped("moments", moments, "...", self._cells.size, self.degree + 1)
        flat = moments.reshape(-1, *moments.shape[-2:])
        transformed = np.matmul(np.moveaxis(flat, 1, 0), self._coefficients)
        return np.asarray(np.moveaxis(transformed, 0, 1).reshape((*moments.shape[:-2], self.size)))

    def legendre_series(self, vectors: Floats) -> Floats:
        """Coefficients in the panels' Legendre polynomials, (panels, degree + 1, k), from ``vectors``, (size, k)."""
        table = shaped("vectors", vectors, self.size, "k")
        return np.asarray(np.matmul(self._coefficients, table.reshape(-1, self.degree + 1, table.shape[1])))

    def evaluate(self, angle: ArrayLike) -> Floats:
        panel, local = self.local(angle)
        values = np.zeros((*panel.shape, self._cells.size, self.degree + 1))
        np.put_along_axis(values, panel[..., None, None], local[..., None, :], axis=-2)
        return values.reshape((*panel.shape, self.size))

    def nonzero(self, angle: Floats) -> Floats:
        return self.local(angle)[1]

    def coarsened(self) -> tuple[Panels, Floats] | None:
        if self.degree > 0:
            coarse = Panels(self.edges, (self.degree - 1) // 2, self.measure.name)
            selected = np.arange(self.size).reshape(self._cells.size, -1)[:, : coarse.degree + 1].ravel()
            return coarse, np.eye(self.size)[selected]
        merged = self._cells.coarsened()
        return None if merged is None else (Panels(merged[0].edges, 0, self.measure.name), merged[1])

    def _orthonormalise(self) -> Floats:
        """The upper triangular matrix of each panel that turns Legendre polynomials into orthonormal functions."""
        angle, weight = self.measure.quadrature(self.edges, self.nodes_per_interval)
        shape = (self._cells.size, self.nodes_per_interval)
        polynomials = np.polynomial.legendre.legvander(self.positions(angle)[1], self.degree)
        table = (np.sqrt(weight)[:, None] * polynomials).reshape((*shape, self.degree + 1))
        triangle = np.linalg.qr(table, mode="r")
        inverse = np.linalg.inv(triangle)
        signs = np.sign(np.diagonal(triangle, axis1=-2, axis2=-1))
        return np.asarray(inverse * signs[:, None, :])

    def __repr__(self) -> str:
        weight = "" if self.measure == SINE else f", weight={self.measure.name!r}"
        return f"Panels(<{self._cells.size + 1} edges>, {self.degree}{weight})"


def _single_arc_half_angle(wall: Wall) -> float | None:
    from ...geometry import Arc, Wall

    instance("wall", wall, Wall, "geo.focusing_arcs(1.0)")
    pieces = wall.cell.pieces
    # more than a half circle would overlap the next period
    if len(pieces) == 1 and isinstance(pieces[0], Arc) and pieces[0].is_circular:
        return pieces[0].half_span
    return None


def _graded_edges(special: list[float], followed: list[float], smallest: float) -> Floats:
    """Edges at all given angles, graded geometrically on both sides of the special ones, at most WIDEST apart.

    At grazing (the angles 0 and pi) the smallest panel has the relative width ``smallest``, because the eigenfunctions
    are singular there. At other special angles it has the square root: the breakpoints get weaker towards these.
    """
    marks = np.unique(special)
    edges = [marks, np.asarray(followed)]
    for low, high in pairwise(marks):
        half = 0.5 * (high - low)
        upward = half * _grading(smallest if low == 0.0 else smallest**0.5)
        downward = half * _grading(smallest if high == np.pi else smallest**0.5)
        edges += [low + upward, high - downward, np.array([low + half])]
    merged = np.unique(np.concatenate(edges))
    merged = merged[np.concatenate(([True], np.diff(merged) > 0.1 * smallest))]
    merged[-1] = np.pi
    pieces = np.maximum(np.ceil(np.diff(merged) / WIDEST).astype(int), 1)
    split = [
        low + (high - low) * np.arange(n) / n for low, high, n in zip(merged[:-1], merged[1:], pieces, strict=True)
    ]
    return np.concatenate([*split, [np.pi]])


def _grading(smallest: float) -> Floats:
    levels = int(np.ceil(np.log(smallest) / np.log(RATIO)))
    return np.asarray(RATIO ** np.arange(1, levels + 1, dtype=np.float64))


# Numbers of Gauss nodes that integrate a smooth function times the weight to rounding on cells of width up to NARROW
# and up to pi. The error is about (width / 4)^(2 nodes) / (2 nodes)!, below 1e-17 in both cases.
NODES_NARROW, NODES_WIDE, NARROW = 8, 20, 1.0


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Bins(Basis):
    r"""Normalised indicators of the bins between increasing angles from 0 to pi.

    Parameters
    ----------
    divisions : int or array_like
        The number of bins, which then have equal measure; or the edges, increasing from 0 to pi, in radians.
    weight : {"sin", "sin2"}
        The measure: ``"sin"`` for theta and sin(theta) d theta, ``"sin2"`` for psi and sin(psi)^2 d psi.

    Raises
    ------
    InputError
        If the number is not a whole number of at least 1, or the edges do not increase from 0 to pi.

    Notes
    -----
    For ``"sin"``, bins of equal measure have equal width in u = -cos(theta) (Rudzis 2022, section 1.2.2). For smooth
    kernels the eigenvalues of the Galerkin matrix on n such bins converge with order 2.

    Examples
    --------
    >>> bins = Bins(4)
    >>> bins.weights.round(14).tolist(), bins.index([0.1, 1.0, 1.6, 3.0]).tolist()
    ([0.25, 0.25, 0.25, 0.25], [0, 0, 2, 3])
    """

    order: ClassVar[int] = 2
    is_partition = True

    _edges: Floats
    _weights: Floats
    _measure: AngularMeasure
    _equal: bool

    def __init__(self, divisions: int | ArrayLike, weight: WeightName = "sin") -> None:
        measure = measure_by_name(weight)
        equal = not np.iterable(divisions)
        if equal:
            check_memory("bins", "the edges", whole_number("bins", divisions, 1))
        edges = _equal_edges(whole_number("bins", divisions, 1), measure) if equal else checked_edges(divisions)
        weights = frozen(measure.mass(edges[:-1], edges[1:]))
        self._set(_edges=frozen(edges), _weights=weights, _measure=measure, _equal=equal)

    @property
    def measure(self) -> AngularMeasure:
        return self._measure

    @property
    def size(self) -> int:
        return self._weights.size

    @property
    def edges(self) -> Floats:
        return self._edges

    @property
    def weights(self) -> Floats:
        """Measures of the bins under the probability measure, shape (n,)."""
        return self._weights

    @property
    def normalisation(self) -> Floats:
        return np.asarray(1.0 / np.sqrt(self._weights))

    @property
    def nodes_per_interval(self) -> int:
        return NODES_NARROW if np.diff(self._edges).max() <= NARROW else NODES_WIDE

    @property
    def constant(self) -> Floats:
        return np.asarray(np.sqrt(self._weights))

    def key(self) -> tuple[object, ...]:
        return (self._measure.name, self._edges.tobytes())

    def evaluate(self, angle: ArrayLike) -> Floats:
        index = self.index(angle)
        values = np.zeros((*index.shape, self.size))
        np.put_along_axis(values, index[..., None], self.normalisation[index][..., None], axis=-1)
        return values

    def magnitudes(self) -> tuple[Floats, Floats]:
        return self.normalisation, np.full(self.size, np.inf)

    def derivative_norm(self) -> float:
        return 0.0

    def coarsened(self) -> tuple[Bins, Floats] | None:
        if self.size < 2:
            return None
        coarse, owner, entries = self.joined()
        restriction = np.zeros((coarse.size, self.size))
        restriction[owner, np.arange(self.size)] = entries
        return coarse, restriction

    def joined(self) -> tuple[Bins, NDArray[np.intp], Floats]:
        """`coarsened` of two bins or more without zeros: the row of the only entry of every column, and this entry."""
        if self._equal and self.size % 2 == 0:
            coarse = Bins(self.size // 2, self._measure.name)
        else:
            coarse = Bins(np.concatenate(([0.0], self._edges[2:-1:2], [np.pi])), self._measure.name)
        owner = np.minimum(np.arange(self.size) // 2, coarse.size - 1)
        return coarse, owner, np.sqrt(self._weights / coarse.weights[owner])

    def __repr__(self) -> str:
        weight = "" if self._measure == SINE else f", weight={self._measure.name!r}"
        return f"Bins({self.size}{weight})" if self._equal else f"Bins(<{self.size + 1} edges>{weight})"


def _equal_edges(n: int, measure: AngularMeasure) -> Floats:
    # The upper edges are computed from the lower ones by pi - x, so that J permutes the bins exactly.
    lower = measure.quantile(np.arange(n // 2 + 1) / n)
    if n % 2 == 0:
        lower[-1] = 0.5 * np.pi
    return np.concatenate((lower, np.pi - lower[: (n + 1) // 2][::-1]))
