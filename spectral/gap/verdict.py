"""A spectral gap with its error, its verdict and the evidence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...core.estimates import Estimate, rounded
from ..eigenvalues.spectra import EIGENVALUE, Spectrum, Verdict
from ..essential.edge import EssentialEdge
from ..plotting import draw_eigenvalues

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class SpectralGap(Estimate):
    """1 - sup of the spectrum off the constants, with its error and a verdict.

    Attributes
    ----------
    verdict : {"isolated", "essential edge", "no gap", "undecided"}
        Whether the gap ends at an isolated eigenvalue, at an edge of the essential spectrum, is zero, or cannot be
        told from the refinements made. Of a law P J that is not self-adjoint, whose value is 1 - the norm on functions
        of mean 0, the same of its singular values, the moduli in the spectrum of P.
    evidence : tuple of str
        What the verdict rests on, line by line.
    convention : {"paper", "specular"}
        The gap that the literature quotes is that of the specular convention (``law.in_specular_frame()``).
    spectrum : Spectrum or None
        The finest spectrum that was computed.
    self_adjoint : bool
        False of a law P J that is not known to be self-adjoint though P is: see ``verdict``.
    """

    verdict: Verdict
    evidence: tuple[str, ...]
    convention: str
    spectrum: Spectrum | None = None
    self_adjoint: bool = True

    def cut_at_zero(self) -> SpectralGap:
        """The part of the interval at or above 0: the norm of a law is 1, so that no gap is negative."""
        low, high = self.value - self.error, max(self.value + self.error, 0.0)
        if low >= 0.0 or high == np.inf:
            return self
        cut = f"a gap is never negative: the interval {self.value:.6g} +- {self.error:.2g} is cut at 0"
        return replace(self, value=0.5 * high, error=0.5 * high, evidence=(*self.evidence, cut))

    def __str__(self) -> str:
        words = "" if self.self_adjoint else ", not known to be self-adjoint"
        return f"{super().__str__()}, {self.verdict}, {self.convention} convention{words}"


def made_from(found: Spectrum, how: str) -> str:
    """The method of a gap that was read off a matrix."""
    return f"{found.basis!r}, {found.method}; {how}"


def isolated(
    found: Spectrum, error: float, how: str, edge: EssentialEdge, convention: str, evidence: tuple[str, ...] = ()
) -> SpectralGap | None:
    """The gap of a matrix as that of the law; None unless its interval lies between the essential spectrum and 1."""
    top = 1.0 - found.gap
    if top - error <= edge.high or found.gap <= error:
        return None
    outside = f"largest eigenvalue {top:.10g} beyond the essential spectrum, which reaches {edge.high:.6g}"
    reasons = (*edge.reasons, *evidence, outside)
    return SpectralGap(found.gap, error, "estimate", made_from(found, how), "isolated", reasons, convention, found)


def draw_spectrum(found: Spectrum, gap: SpectralGap, ax: Axes | None = None) -> Axes:
    """Draw eigenvalues of a matrix with what is known of the gap of the law behind it.

    The gap is shaded and named with its verdict; where the law has no gap nothing is shaded.
    """
    gapless = gap.verdict == "no gap"
    label = f"eigenvalue of the matrix in {found.basis!r}" if gapless else EIGENVALUE
    shaded = None if gapless else (gap.value, f"gap {rounded(gap).replace('+-', '±')} ({gap.verdict})")
    return draw_eigenvalues(found.values, found.errors.total(), found.convention, label, shaded, ax)
