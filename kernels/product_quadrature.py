"""Matrices of compositions through finer bases."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np

from ..checks import Floats
from ..errors import InputError
from .basis import Basis
from .bins import Bins
from .law import Law
from .legendre import Legendre
from .matrix import KernelMatrix
from .panels import Panels
from .products import overlaps


def product_matrix(
    laws: Sequence[Law], basis: Basis, make: Callable[[Law, Basis], KernelMatrix]
) -> tuple[Floats, float]:
    """<e_i, P_1 P_2 ... e_j>, with the products taken in bases two and four times as large.

    The factors' matrices on the larger basis act on more functions than those of ``basis``, and in the limit on all,
    so that this tends to the Galerkin matrix of the product. The difference of the two levels, with the errors of the
    factors, is the error estimate.
    """
    (coarse, _), (fine, factor_error) = (_product(laws, basis, levels, make) for levels in (1, 2))
    return fine, float(np.linalg.norm(fine - coarse)) + factor_error


def _product(
    laws: Sequence[Law], basis: Basis, levels: int, make: Callable[[Law, Basis], KernelMatrix]
) -> tuple[Floats, float]:
    finer, restriction = basis, np.eye(basis.size)
    for _ in range(levels):
        finer, step = refined(finer)
        restriction = restriction @ step
    matrices = {law: make(law, finer) for law in dict.fromkeys(laws)}
    product = reduce(np.matmul, [matrices[law].symmetric for law in laws])
    return restriction @ product @ restriction.T, sum(float(matrices[law].error) for law in laws)


def refined(basis: Basis) -> tuple[Basis, Floats]:
    """A basis twice as large whose span contains that of ``basis``, and the coefficients of ``basis`` in it.

    Examples
    --------
    >>> refined(Legendre(1))[1].tolist()
    [[1.0, 0.0]]
    """
    if isinstance(basis, Legendre):
        return Legendre(2 * basis.n, basis.weight), np.eye(basis.n, 2 * basis.n)
    middle = 0.5 * (basis.edges[1:] + basis.edges[:-1])
    edges = np.insert(basis.edges, np.arange(1, basis.edges.size), middle)
    if isinstance(basis, Bins):
        bins = Bins(edges)
        owner = np.arange(bins.size) // 2
        restriction = np.zeros((basis.size, bins.size))
        restriction[owner, np.arange(bins.size)] = np.sqrt(bins.weights / basis.weights[owner])
        return bins, restriction
    if isinstance(basis, Panels):
        panels = Panels(edges, basis.degree)
        return panels, overlaps(basis, panels.evaluate, edges)
    raise InputError(f"{basis!r} cannot be refined; expected Bins, Legendre or Panels")
