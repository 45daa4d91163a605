"""The gap from Galerkin matrices of increasing size, until it is sufficiently accurate."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...core.estimates import with_error
from ...core.long_runs import progress_bar
from ...kernels import Basis, Law, Legendre, discretise
from ..eigenvalues.spectra import Spectrum, matrix_spectrum
from ..essential.edge import EssentialEdge

# Number of eigenvalues in the spectrum of a gap.
EIGENVALUES = 4
DEGREES = (12, 24, 48, 96)
FIRST_SAMPLES = 2**17
# Fraction of the time limit for rays; the rest is for the enclosures that are tried before.
RAYS_FRACTION = 0.5
# Nominal time of a ray, and of the product of two basis functions at a ray, in seconds.
RAY_TIME, PRODUCT_TIME = 1e-6, 4e-10
# Limits at an edge of the essential spectrum, where the edge itself is the result and more rays do not help.
SAMPLES_AT_EDGE, DEGREE_AT_EDGE, TOLERANCE_AT_EDGE = 2**19, 24, 1e-4
# Fraction of the tolerance for the error of a matrix.
MATRIX_FRACTION = 0.1
FEWEST_LEVELS = 3
# For convergence, two successive refinements must each reduce the change of the gap by this factor. At an essential
# edge the change decreases by less, like a power of 1/log(n).
SHRINKAGE = 2.0
# Changes whose ratio is above this are not extrapolated.
STALLED = 0.6
# A change below this fraction of the gap is negligible.
NEGLIGIBLE = 1e-3
# Rounding of a gap; smaller changes are noise.
ROUNDING_FLOOR = 1e-12
# The composition of the error of a refinement.
HOW = "change by the last refinement + algebraic + matrix + 1.96 x sampling error"


@dataclass(frozen=True)
class Refinement:
    """Spectra on successively larger bases.

    Attributes
    ----------
    levels : tuple of Spectrum
    converges : bool
        Whether the changes of the gap decrease.
    evidence : tuple of str
        One line per level.
    """

    levels: tuple[Spectrum, ...]
    converges: bool
    evidence: tuple[str, ...]

    @property
    def finest(self) -> Spectrum:
        """The spectrum of the last level."""
        return self.levels[-1]

    @property
    def noise(self) -> float:
        """Algebraic, matrix and sampling error of the last level."""
        return _noise(self.finest)

    @property
    def error(self) -> float:
        """Change by the last refinement plus noise if the levels converge, else (or if less) the error of the gap."""
        if len(self.levels) < 2 or not self.converges:
            return self.finest.gap_error
        return min(abs(self.finest.gap - self.levels[-2].gap) + self.noise, self.finest.gap_error)

    def overshoot(self, edge: float) -> float:
        """Distance beyond an edge of the largest eigenvalue, extrapolated by a geometric series of its changes.

        0 if the last change is noise or the changes hardly decrease; towards a grazing edge they decrease like a power
        of 1/log(n). With a single change the ratio is taken as 1/2.
        """
        tops = 1.0 - np.array([level.gap for level in self.levels])
        change = np.diff(tops)
        if not change.size or change[-1] <= self.noise:
            return 0.0
        ratio = float(change[-1] / change[-2]) if change.size > 1 and change[-2] > 0.0 else 0.5
        if ratio >= STALLED:
            return 0.0
        return max(float(tops[-1] + change[-1] * ratio / (1.0 - ratio)) - edge, 0.0)


def refined(law: Law, tolerance: float, rng: np.random.Generator, seconds: float, edge: EssentialEdge) -> Refinement:
    """Refine until the changes decrease and the error is below the tolerance, or to the largest basis.

    The levels end with the one of least error, for a larger basis may have more noise.
    """
    with progress_bar(None, "step", "gap") as bar:
        return _refined(law, tolerance, rng, seconds, edge, bar)


def _refined(
    law: Law, tolerance: float, rng: np.random.Generator, seconds: float, edge: EssentialEdge, bar: Any
) -> Refinement:
    """The refinement, whose last error the bar shows."""
    levels: list[Spectrum] = []
    evidence: list[str] = []
    steps, best = Refinement((), False, ()), None
    near_edge = edge.low > NEGLIGIBLE
    for basis, samples in _steps(RAYS_FRACTION * seconds):
        wanted = max(MATRIX_FRACTION * tolerance, TOLERANCE_AT_EDGE if near_edge else 0.0)
        matrix = discretise(law, basis, tolerance=wanted, samples=samples, rng=rng)
        found = matrix_spectrum(matrix, EIGENVALUES, margin=1.0)
        levels.append(found)
        evidence.append(f"{basis!r}: gap {with_error(found.gap, found.gap_error)} ({matrix.method})")
        steps = Refinement(tuple(levels), _converges(levels, tolerance), tuple(evidence))
        bar.describe(f"error {steps.error:.1g}, asked for {tolerance:.1g}")
        bar.update()
        if steps.converges and (best is None or steps.error < best.error):
            best = steps
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
    return best or steps


def _steps(seconds: float) -> Iterator[tuple[Basis, int]]:
    """Pairs of a basis and a number of rays, as many as some seconds allow."""
    samples = FIRST_SAMPLES
    for degree in DEGREES:
        of_ray = RAY_TIME + PRODUCT_TIME * degree**2
        # a power of two, as Sobol sequences need
        most = 2 ** math.floor(math.log2(max(seconds / of_ray, FIRST_SAMPLES)))
        yield Legendre(degree), min(samples, most)
        seconds -= min(samples, most) * of_ray
        samples = 4 * min(samples, most)


def _noise(level: Spectrum) -> float:
    return float(
        level.gap_errors.algebraic[0] + level.matrix_error + level.gap_errors.quantile * level.gap_errors.sampling[0]
    )


def _converges(levels: list[Spectrum], tolerance: float) -> bool:
    """Whether each of the last two refinements reduced the change by `SHRINKAGE`, or made a negligible change.

    A change is negligible within the noise, or below the tolerance and the fraction `NEGLIGIBLE` of the gap.
    """
    if len(levels) < FEWEST_LEVELS:
        return False
    gaps = np.array([level.gap for level in levels])
    noise = np.array([_noise(level) + ROUNDING_FLOOR for level in levels])
    change = np.abs(np.diff(gaps))
    small = np.minimum(tolerance, NEGLIGIBLE * np.abs(gaps[2:]))
    settled = (change[1:] * SHRINKAGE <= change[:-1]) | (change[1:] <= np.maximum(noise[1:-1] + noise[2:], small))
    return bool(settled[-2:].all())
