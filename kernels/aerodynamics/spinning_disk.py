"""Force and torque of a stream of particles on a rotating rough disk (the Magnus effect of a rarefied gas)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats, finite_number, positive_number
from ...core.errors import InputError
from ...core.estimates import Estimate
from ..bases.measure import LARGEST_ANGLE, SMALLEST_ANGLE
from ..expectations.conditionals import Conditionals
from ..laws.law import Law, is_atomic
from ..laws.structure import has_chain, multiplied_out
from .drag import StreamForce

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
TOLERANCE, MEAN_TOLERANCE, DEGREE, HIGHER, AT_ONCE = 1e-9, 1e-10, 8, 64, 256
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
    if not isinstance(law, Law) or law.frame != "paper":
        raise InputError(f"law: expected one in the paper's convention, got {law!r}")
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
    for start in range(0, angle.size, AT_ONCE):
        some = angle[start : start + AT_ONCE]
        given = law.conditionals(some, MEAN_TOLERANCE, DEGREE)
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
