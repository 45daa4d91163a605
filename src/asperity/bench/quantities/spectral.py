"""The largest spectral value off the constants, and the slope of diffusion in a long channel between two walls."""

from __future__ import annotations

import numpy as np

from ...core.estimates import Estimate
from ...geometry import Wall
from ...kernels import Basis, Bins, Legendre, Panels, WallLaw, discretise
from ...spectral import WorkMethod, diffusivity, spectral_gap, spectrum
from .methods import AUTO, Methods, Quantity
from .walls import standard_names

# Entry points at one grazing angle; the error of their midpoint rule is below the error of the finite angle.
ENTRY_POINTS = 2**16
ETA_SCENES = ("focusing-arc", "koch", "mixed")


def _second(wall: Wall, basis: Basis) -> Estimate:
    # the spectrum of the matrix, because for the law theorems and essential edges would be used
    found = spectrum(discretise(WallLaw(wall), basis), k=2)
    return Estimate(1.0 - found.gap, found.gap_error, "estimate", f"{found.basis!r}, {found.method}")


def _auto_second(wall: Wall, budget: float, rng: np.random.Generator) -> Estimate:
    gap = spectral_gap(WallLaw(wall), tolerance=1.0 / budget, rng=rng)
    return Estimate(1.0 - gap.value, gap.error, gap.kind, f"{gap.verdict}: {gap.method}")


def _eigenvalue_methods(wall: Wall) -> Methods:
    def panels(degree: int) -> Estimate:
        return _second(wall, Panels.for_wall(wall, degree=degree, smallest=1e-3))

    sizes = (4.0, 8.0, 16.0)
    return [
        (WorkMethod(AUTO, lambda n, rng: _auto_second(wall, n, rng), True), (1e2,), (1e2, 1e4, 1e6)),
        (WorkMethod("Legendre", lambda n: _second(wall, Legendre(n))), sizes, (*sizes, 32.0, 64.0)),
        (WorkMethod("bins", lambda n: _second(wall, Bins(n))), sizes, (*sizes, 32.0, 64.0, 128.0)),
        (WorkMethod("panels", panels), (1.0, 2.0), (1.0, 2.0, 3.0, 4.0)),
    ]


def _diffusivity_methods(wall: Wall) -> Methods:
    angles = (1e1, 1e2, 1e3)
    return [
        (WorkMethod(AUTO, lambda budget: _auto_eta(wall)), (1.0,), (1.0,)),
        (WorkMethod("rays at the angle 1/budget", lambda n: eta_at(wall, 1.0 / n)), angles, (*angles, 1e4, 1e5, 1e6)),
    ]


def _auto_eta(wall: Wall) -> Estimate:
    found = diffusivity(WallLaw(wall))
    return Estimate(found.eta, found.eta_error, found.kind, found.method)


def eta_at(wall: Wall, angle: float) -> float:
    """(1 + zeta)/(1 - zeta) with zeta = E[cot(Theta)/cot(theta)] at a small angle and its mirror image."""
    entry = (np.arange(ENTRY_POINTS) + 0.5) / ENTRY_POINTS
    law, total = WallLaw(wall), 0.0
    for theta in (angle, np.pi - angle):
        # the sign of cot(Theta) is opposite in the specular convention
        total -= float(np.mean(np.tan(theta) / np.tan(law.reflect(entry, theta))))
    return (1.0 + 0.5 * total) / (1.0 - 0.5 * total)


# The largest spectral value off the constants.
EIGENVALUE = Quantity("lambda2", _eigenvalue_methods, standard_names())
# The slope of L^2/tau against ln L in a long channel, over that between diffuse walls.
DIFFUSIVITY = Quantity("eta", _diffusivity_methods, ETA_SCENES)
