"""The collision law K on a product of bases in theta and psi, as a factored scipy LinearOperator."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import LinearOperator

from ...core.checks import Floats
from ...core.errors import InputError
from ..bases.basis import Basis
from ..bases.mirror import reflection_matrix
from ..matrices.defects import SymmetryDefect, relative_asymmetry

if TYPE_CHECKING:
    from ..matrices.matrix import KernelMatrix


class CollisionOperator(LinearOperator):
    """The operator P~ (x) J_psi + Q~ (x) 1, symmetric with respect to Lambda^2 if P~ and Q~ are symmetric.

    Vectors hold coefficients in the orthonormal product basis e_i(theta) f_j(psi); the index of psi runs fastest.

    Parameters
    ----------
    theta_matrix : KernelMatrix or None
        P~ in a basis for sin(theta); None if every term leaves psi unchanged.
    psi_basis : Basis
        A basis for sin(psi)^2.
    unflipped : KernelMatrix, optional
        Q~ in the same basis, for products of collision laws.
    """

    def __init__(
        self, theta_matrix: KernelMatrix | None, psi_basis: Basis, unflipped: KernelMatrix | None = None
    ) -> None:
        parts = [part for part in (theta_matrix, unflipped) if part is not None]
        if not parts or any(part.basis != parts[0].basis for part in parts):
            raise InputError("theta_matrix: expected one matrix or two in the same basis")
        if parts[0].basis.measure.name != "sin":
            raise InputError("theta_basis: expected a basis for sin(theta), got one with weight 'sin2'")
        if psi_basis.measure.name != "sin2":
            raise InputError("psi_basis: expected a basis for sin(psi)^2, such as Legendre(n, weight='sin2')")
        self.flipped, self.unflipped = theta_matrix, unflipped
        self.theta_basis, self.psi_basis = parts[0].basis, psi_basis
        self.flip = reflection_matrix(psi_basis)
        size = self.theta_basis.size * psi_basis.size
        super().__init__(np.dtype(np.float64), (size, size))  # type: ignore[call-arg]

    @property
    def theta_matrix(self) -> KernelMatrix:
        """P~; raises InputError if every term leaves psi unchanged."""
        if self.flipped is None:
            raise InputError("theta_matrix: no term of this law flips psi; use `unflipped`")
        return self.flipped

    def _terms(self) -> list[tuple[Floats, Floats]]:
        """The matrices in theta and in psi of every term."""
        terms = [] if self.flipped is None else [(self.flipped.symmetric, self.flip)]
        return terms if self.unflipped is None else [*terms, (self.unflipped.symmetric, np.eye(self.psi_basis.size))]

    def _matvec(self, vector: Floats) -> Floats:
        table = vector.reshape(self.theta_basis.size, self.psi_basis.size)
        return np.asarray(sum(first @ table @ second.T for first, second in self._terms())).ravel()

    def _rmatvec(self, vector: Floats) -> Floats:
        table = vector.reshape(self.theta_basis.size, self.psi_basis.size)
        return np.asarray(sum(first.T @ table @ second for first, second in self._terms())).ravel()

    def dense(self) -> Floats:
        """The full matrix, shape (n, n), where n is the product of the two sizes."""
        return np.asarray(sum(np.kron(first, second) for first, second in self._terms()), dtype=np.float64)

    def symmetry_defect(self) -> SymmetryDefect:
        """The asymmetry of the law with respect to Lambda^2; of one term that of its matrix in theta.

        J_psi is exactly symmetric. The full matrix is formed only if there are two terms.
        """
        if self.flipped is not None and self.unflipped is not None:
            return SymmetryDefect(relative_asymmetry(self.dense()))
        only = self.theta_matrix if self.unflipped is None else self.unflipped
        return only.symmetry_defect()
