"""The Wasserstein distance of a law from Lambert's law, averaged over the incoming angle."""

from __future__ import annotations

import numpy as np

from ...core.estimates import Estimate
from ...geometry import Wall
from ...kernels import Bins, KernelMatrix, WallLaw, discretise, distance, lambertian
from ...spectral import WorkMethod
from .methods import monte_carlo_matrix
from .quantity import Methods, Quantity

# Scenes whose conditional distributions have a closed form.
SCENES = ("triangular-teeth", "rectangular-teeth", "focusing-arc")
SAMPLED_BINS = 64


def _methods(wall: Wall) -> Methods:
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
        (WorkMethod("auto", of_laws), (1e2, 1e4), (1e2, 1e3, 1e4, 1e5, 1e6)),
        (WorkMethod("bins", of_bins), sizes, (*sizes, 128.0, 256.0, 512.0)),
        (WorkMethod("Monte Carlo", of_samples, True), (4.0**7, 4.0**8), tuple(4.0**k for k in (7, 8, 9, 10))),
    ]


def _to_lambert(matrix: KernelMatrix) -> Estimate:
    return distance(matrix, discretise(lambertian(), matrix.basis))


DISTANCE = Quantity("distance", _methods, SCENES)
