"""The method choice of `auto` for the law of a wall without closed form: five rules, tried in this order."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple, cast

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
from .traced import Traced, may_be_affordable

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
    4. Adaptive quadrature, if its first segments predict an error not far above half of that of ``budget.rays`` rays.
    5. ``budget.rays`` rays. Of the last two, the more exact matrix.

    This takes a second or two, and up to five where many rays near corners are traced with more digits. If it misses
    the tolerance and the budget has more segments, as for `resistance`, adaptive quadrature continues until they are
    used up.
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
        sampler, affordable = SobolSampler(law, basis, budget.rng), may_be_affordable(law.wall)
        pilot = _few_rays(law, sampler, basis, budget, affordable)
        if pilot.found is not None:
            return pilot.found
        if law.exact_law is not None:
            return IsometryTables().matrix(law.exact_law, basis, budget)
        if not affordable:
            return sobol_matrix(sampler, basis, budget)
        return _traced_or_all_rays(law, sampler, basis, budget, pilot.predicted)


def rays_of_whole(law: Law, basis: Basis, budget: Budget) -> KernelMatrix | None:
    """The matrix of a wall that is taken apart, by a few rays that enter anywhere; None if they miss the tolerance.

    Each hollow by itself takes some tenths of a second, whatever the tolerance.
    """
    taken_apart = isinstance(law, WallLaw) and law.closed_form is None and law.replacement is not None
    if not taken_apart or budget.tolerance * MANY_RAYS < 1.0:
        return None
    return _pilot(SobolSampler(law, basis, budget.rng), basis, budget, FIRST_RAYS, MANY_RAYS).found


class _Pilot(NamedTuple):
    """The matrix within the tolerance, or None; the number of rays that it needs, and the predicted error of all rays.

    If it needs more than all, the number is at least that of all; if a few rays do not tell it, the error is inf.
    """

    found: KernelMatrix | None
    needed: int
    predicted: float


def _few_rays(law: WallLaw, sampler: SobolSampler, basis: Basis, budget: Budget, affordable: bool) -> _Pilot:
    """The matrix by as many rays as the tolerance needs, or by quadrature with fewer segments, if it is affordable."""
    # Even an error of order 1 in the number of rays would miss the tolerance, so a pilot run is useless.
    if not affordable and budget.tolerance * budget.rays < 1.0:
        return _Pilot(None, budget.rays, math.inf)
    pilot = _pilot(sampler, basis, budget, FIRST_RAYS, MANY_RAYS)
    if pilot.found is not None or pilot.needed >= budget.rays:
        return pilot
    if affordable:
        traced = Traced().matrix(law, basis, replace(budget, segments=pilot.needed, fallback=budget.tolerance))
        if float(traced.error) <= budget.tolerance:
            return _Pilot(traced, pilot.needed, float(traced.error))
    return _pilot(sampler, basis, budget, pilot.needed, budget.rays)


def _pilot(sampler: SobolSampler, basis: Basis, budget: Budget, first: int, most: int) -> _Pilot:
    """The matrix by ``first`` rays, or as many more, fewer than ``most``, as are predicted to meet the tolerance."""
    predicted, number = math.inf, first
    while number < min(most, budget.rays):
        try:
            found = sobol_matrix(sampler, basis, replace(budget, rays=number))
        except AccuracyError:
            # A bin has no rays, or too many rays do not escape, so this number of rays predicts nothing.
            return _Pilot(None, budget.rays, predicted)
        error = float(found.error)
        if error <= budget.tolerance:
            return _Pilot(found, number, error)
        predicted = error * (number / budget.rays) ** SOBOL_ORDER
        if error > budget.tolerance * (budget.rays / (SOBOL_MARGIN * number)) ** SOBOL_ORDER:
            return _Pilot(None, budget.rays, predicted)
        needed = SOBOL_MARGIN * number * (error / budget.tolerance) ** (1.0 / SOBOL_ORDER)
        number = max(2 * number, int(needed))
    return _Pilot(None, number, predicted)


def _traced_or_all_rays(
    law: WallLaw, sampler: SobolSampler, basis: Basis, budget: Budget, predicted: float
) -> KernelMatrix:
    """The more exact of both matrices; one of the methods is skipped if the other suffices.

    Raises AccuracyError if too many rays do not escape and quadrature left the work to them.
    """
    rays = _all_rays(sampler, basis, budget) if predicted <= budget.tolerance else None
    if rays is not None:
        predicted = float(rays.error)
        if predicted <= budget.tolerance:
            return rays
    # no matrix is worth more than an error of its largest norm
    fallback = max(min(TRACED_ADVANTAGE * predicted, math.sqrt(basis.size)), budget.tolerance)
    traced = Traced().matrix(law, basis, replace(budget, fallback=fallback))
    error = float(traced.error)
    if math.isinf(error):
        return rays or sobol_matrix(sampler, basis, budget)
    if error <= budget.tolerance or error <= predicted < math.inf:
        return traced
    rays = rays or _all_rays(sampler, basis, budget)
    return traced if rays is None else _more_exact(traced, rays)


def _all_rays(sampler: SobolSampler, basis: Basis, budget: Budget) -> KernelMatrix | None:
    """The matrix by rays; None if too many rays do not escape, which traced angles include in their error."""
    try:
        return sobol_matrix(sampler, basis, budget)
    except AccuracyError:
        return None


def _more_exact(first: KernelMatrix, second: KernelMatrix) -> KernelMatrix:
    return min(first, second, key=lambda matrix: float(matrix.error))
