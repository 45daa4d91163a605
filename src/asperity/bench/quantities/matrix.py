"""Quantities computed from a law's matrix: the matrix itself, the first moment, the resistance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...core.checks import Floats
from ...core.estimates import Estimate
from ...geometry import Wall
from ...kernels import Basis, Bins, KernelMatrix, Legendre
from ...kernels.bases.directions import MEAN_SINE, SINE_NORM, Directions
from ...spectral import WorkMethod
from .methods import RANDOM_ORDER, MatrixMethod, declared_order, methods_for
from .quantity import Methods, Quantity
from .walls import standard_names

LAW_BASIS, MOMENT_BASIS, RESISTANCE_BASIS = Bins(32), Legendre(2), Directions()


def _by_methods(basis: Basis, read: Callable[[KernelMatrix], Any], in_bins: bool = False) -> Callable[[Wall], Methods]:
    """Methods for a quantity that ``read`` computes from a matrix."""

    def method(wall: Wall, chosen: MatrixMethod) -> WorkMethod:
        # strata and Sobol sequences exceed 3/4 for continuous integrands, so orders are declared for bins only
        order = declared_order(chosen, wall) if in_bins or chosen.order == RANDOM_ORDER else None
        return WorkMethod(
            chosen.name, lambda budget, *rng: read(chosen.matrix(wall, basis, budget, *rng)), chosen.is_random, order
        )

    return lambda wall: [(method(wall, chosen), chosen.quick, chosen.full) for chosen in methods_for(wall)]


def moment_of(matrix: KernelMatrix) -> Estimate:
    """<u, P u>/<u, u>, from the matrix in Legendre polynomials."""
    return Estimate(float(matrix.symmetric[1, 1]), matrix.error.value, matrix.error.kind, matrix.method)


def resistance_of(symmetric: Floats) -> float:
    """(3/4) E[1 + cos(theta' - theta)] from the matrix in orthonormalised 1, cos and sin."""
    sine = np.array([MEAN_SINE, 0.0, SINE_NORM])
    return float(0.75 * (1.0 + symmetric[1, 1] / 3.0 + sine @ symmetric @ sine))


def _resistance(matrix: KernelMatrix) -> Estimate:
    # the norm of the coefficients of the matrix
    size = 0.75 * float(np.hypot(1.0 / 3.0, MEAN_SINE**2 + SINE_NORM**2))
    return Estimate(resistance_of(matrix.symmetric), size * matrix.error.value, matrix.error.kind, matrix.method)


# The matrix of the law in bins, <u, P u>/<u, u>, and the mean resistance of a body with this wall.
LAW = Quantity("law", _by_methods(LAW_BASIS, lambda matrix: matrix, in_bins=True), standard_names())
MOMENT = Quantity("moment", _by_methods(MOMENT_BASIS, moment_of), standard_names())
RESISTANCE = Quantity(
    "resistance", _by_methods(RESISTANCE_BASIS, _resistance), ("triangular-teeth", "focusing-arc", "mixed")
)
