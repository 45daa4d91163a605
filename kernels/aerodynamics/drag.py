"""Resistance of a rough surface, and force and torque of a stream of particles on a rotating rough disk."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, finite_number, positive_number
from ...core.estimates import Estimate, Summary, student_95
from ...core.given import Vectorised
from ...core.long_runs import TIME_LIMIT, reported, slices
from ...geometry.scene.scene import SEGMENT_TIME
from ..bases.basis import Basis
from ..bases.measure import LARGEST_ANGLE, SINE, SMALLEST_ANGLE, gauss_rule
from ..bases.partitions import Panels
from ..bases.polynomials import Directions
from ..discretisation.method import Budget
from ..discretisation.methods import matrix_by
from ..expectations.conditionals import Conditionals
from ..laws.law import Law, check_paper_frame, is_atomic
from ..laws.structure import has_chain, multiplied_out
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
    check_paper_frame("law", law)
    wanted, seconds = positive_number("tolerance", tolerance), positive_number("time_limit", time_limit)

    if cost is air_resistance and not has_chain(law):
        # three functions suffice; a product of laws needs a basis that can be refined
        basis: Basis = Directions()
        coefficients, missed = _projected(cost, basis)
    else:
        basis, coefficients, missed = _represented(cost, finite_array("breakpoints", breakpoints), 0.1 * wanted)
    size = float(np.linalg.norm(coefficients))
    budget = Budget(MATRIX_FRACTION * wanted / max(size, 1.0), segments=int(min(seconds / SEGMENT_TIME, 1e18)))
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


# Equal panels over the directions of all normals, besides those at breakpoints, and points of Chebyshev on each, also
# beside its ends; these are less than 0.019 apart. The matrix gives the coefficients of Legendre polynomials.
PANELS, NODES = 48, (1.0 - 1e-9) * np.cos(np.linspace(np.pi, 0.0, 12))
COEFFICIENTS = np.linalg.inv(np.polynomial.legendre.legvander(NODES, NODES.size - 1))
# The largest of this number of last coefficients is above the error of the integral over the panel: of a function with
# a jump, a kink or a square root the error is at most 0.38 of it, of a strip with two jumps 0.46.
LAST = 4
# Breakpoints used at most, of laws with exact means and of others, whose means take longer.
BREAKPOINTS, FEW_BREAKPOINTS = 4000, 100
# Panels that are halved at most.
MOST_HALVED = 2000
# Wanted error of forces, and of the means of laws; degree of cosine and sine, and a higher one, where errors of means
# are not known. Incoming angles at a time.
TOLERANCE, MEAN_TOLERANCE, FEWEST_DEGREES, HIGHER, AT_ONCE = 1e-9, 1e-10, 8, 64, 256
# Rounding of the momentum of one particle.
ROUNDING = 1e-15


@dataclass(frozen=True, repr=False)
class SpinForce(StreamForce):
    """Force and torque on a rotating disk, in units of the momentum flux of the stream.

    Attributes
    ----------
    along : Estimate
        Force along the stream (drag).
    across : Estimate
        Force across it, positive to the left of the stream. For a disk that turns against the clock a positive value
        is the inverse Magnus effect.
    torque : Estimate
        Torque about the centre, positive against the clock; negative values brake a positive spin.
    """

    torque: Estimate


def spin_force(law: Law, spin: float, radius: float = 1.0) -> SpinForce:
    r"""The force and the torque of a parallel stream on a disk with a rough rim that rotates.

    Parameters
    ----------
    law : Law
        P~ of the rim, in the paper's convention.
    spin : float
        omega r/v, the speed of the rim over that of the stream; positive against the clock.
    radius : float

    Returns
    -------
    SpinForce
        The error is the sum of what polynomials miss on panels, which are halved until it is 1e-9 of the momentum flux
        or 2,000 are halved, and of the errors of the law's means.

    Raises
    ------
    InputError
        If an argument is not as described.

    Notes
    -----
    In the frame of an element of the rim, which moves along itself, a particle has another angle and speed. There it is
    reflected by P~ at this angle with unchanged speed; its momentum transfer is the same in both frames. The flux onto
    an element does not depend on the spin, because the motion of the rim has no normal component.

    Source: A. Plakhov and T. Tchemisova, "Force acting on a spinning rough disk in a flow of non-interacting particles"
    (2009); Rudzis 2022, section 1.2.7.

    Examples
    --------
    A retroreflecting disk has drag 4, force pi omega across, and torque -4 omega; a smooth one feels no spin:

    >>> from asperity import kernels as ker
    >>> force = ker.spin_force(ker.retroreflection(), 0.5)
    >>> round(float(force.along), 9), round(float(force.across) / np.pi, 9), round(float(force.torque), 9)
    (4.0, 0.5, -2.0)
    >>> smooth = ker.spin_force(ker.specular(), 0.5)
    >>> round(3 * float(smooth.along), 9), abs(round(float(smooth.across), 9)), abs(round(float(smooth.torque), 9))
    (8.0, 0.0, 0.0)
    """
    check_paper_frame("law", law)
    rate, size = finite_number("spin", spin), positive_number("radius", radius)
    whole = np.linspace(-0.5 * math.pi, 0.5 * math.pi, PANELS // 2 + 1)
    edges = np.unique(np.concatenate((whole, normals_at_breakpoints(law, rate))))
    found, errors, panels = integral(lambda normal: pushes(law, normal, rate), edges, TOLERANCE * (1.0 + abs(rate)))
    scale = np.array([size, size, size * size])
    how = f"polynomials on {panels.size - 1} panels"
    return SpinForce(*(Estimate(*pair, "estimate", how) for pair in zip(scale * found, scale * errors, strict=True)))


def normals_at_breakpoints(law: Law, spin: float) -> Floats:
    """Directions of the lit normals, from that of the stream's source, where the incoming angle is a breakpoint."""
    angles, _ = law.breakpoints(BREAKPOINTS if is_atomic(law) else FEW_BREAKPOINTS)
    # the angle is theta where cos(phi + theta) = -spin sin(theta)
    level = -spin * np.sin(angles)
    turn = np.arccos(np.clip(level, -1.0, 1.0))
    found = np.concatenate([sign * turn - angles + 2.0 * math.pi * k for sign in (1.0, -1.0) for k in (0, 1)])
    return np.asarray(found[(np.abs(found) < 0.5 * math.pi) & np.tile(np.abs(level) <= 1.0, 4)])


def integral(function: Callable[[Floats], Floats], edges: Floats, tolerance: float) -> tuple[Floats, Floats, Floats]:
    """Integrals of functions with values (rows, angles), their errors, and the edges of the panels in the end.

    The last row bounds the errors of the other rows. Panels are halved where the last coefficients of polynomials
    exceed the integral of this row and a part of the tolerance.
    """
    low, high = edges[:-1], edges[1:]
    part, halved, ends = tolerance / low.size, 0, [edges]
    total, error = np.zeros(1), np.zeros(1)
    while low.size:
        half = 0.5 * (high - low)
        values = function(((low + half)[:, None] + half[:, None] * NODES).ravel())
        found = values.reshape(len(values), low.size, -1) @ COEFFICIENTS.T * (high - low)[:, None]
        missed = np.abs(found[:-1, :, -LAST:]).max(axis=2)
        more = (missed.max(axis=0) > part + found[-1, :, 0]) & (halved < MOST_HALVED)
        total = total + found[:, ~more, 0].sum(axis=1)
        error = error + missed[:, ~more].sum(axis=1)
        middle, halved = (low + half)[more], halved + int(np.count_nonzero(more))
        ends.append(middle)
        low, high = np.append(low[more], middle), np.append(middle, high[more])
    return total[:-1], error + total[-1], np.unique(np.concatenate(ends))


def pushes(law: Law, normal: Floats, spin: float) -> Floats:
    """Along, across, torque and their error for an element of unit length of a unit disk, shape (4, normals).

    The directions of the normals are counted from that of the source of the stream.
    """
    found = np.zeros((4, normal.size))
    lit = np.cos(normal) > 0.0
    cosine, sine = np.cos(normal[lit]), np.sin(normal[lit])
    # minus the velocity relative to the rim: along the clockwise tangent, and along the normal
    level, up = sine - spin, cosine
    speed = np.hypot(level, up)
    means, wrong = _mean_directions(law, np.clip(np.arctan2(up, level), SMALLEST_ANGLE, LARGEST_ANGLE))
    # momentum that the particle leaves behind, in the frame (clockwise tangent, normal) of the element
    push_level, push_up = -(level + speed * means[:, 0]), -(up + speed * means[:, 1])
    x, y = push_level * sine + push_up * cosine, -push_level * cosine + push_up * sine
    # both means have the error
    found[:, lit] = cosine * np.stack([-x, -y, -push_level, speed * (math.sqrt(2.0) * wrong + ROUNDING)])
    return found


def _mean_directions(law: Law, theta: Floats) -> tuple[Floats, Floats]:
    """E[cos theta'] and E[sin theta'] at incoming angles, shape (angles, 2), and their errors."""
    # the errors of the means of a sum of chains may be known where those of a chain of sums are not
    law = multiplied_out(law) if has_chain(law) else law
    angle, back = law._distinct(theta)
    means, errors = [np.empty((0, 2))], [np.empty(0)]
    for some in (angle[part] for part in slices(angle.size, AT_ONCE)):
        given = law.conditionals(some, MEAN_TOLERANCE, FEWEST_DEGREES)
        mean, error = given.mean(_components), given.error
        if np.isnan(error).any():
            other = law.conditionals(some, MEAN_TOLERANCE, HIGHER)
            if np.array_equal(other.nodes, given.nodes):
                other = _every_second(given)
            error = np.abs(other.mean(_components) - mean).max(axis=1)
        means.append(mean)
        errors.append(error)
    return np.concatenate(means)[back], np.concatenate(errors)[back]


def _components(angle: Floats) -> Floats:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _every_second(given: Conditionals) -> Conditionals:
    """Half of the nodes of each distribution, which average over entry points."""
    first = (np.arange(given.nodes.size) - given.starts[given.owner]) % 2 == 0
    return Conditionals.of_lists(given.owner[first], given.nodes[first], given.weights[first], given.error)
