"""Splitting the constant function off a Markov operator, and the eigenvalues of the rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..checks import Floats

if TYPE_CHECKING:
    from ..kernels import KernelMatrix


def off_constants(array: Floats, constant: Floats) -> tuple[Floats, Floats]:
    """All eigenvalues (ascending) and eigenvectors of a symmetric matrix on the complement of a unit vector.

    The complement is reached by a Householder reflection that takes the vector to the first axis; so neither the
    multiplicity of the eigenvalue 1 nor noise in the rows can mix constants into the rest.
    """
    from scipy.linalg import eigh

    reflector = _householder(constant)
    turned = _reflect(reflector, _reflect(reflector, array).T)
    values, inner = eigh(0.5 * (turned + turned.T)[1:, 1:])
    vectors = np.vstack([np.zeros((1, inner.shape[1])), inner])
    return np.asarray(values), _reflect(reflector, vectors)


def coarser_grids(matrix: KernelMatrix, levels: int) -> list[Floats]:
    """Eigenvalues off the constants (ascending) on successively coarser bases, as many as the basis has."""
    from scipy.sparse import csr_array

    found: list[Floats] = []
    basis, array = matrix.basis, 0.5 * (matrix.symmetric + matrix.symmetric.T)
    for _ in range(levels):
        coarser = basis.coarsened()
        if coarser is None:
            break
        basis, embedding = coarser[0], csr_array(coarser[1])
        array = np.asarray(embedding @ array @ embedding.T)
        found.append(off_constants(array, np.asarray(basis.constant))[0])
    return found


def _householder(unit: Floats) -> Floats:
    """The unit vector v for which I - 2 v v^T takes ``unit`` to plus or minus the first axis."""
    v = np.array(unit, dtype=np.float64)
    v[0] += 1.0 if v[0] >= 0.0 else -1.0
    return np.asarray(v / np.linalg.norm(v))


def _reflect(v: Floats, array: Floats) -> Floats:
    return np.asarray(array - 2.0 * np.outer(v, v @ array))
