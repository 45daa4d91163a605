"""Galerkin matrices of growing size, until the gap of one of them is accurate enough."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...kernels import Basis, CircularArcLaw, KernelMatrix, Law, Legendre, Panels, SpecularFrame, discretise
from ...kernels.bases.mirror import is_mirror_symmetric
from ..eigenvalues.spectra import Spectrum, matrix_spectrum
from ..essential.edge import EssentialEdge

# Eigenvalues that a gap carries along in its spectrum.
EIGENVALUES = 4
DEGREES = (12, 24, 48, 96)
# Panels for one circular arc, whose matrices need no sampling: degree, and the smallest panel at grazing.
ARC_PANELS = ((1, 1e-1), (2, 1e-2), (3, 1e-3), (4, 1e-3), (6, 1e-4))
# Up to this half angle the eigenfunctions of arcs are close enough to Legendre polynomials.
SHALLOW = 0.5
FIRST_SAMPLES, LARGEST_SAMPLES = 2**17, 2**22
# At an edge of the essential spectrum more rays show nothing: the edge is known by itself.
SAMPLES_AT_EDGE, DEGREE_AT_EDGE, TOLERANCE_AT_EDGE = 2**19, 24, 1e-4
# Quadratures with an error above this many standard errors of as many rays are given up.
POOR = 4.0
# Fraction of the tolerance that a matrix may spend.
MATRIX_FRACTION = 0.1
FEWEST_LEVELS = 3
# Two refinements in a row must each shrink the change of the eigenvalue by this factor before it converges: at an
# essential edge the change falls only like a power of 1/log(n), by less than this a doubling.
SHRINKAGE = 2.0
# Changes that shrink by less than this do not tell where they lead.
STALLED = 0.6
# A change below this fraction of the gap does not matter, whatever it does.
NEGLIGIBLE = 1e-3
# Changes below this many rounding errors say nothing about convergence.
ROUNDING_FLOOR = 1e-12


@dataclass(frozen=True)
class Refinement:
    """Spectra on growing bases.

    Attributes
    ----------
    levels : tuple of Spectrum
    converges : bool
        Whether the changes of the gap shrink.
    evidence : tuple of str
        One line a level.
    """

    levels: tuple[Spectrum, ...]
    converges: bool
    evidence: tuple[str, ...]

    @property
    def chosen(self) -> int:
        """The last level, or the one before if the noise of the last is larger than what it changed."""
        if len(self.levels) > FEWEST_LEVELS:
            before, last = self.levels[-2:]
            if _noise(last) > abs(last.gap - before.gap) + _noise(before):
                return len(self.levels) - 2
        return len(self.levels) - 1

    @property
    def finest(self) -> Spectrum:
        """The spectrum of the chosen level."""
        return self.levels[self.chosen]

    @property
    def noise(self) -> float:
        """What is not discretisation in the error of the last level: sampling and the error of the matrix."""
        return _noise(self.finest)

    @property
    def error(self) -> float:
        """Change by the last refinement, if the changes shrink, else the two-grid error; plus the noise."""
        if len(self.levels) < 2 or not self.converges:
            return self.finest.gap_error
        change = abs(self.levels[self.chosen].gap - self.levels[self.chosen - 1].gap)
        return min(change + self.noise, self.finest.gap_error)

    def overshoot(self, edge: float) -> float:
        """How far beyond an edge the largest eigenvalue would come if its changes went on shrinking as they do.

        0 where the last one is noise, and where they hardly shrink: towards the edge at grazing they fall like a power
        of 1/log(n). After one change the next ones are taken to halve.
        """
        tops = 1.0 - np.array([level.gap for level in self.levels])
        change = np.diff(tops)
        if not change.size or change[-1] <= self.noise:
            return 0.0
        ratio = float(change[-1] / change[-2]) if change.size > 1 and change[-2] > 0.0 else 0.5
        if ratio >= STALLED:
            return 0.0
        return max(float(tops[-1] + change[-1] * ratio / (1.0 - ratio)) - edge, 0.0)

    @property
    def how(self) -> str:
        """What the error is made of."""
        return "change by the last refinement + algebraic + matrix + 1.96 x sampling error"


class SharedMatrices:
    """Matrices of one law, made when they are first asked for: both conventions of a mirror-symmetric law use them."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self._made: dict[tuple[Basis, int, float], KernelMatrix] = {}
        self._by_rays = False

    def __call__(self, law: Law, basis: Basis, samples: int, tolerance: float) -> KernelMatrix:
        """The matrix of a law, by a flip where it is the other convention's."""
        if isinstance(law, SpecularFrame) and law.reversible and is_mirror_symmetric(basis):
            return self(law.law, basis, samples, tolerance).in_specular_frame()
        key = (basis, samples, tolerance)
        if key not in self._made:
            self._made[key] = self._better(law, basis, samples, tolerance)
        return self._made[key]

    def _better(self, law: Law, basis: Basis, samples: int, tolerance: float) -> KernelMatrix:
        """By quadrature, unless its error is beyond the tolerance and beyond what an eigenvalue has from rays.

        The Frobenius error bounds that of an eigenvalue; from n rays this is about n^(-1/2) whatever the basis.
        """
        if not self._by_rays:
            found = discretise(law, basis, tolerance=tolerance, samples=samples, rng=self.rng)
            poor = float(found.error) > max(tolerance, POOR / np.sqrt(samples))
            if found.samples or not poor or not law.reversible:
                return found
            # it would be no better on larger bases
            self._by_rays = True
        return discretise(law, basis, method="monte-carlo", tolerance=tolerance, samples=samples, rng=self.rng)


def refined(law: Law, tolerance: float, matrices: SharedMatrices, edge: EssentialEdge) -> Refinement:
    """Refine until the changes shrink and the error is below the tolerance, or the means are spent."""
    levels: list[Spectrum] = []
    evidence: list[str] = []
    steps = Refinement((), False, ())
    near_edge = edge.low > NEGLIGIBLE
    for basis, samples in _steps(law):
        wanted = max(MATRIX_FRACTION * tolerance, TOLERANCE_AT_EDGE if near_edge else 0.0)
        matrix = matrices(law, basis, samples, wanted)
        found = matrix_spectrum(matrix, EIGENVALUES)
        levels.append(found)
        evidence.append(f"{basis!r}: gap {found.gap:.12g} +- {found.gap_error:.2g} ({matrix.method})")
        steps = Refinement(tuple(levels), _converges(levels, tolerance), tuple(evidence))
        near_edge = near_edge and 1.0 - found.gap - found.gap_error < edge.high
        if len(levels) >= FEWEST_LEVELS and steps.converges and steps.error <= tolerance:
            break
        if (
            near_edge
            and len(levels) > 1
            and steps.overshoot(edge.high) <= max(tolerance, edge.error)
            and (basis.size >= DEGREE_AT_EDGE and (samples >= SAMPLES_AT_EDGE or not matrix.samples))
        ):
            break
        if len(levels) > FEWEST_LEVELS and steps.finest is not found:
            # a larger basis would only have more noise
            break
    return steps


def _steps(law: Law) -> Iterator[tuple[Basis, int]]:
    """Bases and numbers of rays; for sampled laws the basis stops growing before the rays do."""
    inner = law.law if isinstance(law, SpecularFrame) else law
    inner = inner.closed_form or inner
    if isinstance(inner, CircularArcLaw) and inner.half_angle > SHALLOW:
        for degree, smallest in ARC_PANELS:
            yield Panels.for_arc(inner.half_angle, degree, smallest), FIRST_SAMPLES
        return
    samples = FIRST_SAMPLES
    for degree in DEGREES:
        yield Legendre(degree), samples
        samples = min(4 * samples, LARGEST_SAMPLES)


def _noise(level: Spectrum) -> float:
    return float(
        level.gap_errors.algebraic[0] + level.matrix_error + level.gap_errors.quantile * level.gap_errors.sampling[0]
    )


def _converges(levels: list[Spectrum], tolerance: float) -> bool:
    """Whether each of the last two refinements shrank the change, or left one that is negligible.

    Negligible is what noise explains, or what is below the tolerance and a small fraction of the gap.
    """
    if len(levels) < FEWEST_LEVELS:
        return False
    gaps = np.array([level.gap for level in levels])
    noise = np.array([_noise(level) + ROUNDING_FLOOR for level in levels])
    change = np.abs(np.diff(gaps))
    small = np.minimum(tolerance, NEGLIGIBLE * np.abs(gaps[2:]))
    settled = (change[1:] * SHRINKAGE <= change[:-1]) | (change[1:] <= np.maximum(noise[1:-1] + noise[2:], small))
    return bool(settled[-2:].all())
