"""Eigenvalues of the even and odd parts of a mirror-symmetric law under theta -> pi - theta."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...kernels import Basis, Bins, KernelMatrix, Law
from ...kernels.bases.assembly import is_mirror_symmetric, reflection_matrix
from .dense import ExtremalEigenvalues, Which, compressed, counted_from_above, extremal, symmetric_half, wanted

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    ParityBasis = tuple[csr_array[Any], csr_array[Any]]

Parity = Literal["even", "odd", "none"]

# Larger entries of the reflection matrix count as 1 in modulus: the reflection permutes the basis up to signs.
ENTRY = 0.5


def parity_basis(basis: Basis, law: Law | KernelMatrix) -> ParityBasis | None:
    """Orthonormal even and odd functions in a basis, as sparse arrays of shapes (n, even) and (n, odd).

    None if the law is not known to be mirror-symmetric, or the reflection does not preserve the basis.

    Examples
    --------
    >>> from asperity.kernels import Legendre, lambertian
    >>> [half.shape for half in parity_basis(Legendre(5), lambertian())]
    [(5, 3), (5, 2)]
    """
    if not law.mirror_symmetric or not is_mirror_symmetric(basis):
        return None
    here = np.arange(basis.size)
    if isinstance(basis, Bins):
        # the reflection reverses the bins; no large matrix is needed
        image, sign = here[::-1], np.ones(basis.size)
    else:
        flip = reflection_matrix(basis)
        image = np.argmax(np.abs(flip), axis=1)
        sign = flip[here, image]
    if np.any(np.abs(sign) < ENTRY) or np.any(image[image] != here):
        return None
    from scipy.sparse import csr_array

    def columns(alone: NDArray[np.bool_], factor: float) -> csr_array[Any]:
        """The functions of one parity: those equal to their image, and sums of the others with their images."""
        single, first = here[alone], here[image > here]
        weight = np.full(len(first), np.sqrt(0.5))
        rows = np.concatenate([single, first, image[first]])
        pair = len(single) + np.arange(len(first))
        entries = np.concatenate([np.ones(len(single)), weight, factor * weight * np.sign(sign[first])])
        where = np.concatenate([np.arange(len(single)), pair, pair])
        return csr_array((entries, (rows, where)), shape=(basis.size, len(single) + len(first)))

    return columns((image == here) & (sign > 0.0), 1.0), columns((image == here) & (sign < 0.0), -1.0)


def extremal_by_parity(
    array: Floats, split: ParityBasis | None, constant: Floats | None, k: int, which: Which = "moduli"
) -> tuple[ExtremalEigenvalues, tuple[Parity, ...]]:
    """The result of `extremal` for the symmetric part of a matrix, with the parities of the eigenvectors.

    A mirror-symmetric law does not mix even and odd functions. Two matrices of half the size take a quarter of the
    work; noise between the parities in a sampled matrix is omitted. ``split`` is the result of `parity_basis`.
    """
    if split is None:
        found = extremal(symmetric_half(array), constant, k, which)
        nothing: Parity = "none"
        return found, (nothing,) * len(found.values)
    parts: list[tuple[ExtremalEigenvalues, csr_array[Any], Parity]] = []
    names: tuple[Parity, Parity] = ("even", "odd")
    for half, name in zip(split, names, strict=True):
        if half.shape[1]:
            inside = None if constant is None or name == "odd" else np.asarray(half.T @ constant)
            parts.append((extremal(compressed(array, half.T.tocsr()), inside, k, which), half, name))
    return _merged(parts, k, which)


def _merged(
    parts: list[tuple[ExtremalEigenvalues, csr_array[Any], Parity]], k: int, which: Which
) -> tuple[ExtremalEigenvalues, tuple[Parity, ...]]:
    """The k wanted eigenvalues of the even and odd parts together, from the k wanted ones of each."""
    values = np.concatenate([part.values for part, _, _ in parts])
    vectors = np.concatenate([half @ part.vectors for part, half, _ in parts], axis=1)
    residuals = np.concatenate([part.residuals for part, _, _ in parts])
    errors = np.concatenate([part.errors for part, _, _ in parts])
    names = np.repeat([name for _, _, name in parts], [len(part.values) for part, _, _ in parts])
    order = np.argsort(-values, kind="stable")
    order = order[wanted(values[order], k, which)]
    methods = dict.fromkeys(part.method for part, _, _ in parts)
    values = values[order]
    top = counted_from_above(values, which)
    found = ExtremalEigenvalues(values, vectors[:, order], top, residuals[order], errors[order], "; ".join(methods))
    return found, tuple(names[order].tolist())
