"""The collision law K as an operator: factored, on a product of bases, or as a matrix of the velocity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator

from ...core.checks import Floats, instance
from ...core.errors import InputError
from ...geometry.disk.disk import Disk, branch_block
from ..bases.assembly import reflection_matrix
from ..bases.basis import Basis, checked_basis
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
        checked_basis(psi_basis)
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


def smooth_matrix(disk: Disk) -> Floats:
    """The 3x3 matrix A_smooth of a smooth collision, which reverses v2 and leaves v1 and omega unchanged.

    It is the law K of specular reflection. Source: Rudzis 2022, eq. 2.25.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> (smooth_matrix(geo.Disk()).round(12) + 0.0).tolist()
    [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    return isometry_matrix(disk, -1.0, np.pi)


def no_slip_matrix(disk: Disk) -> Floats:
    """The 3x3 matrix A_no-slip = 2 chi chi^T - I (kinetic-energy metric), which reverses v2 and the slip v1 + r omega.

    It is the law K of retroreflection. Source: Rudzis 2022, eq. 2.25.

    Examples
    --------
    >>> from asperity import geometry as geo
    >>> (3 * no_slip_matrix(geo.Disk(mass=1.0, inertia_ratio=0.5))).round(12).tolist()
    [[1.0, 0.0, -2.0], [0.0, -3.0, 0.0], [-4.0, 0.0, -1.0]]
    """
    return isometry_matrix(disk, 1.0, 0.0)


def isometry_matrix(disk: Disk, sign: ArrayLike, offset: ArrayLike, flip: bool = True) -> Floats:
    """The velocity matrix of theta' = sign theta + offset, psi' = pi - psi; shape ``sign.shape + (3, 3)``.

    It maps the true incoming velocity (v2 < 0) to the outgoing one and preserves the kinetic energy and the rolling
    momentum -m v1 + J omega/r. Without ``flip``, psi' = psi, and the rolling momentum is reversed. Rudzis 2022, section
    2.3.2, omits the matrix for triangular teeth.
    """
    sign, offset = np.broadcast_arrays(np.asarray(sign, dtype=np.float64), np.asarray(offset, dtype=np.float64))
    inner = np.zeros((*sign.shape, 3, 3))
    for row, entries in enumerate(branch_block(sign, np.cos(offset), np.sin(offset))):
        for column, entry in enumerate(entries):
            inner[..., row, column] = entry
    inner[..., 2, 2] *= 1.0 if flip else -1.0
    instance("disk", disk, Disk, "geo.Disk()")
    frame = np.asarray(disk.frame)
    metric = np.array([disk.mass, disk.mass, disk.rim_mass])
    return np.asarray(frame.T @ inner @ (frame * metric))
