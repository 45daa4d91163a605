"""Even and odd functions under theta -> pi - theta: the two halves of a mirror-symmetric law."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ..checks import Floats
from ..kernels.reflection import is_mirror_symmetric, reflection_matrix

if TYPE_CHECKING:
    from ..kernels import Basis, KernelMatrix

Parity = Literal["even", "odd", "none"]

# Entries of the flip that are no rounding: it permutes the functions of a basis, up to signs.
ENTRY = 0.5


def halves(matrix: KernelMatrix) -> tuple[Floats, Floats] | None:
    """Orthonormal even and odd functions, shapes (n, even) and (n, odd), of a mirror-symmetric law's basis.

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


def _halves(basis: Basis) -> tuple[Floats, Floats] | None:
    flip = reflection_matrix(basis)
    image = np.argmax(np.abs(flip), axis=1)
    here = np.arange(basis.size)
    sign = flip[here, image]
    if np.any(np.abs(sign) < ENTRY) or np.any(image[image] != here):
        return None
    fixed, pairs = image == here, image > here
    even: list[Floats] = []
    odd: list[Floats] = []
    for chosen, target in ((fixed & (sign > 0.0), even), (fixed & (sign < 0.0), odd)):
        part = np.zeros((basis.size, int(chosen.sum())))
        part[here[chosen], np.arange(part.shape[1])] = 1.0
        target.append(part)
    for factor, target in ((1.0, even), (-1.0, odd)):
        part = np.zeros((basis.size, int(pairs.sum())))
        column = np.arange(part.shape[1])
        part[here[pairs], column] = np.sqrt(0.5)
        part[image[pairs], column] = factor * np.sqrt(0.5) * np.sign(sign[pairs])
        target.append(part)
    return np.concatenate(even, axis=1), np.concatenate(odd, axis=1)
