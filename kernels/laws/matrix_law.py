"""The law of a kernel matrix, constant in cos(theta) on bins, and all laws that act on finitely many bins."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, reduce

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, frozen, given
from ...core.errors import InputError
from ...core.rounding import EPS
from ..bases.angles import cell_among, clipped_inside
from ..bases.basis import Basis, Frame
from ..bases.measure import SINE
from ..bases.partitions import Bins
from ..expectations.conditionals import Conditionals, gauss_nodes, stiffness_between
from ..matrices.matrix import KernelMatrix, frobenius_error
from .density import NEGATIVE_TOLERANCE, SYMMETRY_TOLERANCE, DensityLaw, angle_pair, not_invariant, split_panels
from .law import Composition, Law
from .structure import Rules, fold, holds_of_all

# Rows divided by their sums add up to 1 within a few roundings. Rows of a matrix with symmetrised flux may not; such a
# matrix is not a law.
ROW_SUM_TOLERANCE = 1e-9
# Edges of bins within this distance, a few roundings of an angle, are one edge.
SAME_EDGE = 32.0 * EPS
# Relative rounding of an entry of a matrix on finer bins: three masses, each of a few roundings.
ENTRY_ROUNDING = 16.0 * EPS
# Position of the node that stands for a whole interval: no angle of a grid, at which it would pass for an atom.
# Matrices of masses in memory.
INSIDE, MATRICES = 0.5 * (5.0**0.5 - 1.0), 4


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
    >>> law.reversible
    True
    """

    is_compact = True
    array: Floats
    edges: Floats
    _masses: Floats

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
        self._set(array=frozen(array), edges=frozen(edges), _masses=masses, frame=frame)
        self._set(outgoing_breakpoints=frozen(edges[1:-1]))
        flux = masses[:, None] * array
        close = max(SYMMETRY_TOLERANCE, rounding)
        reversible = bool(np.max(np.abs(flux - flux.T)) <= close * np.max(flux))
        even = bool(np.max(np.abs(masses - masses[::-1])) <= SYMMETRY_TOLERANCE)
        mirror = bool(np.max(np.abs(array - array[::-1, ::-1])) <= close)
        # On bins that are not symmetric about pi/2 the entries do not determine the mirror symmetry.
        self._set(reversible=reversible, mirror_symmetric=mirror if even else None)

    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats:
        """p(theta, theta') with respect to d theta', in the shape to which the two arguments broadcast."""
        theta, theta_out = angle_pair(theta, theta_out)
        source, target = cell_among(self.edges, theta), cell_among(self.edges, theta_out)
        return np.asarray(self.array[source, target] * SINE.density(theta_out) / self._masses[target])

    def panels(self, theta: Floats) -> Floats:
        """The edges of the bins."""
        return np.broadcast_to(self.edges, (*finite_array("theta", theta).shape, self.edges.size))

    def breakpoints(self, limit: int) -> tuple[Floats, float]:
        """The inner edges of the bins; none are left out."""
        return self.edges[1:-1], 0.0

    def _distinct(self, theta: Floats) -> tuple[Floats, NDArray[np.intp]]:
        """One angle of each bin."""
        _, first, back = np.unique(cell_among(self.edges, theta), return_index=True, return_inverse=True)
        return theta[first], back

    def _conditionals(self, theta: Floats, tolerance: float, degree: int, edges: Floats) -> Conditionals:
        """The nodes of all bins; for functions that are constant between edges one node between each two of them."""
        cell = cell_among(self.edges, theta)
        if degree:
            within = uniform_on_bins(self.edges, degree, edges)
            weights, nodes = self.array[cell][:, within.owner] * within.weights, within.nodes
        else:
            whole = np.concatenate(([0.0], edges, [np.pi]))
            weights, nodes = _masses_between(self, whole.tobytes())[cell], whole[:-1] + INSIDE * np.diff(whole)
        return Conditionals.of_atoms(np.broadcast_to(nodes, weights.shape), weights, ENTRY_ROUNDING)

    def adjoint(self) -> MatrixLaw:
        """The law of W^-1 P^T W with bin masses W; raises InputError if P does not preserve sin(theta) d theta."""
        if self.reversible:
            return self
        reverse = self.array.T * self._masses / self._masses[:, None]
        defect = float(np.max(np.abs(reverse.sum(axis=1) - 1.0)))
        if defect > ROW_SUM_TOLERANCE:
            raise not_invariant(self, f"{defect:.2g}", "its adjoint is not a law")
        law = object.__new__(MatrixLaw)
        law._fill(reverse, self.edges, self.frame)
        return law

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


def uniform_on_bins(bins: Floats, degree: int, edges: Floats) -> Conditionals:
    """The uniform distribution of cos(theta') in each bin, for functions of a degree between edges, to rounding."""
    cuts = np.unique(np.concatenate((bins, edges)))
    low, high = cuts[:-1], cuts[1:]
    stiffness = stiffness_between(edges, degree, low, high) + high - low
    owner, nodes, weights = gauss_nodes(cell_among(bins, 0.5 * (low + high)), low, high, stiffness)
    error = np.full(bins.size - 1, ENTRY_ROUNDING)
    return Conditionals.of_lists(owner, nodes, weights * SINE.density(nodes), error)


@lru_cache(maxsize=MATRICES)
def _masses_between(law: MatrixLaw, edges: bytes) -> Floats:
    """Masses between edges from 0 to pi after each bin."""
    whole = np.frombuffer(edges)
    return np.asarray(law.array @ uniform_on_bins(law.edges, 0, whole[1:-1]).masses(whole))


def finite_matrix(law: Law, functions: int = 0, edges: Floats | None = None) -> KernelMatrix | None:
    """The matrix of a law composed of matrices, Lambertian reflection and ideal isometries; None for other laws.

    Such laws map step functions on their common bins to step functions, because bins symmetric about pi/2 are kept by
    theta -> pi - theta. Functions of mean 0 on every bin are annihilated by matrices and by Lambertian reflection;
    isometries multiply the even and the odd ones (``KernelMatrix.beyond``). If ``functions`` is given and they are not
    annihilated, the bins are divided until they show at least so many of them of each parity. If ``edges`` are given,
    the matrix is that on these bins, and None unless they refine the common ones.

    Examples
    --------
    >>> from asperity.kernels import maxwell
    >>> found = finite_matrix(maxwell(0.25))
    >>> found.beyond, found.array.tolist()
    ((0.75, -0.75), [[1.0]])
    """
    if not holds_of_all(law, _is_finite):
        return None

    def joined(parts: Sequence[Floats]) -> Floats:
        return np.concatenate([np.zeros(1), *parts])

    rules = Rules(_inner_edges, lambda terms: joined([part for _, part in terms]), joined, lambda part: part)
    found = fold(law, rules)
    reflects = contains_reflection(law)
    found = np.sort(joined([found, np.pi - found[found > 0.0]] if reflects else [found]))
    common = np.append(found[np.diff(found, prepend=-1.0) > SAME_EDGE], np.pi)
    if edges is not None:
        missed = np.abs(common[:, None] - edges).min(axis=1).max()
        lopsided = np.abs(edges + edges[::-1] - np.pi).max() if reflects else 0.0
        return _matrix_on(law, edges) if max(missed, lopsided) <= SAME_EDGE else None
    matrix = _matrix_on(law, common)
    if functions and any(matrix.beyond or ()):
        return _matrix_on(law, split_panels(common, 2 + 2 * functions // matrix.size))
    return matrix


def acts_on_bins(law: Law) -> bool:
    """Whether a law is a matrix, or a chain of matrices, Lambertian reflection and ideal isometries with a matrix."""
    factors = law.laws if isinstance(law, Composition) else (law,)
    return any(isinstance(part, MatrixLaw) for part in factors) and holds_of_all(law, _is_finite)


def _is_finite(law: Law) -> bool:
    if isinstance(law, MatrixLaw):
        return bool(np.diff(law.edges).min() > SAME_EDGE)
    return law.is_lambertian or law.retro is not None


def _inner_edges(law: Law) -> Floats:
    return law.edges[1:-1] if isinstance(law, MatrixLaw) else np.empty(0)


def contains_reflection(law: Law) -> bool:
    """Whether specular reflection, or a change of convention, is a part of the law."""
    rules = Rules(lambda leaf: leaf.retro is False, lambda terms: any(part for _, part in terms), any, lambda _: True)
    return fold(law, rules)


def with_beyond(law: Law, reflection: Floats, leaf: Callable[[Law], Floats]) -> Floats:
    """The matrix of a law of isometries and of laws that annihilate what is beyond a basis, with two more rows.

    The last two are for even and odd functions beyond the basis; ``reflection`` is the matrix of specular reflection in
    it, and ``leaf`` gives that of any other law.
    """
    size = len(reflection)
    identity = np.eye(size + 2)
    mirrored = np.diag([*np.zeros(size), 1.0, -1.0])
    mirrored[:size, :size] = reflection

    def of_leaf(part: Law) -> Floats:
        if part.retro is not None:
            return identity if part.retro else mirrored
        return np.pad(leaf(part), (0, 2))

    def mixture(terms: Sequence[tuple[float, Floats]]) -> Floats:
        return sum((weight * part for weight, part in terms), np.zeros(identity.shape))

    rules = Rules(of_leaf, mixture, lambda parts: reduce(np.matmul, parts, identity), lambda part: part @ mirrored)
    return fold(law, rules)


def _matrix_on(law: Law, edges: Floats) -> KernelMatrix:
    """The matrix of a law on bins that refine its own, by matrices with two more rows for the functions beyond."""
    masses = SINE.mass(edges[:-1], edges[1:])
    size, middles = masses.size, 0.5 * (edges[:-1] + edges[1:])

    def leaf(part: Law) -> Floats:
        cell, given = np.zeros(size, dtype=np.intp), np.ones((1, 1))
        if isinstance(part, MatrixLaw):
            cell, given = cell_among(part.edges, middles), part.array
        return np.asarray(given[cell][:, cell] * (masses / np.bincount(cell, masses)[cell]))

    whole = with_beyond(law, np.eye(size)[::-1], leaf)
    # all entries on the bins are nonnegative, so their relative roundings add up
    leaves = fold(law, Rules(lambda _: 1, lambda terms: sum(number for _, number in terms), sum, lambda number: number))
    rounding = leaves * ((ENTRY_ROUNDING if size > 1 else 0.0) + size * EPS)
    root = np.sqrt(masses)
    symmetric = root[:, None] * whole[:size, :size] / root
    norm, skew = np.linalg.norm(symmetric), np.linalg.norm(symmetric - symmetric.T)
    # symmetries that the law is known to have are enforced when eigenvalues are computed
    lopsided = np.linalg.norm(symmetric - symmetric[::-1, ::-1]) if law.mirror_symmetric else 0.0
    error = rounding * norm + (skew if law.reversible else min(skew, ENTRY_ROUNDING * norm)) + lopsided
    return KernelMatrix(
        symmetric, Bins(edges), frobenius_error(float(error), "bound", "rounding, and defects of symmetry"),
        method="exact", law=repr(law), reversible=law.reversible, mirror_symmetric=law.mirror_symmetric,
        frame=law.frame, beyond=(whole[-2, -2], whole[-1, -1]),
    )  # fmt: skip


def check_law(name: str, value: object, expected: str, *others: type) -> None:
    """Refuse what is neither a law nor of one of the other kinds, with what makes a law of it."""
    if not isinstance(value, (Law, *others)):
        raise InputError(f"{name}: expected {expected}, got {given(value, Law)}")
    try:
        hash(value if isinstance(value, Law) else name)
    except TypeError as reason:
        raise InputError(
            f"{name}: expected a law that can be hashed, because what is computed of it is remembered, got one of the "
            f"class {type(value).__name__}; write @dataclass(frozen=True), with eq=False where a field is an array"
        ) from reason


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
