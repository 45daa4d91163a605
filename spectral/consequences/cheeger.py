"""Cheeger's bounds for the gap, from the conductance of a cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats, frozen, instance
from ...core.errors import InputError
from ...core.estimates import Summary
from ...kernels import KernelMatrix
from ..eigenvalues.spectra import matrix_spectrum


@dataclass(frozen=True, repr=False)
class Conductance(Summary):
    """The best cut by a level of the second eigenfunction, and its bounds for the gap.

    Attributes
    ----------
    value : float
        Flux from the set to its complement over the smaller of the two measures.
    cells : array of shape (n,)
        1 for the bins of the set, 0 for the others.
    gap_above : float
        Upper bound of the gap, flux / (measure times measure of the complement). It holds for the matrix and for the
        law, whose Rayleigh quotient of the set is the same. For a sampled matrix it has a sampling error.
    gap_below : float
        Lower bound value^2 / 2 of the gap of the matrix. It does not hold for the law.
    error : float
        Error of ``gap_above``, from the Frobenius error of the matrix.
    """

    value: float
    cells: Floats
    gap_above: float
    gap_below: float
    error: float


def conductance(matrix: KernelMatrix) -> Conductance:
    """Cheeger's bounds for a reversible matrix on bins, from the level sets of its second eigenfunction.

    Parameters
    ----------
    matrix : KernelMatrix
        A reversible matrix on `Bins`.

    Raises
    ------
    InputError
        If the basis has no cells, or only one.

    Notes
    -----
    Some level set of the second eigenfunction has a conductance of at most sqrt(2 gap), so gap >= value^2 / 2.
    Source: D. A. Levin and Y. Peres, *Markov Chains and Mixing Times* (2017), theorem 13.10.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> found = conductance(ker.discretise(ker.MatrixLaw([[0.9, 0.1], [0.1, 0.9]]), ker.Bins(2)))
    >>> round(found.value, 12), round(found.gap_above, 12), round(found.gap_below, 12)
    (0.1, 0.2, 0.005)
    """
    instance("matrix", matrix, KernelMatrix, "ker.discretise(law, ker.Bins(64))")
    if not matrix.basis.is_partition or matrix.size < 2:
        raise InputError(f"matrix: expected one in at least two bins, got {matrix.basis!r}")
    found = matrix_spectrum(matrix, matrix.size)
    weights = np.asarray(matrix.weights)
    flux = 0.5 * (matrix.flux + matrix.flux.T)
    second = found.vectors[:, 1] / np.sqrt(weights)
    order = np.argsort(second, kind="stable")
    sorted_flux, mass = flux[np.ix_(order, order)], np.cumsum(weights[order])[:-1]
    # the flux out of the first m cells: their total flux minus the flux among them
    within = np.cumsum(np.cumsum(sorted_flux, axis=0), axis=1).diagonal()[:-1]
    out = np.maximum(np.cumsum(sorted_flux.sum(axis=1))[:-1] - within, 0.0)
    ratio = out / np.minimum(mass, 1.0 - mass)
    best = int(np.argmin(ratio))
    cells = np.zeros(matrix.size)
    cells[order[: best + 1]] = 1.0
    above = float(out[best] / (mass[best] * (1.0 - mass[best])))
    value = float(ratio[best])
    return Conductance(value, frozen(cells), above, 0.5 * value**2, float(matrix.error))
