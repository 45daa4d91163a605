"""The basis of the components of a direction: the constant, cos(theta) and sin(theta)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats
from .basis import Basis
from .measure import SINE, AngularMeasure

# Products of two of the functions times the weight are trigonometric polynomials of degree 3 on (0, pi).
GAUSS_NODES = 20
# <sin, 1> and the norm of sin - <sin, 1> for the measure sin(theta)/2 d theta; the squared norm is 2/3 - pi^2/16.
MEAN_SINE = 0.25 * np.pi
SINE_NORM = float(np.sqrt(2.0 / 3.0 - np.pi**2 / 16.0))


@dataclass(frozen=True, eq=False, repr=False)
class Directions(Basis):
    """1, cos(theta) and sin(theta), made orthonormal for sin(theta)/2 d theta.

    A law's matrix in this basis determines the mean momentum of the particles that it reflects.

    Examples
    --------
    >>> Directions().evaluate(0.0).round(12).tolist()
    [1.0, 1.732050807569, -3.518874256629]
    """

    @property
    def measure(self) -> AngularMeasure:
        return SINE

    @property
    def size(self) -> int:
        return 3

    @property
    def edges(self) -> Floats:
        return np.array([0.0, np.pi])

    @property
    def nodes_per_interval(self) -> int:
        return GAUSS_NODES

    @property
    def constant(self) -> Floats:
        return np.array([1.0, 0.0, 0.0])

    def key(self) -> tuple[object, ...]:
        return ()

    def __repr__(self) -> str:
        return "cosine and sine of the angle"

    def evaluate(self, angle: ArrayLike) -> Floats:
        angle = np.asarray(angle, dtype=np.float64)
        raised = (np.sin(angle) - MEAN_SINE) / SINE_NORM
        return np.stack([np.ones(angle.shape), np.sqrt(3.0) * np.cos(angle), raised], axis=-1)

    def coarsened(self) -> None:
        return None
