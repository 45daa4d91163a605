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
# Roundings of an entry of S - V diag(values) V^T, without one for each product: values, last sum, transpose and spare.
FORM_ROUNDINGS = 4
# Rows and columns of a block whose norm is bounded, and single precision.
BLOCK = 512
SINGLE_ROUNDOFF, SMALLEST_SINGLE = 2.0**-24, 2.0**-126
SMALLEST_NORM = 1e-140


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


def block_norm_beyond(matrix: Deflated, vectors: Floats, values: Floats) -> float:
    r"""A bound of the moduli of all eigenvalues other than the listed Ritz values, from norms of blocks.

    It needs a fraction of the work of two factorisations and is sharp enough where the other eigenvalues are far from
    the listed ones, as in matrices of sampled rays.

    Notes
    -----
    Let R = S - V diag(values) V^T. For x orthogonal to V, x^T S x = x^T R x, so by the minimax principle at most as
    many eigenvalues as V has columns exceed the norm of R in modulus. If N_ij bounds the spectral norm of the block
    R_ij, the norm of R is at most that of N, because abs(x^T R x) <= sum_ij |x_i| N_ij |x_j|. For a block B with the
    Gram matrix G = B^T B, \|B\|^4 = \|G^2\| <= \|G^2\|_F. The products are in single precision with the unit
    roundoff u: for every order of summation \|fl(B^T B) - B^T B\|_F <= gamma_b \|B\|_F^2 with gamma_b = b u/(1 - b u),
    plus b^2 results that may underflow, each by b times the least normal number. The blocks are divided by their
    Frobenius norms.

    Source: N. J. Higham, *Accuracy and Stability of Numerical Algorithms* (2nd ed. 2002), section 3.5.
    """
    left, right = [vectors * values], [vectors]
    if matrix.constant is not None and matrix.image is not None:
        left += [matrix.constant[:, None], matrix.image[:, None]]
        right += [matrix.image[:, None], matrix.constant[:, None]]
    one, other = np.column_stack(left), np.column_stack(right)
    starts = range(0, len(matrix.array), BLOCK)
    norms = np.empty((len(starts), len(starts)))
    for row, first in enumerate(starts):
        for column, second in enumerate(starts[: row + 1]):
            here, there = slice(first, first + BLOCK), slice(second, second + BLOCK)
            block = matrix.array[here, there] - one[here] @ other[there].T
            norms[row, column] = norms[column, row] = _norm_of_block(block)
    # the sums of an entry of R, and the largest eigenvalue of N
    parts = float(np.linalg.norm(matrix.array)) + float(np.linalg.norm(one, axis=0) @ np.linalg.norm(other, axis=0))
    rounding = (one.shape[1] + FORM_ROUNDINGS) * UNIT_ROUNDOFF * parts
    largest = float(np.linalg.eigvalsh(norms)[-1])
    return float(largest + len(norms) ** 2 * UNIT_ROUNDOFF * float(np.linalg.norm(norms)) + rounding)


def _norm_of_block(block: Floats) -> float:
    """A bound of the spectral norm: the fourth root of the Frobenius norm of the squared Gram matrix."""
    size = max(block.shape)
    scale = float(np.linalg.norm(block))
    if scale <= SMALLEST_NORM:
        # squares may underflow
        return float(size * np.abs(block).max())
    single = (block / scale).astype(np.float32)
    terms = (size + 2) * SINGLE_ROUNDOFF
    gamma, underflow = terms / (1.0 - terms), float(size**2) * size * SMALLEST_SINGLE
    gram = single.T @ single
    square = gram.T @ gram
    length = float(np.linalg.norm(gram.astype(np.float64)))
    fourth = float(np.linalg.norm(square.astype(np.float64))) + gamma * length**2 + underflow
    # the Frobenius norm of the rounded block is 1 to a few roundings; gamma covers the rounding of the block as well
    bound = np.sqrt(np.sqrt(fourth) + gamma * (1.0 + gamma) + underflow) + gamma
    # three Frobenius norms of size^2 entries
    return float(scale * bound * (1.0 + 3.0 * size**2 * UNIT_ROUNDOFF))


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
