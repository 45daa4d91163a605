"""The collision law K on a product of bases in theta and psi, as a factored scipy LinearOperator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import LinearOperator

from ...core.checks import Floats
from ...core.errors import InputError
from ..bases.basis import Basis
from ..bases.mirror import reflection_matrix

if TYPE_CHECKING:
    from ..matrices.defects import SymmetryDefect
    from ..matrices.matrix import KernelMatrix


class CollisionOperator(LinearOperator):
    """The operator K = P~ (x) J_psi, symmetric with respect to Lambda^2 if P~ is symmetric.

    Vectors hold coefficients in the orthonormal product basis e_i(theta) f_j(psi); the index of psi runs fastest.

    Parameters
    ----------
    theta_matrix : KernelMatrix
        P~ in a basis for sin(theta).
    psi_basis : Basis
        A basis for sin(psi)^2.
    """

    def __init__(self, theta_matrix: KernelMatrix, psi_basis: Basis) -> None:
        if theta_matrix.basis.measure.name != "sin":
            raise InputError("theta_basis: expected a basis for sin(theta), got one with weight 'sin2'")
        if psi_basis.measure.name != "sin2":
            raise InputError("psi_basis: expected a basis for sin(psi)^2, such as Legendre(n, weight='sin2')")
        self.theta_matrix = theta_matrix
        self.psi_basis = psi_basis
        self.flip = reflection_matrix(psi_basis)
        size = theta_matrix.basis.size * psi_basis.size
        super().__init__(np.dtype(np.float64), (size, size))  # type: ignore[call-arg]

    def _split(self, vector: Floats) -> Floats:
        return np.asarray(vector).reshape(self.theta_matrix.basis.size, self.psi_basis.size)

    def _matvec(self, vector: Floats) -> Floats:
        return np.asarray(self.theta_matrix.symmetric @ self._split(vector) @ self.flip.T).ravel()

    def _rmatvec(self, vector: Floats) -> Floats:
        return np.asarray(self.theta_matrix.symmetric.T @ self._split(vector) @ self.flip).ravel()

    def dense(self) -> Floats:
        """The full matrix, shape (n, n), where n is the product of the two sizes."""
        return np.asarray(np.kron(self.theta_matrix.symmetric, self.flip), dtype=np.float64)

    def symmetry_defect(self) -> SymmetryDefect:
        """The asymmetry of K with respect to Lambda^2, equal to that of P~ because J_psi is exactly symmetric."""
        return self.theta_matrix.symmetry_defect()
