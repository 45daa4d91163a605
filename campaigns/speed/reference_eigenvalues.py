"""lambda_2 of the standard set by independent methods: theorems, another program, rays and extrapolation."""

from __future__ import annotations

import numpy as np

from asperity import geometry as geo
from asperity import kernels as ker
from asperity.bench.quantities import wall_of
from asperity.core.checks import Floats

from .reference_rays import NETS, Found, sampled_sums

RAYS = 2**24
# Value for the focusing arcs, by piecewise polynomials in another program, and its error.
ARC_LAMBDA2, ARC_ERROR = 0.3670253152, 3e-10
# Sizes of the extrapolated Legendre matrices.
SIZES = (16, 32, 64)
# What is left, in changes of degree: Galerkin values lie below, and degrees 2 and 4 on panels ten times as fine gave
# 0.17004 and 0.17031, four times the change from degree 2 to 3 here.
REST = 4.0
# Coarse and fine degree of the panels of the cusps, number of panel edges towards each special angle, and ratio of the
# smallest to the largest distance.
DEGREES, PANELS, SMALLEST = (2, 3), 9, 1e-3
GRAZING_ANGLES, GRAZING_POINTS = (1e-5, 1e-6, 1e-7), 2**22


def reference_eigenvalue(scene: str) -> Found | None:
    """The largest spectral value off the constants, or None if no independent value is known."""
    wall = wall_of(scene)
    if wall.is_polygonal:
        return Found(np.asarray(1.0), 0.0, "theorem: 1 is in the essential spectrum of isometries")
    makers = {"focusing-arc": _of_arc, "cusps": _of_cusps, "mixed": _of_mixed, "mushroom": _of_mushroom}
    return makers[scene](wall)


def _of_arc(wall: geo.Wall) -> Found:
    return Found(np.asarray(ARC_LAMBDA2), ARC_ERROR, "another program, piecewise polynomials on graded panels")


def _of_cusps(wall: geo.Wall) -> Found:
    """On panels graded towards grazing and towards pi/2, where rays stay long in the cusp."""
    near = 0.25 * np.pi * np.geomspace(SMALLEST, 1.0, PANELS)
    edges = np.unique(
        np.concatenate([[0.0, np.pi], near, np.pi - near, 0.5 * np.pi - near, [0.5 * np.pi], 0.5 * np.pi + near])
    )
    bases: dict[str, ker.Basis] = {str(degree): ker.Panels(edges, degree) for degree in DEGREES}
    nets = sampled_sums(wall, bases, RAYS)
    coarse, fine = (_jackknifed(nets[name], basis.constant) for name, basis in bases.items())
    error = REST * abs(fine[0] - coarse[0]) + 2.0 * fine[1]
    source = (
        f"panels of degree {DEGREES[1]}, graded towards pi/2 and grazing, from {RAYS} rays; below the eigenvalue by "
        f"{REST:g} times the change of degree at most, and spread"
    )
    return Found(np.asarray(fine[0]), error, source)


def _of_mixed(wall: geo.Wall) -> Found:
    """Aitken's extrapolation of Galerkin values for three sizes, which increase with the basis."""
    basis = ker.Legendre(SIZES[-1])
    nets = sampled_sums(wall, {"": basis}, RAYS)[""]
    parts = [_jackknifed([net[:n, :n] for net in nets], basis.constant[:n]) for n in SIZES]
    first, second, third = (value for value, _ in parts)
    rest = (third - second) ** 2 / ((second - first) - (third - second))
    source = f"Legendre {SIZES}, from {RAYS} rays, extrapolated; error half of the extrapolation, and spread"
    return Found(np.asarray(third + rest), 0.5 * rest + 2.0 * parts[-1][1], source)


def _of_mushroom(wall: geo.Wall) -> Found:
    """The edge of the essential spectrum, E[sin(theta)/sin(theta')] as theta -> 0, from rays at three small angles."""
    entry = (np.arange(GRAZING_POINTS) + 0.5) / GRAZING_POINTS
    law = ker.WallLaw(wall)
    ratios = [
        float(np.mean(np.sin(angle) / np.sin(law.reflect(entry, np.full_like(entry, angle)))))
        for angle in GRAZING_ANGLES
    ]
    angles = ", ".join(f"{angle:g}" for angle in GRAZING_ANGLES)
    source = f"edge of the essential spectrum, from rays at the angles {angles}; nothing seen beyond, without proof"
    return Found(np.asarray(np.mean(ratios)), 4.0 * float(np.ptp(ratios)), source)


def _jackknifed(nets: list[Floats], constant: Floats) -> tuple[float, float]:
    """Largest eigenvalue off the constants of the mean of independent matrices, with bias removed, and its error."""
    total = np.sum(nets, axis=0)
    whole = _largest(total / NETS, constant)
    parts = np.array([_largest((total - net) / (NETS - 1), constant) for net in nets])
    value = NETS * whole - (NETS - 1) * float(parts.mean())
    return value, float(np.sqrt((NETS - 1) * parts.var()))


def _largest(matrix: Floats, constant: Floats) -> float:
    direction = constant / np.linalg.norm(constant)
    off = np.eye(len(matrix)) - np.outer(direction, direction)
    return float(np.linalg.eigvalsh(off @ matrix @ off)[-1])
