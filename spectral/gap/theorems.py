"""Verdicts on the gap that follow from the structure of a law, by theorem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...core.checks import Floats
from ...core.rounding import EPS
from ...kernels import Bins, FacetedLaw, KernelMatrix, Law
from ...kernels.discretisation.radiosity import has_radiosity, one_diffuse_hit
from ...kernels.laws.matrix_law import finite_matrix
from ...kernels.walls.wall_law import made_of_isometries
from ..bounds.separation import lambertian_fraction
from ..eigenvalues.spectra import Verdict, matrix_spectrum
from ..essential.edge import essential_edge
from .refinement import EIGENVALUES
from .verdict import SpectralGap, made_from

# Of n independent rays with the chance p of an event none shows it with the probability 5 % if n p is this, ln 20.
UNSEEN = 3.0
# Bins and rays of the bound by rays with one diffuse hit.
ONE_HIT, RAYS = Bins(64), 2**16


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
    if law.angle_map is not None and law.reversible:
        reason = "the law is an involution T: f + f o T is kept for every f, so 1 has infinite multiplicity"
        return _stated(law, 0.0, 0.0, "no gap", reason)
    matrix = finite_matrix(law)
    if matrix is not None:
        return gap_of_exact(matrix)
    fraction = lambertian_fraction(law)
    if fraction > 0.0:
        edge = essential_edge(law)
        if edge.kind == "bound" and abs(edge.low - (1.0 - fraction)) <= 4.0 * EPS:
            reason = f"a Lambertian fraction a = {fraction:.6g}: the gap is at least a, the essential edge is 1 - a"
            return _stated(law, fraction, 4.0 * EPS, "essential edge", reason, *edge.reasons)
    return None


def _stated(law: Law, value: float, error: float, verdict: Verdict, *evidence: str) -> SpectralGap:
    return SpectralGap(value, error, "bound", "structure of the law", verdict, evidence, law.frame)


def lower_bound(law: Law) -> tuple[str, ...]:
    """What is known to be below the gap, in words: the Lambertian fraction of a law, and diffuse facets."""
    fraction = lambertian_fraction(law)
    if fraction > 0.0:
        return (f"the gap is at least {fraction:.6g}, the Lambertian fraction of the law",)
    if not isinstance(law, FacetedLaw) or not has_radiosity(law, ONE_HIT) or not law.diffuse_fraction:
        return ()
    least = law.diffuse_fraction * form_of_one_hit(law)
    return (
        f"the gap is at least a gamma = {least:.3g}, a = {law.diffuse_fraction:.6g}, because P >= a D for rays with "
        f"one hit, which is diffuse; gamma, the least form of D 1 - D off the constants, is estimated in {ONE_HIT!r}",
    )


def form_of_one_hit(law: FacetedLaw) -> float:
    """The least value of the form of D 1 - D on functions of mean 0 in bins, D of rays with one hit, which is diffuse.

    Examples
    --------
    >>> from asperity import geometry as geo, kernels as ker
    >>> round(form_of_one_hit(ker.FacetedLaw(geo.triangular_teeth(2.5), ker.maxwell(0.2))), 2)
    0.81
    """
    matrix = one_diffuse_hit(law, ONE_HIT, RAYS)
    constant = ONE_HIT.constant
    return float(np.linalg.eigvalsh(np.diag(matrix @ constant / constant) - matrix)[1])


def gap_of_exact(matrix: KernelMatrix, modulus: bool = False) -> SpectralGap:
    """The gap, or 1 - slem for ``modulus``, of a law from a matrix that is known beyond its basis.

    The eigenvalue 1 of a stochastic matrix is as multiple as the matrix has parts without transitions between them.
    """
    assert matrix.beyond is not None  # else the matrix is not exact
    found = matrix_spectrum(matrix, EIGENVALUES)
    even, odd = matrix.beyond
    value, kind = 1.0 - found.slem if modulus else found.gap, matrix.error.kind
    chain = matrix.symmetric @ matrix.symmetric if modulus else matrix.symmetric
    parts, _ = _separate_parts(chain)
    inexact = not matrix.basis.is_partition
    reason = (
        f"the law maps functions that are constant on {matrix.size} bins to such" if not inexact else
        f"the law is a matrix on {matrix.size} functions within the norm {float(matrix.error):.2g}"
    ) + (
        f": beyond these its spectrum is {even:.12g} on even and {odd:.12g} on odd functions of cos(theta), each of "
        "infinite multiplicity"
    )  # fmt: skip
    if parts > 1 and matrix.norm_bound == 1.0 and not inexact:
        double = (
            f"{'the square of ' if modulus else ''}the law has no transitions between {parts} sets of bins: "
            f"1 is its eigenvalue of multiplicity {parts}"
        )
        return SpectralGap(0.0, 0.0, kind, "structure of the law", "no gap", (double, reason), matrix.frame, found)
    method = made_from(found, matrix.error.method if inexact else "algebraic error and rounding; the basis is exact")
    lowest = float(found.errors.total()[int(np.argmin(found.values))]) if modulus else 0.0
    error, edge = max(found.gap_error, lowest), max(even, odd, -min(even, odd) if modulus else 0.0)
    verdict: Verdict = "no gap" if edge >= 1.0 else "isolated"
    if inexact and 1.0 - value - error <= edge < 1.0:
        verdict = "essential edge"
    return SpectralGap(value, error, kind, method, verdict, (reason,), matrix.frame, found).cut_at_zero()


def split_gap(matrix: KernelMatrix, found: SpectralGap) -> SpectralGap | None:
    """The gap of a matrix without transitions between sets of its bins; None for other matrices.

    The indicator of a set of measure m, with the flux f to the other bins, shows that the gap of the law is at most
    f / (m (1 - m)). If n rays show no such flux, f is at most 3 / n in 95 of 100 cases. The error of a matrix without
    rays bounds the quotient of a unit vector, hence the gap.
    """
    parts, label = _separate_parts(matrix.symmetric)
    if parts == 1 or not matrix.basis.is_partition or matrix.norm_bound != 1.0:
        return None
    mass = np.bincount(label, matrix.weights)
    spread = float((mass * (1.0 - mass)).max())
    most = UNSEEN / (matrix.samples * spread) if matrix.samples else float(matrix.error)
    evidence = (
        f"the matrix has no transitions between {parts} sets of bins: 1 is its eigenvalue of multiplicity {parts}"
    )
    verdict: Verdict = "no gap" if most == 0.0 else "undecided"
    kind = "estimate" if matrix.samples else matrix.error.kind
    return replace(found, value=0.0, error=most, kind=kind, verdict=verdict, evidence=(evidence, *found.evidence))


def _separate_parts(array: Floats) -> tuple[int, NDArray[np.int32]]:
    """The number of sets of states without transitions between them, and the set of each state."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    return connected_components(csr_array(array != 0.0), directed=False)
