"""The law of a kernel matrix, constant in cos(theta) on bins, and all laws that act on finitely many bins."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, frozen, shortened
from ...core.errors import InputError
from ...core.kinds import explained, explained_class
from ...core.rounding import EPS
from ..bases.angles import clipped_inside
from ..bases.basis import AngleFunction, Basis, Frame
from ..bases.bins import Bins
from ..bases.intervals import cell_among
from ..bases.measure import SINE
from ..matrices.matrix import KernelMatrix, frobenius_error
from .density import GAUSS_NODES, NEGATIVE_TOLERANCE, SYMMETRY_TOLERANCE, DensityLaw, split_panels
from .ideal import LambertianLaw
from .law import IsometryLaw, Law, set_properties
from .phase_function import HenyeyGreensteinLaw
from .structure import Rules, fold

# Rows divided by their sums add up to 1 within a few roundings. Rows of a matrix with symmetrised flux may not; such a
# matrix is not a law.
ROW_SUM_TOLERANCE = 1e-9
# Edges of bins within this distance, a few roundings of an angle, are one edge.
SAME_EDGE = 32.0 * EPS
# Relative rounding of an entry of a matrix on finer bins: three masses, each of a few roundings.
ENTRY_ROUNDING = 16.0 * EPS


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
        If the matrix is not square, not on bins in theta, has a negative entry, or a row does not sum to 1 within 1e-9,
        or n roundings of the given float type if these are more; the message names the worst row.

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
        # entries that were rounded to another precision
        rounding = size * float(np.finfo(dtype).eps) if (dtype := np.asarray(matrix).dtype).kind == "f" else 0.0
        self._fill(array, edges, matrix.frame if isinstance(matrix, KernelMatrix) else "paper", rounding)

    def _fill(self, array: Floats, edges: Floats, frame: Frame, rounding: float = 0.0) -> None:
        if array.min() < -NEGATIVE_TOLERANCE:
            row, column = np.unravel_index(int(np.argmin(array)), array.shape)
            raise InputError(
                f"matrix: expected probabilities, got {array[row, column]:g} in row {row}, column {column}"
            )
        array = np.maximum(array, 0.0)
        sums = array.sum(axis=1)
        worst = int(np.argmax(np.abs(sums - 1.0)))
        if abs(sums[worst] - 1.0) > max(ROW_SUM_TOLERANCE, rounding):
            remedy = "a matrix whose flux was symmetrised is not a law until its rows are divided by their sums"
            if np.abs(array.sum(axis=0) - 1.0).max() <= max(ROW_SUM_TOLERANCE, rounding):
                remedy = "its columns sum to 1: pass the transpose"
            raise InputError(f"matrix: expected rows that sum to 1, got {sums[worst]:.12g} in row {worst}; {remedy}")
        masses = SINE.mass(edges[:-1], edges[1:])
        array = array / sums[:, None]
        set_properties(self, array=frozen(array), edges=frozen(edges), _masses=masses)
        set_properties(self, outgoing_breakpoints=frozen(edges[1:-1]))
        set_properties(self, frame=frame, evaluations=array.shape[0] * GAUSS_NODES)
        flux = masses[:, None] * array
        close = max(SYMMETRY_TOLERANCE, rounding)
        set_properties(self, reversible=bool(np.max(np.abs(flux - flux.T)) <= close * np.max(flux)))
        even = bool(np.max(np.abs(masses - masses[::-1])) <= SYMMETRY_TOLERANCE)
        mirror = bool(np.max(np.abs(array - array[::-1, ::-1])) <= close)
        # On bins that are not symmetric about pi/2 the entries do not determine the mirror symmetry.
        set_properties(self, mirror_symmetric=mirror if even else None)

    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats:
        """p(theta, theta') with respect to d theta', in the shape to which the two arguments broadcast."""
        source, target = cell_among(self.edges, theta), cell_among(self.edges, theta_out)
        return np.asarray(self.array[source, target] * SINE.density(theta_out) / self._masses[target])

    def panels(self, theta: Floats) -> Floats:
        """The edges of the bins."""
        return np.broadcast_to(self.edges, (*theta.shape, self.edges.size))

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


@dataclass(frozen=True)
class FiniteAction:
    """The action of a law on step functions on bins, and on functions whose mean on every bin is 0.

    Attributes
    ----------
    edges : array of shape (n + 1,)
        Edges of bins, symmetric about pi/2 if theta -> pi - theta occurs in the law.
    array : array of shape (n, n)
        Transition probabilities between the bins, which map step functions to step functions.
    even, odd : float
        The law multiplies even and odd functions of cos(theta) by these, if their mean on every bin is 0.
    rounding : float
        Bound of the relative rounding of the entries, and of the rounding of ``even`` and ``odd``.
    states : int
        The least number of bins on which the law acts like this.
    """

    edges: Floats
    array: Floats
    even: float
    odd: float
    rounding: float
    states: int = 1

    def matrix_of(self, law: Law) -> KernelMatrix:
        """The matrix of the law on the bins, with ``beyond``; entries are symmetrised within their error."""
        root = np.sqrt(SINE.mass(self.edges[:-1], self.edges[1:]))
        symmetric = root[:, None] * self.array / root
        skew = float(np.linalg.norm(symmetric - symmetric.T))
        lopsided = float(np.linalg.norm(symmetric - symmetric[::-1, ::-1]))
        size = float(np.linalg.norm(symmetric))
        mirrored, reversible = (
            known is True or (known is None and defect <= 8.0 * max(self.rounding, EPS) * size)
            for known, defect in ((law.mirror_symmetric, lopsided), (law.reversible, skew))
        )
        error = (self.rounding * size) + (skew if reversible else 0.0) + (lopsided if mirrored else 0.0)
        return KernelMatrix(
            symmetric, Bins(self.edges), frobenius_error(error, "bound", "rounding, and defects of symmetry"),
            method="exact", law=repr(law), reversible=reversible or law.reversible, frame=law.frame,
            mirror_symmetric=mirrored or law.mirror_symmetric, beyond=(self.even, self.odd),
        )  # fmt: skip


def finite_action(law: Law, functions: int = 0, edges: Floats | None = None) -> FiniteAction | None:
    """The action of a law composed of matrices, Lambertian reflection and ideal isometries; None for other laws.

    On their common bins such laws are matrices, because bins symmetric about pi/2 are kept by theta -> pi - theta.
    Functions of mean 0 on every bin are annihilated by matrices and by Lambertian reflection. If ``functions`` is given
    and the others are not annihilated, the bins are divided until they show at least so many of them of each parity. If
    ``edges`` are given, the action is that on these bins, and None unless they refine the common ones.

    Examples
    --------
    >>> from asperity.kernels import maxwell
    >>> found = finite_action(maxwell(0.25))
    >>> found.even, found.odd, found.array.tolist()
    (0.75, -0.75, [[1.0]])
    """
    inner = fold(
        law, Rules(_inner_edges, lambda terms: _joined([part for _, part in terms]), _joined, lambda part: part)
    )
    if inner is None:
        return None
    reflects = fold(law, Rules(_reflects, lambda terms: any(part for _, part in terms), any, lambda _: True))
    common = _merged_edges(np.concatenate([inner, np.pi - inner]) if reflects else inner)
    missed = 0.0 if edges is None else np.abs(common[:, None] - edges).min(axis=1).max()
    lopsided = 0.0 if edges is None or not reflects else np.abs(edges + edges[::-1] - np.pi).max()
    if max(missed, lopsided) > SAME_EDGE:
        return None
    found = _action_on(law, common if edges is None else edges)
    if functions and (found.even or found.odd):
        found = _action_on(law, split_panels(common, 2 + 2 * functions // (common.size - 1)))
    return replace(found, states=common.size - 1)


def _inner_edges(law: Law) -> Floats | None:
    """The edges inside (0, pi) of the bins of a law that is not compound; None if it has none."""
    if isinstance(law, MatrixLaw):
        return law.edges[1:-1] if np.diff(law.edges).min() > SAME_EDGE else None
    return np.empty(0) if isinstance(law, (IsometryLaw, LambertianLaw)) or _is_isotropic(law) else None


def _is_isotropic(law: Law) -> bool:
    return isinstance(law, HenyeyGreensteinLaw) and law.g == 0.0


def _reflects(law: Law) -> bool:
    return isinstance(law, IsometryLaw) and not law.retro


def _joined(parts: Sequence[Floats | None]) -> Floats | None:
    known = [part for part in parts if part is not None]
    return np.concatenate([np.empty(0), *known]) if len(known) == len(parts) else None


def _merged_edges(inner: Floats) -> Floats:
    """The edges from 0 to pi, of which those within `SAME_EDGE` of each other are one."""
    found = np.sort(np.append(inner, 0.0))
    return np.append(found[np.diff(found, prepend=-1.0) > SAME_EDGE], np.pi)


def _action_on(law: Law, edges: Floats) -> FiniteAction:
    """The action of a law on bins that refine its own."""
    masses = SINE.mass(edges[:-1], edges[1:])
    size, middles = masses.size, 0.5 * (edges[:-1] + edges[1:])

    def leaf(part: Law) -> FiniteAction:
        if isinstance(part, IsometryLaw):
            identity = np.eye(size)
            array = identity if part.retro else identity[:, ::-1]
            return FiniteAction(edges, array, 1.0, 1.0 if part.retro else -1.0, 0.0)
        cell, given = np.zeros(size, dtype=np.intp), np.ones((1, 1))
        if isinstance(part, MatrixLaw):
            cell, given = cell_among(part.edges, middles), part.array
        fraction = masses / np.bincount(cell, masses)[cell]
        return FiniteAction(edges, given[cell][:, cell] * fraction, 0.0, 0.0, ENTRY_ROUNDING if size > 1 else 0.0)

    def mixture(terms: Sequence[tuple[float, FiniteAction]]) -> FiniteAction:
        def mean(of: Callable[[FiniteAction], float]) -> float:
            return sum(weight * of(part) for weight, part in terms)

        array = sum((weight * part.array for weight, part in terms), np.zeros((size, size)))
        rounding = max(part.rounding for _, part in terms) + len(terms) * EPS
        return FiniteAction(edges, array, mean(lambda part: part.even), mean(lambda part: part.odd), rounding)

    def product(one: FiniteAction, other: FiniteAction) -> FiniteAction:
        # all entries are nonnegative, so their relative roundings add up
        rounding = one.rounding + other.rounding + size * EPS
        return FiniteAction(edges, one.array @ other.array, one.even * other.even, one.odd * other.odd, rounding)

    def mirrored(part: FiniteAction) -> FiniteAction:
        return FiniteAction(edges, part.array[:, ::-1], part.even, -part.odd, part.rounding)

    identity = leaf(IsometryLaw(True))
    return fold(law, Rules(leaf, mixture, lambda parts: reduce(product, parts, identity), mirrored))


def not_a_law(name: str, expected: str, value: object) -> InputError:
    """The refusal of a value that is not a law; of an array it has the shape, and names the law of a matrix."""
    if isinstance(value, np.ndarray):
        return InputError(
            f"{name}: expected {expected}, got an array of shape {value.shape}; the law of transition probabilities "
            "between bins of equal measure is ker.MatrixLaw(array)"
        )
    return InputError(f"{name}: expected {expected}, got {shortened(value)}")


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
