"""Eigenvalues of laws: from enclosures where conditional expectations are accurate, else from growing matrices."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from ...core.checks import Floats, Rng, frozen, generator
from ...core.errors import AccuracyError
from ...core.long_runs import TIME_LIMIT, OutOfTime, time_limited
from ...core.rounding import EPS
from ...kernels import Law, Legendre, discretise
from ...kernels.laws.matrix_law import finite_matrix
from ...kernels.walls.wall_law import made_of_isometries
from ..bounds.enclosure import EnclosedTrialSpace, as_power, enclosed_trial_space
from ..bounds.images import is_costly, is_traced, suits_panels
from ..bounds.quotients_by_rays import tops_by_rays
from ..bounds.rays_on_panels import suits_rays
from ..bounds.trial_space import PARITIES
from ..eigenvalues.spectra import Spectrum, SpectrumErrors, matrix_spectrum
from ..essential.compact import compact_matrix

# Sizes of Legendre bases for laws without known errors of expectations; the first suffices for ten eigenvalues of most.
DEGREES = (48, 96)
# Fraction of the tolerance for the errors of the entries of a matrix.
MATRIX_FRACTION = 0.1
# Enclosures are first computed with FIRST times the tolerance, because they are wider than asked. Up to ATTEMPTS times
# the tolerance is reduced, by SMALLEST_STEP at most, as long as the width decreases by the factor WORTHWHILE.
FIRST, ATTEMPTS, SMALLEST_STEP, WORTHWHILE = 0.4, 6, 0.03, 0.5
# Of traced walls the first enclosures have at least this tolerance.
COARSE = 1e-2
# Tolerance that rays on panels reach, and fraction of the time limit for enclosures which are tried before them then.
OF_RAYS, BEFORE_RAYS = 5e-5, 0.25
# Limit on the enclosed eigenvalues in the search for the largest one off the constants.
MOST_ENCLOSED = 24


def law_eigenvalues(law: Law, k: int, tolerance: float, rng: Rng, seconds: float = TIME_LIMIT) -> Spectrum:
    """The k eigenvalues of largest modulus of a law, without a word on its gap: see `spectrum`."""
    power = as_power(law)
    if power is not None:
        base, exponent = power
        # an even power needs the largest modulus off the constants
        found = law_eigenvalues(base, max(k, 2), tolerance / exponent, rng, seconds)
        return _raised(found, exponent, k)
    matrix = None if made_of_isometries(law) else finite_matrix(law, k)
    if matrix is None and law.eigenvalue_ratio is None:
        near = compact_matrix(law)
        matrix = near if near is not None and float(near.error) <= tolerance else None
    if matrix is not None:
        return matrix_spectrum(matrix, k)
    if made_of_isometries(law):
        return _by_matrices(law, k, tolerance, rng)
    if law.has_density:
        return _of_density(law, k, tolerance)
    return _of_rays(law, k, tolerance, rng, seconds)


def _of_rays(law: Law, k: int, tolerance: float, rng: Rng, seconds: float) -> Spectrum:
    """The first that is accurate, or the best, of enclosures, matrices of laws without rays, and quotients by rays."""
    found: list[Spectrum] = []

    def missed() -> bool:
        return all(_worst(one) > tolerance for one in found)

    shown = suits_rays(law) and k > 1
    if suits_panels(law) and not is_costly(law):
        allowed = BEFORE_RAYS if shown and is_traced(law) and tolerance >= OF_RAYS else 1.0
        enclosed = _enclosed(law, k, tolerance, allowed * seconds)
        found += [] if enclosed is None else [enclosed]
    if missed() and not (shown and is_traced(law)):
        found.append(_by_matrices(law, k, tolerance, rng))
    if missed() and shown:
        try:
            found.append(_by_rays(law, k, tolerance, rng, seconds))
        except AccuracyError:
            if not found:
                raise
    return min(found, key=_worst)


def _worst(found: Spectrum) -> float:
    return float(found.errors.total().max())


def _by_rays(law: Law, k: int, tolerance: float, rng: Rng, seconds: float) -> Spectrum:
    """The quotients with the least error of the worst one within the time."""
    best, error = None, np.inf
    for tops, level in tops_by_rays(law, generator(rng, 0), seconds, np.abs, k - 1):
        worst = max(top.error for top in tops)
        if worst < error:
            best, error = (tops, level), worst
        if error <= tolerance:
            break
    assert best is not None  # the first quotients have an error
    tops, level = best
    values = np.append(1.0, level.signs[: k - 1] * [top.value for top in tops])
    errors = np.append(0.0, [top.error for top in tops])
    order = np.append(0, 1 + np.argsort(-values[1:], kind="stable"))
    vectors = np.column_stack([level.rays.basis.constant, level.vectors[:, : k - 1]])
    of_matrix = np.append(1.0, level.signs[: k - 1] * level.values[: k - 1])
    parities = np.append(1.0 if law.mirror_symmetric else 0.0, level.parities[: k - 1])
    moduli, top = np.abs(values[1:]), float(values[order[1]])
    # what is not listed has no larger modulus
    gap_error = max(float(errors[order[1]]), float(np.min(moduli + errors[1:])) - top)
    return Spectrum(
        values=frozen(values[order]), vectors=frozen(vectors[:, order]),
        residuals=frozen(np.abs(of_matrix - values)[order]), errors=discretisation_only(errors[order]),
        gap=1.0 - top, gap_errors=discretisation_only(np.array([gap_error])), slem=float(moduli.max()),
        convention=law.frame, basis=level.rays.basis,
        method=f"quotients of eigenfunctions by {tops[0].rays} rays from panels",
        parity=tuple(PARITIES[int(parity)] for parity in parities[order]),
        completeness=f"the largest moduli of a matrix from {tops[0].rays} rays",
    )  # fmt: skip


def _by_matrices(law: Law, k: int, tolerance: float, rng: Rng) -> Spectrum:
    best = None
    for degree in DEGREES:
        found = matrix_spectrum(discretise(law, Legendre(degree), tolerance=MATRIX_FRACTION * tolerance, rng=rng), k)
        if best is None or _worst(found) < _worst(best):
            best = found
        if made_of_isometries(law) or _worst(best) <= tolerance:
            break
    assert best is not None  # there are degrees
    return best


def _enclosed(law: Law, k: int, tolerance: float, seconds: float) -> Spectrum | None:
    """Enclosures to the tolerance, with enough eigenvalues to include the largest one off the constants.

    The time limit ends them with the best that they have reached.
    """
    number, asked, start = k, FIRST * (max(tolerance, COARSE) if is_traced(law) else tolerance), None
    best: EnclosedTrialSpace | None = None
    with suppress(OutOfTime), time_limited(seconds):
        for _ in range(1 + ATTEMPTS):
            found = enclosed_trial_space(law, number, None, asked, np.abs, start)
            alike = best is not None and len(found.enclosures) == len(best.enclosures)
            if best is not None and alike and found.worst > WORTHWHILE * best.worst:
                # no further progress
                break
            best, start = found, found.finer
            if not found.indexed:
                break
            if not _has_top(found) and number < MOST_ENCLOSED:
                number = min(2 * number + 2, MOST_ENCLOSED)
            elif found.worst > tolerance:
                asked *= max(FIRST * tolerance / found.worst, SMALLEST_STEP)
            else:
                break
    return None if best is None else _spectrum_of(best, k)


def _of_density(law: Law, k: int, tolerance: float) -> Spectrum:
    first, *others = [Legendre(factor * max(DEGREES[0], 2 * k)) for factor in (1, 2, 4)]
    best = enclosed_trial_space(law, k, first)
    for basis in others:
        if best.worst <= tolerance:
            break
        best = min(best, enclosed_trial_space(law, k, basis), key=lambda found: found.worst)
    return _spectrum_of(best, k)


def _has_top(found: EnclosedTrialSpace) -> bool:
    """Whether the largest eigenvalue off the constants is known to be listed."""
    tops = [item.low for item in found.enclosures if item.index != 0]
    return bool(tops) and max(tops) > max(found.enclosures.separation.radius, 0.0)


def _spectrum_of(found: EnclosedTrialSpace, k: int) -> Spectrum:
    """Enclosures as a spectrum; the errors are the distances from the values to the ends of the intervals."""
    items = found.enclosures.items
    values = np.array([item.value for item in items])
    errors = np.array([max(item.high - item.value, item.value - item.low) for item in items])
    # constants first, then by decreasing modulus
    order = np.append(0, 1 + np.argsort(-np.abs(values[1:]), kind="stable"))[:k]
    chosen = np.append(0, np.sort(order[1:]))
    radius = found.enclosures.separation.radius
    gap, gap_error, slem = 1.0, np.inf, 0.0
    if len(values) > 1:
        top, gap_error = float(values[1:].max()), float(errors[1 + np.argmax(values[1:])])
        gap, slem = 1.0 - top, np.abs(values[1:]).max()
        if not _has_top(found) and found.indexed:
            # the rest of the spectrum may contain a larger eigenvalue
            gap_error = max(gap_error, radius - top)
    return Spectrum(
        values=frozen(values[chosen]), vectors=frozen(found.vectors[:, chosen]),
        residuals=frozen(np.array([items[i].residual for i in chosen])), errors=discretisation_only(errors[chosen]),
        gap=gap, gap_errors=discretisation_only(np.array([gap_error])), slem=float(slem),
        convention=found.enclosures.convention, basis=found.basis, method=found.enclosures.method,
        parity=tuple(items[i].parity for i in chosen),
        completeness=(
            f"the rest of the spectrum is within {radius:.6g}: {found.enclosures.separation.reason}"
            if found.indexed
            else "not all have a known number: see enclosures(law, k)"
        ),
    )  # fmt: skip


def discretisation_only(width: Floats) -> SpectrumErrors:
    """Errors with the discretisation part only."""
    nothing = np.zeros(len(width))
    return SpectrumErrors(frozen(nothing), frozen(width), frozen(nothing))


def _raised(found: Spectrum, exponent: int, k: int) -> Spectrum:
    """The spectrum of a power; errors are multiplied by the largest slope on their intervals."""
    width = found.errors.total()
    slope = exponent * np.minimum(np.abs(found.values) + width, 1.0) ** (exponent - 1)
    values = found.values**exponent
    order = 1 + np.argsort(-np.abs(values[1:]), kind="stable")[: k - 1]
    order = np.append(0, order[np.argsort(-values[order], kind="stable")])
    # the largest modulus belongs to the top or to the most negative value, which is then listed
    base, error = 1.0 - found.gap, found.gap_error
    if exponent % 2 == 0 and found.slem > base:
        base, error = found.slem, float(width[np.argmin(found.values)])
    gap, grown = gap_of_power(1.0 - base if base != 1.0 - found.gap else found.gap, error, exponent)
    return replace(
        found.at(order), values=frozen(values[order]), residuals=frozen((slope * found.residuals)[order]),
        errors=found.errors.at(order, slope), gap=gap, gap_errors=discretisation_only(np.array([grown])),
        slem=found.slem**exponent, method=f"powers {exponent} of the eigenvalues; {found.method}",
        matrix_error=exponent * found.matrix_error,
    )  # fmt: skip


def gap_of_power(gap: float, error: float, exponent: int) -> tuple[float, float]:
    """The gap 1 - (1 - gap)^n of a power and its error, without cancellation for small gaps.

    For an even power the given gap is 1 - slem, at most 1.

    Examples
    --------
    >>> f"{gap_of_power(1e-16, 0.0, 3)[0]:.12g}", gap_of_power(1.5, 0.0, 3)[0]
    ('3e-16', 1.125)
    """

    def grown(one: float) -> float:
        return float(-np.expm1(exponent * np.log1p(-one))) if one < 1.0 else 1.0 - (1.0 - one) ** exponent

    least, most = max(gap - error, 0.0), min(gap + error, 2.0 if exponent % 2 else 1.0)
    value = grown(gap)
    return value, max(grown(most) - value, value - grown(least), 0.0) + 4.0 * EPS * abs(value)
