"""The mean of a function of the incoming and the outgoing angle, such as the resistance of a rough surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, instance, positive_number
from ...core.errors import InputError
from ...core.estimates import Estimate, Summary, student_95
from ...core.long_runs import TIME_LIMIT, reported
from ...geometry.scene.scene import SEGMENT_TIME
from ..bases.basis import Basis
from ..bases.given import Vectorised
from ..bases.measure import SINE, gauss_rule
from ..bases.partitions import Panels
from ..bases.polynomials import Directions
from ..discretisation.method import Budget
from ..discretisation.methods import matrix_by
from ..laws.law import Law
from ..laws.structure import has_chain
from ..matrices.matrix import KernelMatrix
from ..sampling.counts import half_width

CostFunction = Callable[[Floats, Floats], Floats]

# The cost is replaced by polynomials of this degree on panels of this width; cos and sin have an error of 1e-14.
DEGREE, WIDTH = 10, np.pi / 4.0
# Largest number of halvings of the panels, until the cost is represented to the tolerance.
MOST_HALVINGS = 3
# Fraction of the tolerance for the error of the matrix.
MATRIX_FRACTION = 0.5
# Angles per panel, at Gauss nodes of another rule, at which the polynomials are compared with the cost.
PROBES = 17


@dataclass(frozen=True, repr=False)
class StreamForce(Summary):
    """The force of a parallel stream on a body, in units of the momentum flux of the stream.

    Attributes
    ----------
    along, across : Estimate
        Components along the stream (the resistance) and across it, positive to its left.
    """

    along: Estimate
    across: Estimate


def air_resistance(theta: Floats, outgoing: Floats) -> Floats:
    """Plakhov's cost (3/4)(1 + cos(theta' - theta)), whose mean is 1 for a smooth surface.

    Examples
    --------
    Retroreflection has the largest cost.

    >>> float(air_resistance(np.array(1.25), np.array(1.25)))
    1.5
    """
    return np.asarray(0.75 * (1.0 + np.cos(outgoing - theta)))


@reported("resistance")
def resistance(
    law: Law,
    tolerance: float = 1e-10,
    *,
    cost: CostFunction = air_resistance,
    breakpoints: ArrayLike = (),
    time_limit: float = TIME_LIMIT,
) -> Estimate:
    r"""The mean resistance E[c(theta, theta')] of a surface with the given law.

    The default is R = (3/4) E[1 + cos(theta' - theta)] with theta distributed as sin(theta)/2 d theta: the resistance
    of a tumbling rough convex body in a thin medium, relative to the smooth body.

    Parameters
    ----------
    law : Law
        A law in the paper's convention.
    tolerance : float
        Wanted error; ``error`` is the error reached.
    cost : callable
        ``cost(theta, theta_out)`` of two arrays that broadcast, radians; smooth between the breakpoints. For another
        distribution of incoming angles it is the cost times the density with respect to sin(theta)/2 d theta.
    breakpoints : array_like, optional
        Angles in (0, pi) at which the cost is not smooth.
    time_limit : float
        Limit in seconds on the quadrature of a traced wall, counted as some million ray segments each, so that the
        result does not depend on the machine.

    Returns
    -------
    Estimate
        The error is the sum of the error of the law's matrix on `Panels` and of the distance of the cost from piecewise
        polynomials, measured between their nodes.

    Raises
    ------
    InputError
        If the law is in the specular frame, or the cost is not vectorised or not finite.

    Notes
    -----
    If c(theta, theta') = sum_ij c_ij e_i(theta) e_j(theta') in an orthonormal basis, the mean is sum_ij c_ij S_ij with
    the matrix S of the law.

    Source: A. Plakhov, "Billiards and two-dimensional problems of optimal resistance", Arch. Ration. Mech. Anal. 194
    (2009); Rudzis 2022, section 1.2.7.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> round(float(resistance(ker.specular())), 12), round(float(resistance(ker.retroreflection())), 12)
    (1.0, 1.5)
    >>> round(float(resistance(ker.lambertian())), 12) == round(0.75 * (1 + np.pi**2 / 16), 12)
    True
    """
    instance("law", law, Law, "ker.lambertian()")
    if law.frame != "paper":
        raise InputError(f"law: expected one in the paper's convention, got {law!r}; call in_specular_frame() on it")
    wanted, seconds = positive_number("tolerance", tolerance), positive_number("time_limit", time_limit)

    if cost is air_resistance and not has_chain(law):
        # three functions suffice; a product of laws needs a basis that can be refined
        basis: Basis = Directions()
        coefficients, missed = _projected(cost, basis)
    else:
        basis, coefficients, missed = _represented(cost, finite_array("breakpoints", breakpoints), 0.1 * wanted)
    size = float(np.linalg.norm(coefficients))
    budget = Budget(MATRIX_FRACTION * wanted / max(size, 1.0), segments=int(seconds / SEGMENT_TIME))
    matrix = matrix_by(law, "auto", basis, budget)
    value = float(np.sum(coefficients * matrix.symmetric))
    error = _error(matrix, coefficients) + missed
    how = f"{matrix.method} on {basis!r} ({matrix.error.method})"
    return Estimate(value, error, matrix.error.kind, how)


def scaled(found: Estimate, factor: float) -> Estimate:
    """The estimate of ``factor`` times the quantity."""
    return replace(found, value=factor * found.value, error=factor * found.error)


def _error(matrix: KernelMatrix, coefficients: Floats) -> float:
    """The error of sum_ij c_ij S_ij: from replicates for sampled rays, else from that of S by Cauchy and Schwarz."""
    size, parts = float(np.linalg.norm(coefficients)), len(matrix.replicates)
    if parts < 2:
        return size * float(matrix.error)
    each = [float((part * coefficients).sum()) for part in matrix.replicates]
    other = max(float(matrix.error) - half_width(matrix.symmetric, matrix.replicates), 0.0)
    return student_95(parts) * float(np.std(each, ddof=1)) / math.sqrt(parts) + size * other


def _represented(function: CostFunction, breakpoints: Floats, tolerance: float) -> tuple[Panels, Floats, float]:
    """Panels, the coefficients of a function of two angles on them, and the largest error of its polynomials."""
    inside = breakpoints[(breakpoints > 0.0) & (breakpoints < np.pi)]
    pieces = round(np.pi / WIDTH)
    for halving in range(MOST_HALVINGS + 1):
        uniform = np.linspace(0.0, np.pi, pieces * 2**halving + 1)
        basis = Panels(np.unique(np.concatenate((uniform, inside))), DEGREE)
        coefficients, missed = _projected(function, basis)
        if missed <= tolerance:
            break
    return basis, coefficients, missed


def _projected(function: CostFunction, basis: Basis) -> tuple[Floats, float]:
    angle, weight = SINE.quadrature(basis.edges, basis.nodes_per_interval)
    values = basis.evaluate(angle)
    table = _table(function, angle)
    coefficients = (values * weight[:, None]).T @ table @ (values * weight[:, None])
    probe, _ = gauss_rule(basis.edges, PROBES)
    at_probes = basis.evaluate(probe)
    missed = np.abs(_table(function, probe) - at_probes @ coefficients @ at_probes.T)
    return coefficients, float(missed.max())


def _table(function: CostFunction, angle: Floats) -> Floats:
    return finite_array("cost", Vectorised(function, scalar=True)(angle[:, None], angle))
