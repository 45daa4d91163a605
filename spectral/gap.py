"""The spectral gap of a law: a number with its error, a verdict and the evidence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..checks import positive_number
from ..errors import AccuracyError, InputError
from ..kernels import Bins, CollisionLaw, InvolutionLaw, KernelMatrix, Law, MatrixLaw, Power, discretise
from ..kernels.algebra import made_of_isometries
from ..rounding import EPS
from .eigenvalues import Spectrum, spectrum
from .essential import EssentialEdge, essential_edge
from .gap_routes import enclosed_gap, rough_gap
from .ideal_parts import ideal_spectrum, without_identity
from .oscillations import held_against_oscillations
from .refinement import EIGENVALUES, Refinement, SharedMatrices, refined
from .relaxation import largest_modulus
from .separation import lambertian_share
from .shallow import shallow_gap
from .verdict import SpectralGap, Verdict, isolated, made_from


def spectral_gap(
    law: Law | KernelMatrix | CollisionLaw, tolerance: float = 1e-6, rng: np.random.Generator | None = None
) -> SpectralGap:
    """The gap 1 - sup(spectrum off the constants) of a reversible law.

    Parameters
    ----------
    law : Law, CollisionLaw or KernelMatrix
        In the convention that it carries; a matrix is taken as it is, of a collision law its P~.
    tolerance : float
        The basis grows, and the number of rays with it, until the reported error is below this or the largest basis
        and number of rays are reached; the error says which.
    rng : numpy.random.Generator, optional
        For laws that are traced; ``np.random.default_rng(0)`` by default, so that results repeat.

    Returns
    -------
    SpectralGap

    Raises
    ------
    AccuracyError
        If the law is not reversible, or its sampled matrix speaks against it.

    Notes
    -----
    First the structure of the law is asked. Laws made of isometries (polygonal walls, specular reflection,
    retroreflection) have no gap: 1 is in the essential spectrum, and whatever a grid shows is an artefact of the grid.
    Else `essential_edge` says how far the essential spectrum reaches, and Galerkin matrices, whose eigenvalues above
    it converge from below, say whether an eigenvalue lies beyond. If one does, the gap is *isolated*; if on all bases
    all of them stay short of the edge, the gap ends at the *essential edge*.

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
    positive_number("tolerance", tolerance)
    if isinstance(law, CollisionLaw):
        law = law.law
    if isinstance(law, KernelMatrix):
        return _of_matrix(law)
    if not isinstance(law, Law):
        raise InputError(f"law: expected a Law, a CollisionLaw or a KernelMatrix, got {law!r}")
    if law.reversible is False:
        raise AccuracyError(
            f"{law!r} is not symmetric with respect to sin(theta) d theta: its spectrum need not be real. "
            "Use law @ law.adjoint() if that is what you mean",
            np.inf,
        )
    if isinstance(law, Power) and law.exponent > 1 and law.law.reversible and not made_of_isometries(law):
        return _of_power(law, tolerance, rng or np.random.default_rng(0))
    return _by_theorem(law) or _by_refinement(law, tolerance, SharedMatrices(rng or np.random.default_rng(0)))


def gaps_in_both_conventions(
    law: Law, tolerance: float = 1e-6, rng: np.random.Generator | None = None
) -> tuple[SpectralGap, SpectralGap]:
    """The gaps of a mirror-symmetric law in the convention that it carries and in the other, from the same matrices.

    Raises
    ------
    InputError
        If the law is not known to be mirror-symmetric: in the other convention it need not be self-adjoint then.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> [float(gap) for gap in gaps_in_both_conventions(0.5 * ker.specular() + 0.5 * ker.lambertian())]
    [0.5, 0.5]
    """
    positive_number("tolerance", tolerance)
    if not law.reversible or not law.mirror_symmetric:
        raise InputError(f"law: expected a reversible and mirror-symmetric one, got {law!r}")
    matrices = SharedMatrices(rng or np.random.default_rng(0))
    other = law.in_specular_frame()
    first, second = (_by_theorem(each) or _by_refinement(each, tolerance, matrices) for each in (law, other))
    return first, second


def _of_matrix(matrix: KernelMatrix) -> SpectralGap:
    found = spectrum(matrix, k=EIGENVALUES)
    method = made_from(found, "algebraic + two-grid + 1.96 x sampling error")
    evidence = ("one matrix: its basis was not refined",)
    return SpectralGap(found.gap, found.gap_error, "estimate", method, "undecided", evidence, found.convention, found)


def _by_theorem(law: Law) -> SpectralGap | None:
    """What the structure of a law tells without computing."""
    if made_of_isometries(law) and law.reversible:
        reason = (
            "the law is a mixture of isometries theta' = +-theta + const: 1 belongs to its essential spectrum, "
            "so no L^2 gap exists, and a gap on a grid is an artefact of the grid"
        )
        return _stated(law, 0.0, 0.0, "no gap", reason)
    if isinstance(law, InvolutionLaw):
        reason = "the law is an involution T: f + f o T is kept for every f, so 1 has infinite multiplicity"
        return _stated(law, 0.0, 0.0, "no gap", reason)
    ideal = ideal_spectrum(law)
    if ideal is not None:
        reason = (
            f"the spectrum off the constants consists of two isolated eigenvalues of infinite multiplicity, "
            f"{ideal.even:.12g} on even functions of cos(theta) and {ideal.odd:.12g} on odd ones"
        )
        if lambertian_share(law) == 1.0:
            reason = "the law is Lambertian: of rank 1, its spectrum off the constants is 0"
        return _stated(law, 1.0 - ideal.top, ideal.rounding, "isolated", reason)
    if isinstance(law, MatrixLaw):
        return _of_finite_rank(law)
    share = lambertian_share(law)
    if share > 0.0:
        edge = essential_edge(law)
        if edge.kind == "bound" and abs(edge.low - (1.0 - share)) <= 4.0 * EPS:
            reason = (
                f"a Lambertian share a = {share:.6g} makes the gap at least a, and the essential spectrum reaches 1 - a"
            )
            return _stated(law, share, 4.0 * EPS, "essential edge", reason, *edge.reasons)
    return None


def _stated(law: Law, value: float, error: float, verdict: Verdict, *evidence: str) -> SpectralGap:
    return SpectralGap(value, error, "bound", "structure of the law", verdict, evidence, law.frame)


def _of_power(law: Power, tolerance: float, rng: np.random.Generator) -> SpectralGap:
    """The spectrum of P^n consists of the n-th powers of that of P: an even power turns its lower end up."""
    exponent = law.exponent
    base = spectral_gap(law.law, tolerance / exponent, rng)
    top, error, kind = 1.0 - base.value, base.error, base.kind
    evidence = [f"P: {base}", *base.evidence]
    if exponent % 2 == 0:
        modulus = largest_modulus(law.law)
        if modulus.value > top:
            top, error, kind = modulus.value, modulus.error, modulus.kind
            evidence.append(f"the largest modulus off the constants is {modulus.value:.10g} +- {modulus.error:.2g}")
    value = 1.0 - top**exponent
    slope = exponent * min(top + error, 1.0) ** (exponent - 1)
    method = f"power {exponent} of the spectrum of P; {base.method}"
    return SpectralGap(value, slope * error, kind, method, base.verdict, tuple(evidence), law.frame)


def _of_finite_rank(law: MatrixLaw) -> SpectralGap:
    """A law that is constant on bins: its own bins hold every eigenvalue but 0, which has infinite multiplicity."""
    found = spectrum(discretise(law, Bins(law.edges)), k=EIGENVALUES)
    error = float(found.gap_errors.algebraic[0])
    reason = f"the law is constant on {law.edges.size - 1} bins: beyond these its spectrum is 0"
    method = made_from(found, "algebraic error; the basis is exact")
    return SpectralGap(min(found.gap, 1.0), error, "bound", method, "isolated", (reason,), found.convention, found)


def _by_refinement(law: Law, tolerance: float, matrices: SharedMatrices) -> SpectralGap:
    """By what is known best: of shallow walls the form of 1 - P, else enclosures and matrices."""
    share, rest = without_identity(law)
    if share < 1.0:
        own = SharedMatrices(matrices.rng)
        return _scaled(_by_theorem(rest) or _by_refinement(rest, tolerance / share, own), share)
    edge = essential_edge(law)
    small = shallow_gap(law, edge)
    if small is not None and small.error <= tolerance:
        return small
    found = _by_matrices(law, tolerance, matrices, edge).cut_at_zero()
    if found.verdict == "isolated" and found.kind == "estimate":
        found = held_against_oscillations(law, found)
    return small if small is not None and small.error < found.error else found


def _scaled(found: SpectralGap, share: float) -> SpectralGap:
    """The gap of (1 - share) + share R from that of R."""
    reason = f"a share {share:.6g} of the law is R, the rest keeps all angles: the gap is {share:.6g} times that of R"
    value, error = share * found.value, share * found.error + 4.0 * EPS * share * found.value
    return replace(found, value=value, error=error, evidence=(reason, *found.evidence), spectrum=None)


def _by_matrices(law: Law, tolerance: float, matrices: SharedMatrices, edge: EssentialEdge) -> SpectralGap:
    if edge.high >= 1.0 and edge.low >= 1.0 - tolerance:
        # the edge cannot be told from 1, and no eigenvalue fits between that the tolerance could tell
        return _at_edge(law, edge, (*edge.reasons, f"the edge is 1 within {2.0 * edge.error:.1g}: no gap is visible"))
    found_at_once = rough_gap(law, tolerance, matrices, edge) or enclosed_gap(law, tolerance, edge)
    if found_at_once is not None:
        return found_at_once
    steps = refined(law, tolerance, matrices, edge)
    found, error = steps.finest, steps.error
    evidence = (*steps.evidence, *_lower_bound(law))
    gap = isolated(found, error, steps.how, edge, law.frame, evidence) if steps.converges else None
    if gap is not None:
        return gap
    reasons, top = (*edge.reasons, *evidence), 1.0 - found.gap
    if edge.low > 0.0 and top < edge.high + steps.noise and _is_relevant(edge, steps):
        short = f"no eigenvalue beyond the edge {edge.value:.8g} on any basis: {top:.6g} is the largest"
        return _at_edge(law, edge, (*reasons, short), found)
    # two grids say nothing where refinement does not converge; the gap of a Galerkin matrix is never too small
    method = made_from(found, "not converged: an upper bound but for its noise")
    error = max(error, abs(found.gap))
    return SpectralGap(found.gap, error, "estimate", method, "undecided", reasons, law.frame, found)


def _is_relevant(edge: EssentialEdge, steps: Refinement) -> bool:
    """Whether the edge is known better than what refinement leaves open between its largest eigenvalue and the edge."""
    top = 1.0 - steps.finest.gap
    return edge.error <= max(edge.value - top, steps.noise, 1e-3 * (1.0 - edge.value))


def _at_edge(law: Law, edge: EssentialEdge, evidence: tuple[str, ...], found: Spectrum | None = None) -> SpectralGap:
    method = "edge of the essential spectrum, from the law's action on grazing rays and its isometries"
    return SpectralGap(
        1.0 - edge.value, edge.error, "estimate", method, "essential edge", evidence, law.frame, found
    )  # fmt: skip


def _lower_bound(law: Law) -> tuple[str, ...]:
    share = lambertian_share(law)
    return (f"the gap is at least {share:.6g}, the Lambertian share of the law",) if share > 0.0 else ()
