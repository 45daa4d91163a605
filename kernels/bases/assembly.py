"""Matrices in a basis: sums of products e_i(theta) e_j(theta') over many pairs of angles, and the mirror map."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.errors import InputError
from ...core.long_runs import NUMBERS_AT_ONCE, slices
from .basis import Basis
from .partitions import Bins, Panels
from .polynomials import Legendre
from .spaces import TensorBasis

# OpenBLAS uses one thread for products of at most this many multiplications, and to limit it takes 30 us.
SMALL_PRODUCT = 2**18
# Matrices with more entries are copied as seldom as possible.
LARGE = 2**22


def one_blas_thread() -> AbstractContextManager[Any]:
    """Limit BLAS to one thread: on a busy machine its waiting threads can slow a tall thin product a hundredfold."""
    return _blas().limit(limits=1, user_api="blas")  # type: ignore[no-any-return]


@cache
def _blas() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def overlaps(basis: Basis, functions: Callable[[Floats], Floats], edges: Floats) -> Floats:
    """<e_i, f_j>, shape (n, k); ``functions`` returns f_j, smooth between the edges, with shape (angles, k)."""
    angle, weight = basis.measure.quadrature(edges, basis.nodes_per_interval)
    return np.asarray(basis.evaluate(angle).T @ (weight[:, None] * functions(angle)))


def add_products(total: Floats, basis: Basis, incoming: Floats, outgoing: Floats, weight: Floats) -> None:
    """Add the sum of weight e_i(incoming) e_j(outgoing) over the pairs to ``total``, shape (n, n)."""
    if basis.is_partition:
        add_masses(total, basis, basis.index(incoming), basis.index(outgoing), weight)
        return
    if isinstance(basis, Panels):
        (source, values), (target, images) = basis.local(incoming), basis.local(outgoing)
        add_blocks(total, basis, source, target, values, weight[:, None] * images)
        return
    step = max(1, NUMBERS_AT_ONCE // basis.size)
    for part in slices(incoming.size, step):
        values, images = basis.evaluate(incoming[part]), weight[part, None] * basis.evaluate(outgoing[part])
        with nullcontext() if values.size * basis.size <= SMALL_PRODUCT else one_blas_thread():
            total += values.T @ images


def add_masses(total: Floats, basis: Basis, source: NDArray[np.int64], target: NDArray[np.int64], mass: Floats) -> None:
    """Add masses transported from ``source`` to ``target`` cells of a partition to the Galerkin matrix ``total``."""
    if mass.size < total.size > LARGE:
        np.add.at(total, (source, target), basis.normalisation[source] * basis.normalisation[target] * mass)
        return
    flux = np.bincount(source * basis.size + target, weights=mass, minlength=total.size).reshape(total.shape)
    total += basis.normalisation[:, None] * flux * basis.normalisation


def add_blocks(
    total: Floats, basis: Panels, source: NDArray[np.int64], target: NDArray[np.int64], values: Floats, images: Floats
) -> None:
    """Add outer products of ``values`` on the panel ``source`` with ``images`` on the panel ``target`` to ``total``."""
    width = basis.degree + 1
    panels = basis.size // width
    cell = source * panels + target
    blocks = total.reshape(panels, width, panels, width)
    for row in range(width):
        for column in range(width):
            sums = np.bincount(cell, weights=values[:, row] * images[:, column], minlength=panels * panels)
            blocks[:, row, :, column] += sums.reshape(panels, panels)


def largest_square_sum(basis: Basis) -> float:
    """sup over theta of the sum of e_i(theta)^2."""
    return float(np.max(basis.magnitudes()[0])) ** 2


# Edges x and pi - y closer than this count as equal; pi - x has a rounding error of at most one spacing of pi.
MIRROR_TOLERANCE = 8.0 * np.spacing(np.pi)


def is_mirror_symmetric(basis: Basis) -> bool:
    """Whether J maps the span of the basis to itself."""
    if isinstance(basis, Legendre):
        return True
    if isinstance(basis, TensorBasis):
        return all(is_mirror_symmetric(factor) for factor in basis.factors)
    edges = basis.edges
    return bool(np.all(np.abs(edges + edges[::-1] - np.pi) <= MIRROR_TOLERANCE))


def reflection_matrix(basis: Basis) -> Floats:
    """The matrix <e_i, J e_k>, orthogonal if `is_mirror_symmetric` holds; in a tensor basis J mirrors every angle.

    Examples
    --------
    >>> reflection_matrix(Legendre(3)).tolist()
    [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]
    >>> reflection_matrix(Bins(2)).tolist()
    [[0.0, 1.0], [1.0, 0.0]]
    """
    if isinstance(basis, Legendre):
        return np.diag((-1.0) ** np.arange(basis.size))
    if isinstance(basis, TensorBasis):
        product: Floats = np.ones((1, 1))
        for factor in basis.factors:
            product = np.asarray(np.kron(product, reflection_matrix(factor)), dtype=np.float64)
        return product
    if isinstance(basis, Bins) and is_mirror_symmetric(basis):
        return np.ascontiguousarray(np.eye(basis.size)[::-1])
    edges = np.unique(np.concatenate((basis.edges, np.pi - basis.edges[::-1])))
    return overlaps(basis, lambda angle: basis.evaluate(np.pi - angle), edges)


def mirror_image(matrix: Floats, basis: Basis, *, rows: bool = True) -> Floats:
    """J S J, or S J without ``rows``, of a matrix in a basis; a view if the basis is a partition that J keeps."""
    if isinstance(basis, Bins) and is_mirror_symmetric(basis):
        return matrix[::-1, ::-1] if rows else matrix[:, ::-1]
    flip = reflection_matrix(basis)
    return flip @ matrix @ flip.T if rows else matrix @ flip


def mirror_refinement(basis: Basis) -> tuple[Basis, Floats]:
    """A basis with a J-invariant span that contains the span of ``basis``, and the coefficients of ``basis`` in it.

    The second value R has shape (coarse, fine). The Galerkin matrix S on the refinement gives R S R^T on ``basis``.
    """
    if is_mirror_symmetric(basis):
        return basis, np.eye(basis.size)
    joint = np.concatenate((basis.edges, np.pi - basis.edges[::-1]))
    lower = np.unique(joint[joint < 0.5 * np.pi])
    lower = lower[np.concatenate(([True], np.diff(lower) > MIRROR_TOLERANCE))]
    centre = [0.5 * np.pi] if np.any(joint == 0.5 * np.pi) else []
    edges = np.concatenate((lower, centre, np.pi - lower[::-1]))
    fine: Basis
    if isinstance(basis, Panels):
        fine = Panels(edges, basis.degree, basis.measure.name)
    elif isinstance(basis, Bins):
        fine = Bins(edges, basis.measure.name)
    else:
        raise InputError(f"{basis!r} is not kept by theta -> pi - theta; expected edges that are mirror images")
    return fine, overlaps(basis, fine.evaluate, np.unique(np.concatenate((edges, basis.edges))))
