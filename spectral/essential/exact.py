"""The exact spectrum of laws composed of ideal ones (specular reflection, retroreflection, Lambertian reflection)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ...core.rounding import EPS
from ...kernels import Combination, Law, SpecularFrame
from ...kernels.laws.ideal import LambertianLaw
from ...kernels.laws.law import IsometryLaw
from ...kernels.laws.structure import Rules, fold


@dataclass(frozen=True)
class IdealSpectrum:
    """The two eigenvalues, off the constants, of a law composed of ideal ones.

    Attributes
    ----------
    even, odd : float
        The eigenvalues on even and on odd functions of cos(theta).
    rounding : float
        Bound of the rounding of both.
    """

    even: float
    odd: float
    rounding: float = 0.0

    @property
    def top(self) -> float:
        """The larger eigenvalue."""
        return max(self.even, self.odd)


def ideal_spectrum(law: Law) -> IdealSpectrum | None:
    """The two eigenvalues off the constants of a law composed of ideal ones; None for other laws.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> found = ideal_spectrum(ker.maxwell(0.25))
    >>> found.even, found.odd
    (0.75, -0.75)
    """
    return fold(law, Rules(_leaf, _mixture, _chain, _in_other_frame))


def _leaf(law: Law) -> IdealSpectrum | None:
    if isinstance(law, LambertianLaw):
        return IdealSpectrum(0.0, 0.0)
    if isinstance(law, IsometryLaw):
        return IdealSpectrum(1.0, 1.0 if law.retro else -1.0)
    return None


def _mixture(terms: Sequence[tuple[float, IdealSpectrum | None]]) -> IdealSpectrum | None:
    even, odd, rounding = 0.0, 0.0, 0.0
    for weight, part in terms:
        if part is None:
            return None
        even, odd = even + weight * part.even, odd + weight * part.odd
        rounding += weight * part.rounding + EPS
    return IdealSpectrum(even, odd, rounding)


def _chain(parts: Sequence[IdealSpectrum | None]) -> IdealSpectrum | None:
    even, odd, rounding = 1.0, 1.0, 0.0
    for part in parts:
        if part is None:
            return None
        even, odd = even * part.even, odd * part.odd
        rounding += part.rounding + EPS
    return IdealSpectrum(even, odd, rounding)


def _in_other_frame(part: IdealSpectrum | None) -> IdealSpectrum | None:
    return None if part is None else IdealSpectrum(part.even, -part.odd, part.rounding)


def without_identity(law: Law) -> tuple[float, Law]:
    """The weight 1 - a and the law R in P = a 1 + (1 - a) R, if P is a sum with an identity term; else 1 and P.

    The identity is retroreflection in the paper's convention and specular reflection in the other.

    Examples
    --------
    >>> from asperity import kernels as ker
    >>> without_identity(0.75 * ker.retroreflection() + 0.25 * ker.henyey_greenstein(0.5))
    (0.25, henyey_greenstein(0.5))
    """
    in_frame = isinstance(law, SpecularFrame)
    inner = law.law if isinstance(law, SpecularFrame) else law
    inner = inner.closed_form or inner
    if not isinstance(inner, Combination):
        return 1.0, law
    terms = [(weight, SpecularFrame.of(term) if in_frame else term) for weight, term in inner.terms_checked()]
    rest = [(weight, term) for weight, term in terms if weight > 0.0 and not _keeps_angles(term)]
    if not rest or len(rest) == sum(weight > 0.0 for weight, _ in terms):
        return 1.0, law
    fraction = math.fsum(weight for weight, _ in rest)
    return fraction, rest[0][1] if len(rest) == 1 else Combination(
        tuple((weight / fraction, term) for weight, term in rest)
    )


def _keeps_angles(law: Law) -> bool:
    inner = law.law if isinstance(law, SpecularFrame) else law
    return isinstance(inner, IsometryLaw) and inner.retro == (law.frame == "paper")
