"""A spectral gap with its error, its verdict and its evidence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...core.estimates import Estimate, with_error
from ..eigenvalues.spectra import EIGENVALUE, Spectrum, Verdict, draw_eigenvalues
from ..essential.edge import EssentialEdge

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
class SpectralGap(Estimate):
    """The gap 1 - sup(spectrum off the constants), with its error and a verdict.

    Attributes
    ----------
    verdict : {"isolated", "essential edge", "no gap", "undecided"}
        Whether the gap ends at an isolated eigenvalue, ends at an edge of the essential spectrum, is zero, or is not
        decided. For a law P J that is not self-adjoint, the value is 1 minus the norm on functions of mean 0, and the
        verdict refers to the singular values of P J, the moduli in the spectrum of P.
    evidence : tuple of str
        The evidence for the verdict, one statement per entry.
    convention : {"paper", "specular"}
        The literature quotes the gap in the specular convention (``law.in_specular_frame()``).
    spectrum : Spectrum or None
        The finest spectrum computed.
    self_adjoint : bool
        False for a law P J that is not known to be self-adjoint although P is.
    """

    verdict: Verdict
    evidence: tuple[str, ...]
    convention: str
    spectrum: Spectrum | None = None
    self_adjoint: bool = True
    _more = ".method, .evidence, .spectrum"

    def cut_at_zero(self) -> SpectralGap:
        """The gap with its interval cut at 0, because the norm of a law is 1 and no gap is negative.

        An eigenvalue whose interval contains 1 is not isolated from it.
        """
        low, high = self.value - self.error, max(self.value + self.error, 0.0)
        if low >= 0.0 or high == np.inf:
            return self
        cut = f"a gap is never negative: the interval {with_error(self.value, self.error)} is cut at 0"
        verdict: Verdict = "undecided" if self.verdict == "isolated" else self.verdict
        return replace(self, value=0.5 * high, error=0.5 * high, verdict=verdict, evidence=(*self.evidence, cut))


def made_from(found: Spectrum, how: str) -> str:
    """The method, in words, of a gap computed from a matrix."""
    return f"{found.basis!r}, {found.method}; {how}"


def isolated(
    found: Spectrum, error: float, how: str, edge: EssentialEdge, convention: str, evidence: tuple[str, ...] = ()
) -> SpectralGap | None:
    """The gap of a matrix as the gap of the law, or None unless the largest eigenvalue is isolated within its error."""
    top = 1.0 - found.gap
    if top - error <= edge.high or found.gap <= error:
        return None
    outside = f"largest eigenvalue {top:.10g} beyond the essential spectrum, which reaches {edge.high:.6g}"
    reasons = (*edge.reasons, *evidence, outside)
    return SpectralGap(found.gap, error, "estimate", made_from(found, how), "isolated", reasons, convention, found)


def gap_between(
    low: float, high: float, edge: EssentialEdge, how: str, evidence: tuple[str, ...], convention: str
) -> SpectralGap:
    """The gap of a law with an edge of the essential spectrum whose largest eigenvalue lies between two numbers."""
    verdict: Verdict = "isolated" if low > edge.high else "essential edge" if high <= edge.high < 1.0 else "undecided"
    low, high = max(low, edge.low), max(high, edge.high)
    value, error = 1.0 - 0.5 * (low + high), 0.5 * (high - low)
    return SpectralGap(value, error, "estimate", how, verdict, (*evidence, *edge.reasons), convention)


def draw_spectrum(found: Spectrum, gap: SpectralGap, ax: Axes | None = None) -> Axes:
    """Draw eigenvalues of a matrix and the gap of its law, which is shaded and labelled with its verdict.

    Nothing is shaded if the law has no gap.
    """
    gapless = gap.verdict == "no gap"
    label = f"eigenvalue of the matrix in {found.basis!r}" if gapless else EIGENVALUE
    shaded = None if gapless else (gap.value, f"gap {gap} ({gap.verdict})")
    return draw_eigenvalues(found.values, found.errors.total(), found.convention, label, shaded, ax)
