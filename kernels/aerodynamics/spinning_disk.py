"""Force and torque of a stream of particles on a rotating rough disk (the Magnus effect of a rarefied gas)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats, finite_number, positive_number
from ...core.errors import InputError
from ...core.estimates import Estimate, Summary
from ..bases.measure import gauss_rule
from ..laws.law import Law, is_atomic

# Equal panels over the lit half of the rim, besides those at breakpoints of the law, and Gauss nodes on each. The finer
# rule halves every panel.
PANELS, NODES = 96, 6
# Breakpoints used at most, of laws with exact means and of others, whose means take longer.
BREAKPOINTS, FEW_BREAKPOINTS = 4000, 100
# On a panel with a kink of the integrand, the error of the finer rule is below this multiple of the difference of both
# rules for all but a few positions of the kink.
SAFETY = 2.0
# Error of means of a law by traced rays, relative to a function of size 1.
TRACED = 1e-8


@dataclass(frozen=True, repr=False)
class SpinForce(Summary):
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

    along: Estimate
    across: Estimate
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
        The error is twice the sum over all panels of the differences of two rules, plus that of the law's means, plus a
        bound for grazing angles at which the law has more breakpoints than are used.

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
    exact = is_atomic(law)
    breakpoints, left_out = law.breakpoints(BREAKPOINTS if exact else FEW_BREAKPOINTS)
    edges = _edges(breakpoints, rate)
    finer = np.sort(np.concatenate((edges, 0.5 * (edges[1:] + edges[:-1]))))
    coarse, fine = _forces(law, rate, edges), _forces(law, rate, finer)
    rounding = (1e-13 if exact else TRACED) * (2.0 + abs(rate))
    errors = SAFETY * np.abs(fine.reshape(3, -1, 2).sum(axis=2) - coarse).sum(axis=1) + rounding
    if math.isfinite(left_out):
        errors = errors + _grazing(left_out, rate, finer)
    fine = fine.sum(axis=1)
    scale = np.array([size, size, size * size])
    how = f"Gauss rules of {len(edges) - 1} and {len(finer) - 1} panels"
    along, across, torque = (
        Estimate(float(value), float(error), "estimate", how)
        for value, error in zip(scale * fine, scale * errors, strict=True)
    )
    return SpinForce(along, across, torque)


def _edges(angles: Floats, spin: float) -> Floats:
    """Polar angles of panels of the lit half of the rim, with those at which the angle is one of the given ones."""
    # the angle is theta where cos(phi + theta) = -spin sin(theta)
    level = -spin * np.sin(angles)
    turn = np.arccos(np.clip(level, -1.0, 1.0))
    found = np.concatenate([sign * turn - angles + 2.0 * math.pi * k for sign in (1.0, -1.0) for k in (0, 1)])
    inside = found[(np.abs(found) < 0.5 * math.pi) & np.tile(np.abs(level) <= 1.0, 4)]
    return np.asarray(np.unique(np.concatenate((np.linspace(-0.5 * math.pi, 0.5 * math.pi, PANELS + 1), inside))))


def _grazing(measure: float, spin: float, edges: Floats) -> float:
    """The momentum flux, twice, of particles at grazing angles of this measure under sin(theta)/2 d theta."""
    nodes, weight = gauss_rule(edges + 0.5 * math.pi, NODES)
    level, up = np.sin(nodes - 0.5 * math.pi) - spin, np.sin(nodes)
    speed = np.hypot(level, up)
    # the measure may lie at one of both ends, where it is (1 - cos)/2
    grazing = np.abs(level) >= speed * (1.0 - 2.0 * measure)
    return float(2.0 * np.sum(weight * up * speed * grazing)) if measure > 0.0 else 0.0


def _forces(law: Law, spin: float, edges: Floats) -> Floats:
    """Along, across and torque from every panel for radius 1, shape (3, panels); the stream has velocity (-1, 0)."""
    # the rule is for (0, pi)
    nodes, weight = gauss_rule(edges + 0.5 * math.pi, NODES)
    # polar angle of the element's outer normal
    normal = nodes - 0.5 * math.pi
    cosine, sine = np.cos(normal), np.sin(normal)
    # minus the velocity relative to the rim: along the clockwise tangent, and along the normal
    level, up = sine - spin, cosine
    speed = np.hypot(level, up)
    theta = np.clip(np.arctan2(up, level), 1e-300, np.nextafter(math.pi, 0.0))
    out_level = speed * law.apply(np.cos, theta)
    out_up = speed * law.apply(np.sin, theta)
    # momentum that the particle leaves behind, in the frame (clockwise tangent, normal) of the element
    push_level, push_up = -(level + out_level), -(up + out_up)
    flux = weight * cosine
    x = flux * (push_level * sine + push_up * cosine)
    y = flux * (-push_level * cosine + push_up * sine)
    parts = np.stack([-x, -y, -flux * push_level])
    return np.asarray(parts.reshape(3, -1, NODES).sum(axis=2))
