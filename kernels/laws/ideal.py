"""The ideal laws: specular, retroreflection, Lambertian, and the mixture of Maxwell and Smoluchowski."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...checks import Floats, angles, number_between
from ..bases.angles import flipped
from ..bases.measure import SINE
from .density import DensityLaw
from .law import BranchLaw, Combination


@dataclass(frozen=True, repr=False)
class IsometryLaw(BranchLaw):
    """The deterministic law theta' = theta (``retro``) or theta' = pi - theta."""

    retro: bool

    mirror_symmetric = True
    fan_out = 1

    def branches(self, theta: ArrayLike) -> tuple[Floats, Floats]:
        """One branch, of probability 1."""
        theta = angles("theta", theta)
        outgoing = theta.copy() if self.retro else flipped(theta)
        return np.ones((*theta.shape, 1)), outgoing[..., None]

    def kinks(self, limit: int) -> tuple[Floats, float]:
        """None at all."""
        return np.empty(0), 0.0

    def __repr__(self) -> str:
        return "retroreflection()" if self.retro else "specular()"


@dataclass(frozen=True, init=False, repr=False)
class LambertianLaw(DensityLaw):
    """The law that forgets the incoming angle: theta' has the density sin(theta')/2."""

    reversible = True
    mirror_symmetric = True

    def __init__(self) -> None:
        """Takes no arguments."""

    def density(self, theta: ArrayLike, theta_out: ArrayLike) -> Floats:
        """sin(theta')/2, in the shape to which the two arguments broadcast."""
        shape = np.broadcast_shapes(np.shape(theta), np.shape(theta_out))
        return np.broadcast_to(SINE.density(theta_out), shape)

    def _sample(self, theta: Floats, rng: np.random.Generator) -> Floats:
        return SINE.sample(theta.shape, rng)

    def __repr__(self) -> str:
        return "lambertian()"


def specular() -> IsometryLaw:
    """Specular reflection, theta' = pi - theta in the paper's convention: the law of a flat wall.

    Examples
    --------
    >>> float(specular().sample(np.pi / 4, np.random.default_rng(0))) == np.pi * 3 / 4
    True
    """
    return IsometryLaw(retro=False)


def retroreflection() -> IsometryLaw:
    """Retroreflection, theta' = theta: the particle goes back where it came from.

    Examples
    --------
    >>> float(retroreflection().sample(0.5, np.random.default_rng(0)))
    0.5
    """
    return IsometryLaw(retro=True)


def lambertian() -> LambertianLaw:
    """Diffuse reflection: theta' has the density sin(theta')/2 whatever theta was (Rudzis 2022, section 1.2.5).

    Examples
    --------
    >>> round(float(lambertian().apply(lambda theta: np.cos(theta) ** 2, 1.0)), 14)
    0.33333333333333
    """
    return LambertianLaw()


def maxwell(diffuse_fraction: float) -> Combination:
    """The law of Maxwell and Smoluchowski: diffuse with probability ``diffuse_fraction`` in [0, 1], else specular.

    Its eigenvalues are 1 on constants, 1 - a on even functions of cos(theta) of mean zero and -(1 - a) on odd ones,
    a the diffuse fraction, in the paper's convention; in the specular frame 1 - a on both.

    Examples
    --------
    >>> maxwell(0.25)
    0.25*lambertian() + 0.75*specular()
    """
    diffuse = number_between("diffuse_fraction", diffuse_fraction, 0.0, 1.0, closed="low high")
    return diffuse * lambertian() + (1.0 - diffuse) * specular()
