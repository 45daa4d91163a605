"""Momentum accommodation in space of walls with grooves, from the planar coefficients, and of mixtures of walls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from ...core.errors import InputError
from ...core.estimates import ErrorKind, Estimate, Summary
from ...kernels import FacetedLaw, HemisphereLaw, Law, SurfaceLaw, discretise
from ...kernels.bases.polynomials import MEAN_SINE, SINE_NORM, Directions
from ...kernels.discretisation.radiosity import UnscatteredRays
from ...kernels.hemisphere.hemisphere_law import DirectionLaw

# Ratios of the coefficients in space to those of the cross section. The cosine law has E|v_t|^2 = 1/2, half of it
# across the grooves. With s = sqrt(1 - b^2), v_n = s sin(theta): E s^2 = 3/4, and Var v_n = E v_n^2 - (E v_n)^2 =
# 1/2 - 4/9 = 1/18, so that the change of v_n has the weight (3/4) SINE_NORM^2 / (1/18).
TANGENTIAL, NORMAL = 0.5, 13.5 * SINE_NORM**2
# Where diffuse facets draw b anew, the planar law P acts on means over b, and its rays without a diffuse hit on the
# rest. Of the mean square of a, and of the variance of v_n, the means over b are these fractions: E s = 8/(3 pi).
MEAN_SPEED = 8.0 / (3.0 * np.pi)
ACROSS, UP = MEAN_SPEED**2 / 0.75, 18.0 * MEAN_SPEED**2 * SINE_NORM**2
KEPT = Estimate(0.0, 0.0, "bound", "grooves keep the velocity along them")
# E|v_t|^2 and Var v_n over their sum: weights of the two coefficients in the fraction.
WEIGHTS = 0.9, 0.1

Term: TypeAlias = tuple[float, Estimate]


@dataclass(frozen=True, repr=False)
class SpaceAccommodation(Summary):
    r"""How far particles that a wall reflects forget the momentum with which they came.

    Incoming velocities of speed 1 have the cosine law, and walls of any direction the same means: of a drifting gas
    averaged over the directions of the drift in the plane.

    Attributes
    ----------
    tangential : Estimate
        1 - E<v_t, v_t'>/E|v_t|^2. Of grooves it is half the planar coefficient: they keep one of two components.
    normal : Estimate
        1 - Cov(-v_n, v_n')/Var v_n. Of grooves it is the planar coefficient times 9 - 27 pi^2/32 = 0.6725...
    maxwell_fraction : Estimate
        The f in [0, 1] whose Maxwell law has the nearest mean reflected velocities: .9 tangential + .1 normal.
    across, along : Estimate or None
        The tangential coefficient across and along the grooves, whose mean is ``tangential``; None with surfaces.
        Along, it is 0, unless facets are diffuse in space: then it is the probability of a diffuse hit.
    """

    tangential: Estimate
    normal: Estimate
    maxwell_fraction: Estimate
    across: Estimate | None = field(default=None, kw_only=True)
    along: Estimate | None = field(default=None, kw_only=True)


def in_space(
    law: DirectionLaw,
    planar: Callable[[Law], tuple[Estimate, ...]],
    of_surface: Callable[[SurfaceLaw], SpaceAccommodation],
    rng: np.random.Generator,
) -> SpaceAccommodation:
    """The coefficients of a mixture, from those of its surfaces, and the planar ones of its grooves."""
    if any(len(laws) > 1 for _, laws in law.parts):
        raise InputError(
            f"{law!r}: expected a law of one collision, a law of one wall or a mixture of such; of a product of random "
            "directions 1 - H.matrix(1, 1).symmetric[0, 0] is the tangential coefficient"
        )
    tangential, normal, sides = list[Term](), list[Term](), (list[Term](), list[Term]())
    has_sides = True
    for weight, (one,) in law.parts:
        if isinstance(one, SurfaceLaw):
            space, has_sides = of_surface(one), False
            tangential.append((weight, space.tangential))
            normal.append((weight, space.normal))
            continue
        assert isinstance(one, HemisphereLaw)
        across, up = planar(one.law)[:2]
        along, ratio = KEPT, NORMAL
        if one.redrawing is not None:
            across, along, up = _redrawn(one.redrawing, across, up, rng)
            ratio = 1.0
        normal.append((ratio * weight, up))
        for terms, each in zip(sides, (across, along), strict=True):
            terms.append((weight, each))
            tangential.append((TANGENTIAL * weight, each))
    mean, mean_up = _combined(tangential), _combined(normal)
    both = {name: _combined(terms) for name, terms in zip(("across", "along"), sides, strict=True) if has_sides}
    return SpaceAccommodation(mean, mean_up, nearest_maxwell(mean, mean_up), **both)


def _redrawn(
    law: FacetedLaw, across: Estimate, normal: Estimate, rng: np.random.Generator
) -> tuple[Estimate, Estimate, Estimate]:
    """The coefficients across, along and normal, from the planar ones, where diffuse facets draw b anew."""
    rest = discretise(UnscatteredRays(law), Directions(), rng=rng)
    entry, error = rest.symmetric, float(rest.error)
    raised = np.array([MEAN_SINE, 0.0, SINE_NORM])
    # Var s E sin(theta)^2 over Var v_n is 1 - UP, E sin(theta)^2 = 2/3
    unscattered = np.array([-entry[1, 1], entry[0, 0], 1.5 * raised @ entry @ raised])
    found = []
    for fraction, planar, own in zip((ACROSS, 0.0, UP), (across, across, normal), unscattered.tolist(), strict=True):
        value = 1.0 - fraction * (1.0 - planar.value) - (1.0 - fraction) * own
        method = f"{planar.method}; rays without a diffuse hit"
        found.append(Estimate(value, fraction * planar.error + (1.0 - fraction) * error, "estimate", method))
    return found[0], found[1], found[2]


def nearest_maxwell(tangential: Estimate, normal: Estimate) -> Estimate:
    """The fraction in [0, 1] of the Maxwell law with the nearest mean reflected velocities."""
    mean = _combined(list(zip(WEIGHTS, (tangential, normal), strict=True)))
    return Estimate(min(max(mean.value, 0.0), 1.0), mean.error, mean.kind, mean.method)


def _combined(terms: list[Term]) -> Estimate:
    """A sum with positive weights."""
    value = sum(weight * one.value for weight, one in terms)
    error = sum(weight * one.error for weight, one in terms)
    kind: ErrorKind = "bound" if all(one.kind == "bound" for _, one in terms) else "estimate"
    return Estimate(value, error, kind, "; ".join(dict.fromkeys(one.method for _, one in terms)))
