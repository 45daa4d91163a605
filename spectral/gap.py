"""The spectral gap of a law: refined until its error meets the tolerance, with a verdict."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..checks import positive_number
from ..estimates import Estimate
from ..kernels import Bins, BranchLaw, KernelMatrix, Law, Legendre, MatrixLaw, SpecularFrame, WallLaw, discretise
from .eigenvalues import NORMAL_95, Spectrum, spectrum

Verdict = Literal["isolated", "essential edge", "no gap", "undecided"]

# Eigenvalues that a gap carries along in its spectrum.
SHOWN_VALUES = 4
FIRST_DEGREE = 12
LARGEST_DEGREE = 96
SAMPLED_DEGREE = 48
FIRST_SAMPLES = 2**17
LARGEST_SAMPLES = 2**22
FEWEST_LEVELS = 3
# A gap of fewer errors than this is not told from zero.
SIGNIFICANCE = 10.0
# Two refinements in a row must each shrink the change of the eigenvalue by this factor before it is called isolated:
# at an essential edge the change falls only like a power of 1/log(n), by less than this a doubling.
ISOLATED_SHRINKAGE = 2.0
# At an essential edge the change by a doubling stays above a hundredth of the gap for every basis in reach.
NEGLIGIBLE_GAP = 1e-3
# Changes below this many rounding errors say nothing about convergence.
ROUNDING_FLOOR = 1e-12


@dataclass(frozen=True)
class SpectralGap(Estimate):
    """1 - sup of the spectrum off the constants, with its error and a verdict.

    Attributes
    ----------
    verdict : {"isolated", "essential edge", "no gap", "undecided"}
        Whether the gap ends at an isolated eigenvalue, at an edge of the essential spectrum, is zero, or cannot be
        told from the refinements made.
    evidence : tuple of str
        What the verdict rests on, line by line.
    convention : {"paper", "specular"}
        The gap that the literature quotes is that of the specular convention (``law.in_specular_frame()``).
    spectrum : Spectrum or None
        The finest spectrum that was computed.
    """

    verdict: Verdict
    evidence: tuple[str, ...]
    convention: str
    spectrum: Spectrum | None = None

    def __str__(self) -> str:
        return f"{super().__str__()}, {self.verdict}, {self.convention} convention"


def spectral_gap(
    law: Law | KernelMatrix, tolerance: float = 1e-6, rng: np.random.Generator | None = None
) -> SpectralGap:
    """The gap 1 - sup(spectrum off the constants) of a reversible law.

    Parameters
    ----------
    law : Law or KernelMatrix
        In the convention that it carries; a matrix is taken as it is.
    tolerance : float
        The basis grows, and the number of rays with it, until the reported error is below this or the largest basis
        and number of rays are reached; the error says which.
    rng : numpy.random.Generator, optional
        For laws that are traced; ``np.random.default_rng(0)`` by default, so that results repeat.

    Returns
    -------
    SpectralGap

    Notes
    -----
    Laws made of isometries (polygonal walls, specular, retroreflection) have no gap: 1 is in the essential spectrum,
    and whatever a grid shows is an artefact of the grid. This is answered by theorem, without computing.

    Examples
    --------
    >>> from asperity import kernels as ker, spectral as spec
    >>> gap = spec.spectral_gap(ker.henyey_greenstein(0.5), tolerance=1e-9)
    >>> round(float(gap), 9), gap.verdict
    (0.5, 'isolated')
    >>> spec.spectral_gap(ker.specular()).verdict
    'no gap'
    """
    positive_number("tolerance", tolerance)
    if isinstance(law, KernelMatrix):
        found = spectrum(law, k=SHOWN_VALUES)
        method = _method(found, "algebraic + two-grid + 1.96 x sampling error")
        evidence = ("one matrix: its basis was not refined",)
        return SpectralGap(
            found.gap, found.gap_error, "estimate", method, "undecided", evidence, found.convention, found
        )
    if made_of_isometries(law):
        reason = (
            "the law is a mixture of isometries theta' = +-theta + const: 1 belongs to its essential spectrum, "
            "so no L^2 gap exists, and a gap on a grid is an artefact of the grid"
        )
        return SpectralGap(0.0, 0.0, "bound", "structure of the law", "no gap", (reason,), law.frame)
    if isinstance(law, MatrixLaw):
        return _of_finite_rank(law)
    return _refined(law, tolerance, rng or np.random.default_rng(0))


def _of_finite_rank(law: MatrixLaw) -> SpectralGap:
    """A law that is constant on bins: its own bins hold every eigenvalue but 0, which has infinite multiplicity."""
    found = spectrum(discretise(law, Bins(law.edges)), k=SHOWN_VALUES)
    error = float(found.gap_errors.algebraic[0])
    reason = f"the law is constant on {law.edges.size - 1} bins: beyond these its spectrum is 0"
    method = _method(found, "algebraic error; the basis is exact")
    return SpectralGap(min(found.gap, 1.0), error, "bound", method, "isolated", (reason,), found.convention, found)


def made_of_isometries(law: Law) -> bool:
    """Whether the law is known to be a mixture of finitely many isometries for almost every angle."""
    if isinstance(law, SpecularFrame):
        return made_of_isometries(law.law)
    if isinstance(law, WallLaw):
        return law.wall.is_polygonal
    return isinstance(law, BranchLaw)


def _refined(law: Law, tolerance: float, rng: np.random.Generator) -> SpectralGap:
    levels: list[Spectrum] = []
    evidence: list[str] = []
    for matrix in _matrices(law, tolerance, rng):
        found = spectrum(matrix, k=SHOWN_VALUES)
        levels.append(found)
        evidence.append(f"{matrix.basis!r}: gap {found.gap:.12g} +- {found.gap_error:.2g} ({matrix.method})")
        enough = found.gap_error <= tolerance and len(levels) >= FEWEST_LEVELS
        if enough and _verdict(levels, tolerance) == "isolated":
            break
    return _as_gap(levels[-1], _verdict(levels, tolerance), tuple(evidence))


def _matrices(law: Law, tolerance: float, rng: np.random.Generator) -> Iterator[KernelMatrix]:
    """Matrices of growing size; sampled ones keep the basis and grow in rays once the basis is large enough."""
    samples = FIRST_SAMPLES
    degree = FIRST_DEGREE
    while True:
        matrix = discretise(law, Legendre(degree), tolerance=0.1 * tolerance, samples=samples, rng=rng)
        yield matrix
        if matrix.samples:
            if degree >= SAMPLED_DEGREE and samples >= LARGEST_SAMPLES:
                return
            samples = min(4 * samples, LARGEST_SAMPLES)
            degree = min(2 * degree, SAMPLED_DEGREE)
        else:
            if degree >= LARGEST_DEGREE:
                return
            degree *= 2


def _verdict(levels: list[Spectrum], tolerance: float) -> Verdict:
    """Isolated if each of the last two refinements shrank the change, or left one that is negligible.

    Negligible is what sampling explains, or what is below the tolerance and a small share of the gap.
    """
    gaps = np.array([level.gap for level in levels])
    noise = np.array([NORMAL_95 * level.gap_errors.sampling[0] + ROUNDING_FLOOR for level in levels])
    change = np.abs(np.diff(gaps))
    small = np.minimum(tolerance, NEGLIGIBLE_GAP * gaps[2:])
    settled = (change[1:] * ISOLATED_SHRINKAGE <= change[:-1]) | (
        change[1:] <= np.maximum(noise[1:-1] + noise[2:], small)
    )
    known = levels[-1].gap > SIGNIFICANCE * levels[-1].gap_error
    return "isolated" if len(settled) and settled[-2:].all() and known else "undecided"


def _as_gap(found: Spectrum, verdict: Verdict, evidence: tuple[str, ...]) -> SpectralGap:
    error, how = found.gap_error, "algebraic + two-grid + 1.96 x sampling error"
    if verdict == "undecided":
        # two grids say nothing where refinement does not converge; the gap of a Galerkin matrix is never too small
        error, how = max(error, abs(found.gap)), "not converged: an upper bound but for its noise"
    return SpectralGap(found.gap, error, "estimate", _method(found, how), verdict, evidence, found.convention, found)


def _method(found: Spectrum, how: str) -> str:
    return f"{found.basis!r}, {found.method}; {how}"
