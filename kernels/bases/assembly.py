"""Galerkin matrices: sums of weighted products e_i(theta) e_j(theta') over many pairs of angles, for checked bases."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats, frozen, instance, shaped, whole_number
from ...core.errors import AsperityError, InputError
from ...core.long_runs import NUMBERS_AT_ONCE
from .basis import DENSER, Basis, BasisOfPoints
from .bins import checked_edges
from .measure import AngularMeasure
from .panels import Panels

# OpenBLAS uses one thread for products of at most this many multiplications, and to limit it takes 30 us.
SMALL_PRODUCT = 2**18
# Rounding of <e_i, e_j> for each function, and the attribute of a basis that was found to be orthonormal.
ORTHONORMAL, CHECKED = 1e-12, "_is_checked"
# Matrices with more entries are copied as seldom as possible.
LARGE = 2**22


def one_blas_thread() -> AbstractContextManager[Any]:
    """Limit BLAS to one thread: on a busy machine its waiting threads can slow a tall thin product a hundredfold."""
    return _blas().limit(limits=1, user_api="blas")  # type: ignore[no-any-return]


@cache
def _blas() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def checked_basis(basis: Any) -> None:
    """Refuse what is no basis, and a basis of a user's own class that breaks a promise of `Basis`.

    An object is examined once, at its own nodes and at more. The tests examine the classes of this package.
    """
    instance("basis", basis, Basis, "ker.Bins(64)")
    if type(basis).__module__.startswith(__package__) or isinstance(basis, BasisOfPoints) or CHECKED in vars(basis):
        return
    try:
        for what, found, expected in _promises(basis):
            defect = np.abs(found - shaped("basis", expected, *found.shape))
            # rounding of functions on narrow cells is larger
            if not defect.max() <= ORTHONORMAL * basis.size * max(1.0, np.abs(found).max()):
                raise InputError(f"basis: expected {what}, got a difference of {defect.max():.2g}")
    except AsperityError:
        raise
    except Exception as reason:  # of the user's methods
        raise InputError(f"basis: {basis!r} failed ({type(reason).__name__}: {reason}); see ker.Basis") from reason
    vars(basis)[CHECKED] = True


def _promises(basis: Basis) -> Iterator[tuple[str, Floats, Any]]:
    """What a basis promises, what is found, and what is expected."""
    hash(basis)
    instance("basis.measure", basis.measure, AngularMeasure, "ker.SINE")
    instance("basis.edges", basis.edges, np.ndarray, "np.array([0.0, np.pi])")
    instance("basis.constant", basis.constant, np.ndarray, "np.array([1.0, 0.0])")
    size, nodes = whole_number("basis.size", basis.size, 1), basis.nodes_per_interval
    for number in (nodes, DENSER * whole_number("basis.nodes_per_interval", nodes, 1)):
        angle, weight = basis.measure.quadrature(checked_edges(basis.edges), number)
        values = shaped("basis.evaluate(angles)", basis.evaluate(frozen(angle)), angle.size, size)
        gram = values.T @ (weight[:, None] * values)
        remedy = "raise nodes_per_interval, or add edges where functions have kinks"
        yield f"orthonormal functions at {number} nodes an interval ({remedy})", gram, np.eye(size)
    yield "evaluate(angle) @ constant = 1", values @ shaped("basis.constant", basis.constant, size), np.ones(angle.size)
    if basis.is_partition:
        cells = basis.index(angle)[:, None] == np.arange(size)
        yield "is_partition of indicators only", values, cells * basis.normalisation
    if basis.is_polynomial:
        powers = np.polynomial.legendre.legvander(np.cos(angle), size - 1)
        triangle = np.triu(np.linalg.lstsq(powers, values)[0])
        yield "is_polynomial of degrees 0, 1, ... in cos(theta) only", values, powers @ triangle
    coarser = basis.coarsened()
    if coarser is not None:
        yield "coarsened() of a subspace", values @ np.transpose(coarser[1]), coarser[0].evaluate(angle)


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
    """sup over theta of the sum of e_i(theta)^2; all our bases attain it at an edge, from one side."""
    if basis.is_partition:
        return float(np.max(basis.normalisation**2))
    ends = np.concatenate((basis.edges, np.nextafter(basis.edges, 0.0)))
    return float(np.max(np.sum(basis.evaluate(ends) ** 2, axis=1)))
