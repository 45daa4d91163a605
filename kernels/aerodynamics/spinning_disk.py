"""Force and torque of a stream of particles on a rotating rough disk (the Magnus effect of a rarefied gas)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...core.checks import Floats, finite_number, positive_number
from ...core.errors import InputError
from ...core.estimates import Estimate
from ...core.kinds import explained
from ..bases.measure import gauss_rule
from ..laws.law import Law

# Panels of the coarser rule over the lit half of the rim, and Gauss nodes on each; the finer rule has twice the panels.
PANELS, NODES = 48, 6
# Error of means of a law by traced rays, relative to a function of size 1.
TRACED = 1e-8


@dataclass(frozen=True)
class SpinForce:
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


@explained
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
        The error is the difference of two rules, plus that of the law's means.

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
    coarse, fine = (_forces(law, rate, panels) for panels in (PANELS, 2 * PANELS))
    rounding = (1e-13 if law.exact_apply else TRACED) * (2.0 + abs(rate))
    errors = np.abs(fine - coarse) + rounding
    scale = np.array([size, size, size * size])
    how = f"Gauss rules of {PANELS} and {2 * PANELS} panels"
    along, across, torque = (
        Estimate(float(value), float(error), "estimate", how)
        for value, error in zip(scale * fine, scale * errors, strict=True)
    )
    return SpinForce(along, across, torque)


def _forces(law: Law, spin: float, panels: int) -> Floats:
    """Along, across and torque for radius 1; the stream has the velocity (-1, 0)."""
    edges = np.linspace(0.0, math.pi, panels + 1)
    nodes, weight = gauss_rule(edges, NODES)
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
    x = flux @ (push_level * sine + push_up * cosine)
    y = flux @ (-push_level * cosine + push_up * sine)
    return np.array([-x, -y, flux @ -push_level])
