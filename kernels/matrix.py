"""A kernel as a matrix in an orthonormal basis, with what is known about its error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import Floats, finite_array, finite_number, frozen, whole_number
from ..errors import InputError
from ..estimates import Estimate
from .basis import Basis
from .law import AngleFunction, Frame
from .reflection import reflection_matrix, is_mirror_symmetric
from .symmetry import (
    STOCHASTIC_NORM,
    STOCHASTIC_NORM_CELLS,
    Defect,
    SymmetryDefect,
    relative_asymmetry,
)
from .tensor import TensorBasis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from scipy.sparse import csr_array
    from scipy.sparse.linalg import LinearOperator

    Replicate: TypeAlias = "Floats | csr_array[Any, tuple[int, int]]"


def frobenius_error(error: float, kind: str, method: str) -> Estimate:
    """The Estimate that `KernelMatrix.error` holds: value and error are both the Frobenius error.

    So that the value itself and the half width of the interval around it are the same number.
    """
    return Estimate(error, error, "bound" if kind == "bound" else "estimate", method)


@dataclass(frozen=True, eq=False, repr=False)
class KernelMatrix:
    r"""The matrix of a Markov kernel P in a basis of L^2 of the invariant measure.

    Made by `discretise`, `estimate` or `load_matrix`, and by the algebra: ``P @ Q`` (first P, then Q),
    ``a * P + b * Q``, ``P ** n``, ``P.adjoint()``, ``P.tensor(Q)``, ``P.in_specular_frame()``. The algebra is that of
    the matrices: in general the product of two Galerkin matrices is not the Galerkin matrix of the product.

    Parameters
    ----------
    symmetric : ndarray, shape (n, n)
        <e_i, P e_j> in the orthonormal basis; a symmetric array where the kernel is reversible. Read-only.
    basis : Basis
        The basis, of n functions.
    error : Estimate
        Frobenius error of ``symmetric``, in its ``.value`` (and, being all that is known, in its ``.error`` too).
    counts : ndarray of int64, shape (n, n), optional
        Raw counts of sampled pairs (incoming bin, outgoing bin), before any symmetrisation.
    replicates : tuple of arrays
        ``symmetric`` from independent randomisations, dense or sparse; their mean is ``symmetric``. For errors.
    symmetrised : bool
        Whether each sampled pair was counted both ways.
    samples : int
        Number of sampled pairs, 0 where nothing was sampled.
    method : str
        The method that was used: ``"exact"``, ``"quadrature"``, ``"qmc"``, ``"monte-carlo"``, or how the matrix came.
    law : str
        The law, as its repr.
    reversible, mirror_symmetric : bool or None
        As for a law; None where it is not known.
    frame : {"paper", "specular"}
        The convention; see `in_specular_frame`.
    requested_tolerance : float, optional
        The Frobenius error that was asked for.
    unresolved : float
        Share of the sampled rays that the tracer flagged.
    norm_bound : float
        Upper bound of the operator norm of the exact matrix: 1 for Markov kernels that keep the measure.
    raw_defect : SymmetryDefect, optional
        The symmetry defect of the raw sample, with its z-score.
    metadata : mapping
        Anything else that belongs to the record, as plain JSON values.

    Examples
    --------
    >>> from .bins import Bins
    >>> P = KernelMatrix([[0.75, 0.25], [0.25, 0.75]], Bins(2), frobenius_error(0.0, "bound", "given"))
    >>> (P @ P).array.tolist(), float(P.symmetry_defect())
    ([[0.625, 0.375], [0.375, 0.625]], 0.0)
    """

    symmetric: Floats
    basis: Basis
    error: Estimate
    counts: NDArray[np.int64] | None = field(default=None, kw_only=True)
    replicates: tuple[Replicate, ...] = field(default=(), kw_only=True)
    symmetrised: bool = field(default=False, kw_only=True)
    samples: int = field(default=0, kw_only=True)
    method: str = field(default="given", kw_only=True)
    law: str = field(default="", kw_only=True)
    reversible: bool | None = field(default=None, kw_only=True)
    mirror_symmetric: bool | None = field(default=None, kw_only=True)
    frame: Frame = field(default="paper", kw_only=True)
    requested_tolerance: float | None = field(default=None, kw_only=True)
    unresolved: float = field(default=0.0, kw_only=True)
    norm_bound: float = field(default=1.0, kw_only=True)
    raw_defect: SymmetryDefect | None = field(default=None, kw_only=True)
    metadata: Mapping[str, Any] = field(default_factory=dict, kw_only=True)

    # numpy must leave ``mu @ P`` and ``np.float64(2) * P`` to this class
    __array_ufunc__ = None

    def __post_init__(self) -> None:
        if not isinstance(self.basis, Basis):
            raise InputError(f"basis: expected a basis such as Bins(64), got {self.basis!r}")
        symmetric = finite_array("symmetric", self.symmetric)
        n = self.basis.size
        if symmetric.shape != (n, n):
            raise InputError(f"symmetric: expected shape {(n, n)} for {self.basis!r}, got {symmetric.shape}")
        if not isinstance(self.error, Estimate):
            raise InputError(f"error: expected an Estimate, got {self.error!r}")
        object.__setattr__(self, "symmetric", frozen(symmetric))
        if self.counts is not None:
            counts = np.array(self.counts, dtype=np.int64)
            if counts.shape != (n, n):
                raise InputError(f"counts: expected shape {(n, n)}, got {counts.shape}")
            counts.setflags(write=False)
            object.__setattr__(self, "counts", counts)

    # ---- the arrays ------------------------------------------------------------------------------------------
    @property
    def size(self) -> int:
        """Number of basis functions."""
        return self.basis.size

    @property
    def array(self) -> Floats:
        """P[i, j] = P(bin i -> bin j) for partitions, <e_i, P e_j> for other bases; shape (n, n)."""
        heights = self.basis.heights
        return np.asarray(heights[:, None] * self.symmetric / heights)

    @property
    def weights(self) -> Floats:
        """Invariant probability measure of the cells, sum 1 (squared coefficients of 1 for other bases)."""
        return self.basis.weights

    @property
    def flux(self) -> Floats:
        """Probability of going from cell i to cell j under the invariant measure: ``weights[:, None] * array``."""
        if not self.basis.is_partition:
            raise InputError(f"flux: {self.basis!r} has no cells; use Bins, or .symmetric for <e_i, P e_j>")
        root = np.sqrt(self.weights)
        return np.asarray(root[:, None] * self.symmetric * root)

    @property
    def tolerance_met(self) -> bool | None:
        """Whether the error is within the tolerance that was asked for; None where none was."""
        return None if self.requested_tolerance is None else float(self.error) <= self.requested_tolerance

    def symmetry_defect(self) -> SymmetryDefect:
        """Distance from reversibility: relative Frobenius norm of the antisymmetric part in an orthonormal basis.

        For sampled kernels it is that of the raw sample, also when it was symmetrised, and ``.z_score`` says how
        far it lies above the sampling noise.
        """
        if self.raw_defect is not None:
            return self.raw_defect
        return SymmetryDefect(relative_asymmetry(self.symmetric))

    def stochastic_defect(self) -> Defect:
        """How far P 1 is from 1: the largest row defect for partitions, the L^2 norm for other bases."""
        if self.basis.is_partition:
            return Defect(float(np.max(np.abs(self.array.sum(axis=1) - 1.0))), STOCHASTIC_NORM_CELLS)
        constant = self.basis.constant
        return Defect(float(np.linalg.norm(self.symmetric @ constant - constant)), STOCHASTIC_NORM)

    # ---- the algebra -----------------------------------------------------------------------------------------
    @overload
    def __matmul__(self, other: KernelMatrix) -> KernelMatrix: ...
    @overload
    def __matmul__(self, other: ArrayLike | AngleFunction) -> Floats: ...
    def __matmul__(self, other: KernelMatrix | ArrayLike | AngleFunction) -> KernelMatrix | Floats:
        """``P @ Q``: first P, then Q. ``P @ f``: the operator on values in the cells (or coefficients), or on a
        function of the angle, which is projected."""
        if isinstance(other, KernelMatrix):
            return _multiplied(self, other)
        return np.asarray(self.array @ self._coordinates(other, "f"))

    def __rmatmul__(self, measure: ArrayLike | AngleFunction) -> Floats:
        """``mu @ P``: the measure after one step, from the masses of the cells (for other bases the integrals of
        the e_i), or from a density with respect to the invariant measure."""
        if callable(measure):
            return np.asarray((self._coordinates(measure, "mu") / self.basis.heights**2) @ self.array)
        return np.asarray(self._coordinates(measure, "mu", axis=-1) @ self.array)

    def __mul__(self, factor: float) -> KernelMatrix:
        number = finite_number("factor", factor)
        error = frobenius_error(abs(number) * float(self.error), self.error.kind, self.error.method)
        return replace(
            self._derived(number * self.symmetric, error, f"{number:g}*{self.law or self.method}"),
            replicates=tuple(number * part for part in self.replicates),
            reversible=self.reversible,
            mirror_symmetric=self.mirror_symmetric,
            norm_bound=abs(number) * self.norm_bound,
        )

    __rmul__ = __mul__

    def __neg__(self) -> KernelMatrix:
        return -1.0 * self

    def __add__(self, other: KernelMatrix) -> KernelMatrix:
        return _added(self, other) if isinstance(other, KernelMatrix) else NotImplemented

    def __sub__(self, other: KernelMatrix) -> KernelMatrix:
        return _added(self, -1.0 * other) if isinstance(other, KernelMatrix) else NotImplemented

    def __pow__(self, exponent: int) -> KernelMatrix:
        n = whole_number("exponent", exponent, 0)
        bound, error = self.norm_bound, float(self.error)
        # telescoping S^n - S*^n with ||S*|| <= bound and ||S|| <= bound + error
        whole = (bound + error) ** n - bound**n if bound != 1.0 else float(np.expm1(n * np.log1p(error)))
        power = frobenius_error(whole, self.error.kind, f"power {n} of: {self.error.method}")
        return replace(
            self._derived(np.linalg.matrix_power(self.symmetric, n), power, f"({self.law or self.method})**{n}"),
            reversible=True if n == 0 else self.reversible,
            mirror_symmetric=True if n == 0 else self.mirror_symmetric,
            norm_bound=bound**n,
        )

    def adjoint(self) -> KernelMatrix:
        """The matrix of the adjoint kernel in L^2 of the invariant measure."""
        return replace(
            self,
            symmetric=self.symmetric.T,
            counts=None if self.counts is None else self.counts.T,
            replicates=tuple(part.T for part in self.replicates),
            law=self.law if self.reversible else f"adjoint of {self.law or self.method}",
        )

    def tensor(self, other: KernelMatrix) -> KernelMatrix:
        """The kernel that applies this one to the first angle and the other to the second, independently."""
        _same_frame(self, other)
        mine, yours = float(self.error), float(other.error)
        size = float(np.linalg.norm(self.symmetric)) + mine
        error = mine * float(np.linalg.norm(other.symmetric)) + size * yours
        return KernelMatrix(
            np.kron(self.symmetric, other.symmetric),
            TensorBasis((self.basis, other.basis)),
            frobenius_error(error, _joint_kind(self, other), "tensor product"),
            method="tensor product",
            law=f"({self.law or self.method}) x ({other.law or other.method})",
            reversible=_both(self.reversible, other.reversible),
            mirror_symmetric=_both(self.mirror_symmetric, other.mirror_symmetric),
            frame=self.frame,
            norm_bound=self.norm_bound * other.norm_bound,
        )

    def in_specular_frame(self) -> KernelMatrix:
        """P J, J f(theta) = f(pi - theta): Feres' convention, where specular reflection is the identity.

        Of a matrix that is in that convention already this gives back the paper's, as for laws.
        Raises an InputError where J does not keep the span of the basis; discretise the law's own
        ``in_specular_frame()`` then.
        """
        if not is_mirror_symmetric(self.basis):
            raise InputError(
                f"{self.basis!r} is not kept by theta -> pi - theta; discretise law.in_specular_frame() instead"
            )
        flip = reflection_matrix(self.basis)
        return replace(
            self._derived(self.symmetric @ flip, self.error, self.law),
            method=self.method,
            replicates=tuple(part @ flip for part in self.replicates),
            samples=self.samples,
            unresolved=self.unresolved,
            requested_tolerance=self.requested_tolerance,
            frame="paper" if self.frame == "specular" else "specular",
            reversible=bool(self.reversible) if self.mirror_symmetric else None,
            mirror_symmetric=self.mirror_symmetric,
            norm_bound=self.norm_bound,
        )

    def as_linear_operator(self) -> LinearOperator:
        """``array`` as a scipy LinearOperator, with its transpose."""
        from scipy.sparse.linalg import aslinearoperator

        return aslinearoperator(self.array)

    # ---- files and pictures ----------------------------------------------------------------------------------
    def save(self, path: str | Path, overwrite: bool = False) -> Path:
        """Write everything to an .npz file that `load_matrix` reads; an existing file only with ``overwrite``."""
        from .matrixfile import write_matrix

        return write_matrix(self, path, overwrite=overwrite)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the density with respect to the invariant measure; returns the axes."""
        from .picture import draw_matrix

        return draw_matrix(self, ax)

    def __repr__(self) -> str:
        error = f"error {float(self.error):.2g} ({self.error.kind})"
        parts = [repr(self.basis), self.law, self.method, error]
        if self.samples:
            parts.append(f"{self.samples} samples")
        if self.frame == "specular":
            parts.append("specular frame")
        if self.tolerance_met is False:
            parts.append(f"tolerance {self.requested_tolerance:g} not met")
        return f"KernelMatrix({', '.join(part for part in parts if part)})"

    # ---- internals -------------------------------------------------------------------------------------------
    def _coordinates(self, other: ArrayLike | AngleFunction, name: str, axis: int = 0) -> Floats:
        if callable(other):
            return np.asarray(self.basis.heights * self.basis.project(other))
        values = finite_array(name, other)
        if values.ndim == 0 or values.shape[axis] != self.size:
            raise InputError(f"{name}: expected {self.size} entries for {self.basis!r}, got shape {values.shape}")
        return values

    def _derived(self, symmetric: Floats, error: Estimate, law: str) -> KernelMatrix:
        """A matrix on the same basis that is no sample any more."""
        return KernelMatrix(symmetric, self.basis, error, method="algebra", law=law, frame=self.frame)


def _multiplied(first: KernelMatrix, second: KernelMatrix) -> KernelMatrix:
    _same_basis(first, second)
    mine, yours = float(first.error), float(second.error)
    # S_1 S_2 - S_1* S_2* = E_1 S_2* + S_1 E_2, and ||S_1|| <= norm_bound + error
    error = mine * second.norm_bound + (first.norm_bound + mine) * yours
    method = f"product of ({first.error.method}) and ({second.error.method})"
    same = first is second
    return replace(
        first._derived(
            first.symmetric @ second.symmetric,
            frobenius_error(error, _joint_kind(first, second), method),
            f"{first.law or first.method} @ {second.law or second.method}",
        ),
        reversible=first.reversible if same else None,
        mirror_symmetric=_both(first.mirror_symmetric, second.mirror_symmetric),
        norm_bound=first.norm_bound * second.norm_bound,
    )


def _added(first: KernelMatrix, second: KernelMatrix) -> KernelMatrix:
    _same_basis(first, second)
    replicates: tuple[Any, ...] = ()
    # independent randomisations cannot be paired; those of one term are shifted by the other where it has none
    if first.replicates and not second.replicates:
        replicates = tuple(part + second.symmetric for part in first.replicates)
    elif second.replicates and not first.replicates:
        replicates = tuple(part + first.symmetric for part in second.replicates)
    return replace(
        first._derived(
            first.symmetric + second.symmetric,
            frobenius_error(
                float(first.error) + float(second.error),
                _joint_kind(first, second),
                f"sum of ({first.error.method}) and ({second.error.method})",
            ),
            f"{first.law or first.method} + {second.law or second.method}",
        ),
        replicates=replicates,
        reversible=_both(first.reversible, second.reversible),
        mirror_symmetric=_both(first.mirror_symmetric, second.mirror_symmetric),
        norm_bound=first.norm_bound + second.norm_bound,
    )


def _same_basis(first: KernelMatrix, second: KernelMatrix) -> None:
    if first.basis != second.basis:
        raise InputError(f"the matrices have different bases, {first.basis!r} and {second.basis!r}; discretise again")
    _same_frame(first, second)


def _same_frame(first: KernelMatrix, second: KernelMatrix) -> None:
    if first.frame != second.frame:
        raise InputError(
            f"the matrices are in different conventions, {first.frame!r} and {second.frame!r}; "
            "use in_specular_frame() on both or on neither"
        )


def _joint_kind(first: KernelMatrix, second: KernelMatrix) -> str:
    return "bound" if first.error.kind == second.error.kind == "bound" else "estimate"


def _both(first: bool | None, second: bool | None) -> bool | None:
    return True if first and second else None


