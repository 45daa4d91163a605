"""The protocols of laws of several angles, made of laws of one angle, which `discretise` takes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import TypeAlias

from ...core.checks import Value
from ...core.errors import InputError
from ..bases.basis import Basis
from ..bases.spaces import TensorBasis
from ..matrices.matrix import KernelMatrix
from .law import Law

# Weight, law of theta, and whether psi becomes pi - psi (else it is unchanged).
Term: TypeAlias = tuple[float, Law, bool]
# `discretise` with all its arguments but law and basis.
Discretiser: TypeAlias = Callable[[Law, Basis], KernelMatrix]


class SpatialLaw(Value, ABC):
    """A law of several angles or of velocities in space, whose matrix is computed in ways of its own."""

    @abstractmethod
    def matrix_on(self, basis: Basis, discretise: partial[KernelMatrix]) -> KernelMatrix:
        """The matrix in a basis, from those of other laws or by the keywords of the call alone.

        Raises InputError for a basis of other functions.
        """


class TensorLaw(SpatialLaw):
    """A law of the angles (theta, psi), computed from laws of the single angles."""

    @abstractmethod
    def parts_checked(self) -> tuple[Term, ...]:
        """The terms, of which the law is the sum; raises InputError if their weights do not sum to 1 within 1e-12."""


def checked_pair(basis: Basis) -> TensorBasis:
    """The basis, if it is a product of one for theta and one for psi; else raises InputError."""
    if isinstance(basis, TensorBasis) and [factor.measure.name for factor in basis.factors] == ["sin", "sin2"]:
        return basis
    raise InputError(
        "basis: expected a product of one basis in theta and one in psi, such as "
        f"TensorBasis((Bins(16), Bins(8, weight='sin2'))), got {basis!r}"
    )
