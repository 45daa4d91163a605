"""Check, in floating point with rounding bounds, that a symmetric matrix has no eigenvalues beyond the known ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.checks import Floats
from ...core.rounding import UNIT_ROUNDOFF

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
