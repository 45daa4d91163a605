"""The spectral gap of a law in either convention, with its error, a verdict and the evidence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ...core.checks import Rng, generator, positive_number
from ...core.errors import AccuracyError
from ...core.estimates import with_error
from ...core.long_runs import TIME_LIMIT, OutOfTime, reported, time_limited
from ...core.rounding import EPS
from ...kernels import CollisionLaw, KernelMatrix, Law, SurfaceLaw
from ...kernels.hemisphere.hemisphere_law import DirectionLaw
from ...kernels.laws.matrix_law import check_law, finite_matrix
from ...kernels.walls.wall_law import made_of_isometries
from ..bounds.contraction import refuse_unless_self_adjoint, self_adjoint_elsewhere, what_is_true, why_not_self_adjoint
from ..bounds.enclosure import Enclosures, as_power, enclosed_trial_space, enclosures
from ..bounds.images import is_costly, is_traced, suits_panels
from ..bounds.oscillations import RAYS, SIGMAS, least_quotient
from ..bounds.quotients_by_rays import Top, tops_by_rays
from ..bounds.rays_on_panels import suits_rays, values_by_rays
from ..bounds.separation import lambertian_fraction
from ..bounds.trial_space import Rank
from ..eigenvalues.spectra import ONE_MATRIX, Spectrum, Verdict, matrix_spectrum
from ..essential.compact import compact_matrix
from ..essential.edge import EssentialEdge, essential_edge, without_identity, without_lambertian
from .grooves import gap_of_grooves
from .methods import BEFORE_RAYS, OF_RAYS, gap_of_power, law_eigenvalues
from .refinement import EIGENVALUES, HOW, refined
from .shallow import shallow_gap
from .surfaces import gap_of_surface
from .theorems import gap_by_theorem, gap_of_exact, lower_bound, split_gap
from .verdict import SpectralGap, gap_between, isolated, made_from

# Numbers of enclosed eigenvalues with the constants: of densities by modulus, of other laws the largest values.
OF_DENSITIES, FEWEST, MOST = (3, 6), 2, 6
# Enclosures are computed to these tolerances, each from the panels of the one before; for laws without rays to the one
# asked for. Where an error exceeds the tolerance by less than 1/CLOSER, the tolerance is reduced, by CLOSER at most, so
# that the error would become HALF of it; where it exceeds it by more, or there is none, another eigenvalue is enclosed.
TOLERANCES, CLOSER, HALF = (1e-2, 1e-3, 1e-4, 1e-6, 1e-9, 1e-12), 0.25, 0.5
# Where enclosures of densities take too long, these tolerances are tried.
SURE = 1e-9, 1e-6
# An enclosed gap that misses its tolerance is held against rays on panels if its error exceeds the first, and against
# matrices in polynomials if it exceeds the second: they may reach these.
MISS_FOR_RAYS, MISS_FOR_MATRICES = 1e-4, 2e-3
# Fractions of the time limit for rays on panels, after enclosures and where there are none.
AFTER_ENCLOSURES, ALONE = 1.25, 1.5
# With so many ray segments per angle, rays on panels are faster than enclosures.
SLOW = 8_000
# The same for laws near a matrix, relative to the gap.
COMPACT_MISS = 1e-3
# Tolerance of the planar gaps that bound the gap of a law on the half sphere.
PLANAR = 1e-2
# Rays after which panels that reach no edge show that nothing is beyond it, and the method in words then.
AT_EDGE, OF_EDGE = 2**19, "edge of the essential spectrum, from the law's action on grazing rays and its isometries"
# Number of eigenvalues computed to find the least one.
MODULI = 3


def enclosed_gap(
    law: Law, tolerance: float, edge: EssentialEdge, seconds: float, rank: Rank = np.positive
) -> SpectralGap | None:
    """The gap, or 1 - slem if ranked by modulus, with the least error within a time limit; None without enclosures."""
    best: SpectralGap | None = None
    if law.has_density:
        return _of_density(law, tolerance, edge, seconds)
    if suits_panels(law) and not is_costly(law, SLOW):
        allowed = BEFORE_RAYS if tolerance >= OF_RAYS and suits_rays(law) else 1.0
        with suppress(OutOfTime), time_limited(allowed * seconds):
            for gap in _on_panels(law, tolerance, edge, rank):
                best = gap if best is None or gap.error < best.error else best
                if best.error <= tolerance:
                    break
    return best


def _of_density(law: Law, tolerance: float, edge: EssentialEdge, seconds: float) -> SpectralGap | None:
    for wanted in dict.fromkeys((tolerance, *(max(tolerance, sure) for sure in SURE))):
        with suppress(OutOfTime), time_limited(seconds):
            found = (_gap_of(law, enclosures(law, number, tolerance=wanted), edge) for number in OF_DENSITIES)
            # in time, but not exact enough: a larger tolerance does not help
            return next((gap for gap in found if gap is not None and gap.error <= wanted), None)
    return None


def _on_panels(law: Law, tolerance: float, edge: EssentialEdge, rank: Rank) -> Iterator[SpectralGap]:
    """Gaps of growing accuracy. The sequence does not depend on the tolerance if rays are traced."""
    number, start, least = FEWEST, None, np.inf
    for wanted in TOLERANCES if is_traced(law) else (tolerance,):
        asked = wanted
        while least > wanted:
            found = enclosed_trial_space(law, number, None, asked, rank, start)
            values = np.array([item.value for item in found.enclosures if item.index != 0])
            if edge.low > 0.0 and np.all(rank(values) <= edge.high):
                # the edge is the answer
                return
            start, gap = found.finer, _gap_of(law, found.enclosures, edge, rank)
            if gap is not None:
                least = min(least, gap.error)
                yield gap
            if gap is None or gap.error > wanted / CLOSER:
                if number == MOST:
                    break
                number += 1
            else:
                asked *= max(CLOSER, HALF * wanted / gap.error)


def _gap_of(law: Law, found: Enclosures, edge: EssentialEdge, rank: Rank = np.positive) -> SpectralGap | None:
    """The gap between a trial function, or the edge, and the bound of the largest eigenvalue, or of the rest."""
    others = [
        replace(item, value=-item.value, low=-item.high, high=-item.low) if rank is np.abs and item.value < 0 else item
        for item in found if item.index != 0
    ]  # fmt: skip
    top = max(others, key=lambda item: item.value, default=None)
    if top is None or len(others) == len(found):
        return None
    if top.index is not None and top.low > max(found.separation.radius, 0.0) and top.high < 1.0:
        how, value = f"bounds of the eigenvalue; {found.method}", 1.0 - 0.5 * (top.low + top.high)
        return SpectralGap(value, 0.5 * top.width, top.kind, how, "isolated", (str(top),), law.frame)
    # no eigenvalue that is not listed is above the radius
    high = max([found.separation.radius, *(item.high for item in others if item.index is not None)])
    if max(high, edge.high) >= 1.0:
        return None
    how = f"bounds of all eigenvalues; {found.method}"
    evidence = (f"no eigenvalue off the constants is above {high:.3g}: {found.separation.reason}",)
    return gap_between(max(item.low for item in others), high, edge, how, evidence, law.frame)


@reported("spectral gap")
def spectral_gap(
    law: Law | KernelMatrix | CollisionLaw | DirectionLaw,
    tolerance: float = 1e-6,
    rng: Rng = None,
    *,
    time_limit: float = TIME_LIMIT,
) -> SpectralGap:
    """The gap 1 - sup(spectrum off the constants) of a reversible law.

    Parameters
    ----------
    law : Law, CollisionLaw, HemisphereLaw, SurfaceLaw or KernelMatrix
        A law in its own convention; for a collision law its P~. The gap of a law on the half sphere of velocities is
        computed in Zernike functions, and planar gaps bound it from below. Of a surface at a fixed orientation, whose
        law need not be reversible, an upper bound is known only: the interval begins at 0. A matrix is not refined: the
        error is then an estimate of the distance from the gap of its law, and ``evidence`` has the gap of the matrix
        itself with its error. They are the same for a law of finitely many states in bins that refine its own. An array
        of transition probabilities is a law: ``MatrixLaw(array)``.
    tolerance : float
        Wanted error. If it is not reached with the largest basis and number of rays, ``error`` is larger.
    rng : None, int or numpy.random.Generator
        Source of rays for traced laws; by default ``np.random.default_rng(0)``.
    time_limit : float
        Limit in seconds for the enclosures of a traced law, of which a quarter is for tolerances of 5e-5 and more.
        Where they are not within 1e-4 then, rays from panels go on for 1.25 times the limit, or 1.5 times without any
        enclosures. It is counted as about a million rays with eight million segments, or 1.3 million rays without
        quadrature, a second, so that the result does not depend on the machine. A longer limit continues the same
        enclosures and rays, and never makes them worse.

    Returns
    -------
    SpectralGap

    Raises
    ------
    AccuracyError
        If the law is not reversible, or its sampled matrix is not symmetric within its error.

    Notes
    -----
    First, theorems are applied. Laws made of isometries (polygonal walls, specular reflection, retroreflection) have no
    gap: 1 is in the essential spectrum, and the gap of a grid is an artefact. Otherwise `essential_edge` bounds the
    essential spectrum. Enclosures, or Galerkin matrices, whose eigenvalues above the edge converge from below, decide
    whether an eigenvalue lies beyond the edge. If so, the gap is *isolated*. If the eigenvalues on all bases stay below
    the edge, the gap ends at the *essential edge*.

    Enclosures of traced laws become more accurate in steps, 1e-2, 1e-3, 1e-4, 1e-6 and 1e-9, each from the panels of
    the one before, until the tolerance is reached or the time is over; the best of them is the result.

    A law P J that is not self-adjoint in its convention, such as the law of a wall without mirror symmetry in the
    specular frame, need not have a real spectrum. The value is then 1 - ||P J|| on functions of mean 0, where ||P J||
    is the slem of P since J is unitary; ``method`` and ``evidence`` say so.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> gap = spec.spectral_gap(ker.henyey_greenstein(0.5), tolerance=1e-9)
    >>> round(float(gap), 9), gap.verdict
    (0.5, 'isolated')
    >>> spec.spectral_gap(ker.specular()).verdict
    'no gap'
    >>> semicircle = spec.spectral_gap(ker.CircularArcLaw(np.pi / 2))
    >>> round(float(semicircle), 6), semicircle.verdict
    (0.176041, 'essential edge')
    """
    tolerance = positive_number("tolerance", tolerance)
    seconds, rng = positive_number("time_limit", time_limit), generator(rng, 0)
    if isinstance(law, CollisionLaw):
        law = law.law
    if isinstance(law, SurfaceLaw):
        return gap_of_surface(law, tolerance, rng)
    if isinstance(law, DirectionLaw):
        return gap_of_grooves(law, tolerance, rng, lambda one: spectral_gap(one, PLANAR, rng, time_limit=seconds))
    if isinstance(law, KernelMatrix):
        return _of_matrix(law)
    check_law("law", law, "a Law, a CollisionLaw, a HemisphereLaw, a SurfaceLaw or a KernelMatrix")
    other = self_adjoint_elsewhere(law)
    if other is not None:
        return _contraction(law, other, tolerance, rng, seconds)
    refuse_unless_self_adjoint(law)
    power = as_power(law)
    if power is not None:
        return _of_power(law, *power, tolerance, rng, seconds)
    return gap_by_theorem(law) or _by_refinement(law, tolerance, rng, seconds)


def _of_matrix(matrix: KernelMatrix) -> SpectralGap:
    if matrix.beyond is not None:
        return gap_of_exact(matrix)
    found = matrix_spectrum(matrix, EIGENVALUES)
    method = made_from(found, f"algebraic + {ONE_MATRIX:.0f} x two-grid + 1.96 x sampling error")
    evidence = (
        f"{found.evidence[0]}; the gap of the matrix itself is "
        f"{with_error(found.gap, found.gap_errors.algebraic[0])}, an upper bound "
        "of the law's but for noise and the errors of entries",
    )
    gap = SpectralGap(found.gap, found.gap_error, "estimate", method, "undecided", evidence, found.convention, found)
    return split_gap(matrix, gap) or (gap.cut_at_zero() if matrix.norm_bound == 1.0 else gap)


def _of_power(
    law: Law, base: Law, exponent: int, tolerance: float, rng: np.random.Generator, seconds: float
) -> SpectralGap:
    """The gap of P^n, from the gap of P for odd n and from 1 - slem of P for even n."""
    ask = modulus_gap if exponent % 2 == 0 else spectral_gap
    found = ask(base, tolerance / exponent, rng, time_limit=seconds)
    value, error = gap_of_power(found.value, found.error, exponent)
    method = f"power {exponent} of the spectrum of P; {found.method}"
    evidence = (f"P: {found}", *found.evidence)
    return SpectralGap(value, error, found.kind, method, found.verdict, evidence, law.frame)


def modulus_gap(law: Law, tolerance: float = 1e-6, rng: Rng = None, *, time_limit: float = TIME_LIMIT) -> SpectralGap:
    """1 - slem, the distance from 1 of the largest modulus in the spectrum off the constants, as `spectral_gap` is.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> round(float(modulus_gap(ker.henyey_greenstein(-0.5))), 9)
    0.5
    """
    matrix = None if made_of_isometries(law) else finite_matrix(law)
    compact = None if matrix is not None or law.eigenvalue_ratio is not None else compact_matrix(law)
    near = compact if matrix is None else matrix
    if near is not None and (near is matrix or float(near.error) <= tolerance):
        refuse_unless_self_adjoint(law)
        return gap_of_exact(near, modulus=True)
    fraction, rest = without_lambertian(law)
    if fraction < 1.0 and is_traced(law):
        return _off_constants(modulus_gap(rest, tolerance / fraction, rng, time_limit=time_limit), fraction)
    small = _shallow_modulus(law, tolerance)
    if small is not None:
        return small
    edge = essential_edge(law)
    if is_traced(law) and edge.high < 1.0 and gap_by_theorem(law) is None:
        found = _by_functions(law, tolerance, generator(rng, 0), time_limit, edge, np.abs)
        if found is not None and _is_accurate(law, found, tolerance):
            return held_against_oscillations(law, found).cut_at_zero()
        upper = _by_polynomials(law, tolerance, generator(rng, 0), time_limit, edge)
    else:
        upper = spectral_gap(law, tolerance, rng, time_limit=time_limit)
    if upper.verdict == "no gap" or lambertian_fraction(law) == upper.value:
        # the slem is 1, or is the norm 1 - a of the rest of a law with a Lambertian fraction a
        return upper
    listed = upper.spectrum or law_eigenvalues(law, MODULI, tolerance, rng, time_limit)
    lowest = int(np.argmin(listed.values))
    least, error = -float(listed.values[lowest]), float(listed.errors.total()[lowest])
    top = 1.0 - upper.value
    if least + error < top - upper.error or least <= edge.high:
        # the edge bounds the modulus of the essential spectrum, because the parts of the law are positive operators
        return upper
    evidence = (*upper.evidence, f"the least eigenvalue is {with_error(-least, error)}")
    method = f"least eigenvalue, {listed.basis!r}, {listed.method}"
    if least - error > max(top + upper.error, edge.high):
        gap = SpectralGap(1.0 - least, error, "estimate", method, "isolated", evidence, law.frame, listed)
        return gap.cut_at_zero()
    low, high = max(top - upper.error, least - error), max(top + upper.error, least + error)
    method = f"largest and least eigenvalue: {upper.method}; {method}"
    return SpectralGap(
        1.0 - 0.5 * (low + high), 0.5 * (high - low), "estimate", method, upper.verdict, evidence, law.frame, listed
    ).cut_at_zero()  # fmt: skip


def _shallow_modulus(law: Law, tolerance: float) -> SpectralGap | None:
    """The gap 1 - slem of mirror-symmetric shallow walls, the lesser of the gaps in both conventions."""
    if not law.mirror_symmetric:
        return None
    both = [shallow_gap(one, essential_edge(one)) for one in (law, law.in_specular_frame())]
    known = [one for one in both if one is not None]
    least = min(known, key=lambda one: one.value, default=None)
    if least is None or len(known) < 2 or least.error > tolerance:
        return None
    return replace(least, convention=law.frame, method=f"the lesser of the gaps in both conventions; {least.method}")


def _contraction(law: Law, other: Law, tolerance: float, rng: np.random.Generator, seconds: float) -> SpectralGap:
    """The value 1 - ||P J|| on functions of mean 0, for a self-adjoint P whose P J is not self-adjoint."""
    found = modulus_gap(other, tolerance, rng, time_limit=seconds)
    evidence = (why_not_self_adjoint(other), what_is_true(), *found.evidence)
    method = f"norm of P J on functions of mean 0, the slem of P; {found.method}"
    return replace(
        found, method=method, evidence=evidence, convention=law.frame, spectrum=None, self_adjoint=False
    )  # fmt: skip


def _by_refinement(law: Law, tolerance: float, rng: np.random.Generator, seconds: float) -> SpectralGap:
    """The gap from the quadratic form of 1 - P for shallow walls, or from enclosures and matrices."""
    fraction, rest = without_identity(law)
    if fraction < 1.0:
        own = gap_by_theorem(rest) or _by_refinement(rest, tolerance / fraction, rng, seconds)
        return _scaled(own, fraction)
    fraction, rest = without_lambertian(law)
    if fraction < 1.0 and is_traced(law):
        own = gap_by_theorem(rest) or _by_refinement(rest, tolerance / fraction, rng, seconds)
        return _off_constants(own, fraction)
    compact = compact_matrix(law) if law.eigenvalue_ratio is None else None
    if compact is None:
        return _by_edge(law, tolerance, rng, seconds)
    found = gap_of_exact(compact)
    if found.error > max(tolerance, COMPACT_MISS * found.value):
        with suppress(OutOfTime), time_limited(seconds):
            return min(found, _by_edge(law, tolerance, rng, seconds), key=lambda one: one.error)
    return found


def _by_edge(law: Law, tolerance: float, rng: np.random.Generator, seconds: float) -> SpectralGap:
    """The gap from the edge of the essential spectrum and from trial functions."""
    edge = essential_edge(law)
    small = shallow_gap(law, edge)
    if small is not None and small.error <= tolerance:
        return small
    found = _by_matrices(law, tolerance, rng, seconds, edge).cut_at_zero()
    if found.verdict == "isolated" and found.kind == "estimate":
        found = held_against_oscillations(law, found)
    return small if small is not None and small.error < found.error else found


def _off_constants(found: SpectralGap, fraction: float) -> SpectralGap:
    """The gap of a L + (1 - a) R with a Lambertian L and 1 - a = fraction, from the gap of R."""
    reason = f"off the constants the law is R times {fraction:.6g}, for the other fraction is Lambertian"
    value, error = 1.0 - fraction * (1.0 - found.value), fraction * found.error + 4.0 * EPS
    verdict: Verdict = "essential edge" if found.verdict == "no gap" else found.verdict
    return replace(found, value=value, error=error, verdict=verdict, evidence=(reason, *found.evidence), spectrum=None)


def _scaled(found: SpectralGap, fraction: float) -> SpectralGap:
    """The gap of (1 - fraction) + fraction R from the gap of R."""
    reason = (
        f"the law is R in a fraction {fraction:.6g} and the identity in the rest: its gap is that fraction of R's gap"
    )
    value, error = fraction * found.value, fraction * found.error + 4.0 * EPS * fraction * found.value
    return replace(found, value=value, error=error, evidence=(reason, *found.evidence), spectrum=None)


def _by_matrices(
    law: Law, tolerance: float, rng: np.random.Generator, seconds: float, edge: EssentialEdge
) -> SpectralGap:
    if edge.high >= 1.0 and edge.low >= 1.0 - tolerance:
        # within the tolerance, no eigenvalue fits between the edge and 1
        return _at_edge(law, edge, (*edge.reasons, f"the edge is 1 within {2.0 * edge.error:.1g}: no gap is visible"))
    found = _by_functions(law, tolerance, rng, seconds, edge)
    if found is not None and _is_accurate(law, found, tolerance):
        return found
    sampled = _by_polynomials(law, tolerance, rng, seconds, edge)
    # the gap of slow functions is an upper bound, which faster ones may refute
    refuted = found is not None and sampled.value - sampled.error > found.value + found.error
    return sampled if found is None or (sampled.error < found.error and not refuted) else found


def _by_functions(
    law: Law, tolerance: float, rng: np.random.Generator, seconds: float, edge: EssentialEdge,
    rank: Rank = np.positive,
) -> SpectralGap | None:  # fmt: skip
    """The enclosed gap, or the better of it and of one by rays on panels; None if there is neither."""
    enclosed = enclosed_gap(law, tolerance, edge, seconds, rank)
    if not suits_rays(law) or (enclosed is not None and enclosed.error <= max(tolerance, MISS_FOR_RAYS)):
        return enclosed
    allowed = ALONE if enclosed is None else AFTER_ENCLOSURES
    try:
        sampled = gap_by_rays(law, tolerance, rng, seconds * allowed, edge, rank)
    except AccuracyError:
        if enclosed is None:
            raise
        return enclosed
    return sampled if enclosed is None else min(enclosed, sampled, key=lambda one: one.error)


def _is_accurate(law: Law, found: SpectralGap, tolerance: float) -> bool:
    """Whether matrices in polynomials are not expected to be more accurate."""
    return suits_rays(law) or found.error <= max(tolerance, MISS_FOR_MATRICES)


def gap_by_rays(
    law: Law, tolerance: float, rng: np.random.Generator, seconds: float, edge: EssentialEdge, rank: Rank = np.positive
) -> SpectralGap:
    """The gap, or 1 - slem if ranked by modulus, from rays until its error is at most the tolerance.

    Levels that miss an eigenvalue which others show are left out.
    """
    above, below = values_by_rays(law)
    shown = max([0.0, *above[:1], *(below[:1] if rank is np.abs else ())])
    tops: list[Top] = []
    best: SpectralGap | None = None
    how = "quotients of an eigenfunction by rays from panels; sampling error + error of the eigenfunction"
    for (top,), _ in tops_by_rays(law, rng, seconds, rank):
        # finer panels reach more
        growth = max(top.centre - tops[-1].centre, 0.0) if tops else np.inf
        tops.append(top)
        at_edge = edge.low > 0.0 and max(top.least, shown) <= edge.high
        if best is not None and best.verdict == "essential edge" and not at_edge:
            best = None
        if at_edge and top.rays >= AT_EDGE:
            # no panel shows an eigenvalue beyond the edge, but for noise
            least = f"no eigenvalue beyond the edge {edge.value:.8g}: {top.reached:.6g} is the largest by rays"
            found = gap_between(0.0, min(top.reached + growth, 1.0), edge, OF_EDGE, (least,), law.frame)
            found = replace(found, verdict="essential edge" if edge.high < 1.0 else "undecided")
        elif not at_edge and top.value + top.error >= shown:
            found = gap_between(top.value - top.error, min(top.value + top.error, 1.0), edge, how, (), law.frame)
        else:
            continue
        best = found if best is None or found.error < best.error else best
        if best.error <= max(tolerance, edge.error * (best.verdict == "essential edge")):
            break
    best = gap_between(shown, 1.0, edge, how, (), law.frame) if best is None else best
    evidence = (*map(str, tops), f"rays show an eigenvalue of at least {shown:.3g}", *best.evidence)
    if best.verdict == "undecided":
        evidence = (*evidence, "the panels do not resolve the function that reaches the largest value")
    return replace(best, evidence=evidence)


def _by_polynomials(
    law: Law, tolerance: float, rng: np.random.Generator, seconds: float, edge: EssentialEdge
) -> SpectralGap:
    """The gap from Galerkin matrices of growing size."""
    steps = refined(law, tolerance, rng, seconds, edge)
    found, error = steps.finest, steps.error
    evidence = (*steps.evidence, *lower_bound(law))
    gap = isolated(found, error, HOW, edge, law.frame, evidence) if steps.converges else None
    if gap is not None:
        return gap
    reasons, top = (*edge.reasons, *evidence), 1.0 - found.gap
    # the error of the edge is less than its distance from the largest eigenvalue
    relevant = edge.error <= max(edge.value - top, steps.noise, 1e-3 * (1.0 - edge.value))
    if edge.low > 0.0 and top < edge.high + steps.noise and relevant:
        short = f"no eigenvalue beyond the edge {edge.value:.8g} on any basis: {top:.6g} is the largest"
        return _at_edge(law, edge, (*reasons, short), found, steps.overshoot(edge.high))
    low = max(edge.low, top - steps.noise)
    if 0.0 < edge.low < edge.high < 1.0 and low < edge.high:
        # the edge is not known better, and its interval contains the top of the spectrum
        known = f"no eigenvalue beyond {edge.high:.6g} on any basis: {top:.6g} is the largest"
        return _at_edge(law, replace(edge, low=low), (*reasons, known), found)
    # without convergence the two-grid error is meaningless; the gap of a Galerkin matrix is an upper bound
    method = made_from(found, "not converged: an upper bound but for its noise")
    error = max(error, abs(found.gap))
    return SpectralGap(found.gap, error, "estimate", method, "undecided", reasons, law.frame, found)


def _at_edge(
    law: Law, edge: EssentialEdge, evidence: tuple[str, ...], found: Spectrum | None = None, overshoot: float = 0.0
) -> SpectralGap:
    error = max(edge.error, overshoot)
    return SpectralGap(1.0 - edge.value, error, "estimate", OF_EDGE, "essential edge", evidence, law.frame, found)


def held_against_oscillations(law: Law, found: SpectralGap) -> SpectralGap:
    r"""Replace a gap found in slow functions if cos(t theta + phase) for some large t has a smaller quotient.

    Notes
    -----
    The quotient 1/2 E (f(theta') - f(theta))^2 / Var f is at least the gap for every f. Straight pieces change angles
    by a few constants c_k. If all t c_k are nearly multiples of 2 pi, cos(t theta) is nearly invariant. If the pieces
    are slightly curved, this still holds for moderate t, although the essential spectrum disappears. A matrix in slow
    functions does not detect it. A few thousand rays detect such t, but do not prove that there are none.
    """
    try:
        frequency, quotient, spread = least_quotient(law)
    except AccuracyError as failure:
        return replace(found, evidence=(*found.evidence, f"not held against fast oscillations: {failure}"))
    half = SIGMAS * spread
    most = quotient + half
    if most >= found.value - found.error:
        return found
    reason = (
        f"by {RAYS} rays cos(t theta + phase), t = {frequency:.6g}, has the quotient {with_error(quotient, half)}: "
        f"the gap is not {found.value:.6g}, that of slow functions, but {most:.3g} or less"
    )
    evidence = (*found.evidence, reason)
    return replace(
        found, value=0.5 * most, error=0.5 * most, method="quotients of fast oscillations, from rays",
        verdict="undecided", evidence=evidence, spectrum=None,
    )  # fmt: skip
