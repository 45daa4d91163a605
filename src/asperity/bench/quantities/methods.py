"""The methods for the matrix of a wall's law: each method alone, and the library's choice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...geometry import Wall
from ...kernels import Basis, KernelMatrix, PolygonLaw, WallLaw, discretise, estimate
from ...kernels.discretisation.method import Budget
from ...kernels.discretisation.traced import traced_matrix
from ...kernels.matrices.matrix import frobenius_error
from .quantity import QUICK_RAYS, RAYS

MakeMatrix = Callable[..., KernelMatrix]
# The error of sampled rays decreases with order 1/2. Strata and scrambled Sobol sequences in two dimensions reach 3/4
# if the integrand jumps along curves, as for indicators of bins and the laws of most walls.
RANDOM_ORDER, JUMPING_ORDER = 0.5, 0.75
# If the pieces of a wall are smaller than a stratum, its rays are as good as independent. A million strata have a side
# of 1/1024, so walls with more pieces than half of 1024 count as random.
MANY_PIECES = 512


@dataclass(frozen=True)
class MatrixMethod:
    """One method for a matrix.

    Attributes
    ----------
    name : str
    matrix : callable
        ``matrix(wall, basis, budget)`` or ``matrix(wall, basis, budget, rng)``.
    quick, full : tuple of float
        Budgets of the quick and the full set.
    is_random : bool
    order : float or None
        Declared order of the error for matrices in bins.
    """

    name: str
    matrix: MakeMatrix
    quick: tuple[float, ...]
    full: tuple[float, ...]
    is_random: bool = False
    order: float | None = None


def methods_for(wall: Wall) -> tuple[MatrixMethod, ...]:
    """The methods that apply to a wall, the library's own choice first."""
    found = [AUTO]
    if WallLaw(wall).closed_form is not None:
        found.append(CLOSED_FORM)
    if wall.is_polygonal and wall.closes:
        found.append(BEAMS)
    found += [ROWS, QMC, STRATIFIED, MONTE_CARLO]
    return tuple(found)


def declared_order(chosen: MatrixMethod, wall: Wall) -> float | None:
    """The order of a method for matrices in bins, at the ladders' numbers of rays.

    >>> from asperity.bench.quantities.walls import wall_of
    >>> [declared_order(STRATIFIED, wall_of(name)) for name in ("cusps", "profile")]
    [0.75, 0.5]
    """
    return RANDOM_ORDER if chosen.order == JUMPING_ORDER and len(wall.pieces) > MANY_PIECES else chosen.order


def closed_form_matrix(wall: Wall, basis: Basis, budget: float = 1.0) -> KernelMatrix:
    """From the closed form of the wall's hollows."""
    law = WallLaw(wall).closed_form
    assert law is not None  # `methods_for` checks that the closed form exists
    return discretise(law, basis)


def beam_matrix(wall: Wall, basis: Basis, budget: float) -> KernelMatrix:
    """From at most ``budget`` beams for each hollow, with a bound for the others."""
    return discretise(PolygonLaw(wall, max_beams=int(budget)), basis, "exact")


def adaptive_matrix(wall: Wall, basis: Basis, budget: float) -> KernelMatrix:
    """By adaptive conditional distributions to the tolerance 1/budget, for every wall."""
    symmetric, error, rays = traced_matrix(wall, basis, Budget(1.0 / budget))
    how = frobenius_error(error, "estimate", f"adaptive angles, {rays} rays")
    return KernelMatrix(symmetric, basis, how, method="adaptive angles")


def qmc_matrix(wall: Wall, basis: Basis, budget: float, rng: np.random.Generator) -> KernelMatrix:
    """From ``budget`` rays of scrambled Sobol sequences."""
    return discretise(WallLaw(wall), basis, "qmc", samples=int(budget), rng=rng)


def stratified_matrix(wall: Wall, basis: Basis, budget: float, rng: np.random.Generator) -> KernelMatrix:
    """From one ray in every cell of a square grid over entry point and u."""
    side = round(budget**0.5)
    cell = np.arange(side)
    x = (cell[:, None] + rng.random((side, side))) / side
    u = -1.0 + 2.0 * (cell + rng.random((side, side))) / side
    theta = np.arccos(-u).ravel()
    return estimate(theta, WallLaw(wall).reflect(x.ravel(), theta), basis)


def monte_carlo_matrix(wall: Wall, basis: Basis, budget: float, rng: np.random.Generator) -> KernelMatrix:
    """From ``budget`` independent rays, traced even if a closed form could be sampled."""
    theta = np.arccos(1.0 - 2.0 * rng.random(int(budget)))
    return estimate(theta, WallLaw(wall).reflect(rng.random(int(budget)), theta), basis)


def auto_matrix(wall: Wall, basis: Basis, budget: float, rng: np.random.Generator) -> KernelMatrix:
    """By the library's choice, to the tolerance 1/budget; each repeat has its own generator for sampling."""
    return discretise(WallLaw(wall), basis, tolerance=1.0 / budget, rng=rng)


# The budget of AUTO and ROWS is 1/tolerance, that of BEAMS the beams a hollow; the others have rays.
AUTO = MatrixMethod("auto", auto_matrix, (1e2, 1e6), (1e2, 1e3, 1e4, 1e6, 1e8), True)
CLOSED_FORM = MatrixMethod("closed form", closed_form_matrix, (1.0,), (1.0,))
BEAMS = MatrixMethod("beams", beam_matrix, (1e3, 1e4), (1e2, 1e3, 1e4, 1e5))
ROWS = MatrixMethod("adaptive angles", adaptive_matrix, (1e2, 1e3), (1e2, 1e3, 1e4, 1e6, 1e8))
QMC = MatrixMethod("randomised QMC", qmc_matrix, QUICK_RAYS, RAYS, True, JUMPING_ORDER)
STRATIFIED = MatrixMethod("stratified", stratified_matrix, QUICK_RAYS, RAYS, True, JUMPING_ORDER)
MONTE_CARLO = MatrixMethod("Monte Carlo", monte_carlo_matrix, QUICK_RAYS, RAYS, True, RANDOM_ORDER)
