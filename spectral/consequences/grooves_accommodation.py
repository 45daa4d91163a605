"""Momentum accommodation in space of walls with grooves, from the planar coefficients, and of mixtures of walls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ...core.errors import InputError
from ...core.estimates import ErrorKind, Estimate, Summary
from ...kernels import HemisphereLaw, Law, SurfaceLaw
from ...kernels.bases.polynomials import SINE_NORM
from ...kernels.hemisphere.hemisphere_law import DirectionLaw

# Ratios of the coefficients in space to those of the cross section. The cosine law has E|v_t|^2 = 1/2, half of it
# across the grooves. With s = sqrt(1 - b^2), v_n = s sin(theta): E s^2 = 3/4, and Var v_n = E v_n^2 - (E v_n)^2 =
# 1/2 - 4/9 = 1/18, so that the change of v_n has the weight (3/4) SINE_NORM^2 / (1/18).
TANGENTIAL, NORMAL = 0.5, 13.5 * SINE_NORM**2
# E|v_t|^2 and Var v_n over their sum: weights of the two coefficients in the fraction.
WEIGHTS = 0.9, 0.1


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
    """

    tangential: Estimate
    normal: Estimate
    maxwell_fraction: Estimate


def in_space(
    law: DirectionLaw,
    planar: Callable[[Law], tuple[Estimate, ...]],
    of_surface: Callable[[SurfaceLaw], SpaceAccommodation],
) -> SpaceAccommodation:
    """The coefficients of a mixture, from those of its surfaces, and the planar ones of its grooves."""
    if any(len(laws) > 1 for _, laws in law.parts):
        raise InputError(
            f"{law!r}: expected a law of one collision, a law of one wall or a mixture of such; of a product of random "
            "directions 1 - H.matrix(1, 1).symmetric[0, 0] is the tangential coefficient"
        )
    terms: list[list[tuple[float, Estimate]]] = [[], []]
    found: tuple[Estimate, ...]
    for weight, (one,) in law.parts:
        if isinstance(one, SurfaceLaw):
            space = of_surface(one)
            found, ratios = (space.tangential, space.normal), (1.0, 1.0)
        else:
            assert isinstance(one, HemisphereLaw)
            found, ratios = planar(one.law)[:2], (TANGENTIAL, NORMAL)
        for term, ratio, each in zip(terms, ratios, found, strict=True):
            term.append((ratio * weight, each))
    tangential, normal = map(_combined, terms)
    return SpaceAccommodation(tangential, normal, nearest_maxwell(tangential, normal))


def nearest_maxwell(tangential: Estimate, normal: Estimate) -> Estimate:
    """The fraction in [0, 1] of the Maxwell law with the nearest mean reflected velocities."""
    mean = _combined(list(zip(WEIGHTS, (tangential, normal), strict=True)))
    return Estimate(min(max(mean.value, 0.0), 1.0), mean.error, mean.kind, mean.method)


def _combined(terms: list[tuple[float, Estimate]]) -> Estimate:
    """A sum with positive weights."""
    value = sum(weight * one.value for weight, one in terms)
    error = sum(weight * one.error for weight, one in terms)
    kind: ErrorKind = "bound" if all(one.kind == "bound" for _, one in terms) else "estimate"
    return Estimate(value, error, kind, "; ".join(dict.fromkeys(one.method for _, one in terms)))
