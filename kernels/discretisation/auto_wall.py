"""The method choice of `auto` for the law of a wall without closed form: five rules, tried in this order."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple, cast

from ...core.errors import AccuracyError
from ...geometry.scene.scene import SEGMENT_TIME
from ..bases.basis import Basis
from ..laws.law import Law
from ..matrices.matrix import KernelMatrix
from ..sampling.sobol import SobolSampler, whole_sequences
from ..walls.conditionals import is_few
from ..walls.wall_law import FEW_PIECES, WallLaw
from .isometry_tables import IsometryTables
from .method import QUICK_SEGMENTS, Budget, MethodName
from .sampled import sobol_matrix
from .traced import Traced, may_be_affordable

# A pilot run of PILOT_RAYS rays, or of some for every function, predicts how many the tolerance needs, FIRST_RAYS at
# least. It is no result: rays that end where their own spread happens to be small report errors that are too small. The
# margin makes the first result likely to be the last. Of simulated normal errors of order 0.75 or 1, at least 94.7 %
# lie within the half widths of 95 %, and 92.7 % if the pilot run can be the result.
PILOT_RAYS, RAYS_A_FUNCTION, FIRST_RAYS, SOBOL_MARGIN = 2**11, 4, 2**14, 2.0
# The error of a scrambled Sobol sequence falls like the number of rays to the power -SOBOL_ORDER if the integrand jumps
# across a curve, and like -1/2 on walls with more pieces than ROUGH_PIECES, finer than the strata of a million rays.
SOBOL_ORDER, ROUGH_ORDER, ROUGH_PIECES = 0.75, 0.5, 512
# From this number of rays on, traced angles are tried with the segments that take the time of these rays: on twelve
# walls a segment took .17 to .35 us with its quadrature, a ray .12 to .25 us.
MANY_RAYS, RAYS_A_SEGMENT = 2**17, 1.6
# Traced angles that take longer than all rays must predict at most this fraction of the rays' error.
TRACED_ADVANTAGE = 0.5


class AutoWall:
    """Walls without closed form, by the method predicted to meet the tolerance first, or to have the least error.

    1. Isometries, if the wall has few pieces and its beams resolve; this takes less time than a few rays.
    2. The number of rays that the tolerance needs by a pilot run, if that is less than ``budget.rays``; or adaptive
       quadrature, if it meets the tolerance with fewer segments. The pilot run itself is no result.
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
        segments = int(budget.segments * SEGMENT_TIME / wall_law.wall.scene.segment_time)
        return _more_exact(found, Traced().matrix(law, basis, replace(budget, segments=segments)))

    def _quick(self, law: WallLaw, basis: Basis, budget: Budget) -> KernelMatrix:
        if len(law.wall.pieces) <= FEW_PIECES and law.exact_law is not None:
            return IsometryTables().matrix(law.exact_law, basis, budget)
        sampler, affordable = SobolSampler(law, basis, budget.rng), may_be_affordable(law.wall)
        attempt = _few_rays(law, sampler, basis, budget, affordable)
        if attempt.found is not None:
            return attempt.found
        if law.exact_law is not None:
            return IsometryTables().matrix(law.exact_law, basis, budget)
        if not affordable:
            return sobol_matrix(sampler, basis, budget)
        return _traced_or_all_rays(law, sampler, basis, budget, attempt.predicted)


def rays_of_whole(law: Law, basis: Basis, budget: Budget) -> KernelMatrix | None:
    """The matrix of a wall that is taken apart, by a few rays that enter anywhere; None if they miss the tolerance.

    Each hollow by itself takes some hundredths of a second at least.
    """
    taken_apart = isinstance(law, WallLaw) and law.closed_form is None and law.replacement is not None
    if not taken_apart or budget.tolerance * MANY_RAYS < 1.0:
        return None
    sampler = SobolSampler(law, basis, budget.rng)
    pilot = _pilot(sampler, basis, budget, SOBOL_ORDER)
    return _enough_rays(sampler, basis, budget, SOBOL_ORDER, pilot, MANY_RAYS).found


class _Attempt(NamedTuple):
    """The matrix within the tolerance, or None; the number of rays that it needs, and the predicted error of all rays.

    If it needs more than all, the number is at least that of all; if a few rays do not tell it, the error is inf.
    """

    found: KernelMatrix | None
    needed: int
    predicted: float


def _few_rays(law: WallLaw, sampler: SobolSampler, basis: Basis, budget: Budget, affordable: bool) -> _Attempt:
    """The matrix by as many rays as the tolerance needs, or by quadrature with fewer segments, if it is affordable."""
    # Even an error of order 1 in the number of rays would miss the tolerance, so a pilot run is useless.
    if not affordable and budget.tolerance * budget.rays < 1.0:
        return _Attempt(None, budget.rays, math.inf)
    order = ROUGH_ORDER if len(law.wall.pieces) > ROUGH_PIECES else SOBOL_ORDER
    attempt = _enough_rays(sampler, basis, budget, order, _pilot(sampler, basis, budget, order), MANY_RAYS)
    if affordable and attempt.needed >= budget.rays > FIRST_RAYS:
        # more rays predict better the error that is compared with that of quadrature
        attempt = _attempt(sampler, basis, budget, order, FIRST_RAYS)
    if attempt.found is not None or attempt.needed >= budget.rays:
        return attempt
    if affordable:
        segments = int(attempt.needed / RAYS_A_SEGMENT)
        traced = Traced().matrix(law, basis, replace(budget, segments=segments, fallback=budget.tolerance))
        if float(traced.error) <= budget.tolerance:
            return _Attempt(traced, attempt.needed, float(traced.error))
    elif whole_sequences(attempt.needed) >= budget.rays:
        # isometries of many pieces take no longer than all rays
        return attempt
    return _enough_rays(sampler, basis, budget, order, attempt, budget.rays)


def _pilot(sampler: SobolSampler, basis: Basis, budget: Budget, order: float) -> _Attempt:
    """What a pilot run predicts."""
    number = max(PILOT_RAYS, RAYS_A_FUNCTION * basis.size)
    if max(number, FIRST_RAYS) >= budget.rays:
        return _Attempt(None, budget.rays, math.inf)
    return _attempt(sampler, basis, budget, order, number)._replace(found=None)


def _enough_rays(
    sampler: SobolSampler, basis: Basis, budget: Budget, order: float, attempt: _Attempt, most: int
) -> _Attempt:
    """As many rays, fewer than ``most``, as are predicted to meet the tolerance, until they meet it."""
    while attempt.found is None and attempt.needed < min(most, budget.rays):
        attempt = _attempt(sampler, basis, budget, order, attempt.needed)
    return attempt


def _attempt(sampler: SobolSampler, basis: Basis, budget: Budget, order: float, number: int) -> _Attempt:
    """The matrix by a number of rays, if it meets the tolerance, and what the spread of these rays predicts."""
    try:
        found = sobol_matrix(sampler, basis, replace(budget, rays=number))
    except AccuracyError:
        # A bin has no rays, or too many rays do not escape, so this number of rays predicts nothing.
        return _Attempt(None, budget.rays, math.inf)
    error, number = float(found.error), found.samples
    predicted = error * (number / budget.rays) ** order
    within = found if error <= budget.tolerance else None
    if error > budget.tolerance * (budget.rays / (SOBOL_MARGIN * number)) ** order:
        return _Attempt(within, budget.rays, predicted)
    needed = SOBOL_MARGIN * number * (error / budget.tolerance) ** (1.0 / order)
    return _Attempt(within, max(FIRST_RAYS, 2 * number, int(needed)), predicted)


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
