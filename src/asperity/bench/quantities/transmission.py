"""The transmission of a channel ten widths long, or of a tube ten radii long."""

from __future__ import annotations

import numpy as np

from ...core.estimates import Estimate
from ...kernels import HemisphereLaw, Law, WallLaw, lambertian
from ...spectral import WorkMethod, transmission
from ...spectral.consequences.clausing import Section
from .methods import AUTO, FLIGHTS, Methods, Quantity

LENGTH = 10.0
# Scenes that have no wall: their channel or tube reflects diffusely.
DIFFUSE: dict[str, Section] = {"diffuse-channel": "channel", "diffuse-tube": "tube"}


def diffuse_methods(scene: str) -> Methods:
    """The methods for diffuse reflection."""
    return _methods(lambertian(), DIFFUSE[scene])


def _methods(law: Law, section: Section) -> Methods:
    def chosen(budget: float, rng: np.random.Generator) -> Estimate:
        return transmission(law, LENGTH, section, 1.0 / budget, rng)

    def flights(budget: float, rng: np.random.Generator) -> Estimate:
        # in space, where no polynomials are tried
        return transmission(HemisphereLaw(law, 0.5 * np.pi), LENGTH, section, 1.0 / budget, rng)

    found: Methods = [(WorkMethod(AUTO, chosen, True), (1e2, 1e3), (1e2, 1e3, 1e4, 1e5))]
    # laws of grooves contain no diffuse reflection in a tube
    if section == "channel":
        found.append((WorkMethod(FLIGHTS, flights, True), (4e2, 1e3), (4e2, 1e3, 2e3)))
    return found


# The probability that a particle passes.
TRANSMISSION = Quantity("transmission", lambda wall: _methods(WallLaw(wall), "channel"), ("focusing-arc", *DIFFUSE))
