"""The largest eigenvalues of large symmetric matrices, with a count that proves that none is missed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import Floats, finite_array, frozen, whole_number
from ...core.errors import AccuracyError, InputError
from ...core.rounding import EPS
from ...kernels import KernelMatrix
from .dense import ExtremalEigenvalues, extremal, symmetric_half
from .parity import Parity, extremal_by_parity, parity_basis

if TYPE_CHECKING:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import LinearOperator, SuperLU

# Vectors carried beyond those asked for: the block converges as fast as the first value beyond it is far away.
GUARD = 12
# Of the shift beyond the largest eigenvalue that a matrix of norm 1 can have: a solve then loses half of the digits
# only, and values within it of each other are told apart by Rayleigh and Ritz.
SHIFT = 1e-9
MOST_ITERATIONS, SETTLED = 300, 64.0
# Fraction of the widest gap below the k-th value that another must have to be cut in.
WIDE_GAP = 0.25
# Gaps between neighbouring values must be this many rounding margins wide for a count between them to mean anything.
MARGINS = 4.0


@dataclass(frozen=True)
class LeadingEigenvalues:
    """The k largest eigenvalues of a symmetric matrix.

    Attributes
    ----------
    values : array of shape (k,)
        Descending.
    vectors : array of shape (n, k)
        Orthonormal.
    residuals : array of shape (k,)
        ||S v - lambda v||.
    error : float
        Bound, to rounding: every value is this near the eigenvalue of its rank.
    complete : bool
        Whether the count proves that no larger eigenvalue is missing.
    counted : int
        Eigenvalues above ``threshold``, by the signs of a factorisation; -1 where none was made. Of dense matrices the
        number of those that are listed: no more are above ``threshold``, the last of them, plus ``margin``.
    threshold, margin : float
        The matrix that was factorised differs from S - threshold by at most ``margin`` in norm.
    method : str
    parity : tuple of {"even", "odd"}
        Of the eigenvectors of a `KernelMatrix` of a mirror-symmetric law, which is solved in two halves; else empty.
    """

    values: Floats
    vectors: Floats
    residuals: Floats
    error: float
    complete: bool
    counted: int
    threshold: float
    margin: float
    method: str
    parity: tuple[Parity, ...] = ()


def leading_eigenvalues(
    matrix: KernelMatrix | Floats | LinearOperator | Any, k: int, rng: np.random.Generator | None = None
) -> LeadingEigenvalues:
    r"""The k largest eigenvalues of a symmetric matrix of norm about 1, proved to be the k largest.

    Parameters
    ----------
    matrix : KernelMatrix, array, scipy sparse array or LinearOperator
        Symmetric in an orthonormal basis: for a reversible stochastic P with the invariant weights w this is
        W^(1/2) P W^(-1/2).
    k : int
        How many; a cluster that k would cut is taken in whole, so that there may be a few more.
    rng : numpy.random.Generator, optional
        For the vectors to start from.

    Returns
    -------
    LeadingEigenvalues

    Raises
    ------
    InputError
        If the matrix is not square or not symmetric.
    AccuracyError
        If the values do not converge, or the count disagrees with them: some would be missing or wrong.

    Notes
    -----
    Sparse matrices: blocks of vectors are multiplied by (sigma - S)^(-1), sigma just above the spectrum, until they
    settle, and an LDL^T factorisation without pivoting of S - tau, tau in a gap below the k-th value, has as many
    positive pivots as S has eigenvalues above tau (Sylvester). The factors are multiplied out: the difference from
    S - tau bounds how far the counted spectrum is moved. Dense matrices: see `asperity.spectral.eigenvalues.dense`.
    For a LinearOperator nothing can be factorised: ``complete`` is False, and the residuals are all that is known.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy.sparse import diags_array
    >>> found = leading_eigenvalues(diags_array(np.linspace(0.0, 1.0, 500)), 2)
    >>> found.values[:2].round(12).tolist(), found.complete
    ([1.0, 0.997995991984], True)
    """
    from scipy.sparse import issparse
    from scipy.sparse.linalg import LinearOperator

    whole_number("k", k, 1)
    source = np.random.default_rng(0) if rng is None else rng
    if isinstance(matrix, KernelMatrix):
        found, parity = extremal_by_parity(matrix.symmetric, parity_basis(matrix.basis, matrix), None, k, "largest")
        return _listed(found, parity if "none" not in parity else ())
    if isinstance(matrix, LinearOperator):
        return _matrix_free(matrix, k, source)
    if issparse(matrix):
        return _sparse(_checked(matrix), k, source)
    array = finite_array("matrix", matrix)
    if array.ndim != 2 or array.shape[0] != array.shape[1]:
        raise InputError(f"matrix: expected a square array, got shape {array.shape}")
    _check_symmetric(float(np.abs(array - array.T).max()), float(np.abs(array).max()))
    return _dense(array, k)


def _dense(array: Floats, k: int) -> LeadingEigenvalues:
    return _listed(extremal(symmetric_half(array), None, k, "largest"), ())


def _listed(found: ExtremalEigenvalues, parity: tuple[Parity, ...]) -> LeadingEigenvalues:
    number = len(found.values)
    return LeadingEigenvalues(
        frozen(found.values), frozen(found.vectors), frozen(found.residuals), float(found.errors.max(initial=0.0)),
        True, number, float(found.values.min(initial=np.inf)), float(found.errors.max(initial=0.0)), found.method,
        parity,
    )  # fmt: skip


def _sparse(matrix: csc_array[Any], k: int, rng: np.random.Generator) -> LeadingEigenvalues:
    size = matrix.shape[0]
    if size <= 4 * (k + GUARD):
        return _dense(matrix.toarray(), k)
    # no eigenvalue is above the largest sum of moduli in a row
    top = float(np.max(abs(matrix).sum(axis=1)))
    inverse = _factorised(matrix, top * (1.0 + SHIFT), -1.0).solve
    values, vectors, number, gap = _block_iteration(matrix, inverse, k, rng)
    leading = vectors[:, :number]
    residuals = np.linalg.norm(matrix @ leading - leading * values[:number], axis=0)
    threshold = 0.5 * (values[number - 1] + values[number])
    counted, margin = _count_above(matrix, threshold)
    if MARGINS * margin > gap:
        raise AccuracyError(
            f"values {number} and {number + 1} are {gap:.2g} apart, and the count between them has a rounding margin "
            f"of {margin:.2g}: no completeness can be claimed; ask for another k",
            margin,
        )
    if counted != number:
        raise AccuracyError(
            f"{counted} eigenvalues lie above {threshold:.15g}, but {number} were found there: the block has missed "
            "some; ask for more with a larger k",
            abs(counted - number),
        )
    # as many values as the count has, each with an eigenvalue of its own within the joint residual
    error = float(np.linalg.norm(residuals)) + 8.0 * EPS * top
    return LeadingEigenvalues(
        frozen(values[:number]), frozen(leading), frozen(residuals), error, True, counted, float(threshold), margin,
        f"block inverse iteration, {counted} eigenvalues above {threshold:.12g} by the signs of LDL^T",
    )  # fmt: skip


def _block_iteration(
    matrix: csc_array[Any], inverse: Callable[[Floats], Floats], k: int, rng: np.random.Generator
) -> tuple[Floats, Floats, int, float]:
    """Ritz values (descending) and vectors of a block, how many of them are wanted, and the gap below these."""
    size = matrix.shape[0]
    block = np.linalg.qr(rng.normal(size=(size, k + GUARD)))[0]
    worst = np.inf
    for _ in range(MOST_ITERATIONS):
        block = np.linalg.qr(inverse(block))[0]
        values, turn = np.linalg.eigh(block.T @ (matrix @ block))
        values, block = values[::-1], block @ turn[:, ::-1]
        # cut below k at the first gap that is about as wide as any, so that no cluster is cut
        drops = (values[k - 1 : -1] - values[k:])[: GUARD - 2]
        number = k + int(np.argmax(drops >= WIDE_GAP * drops.max()))
        leading = block[:, :number]
        worst = float(np.linalg.norm(matrix @ leading - leading * values[:number], axis=0).max())
        if worst <= SETTLED * EPS:
            return values, block, number, float(drops[number - k])
    if worst <= 1e-3 * float(drops[number - k]):
        return values, block, number, float(drops[number - k])
    raise AccuracyError(
        f"{MOST_ITERATIONS} inverse iterations left a residual of {worst:.2g}; ask for a larger k", worst
    )


def _factorised(matrix: csc_array[Any], shift: float, sign: float) -> SuperLU:
    """LU of sign * (matrix - shift) with symmetric permutations only, so that it is an LDL^T."""
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    shifted = (sign * (matrix - shift * eye_array(matrix.shape[0]))).tocsc()
    return splu(
        shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
    )


def _count_above(matrix: csc_array[Any], threshold: float) -> tuple[int, float]:
    """Eigenvalues above the threshold and how far, in norm, the factorised matrix is from the one asked for."""
    from scipy.sparse import csc_array, eye_array

    factors = _factorised(matrix, threshold, 1.0)
    if not np.array_equal(factors.perm_r, factors.perm_c):
        raise AccuracyError("a pivot of the factorisation vanished: move the threshold by asking for another k", 0.0)
    pivots = factors.U.diagonal()
    size = matrix.shape[0]
    order = np.argsort(factors.perm_c)
    shifted = csc_array(matrix - threshold * eye_array(size))[order][:, order]
    difference = abs(factors.L @ factors.U - shifted)
    # of a matrix that is symmetric but for rounding the norm is at most the root of both sums
    margin = float(np.sqrt(difference.sum(axis=0).max() * difference.sum(axis=1).max())) + size * EPS * EPS
    return int(np.sum(pivots > 0.0)), margin


def _matrix_free(operator: LinearOperator, k: int, rng: np.random.Generator) -> LeadingEigenvalues:
    from scipy.sparse.linalg import eigsh

    size = operator.shape[0]
    if operator.shape[0] != operator.shape[1] or k >= size:
        raise InputError(f"matrix: expected a square operator of more than {k} rows, got shape {operator.shape}")
    first, second = rng.normal(size=(2, size))
    _check_symmetric(abs(float(first @ operator.matvec(second) - second @ operator.matvec(first))) / size, 1.0)
    values, vectors = eigsh(operator, k=k, which="LA", ncv=min(size, max(4 * k, 40)), tol=0.0, v0=first)
    order = np.argsort(-values)
    values, vectors = values[order], np.linalg.qr(vectors[:, order])[0]
    residuals = np.linalg.norm(operator.matmat(vectors) - vectors * values, axis=0)
    return LeadingEigenvalues(
        frozen(values), frozen(vectors), frozen(residuals), np.inf, False, -1, np.nan, np.nan,
        "Lanczos; nothing to factorise, so copies of multiple eigenvalues and whole clusters may be missing",
    )  # fmt: skip


def _checked(matrix: Any) -> csc_array[Any]:
    from scipy.sparse import csc_array

    found = csc_array(matrix, dtype=np.float64)
    if found.shape[0] != found.shape[1] or not np.all(np.isfinite(found.data)):
        raise InputError(f"matrix: expected a square sparse array of finite numbers, got shape {found.shape}")
    difference = abs(found - found.T)
    _check_symmetric(float(difference.max()) if difference.nnz else 0.0, float(abs(found).max()))
    return found


def _check_symmetric(defect: float, scale: float) -> None:
    if defect > 64.0 * EPS * max(scale, 1.0):
        raise InputError(
            f"matrix: expected a symmetric one, got a defect of {defect:.2g}; of a stochastic P with weights w pass "
            "W^(1/2) P W^(-1/2), or its symmetric half where it was sampled"
        )
