"""What two kernel matrices must share to be combined or compared, and the kind of the error of what comes of both."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...errors import InputError
from ...estimates import ErrorKind

if TYPE_CHECKING:
    from .matrix import KernelMatrix


def check_same_basis(first: KernelMatrix, second: KernelMatrix) -> None:
    """Raise an InputError unless both are in the same basis and the same convention."""
    if first.basis != second.basis:
        raise InputError(f"the matrices have different bases, {first.basis!r} and {second.basis!r}; discretise again")
    check_same_frame(first, second)


def check_same_frame(first: KernelMatrix, second: KernelMatrix) -> None:
    """Raise an InputError unless both are in the same convention."""
    if first.frame != second.frame:
        raise InputError(
            f"the matrices are in different conventions, {first.frame!r} and {second.frame!r}; "
            "use in_specular_frame() on both or on neither"
        )


def joint_kind(first: KernelMatrix, second: KernelMatrix) -> ErrorKind:
    """Whether what is computed from both has a bound for its error, or an estimate."""
    return "bound" if first.error.kind == second.error.kind == "bound" else "estimate"
