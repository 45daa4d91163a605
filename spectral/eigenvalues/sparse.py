"""The largest eigenvalues of large symmetric matrices, complete by a count."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.checks import Floats, Rng, finite_array, frozen, generator, whole_number
from ...core.errors import AccuracyError, InputError
from ...core.rounding import EPS
from ...kernels import KernelMatrix
from .dense import ExtremalEigenvalues, extremal, symmetric_half
from .parity import Parity, extremal_by_parity, parity_basis

if TYPE_CHECKING:
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import LinearOperator, SuperLU

# Additional vectors of the block; it converges at the rate of the distance to the first value beyond the block.
GUARD = 12
# Relative distance of the shift from the bound of the largest eigenvalue. A solve then loses half of the digits only;
# Rayleigh-Ritz separates values closer than this.
SHIFT = 1e-9
MOST_ITERATIONS, CONVERGED = 300, 64.0
# Width of an acceptable gap below the k-th value, as a fraction of the widest.
WIDE_GAP = 0.25
# Least width of the gap of a reliable count, in margins of rounding.
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
        Bound, to rounding, of the distance of every value from the eigenvalue of its rank.
    complete : bool
        Whether no larger eigenvalue is missing, by a check in floating point with rounding bounds.
    counted : int
        Number of eigenvalues above ``threshold``, by the signs of a factorisation; -1 without a factorisation. For
        dense matrices the number of listed values: no others are above ``threshold``, the last value, plus ``margin``.
    threshold, margin : float
        The factorised matrix differs from S - threshold by at most ``margin`` in norm.
    method : str
    parity : tuple of {"even", "odd"}
        Parities of the eigenvectors for a `KernelMatrix` of a mirror-symmetric law, otherwise empty.
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
    matrix: KernelMatrix | Floats | LinearOperator | Any, k: int, rng: Rng = None
) -> LeadingEigenvalues:
    r"""The k largest eigenvalues of a symmetric matrix of norm about 1, with a check of completeness.

    Parameters
    ----------
    matrix : KernelMatrix, array, scipy sparse array or LinearOperator
        A symmetric matrix in an orthonormal basis; for a reversible stochastic P with the invariant weights w it is
        W^(1/2) P W^(-1/2).
    k : int
        Number of eigenvalues. A cluster at the end is not cut, so there may be a few more.
    rng : None, int or numpy.random.Generator
        Source of the initial vectors.

    Returns
    -------
    LeadingEigenvalues

    Raises
    ------
    InputError
        If the matrix is not square or not symmetric.
    AccuracyError
        If the values do not converge, or the count contradicts them.

    Notes
    -----
    Sparse matrices: a block of vectors is iterated with (sigma - S)^(-1), sigma just above the spectrum, until it
    converges. An LDL^T factorisation without pivoting of S - tau, with tau in a gap below the k-th value, has as many
    positive pivots as S has eigenvalues above tau (Sylvester). The difference of the product of the factors from
    S - tau bounds the displacement of the counted spectrum. Dense matrices: see `asperity.spectral.eigenvalues.dense`.
    A LinearOperator cannot be factorised: ``complete`` is False, and only the residuals are known.

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
    source = generator(rng, 0)
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
    # the largest sum of moduli in a row bounds the eigenvalues
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
    # the number of values equals the count, so each has its own eigenvalue within the joint residual
    error = float(np.linalg.norm(residuals)) + 8.0 * EPS * top
    return LeadingEigenvalues(
        frozen(values[:number]), frozen(leading), frozen(residuals), error, True, counted, float(threshold), margin,
        f"block inverse iteration, {counted} eigenvalues above {threshold:.12g} by the signs of LDL^T",
    )  # fmt: skip


def _block_iteration(
    matrix: csc_array[Any], inverse: Callable[[Floats], Floats], k: int, rng: np.random.Generator
) -> tuple[Floats, Floats, int, float]:
    """Ritz values (descending) and vectors of a block, the number of wanted ones, and the gap below these."""
    size = matrix.shape[0]
    block = np.linalg.qr(rng.normal(size=(size, k + GUARD)))[0]
    worst = np.inf
    for _ in range(MOST_ITERATIONS):
        block = np.linalg.qr(inverse(block))[0]
        values, turn = np.linalg.eigh(block.T @ (matrix @ block))
        values, block = values[::-1], block @ turn[:, ::-1]
        # cut at the first sufficiently wide gap below k, so that no cluster is cut
        drops = (values[k - 1 : -1] - values[k:])[: GUARD - 2]
        number = k + int(np.argmax(drops >= WIDE_GAP * drops.max()))
        leading = block[:, :number]
        worst = float(np.linalg.norm(matrix @ leading - leading * values[:number], axis=0).max())
        if worst <= CONVERGED * EPS:
            return values, block, number, float(drops[number - k])
    if worst <= 1e-3 * float(drops[number - k]):
        return values, block, number, float(drops[number - k])
    raise AccuracyError(
        f"{MOST_ITERATIONS} inverse iterations left a residual of {worst:.2g}; ask for a larger k", worst
    )


def _factorised(matrix: csc_array[Any], shift: float, sign: float) -> SuperLU:
    """LU factors of sign * (matrix - shift) with symmetric permutations only, equivalent to LDL^T."""
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    shifted = (sign * (matrix - shift * eye_array(matrix.shape[0]))).tocsc()
    return splu(
        shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
    )


def _count_above(matrix: csc_array[Any], threshold: float) -> tuple[int, float]:
    """The number of eigenvalues above the threshold, and the norm of the error of the factorisation."""
    from scipy.sparse import csc_array, eye_array

    factors = _factorised(matrix, threshold, 1.0)
    if not np.array_equal(factors.perm_r, factors.perm_c):
        raise AccuracyError("a pivot of the factorisation vanished: move the threshold by asking for another k", 0.0)
    pivots = factors.U.diagonal()
    size = matrix.shape[0]
    order = np.argsort(factors.perm_c)
    shifted = csc_array(matrix - threshold * eye_array(size))[order][:, order]
    difference = abs(factors.L @ factors.U - shifted)
    # the spectral norm is at most the root of the product of both sums
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
