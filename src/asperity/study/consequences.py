"""The consequences of a wall's gap that a study reports: relaxation, diffusion in a channel, flatness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..core.errors import AsperityError
from ..core.estimates import Estimate, Summary, estimate_as_dict, finite
from ..geometry import Wall
from ..kernels import Law
from ..spectral import SpectralGap, Spectrum, mean_squared_slope
from ..spectral.consequences.diffusion import Diffusivity, logarithmic_slope
from ..spectral.consequences.mixing import relaxation_time, slem_from_gap


@dataclass(frozen=True, repr=False)
class Consequences(Summary):
    """What a study derives from the law and its gaps.

    Attributes
    ----------
    slem : Estimate or None
        The largest modulus in the spectrum off the constants; None where the gaps in both conventions are not known.
    relaxation_time : Estimate or None
        -1/ln(slem) in steps; its error is ``inf`` where slem may be 1.
    diffusion : Diffusivity or None
        The slope of L^2/tau against ln L for a long channel of half-width 1 and speed 1, tau the mean time to leave
        |x| < L, the upper wall the mirror image of the lower.
    flatness : float
        The mean squared slope h; ``inf`` for walls with vertical pieces or overhangs.
    refusal : str
        Why there is no diffusivity, or empty.
    """

    slem: Estimate | None
    relaxation_time: Estimate | None
    diffusion: Diffusivity | None
    flatness: float
    refusal: str = ""

    @property
    def without_gap(self) -> bool:
        """Whether it is certain that slem is 1."""
        return self.slem is not None and self.slem.value - self.slem.error >= 1.0

    def as_dict(self) -> dict[str, Any]:
        """Plain values; what is not known or infinite is None."""
        found = self.diffusion
        return {
            "slem": self.slem and estimate_as_dict(self.slem),
            "relaxation_time": self.relaxation_time and estimate_as_dict(self.relaxation_time),
            "diffusivity": found and {
                **estimate_as_dict(found), "eta": found.eta, "eta_error": finite(found.eta_error), "zeta": found.zeta,
                "zeta_error": finite(found.zeta_error), "arrangement": found.arrangement,
                "onset": finite(found.onset),
            },
            "mean_squared_slope": finite(self.flatness),
        }  # fmt: skip


def consequences_of(
    wall: Wall, law: Law, gap: SpectralGap | None, specular_gap: SpectralGap | None, found: Spectrum | None
) -> Consequences:
    """Derive what follows; a diffusivity that is infinite or out of reach is None, with the reason."""
    modulus_gap, diffusion, refusal = _modulus_gap(gap, specular_gap, found), None, ""
    slem, time = (modulus_gap and derived(modulus_gap) for derived in (slem_from_gap, relaxation_time))
    try:
        diffusion = logarithmic_slope(law, 1.0, 1.0, "mirror")
    except AsperityError as reason:
        refusal = str(reason)
    return Consequences(slem, time, diffusion, mean_squared_slope(wall), refusal)


def _modulus_gap(gap: SpectralGap | None, specular_gap: SpectralGap | None, found: Spectrum | None) -> Estimate | None:
    """1 - slem. The gaps see the upper end of the spectrum, and in the other convention minus the odd functions' lower
    end; the lower end on even functions is that of the spectrum that was computed.
    """
    if gap is None or specular_gap is None or found is None:
        return None
    if not specular_gap.self_adjoint:
        return specular_gap
    nearer = min(gap, specular_gap, key=float)
    lowest = int(found.values.argmin())
    if -found.values[lowest] > 1.0 - nearer.value + nearer.error:
        error = float(found.errors.total()[lowest])
        return Estimate(1.0 + float(found.values[lowest]), error, "estimate", f"least eigenvalue in {found.basis!r}")
    return Estimate(nearer.value, nearer.error, nearer.kind, f"gap in the {nearer.convention} convention")
