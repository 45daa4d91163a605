"""Proof by factorisation that a symmetric matrix has no eigenvalue beyond those that are known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.checks import Floats
from ...core.rounding import UNIT_ROUNDOFF

# Roundings of an entry of the shifted matrix, beside one for each vector that is moved: its product with the sign, the
# shift, and two products and sums of the deflation.
ENTRY_ROUNDINGS = 6
# Of gamma_{n+1} the one beyond n is the division by a pivot; where BLAS multiplies by its reciprocal it is one more,
# and one is for the square root.
PIVOT_ROUNDINGS = 3


@dataclass(frozen=True)
class Deflated:
    """The symmetric S, or for a unit vector c the matrix (I - c c^T) S (I - c c^T), which is not formed.

    It is S - c u^T - u c^T with u = S c - (c^T S c) c / 2. The eigenvalue at c is 0.
    """

    array: Floats
    constant: Floats | None
    image: Floats | None

    @classmethod
    def of(cls, array: Floats, constant: Floats | None) -> Deflated:
        """The matrix without the direction of ``constant``."""
        if constant is None:
            return cls(array, None, None)
        image = array @ constant
        return cls(array, constant, image - 0.5 * (constant @ image) * constant)

    def __matmul__(self, block: Floats) -> Floats:
        from scipy.linalg.blas import dsymv

        # of a symmetric matrix the transpose is the same and, for BLAS, in the right order; one triangle is read
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
        # S c = u + (c^T u) c, of which u - (c^T u) c is off c
        return float(np.sqrt(max(square - 2.0 * rest - 4.0 * along**2, 0.0)))


def norm_beyond(matrix: Deflated, values: Floats) -> float:
    """A bound for the moduli of all eigenvalues but the listed ones, which are Ritz values: by Frobenius norms.

    On orthonormal vectors V with V^T S V = diag(values) the squared norm of S is at least the sum of the squares of the
    values plus that of the compression to the complement of V.
    """
    square = matrix.frobenius**2
    # sums of n^2 squares, in any order
    rounding = 2.0 * matrix.array.size * UNIT_ROUNDOFF * float(np.vdot(matrix.array, matrix.array))
    return float(np.sqrt(max(square - float(values @ values), 0.0) + rounding))


def margin_below(matrix: Deflated, sign: float, vectors: Floats, values: Floats, threshold: float) -> float | None:
    r"""How far above ``threshold`` the eigenvalues of sign * matrix off the ``vectors`` may lie at most.

    None where the proof fails: some of them are above, or nearer than rounding.

    Notes
    -----
    B = threshold - sign * matrix is made, with the vectors (approximate eigenvectors of the given values) and the
    deflated direction moved far up, and factorised as B = R^T R. If that runs to completion then R^T R = B + E with
    \|E\| <= gamma_{n+3} \| |R^T| |R| \| <= gamma_{n+3} \| |R| \|_1 \| |R| \|_inf in the spectral norm and
    gamma_k = k u / (1 - k u), for every order of summation and pivots by their reciprocals. So x^T B x >= -margin for
    all unit x, and for x orthogonal to the vectors x^T B x is threshold - sign * x^T S x: by the minimax principle
    nothing else lies above.

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
    # | |S| | <= |S|_F; a rank one update has the norm of its vectors
    parts = float(np.linalg.norm(matrix.array)) + abs(threshold) + float(np.sum(moved**2))
    if matrix.image is not None:
        parts += 2.0 * float(np.linalg.norm(matrix.image))
    entries = (ENTRY_ROUNDINGS + moved.shape[1]) * UNIT_ROUNDOFF * parts
    return float(terms / (1.0 - terms) * one_norm * largest_row + entries)
