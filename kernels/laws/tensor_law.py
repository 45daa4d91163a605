"""The protocol of laws of several angles, which `discretise` takes with a tensor basis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TypeAlias

from ..bases.basis import Basis
from ..bases.tensor import TensorBasis
from ..matrices.matrix import KernelMatrix
from .law import Law

# Weight, law of theta, and whether psi becomes pi - psi (else it is unchanged).
Term: TypeAlias = tuple[float, Law, bool]
# `discretise` with all its arguments but law and basis.
Discretiser: TypeAlias = Callable[[Law, Basis], KernelMatrix]


class TensorLaw(ABC):
    """A law of the angles (theta, psi), computed from laws of the single angles."""

    @abstractmethod
    def parts_checked(self) -> tuple[Term, ...]:
        """The terms, of which the law is the sum; raises InputError if their weights do not sum to 1 within 1e-12."""

    @abstractmethod
    def matrix_on(self, basis: TensorBasis, discretise: Discretiser) -> KernelMatrix:
        """The matrix on products e_i(theta) f_j(psi), with theta for sin(theta) and psi for sin(psi)^2."""
