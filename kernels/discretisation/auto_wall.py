"""The method choice of `auto` for the law of a wall without closed form: five rules, tried in this order."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import cast

from ...core.errors import AccuracyError
from ..bases.basis import Basis
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix
from ..sampling.sobol import SobolSampler
from ..walls.conditionals import is_few
from ..walls.wall_law import FEW_PIECES, WallLaw
from .isometry_tables import IsometryTables
from .method import QUICK_SEGMENTS, Budget, MethodName
from .sampled import sobol_matrix
from .traced import Traced

# A pilot run of FIRST_RAYS rays predicts how many the tolerance needs. The error of a scrambled Sobol sequence falls
# like the number of rays to the power -SOBOL_ORDER if the integrand jumps across a curve. It is known to a factor of 2.
FIRST_RAYS, SOBOL_ORDER, SOBOL_MARGIN = 2**14, 0.75, 2.0
# From this number of rays on, traced angles get a pilot run with this number of segments; a ray has two or three.
MANY_RAYS = 2**17
# Traced angles that take longer than all rays must predict at most this fraction of the rays' error.
TRACED_ADVANTAGE = 0.5


class AutoWall:
    """Walls without closed form, by the method predicted to meet the tolerance first, or to have the least error.

    1. Isometries, if the wall has few pieces and its beams resolve; this takes less time than a few rays.
    2. The number of rays that the tolerance needs by a pilot run, if that is less than ``budget.rays``; or adaptive
       quadrature, if it meets the tolerance with fewer segments.
    3. Isometries of many pieces, if their beams resolve.
    4. Adaptive quadrature, if its first angles predict at most half of the error of ``budget.rays`` rays.
    5. ``budget.rays`` rays. Of the last two, the more exact matrix.

    This takes a second or two. If it misses the tolerance and the budget has more segments, as for `resistance`,
    adaptive quadrature continues until they are used up.
    """

    name: MethodName = "auto"

    def accepts(self, law: Law, basis: Basis) -> bool:
        return isinstance(law, WallLaw) and law.closed_form is None

    def matrix(self, law: Law, basis: Basis, budget: Budget) -> KernelMatrix:
        wall_law = cast(WallLaw, law)
        quick = replace(budget, segments=min(budget.segments, QUICK_SEGMENTS))
        found = self._quick(wall_law, basis, quick)
        more = budget.segments > quick.segments and is_few(wall_law.wall)
        if not more or float(found.error) <= budget.tolerance:
            return found
        return _more_exact(found, Traced().matrix(law, basis, budget))

    def _quick(self, law: WallLaw, basis: Basis, budget: Budget) -> KernelMatrix:
        if len(law.wall.pieces) <= FEW_PIECES and law.exact_law is not None:
            return IsometryTables().matrix(law.exact_law, basis, budget)
        sampler = SobolSampler(law, basis, budget.rng)
        found, predicted = _few_rays(law, sampler, basis, budget)
        if found is not None:
            return found
        if law.exact_law is not None:
            return IsometryTables().matrix(law.exact_law, basis, budget)
        if not Traced().accepts(law, basis):
            return sobol_matrix(sampler, basis, budget)
        return _traced_or_all_rays(law, sampler, basis, budget, predicted)


def _few_rays(law: WallLaw, sampler: SobolSampler, basis: Basis, budget: Budget) -> tuple[KernelMatrix | None, float]:
    """The matrix within the tolerance by fewer than ``budget.rays`` rays, or None; and the predicted error of all rays.

    The predicted error is inf if a few rays do not predict it.
    """
    predicted, number, affordable = math.inf, FIRST_RAYS, Traced().accepts(law, basis)
    # Even an error of order 1 in the number of rays would miss the tolerance, so a pilot run is useless.
    if not affordable and budget.tolerance * budget.rays < 1.0:
        return None, predicted
    while number < budget.rays:
        try:
            found = sobol_matrix(sampler, basis, replace(budget, rays=number))
        except AccuracyError:
            # A bin has no rays, or too many rays do not escape, so this number of rays predicts nothing.
            break
        error = float(found.error)
        if error <= budget.tolerance:
            return found, error
        predicted = error * (number / budget.rays) ** SOBOL_ORDER
        if error > budget.tolerance * (budget.rays / (SOBOL_MARGIN * number)) ** SOBOL_ORDER:
            break
        needed = SOBOL_MARGIN * number * (error / budget.tolerance) ** (1.0 / SOBOL_ORDER)
        number = max(2 * number, int(needed))
        if affordable and number >= MANY_RAYS:
            found = Traced().matrix(law, basis, replace(budget, segments=number, fallback=budget.tolerance))
            if float(found.error) <= budget.tolerance:
                return found, predicted
    return None, predicted


def _traced_or_all_rays(
    law: WallLaw, sampler: SobolSampler, basis: Basis, budget: Budget, predicted: float
) -> KernelMatrix:
    """The more exact of both matrices; one of the methods is skipped if the other suffices."""
    rays = _all_rays(sampler, basis, budget) if predicted <= budget.tolerance else None
    if rays is not None:
        predicted = float(rays.error)
        if predicted <= budget.tolerance:
            return rays
    fallback = max(TRACED_ADVANTAGE * predicted, budget.tolerance)
    traced = Traced().matrix(law, basis, replace(budget, fallback=fallback))
    error = float(traced.error)
    if error <= budget.tolerance or error <= predicted < math.inf:
        return traced
    rays = _all_rays(sampler, basis, budget) if rays is None else rays
    return traced if rays is None else _more_exact(traced, rays)


def _all_rays(sampler: SobolSampler, basis: Basis, budget: Budget) -> KernelMatrix | None:
    """The matrix by rays; None if too many rays do not escape, which traced angles include in their error."""
    try:
        return sobol_matrix(sampler, basis, budget)
    except AccuracyError:
        return None


def _more_exact(first: KernelMatrix, second: KernelMatrix) -> KernelMatrix:
    return min(first, second, key=lambda matrix: float(matrix.error))
