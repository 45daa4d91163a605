"""The paper's pseudometric of weak convergence, with products of cosines as test functions."""

from __future__ import annotations

from math import ceil, log2

import numpy as np

from ...core.checks import Floats
from ...core.estimates import Estimate
from ..bases.basis import Basis
from ..bases.legendre import Legendre
from ..discretisation.discretisation import discretise
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix, joint_kind

# Weights of 2^-60 and less are below the rounding of the sum.
LARGEST_ORDER = 58


def moment_distance(first: Law | KernelMatrix, second: Law | KernelMatrix, tolerance: float) -> Estimate:
    r"""Sum over k, l >= 0 of 2^(-k - l - 2) times the absolute difference of the means of cos(k theta) cos(l theta').

    The means are taken under the flux measure, int int f(theta, theta') P(theta, d theta') nu(d theta) with
    nu = sin(theta)/2 d theta. The products of cosines span a dense subspace of the continuous functions on the square,
    so the distance tends to 0 exactly if the flux measures converge weakly.

    The sum is taken over k, l <= K. The remainder is at most 2 (1 - (1 - 2^(-K - 1))^2) < 2^(1 - K), because a
    difference of means is at most 2. In u = cos(theta) the functions are Chebyshev polynomials: K + 1 Legendre
    polynomials give their means exactly, and an error E of the matrix changes each mean by at most E.

    Source: Rudzis 2022, section 6.2.3, with the order of the arguments of f corrected: f(y, x) G(y, dx) nu(dy).
    """
    last = min(max(ceil(log2(2.0 / tolerance)), 1), LARGEST_ORDER)
    matrices = [
        law if isinstance(law, KernelMatrix) else discretise(law, Legendre(last + 1), tolerance=0.1 * tolerance)
        for law in (first, second)
    ]
    for matrix in matrices:
        if isinstance(matrix.basis, Legendre):
            last = min(last, matrix.size - 1)
    weight = 0.5 ** (np.arange(last + 1) + 1.0)
    difference = np.abs(flux_means(matrices[0], last) - flux_means(matrices[1], last))
    rest = 2.0 * (2.0 - 0.5 ** (last + 1)) * 0.5 ** (last + 1)
    error = float(matrices[0].error) + float(matrices[1].error) + rest
    how = f"cosines up to order {last}: errors of both matrices, and 2^{1 - last} for the rest of the sum"
    return Estimate(float(weight @ difference @ weight), error, joint_kind(matrices[0], matrices[1]), how)


def flux_means(matrix: KernelMatrix, last: int) -> Floats:
    """Means of cos(k theta) cos(l theta') under the flux measure, k, l = 0, ..., last."""
    cosines = _cosines(matrix.basis, last)
    return np.asarray(cosines @ matrix.symmetric @ cosines.T)


def _cosines(basis: Basis, last: int) -> Floats:
    """Coefficients of cos(k theta) in the basis, one row per k."""
    order = basis.nodes_per_interval + last
    angle, weight = basis.measure.quadrature(basis.edges, order)
    return np.asarray((weight * np.cos(np.arange(last + 1)[:, None] * angle)) @ basis.evaluate(angle))
