"""Even and odd functions under theta -> pi - theta: the two halves of a mirror-symmetric law."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..kernels.reflection import is_mirror_symmetric, reflection_matrix

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from ..kernels import Basis, KernelMatrix

Parity = Literal["even", "odd", "none"]

# Entries of the flip that are no rounding: it permutes the functions of a basis, up to signs.
ENTRY = 0.5


def halves(matrix: KernelMatrix) -> tuple[csr_array[Any], csr_array[Any]] | None:
    """Orthonormal even and odd functions, sparse of shapes (n, even) and (n, odd), of a mirror-symmetric law's basis.

    None where the law is not known to be symmetric, or the basis is not.

    Examples
    --------
    >>> from asperity.kernels import Legendre, discretise, lambertian
    >>> [half.shape for half in halves(discretise(lambertian(), Legendre(5)))]
    [(5, 3), (5, 2)]
    """
    if matrix.mirror_symmetric is not True or not is_mirror_symmetric(matrix.basis):
        return None
    return _halves(matrix.basis)


def _halves(basis: Basis) -> tuple[csr_array[Any], csr_array[Any]] | None:
    flip = reflection_matrix(basis)
    image = np.argmax(np.abs(flip), axis=1)
    here = np.arange(basis.size)
    sign = flip[here, image]
    if np.any(np.abs(sign) < ENTRY) or np.any(image[image] != here):
        return None
    from scipy.sparse import csr_array

    def columns(alone: NDArray[np.bool_], factor: float) -> csr_array[Any]:
        """The functions of one parity: each that is its own image, and the sums of each other one with its image."""
        single, first = here[alone], here[image > here]
        weight = np.full(len(first), np.sqrt(0.5))
        rows = np.concatenate([single, first, image[first]])
        pair = len(single) + np.arange(len(first))
        entries = np.concatenate([np.ones(len(single)), weight, factor * weight * np.sign(sign[first])])
        where = np.concatenate([np.arange(len(single)), pair, pair])
        return csr_array((entries, (rows, where)), shape=(basis.size, len(single) + len(first)))

    return columns((image == here) & (sign > 0.0), 1.0), columns((image == here) & (sign < 0.0), -1.0)
