"""The method choice of `auto` for the law of a wall without further parts: isometries, rays or conditionals."""

from __future__ import annotations

from dataclasses import replace

from ...core.errors import AccuracyError
from ..bases.basis import Basis
from ..bases.partitions import Panels
from ..matrices.matrix import KernelMatrix
from ..sampling.sobol import SobolSampler
from ..walls.wall_law import FEW_PIECES, WallLaw
from .isometries import by_isometry_table
from .method import Budget, sobol_matrix
from .traced import by_adaptive_angles, first_segments

# These rays take .02 to .1 s. Their error has hardly ever been below the second number.
FIRST_RAYS, LEAST_ERROR = 2**17, 1e-5
# Walls of more pieces, and walls that do not close, have no conditionals.
MOST_PIECES = 16
# Nor walls whose first panels are predicted to need more than this fraction of the limit on ray segments.
FRACTION_OF_PANELS = 0.5
# All rays, eight times as many as the first, have hardly ever an error below this fraction of that of the first.
RAYS_GAIN = 1.0 / 16.0


def by_rays_or_conditionals(law: WallLaw, basis: Basis, budget: Budget) -> KernelMatrix:
    """The first of these matrices of an undivided wall that meets the tolerance, or else the most exact one.

    1. Isometries of a polygonal wall, if its beams resolve. If it has many pieces, after the first rays, but not on
       panels, and not if no rays reach the tolerance.
    2. The first rays.
    3. Conditional distributions, of walls that close and have few pieces.
    4. All rays.

    The error does not grow if the tolerance falls.
    """
    # on panels, mostly between the factors of a chain, rays would have to resolve hundreds of functions
    few = len(law.wall.cell.pieces) <= FEW_PIECES
    if (few or isinstance(basis, Panels) or budget.tolerance < LEAST_ERROR) and law.isometry_table() is not None:
        return by_isometry_table(law, basis, budget)
    sampler = SobolSampler(law, basis, budget.rng)
    first = _by_rays(sampler, replace(budget, rays=min(FIRST_RAYS, budget.rays)))
    if first is not None and float(first.error) <= budget.tolerance:
        return first
    reached, first = 0.0 if first is None else float(first.error), None
    if law.isometry_table() is not None:
        return by_isometry_table(law, basis, budget)
    if not _has_conditionals(law, basis, budget):
        return sobol_matrix(sampler, budget)
    found = by_adaptive_angles(law, basis, budget)
    if float(found.error) <= max(budget.tolerance, RAYS_GAIN * reached):
        return found
    rays = _by_rays(sampler, budget)
    return found if rays is None else min(found, rays, key=lambda matrix: float(matrix.error))


def _by_rays(sampler: SobolSampler, budget: Budget) -> KernelMatrix | None:
    """The matrix by rays; None if a bin has none or too many do not escape."""
    try:
        return sobol_matrix(sampler, budget)
    except AccuracyError:
        return None


def _has_conditionals(law: WallLaw, basis: Basis, budget: Budget) -> bool:
    """Whether the conditional distributions at the first panels are affordable."""
    few = law.wall.closes and len(law.wall.cell.pieces) <= MOST_PIECES
    return few and first_segments(law.wall, basis) <= FRACTION_OF_PANELS * budget.segments
