"""A quantity of the standard set, and the methods for the matrix of a law: each alone, and the library's choice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...geometry import Wall
from ...kernels import Basis, Bins, KernelMatrix, PolygonLaw, WallLaw, discretise, estimate
from ...kernels.discretisation.method import Budget
from ...kernels.discretisation.traced import traced_matrix
from ...kernels.matrices.matrix import frobenius_error
from ...spectral import WorkMethod

# Methods with their budgets in the quick set and in the full set.
Methods = list[tuple[WorkMethod, tuple[float, ...], tuple[float, ...]]]
# Numbers of rays of sampling methods; the full ladder resolves orders to 0.15.
QUICK_RAYS, RAYS = tuple(4.0**k for k in (6, 7, 8)), tuple(4.0**k for k in (5, 6, 7, 8, 9, 10))
# Names of methods that are the library's own choice, or make references.
AUTO, CLOSED_FORM, BEAMS, ROWS, QMC = "auto", "closed form", "beams", "adaptive angles", "randomised QMC"
FLIGHTS = "flights"
# The error of sampled rays decreases with order 1/2. Strata and scrambled Sobol sequences in two dimensions reach 3/4
# if the integrand jumps along curves, as for indicators of bins and the laws of most walls.
RANDOM_ORDER, JUMPING_ORDER = 0.5, 0.75
# If the pieces of a wall are smaller than a stratum, its rays are as good as independent. A million strata have a side
# of 1/1024, so walls with more pieces than half of 1024 count as random.
MANY_PIECES = 512


@dataclass(frozen=True)
class Quantity:
    """A quantity of a wall.

    Attributes
    ----------
    name : str
    methods : callable
        ``methods(wall)`` returns triples of a `WorkMethod` and its budgets (quick, full).
    scenes : tuple of str
        Scenes of the standard set on which the quantity is measured.
    """

    name: str
    methods: Callable[[Wall], Methods]
    scenes: tuple[str, ...]


def matrix_methods(wall: Wall, basis: Basis) -> Methods:
    """The methods for the matrix of a wall's law that apply to the wall, the library's own choice first.

    The budget of "auto" and "adaptive angles" is 1/tolerance, that of "beams" the beams a hollow, with a bound for the
    others; all other methods have rays.

    >>> from asperity.bench.quantities.walls import wall_of
    >>> [[method.order for method, *_ in matrix_methods(wall_of(name), Bins(4))][-3:] for name in ("cusps", "profile")]
    [[0.75, 0.75, 0.5], [0.5, 0.5, 0.5]]
    """
    # strata and Sobol sequences exceed 3/4 for continuous integrands, so orders are declared for bins only
    order = (RANDOM_ORDER if len(wall.pieces) > MANY_PIECES else JUMPING_ORDER) if isinstance(basis, Bins) else None

    def chosen(budget: float, rng: np.random.Generator) -> KernelMatrix:
        # each repeat has its own generator for sampling
        return discretise(WallLaw(wall), basis, tolerance=1.0 / budget, rng=rng)

    def sobol(rays: float, rng: np.random.Generator) -> KernelMatrix:
        return discretise(WallLaw(wall), basis, "qmc", samples=int(rays), rng=rng)

    def beams(number: float) -> KernelMatrix:
        return discretise(PolygonLaw(wall, max_beams=int(number)), basis, "exact")

    def by_formula(_: float) -> KernelMatrix:
        return discretise(WallLaw(wall), basis)

    found: Methods = [(WorkMethod(AUTO, chosen, True), (1e2, 1e6), (1e2, 1e3, 1e4, 1e6, 1e8))]
    if not WallLaw(wall).has_traced_parts:
        found.append((WorkMethod(CLOSED_FORM, by_formula), (1.0,), (1.0,)))
    if wall.is_polygonal and wall.closes:
        found.append((WorkMethod(BEAMS, beams), (1e3, 1e4), (1e2, 1e3, 1e4, 1e5)))
    adaptive = WorkMethod(ROWS, lambda budget: adaptive_matrix(wall, basis, 1.0 / budget))
    sampled = (
        WorkMethod(QMC, sobol, True, order),
        WorkMethod("stratified", lambda rays, rng: stratified_matrix(wall, basis, rays, rng), True, order),
        WorkMethod("Monte Carlo", lambda rays, rng: monte_carlo_matrix(wall, basis, rays, rng), True, RANDOM_ORDER),
    )
    found.append((adaptive, (1e2, 1e3), (1e2, 1e3, 1e4, 1e6, 1e8)))
    return [*found, *((method, QUICK_RAYS, RAYS) for method in sampled)]


def adaptive_matrix(wall: Wall, basis: Basis, tolerance: float) -> KernelMatrix:
    """By adaptive conditional distributions, for every wall."""
    symmetric, error, rays = traced_matrix(wall, basis, Budget(tolerance))
    how = frobenius_error(error, "estimate", f"adaptive angles, {rays} rays")
    return KernelMatrix(symmetric, basis, how, method="adaptive angles")


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
