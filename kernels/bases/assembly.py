"""Galerkin matrices: sums of weighted products e_i(theta) e_j(theta') over many pairs of angles, for every basis."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.long_runs import NUMBERS_AT_ONCE
from .basis import Basis
from .panels import Panels

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
    for start in range(0, incoming.size, step):
        part = slice(start, start + step)
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
