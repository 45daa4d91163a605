r"""The spectral gap of laws of grooves on the half sphere of velocities.

Let g_i be the planar gaps, in the specular frame, of the laws with weights w_i of a mixture of grooves of random
direction, and E the mean over all directions of grooves with a Lambertian cross section. On the functions of one
component b, P_i is at most 1 - g_i plus g_i times the projection on the constants, so that the mixture is at most
1 - G + G E as a quadratic form, G = sum w_i g_i. The eigenvalues of E on Zernike functions of degree n are 1/(n + 1).
Hence the gap is at least G/2, and the essential spectrum is at most 1 - G, because E is compact.

Where facets with the diffuse fraction a draw b anew, the law is P_i on means over b, and on the rest the law of rays
without a diffuse hit, of norm at most 1 - a. It is at most 1 - g_i plus g_i times the projection on the constants, with
the smaller of g_i and a for g_i, in any direction.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from ...core.errors import AccuracyError
from ...core.estimates import Estimate
from ...kernels import KernelMatrix, Law, Zernike, discretise
from ...kernels.bases.basis import Basis
from ...kernels.hemisphere.hemisphere_law import DirectionLaw, HemisphereLaw
from ...kernels.laws.structure import Discretiser, SpatialLaw
from ..eigenvalues.spectra import ONE_MATRIX, Verdict
from .verdict import SpectralGap

# Largest degrees of the Zernike functions, of a law that is invariant under rotations and of others.
DEGREES, DEGREES_TOGETHER = (8, 16, 32), (4, 8, 16)


def gap_of_grooves(
    law: DirectionLaw, tolerance: float, rng: np.random.Generator, planar_gap: Callable[[Law], Estimate]
) -> SpectralGap:
    """The gap from Zernike functions of growing degree, whose Rayleigh quotients bound it from above."""
    if not law.reversible:
        raise AccuracyError(
            f"{law!r} is not known to be symmetric with respect to the cosine law: its spectrum need not be real. Take "
            "a palindrome such as H1 @ H2 @ H1 for a product, in_specular_frame() of a mirror-symmetric wall for "
            "grooves of a fixed direction, or ker.discretise(H, ker.Zernike(8))",
            np.inf,
        )
    used = [laws for _, laws in law.parts]
    angles = [one.orientation for laws in used for one in laws]
    fixed = [float(angle) for angle in angles if not isinstance(angle, str)]
    redraws = any(isinstance(one, HemisphereLaw) and one.redrawing is not None for laws in used for one in laws)
    if len(fixed) == len(angles) and np.ptp(np.mod(fixed, np.pi)) == 0.0 and not redraws:
        reason = "all grooves have the same direction: every function of the velocity along them is kept"
        return SpectralGap(0.0, 0.0, "bound", "structure of the law", "no gap", (reason,), "specular")

    @lru_cache
    def planar(one: Law | SpatialLaw, basis: Basis) -> KernelMatrix:
        return discretise(one, basis, tolerance=0.1 * tolerance, rng=rng)

    value, change, wrong = np.inf, np.inf, 0.0
    invariant = law.rotation_invariant
    degrees = DEGREES if invariant else DEGREES_TOGETHER
    for degree in degrees:
        top, wrong = _largest(law, degree, planar, invariant)
        value, change = 1.0 - top, abs(1.0 - top - value)
        if change + wrong <= tolerance:
            break
    reasons = [f"the Rayleigh quotient of functions of degree {degree} bounds the gap from above"]
    together = 0.0
    if all(len(laws) == 1 for laws in used):
        together = sum(weight * _at_least(laws[0], planar_gap) for weight, laws in law.parts)
        reasons.append(
            f"the mean of the planar gaps is at least G = {together:.6g}: the gap is at least G/2, and the essential "
            "spectrum at most 1 - G"
        )
    verdict: Verdict = "isolated" if value + change + wrong < together else "undecided"
    # without an isolated eigenvalue convergence may be slow
    change *= 1.0 if verdict == "isolated" else ONE_MATRIX
    # where narrow grooves show at high degrees only, early changes are too small: they say that the tolerance is met
    change = change if degree == degrees[-1] else max(change, tolerance)
    error = min(change, max(value - 0.5 * together, 0.0)) + wrong
    method = f"{Zernike(degree)!r}, change from half the degree + error of planar matrices"
    return SpectralGap(value, error, "estimate", method, verdict, tuple(reasons), "specular").cut_at_zero()


def _largest(law: DirectionLaw, degree: int, planar: Discretiser, invariant: bool) -> tuple[float, float]:
    """The largest eigenvalue of the matrix off the constants, and the error of the matrix as an operator."""
    top, wrong = -np.inf, 0.0
    for order in range(degree + 1) if invariant else (None,):
        found = law.entries(degree, order, planar)
        # the constants come first
        off = found.symmetric if order else found.symmetric[1:, 1:]
        top, wrong = max(top, float(np.linalg.eigvalsh(off)[-1])), max(wrong, found.error)
    return top, wrong


def _at_least(law: DirectionLaw, planar_gap: Callable[[Law], Estimate]) -> float:
    """The planar gap less its error for grooves of random direction; 0 for those of a fixed one and for surfaces.

    If diffuse facets draw the velocity along the grooves anew, it is at most their fraction, for any direction.
    """
    if not isinstance(law, HemisphereLaw) or (law.redrawing is None and not isinstance(law.orientation, str)):
        return 0.0
    found = planar_gap(law.specular)
    most = 1.0 if law.redrawing is None else law.redrawing.diffuse_fraction or 0.0
    return min(max(found.value - found.error, 0.0), most)
