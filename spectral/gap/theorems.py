"""Verdicts on the gap that follow from the structure of a law, by theorem."""

from __future__ import annotations

from ...core.rounding import EPS
from ...kernels import Bins, InvolutionLaw, Law, MatrixLaw, discretise
from ...kernels.laws.structure import made_of_isometries
from ..bounds.separation import lambertian_fraction
from ..eigenvalues.spectra import Verdict, matrix_spectrum
from ..essential.edge import essential_edge
from ..essential.exact import ideal_spectrum
from .refinement import EIGENVALUES
from .verdict import SpectralGap, made_from


def gap_by_theorem(law: Law) -> SpectralGap | None:
    """The gap by theorem of laws of isometries, of ideal laws, of finite rank, and some others; None if none applies.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> gap_by_theorem(ker.TriangularTeethLaw(0.7)).verdict, gap_by_theorem(ker.henyey_greenstein(0.5)) is None
    ('no gap', True)
    """
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
        if lambertian_fraction(law) == 1.0:
            reason = "the law is Lambertian: of rank 1, its spectrum off the constants is 0"
        return _stated(law, 1.0 - ideal.top, ideal.rounding, "isolated", reason)
    if isinstance(law, MatrixLaw):
        return _of_finite_rank(law)
    fraction = lambertian_fraction(law)
    if fraction > 0.0:
        edge = essential_edge(law)
        if edge.kind == "bound" and abs(edge.low - (1.0 - fraction)) <= 4.0 * EPS:
            reason = f"a Lambertian fraction a = {fraction:.6g}: the gap is at least a, the essential edge is 1 - a"
            return _stated(law, fraction, 4.0 * EPS, "essential edge", reason, *edge.reasons)
    return None


def _stated(law: Law, value: float, error: float, verdict: Verdict, *evidence: str) -> SpectralGap:
    return SpectralGap(value, error, "bound", "structure of the law", verdict, evidence, law.frame)


def _of_finite_rank(law: MatrixLaw) -> SpectralGap:
    """The gap of a law that is constant on bins, whose spectrum is 0 and the eigenvalues of its matrix."""
    found = matrix_spectrum(discretise(law, Bins(law.edges)), EIGENVALUES)
    error = float(found.gap_errors.algebraic[0])
    reason = f"the law is constant on {law.edges.size - 1} bins: beyond these its spectrum is 0"
    method = made_from(found, "algebraic error; the basis is exact")
    return SpectralGap(min(found.gap, 1.0), error, "bound", method, "isolated", (reason,), found.convention, found)
