"""Polynomials in the cosine of the angle and components of the direction, their moments, and the rounding of angles in
their matrices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.checks import Floats, finite_array, frozen, whole_number
from ...core.rounding import EPS
from .basis import Basis
from .measure import SINE, AngularMeasure, WeightName, measure_by_name

# Products of two functions, times the weight, oscillate at most 2 n times as fast as cos(theta). On an interval of
# length h, Gauss rules need about n h / 2 nodes to resolve them and DIGITS more to reach rounding (the error is 1e-12
# with 16, 1e-13 with 17). One panel per DEGREES_PER_PANEL degrees keeps the rules short.
DEGREES_PER_PANEL = 16
DIGITS = 18


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Legendre(Basis):
    r"""Orthonormal polynomials of degree 0, ..., n - 1 in cos(theta).

    For ``weight="sin"`` they are e_l = sqrt(2 l + 1) P_l(cos theta), the normalised Legendre polynomials; for
    ``weight="sin2"`` they are e_l = U_l(cos psi), the Chebyshev polynomials of the second kind. Both are orthonormal
    in the probability measure, sin(theta)/2 d theta or (2/pi) sin(psi)^2 d psi.

    Parameters
    ----------
    n : int
        Number of functions, at least 1.
    weight : {"sin", "sin2"}
        The measure.

    Raises
    ------
    InputError
        If n is not a whole number of at least 1.

    Examples
    --------
    >>> Legendre(3).evaluate(np.pi / 3).round(12)
    array([ 1.       ,  0.8660254, -0.2795085])
    """

    n: int
    weight: WeightName

    is_polynomial = True

    def __init__(self, n: int, weight: WeightName = "sin") -> None:
        self._set(n=whole_number("n", n, 1), weight=measure_by_name(weight).name)

    @property
    def measure(self) -> AngularMeasure:
        return measure_by_name(self.weight)

    @property
    def size(self) -> int:
        return self.n

    @property
    def edges(self) -> Floats:
        return np.linspace(0.0, np.pi, -(-self.n // DEGREES_PER_PANEL) + 1)

    @property
    def nodes_per_interval(self) -> int:
        width = float(self.edges[1])
        return int(np.ceil(0.5 * self.n * width)) + DIGITS

    @property
    def constant(self) -> Floats:
        unit = np.zeros(self.n)
        unit[0] = 1.0
        return unit

    def key(self) -> tuple[object, ...]:
        return (self.n, self.weight)

    def evaluate(self, angle: ArrayLike) -> Floats:
        angle = finite_array("angle", angle)
        # The recurrence for e_(l + 1) - e_l in 1 - cos = 2 sin^2(angle/2) has no cancellation near 0. Angles beyond
        # pi/2 are mirrored: e_l(pi - angle) = (-1)^l e_l(angle).
        mirrored = angle > 0.5 * np.pi
        versine = 2.0 * np.sin(0.5 * np.where(mirrored, np.pi - angle, angle)) ** 2
        values = np.ones((self.n, *angle.shape))
        step = np.zeros(angle.shape)
        for degree in range(self.n - 1):
            if self.weight == "sin":
                step = (degree * step - (2 * degree + 1) * versine * values[degree]) / (degree + 1)
            else:
                step = (1.0 if degree == 0 else step) - 2.0 * versine * values[degree]
            values[degree + 1] = values[degree] + step
        values[1::2] *= np.where(mirrored, -1.0, 1.0)
        if self.weight == "sin":
            values *= np.sqrt(2.0 * np.arange(self.n) + 1.0).reshape((-1,) + (1,) * angle.ndim)
        return np.moveaxis(values, 0, -1)

    def magnitudes(self) -> tuple[Floats, Floats]:
        # Bernstein's inequality: sin(theta) P_l^2 < 2 / (pi (l + 1/2)), so the sum of e_l^2 is below 4 n / (pi sin).
        # The sum of U_l^2 is at most n / sin^2.
        intervals = self.edges.size - 1
        if self.weight == "sin":
            return np.full(intervals, float(self.n)), np.full(intervals, np.sqrt(4.0 * self.n / np.pi))
        return np.full(intervals, np.sqrt(self.n * (self.n + 1) * (2 * self.n + 1) / 6)), np.full(intervals, np.inf)

    def derivative_norm(self) -> float:
        # The eigenvalues of minus the second derivative in the measure are l (l + 1), or l (l + 2).
        degree = np.arange(float(self.n))
        return float(np.sqrt(np.sum(degree * (degree + (1.0 if self.weight == "sin" else 2.0)))))

    def coarsened(self) -> tuple[Legendre, Floats] | None:
        if self.n < 2:
            return None
        coarse = -(-self.n // 2)
        return Legendre(coarse, self.weight), np.eye(coarse, self.n)

    def __repr__(self) -> str:
        return f"Legendre({self.n})" if self.measure == SINE else f"Legendre({self.n}, weight={self.weight!r})"


def legendre_moments(local: Floats, weight: Floats, degree: int, cell: NDArray[np.intp], cells: int) -> Floats:
    """Sums over the nodes in each cell of weights times L_0, ..., L_degree, shape (degree + 1, cells).

    ``local`` are the nodes in (-1, 1), ``weight`` their weights and ``cell`` their cells. The three-term recurrence
    (k + 1) L_(k + 1) = (2 k + 1) t L_k - k L_(k - 1) needs two polynomials in memory at a time.

    Examples
    --------
    >>> legendre_moments(np.array([-1.0, 0.5, 0.0]), np.array([1.0, 2.0, 1.0]), 2, np.array([0, 0, 1]), 2).tolist()
    [[3.0, 1.0], [0.0, 0.0], [0.75, -0.5]]
    """
    before, current = weight, weight * local
    moments = np.empty((degree + 1, cells))
    for k in range(degree + 1):
        moments[k] = np.bincount(cell, weights=before, minlength=cells)
        before, current = current, ((2 * k + 3) * local * current - (k + 1) * before) / (k + 2)
    return moments


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

    measure = SINE
    size = 3
    edges = frozen([0.0, np.pi])
    nodes_per_interval = GAUSS_NODES
    constant = frozen([1.0, 0.0, 0.0])

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


# Bound of the root mean square of the rounding errors of a node and its image, two sums each: 1.2 eps near pi.
NODE = 2.0 * EPS


def node_rounding(basis: Basis) -> float:
    """A bound of the change of a Galerkin matrix by the rounding of its quadrature nodes, in the Frobenius norm."""
    return NODE * basis.derivative_norm()
