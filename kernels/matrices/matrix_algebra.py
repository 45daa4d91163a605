"""The algebra of kernel matrices and what it does to their errors.

Bounds and quantiles of 95 % are added as they are, whether the terms are independent or not: a quantile of one term
and bounds of the others are a quantile, and of several quantiles the sum is exceeded in less than 5 % of cases where
errors are normal.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...checks import Floats
from ...errors import InputError
from ...estimates import ErrorKind, Estimate
from ..bases.mirror import is_mirror_symmetric, reflection_matrix
from ..bases.tensor import TensorBasis
from .matrix_pair import check_same_basis, check_same_frame, joint_kind

if TYPE_CHECKING:
    from .matrix import KernelMatrix


def frobenius_error(error: float, kind: ErrorKind, method: str) -> Estimate:
    """The Estimate that ``KernelMatrix.error`` holds: its value and its half width are both the Frobenius error, a
    bound or a quantile of 95 %."""
    return Estimate(error, error, kind, method)


def scaled(matrix: KernelMatrix, factor: float) -> KernelMatrix:
    """``factor * matrix``."""
    error = frobenius_error(abs(factor) * float(matrix.error), matrix.error.kind, matrix.error.method)
    return replace(
        _derived(matrix, factor * matrix.symmetric, error, f"{factor:g}*{_name(matrix)}"),
        replicates=tuple(factor * part for part in matrix.replicates),
        reversible=matrix.reversible,
        mirror_symmetric=matrix.mirror_symmetric,
        norm_bound=abs(factor) * matrix.norm_bound,
    )


def added(first: KernelMatrix, second: KernelMatrix) -> KernelMatrix:
    """``first + second``; errors add."""
    check_same_basis(first, second)
    replicates: tuple[Any, ...] = ()
    # parts of different samples cannot be paired; those of one term are shifted by the other where it has none
    if first.replicates and not second.replicates:
        replicates = tuple(part + second.symmetric for part in first.replicates)
    elif second.replicates and not first.replicates:
        replicates = tuple(part + first.symmetric for part in second.replicates)
    how = f"sum of ({first.error.method}) and ({second.error.method})"
    error = frobenius_error(float(first.error) + float(second.error), joint_kind(first, second), how)
    return replace(
        _derived(first, first.symmetric + second.symmetric, error, f"{_name(first)} + {_name(second)}"),
        replicates=replicates,
        reversible=_both(first.reversible, second.reversible),
        mirror_symmetric=_both(first.mirror_symmetric, second.mirror_symmetric),
        norm_bound=first.norm_bound + second.norm_bound,
    )


def multiplied(first: KernelMatrix, second: KernelMatrix) -> KernelMatrix:
    """First the one, then the other: S_1 S_2, with S_1 S_2 - S_1* S_2* = E_1 S_2* + S_1 E_2."""
    check_same_basis(first, second)
    mine, yours = float(first.error), float(second.error)
    how = f"product of ({first.error.method}) and ({second.error.method})"
    total = mine * second.norm_bound + (first.norm_bound + mine) * yours
    error = frobenius_error(total, joint_kind(first, second), how)
    return replace(
        _derived(first, first.symmetric @ second.symmetric, error, f"{_name(first)} @ {_name(second)}"),
        reversible=first.reversible if first is second else None,
        mirror_symmetric=_both(first.mirror_symmetric, second.mirror_symmetric),
        norm_bound=first.norm_bound * second.norm_bound,
    )


def to_power(matrix: KernelMatrix, exponent: int) -> KernelMatrix:
    """``matrix ** exponent``; telescoping S^n - S*^n with ||S*|| <= b, ||S|| <= b + e gives (b + e)^n - b^n."""
    bound, error = matrix.norm_bound, float(matrix.error)
    if bound == 1.0:
        with np.errstate(over="ignore"):
            whole = float(np.expm1(exponent * np.log1p(error)))
    else:
        whole = (bound + error) ** exponent - bound**exponent
    power = frobenius_error(whole, matrix.error.kind, f"power {exponent} of: {matrix.error.method}")
    array = np.linalg.matrix_power(matrix.symmetric, exponent)
    return replace(
        _derived(matrix, array, power, f"({_name(matrix)})**{exponent}"),
        reversible=True if exponent == 0 else matrix.reversible,
        mirror_symmetric=True if exponent == 0 else matrix.mirror_symmetric,
        norm_bound=bound**exponent,
    )


def tensor_product(first: KernelMatrix, second: KernelMatrix) -> KernelMatrix:
    """The two kernels side by side: A x B - A* x B* = E_A x B + A* x E_B, in the Frobenius norm."""
    check_same_frame(first, second)
    mine, yours = float(first.error), float(second.error)
    size = float(np.linalg.norm(first.symmetric)) + mine
    error = mine * float(np.linalg.norm(second.symmetric)) + size * yours
    whole = _derived(
        first,
        np.asarray(np.kron(first.symmetric, second.symmetric), dtype=np.float64),
        frobenius_error(error, joint_kind(first, second), "tensor product"),
        f"({_name(first)}) x ({_name(second)})",
        TensorBasis((first.basis, second.basis)),
    )
    return replace(
        whole,
        reversible=_both(first.reversible, second.reversible),
        mirror_symmetric=_both(first.mirror_symmetric, second.mirror_symmetric),
        norm_bound=first.norm_bound * second.norm_bound,
    )


def flipped_frame(matrix: KernelMatrix) -> KernelMatrix:
    """P J: the matrix in the other convention."""
    if not is_mirror_symmetric(matrix.basis):
        raise InputError(
            f"{matrix.basis!r} is not kept by theta -> pi - theta; discretise law.in_specular_frame() instead"
        )
    flip = reflection_matrix(matrix.basis)
    return replace(
        _derived(matrix, matrix.symmetric @ flip, matrix.error, f"({_name(matrix)}).in_specular_frame()"),
        method=matrix.method,
        replicates=tuple(part @ flip for part in matrix.replicates),
        samples=matrix.samples,
        unresolved=matrix.unresolved,
        requested_tolerance=matrix.requested_tolerance,
        frame="paper" if matrix.frame == "specular" else "specular",
        # P J is self-adjoint exactly if P commutes with J
        reversible=matrix.reversible if matrix.mirror_symmetric else None,
        mirror_symmetric=matrix.mirror_symmetric,
        norm_bound=matrix.norm_bound,
    )


def _derived(
    matrix: KernelMatrix, symmetric: Floats, error: Estimate, law: str, basis: TensorBasis | None = None
) -> KernelMatrix:
    """A matrix that is no sample any more."""
    return type(matrix)(symmetric, basis or matrix.basis, error, method="algebra", law=law, frame=matrix.frame)


def _name(matrix: KernelMatrix) -> str:
    return matrix.law or matrix.method


def _both(first: bool | None, second: bool | None) -> bool | None:
    return True if first and second else None
