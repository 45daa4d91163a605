"""The spectrum of a law or of a matrix, with the verdict on its gap."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...core.checks import Rng, frozen, generator, number_between, positive_number, whole_number
from ...core.errors import InputError
from ...core.long_runs import TIME_LIMIT, reported
from ...core.rounding import EPS
from ...kernels import CollisionLaw, KernelMatrix, Law
from ...kernels.laws.matrix_law import check_law
from ..bounds.contraction import refuse_unless_self_adjoint
from ..eigenvalues.spectra import Spectrum, matrix_spectrum
from ..essential.edge import essential_edge
from .gap import spectral_gap
from .methods import discretisation_only, law_eigenvalues
from .theorems import gap_by_theorem
from .verdict import SpectralGap, isolated

TOLERANCE = 1e-4


@reported("spectrum")
def spectrum(
    kernel: KernelMatrix | Law | CollisionLaw,
    k: int = 10,
    *,
    tolerance: float | None = None,
    rng: Rng = None,
    time_limit: float = TIME_LIMIT,
) -> Spectrum:
    """The k eigenvalues of largest modulus of a reversible kernel, sorted descending.

    Parameters
    ----------
    kernel : KernelMatrix, Law or CollisionLaw
        A reversible kernel. A collision law has the eigenvalues of its P~ with both signs. A matrix is not refined.
    k : int
        Number of eigenvalues; a matrix with fewer rows has fewer.
    tolerance : float, optional
        Wanted error of every eigenvalue of a law, 1e-4 by default and at least 2^-52; ``errors`` are the errors
        reached.
    rng : None, int or numpy.random.Generator
        Source of rays for traced laws.
    time_limit : float
        As of `spectral_gap`.

    Returns
    -------
    Spectrum
        The spectrum of a law includes the verdict on its gap. If this is "no gap" or "essential edge", ``gap`` and
        ``slem`` belong to the law, and some listed eigenvalues may belong to the basis only.

    Raises
    ------
    AccuracyError
        If the kernel is not symmetric within its error, so that its spectrum need not be real. If the law is
        self-adjoint in the other convention only, the message states the norm bound that holds in this one.

    Notes
    -----
    For walls, arcs, densities, Lambertian reflection and sums of these, eigenvalues are enclosed by residuals of trial
    functions (`enclosures`); ``errors`` are the half widths. Where these take too long, as in chaotic hollows, they are
    quotients of eigenfunctions by rays from panels. Powers of laws have the powers of the eigenvalues. For other laws
    Galerkin matrices are used, and quotients by rays if matrices miss the tolerance.

    Matrices are compressed exactly to the complement of the constants, and to even and odd functions if the law is
    mirror-symmetric. LAPACK solves small matrices completely. For large ones Lanczos finds the wanted eigenvalues, and
    Cholesky factorisations check, in floating point with rounding bounds, that none is missing
    (`asperity.spectral.eigenvalues.dense`). The cost is O(n^3).

    Examples
    --------
    The Henyey-Greenstein law has the eigenvalues g^l:

    >>> from asperity import kernels as ker, spectral as spec
    >>> spec.spectrum(ker.henyey_greenstein(0.5), k=4).values.round(12).tolist()
    [1.0, 0.5, 0.25, 0.125]
    >>> spec.spectrum(ker.TriangularTeethLaw(0.7)).verdict
    'no gap'
    """
    whole_number("k", k, 1)
    seconds = positive_number("time_limit", time_limit)
    wanted = number_between("tolerance", TOLERANCE if tolerance is None else tolerance, EPS, math.inf, closed="low")
    source = rng if rng is None else generator(rng)
    if isinstance(kernel, CollisionLaw):
        half = spectrum(kernel.law, max(1, (k + 1) // 2), tolerance=wanted, rng=source, time_limit=seconds)
        return _both_signs(half, k)
    if isinstance(kernel, KernelMatrix):
        if tolerance is not None or rng is not None:
            raise InputError("tolerance, rng: only for laws; a KernelMatrix is discretised already")
        return matrix_spectrum(kernel, k)
    check_law("kernel", kernel, "a KernelMatrix, a Law or a CollisionLaw")
    refuse_unless_self_adjoint(kernel)
    return _with_verdict(kernel, law_eigenvalues(kernel, k, wanted, rng, seconds), wanted, rng, seconds)


def _with_verdict(law: Law, found: Spectrum, tolerance: float, rng: Rng, seconds: float) -> Spectrum:
    """With the law's gap and its verdict: what a matrix shows short of the essential spectrum's edge is not the gap."""
    known = gap_by_theorem(law)
    if known is None:
        edge = essential_edge(law)
        inside = int(np.sum(np.abs(found.values[1:]) + found.errors.total()[1:] <= edge.high))
        caution = (
            f"{inside} of the values are not beyond {edge.high:.6g}, which the essential spectrum may reach: they may "
            "belong to the basis"
        )
        gap = isolated(found, found.gap_error, "", edge, law.frame, (caution,) if inside else ())
        if gap is not None:
            return replace(found, verdict="isolated", evidence=gap.evidence)
        known = spectral_gap(law, tolerance, rng, time_limit=seconds)
    return with_gap(found, known)


def with_gap(found: Spectrum, known: SpectralGap) -> Spectrum:
    """The eigenvalues of a matrix of a law, with the gap of the law."""
    return replace(
        found, gap=known.value, gap_errors=discretisation_only(np.array([known.error])),
        slem=max(1.0 - known.value, found.slem), verdict=known.verdict, evidence=known.evidence,
    )  # fmt: skip


def _both_signs(half: Spectrum, k: int) -> Spectrum:
    """The spectrum of K, spectrum(P~) x {+1, -1} because psi -> pi - psi has both eigenvalues, with the gap of P~."""
    index = np.tile(np.arange(len(half.values)), 2)
    values = np.concatenate([half.values, -half.values])
    order = np.argsort(-np.abs(values), kind="stable")[:k]
    order = order[np.argsort(-values[order], kind="stable")]
    return replace(half.at(index[order]), values=frozen(values[order]))
