"""Quantities of a law: its matrix, first moment, resistance, and mean Wasserstein distance from Lambert's law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ...core.checks import Floats
from ...core.estimates import Estimate
from ...geometry import Wall
from ...kernels import Basis, Bins, KernelMatrix, Legendre, WallLaw, discretise, distance, lambertian
from ...kernels.bases.polynomials import MEAN_SINE, SINE_NORM, Directions
from ...spectral import WorkMethod
from .methods import AUTO, Methods, Quantity, matrix_methods, monte_carlo_matrix
from .walls import standard_names

LAW_BASIS, MOMENT_BASIS, RESISTANCE_BASIS = Bins(32), Legendre(2), Directions()
# Scenes whose conditional distributions have a closed form.
DISTANCE_SCENES = ("triangular-teeth", "rectangular-teeth", "focusing-arc")
SAMPLED_BINS = 64


def _read_from(basis: Basis, read: Callable[[KernelMatrix], Any]) -> Callable[[Wall], Methods]:
    """Methods for a quantity that ``read`` computes from a matrix."""

    def reading(method: WorkMethod) -> WorkMethod:
        return replace(method, solve=lambda *how: read(method.solve(*how)))

    return lambda wall: [(reading(method), quick, full) for method, quick, full in matrix_methods(wall, basis)]


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


def _distance_methods(wall: Wall) -> Methods:
    law = WallLaw(wall)

    def of_laws(budget: float) -> Estimate:
        return distance(law, lambertian(), tolerance=1.0 / budget)

    def of_bins(number: int) -> Estimate:
        return _to_lambert(discretise(law, Bins(number)))

    def of_samples(rays: float, rng: np.random.Generator) -> Estimate:
        return _to_lambert(monte_carlo_matrix(wall, Bins(SAMPLED_BINS), rays, rng))

    sizes = (16.0, 32.0, 64.0)
    # samples have a noise floor from their bins, and bins an error from their width, so neither has one order
    return [
        (WorkMethod(AUTO, of_laws), (1e2, 1e4), (1e2, 1e3, 1e4, 1e5, 1e6)),
        (WorkMethod("bins", of_bins), sizes, (*sizes, 128.0, 256.0, 512.0)),
        (WorkMethod("Monte Carlo", of_samples, True), (4.0**7, 4.0**8), tuple(4.0**k for k in (7, 8, 9, 10))),
    ]


def _to_lambert(matrix: KernelMatrix) -> Estimate:
    return distance(matrix, discretise(lambertian(), matrix.basis))


# The matrix of the law in bins, <u, P u>/<u, u>, and the mean resistance of a body with this wall.
LAW = Quantity("law", lambda wall: matrix_methods(wall, LAW_BASIS), standard_names())
MOMENT = Quantity("moment", _read_from(MOMENT_BASIS, moment_of), standard_names())
RESISTANCE = Quantity(
    "resistance", _read_from(RESISTANCE_BASIS, _resistance), ("triangular-teeth", "focusing-arc", "mixed")
)
DISTANCE = Quantity("distance", _distance_methods, DISTANCE_SCENES)
