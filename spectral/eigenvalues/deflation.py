"""Symmetric matrices compressed to a subspace, above all to the complement of the constant function."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...checks import Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# Two tiles of this many rows and columns stay in the cache.
TILE = 256


def off_constants(array: Floats, constant: Floats) -> tuple[Floats, Floats]:
    """All eigenvalues (ascending) and eigenvectors of a symmetric matrix on the complement of a unit vector.

    The complement is reached by a Householder reflection that takes the vector to the first axis; so neither the
    multiplicity of the eigenvalue 1 nor noise in the rows can mix constants into the rest.
    """
    from scipy.linalg import eigh

    reflector = _householder(constant)
    turned = _reflect(reflector, _reflect(reflector, array).T)
    values, inner = eigh(0.5 * (turned + turned.T)[1:, 1:])
    vectors = np.vstack([np.zeros((1, inner.shape[1])), inner])
    return np.asarray(values), _reflect(reflector, vectors)


def compressed(array: Floats, embedding: csr_array[Any]) -> Floats:
    """The symmetric half of E A E^T for a sparse E of shape (m, n): the form of A on the rows of E."""
    rows = embedding @ array
    found = np.empty((len(rows), len(rows)))
    for start in range(0, len(rows), TILE):
        # a product with a transpose in one piece would read memory across the rows
        found[:, start : start + TILE] = embedding @ np.ascontiguousarray(rows[start : start + TILE].T)
    return symmetric_half(found)


def symmetric_half(array: Floats) -> Floats:
    """(A + A^T)/2, tile by tile, so that memory is read along the rows."""
    found = np.empty_like(array)
    for row in range(0, len(array), TILE):
        for column in range(0, row + 1, TILE):
            here, there = slice(row, row + TILE), slice(column, column + TILE)
            found[here, there] = 0.5 * (array[here, there] + array[there, here].T)
            found[there, here] = found[here, there].T
    return found


def _householder(unit: Floats) -> Floats:
    """The unit vector v for which I - 2 v v^T takes ``unit`` to plus or minus the first axis."""
    v = np.array(unit, dtype=np.float64)
    v[0] += 1.0 if v[0] >= 0.0 else -1.0
    return np.asarray(v / np.linalg.norm(v))


def _reflect(v: Floats, array: Floats) -> Floats:
    return np.asarray(array - 2.0 * np.outer(v, v @ array))
