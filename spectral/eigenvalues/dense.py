"""Extremal eigenvalues of a dense symmetric matrix and of its even and odd parts, with a check of completeness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS, UNIT_ROUNDOFF
from ...kernels import Basis, Bins, KernelMatrix, Law
from ...kernels.bases.assembly import is_mirror_symmetric, reflection_matrix

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    ParityBasis = tuple[csr_array[Any], csr_array[Any]]

Which = Literal["largest", "moduli"]
_Pairs = tuple[Floats, Floats]
# LAPACK's complete solver is used below this size and above this fraction of the spectrum, where it takes no longer.
SMALL, LARGEST_FRACTION = 512, 1.0 / 24.0
# Relative accuracy, least number of vectors and limit on restarts of Lanczos: some hundred products, less than LAPACK.
LANCZOS_TOLERANCE, LEAST_SPACE, MOST_RESTARTS = 1e-13, 24, 16
# Joint residual above which LAPACK is used; Lanczos loses digits where it restarts in a cluster.
LARGEST_RESIDUAL = 1e-11
# Additional values. For a compact operator the Frobenius norm of the rest may then be below the last wanted value, and
# no factorisation is needed.
GUARDS = 6
# Number of searches, and additional values per search, if the check shows that values are missing.
SEARCHES, MORE_VALUES = 2, 8
# Distance from the last value to the threshold of the check, in backward errors n u of a factorisation.
CLEARANCE = 2.0


def off_constants(array: Floats, constant: Floats) -> tuple[Floats, Floats]:
    """All eigenvalues (ascending) and eigenvectors of a symmetric matrix on the complement of a unit vector.

    A Householder reflection maps the vector to the first axis. Therefore neither the multiplicity of the eigenvalue 1
    nor noise in the entries can mix constants into the other eigenvectors.
    """
    from scipy.linalg import eigh

    # I - 2 v v^T maps the unit vector to plus or minus the first axis
    reflector = np.array(constant, dtype=np.float64)
    reflector[0] += 1.0 if reflector[0] >= 0.0 else -1.0
    reflector /= np.linalg.norm(reflector)
    reflected = _reflect(reflector, _reflect(reflector, array).T)
    values, inner = eigh(0.5 * (reflected + reflected.T)[1:, 1:])
    vectors = np.vstack([np.zeros((1, inner.shape[1])), inner])
    return np.asarray(values), _reflect(reflector, vectors)


def compressed(array: Floats, embedding: csr_array[Any]) -> Floats:
    """The symmetric part of E A E^T for a sparse E of shape (m, n): the form of A on the rows of E."""
    return symmetric_half(embedding @ (embedding @ array).T)


def symmetric_half(array: Floats) -> Floats:
    """The symmetric part (A + A^T)/2."""
    return np.asarray(0.5 * (array + array.T))


def _reflect(v: Floats, array: Floats) -> Floats:
    return np.asarray(array - 2.0 * np.outer(v, v @ array))


@dataclass(frozen=True)
class ExtremalEigenvalues:
    """The extremal eigenvalues of a symmetric matrix.

    Attributes
    ----------
    values : array of shape (m,)
        Descending.
    vectors : array of shape (n, m)
        Orthonormal.
    top : int
        The first ``top`` values are the largest eigenvalues; the others are the least ones.
    residuals : array of shape (m,)
        Norms of S v - lambda v.
    errors : array of shape (m,)
        Bounds, to rounding, of the distance of every value from the eigenvalue of its rank.
    method : str
        The method of computation, and the check of completeness.
    """

    values: Floats
    vectors: Floats
    top: int
    residuals: Floats
    errors: Floats
    method: str


def extremal(array: Floats, constant: Floats | None, k: int, which: Which = "moduli") -> ExtremalEigenvalues:
    r"""The k largest eigenvalues, or the k eigenvalues of largest modulus together with the largest one.

    Parameters
    ----------
    array : array of shape (n, n)
        Exactly symmetric.
    constant : array of shape (n,), optional
        A unit vector; the matrix is compressed to its complement.
    k : int
        At least 1; there may be fewer.
    which : {"largest", "moduli"}

    Notes
    -----
    Lanczos computes values and vectors, which are then deflated. If the Frobenius norm of what is left is not below
    sigma, just beyond the last value, a Cholesky factorisation of sigma - S shows, in floating point with bounds of its
    rounding, that no other eigenvalue is above sigma; sigma + S shows the same for the lower end. This takes a tenth of
    the time of LAPACK's solver, which is used if Lanczos does not converge. With the vectors V and R = S V - V
    diag(values), the eigenvalues of S are by Weyl within \|R\| of the values and of the spectrum of the compression to
    the complement of V, whose upper end is at most sigma plus a margin of rounding. A cluster may be cut: its unlisted
    eigenvalues are not larger than the listed ones.
    """
    size = len(array)
    if size < SMALL or k > LARGEST_FRACTION * size:
        return _by_lapack(array, constant, k, which, "all eigenvalues by LAPACK")
    found = _verified(Deflated.of(array, constant), k, which)
    if isinstance(found, str):
        return _by_lapack(array, constant, k, which, f"all eigenvalues by LAPACK, since {found}")
    return found


def end_values(array: Floats, constant: Floats | None, top: int, bottom: int) -> tuple[Floats, Floats]:
    """The ``top`` largest eigenvalues, descending, and the ``bottom`` least ones, ascending; fewer of a small matrix.

    There is no check of completeness; the values serve to compare two grids, an estimate.
    """
    if len(array) >= SMALL and max(top, bottom) <= LARGEST_FRACTION * len(array):
        matrix = Deflated.of(array, constant)
        upper = _more(matrix, _nothing(len(array)), top, "LA")
        lower = _more(matrix, _nothing(len(array)), bottom, "SA") if bottom else _nothing(len(array))
        if upper is not None and lower is not None:
            return np.sort(upper[0])[::-1], np.sort(lower[0])
    values = _by_lapack(array, constant, len(array), "largest", "").values
    return values[:top], values[::-1][:bottom]


def wanted(values: Floats, k: int, which: Which) -> NDArray[np.intp]:
    """Indices of the k wanted ones among descending values; for moduli they include the largest value."""
    if which == "largest" or not len(values):
        return np.arange(min(k, len(values)))
    return np.union1d([0], np.argsort(-np.abs(values), kind="stable")[:k])


def counted_from_above(values: Floats, which: Which) -> int:
    """The number of wanted values, descending, with a rank from the upper end: for moduli the positive values."""
    return len(values) if which == "largest" else max(int(np.sum(values > 0.0)), min(1, len(values)))


def _verified(matrix: Deflated, k: int, which: Which) -> ExtremalEigenvalues | str:
    """Extremal eigenvalues by Lanczos, verified by a Cholesky factorisation; the reason in words if either fails."""
    end: Literal["LM", "LA"] = "LM" if which == "moduli" else "LA"
    none = _nothing(len(matrix.array))
    found = _more(matrix, none, k + GUARDS, end) or _more(matrix, none, k, end)
    for _ in range(SEARCHES):
        if found is not None and which == "moduli" and np.all(found[0] <= 0.0):
            found = _more(matrix, found, 1, "LA")
        if found is None:
            return "Lanczos did not converge"
        listed = _without_others(matrix, found, k, which)
        if isinstance(listed, ExtremalEigenvalues):
            return listed
        reason, found = listed, _more(matrix, found, MORE_VALUES, end)
    return reason


def _without_others(matrix: Deflated, found: _Pairs, k: int, which: Which) -> ExtremalEigenvalues | str:
    """The k wanted pairs among those found, or the reason why they are inaccurate or may be incomplete."""
    values, vectors = found
    rounding = len(matrix.array) * EPS * max(1.0, float(np.abs(values).max()))
    residuals = np.linalg.norm(matrix @ vectors - vectors * values, axis=0)
    joint = float(np.linalg.norm(residuals)) + rounding
    if joint > LARGEST_RESIDUAL:
        return f"Lanczos left a residual of {joint:.2g}"
    indices = wanted(values, k, which)
    chosen = values[indices]
    top = counted_from_above(chosen, which)
    if which == "largest":
        last = float(chosen[-1])
        ends = {1.0: last}
    else:
        # the largest value is always wanted, even if it is not among the k largest moduli
        last = float(np.sort(np.abs(chosen))[-min(k, len(chosen))])
        ends = {1.0: min(last, float(chosen[0])), -1.0: last}
    thresholds = {sign: end + joint + CLEARANCE * rounding for sign, end in ends.items()}
    others, reach = norm_beyond(matrix, values), {}
    how = "Frobenius norms" if others <= min(thresholds.values()) else "Cholesky factorisations"
    for sign, threshold in thresholds.items():
        margin = 0.0 if others <= threshold else margin_below(matrix, sign, vectors, values, threshold)
        if margin is None:
            return f"a Cholesky factorisation did not rule out others beyond {sign * threshold:.12g}"
        reach[sign] = threshold + margin
    upper = np.maximum(reach[1.0] - chosen[:top], 0.0)
    lower = np.maximum(reach.get(-1.0, 0.0) + chosen[top:], 0.0)
    sides = f"above {reach[1.0]:.12g}" + (f" or below {-reach[-1.0]:.12g}" if -1.0 in reach else "")
    return ExtremalEigenvalues(
        chosen, vectors[:, indices], top, residuals[indices], 2.0 * joint + np.concatenate([upper, lower]),
        f"Lanczos, and by {how} no other eigenvalue is {sides}",
    )  # fmt: skip


def _more(matrix: Deflated, known: _Pairs, number: int, end: Literal["LM", "LA", "SA"]) -> _Pairs | None:
    """The known pairs and ``number`` more from one end of the rest, descending; None if Lanczos fails."""
    from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

    values, vectors = known
    size = len(matrix.array)
    # known eigenvalues are moved away from the wanted end
    target = {"LM": 0.0, "LA": -1.0, "SA": 1.0}[end] * (1.0 + np.abs(values).max(initial=0.0))

    def product(x: Floats) -> Floats:
        x = x.ravel()
        found = matrix @ x
        if end != "LM" and matrix.constant is not None:
            found = found + target * (matrix.constant @ x) * matrix.constant
        return np.asarray(found - vectors @ ((values - target) * (vectors.T @ x)))

    start = np.random.default_rng(size).normal(size=size)
    space = min(max(2 * number + 1, LEAST_SPACE), size)
    try:
        _, fresh = eigsh(
            LinearOperator((size, size), product, dtype=np.float64), number, which=end, v0=start, ncv=space,
            maxiter=MOST_RESTARTS, tol=LANCZOS_TOLERANCE,
        )  # fmt: skip
    except ArpackError:
        return None
    basis = np.linalg.qr(np.column_stack([vectors, fresh]))[0]
    ritz, turn = np.linalg.eigh(basis.T @ (matrix @ basis))
    return ritz[::-1], basis @ turn[:, ::-1]


def _nothing(size: int) -> _Pairs:
    return np.empty(0), np.empty((size, 0))


def _by_lapack(array: Floats, constant: Floats | None, k: int, which: Which, method: str) -> ExtremalEigenvalues:
    from scipy.linalg import eigh

    values, vectors = eigh(array) if constant is None else off_constants(array, constant)
    values, vectors = values[::-1], vectors[:, ::-1]
    indices = wanted(values, k, which)
    values, vectors = values[indices], vectors[:, indices]
    top = counted_from_above(values, which)
    norm = max(1.0, float(np.abs(values).max(initial=0.0)))
    residuals = np.linalg.norm(Deflated.of(array, constant) @ vectors - vectors * values, axis=0)
    errors = residuals + len(array) * EPS * norm
    return ExtremalEigenvalues(values, vectors, top, residuals, errors, method)


# Roundings of an entry of the shifted matrix, without one for each deflated vector: its product with the sign, the
# shift, and two products and sums of the deflation.
ENTRY_ROUNDINGS = 6
# Roundings beyond n in gamma_{n+3}: the division by a pivot, one more if BLAS multiplies by its reciprocal, and the
# square root.
PIVOT_ROUNDINGS = 3


@dataclass(frozen=True)
class Deflated:
    """A symmetric matrix S, or (I - c c^T) S (I - c c^T) for a unit vector c, without forming it.

    The latter is S - c u^T - u c^T with u = S c - (c^T S c) c / 2; it has the eigenvalue 0 at c.
    """

    array: Floats
    constant: Floats | None
    image: Floats | None

    @classmethod
    def of(cls, array: Floats, constant: Floats | None) -> Deflated:
        """The matrix compressed to the complement of ``constant``."""
        if constant is None:
            return cls(array, None, None)
        image = array @ constant
        return cls(array, constant, image - 0.5 * (constant @ image) * constant)

    def __matmul__(self, block: Floats) -> Floats:
        from scipy.linalg.blas import dsymv

        # the transpose of a symmetric matrix is the same matrix in the order of BLAS; one triangle is read
        found = dsymv(1.0, self.array.T, block) if block.ndim == 1 else self.array @ block
        if self.constant is None or self.image is None:
            return np.asarray(found)
        outer = np.multiply.outer
        return np.asarray(found - outer(self.constant, self.image @ block) - outer(self.image, self.constant @ block))

    @property
    def frobenius(self) -> float:
        """The Frobenius norm."""
        square = float(np.vdot(self.array, self.array))
        if self.constant is None or self.image is None:
            return float(np.sqrt(square))
        along = float(self.constant @ self.image)
        rest = float(self.image @ self.image) - along**2
        # S c = u + (c^T u) c, with the part u - (c^T u) c orthogonal to c
        return float(np.sqrt(max(square - 2.0 * rest - 4.0 * along**2, 0.0)))


def norm_beyond(matrix: Deflated, values: Floats) -> float:
    """A bound, from Frobenius norms, of the moduli of all eigenvalues other than the listed Ritz values.

    For orthonormal vectors V with V^T S V = diag(values), the squared norm of S is at least the sum of the squared
    values plus the squared norm of the compression to the complement of V.
    """
    square = matrix.frobenius**2
    # sums of n^2 squares, in any order
    rounding = 2.0 * matrix.array.size * UNIT_ROUNDOFF * float(np.vdot(matrix.array, matrix.array))
    return float(np.sqrt(max(square - float(values @ values), 0.0) + rounding))


def margin_below(matrix: Deflated, sign: float, vectors: Floats, values: Floats, threshold: float) -> float | None:
    r"""A bound of the distance by which eigenvalues of sign * matrix off the ``vectors`` can exceed ``threshold``.

    None if the check fails, because an eigenvalue is above the threshold or closer to it than rounding.

    Notes
    -----
    Let B be threshold - sign * matrix, in which the ``vectors`` (approximate eigenvectors of the given values) and the
    deflated direction are moved to large eigenvalues. If the factorisation B = R^T R completes, R^T R = B + E with
    \|E\| <= gamma_{n+3} \| |R^T| |R| \| <= gamma_{n+3} \| |R| \|_1 \| |R| \|_inf in the spectral norm and
    gamma_k = k u / (1 - k u), for every order of summation and pivots by their reciprocals. Hence x^T B x >= -margin
    for all unit x. For x orthogonal to the vectors, x^T B x is threshold - sign * x^T S x. By the minimax principle no
    other eigenvalue exceeds threshold + margin.

    Source: N. J. Higham, *Accuracy and Stability of Numerical Algorithms* (2nd ed. 2002), Theorem 10.3.
    """
    from scipy.linalg import get_lapack_funcs
    from scipy.linalg.blas import dsyr2, dsyrk
    from scipy.linalg.lapack import dpotrf

    size, roots = len(matrix.array), np.sqrt(sign * values + 1.0 + np.abs(values).max(initial=0.0))
    moved = vectors * roots
    # one triangle is used, in the order of BLAS
    shifted = np.multiply(matrix.array, -sign).T
    np.einsum("ii->i", shifted)[:] += threshold
    if matrix.constant is not None and matrix.image is not None:
        dsyr2(sign, matrix.constant, matrix.image, lower=1, a=shifted, overwrite_a=1)
        moved = np.column_stack([moved, matrix.constant * np.sqrt(1.0 + abs(threshold))])
    if moved.shape[1]:
        dsyrk(1.0, moved, beta=1.0, c=shifted, lower=1, overwrite_c=1)
    factor, failed = dpotrf(shifted, lower=1, clean=1, overwrite_a=1)
    if failed:
        return None
    terms = (size + PIVOT_ROUNDINGS) * UNIT_ROUNDOFF
    norm: Any = get_lapack_funcs("lange", (factor,))
    one_norm, largest_row = norm("1", factor), norm("I", factor)
    # | |S| | <= |S|_F; the norm of a rank one update is the product of the norms of its vectors
    parts = float(np.linalg.norm(matrix.array)) + abs(threshold) + float(np.sum(moved**2))
    if matrix.image is not None:
        parts += 2.0 * float(np.linalg.norm(matrix.image))
    entries = (ENTRY_ROUNDINGS + moved.shape[1]) * UNIT_ROUNDOFF * parts
    return float(terms / (1.0 - terms) * one_norm * largest_row + entries)


Parity = Literal["even", "odd", "none"]
# Larger entries of the reflection matrix count as 1 in modulus: the reflection permutes the basis up to signs.
ENTRY = 0.5


def parity_basis(basis: Basis, law: Law | KernelMatrix) -> ParityBasis | None:
    """Orthonormal even and odd functions in a basis, as sparse arrays of shapes (n, even) and (n, odd).

    None if the law is not known to be mirror-symmetric, or the reflection does not preserve the basis.

    Examples
    --------
    >>> from asperity.kernels import Legendre, lambertian
    >>> [half.shape for half in parity_basis(Legendre(5), lambertian())]
    [(5, 3), (5, 2)]
    """
    if not law.mirror_symmetric or not is_mirror_symmetric(basis):
        return None
    here = np.arange(basis.size)
    if isinstance(basis, Bins):
        # the reflection reverses the bins; no large matrix is needed
        image, sign = here[::-1], np.ones(basis.size)
    else:
        flip = reflection_matrix(basis)
        image = np.argmax(np.abs(flip), axis=1)
        sign = flip[here, image]
    if np.any(np.abs(sign) < ENTRY) or np.any(image[image] != here):
        return None
    from scipy.sparse import csr_array

    def columns(alone: NDArray[np.bool_], factor: float) -> csr_array[Any]:
        """The functions of one parity: those equal to their image, and sums of the others with their images."""
        single, first = here[alone], here[image > here]
        weight = np.full(len(first), np.sqrt(0.5))
        rows = np.concatenate([single, first, image[first]])
        pair = len(single) + np.arange(len(first))
        entries = np.concatenate([np.ones(len(single)), weight, factor * weight * np.sign(sign[first])])
        where = np.concatenate([np.arange(len(single)), pair, pair])
        return csr_array((entries, (rows, where)), shape=(basis.size, len(single) + len(first)))

    return columns((image == here) & (sign > 0.0), 1.0), columns((image == here) & (sign < 0.0), -1.0)


def extremal_by_parity(
    array: Floats, split: ParityBasis | None, constant: Floats | None, k: int, which: Which = "moduli"
) -> tuple[ExtremalEigenvalues, tuple[Parity, ...]]:
    """The result of `extremal` for the symmetric part of a matrix, with the parities of the eigenvectors.

    A mirror-symmetric law does not mix even and odd functions. Two matrices of half the size take a quarter of the
    work; noise between the parities in a sampled matrix is omitted. ``split`` is the result of `parity_basis`.
    """
    if split is None:
        found = extremal(symmetric_half(array), constant, k, which)
        nothing: Parity = "none"
        return found, (nothing,) * len(found.values)
    parts: list[tuple[ExtremalEigenvalues, csr_array[Any], Parity]] = []
    names: tuple[Parity, Parity] = ("even", "odd")
    for half, name in zip(split, names, strict=True):
        if half.shape[1]:
            inside = None if constant is None or name == "odd" else np.asarray(half.T @ constant)
            parts.append((extremal(compressed(array, half.T.tocsr()), inside, k, which), half, name))
    return _merged(parts, k, which)


def _merged(
    parts: list[tuple[ExtremalEigenvalues, csr_array[Any], Parity]], k: int, which: Which
) -> tuple[ExtremalEigenvalues, tuple[Parity, ...]]:
    """The k wanted eigenvalues of the even and odd parts together, from the k wanted ones of each."""
    values = np.concatenate([part.values for part, _, _ in parts])
    vectors = np.concatenate([half @ part.vectors for part, half, _ in parts], axis=1)
    residuals = np.concatenate([part.residuals for part, _, _ in parts])
    errors = np.concatenate([part.errors for part, _, _ in parts])
    names = np.repeat([name for _, _, name in parts], [len(part.values) for part, _, _ in parts])
    order = np.argsort(-values, kind="stable")
    order = order[wanted(values[order], k, which)]
    methods = dict.fromkeys(part.method for part, _, _ in parts)
    values = values[order]
    top = counted_from_above(values, which)
    found = ExtremalEigenvalues(values, vectors[:, order], top, residuals[order], errors[order], "; ".join(methods))
    return found, tuple(names[order].tolist())
