"""The ideal laws: specular, retroreflection, Lambertian, and the mixture of Maxwell and Smoluchowski."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...core.checks import Floats, finite_array, number_between
from ..bases.measure import SINE
from .density import DensityLaw, angle_pair
from .law import Combination, specular


@dataclass(frozen=True, init=False, repr=False)
class LambertianLaw(DensityLaw):
    """The law whose outgoing angle has the density sin(theta')/2 for every incoming angle."""

    reversible = True
    mirror_symmetric = True
    is_lambertian = True

    def __init__(self) -> None:
        """Takes no arguments."""

    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats:
        """sin(theta')/2, in the shape to which the two arguments broadcast."""
        incoming, outgoing = angle_pair(theta, theta_out)
        return np.broadcast_to(SINE.density(outgoing), np.broadcast_shapes(incoming.shape, outgoing.shape))

    def panels(self, theta: Floats) -> Floats:
        """One panel."""
        return np.broadcast_to([0.0, np.pi], (*finite_array("theta", theta).shape, 2))

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return SINE.sample(theta.shape, rng)

    def __repr__(self) -> str:
        return "lambertian()"


def lambertian() -> LambertianLaw:
    """Diffuse reflection: theta' has the density sin(theta')/2 for every theta (Rudzis 2022, section 1.2.5).

    Examples
    --------
    >>> round(float(lambertian().apply(lambda theta: np.cos(theta) ** 2, 1.0)), 14)
    0.33333333333333
    """
    return LambertianLaw()


def maxwell(diffuse_fraction: float) -> Combination:
    """The law of Maxwell and Smoluchowski: diffuse with probability ``diffuse_fraction`` in [0, 1], else specular.

    Let a be the diffuse fraction. In the paper's convention the eigenvalues are 1 on constants, 1 - a on even functions
    of cos(theta) of mean zero, and -(1 - a) on odd functions. In the specular frame both are 1 - a.

    Examples
    --------
    >>> maxwell(0.25)
    0.25*lambertian() + 0.75*specular()
    """
    diffuse = number_between("diffuse_fraction", diffuse_fraction, 0.0, 1.0, closed="low high")
    return diffuse * lambertian() + (1.0 - diffuse) * specular()
